"""weighted-sum: one pass over the fragments in the order they come (techniques/weighted-sum.cl).

C = sum(Ai Ci) + C0 (1 - sum(Ai)), float32, in submission order (Meshkin 2007; Bavoil and Myers 2008, "Weighted Sum").
"""

from __future__ import annotations

from functools import partial

from clpeel.draw import draw_once

SUMMARY = "fast, not exact: adds up the colours times their alphas in any order; right where alphas are small"

draw = partial(draw_once, "techniques/weighted-sum.cl", 0)
