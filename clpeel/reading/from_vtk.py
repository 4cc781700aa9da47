"""Converts VTK's data sets, and so PyVista's, to Scenes: faces, lines, points, and the colours among their arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.colors import colors_among
from clpeel.reading.geometry import Geometry, Tint
from clpeel.reading.marks import together
from clpeel.reading.transforms import cofactors, moved, turned
from clpeel.reading.vtk_arrays import corners_of, lines_of, messages, named, numbers
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.scene import Scene

_PIECE = "clpeel cell"


def from_vtk(source: Any) -> Scene:
    """Return the scene of a vtkDataSet, or of all parts of a vtkCompositeDataSet in order. PyVista's meshes are both.

    Of grids and of cells with a volume, the surface is drawn, as VTK extracts it. Polygons and strips become triangles.
    Colours are display-referred: those that VTK would colour by if they are bytes of RGB or RGBA, else an array that is
    called RGB, RGBA or Colors. All other arrays of points and cells become those of the scene's vertices and faces.
    Raises InputError if there is nothing to draw.
    """
    notes = list[str]()
    with messages() as told:
        parts = [surface(leaf) for leaf in leaves(source)]
        found = [scene_of(part, own_tint(part, notes)) for part in parts]
    scene = together(found)
    if scene is None:
        raise InputError(
            f"expected triangles, lines or points, got none in a {source.GetClassName()}; the mesh is empty"
        )
    return replace(
        scene, notes=tuple(dict.fromkeys([*scene.notes, *notes, *(f"VTK reports: {text}" for text in told)]))
    )


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


def own_tint(data: Any, notes: list[str]) -> Tint:
    """Return the colours among the arrays of a vtkPolyData, those of points before those of cells. Adds notes."""
    points, of_points = _arrays(data.GetPointData(), notes)
    cells, of_cells = _arrays(data.GetCellData(), notes)
    active = [attributes.GetScalars() is not None for attributes in (data.GetPointData(), data.GetCellData())]
    by_cells = points is None or (cells is not None and active == [False, True])
    return Tint(None if by_cells else points, cells if by_cells else None, None, of_points, of_cells)


def _arrays(attributes: Any, notes: list[str]) -> tuple[Colors | None, dict[str, AnyArray]]:
    """Return the colours of points, or of cells, and their other numbers, but for normals and texture coordinates."""
    scalars = attributes.GetScalars()
    colors, others = colors_among(named(attributes), None if scalars is None else scalars.GetName(), notes)
    for array in (attributes.GetNormals(), attributes.GetTCoords()):
        if array is not None:
            others.pop(array.GetName(), None)
    return colors, others


def scene_of(data: Any, tint: Tint, matrix: NDArray[np.float64] | None = None, arrays: bool = False) -> Scene | None:
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
    geometry = Geometry(points, units, tint)
    counts = [0, data.GetNumberOfVerts(), data.GetNumberOfVerts() + data.GetNumberOfLines()]
    faces, of_polygon = triangles_of(data)
    # The triangles of a strip have edges of their own.
    whole = data.GetNumberOfPolys()
    polygons = np.where(of_polygon < whole, of_polygon, whole + np.arange(len(faces)))
    lines, of_line = lines_of(data.GetLines())
    dots, dot_counts = corners_of(data.GetVerts())
    of_dot = np.repeat(np.arange(len(dot_counts)), dot_counts)
    return together(
        (
            geometry.faces(faces, of_polygon + counts[2], polygons, texture_coordinates(data)),
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
