"""Peeling: a batch of tiles to the picture, by a technique of several geometry passes (peel.h)."""

from __future__ import annotations

from typing import Any

import numpy as np

from clpeel.binning import Batch
from clpeel.device import Gpu
from clpeel.draw import Drawn, Report, draw_tiles, groups_for
from clpeel.errors import InputError
from clpeel.layout import TILE_TOTALS
from clpeel.program import program
from clpeel.projection import Triangles
from clpeel.raster import walk_arguments

COINCIDENT = ("keep", "paper")
"""What becomes of fragments of equal depth: all are kept, in submission order, or the first alone, as in the papers."""

MAX_PASSES = 1 << 20


def checked_count(name: str, count: Any, most: int) -> int:
    """A whole number 1..most, or InputError."""
    try:
        whole = int(count)
    except (TypeError, ValueError, OverflowError):
        whole = 0
    if whole != count or not 1 <= whole <= most:
        raise InputError(f"{name}: expected 1..{most}, got {count!r}")
    return whole


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
    defines: dict[str, int] | None = None,
) -> Drawn:
    """Draws the batch with the technique in the kernel file `path`.

    first_passes: geometry passes that peel nothing yet. passes: peels that many times and stops. occlusion_query: stops
    where a pass draws nothing; without, all `passes` are made. coincident: "keep" or "paper" (COINCIDENT). defines:
    constants of the kernel. Raises InputError where one of these cannot be.
    """
    if passes is not None:
        passes = checked_count("passes", passes, MAX_PASSES)
    if passes is None and not occlusion_query:
        raise InputError(
            "occlusion_query: expected passes=N with it off, as nothing else ends the passes; got no passes"
        )
    if coincident not in COINCIDENT:
        raise InputError(f"coincident: expected one of {', '.join(COINCIDENT)}; got {coincident!r}")
    # There cannot be more layers than a tile has records; one pass more is the empty one that ends them.
    most = [passes] if passes is not None else []
    most += [int(batch.tile_pairs.max()) + 1] if occlusion_query else []
    most_passes = first_passes + min(most)
    pass_totals = gpu.put("pass_totals", np.zeros((most_passes, 2), np.uint32))
    tile_totals = gpu.buffer("tile_totals", 4 * TILE_TOTALS * batch.tiles)
    draw_tiles(
        gpu,
        path.removesuffix(".cl").rpartition("/")[2],
        program(gpu, path, triangles.features, **(defines or {}))["peel"],
        groups_for(gpu, batch),
        batch,
        report,
        **walk_arguments(triangles, batch),
        **triangles.shading,
        **target,
        most_passes=most_passes,
        occlusion_query=occlusion_query,
        keep_coincident=coincident == "keep",
        pass_totals=pass_totals,
        tile_totals=tile_totals,
    )
    totals = gpu.get(tile_totals, (batch.tiles, TILE_TOTALS), np.uint32)
    issued = int(totals[:, 2].max())
    passed = gpu.get(pass_totals, (most_passes, 2), np.uint32).astype(np.uint64)
    return Drawn(
        fragments=int(totals[:, 0].sum(dtype=np.int64)),
        layers_max=int(totals[:, 1].max()),
        samples_passed=tuple(int(low + (high << np.uint64(32))) for low, high in passed[:issued]),
        truncated_pixels=int(totals[:, 3].sum(dtype=np.int64)),
        hidden=float(totals[:, 4].max().view(np.float32)),
    )
