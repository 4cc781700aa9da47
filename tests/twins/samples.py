"""The float64 twin of several samples a pixel: where they lie, by definition, and pictures as means over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twins import reference

Floats = NDArray[np.float64]


def rotated(columns: int, rows: int, x: Any, y: Any, steps: int) -> Floats:
    """Places of columns x rows cells: cell (i, j) has x(i, j) and y(i, j), in `steps` of a pixel, from the middle."""
    return np.array([((x(i, j) + 0.5) / steps, (y(i, j) + 0.5) / steps) for j in range(rows) for i in range(columns)])


PLACES: dict[int, Floats] = {
    1: np.array([(0.5, 0.5)]),
    4: rotated(2, 2, lambda i, j: 2 * i + j, lambda i, j: 2 * j + (1 - i), 4),
    8: rotated(4, 2, lambda i, j: 2 * i + j, lambda i, j: 4 * j + (1, 3, 0, 2)[i], 8),
    16: rotated(4, 4, lambda i, j: 4 * i + j, lambda i, j: 4 * j + (3 - i), 16),
    64: rotated(8, 8, lambda i, j: i, lambda i, j: j, 8),
}
"""Where the samples of a pixel lie, from its upper left corner, right and down, in pixels."""


def shaded_once(soup: Any) -> NDArray[np.bool_]:
    """Which faces have one colour for all samples that they cover in a pixel: all whose texels cut nothing away."""
    cuts = [
        each.alpha_mode == "MASK"
        or (each.alpha_mode == "BLEND" and each.texture is not None and (each.texture.image[..., 3] == 0).any())
        for each in soup.materials
    ]
    if soup.face_materials is None:
        return np.ones(len(soup.faces), bool)
    return ~np.array([*cuts, False])[soup.face_materials]


@dataclass(frozen=True)
class Sampled:
    """A picture of several samples a pixel. h rows, w columns."""

    color: Floats  # [h, w, 4] premultiplied RGBA, 0..1, before the background
    bound: Floats  # [h, w] how far float32 may stray, where it is known
    excused: NDArray[np.bool_]  # [h, w] a sample lies on an edge, or two layers are too close to tell
    layers: NDArray[np.int64]  # [h, w] hits of all samples


def render(judge: Any, soup: Any, view: Any, size: tuple[int, int], samples: int, **options: Any) -> Sampled:
    """The mean of as many exact pictures as there are samples, each with its samples in another place.

    A sum of n numbers up to 1, rounded n times in float32, and its quotient are off by n + 1 roundings at most.
    """
    places, once = PLACES[samples], shaded_once(soup)
    parts = [judge.weigh(soup, view, size, aside=(x - 0.5, y - 0.5), once=once, **options) for x, y in places]
    return Sampled(
        np.mean([twin.color for twin, _, _ in parts], axis=0),
        np.mean([bound for _, _, bound in parts], axis=0) + (len(places) + 1) * reference.UNIT,
        np.any([excused for _, excused, _ in parts], axis=0),
        np.sum([twin.layers for twin, _, _ in parts], axis=0),
    )
