"""weighted-average: n layers of the average colour and alpha (techniques/weighted-average.cl).

C A (1 - (1 - A)^n) / A + C0 (1 - A)^n with C = sum(Ai Ci) / sum(Ai), A = sum(Ai) / n, in submission order (Bavoil and
Myers 2008, "Weighted Average").
"""

from __future__ import annotations

from clpeel.techniques.weighted_sum import Sums


class WeightedAverage(Sums):
    """Every layer alike."""

    name = "weighted-average"
    summary = "fast, not exact: as many layers as there are, all of the average colour and alpha"
    kernel = "techniques/weighted-average.cl"
