"""Drawing: a batch of tiles to the picture, by a technique that goes through each pixel's fragments once (draw.h)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from clpeel.device.devices import Gpu
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
from clpeel.device.program import Kernel, launch, program
from clpeel.errors import InputError
from clpeel.stages.binning import Batch
from clpeel.stages.projection import Triangles
from clpeel.stages.windows import too_deep, walk_arguments

GROUPS_A_UNIT = 16
"""Work-groups for each compute unit, each with a slab of its own, where a unit turns from one to another."""

CACHED_FRAGMENTS = 1 << 22
"""Fragments that all groups have room for, 32 MiB, unless the fullest pixels need more."""

LEAST_ROWS, MOST_ROWS, ROWS_APART = 34, RUN_MAX + 2, 32
"""Layers that a strip has room for at once: 2 more than a multiple of 32, so that the rows of a tile's blocks, of 128
bytes each, do not fall on the same places of a cache."""

OWN_BUFFERS = ("fragments", "scratch", "colors", "tile_totals", "pass_totals")
"""Of the device, by name: what a technique takes besides the scene, its records and lists."""

REPORTED_PAIRS = 1 << 18
"""Records in tiles that are drawn between two reports of progress: some tenths of a second."""

Report = Callable[[int], None]


@dataclass(frozen=True)
class Drawn:
    """What a batch had: fragments, those of its deepest pixel, and what the geometry passes over it found.

    samples_passed: of each pass that was issued; truncated_pixels: those with layers that no pass reached, and hidden:
    the greatest transmittance of these, which bounds what those layers could have changed in any channel;
    opaque_samples: those with an opaque surface, behind which there are no fragments;
    pass_ticks, ticks: of each pass and of everything, by the device's own count, or 0 where it has none; pass_keys: of
    each pass, where passes are repeated.
    """

    fragments: int
    layers_max: int
    samples_passed: tuple[int, ...]
    truncated_pixels: int = 0
    hidden: float = 0.0
    opaque_samples: int = 0
    pass_ticks: tuple[int, ...] = ()
    ticks: int = 0
    pass_keys: tuple[tuple[int, int], ...] = ()

    @property
    def keys(self) -> tuple[tuple[int, int], ...]:
        """Which passes of the picture those of the batch are: the peel, and how often it has been repeated."""
        return self.pass_keys or tuple((number, 0) for number in range(len(self.samples_passed)))


def draw_tiles(
    gpu: Gpu, stage: str, kernel: Kernel, groups: int, batch: Batch, report: Report | None, **arguments: Any
) -> None:
    """Launches a kernel whose groups take the batch's tiles, in parts where progress is to be reported.

    report: called now and then with the picture's tile that it has come to.
    """
    done = np.cumsum(batch.tile_pairs)
    tile = 0
    while tile < batch.tiles:
        part = REPORTED_PAIRS if report else int(done[-1]) + 1
        stop = max(int(np.searchsorted(done, done[tile] + part)), tile + 1)
        launch(
            gpu,
            stage,
            kernel,
            min(groups, stop - tile),
            gpu.lanes,
            next_tile=gpu.put("next_tile", np.array([tile], np.uint32)),
            to_tile=stop,
            **arguments,
        )
        tile = stop
        if report:
            gpu.queue.finish()
            report(batch.first_tile + tile)


def groups_for(gpu: Gpu, batch: Batch) -> int:
    """Work-groups that take a batch's tiles: one for each compute unit where a lane has a tile to itself."""
    units = int(gpu.device.max_compute_units)
    return min(units if gpu.lanes == 1 else GROUPS_A_UNIT * units, batch.tiles)


def checked_error(max_error: float | None) -> np.float32 | None:
    """The greatest float32 that is not more than max_error (0..1, else InputError); None where there is none."""
    if max_error is None:
        return None
    try:
        error = float(max_error)
    except (TypeError, ValueError):
        error = math.nan
    if not 0 <= error <= 1:
        raise InputError(f"max_error: expected 0..1, got {max_error!r}")
    least = np.float32(error)
    return least if float(least) <= error else np.nextafter(least, np.float32(0))


