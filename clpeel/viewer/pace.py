"""The pace: which resolution keeps a frame within its time while the hand moves."""

from __future__ import annotations

import math
from collections.abc import Hashable

FRAME = 0.040
"""The most seconds that a frame may take while the hand moves."""

AIM = 0.012
"""The seconds that a reduced frame aims at. A hand that moves just after a frame has begun waits for two of them."""

SHARP = 0.015
"""A frame that takes at most so many seconds at full resolution is not reduced."""

LEAST_SHARE = 1 / 3
"""The least share of AIM that pixels are given. Fewer would hardly be faster if all else takes so long already."""

LEAST = 1 / 16
"""The least scale: the width of a frame, as a share of the full picture's."""

FIRST = 100_000
"""Pixels of the first frame of a kind, when nothing is known about its time."""

STEPS = 8
"""Scales are 2^(-n / STEPS). Nearby scales are made one, so that buffers are not made anew for each frame."""


class Pace:
    """Learns the seconds of a frame: those that it takes however small it is, and those of a pixel.

    Each kind of frame (a technique with its options, say) has its own seconds of a pixel.
    """

    def __init__(self) -> None:
        self._fixed: dict[Hashable, float] = {}
        self._pixel: dict[Hashable, float] = {}
        self._seen: set[Hashable] = set()

    def scale(self, kind: Hashable, pixels: int) -> float:
        """Return the scale of the next frame, in LEAST..1. pixels: those of the full picture."""
        if kind not in self._pixel:
            return self._stepped(math.sqrt(FIRST / pixels))
        fixed, each = self._fixed[kind], self._pixel[kind]
        if fixed + each * pixels <= SHARP:
            return 1.0
        most = max(AIM - fixed, AIM * LEAST_SHARE) / each
        return self._stepped(math.sqrt(most / pixels))

    def _stepped(self, scale: float) -> float:
        if scale >= 1:
            return 1.0
        return max(2 ** (math.floor(math.log2(scale) * STEPS) / STEPS), LEAST)

    def learn(self, kind: Hashable, pixels: int, fixed: float, rest: float) -> None:
        """Take note of a frame's seconds. rest: those of drawing its pixels. fixed: all others.

        The first frame of a kind teaches nothing, as it may have compiled kernels. A slower frame counts by two thirds,
        so that the next ones are in time, but as no more than three times as slow: it may have been held up by others.
        A faster one counts by a third.
        """
        if kind not in self._seen:
            self._seen.add(kind)
            return
        for known, value in ((self._fixed, fixed), (self._pixel, rest / pixels)):
            old = known.get(kind, value)
            value = min(value, 3 * old)
            known[kind] = old + (value - old) * (2 / 3 if value > old else 1 / 3)
