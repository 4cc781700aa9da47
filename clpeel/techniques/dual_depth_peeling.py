"""dual-depth-peeling: the nearest and the farthest layer in each pass (techniques/dual-depth-peeling.cl).

Bavoil and Myers 2008, "Dual Depth Peeling": N layers take N / 2 + 1 geometry passes, (N + 1) / 2 + 1 where N is odd.
"""

from __future__ import annotations

from functools import partial

from clpeel.peel import peel

SUMMARY = "exact: peels the nearest and the farthest layer in each geometry pass; N layers take N / 2 + 1 passes"
FIRST_PASSES = 1
"""The first pass finds the outermost layers and peels none."""

draw = partial(peel, "techniques/dual-depth-peeling.cl", FIRST_PASSES)
