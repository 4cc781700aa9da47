"""weighted-blended: a mean of the colours, weighted by how near they are (techniques/weighted-blended.cl).

C = sum(Ai Ci wi) / sum(Ai wi) (1 - R) + C0 R, where R is the product of all 1 - Ai (McGuire and Bavoil 2013, "Weighted
Blended Order-Independent Transparency", equation 6). The sums are taken in submission order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.errors import InputError
from clpeel.options import option
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.projection import Triangles
    from clpeel.stages.tiles import Drawn

WeightName = Literal["7", "8", "9", "10"]
WEIGHTS: tuple[WeightName, ...] = get_args(WeightName)
"""The equations of the paper that say how much a fragment counts at its depth."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedBlendedOptions(Blending):
    """The options of weighted-blended.

    weight: the paper's equation for weights. "10" goes by the window depth, so it means the same in scenes of any size.
    "7", "8" and "9" go by the distance in scene units, and are made for scenes that reach some hundreds of them.
    """

    weight: WeightName = option("10", help="of weighted-blended: the paper's equation for weights (default: 10)")

    def check_together(self) -> None:
        """Raise InputError for 8 bits, as the sum of weights goes to 3000 with each layer."""
        if self.precision == "unorm8":
            raise InputError(
                "precision: expected one of float32, half with the technique weighted-blended, got 'unorm8'; its sums "
                "of weights exceed 1"
            )


class WeightedBlended(Technique[WeightedBlendedOptions]):
    """Blends all layers as one, of their mean colour and their exact coverage."""

    name = "weighted-blended"
    summary = "fast, not exact: the mean colour of all layers, in which nearer ones count more; coverage is exact"
    kernel = "techniques/weighted-blended.cl"
    options = WeightedBlendedOptions
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: WeightedBlendedOptions) -> int:
        """All fragments of a sample. They are stored until they can be added up in the order of submission."""
        return FRAGMENT_BYTES * layers

    def compared(self) -> tuple[WeightedBlendedOptions, ...]:
        """The weights of the paper's other equations."""
        return tuple(WeightedBlendedOptions(weight=weight) for weight in WEIGHTS if weight != self.options().weight)

    def draw(self, frame: Frame, batch: Batch, options: WeightedBlendedOptions) -> Drawn:
        """Draws the batch in one geometry pass."""
        constants = {"WEIGHT": int(options.weight), "PERSPECTIVE": int(frame.triangles.perspective)}
        return frame.once(batch, self.kernel, {**options.constants, **constants}, parameters=depths_of(frame.triangles))


def depths_of(triangles: Triangles) -> tuple[float, ...]:
    """What makes window depths and distances of reversed depths: the kernel's parameters (weighted-blended.cl)."""
    near, far = triangles.clipping
    first, last = triangles.window
    span = last - first
    if triangles.perspective:  # depth is near / distance; the window depth is last / span (1 - first / distance)
        return -first / span, last / span * (first / near), near, 0.0, triangles.depth_scale
    return (last - far) / span, (far - near) / span, far, near - far, triangles.depth_scale
