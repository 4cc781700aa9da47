"""The window's screen: rendercanvas on glfw and wgpu, or on Qt."""

from __future__ import annotations

import contextlib
import signal
import sys
import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from clpeel.errors import InputError
from clpeel.rendering.options import Size
from clpeel.viewer.bitmap import EVENTS, BitmapScreen
from clpeel.viewer.open import NEEDS, QT
from clpeel.viewer.viewer import Viewer

MOST_FPS = 60
"""How often in a second events are taken, and frames are shown."""


def run(viewer: Viewer, title: str, size: Size) -> None:
    """Show the viewer in a window until that is closed, or until Ctrl-C.

    In a program that runs an event loop of its own, this returns at once, and the window stays. size: (width, height)
    in logical pixels. Raises InputError if no window can be opened here.
    """
    try:
        canvas, loop = _opened(viewer, title, size)
    except Exception as error:
        viewer.close()
        reason = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise InputError(
            f"window: expected a screen with a window to draw in: {reason}; try --backend browser"
        ) from None
    try:
        run_loop(canvas, loop)
    finally:
        if canvas.get_closed():
            viewer.close()


def run_loop(canvas: Any, loop: Any) -> None:
    """Run rendercanvas's loop until the window is closed, or until Ctrl-C.

    rendercanvas closes the window at once with Ctrl-C, even in the midst of a frame, and wgpu then ends the process. So
    here the window is closed after the frame.
    """
    running = True

    def take_over() -> None:
        if running and signal.getsignal(signal.SIGINT) not in (None, signal.SIG_IGN, signal.SIG_DFL):
            with contextlib.suppress(ValueError):  # other threads than the main one cannot do this
                signal.signal(signal.SIGINT, lambda number, frame: loop.call_soon(canvas.close))

    loop.call_soon(take_over)
    loop.run()  # at the end it brings back the handler that there was
    running = False


def _opened(viewer: Viewer, title: str, size: Size) -> tuple[Any, Any]:
    """Open a window. Returns the canvas and the loop. Raises any exception if that fails."""
    qt = chosen_qt()
    if qt is None:
        check_glfw()
        check_adapter()
        backend = import_module("rendercanvas.glfw")
    else:
        import_module(f"{qt}.QtWidgets")
        backend = import_module("rendercanvas.qt")
    canvas = backend.RenderCanvas(size=size, title=title, update_mode="ondemand", max_fps=MOST_FPS)
    try:
        screen = WindowScreen(viewer, canvas, backend.loop)
    except Exception:
        canvas.close()
        raise
    if qt is None:
        canvas.add_event_handler(Typed(screen.handle).handle, *EVENTS, "char")
    else:
        canvas.add_event_handler(screen.handle, *EVENTS)
    return canvas, backend.loop


class WindowScreen(BitmapScreen):
    """A screen that shows a frame as soon as it is there. rendercanvas would wait for its next turn, for 20 ms."""

    def _draw_soon(self) -> None:
        self._canvas.force_draw()


def chosen_qt() -> str | None:
    """Return the package for Qt to use, or None for glfw: one that is imported already, or any if glfw is missing."""
    imported = [name for name in QT if name in sys.modules]
    if imported or all(find_spec(name) is not None for name in NEEDS["window"]):
        return next(iter(imported), None)
    return next((name for name in QT if find_spec(name) is not None), None)


def check_glfw() -> None:
    """Raise RuntimeError if glfw cannot open a window. Without this, glfw would end the process."""
    import glfw

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        window = None
        if glfw.init():
            glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
            glfw.window_hint(glfw.VISIBLE, False)
            window = glfw.create_window(1, 1, "", None, None)
        if window:
            glfw.destroy_window(window)
            return
    reason = str(said[0].message) if said else "glfw cannot open a window"
    raise RuntimeError(reason.partition(" b'")[2].rstrip("'") or reason)


def check_adapter() -> None:
    """Raise an exception if wgpu cannot draw in a window. Without this, wgpu would end the process at the first frame.

    With OpenGL alone it finds an adapter, but not one for windows.
    """
    import wgpu

    adapter = wgpu.gpu.request_adapter_sync(power_preference="high-performance")
    if adapter.info["backend_type"] == "OpenGL":
        raise RuntimeError("there is no driver for Vulkan")


class Typed:
    """Turns the keys of glfw into what they type, as glfw names keys by their places on an American keyboard."""

    def __init__(self, then: Callable[[Mapping[str, Any]], None]) -> None:
        self._then = then
        self._pressed = False  # whether a key went down that may type something. While it is held, it types again.

    def handle(self, event: Mapping[str, Any]) -> None:
        """Pass an event on, unless it is a key that types something: pass on what it types."""
        if event["event_type"] == "key_down" and len(event["key"]) == 1:
            self._pressed = True
        elif event["event_type"] != "char":
            self._then(event)
        elif self._pressed:
            self._pressed = False
            self._then({"event_type": "key_down", "key": event["data"], "modifiers": ()})
