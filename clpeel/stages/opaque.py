"""Opaque scenes: draws a batch of tiles in one pass, whatever the technique is (stages/opaque.cl)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clpeel.device.program import program
from clpeel.stages.binning import Batch
from clpeel.stages.tiles import Canvas, Drawn, draw_tiles, groups_for

STAGE = "opaque"


def draw_opaque(canvas: Canvas, batch: Batch, defines: Mapping[str, int]) -> Drawn:
    """Draws the nearest surface of each sample, in one geometry pass that stores no fragments.

    defines: constants of the kernel.
    """
    gpu = canvas.gpu
    tile_samples = gpu.buffer("tile_totals", 4 * batch.tiles)
    draw_tiles(
        gpu,
        STAGE,
        program(gpu, "stages/opaque.cl", canvas.triangles.features, **defines)["draw"],
        groups_for(gpu, batch),
        batch,
        canvas.watch and canvas.watch(batch),
        {**canvas.arguments(batch), "tile_samples": tile_samples},
    )
    samples = gpu.get(tile_samples, batch.tiles, np.uint32)
    return Drawn(0, 0, (), opaque_samples=int(samples.sum(dtype=np.int64)))
