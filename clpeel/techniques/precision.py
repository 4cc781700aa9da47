"""Precision: how many bytes the buffers for blended colours have, and how much that rounds off (blending.h)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clpeel.options import SHARE, Options, option

PrecisionName = Literal["float32", "half", "unorm8"]

DEFAULT_PRECISION: PrecisionName = "float32"


@dataclass(frozen=True)
class Precision:
    """How a buffer stores a channel.

    channel_bytes: bytes of one channel. rounding: how far the stored value is from the float32 value at most, in 0..1.
    """

    channel_bytes: int
    rounding: float

    @property
    def color_bytes(self) -> int:
        """Bytes of red, green, blue and alpha."""
        return 4 * self.channel_bytes


PRECISIONS: dict[str, Precision] = {
    "float32": Precision(4, 0.0),
    "half": Precision(2, 2.0**-12),
    "unorm8": Precision(1, 0.5 / 255),
}
"""In the order of the kernels' numbers. The papers use unorm8 (RGBA8) for blended layers, and half for sums."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Blending(Options):
    """The options of all techniques that blend colours."""

    precision: PrecisionName = option(
        DEFAULT_PRECISION, help="of the buffers that colours are blended into, each blend rounded as hardware does"
    )

    @property
    def color_bytes(self) -> int:
        """Bytes of a colour in a buffer of this precision."""
        return PRECISIONS[self.precision].color_bytes

    @property
    def constants(self) -> dict[str, int]:
        """The constant of a kernel that blends into buffers of this precision; none for float32, the default."""
        number = list(PRECISIONS).index(self.precision)
        return {"PRECISION": number} if number else {}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Bounded(Blending):
    """The options of techniques that blend layers in order. They know how much the next layers could still change."""

    max_error: float | None = option(None, SHARE, help="skip layers that cannot change a channel by more; 0 is exact")


def blending_bound(layers: int, precision: str = DEFAULT_PRECISION) -> float:
    """How far off a channel may be after N layers, over any background, through rounding alone, in 0..1.

    float32 has 3 N + 4 roundings of 2^-24: of the layers' own products and sums, and of the merge. Coarser buffers
    also round the colour and the transmittance of each blend, by u at most. Let e be the error of one and f that of the
    other; over a background they add up to e + f. As e' <= (1 - a) e + u and f' <= f + a e + u for a layer of alpha a,
    the sum grows by 2 u a layer at most.
    """
    return (3 * layers + 4) * 2.0**-24 + 2 * layers * PRECISIONS[precision].rounding
