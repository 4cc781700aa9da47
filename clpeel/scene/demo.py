"""The scene of `clpeel demo`: a knot of glass through nested spheres, inside a spiral shell and a geodesic lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from clpeel.scene.scene import Scene

DIRECTION = (-0.35, -0.42, -1.0)  # the direction in which the demo's camera looks
ZOOM = 1.68  # the zoom: the scene is a ball, but the default framing leaves room for the corners of its box

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Part = tuple[Floats, Ints, Floats]  # vertices [n, 3], faces [m, 3], face colours [m, 4] in 0..1

# Colours along the knot, in order. After the last, they return to the first.
KNOT_COLORS = np.array(
    [
        (0.05, 0.70, 0.95),
        (0.25, 0.35, 1.00),
        (0.75, 0.20, 0.95),
        (1.00, 0.20, 0.50),
        (1.00, 0.55, 0.15),
        (0.98, 0.85, 0.20),
        (0.20, 0.82, 0.55),
    ]
)
RIBBON_COLORS = np.array([(0.15, 0.85, 0.95), (0.55, 0.35, 1.00)])  # from the upper pole to the lower


def demo_scene() -> Scene:
    """Return the whole scene: about 205,000 triangles and up to 30 layers in a pixel, with the same bits each time."""
    from clpeel.scene.scene import Scene

    parts = [
        _sphere(0.12, (1.00, 0.97, 0.85, 1.00)),
        _sphere(0.20, (1.00, 0.80, 0.15, 0.50)),
        _sphere(0.29, (1.00, 0.55, 0.15, 0.35)),
        _sphere(0.38, (1.00, 0.30, 0.35, 0.25)),
        _sphere(0.48, (0.95, 0.20, 0.60, 0.16)),
        _knot(),
        _ribbons(1.22),
        _lattice(1.36),
        _pearls(1.36),
    ]
    base = np.cumsum([0] + [len(vertices) for vertices, _, _ in parts])
    return Scene.from_arrays(
        np.concatenate([vertices for vertices, _, _ in parts]),
        np.concatenate([faces + start for (_, faces, _), start in zip(parts, base, strict=False)]).astype(np.int32),
        face_colors=np.round(255 * np.concatenate([colors for _, _, colors in parts])).astype(np.uint8),
    )


def _grid_faces(rows: int, columns: int, *, closed_rows: bool, closed_columns: bool) -> Ints:
    """Return two triangles for every square of a grid of vertices, row by row: int [m, 3]."""
    i, j = np.mgrid[0 : rows - (not closed_rows), 0 : columns - (not closed_columns)]
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
    return np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], -2).reshape(-1, 3)


def _on_sphere(polar: Floats, around: Floats) -> Floats:
    """Return the unit vectors [..., 3] at the angles `polar` (from +Y) and `around` (about the Y axis), in radians."""
    x, y, z = np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)
    return np.stack(np.broadcast_arrays(x, y, z), -1)


def _sphere(radius: float, color: ArrayLike, rows: int = 48, columns: int = 96) -> Part:
    polar = np.linspace(0, np.pi, rows)[:, None]
    around = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None, :]
    unit = _on_sphere(polar, around)
    faces = _grid_faces(rows, columns, closed_rows=False, closed_columns=True)
    return radius * unit.reshape(-1, 3), faces, np.tile(np.asarray(color, float), (len(faces), 1))


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _tube(center: Floats, side: Floats, up: Floats, radius: float, sides: int) -> Floats:
    """Return the vertices [steps * sides, 3] of circles about `center` [steps, 3] in the planes of `side` and `up`."""
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)[None, :, None]
    return (center[:, None] + radius * (np.cos(angle) * side[:, None] + np.sin(angle) * up[:, None])).reshape(-1, 3)


def _knot(steps: int = 900, sides: int = 40, radius: float = 0.155) -> Part:
    """Return a (3, 5) torus knot whose colour changes along it, with a thinner and more opaque core inside."""
    t = np.linspace(0, 2 * np.pi, steps, endpoint=False)

    def curve(t: Floats) -> Floats:
        ring = 0.72 + 0.28 * np.cos(5 * t)
        return np.stack([ring * np.cos(3 * t), 0.46 * np.sin(5 * t), ring * np.sin(3 * t)], -1)

    center = curve(t)
    along = _unit(curve(t + 1e-4) - curve(t - 1e-4))
    side = _unit(np.cross(along, (0.0, 1.0, 0.0)))
    up = np.cross(side, along)
    faces = _grid_faces(steps, sides, closed_rows=True, closed_columns=True)
    place = np.arange(steps) / steps * len(KNOT_COLORS)
    first, mix = place.astype(int), (place % 1)[:, None]
    shade = KNOT_COLORS[first] * (1 - mix) + KNOT_COLORS[(first + 1) % len(KNOT_COLORS)] * mix
    outer = np.repeat(np.column_stack([shade, np.full(steps, 0.33)]), 2 * sides, axis=0)

    core_sides = 16
    core_faces = _grid_faces(steps, core_sides, closed_rows=True, closed_columns=True)
    core = np.repeat(np.column_stack([shade, np.full(steps, 0.80)]), 2 * core_sides, axis=0)
    outer_vertices = _tube(center, side, up, radius, sides)
    return (
        np.concatenate([outer_vertices, _tube(center, side, up, 0.3 * radius, core_sides)]),
        np.concatenate([faces, core_faces + len(outer_vertices)]),
        np.concatenate([outer, core]),
    )


def _ribbons(radius: float, count: int = 9, rows: int = 160, columns: int = 12) -> Part:
    """Return ribbons that wind from pole to pole on a sphere. They are widest at its equator."""
    down, across = np.linspace(0, 1, rows)[:, None], np.linspace(-0.5, 0.5, columns)[None, :]
    polar = np.pi * (0.06 + 0.88 * down)
    vertices, faces, colors = [], [], []
    one = _grid_faces(rows, columns, closed_rows=False, closed_columns=False)
    mix = (one[:, :1] // columns) / rows
    shade = (1 - mix) * RIBBON_COLORS[0] + mix * RIBBON_COLORS[1]
    for k in range(count):
        around = 2 * np.pi * ((k + across * (0.15 + 0.55 * np.sin(np.pi * down))) / count + 0.55 * down)
        faces.append(one + k * rows * columns)
        vertices.append(radius * _on_sphere(polar, around).reshape(-1, 3))
        colors.append(np.column_stack([shade, np.full(len(one), 0.30)]))
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(colors)


def _lattice(radius: float, thickness: float = 0.006, sides: int = 8) -> Part:
    """Return the edges of an icosahedron, with each face divided into nine, as thin rods on a sphere."""
    edges = _geodesic_edges(3) * radius
    start, end = edges[:, 0], edges[:, 1]
    along = _unit(end - start)
    side = _unit(np.cross(along, start + end))
    up = np.cross(side, along)
    rods = np.stack([_tube(at, side, up, thickness, sides).reshape(-1, sides, 3) for at in (start, end)], 1)
    one = _grid_faces(2, sides, closed_rows=False, closed_columns=True)
    return rods.reshape(-1, 3), *_copies(one, 2 * sides, len(edges), (0.50, 0.60, 0.85, 0.55))


def _pearls(radius: float, size: float = 0.022) -> Part:
    """Return a small ball on every joint of the lattice."""
    joints = np.unique(_geodesic_edges(3).reshape(-1, 3), axis=0) * radius
    ball, one, _ = _sphere(size, (0.0, 0.0, 0.0, 0.0), rows=9, columns=16)
    vertices = (joints[:, None] + ball).reshape(-1, 3)
    return vertices, *_copies(one, len(ball), len(joints), (1.00, 0.72, 0.25, 0.85))


def _copies(faces: Ints, vertices: int, count: int, color: ArrayLike) -> tuple[Ints, Floats]:
    """Return the faces and colours of `count` copies of a part that has `vertices` vertices."""
    copies = (faces[None] + vertices * np.arange(count)[:, None, None]).reshape(-1, 3)
    return copies, np.tile(np.asarray(color, float), (len(copies), 1))


def _geodesic_edges(divisions: int) -> Floats:
    """Return edges [m, 2, 3] of a divided icosahedron, as pairs of unit vectors on the sphere."""
    golden = (1 + 5**0.5) / 2
    corners = [(0.0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    points = _unit(np.array([np.roll(corner, shift) for corner in corners for shift in range(3)]))
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    near = distance < 1.1 * distance[distance > 1e-6].min()
    triples = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    segments = set()
    for a, b, c in triples:

        def point(i: int, j: int, corner: tuple[int, int, int] = (a, b, c)) -> tuple[float, ...]:
            p, q, r = points[list(corner)]
            at = (p * (divisions - i - j) + q * i + r * j) / divisions
            return tuple(float(x) for x in np.round(_unit(at), 9))

        for i in range(divisions):
            for j in range(divisions - i):
                triangle = point(i, j), point(i + 1, j), point(i, j + 1)
                segments |= {tuple(sorted(pair)) for pair in zip(triangle, triangle[1:] + triangle[:1], strict=True)}
    return np.array(sorted(segments))
