"""The techniques: one module each, and the one registry that every menu, test and table goes through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from clpeel.device.devices import Gpu
from clpeel.device.layout import Features
from clpeel.errors import InputError
from clpeel.stages.binning import Batch
from clpeel.stages.composite import Finished
from clpeel.stages.many_passes import check_peeling, totals_bytes
from clpeel.stages.one_pass import Drawn, slab_bytes
from clpeel.techniques import (
    depth_peeling,
    dual_depth_peeling,
    glowscript,
    multi_layer_peeling,
    sort,
    thickness,
    translucency,
    weighted_average,
    weighted_sum,
)
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISION, check_precision

LAYERS = "layers"
"""Option of all that know a pixel's layers, front to back: gives these besides the picture (layers.py)."""

ERROR_BOUND = "error_bound"
"""The map that MAX_ERROR makes."""

MAX_ERROR = "max_error"
"""Option of all that blend in order: leave out what cannot change a channel by more, and tell by how much (draw.py)."""

PEELING = ("passes", "occlusion_query", "coincident", MAX_ERROR, PRECISION, LAYERS)
"""Options of all that peel until nothing is left (peel.py)."""


def one_pass(layers: Any, options: dict[str, Any]) -> Any:
    """However many layers there are."""
    return 1


@dataclass(frozen=True)
class Technique:
    """How layers are found and blended.

    draw: (gpu, triangles, batch, target, capacity, report, **options) draws a batch of tiles with room for `capacity`
    fragments; buffer_bytes: (layers, options) tells what it keeps of a sample with so many layers; fragment_bytes: what
    it needs for each fragment besides the fragment. peeled: (**options) to how many transparent layers of a pixel, from
    the front and from the back, it peels; None where it does not sort. passes_for: (layers, options) to the geometry
    passes that a picture takes whose deepest pixel has so many transparent layers, as the paper counts them; of
    an array of layers an array, or one number for all.
    """

    summary: str
    draw: Callable[..., Drawn]
    buffer_bytes: Callable[[int, dict[str, Any]], int]
    fragment_bytes: int = 0
    passes: int = 0  # geometry passes at least, as the papers count them; those that peel need more for more layers
    exact: bool = False
    paper_precision: str = DEFAULT_PRECISION  # of its colour buffers in the paper (blending.py)
    options: tuple[str, ...] = ()  # of `render`, that it has besides those of all techniques
    maps: tuple[str, ...] = ()  # of `Result`, that it makes besides the picture; the first is what `--map` writes
    finish: Callable[..., Finished] | None = None
    """Of techniques with maps: (picture, triangles, background, **options) makes them of picture.values."""
    peeled: Callable[..., tuple[int, int]] | None = None
    check: Callable[..., None] = lambda **_: None
    passes_for: Callable[[Any, dict[str, Any]], Any] = one_pass
    stores_fragments: bool = False  # all of a pixel's at once, for which the memory has to be enough
    variants: tuple[dict[str, Any], ...] = ({},)  # options that `auto` has the choice of
    left_out: Callable[[int, float], float] | None = None
    """Of techniques that are not exact: how far off a channel is at most, with so many layers of such alphas."""
    device_bytes: Callable[[Gpu, Features, Batch, int, dict[str, Any]], int] = lambda *_: 0
    """(gpu, features, batch, capacity, options) to what it takes of the device's memory for a batch, besides lists."""


