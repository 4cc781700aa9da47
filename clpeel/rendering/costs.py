"""What drawing costs, technique by technique: the one table of measured numbers that estimates are made of.

tools/measure_costs.py measures them anew, on any device, and prints this table and how far off its estimates are. These
are of two cores of an AMD EPYC, PoCL 3.0, which compiles for AVX2 there.
"""

from __future__ import annotations

from dataclasses import dataclass

from clpeel.techniques.technique import Variant

RECORD, VISIT, PIXEL = 8.41, 3.09, 1.35
"""Nanoseconds of counting (counting.cl): a record of a tile made ready, a strip of it visited for one, and a
pixel's count stored."""


@dataclass(frozen=True)
class Cost:
    """What things cost: a walk over a tile's records in times of counting's, else nanoseconds of all units together.

    fragment: to keep, order and blend one; lit_visit, lit_fragment: more where colours vary over faces, of a strip that
    is visited and of a fragment; pixel: to put one into the picture.
    """

    walk: float
    fragment: float
    lit_visit: float
    lit_fragment: float
    pixel: float


ALL_OPAQUE_COST = Cost(2.36, 0.154, 0, 5.62, 0)
"""Of scenes with nothing transparent, whatever the technique; fragments are then samples with a surface."""

COSTS: dict[Variant, Cost] = {
    ("sort", ()): Cost(4.57, 1, 8.86, 1.86, 0.788),
    ("depth-peeling", ()): Cost(1.31, 2.05, 51.3, 0.666, 1.68),
    ("dual-depth-peeling", ()): Cost(1.56, 1.9, 50.3, 0.32, 1.99),
    ("multi-layer-peeling", ()): Cost(2.43, 0.725, 43.1, 1.14, 2.12),
    ("multi-layer-peeling", (("layers_per_pass", 2),)): Cost(1.6, 1.53, 48.5, 0.871, 1.77),
    ("multi-layer-peeling", (("layers_per_pass", 4),)): Cost(1.97, 1.15, 44.8, 0.722, 1.85),
    ("multi-layer-peeling", (("layers_per_pass", 16),)): Cost(3.12, 1.27, 38.2, 1.2, 2.3),
    ("glowscript", ()): Cost(1.39, 1.31, 43.2, 1.12, 1.85),
    ("thickness", ()): Cost(3.71, 1.08, 1.13, 0, 3.43),
    ("translucency", ()): Cost(4.38, 1.2, 8.62, 1.26, 2.92),
    ("weighted-average", ()): Cost(4.18, 0.758, 15, 1.08, 0.807),
    ("weighted-sum", ()): Cost(3.93, 0.764, 14.6, 0.863, 0.78),
}
"""By technique and those options that make it another (Technique.variant)."""
