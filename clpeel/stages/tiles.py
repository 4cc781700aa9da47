"""Tiles: what a kernel draws with, how it goes through a batch's tiles, and what it finds there."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from clpeel.device.layout import TILE
from clpeel.device.memory import Budget
from clpeel.device.program import Arguments, Kernel, launch
from clpeel.device.records import SCREEN
from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.stages.binning import Batch
from clpeel.stages.projection import Triangles

GROUPS_A_UNIT = 16
"""Work-groups for each compute unit, on devices whose units switch between groups. Each group has its own slab."""

FIRST_PAIRS, MOST_PAIRS = 1 << 14, 1 << 18
"""How many records in tiles are drawn between two reports of progress: at first, and at most."""

REPORT_SECONDS = 0.01
"""The seconds between two reports that are aimed at. Whoever reports may give the picture up, and should soon."""

AtTile = Callable[[int], None]
"""Called now and then as a batch is drawn, with a tile number of the picture: the batch is done up to that tile."""


@dataclass(frozen=True)
class Drawn:
    """What drawing a batch found.

    fragments: of all samples. layers_max: fragments of the deepest sample. samples_passed: how many samples passed in
    each pass that was issued. truncated_pixels: samples with layers that no pass reached. hidden: the greatest
    transmittance in front of such layers, which bounds what they could have changed in any channel. opaque_samples:
    samples with an opaque surface; fragments behind it do not count. pass_ticks, ticks: clock ticks of each pass and
    of everything; 0 where the device's kernels have no clock. pass_seconds: seconds of each pass, if each has launches
    of its own, else empty. pass_keys: as `keys`, if passes are repeated, else empty.
    """

    fragments: int
    layers_max: int
    samples_passed: tuple[int, ...]
    truncated_pixels: int = 0
    hidden: float = 0.0
    opaque_samples: int = 0
    pass_ticks: tuple[int, ...] = ()
    ticks: int = 0
    pass_seconds: tuple[float, ...] = ()
    pass_keys: tuple[tuple[int, int], ...] = ()

    @property
    def keys(self) -> tuple[tuple[int, int], ...]:
        """Names the batch's passes, so that passes of several batches can be added up.

        A pass is named by the number of its peel, and by how often that peel was repeated before.
        """
        return self.pass_keys or tuple((number, 0) for number in range(len(self.samples_passed)))


@dataclass(frozen=True)
class Canvas:
    """What all batches of a picture are drawn with.

    target: the picture, as arguments of kernels (Picture.begin). capacity: how many of the technique's fragments there
    is room for. budget: the memory in bytes. watch: gives, for a batch, the function to call as its tiles are drawn;
    None if progress is not reported.
    """

    gpu: Workspace
    triangles: Triangles
    target: Arguments
    capacity: int
    budget: Budget
    watch: Callable[[Batch], AtTile] | None = None

    def arguments(self, batch: Batch, parameters: Sequence[float] = ()) -> Arguments:
        """The kernel arguments for a batch: its records, colours, the picture, and the technique's own parameters."""
        own: Arguments = {}
        if parameters:
            own["parameters"] = self.gpu.put("parameters", np.array(parameters).astype(np.float32))
        return {**walk_arguments(self.triangles, batch), **self.triangles.shading, **self.target, **own}


def draw_tiles(
    gpu: Workspace, stage: str, kernel: Kernel, groups: int, batch: Batch, at_tile: AtTile | None, arguments: Arguments
) -> None:
    """Launches a kernel whose groups take the batch's tiles one after the other.

    at_tile: if given, tiles are drawn in parts, and it is called after each part (AtTile). This waits for the device.
    """
    done = np.cumsum(batch.tile_pairs)
    part = FIRST_PAIRS if at_tile else int(done[-1]) + 1
    tile = 0
    while tile < batch.tiles:
        begun = time.perf_counter()
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
        if at_tile:
            gpu.queue.finish()
            late = time.perf_counter() - begun > REPORT_SECONDS
            part = part // 2 + 1 if late else min(2 * part, MOST_PAIRS)
            at_tile(batch.first_tile + tile)


def stage_of(path: str) -> str:
    """The stage that the time of a technique's kernel counts for: the kernel file's name without folder and `.cl`."""
    return path.removesuffix(".cl").rpartition("/")[2]


def groups_for(gpu: Workspace, batch: Batch) -> int:
    """How many work-groups take a batch's tiles: one for each compute unit, if a lane has a tile to itself."""
    units = int(gpu.device.max_compute_units)
    return min(units if gpu.lanes == 1 else GROUPS_A_UNIT * units, batch.tiles)


def walk_arguments(triangles: Triangles, batch: Batch) -> Arguments:
    """The kernel arguments of a walk over a batch's records (walk.h)."""
    width, height = triangles.size
    screen = (batch.first_tile, -(-width // TILE), width, height, triangles.depth_scale, triangles.view)
    return {
        "triangles": triangles.records,
        "pair_start": batch.pair_start,
        "pairs": batch.pairs,
        "screen": np.array(screen, SCREEN),
    }


def too_deep(layers: int, capacity: int) -> InputError:
    """The error to raise when the memory does not hold one pixel's fragments."""
    return InputError(
        f"memory: expected room for the {layers:,} fragments of one pixel, got room for {capacity:,}; raise --memory"
    )
