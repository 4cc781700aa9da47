"""translucency: a light behind the scene shines through where the scene is thin (techniques/translucency.cl).

"Dual depth buffering for translucency rendering": the share exp(-extinction thickness) of the light comes through. The
thickness is any of the variants of `thickness`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clpeel.checks import Background, Rgb
from clpeel.options import COLOR, not_negative, option
from clpeel.techniques.precision import Blending
from clpeel.techniques.thickness import Measuring, Variant, device_scale, maps_of

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.composite import Finished, Picture
    from clpeel.stages.frame import Frame
    from clpeel.stages.projection import Triangles
    from clpeel.stages.tiles import Drawn

LIGHT_COLOR = (1.0, 0.93, 0.8)
"""A warm white."""

REFLECTANCE = 0.35
"""The share of the light at the camera that a white surface reflects."""

OPTICAL_DIAGONAL = 6.0
"""The default sigma is this number, divided by the diagonal of the scene's bounds."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TranslucencyOptions(Blending, Variant):
    """The options of the light, and of the material that it goes through.

    sigma: extinction for each scene unit; None for a default by the scene's size (extinction_of). light_color: three
    numbers 0..1, or text such as "white".
    """

    sigma: float | None = option(
        None,
        not_negative("a number of 0 or more, a scene unit"),
        help="extinction a scene unit (default: by the scene's size)",
    )
    light_color: Rgb | str = option(LIGHT_COLOR, COLOR, help="of the light behind the scene (default: a warm white)")


class Translucency(Measuring[TranslucencyOptions]):
    """Makes the picture, and the maps of thickness that it is made from."""

    name = "translucency"
    summary = "surfaces with a light behind them, which comes through where they are thin"
    kernel = "techniques/translucency.cl"
    options = TranslucencyOptions
    light_apart = True

    def draw(self, frame: Frame, batch: Batch, options: TranslucencyOptions) -> Drawn:
        """Draws a batch. The kernel's lengths are in the device's units, so the extinction is converted to these."""
        extinction = extinction_of(frame.triangles, options) / device_scale(frame.triangles)
        light = [float(part) for part in options.light_color]
        if frame.triangles.features.linear:
            from clpeel.scene.textures import linear

            light = linear(light).tolist()
        parameters = (extinction, *light, REFLECTANCE)
        return self.measure(frame, batch, options.variant, parameters=parameters, constants=options.constants)

    def finish(
        self, picture: Picture, triangles: Triangles, background: Background | None, options: TranslucencyOptions
    ) -> Finished:
        """Makes the maps. The picture stays as it was drawn."""
        maps, stats = maps_of(picture, 1 / device_scale(triangles))
        return picture.finished(maps, {**stats, "sigma": extinction_of(triangles, options)})


def extinction_of(triangles: Triangles, options: TranslucencyOptions) -> float:
    """The extinction for each scene unit: `sigma` or, by default, OPTICAL_DIAGONAL / the scene's diagonal."""
    from clpeel.scene.camera import length_of

    if options.sigma is not None:
        return options.sigma
    low, high = triangles.scene.scene.bounds
    return OPTICAL_DIAGONAL / (length_of(high - low) or 1.0)
