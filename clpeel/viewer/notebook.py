"""The notebook's screen."""

from __future__ import annotations

from clpeel.rendering.options import Size
from clpeel.viewer.viewer import Viewer


def widget(viewer: Viewer, size: Size) -> object:
    """Return the widget that shows the viewer."""
    raise NotImplementedError
