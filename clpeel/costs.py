"""What drawing costs, technique by technique: the one table of measured numbers that estimates are made of.

tools/measure_costs.py measures them anew, on any device, and prints this table and how far off its estimates are. These
are of two cores of an AMD EPYC, PoCL 3.0, which compiles for AVX2 there.
"""

from __future__ import annotations

from dataclasses import dataclass

RECORD, VISIT, PIXEL = 9.48, 2.71, 1.27
"""Nanoseconds of counting (counting.cl): a record of a tile made ready, a strip of it visited for one, and a
pixel's count stored."""


@dataclass(frozen=True)
class Cost:
    """What things cost: a walk over a tile's records in times of counting's, else nanoseconds of all units together.

    fragment: to keep, order and blend one; shaded: more where its colour varies over a face; pixel: to put one into the
    picture.
    """

    walk: float
    fragment: float
    shaded: float
    pixel: float


OPAQUE = Cost(1.93, 1.09, 21.6, 0)
"""Of scenes with nothing transparent, whatever the technique; fragments are then samples with a surface."""

COSTS = {
    "sort": Cost(4.99, 1.01, 16.8, 0.8),
    "depth-peeling": Cost(1.50, 1.78, 21.3, 1.8),
    "dual-depth-peeling": Cost(1.79, 1.45, 20.8, 1.9),
    "multi-layer-peeling": Cost(2.64, 0.81, 21.0, 2.1),
    "glowscript": Cost(1.53, 1.75, 20.6, 1.9),
    "thickness": Cost(3.68, 1.03, 0.1, 2.8),
    "translucency": Cost(4.37, 1.11, 15.0, 2.6),
    "weighted-average": Cost(4.71, 0.58, 16.9, 0.8),
    "weighted-sum": Cost(4.61, 0.42, 16.6, 0.7),
}
