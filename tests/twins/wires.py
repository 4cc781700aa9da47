"""Obviously right twins of edges: how much of each pixel their strokes cover, in float64."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twins import screen, strokes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDING = 2.0**-20
"""How far a stroke may be off, in shares of the largest coordinate of its ends: these are float32, which are off by
2^-25 of it, and a distance adds up eight products and sums of them. Edges are not snapped."""


def hull(points: Floats) -> Ints:
    """The faces of the convex hull of a few points in general position, counterclockwise from outside, [f, 3]."""
    n = len(points)
    a, b, c = (each.reshape(-1) for each in np.meshgrid(*[np.arange(n)] * 3, indexing="ij"))
    faces = np.stack([a, b, c], axis=1)[(a < b) & (a < c) & (b != c)]
    normal = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    height = np.einsum("fk,fnk->fn", normal, points[None] - points[faces[:, :1]])
    height[np.arange(len(faces))[:, None], faces] = -1
    return faces[(height < 0).all(axis=1)]


def edges(faces: Ints) -> Ints:
    """The edges of faces that share vertices, [e, 2]."""
    return np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def segments(vertices: Floats, ends: Ints, camera: Any, size: tuple[int, int], near: float, far: float) -> Floats:
    """Edges on the screen: x and y in subpixels from the image's centre, and distance, [e, 2, 3]; NaN if cut off."""
    found = np.full((len(ends), 2, 3), np.nan)
    for k, (a, b) in enumerate(vertices[ends]):
        cut = strokes.cut(a, b, camera, near, far)
        if cut is not None:
            found[k] = screen.screen(np.array(cut), camera, size)
    return found


def stroke_over(distance: Floats, half: Floats, unit: float) -> Floats:
    """The part of a stroke within half a unit of places at this distance from its middle, in units."""
    return np.maximum(np.minimum(distance + unit / 2, half) - np.maximum(distance - unit / 2, -half), 0) / unit


def nearest(segment: Floats, x: Any, y: Any) -> tuple[Floats, Floats]:
    """How far places are from a segment [2, 3], and how far along it the nearest of its places is, 0 .. 1."""
    (ax, ay, _), (bx, by, _) = segment
    length2 = (bx - ax) ** 2 + (by - ay) ** 2
    share = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / (length2 or 1.0), 0, 1)
    return np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)), share


def covered(segment: Floats, half: Any, x: Any, y: Any, unit: float = 256.0) -> Floats:
    """How much of the units around these places an edge covers. half: half its width by view distance, in subpixels.

    Where widths are of scene units they are in proportion to 1 / distance, which runs evenly along the screen.
    """
    if np.isnan(segment).any():
        return np.zeros(np.broadcast(x, y).shape)
    distance, share = nearest(segment, x, y)
    first, last = half(segment[0, 2]), half(segment[1, 2])
    return stroke_over(distance, first + share * (last - first), unit)


def inside(corners: Floats, x: Any, y: Any) -> Floats:
    """How far places are within triangles [f, 3, 2] of the screen, in subpixels, negative outside: [f, h, w]."""
    found = []
    for triangle in corners:
        a, b, c = triangle
        turn = np.sign((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]) or 1.0
        sides = [
            turn * ((q - p)[0] * (y - p[1]) - (q - p)[1] * (x - p[0])) / (np.hypot(*(q - p)) or 1.0)
            for p, q in ((a, b), (b, c), (c, a))
        ]
        found.append(np.minimum(np.minimum(sides[0], sides[1]), sides[2]))
    return np.array(found)


def over(share: Any, edge: Any, color: Any) -> Floats:
    """Premultiplied RGBA of an edge that covers a share of a place, over premultiplied RGBA."""
    share = np.asarray(share)[..., None]
    return np.concatenate([np.asarray(edge, float), [1.0]]) * share + (1 - share) * color
