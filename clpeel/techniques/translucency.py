"""translucency: a light behind the scene, seen through what is thin (techniques/translucency.cl).

"Dual depth buffering for translucency rendering": what comes through is exp(-extinction thickness), by any of the
variants of `thickness`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from clpeel.errors import InputError
from clpeel.scene.camera import length_of
from clpeel.scene.scene import checked_rgb
from clpeel.stages.composite import Finished, Picture
from clpeel.stages.one_pass import Drawn
from clpeel.stages.projection import Triangles
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISION, precision_define
from clpeel.techniques.thickness import device_scale, maps_of, measure

SUMMARY = "surfaces with a light behind them, which comes through where they are thin"
OPTIONS = ("variant", "sigma", "light_color", PRECISION)

LIGHT_COLOR = (1.0, 0.93, 0.8)
"""A warm white."""

REFLECTANCE = 0.35
"""What a white surface reflects of the light at the camera."""

OPTICAL_DIAGONAL = 6.0
"""sigma, unless told, times the diagonal of the scene's bounds."""


def extinction(triangles: Triangles, sigma: Any) -> float:
    """sigma, a scene unit, as given or OPTICAL_DIAGONAL over the scene's diagonal; or InputError."""
    if sigma is None:
        low, high = triangles.scene.scene.bounds
        return OPTICAL_DIAGONAL / (length_of(high - low) or 1.0)
    try:
        value = float(sigma)
    except (TypeError, ValueError):
        value = -1.0
    if not 0 <= value < math.inf:
        raise InputError(f"sigma: expected a number of 0 or more, a scene unit, got {sigma!r}")
    return value


def draw(
    gpu: Any,
    triangles: Triangles,
    *arguments: Any,
    variant: str = "exact",
    sigma: float | None = None,
    light_color: Sequence[float] | str = LIGHT_COLOR,
    precision: str = DEFAULT_PRECISION,
) -> Drawn:
    """Draws a batch of tiles. Raises InputError where an option cannot be."""
    # Of the device's units, in which it finds lengths.
    parameters = (
        extinction(triangles, sigma) / device_scale(triangles),
        *checked_rgb("light_color", light_color),
        REFLECTANCE,
    )
    constants = precision_define(precision)
    return measure("techniques/translucency.cl", variant, False, parameters, gpu, triangles, *arguments, **constants)


def finish(
    picture: Picture, triangles: Triangles, background: Any, *, sigma: float | None = None, **options: Any
) -> Finished:
    """The maps; the picture is as it was drawn."""
    maps, stats = maps_of(picture, 1 / device_scale(triangles))
    return Finished(picture.image, picture.color, maps, {**stats, "sigma": extinction(triangles, sigma)})
