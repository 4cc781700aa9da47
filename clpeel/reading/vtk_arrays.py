"""VTK's arrays: NumPy arrays of them, its cells as faces, lines and points, and its messages, which go nowhere else."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.reading.marks import chains
from clpeel.scene.arrays import AnyArray

_turn = threading.RLock()  # VTK has one window for its messages


@contextmanager
def messages() -> Iterator[list[str]]:
    """Yield a list that holds VTK's errors and warnings, a line each, once the block has ended.

    They go nowhere else.
    """
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

    with _turn:
        before, window = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
        level = vtkLogger.GetCurrentVerbosityCutoff()
        vtkOutputWindow.SetInstance(window)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
        found = list[str]()
        try:
            yield found
        finally:
            vtkLogger.SetStderrVerbosity(level)
            vtkOutputWindow.SetInstance(before)
            found += dict.fromkeys(_told(window.GetOutput()))


_BEGIN = re.compile(r"^(?:ERROR|Warning|Generic Warning): In .*, line \d+\n", re.MULTILINE)
_OBJECT = re.compile(r"^\w+ \(0x[0-9a-f]+\): ")


def _told(text: str) -> Iterator[str]:
    """Yield the messages in the text of a window, each on one line, without the places in VTK's sources."""
    for part in _BEGIN.split(text or "")[1:]:
        said = " ".join(part.split())
        if said:
            yield _OBJECT.sub("", said)[:200]


def numbers(array: Any) -> AnyArray:
    """Return a vtkDataArray as NumPy has it, [n] or [n, components]. It may share its memory."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkDataArray

    try:
        return np.asarray(vtk_to_numpy(array))
    except (TypeError, AttributeError, ValueError):  # one that is computed, or that has a column for each component
        whole = vtkDataArray.CreateDataArray(array.GetDataType())
        whole.DeepCopy(array)
        return np.asarray(vtk_to_numpy(whole))


def named(attributes: Any) -> dict[str, AnyArray]:
    """Return the arrays of numbers of a vtkFieldData by name."""
    found = (
        (attributes.GetArrayName(place), attributes.GetArray(place)) for place in range(attributes.GetNumberOfArrays())
    )
    return {name: numbers(array) for name, array in found if name and array is not None and array.GetNumberOfTuples()}


def corners_of(cells: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the vertices of all cells of a vtkCellArray one after another, and how many each cell has, int64 both."""
    if cells is None or not cells.GetNumberOfCells():
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    offsets = numbers(cells.GetOffsetsArray()).astype(np.int64)
    return numbers(cells.GetConnectivityArray()).astype(np.int64)[offsets[0] : offsets[-1]], np.diff(offsets)


def lines_of(cells: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the segments of the polylines in a vtkCellArray, [k, 2], and the cell of each, [k]."""
    corners, counts = corners_of(cells)
    segments = chains(counts)
    of_cell = np.repeat(np.arange(len(counts)), counts)
    return corners[segments], of_cell[segments[:, 0]]
