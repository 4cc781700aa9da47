"""Albedo: how much of even light one reflection of a rough surface returns (kernels/shading/lights.h).

tools/albedo_table.py computes the numbers: 65535 for 1, row by row, for a roughness of 0, 1/15, .. 1. In a row the root
of the cosine between the normal and the view is 0, 1/15, .. 1. Linear interpolation is right to 1 % where that cosine
is 0.03 or more.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import ALBEDO_SIDE

_ANY = """
009105a815f72f444ef771f094f0b507cff9e482f273fa98fe73ffc0fffdffff
1688105a194730bb4faf724a9517b514cff9e47cf26cfa93fe6fffbefffbfffe
3cb5377531e73c88557475229653b56ccfdce432f21cfa51fe40ff9effe3ffea
634b6023598e58d564f87c569907b5c5cf0fe2f7f0e1f94bfd7dff11ff77ff90
854a834b7e7b7add7dc08a159e3eb5e8ccbddfccedc3f6a8fb6ffd83fe40fe8c
a1309fb79c31988c97989c29a742b762c977da5ce7f1f16af71ffa16fb7ffc3d
b71ab5c4b2caaf5fad00ad6eb206baebc6e2d3d5dfb4e920efb0f3c8f635f7b9
c7d5c668c36fbfe2bcb3bae8bb7dbf04c554cd86d64ade60e4fae9e4ed62efe8
d460d2bccf58cb49c743c3f2c1f8c1d8c3c5c78dcc9ed236d7a1dc6de076e3d1
ddabdbb3d7a3d2bfcdb3c902c51cc260c10fc13bc2c2c553c88dcc11cf9dd311
e486e221dd35d73fd0f6cad6c539c065bc90b9dbb851b7e3b86eb9c6bbbdbe2f
e991e6ade0c0d987d1d3ca27c2d7bc20b62bb118acfaa9d8a7b0a678a620a694
ed4ae9d8e2cada29d0e6c791be85b5fcae1ca6fda0ae9b3a96a692f2901b8e1c
f00bec03e3b8d991cea2c390b8c0ae70a4c49bd293a68c4285aa7fda7ad07688
f218ed6ee3d2d80fcb62be87b1f2a5e79a8f8ffe863d7d4b75246dc16717611e
f3a2ee4ae34ed5dec768b8c2aa709cc18fe283e978dd6ebc657d5d1455734e8b
"""
_ALL = """
e45effeefffeffffffffffffffffffffffffffffffffffffffffffffffffffff
fecae45ef6ecfe23ff71ffc7ffe4fff0fff6fff9fffbfffcfffdfffdfffdfffe
ffb1f3d7e452ec05f6dbfc04fe17fefbff65ff9dffbcffceffdaffe1ffe6ffea
ffdcfa22ec88e403e78eeff3f69cfa8efcb6fde5fe91fef8ff37ff61ff7cff90
ffeafc6ff328e8b4e33ee505eaedf125f5eff927fb37fc86fd5dfdebfe4afe8c
fff0fd5ff691ed9be5a0e1a7e283e6a9ebe6f0b5f481f748f93dfa9bfb90fc3e
fff1fdb5f818f072e86ce206deccdf12e1fde63ceaadeea5f1e3f467f64ef7ba
fff1fdbdf88ef187e9cae292dd19da30d9fadbf5df4fe339e718ea93ed84efe9
ffeffd9af84ef155e995e1ebdb35d62ed348d290d3b8d63ad986dd1be09de3d3
ffecfd51f793f032e80adfd0d828d1a2ccaec988c835c885ca25ccb0cfc6d313
ffe9fcebf67aee57e56adc5ed3b9cbeac54ac017bc73ba5cb9b7ba4fbbe4be32
ffe4fc6cf517ebede1f0d7cdce01c4e7bcc4b5cab018abbba8b2a6e9a642a697
ffdffbdaf378e910ddc8d257c737bcbeb322aa89a3089ca9976c934b90388e1f
ffd9fb3cf1a7e5dad919cc2fbf9cb3b1a8a09e85956c8d57864180207ae8768b
ffd3fa8fefaee25ad403c585b76baa089d8d921087967e1d75976df6672a6121
ffccf9d4ed94dea2ce9fbe80aedba0089239858179e56f5b65d45d3d55824e8e
"""


@cache
def albedo_tables() -> NDArray[np.float32]:
    """Return what is returned of light that f0 is multiplied with, and of all light if f0 is 1: float32 [2, 16, 16]."""
    words = "".join((_ANY + _ALL).split())
    found = np.frombuffer(bytes.fromhex(words), ">u2").reshape(2, ALBEDO_SIDE, ALBEDO_SIDE) / 65535
    return found.astype(np.float32)


def albedo_of(roughness: float) -> NDArray[np.float32]:
    """Return both rows for a roughness 0..1: float32 [2, 16]."""
    place = roughness * (ALBEDO_SIDE - 1)
    row = min(int(place), ALBEDO_SIDE - 2)
    low, high = albedo_tables()[:, row].astype(np.float64), albedo_tables()[:, row + 1].astype(np.float64)
    return (low + (place - row) * (high - low)).astype(np.float32)
