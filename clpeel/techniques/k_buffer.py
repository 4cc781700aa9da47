"""k-buffer: keeps and sorts k layers of a pixel, and averages the others behind them (techniques/k-buffer.cl).

The nearest k are kept by insertion (Bavoil, Callahan, Lefohn, Comba and Silva 2007, "Multi-Fragment Effects on the GPU
using the k-Buffer"), or the first k to arrive (Myers and Bavoil 2007, "Stencil Routed A-Buffer"). The others are
averaged as in weighted-average, and put behind them (Maule, Comba, Torchelsen and Bastos 2013, "Hybrid Transparency").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.options import count, option
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Count, Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn

KeptByName = Literal["depth", "arrival"]
TailName = Literal["weighted-average", "none"]

MOST_KEPT = 64

ROUTED_A_PASS = 8
"""How many fragments of a pixel one stencil-routed pass takes: as many as a multisampled pixel has samples."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class KBufferOptions(Blending):
    """The options of k-buffer.

    kept_layers: k. With 0 the picture is that of weighted-average, and with as many as there are layers, that of sort.
    kept_by: "depth" keeps the nearest layers. "arrival" keeps the first ones of the order of submission, as hardware
    with stencil routing does. tail: what becomes of the others. "weighted-average" puts them behind the kept ones, as
    so many layers of their average colour and alpha. "none" loses them; stats["truncated_pixels"] counts where.
    """

    kept_layers: int = option(8, count(MOST_KEPT, 0), help="of k-buffer: layers that are kept and sorted (default: 8)")
    kept_by: KeptByName = option("depth", help="of k-buffer: keep the nearest layers, or the first to arrive")
    tail: TailName = option("weighted-average", help="of k-buffer: average the other layers, or leave them out")


class KBuffer(Technique[KBufferOptions]):
    """Blends k layers in order, and the others as one."""

    name = "k-buffer"
    summary = (
        "fast, not exact: sorts the 8 nearest layers of each pixel, and blends the average of the others behind them"
    )
    kernel = "techniques/k-buffer.cl"
    options = KBufferOptions
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True

    def passes_for(self, layers: Count, options: KBufferOptions) -> Count:
        """One pass; or as many as stencil routing takes for those that are kept."""
        if options.kept_by == "depth":
            return super().passes_for(layers, options)
        return (layers * 0 + options.kept_layers + ROUTED_A_PASS - 1) // ROUTED_A_PASS

    def buffer_bytes(self, layers: int, options: KBufferOptions) -> int:
        """All fragments of a sample. They are stored until they can be gone through in the order of submission."""
        return FRAGMENT_BYTES * layers

    def compared(self) -> tuple[KBufferOptions, ...]:
        """Fewer and more layers than the default."""
        return tuple(KBufferOptions(kept_layers=kept) for kept in (2, 4, 16))

    def draw(self, frame: Frame, batch: Batch, options: KBufferOptions) -> Drawn:
        """Draws the batch in one geometry pass."""
        constants = {
            "KEPT_LAYERS": options.kept_layers,
            "BY_ARRIVAL": int(options.kept_by == "arrival"),
            "AVERAGED": int(options.tail == "weighted-average"),
        }
        return frame.once(batch, self.kernel, {**options.constants, **constants})
