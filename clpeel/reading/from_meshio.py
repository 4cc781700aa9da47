"""Converts meshio's meshes to Scenes: cells as faces, lines and points; of cells with a volume, the surface."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.colors import colors_among
from clpeel.reading.corners import fans
from clpeel.reading.geometry import Geometry, Tint
from clpeel.reading.marks import chains, together
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene

_SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
"""The sides of cells with a volume, by their corners, counterclockwise as seen from outside (VTK's order)."""

_FLAT = {"triangle": 3, "quad": 4}
_KIND = re.compile(
    r"(?:VTK_LAGRANGE_)?(vertex|line|curve|triangle|quadrilateral|quad|tetrahedron|tetra|pyramid|wedge|hexahedron)_?(\d*)$",
    re.I,
)
_SHORT = {"curve": "line", "quadrilateral": "quad", "tetrahedron": "tetra"}


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Polygons, lines or points, one after another.

    corners: of all. counts: how many each has. cells: the number of each one's cell in the mesh.
    """

    corners: NDArray[np.int64]
    counts: NDArray[np.int64]
    cells: NDArray[np.int64]


def from_meshio(mesh: Any) -> Scene:
    """Return the scene of a meshio.Mesh. Its colours are arrays of 3 or 4 bytes, or those that are called RGB or so.

    Sides of volumes that two cells share are inside, so they are not drawn. Cells with curved sides are drawn straight,
    between their corners; a note says so. Notes name kinds of cells that are left out. Raises InputError if there is
    nothing to draw.
    """
    notes = list[str]()
    points = np.asarray(mesh.points, np.float64)
    if not points.size:
        raise InputError("expected triangles, lines or points, got none in the meshio mesh; the mesh is empty")
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"expected points of 2 or 3 coordinates, got {list(points.shape)}")
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    stacked = {name: stack for name, parts in mesh.cell_data.items() if (stack := _stacked(parts)) is not None}
    colors, of_points = colors_among(dict(mesh.point_data), None, notes)
    cell_colors, of_cells = colors_among(stacked, None, notes)
    found = _sorted(mesh.cells, notes)
    tint = Tint(colors, cell_colors if colors is None else None, None, of_points, of_cells)
    scene = together(_scenes(points, found, tint))
    if scene is None:
        raise InputError("expected triangles, lines or points, got none in the meshio mesh; the mesh is empty")
    return replace(scene, notes=(*scene.notes, *notes))


def _stacked(parts: Sequence[Any]) -> AnyArray | None:
    """Return the values of all blocks of cells as one array, or None if they do not fit together."""
    arrays = [np.asarray(part) for part in parts]
    fit = arrays and all(each.ndim == arrays[0].ndim > 0 and each.shape[1:] == arrays[0].shape[1:] for each in arrays)
    return np.concatenate(arrays) if fit else None


def _sorted(blocks: Sequence[Any], notes: list[str]) -> dict[str, list[_Pieces]]:
    """Return the cells of all blocks as "faces", "lines" and "points"."""
    found: dict[str, list[_Pieces]] = {"faces": [], "lines": [], "points": []}
    solid = list[_Pieces]()
    curved, unknown, first = list[str](), list[str](), 0
    for block in blocks:
        cells = first + np.arange(len(block.data))
        first += len(block.data)
        named = _KIND.match(block.type)
        if block.type.startswith("polygon"):
            counts = np.array([len(row) for row in block.data], np.int64)
            corners = np.concatenate([np.asarray(row, np.int64) for row in block.data] or [np.zeros(0, np.int64)])
            found["faces"].append(_Pieces(corners, counts, cells))
            continue
        if named is None:
            unknown.append(block.type)
            continue
        kind, data = _SHORT.get(named[1].lower(), named[1].lower()), np.asarray(block.data, np.int64)
        if named[2] or named[0].startswith("VTK"):
            curved.append(block.type)
        if kind in _SIDES:
            solid += [_rows(data[:, side], cells) for side in _SIDES[kind]]
        elif kind in _FLAT:
            found["faces"].append(_rows(data[:, : _FLAT[kind]], cells))
        else:
            found["lines" if kind == "line" else "points"].append(_rows(data[:, : 2 if kind == "line" else 1], cells))
    found["faces"] += _outside(solid)
    if curved:
        notes.append(f"drawn straight between their corners: {', '.join(dict.fromkeys(curved))}")
    if unknown:
        notes.append(f"kinds of cells left out: {', '.join(dict.fromkeys(unknown))}")
    return found


def _rows(data: NDArray[np.int64], cells: NDArray[np.int64]) -> _Pieces:
    """Return cells of equally many corners."""
    return _Pieces(data.reshape(-1), np.full(len(data), data.shape[1], np.int64), cells)


def _outside(sides: list[_Pieces]) -> list[_Pieces]:
    """Return the sides that one cell alone has."""
    found = list[_Pieces]()
    for width in (3, 4):
        alike = [side for side in sides if len(side.counts) and side.counts[0] == width]
        if not alike:
            continue
        corners = np.concatenate([side.corners.reshape(-1, width) for side in alike])
        cells = np.concatenate([side.cells for side in alike])
        _, first, count = np.unique(np.sort(corners, axis=1), axis=0, return_index=True, return_counts=True)
        own = np.sort(first[count == 1])
        found.append(_rows(corners[own], cells[own]))
    return found


def _scenes(points: AnyArray, found: dict[str, list[_Pieces]], tint: Tint) -> list[Scene | None]:
    """Return the scenes of faces, lines and points. points: [n, 3]."""
    geometry, scenes = Geometry(points, None, tint), list[Scene | None]()
    for kind, pieces in found.items():
        if not pieces:
            continue
        corners, counts, cells = (
            np.concatenate([getattr(each, name) for each in pieces]) for name in ("corners", "counts", "cells")
        )
        if kind == "faces":
            places, of_face = fans(counts)
            scenes.append(geometry.faces(corners[places], cells[of_face], of_face))
        elif kind == "lines":
            scenes.append(geometry.marks(kind, corners[chains(counts)], cells))
        else:
            scenes.append(geometry.marks(kind, corners, cells))
    return scenes
