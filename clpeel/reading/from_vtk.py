"""Converts VTK's data sets, and so PyVista's, to Scenes: faces, lines, points, and the colours among their arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.colors import colors_among
from clpeel.reading.marks import marks, together
from clpeel.reading.transforms import cofactors, moved, turned
from clpeel.reading.vtk_arrays import corners_of, lines_of, messages, named, numbers
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.scene import Scene

_PIECE = "clpeel cell"


@dataclass(frozen=True, eq=False)
class Tint:
    """The colours of a vtkPolyData: of its points, [n, 3|4], or of its cells, [c, 3|4], or one for all; or none."""

    points: Colors | None = None
    cells: Colors | None = None
    color: Colors | None = None


def from_vtk(source: Any) -> Scene:
    """Return the scene of a vtkDataSet, or of all parts of a vtkCompositeDataSet in order. PyVista's meshes are both.

    Of grids and of cells with a volume, the surface is drawn, as VTK extracts it. Polygons and strips become triangles.
    Colours are display-referred: those that VTK would colour by if they are bytes of RGB or RGBA, else an array that is
    called RGB, RGBA or Colors. Numbers that are no colours are not drawn; a note names those that are active.
    Raises InputError if there is nothing to draw.
    """
    notes = list[str]()
    with messages() as told:
        found = [scene for leaf in leaves(source) if (scene := _scene(surface(leaf), notes)) is not None]
    scene = together(found)
    if scene is None:
        raise InputError(
            f"expected triangles, lines or points, got none in a {source.GetClassName()}; the mesh is empty"
        )
    return replace(
        scene, notes=tuple(dict.fromkeys([*scene.notes, *notes, *(f"VTK reports: {text}" for text in told)]))
    )


def _scene(data: Any, notes: list[str]) -> Scene | None:
    """Return the scene of a vtkPolyData with its own colours, or None if it draws nothing. Adds notes."""
    tint, scalars = own_tint(data, notes)
    if tint.points is None and tint.cells is None and scalars is not None:
        notes.append(f"scalars {scalars!r} left out: they are numbers, not colours")
    return scene_of(data, tint)


def leaves(source: Any) -> Iterator[Any]:
    """Yield the data sets of a vtkCompositeDataSet in order, or the one that is given. Empty places are skipped."""
    if not source.IsA("vtkCompositeDataSet"):
        yield source
        return
    walk = source.NewIterator()
    walk.InitTraversal()
    while not walk.IsDoneWithTraversal():
        leaf = walk.GetCurrentDataObject()
        if leaf is not None and leaf.IsA("vtkDataSet"):
            yield leaf
        walk.GoToNextItem()


def surface(data: Any) -> Any:
    """Return a vtkDataSet as vtkPolyData: itself, or its surface."""
    if data.IsA("vtkPolyData"):
        return data
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    extract = vtkDataSetSurfaceFilter()
    extract.SetInputData(data)
    extract.Update()
    return extract.GetOutput()


def own_tint(data: Any, notes: list[str]) -> tuple[Tint, str | None]:
    """Return the colours among the arrays of a vtkPolyData, and the name of the array that VTK would colour it by."""
    found: dict[str, Colors | None] = {}
    active: dict[str, str | None] = {}
    for name, attributes in (("points", data.GetPointData()), ("cells", data.GetCellData())):
        scalars = attributes.GetScalars()
        active[name] = None if scalars is None else scalars.GetName()
        found[name] = colors_among(named(attributes), active[name], notes)
    by_points = found["points"] is not None and not (
        active["cells"] and not active["points"] and found["cells"] is not None
    )
    tint = Tint(points=found["points"]) if by_points else Tint(cells=found["cells"])
    return tint, active["points"] or active["cells"]


def scene_of(data: Any, tint: Tint, matrix: NDArray[np.float64] | None = None) -> Scene | None:
    """Return the faces, lines and points of a vtkPolyData with these colours as a scene. None if there are none.

    matrix: [4, 4], which moves all of it.
    """
    if data.GetPoints() is None or not data.GetNumberOfPoints():
        return None
    normals = data.GetPointData().GetNormals()
    points = numbers(data.GetPoints().GetData()).astype(np.float64)
    units = None if normals is None else numbers(normals).astype(np.float64)
    if matrix is not None:
        points = moved(points, matrix)
        units = None if units is None else turned(units, cofactors(matrix)[0])
    geometry = _Geometry(points, units, tint)
    counts = [0, data.GetNumberOfVerts(), data.GetNumberOfVerts() + data.GetNumberOfLines()]
    faces, of_polygon = triangles_of(data)
    lines, of_line = lines_of(data.GetLines())
    dots, dot_counts = corners_of(data.GetVerts())
    of_dot = np.repeat(np.arange(len(dot_counts)), dot_counts)
    return together(
        (
            geometry.faces(faces, of_polygon, counts[2], data.GetNumberOfPolys(), texture_coordinates(data)),
            geometry.marks("lines", lines, of_line + counts[1]),
            geometry.marks("points", dots, of_dot),
        )
    )


def texture_coordinates(data: Any) -> AnyArray | None:
    """Return the active texture coordinates of a vtkPolyData's points, [n, 2], v pointing down; None if it has none."""
    found = data.GetPointData().GetTCoords()
    if found is None or found.GetNumberOfComponents() < 2:
        return None
    return numbers(found)[:, :2] * [1, -1] + [0, 1]


