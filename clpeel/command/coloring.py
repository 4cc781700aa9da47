"""Coloring: the options by which colours and opacities stand for numbers in the files."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

from clpeel.command import values
from clpeel.errors import InputError

OPTIONS = {
    "coloring_component": "component",
    "coloring_range": "clim",
    "coloring_log_scale": "log_scale",
    "colormap": "cmap",
    "colormap_discretization": "n_colors",
    "nan_color": "nan_color",
    "below_color": "below_color",
    "above_color": "above_color",
    "categories": "categories",
}
"""The options, and what with_scalars calls them."""

OPACITIES = ("opacity_array", "opacity_map")

COLORING = ("coloring_array", "coloring_by_cells", *OPTIONS, *OPACITIES)
"""All options of colours that stand for numbers."""


def add_coloring_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of all commands that read files."""
    add = parser.add_argument_group("colours that stand for numbers").add_argument
    text = "colour by these numbers of vertices or faces: a property of PLY, ..."
    add("--coloring-array", metavar="NAME", help=text)
    add(
        "--coloring-by-cells",
        action="store_true",
        help="those of faces, where vertices have an array of that name, too",
    )
    text = "of vectors: a component, from 0, or -1 for the length (default: -1)"
    add("--coloring-component", type=values.component, metavar="N", help=text)
    text = "numbers that have the first and the last colour (default: the least and the greatest)"
    add("--coloring-range", type=values.number_range, metavar="LOW,HIGH", help=text)
    add("--coloring-log-scale", action="store_true", help="map logarithms")
    text = "a name of matplotlib or cmap (_r turns it), or blue:white:red (default: viridis)"
    add("--colormap", type=values.colormap, metavar="NAME", help=text)
    text = "how many colours (default: 256, or those of the list)"
    add("--colormap-discretization", type=values.count, metavar="N", help=text)
    text = "colour where there is no number (default: nothing is drawn)"
    add("--nan-color", type=values.any_color, metavar="COLOR", help=text)
    text = "colour of numbers {} the range (default: the {} colour)"
    add("--below-color", type=values.any_color, metavar="COLOR", help=text.format("below", "first"))
    add("--above-color", type=values.any_color, metavar="COLOR", help=text.format("above", "last"))
    add("--categories", action="store_true", help="each number stands for a kind, and has a colour of its own")
    add("--opacity-array", metavar="NAME", help="opacity by these numbers of the files, 0..1")
    text = "opacity along the colours: linear, sigmoid, ... (_r: the other way round), or numbers 0..1, as 0,0.2,1"
    add("--opacity-map", type=values.opacity_map, metavar="NAME", help=text)


def given_coloring(options: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the arguments of with_scalars that the options of a file give, or None without --coloring-array.

    Raises InputError if an option is given without it, or is wrong, as far as that is known without the file.
    """
    given = {name: value for name in (*OPTIONS, *OPACITIES) if (value := options.get(name)) not in (None, False)}
    if options.get("coloring_array") is None:
        alone = [*given, *(["coloring_by_cells"] if options.get("coloring_by_cells") else [])]
        if alone:
            raise InputError(f"--{alone[0].replace('_', '-')}: expected --coloring-array with it, got none")
        return None
    if len([name for name in OPACITIES if name in given]) > 1:
        raise InputError("--opacity-array: expected no --opacity-map with it, got both")

    from clpeel.pictures.colormaps import sampled
    from clpeel.scene.transfer import transfer

    if "colormap" in given:
        sampled(given["colormap"])
    if "opacity_map" in given:
        try:
            transfer(given["opacity_map"], 256)
        except InputError as error:
            raise InputError(str(error).replace("opacity: ", "--opacity-map: ", 1)) from None
    found = {OPTIONS.get(name, "opacity"): value for name, value in given.items()}
    preference = "face" if options.get("coloring_by_cells") else "vertex"
    return {**found, "values": options["coloring_array"], "preference": preference}
