"""Geometry: makes scenes of points and cells of several kinds, with the colours and numbers of either."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.reading.marks import marks
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.fields import with_arrays
from clpeel.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Tint:
    """The colours of a mesh: of its points, [n, 3|4], or of its cells, [c, 3|4], or one for all; or none.

    of_points, of_cells: their numbers by name, for the scene's arrays.
    """

    points: Colors | None = None
    cells: Colors | None = None
    color: Colors | None = None
    of_points: Mapping[str, AnyArray] = field(default_factory=dict)
    of_cells: Mapping[str, AnyArray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Geometry:
    """What scenes are made from: the points [n, 3] of a mesh, their normals or None, and its colours."""

    points: NDArray[np.float64]
    normals: AnyArray | None
    tint: Tint

    def faces(self, faces: AnyArray, cells: AnyArray, polygons: AnyArray, uv: AnyArray | None = None) -> Scene | None:
        """Return a scene of these faces, [m, 3], or None without any.

        cells: the number of the cell that each is of, [m]. polygons, uv: as in Scene.from_arrays.
        """
        if not len(faces):
            return None
        tint = self.tint
        scene = Scene.from_arrays(
            self.points,
            faces,
            face_colors=None if tint.cells is None else tint.cells[cells],
            vertex_colors=tint.points,
            color=tint.color,
            vertex_normals=self.normals,
            uv=uv,
            polygons=polygons,
        )
        return with_arrays(scene, tint.of_points, self._of_cells(cells))

    def marks(self, kind: str, ends: AnyArray, cells: AnyArray) -> Scene | None:
        """Return a scene of these "lines" [k, 2] or "points" [p], or None without any. cells: that each is of."""
        if not len(ends):
            return None
        tint, points, normals = self.tint, self.points, self.normals
        colors, arrays = tint.points, tint.of_points
        if tint.cells is not None:  # each has a colour of its own, so its ends must be its own, too
            flat = ends.reshape(-1)
            colors = np.repeat(tint.cells[cells], ends[0].size, axis=0)
            points, normals = points[flat], None if normals is None else normals[flat]
            arrays = {name: array[flat] for name, array in arrays.items()}
            ends = np.arange(ends.size).reshape(ends.shape)
        given: dict[str, Any] = {kind: ends, "color": tint.color, "arrays": arrays}
        scene = marks(points, vertex_colors=colors, vertex_normals=normals, **given)
        return None if scene is None else with_arrays(scene, {}, self._of_cells(cells))

    def _of_cells(self, cells: AnyArray) -> dict[str, AnyArray]:
        """Return the numbers of these cells."""
        return {name: array[cells] for name, array in self.tint.of_cells.items()}
