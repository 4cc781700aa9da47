"""sort: the exact picture, by sorting each pixel's fragments (techniques/sort.cl).

Front to back under blending in the order (depth, submission index), float32 (Bavoil and Myers 2008).
"""

from __future__ import annotations

from functools import partial
from typing import Any

from clpeel.draw import draw_once
from clpeel.layout import ALL_LAYERS, FRAGMENT_BYTES

SUMMARY = "exact: sorts each pixel's fragments by depth, then blends them front to back"
SCRATCH_BYTES = FRAGMENT_BYTES
"""Room to sort long lists in, taken only where a pixel has more than RUN_MAX fragments."""


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """All fragments of a sample."""
    return FRAGMENT_BYTES * layers


draw = partial(draw_once, "techniques/sort.cl", SCRATCH_BYTES)


def peeled() -> tuple[int, int]:
    """All layers, from the front."""
    return ALL_LAYERS, 0
