"""dual-depth-peeling: each pass peels the nearest and the farthest layer (techniques/dual-depth-peeling.cl).

Bavoil and Myers 2008, "Dual Depth Peeling": N layers take N / 2 + 1 geometry passes, (N + 1) / 2 + 1 where N is odd.
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


class DualDepthPeeling(Technique[Peeling]):
    """Peels from both ends at once, with a min-max depth buffer."""

    name = "dual-depth-peeling"
    summary = "exact: peels the nearest and the farthest layer in each geometry pass; N layers take N / 2 + 1 passes"
    kernel = "techniques/dual-depth-peeling.cl"
    options = Peeling
    exact = True
    least_passes = 1  # the first pass finds the outermost layers and peels none
    paper_precision = "unorm8"
    has_passes = True

    def passes_for(self, layers: Count, options: Peeling) -> Count:
        """N / 2 + 1 passes for N layers, and (N + 1) / 2 + 1 where N is odd (Bavoil and Myers 2008)."""
        return (layers + 1) // 2 + self.least_passes

    def buffer_bytes(self, layers: int, options: Peeling) -> int:
        """Two min-max depth buffers, a front colour and a back colour. See Buffers in the kernel file."""
        return 4 * FRAGMENT_BYTES + 2 * options.color_bytes

    def peeled(self, options: Peeling) -> tuple[int, int]:
        """One layer a peel from the front and one from the back; all layers if `passes` does not limit the peels."""
        return (ALL_LAYERS, 0) if options.passes is None else (options.passes, options.passes)

    def targets(self, options: Peeling) -> Targets:
        """The min-max depth buffers of this pass and of the one before, and the colours of front and back."""
        return Targets(depths=2, bounds=2, colors=2)

    def draw(self, frame: Frame, batch: Batch, options: Peeling) -> Drawn:
        """Peels until nothing is left, or `passes` times after the first pass."""
        return frame.peel(batch, self.kernel, options, first_passes=self.least_passes)
