"""Memory: how a render's share of the device's memory is spent."""

from __future__ import annotations

from dataclasses import dataclass

from clpeel.checks import MIN_MEMORY
from clpeel.device.workspace import Workspace

MOST_LISTED = 2**31
"""Bytes of a batch's lists: places in them are below 2**29, and so signed numbers of 32 bits (comparing.h)."""

MAX_PLACES = 2**31 - 1
"""The most fragments in a buffer: their places are signed where vectors are scattered (common.h)."""

DEFAULT_MEMORY_SHARE = 4
"""By default a render may use this fraction (1 / n) of what a scene leaves of the device's memory."""

BATCH_SHARE = 4
"""A batch's lists and tiles take at most this fraction (1 / n) of the budget; its fragments have the rest."""


@dataclass(frozen=True)
class Budget:
    """Bytes of the device's memory that a render may use besides its scene and triangles.

    largest: what the device gives in one buffer.
    """

    nbytes: int
    largest: int

    @classmethod
    def of(cls, gpu: Workspace, limit: int | None, held: int) -> Budget:
        """limit: what the user allows, of which scene and triangles take `held`; None for a share of the device's."""
        left = (int(gpu.device.global_mem_size) - held) // DEFAULT_MEMORY_SHARE if limit is None else limit - held
        return cls(max(left, MIN_MEMORY), int(gpu.device.max_mem_alloc_size))

    @property
    def lists(self) -> int:
        """The part that lists of triangles in tiles have."""
        return self.nbytes // BATCH_SHARE

    @property
    def batch(self) -> int:
        """The most that one batch's lists may take."""
        return min(self.lists, self.largest, MOST_LISTED)

    def capacity(self, fragment_bytes: int, widest: int) -> int:
        """How many fragments there is room for, of so many bytes each, whose largest buffer has `widest` of them."""
        return min((self.nbytes - self.lists) // fragment_bytes, self.largest // widest, MAX_PLACES)
