"""thickness: how far the ray of each pixel runs through the scene, as a map and its picture (techniques/thickness.cl).

Oat and Scheuermann 2008, "Computing Per-Pixel Object Thickness in a Single Render Pass" (ShaderX6), as described and
amended in "Dual depth buffering for translucency rendering": MIN blending of (depth, 1 - depth). The variant `exact` is
clpeel's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from clpeel.checks import Rgb
from clpeel.device.layout import FRAGMENT_BYTES
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


@dataclass(frozen=True, kw_only=True)
class Variant(Options):
    """The option of all that measure thickness.

    variant: "exact" adds up the lengths within the surfaces, by all fragments sorted; "total" goes from the nearest
    crossing to the farthest; "first-solid" goes from the first entry to the first exit.
    """

    variant: VariantName = option(
        "exact",
        help="of thickness: what lies within surfaces, from first to last, or the first solid (default: exact)",
    )


@dataclass(frozen=True, kw_only=True)
class ThicknessOptions(MapOptions, Variant):
    """What is measured, and how it is shown."""

    projected: bool = option(False, help="thickness in window depths, 0..1, in place of scene units")
    thickness_range: tuple[float, float] | None = option(
        None, RANGE, help="thickness that the first and the last colour stand for (default: 0 to the greatest)"
    )


V = TypeVar("V", bound=Variant)


class Measuring(Technique[V]):
    """What techniques have in common that find thickness."""

    maps = ("thickness", "unpaired")
    least_passes = 1
    all_surfaces = True
    stores_fragments = True
    scratch_bytes = FRAGMENT_BYTES

    def buffer_bytes(self, layers: int, options: V) -> int:
        """All fragments of a sample, or the two that MIN blending keeps."""
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
        """Draws a batch, and finds its thickness (Picture.values, as thickness.h has them).

        projected: in window depths rather than scene units. parameters: the technique's own numbers. constants: of its
        kernel.
        """
        triangles = frame.triangles
        numbers = (length_unit(triangles, projected), triangles.depth_scale, *parameters)
        defines = {"VARIANT": VARIANTS.index(variant), **(constants or {})}
        linear = projected or not triangles.features.perspective  # thickness.h, length_between
        # Depths are exact by now, so the kernels need no float pairs: one build fewer.
        frame = frame.built_for(perspective=not linear, low_positions=False)
        if variant == "exact":
            return frame.once(batch, self.kernel, defines, scratch_bytes=self.scratch_bytes, parameters=numbers)
        return frame.peel(batch, self.kernel, Peeling(passes=1), defines, parameters=numbers)


class Thickness(Measuring[ThicknessOptions]):
    """The map, and its picture."""

    name = "thickness"
    summary = (
        "how far rays run through closed surfaces: a map in scene units, and its picture in colours with a scale bar"
    )
    kernel = "techniques/thickness.cl"
    options = ThicknessOptions

    def draw(self, frame: Frame, batch: Batch, options: ThicknessOptions) -> Drawn:
        """Needs no colours, so no fragment needs one of its own."""
        plain = frame.built_for(color_rate="scene", headlight=False)
        return self.measure(plain, batch, options.variant, options.projected)

    def finish(
        self, picture: Picture, triangles: Triangles, background: Rgb | None, options: ThicknessOptions
    ) -> Finished:
        """The maps, and the thickness in colours: of a pixel's samples the mean of those that are covered.

        Unpaired samples are shown in OUTSIDE, a colour that the map has not. `thickness_range` is by default 0 to the
        greatest thickness of any pixel that is not unpaired.
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
    """What the kernels' lengths are multiplied with (thickness.h, length_between).

    Scene units: near in perspective, as depth is near / distance, and far - near else; times device_scale, so that
    float32 holds them. Projected, OpenGL's window depth f / (f - n) (1 - n / distance) in perspective: f / (f - n), and
    else 1. Where depths begin and end elsewhere than window depths, their ratio comes in (Camera.depth_range).
    """
    near, far = triangles.clipping
    window_near, window_far = triangles.window
    if triangles.features.perspective:
        projection = window_near / near * window_far / (window_far - window_near)
        return projection if projected else near * device_scale(triangles)
    return (far - near) / (window_far - window_near) if projected else (far - near) * device_scale(triangles)


def device_scale(triangles: Triangles) -> float:
    """A scene unit, in those of the device: a power of two, 1 but for scenes of extreme sizes."""
    return triangles.scene.grid.scale


def maps_of(picture: Picture, unit: float = 1.0) -> tuple[dict[str, Map], dict[str, object]]:
    """The maps by name, and their stats. unit: of the device's lengths, a power of two, in those of the map."""
    import numpy as np

    from clpeel.pictures.lengths import scaled

    thickness = scaled(picture.found[..., 0], unit)
    unpaired = picture.found[..., 1] > 0
    stats: dict[str, object] = {
        "thickness_max": float(thickness.max()),
        "unpaired_pixels": int(np.count_nonzero(unpaired)),
    }
    return {"thickness": thickness, "unpaired": unpaired}, stats
