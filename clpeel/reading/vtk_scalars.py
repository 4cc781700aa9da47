"""VTK's scalars: the numbers that a mapper colours points by, and its lookup table as a colour map."""

from __future__ import annotations

from typing import Any

import numpy as np

from clpeel.pictures.colormaps import ColorMap
from clpeel.reading.vtk_arrays import numbers
from clpeel.scene.arrays import AnyArray
from clpeel.scene.fields import MAGNITUDE

_MAGNITUDE, _COMPONENT = 0, 1  # vector modes of a vtkScalarsToColors
_DIRECT = 2  # a colour mode of a vtkMapper, where scalars are colours
_LOG10 = 1  # a scale of a vtkLookupTable


def mapped_numbers(mapper: Any, data: Any) -> tuple[AnyArray, int, ColorMap] | None:
    """Return the numbers of each point of a vtkPolyData that a mapper looks up between points, and its colour map.

    Between the two is which component counts, or MAGNITUDE. None if it looks up colours in another way: of cells, at
    the points alone, by names, or directly.
    """
    table = mapper.GetLookupTable() if mapper.GetScalarVisibility() else None
    if table is None or not mapper.GetInterpolateScalarsBeforeMapping() or mapper.GetColorMode() == _DIRECT:
        return None
    if not table.IsA("vtkLookupTable") or table.GetIndexedLookup():
        return None
    from vtkmodules.vtkCommonCore import reference
    from vtkmodules.vtkRenderingCore import vtkAbstractMapper

    of_cells: Any = reference(0)
    abstract: Any = vtkAbstractMapper
    scalars = abstract.GetAbstractScalars(
        data, mapper.GetScalarMode(), mapper.GetArrayAccessMode(), mapper.GetArrayId(), mapper.GetArrayName(), of_cells
    )
    if scalars is None or int(of_cells):
        return None
    values = numbers(scalars)
    if values.dtype == np.uint8 and mapper.GetColorMode() == 0 or values.dtype.kind not in "fiu":
        return None  # bytes are colours
    component = MAGNITUDE
    if values.ndim == 2:
        if table.GetVectorMode() not in (_MAGNITUDE, _COMPONENT):
            return None
        if table.GetVectorMode() == _COMPONENT:
            component = min(table.GetVectorComponent(), values.shape[1] - 1)
    found = _color_map(mapper, table, scalars.GetName() or "")
    return None if found is None else (values, component, found)


def _color_map(mapper: Any, table: Any, label: str) -> ColorMap | None:
    """Return a vtkLookupTable as a colour map, or None if its range is none."""
    low, high = table.GetTableRange() if mapper.GetUseLookupTableScalarRange() else mapper.GetScalarRange()
    is_log = table.GetScale() == _LOG10
    if not low < high or (is_log and low <= 0):
        return None
    table.Build()
    below = table.GetBelowRangeColor() if table.GetUseBelowRangeColor() else None
    above = table.GetAboveRangeColor() if table.GetUseAboveRangeColor() else None
    colors = numbers(table.GetTable()).copy()
    nan = _bytes(table.GetNanColor())
    return ColorMap(colors, (float(low), float(high)), is_log, _bytes(below), _bytes(above), nan, label)


def _bytes(color: Any) -> tuple[int, int, int, int] | None:
    """Return a colour 0..1 as bytes, or None if it is None."""
    if color is None:
        return None
    red, green, blue, alpha = (int(np.rint(255 * value)) for value in color)
    return red, green, blue, alpha
