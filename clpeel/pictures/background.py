"""Backgrounds: the colour behind each row of a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import Background, shades_of


def rows_of(background: Background, height: int) -> NDArray[np.float64]:
    """Return the colour behind each row, 0..1, row 0 on top: float64 [height, 1, 3].

    A gradient is linear in the values that the picture holds. A row has the colour of its centre, which lies at
    (row + 0.5) / height of the way from top to bottom.
    """
    shades = np.array(shades_of(background), np.float64)
    way = (np.arange(height)[:, None, None] + 0.5) / height
    return np.asarray(shades[0] + way * (shades[-1] - shades[0]))


def levels_of(background: Background, height: int) -> NDArray[np.uint8]:
    """Return the pixel that shows where nothing is drawn, for each row, row 0 on top: uint8 [height, 1, 4], opaque."""
    rows = np.pad(rows_of(background, height), ((0, 0), (0, 0), (0, 1)), constant_values=1.0)
    return (rows * 255 + 0.5).astype(np.uint8)
