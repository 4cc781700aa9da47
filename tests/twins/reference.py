"""The float64 twin: casts a ray through every pixel centre and composites what it hits, in NumPy alone.

Nothing here is shared with clpeel: it reads the fields of a scene and of a camera, and works out the view anew.
Screen coordinates have their origin in the middle of the image, x to the right, y down, in pixels; the sample of pixel
(row r, column c) lies at (c + 0.5 - width / 2, r + 0.5 - height / 2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from twins.materials import Places, Roundings, paint, paint_range
from twins.textures import Footprint

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

UNIT = 2.0**-24  # unit roundoff of float32
SNAP = 1 / 512  # the farthest that rounding to 1/256 pixel moves a vertex, in x and in y
PAIRS = 1 << 20  # (triangle, pixel) pairs looked at in one go


class Surface(Protocol):
    """What the twin reads of a scene (clpeel.Scene has these fields)."""

    @property
    def vertices(self) -> NDArray[Any]: ...
    @property
    def faces(self) -> NDArray[Any]: ...
    @property
    def face_colors(self) -> NDArray[Any] | None: ...
    @property
    def vertex_colors(self) -> NDArray[Any] | None: ...
    @property
    def color(self) -> Any: ...
    @property
    def materials(self) -> Any: ...
    @property
    def face_materials(self) -> NDArray[Any] | None: ...
    @property
    def uv(self) -> NDArray[Any] | None: ...
    @property
    def single_sided(self) -> NDArray[Any] | None: ...


class View(Protocol):
    """What the twin reads of a camera (clpeel.Camera has these fields)."""

    @property
    def position(self) -> Any: ...
    @property
    def focal_point(self) -> Any: ...
    @property
    def view_up(self) -> Any: ...
    @property
    def view_angle(self) -> float: ...
    @property
    def clipping_range(self) -> Any: ...
    @property
    def orthographic(self) -> bool: ...


@dataclass(frozen=True)
class Projected:
    """Triangles in homogeneous screen coordinates, without those that have a vertex that is not finite."""

    number: Integers  # [m] index of each triangle in the scene
    corners: Floats  # [m, 3 corners, 3] homogeneous (x, y, w), pixels once divided by w
    distance: Floats  # [m, 3 corners] view distance, along the view axis
    colors: Floats  # [m, 3 corners, 4] straight RGBA, 0..1
    uv: Floats  # [m, 3 corners, 2] texture coordinates; zeros where the scene has none
    edges: Floats  # [m, 3, 3] edge k, opposite corner k, is zero where edges[k] . (x, y, 1) = 0
    clipping: tuple[float, float]  # nearest and farthest view distance that is drawn
    orthographic: bool
    to_shade: Floats | None = None  # [m, 2] how far from samples, right and down in pixels, hits are shaded


@dataclass(frozen=True)
class Picture:
    """What the twin makes. h rows, w columns, n hits, front to back within each pixel."""

    color: Floats  # [h, w, 4] premultiplied RGBA, 0..1, before the background
    layers: Integers  # [h, w] hits under each sample
    bound: Floats  # [h, w] how far float32 compositing may stray, see `composite`
    pixel: Integers  # [n] row * w + column
    distance: Floats  # [n] view distance
    triangle: Integers  # [n] index into `projected`
    rgba: Floats  # [n, 4] straight RGBA
    projected: Projected
    cut: tuple[Integers, Integers]  # pixel and triangle of hits that a material says are not there


def unit(vector: Floats) -> Floats:
    """The vector, made one long."""
    return vector / np.linalg.norm(vector)


def cross(a: Floats, b: Floats) -> Floats:
    """a x b over the last axis; exactly -(b x a), so that both triangles at an edge see the same one."""
    ax, ay, az = np.moveaxis(a, -1, 0)
    bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


def straight_colors(scene: Surface) -> Floats:
    """Straight RGBA of every corner of every face: float64 [m, 3, 4]."""
    faces = np.asarray(scene.faces, np.int64)

    def real(colors: Any) -> Floats:
        array = np.asarray(colors)
        return array.astype(np.float64) / (255.0 if array.dtype == np.uint8 else 1.0)

    if scene.vertex_colors is not None:
        return real(scene.vertex_colors)[faces]
    if scene.face_colors is not None:
        return np.repeat(real(scene.face_colors)[:, None], 3, axis=1)
    return np.broadcast_to(real(scene.color), (len(faces), 3, 4)).copy()


def project(
    scene: Surface,
    camera: View,
    size: tuple[int, int],
    backfaces: str = "default",
    aside: tuple[float, float] = (0.0, 0.0),
) -> Projected:
    """Bring the triangles into homogeneous screen coordinates of an image of size (width, height).

    backfaces: which faces that are seen from behind are kept: those that have two sides, all if "visible", none if
    "hidden". aside: how far right of pixels' centres, and below, the samples lie, in pixels. The triangles are moved
    the other way.
    """
    _, height = size
    position = np.asarray(camera.position, np.float64)
    to_focus = np.asarray(camera.focal_point, np.float64) - position
    ahead = unit(to_focus)
    right = unit(cross(ahead, unit(np.asarray(camera.view_up, np.float64))))
    top = cross(right, ahead)

    faces = np.asarray(scene.faces, np.int64)
    corners = np.asarray(scene.vertices, np.float64)[faces]
    number = np.flatnonzero(np.isfinite(corners).all(axis=(1, 2)))
    x, y, z = np.moveaxis(corners[number] - position, -1, 0)
    distance = x * ahead[0] + y * ahead[1] + z * ahead[2]

    # The half height of the view is tan(angle / 2) at distance 1; orthographic, it is the same at every distance.
    half = math.tan(math.radians(camera.view_angle) / 2)
    if camera.orthographic:
        half *= float(np.linalg.norm(to_focus))
    scale = height / 2 / half
    screen_x = (x * right[0] + y * right[1] + z * right[2]) * scale
    screen_y = (x * top[0] + y * top[1] + z * top[2]) * -scale
    w = np.ones_like(distance) if camera.orthographic else distance
    homogeneous = np.stack([screen_x - aside[0] * w, screen_y - aside[1] * w, w], -1)
    edges = cross(np.roll(homogeneous, -1, axis=1), np.roll(homogeneous, -2, axis=1))
    uv = np.zeros((len(faces), 3, 2)) if scene.uv is None else np.asarray(scene.uv, np.float64)[faces]
    kept = np.ones(len(number), bool)
    if backfaces == "hidden" or (backfaces == "default" and scene.single_sided is not None):
        # Counterclockwise is the front. As y is down here, the corners' volume is negative then.
        behind = (edges[:, 0] * homogeneous[:, 0]).sum(axis=1) > 0
        kept = ~(behind & (True if backfaces == "hidden" else scene.single_sided[number]))

    if camera.clipping_range is None:
        clipping = (float(np.nextafter(0.0, 1.0)), math.inf)
    else:
        clipping = (float(camera.clipping_range[0]), float(camera.clipping_range[1]))
    return Projected(
        number[kept],
        homogeneous[kept],
        distance[kept],
        straight_colors(scene)[number][kept],
        uv[number][kept],
        edges[kept],
        clipping,
        camera.orthographic,
    )


def expand(counts: Integers, limit: int = PAIRS) -> Iterator[tuple[Integers, Integers]]:
    """For item i with counts[i] parts: (item, part) of all parts, in pieces of about `limit`."""
    start = 0
    totals = np.cumsum(counts)
    while start < len(counts):
        before = totals[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(totals, before + limit, side="right")))
        piece = counts[start:stop]
        item = np.repeat(np.arange(start, stop), piece)
        part = np.arange(len(item)) - np.repeat(np.cumsum(piece) - piece, piece)
        yield item, part
        start = stop


def screen_boxes(projected: Projected, size: tuple[int, int]) -> Integers:
    """Pixels that each triangle may cover: int64 [m, 4], first column, first row, end column, end row.

    A triangle that does not lie wholly in front of the eye gets the whole screen.
    """
    limit = np.array(size, np.float64)
    w = projected.corners[..., 2:]
    with np.errstate(all="ignore"):
        points = projected.corners[..., :2] / w + limit / 2
        low = np.clip(np.nan_to_num(np.floor(points.min(axis=1)) - 1, nan=0.0), 0, limit)
        high = np.clip(np.nan_to_num(np.ceil(points.max(axis=1)) + 1, nan=np.inf), 0, limit)
    whole = ~((w[..., 0] > 0).all(axis=1) & np.isfinite(points).all(axis=(1, 2)))
    low[whole], high[whole] = 0, limit
    return np.concatenate([low, np.maximum(high, low)], axis=1).astype(np.int64)


def inside(projected: Projected, triangle: Integers, x: Floats, y: Floats) -> Booleans:
    """Whether the ray's line through the sample (x, y) meets the triangle, whatever its winding.

    A sample exactly on an edge counts as if it lay a hair to the right, or on a horizontal edge a hair below:
    this is the top-left rule, so that triangles that share an edge never both own a sample.
    """
    normal = projected.edges[triangle]
    side = np.sign(normal[..., 0] * x[:, None] + normal[..., 1] * y[:, None] + normal[..., 2])
    side = np.where(side == 0, np.sign(normal[..., 0]), side)
    side = np.where(side == 0, np.sign(normal[..., 1]), side)
    return (side != 0).all(axis=1) & (side == side[:, :1]).all(axis=1)


def barycentric(projected: Projected, triangle: Integers, x: Floats, y: Floats) -> Floats:
    """The hit of the line through (x, y) with the triangle's plane, in space: float64 [n, 3], sums to 1."""
    normal = projected.edges[triangle]
    volume = normal[..., 0] * x[:, None] + normal[..., 1] * y[:, None] + normal[..., 2]
    with np.errstate(all="ignore"):
        return volume / volume.sum(axis=1, keepdims=True)


