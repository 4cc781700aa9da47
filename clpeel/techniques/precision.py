"""Blending: the precisions of the buffers that colours are blended into (blending.h)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from clpeel.errors import InputError


@dataclass(frozen=True)
class Precision:
    """How a buffer keeps a channel: in how many bytes, and how far off that is from a float32 at most, of 0..1."""

    channel_bytes: int
    rounding: float

    @property
    def color_bytes(self) -> int:
        """Of red, green, blue and alpha."""
        return 4 * self.channel_bytes


PRECISION = "precision"
"""Option of all that blend colours."""

PRECISIONS = {
    "float32": Precision(4, 0.0),
    "half": Precision(2, 2.0**-12),
    "unorm8": Precision(1, 0.5 / 255),
}
"""In the order of the kernels' numbers. The papers' are unorm8 (RGBA8) where layers are blended, half for sums."""

DEFAULT_PRECISION = "float32"


def check_precision(precision: str = DEFAULT_PRECISION) -> None:
    """InputError where there is none of that name."""
    if precision not in PRECISIONS:
        raise InputError(f"precision: expected one of {', '.join(PRECISIONS)}; got {precision!r}")


def precision_define(precision: str = DEFAULT_PRECISION) -> dict[str, Any]:
    """The constant of a kernel that blends into buffers of that precision (PRECISIONS, else InputError)."""
    check_precision(precision)
    number = list(PRECISIONS).index(precision)
    return {"PRECISION": number} if number else {}


def color_bytes(options: dict[str, Any]) -> int:
    """Bytes of a colour in a buffer, with these options of a technique."""
    return PRECISIONS[options.get(PRECISION, DEFAULT_PRECISION)].color_bytes


def blending_bound(layers: int, precision: str = DEFAULT_PRECISION) -> float:
    """How far off a channel may be, over any background, after so many layers, by rounding alone.

    float32: 3 N + 4 roundings of 2^-24, of the layers' own products and sums, and of the merge. Coarser buffers round
    the colour and the transmittance of each blend: the errors e of one and f of the other, together over a background
    e + f, grow by two roundings a layer at most, as e' <= (1 - a) e + u and f' <= f + a e + u.
    """
    return (3 * layers + 4) * 2.0**-24 + 2 * layers * PRECISIONS[precision].rounding
