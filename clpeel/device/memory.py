"""Memory: how much of the device's memory a render may use, and for what."""

from __future__ import annotations

from dataclasses import dataclass

from clpeel.checks import MIN_MEMORY
from clpeel.device.workspace import Workspace

MOST_LISTED = 2**31
"""The most bytes of a batch's lists. Places in them are then below 2**29, so they fit signed 32 bits (comparing.h)."""

MAX_PLACES = 2**31 - 1
"""The most fragments in a buffer. Their places must fit signed 32 bits, as kernels scatter vectors (common.h)."""

DEFAULT_MEMORY_SHARE = 4
"""By default a render may use 1 / n of the device's memory that the scene leaves free."""

BATCH_SHARE = 4
"""A batch's lists and tiles take at most 1 / n of the budget. The rest is for its fragments."""


@dataclass(frozen=True)
class Budget:
    """How many bytes of the device's memory a render may use besides its scene and triangles.

    largest: the most bytes that the device gives in one buffer.
    """

    nbytes: int
    largest: int

    @classmethod
    def of(cls, gpu: Workspace, limit: int | None, held: int) -> Budget:
        """limit: bytes that the user allows, or None for a share of the device's. held: bytes of scene and triangles.

        The budget has at least MIN_MEMORY bytes.
        """
        left = (int(gpu.device.global_mem_size) - held) // DEFAULT_MEMORY_SHARE if limit is None else limit - held
        return cls(max(left, MIN_MEMORY), int(gpu.device.max_mem_alloc_size))

    @property
    def lists(self) -> int:
        """Bytes for the lists of records in tiles."""
        return self.nbytes // BATCH_SHARE

    @property
    def batch(self) -> int:
        """The most bytes that the lists of one batch may take."""
        return min(self.lists, self.largest, MOST_LISTED)

    @property
    def drawing(self) -> int:
        """Bytes for a batch's fragments, and for buffers of its pixels."""
        return self.nbytes - self.lists

    def capacity(self, fragment_bytes: int, widest: int) -> int:
        """How many fragments there is room for.

        fragment_bytes: of one fragment, in all buffers together. widest: of one fragment, in the largest buffer.
        """
        return min(self.drawing // fragment_bytes, self.largest // widest, MAX_PLACES)
