"""The window's screen."""

from __future__ import annotations

from clpeel.rendering.options import Size
from clpeel.viewer.viewer import Viewer


def run(viewer: Viewer, title: str, size: Size) -> None:
    """Show the viewer in a window until it is closed."""
    raise NotImplementedError
