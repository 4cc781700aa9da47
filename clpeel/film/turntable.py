"""The turntable: a film of a scene, around which the camera turns."""

from __future__ import annotations

import os
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clpeel import checks
from clpeel.checks import GivenBackground, checked_size
from clpeel.errors import InputError
from clpeel.files import write_whole
from clpeel.film import gif, mp4, webp
from clpeel.film.kept import Kept, folder_of
from clpeel.film.outputs import Output, check_film, checked_output
from clpeel.film.recipe import recipe_of
from clpeel.pictures.scale_bar import draw_beside, draw_scale_bar, scale_of
from clpeel.rendering.axis import box_of
from clpeel.rendering.options import BACKGROUND, Lighting, Size
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.request import Progress, Request
from clpeel.rendering.result import NO_BAR, Result, left_out
from clpeel.scene.camera import Camera, GivenCamera, Vector, checked_camera
from clpeel.scene.scene import Scene
from clpeel.techniques import AUTO, option_names
from clpeel.version import VERSION

if TYPE_CHECKING:
    from typing import Unpack

    from clpeel.rendering.keywords import Keywords

MOST_FRAMES = 100_000

DRAWING = 0.95
"""The share of the progress bar that is for drawing frames. The rest is for writing the film."""

SURVEY_SIDE = 256
"""About how many pixels the larger side of the small pictures has that show where the model never is."""


@dataclass(frozen=True)
class Film:
    """A film that was written. files: one, or each numbered picture. drawn: how many frames were not there before.

    notes: what the frames lack, one line each.
    """

    files: tuple[str, ...]
    frames: int
    drawn: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Work:
    """What has to be drawn. given: the options of Renderer.render but the camera and the technique.

    bar: whether there are scale bars of colour maps. map_bar: whether there is that of a technique's map.
    taken: bool [height, width], where scale bars must not be; None without them, and until it is known. unpaired:
    whether that of a map explains the colour of unpaired pixels.
    """

    renderer: Renderer
    cameras: Sequence[Camera]
    technique: str
    given: dict[str, Any]
    axis: bool
    bar: bool
    map_bar: bool
    place: tuple[int | str | None, int | None]
    taken: NDArray[np.bool_] | None = None
    unpaired: bool = False

    def draw(self, k: int, progress: Progress | None) -> Result:
        """Return frame k, whose bits are those of `clpeel.render` with this camera, and with what is over it."""
        camera = self.cameras[k]
        result = self.renderer.render(camera, technique=self.technique, progress=progress, **self.given)
        if self.axis:
            result = result.with_axis(camera, *self.place)
        if self.taken is None:
            return result
        image, taken, notes = result.image.copy(), self.taken.copy(), list(result.stats.notes)
        if self.map_bar:
            low, high = result.stats["thickness_range"]
            draw_scale_bar(image, low, high, f"thickness, {result.stats['unit']}", taken, self.unpaired)
        for each in self.renderer.scene.color_maps if self.bar else ():
            box = draw_beside(image, scale_of(each), taken)
            if box is None:
                notes.append(NO_BAR.format(f"of {each.label!r} " if each.label else ""))
            else:
                taken[box.rows_and_columns] = True
        return replace(result, image=image, stats=replace(result.stats, notes=notes))


