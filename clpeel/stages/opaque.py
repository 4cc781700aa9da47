"""Opaque scenes: a batch of tiles to the picture in one pass, whatever the technique (opaque.cl)."""

from __future__ import annotations

from typing import Any

import numpy as np

from clpeel.device.devices import Gpu
from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.device.program import program
from clpeel.stages.binning import Batch
from clpeel.stages.one_pass import Drawn, Report, draw_tiles, groups_for
from clpeel.stages.projection import Triangles
from clpeel.stages.windows import walk_arguments
from clpeel.techniques.precision import DEFAULT_PRECISION, color_bytes, precision_define

STAGE = "opaque"


def opaque_bytes(options: dict[str, Any]) -> int:
    """Of a sample where opaque surfaces come first: z-far, and the colour there (opaque.h), with these options."""
    return FRAGMENT_BYTES + color_bytes(options)


def draw_opaque(
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    target: dict[str, Any],
    report: Report | None = None,
    precision: str = DEFAULT_PRECISION,
) -> Drawn:
    """Draws the nearest surface of each sample: no fragments are kept, and no geometry pass is made besides this one.

    target, report: as for draw_once (draw.py). precision: of the colour buffer, one of PRECISIONS (blending.py).
    """
    tile_samples = gpu.buffer("tile_totals", 4 * batch.tiles)
    draw_tiles(
        gpu,
        STAGE,
        program(gpu, "stages/opaque.cl", triangles.features, **precision_define(precision))["draw"],
        groups_for(gpu, batch),
        batch,
        report,
        **walk_arguments(triangles, batch),
        **triangles.shading,
        **target,
        tile_samples=tile_samples,
    )
    samples = gpu.get(tile_samples, batch.tiles, np.uint32)
    return Drawn(0, 0, (), opaque_samples=int(samples.sum(dtype=np.int64)))
