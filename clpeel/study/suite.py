"""The suite: compares the techniques on a standard set of scenes, one after the other."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from clpeel.checks import whole_number
from clpeel.device.devices import find_device
from clpeel.errors import ClpeelError
from clpeel.rendering.options import PictureOptions, Size
from clpeel.rendering.request import Progress, check_picture_fits
from clpeel.study.compare import HOST_BYTES, LEFT_OUT, MOST_FRAMES, chosen_names, chosen_trials, compare
from clpeel.study.comparison import Comparison, Interrupted
from clpeel.study.scenes import NAMES, StandardScene, dragon_file, models_folder, standard_scenes
from clpeel.study.standings import Chapter, InterruptedSuite, SuiteComparison

PAGE_SIDE = 400
"""The most pixels a side of the pictures that are kept for a page. There are hundreds of them."""

TRUTH_BYTES = 8 * 4
"""Host memory of a pixel of a finished scene, in bytes: its truth."""

SOON = 10.0
"""Seconds before which nobody knows how long it takes."""


def compare_suite(
    scenes: Iterable[str] | None = None,
    size: Size = (1024, 1024),
    techniques: Iterable[str] | None = None,
    precisions: Iterable[str] | None = None,
    budgets: Iterable[int] = (),
    frames: int = 5,
    *,
    models: str | os.PathLike[str] | None = None,
    memory: int | str | None = None,
    device: int | str | None = None,
    lanes: int | None = None,
    pictures: bool = False,
    progress: Progress | None = None,
) -> SuiteComparison:
    """Compare the techniques on every scene of the suite, over white (see `compare`), and rank them.

    scenes: names in `clpeel.study.scenes.NAMES`; by default all.
    models: the folder of the dragon's file, dragon_vrip.ply.gz. By default it is `models` in the folder that the
    environment variable CLPEEL_SHARED names. Without the file, the dragon is left out, unless `scenes` has it.
    pictures: whether pictures are kept, of at most PAGE_SIDE pixels a side, which `to_html` needs.
    All other parameters are those of `compare`.

    A scene that cannot be drawn is left out, and a note says why. Raises InputError if a parameter is invalid, and the
    first scene's error if none can be drawn. Raises InterruptedSuite, a KeyboardInterrupt with what is finished, on
    Ctrl-C.
    """
    chosen = check_scenes(scenes, models)
    picture = PictureOptions(size=size, memory=memory)
    frames = whole_number("frames", frames, MOST_FRAMES)
    techniques, precisions, budgets = kept(techniques), kept(precisions), tuple(budgets)
    notes = chosen_trials(techniques, precisions, budgets)[1]
    check_picture_fits(picture.size, HOST_BYTES + TRUTH_BYTES * len(chosen))
    find_device(device)
    chapters: list[Chapter] = []
    errors: list[ClpeelError] = []
    clock = _Clock(progress, len(chosen))
    if techniques is None:
        notes.append(LEFT_OUT)
    try:
        for scene in chosen:
            clock.begin(scene.name)
            try:
                comparison = compare(
                    scene.make(),
                    scene.camera,
                    picture.size,
                    techniques,
                    precisions,
                    budgets,
                    frames,
                    lighting=scene.lighting,
                    memory=memory,
                    device=device,
                    lanes=lanes,
                    pictures=pictures,
                    progress=clock.report,
                )
            except ClpeelError as error:
                errors.append(error)
                notes.append(f"left out: {scene.name}: {error}")
            else:
                chapters.append(chapter_of(scene, comparison))
    except KeyboardInterrupt as interrupt:
        notes.append(f"interrupted in {scene.name}")
        if isinstance(interrupt, Interrupted):
            chapters.append(chapter_of(scene, interrupt.comparison))
        if not chapters:
            raise
        raise InterruptedSuite(SuiteComparison(chapters, tuple(notes))) from None
    if not chapters:
        raise errors[0]
    return SuiteComparison(chapters, tuple(notes))


def kept(names: Iterable[str] | None) -> tuple[str, ...] | None:
    """Return names that can be gone through more than once. A text is one name."""
    return None if names is None else (names,) if isinstance(names, str) else tuple(names)


def check_scenes(names: Iterable[str] | None, models: str | os.PathLike[str] | None) -> list[StandardScene]:
    """Return the scenes of these names, in the suite's order. None means all.

    Raises InputError if a name is not known, or if the dragon is among the names and its file is not there.
    """
    folder = models_folder(models)
    chosen = chosen_names("scenes", names, NAMES)
    if names is not None and "dragon" in chosen:
        dragon_file(folder)
    known = standard_scenes(folder)
    return [known[name] for name in chosen]


def chapter_of(scene: StandardScene, comparison: Comparison) -> Chapter:
    """Return a scene's comparison, whose pictures, if it has any, are kept in a reduced size."""
    pictures = {row.name: reduced(row.image) for row in comparison.rows if row.image is not None}
    if pictures:
        pictures["truth"] = reduced(comparison.truth_image())
    rows = [replace(row, image=None, error=None) for row in comparison.rows]
    return Chapter(scene.name, scene.about, replace(comparison, rows=rows), pictures)


def reduced(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture [height, width, 4] of at most PAGE_SIDE pixels a side, each the mean of those that it covers."""
    height, width = image.shape[:2]
    share = min(PAGE_SIDE / max(width, height), 1.0)
    size = (max(round(width * share), 1), max(round(height * share), 1))
    return image if share == 1 else np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX))


class _Clock:
    """Reports how much of all scenes is done, each as much as any other, and about how much time is left."""

    def __init__(self, progress: Progress | None, count: int) -> None:
        self.progress, self.count = progress, count
        self.begun, self.started, self.name = 0, time.monotonic(), ""

    def begin(self, name: str) -> None:
        """Begin the next scene."""
        self.name = name
        self.begun += 1
        self.report(0.0, "making it")

    def report(self, part: float, text: str) -> None:
        """Report the progress of the scene."""
        if self.progress is None:
            return
        done = (self.begun - 1 + part) / self.count
        left = time_left(time.monotonic() - self.started, done)
        self.progress(done, ", ".join(filter(None, (left, f"{self.name}: {text}"))))


def time_left(elapsed: float, done: float) -> str:
    """Return the seconds that are left as text, such as `12 min left`, if `done` (0..1) took so many; or no text."""
    if elapsed < SOON or not 0 < done < 1:
        return ""
    left = elapsed * (1 - done) / done
    if left < 60:
        return f"{left:.0f} s left"
    return f"{left / 60:.0f} min left" if left < 3600 else f"{left / 3600:.1f} h left"