def triangles_of(data: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the triangles of a vtkPolyData's polygons and strips, [m, 3], and the polygon or strip of each, [m].

    Polygons come first. Whatever their shape, they are filled as VTK fills them.
    """
    corners, counts = corners_of(data.GetPolys())
    if (counts == 3).all() and not data.GetNumberOfStrips():
        return corners.reshape(-1, 3), np.arange(len(counts))
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter

    bare = vtkPolyData()
    bare.SetPoints(data.GetPoints())
    bare.SetPolys(data.GetPolys())
    bare.SetStrips(data.GetStrips())
    places = numpy_to_vtk(np.arange(bare.GetNumberOfCells(), dtype=np.int64), deep=True)
    places.SetName(_PIECE)
    bare.GetCellData().AddArray(places)
    split = vtkTriangleFilter()
    split.PassVertsOff()
    split.PassLinesOff()
    split.SetInputData(bare)
    split.Update()
    filled = split.GetOutput()
    if not filled.GetNumberOfPolys():
        return np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    return corners_of(filled.GetPolys())[0].reshape(-1, 3), numbers(filled.GetCellData().GetArray(_PIECE)).astype(
        np.int64
    )


@dataclass(frozen=True, eq=False)
class _Geometry:
    """The points [n, 3] of a vtkPolyData, their normals or None, and its colours, from which scenes are made."""

    points: NDArray[np.float64]
    normals: AnyArray | None
    tint: Tint

    def faces(self, faces: AnyArray, cells: AnyArray, first: int, polygons: int, uv: AnyArray | None) -> Scene | None:
        """Return a scene of these faces, [m, 3], or None without any.

        cells: the polygon or strip of each, [m]. first: the number of polygon 0 among all cells. polygons: how many
        there are. What follows is strips, whose triangles have edges of their own.
        """
        if not len(faces):
            return None
        tint = self.tint
        whole = np.where(cells < polygons, cells, polygons + np.arange(len(cells)))
        return Scene.from_arrays(
            self.points,
            faces,
            face_colors=None if tint.cells is None else tint.cells[first + cells],
            vertex_colors=tint.points,
            color=tint.color,
            vertex_normals=self.normals,
            uv=uv,
            polygons=whole,
        )

    def marks(self, kind: str, ends: AnyArray, cells: AnyArray) -> Scene | None:
        """Return a scene of these lines [k, 2] or points [p], or None without any. cells: the number of each cell."""
        if not len(ends):
            return None
        points, normals, colors = self.points, self.normals, self.tint.points
        if self.tint.cells is not None:  # each has a colour of its own, so its ends must be its own, too
            colors = np.repeat(self.tint.cells[cells], ends[0].size, axis=0)
            points, normals = points[ends.reshape(-1)], None if normals is None else normals[ends.reshape(-1)]
            ends = np.arange(ends.size).reshape(ends.shape)
        return marks(points, **{kind: ends}, vertex_colors=colors, vertex_normals=normals, color=self.tint.color)
