"""moments: a few moments of a pixel's absorbance say how much of each fragment is seen (techniques/moments.cl).

Muenstermann, Krumpen, Klein and Peters 2018, "Moment-Based Order-Independent Transparency" (PACMCGIT 1, 1). Biases and
quantization are those of the paper's supplement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.options import SHARE, option
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.projection import Triangles
    from clpeel.stages.tiles import Drawn

MomentsName = Literal["4", "6", "8", "trigonometric"]
StoredAs = Literal["single", "quantized"]


@dataclass(frozen=True)
class Bias:
    """How far moments are moved, and where to: towards the moments of an even spread.

    amount: the share of it. even: its moments of even order, 2, 4, ... All others are 0.
    """

    amount: float
    even: tuple[float, ...] = ()

    def moments(self, count: int) -> list[float]:
        """The moments that are added, 1 to `count`: the even spread's, times the amount."""
        added = [0.0] * count
        added[1::2] = [self.amount * each for each in self.even] or added[1::2]
        return added


BIASES: dict[tuple[MomentsName, StoredAs], Bias] = {
    ("4", "single"): Bias(5e-7, (0.375, 0.375)),
    ("6", "single"): Bias(5e-6, (0.48, 0.451, 0.45)),
    ("8", "single"): Bias(5e-5, (0.75, 0.67666666666666664, 0.63, 0.60030303030303034)),
    ("trigonometric", "single"): Bias(4e-7),
    ("4", "quantized"): Bias(6e-5, (0.628, 0.628)),
    ("6", "quantized"): Bias(6e-4, (0.5566, 0.489, 0.47869382)),
    ("8", "quantized"): Bias(
        2.5e-3, (0.42474916387959866, 0.22407802675585284, 0.15369230769230768, 0.12900440529089119)
    ),
    ("trigonometric", "quantized"): Bias(4e-4),
}


@dataclass(frozen=True)
class Mixing:
    """How power moments are mixed before they are stored in 16 bits: so that each mixture fills 0 to 1.

    odd, even: the matrices of the moments of odd and of even order. offsets: what is added, by order.
    """

    odd: tuple[tuple[float, ...], ...]
    even: tuple[tuple[float, ...], ...]
    offsets: tuple[float, ...]


_ROOT = math.sqrt(3.0)

MIXINGS: dict[MomentsName, Mixing] = {
    "4": Mixing(((1.5, -2.0), (_ROOT / 2, -2 * _ROOT / 9)), ((4.0, -4.0), (0.5, 0.5)), (0.5, 0.0, 0.5, 0.0)),
    "6": Mixing(
        (
            (2.5, -10.0, 8.0),
            (-1.87499864450, 4.20757543111, -1.83257678661),
            (1.26583039016, -1.47644882902, 0.71061660238),
        ),
        ((4.0, -4.0, 0.0), (9.0, -24.0, 16.0), (-0.57759806484, 4.61936647543, -3.07953906655)),
        (0.5, 0.0, 0.5, 0.0, 0.5, 0.018888946),
    ),
    "8": Mixing(
        (
            (3.48044635732474, -27.5760737514826, 55.1267384344761, -31.5311110403183),
            (1.26797185782836, -0.928755808743913, -2.07520453231032, 1.23598848322588),
            (-2.1671560004294, 6.17950199592966, -0.276515571579297, -4.23583042392097),
            (0.974332879165755, -0.443426830933027, -0.360491648368785, 0.310149466050223),
        ),
        (
            (0.280504133158527, -0.757633844606942, 0.392179589334688, -0.887531871812237),
            (-2.01362265883247, 0.221551373038988, -1.06107954265125, 2.83887201588367),
            (-7.31010494985321, 13.9855979699139, -0.114305766176437, -7.4361899359832),
            (-15.8954215629556, 79.6186327084103, -127.457278992502, 63.7349456687829),
        ),
        (0.5, 0.972481993925964, 0.5, 1.0, 0.5, 0.999179192513328, 0.5, 0.991778293073131),
    ),
}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MomentsOptions(Blending):
    """The options of moments.

    moments: how many power moments are kept besides the total absorbance, or "trigonometric" for two complex moments,
    which are four numbers, too. moment_precision: "single" keeps them as float32, "quantized" in 16 bits each.
    overestimation: of the absorbance that may or may not lie in front of a fragment, the share that is taken to. With 0
    fragments look too bright, with 1 too dark.
    """

    moments: MomentsName = option(
        "4", help="of moments: how many power moments, or two trigonometric ones (default: 4)"
    )
    moment_precision: StoredAs = option("single", help="of moments: store them as float32, or in 16 bits each")
    overestimation: float = option(
        0.25, SHARE, help="of moments: how much of what may hide a fragment does (default: 0.25)"
    )

    @property
    def numbers(self) -> int:
        """How many numbers the moments are, besides the total absorbance."""
        return 4 if self.moments == "trigonometric" else int(self.moments)


class Moments(Technique[MomentsOptions]):
    """Reconstructs from moments how much of each fragment is seen."""

    name = "moments"
    summary = "fast, not exact: a mean of all colours by how much of each is seen, which a few moments tell"
    kernel = "techniques/moments.cl"
    options = MomentsOptions
    least_passes = 1
    paper_precision = "half"
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: MomentsOptions) -> int:
        """All fragments of a sample. They are stored, as they are gone through twice."""
        return FRAGMENT_BYTES * layers

    def compared(self) -> tuple[MomentsOptions, ...]:
        """The other moments."""
        others: tuple[MomentsName, ...] = ("6", "8", "trigonometric")
        return tuple(MomentsOptions(moments=each) for each in others)

    def draw(self, frame: Frame, batch: Batch, options: MomentsOptions) -> Drawn:
        """Draws the batch in one geometry pass, whose fragments it goes through twice."""
        constants = {
            **({"MOMENTS": options.numbers} if options.numbers != 4 else {}),
            "TRIGONOMETRIC": int(options.moments == "trigonometric"),
            "QUANTIZED": int(options.moment_precision == "quantized"),
            "PERSPECTIVE": int(frame.triangles.perspective),
        }
        numbers = (
            *places_of(frame.triangles),
            options.overestimation,
            *biased_by(options),
            *(mixed_by(options.moments) if options.moment_precision == "quantized" else ()),
        )
        return frame.once(batch, self.kernel, {**options.constants, **constants}, parameters=numbers)


def places_of(triangles: Triangles) -> tuple[float, float, float, float]:
    """The kernel's first parameters: what makes places from -1 to 1 of reversed depths (moments.cl)."""
    near, far = triangles.clipping
    first, last = triangles.window
    if triangles.perspective:  # depth is near / distance, and the place -1 - 2 ln(first / distance) / ln(last / first)
        return triangles.depth_scale, -1.0, 2 / math.log(last / first), first / near
    span = last - first  # the distance is far - (far - near) depth
    return triangles.depth_scale, 2 * (far - first) / span - 1, -2 * (far - near) / span, 0.0


def biased_by(options: MomentsOptions) -> Sequence[float]:
    """The factor of moments, and what is added to each of them."""
    bias = BIASES[options.moments, options.moment_precision]
    return [1 - bias.amount, *bias.moments(options.numbers)]


def mixed_by(moments: MomentsName) -> Sequence[float]:
    """The offsets, and the matrices of odd and even moments there and back; nothing of trigonometric ones."""
    import numpy as np

    if moments == "trigonometric":
        return []
    mixing = MIXINGS[moments]
    there = np.array([mixing.odd, mixing.even])
    return [*mixing.offsets, *there.ravel().tolist(), *np.linalg.inv(there).ravel().tolist()]
