"""multi-layer-peeling: several layers in each pass, by insertion sort (techniques/multi-layer-peeling.cl).

Liu, Wei and Xu 2006, "Multi-layer depth peeling via fragment sort": M layers a pass, so that N layers take N / M
passes, rounded up.
"""

from __future__ import annotations

from typing import Any

from clpeel.draw import Drawn
from clpeel.errors import InputError
from clpeel.layout import ALL_LAYERS
from clpeel.peel import checked_count, peel

SUMMARY = "exact: peels several layers, 8 unless told, in each geometry pass by insertion sort"
MOST_LAYERS = 64


def layers_per_pass(targets: int = 4, target_bytes: int = 16, color_bytes: int = 4, depth_bytes: int = 4) -> int:
    """M of the paper's equation 1: the buckets that so many render targets of so many bytes a pixel hold.

    M = Mrt Bm / (Bc + Bd): 4 targets of 4 x FP32 hold 8 buckets of RGBA8 and FP32 depth, or 16 of depth alone
    (color_bytes=0). Raises InputError where not one fits.
    """
    bucket = color_bytes + depth_bytes
    layers = targets * target_bytes // bucket if bucket > 0 else 0
    if layers < 1:
        raise InputError(
            f"layers_per_pass: expected render targets that hold one bucket of {bucket} bytes, "
            f"got {targets} of {target_bytes} bytes"
        )
    return layers


def draw(*arguments: Any, layers_per_pass: int = layers_per_pass(), **options: Any) -> Drawn:
    """Draws a batch of tiles, `layers_per_pass` layers a pass (1..MOST_LAYERS, else InputError)."""
    defines = {"LAYERS_A_PASS": checked_count("layers_per_pass", layers_per_pass, MOST_LAYERS)}
    return peel("techniques/multi-layer-peeling.cl", 0, *arguments, defines=defines, **options)


def peeled(passes: int | None = None, layers_per_pass: int = layers_per_pass(), **_: Any) -> tuple[int, int]:
    """So many layers a pass, from the front."""
    return ALL_LAYERS if passes is None else int(passes) * int(layers_per_pass), 0
