"""The stream: a batch's fragments in the device's memory, for techniques that are executed by passes (stream.cl).

A batch is cut into windows. A window's fragments, and all buffers of its pixels, fit the memory together. If one tile
has too many fragments for that, it is a window of its own, and its fragments come in several runs of its pixels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.layout import COLOR_BYTES, FRAGMENT_BYTES, FRAGMENT_PADDING, TILE_PIXELS, Targets
from clpeel.device.memory import MAX_PLACES
from clpeel.device.program import Arguments, launch, program
from clpeel.device.records import WINDOW_TOTALS
from clpeel.device.workspace import Workspace
from clpeel.stages.binning import Batch
from clpeel.stages.tiles import Canvas, too_deep, walk_arguments

STAGE = "rasterization"

PIXEL_BYTES = 4
"""Bytes of a fragment's pixel."""

WINDOW_BYTES = 1 << 24
"""A window takes at most so many bytes, even where the memory has more room: then most of it stays in caches."""

MOST_ITEMS = 65_000
"""The most work-items over a window on a CPU. PoCL would compile a kernel anew for 65,536 and more."""

BATCH_PIXEL_BYTES = 4 + FRAGMENT_BYTES + COLOR_BYTES
"""Bytes of a pixel for a whole part of a batch: where its list ends, z-far, and the colour of its opaque surface."""


@dataclass(frozen=True)
class Run:
    """Fragments that are in the device's memory together: of all pixels of a window, or of some pixels of its one tile.

    start: the place of its first fragment in the part. fragments, pixels, colors: see stream.cl; colors is the scene's
    palette where colours do not vary over faces.
    """

    first_pixel: int
    last_pixel: int
    count: int
    start: int
    fragments: cl.Buffer
    pixels: cl.Buffer
    colors: cl.Buffer


@dataclass(frozen=True)
class Part:
    """Consecutive tiles of a batch whose fragments have been counted.

    batch: these tiles. totals: int64 [tiles], fragments of each tile. pixel_end, tile_start: as in windows.Fragments.
    z_far, behind: see stream.cl; None if no surface is opaque. opaque_samples: samples with an opaque surface.
    """

    batch: Batch
    totals: NDArray[np.int64]
    pixel_end: cl.Buffer
    tile_start: cl.Buffer
    z_far: cl.Buffer | None
    behind: cl.Buffer | None
    opaque_samples: int


@dataclass(frozen=True)
class Window:
    """Consecutive tiles of a part that are drawn together.

    tile: the first of them, in the part. cuts: first and last pixel of each of its runs, and the run's fragments.
    """

    part: Part
    tile: int
    tiles: int
    cuts: tuple[tuple[int, int, int], ...]

    @property
    def pixels(self) -> int:
        """The number of its pixels, all of its tiles."""
        return self.tiles * TILE_PIXELS

    @property
    def fragments(self) -> int:
        """The number of its fragments, in all runs."""
        return sum(count for _, _, count in self.cuts)


