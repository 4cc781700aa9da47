"""Over: puts a picture with straight or premultiplied alpha over a part of a finished one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


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
    straight = np.divide(light, alpha, out=np.zeros_like(light), where=alpha > 0)
    found = np.clip(np.concatenate([straight, alpha], axis=-1), 0, 1) * most + 0.5
    there = above[..., 3] > 0
    part[there] = found[there].astype(image.dtype)
