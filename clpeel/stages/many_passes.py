"""Many passes: techniques of several geometry passes peel a batch of tiles (frames/many_passes.h)."""

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
"""Passes that a peel may be repeated for each layer there is before it is taken to be without end. With writes that are
atomic there are at most as many as layers: each stores one fragment more, and none that was replaced comes back."""

MAX_REPEATED_PASSES = 1 << 20
"""Passes that are counted one by one where they are repeated."""


class PassRules(Protocol):
    """What ends the passes, and which fragments they keep.

    passes: peels that many times and stops. occlusion_query: stops where a pass draws nothing; without it, all `passes`
    are made. coincident: of fragments of equal depth "keep" keeps all, "paper" the first alone.
    """

    @property
    def passes(self) -> int | None: ...
    @property
    def occlusion_query(self) -> bool: ...
    @property
    def coincident(self) -> str: ...


def totals_bytes(batch: Batch) -> int:
    """Of the device's memory that `peel` takes for a batch: a tile's buffers are its lane's own."""
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

    defines: constants of the kernel. first_passes: geometry passes that peel nothing yet. layers_a_pass: where the
    passes of a peel may have to be repeated, how many layers one peels. parameters: numbers of the kernel's own. Raises
    InputError where there is no end to the repeats.
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
    measured = gpu.get(pass_totals, (most_passes + 1, 2), np.uint64)  # low words first
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
    """The most passes that a batch can take, and how often each peel may be repeated; or InputError."""
    # There cannot be more layers than a tile has records; one pass more is the empty one that ends them.
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
    """Of each peel the passes that found something, and the one that found nothing; nothing after an empty peel.

    measured: [peels, repeats, 2]. Returns those rows, and of each the peel and the number of the repeat.
    """
    found = (measured[..., 0] > 0).sum(axis=1)
    peels = range(int(np.argmin(found)) + 1)
    rows = np.concatenate([measured[peel, : found[peel] + 1] for peel in peels])
    return rows, tuple((peel, repeat) for peel in peels for repeat in range(found[peel] + 1))


def check_for_an_end(endless: NDArray[np.uint32], batch: Batch, columns: int) -> None:
    """InputError where a tile has a sample whose passes are repeated without end: `endless` is 1 + its number there."""
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
