"""glowscript: draws opaque surfaces, then at most four peels in front of them (techniques/glowscript.cl).

"Details about handling transparency with depth peeling" (GlowScript). There is no occlusion query, because reading its
result costs more than the passes that it saves. So the number of passes is fixed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clpeel.device.layout import FRAGMENT_BYTES, Targets
from clpeel.options import count, option
from clpeel.techniques.peeling import CoincidentName, Peeling
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Count, Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn

MOST_PEELS = 4


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GlowscriptOptions(Blending):
    """The options of Peeling, with a fixed number of passes: without occlusion_query and max_error."""

    passes: int = option(MOST_PEELS, count(MOST_PEELS), help="peel so many times and stop, where the technique peels")
    coincident: CoincidentName = option("keep", help="of equal depths keep all fragments, or the first alone")


class Glowscript(Technique[GlowscriptOptions]):
    """Peels as GlowScript's renderer does in browsers."""

    name = "glowscript"
    summary = "the four foremost layers, or as many as --passes, in front of opaque surfaces; what is behind is skipped"
    kernel = "techniques/glowscript.cl"
    options = GlowscriptOptions
    paper_precision = "unorm8"
    has_passes = True

    def passes_for(self, layers: Count, options: GlowscriptOptions) -> Count:
        """Always `passes`: without an occlusion query it cannot know that fewer would do."""
        return layers * 0 + options.passes

    def buffer_bytes(self, layers: int, options: GlowscriptOptions) -> int:
        """z_near, the slot, whether there are more layers, and the peels' colours. See Buffers in the kernel file."""
        return 2 * FRAGMENT_BYTES + 4 + MOST_PEELS * options.color_bytes

    def peeled(self, options: GlowscriptOptions) -> tuple[int, int]:
        """One layer a peel from the front, and none from the back."""
        return options.passes, 0

    def targets(self, options: GlowscriptOptions) -> Targets:
        """The depths of this peel and of the one before, which take turns, and the colours of all peels."""
        return Targets(depths=1, bounds=1, colors=MOST_PEELS)

    def draw(self, frame: Frame, batch: Batch, options: GlowscriptOptions) -> Drawn:
        """Peels `passes` times."""
        peeling = Peeling(
            precision=options.precision,
            passes=options.passes,
            occlusion_query=False,
            coincident=options.coincident,
        )
        return frame.peel(batch, self.kernel, peeling)
