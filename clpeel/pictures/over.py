"""Over: puts a picture with straight or premultiplied alpha over a part of a finished one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def straight(rgb: NDArray[Any], alpha: NDArray[Any]) -> NDArray[Any]:
    """Return premultiplied colours [..., 3], divided by their alphas [..., 1]; 0 where these are 0."""
    return np.divide(rgb, alpha, out=np.zeros_like(rgb), where=alpha > 0)


def converted(color: NDArray[Any], convert: Callable[[NDArray[Any]], NDArray[Any]]) -> NDArray[Any]:
    """Return premultiplied colours [..., 4] whose straight colours are converted."""
    rgb, alpha = color[..., :3], color[..., 3:]
    return np.concatenate([alpha * convert(straight(rgb, alpha)), alpha], axis=-1)


def put_over(image: NDArray[Any], color: NDArray[np.floating[Any]], x: int, y: int) -> None:
    """Put a picture over a part of a finished one, which is changed in place. All of it must lie inside.

    image: [height, width, 4] of an unsigned type whose greatest value is 1, straight alpha, row 0 on top. color: [h, w,
    4], 0..1, premultiplied. x, y: where its upper left corner is. Pixels in which it has nothing stay as they are.
    """
    height, width = color.shape[:2]
    part = image[y : y + height, x : x + width]
    most = float(np.iinfo(image.dtype).max)
    under, above = part / most, color.astype(np.float64)
    through = 1 - above[..., 3:]
    alpha = above[..., 3:] + through * under[..., 3:]
    light = above[..., :3] + through * under[..., :3] * under[..., 3:]
    found = np.clip(np.concatenate([straight(light, alpha), alpha], axis=-1), 0, 1) * most + 0.5
    there = above[..., 3] > 0
    part[there] = found[there].astype(image.dtype)
