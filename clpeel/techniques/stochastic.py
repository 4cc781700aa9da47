"""stochastic: each fragment covers a random part of a pixel's samples, by its alpha (techniques/stochastic.cl).

Enderton, Sintorn, Shirley and Luebke 2010, "Stochastic Transparency": stratified masks, visibility by the samples that
nothing nearer covers, and alpha correction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.options import option
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class StochasticOptions(Blending):
    """The options of stochastic.

    stochastic_samples: how many samples the masks of a pixel have. They are all at one place, and each of the picture's
    own `samples` has so many. The default is that of the paper's hardware. alpha_correction: make the total opacity
    that of all layers, so that only their colours are noisy.
    """

    stochastic_samples: Literal[8, 16, 64] = option(
        8, help="of stochastic: samples that a fragment covers some of: 8, 16 or 64 (default: 8)"
    )
    alpha_correction: bool = option(True, help="correct the opacity of stochastic to that of all layers")


class Stochastic(Technique[StochasticOptions]):
    """Shows layers by chance, so that the mean of many pictures is the exact one."""

    name = "stochastic"
    summary = "not exact: each fragment covers a random part of a pixel's samples; noise that falls with their number"
    kernel = "techniques/stochastic.cl"
    options = StochasticOptions
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True
    scratch_bytes = FRAGMENT_BYTES  # as `sort`, by which it finds what is nearer

    def buffer_bytes(self, layers: int, options: StochasticOptions) -> int:
        """All fragments of a sample, which it stores at once. Masks are never in memory."""
        return FRAGMENT_BYTES * layers

    def compared(self) -> tuple[StochasticOptions, ...]:
        """More samples, and the paper's algorithm without alpha correction."""
        return (
            StochasticOptions(stochastic_samples=16),
            StochasticOptions(stochastic_samples=64),
            StochasticOptions(alpha_correction=False),
        )

    def draw(self, frame: Frame, batch: Batch, options: StochasticOptions) -> Drawn:
        """Draws the batch in one geometry pass."""
        own = {"MASK_BITS": options.stochastic_samples, "CORRECTED": int(options.alpha_correction)}
        return frame.once(batch, self.kernel, {**options.constants, **own}, scratch_bytes=self.scratch_bytes)
