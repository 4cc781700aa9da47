"""thickness: how far each pixel's ray runs through the scene, as a map and a picture of it (techniques/thickness.cl).

Oat and Scheuermann 2008, "Computing Per-Pixel Object Thickness in a Single Render Pass" (ShaderX6), as described and
amended in "Dual depth buffering for translucency rendering": MIN blending of (depth, 1 - depth). The variant `exact` is
clpeel's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from clpeel.checks import Background
from clpeel.device.layout import FRAGMENT_BYTES, Targets
from clpeel.errors import InputError
from clpeel.options import RANGE, Options, option
from clpeel.techniques.maps import MapOptions, paint
from clpeel.techniques.peeling import Peeling
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from clpeel.pictures.lengths import Lengths
    from clpeel.stages.binning import Batch
    from clpeel.stages.composite import Finished, Map, Picture
    from clpeel.stages.frame import Frame
    from clpeel.stages.projection import Triangles
    from clpeel.stages.tiles import Drawn

VariantName = Literal["exact", "total", "first-solid"]
VARIANTS: tuple[VariantName, ...] = get_args(VariantName)
"""The variants in the order of the kernels' numbers (thickness.h)."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Variant(Options):
    """The option of all techniques that measure thickness.

    variant: "exact" sorts all fragments, and adds up the lengths within the surfaces. "total" is the length from the
    nearest crossing to the farthest. "first-solid" is the length from the first entry to the first exit.
    """

    variant: VariantName = option(
        "exact",
        help="of thickness: what lies within surfaces, from first to last, or the first solid (default: exact)",
    )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ThicknessOptions(MapOptions, Variant):
    """Which thickness is measured, and how it is shown."""

    projected: bool = option(False, help="thickness in window depths, 0..1, in place of scene units")
    thickness_range: tuple[float, float] | None = option(
        None, RANGE, help="thickness that the first and the last colour stand for (default: 0 to the greatest)"
    )


V = TypeVar("V", bound=Variant)


class Measuring(Technique[V]):
    """What techniques that measure thickness have in common."""

    maps = ("thickness", "unpaired")
    least_passes = 1
    all_surfaces = True
    measures_solids = True
    stores_fragments = True
    scratch_bytes = FRAGMENT_BYTES

    def buffer_bytes(self, layers: int, options: V) -> int:
        """All fragments of a sample for "exact", or the two that MIN blending keeps."""
        return FRAGMENT_BYTES * (layers if options.variant == "exact" else 2)

    def measure(
        self,
        frame: Frame,
        batch: Batch,
        variant: VariantName,
        projected: bool = False,
        parameters: Sequence[float] = (),
        constants: dict[str, int] | None = None,
    ) -> Drawn:
        """Draws a batch, and finds its thickness: Picture.values, as described in thickness.h.

        projected: measure in window depths, instead of the device's units. parameters: further numbers for the
        technique's kernel. constants: of the kernel.
        """
        triangles = frame.triangles
        numbers = (length_unit(triangles, projected), triangles.depth_scale, *parameters)
        linear = projected or not triangles.perspective  # thickness.h, length_between
        defines = {"VARIANT": VARIANTS.index(variant), "PERSPECTIVE": int(not linear), **(constants or {})}
        if variant == "exact":
            return frame.once(batch, self.kernel, defines, scratch_bytes=self.scratch_bytes, parameters=numbers)
        return frame.peel(batch, self.kernel, Peeling(passes=1), defines, parameters=numbers)


