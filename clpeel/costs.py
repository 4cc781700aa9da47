"""What drawing costs, technique by technique: the one table of measured numbers that estimates are made of.

tools/measure_costs.py measures them anew, on any device, and prints this table and how far off its estimates are. These
are of two cores of an AMD EPYC, PoCL 3.0, that others used at the same time.
"""

from __future__ import annotations

from dataclasses import dataclass

RECORD, VISIT = 13.3, 8.67
"""Nanoseconds of counting (depth_complexity.cl): a record of a tile made ready, and a strip of it visited for one."""


@dataclass(frozen=True)
class Cost:
    """walk: of a tile's records in one pass, in times of counting's. In nanoseconds, all units of the device together,
    fragment: to keep, order and blend one; shaded: more where its colour varies over a face; pixel: to put one into the
    picture."""

    walk: float
    fragment: float
    shaded: float
    pixel: float


OPAQUE = Cost(1.15, 0, 49.2, 0)
"""Of scenes with nothing transparent, whatever the technique; fragments are then samples with a surface."""

COSTS = {
    "sort": Cost(3.63, 0.57, 50.8, 1.96),
    "depth-peeling": Cost(1.40, 0.10, 71.6, 0),
    "dual-depth-peeling": Cost(1.69, 0, 67.1, 5.62),
    "multi-layer-peeling": Cost(2.11, 0.38, 57.0, 5.54),
    "glowscript": Cost(1.44, 3.3, 58.1, 0),
    "thickness": Cost(2.88, 0, 0, 16.1),
    "translucency": Cost(3.64, 0, 37.9, 17.0),
    "weighted-average": Cost(3.57, 0, 43.0, 6.05),
    "weighted-sum": Cost(2.61, 0, 47.7, 5.65),
}
