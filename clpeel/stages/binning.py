"""Binning: lists for each tile the records that meet it, in submission order, batch by batch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.layout import PADDING, TILE, TILE_PIXELS
from clpeel.device.program import Arguments, cut, launch
from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.stages.projection import Triangles, setup_kernels

STAGE = "binning"
PAIR_BYTES = 4
"""Bytes that one record takes in a tile's list: its number."""
TILE_BYTES = 4 + 8
"""Bytes that a tile takes in a batch besides its list: 4 for where the list begins, 8 for its fragment counts."""


@dataclass(frozen=True)
class Batch:
    """The lists of the tiles first_tile .. last_tile.

    The records of tile first_tile + i are pairs[pair_start[i] : pair_start[i + 1]].
    """

    first_tile: int
    last_tile: int
    pair_start: cl.Buffer  # uint32 [tiles + 1]
    pairs: cl.Buffer  # uint32 [tile_pairs.sum(), and padding that the kernel may write to]
    tile_pairs: NDArray[np.int64]  # [tiles], the length of each list

    @property
    def tiles(self) -> int:
        """The number of tiles."""
        return self.last_tile - self.first_tile + 1

    @property
    def most_layers(self) -> int:
        """The length of the longest list. No pixel has more layers than that."""
        return int(self.tile_pairs.max())


@dataclass(frozen=True)
class Tiles:
    """How many records meet each tile of the image. Tiles are numbered row by row, from the top left.

    columns: tiles in a row. chunk_records: records of a chunk. chunk_count: the number of chunks.
    """

    gpu: Workspace
    triangles: Triangles
    columns: int
    chunk_records: int
    chunk_count: int
    counts: cl.Buffer  # uint32 [chunks, tiles and padding]: where each chunk's records begin in the tile's list
    tile_pairs: NDArray[np.int64]  # [tiles], the length of each tile's list

    def ranges(self, budget: int, tile_bytes: int = TILE_BYTES) -> list[tuple[int, int]]:
        """Cuts the tiles into runs of consecutive tiles, and returns each run's first and last tile.

        A run's lists, with `tile_bytes` more for each tile, fit `budget` bytes. A run has at least one tile, which may
        exceed the budget.
        """
        ends = np.cumsum(self.tile_pairs * PAIR_BYTES + tile_bytes)
        found, tile, before = [], 0, 0
        while tile < len(ends):
            last = max(int(np.searchsorted(ends, before + budget, side="right")) - 1, tile)
            found.append((tile, last))
            tile, before = last + 1, int(ends[last])
        return found

    def batches(self, budget: int, tile_bytes: int = TILE_BYTES, middle_first: bool = False) -> Iterator[Batch]:
        """Yields all tiles in batches, which are the runs of `ranges`. The next batch overwrites the one before.

        middle_first: begin with the run that contains the middle one of all records. That run is likely to resemble
        the others, and `auto` examines the first batch.
        """
        runs = self.ranges(budget, tile_bytes)
        if middle_first:
            middle = int(np.searchsorted(np.cumsum(self.tile_pairs), self.tile_pairs.sum() / 2))
            runs.sort(key=lambda run: not run[0] <= middle <= run[1])  # a stable sort: the other runs stay in order
        for first_tile, last_tile in runs:
            yield self._emit(first_tile, last_tile)

    def _emit(self, first_tile: int, last_tile: int) -> Batch:
        """The lists of these tiles. Works only once for each tile, as the kernel overwrites the tile's `counts`."""
        tile_pairs = self.tile_pairs[first_tile : last_tile + 1]
        starts = np.zeros(len(tile_pairs) + 1, np.int64)
        np.cumsum(tile_pairs, out=starts[1:])
        pair_start = self.gpu.put("pair_start", starts.astype(np.uint32))
        pairs = self.gpu.buffer("pairs", (int(starts[-1]) + (1 + self.chunk_count) * PADDING) * PAIR_BYTES)
        kernel = setup_kernels(self.gpu, self.triangles.scene)["bin_emit"]
        launch(
            self.gpu,
            STAGE,
            kernel,
            self.chunk_count,
            1,
            **_walk(self.triangles, self.columns, self.chunk_records, len(self.tile_pairs), self.counts),
            first_row=first_tile // self.columns,
            last_row=last_tile // self.columns,
            first_tile=first_tile,
            last_tile=last_tile,
            pair_start=pair_start,
            pairs=pairs,
        )
        return Batch(first_tile, last_tile, pair_start, pairs, tile_pairs)


def bin_triangles(gpu: Workspace, triangles: Triangles, budget: int) -> Tiles:
    """Counts the records that meet each tile, chunk by chunk. The counts take at most `budget` bytes if one chunk fits.

    Raises InputError when one tile has 2**24 records or more: its fragments could be too many for a 32-bit count.
    """
    width, height = triangles.size
    columns, rows = -(-width // TILE), -(-height // TILE)
    tile_count = columns * rows
    counts_apart = tile_count + columns + 1
    chunk_records, chunks = cut(gpu, triangles.listed, budget // (4 * counts_apart))
    counts = gpu.buffer("counts", 4 * chunks * counts_apart)
    tile_pairs = gpu.buffer("tile_pairs", 4 * tile_count)
    kernels = setup_kernels(gpu, triangles.scene)
    walk = _walk(triangles, columns, chunk_records, tile_count, counts)
    launch(gpu, STAGE, kernels["bin_count"], chunks, 1, **walk, first_row=0, last_row=rows - 1)
    launch(
        gpu,
        STAGE,
        kernels["bin_offsets"],
        tile_count,
        chunk_count=chunks,
        columns=columns,
        tile_count=tile_count,
        counts=counts,
        tile_pairs=tile_pairs,
    )
    pairs = gpu.get(tile_pairs, tile_count, np.uint32).astype(np.int64)
    if pairs.max(initial=0) >= 2**32 // TILE_PIXELS:
        raise InputError(
            f"scene: expected fewer than {2**32 // TILE_PIXELS:,} triangles in a tile of {TILE} x {TILE} pixels, "
            f"got {pairs.max():,}; render a larger picture or part of the scene"
        )
    return Tiles(gpu, triangles, columns, chunk_records, chunks, counts, pairs)


def _walk(triangles: Triangles, columns: int, chunk_records: int, tile_count: int, counts: cl.Buffer) -> Arguments:
    """The arguments that bin_count and bin_emit share: both go through all records in the same way."""
    return {
        "triangles": triangles.records,
        "bounds": triangles.bounds,
        "record_count": triangles.listed,
        "chunk_records": chunk_records,
        "width": triangles.size[0],
        "height": triangles.size[1],
        "pattern": triangles.features.pattern,
        "columns": columns,
        "tile_count": tile_count,
        "counts": counts,
    }
