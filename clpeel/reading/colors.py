"""Colours: finds those among the named arrays of a mesh of another library."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clpeel.scene.arrays import AnyArray, Colors

_NAMES = ("rgba", "rgb", "colors", "color", "colours", "colour")
"""What arrays of colours are called, in lower case. Only such an array may have floats: others are often vectors."""


def colors_among(
    arrays: Mapping[str, AnyArray], active: str | None, notes: list[str]
) -> tuple[Colors | None, dict[str, AnyArray]]:
    """Return the colours [n, 3|4] among the arrays of points, or of cells, and all other arrays of numbers.

    Colours are uint8, or floats 0..1; None if there are none.

    active: the name of the array that the library would colour by, which comes first; then one that is called RGB or
    Colors, and then any of 3 or 4 bytes. Adds a note if floats are outside 0..1 or NaN: these are cut off.
    """
    known = sorted((name for name in arrays if name.lower() in _NAMES), key=lambda name: _NAMES.index(name.lower()))
    first = [] if active is None or active not in arrays else [active]
    for name in (*first, *known, *arrays):
        array = np.asarray(arrays[name])
        if array.ndim != 2 or array.shape[1] not in (3, 4):
            continue
        if array.dtype == np.uint8:
            return array, _others(arrays, name)
        if array.dtype.kind == "f" and name.lower() in _NAMES:
            return unit_colors(array, f"colours {name!r}", notes), _others(arrays, name)
    return None, _others(arrays, "")


def _others(arrays: Mapping[str, AnyArray], colors: str) -> dict[str, AnyArray]:
    """Return the arrays that a scene can be coloured by: none of colours, nor of matrices, nor those of VTK itself."""
    kept = {name: np.asarray(array) for name, array in arrays.items() if name != colors and not name.startswith("vtk")}
    return {name: array for name, array in kept.items() if array.ndim in (1, 2) and array.dtype.kind in "fiub"}


def unit_colors(array: AnyArray, name: str, notes: list[str]) -> Colors:
    """Return colours that are floats as float32 in 0..1. What is outside is cut off, and NaN becomes 0, with a note."""
    wrong = int(np.count_nonzero(~((array >= 0) & (array <= 1)).all(axis=1)))
    if wrong:
        notes.append(f"{name}: {wrong:,} of {len(array):,} are not within 0..1, and were cut off")
    return np.clip(np.nan_to_num(array, nan=0.0), 0, 1).astype(np.float32)
