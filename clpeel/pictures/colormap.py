"""The colour map: turns numbers 0..1 into colours of evenly rising lightness, for maps of one quantity.

One map is enough, so its 52 colours are stored here. The package cmap has them too, but takes 80 MB.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

OUTSIDE = np.array([1.0, 0.0, 1.0])
"""Magenta, for values without a number. The colour map does not contain it."""

_STOPS = (
    "44015446085c471063481769481d6f482475472a7a46307e453781433d844142873f48893d4e8a"
    "3a538b38598c355e8d33638d31688e2e6d8e2c718e2a768e297b8e27808e25848e23898e218e8d"
    "20928c1f978b1e9c891fa18821a58524aa8328ae802eb37c35b7793dbc7446c06f50c46a5ac864"
    "65cb5e70cf577cd25089d54895d840a2da37b0dd2fbddf26cae11fd8e219e5e419f1e51dfde725"
)
VIRIDIS = np.frombuffer(bytes.fromhex(_STOPS), np.uint8).reshape(-1, 3) / 255
"""Viridis (Nathaniel Smith and Stefan van der Walt, CC0), every fifth of its 256 colours: float64 [52, 3]."""


def colors_at(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the RGB of numbers: float64 [..., 3], 0..1, interpolated linearly between the colours of VIRIDIS.

    A number outside 0..1 gets the colour of the nearer end.
    """
    places = np.linspace(0, 1, len(VIRIDIS))
    return np.stack([np.interp(values, places, VIRIDIS[:, channel]) for channel in range(3)], axis=-1)
