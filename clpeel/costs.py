"""What drawing costs, technique by technique: the one table of measured numbers that estimates are made of.

tools/measure_costs.py measures them anew, on any device, and prints this table and how far off its estimates are. These
are of two cores of an AMD EPYC, PoCL 3.0, which compiles for AVX2 there.
"""

from __future__ import annotations

from dataclasses import dataclass

RECORD, VISIT, PIXEL = 8.61, 2.64, 1.41
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


OPAQUE = Cost(2.53, 0.293, 5.5, 0)
"""Of scenes with nothing transparent, whatever the technique; fragments are then samples with a surface."""

COSTS = {
    "sort": Cost(5.35, 0.938, 2.37, 0.786),
    "depth-peeling": Cost(1.68, 1.49, 5.58, 1.71),
    "dual-depth-peeling": Cost(2.1, 1.14, 4.88, 1.89),
    "multi-layer-peeling": Cost(3.34, 0.464, 5.13, 2.03),
    "multi-layer-peeling, layers_per_pass 2": Cost(2.17, 1.18, 5.54, 1.82),
    "multi-layer-peeling, layers_per_pass 4": Cost(2.62, 0.591, 5.05, 1.89),
    "multi-layer-peeling, layers_per_pass 16": Cost(4.44, 0.673, 5, 2.33),
    "glowscript": Cost(1.79, 0.891, 5.5, 1.87),
    "thickness": Cost(3.84, 1.09, 0, 3.55),
    "translucency": Cost(4.84, 0.989, 2.02, 3.18),
    "weighted-average": Cost(5.18, 0.464, 2.53, 0.776),
    "weighted-sum": Cost(5.02, 0.41, 2.45, 0.723),
}
