"""Turntables: the frames and their cameras, the files as other readers see them, and what an interruption leaves."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageFilter

import clpeel
from clpeel.film import gif
from clpeel.film import turntable as module
from clpeel.film.kept import MARK, Kept, hidden_folder
from clpeel.film.recipe import recipe_of

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (96, 72)


@pytest.fixture
def scene() -> clpeel.Scene:
    """Four faces of different colours around the Y axis, half transparent, so that every view differs."""
    corners = [[1, -1, 0], [0, -1, 1], [-1, -1, 0], [0, -1, -1], [0.2, 1, 0.1]]
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    colors = [[230, 40, 40, 140], [40, 200, 60, 140], [40, 80, 230, 140], [240, 200, 40, 140]]
    return clpeel.Scene.from_arrays(corners, faces, face_colors=np.array(colors, np.uint8))


def frames_of(path: Path) -> list[NDArray[np.uint8]]:
    """The frames of a film as Pillow reads them, RGBA."""
    with Image.open(path) as film:
        found = []
        for k in range(getattr(film, "n_frames", 1)):
            film.seek(k)
            found.append(np.asarray(film.convert("RGBA")))
        return found


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# --- frames -----------------------------------------------------------------------------------------------------------


def test_frames_have_the_bits_of_render_with_the_cameras_of_an_orbit(scene: clpeel.Scene, tmp_path: Path) -> None:
    camera, size = clpeel.Camera.frame(scene, (-1, -0.5, -1), aspect=4 / 3), (128, 96)
    film = clpeel.turntable(scene, tmp_path / "%02d.png", camera, frames=5, size=size, axis=True)
    assert left_in(tmp_path) == ["01.png", "02.png", "03.png", "04.png", "05.png"]
    assert (film.frames, film.drawn, [Path(each).name for each in film.files]) == (5, 5, left_in(tmp_path))
    for k, name in enumerate(left_in(tmp_path)):
        turned = camera.azimuth(72 * k)
        want = clpeel.render(scene, turned, size).with_axis(turned).image
        assert (frames_of(tmp_path / name)[0] == want).all(), name


def test_a_default_camera_never_cuts_the_model(scene: clpeel.Scene, tmp_path: Path) -> None:
    """The model covers no pixel of any frame's border, wherever the film's camera is."""
    clpeel.turntable(scene, tmp_path / "#.png", "iso", frames=9, size=SIZE, background=None)
    for name in left_in(tmp_path):
        alpha = frames_of(tmp_path / name)[0][..., 3]
        assert alpha.any() and not (alpha[[0, -1]].any() or alpha[:, [0, -1]].any())


def test_options_are_those_of_render(scene: clpeel.Scene, tmp_path: Path) -> None:
    options: dict[str, Any] = {"technique": "depth-peeling", "passes": 1, "background": "white:black", "samples": 1}
    film = clpeel.turntable(scene, tmp_path / "a#.png", frames=1, size=SIZE, lighting="headlight", **options)
    want = clpeel.render(scene, size=SIZE, lighting="headlight", **options)
    assert (frames_of(tmp_path / "a1.png")[0] == want.image).all()
    assert len(film.notes) == 1 and "more layers than were drawn" in film.notes[0]


def test_notes_say_in_how_many_frames_they_are() -> None:
    notes = module.gathered([["blank", "7 pixels are off"], ["8,123 pixels are off"], ["9 pixels are off"]])
    assert notes == ("blank (in 1 of 3 frames)", "7 pixels are off")
    assert module.gathered([["map 1 is lost", "map 2 is lost"]] * 3) == ("map 1 is lost", "map 2 is lost")


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_gif_has_one_palette_and_the_exact_background(scene: clpeel.Scene, tmp_path: Path) -> None:
    clpeel.turntable(scene, tmp_path / "a.gif", frames=7, fps=30, size=SIZE, background="#c8ccd2")
    assert left_in(tmp_path) == ["a.gif"]
    data = (tmp_path / "a.gif").read_bytes()
    times, local = gif_frames(data)
    assert b"NETSCAPE2.0\x03\x01\x00\x00" in data, "it plays again and again"
    assert not any(local), "a frame has a palette of its own"
    assert len(times) == 7 and set(times) <= {3, 4} and sum(times) == round(7 / 30 * 100)
    for k, frame in enumerate(frames_of(tmp_path / "a.gif")):
        want = clpeel.render(scene, clpeel.Camera.frame(scene, aspect=4 / 3).azimuth(360 / 7 * k), SIZE).image
        off = np.abs(frame.astype(int) - want.astype(int)).max(axis=2)
        assert off[0, 0] == 0 and np.percentile(off, 99) <= 12


def test_each_pixel_of_a_gif_has_the_nearest_colour_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gif, "CHUNK", 100)
    pixels = np.random.default_rng(1).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    palette = gif.palette_of(lambda k: Image.fromarray(pixels[:10, :20]), 1)
    colors = np.array(palette.getpalette()).reshape(-1, 3)
    found = np.asarray(gif.in_palette(pixels, palette).convert("RGB")).astype(int)
    least = ((pixels[:, :, None].astype(int) - colors) ** 2).sum(axis=-1).min(axis=-1)
    assert (((pixels - found) ** 2).sum(axis=-1) == least).all()


def gif_frames(data: bytes) -> tuple[list[int], list[bool]]:
    """The hundredths of a second of each frame of a GIF, and whether it has a palette of its own (GIF89a, 17 to 23)."""
    times, local = [], []
    flags = data[10]
    at = 13 + (3 << (flags & 7) + 1 if flags & 0x80 else 0)
    while data[at] != 0x3B:
        if data[at] == 0x21:
            if data[at + 1] == 0xF9:
                times.append(int.from_bytes(data[at + 4 : at + 6], "little"))
            at += 2
        else:
            flags = data[at + 9]
            local.append(bool(flags & 0x80))
            at += 11 + (3 << (flags & 7) + 1 if flags & 0x80 else 0)
        while data[at]:
            at += data[at] + 1
        at += 1
    return times, local


def test_a_lossless_webp_keeps_bits_and_alpha(scene: clpeel.Scene, tmp_path: Path) -> None:
    clpeel.turntable(scene, tmp_path / "a.webp", frames=4, fps=25, size=SIZE, background=None, lossless=True)
    camera = clpeel.Camera.frame(scene, aspect=4 / 3)
    with Image.open(tmp_path / "a.webp") as film:
        assert film.info["loop"] == 0
        film.load()
        assert film.info["duration"] == 40
    frames = frames_of(tmp_path / "a.webp")
    assert len(frames) == 4 and left_in(tmp_path) == ["a.webp"]
    for k, frame in enumerate(frames):
        want = clpeel.render(scene, camera.azimuth(90 * k), SIZE, background=None).image
        seen = want[..., 3] > 0
        assert (frame[seen] == want[seen]).all() and not frame[~seen, 3].any()


def test_a_lossy_webp_leaves_no_specks_of_earlier_frames(model: Any, tmp_path: Path) -> None:
    """Far from the model, each frame is within a step or two of the background, where earlier frames were, too."""
    bunny = clpeel.load(model("bunny.ply"), color="orange", opacity=0.7)
    camera = clpeel.Camera.frame(bunny, aspect=4 / 3).zoom(1.3)
    clpeel.turntable(bunny, tmp_path / "a.webp", camera, frames=24, size=(400, 300), quality=80)
    first = clpeel.render(bunny, camera, (400, 300)).image.astype(int)
    for frame, each in zip(frames_of(tmp_path / "a.webp"), camera.orbit(24), strict=True):
        bare = clpeel.render(bunny, each, (400, 300)).image == first[0, 0]
        far = ~np.asarray(Image.fromarray(~bare.all(axis=2)).convert("L").filter(ImageFilter.MaxFilter(25)), bool)
        assert far.sum() > 30_000 and (np.abs(frame - first[0, 0])[far].max(axis=1) > 4).sum() <= 3


def test_quality_makes_a_webp_smaller(scene: clpeel.Scene, tmp_path: Path) -> None:
    for quality in (20, 95):
        clpeel.turntable(scene, tmp_path / f"{quality}.webp", frames=3, size=SIZE, quality=quality)
    assert (tmp_path / "20.webp").stat().st_size < (tmp_path / "95.webp").stat().st_size


@pytest.mark.skipif(find_spec("av") is None, reason="needs av")
def test_an_mp4_says_that_it_is_bt709_and_is(scene: clpeel.Scene, tmp_path: Path) -> None:
    """The planes are turned into colours by the formula of ITU-R BT.709, item 3.2 to 3.5, in the narrow range."""
    import av

    clpeel.turntable(scene, tmp_path / "a.mp4", frames=5, fps=24, size=(160, 120), quality=100, background="#c8ccd2")
    assert left_in(tmp_path) == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_bytes().find(b"moov") < (tmp_path / "a.mp4").read_bytes().find(b"mdat")
    camera = clpeel.Camera.frame(scene, aspect=4 / 3)
    with av.open(tmp_path / "a.mp4") as film:
        stream = film.streams.video[0]
        context = stream.codec_context
        assert (context.color_primaries, context.color_trc, context.colorspace, context.color_range) == (1, 1, 1, 1)
        assert (stream.average_rate, context.pix_fmt) == (24, "yuv420p")
        frames = [planes(frame) for frame in film.decode(stream)]
    assert len(frames) == 5
    for k, (y, cb, cr) in enumerate(frames):
        want = clpeel.render(scene, camera.azimuth(72 * k), (160, 120)).image[..., :3].astype(float)
        found = 255 * np.stack([y + 1.5748 * cr, y - 0.1873 * cb - 0.4681 * cr, y + 1.8556 * cb], axis=-1)
        off = found - want
        assert np.abs(off.mean(axis=(0, 1))).max() < 1 and np.abs(off).mean() < 4
        assert np.abs(off[:8]).max() < 2, "the background"


@pytest.mark.skipif(find_spec("av") is None, reason="needs av")
def test_an_mp4_has_the_colours_that_were_drawn(tmp_path: Path) -> None:
    """Strong colours, all over: those of BT.601 would be off by up to 30."""
    import av

    square = [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]
    for number, color in enumerate(((220, 30, 40), (20, 200, 60), (40, 60, 210), (230, 200, 20))):
        wall = clpeel.Scene.from_arrays(square, [[0, 1, 2], [0, 2, 3]], color=color)
        path = tmp_path / f"{number}.mp4"
        clpeel.turntable(wall, path, clpeel.Camera((0, 0, 5), (0, 0, 0)), 1, size=(64, 48), lighting="none")
        with av.open(path) as film:
            y, cb, cr = planes(next(film.decode(video=0)))
        found = 255 * np.stack([y + 1.5748 * cr, y - 0.1873 * cb - 0.4681 * cr, y + 1.8556 * cb], axis=-1)
        assert np.abs(found - color).max() <= 3, (color, found[20, 30])


def planes(frame: Any) -> tuple[NDArray[np.float64], ...]:
    """Y in 0..1, and Cb and Cr in -0.5..0.5, of each pixel."""
    height, width = frame.height, frame.width
    found = frame.to_ndarray().astype(float)
    y, both = (found[:height] - 16) / 219, (found[height:].reshape(2, height // 2, width // 2) - 128) / 224
    cb, cr = (each.repeat(2, axis=0).repeat(2, axis=1) for each in both)
    return y, cb, cr


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.png", {}, "expected one place for the frame's number"),
        ("##-#.png", {}, "expected one place for the frame's number"),
        ("a.avi", {}, "expected a name ending in .gif, .webp or .mp4, or numbered pictures"),
        ("no/a.gif", {}, "the folder .* does not exist"),
        ("no/x/##.png", {}, "the folder .* does not exist"),
        ("x" * 300 + ".gif", {}, "cannot write"),
        ("x" * 252 + "#.png", {}, "cannot write"),
        ("a.gif", {"background": None}, "background: expected a colour, as GIF holds no alpha"),
        ("a.gif", {"fps": 60}, "fps: expected above 0, up to 50 for GIF, got 60"),
        ("a.gif", {"fps": float("nan")}, "fps: expected above 0"),
        ("a.gif", {"frames": 0}, "frames: expected 1..100000, got 0"),
        ("a.gif", {"frames": 2.5}, "frames: expected 1..100000"),
        ("a.gif", {"lossless": True}, "lossless: expected a name ending in .webp"),
        ("a.webp", {"quality": 101}, "quality: expected 0..100, got 101"),
        ("a.webp", {"size": (20000, 10)}, "size: expected at most 16,383 pixels a side"),
        ("a.mp4", {"size": (95, 72)}, "size: expected even numbers for MP4, got 95 x 72"),
        ("a.mp4", {"background": None}, "background: expected a colour, as MP4 holds no alpha"),
        ("a.gif", {"technique": "thickness"}, "thickness_range: expected"),
        ("a.gif", {"technique": "layer-count"}, "technique: expected one whose colours mean the same"),
        ("a.gif", {"technique": "magic"}, "technique: expected one of"),
        ("a.gif", {"bar": True}, "bar: expected a scene in the colours of numbers"),
        ("a.gif", {"layers": True}, "layers: expected False"),
        ("a.gif", {"up": (0, 0, 0)}, "camera orbit: expected an axis"),
        ("a.gif", {"degrees": "far"}, "camera orbit: expected degrees"),
        ("a.gif", {"passes": 3}, "passes: the technique 'sort' has no such option"),
    ],
)
def test_what_is_wrong_is_said_before_any_work(
    scene: clpeel.Scene, tmp_path: Path, name: str, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(clpeel.InputError, match=message):
        clpeel.turntable(scene, tmp_path / name, **{"frames": 2, "size": SIZE, **options})
    assert left_in(tmp_path) == []


def test_a_film_without_its_package_says_how_to_get_it(
    scene: clpeel.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("clpeel.film.outputs.find_spec", lambda name: None)
    with pytest.raises(clpeel.InputError, match=r"expected the package av for MP4, got none: pip install 'clpeel\[vid"):
        clpeel.turntable(scene, tmp_path / "a.mp4", size=SIZE)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_is_no_place_for_a_film(scene: clpeel.Scene, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.gif")
    with pytest.raises(clpeel.InputError, match="expected a file, as a film is not written piece by piece"):
        clpeel.turntable(scene, tmp_path / "a.gif", frames=1, size=SIZE)


# --- what is over the frames ------------------------------------------------------------------------------------------


def test_a_scale_bar_stays_in_one_place_and_covers_no_frame(scene: clpeel.Scene, tmp_path: Path) -> None:
    heat = clpeel.with_scalars(scene, scene.vertices[:, 1], cmap="viridis", label="height")
    size = (320, 240)
    camera = clpeel.Camera.frame(heat, (-1, -0.3, -1), aspect=4 / 3)
    camera = clpeel.Camera(camera.position, camera.focal_point + np.array([0, 0.9, 0])).zoom(1.2)
    options: dict[str, Any] = {"camera": camera, "frames": 6, "size": size, "background": "white"}
    clpeel.turntable(heat, tmp_path / "with#.png", bar=True, **options)
    clpeel.turntable(heat, tmp_path / "bare#.png", **options)
    where = []
    for k in range(6):
        bare, barred = (frames_of(tmp_path / f"{name}{k + 1}.png")[0].astype(int) for name in ("bare", "with"))
        changed = (bare != barred).any(axis=2)
        assert changed.any() and (bare[changed] == 255).all(), "it covers the model"
        where.append(barred[changed.any(axis=1)][:, changed.any(axis=0)])
    assert all((each == where[0]).all() for each in where)


def test_the_scale_bar_of_a_map_stays_in_one_place(model: Any, tmp_path: Path) -> None:
    """Alone, some of these frames have it in other corners."""
    bunny, size = clpeel.load(model("bunny.ply")), (320, 240)
    options: dict[str, Any] = {"frames": 6, "size": size, "technique": "thickness", "thickness_range": (0, 0.12)}
    clpeel.turntable(bunny, tmp_path / "with#.png", **options)
    clpeel.turntable(bunny, tmp_path / "bare#.png", **options, scale_bar=False)
    corners = set()
    for k in range(6):
        bare, barred = (frames_of(tmp_path / f"{name}{k + 1}.png")[0].astype(int) for name in ("bare", "with"))
        rows, columns = np.nonzero((bare != barred).any(axis=2))
        corners.add((rows.min(), rows.max(), columns.min(), columns.max()))
    assert len(corners) == 1
    camera = clpeel.Camera.frame(bunny, aspect=4 / 3)
    alone = clpeel.render(bunny, camera, size, technique="thickness", thickness_range=(0, 0.12), scale_bar=False)
    assert (frames_of(tmp_path / "bare1.png")[0] == alone.image).all()


# --- after an interruption --------------------------------------------------------------------------------------------


class Stopped(BaseException):
    """What ends a film half-way, like Ctrl-C."""


def stopping(after: int) -> Any:
    """A `progress` that ends the film while it draws the frame after so many."""

    def progress(done: float, text: str) -> None:
        if text.startswith(f"frame {after + 1} of "):
            raise Stopped

    return progress


@pytest.fixture
def half(scene: clpeel.Scene, tmp_path: Path) -> Iterator[Path]:
    """A film whose first 3 of 6 frames are kept."""
    path = tmp_path / f"{'ü' * 120}'\".webp"  # 247 bytes
    with pytest.raises(Stopped):
        clpeel.turntable(scene, path, frames=6, size=SIZE, lossless=True, progress=stopping(3))
    assert left_in(tmp_path) == [Path(hidden_folder(str(path))).name]
    assert left_in(Path(hidden_folder(str(path)))) == ["000000.png", "000001.png", "000002.png"]
    yield path


def test_an_interrupted_film_continues(half: Path, scene: clpeel.Scene, tmp_path: Path) -> None:
    said: list[str] = []
    film = clpeel.turntable(scene, half, frames=6, size=SIZE, lossless=True, tell=said.append)
    assert film.drawn == 3 and said == ["3 of 6 frames are finished already"]
    assert left_in(half.parent) == [half.name]
    clpeel.turntable(scene, tmp_path / "whole.webp", frames=6, size=SIZE, lossless=True)
    assert half.read_bytes() == (tmp_path / "whole.webp").read_bytes()


def test_frames_are_known_by_another_process(scene: clpeel.Scene) -> None:
    code = (
        "import sys, pickle, clpeel; from clpeel.film.recipe import recipe_of; "
        "print(recipe_of(pickle.load(sys.stdin.buffer), 'x'))"
    )
    import pickle

    data = pickle.dumps(scene)
    done = subprocess.run([sys.executable, "-c", code], input=data, capture_output=True, check=True)
    assert done.stdout.decode().strip() == recipe_of(pickle.loads(data), "x")


@pytest.mark.parametrize(
    "change",
    [
        {"camera": "iso"},
        {"degrees": 180},
        {"background": "red"},
        {"technique": "weighted-average"},
        {"lighting": "none"},
        {"samples": 1},
        {"axis": True},
    ],
)
def test_frames_of_another_command_are_made_anew(half: Path, scene: clpeel.Scene, change: dict[str, Any]) -> None:
    said: list[str] = []
    film = clpeel.turntable(scene, half, **{"frames": 6, "size": SIZE, "tell": said.append, **change})
    assert film.drawn == 6
    assert said == ["3 of 6 frames are there of another command, model or version; they are made anew"]


def test_frames_of_another_model_or_version_are_made_anew(
    half: Path, scene: clpeel.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert scene.face_colors is not None
    colors = scene.face_colors.copy()
    colors[0, 0] += 1
    other = clpeel.Scene.from_arrays(scene.vertices, scene.faces, face_colors=colors)
    options: dict[str, Any] = {"frames": 6, "size": SIZE, "lossless": True}
    with pytest.raises(Stopped):
        clpeel.turntable(other, half, **options, progress=stopping(0))
    assert clpeel.turntable(scene, half, **options).drawn == 3, "nothing was drawn over them yet"
    with pytest.raises(Stopped):
        clpeel.turntable(scene, half, **options, progress=stopping(2))
    monkeypatch.setattr(module, "VERSION", "0.0.1")
    assert clpeel.turntable(scene, half, **options).drawn == 6


def test_what_frames_look_like_does_not_depend_on_how_they_are_written(half: Path, scene: clpeel.Scene) -> None:
    assert clpeel.turntable(scene, half, frames=6, size=SIZE, fps=10, quality=50).drawn == 3


def test_damaged_frames_are_made_anew(half: Path, scene: clpeel.Scene) -> None:
    folder = Path(hidden_folder(str(half)))
    data = (folder / "000000.png").read_bytes()
    (folder / "000000.png").write_bytes(data[:-40])  # cut off
    broken = bytearray((folder / "000001.png").read_bytes())
    broken[-60] ^= 1  # a bit has flipped
    (folder / "000001.png").write_bytes(broken)
    shutil.copy(folder / "000002.png", folder / "000003.png")  # another frame's
    said: list[str] = []
    film = clpeel.turntable(scene, half, frames=6, size=SIZE, lossless=True, tell=said.append)
    assert film.drawn == 5 and said[0] == "1 of 6 frames are finished already" and said[1].startswith("3 of 6 frames")
    assert (frames_of(half)[0] == clpeel.render(scene, clpeel.Camera.frame(scene, aspect=4 / 3), SIZE).image).all()


def test_no_flipped_bit_goes_unseen(scene: clpeel.Scene, tmp_path: Path) -> None:
    """Pillow decodes about one such file in twenty to other pixels without a word."""
    kept = Kept(str(tmp_path), "{}.png".format, "recipe")
    image = clpeel.render(scene, size=SIZE).image
    kept.add(0, image, ["a note"])
    assert kept.notes(0) == ["a note"]
    data = (tmp_path / "0.png").read_bytes()
    for at in range(0, len(data), 7):
        broken = bytearray(data)
        broken[at] ^= 1 << at % 8
        (tmp_path / "0.png").write_bytes(broken)
        if kept.notes(0) is not None:
            assert (np.asarray(kept.image(0)) == image[..., :3]).all(), at


def test_numbered_pictures_continue_and_leave_other_pictures_alone(scene: clpeel.Scene, tmp_path: Path) -> None:
    options: dict[str, Any] = {"size": SIZE, "background": "white"}
    place = tmp_path / "frames" / "f-###.png"
    clpeel.turntable(scene, place, frames=5, **options)
    Image.new("RGB", (3, 3)).save(place.parent / "f-009.png")
    Image.new("RGB", (3, 3)).save(place.parent / "f-2.png")
    (place.parent / "f-002.png").unlink()
    assert clpeel.turntable(scene, place, frames=5, **options).drawn == 1
    said: list[str] = []
    film = clpeel.turntable(scene, place, frames=3, **options, tell=said.append)
    assert film.drawn == 3
    assert said[-1].startswith("2 frame(s) of a longer turntable were removed from")
    assert left_in(place.parent) == ["f-001.png", "f-002.png", "f-003.png", "f-009.png", "f-2.png"]


def test_a_frame_says_what_it_is(scene: clpeel.Scene, tmp_path: Path) -> None:
    clpeel.turntable(scene, tmp_path / "#.png", frames=2, size=SIZE)
    with Image.open(tmp_path / "2.png") as image:
        assert json.loads(image.info[MARK])["frame"] == 1


def test_an_interrupted_film_without_a_frame_leaves_nothing(scene: clpeel.Scene, tmp_path: Path) -> None:
    for name in ("a.gif", "frames/##.png"):
        with pytest.raises(Stopped):
            clpeel.turntable(scene, tmp_path / name, frames=2, size=SIZE, progress=stopping(0))
    assert left_in(tmp_path) == []


def test_a_film_that_cannot_be_written_keeps_its_frames_and_the_old_film(
    scene: clpeel.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.gif").write_bytes(b"old")

    def full(path: str, data: bytes) -> None:
        raise clpeel.InputError("output: cannot write 'a.gif': No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(module, "write_whole", full)
        with pytest.raises(clpeel.InputError, match="No space left"):
            clpeel.turntable(scene, tmp_path / "a.gif", frames=2, size=SIZE)
    assert (tmp_path / "a.gif").read_bytes() == b"old"
    assert clpeel.turntable(scene, tmp_path / "a.gif", frames=2, size=SIZE).drawn == 0


def test_two_at_once_do_not_mix(scene: clpeel.Scene, tmp_path: Path) -> None:
    def again(done: float, text: str) -> None:
        with pytest.raises(clpeel.InputError, match="another turntable is writing"):
            clpeel.turntable(scene, tmp_path / "a.gif", "iso", frames=2, size=SIZE)
        raise Stopped

    with pytest.raises(Stopped):
        clpeel.turntable(scene, tmp_path / "a.gif", frames=2, size=SIZE, progress=again)


def test_a_link_in_place_of_the_hidden_folder_is_refused(scene: clpeel.Scene, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    os.symlink(tmp_path / "elsewhere", hidden_folder(str(tmp_path / "a.gif")))
    with pytest.raises(clpeel.InputError, match="expected a folder of your own"):
        clpeel.turntable(scene, tmp_path / "a.gif", frames=1, size=SIZE)
    assert left_in(tmp_path / "elsewhere") == []


def test_progress_says_which_frame_and_how_long(
    scene: clpeel.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = iter(range(0, 10_000, 25))
    monkeypatch.setattr(module.time, "monotonic", lambda: next(now))
    said: list[tuple[float, str]] = []
    clpeel.turntable(scene, tmp_path / "a.gif", frames=4, size=SIZE, progress=lambda *each: said.append(each))
    texts = list(dict.fromkeys(text for _, text in said))
    assert texts[:4] == ["frame 1 of 4", "frame 2 of 4", "frame 3 of 4, 50 s left", "frame 4 of 4, 25 s left"]
    assert texts[4] == "writing frame 1 of 4" and all(len(text) <= 40 for text in texts)
    shares = [done for done, _ in said]
    assert shares == sorted(shares) and shares[-1] == 1
    clock = module._Clock()
    assert [clock.left(drawn, 20) for drawn in (0, 1, 5)] == ["", "", ", 1 min 34 s left"]


def test_importing_it_imports_no_encoder() -> None:
    code = "import sys, clpeel; clpeel.turntable; print([n for n in ('av', 'PIL.Image') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_one_frame_is_a_film(scene: clpeel.Scene, tmp_path: Path) -> None:
    for name in ("a.gif", "a.webp", *(["a.mp4"] if find_spec("av") else [])):
        clpeel.turntable(scene, tmp_path / name, frames=1, size=SIZE)
        assert (tmp_path / name).stat().st_size > 500
    with Image.open(io.BytesIO((tmp_path / "a.gif").read_bytes())) as film:
        assert getattr(film, "n_frames", 1) == 1


@pytest.mark.skipif(find_spec("av") is None, reason="needs av")
def test_an_encoder_that_is_missing_or_a_full_disk_is_one_line(
    scene: clpeel.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import av

    def none(name: str, mode: str) -> None:
        raise av.codec.codec.UnknownCodecError(name)

    def full(*_: object, **__: object) -> None:
        raise av.error.OSError(28, "No space left on device", "film.mp4")

    with monkeypatch.context() as patch:
        patch.setattr(av.codec, "Codec", none)
        with pytest.raises(clpeel.InputError, match="expected a package av with libx264 for MP4"):
            clpeel.turntable(scene, tmp_path / "a.mp4", frames=1, size=SIZE)
    assert left_in(tmp_path) == []
    monkeypatch.setattr(av, "open", full)
    with pytest.raises(clpeel.InputError, match=r"output: cannot write '.*film.mp4': No space left on device"):
        clpeel.turntable(scene, tmp_path / "a.mp4", frames=1, size=SIZE)
