"""What drawing costs, technique by technique: the one table of measured numbers that estimates are made of.

tools/measure_costs.py measures them anew, on any device, and prints this table and how far off its estimates are. These
are of two cores of an AMD EPYC, PoCL 3.0, that others used at the same time: fitted to many scenes, then brought to the
speed that counting has where the cores are free.
"""

from __future__ import annotations

from dataclasses import dataclass

RECORD, VISIT, PIXEL = 6.1, 4.0, 2.6
"""Nanoseconds of counting (depth_complexity.cl): a record of a tile made ready, a strip of it visited for one, and a
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


OPAQUE = Cost(1.15, 0, 22.6, 0)
"""Of scenes with nothing transparent, whatever the technique; fragments are then samples with a surface."""

COSTS = {
    "sort": Cost(3.63, 0.26, 23.4, 0.9),
    "depth-peeling": Cost(1.40, 0.046, 32.9, 0),
    "dual-depth-peeling": Cost(1.69, 0, 30.9, 2.6),
    "multi-layer-peeling": Cost(2.11, 0.17, 26.2, 2.5),
    "glowscript": Cost(1.44, 1.5, 26.7, 0),
    "thickness": Cost(2.88, 0, 0, 7.4),
    "translucency": Cost(3.64, 0, 17.4, 7.8),
    "weighted-average": Cost(3.57, 0, 19.8, 2.8),
    "weighted-sum": Cost(2.61, 0, 21.9, 2.6),
}
