"""Layers: against the float64 twin, blended again to the bits of `sort`, what is peeled, files, the command."""

from __future__ import annotations

import io
import os
import re
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from conftest import INTERPOLATION_ROUNDING, INTERPOLATION_SHIFT, TIE, printed
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from twins import reference, soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH, Eye

import clpeel
from clpeel.command import main as cli
from clpeel.device.layout import INSERTED_MAX
from clpeel.device.workspace import Workspace
from clpeel.stages.find_layers import TURNS
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

ORTHOGRAPHIC = Eye(clipping_range=(2.5, 5.5), orthographic=True)
CLIPPED = Eye(position=(0.0, 0.0, 0.4), focal_point=(0.0, 0.0, -1.0), view_angle=70.0, clipping_range=(0.3, 0.9))
PEEL = [
    ("depth-peeling", {}),
    ("multi-layer-peeling", {"layers_per_pass": 3}),
    ("multi-layer-peeling", {}),
    ("dual-depth-peeling", {}),
    ("glowscript", {}),
]
FIELDS = ("start", "color", "depth", "triangle")


def peeled_of(technique: str, options: dict[str, Any], passes: int | None) -> tuple[int, int]:
    """How many layers the papers peel from the front and from the back in so many peels."""
    if passes is None:
        return 4 if technique == "glowscript" else 10**9, 0
    if technique == "dual-depth-peeling":
        return passes, passes
    return passes * (options.get("layers_per_pass", 8) if technique == "multi-layer-peeling" else 1), 0


def same(got: clpeel.Layers, want: clpeel.Layers) -> None:
    """The same layers, bit for bit."""
    assert got.size == want.size
    for name in FIELDS:
        one, two = getattr(got, name), getattr(want, name)
        assert one.dtype == two.dtype and one.tobytes() == two.tobytes(), name


def again(result: clpeel.Result, background: Any, judge: Judge) -> None:
    """The layers, blended again, are the picture's bits."""
    layers = result.layers
    remade = clpeel.Result(layers.composite(background), {}, layers.blended())
    judge.same_bits(remade, result, "blended again")


