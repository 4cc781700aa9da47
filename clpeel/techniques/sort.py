"""sort: sorts all fragments of a pixel by (depth, submission), and blends them front to back (techniques/sort.cl)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clpeel.device.layout import ALL_LAYERS, FRAGMENT_BYTES
from clpeel.techniques.precision import Bounded
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn


class Sort(Technique[Bounded]):
    """The exact technique that the others are measured against."""

    name = "sort"
    summary = "exact: sorts each pixel's fragments by depth, then blends them front to back"
    kernel = "techniques/sort.cl"
    options = Bounded
    exact = True
    least_passes = 1
    stores_fragments = True
    scratch_bytes = FRAGMENT_BYTES  # to sort long lists in: needed only where a pixel has more than RUN_MAX

    def buffer_bytes(self, layers: int, options: Bounded) -> int:
        """All fragments of a sample, which it stores at once."""
        return FRAGMENT_BYTES * layers

    def peeled(self, options: Bounded) -> tuple[int, int]:
        """All layers from the front, and none from the back."""
        return ALL_LAYERS, 0

    def draw(self, frame: Frame, batch: Batch, options: Bounded) -> Drawn:
        """Draws the batch in one geometry pass."""
        return frame.once(
            batch, self.kernel, options.constants, scratch_bytes=self.scratch_bytes, max_error=options.max_error
        )
