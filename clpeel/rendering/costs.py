"""What drawing costs, technique by technique: the table of measured numbers that all estimates are made from.

tools/measure_costs.py measures the numbers again, on any device. It prints this table and how far off its estimates
are. The numbers here were measured on two cores of an AMD EPYC with PoCL 3.0, which compiles for AVX2 there.
"""

from __future__ import annotations

from dataclasses import dataclass

from clpeel.techniques.technique import Variant

RECORD, VISIT, PIXEL = 8.41, 3.09, 1.35
"""Nanoseconds of counting (counting.cl): to prepare a record of a tile, to visit a strip of the tile for a record, and
to store a pixel's count."""


@dataclass(frozen=True)
class Cost:
    """What the parts of drawing cost. All but `walk` are nanoseconds, of all compute units together.

    walk: a walk over a tile's records, as a multiple of what counting takes for it. fragment: to store, order and blend
    a fragment. lit_visit, lit_fragment: what a visited strip and a fragment cost more if colours vary over faces.
    pixel: to put a pixel into the picture.
    """

    walk: float
    fragment: float
    lit_visit: float
    lit_fragment: float
    pixel: float


ALL_OPAQUE_COST = Cost(2.36, 0.154, 0, 5.62, 0)
"""Of scenes with nothing transparent, whatever the technique is. A fragment is then a sample with a surface."""

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
"""The costs of each technique, with the options that make it a different variant (Technique.variant)."""