def shares(
    projected: Projected, triangle: Integers, x: Floats, y: Floats, move: tuple[float, float] = (0.0, 0.0)
) -> tuple[Floats, Floats]:
    """Barycentric weights [n, 3] where hits are shaded, and the sum of volumes [n] that they were divided by.

    move: how far aside of there, in pixels. A place that is shaded outside of the triangle has weights below 0. They
    count as 0, and the others are divided by their sum.
    """
    if projected.to_shade is None:
        normal = projected.edges[triangle].sum(axis=1)
        sums = normal[:, 0] * (x + move[0]) + normal[:, 1] * (y + move[1]) + normal[:, 2]
        return barycentric(projected, triangle, x + move[0], y + move[1]), sums
    normal, aside = projected.edges[triangle], projected.to_shade[triangle]
    sign = np.sign((normal[..., 0] * x[:, None] + normal[..., 1] * y[:, None] + normal[..., 2]).sum(axis=1))[:, None]
    x, y = x + aside[:, 0] + move[0], y + aside[:, 1] + move[1]
    volume = normal[..., 0] * x[:, None] + normal[..., 1] * y[:, None] + normal[..., 2]
    inside = np.maximum(volume * sign, 0)
    sums = inside.sum(axis=1)
    with np.errstate(all="ignore"):
        return inside / sums[:, None], sums * sign[:, 0]


