"""Transfer functions: how opaque each colour of a map is. Names, and what they mean, are PyVista's."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError

SIGMOIDS = (*range(1, 11), 15, 20)
"""How far "sigmoid_3" and so on reach along the logistic function to either side. "sigmoid" alone is "sigmoid_10"."""

NAMES = ("linear", "geom", "sigmoid", *(f"sigmoid_{reach}" for reach in SIGMOIDS), "foreground")
"""All but "foreground" may have "_r" behind them: the other way round."""


def transfer(function: str | Sequence[float] | NDArray[np.floating], count: int) -> NDArray[np.uint8]:
    """Return the alpha of each of so many colours, 0..255: uint8 [count].

    function: a name; or numbers 0..1, as many as colours, or fewer that stand at even distances, between which it is
    linear. Raises InputError for anything else.
    """
    if isinstance(function, str):
        return _named(function, count)
    try:
        given = np.asarray(function, np.float64)
    except (TypeError, ValueError):
        given = np.zeros(0)
    if given.ndim != 1 or not 1 <= len(given) <= count:
        raise InputError(f"opacity: expected 1..{count} numbers for {count} colours, got {list(np.shape(function))}")
    if not ((given >= 0) & (given <= 1)).all():
        raise InputError(f"opacity: expected numbers 0..1, got {given.min():g} to {given.max():g}")
    if len(given) == count:
        return np.rint(given * 255).astype(np.uint8)
    levels = np.interp(np.linspace(0, 1, count), np.linspace(0, 1, len(given)), given)
    return np.rint(levels * 255).astype(np.uint8)


def _named(name: str, count: int) -> NDArray[np.uint8]:
    """Return the function of a name, rounded down as PyVista does it."""
    stem = name.removesuffix("_r")
    sigmoid = re.fullmatch(r"sigmoid(?:_(\d+))?", stem)
    if stem not in NAMES or (stem == "foreground" and name != stem):
        close = difflib.get_close_matches(name, NAMES, n=1)
        raise InputError(
            f"opacity: expected a number, an array, or one of {', '.join(NAMES[:3])}, sigmoid_1, ..., foreground; "
            f"got {name!r}{f'; did you mean {close[0]}?' if close else ''}"
        )
    if sigmoid:
        reach = float(sigmoid[1] or 10)
        levels = 255 / (1 + np.exp(-np.linspace(-reach, reach, count)))
    elif stem == "foreground":
        levels = np.where(np.arange(count) > 0, 255.0, 0.0)
    else:
        levels = np.linspace(0, 255, count) if stem == "linear" else np.geomspace(1e-6, 255, count)
    found = levels.astype(np.uint8)
    return found if stem == name else found[::-1]
