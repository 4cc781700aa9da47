"""The painter: a thread that draws the latest view, coarsely while the hand moves and fully once it rests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.result import Stats
from clpeel.scene.camera import Camera
from clpeel.viewer.coarse import coarse_scene
from clpeel.viewer.heat import error_map
from clpeel.viewer.motion import Place, focused, through
from clpeel.viewer.pace import AIM, Pace
from clpeel.viewer.view import LAYER_COUNT, View

REST = 0.08
"""Seconds without a new view after which the hand rests. The full picture is then drawn, and comes soon after."""

GEOMETRY = ("projection", "binning")
"""The stages whose time hardly depends on the resolution."""

HEAVY = 0.6 * AIM
"""If the geometry alone takes more seconds than this, frames are drawn of a coarser scene while the hand moves."""

HEAVY_FRAMES = 5
"""So many frames in a row must show that the geometry is heavy, as any one of them may have been held up."""


class _Newer(Exception):
    """There is a newer view, so the picture under way is not needed."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture of a view.

    image: uint8 [height, width, 4], of the view's size times scale. full: whether it is what `render` draws of this
    view; else it is what there was time for. seconds: that drawing took. coarse: whether a coarser scene was drawn.
    errors: the maximum and the RMS error, of 1, of a heat map of errors. notes: what the picture lacks, and why.
    """

    view: View
    image: NDArray[np.uint8]
    stats: Stats
    full: bool
    scale: float
    seconds: float
    coarse: bool = False
    errors: tuple[float, float] | None = None

    @property
    def notes(self) -> list[str]:
        return self.stats.notes


class Painter:
    """Draws in a thread of its own. Only the latest view is kept: there is no queue that could grow.

    on_frame: called in the painter's thread with each frame. on_error: called there with the view that cannot be drawn,
    and the error. Both must not wait.
    """

    def __init__(
        self,
        renderer: Renderer,
        on_frame: Callable[[Frame], None],
        on_error: Callable[[View, Exception], None],
    ) -> None:
        self._renderer = renderer
        self._on_frame, self._on_error = on_frame, on_error
        self._pace = Pace()
        self._coarse: Renderer | None = None
        self._coarsening: threading.Thread | None = None
        self._heavy = 0  # frames in a row whose geometry was
        self._changed = threading.Condition()
        self._view: View | None = None
        self._number = 0  # of the latest view
        self._moved = 0.0  # when it came
        self._drafted = self._finished = 0  # the numbers of the latest views that were drawn coarsely, and fully
        self._last: Frame | None = None
        self._errands: dict[str, Callable[[], None]] = {}  # what to do before anything else, the latest of each kind
        self._ready = True
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="clpeel painter", daemon=True)
        self._thread.start()

    def show(self, view: View) -> None:
        """Take a view in place of all before."""
        with self._changed:
            self._view, self._moved = view, time.monotonic()
            self._number += 1
            self._changed.notify()

    def set_ready(self, ready: bool) -> None:
        """Say whether anybody can take a frame. Nothing is drawn while nobody can."""
        with self._changed:
            self._ready = ready
            self._changed.notify()

    def pick(self, camera: Camera, at: Place, size: Place, then: Callable[[Camera | None], None]) -> None:
        """Find what lies under a place of the screen. then: called with the camera that has it in the middle, or None.

        It is called in the painter's thread.
        """
        with self._changed:
            self._errands["pick"] = lambda: then(self._focused(camera, at, size))
            self._changed.notify()

    def draw(self, view: View, then: Callable[[Frame | None], None]) -> None:
        """Draw a view in full, even if there are newer ones. then: called with the frame, or None after an error.

        It is called in the painter's thread. Both come before the painter ends.
        """
        with self._changed:
            self._errands["draw"] = lambda: then(self._whole(view))
            self._changed.notify()

    def close(self) -> None:
        """End the thread. A picture under way is given up, but not one that `draw` asked for."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    # --- in the painter's thread --------------------------------------------------------------------------------------

    def _run(self) -> None:
        while (task := self._next()) is not None:
            task()

    def _next(self) -> Callable[[], None] | None:
        """Wait for something to do, and return it. None means that it is time to end."""
        with self._changed:
            while True:
                if self._errands:
                    return self._errands.pop(next(iter(self._errands)))
                if self._closed:
                    return None
                wait = None
                if self._view is not None and self._ready:
                    if self._drafted < self._number:
                        return self._task(self._view, full=False)
                    wait = self._moved + REST - time.monotonic()
                    if self._finished == self._number:
                        wait = None
                    elif wait <= 0:
                        return self._task(self._view, full=True)
                self._changed.wait(wait)

    def _task(self, view: View, full: bool) -> Callable[[], None]:
        number = self._number

        def paint() -> None:
            try:
                frame = self._finish(view, number) if full else self._draft(view)
            except _Newer:
                return
            except Exception as error:  # the viewer stays, and shows what went wrong
                self._drafted = self._finished = number
                self._on_error(view, error)
                return
            self._drafted = number
            if full:
                self._finished = number
            self._last = frame
            self._on_frame(frame)

        return paint

    def _draft(self, view: View) -> Frame:
        """Draw the view at the resolution that keeps the frame within its time."""
        renderer = self._coarse or self._renderer
        kind: Hashable = (renderer is self._coarse, view.technique, view.shows, repr(sorted(view.keywords().items())))
        width, height = view.size
        scale = self._pace.scale(kind, width * height)
        size = (max(round(width * scale), 1), max(round(height * scale), 1))
        small = replace(view, size=size).with_option("samples", None)
        frame = replace(self._paint(renderer, small), view=view, scale=scale, coarse=renderer is self._coarse)
        stages = frame.stats.seconds
        geometry = min(sum(stages.get(stage, 0.0) for stage in GEOMETRY), frame.seconds)
        drawing = sum(seconds for stage, seconds in stages.items() if stage not in (*GEOMETRY, "host", "total"))
        if view.shows == "error":  # most of it is done on the host, for each pixel
            drawing = frame.seconds - geometry
        self._pace.learn(kind, size[0] * size[1], frame.seconds - drawing, drawing)
        self._heavy = self._heavy + 1 if geometry > HEAVY and not frame.coarse else 0
        if self._heavy >= HEAVY_FRAMES and self._coarsening is None:
            self._coarsening = threading.Thread(target=self._coarsen, args=(geometry,), daemon=True)
            self._coarsening.start()
        return frame

    def _finish(self, view: View, number: int) -> Frame:
        """Draw the view as `render` does. A newer view ends this."""
        last = self._last
        if last is not None and last.view is view and last.scale == 1 and not last.coarse:
            if view.options.get("samples", 1) == 1 or view.shows == "error":  # errors have one sample a pixel
                return replace(last, full=True)  # it is the full picture already

        def check(done: float, text: str) -> None:
            if self._number != number or self._closed:
                raise _Newer

        frame = self._paint(self._renderer, view, check)
        return replace(frame, full=True)

    def _whole(self, view: View) -> Frame | None:
        """Draw the view in full, unless the latest frame is just that. Returns None after an error."""
        last = self._last
        if last is not None and last.full and last.view is view:
            return last
        try:
            return replace(self._paint(self._renderer, view), full=True)
        except Exception as error:
            self._on_error(view, error)
            return None

    def _paint(self, renderer: Renderer, view: View, progress: Callable[[float, str], None] | None = None) -> Frame:
        begun = time.perf_counter()
        renderer.set_opacity(view.opacity)
        errors = None
        if view.shows == "error":
            found = error_map(renderer, view, progress)
            image, stats, errors = found.image, found.stats, (found.max_error, found.rms_error)
        else:
            technique = LAYER_COUNT if view.shows == "layers" else view.technique
            keywords = {"keep_color": False, **view.keywords(technique)}
            drawn = renderer.render(view.camera, technique=technique, progress=progress, **keywords)
            image, stats = drawn.image, drawn.stats
        return Frame(view, image, stats, False, 1.0, time.perf_counter() - begun, errors=errors)

    def _coarsen(self, geometry: float) -> None:
        """Make the coarser scene, whose geometry takes HEAVY / 3 seconds if this scene's takes `geometry`."""
        scene = self._renderer.scene
        coarse = coarse_scene(scene, max(int(len(scene.faces) * HEAVY / 3 / geometry), 1000))
        if len(coarse.faces) < len(scene.faces) / 1.5:
            self._coarse = self._renderer.beside(coarse)

    def _focused(self, camera: Camera, at: Place, size: Place) -> Camera | None:
        """Return the camera with what lies under a place of the screen in the middle, or None if nothing does."""
        try:
            one = self._renderer.render(through(camera, at, size), (1, 1), "sort", lighting="none", layers=True)
        except InputError:
            return None
        return focused(camera, float(one.layers.depth[0]), at, size) if len(one.layers) else None