def blend(weights: Floats, values: Floats) -> Floats:
    """Values [n, 3 corners, ...] at barycentric weights [n, 3]; exact where the three corners agree."""
    first = values[:, 0]
    extra = (1,) * (values.ndim - 2)
    b, c = (weights[:, k].reshape(-1, *extra) for k in (1, 2))
    with np.errstate(all="ignore"):
        return first + (b * (values[:, 1] - first) + c * (values[:, 2] - first))


def samples(pixel: Integers, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Screen coordinates of pixels' samples."""
    width, height = size
    column, row = (pixel % width).astype(np.float64), (pixel // width).astype(np.float64)
    return column + (0.5 - width / 2), row + (0.5 - height / 2)


def cast(projected: Projected, size: tuple[int, int]) -> tuple[Integers, Integers, Floats]:
    """Every hit within the clipping range: pixel, triangle, view distance; by pixel, then distance, then submission."""
    width, _ = size
    boxes = screen_boxes(projected, size)
    columns = boxes[:, 2] - boxes[:, 0]
    found: list[tuple[Integers, Integers, Floats]] = []
    for triangle, part in expand(columns * (boxes[:, 3] - boxes[:, 1])):
        pixel = (boxes[triangle, 1] + part // columns[triangle]) * width + boxes[triangle, 0] + part % columns[triangle]
        x, y = samples(pixel, size)
        keep = inside(projected, triangle, x, y)
        pixel, triangle, x, y = pixel[keep], triangle[keep], x[keep], y[keep]
        distance = blend(barycentric(projected, triangle, x, y), projected.distance[triangle])
        keep = (distance >= projected.clipping[0]) & (distance <= projected.clipping[1])
        found.append((pixel[keep], triangle[keep], distance[keep]))
    if not found:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    pixel, triangle, distance = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((triangle, distance, pixel))
    return pixel[order], triangle[order], distance[order]


def ranks(pixel: Integers, count: int) -> Iterator[tuple[Integers, Integers]]:
    """For the first, second, ... hit of every pixel that has one: (hit, pixel). `pixel` is sorted, below `count`."""
    layers = np.bincount(pixel, minlength=count)
    start = np.cumsum(layers) - layers
    alive = np.flatnonzero(layers)
    rank = 0
    while len(alive):
        yield start[alive] + rank, alive
        rank += 1
        alive = alive[layers[alive] > rank]


def composite(pixel: Integers, colors: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Sorted hits with straight RGBA [n, 4], front to back: premultiplied color [h, w, 4] and float32 bound [h, w].

    The bound, for the same loop in float32 with u = 2^-24, to first order in u. A layer adds T a c and makes T (1 - a):
    - a c comes from a rounded alpha and a rounded colour in two more products: 4 u a c, and the weights T a sum up to
      at most 1: 4 u in all;
    - 1 - a is off by a u (rounded alpha) + (1 - a) u (its own rounding) <= u, which moves the result by at most u T,
      since what lies behind is at most 1; the product T (1 - a) is off by u T (1 - a) <= u T: 2 u T a layer;
    - the sum is rounded by at most u of itself, and by no more than the number that is added: min(u S, T a) a layer.
    As T <= 1 and S <= 1, N layers give at most (3 N + 4) u, the bound of EXTREMES.md with its constant.
    """
    width, height = size
    count = width * height
    color = np.zeros((count, 4))
    clear = np.ones(count)
    steps = np.full(count, 4.0)
    for hit, at in ranks(pixel, count):
        rgba = colors[hit]
        alpha = rgba[:, 3]
        weight = clear[at] * alpha
        color[at, :3] += weight[:, None] * rgba[:, :3]
        color[at, 3] += weight
        steps[at] += np.minimum(color[at, 3], weight / UNIT) + 2 * clear[at]
        clear[at] *= 1 - alpha
    return color.reshape(height, width, 4), (steps * UNIT).reshape(height, width)


def slopes(projected: Projected, triangle: Integers, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """How the barycentric weights change from pixel to pixel, along x and along y: float64 [n, 3] each, sums to 0."""
    normal = projected.edges[triangle]
    weights, volume = shares(projected, triangle, x, y)
    whole = normal.sum(axis=1)
    with np.errstate(all="ignore"):
        along_x, along_y = ((normal[..., k] - weights * whole[:, k, None]) / volume[:, None] for k in (0, 1))
    return along_x, along_y


def places(projected: Projected, pixel: Integers, triangle: Integers, size: tuple[int, int]) -> Places:
    """Where hits lie on their faces."""
    x, y = samples(pixel, size)
    (weights, _), uv = shares(projected, triangle, x, y), projected.uv[triangle]
    along_x, along_y = (
        (slope[:, 1:, None] * (uv[:, 1:] - uv[:, :1])).sum(axis=1) for slope in slopes(projected, triangle, x, y)
    )
    color = blend(weights, projected.colors[triangle])
    return Places(projected.number[triangle], color, Footprint(blend(weights, uv), along_x, along_y))


def render(
    scene: Surface,
    camera: View,
    size: tuple[int, int],
    backfaces: str = "default",
    anisotropy: int = 1,
    aside: tuple[float, float] = (0.0, 0.0),
    once: Booleans | None = None,
) -> Picture:
    """The exact picture of the scene; size is (width, height).

    aside: where samples lie, see `project`. once: which faces are shaded at pixels' centres; None for none.
    """
    width, height = size
    projected = project(scene, camera, size, backfaces, aside)
    if once is not None:
        projected = replace(projected, to_shade=-np.array(aside) * once[projected.number, None])
    pixel, triangle, distance = cast(projected, size)
    cut = pixel[:0], triangle[:0]
    if scene.face_materials is None:
        rgba = blend(shares(projected, triangle, *samples(pixel, size))[0], projected.colors[triangle])
    else:
        painted = paint(scene, places(projected, pixel, triangle, size), anisotropy)
        there = painted.there
        cut = pixel[~there], triangle[~there]
        pixel, triangle, distance, rgba = pixel[there], triangle[there], distance[there], painted.color[there]
    color, bound = composite(pixel, rgba, size)
    layers = np.bincount(pixel, minlength=width * height).reshape(height, width)
    return Picture(color, layers, bound, pixel, distance, triangle, rgba, projected, cut)


def image(color: Floats, background: Any = (1.0, 1.0, 1.0)) -> NDArray[np.uint8]:
    """The uint8 RGBA picture over a background, or with straight alpha for None: x 255 + 0.5, clamped."""
    return np.nan_to_num(np.clip(np.floor(levels(color, background) + 0.5), 0, 255)).astype(np.uint8)


def levels(color: Any, background: Any = (1.0, 1.0, 1.0)) -> Floats:
    """`image` before the 0.5 is added and the fraction dropped: float64 [h, w, 4], 0..255.

    background: a colour, two for a gradient from the top edge to the bottom edge, or None.
    """
    color = np.asarray(color, np.float64)
    rgb, alpha = color[..., :3], color[..., 3:]
    if background is None:
        straight = np.divide(rgb, alpha, out=np.zeros_like(rgb), where=alpha > 0)
        return np.concatenate([straight, alpha], -1) * 255
    over = rgb + (1 - alpha) * behind(background, len(rgb))
    return np.concatenate([over, np.ones_like(alpha)], -1) * 255


def behind(background: Any, height: int) -> Floats:
    """What lies behind each row: float64 [h, 1, 3]. A gradient is a mean of its two colours, weighed by distance.

    The mean of equal numbers is that number: a rounding would matter where it lies on a half of 1/255.
    """
    top, bottom = np.broadcast_to(np.asarray(background, np.float64), (2, 3))
    below = (2 * np.arange(height)[:, None, None] + 1) / (2 * height)
    return np.where(top == bottom, top, (1 - below) * top + below * bottom)


def shifted(picture: Picture, shift: float) -> tuple[Floats, Floats, Floats, Floats]:
    """What each hit may become when its triangle's corners move by up to `shift` pixels in x and in y.

    Returns nearest [n], farthest [n] distance, least [n, 4], greatest [n, 4] straight RGBA of the scene.
    """
    height, width = picture.layers.shape
    projected = picture.projected
    values = np.concatenate([projected.distance[..., None], projected.colors], axis=2)
    low, high = shifted_values(projected, values, picture.pixel, picture.triangle, (width, height), shift)
    return low[:, 0], high[:, 0], low[:, 1:], high[:, 1:]


def shifted_values(
    projected: Projected, values: Floats, pixel: Integers, triangle: Integers, size: tuple[int, int], shift: float
) -> tuple[Floats, Floats]:
    """The least and the greatest values [n, c] of hits when corners move by up to `shift` pixels in x and in y.

    values: [m, 3 corners, c], such as distances. A moved triangle, interpolated at a sample p inside it, gives what the
    true triangle has at p - sum(weight * move): some point within `shift` of p in x and in y. Values are quotients of
    affine functions there, so that their extremes over that square lie in its corners; they never leave the range of
    the triangle's own corners. Where the plane turns edge-on within the square, the whole of that range is returned.
    Hits that are shaded aside have weights that are cut off at 0, within the square, too. What they change by in all is
    then up to three times as much: a part for each weight.
    """
    x, y = samples(pixel, size)
    values = values[triangle]
    least, greatest = values.min(axis=1), values.max(axis=1)
    normal = projected.edges[triangle].sum(axis=1)
    middle = normal[:, 0] * x + normal[:, 1] * y + normal[:, 2]
    edge_on = np.abs(middle) <= shift * (np.abs(normal[:, 0]) + np.abs(normal[:, 1]))
    corners = [
        np.clip(blend(shares(projected, triangle, x, y, (dx, dy))[0], values), least, greatest)
        for dx in (-shift, shift)
        for dy in (-shift, shift)
    ]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    if projected.to_shade is not None:
        low, high = np.maximum(2 * low - high, least), np.minimum(2 * high - low, greatest)
    return np.where(edge_on[:, None], least, low), np.where(edge_on[:, None], greatest, high)


def interpolation_bound(picture: Picture, shift: float = SNAP, rounding: float = 20 * UNIT) -> Floats:
    """How much interpolated colours may stray when corners move by `shift` pixels: float64 [h, w].

    `rounding` is what interpolating in float32 may add to each colour and alpha.
    """
    _, _, low, high = shifted(picture, shift)
    return stray_bound(picture, np.maximum(high - picture.rgba, picture.rgba - low) + rounding)


def stray_bound(picture: Picture, stray: Floats) -> Floats:
    """How far off the picture may be if the straight RGBA of its hits is off by `stray` [n, 4]: float64 [h, w].

    A layer whose alpha is off by da and whose colour is off by dc moves the result by at most T (da + a dc): what lies
    behind it is a colour between 0 and 1 too.
    """
    height, width = picture.layers.shape
    clear, bound = np.ones(width * height), np.zeros(width * height)
    for hit, at in ranks(picture.pixel, width * height):
        alpha = picture.rgba[hit, 3]
        bound[at] += clear[at] * (stray[hit, 3] + alpha * stray[hit, :3].max(axis=1))
        clear[at] *= 1 - alpha
    return bound.reshape(height, width)


def places_off(
    projected: Projected, pixel: Integers, triangle: Integers, size: tuple[int, int], shift: float, rounding: float
) -> Places:
    """How far off `places` may be when corners move by `shift` pixels, and weights are off by `rounding`.

    A slope is a sum of the corners' values, times the slopes of their weights. A corner's value is off by what the
    plane changes within `shift`, and each product by `rounding`. Perspective doubles both: it divides by a sum that is
    off by as much.
    """
    middle = places(projected, pixel, triangle, size)
    values = np.concatenate([projected.colors, projected.uv], axis=2)
    low, high = shifted_values(projected, values, pixel, triangle, size, shift)
    found = np.concatenate([middle.color, middle.at.uv], axis=1)
    largest = np.abs(values).max(axis=1)[triangle]
    off = np.maximum(high - found, found - low) + rounding * largest
    change = shift * (np.abs(middle.at.along_x) + np.abs(middle.at.along_y)) + rounding * largest[:, 4:]
    along_x, along_y = (
        2 * np.abs(slope).sum(axis=1)[:, None] * change for slope in slopes(projected, triangle, *samples(pixel, size))
    )
    return Places(middle.face, off[:, :4], Footprint(off[:, 4:], along_x, along_y))


def paint_bound(
    scene: Surface, picture: Picture, shift: float, rounding: float, roundings: Roundings, anisotropy: int = 1
) -> tuple[Floats, Booleans]:
    """How far off colours may be in a scene with materials, float64 [h, w], and where a hit may be there or not.

    shift, rounding: as in `places_off`.
    """
    height, width = picture.layers.shape
    ranges = []
    for pixel, triangle in ((picture.pixel, picture.triangle), picture.cut):
        hits = picture.projected, pixel, triangle, (width, height)
        ranges.append(paint_range(scene, places(*hits), places_off(*hits, shift, rounding), roundings, anisotropy))
    doubtful = np.zeros(width * height, bool)
    doubtful[picture.pixel[ranges[0].doubtful]] = doubtful[picture.cut[0][ranges[1].doubtful]] = True
    stray = np.maximum(ranges[0].high - picture.rgba, picture.rgba - ranges[0].low)
    return stray_bound(picture, stray), doubtful.reshape(height, width)


def near_tie(picture: Picture, relative: float = 1e-6, absolute: float = 0.0, shift: float = 0.0) -> Booleans:
    """Pixels where float32 cannot tell which of two layers is in front, or whether one is clipped: bool [h, w].

    Two layers tie where their distances differ by less than relative * distance + absolute (float32 resolves 1.2e-7 of
    a distance at best); with a `shift` in pixels, also where they cross that close to the sample. Exact ties
    (coincident triangles) are no near ties: those follow the order of submission.
    """
    height, width = picture.layers.shape
    distance = picture.distance
    low, high = shifted(picture, shift)[:2] if shift else (distance, distance)
    low, high = low - (low * relative + absolute) / 2, high + (high * relative + absolute) / 2
    tie = np.zeros(width * height, bool)
    farthest, last = np.full(width * height, -np.inf), np.full(width * height, np.nan)
    for hit, at in ranks(picture.pixel, width * height):
        tie[at] |= (low[hit] <= farthest[at]) & (distance[hit] != last[at])
        farthest[at], last[at] = np.maximum(farthest[at], high[hit]), distance[hit]
    # Hits that are barely drawn, and those that are barely not.
    near, far = picture.projected.clipping
    margin = near * relative + absolute, (far * relative if far < np.inf else 0.0) + absolute
    wide = replace(picture.projected, clipping=(near - margin[0], far + margin[1]))
    pixel, _, distance = cast(wide, (width, height))
    tie[pixel[(distance < near + margin[0]) | (distance > far - margin[1])]] = True
    return tie.reshape(height, width)


def cut(a: Floats, b: Floats, at: Any, orthographic: bool) -> Floats:
    """The points of segments a..b [n, 4: x, y, w, view distance] at view distance `at`, between their ends'."""
    with np.errstate(all="ignore"):
        point = a + (b - a) * ((at - a[..., 3]) / (b[..., 3] - a[..., 3]))[..., None]
    point[..., 3] = at
    if not orthographic:
        point[..., 2] = at
    return point


def segments(projected: Projected) -> Floats:
    """The triangles' outlines on the screen, in front of the eye: float64 [k, 2 ends, 2] pixels.

    Every edge is cut at the near and the far distance in homogeneous space, and where one of these planes cuts a
    triangle, the cut is an edge too. An edge through the eye plane is cut at 1e-6 of its farther end at the latest.
    """
    near, far = projected.clipping
    first = np.concatenate([projected.corners, projected.distance[..., None]], -1)
    second = np.roll(first, -1, axis=1)
    one, two = first.reshape(-1, 4), second.reshape(-1, 4)
    nearest = np.full(len(one), near)
    if not projected.orthographic:
        nearest = np.maximum(near, 1e-6 * np.maximum(one[:, 3], two[:, 3]))
    drawn = (np.maximum(one[:, 3], two[:, 3]) >= nearest) & (np.minimum(one[:, 3], two[:, 3]) <= far)
    one, two, nearest = one[drawn], two[drawn], nearest[drawn]
    ends = []
    for end, other in ((one, two), (two, one)):
        front = np.where(end[:, 3:] < nearest[:, None], cut(end, other, nearest, projected.orthographic), end)
        ends.append(np.where(end[:, 3:] > far, cut(end, other, far, projected.orthographic), front))
    found = [np.stack(ends, axis=1)]
    for plane in (near, far):
        crosses = (first[..., 3] < plane) != (second[..., 3] < plane)
        both = np.flatnonzero(crosses.sum(axis=1) == 2)
        where = np.argsort(~crosses[both], axis=1, kind="stable")[:, :2]
        row = both[:, None]
        found.append(cut(first[row, where], second[row, where], plane, projected.orthographic))
    outline = np.concatenate(found)
    with np.errstate(all="ignore"):
        return outline[..., :2] / outline[..., 2:3]


def edge_distance(
    scene: Surface,
    camera: View,
    size: tuple[int, int],
    relative: float = 0.0,
    backfaces: str = "default",
    aside: tuple[float, float] = (0.0, 0.0),
) -> Floats:
    """How far each sample is from the nearest edge, in pixels, where that is below 1/2; else inf: float64 [h, w].

    The distance is max(|dx|, |dy|): rounding to 1/256 pixel moves a corner by at most 1/512 in x and in y, thus every
    point of an edge too, so a sample that changes sides lies within 1/512 of the true edge in exactly this measure
    (the Euclidean distance can reach sqrt(2) / 512). `relative` is taken off, times the largest coordinate of the
    edge's ends (counted from the image's corner): what rounding the projection itself may move. aside: see `project`.
    """
    return outline_distance(segments(project(scene, camera, size, backfaces, aside)), size, relative)


def outline_distance(lines: Floats, size: tuple[int, int], relative: float = 0.0) -> Floats:
    """`edge_distance` of segments float64 [k, 2 ends, 2], in screen coordinates."""
    width, height = size
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    nearest = np.full(width * height, np.inf)
    slack = relative * (np.abs(lines).max(axis=(1, 2)) + max(size) / 2)
    lines = lines + (np.array(size) / 2 - 0.5)  # pixel (row, column) now has its sample at (column, row)
    # Walk along the longer axis; the line passes each step within one pixel of its nearest neighbour across it.
    steep = np.ptp(lines[..., 1], axis=1) > np.ptp(lines[..., 0], axis=1)
    along = np.where(steep[:, None], lines[..., 1], lines[..., 0])
    across = np.where(steep[:, None], lines[..., 0], lines[..., 1])
    length = np.where(steep, height, width)
    low = np.clip(np.floor(along.min(axis=1)) - 1, 0, length).astype(np.int64)
    high = np.clip(np.ceil(along.max(axis=1)) + 2, 0, length).astype(np.int64)
    for line, part in expand(3 * np.maximum(high - low, 0)):
        step = low[line] + part // 3
        a, b = along[line].T
        span = np.where(b == a, 1.0, b - a)
        t = np.clip((step - a) / span, 0, 1)
        middle = across[line, 0] + t * (across[line, 1] - across[line, 0])
        limit = np.where(steep[line], width, height)
        other = np.clip(np.round(middle), -2, limit + 1).astype(np.int64) + part % 3 - 1
        on = (other >= 0) & (other < limit)
        line, step, other = line[on], step[on], other[on]
        pixel = np.where(steep[line], step * width + other, other * width + step)
        np.minimum.at(
            nearest, pixel, np.maximum(square_distance(along[line], across[line], step, other) - slack[line], 0)
        )
    return np.where(nearest <= 0.5, nearest, np.inf).reshape(height, width)


def square_distance(along: Floats, across: Floats, step: Integers, other: Integers) -> Floats:
    """The least max(|dx|, |dy|) between points (step, other) and segments [n, 2 ends]: float64 [n].

    Along the segment it is a convex function of straight pieces; they meet where dx = 0, dy = 0, dx = dy or dx = -dy,
    so one of these places or an end is the nearest.
    """
    dx, dy = along[:, 0] - step, across[:, 0] - other
    run, rise = along[:, 1] - along[:, 0], across[:, 1] - across[:, 0]
    best = np.minimum(np.maximum(np.abs(dx), np.abs(dy)), np.maximum(np.abs(dx + run), np.abs(dy + rise)))
    for offset, slope in ((dx, run), (dy, rise), (dx - dy, run - rise), (dx + dy, run + rise)):
        t = np.clip(np.divide(-offset, slope, out=np.zeros_like(slope), where=slope != 0), 0, 1)
        best = np.minimum(best, np.maximum(np.abs(dx + t * run), np.abs(dy + t * rise)))
    return best
