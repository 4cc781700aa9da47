"""The techniques: a module for each, and the one registry that all menus, tests and tables use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from clpeel.errors import InputError
from clpeel.options import SHARE, Options, option, options_of
from clpeel.techniques.adaptive import Adaptive
from clpeel.techniques.depth_peeling import DepthPeeling
from clpeel.techniques.dual_depth_peeling import DualDepthPeeling
from clpeel.techniques.glowscript import Glowscript
from clpeel.techniques.k_buffer import KBuffer
from clpeel.techniques.layer_count import LayerCount
from clpeel.techniques.moments import Moments
from clpeel.techniques.multi_layer_alpha_blending import MultiLayerAlphaBlending
from clpeel.techniques.multi_layer_peeling import MultiLayerPeeling
from clpeel.techniques.precision import Bounded
from clpeel.techniques.sort import Sort
from clpeel.techniques.stochastic import Stochastic
from clpeel.techniques.technique import Technique as Technique
from clpeel.techniques.thickness import Thickness
from clpeel.techniques.translucency import Translucency
from clpeel.techniques.wavelet import Wavelet
from clpeel.techniques.weighted_average import WeightedAverage
from clpeel.techniques.weighted_blended import WeightedBlended
from clpeel.techniques.weighted_sum import WeightedSum

AnyTechnique = Technique[Any]
"""A technique of the registry. Its type does not say which options it takes; its attribute `options` does."""

TECHNIQUES: dict[str, AnyTechnique] = {
    each.name: each
    for each in (
        Sort(),
        DepthPeeling(),
        DualDepthPeeling(),
        MultiLayerPeeling(),
        Glowscript(),
        Thickness(),
        Translucency(),
        WeightedAverage(),
        WeightedSum(),
        WeightedBlended(),
        KBuffer(),
        Wavelet(),
        MultiLayerAlphaBlending(),
        Adaptive(),
        Stochastic(),
        Moments(),
        LayerCount(),
    )
}

AUTO = "auto"
"""In place of a technique's name: rendering/auto.py chooses the one of TECHNIQUES that the picture needs."""

AUTO_SUMMARY = "the technique and the layers a pass that draw this picture fastest, within --max-error and --memory"

ERROR_BOUND = "error_bound"
"""The map that `max_error` makes."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class AutoOptions(Options):
    """The options of `auto`. It chooses only among techniques that keep to them."""

    max_error: float | None = option(None, SHARE, help="skip layers that cannot change a channel by more; 0 is exact")


def technique(name: str) -> AnyTechnique:
    """The technique of that name. Raises InputError if there is none, with a list of all names."""
    if name not in TECHNIQUES:
        raise InputError(f"technique: expected one of {', '.join((*TECHNIQUES, AUTO))}; got {name!r}")
    return TECHNIQUES[name]


def options_class(name: str) -> type[Options]:
    """The class of the options that a technique (or AUTO) has besides those of all pictures.

    Raises InputError if there is no such technique.
    """
    return AutoOptions if name == AUTO else technique(name).options


def option_names(name: str) -> tuple[str, ...]:
    """The names of the options of options_class, and `layers` if the technique knows the order of a pixel's layers.

    Raises InputError if there is no such technique.
    """
    if name == AUTO:
        return (*(each.name for each in options_of(AutoOptions)), "layers")
    return technique(name).option_names


def takes_max_error(options: type[Options]) -> bool:
    """Whether a technique with these options can skip layers that change nothing by more than a given error."""
    return issubclass(options, Bounded | AutoOptions)


def with_map(name: str) -> list[str]:
    """The names of the techniques that make the map of that name, always or when max_error is given."""
    return [
        made.name
        for made in TECHNIQUES.values()
        if name in made.maps or (name == ERROR_BOUND and takes_max_error(made.options))
    ]