def turntable(
    scene: Scene,
    path: str | os.PathLike[str],
    camera: GivenCamera | None = None,
    frames: int = 90,
    degrees: float = 360.0,
    fps: float = 30.0,
    size: Size = (800, 600),
    technique: str = "sort",
    background: GivenBackground = BACKGROUND,
    lighting: Lighting | None = None,
    *,
    up: str | Vector | None = None,
    quality: int = 90,
    lossless: bool = False,
    axis: bool = False,
    bar: bool = False,
    device: int | str | None = None,
    lanes: int | None = None,
    progress: Progress | None = None,
    tell: Callable[[str], None] | None = None,
    **options: Unpack[Keywords],
) -> Film:
    """Write a film of the scene, around which the camera turns.

        clpeel.turntable(scene, "part.gif", "iso", frames=60)

    path: a name ending in .gif, .webp or .mp4 (which needs the extra `video`), or one for numbered pictures such as
    "frames/####.png" or "frames/%04d.png", whose numbers begin with 1. camera: that of the first frame, as for
    `clpeel.render`; by default all is in view, and stays in view. The other frames have those of `Camera.orbit`. up:
    the axis that it turns about, by default what is up for the camera. degrees: of all frames together; below 0 the
    other way round. fps: frames a second. quality: 0..100, of .webp and .mp4. lossless: of .webp, in place of a
    quality. axis: the axes in a corner. bar: a scale bar of each of the scene's colour maps, in a place where the model
    never is. progress, and all other options: those of `clpeel.render`. tell: takes what is worth to know meanwhile, a
    line each.

    Finished frames are kept, numbered pictures as they are, and others in a hidden folder beside the film. If the film
    is interrupted, the next call with the same arguments continues it. Frames that depend on anything else, such as
    another scene, camera, option or version, are made anew. The film itself is written whole or not at all.

    Raises InputError if an option is wrong, or if the place cannot be written.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a clpeel.Scene, got {type(scene).__name__}; see clpeel.load")
    output, size, count = checked_output(path), checked_size(size), frames
    check_turntable(output, size, background is None, count, fps, quality, lossless)
    check_technique(technique, options)
    if output.kind == "mp4":
        mp4.check_encoder()
    if bar and not scene.color_maps:
        raise InputError("bar: expected a scene in the colours of numbers with it, got one without; see with_scalars")
    first = checked_camera(scene, camera, size[0] / size[1])
    cameras = first.orbit(count, degrees, up)
    given = {"size": size, "background": background, "lighting": lighting, "keep_color": False, **options}
    map_bar = "scale_bar" in option_names(technique) and bool(given.get("scale_bar", True))
    if map_bar:
        given["scale_bar"] = False  # its own bar lies where each frame alone has room
    request = Request.of(scene, first, technique, given)
    renderer = Renderer(scene, device, lanes)
    gpu = renderer.gpu
    over = axis, bar, map_bar
    drawn_by = gpu.device.name, gpu.lanes
    recipe = recipe_of(VERSION, scene.digest, cameras, technique, request.picture, request.options, over, drawn_by)
    work = _Work(renderer, cameras, technique, given, *over, (device, lanes))
    with folder_of(output) as folder:
        kept = Kept(folder, output.name if output.kind == "png" else "{:06}.png".format, recipe)
        drawn, notes = _draw(kept, work, progress, tell or _silent)
        _write(output, kept, count, float(fps), quality, lossless, progress)
        if output.kind == "png":
            removed = kept.remove_beyond(output, count)
            if removed and tell:
                tell(f"{removed} frame(s) of a longer turntable were removed from '{folder}'")
            return Film(tuple(map(kept.path, range(count))), count, drawn, notes)
    return Film((output.path,), count, drawn, notes)


def _silent(text: str) -> None:
    """Say nothing."""


def check_turntable(
    output: Output, size: Size, transparent: bool, frames: int, fps: float, quality: int, lossless: bool
) -> None:
    """Raise InputError if the options of a film are wrong, each alone or for this kind of film."""
    checks.whole_number("frames", frames, MOST_FRAMES)
    checks.whole_number("quality", quality, 100, 0)
    check_film(output, size, transparent, checks.number(fps))
    if lossless and output.kind != "webp":
        raise InputError("lossless: expected a name ending in .webp with it, as no other film can choose")


def check_technique(technique: str, options: Mapping[str, object]) -> None:
    """Raise InputError if colours would not mean the same in all frames, or for options that films have no use for."""
    if options.get("layers"):
        raise InputError("layers: expected False, as a film shows pictures alone, got True")
    names = option_names(technique)
    if technique == AUTO or "scale_bar" not in names:
        return
    if "thickness_range" not in names:
        raise InputError(
            f"technique: expected one whose colours mean the same in all frames, got {technique!r}, which scales them "
            "by the most of each"
        )
    if options.get("thickness_range") is None:
        raise InputError("thickness_range: expected (low, high), so that colours mean the same in all frames, got none")


# --- the frames -------------------------------------------------------------------------------------------------------


def _draw(
    kept: Kept, work: _Work, progress: Progress | None, tell: Callable[[str], None]
) -> tuple[int, tuple[str, ...]]:
    """Draw the frames that are missing. Returns how many these were, and the notes of all frames."""
    count = len(work.cameras)
    notes = [kept.notes(k) for k in range(count)]
    missing = [k for k in range(count) if notes[k] is None]
    other = sum(os.path.lexists(kept.path(k)) for k in missing)
    if len(missing) < count:
        tell(f"{count - len(missing)} of {count} frames are finished already")
    if other:
        tell(f"{other} of {count} frames are there of another command, model or version; they are made anew")
    if missing and (work.bar or work.map_bar):
        taken, unpaired = taken_by(work, progress)
        work = replace(work, taken=taken, unpaired=unpaired)
    clock = _Clock()
    for at, k in enumerate(missing):
        text = f"frame {k + 1} of {count}{clock.left(at, len(missing))}"
        report = None if progress is None else _within(progress, k, count, text)
        result = work.draw(k, report)
        notes[k] = [*result.stats.notes, *left_out(result.stats, bounded=work.given.get("max_error") is not None)]
        kept.add(k, result.image, notes[k] or ())
    return len(missing), gathered([each or [] for each in notes])


def _within(progress: Progress, k: int, count: int, text: str) -> Progress:
    """Return what takes the progress of frame k."""
    return lambda done, _: progress((k + done) / count * DRAWING, text)


class _Clock:
    """Knows how long frames take. The first one, which may compile kernels, does not count."""

    def __init__(self) -> None:
        self._second: float | None = None

    def left(self, drawn: int, count: int) -> str:
        """Return how long the frames that are left will take, as text, once that is known. drawn: how many are."""
        if drawn == 1:
            self._second = time.monotonic()
        if drawn < 2 or self._second is None:
            return ""
        seconds = (time.monotonic() - self._second) / (drawn - 1) * (count - drawn)
        minutes, rest = divmod(round(seconds), 60)
        return f", {minutes} min {rest} s left" if minutes else f", {rest} s left"


def gathered(notes: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the notes of all frames, each once. Notes of two frames that differ in numbers alone count as one.

    A note that not all frames have says in how many it is.
    """
    found: dict[tuple[str, int], list[str]] = {}
    for each in notes:
        seen = Counter[str]()
        for note in each:
            words = re.sub(r"[0-9][0-9.,e+-]*", "0", note)
            found.setdefault((words, seen[words]), []).append(note)
            seen[words] += 1
    return tuple(
        same[0] if len(same) == len(notes) else f"{same[0]} (in {len(same)} of {len(notes)} frames)"
        for same in found.values()
    )


