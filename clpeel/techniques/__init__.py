"""The techniques: one module each, and the one registry that every menu, test and table goes through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from clpeel.composite import Finished
from clpeel.draw import Drawn
from clpeel.errors import InputError
from clpeel.techniques import (
    depth_peeling,
    dual_depth_peeling,
    multi_layer_peeling,
    sort,
    thickness,
    translucency,
    weighted_average,
    weighted_sum,
)

PEELING = ("passes", "occlusion_query", "coincident")
"""Options of all that peel (peel.py)."""


@dataclass(frozen=True)
class Technique:
    """How layers are found and blended.

    draw: (gpu, triangles, batch, target, capacity, report, **options) draws a batch of tiles with room for `capacity`
    fragments; fragment_bytes: what it needs for each besides the fragment.
    """

    summary: str
    draw: Callable[..., Drawn]
    fragment_bytes: int
    passes: (
        int  # geometry passes at least, as the paper counts them; those that peel need more, the more layers there are
    )
    exact: bool
    options: tuple[str, ...] = ()  # of `render`, that it has besides those of all techniques
    maps: tuple[str, ...] = ()  # of `Result`, that it makes besides the picture; the first is what `--map` writes
    finish: Callable[..., Finished] | None = None
    """Of techniques with maps: (picture, triangles, background, **options) makes them of picture.values."""


TECHNIQUES: dict[str, Technique] = {
    "sort": Technique(sort.SUMMARY, sort.draw, sort.SCRATCH_BYTES, passes=1, exact=True),
    "depth-peeling": Technique(depth_peeling.SUMMARY, depth_peeling.draw, 0, passes=0, exact=True, options=PEELING),
    "dual-depth-peeling": Technique(
        dual_depth_peeling.SUMMARY,
        dual_depth_peeling.draw,
        0,
        passes=dual_depth_peeling.FIRST_PASSES,
        exact=True,
        options=PEELING,
    ),
    "multi-layer-peeling": Technique(
        multi_layer_peeling.SUMMARY,
        multi_layer_peeling.draw,
        0,
        passes=0,
        exact=True,
        options=(*PEELING, "layers_per_pass"),
    ),
    "thickness": Technique(
        thickness.SUMMARY,
        thickness.draw,
        thickness.SCRATCH_BYTES,
        passes=1,
        exact=False,
        options=thickness.OPTIONS,
        maps=thickness.MAPS,
        finish=thickness.finish,
    ),
    "translucency": Technique(
        translucency.SUMMARY,
        translucency.draw,
        thickness.SCRATCH_BYTES,
        passes=1,
        exact=False,
        options=translucency.OPTIONS,
        maps=thickness.MAPS,
        finish=translucency.finish,
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


def with_map(name: str) -> list[str]:
    """The techniques that make the map of that name."""
    return [technique for technique, made in TECHNIQUES.items() if name in made.maps]