class Stream:
    """Emits a batch's fragments, window by window.

    targets, defines: those of the technique.
    """

    def __init__(self, canvas: Canvas, targets: Targets, defines: Mapping[str, int]):
        self.canvas, self._targets = canvas, targets
        self._gpu: Workspace = canvas.gpu
        features = canvas.triangles.features
        self.fragment_bytes = features.fragment_bytes + PIXEL_BYTES
        # Of all constants of a technique, only these matter to fragments and to the opaque surfaces behind them.
        wanted = ("BY_DEPTH", "PRECISION") if features.surfaces == "mixed" else ()
        constants = {name: defines[name] for name in wanted if defines.get(name)}
        constants |= {"FACING": 1} if targets.facing else {}
        self._kernels = program(self._gpu, "stages/stream.cl", features, **constants)

    def _most_tiles(self) -> int:
        """The most tiles of a part: half of the memory is for fragments, and a buffer is not too large."""
        budget = self.canvas.budget
        pixels = budget.drawing // (2 * BATCH_PIXEL_BYTES)
        return max(min(pixels, budget.largest // COLOR_BYTES) // TILE_PIXELS, 1)

    def windows(self, batch: Batch) -> Iterator[Window]:
        """Yields the batch's windows. What is on the device for the one before is gone then."""
        most = self._most_tiles()
        for first in range(0, batch.tiles, most):
            part = self._counted(sub_batch(self._gpu, batch, first, min(most, batch.tiles - first)))
            yield from self._cut(part)

    def _counted(self, batch: Batch) -> Part:
        """Draws what is opaque in these tiles, and counts the fragments in front of it."""
        gpu, triangles = self._gpu, self.canvas.triangles
        walk = walk_arguments(triangles, batch)
        z_far = behind = None
        opaque_samples = 0
        if triangles.features.surfaces == "mixed":
            z_far = gpu.buffer("z_far", FRAGMENT_BYTES * TILE_PIXELS * batch.tiles)
            behind = gpu.buffer("behind", COLOR_BYTES * TILE_PIXELS * batch.tiles)
            samples = gpu.buffer("tile_totals", 4 * batch.tiles)
            opaque = {"z_far": z_far, "behind": behind, "tile_samples": samples}
            self._launch("draw_behind", batch.tiles, {**walk, **triangles.shading, **opaque})
            opaque_samples = int(gpu.get(samples, batch.tiles, np.uint32).sum(dtype=np.int64))
        pixel_end = gpu.buffer("pixel_end", 4 * TILE_PIXELS * batch.tiles)
        tile_totals = gpu.buffer("tile_totals", WINDOW_TOTALS.itemsize * batch.tiles)
        outputs = {"z_far": z_far, "pixel_end": pixel_end, "tile_totals": tile_totals}
        self._launch("count_fragments", batch.tiles, {**walk, **triangles.shading, **outputs})
        totals = gpu.get(tile_totals, batch.tiles, WINDOW_TOTALS)["fragments"].astype(np.int64)
        starts = gpu.put("tile_start", (np.cumsum(totals) - totals).astype(np.uint32))
        return Part(batch, totals, pixel_end, starts, z_far, behind, opaque_samples)

    def _launch(self, name: str, groups: int, arguments: Arguments) -> None:
        launch(self._gpu, STAGE, self._kernels[name], groups, self._gpu.lanes, **arguments)

    def _cut(self, part: Part) -> Iterator[Window]:
        """Cuts a part into windows that fit. Raises InputError when a single pixel has too many fragments."""
        budget, totals = self.canvas.budget, part.totals
        room = budget.drawing - BATCH_PIXEL_BYTES * TILE_PIXELS * part.batch.tiles
        tile_bytes = TILE_PIXELS * self._targets.pixel_bytes
        most_fragments = min(budget.largest // max(COLOR_BYTES, FRAGMENT_BYTES), MAX_PLACES) - FRAGMENT_PADDING
        most_pixels = min(
            budget.largest // self._targets.widest_bytes, MAX_PLACES // (2 * max(self._targets.depths, 1))
        )
        if self._gpu.lanes == 1:
            most_fragments, most_pixels = (
                min(most, MOST_ITEMS * self.canvas.triangles.features.strip) for most in (most_fragments, most_pixels)
            )
        most_tiles = max(most_pixels // TILE_PIXELS, 1)
        capacity = max(min((room - tile_bytes) // self.fragment_bytes - FRAGMENT_PADDING, most_fragments), 1)
        ends = np.cumsum(totals)
        costs = np.cumsum(totals * self.fragment_bytes + tile_bytes)
        tile = 0
        while tile < len(totals):
            before, cost = int(ends[tile] - totals[tile]), int(costs[tile - 1]) if tile else 0
            stop = min(
                int(np.searchsorted(costs, cost + min(room, WINDOW_BYTES), side="right")),
                int(np.searchsorted(ends, before + capacity, side="right")),
                tile + most_tiles,
            )
            stop = max(stop, tile + 1)
            if int(ends[stop - 1]) - before <= capacity:
                yield Window(part, tile, stop - tile, ((0, TILE_PIXELS - 1, int(ends[stop - 1]) - before),))
            else:
                yield Window(part, tile, 1, tuple(self._cuts(part, tile, capacity)))
            tile = stop

    def _cuts(self, part: Part, tile: int, capacity: int) -> Iterator[tuple[int, int, int]]:
        """Cuts a tile into runs of pixels with at most `capacity` fragments."""
        ends = self._gpu.get(part.pixel_end, TILE_PIXELS, np.uint32, offset=4 * TILE_PIXELS * tile).astype(np.int64)
        pixel, done = 0, 0
        while pixel < TILE_PIXELS:
            stop = int(np.searchsorted(ends, done + capacity, side="right"))
            if stop == pixel:
                raise too_deep(int(ends[pixel]) - done, capacity)
            yield pixel, stop - 1, int(ends[stop - 1]) - done
            pixel, done = stop, int(ends[stop - 1])

    def runs(self, window: Window) -> Iterator[Run]:
        """Yields the window's runs that have fragments, each emitted into the device's memory."""
        gpu, part, triangles = self._gpu, window.part, self.canvas.triangles
        start = int(part.totals[: window.tile].sum())
        for first_pixel, last_pixel, count in window.cuts:
            if count == 0:
                continue
            room = count + FRAGMENT_PADDING
            fragments = gpu.buffer("fragments", FRAGMENT_BYTES * room)
            pixels = gpu.buffer("pixels", PIXEL_BYTES * room)
            own = triangles.features.fragment_color
            colors = gpu.buffer("colors", COLOR_BYTES * room) if own else None
            run = {"first_tile": window.tile, "first_pixel": first_pixel, "last_pixel": last_pixel}
            lists = {"pixel_end": part.pixel_end, "tile_start": part.tile_start, "run_start": start % 2**32}
            outputs = {"z_far": part.z_far, "fragments": fragments, "pixels": pixels, "colors": colors}
            walk = walk_arguments(triangles, part.batch)
            self._launch("emit_stream", window.tiles, {**walk, **triangles.shading, **run, **lists, **outputs})
            palette = triangles.scene.palette if colors is None else colors
            yield Run(first_pixel, last_pixel, count, start, fragments, pixels, palette)
            start += count


def sub_batch(gpu: Workspace, batch: Batch, first: int, tiles: int) -> Batch:
    """Some consecutive tiles of a batch, from number `first` of it on."""
    if tiles == batch.tiles:
        return batch
    starts = np.zeros(batch.tiles + 1, np.int64)
    np.cumsum(batch.tile_pairs, out=starts[1:])
    pair_start = gpu.put("part_pair_start", starts[first : first + tiles + 1].astype(np.uint32))
    first_tile = batch.first_tile + first
    tile_pairs = batch.tile_pairs[first : first + tiles]
    return Batch(first_tile, first_tile + tiles - 1, pair_start, batch.pairs, tile_pairs)