# --- what they are ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("colors", "view", "size"),
    [
        ("flat8", BENCH, (70, 50)),
        ("flat", ORTHOGRAPHIC, (33, 47)),
        ("vertex", CLIPPED, (50, 50)),
    ],
)
def test_layers_are_the_twins(colors: str, view: Eye, size: tuple[int, int], lanes: int, judge: Judge) -> None:
    soup = soups.random(71, 150, "mixed", colors)
    result = plainly.render(soup.scene(), view.camera(), size, lanes=lanes, layers=True)
    layers = result.layers
    twin, excused, _ = judge.weigh(soup, view, size)
    assert layers.size == size and len(layers.triangle) == result.stats["fragments"]
    assert layers.count == result.stats["layers_max"] >= 4
    count = np.diff(layers.start)
    sure = ~excused.reshape(-1)
    assert sure.mean() > 0.8 and (count == twin.layers.reshape(-1))[sure].all()
    ours = sure[np.repeat(np.arange(len(count)), count)]
    theirs = sure[twin.pixel]
    assert (layers.triangle[ours] == twin.projected.number[twin.triangle[theirs]]).all()

    # A depth is off by TIE / 2 (12 roundings, conftest.py), relatively in perspective, of the range if orthographic,
    # and by what its shift to the snapped corners misses (INTERPOLATION_SHIFT); a distance is rounded once more.
    near, far = twin.projected.clipping
    nearest, farthest, least, greatest = reference.shifted(twin, INTERPOLATION_SHIFT)
    slack = TIE / 2 * ((far - near) if view.orthographic else twin.distance) + UNIT * twin.distance
    depth = layers.depth[ours]
    assert (depth >= (nearest - slack)[theirs]).all() and (depth <= (farthest + slack)[theirs]).all()
    # One colour for a face is the float32 nearest to it; others are interpolated, within INTERPOLATION_ROUNDING.
    rounding = UNIT if colors.startswith("flat") else INTERPOLATION_ROUNDING
    color = layers.color[ours]
    assert (color >= least[theirs] - rounding).all() and (color <= greatest[theirs] + rounding).all()
    again(result, (1, 1, 1), judge)


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_lit_layers_are_lit(colors: str, lanes: int, judge: Judge) -> None:
    soup, size = soups.random(72, 150, "mixed", colors), (40, 50)
    call = {"camera": BENCH.camera(), "size": size, "lanes": lanes, "layers": True, "background": None}
    plain = plainly.render(soup.scene(), **call)
    lit = plainly.render(soup.scene(), lighting="headlight", **call)
    again(plain, None, judge)
    again(lit, None, judge)
    for name in ("start", "depth", "triangle"):
        assert (getattr(lit.layers, name) == getattr(plain.layers, name)).all()
    # AMBIENT + (1 - AMBIENT) cosine of the colour, a number 0.2..1 for all three channels; two products' roundings.
    a, b = lit.layers.color, plain.layers.color
    assert (a[:, 3] == b[:, 3]).all()
    assert (a[:, :3] <= b[:, :3]).all() and (a[:, :3] >= b[:, :3] * (0.2 - 4 * UNIT)).all()
    assert (a[:, :3] < 0.9 * b[:, :3]).any(axis=1).mean() > 0.2


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    places=st.integers(1, 9),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    background=st.sampled_from([None, (1.0, 1.0, 1.0), (0.1, 0.7, 0.3), ((0.1, 0.7, 0.3), (1.0, 0.0, 0.9))]),
)
def test_any_layers_blended_again_are_the_picture(
    seed: int, count: int, places: int, size: tuple[int, int], background: Any, judge: Judge
) -> None:
    """Random triangles, some one in the plane of another, some opaque, some invisible."""
    soup = soups.random(seed, count, "mixed", "flat8")
    vertices = soup.vertices.copy()
    vertices[:, 2] = np.round(vertices[:, 2] * places) / places
    faces = np.concatenate([soup.faces, soup.faces[: count // 3]])
    rng = np.random.default_rng(seed)
    rgba = rng.integers(0, 256, (len(faces), 4), dtype=np.uint8)
    rgba[:, 3] = rng.choice([0, 1, 128, 254, 255], len(faces))
    scene = clpeel.Scene.from_arrays(vertices, faces, face_colors=rgba)
    call = {"camera": BENCH.camera(), "size": size, "background": background, "layers": True}
    one, many = (plainly.render(scene, lanes=lanes, **call) for lanes in (1, 64))
    again(one, background, judge)
    same(many.layers, one.layers)
    dense = list(one.layers)
    assert len(dense) == len(one.layers) == one.layers.count
    for k, parts in enumerate(dense):
        for part, one_layer, last in zip(parts, one.layers.layer(k), one.layers[k - len(dense)], strict=True):
            assert (part == one_layer).all() and (part == last).all()
    assert sum((triangle >= 0).sum() for _, _, triangle in dense) == len(one.layers.triangle)
    for k, (color, depth, triangle) in enumerate(dense):
        assert ((triangle >= 0) == (np.diff(one.layers.start).reshape(triangle.shape) > k)).all()
        assert ((triangle < 0) == np.isinf(depth)).all() and not color[triangle < 0].any()
        if k:
            assert (depth >= dense[k - 1][1]).all()


def test_to_the_last_of_a_million_roundings(judge: Judge) -> None:
    # Alphas that vary: one step of float32 more or less in a transmittance shows in about one byte of 2**25 / 255.
    rgba = np.random.default_rng(9).random((9, 4)).astype(np.float32)
    plain = soups.stack([1.0, 2.0, 3.0], (255, 255, 255, 255))
    scene = soups.Soup(plain.vertices, plain.faces, vertex_colors=rgba).scene()
    for background in ((0.9, 0.5, 0.7), ((0.9, 0.5, 0.7), (0.2, 0.3, 0.8)), None):
        result = plainly.render(scene, AHEAD.camera(), (800, 600), background=background, layers=True)
        again(result, background, judge)


@pytest.mark.parametrize("count", [INSERTED_MAX - 1, INSERTED_MAX, INSERTED_MAX + 1, 300])
def test_pixels_of_a_tile_have_lists_of_their_own(count: int, lanes: int) -> None:
    # Layer k covers the pixels right of column k * 20 / count only; every third is as far as the one before.
    width, height = 20, 18
    rng = np.random.default_rng(count)
    depth = np.round(rng.permutation(np.linspace(-2, 0.5, count)) * 1024) / 1024
    depth[2::3] = depth[1::3][: len(depth[2::3])]
    left = np.round(np.arange(count) * width / count * 64) / 64 - width / 2
    corners = np.empty((count, 3, 3))
    corners[..., 0] = np.stack([left, left, left + 400], -1)
    corners[..., 1] = [-200, 200, 0]
    corners[..., 2] = depth[:, None]
    scene = soups.separate(corners, rng.random((count, 4)).astype(np.float32) * np.float32(0.9)).scene()
    view = soups.pixel_view(height)
    whole = plainly.render(scene, view.camera(), (width, height), lanes=lanes, layers=True).layers
    for column in range(width):
        here = np.flatnonzero(left <= column + 0.5 - width / 2)
        want = here[np.argsort(-depth[here], kind="stable")]
        for row in (0, 15, 16, 17):
            p = row * width + column
            assert (whole.triangle[whole.start[p] : whole.start[p + 1]] == want).all()


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_windows_fit_the_memory_and_change_nothing(
    colors: str, lanes: int, judge: Judge, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One tile with more fragments than the memory holds at once is peeled in runs of its pixels."""
    count, size = 400, (20, 18)
    painted = np.random.default_rng(6).random((count, 4)).astype(np.float32) * np.array([1, 1, 1, 0.05], np.float32)
    soup = soups.stack(np.random.default_rng(7).integers(64, 448, count) / 64, np.round(painted * 255).astype(np.uint8))
    if colors == "vertex":
        soup = soups.Soup(soup.vertices, soup.faces, vertex_colors=np.repeat(painted, 3, axis=0))
    plenty = plainly.render(soup.scene(), AHEAD.camera(), size, lanes=lanes, layers=True, memory="256M")
    most, at_first = 0, None
    allocate = Workspace.buffer

    def watch(gpu: Workspace, name: str, nbytes: int) -> Any:
        nonlocal most, at_first
        if name == "pixel_end" and at_first is None:
            at_first = [n for n in TURNS if n in gpu.buffers]
        held = allocate(gpu, name, nbytes)
        if "kept" in gpu.buffers:
            most = max(most, sum(gpu.buffers[n].size for n in TURNS if n in gpu.buffers))
        return held

    monkeypatch.setattr(Workspace, "buffer", watch)
    tight = plainly.render(soup.scene(), AHEAD.camera(), size, lanes=lanes, layers=True, memory="1M")
    assert tight.stats["fragments"] == count * size[0] * size[1] > 2**20 / 8, "fits a window"
    assert at_first == ["pairs"], "the picture's buffers have been given back"
    assert 2**19 < most <= 2**20
    assert not {"sources", "kept"} & tight.stats["bytes"].keys()
    same(tight.layers, plenty.layers)
    again(tight, (1, 1, 1), judge)
    with pytest.raises(clpeel.InputError, match=r"expected room for the .* fragments of one pixel"):
        deep = soups.stack(np.full(90_000, 2.0), (255, 255, 255, 9)).scene()
        plainly.render(
            deep, AHEAD.camera(), (1, 1), lanes=lanes, technique="depth-peeling", layers=True, memory="1M", passes=1
        )


def test_nothing_in_view(lanes: int, judge: Judge) -> None:
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    scene = soups.stack([1.0], (255, 255, 255, 128)).scene()
    for size in ((1, 1), (20, 17)):
        result = plainly.render(scene, away, size, lanes=lanes, layers=True)
        assert result.layers.count == len(result.layers.depth) == 0
        again(result, (1, 1, 1), judge)
        with pytest.raises(clpeel.InputError, match="layer: expected none, as no pixel has a layer; got 0"):
            result.layers.layer(0)


# --- what each technique peels ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("technique", "options"), [("sort", {}), *PEEL])
def test_what_is_peeled(technique: str, options: dict[str, Any], lanes: int) -> None:
    """Of surfaces at known distances: the front's and the back's, up to the first opaque one, and that."""
    rng = np.random.default_rng(8)
    for layers, opaque in ((1, 0), (1, 1), (6, 0), (7, 1), (7, 3), (40, 0), (40, 2)):
        distances = rng.choice(1 + np.arange(layers // 2 + 1) / 8, layers)
        rgba = rng.integers(0, 255, (layers, 4), dtype=np.uint8)
        rgba[rng.choice(layers, opaque, replace=False), 3] = 255
        scene = soups.stack(distances, rgba).scene()
        order = np.argsort(distances, kind="stable").tolist()
        cases: list[tuple[int | None, str]] = [(None, "keep")]
        if technique != "sort":
            cases += [(None, "paper"), (1, "keep"), (2, "keep"), (2, "paper"), (4, "keep")]
        for passes, coincident in cases:
            want = order
            if coincident == "paper":
                want = [face for i, face in enumerate(order) if not i or distances[face] != distances[order[i - 1]]]
            solid = [i for i, face in enumerate(want) if rgba[face, 3] == 255][:1]
            clear = want[: solid[0]] if solid else want
            front, back = peeled_of(technique, options, passes)
            kept = [face for i, face in enumerate(clear) if i < front or i >= len(clear) - back]
            kept += [want[i] for i in solid]
            given = {} if technique == "sort" else {"coincident": coincident, **options}
            given |= {} if passes is None else {"passes": passes}
            got = plainly.render(scene, AHEAD.camera(), (3, 2), technique, lanes=lanes, layers=True, **given).layers
            assert (got.triangle.reshape(6, -1) == kept).all(), (layers, passes, coincident)
            assert (got.color == np.tile(rgba[kept] / np.float32(255), (6, 1))).all()


@pytest.mark.parametrize(("technique", "options"), PEEL)
def test_what_is_peeled_is_what_is_drawn(technique: str, options: dict[str, Any], judge: Judge) -> None:
    soup = soups.random(67, 120, "large", alpha=(0.2, 0.7))
    rgba = np.array(soup.face_colors)
    for opaque in (False, True):
        rgba[100 if opaque else 120 :, 3] = 255
        scene = clpeel.Scene.from_arrays(soup.vertices, soup.faces, face_colors=rgba)
        for passes in ({"passes": 1}, {"passes": 2}, {}):
            got = plainly.render(scene, BENCH.camera(), (60, 40), technique, layers=True, **passes, **options)
            assert got.stats["layers_max"] <= got.layers.count <= got.stats["layers_max"] + opaque
            if technique in ("dual-depth-peeling", "glowscript"):  # not blended front to back: 3 roundings a layer
                judge.color(got, got.layers.blended(), 2 * 3 * got.layers.count * UNIT)
            else:
                again(got, (1, 1, 1), judge)


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_opaque_surfaces_end_the_layers(colors: str, lanes: int, judge: Judge) -> None:
    """They do, though what is interpolated of alphas of 1 may miss 1; unless they are blended as any other."""
    soup = soups.random(73, 150, "large", colors)
    rgba = np.array(soup.face_colors if colors == "flat8" else soup.vertex_colors)
    opaque = np.arange(len(soup.faces)) % 5 == 0
    rgba[opaque if colors == "flat8" else np.repeat(opaque, 3), 3] = 255 if colors == "flat8" else 1
    rgba[1::15, 3] = 255 if colors == "flat8" else 1  # and a corner here and there
    opaque |= (rgba[:, 3] == 255) if colors == "flat8" else (rgba[:, 3].reshape(-1, 3) == 1).all(axis=1)
    scene = clpeel.Scene.from_arrays(
        soup.vertices, soup.faces, **{"face_colors" if colors == "flat8" else "vertex_colors": rgba}
    )
    call = {"camera": BENCH.camera(), "size": (50, 40), "lanes": lanes, "layers": True}
    first, blend = plainly.render(scene, **call), plainly.render(scene, opaque="blend", **call)
    again(first, (1, 1, 1), judge)
    again(blend, (1, 1, 1), judge)
    assert len(blend.layers.triangle) == blend.stats["fragments"]
    one, all_ = first.layers, blend.layers
    solid = opaque[all_.triangle]
    for p in np.flatnonzero(np.diff(all_.start)):
        own = slice(all_.start[p], all_.start[p + 1])
        until = np.flatnonzero(solid[own] | (all_.color[own, 3] == 1))[:1] + 1
        kept = int(until[0]) if len(until) else own.stop - own.start
        mine = slice(one.start[p], one.start[p + 1])
        assert (one.triangle[mine] == all_.triangle[own][:kept]).all()
        assert (one.color[mine, 3] == np.where(solid[own], 1, all_.color[own, 3])[:kept]).all()
    assert scene.surfaces == "mixed" and solid.mean() > 0.1
    assert len(one.triangle) < 0.8 * len(all_.triangle)


def test_those_that_do_not_sort_have_no_layers() -> None:
    scene = soups.stack([1.0], (255, 255, 255, 128)).scene()
    for name, technique in TECHNIQUES.items():
        assert ("layers" in technique.option_names) == technique.sorts
        if not technique.sorts:
            with pytest.raises(clpeel.InputError, match=f"layers: the technique '{name}' has no such option; it has"):
                plainly.render(scene, AHEAD.camera(), (4, 4), name, layers=True)
            assert plainly.render(scene, AHEAD.camera(), (4, 4), name, layers=False).image.shape == (4, 4, 4)
        else:
            assert plainly.render(scene, AHEAD.camera(), (4, 4), name, layers=True).layers.count == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 4}, "layers: expected samples=1, got 4"),
        (
            {"technique": "multi-layer-peeling", "torn_writes": True},
            "layers: expected no torn_writes",
        ),
        ({"layers": 8}, "layers: expected True or False, got 8; layers in each pass are layers_per_pass"),
        ({"technique": "sort", "passes": 3}, "passes: the technique 'sort' has no such option; it has camera"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    scene = soups.stack([1.0], (255, 255, 255, 128)).scene()
    with pytest.raises(clpeel.InputError, match=message):
        plainly.render(scene, AHEAD.camera(), (4, 4), **{"layers": True, **options})


def test_layers_must_be_asked_for() -> None:
    result = plainly.render(soups.stack([1.0], (255, 255, 255, 128)).scene(), AHEAD.camera(), (4, 4))
    with pytest.raises(clpeel.InputError, match="layers: expected a result rendered with layers=True"):
        _ = result.layers


def test_the_stage_and_the_next_picture() -> None:
    """Its time is booked on it, progress ends with all done, and a picture after it is the one before it."""
    soup = soups.random(3, 100)
    renderer = plainly.Renderer(soup.scene())
    first = renderer.render(BENCH.camera(), (40, 30))
    seen: list[float] = []
    middle = renderer.render(BENCH.camera(), (40, 30), layers=True, progress=lambda done, text: seen.append(done))
    last = renderer.render(BENCH.camera(), (40, 30))
    assert (first.color == middle.color).all() and (first.color == last.color).all()
    seconds = middle.stats["seconds"]
    assert list(seconds)[-1] == "total" and "layers" not in first.stats["seconds"]
    assert seconds["total"] == pytest.approx(sum(seconds.values()) - seconds["total"])
    assert seen[-1] == 1 and all(0 <= done <= 1 for done in seen)


# --- one layer as a picture -------------------------------------------------------------------------------------------


def test_a_layer_as_a_picture() -> None:
    rgba = np.array([[255, 0, 51, 102], [0, 255, 0, 255]], np.uint8)
    layers = plainly.render(soups.stack([1.0, 2.0], rgba).scene(), AHEAD.camera(), (2, 1), layers=True).layers
    assert (layers.picture(0) == [255, 0, 51, 255]).all() and (layers.picture(1) == [0, 255, 0, 255]).all()
    assert (layers.picture(0, None) == [255, 0, 51, 255]).all()
    assert (layers.picture(0, None, keep_alpha=True) == rgba[0]).all()
    # 0.4 of it and 0.6 of white: 255, 153, 0.4 * 51 + 153 = 173.4.
    assert (layers.picture(0, keep_alpha=True) == [255, 153, 173, 255]).all()
    for k in (-1, 2):
        with pytest.raises(clpeel.InputError, match=rf"layer: expected 0\.\.1; got {k}"):
            layers.picture(k)
    with pytest.raises(clpeel.InputError, match="background: expected 3 numbers"):
        layers.picture(0, (2, 0, 0))
    with pytest.raises(clpeel.InputError, match="background: expected R,G,B .* got 'whit'; did you mean white"):
        layers.composite("whit")
    assert (layers.composite("white") == layers.composite()).all()


def test_what_no_layer_covers_is_the_background() -> None:
    start, none = np.array([0, 0, 1]), np.zeros((1, 4), np.float32)
    one = clpeel.Layers((2, 1), start, none, np.ones(1, np.float32), np.zeros(1, np.int32))
    assert (one.picture(0, (1, 0.2, 0)) == [[[255, 51, 0, 255], [0, 0, 0, 255]]]).all()
    assert (one.picture(0, None) == [[[0, 0, 0, 0], [0, 0, 0, 255]]]).all()
    assert (one.composite(None) == 0).all()


# --- files ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def layers() -> clpeel.Layers:
    soup = soups.random(5, 60)
    return plainly.render(soup.scene(), BENCH.camera(), (30, 20), layers=True).layers


def test_a_file_gives_the_same_layers(layers: clpeel.Layers, tmp_path: Path) -> None:
    layers.save(tmp_path / "a.npz")
    assert os.listdir(tmp_path) == ["a.npz"]
    same(clpeel.load_layers(tmp_path / "a.npz"), layers)
    same(clpeel.load_layers(str(tmp_path / "a.npz")), layers)
    with pytest.raises(clpeel.InputError, match=r"output: the folder .*missing' does not exist"):
        layers.save(tmp_path / "missing" / "a.npz")
    with pytest.raises(clpeel.InputError, match=r"output: expected a name ending in .npz or .exr, got"):
        layers.save(tmp_path / "a.png")
    (tmp_path / "link.npz").symlink_to("a.npz")
    layers.save(tmp_path / "link.npz")
    assert (tmp_path / "link.npz").is_symlink()


def fields(layers: clpeel.Layers) -> dict[str, Any]:
    """What a file holds."""
    return {"format": np.int32(1), "size": np.array(layers.size), **{name: getattr(layers, name) for name in FIELDS}}


def swapped(depth: Any, start: Any) -> Any:
    """The depths of the first pixel of two layers or more, the other way round."""
    depth, first = depth.copy(), start[np.flatnonzero(np.diff(start) > 1)[0]]
    depth[first : first + 2] = depth[first + 1], depth[first]
    return depth


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.pop("depth"), "expected layers that clpeel has saved"),
        (lambda f: f.update(format=np.int32(2)), "expected format 1, got 2; it may need a newer clpeel"),
        (lambda f: f.update(format=np.array(["x"] * 99)), "expected format 1, got"),
        (lambda f: f.update(size=np.array([30.0, 20.0])), "size: expected 2 whole numbers"),
        (lambda f: f.update(size=np.array([30, 20, 1])), "size: expected 2 whole numbers"),
        (lambda f: f.update(size=np.array([20, 20])), r"start: expected int64 \[401\], got int64 \[601\]"),
        (lambda f: f.update(size=np.array([-30, -20])), "size: expected 1..65536 pixels a side"),
        (lambda f: f.update(start=f["start"].astype(np.int32)), r"start: expected int64 \[601\], got int32"),
        (lambda f: f.update(start=f["start"] + 1), "start: expected numbers that rise"),
        (lambda f: f.update(start=np.full_like(f["start"], 2**62) * (np.arange(601) > 0)), "color: expected float32"),
        (lambda f: f.update(start=f["start"][::-1].copy()), "start: expected numbers that rise"),
        (lambda f: f.update(start=np.r_[0, 2**62, f["start"][2:]]), "start: expected numbers that rise"),
        (lambda f: f.update(color=f["color"][:-1]), "color: expected float32"),
        (lambda f: f.update(color=f["color"] * np.float32(np.nan)), "color: expected finite numbers"),
        (lambda f: f.update(depth=f["depth"][:, None]), "depth: expected float32"),
        (lambda f: f.update(depth=swapped(f["depth"], f["start"])), "depth: expected each pixel's front to back"),
        (lambda f: f.update(depth=f["depth"] * np.float32(np.nan)), "depth: expected each pixel's front to back"),
        (lambda f: f.update(triangle=f["triangle"] - 1000), "triangle: expected faces from 0 on"),
        (lambda f: f.update(triangle=np.int32(1)), "triangle: expected int32"),
        (lambda f: f.update(triangle=np.array([{}])), "expected layers that clpeel has saved"),
    ],
)
def test_files_that_are_no_layers(layers: clpeel.Layers, tmp_path: Path, change: Any, message: str) -> None:
    changed = fields(layers)
    np.savez(tmp_path / "good.npz", **changed)
    same(clpeel.load_layers(tmp_path / "good.npz"), layers)
    change(changed)
    np.savez(tmp_path / "bad.npz", **changed)
    with pytest.raises(clpeel.InputError, match=message) as error:
        clpeel.load_layers(tmp_path / "bad.npz")
    assert str(error.value).startswith(f"{tmp_path / 'bad.npz'}: ") and "\n" not in str(error.value)


def test_files_that_are_damaged_or_something_else(layers: clpeel.Layers, tmp_path: Path) -> None:
    layers.save(tmp_path / "a.npz")
    data = (tmp_path / "a.npz").read_bytes()
    single = io.BytesIO()
    np.save(single, layers.depth)
    other = io.BytesIO()
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("size.npy", b"no array")
        archive.writestr("format.npy", b"\x93NUMPY\x01\x00\x00\x01{'descr': ")
    broken = bytearray(data)
    broken[len(data) // 2] ^= 255
    for wrong in (b"", b"PK", b"ply\n", data[:1000], data[:-30], single.getvalue(), other.getvalue(), bytes(broken)):
        (tmp_path / "b.npz").write_bytes(wrong)
        with pytest.raises(clpeel.InputError, match=r"b\.npz: expected layers that clpeel has saved") as error:
            clpeel.load_layers(tmp_path / "b.npz")
        assert "\n" not in str(error.value)
    with pytest.raises(clpeel.InputError, match=r"c\.npz: no such file"):
        clpeel.load_layers(tmp_path / "c.npz")
    with pytest.raises(clpeel.InputError, match="cannot be read: Is a directory"):
        clpeel.load_layers(tmp_path)


# --- the command ------------------------------------------------------------------------------------------------------


def command(squares: Path, *arguments: str) -> int:
    """`clpeel layers` of the squares, small and unlit."""
    opacity = [] if any(argument.startswith("--opacity") for argument in arguments) else ["--opacity=0.4"]
    given = ["--resolution=40,30", "--unlit", "--color=1,0,0", *opacity, *arguments]
    return cli.main(["layers", str(squares), *given])


def test_the_command_writes_pictures_and_a_file(squares: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "out"
    assert command(squares, "-o", str(folder)) == 0
    (said,) = sum(printed(capfd), [])
    assert re.fullmatch(rf"clpeel: wrote {folder}/layers\.npz, 2 layers \(40 x 30, 4 triangles, [\d.]+ s\)", said)
    assert sorted(os.listdir(folder)) == ["layer-01.png", "layer-02.png", "layers.npz"]
    assert sorted(os.listdir(tmp_path)) == ["out", "squares.off"]
    (tmp_path / "new").mkdir()
    assert folder.stat().st_mode == (tmp_path / "new").stat().st_mode
    layers = clpeel.load_layers(folder / "layers.npz")
    scene = clpeel.load(squares, opacity=0.4, color=(1.0, 0.0, 0.0))
    camera = clpeel.Camera.frame(scene, aspect=40 / 30)
    assert (layers.composite() == plainly.render(scene, camera, (40, 30)).image).all()
    assert layers.triangle[layers.start[15 * 40 + 20]] in (2, 3), "the nearer square is the first layer"
    first, second = (np.asarray(Image.open(folder / f"layer-0{k}.png").convert("RGBA")) for k in (1, 2))
    red, grey = [255, 0, 0, 255], [200, 204, 210, 255]  # the command puts #c8ccd2 behind
    assert (first[15, 20] == red).all() and (second[15, 20] == red).all() and (first[0, 0] == grey).all()
    assert 0 < (second == red).all(axis=2).sum() < (first == red).all(axis=2).sum()
    assert (first == layers.picture(0, "#c8ccd2")).all()


def test_the_command_with_alpha_and_stats(squares: Path, tmp_path: Path, capfd: Any) -> None:
    arguments = ["--keep-alpha", "--no-background", "--technique=depth-peeling", "--passes=1", "--quiet"]
    assert command(squares, "-o", str(tmp_path / "out"), f"--stats={tmp_path / 's.json'}", *arguments) == 0
    assert not sum(printed(capfd), [])
    assert sorted(os.listdir(tmp_path / "out")) == ["layer-01.png", "layers.npz"]
    image = np.asarray(Image.open(tmp_path / "out" / "layer-01.png"))
    assert (image[15, 20] == [255, 0, 0, 102]).all() and not image[0, 0].any()
    assert '"layers":' in (tmp_path / "s.json").read_text()


def test_an_earlier_run_goes_and_other_files_stay(squares: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    for name in ("layer-02.png", "layer-03.png", "layer-100.png", "layer-final.png", "layer-4.png.txt", "notes"):
        (folder / name).write_text(name)
    (folder / "layer-07.png").mkdir()
    (tmp_path / "link").symlink_to(folder)
    assert command(squares, "-o", str(tmp_path / "link")) == 0
    kept = ["layer-07.png", "layer-4.png.txt", "layer-final.png", "notes"]
    assert sorted(os.listdir(folder)) == sorted(["layer-01.png", "layer-02.png", "layers.npz", *kept])
    assert (folder / "notes").read_text() == "notes" and (folder / "layer-02.png").stat().st_size > 20


def test_one_layer_of_what_is_opaque_is_said(squares: Path, tmp_path: Path, capfd: Any) -> None:
    assert command(squares, "-o", str(tmp_path / "a"), "--opacity=1") == 0
    note, _ = sum(printed(capfd), [])
    assert "note: all is opaque, so there is one layer; --opacity 0.5 or --opaque blend" in note
    assert command(squares, "-o", str(tmp_path / "b"), "--opacity=1", "--opaque=blend") == 0
    assert len(sum(printed(capfd), [])) == 1
    assert [clpeel.load_layers(tmp_path / name / "layers.npz").count for name in "ab"] == [1, 2]


def test_no_layer_in_view_is_said(squares: Path, tmp_path: Path, capfd: Any) -> None:
    assert command(squares, "-o", str(tmp_path / "out"), "--camera-position=0,0,9", "--camera-focal-point=0,0,99") == 0
    assert "no layer is in view" in capfd.readouterr().err
    assert os.listdir(tmp_path / "out") == ["layers.npz"]
    assert clpeel.load_layers(tmp_path / "out" / "layers.npz").count == 0


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize(
    ("error", "code"), [(KeyboardInterrupt(), 130), (OSError(28, "No space left on device", "x.png"), 1)]
)
def test_a_failure_leaves_all_as_it_was(
    squares: Path, tmp_path: Path, there: bool, error: BaseException, code: int, monkeypatch: Any, capfd: Any
) -> None:
    folder = tmp_path / "out"
    if there:
        folder.mkdir()
        (folder / "layer-01.png").write_bytes(b"old")

    def broken(*_: Any) -> None:
        raise error

    monkeypatch.setattr(clpeel.Layers, "save", broken)
    assert command(squares, "-o", str(folder)) == code
    assert len(sum(printed(capfd), [])) == 1
    assert sorted(os.listdir(tmp_path)) == (["out"] if there else []) + ["squares.off"]
    assert not there or [p.read_bytes() for p in folder.iterdir()] == [b"old"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "squares.off"], "--output: expected a folder, got the file 'squares.off'"),
        (["-o", "no/such"], "does not exist; create it first"),
        (["-o", ""], "--output: expected a folder, got ''"),
        (["-o", "-"], "--output: expected a folder, got '-'"),
        (["-o", "x" * 300], "File name too long"),
        (["-o", "circle"], "--output: cannot write 'circle': Too many levels of symbolic links"),
        (["-o", "new", "--stats=new"], "--stats: expected a file of its own, got "),
        (["-o", ".", "--stats=layer-3.png"], "--stats: expected a file of its own, got 'layer-3.png'"),
        (["-o", ".", "--stats=layers.npz"], "--stats: expected a file of its own, got 'layers.npz'"),
        (["--samples=4"], "layers: expected --samples 1, got 4"),
        (["--technique=weighted-sum"], "layers: the technique 'weighted-sum' has no such option"),
        (["--passes=0"], "1 or more"),
    ],
)
def test_bad_input_is_one_line_before_any_work(
    squares: Path, tmp_path: Path, arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(clpeel, "load", lambda *_, **__: pytest.fail("a file was read"))
    (tmp_path / "circle").symlink_to("circle")
    assert command(squares, *arguments) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and message in err
    assert sorted(os.listdir(tmp_path)) == ["circle", "squares.off"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_is_not_writable(squares: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    for name in (folder, folder / "new"):
        assert command(squares, "-o", str(name)) == 2
        assert "not writable" in capfd.readouterr().err
