"""Many passes: draws a batch of tiles with a technique of several geometry passes (frames/many_passes.h)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import BLOCK, BLOCK_PIXELS, BLOCKS_A_ROW, TILE
from clpeel.device.program import program
from clpeel.device.records import PEEL_TOTALS
from clpeel.errors import InputError
from clpeel.stages.binning import Batch
from clpeel.stages.tiles import Canvas, Drawn, draw_tiles, groups_for, stage_of

REPEATS_A_LAYER = 4
"""How often a peel may repeat its pass, for each layer there can be. A peel that needs more counts as endless.

Atomic writes need at most one repeat a layer: each stores one more fragment, and no replaced fragment comes back.
"""

MAX_REPEATED_PASSES = 1 << 20
"""The most passes of a batch where passes are repeated: the totals of each are stored one by one."""


class PassRules(Protocol):
    """What ends the passes, and which fragments they keep.

    passes: stop after so many peels; None for no limit. occlusion_query: stop after a pass that draws nothing; without
    it, all `passes` are made. coincident: "keep" keeps all fragments of equal depth, "paper" only the first.
    """

    @property
    def passes(self) -> int | None: ...
    @property
    def occlusion_query(self) -> bool: ...
    @property
    def coincident(self) -> str: ...


def totals_bytes(batch: Batch) -> int:
    """Bytes of the device's memory that `peel` takes for a batch.

    These are totals alone: the buffers of a tile's pixels are in its lanes' private memory.
    """
    return 16 * (batch.most_layers + 3) + PEEL_TOTALS.itemsize * batch.tiles


def peel(
    canvas: Canvas,
    batch: Batch,
    path: str,
    rules: PassRules,
    defines: Mapping[str, int],
    first_passes: int = 0,
    layers_a_pass: int | None = None,
    parameters: Sequence[float] = (),
) -> Drawn:
    """Draws the batch with the technique in the kernel file `path`.

    defines: constants of the kernel. first_passes: geometry passes before the first one that peels. layers_a_pass: how
    many layers one peel finds, if its pass may have to be repeated; None if passes are never repeated. parameters: the
    kernel's own numbers. Raises InputError if the repeats have no end, or may be too many to count.
    """
    gpu = canvas.gpu
    most_passes, most_repeats = most_passes_of(batch, rules, first_passes, layers_a_pass)
    pass_totals = gpu.put("pass_totals", np.zeros((most_passes + 1, 4), np.uint32))
    tile_totals = gpu.buffer("tile_totals", PEEL_TOTALS.itemsize * batch.tiles)
    constants = {**defines, "BY_DEPTH": int(rules.coincident == "paper")}
    own = {
        "most_passes": most_passes,
        "most_repeats": most_repeats,
        "occlusion_query": rules.occlusion_query,
        "pass_totals": pass_totals,
        "tile_totals": tile_totals,
    }
    draw_tiles(
        gpu,
        stage_of(path),
        program(gpu, path, canvas.triangles.features, **constants)["peel"],
        groups_for(gpu, batch),
        batch,
        canvas.watch and canvas.watch(batch),
        {**canvas.arguments(batch, parameters), **own},
    )
    totals = gpu.get(tile_totals, batch.tiles, PEEL_TOTALS)
    measured = gpu.get(pass_totals, (most_passes + 1, 2), np.uint64)  # of two words, low one first
    ticks = int(measured[-1, 0])
    pass_keys: tuple[tuple[int, int], ...] = ()
    if layers_a_pass is None:
        measured = measured[: int(totals["passes"].max())]
    else:
        check_for_an_end(totals["passes"], batch, -(-canvas.triangles.size[0] // TILE))
        measured, pass_keys = repeats_of(measured[:-1].reshape(-1, most_repeats, 2))
    return Drawn(
        fragments=int(totals["fragments"].sum(dtype=np.int64)),
        layers_max=int(totals["layers"].max()),
        samples_passed=tuple(measured[:, 0].tolist()),
        pass_ticks=tuple(measured[:, 1].tolist()),
        ticks=ticks,
        pass_keys=pass_keys,
        truncated_pixels=int(totals["truncated"].sum(dtype=np.int64)),
        hidden=float(totals["hidden"].max()),
        opaque_samples=int(totals["opaque"].sum(dtype=np.int64)),
    )


def most_passes_of(batch: Batch, rules: PassRules, first_passes: int, layers_a_pass: int | None) -> tuple[int, int]:
    """The most passes that a batch can take, and the most passes of one peel (1 if none is repeated).

    Raises InputError if passes are repeated and may be more than MAX_REPEATED_PASSES.
    """
    # A pixel has at most as many layers as its tile has records. The 1 is for the empty pass that ends the others.
    most_layers = batch.most_layers
    if layers_a_pass is None:
        limits = [] if rules.passes is None else [rules.passes]
        limits += [most_layers + 1] if rules.occlusion_query else []
        return first_passes + min(limits), 1
    most_repeats = REPEATS_A_LAYER * (most_layers + 1)
    most_passes = (most_layers // layers_a_pass + 2) * most_repeats
    if most_passes > MAX_REPEATED_PASSES:
        raise InputError(
            f"hazard_window: expected fewer triangles in a tile, whose passes can be counted, got {most_layers:,}; "
            "simulate a part of the scene, or a larger picture"
        )
    return most_passes, most_repeats


def repeats_of(measured: NDArray[np.uint64]) -> tuple[NDArray[np.uint64], tuple[tuple[int, int], ...]]:
    """The passes that were made: in each peel those that found something, and the empty one that ends the peel.

    The first peel whose first pass is empty is the last one. measured: uint64 [peels, repeats, 2], samples passed and
    ticks. Returns the rows of the passes, uint64 [passes, 2], and the peel and the repeat of each.
    """
    found = (measured[..., 0] > 0).sum(axis=1)
    peels = range(int(np.argmin(found)) + 1)
    rows = np.concatenate([measured[peel, : found[peel] + 1] for peel in peels])
    return rows, tuple((peel, repeat) for peel in peels for repeat in range(found[peel] + 1))


def check_for_an_end(endless: NDArray[np.uint32], batch: Batch, columns: int) -> None:
    """Raises InputError if passes of some sample would be repeated without end.

    endless: uint32 [tiles], 1 + the place of such a sample in the tile, or 0. columns: tiles in a row of the picture.
    """
    if not endless.any():
        return
    tile = int(np.argmax(endless > 0))
    block, place = divmod(int(endless[tile]) - 1, BLOCK_PIXELS)
    row, column = divmod(batch.first_tile + tile, columns)
    x = column * TILE + block % BLOCKS_A_ROW * BLOCK + place % BLOCK
    y = row * TILE + block // BLOCKS_A_ROW * BLOCK + place // BLOCK
    raise InputError(
        f"torn_writes: the sample in column {x}, row {y} holds again what it held some passes before and always would: "
        "the inner loop has no end (Liu, Wei and Xu 2006, Figure 2); expected atomic writes, torn_writes=False, "
        "or another hazard_window"
    )
