"""What drawing costs, technique by technique: the one table of measured numbers that estimates are made of.

tools/measure_costs.py measures them anew, on any device, and prints this table and how far off its estimates are.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """Nanoseconds, all units of the device taken together.

    record: to make one of a tile's records ready in one walk; visit: to find what it covers of a strip of the tile, in
    one walk; fragment: to keep, order and blend one; shaded: more where its colour varies over a face; pixel: to put
    one into the picture.
    """

    record: float
    visit: float
    fragment: float
    shaded: float
    pixel: float


COUNTING = Cost(1, 1, 0, 0, 1)
"""Of counting alone (depth_complexity.cl): what the others are scaled by on another device."""

OPAQUE = Cost(1, 1, 0, 0, 1)
"""Of scenes with nothing transparent, whatever the technique; its fragments are samples with a surface."""

COSTS: dict[str, Cost] = {}