TECHNIQUES: dict[str, Technique] = {
    "sort": Technique(
        sort.SUMMARY,
        sort.draw,
        sort.buffer_bytes,
        fragment_bytes=sort.SCRATCH_BYTES,
        passes=1,
        exact=True,
        options=(MAX_ERROR, PRECISION, LAYERS),
        peeled=sort.peeled,
        check=sort.check,
        stores_fragments=True,
        device_bytes=partial(slab_bytes, sort.SCRATCH_BYTES),
    ),
    "depth-peeling": Technique(
        depth_peeling.SUMMARY,
        depth_peeling.draw,
        depth_peeling.buffer_bytes,
        exact=True,
        paper_precision="unorm8",
        options=PEELING,
        peeled=depth_peeling.peeled,
        check=check_peeling,
        passes_for=depth_peeling.passes_for,
        device_bytes=totals_bytes,
    ),
    "dual-depth-peeling": Technique(
        dual_depth_peeling.SUMMARY,
        dual_depth_peeling.draw,
        dual_depth_peeling.buffer_bytes,
        passes=dual_depth_peeling.FIRST_PASSES,
        exact=True,
        paper_precision="unorm8",
        options=PEELING,
        peeled=dual_depth_peeling.peeled,
        check=check_peeling,
        passes_for=dual_depth_peeling.passes_for,
        device_bytes=totals_bytes,
    ),
    "multi-layer-peeling": Technique(
        multi_layer_peeling.SUMMARY,
        multi_layer_peeling.draw,
        multi_layer_peeling.buffer_bytes,
        exact=True,
        paper_precision="unorm8",
        options=(*PEELING, "layers_per_pass", "hazard_window", "hazard_order", "torn_writes"),
        peeled=multi_layer_peeling.peeled,
        check=multi_layer_peeling.check,
        passes_for=multi_layer_peeling.passes_for,
        variants=multi_layer_peeling.VARIANTS,
        device_bytes=totals_bytes,
    ),
    "glowscript": Technique(
        glowscript.SUMMARY,
        glowscript.draw,
        glowscript.buffer_bytes,
        paper_precision="unorm8",
        options=("passes", "coincident", PRECISION, LAYERS),
        peeled=glowscript.peeled,
        check=glowscript.check,
        passes_for=glowscript.passes_for,
    ),
    "thickness": Technique(
        thickness.SUMMARY,
        thickness.draw,
        thickness.buffer_bytes,
        fragment_bytes=thickness.SCRATCH_BYTES,
        passes=1,
        options=thickness.OPTIONS,
        maps=thickness.MAPS,
        finish=thickness.finish,
        stores_fragments=True,
    ),
    "translucency": Technique(
        translucency.SUMMARY,
        translucency.draw,
        thickness.buffer_bytes,
        fragment_bytes=thickness.SCRATCH_BYTES,
        passes=1,
        options=translucency.OPTIONS,
        maps=thickness.MAPS,
        finish=translucency.finish,
        stores_fragments=True,
    ),
    "weighted-average": Technique(
        weighted_average.SUMMARY,
        weighted_average.draw,
        weighted_sum.buffer_bytes,
        passes=1,
        paper_precision="half",
        options=(PRECISION,),
        check=check_precision,
        stores_fragments=True,
        device_bytes=partial(slab_bytes, 0),
    ),
    "weighted-sum": Technique(
        weighted_sum.SUMMARY,
        weighted_sum.draw,
        weighted_sum.buffer_bytes,
        passes=1,
        paper_precision="half",
        options=(PRECISION,),
        check=check_precision,
        stores_fragments=True,
        left_out=weighted_sum.left_out,
        device_bytes=partial(slab_bytes, 0),
    ),
}


AUTO = "auto"
"""In place of a technique's name: the one of TECHNIQUES that the picture needs (auto.py)."""

AUTO_SUMMARY = "the technique and the layers a pass that draw this picture fastest, within --max-error and --memory"
AUTO_OPTIONS = (MAX_ERROR, LAYERS)


def technique(name: str) -> Technique:
    """The technique of that name. Raises InputError, which lists those there are."""
    if name not in TECHNIQUES:
        raise InputError(f"technique: expected one of {', '.join((*TECHNIQUES, AUTO))}; got {name!r}")
    return TECHNIQUES[name]


def options_of(name: str) -> tuple[str, ...]:
    """Of `render`, that the technique of that name, or AUTO, has besides those of all."""
    return AUTO_OPTIONS if name == AUTO else technique(name).options


def labelled(name: str, options: dict[str, Any]) -> str:
    """A technique with those options that make it another: "multi-layer-peeling, layers_per_pass 16"."""
    return ", ".join([name, *(f"{key} {value}" for key, value in options.items() if key != MAX_ERROR)])


def with_map(name: str) -> list[str]:
    """The techniques that make the map of that name, always or when they are told how much they may leave out."""
    return [
        technique
        for technique, made in TECHNIQUES.items()
        if name in made.maps or (name == ERROR_BOUND and MAX_ERROR in made.options)
    ]
