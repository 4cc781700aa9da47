"""Tiles: what a kernel draws with, how it goes over a batch's tiles, and what it finds there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from clpeel.device.layout import TILE
from clpeel.device.program import Kernel, launch
from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.stages.binning import Batch
from clpeel.stages.projection import Arguments, Triangles

GROUPS_A_UNIT = 16
"""Work-groups for each compute unit, each with a slab of its own, where a unit turns from one to another."""

REPORTED_PAIRS = 1 << 18
"""Records in tiles that are drawn between two reports of progress: some tenths of a second."""

AtTile = Callable[[int], None]
"""Called now and then with the picture's tile that drawing has come to."""


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


@dataclass(frozen=True)
class Canvas:
    """What all of a picture's batches are drawn with.

    target: the picture, as arguments of kernels (Picture.begin). capacity: how many fragments there is room for.
    watch: of a batch, what is called as its tiles are drawn; None where nobody wants to know.
    """

    gpu: Workspace
    triangles: Triangles
    target: Arguments
    capacity: int
    watch: Callable[[Batch], AtTile] | None = None

    def arguments(self, batch: Batch, parameters: Sequence[float] = ()) -> Arguments:
        """The kernel arguments that say what is drawn, where, and by what numbers of the technique's own."""
        own: Arguments = {}
        if parameters:
            own["parameters"] = self.gpu.put("parameters", np.array(parameters).astype(np.float32))
        return {**walk_arguments(self.triangles, batch), **self.triangles.shading, **self.target, **own}


def draw_tiles(
    gpu: Workspace, stage: str, kernel: Kernel, groups: int, batch: Batch, at_tile: AtTile | None, arguments: Arguments
) -> None:
    """Launches a kernel whose groups take the batch's tiles, in parts where progress is to be reported.

    at_tile: called now and then with the picture's tile that it has come to.
    """
    done = np.cumsum(batch.tile_pairs)
    tile = 0
    while tile < batch.tiles:
        part = REPORTED_PAIRS if at_tile else int(done[-1]) + 1
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
            at_tile(batch.first_tile + tile)


def stage_of(path: str) -> str:
    """What the time of a technique's kernel is booked on: the technique's name, which its file has."""
    return path.removesuffix(".cl").rpartition("/")[2]


def groups_for(gpu: Workspace, batch: Batch) -> int:
    """Work-groups that take a batch's tiles: one for each compute unit where a lane has a tile to itself."""
    units = int(gpu.device.max_compute_units)
    return min(units if gpu.lanes == 1 else GROUPS_A_UNIT * units, batch.tiles)


def walk_arguments(triangles: Triangles, batch: Batch) -> Arguments:
    """The kernel arguments of a walk over a batch's records (walk.h)."""
    width, height = triangles.size
    return {
        "triangles": triangles.records,
        "pair_start": batch.pair_start,
        "pairs": batch.pairs,
        "first_tile": batch.first_tile,
        "columns": -(-width // TILE),
        "width": width,
        "height": height,
        "depth_scale": triangles.depth_scale,
    }


def too_deep(layers: int, capacity: int) -> InputError:
    """What to say where the memory does not hold one pixel's fragments."""
    return InputError(
        f"memory: expected room for the {layers:,} fragments of one pixel, got room for {capacity:,}; raise --memory"
    )
