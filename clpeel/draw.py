"""Drawing: a batch of tiles to the picture, by a technique that goes through each pixel's fragments once (draw.h)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from clpeel.binning import Batch
from clpeel.device import Gpu
from clpeel.layout import BLOCK_PIXELS, COLOR_BYTES, FRAGMENT_BYTES, FRAGMENT_PADDING, RUN_MAX
from clpeel.program import launch, program
from clpeel.projection import Triangles
from clpeel.raster import count_fragments, too_deep

GROUPS_A_UNIT = 16
"""Work-groups for each compute unit, each with a slab of its own."""


SLAB_FRAGMENTS = 1 << 16
"""A tile with more fragments than this, 512 KiB, is drawn in runs of pixels."""

CACHED_FRAGMENTS = 1 << 22
"""Fragments that all groups have room for: 32 MiB, unless the fullest tiles need more."""

REPORTED_FRAGMENTS = 1 << 24
"""Fragments that are drawn between two reports of progress: some tenths of a second."""

Report = Callable[[int], None]


@dataclass(frozen=True)
class Drawn:
    """What a batch had: how many fragments, and how many in its deepest pixel."""

    fragments: int
    layers_max: int


def draw_once(
    path: str,
    scratch_bytes: int,
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    target: dict[str, Any],
    capacity: int,
    report: Report | None = None,
) -> Drawn:
    """Draws the batch with the technique in the kernel file `path`, with room for `capacity` fragments.

    target: the picture, as Picture.begin gives it.
    scratch_bytes: what the technique needs besides for each fragment where a pixel has more than RUN_MAX.
    report: called now and then with the picture's tile that it has come to.
    Raises InputError when a single pixel has more fragments than that.
    """
    features = triangles.features
    counts = count_fragments(gpu, triangles, batch)
    layers_max = int(counts.layers.max())
    if layers_max > capacity:
        raise too_deep(layers_max, capacity)
    units = int(gpu.device.max_compute_units)
    # A slab holds the fullest tile, or the fullest block of one that is too deep for the caches. Where many slabs are
    # too much, fewer groups; at last, fuller tiles in smaller parts.
    slab = max(min(int(counts.totals.max()), max(SLAB_FRAGMENTS, BLOCK_PIXELS * layers_max)), 1)
    groups = min(max(CACHED_FRAGMENTS // slab, units), GROUPS_A_UNIT * units, batch.tiles)
    if groups * slab > capacity:
        groups = max(min(groups, capacity // layers_max), 1) if layers_max else 1
        slab = capacity // groups
    room = groups * (slab + FRAGMENT_PADDING)
    buffers = {
        "fragments": gpu.buffer("fragments", FRAGMENT_BYTES * room),
        "scratch": gpu.buffer("scratch", scratch_bytes * room) if scratch_bytes and layers_max > RUN_MAX else None,
        "colors": gpu.buffer("colors", COLOR_BYTES * room) if features.fragment_color else None,
    }
    ends = np.cumsum(counts.totals)
    stage, kernel = path.removesuffix(".cl").rpartition("/")[2], program(gpu, path, features)["draw"]
    tile = 0
    while tile < batch.tiles:
        part = REPORTED_FRAGMENTS if report else int(ends[-1]) + 1
        stop = max(int(np.searchsorted(ends, ends[tile] + part)), tile + 1)
        launch(
            gpu,
            stage,
            kernel,
            min(groups, stop - tile),
            gpu.lanes,
            **counts.walk,
            **triangles.shading,
            **target,
            **buffers,
            next_tile=gpu.put("next_tile", np.array([tile], np.uint32)),
            to_tile=stop,
            slab=slab,
        )
        tile = stop
        if report:
            gpu.queue.finish()
            report(batch.first_tile + tile)
    return Drawn(int(ends[-1]), layers_max)