def taken_by(work: _Work, progress: Progress | None) -> tuple[NDArray[np.bool_], bool]:
    """Return where the model is in any frame, or something else that a scale bar must not cover: bool [height, width].

    Returns also whether any frame has unpaired pixels. Both are found in small pictures of all frames. The model's
    place is larger by one of their pixels than what these show.
    """
    width, height = work.given["size"]
    step = max(max(width, height) // SURVEY_SIDE, 1)
    small = max(width // step, 1), max(height // step, 1)
    found, unpaired = np.zeros((small[1], small[0]), bool), False
    for k, camera in enumerate(work.cameras):
        if progress is not None:
            progress(0.0, f"a place for the bar: view {k + 1} of {len(work.cameras)}")
        given = {**work.given, "size": small, "keep_color": True}
        result = work.renderer.render(camera, technique=work.technique, **given)
        found |= result.color[..., 3] > 0
        unpaired |= bool(result.stats.get("unpaired_pixels"))
    wide = np.pad(found, 1)
    for shift in (-1, 1):
        found = found | np.roll(wide, shift, 0)[1:-1, 1:-1] | np.roll(wide, shift, 1)[1:-1, 1:-1]
    taken: NDArray[np.bool_] = found[np.arange(height) * small[1] // height][:, np.arange(width) * small[0] // width]
    if work.axis:
        taken[box_of(width, height).rows_and_columns] = True
    return taken, unpaired


# --- the film ---------------------------------------------------------------------------------------------------------


def _write(
    output: Output, kept: Kept, count: int, fps: float, quality: int, lossless: bool, progress: Progress | None
) -> None:
    """Make the film of its frames, and write it whole or not at all. Numbered pictures are there already."""
    if output.kind == "png":
        return

    def report(k: int) -> None:
        if progress is not None:
            progress(DRAWING + (k + 1) / count * (1 - DRAWING), f"writing frame {k + 1} of {count}")

    if output.kind == "gif":
        data = gif.encode(kept.image, count, durations(count, fps, 10), report)
    elif output.kind == "webp":
        data = webp.encode(kept.image, count, durations(count, fps, 1), quality, lossless, report)
    else:
        part = os.path.join(kept.folder, "film.mp4")
        mp4.encode(part, kept.image, count, fps, quality, report)
        data = Path(part).read_bytes()
    write_whole(output.path, data)


def durations(count: int, fps: float, unit: int) -> list[int]:
    """Return how many milliseconds each frame is shown, in whole units of so many. They add up to what fps says."""
    ends = [round(1000 * k / fps / unit) * unit for k in range(count + 1)]
    return [end - begin for begin, end in pairwise(ends)]
