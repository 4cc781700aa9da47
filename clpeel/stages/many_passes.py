"""Peeling: a batch of tiles to the picture, by a technique of several geometry passes (peel.h)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.device.devices import Gpu
from clpeel.device.layout import BLOCK, BLOCK_PIXELS, BLOCKS_A_ROW, TILE, TILE_TOTALS, Features
from clpeel.device.program import program
from clpeel.errors import InputError
from clpeel.stages.binning import Batch
from clpeel.stages.one_pass import Drawn, Report, bounded, checked_error, draw_tiles, groups_for
from clpeel.stages.projection import Triangles
from clpeel.stages.windows import walk_arguments
from clpeel.techniques.precision import DEFAULT_PRECISION, check_precision, precision_define

COINCIDENT = ("keep", "paper")
"""What becomes of fragments of equal depth: all are kept, in submission order, or the first alone, as in the papers."""

MAX_PASSES = 1 << 20

REPEATS_A_LAYER = 4
"""Passes that a peel may be repeated for each layer there is before it is taken to be without end. With writes that are
atomic there are at most as many as layers: each stores one fragment more, and none that was replaced comes back."""


def checked_count(name: str, count: Any, most: int) -> int:
    """A whole number 1..most, or InputError."""
    try:
        whole = int(count)
    except (TypeError, ValueError, OverflowError):
        whole = 0
    if whole != count or not 1 <= whole <= most:
        raise InputError(f"{name}: expected 1..{most}, got {count!r}")
    return whole


def check_peeling(
    passes: int | None = None,
    occlusion_query: bool = True,
    coincident: str = "keep",
    max_error: float | None = None,
    precision: str = DEFAULT_PRECISION,
) -> None:
    """InputError where one of these options of `peel` cannot be."""
    if passes is not None:
        checked_count("passes", passes, MAX_PASSES)
    elif not occlusion_query:
        raise InputError(
            "occlusion_query: expected passes=N with it off, as nothing else ends the passes; got no passes"
        )
    if coincident not in COINCIDENT:
        raise InputError(f"coincident: expected one of {', '.join(COINCIDENT)}; got {coincident!r}")
    checked_error(max_error)
    check_precision(precision)


def totals_bytes(gpu: Gpu, features: Features, batch: Batch, capacity: int, options: dict[str, Any]) -> int:
    """Of the device's memory that `peel` takes for a batch: a tile's buffers are its lane's own."""
    return 16 * (batch.most_layers + 3) + 4 * TILE_TOTALS * batch.tiles


def peel(
    path: str,
    first_passes: int,
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    target: dict[str, Any],
    capacity: int,
    report: Report | None = None,
    *,
    passes: int | None = None,
    occlusion_query: bool = True,
    coincident: str = "keep",
    max_error: float | None = None,
    precision: str = DEFAULT_PRECISION,
    defines: dict[str, int] | None = None,
    layers_a_pass: int | None = None,
) -> Drawn:
    """Draws the batch with the technique in the kernel file `path`.

    first_passes: geometry passes that peel nothing yet. passes: peels that many times and stops. occlusion_query: stops
    where a pass draws nothing; without, all `passes` are made. coincident: "keep" or "paper" (COINCIDENT).
    max_error: as for bounded (draw.py). precision: one of PRECISIONS (blending.py). defines: constants of the kernel.
    layers_a_pass: where the passes of a peel may have to be repeated, how many layers one
    peels; `passes` must then be None. Raises InputError where one of these cannot be, or where there is no end to the
    repeats.
    """
    check_peeling(passes, occlusion_query, coincident, max_error, precision)
    # There cannot be more layers than a tile has records; one pass more is the empty one that ends them.
    most_layers = batch.most_layers
    most = [int(passes)] if passes is not None else []
    most += [most_layers + 1] if occlusion_query else []
    most_passes, most_repeats = first_passes + min(most), 1
    if layers_a_pass is not None:
        most_repeats = REPEATS_A_LAYER * (most_layers + 1)
        most_passes = (most_layers // layers_a_pass + 2) * most_repeats
        if most_passes > MAX_PASSES:
            raise InputError(
                f"hazard_window: expected fewer triangles in a tile, whose passes can be counted, got {most_layers:,}; "
                "simulate a part of the scene, or a larger picture"
            )
    target, bounds = bounded(gpu, target, max_error)
    constants = {**(defines or {}), **bounds, **precision_define(precision), "BY_DEPTH": int(coincident == "paper")}
    pass_totals = gpu.put("pass_totals", np.zeros((most_passes + 1, 4), np.uint32))
    tile_totals = gpu.buffer("tile_totals", 4 * TILE_TOTALS * batch.tiles)
    draw_tiles(
        gpu,
        path.removesuffix(".cl").rpartition("/")[2],
        program(gpu, path, triangles.features, **constants)["peel"],
        groups_for(gpu, batch),
        batch,
        report,
        **walk_arguments(triangles, batch),
        **triangles.shading,
        **target,
        most_passes=most_passes,
        most_repeats=most_repeats,
        occlusion_query=occlusion_query,
        pass_totals=pass_totals,
        tile_totals=tile_totals,
    )
    totals = gpu.get(tile_totals, (batch.tiles, TILE_TOTALS), np.uint32)
    measured = gpu.get(pass_totals, (most_passes + 1, 2), np.uint64)  # low words first
    ticks = int(measured[-1, 0])
    pass_keys: tuple[tuple[int, int], ...] = ()
    if layers_a_pass is None:
        measured = measured[: int(totals[:, 2].max())]
    else:
        check_for_an_end(totals[:, 2], batch, -(-triangles.size[0] // TILE))
        measured = measured[:-1].reshape(-1, most_repeats, 2)
        # Of each peel the passes that found something, and the one that found nothing; nothing after an empty peel.
        found = (measured[..., 0] > 0).sum(axis=1)
        peels = range(int(np.argmin(found)) + 1)
        measured = np.concatenate([measured[peel, : found[peel] + 1] for peel in peels])
        pass_keys = tuple((peel, repeat) for peel in peels for repeat in range(found[peel] + 1))
    return Drawn(
        fragments=int(totals[:, 0].sum(dtype=np.int64)),
        layers_max=int(totals[:, 1].max()),
        samples_passed=tuple(measured[:, 0].tolist()),
        pass_ticks=tuple(measured[:, 1].tolist()),
        ticks=ticks,
        pass_keys=pass_keys,
        truncated_pixels=int(totals[:, 3].sum(dtype=np.int64)),
        hidden=float(totals[:, 4].max().view(np.float32)),
        opaque_samples=int(totals[:, 5].sum(dtype=np.int64)),
    )


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
