"""multi-layer-peeling: several layers in each pass, by insertion sort (techniques/multi-layer-peeling.cl).

Liu, Wei and Xu 2006, "Multi-layer depth peeling via fragment sort": M layers a pass, so that N layers take N / M
passes, rounded up.
"""

from __future__ import annotations

from typing import Any

from clpeel.device.layout import ALL_LAYERS, FRAGMENT_BYTES
from clpeel.errors import InputError
from clpeel.stages.many_passes import check_peeling, checked_count, peel
from clpeel.stages.one_pass import Drawn
from clpeel.techniques.precision import color_bytes

SUMMARY = "exact: peels several layers, 8 unless told, in each geometry pass by insertion sort"
MOST_LAYERS = 64
VARIANTS: tuple[dict[str, Any], ...] = ({}, *({"layers_per_pass": layers} for layers in (2, 4, 16)))
"""What `auto` has the choice of besides 8 a pass; more than 16 a pixel do not stay in a processor's registers."""

HAZARD_ORDERS = ("nearest-last", "arrival")
"""In which writes of a wave land: farthest first, which keeps the paper's bound of M passes, or as fragments arrive."""

MAX_WINDOW = 2**31 - 1
TORN_WINDOW = 2
"""Fragments in flight at once where writes are torn, unless told: the two of the paper's Figure 2."""


def layers_per_pass(targets: int = 4, target_bytes: int = 16, color_bytes: int = 4, depth_bytes: int = 4) -> int:
    """M of the paper's equation 1: the buckets that so many render targets of so many bytes a pixel hold.

    M = Mrt Bm / (Bc + Bd): 4 targets of 4 x FP32 hold 8 buckets of RGBA8 and FP32 depth, or 16 of depth alone
    (color_bytes=0). Raises InputError where not one fits.
    """
    bucket = color_bytes + depth_bytes
    layers = targets * target_bytes // bucket if bucket > 0 else 0
    if layers < 1:
        raise InputError(
            f"layers_per_pass: expected render targets that hold one bucket of {bucket} bytes, "
            f"got {targets} of {target_bytes} bytes"
        )
    return layers


def passes_for(layers: Any, options: dict[str, Any]) -> Any:
    """N / M, rounded up (Liu, Wei and Xu 2006)."""
    return -(-layers // int(options.get("layers_per_pass", layers_per_pass())))


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """z_near, a slot for each layer of a pass, whether there is more, the colour; see Buffers in the kernel file."""
    slots = options.get("layers_per_pass", layers_per_pass())
    return FRAGMENT_BYTES * (1 + slots) + 4 + color_bytes(options)


def check(
    layers_per_pass: int = layers_per_pass(),
    hazard_window: int | None = None,
    hazard_order: str = "nearest-last",
    torn_writes: bool = False,
    **options: Any,
) -> None:
    """InputError where one of the options of `draw` cannot be, or not with another."""
    checked_count("layers_per_pass", layers_per_pass, MOST_LAYERS)
    if hazard_order not in HAZARD_ORDERS:
        raise InputError(f"hazard_order: expected one of {', '.join(HAZARD_ORDERS)}; got {hazard_order!r}")
    if hazard_window is not None:
        checked_count("hazard_window", hazard_window, MAX_WINDOW)
    if hazard_window is not None or torn_writes:
        for name in sorted(options.keys() & {"passes", "occlusion_query", "max_error"}):
            raise InputError(
                f"{name}: expected none with hazard_window: its passes end when nothing is written; got one"
            )
    check_peeling(**options)


def draw(
    *arguments: Any,
    layers_per_pass: int = layers_per_pass(),
    hazard_window: int | None = None,
    hazard_order: str = "nearest-last",
    torn_writes: bool = False,
    **options: Any,
) -> Drawn:
    """Draws a batch of tiles, `layers_per_pass` layers a pass (1..MOST_LAYERS, else InputError).

    hazard_window: simulates concurrent writes, of so many fragments of a pixel at once, where it is given; in which
    order they land: one of HAZARD_ORDERS; and, with torn_writes, of two that meet each commits half of its targets.
    Raises InputError where the inner loop of Table 1 then has no end.
    """
    check(layers_per_pass, hazard_window, hazard_order, torn_writes, **options)
    layers = int(layers_per_pass)
    defines = {"LAYERS_A_PASS": layers}
    if hazard_window is None and not torn_writes:
        return peel("techniques/multi-layer-peeling.cl", 0, *arguments, defines=defines, **options)
    defines["HAZARD_WINDOW"] = TORN_WINDOW if hazard_window is None else int(hazard_window)
    defines["HAZARD_ARRIVAL"] = int(hazard_order == "arrival")
    defines["TORN_WRITES"] = int(torn_writes)
    return peel("techniques/multi-layer-hazards.cl", 0, *arguments, defines=defines, layers_a_pass=layers, **options)


def peeled(
    passes: int | None = None, layers_per_pass: int = layers_per_pass(), torn_writes: bool = False, **_: Any
) -> tuple[int, int]:
    """So many layers a pass, from the front. Raises InputError with torn_writes, which may lose some."""
    if torn_writes:
        raise InputError("layers: expected no torn_writes, with which layers may be lost; got both")
    return ALL_LAYERS if passes is None else int(passes) * int(layers_per_pass), 0
