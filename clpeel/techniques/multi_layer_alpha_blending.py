"""multi-layer-alpha-blending: keeps k layers of a pixel, and blends the two farthest into one where there are more.

Salvi and Vaidyanathan 2014, "Multi-Layer Alpha Blending" (techniques/multi-layer-alpha-blending.cl). Fragments are
inserted in submission order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.options import option
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn

SlotCount = Literal[2, 4, 8, 16]
SLOT_COUNTS: tuple[SlotCount, ...] = get_args(SlotCount)

DEPTH_BYTES = 4
"""Bytes of a slot's depth, besides its colour."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SlotOptions(Blending):
    """The options of multi-layer-alpha-blending.

    slots: k, how many layers of a pixel are kept apart. Pixels with at most so many are exact.
    """

    slots: SlotCount = option(
        4, help="of multi-layer-alpha-blending: layers of a pixel that are kept apart (default: 4)"
    )


class MultiLayerAlphaBlending(Technique[SlotOptions]):
    """Keeps the foremost layers, and what is behind them as one."""

    name = "multi-layer-alpha-blending"
    summary = "fast, not exact: keeps 4 layers of a pixel, and blends the two farthest where there are more"
    kernel = "techniques/multi-layer-alpha-blending.cl"
    options = SlotOptions
    least_passes = 1
    paper_precision = "unorm8"
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: SlotOptions) -> int:
        """All fragments of a sample, which are stored until they can be inserted in submission order, and the slots."""
        return FRAGMENT_BYTES * layers + options.slots * (DEPTH_BYTES + options.color_bytes)

    def compared(self) -> tuple[SlotOptions, ...]:
        """The other numbers of slots."""
        return tuple(SlotOptions(slots=slots) for slots in SLOT_COUNTS if slots != self.options().slots)

    def draw(self, frame: Frame, batch: Batch, options: SlotOptions) -> Drawn:
        """Draws the batch in one geometry pass."""
        return frame.once(batch, self.kernel, {**options.constants, "SLOTS": int(options.slots)})
