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
005b05a615f62f444ef771f094efb507cff9e482f273fa98fe73ffc0fffdffff
12850ea418c3307e4f8d72349509b50acff3e47cf26dfa94fe71ffc0fffcffff
38bb345830453bb9550374db9627b54ecfc9e426f215fa4ffe44ffa1ffedffff
5f5f5cb057385770642c7bdf98c2b59fcefee2f4f0e7f958fd8eff22ff83ff90
815f7fce7bf379427cd889a19e11b5e6ccd5dff1edecf6cafb76fd76fe46fe98
9d469c5399cf972896fa9c0ea771b7b3c9cbda96e7e8f15af727fa0ffb7cfc3d
b332b28db0c0ae74ace9add1b290bb5ac6fad3aedfbce91eefb3f3c9f634f7bb
c3efc362c1c9bf79bd16bb92bbf9bf04c53ecd91d645de5ce4fbe9e5ed62efe8
d07bcfe2ce18cb50c7ecc48dc20ac1bfc3cfc78ecc9ed236d7a1dc6de076e3d1
d9c9d909d6c3d31dce6dc94fc4e5c26cc10ec13cc2c1c553c88dcc10cf9dd311
e0a5dfabdcadd7d7d194cac0c53fc05cbc8db9dcb851b7e3b86eb9c6bbbdbe2f
e5b3e46de087da3ed233c9fec2ddbc21b62bb119acfaa9d8a7b0a678a620a694
e96fe7cee2d7dae5d0f6c797be83b5feae1ca6fda0ae9b3a96a692f2901b8e1c
ec33ea2ce3ffda3ace6fc399b8c0ae70a4c49bd293a68c4285aa7fda7ad07688
ee43ebcae448d891cb46be7fb1f3a5e69a8f8ffe863d7d4b75246dc16717611e
efd0ecdae3e7d62cc76eb8c5aa719cc18fe283e978dd6ebc657d5d1455734e8b
"""
_ALL = """
e2b3ffe4fffeffffffffffffffffffffffffffffffffffffffffffffffffffff
fadbe2b3f66dfdebff52ffb3ffd7ffe7fff1fffbfffcfffdfffefffeffffffff
fbb1f0b6e2afeb36f66afbbdfdeafeddff52ff91ffb6ffcdffdeffe4fff0ffff
fbd9f69dea28e29be6c1ef7cf657fa68fca5fde1fe97ff05ff49ff73ff88ff90
fbe7f8e0f098e718e257e493eac2f124f607f94dfb60fca8fd63fddefe50fe98
fbedf9ecf42aec38e504e18de2b2e6faec39f0eef478f738f945fa93fb8dfc3e
fbf0fa70f60cef88e857e269df57df80e216e615eab5eea3f1e6f468f64ef7bc
fbf1faacf6e8f122ea2ee33cdd95da30d9e3dc00df4ae336e719ea93ed84efea
fbf2fab7f710f15fea3ee286db46d615d353d291d3b8d63bd985dd1be09de3d3
fbf1faa1f6b6f091e8c3e01dd7f1d1afccadc988c835c885ca25ccb0cfc6d313
fbf0fa6ff5f5eeefe608dc48d3c0cbe2c547c018bc72ba5db9b7ba4fbbe4be32
fbeefa28f4e1eca4e250d7a4ce06c4e8bcc4b5cab017abbba8b2a6e9a642a697
fbecf9cef387e9ccddd9d25dc735bcbfb322aa89a3089ca9976c934b90388e1f
fbeaf964f1f0e683d8e6cc38bf9cb3b1a8a09e85956c8d57864180207ae8768b
fbe7f8ebf025e2ddd3e7c57db76caa089d8d921087967e1d75976df6672a6121
fbe4f865ee2ddeefcea6be84aedca0089239858179e56f5b65d45d3d55824e8e
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