class Thickness(Measuring[ThicknessOptions]):
    """Makes the map of thickness, and a picture of it."""

    name = "thickness"
    summary = (
        "how far rays run through closed surfaces: a map in scene units, and its picture in colours with a scale bar"
    )
    kernel = "techniques/thickness.cl"
    options = ThicknessOptions
    has_passes = True

    def targets(self, options: ThicknessOptions) -> Targets:
        """The two channels that MIN blending keeps, and the foremost colour.

        Raises InputError for "exact", which sorts all fragments.
        """
        if options.variant == "exact":
            raise InputError(
                "execution: expected 'tiles' for the variant 'exact', got 'passes'; total and first-solid have it"
            )
        return Targets(depths=2, bounds=0, colors=1, facing=True)

    def draw(self, frame: Frame, batch: Batch, options: ThicknessOptions) -> Drawn:
        """Draws a batch. Colours are not needed, so fragments have none of their own."""
        return self.measure(frame.without_colors(), batch, options.variant, options.projected)

    def finish(
        self, picture: Picture, triangles: Triangles, background: Background | None, options: ThicknessOptions
    ) -> Finished:
        """Makes the maps, and the picture: the thickness in colours, as the mean over a pixel's covered samples.

        Unpaired samples have the colour OUTSIDE, which is not in the colour map. `thickness_range` is by default 0 to
        the greatest thickness of the pixels without unpaired samples.
        """
        import numpy as np

        from clpeel.pictures.scale_bar import draw_scale_bar

        maps, stats = maps_of(picture, 1.0 if options.projected else 1 / device_scale(triangles))
        values = picture.found
        covered = values[..., 2]
        some = covered > 0
        shown = np.divide(maps["thickness"], covered, out=np.zeros_like(maps["thickness"]), where=some)
        low, high = options.thickness_range or _range_of(shown, maps["unpaired"])
        outside = some & ~maps["unpaired"] & ((shown < low) | (shown > high))
        stats |= {
            "thickness_range": [low, high],
            "clamped_pixels": int(np.count_nonzero(outside)),
            "unit": "projected" if options.projected else "scene units",
        }
        image, color = paint(picture, background, (shown - low) / (high - low), covered, values[..., 1])
        if options.scale_bar:
            label = f"thickness, {stats['unit']}"
            draw_scale_bar(image, low, high, label, some, bool(stats["unpaired_pixels"]))
        return picture.finished(maps, stats, image, color)


def _range_of(shown: Lengths, unpaired: NDArray[np.bool_]) -> tuple[float, float]:
    return 0.0, float(shown[~unpaired].max(initial=0.0)) or float(shown.max()) or 1.0


def length_unit(triangles: Triangles, projected: bool) -> float:
    """The factor of the kernels' lengths (thickness.h, length_between).

    For scene units it is near in perspective, where depth is near / distance, and far - near in parallel projection.
    device_scale is part of it, so that float32 holds the lengths. For `projected` lengths in perspective, OpenGL's
    window depth is f / (f - n) (1 - n / distance), so it is f / (f - n); in parallel projection it is 1. The depths'
    range may differ from that of window depths (Camera.depth_range). Then the ratio of the two is part of the factor.
    """
    near, far = triangles.clipping
    window_near, window_far = triangles.window
    if triangles.perspective:
        projection = window_near / near * window_far / (window_far - window_near)
        return projection if projected else near * device_scale(triangles)
    return (far - near) / (window_far - window_near) if projected else (far - near) * device_scale(triangles)


def device_scale(triangles: Triangles) -> float:
    """How many of the device's units a scene unit is: a power of two, 1 except for scenes of extreme sizes."""
    return triangles.scene.grid.scale


def maps_of(picture: Picture, unit: float = 1.0) -> tuple[dict[str, Map], dict[str, object]]:
    """The maps by name, [height, width], and their stats.

    unit: how many of the map's units one of the device's units is, a power of two.
    """
    import numpy as np

    from clpeel.pictures.lengths import scaled

    thickness = scaled(picture.found[..., 0], unit)
    unpaired = picture.found[..., 1] > 0
    stats: dict[str, object] = {
        "thickness_max": float(thickness.max()),
        "unpaired_pixels": int(np.count_nonzero(unpaired)),
    }
    return {"thickness": thickness, "unpaired": unpaired}, stats
