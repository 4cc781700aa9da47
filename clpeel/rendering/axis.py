"""The axes in a corner of a finished picture, turned as its camera is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.pictures.over import put_over
from clpeel.pictures.scale_bar import Box
from clpeel.rendering.renderer import render
from clpeel.scene.axes import axes_scene
from clpeel.scene.camera import Camera

SHARE = 6
"""The picture's smaller side is so many times as long as the axes' side."""

LEAST_SIDE = 48
"""The fewest pixels on a side in which letters can be read. The axes take up at most half of the smaller side."""


def with_axes(
    image: NDArray[Any], camera: Camera, device: int | str | None = None, lanes: int | None = None
) -> NDArray[Any] | str:
    """Return a copy of a picture with the axes in its lower right corner, or a line that says why it has no room.

    image: uint8 [height, width, 4], or another unsigned type, straight alpha. device, lanes: as for `render`.
    """
    height, width = image.shape[:2]
    x, y, side = place_of(width, height)
    if 2 * side > min(width, height):
        return f"no axes: {width} x {height} pixels are too few, they need {2 * LEAST_SIDE} on each side"
    scene, view = axes_scene(camera)
    axes = render(
        scene, view, (side, side), background=None, lighting="headlight", samples=16, device=device, lanes=lanes
    )
    found = np.array(image)
    put_over(found, axes.color, x, y)
    return found


def place_of(width: int, height: int) -> tuple[int, int, int]:
    """Return where the axes' square has its upper left corner, and how long its side is, in pixels."""
    side = max(min(width, height) // SHARE, LEAST_SIDE)
    margin = side // 10
    return width - side - margin, height - side - margin, side


def box_of(width: int, height: int) -> Box:
    """Return the part of a picture of this size that the axes take up."""
    x, y, side = place_of(width, height)
    return Box(x, y, side, side)
