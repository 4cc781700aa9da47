"""A coarser scene, which stands for one with very many triangles while the hand moves.

Vertices are clustered on a grid, as Rossignac and Borrel do ("Multi-resolution 3D approximations", 1993), and as VTK
and ParaView do while their users move something.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.scene import Scene

FIRST_CELLS = 128
"""Cells of the first grid along the scene's longest side. What it leaves tells how fine the grid can be."""

LEAST_CELLS, MOST_CELLS = 2, 1 << 20
"""The fewest and the most cells along a side: three numbers of the latter fit into 64 bits."""


def coarse_scene(scene: Scene, triangles: int) -> Scene:
    """Return a scene of at most so many triangles, as far as LEAST_CELLS allow, that looks like the scene from afar.

    Triangles whose corners fall into fewer than three cells vanish, and of triangles with the same three cells the
    first stays. So it is with lines and points, however many there are. A triangle keeps its colour; a corner gets the
    mean place of its cell, and the colour and the texture coordinates of the first vertex there.
    """
    cells = FIRST_CELLS
    cell, faces, kept = _clustered(scene, cells)
    for _ in range(2):  # a surface has as many cells as their number along a side, squared
        cells = int(min(max(cells * (triangles / max(len(faces), 1)) ** 0.5, LEAST_CELLS), MOST_CELLS))
        cell, faces, kept = _clustered(scene, cells)
    while len(faces) > triangles and cells > LEAST_CELLS:
        cells = int(cells * 0.95)
        cell, faces, kept = _clustered(scene, cells)
    if not len(faces):
        return scene
    used = np.asarray(np.isfinite(scene.vertices).all(axis=1))
    count = int(cell.max()) + 1
    weight = np.maximum(np.bincount(cell[used], minlength=count), 1)
    places = [np.bincount(cell[used], scene.vertices[used, axis], count) / weight for axis in range(3)]
    first = np.zeros(count, np.int64)
    first[cell[::-1]] = np.arange(len(cell))[::-1]  # the first of each cell is written last
    none = np.zeros((0, 1), np.int32)
    lines, of_lines = _whole(cell, used, none if scene.lines is None else scene.lines)
    points, of_points = _whole(cell, used, none if scene.points is None else scene.points[:, None])
    starts = np.cumsum(scene.counts)
    rows = np.concatenate([kept, starts[0] + of_lines, starts[1] + of_points])
    return replace(
        scene,
        vertices=np.stack(places, axis=-1),
        faces=faces.astype(np.int32),
        face_colors=None if scene.face_colors is None else scene.face_colors[rows],
        vertex_colors=None if scene.vertex_colors is None else scene.vertex_colors[first],
        vertex_normals=None,
        uv=None if scene.uv is None else scene.uv[first],
        more_uv=tuple(uv[first] for uv in scene.more_uv),
        face_materials=None if scene.face_materials is None else scene.face_materials[kept],
        single_sided=None if scene.single_sided is None else scene.single_sided[kept],
        polygons=None if scene.polygons is None else scene.polygons[kept],
        lines=None if scene.lines is None else lines,
        points=None if scene.points is None else points.reshape(-1),
    )


def _whole(
    cell: NDArray[np.int64], finite: NDArray[np.bool_], marks: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the cells of lines [k, 2] or points [p, 1], and whose they are: each kind of line or point once.

    Those that are not finite are left out.
    """
    kept = np.flatnonzero(finite[marks].all(axis=1))
    found = cell[marks[kept]]
    apart = np.flatnonzero((found[:, :1] != found[:, 1:]).all(axis=1))
    _, first = np.unique(found[apart], axis=0, return_index=True)
    first = apart[np.sort(first)]
    return found[first].astype(np.int32), kept[first]


def _clustered(scene: Scene, cells: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return each vertex's cell, int64 [n], numbered from 0; the faces between three cells, [m, 3]; and whose they are.

    cells: of the grid, along the scene's longest side.
    """
    low, high = scene.bounds
    step = float((high - low).max()) / cells or 1.0
    with np.errstate(invalid="ignore", over="ignore"):
        at = np.clip(np.nan_to_num((scene.vertices - low) / step), 0, cells - 1).astype(np.int64)
    _, cell = np.unique((at[:, 0] << 40) | (at[:, 1] << 20) | at[:, 2], return_inverse=True)
    cell = cell.reshape(-1).astype(np.int64)
    finite = np.asarray(np.isfinite(scene.vertices).all(axis=1))
    corners = cell[scene.faces]
    a, b, c = corners.T
    whole = np.flatnonzero((a != b) & (b != c) & (c != a) & finite[scene.faces].all(axis=1))
    ordered = np.sort(corners[whole], axis=1)
    count = max(int(cell.max()) + 1, 2)
    if count**3 < 2**63:
        key = (ordered[:, 0] * count + ordered[:, 1]) * count + ordered[:, 2]
        _, first = np.unique(key, return_index=True)
    else:
        _, first = np.unique(ordered, axis=0, return_index=True)
    kept = whole[np.sort(first)]
    return cell, corners[kept], kept
