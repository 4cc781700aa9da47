"""Obviously right twins of lines and points: which samples lie within them, and how far away they are, in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twins import screen

Floats = NDArray[np.float64]

SNAPPED = 0.75
"""How far an outline may be off, in subpixels: a corner moves by up to half a subpixel in x and in y, which is 0.71."""

GRID_SNAPPED = 1.45
"""The same for points. Their centres are snapped, and then their corners relative to these."""


@dataclass(frozen=True)
class Stroke:
    """A line or a point. inside: how far each sample is within its outline, in subpixels, negative outside, [height,
    width]. distance: the view distance of what is nearest to the sample, [height, width].
    """

    inside: Floats
    distance: Floats


MIDDLE = (0.5, 0.5)
"""The middle of a pixel, from its upper left corner."""


def grid(size: tuple[int, int], place: tuple[float, float] = MIDDLE) -> tuple[Floats, Floats]:
    """The samples' places: x [1, width] and y [height, 1] in subpixels from the image's centre.

    place: where in each pixel its sample is, right and down from the upper left corner, in pixels.
    """
    x, y = screen.samples(size)
    return x[None, :] + 256 * (place[0] - 0.5), y[:, None] + 256 * (place[1] - 0.5)


def nothing(size: tuple[int, int]) -> Stroke:
    """A stroke that is not there."""
    shape = size[1], size[0]
    return Stroke(np.full(shape, -np.inf), np.full(shape, np.nan))


def cut(a: Floats, b: Floats, camera, near: float, far: float) -> tuple[Floats, Floats] | None:
    """A segment's ends between two view distances, or None if nothing is left."""
    forward = np.subtract(camera.focal_point, camera.position)
    forward = forward / np.linalg.norm(forward)
    da, db = ((point - np.asarray(camera.position)) @ forward for point in (a, b))
    first, last = 0.0, 1.0
    for sa, sb in ((da - near, db - near), (far - da, far - db)):
        if sa < 0 and sb < 0:
            return None
        if sa < 0:
            first = max(first, sa / (sa - sb))
        elif sb < 0:
            last = min(last, sa / (sa - sb))
    return (a + first * (b - a), a + last * (b - a)) if first < last else None


def line(a: Floats, b: Floats, camera, size: tuple[int, int], half, near: float, far: float, place=MIDDLE) -> Stroke:
    """A segment without joints. half: a function of the view distance, half the width there in subpixels.

    place: as for `grid`.
    """
    ends = cut(a, b, camera, near, far)
    if ends is None:
        return nothing(size)
    (ax, ay, az), (bx, by, bz) = screen.screen(np.array(ends), camera, size)
    length = np.hypot(bx - ax, by - ay)
    if length == 0:
        return nothing(size)
    ux, uy = (bx - ax) / length, (by - ay) / length
    x, y = grid(size, place)
    along = (x - ax) * ux + (y - ay) * uy
    across = np.abs((x - ax) * -uy + (y - ay) * ux)
    wide_a, wide_b = half(az), half(bz)
    slope = np.hypot(1, (wide_b - wide_a) / length)  # the sides of a line in scene units are not parallel
    sides = (wide_a + (wide_b - wide_a) * along / length - across) / slope
    share = np.clip(along / length, 0, 1)
    distance = az + share * (bz - az) if camera.orthographic else 1 / ((1 - share) / az + share / bz)
    return Stroke(np.minimum(np.minimum(along, length - along), sides), distance)


def point(
    at: Floats, camera, size: tuple[int, int], half, near: float, far: float, square: bool, place=MIDDLE
) -> Stroke:
    """A square or a disc around a point. place: as for `grid`."""
    (px, py, pz), *_ = screen.screen(at[None], camera, size)
    if not near <= pz <= far:
        return nothing(size)
    x, y = grid(size, place)
    radius = np.maximum(np.abs(x - px), np.abs(y - py)) if square else np.hypot(x - px, y - py)
    return Stroke(half(pz) - radius, np.full(radius.shape, pz))


def to_polyline(corners: Floats, size: tuple[int, int], place: tuple[float, float] = MIDDLE) -> Floats:
    """How far each sample is from a polyline whose corners [n, 2] are on the screen, in subpixels, [height, width].

    place: as for `grid`.
    """
    x, y = grid(size, place)
    found = np.full((size[1], size[0]), np.inf)
    for (ax, ay), (bx, by) in zip(corners[:-1], corners[1:], strict=True):
        length2 = (bx - ax) ** 2 + (by - ay) ** 2
        share = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2, 0, 1)
        found = np.minimum(found, np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)))
    return found
