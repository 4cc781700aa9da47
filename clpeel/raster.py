"""Rasterization: a batch of tiles to fragments, in windows that fit the memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.binning import Batch
from clpeel.device import Gpu
from clpeel.errors import InputError
from clpeel.layout import TILE, TILE_PIXELS, Features
from clpeel.program import launch, program
from clpeel.projection import Triangles

STAGE = "rasterization"


@dataclass(frozen=True)
class Fragments:
    """The fragments of a window: whole tiles, or some pixels of one tile.

    fragments: uint64 [count], depth key << 32 | payload (raster.cl), pixel by pixel, each pixel's in submission order.
    A pixel's begin at tile_start[tile] + pixel_end[pixel before] and end at tile_start[tile] + pixel_end[pixel].
    colors: float32 [count, 4] straight RGBA where colours vary over faces, else the scene's palette.
    """

    features: Features
    batch_tile: int  # first tile of the batch, in the image
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
    tile_start: NDArray[np.uint32]


def rasterize(gpu: Gpu, triangles: Triangles, batch: Batch, capacity: int) -> Iterator[Fragments]:
    """The batch's fragments, at most `capacity` at a time.

    Raises InputError when a single pixel has more than that.
    """
    features = triangles.features
    kernels = program(gpu, "raster.cl", features)
    width, height = triangles.size
    pixel_end = gpu.buffer("pixel_end", 4 * TILE_PIXELS * batch.tiles)
    tile_fragments = gpu.buffer("tile_fragments", 4 * batch.tiles)
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
    launch(
        gpu,
        STAGE,
        kernels["count_fragments"],
        batch.tiles,
        gpu.lanes,
        **shared,
        tile_fragments=tile_fragments,
    )
    ends = gpu.get(pixel_end, (batch.tiles, TILE_PIXELS), np.uint32)
    layers_max = int(np.diff(ends, axis=1, prepend=np.uint32(0)).max(initial=0))
    for window in _windows(ends, capacity):
        tile_start = gpu.put("tile_start", window.tile_start)
        fragments = gpu.buffer("fragments", 8 * window.count)
        colors = gpu.buffer("colors", 16 * window.count) if features.fragment_color else triangles.scene.palette
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
            colors=colors if features.fragment_color else None,
        )
        yield Fragments(
            features=features,
            batch_tile=batch.first_tile,
            window_tile=window.first,
            tiles=window.tiles,
            first_pixel=window.first_pixel,
            last_pixel=window.last_pixel,
            count=window.count,
            layers_max=layers_max,
            fragments=fragments,
            colors=colors,
            pixel_end=pixel_end,
            tile_start=tile_start,
        )


def _windows(ends: NDArray[np.uint32], capacity: int) -> Iterator[_Window]:
    """Runs of tiles of at most `capacity` fragments; a tile deeper than that in runs of pixels."""
    totals = ends[:, -1].astype(np.int64)
    after = np.cumsum(totals)
    tile = 0
    while tile < len(totals):
        before = int(after[tile] - totals[tile])
        stop = int(np.searchsorted(after, before + capacity, side="right"))
        if stop > tile:
            starts = (after[tile:stop] - totals[tile:stop] - before).astype(np.uint32)
            yield _Window(tile, stop - tile, 0, TILE_PIXELS - 1, int(after[stop - 1]) - before, starts)
            tile = stop
            continue
        pixels = ends[tile].astype(np.int64)
        pixel, done = 0, 0
        while pixel < TILE_PIXELS:
            stop = int(np.searchsorted(pixels, done + capacity, side="right"))
            if stop == pixel:
                raise InputError(
                    f"memory: expected room for the {pixels[pixel] - done:,} fragments of the deepest pixel, "
                    f"got room for {capacity:,}; raise --memory"
                )
            start = np.array([-done], np.int64).astype(np.uint32)
            yield _Window(tile, 1, pixel, stop - 1, int(pixels[stop - 1]) - done, start)
            pixel, done = stop, int(pixels[stop - 1])
        tile += 1
