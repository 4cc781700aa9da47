"""Known masks: which samples fragments cover by chance, computed again for the known layers (techniques/stochastic.cl).

The random numbers are hashes of whole numbers, so they are the same here. What is not is an alpha that a device has
interpolated: where a little more or less of it would cover one sample more or less, nobody knows the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Words = NDArray[np.uint32]

GOLDEN = np.uint32(0x9E3779B9)
DOUBT = 2.0**-16
"""How far an alpha may be off. It is much more than it is."""


@dataclass(frozen=True)
class Masks:
    """Of each fragment and sample: the share of the mask that nothing nearer covers [samples, layers], and that which
    is left behind all [samples]; and whether an alpha leaves in doubt what it covers [samples].
    """

    visible: Floats
    left: Floats
    doubtful: NDArray[np.bool_]


def _hash(number: Words) -> Words:
    number = (number ^ number >> np.uint32(16)) * np.uint32(0x7FEB352D)
    number = (number ^ number >> np.uint32(15)) * np.uint32(0x846CA68B)
    return number ^ number >> np.uint32(16)


def masks_of(alpha: Floats, width: int, count: int) -> Masks:
    """The masks of alphas [samples, layers], the nearest first, in a picture that is `width` samples wide, row by row.

    count: of samples in a mask. Layers that are not there have alpha 0, and lie behind all others.
    """
    number = np.arange(len(alpha), dtype=np.uint32)
    place = _hash(number % np.uint32(width) | number // np.uint32(width) << np.uint32(16))
    covered = np.zeros((len(alpha), count), bool)
    visible, doubtful = np.empty_like(alpha), np.zeros(len(alpha), bool)
    for rank in range(alpha.shape[1]):
        visible[:, rank] = 1 - covered.mean(axis=1)
        seed = _hash(place ^ np.uint32(rank * int(GOLDEN) & 0xFFFFFFFF))
        chance = (_hash(seed) >> np.uint32(8)) / 2.0**24
        share = np.floor(np.clip(alpha[:, rank], 0, 1).astype(np.float32) * 2.0**24) / 2.0**24
        wanted = share * count + chance
        exact = (alpha[:, rank] == 0) | (alpha[:, rank] == 1)
        doubtful |= (np.abs(wanted - np.round(wanted)) < count * DOUBT) & ~exact
        to_choose = np.floor(wanted)
        for sample in range(count):
            seed = seed + GOLDEN
            taken = ((_hash(seed) >> np.uint32(8)) * np.uint32(count - sample) >> np.uint32(24)) < to_choose
            to_choose -= taken
            covered[:, sample] |= taken
    return Masks(visible, 1 - covered.mean(axis=1), doubtful)
