"""weighted-sum: one pass over the fragments in the order they come (techniques/weighted-sum.cl).

C = sum(Ai Ci) + C0 (1 - sum(Ai)), in submission order (Meshkin 2007; Bavoil and Myers 2008, "Weighted Sum").
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn


class Sums(Technique[Blending]):
    """What the techniques that add fragments up, in whatever order of depth, have in common."""

    options = Blending
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: Blending) -> int:
        """All fragments of a sample: they are kept until they can be added up in the order of submission."""
        return FRAGMENT_BYTES * layers

    def draw(self, frame: Frame, batch: Batch, options: Blending) -> Drawn:
        """Goes over the geometry once."""
        return frame.once(batch, self.kernel, options.constants)


class WeightedSum(Sums):
    """Every layer in full, as if nothing were in front of it."""

    name = "weighted-sum"
    summary = "fast, not exact: adds up the colours times their alphas in any order; right where alphas are small"
    kernel = "techniques/weighted-sum.cl"

    def error_without_order(self, layers: int, alpha: float) -> float:
        """How far off a channel is at most, over any background, with so many layers of such alphas.

        The sum takes each layer to be seen in full, Ai Ci, where 1 - Pi of it is hidden, Pi being the product of the
        1 - Aj in front; over a background C0 the picture is off by sum(Ai (1 - Pi) (Ci - C0)), and 1 - Pi <= sum(Aj).
        """
        return alpha * alpha * layers * (layers - 1) / 2
