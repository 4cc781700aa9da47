"""Rasterization: makes the fragments of a batch of tiles, window by window. A window fits the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.layout import COLOR_BYTES, FRAGMENT_BYTES, SOURCE_BYTES, TILE_PIXELS, Features
from clpeel.device.program import launch, program
from clpeel.device.records import WINDOW_TOTALS
from clpeel.device.workspace import Workspace
from clpeel.stages.binning import Batch
from clpeel.stages.projection import Triangles
from clpeel.stages.tiles import too_deep, walk_arguments

STAGE = "rasterization"


@dataclass(frozen=True)
class Counts:
    """How many fragments a batch's tiles and pixels have.

    totals: int64 [tiles], fragments of each tile. layers: int64 [tiles], fragments of its deepest pixel. pixel_end:
    uint32 [tiles, TILE_PIXELS], inclusive prefix sums of the pixels' counts within each tile.
    """

    totals: NDArray[np.int64]
    layers: NDArray[np.int64]
    pixel_end: cl.Buffer


@dataclass(frozen=True)
class Fragments:
    """The fragments of a window. A window is a run of whole tiles, or of some pixels of one tile.

    fragments: uint64 [count], depth key << 32 | payload (walk.h), pixel by pixel; those of a pixel are in submission
    order. They begin at tile_start[tile] - start + pixel_end[pixel before] and end at tile_start[tile] - start +
    pixel_end[pixel], where `tile` is the tile's place in the batch; all modulo 2**32.
    colors: float32 [count, 4], straight RGBA, where colours vary over faces; else the scene's palette.
    sources: uint32 [count], the fragments' faces, where colours vary over faces and sources were requested; else None.
    layers_max: fragments of the deepest pixel.
    """

    features: Features
    window_tile: int  # first tile of the window, in the batch
    tiles: int
    first_pixel: int  # of each tile; first and last are 0 and 255, except where a tile is split
    last_pixel: int
    count: int
    layers_max: int
    fragments: cl.Buffer
    colors: cl.Buffer
    sources: cl.Buffer | None
    pixel_end: cl.Buffer  # uint32 [batch tiles, TILE_PIXELS]
    tile_start: cl.Buffer  # uint32 [batch tiles]
    start: int  # place of the window's first fragment in the batch, modulo 2**32


@dataclass(frozen=True)
class _Window:
    first: int
    tiles: int
    first_pixel: int
    last_pixel: int
    count: int
    layers_max: int
    start: int


def count_fragments(gpu: Workspace, triangles: Triangles, batch: Batch) -> Counts:
    """Counts the batch's fragments, pixel by pixel."""
    pixel_end = gpu.buffer("pixel_end", 4 * TILE_PIXELS * batch.tiles)
    tile_totals = gpu.buffer("tile_totals", WINDOW_TOTALS.itemsize * batch.tiles)
    kernel = program(gpu, "stages/windows.cl", triangles.features)["count_fragments"]
    outputs = {"z_far": None, "pixel_end": pixel_end, "tile_totals": tile_totals}
    launch(
        gpu, STAGE, kernel, batch.tiles, gpu.lanes, **walk_arguments(triangles, batch), **triangles.shading, **outputs
    )
    totals = gpu.get(tile_totals, batch.tiles, WINDOW_TOTALS)
    return Counts(totals["fragments"].astype(np.int64), totals["layers"].astype(np.int64), pixel_end)


def rasterize(
    gpu: Workspace, triangles: Triangles, batch: Batch, capacity: int, with_sources: bool = False
) -> Iterator[Fragments]:
    """Yields the batch's fragments in the device's memory, at most `capacity` at a time.

    with_sources: where fragments have colours of their own, store their faces too. Raises InputError when a single
    pixel has more than `capacity` fragments.
    """
    features = triangles.features
    counts = count_fragments(gpu, triangles, batch)
    pixel_end = counts.pixel_end
    tile_start = gpu.put("tile_start", (np.cumsum(counts.totals) - counts.totals).astype(np.uint32))

    def pixels_of(tile: int) -> NDArray[np.int64]:
        return gpu.get(pixel_end, TILE_PIXELS, np.uint32, offset=4 * TILE_PIXELS * tile).astype(np.int64)

    for window in _windows(counts, pixels_of, capacity):
        fragments = gpu.buffer("fragments", FRAGMENT_BYTES * window.count)
        colors = gpu.buffer("colors", COLOR_BYTES * window.count) if features.fragment_color else None
        with_faces = with_sources and features.fragment_color
        sources = gpu.buffer("sources", SOURCE_BYTES * window.count) if with_faces else None
        launch(
            gpu,
            STAGE,
            program(gpu, "stages/windows.cl", features)["emit_fragments"],
            window.tiles,
            gpu.lanes,
            **walk_arguments(triangles, batch),
            **triangles.shading,
            pixel_end=pixel_end,
            window_tile=window.first,
            tile_start=tile_start,
            window_start=window.start % 2**32,
            capacity=window.count,
            fragments=fragments,
            colors=colors,
            sources=sources,
        )
        yield Fragments(
            features=features,
            window_tile=window.first,
            tiles=window.tiles,
            first_pixel=window.first_pixel,
            last_pixel=window.last_pixel,
            count=window.count,
            layers_max=window.layers_max,
            fragments=fragments,
            colors=triangles.scene.palette if colors is None else colors,
            sources=sources,
            pixel_end=pixel_end,
            tile_start=tile_start,
            start=window.start % 2**32,
        )


def _windows(counts: Counts, pixels_of: Callable[[int], NDArray[np.int64]], capacity: int) -> Iterator[_Window]:
    """Cuts a batch into windows of at most `capacity` fragments.

    A window is a run of tiles. A tile with more fragments than that is cut into runs of pixels. Raises InputError when
    a single pixel has more.
    """
    totals, layers = counts.totals, counts.layers
    after = np.cumsum(totals)
    tile = 0
    while tile < len(totals):
        before = int(after[tile] - totals[tile])
        stop = int(np.searchsorted(after, before + capacity, side="right"))
        if stop > tile:
            count, deepest = int(after[stop - 1]) - before, int(layers[tile:stop].max())
            yield _Window(tile, stop - tile, 0, TILE_PIXELS - 1, count, deepest, before)
            tile = stop
            continue
        ends = pixels_of(tile)
        pixel, done = 0, 0
        while pixel < TILE_PIXELS:
            stop = int(np.searchsorted(ends, done + capacity, side="right"))
            if stop == pixel:
                raise too_deep(int(ends[pixel]) - done, capacity)
            count = int(ends[stop - 1]) - done
            yield _Window(tile, 1, pixel, stop - 1, count, int(layers[tile]), before + done)
            pixel, done = stop, int(ends[stop - 1])
        tile += 1
