"""Shown errors: how far off the picture may be, where what is blended may be off by so much.

If colours are blended as they are shown, that is the same. If they are blended as linear light, each channel is shown
by the curve g of sRGB. It is concave, g(0) = 0, and its slope is 12.92 at most, at 0. So light that is off by t is
shown off by g(x + t) - g(x) <= g(t) <= 12.92 t.

`Result.color` is A g(x / A), of premultiplied light x and alpha A. It rises with both. For c = x / A its slopes add
up to g'(c) + g(c) - c g'(c), which is what the tangent at c is at 1, and so 12.92 at most. In front of layers that
are skipped lies x = (1 - t) c with A = 1 - t, and these can add t to both at most. The difference g((1 - t) c + t) -
(1 - t) g(c) falls with c, as its slope is (1 - t) (g'((1 - t) c + t) - g'(c)) <= 0. For c = 0 it is g(t).
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.textures import linear, srgb

Number = TypeVar("Number", float, NDArray[np.float32], NDArray[np.float64])

STEEPEST = 12.92
"""The greatest slope of sRGB."""

ENCODING = 12 * 2.0**-24
"""How far off sRGB is by its own roundings: 8 of the curve (kernels/shading/reals.h), and those of x / A and A g."""


def may_hide(error: float, as_light: bool) -> float:
    """Return the greatest transmittance in front of skipped layers that keeps the picture within an error, 0..1."""
    return min(float(linear(error)), 1.0) if as_light else error


def error_of(hidden: Number, as_light: bool) -> Number:
    """Return how far off the picture is at most, if so much transmittance is in front of skipped layers."""
    if not as_light:
        return hidden
    return float(srgb(hidden)) if isinstance(hidden, float) else srgb(hidden).astype(hidden.dtype)


def steepest(as_light: bool) -> float:
    """Return how far off the picture is at most, for each unit that colours and alphas are off otherwise."""
    return STEEPEST if as_light else 1.0


def rounding_of(blending: Number, as_light: bool) -> Number:
    """Return how far off the picture is at most by rounding. blending: the same of what is blended."""
    return steepest(as_light) * blending + (ENCODING if as_light else 0.0)
