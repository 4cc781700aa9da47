"""`clpeel.view`: looks at a scene, in a window, a browser or a notebook."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Literal, cast

from clpeel.checks import GivenBackground, checked_background, checked_size, one_of
from clpeel.errors import InputError
from clpeel.rendering.options import BACKGROUND, Lighting, Size
from clpeel.rendering.request import checked_options
from clpeel.scene.camera import GivenCamera, checked_camera
from clpeel.scene.scene import Scene
from clpeel.viewer.view import View

if TYPE_CHECKING:
    from clpeel.viewer.command_line import Source
    from clpeel.viewer.controls import Framing

Backend = Literal["window", "browser", "notebook"]
BACKENDS = ("window", "browser", "notebook")

EXTRA = "pip install 'clpeel[view]'"

NEEDS = {
    "window": ("rendercanvas", "glfw", "wgpu"),
    "browser": ("rendercanvas", "uvicorn", "websockets", "simplejpeg"),
    "notebook": ("rendercanvas", "anywidget", "simplejpeg"),
}
"""The packages that each backend needs, by the names that they are imported by."""

QT = ("PySide6", "PyQt6")
"""Packages for Qt, by the names that they are imported by. With one of them a window needs neither glfw nor wgpu."""


def view(
    scene: Scene,
    camera: GivenCamera | Framing | None = None,
    size: Size = (1024, 768),
    technique: str = "sort",
    background: GivenBackground = BACKGROUND,
    lighting: Lighting = "kit",
    *,
    backend: Backend | None = None,
    turning: bool = False,
    host: str = "127.0.0.1",
    port: int = 0,
    open_page: bool = True,
    title: str = "clpeel",
    device: int | str | None = None,
    lanes: int | None = None,
    source: Source | None = None,
    warn: Callable[[str], None] | None = None,
    **options: Any,
) -> object:
    """Look at a scene.

    In a window or a browser, this returns when the window is closed or with Ctrl-C. In a notebook it returns the
    widget, which the cell shows. The first arguments and the options are those of `clpeel.render`.

    camera: as for `clpeel.render`, or a function that makes it for a picture of (width, height) pixels. By default all
    is in view. backend: by default "notebook" in one, "window" where there is a display, else "browser". size: of the
    window or the widget, in logical pixels; a page fills its browser. turning: whether the scene turns by itself. host,
    port, open_page: of the page: the address it listens on, 0 for any free port, and whether to open it in the user's
    browser. title: of the window or the page. source: the command that the key C prints; by default it prints Python.
    warn: takes errors while the scene is looked at, a line each; by default they go to standard error.

    Raises InputError if an option is wrong, or if the backend lacks a package or cannot open its window.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene: expected a clpeel.Scene, got {type(scene).__name__}; see clpeel.load")
    size = checked_size(size)
    chosen = checked_backend(backend)
    framing = framing_of(scene, camera)
    camera = framing(size)
    checked_options(technique, {"size": size, "background": background, "lighting": lighting, **options})
    shown = View(camera, size, technique, options, checked_background(background), lighting, turning=turning)
    from clpeel.viewer.viewer import Viewer

    warn = warn or (lambda text: print(text, file=sys.stderr))
    viewer = Viewer(scene, shown, device, lanes, source, warn=warn, framing=framing)
    if chosen == "browser":
        from clpeel.viewer.browser import serve

        serve(viewer, title, host, port, open_page and has_display(), print)
        return None
    if chosen == "notebook":
        from clpeel.viewer.notebook import widget

        return widget(viewer, size)
    from clpeel.viewer.window import run

    run(viewer, title, size)
    return None


def framing_of(scene: Scene, camera: GivenCamera | Framing | None) -> Framing:
    """Return the function that makes the first camera for a screen. Raises InputError if it is no camera."""
    if callable(camera):
        return camera
    checked_camera(scene, camera, 1.0)
    return lambda pixels: checked_camera(scene, camera, pixels[0] / pixels[1])


def checked_backend(backend: str | None) -> Backend:
    """Return the backend to use. Raises InputError if there is no such backend, or if it lacks a package."""
    if backend is not None:
        one_of("backend", backend, BACKENDS)
        check_packages(backend)
        return cast(Backend, backend)
    if in_notebook() and not missing("notebook"):
        return "notebook"
    if has_display() and not missing("window"):
        return "window"
    check_packages("browser")
    return "browser"


def check_packages(backend: str) -> None:
    """Raise InputError if the backend lacks a package."""
    lacking = missing(backend)
    if lacking:
        raise InputError(f"view: expected {' and '.join(lacking)} for a {backend}, got none; {EXTRA}")


def missing(backend: str) -> list[str]:
    """Return the packages that the backend lacks."""
    needs = NEEDS[backend]
    if backend == "window" and any(find_spec(name) is not None for name in QT):
        needs = needs[:1]
    return [name for name in needs if find_spec(name) is None]


def has_display() -> bool:
    """Return whether this process can open a window."""
    if sys.platform in ("win32", "darwin"):
        return "SSH_CONNECTION" not in os.environ
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def in_notebook() -> bool:
    """Return whether this is a cell of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")
