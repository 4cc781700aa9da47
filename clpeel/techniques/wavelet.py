"""wavelet: what lies in front of a fragment absorbs light, as a sum of Haar wavelets says (techniques/wavelet.cl).

C = sum(wi Ci) / sum(wi) (1 - R) + C0 R, where wi = Ai e^-A(xi), R is the product of all 1 - Ai, and A(x) approximates
the sum of -ln(1 - Aj) over the fragments in front of x (Aizenshtein, Smal and McGuire 2022, "Wavelet Transparency").
The sums are taken in submission order.
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

RankName = Literal[2, 3]
RangeName = Literal["pixel", "scene"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WaveletOptions(Blending):
    """The options of wavelet.

    wavelet_rank: the finest level of wavelets. Levels 0 to r resolve depths into 2^(r + 1) cells. wavelet_range: where
    these cells lie. "pixel" spreads them from the nearest to the farthest fragment of each pixel, "scene" from the near
    to the far clipping plane.
    """

    wavelet_rank: RankName = option(
        3, help="of wavelet: its finest level; 2 has 8 cells of depth, 3 has 16 (default: 3)"
    )
    wavelet_range: RangeName = option(
        "pixel", help="of wavelet: cells lie between each pixel's first and last layer, or the clipping planes"
    )


class Wavelet(Technique[WaveletOptions]):
    """Weighs each layer by what the wavelets say comes through to it."""

    name = "wavelet"
    summary = "fast, not exact: layers hide each other as a sum of wavelets over depth says; coverage is exact"
    kernel = "techniques/wavelet.cl"
    options = WaveletOptions
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: WaveletOptions) -> int:
        """All fragments of a sample. They are stored until they can be added up in the order of submission."""
        return FRAGMENT_BYTES * layers

    def compared(self) -> tuple[WaveletOptions, ...]:
        """Fewer wavelets than the default."""
        return (WaveletOptions(wavelet_rank=2),)

    def draw(self, frame: Frame, batch: Batch, options: WaveletOptions) -> Drawn:
        """Draws the batch, whose fragments are stored in one geometry pass and gone through twice."""
        triangles = frame.triangles
        near, far = triangles.clipping
        constants = {
            "WAVELET_RANK": options.wavelet_rank,
            "PIXEL_RANGE": int(options.wavelet_range == "pixel"),
            "PERSPECTIVE": int(triangles.perspective),
        }
        parameters = (1.0, near / far if triangles.perspective else 0.0, triangles.depth_scale)
        return frame.once(batch, self.kernel, {**options.constants, **constants}, parameters=parameters)
