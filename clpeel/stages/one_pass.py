"""One pass: draws a batch of tiles with a technique that needs each pixel's fragments once (frames/one_pass.h)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clpeel.device.layout import (
    BLOCK_PIXELS,
    COLOR_BYTES,
    FRAGMENT_BYTES,
    FRAGMENT_PADDING,
    LIST_GAP,
    RUN_MAX,
    TILE_PIXELS,
    Features,
)
from clpeel.device.program import program
from clpeel.device.records import ONE_PASS_TOTALS
from clpeel.device.workspace import Workspace
from clpeel.stages.binning import Batch
from clpeel.stages.tiles import Canvas, Drawn, draw_tiles, groups_for, stage_of, too_deep

CACHED_FRAGMENTS = 1 << 22
"""How many fragments all groups together have room for (32 MiB), unless the deepest pixels need more."""

LEAST_ROWS, MOST_ROWS, ROWS_APART = 34, RUN_MAX + 2, 32
"""How many rows (layers) a strip has room for: at least, at most, and the step between.

The number is always 2 more than a multiple of 32. Rows have 128 bytes each. With a plain multiple of 32 the same row of
all blocks of a tile would fall on the same places of a cache.
"""

OWN_BUFFERS = ("fragments", "scratch", "colors", "tile_totals", "pass_totals")
"""Names of the device buffers that a technique takes. All others are of the scene, its records and its lists."""


def slabs_for(gpu: Workspace, batch: Batch, capacity: int) -> tuple[int, int, int]:
    """How the memory is used for a batch: work-groups, rows (layers) of a strip, and fragments of a group's slab.

    capacity: how many fragments there is room for in all.
    """
    groups = groups_for(gpu, batch)
    rows = min(
        max(CACHED_FRAGMENTS // (groups * TILE_PIXELS), LEAST_ROWS),
        MOST_ROWS,
        -(-batch.most_layers // ROWS_APART) * ROWS_APART + 2,
    )
    # If there is no room for a slab for each group, fewer groups draw. If one slab does not fit, it gets smaller, and
    # then it holds fewer rows.
    slab = rows * TILE_PIXELS
    return max(min(groups, capacity // slab), 1), rows, min(slab, capacity)


def slab_bytes(gpu: Workspace, features: Features, batch: Batch, capacity: int, scratch_bytes: int) -> int:
    """Bytes of the device's memory that draw_once takes for a batch, unless a pixel has more fragments than a slab."""
    groups, _, slab = slabs_for(gpu, batch, capacity // BLOCK_PIXELS * BLOCK_PIXELS)
    deep = batch.most_layers > RUN_MAX
    return (
        groups * (slab + FRAGMENT_PADDING) * (features.fragment_bytes + scratch_bytes * deep)
        + ONE_PASS_TOTALS.itemsize * batch.tiles
    )


def draw_once(
    canvas: Canvas,
    batch: Batch,
    path: str,
    defines: dict[str, int],
    scratch_bytes: int = 0,
    parameters: Sequence[float] = (),
) -> Drawn:
    """Draws the batch with the technique in the kernel file `path`.

    defines: constants of the kernel. scratch_bytes: further bytes that it needs for each fragment, if a pixel may have
    more than RUN_MAX fragments. parameters: the kernel's own numbers. Raises InputError when a single pixel has more
    fragments than the canvas has room for.
    """
    gpu, features = canvas.gpu, canvas.triangles.features
    kernel = program(gpu, path, features, **defines)["draw"]
    capacity = canvas.capacity // BLOCK_PIXELS * BLOCK_PIXELS  # so every slab begins where a row may
    groups, rows, slab = slabs_for(gpu, batch, capacity)
    if batch.most_layers <= RUN_MAX:
        scratch_bytes = 0
    tile_totals = gpu.buffer("tile_totals", ONE_PASS_TOTALS.itemsize * batch.tiles)
    arguments = canvas.arguments(batch, parameters)
    at_tile = canvas.watch and canvas.watch(batch)
    layers_before = 0
    while True:
        room = groups * (slab + FRAGMENT_PADDING)
        own = {
            "fragments": gpu.buffer("fragments", FRAGMENT_BYTES * room),
            "scratch": gpu.buffer("scratch", scratch_bytes * room) if scratch_bytes else None,
            "colors": gpu.buffer("colors", COLOR_BYTES * room) if features.fragment_color else None,
            "layers_before": layers_before,
            "rows": min(rows, slab // TILE_PIXELS),
            "slab": slab,
            "tile_totals": tile_totals,
        }
        draw_tiles(gpu, stage_of(path), kernel, groups, batch, at_tile, {**arguments, **own})
        totals = gpu.get(tile_totals, batch.tiles, ONE_PASS_TOTALS)
        layers_max = int(totals["layers"].max())
        if layers_max + LIST_GAP <= slab:
            fragments = int(totals["fragments"].sum(dtype=np.int64))
            truncated = int(totals["truncated"].sum(dtype=np.int64))
            opaque = int(totals["opaque"].sum(dtype=np.int64))
            # How much is in front of lost fragments is not known, so all of the picture may hide behind them.
            return Drawn(fragments, layers_max, (fragments,), truncated, float(truncated > 0), opaque)
        if layers_max + LIST_GAP > capacity:
            raise too_deep(layers_max, capacity - LIST_GAP)
        # The kernel skipped tiles with a pixel that no slab can hold. Draw these tiles again, with fewer, larger slabs.
        layers_before, slab = slab - LIST_GAP, min(BLOCK_PIXELS * (layers_max + LIST_GAP), capacity)
        groups = max(min(groups, capacity // slab), 1)
