"""The viewer: joins the controls, the painter and a screen."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from clpeel.errors import ClpeelError, InputError
from clpeel.rendering.options import Size
from clpeel.rendering.renderer import Renderer
from clpeel.scene.arrays import as_float
from clpeel.scene.camera import Camera, Degrees
from clpeel.scene.scene import Scene
from clpeel.viewer.command_line import Source, command_line
from clpeel.viewer.controls import Controls, Framing, radius_of
from clpeel.viewer.motion import Place
from clpeel.viewer.painter import Frame, Painter
from clpeel.viewer.status import status_of
from clpeel.viewer.view import View

TURN = 24.0
"""Degrees that a turning scene turns by in a second."""

LONGEST_STEP = 0.1
"""The most seconds that a turning scene makes up for in one frame, so that it does not jump after a pause."""

SCREEN = (800, 600)
"""The size of a screen, until it says what it has."""


class Screen(Protocol):
    """Where frames go."""

    def present(self, frame: Frame, status: dict[str, Any]) -> None:
        """Show a frame, or the same one with another status. It is called in the painter's thread, or in another."""

    def save(self, view: View) -> str:
        """Save the full picture of the view. Returns what to say about it."""

    def toggle(self, what: str) -> None:
        """Show or hide the "panel" or the "help"."""


class Viewer:
    """A scene that is looked at. Screens give it events, and it gives them frames.

    say: takes lines for whoever started it, and warn takes errors. source: where the scene came from, for the command
    line. framing: makes the first camera for the size that the screen turns out to have.
    """

    def __init__(
        self,
        scene: Scene,
        view: View,
        device: int | str | None = None,
        lanes: int | None = None,
        source: Source | None = None,
        say: Callable[[str], None] = print,
        warn: Callable[[str], None] = print,
        framing: Framing | None = None,
    ) -> None:
        view.check()
        self.renderer = Renderer(scene, device, lanes)
        self._source, self.say, self.warn = source, say, warn
        self._lock = threading.RLock()
        alpha = float(np.mean(as_float(scene.colors)[..., 3]))
        self._controls = Controls(view, radius_of(scene.bounds), round(alpha, 2), self, SCREEN, framing)
        self._screen: Screen | None = None
        self._frame: Frame | None = None
        self._notice = ""
        self._turned = 0.0
        self._seen = 0.0  # when what was handled last was done, by the screen's clock
        self._painter = Painter(self.renderer, self._on_frame, self._on_error)

    @property
    def view(self) -> View:
        """What is to be shown now."""
        return self._controls.view

    def open(self, screen: Screen) -> None:
        """Take the screen that frames go to."""
        self._screen = screen

    def close(self) -> None:
        """End the painter."""
        self._painter.close()

    def set_ready(self, ready: bool) -> None:
        """Say whether anybody can take a frame. Nothing is drawn while nobody can."""
        self._painter.set_ready(ready)

    # --- what the screen tells ----------------------------------------------------------------------------------------

    def handle(self, event: Mapping[str, Any]) -> None:
        """Do what an event of rendercanvas asks for. A notice is shown until the user does something else."""
        idle = event["event_type"] in ("pointer_move", "pointer_up")
        with self._lock:
            self._seen = event.get("timestamp", 0.0)
            self._change(lambda: self._controls.handle(event), keep=idle)

    def set(self, name: str, value: object, timestamp: float = 0.0) -> None:
        """Change a setting of the panel. timestamp: when the user did, by the screen's clock."""
        with self._lock:
            self._seen = timestamp
            self._change(lambda: self._controls.set(name, value))

    def resize(self, screen: Place, pixels: Size) -> None:
        """Take the size of the screen, in logical pixels and in real ones."""
        self._change(lambda: self._controls.resize(screen, pixels), first=self._frame is None)

    def _change(self, change: Callable[[], None], first: bool = False, keep: bool = False) -> None:
        """Change the view. first: show it even if it stays as it is. keep: keep the notice."""
        with self._lock:
            before, notice, failed = self._controls.view, self._notice, False
            self._notice = notice if keep else ""
            try:
                change()
            except ClpeelError as error:
                self._notice, failed = str(error), True
            after = self._controls.view
            if after.turning and not before.turning:
                self._turned = time.monotonic()
        if after is not before or first:
            self._painter.show(after)
        elif failed or notice != self._notice:
            self.refresh()

    def refresh(self) -> None:
        """Show the latest frame once more, with the status as it is now."""
        frame, screen = self._frame, self._screen
        if frame is not None and screen is not None:
            screen.present(frame, self._status(frame))

    # --- what keys ask for --------------------------------------------------------------------------------------------

    def save(self) -> None:
        """Save the full picture, the way that the screen does it."""
        if self._screen is not None:
            self._notice = self._screen.save(self.view)

    def draw(self, view: View, then: Callable[[Frame | None], None]) -> None:
        """Draw a view in full. then: called in the painter's thread with the frame, or with None after an error."""
        self._painter.draw(view, then)

    def tell(self, text: str) -> None:
        """Print a text, and show it as the notice."""
        with self._lock:
            self._notice = text
        self.say(text)
        self.refresh()

    def print_command(self) -> None:
        """Print the command line that makes this very picture."""
        self.say(self.command)

    def toggle(self, what: str) -> None:
        """Show or hide the "panel" or the "help"."""
        if self._screen is not None:
            self._screen.toggle(what)

    def pick(self, at: Place) -> None:
        """Look at what lies under a place of the screen."""
        screen, camera = self._controls.screen, self.view.camera

        def look(found: Camera | None) -> None:
            def change() -> None:
                if found is None:
                    raise InputError("nothing is under the pointer")
                if self.view.camera is camera:
                    self._controls.look(found)

            self._change(change)

        self._painter.pick(camera, at, screen, look)

    @property
    def command(self) -> str:
        """The command line that makes this very picture."""
        return command_line(self.view, self._source)

    # --- what the painter tells, in its thread ------------------------------------------------------------------------

    def _on_frame(self, frame: Frame) -> None:
        with self._lock:
            self._frame = frame
            self._controls.passes = frame.stats.passes
            status = self._status(frame)
        if self._screen is not None:
            self._screen.present(frame, status)
        if self.view.turning:
            self._turn()

    def _on_error(self, view: View, error: Exception) -> None:
        text = next(iter(str(error).splitlines()), "") or type(error).__name__
        self._notice = text if isinstance(error, ClpeelError) else f"{type(error).__name__}: {text}"
        self.warn(f"error: {self._notice}")
        self.refresh()

    def _turn(self) -> None:
        """Turn the scene by as much as the time since the latest frame asks for."""
        with self._lock:
            now = time.monotonic()
            step, self._turned = min(now - self._turned, LONGEST_STEP), now
            view = self._controls.view
            self._controls.view = replace(view, camera=view.camera.azimuth(Degrees(-TURN * step)))
        self._painter.show(self._controls.view)

    def _status(self, frame: Frame) -> dict[str, Any]:
        """Return the status of a frame. seen: up to when the frame shows what was done; 0 if the view has changed."""
        seen = self._seen if frame.view is self.view else 0.0
        return {**status_of(frame, self.view), "notice": self._notice, "command": self.command, "seen": seen}
