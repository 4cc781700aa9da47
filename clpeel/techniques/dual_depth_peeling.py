"""dual-depth-peeling: the nearest and the farthest layer in each pass (techniques/dual-depth-peeling.cl).

Bavoil and Myers 2008, "Dual Depth Peeling": N layers take N / 2 + 1 geometry passes, (N + 1) / 2 + 1 where N is odd.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from clpeel.device.layout import ALL_LAYERS, FRAGMENT_BYTES
from clpeel.stages.many_passes import peel
from clpeel.techniques.precision import color_bytes

SUMMARY = "exact: peels the nearest and the farthest layer in each geometry pass; N layers take N / 2 + 1 passes"
FIRST_PASSES = 1
"""The first pass finds the outermost layers and peels none."""


def passes_for(layers: Any, options: dict[str, Any]) -> Any:
    """N / 2 + 1, (N + 1) / 2 + 1 where N is odd (Bavoil and Myers 2008)."""
    return (layers + 1) // 2 + FIRST_PASSES


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """Two min-max depth buffers, a front and a back colour; see Buffers in the kernel file."""
    return 4 * FRAGMENT_BYTES + 2 * color_bytes(options)


draw = partial(peel, "techniques/dual-depth-peeling.cl", FIRST_PASSES)


def peeled(passes: int | None = None, **_: Any) -> tuple[int, int]:
    """One layer a peel from the front, and one from the back."""
    return (ALL_LAYERS, 0) if passes is None else (int(passes), int(passes))
