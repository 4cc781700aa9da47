"""Rasterization: a batch of tiles to fragments, in windows that fit the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.binning import Batch
from clpeel.device import Gpu
from clpeel.errors import InputError
from clpeel.layout import COLOR_BYTES, FRAGMENT_BYTES, TILE, TILE_PIXELS, Features
from clpeel.program import launch, program
from clpeel.projection import Triangles

STAGE = "rasterization"

CACHED_FRAGMENTS = 1 << 20
"""Most fragments of a window where a lane has a tile to itself: 8 MiB that are still in a CPU's caches when they are read."""


@dataclass(frozen=True)
class Fragments:
    """The fragments of a window: whole tiles, or some pixels of one tile.

    fragments: uint64 [count], depth key << 32 | payload (raster.cl), pixel by pixel, each pixel's in submission order.
    A pixel's begin at tile_start[tile] + pixel_end[pixel before] and end at tile_start[tile] + pixel_end[pixel].
    colors: float32 [count, 4] straight RGBA where colours vary over faces, else the scene's palette.
    """

    features: Features
    window_tile: int  # first tile of the window, in the batch
    tiles: int
    first_pixel: int  # of each tile, 0 and 255 but where a tile is split
    last_pixel: int
    count: int
    layers_max: int
    fragments: cl.Buffer
    colors: cl.Buffer
    pixel_end: cl.Buffer  # uint32 [batch tiles, TILE_PIXELS]
    tile_start: cl.Buffer  # uint32 [tiles], may wrap below zero in a split tile


@dataclass(frozen=True)
class _Window:
    first: int
    tiles: int
    first_pixel: int
    last_pixel: int
    count: int
    layers_max: int
    tile_start: NDArray[np.uint32]


def rasterize(gpu: Gpu, triangles: Triangles, batch: Batch, capacity: int) -> Iterator[Fragments]:
    """The batch's fragments, at most `capacity` at a time.

    Raises InputError when a single pixel has more than that.
    """
    features = triangles.features
    kernels = program(gpu, "raster.cl", features)
    width, height = triangles.size
    pixel_end = gpu.buffer("pixel_end", 4 * TILE_PIXELS * batch.tiles)
    tile_totals = gpu.buffer("tile_totals", 8 * batch.tiles)
    shared = {
        "triangles": triangles.records,
        "pair_start": batch.pair_start,
        "pairs": batch.pairs,
        "first_tile": batch.first_tile,
        "columns": -(-width // TILE),
        "width": width,
        "height": height,
        "pixel_end": pixel_end,
    }
    launch(gpu, STAGE, kernels["count_fragments"], batch.tiles, gpu.lanes, **shared, tile_totals=tile_totals)
    totals = gpu.get(tile_totals, (batch.tiles, 2), np.uint32)

    def pixels_of(tile: int) -> NDArray[np.int64]:
        return gpu.get(pixel_end, TILE_PIXELS, np.uint32, offset=4 * TILE_PIXELS * tile).astype(np.int64)

    for window in _windows(totals, pixels_of, capacity):
        fragments = gpu.buffer("fragments", FRAGMENT_BYTES * (window.count + window.tiles * gpu.lanes))
        colors = gpu.buffer("colors", COLOR_BYTES * window.count) if features.fragment_color else None
        tile_start = gpu.put("tile_start", window.tile_start)
        launch(
            gpu,
            STAGE,
            kernels["emit_fragments"],
            window.tiles,
            gpu.lanes,
            **shared,
            window_tile=window.first,
            tile_start=tile_start,
            capacity=window.count,
            faces=triangles.scene.faces,
            palette=triangles.scene.palette,
            weights=triangles.weights,
            normals=triangles.scene.normals,
            view_x=triangles.view[0],
            view_y=triangles.view[1],
            view_z=triangles.view[2],
            fragments=fragments,
            colors=colors,
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
            pixel_end=pixel_end,
            tile_start=tile_start,
        )


def _windows(
    totals: NDArray[np.uint32], pixels_of: Callable[[int], NDArray[np.int64]], capacity: int
) -> Iterator[_Window]:
    """Runs of tiles of at most `capacity` fragments; a tile deeper than that in runs of pixels."""
    counts, layers = totals[:, 0].astype(np.int64), totals[:, 1]
    after = np.cumsum(counts)
    tile = 0
    while tile < len(counts):
        before = int(after[tile] - counts[tile])
        stop = int(np.searchsorted(after, before + capacity, side="right"))
        if stop > tile:
            starts = (after[tile:stop] - counts[tile:stop] - before).astype(np.uint32)
            count, deepest = int(after[stop - 1]) - before, int(layers[tile:stop].max())
            yield _Window(tile, stop - tile, 0, TILE_PIXELS - 1, count, deepest, starts)
            tile = stop
            continue
        ends = pixels_of(tile)
        pixel, done = 0, 0
        while pixel < TILE_PIXELS:
            stop = int(np.searchsorted(ends, done + capacity, side="right"))
            if stop == pixel:
                raise InputError(
                    f"memory: expected room for the {ends[pixel] - done:,} fragments of one pixel, "
                    f"got room for {capacity:,}; raise --memory"
                )
            start = np.array([-done], np.int64).astype(np.uint32)
            count = int(ends[stop - 1]) - done
            yield _Window(tile, 1, pixel, stop - 1, count, int(layers[tile]), start)
            pixel, done = stop, int(ends[stop - 1])
        tile += 1
