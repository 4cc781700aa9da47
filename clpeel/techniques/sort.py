"""sort: the exact picture, by sorting each pixel's fragments (techniques/sort.cl).

Front to back under blending in the order (depth, submission index), float32 (Bavoil and Myers 2008).
"""

from __future__ import annotations

from typing import Any

from clpeel.device.devices import Gpu
from clpeel.device.layout import ALL_LAYERS, FRAGMENT_BYTES
from clpeel.stages.binning import Batch
from clpeel.stages.one_pass import Drawn, Report, bounded, checked_error, draw_once
from clpeel.stages.projection import Triangles
from clpeel.techniques.precision import DEFAULT_PRECISION, check_precision, precision_define

SUMMARY = "exact: sorts each pixel's fragments by depth, then blends them front to back"
SCRATCH_BYTES = FRAGMENT_BYTES
"""Room to sort long lists in, taken only where a pixel has more than RUN_MAX fragments."""


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """All fragments of a sample."""
    return FRAGMENT_BYTES * layers


def draw(
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    target: dict[str, Any],
    capacity: int,
    report: Report | None = None,
    *,
    max_error: float | None = None,
    precision: str = DEFAULT_PRECISION,
) -> Drawn:
    """Draws a batch of tiles. max_error: as for bounded (draw.py). Raises InputError where an option cannot be."""
    target, bounds = bounded(gpu, target, max_error)
    constants = {**bounds, **precision_define(precision)}
    return draw_once("techniques/sort.cl", SCRATCH_BYTES, gpu, triangles, batch, target, capacity, report, **constants)


def check(max_error: float | None = None, precision: str = DEFAULT_PRECISION) -> None:
    """InputError where one of the options cannot be."""
    checked_error(max_error)
    check_precision(precision)


def peeled(**_: Any) -> tuple[int, int]:
    """All layers, from the front."""
    return ALL_LAYERS, 0
