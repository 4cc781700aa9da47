"""weighted-average: blends n layers that all have the average colour and alpha (techniques/weighted-average.cl).

C A (1 - (1 - A)^n) / A + C0 (1 - A)^n with C = sum(Ai Ci) / sum(Ai) and A = sum(Ai) / n (Bavoil and Myers 2008,
"Weighted Average"). The sums are taken in submission order.
"""

from __future__ import annotations

from clpeel.techniques.weighted_sum import Sums


class WeightedAverage(Sums):
    """Gives every layer the average colour and alpha."""

    name = "weighted-average"
    summary = "fast, not exact: as many layers as there are, all of the average colour and alpha"
    kernel = "techniques/weighted-average.cl"