def bounded(gpu: Gpu, target: dict[str, Any], max_error: float | None) -> tuple[dict[str, Any], dict[str, int]]:
    """The picture and the constants of a kernel that leaves layers out.

    max_error: what they may change in any channel, 0..1, else InputError; None where all are drawn and none told of.
    """
    least = checked_error(max_error)
    if least is None:
        return target, {}
    return {**target, "parameters": gpu.put("parameters", np.array([least], np.float32))}, {"BOUNDED": 1}


def slabs_for(gpu: Gpu, batch: Batch, capacity: int) -> tuple[int, int, int]:
    """How many groups draw a batch (draw.h), the rows of a strip's layers, and the fragments of a group's slab."""
    groups = groups_for(gpu, batch)
    rows = min(
        max(CACHED_FRAGMENTS // (groups * TILE_PIXELS), LEAST_ROWS),
        MOST_ROWS,
        -(-batch.most_layers // ROWS_APART) * ROWS_APART + 2,
    )
    # Where many slabs are too much, fewer groups; at last, smaller slabs, which hold fewer rows.
    slab = rows * TILE_PIXELS
    return max(min(groups, capacity // slab), 1), rows, min(slab, capacity)


def slab_bytes(
    scratch_bytes: int, gpu: Gpu, features: Features, batch: Batch, capacity: int, options: dict[str, Any]
) -> int:
    """Of the device's memory that draw_once takes for a batch, unless a pixel has more fragments than a slab."""
    groups, _, slab = slabs_for(gpu, batch, capacity // BLOCK_PIXELS * BLOCK_PIXELS)
    deep = batch.most_layers > RUN_MAX
    return groups * (slab + FRAGMENT_PADDING) * (features.fragment_bytes + scratch_bytes * deep) + 16 * batch.tiles


def draw_once(
    path: str,
    scratch_bytes: int,
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    target: dict[str, Any],
    capacity: int,
    report: Report | None = None,
    **defines: int,
) -> Drawn:
    """Draws the batch with the technique in the kernel file `path`, with room for `capacity` fragments.

    target: the picture, as Picture.begin gives it.
    scratch_bytes: what the technique needs besides for each fragment where a pixel may have more than RUN_MAX.
    report: called now and then with the picture's tile that it has come to. defines: constants of the kernel.
    Raises InputError when a single pixel has more fragments than that.
    """
    features = triangles.features
    stage, kernel = path.removesuffix(".cl").rpartition("/")[2], program(gpu, path, features, **defines)["draw"]
    deep = batch.most_layers > RUN_MAX
    tile_totals = gpu.buffer("tile_totals", 16 * batch.tiles)
    capacity = capacity // BLOCK_PIXELS * BLOCK_PIXELS  # slabs begin where rows may
    groups, rows, slab = slabs_for(gpu, batch, capacity)
    layers_before = 0
    while True:
        room = groups * (slab + FRAGMENT_PADDING)
        scratch = scratch_bytes if deep else 0
        buffers = {
            "fragments": gpu.buffer("fragments", FRAGMENT_BYTES * room),
            "scratch": gpu.buffer("scratch", scratch * room) if scratch else None,
            "colors": gpu.buffer("colors", COLOR_BYTES * room) if features.fragment_color else None,
        }
        draw_tiles(
            gpu,
            stage,
            kernel,
            groups,
            batch,
            report,
            **walk_arguments(triangles, batch),
            **triangles.shading,
            **target,
            **buffers,
            layers_before=layers_before,
            rows=min(rows, slab // TILE_PIXELS),
            slab=slab,
            tile_totals=tile_totals,
        )
        totals = gpu.get(tile_totals, (batch.tiles, 4), np.uint32)
        layers_max = int(totals[:, 1].max())
        if layers_max + LIST_GAP <= slab:
            fragments = int(totals[:, 0].sum(dtype=np.int64))
            return Drawn(fragments, layers_max, (fragments,), opaque_samples=int(totals[:, 2].sum(dtype=np.int64)))
        if layers_max + LIST_GAP > capacity:
            raise too_deep(layers_max, capacity - LIST_GAP)
        layers_before, slab = slab - LIST_GAP, min(BLOCK_PIXELS * (layers_max + LIST_GAP), capacity)
        groups = max(min(groups, capacity // slab), 1)
