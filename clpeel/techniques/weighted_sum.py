"""weighted-sum: adds up the fragments in the order in which they come, in one pass (techniques/weighted-sum.cl).

C = sum(Ai Ci) + C0 (1 - sum(Ai)) (Meshkin 2007; Bavoil and Myers 2008, "Weighted Sum"). The sums are taken in
submission order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from clpeel.device.layout import FRAGMENT_BYTES, Targets
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn


class Sums(Technique[Blending]):
    """What techniques that add fragments up, without sorting them by depth, have in common."""

    options = Blending
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True
    has_passes = True

    def buffer_bytes(self, layers: int, options: Blending) -> int:
        """All fragments of a sample. They are stored until they can be added up in the order of submission."""
        return FRAGMENT_BYTES * layers

    def targets(self, options: Blending) -> Targets:
        """The sums. How many fragments there are is counted besides."""
        return Targets(depths=0, bounds=0, colors=1)

    def draw(self, frame: Frame, batch: Batch, options: Blending) -> Drawn:
        """Draws the batch in one geometry pass."""
        return frame.once(batch, self.kernel, options.constants)


class WeightedSum(Sums):
    """Shows every layer in full, as if nothing were in front of it."""

    name = "weighted-sum"
    summary = "fast, not exact: adds up the colours times their alphas in any order; right where alphas are small"
    kernel = "techniques/weighted-sum.cl"

    def error_without_order(self, layers: int, alpha: float) -> float:
        """How far off a channel is at most, 0..1, over any background, with so many layers of at most this alpha.

        The sum shows each layer in full, as Ai Ci. In truth the share 1 - Pi of it is hidden, where Pi is the product
        of 1 - Aj over the layers in front. So over a background C0 the picture is off by sum(Ai (1 - Pi) (Ci - C0)).
        The bound follows from 1 - Pi <= sum(Aj).
        """
        return alpha * alpha * layers * (layers - 1) / 2
