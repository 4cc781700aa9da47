"""Obviously right NumPy twins of the stages between the vertices and the fragments: integers, and float64 elsewhere."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

SUBPIXELS = 256
TILE = 16


def screen(points: NDArray[np.float64], camera, size: tuple[int, int]) -> NDArray[np.float64]:
    """World points to (x right, y down) in subpixels from the image's centre and the view distance: float64 [n, 3]."""
    forward = np.subtract(camera.focal_point, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.view_up)
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)
    arm = points - np.asarray(camera.position)
    x, y, distance = arm @ right, arm @ up, arm @ forward
    half = math.tan(math.radians(camera.view_angle) / 2)
    scale = np.full(len(points), half * camera.distance) if camera.orthographic else half * distance
    pixels = size[1] / 2 / scale
    return np.stack([x * pixels * SUBPIXELS, -y * pixels * SUBPIXELS, distance], axis=1)


def samples(size: tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The sample points' x [width] and y [height] in subpixels from the image's centre."""
    width, height = size
    x = np.arange(width, dtype=np.int64) * SUBPIXELS + SUBPIXELS // 2 - width * SUBPIXELS // 2
    y = np.arange(height, dtype=np.int64) * SUBPIXELS + SUBPIXELS // 2 - height * SUBPIXELS // 2
    return x, y


def coverage(x: NDArray[np.int64], y: NDArray[np.int64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which samples a triangle with these snapped corners covers, by exact integers and the top-left rule."""
    cx, cy = [int(v) for v in x], [int(v) for v in y]
    area = (cx[1] - cx[0]) * (cy[2] - cy[0]) - (cx[2] - cx[0]) * (cy[1] - cy[0])
    if area < 0:
        cx[1], cx[2], cy[1], cy[2] = cx[2], cx[1], cy[2], cy[1]
    sx, sy = samples(size)
    inside = np.full((size[1], size[0]), area != 0)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        dx, dy = cx[b] - cx[a], cy[b] - cy[a]
        value = dx * (sy[:, None] - cy[a]) - dy * (sx[None, :] - cx[a])
        owned = dy < 0 or (dy == 0 and dx > 0)
        inside &= (value > 0) | ((value == 0) & owned)
    return inside


def tiles_met(inside: NDArray[np.bool_]) -> set[int]:
    """The tiles, in rows from the top, that hold a covered sample."""
    columns = -(-inside.shape[1] // TILE)
    rows, cols = np.nonzero(inside)
    return set(((rows // TILE) * columns + cols // TILE).tolist())
