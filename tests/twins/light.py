"""Blending as linear light, obviously right: one pixel at a time, in float64."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twins.textures import to_linear, to_srgb

Floats = NDArray[np.float64]


def blended(layers: Any, technique: str) -> Floats:
    """What layers become, front to back, straight sRGB [n, 4]: premultiplied light and transmittance, [4].

    An opaque layer is the last one. It lies behind what techniques without an order add up.
    """
    light = [(to_linear(rgba[:3]), float(rgba[3])) for rgba in np.asarray(layers, np.float64)]
    color, through = np.zeros(3), 1.0
    if technique.startswith("weighted"):
        clear = [(c, a) for c, a in light if a < 1]
        total, n = sum(a for _, a in clear), len(clear)
        for c, a in clear:
            color += a * c
        through = 1 - total
        if technique == "weighted-average" and total > 0:
            through = (1 - total / n) ** n
            color *= (1 - through) / total
        light = [(c, a) for c, a in light if a == 1]
    for c, a in light:
        color += through * a * c
        through *= 1 - a
    return np.array([*color, through])


def mean(samples: Sequence[Floats]) -> Floats:
    """The mean of a pixel's samples."""
    return np.mean(np.array(samples), axis=0)


def color_of(pixel: Floats) -> Floats:
    """What `Result.color` has of a pixel: alpha times the sRGB of the straight colour, and alpha."""
    alpha = 1 - pixel[3]
    straight = pixel[:3] / alpha if alpha > 0 else np.zeros(3)
    return np.array([*(alpha * to_srgb(np.clip(straight, 0, 1))), alpha])


def picture_of(pixel: Floats, background: Any) -> Floats:
    """What the picture shows of a pixel, 0..1, over an sRGB colour, or straight with its alpha if there is none."""
    if background is None:
        alpha = 1 - pixel[3]
        straight = pixel[:3] / alpha if alpha > 0 else np.zeros(3)
        return np.array([*to_srgb(np.clip(straight, 0, 1)), alpha])
    return np.array([*to_srgb(np.clip(pixel[:3] + pixel[3] * to_linear(background), 0, 1)), 1.0])
