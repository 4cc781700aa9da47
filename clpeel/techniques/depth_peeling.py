"""depth-peeling: each pass finds the nearest layer behind the one before (techniques/depth-peeling.cl).

Everitt 2001; Bavoil and Myers 2008, "Depth Peeling": N layers take N geometry passes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from clpeel.device.layout import ALL_LAYERS, FRAGMENT_BYTES, Targets
from clpeel.techniques.peeling import Peeling
from clpeel.techniques.technique import Count, Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn


class DepthPeeling(Technique[Peeling]):
    """Peels one layer a pass, front to back."""

    name = "depth-peeling"
    summary = "exact: peels the nearest layer in each geometry pass; N layers take N passes"
    kernel = "techniques/depth-peeling.cl"
    options = Peeling
    exact = True
    paper_precision = "unorm8"
    has_passes = True

    def passes_for(self, layers: Count, options: Peeling) -> Count:
        """N passes for N layers (Everitt 2001)."""
        return layers

    def buffer_bytes(self, layers: int, options: Peeling) -> int:
        """z_near, the slot of the layer, whether there are more layers, and the colour."""
        return 2 * FRAGMENT_BYTES + 4 + options.color_bytes

    def peeled(self, options: Peeling) -> tuple[int, int]:
        """One layer a pass from the front, and none from the back."""
        return ALL_LAYERS if options.passes is None else options.passes, 0

    def targets(self, options: Peeling) -> Targets:
        """The depth buffers of this pass and of the one before, which take turns, and the colour."""
        return Targets(depths=1, bounds=1, colors=1)

    def draw(self, frame: Frame, batch: Batch, options: Peeling) -> Drawn:
        """Peels until nothing is left, or `passes` times."""
        return frame.peel(batch, self.kernel, options)
