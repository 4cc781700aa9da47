"""The techniques: one module each, and the one registry that every menu, test and table goes through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from clpeel.draw import Drawn
from clpeel.errors import InputError
from clpeel.techniques import (
    depth_peeling,
    dual_depth_peeling,
    multi_layer_peeling,
    sort,
    weighted_average,
    weighted_sum,
)

LAYERS = "layers"
"""Option of all that know a pixel's layers, front to back: gives these besides the picture (layers.py)."""

PEELING = ("passes", "occlusion_query", "coincident", LAYERS)
"""Options of all that peel (peel.py)."""


@dataclass(frozen=True)
class Technique:
    """How layers are found and blended.

    draw: (gpu, triangles, batch, target, capacity, report, **options) draws a batch of tiles with room for `capacity`
    fragments; fragment_bytes: what it needs for each besides the fragment. peeled: (**options) to how many transparent
    layers of a pixel, from the front and from the back, it peels, of those in front of the first opaque one; None where
    it does not sort.
    """

    summary: str
    draw: Callable[..., Drawn]
    fragment_bytes: int
    passes: (
        int  # geometry passes at least, as the paper counts them; those that peel need more, the more layers there are
    )
    exact: bool
    options: tuple[str, ...] = ()  # of `render`, that it has besides those of all techniques
    peeled: Callable[..., tuple[int, int]] | None = None


TECHNIQUES: dict[str, Technique] = {
    "sort": Technique(
        sort.SUMMARY, sort.draw, sort.SCRATCH_BYTES, passes=1, exact=True, options=(LAYERS,), peeled=sort.peeled
    ),
    "depth-peeling": Technique(
        depth_peeling.SUMMARY,
        depth_peeling.draw,
        0,
        passes=0,
        exact=True,
        options=PEELING,
        peeled=depth_peeling.peeled,
    ),
    "dual-depth-peeling": Technique(
        dual_depth_peeling.SUMMARY,
        dual_depth_peeling.draw,
        0,
        passes=dual_depth_peeling.FIRST_PASSES,
        exact=True,
        options=PEELING,
        peeled=dual_depth_peeling.peeled,
    ),
    "multi-layer-peeling": Technique(
        multi_layer_peeling.SUMMARY,
        multi_layer_peeling.draw,
        0,
        passes=0,
        exact=True,
        options=(*PEELING, "layers_per_pass"),
        peeled=multi_layer_peeling.peeled,
    ),
    "weighted-average": Technique(
        weighted_average.SUMMARY, weighted_average.draw, 0, passes=1, exact=False, options=("precision",)
    ),
    "weighted-sum": Technique(
        weighted_sum.SUMMARY, weighted_sum.draw, 0, passes=1, exact=False, options=("precision",)
    ),
}


def technique(name: str) -> Technique:
    """The technique of that name. Raises InputError, which lists those there are."""
    if name not in TECHNIQUES:
        raise InputError(f"technique: expected one of {', '.join(TECHNIQUES)}; got {name!r}")
    return TECHNIQUES[name]
