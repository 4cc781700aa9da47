"""What drawing costs, technique by technique: the measured numbers that all estimates are made from.

tools/measure_costs.py measures the numbers again, on any device. It prints a table, and how far off its estimates are.
There are two tables, because the order of techniques changes with the width of the device's vectors. Both were
measured on two cores with PoCL 3.0: NARROW on an AMD EPYC, for which it compiles AVX2, and WIDE on an Intel Xeon, for
which it compiles AVX-512.
"""

from __future__ import annotations

from dataclasses import dataclass

from clpeel.techniques.technique import Variant


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


@dataclass(frozen=True)
class Costs:
    """A table of costs.

    record, visit, pixel: nanoseconds of counting (counting.cl): to prepare a record of a tile, to visit a strip of the
    tile for a record, and to store a pixel's count. all_opaque: of scenes with nothing transparent, whatever the
    technique is; a fragment is then a sample with a surface. drawing: of each technique, with the options that make it
    a different variant (Technique.variant).
    """

    record: float
    visit: float
    pixel: float
    all_opaque: Cost
    drawing: dict[Variant, Cost]


NARROW = Costs(
    record=8.41,
    visit=3.09,
    pixel=1.35,
    all_opaque=Cost(2.36, 0.154, 0, 5.62, 0),
    drawing={
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
    },
)
"""Of devices whose vectors have fewer than 16 float32 values."""

WIDE = Costs(
    record=11.9,
    visit=2.2,
    pixel=1.8,
    all_opaque=Cost(2.66, 0, 0, 6.58, 1.58),
    drawing={
        ("sort", ()): Cost(2.28, 1.03, 21.7, 1.56, 2.05),
        ("depth-peeling", ()): Cost(1.34, 2.96, 46, 3.24, 4.59),
        ("dual-depth-peeling", ()): Cost(1.86, 2.22, 45.5, 2.8, 5.12),
        ("multi-layer-peeling", ()): Cost(2.88, 1.08, 47, 2.18, 4.06),
        ("multi-layer-peeling", (("layers_per_pass", 2),)): Cost(1.9, 1.49, 41, 2.96, 4),
        ("multi-layer-peeling", (("layers_per_pass", 4),)): Cost(2.37, 1.16, 48.2, 2.31, 3.94),
        ("multi-layer-peeling", (("layers_per_pass", 16),)): Cost(3.68, 1.37, 49.3, 2.13, 4.85),
        ("glowscript", ()): Cost(1.34, 2.88, 46.1, 2.51, 4.48),
        ("thickness", ()): Cost(2.15, 0.994, 0, 0, 6.37),
        ("translucency", ()): Cost(2.13, 1.22, 24.6, 0, 5.46),
        ("weighted-average", ()): Cost(2.15, 1.04, 22, 0.902, 2.11),
        ("weighted-sum", ()): Cost(2.07, 1.07, 25.7, 0.43, 2.06),
    },
)
"""Of devices whose vectors have 16 float32 values, as those of AVX-512 have."""


def costs_of(vector_width: int) -> Costs:
    """The table for a device whose vectors have so many float32 values (CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT)."""
    return WIDE if vector_width >= 16 else NARROW
