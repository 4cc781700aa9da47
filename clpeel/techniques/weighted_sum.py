"""weighted-sum: one pass over the fragments in the order they come (techniques/weighted-sum.cl).

C = sum(Ai Ci) + C0 (1 - sum(Ai)), in submission order (Meshkin 2007; Bavoil and Myers 2008, "Weighted Sum").
"""

from __future__ import annotations

from functools import partial
from typing import Any

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.stages.one_pass import Drawn, draw_once
from clpeel.techniques.precision import DEFAULT_PRECISION, precision_define

SUMMARY = "fast, not exact: adds up the colours times their alphas in any order; right where alphas are small"


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """All fragments of a sample: they are kept until they can be added up in the order of submission."""
    return FRAGMENT_BYTES * layers


def left_out(layers: int, alpha: float) -> float:
    """How far off a channel is at most, over any background, with so many layers of such alphas.

    The sum takes each layer to be seen in full, Ai Ci, where 1 - Pi of it is hidden, Pi being the product of the 1 - Aj
    in front; over a background C0 the picture is off by sum(Ai (1 - Pi) (Ci - C0)), and 1 - Pi <= sum(Aj).
    """
    return alpha * alpha * layers * (layers - 1) / 2


def draw_sums(path: str, *arguments: Any, precision: str = DEFAULT_PRECISION) -> Drawn:
    """Draws a batch by the kernel file `path`, with sums of that precision (PRECISIONS, else InputError)."""
    return draw_once(path, 0, *arguments, **precision_define(precision))


draw = partial(draw_sums, "techniques/weighted-sum.cl")
