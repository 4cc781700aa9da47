"""Composition: the picture that layers of premultiplied colour and transmittance are put over a background in."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import DTypeLike, NDArray

from clpeel.checks import Rgb
from clpeel.device.workspace import Workspace

Map = NDArray[Any]
"""A map [height, width] that a technique makes, of whatever type its values have."""

CACHE_LINE = 64
"""Bytes that a device's cores read and write at once, or a multiple."""


def _aligned(shape: tuple[int, ...], dtype: DTypeLike) -> Map:
    """An array that begins on a cache line, so that a device which works in it stores whole lines."""
    nbytes = int(np.prod(shape)) * np.dtype(dtype).itemsize
    held = np.empty(nbytes + CACHE_LINE, np.uint8)
    start = -held.ctypes.data % CACHE_LINE
    return held[start : start + nbytes].view(dtype).reshape(shape)


@dataclass(frozen=True, eq=False)
class Finished:
    """A picture when its technique has made it of what was found: the arrays of `Picture`, maps by name, and stats."""

    image: NDArray[np.uint8]
    color: NDArray[np.float32] | None
    maps: dict[str, Map]
    stats: dict[str, object]


class Picture:
    """The picture being made, in the host's own arrays, which the device fills tile by tile.

    image: uint8 [height, width, 4]; color: float32 [height, width, 4] premultiplied, or None where not wanted;
    values: float32 [height, width, 1 or 4] that a technique finds besides, the means of a pixel's samples, or None.
    """

    def __init__(self, gpu: Workspace, size: tuple[int, int], keep_color: bool, numbers: int = 0):
        width, height = size
        self.gpu = gpu
        self.size = size
        self.image: NDArray[np.uint8] = _aligned((height, width, 4), np.uint8)
        self.color: NDArray[np.float32] | None = _aligned((height, width, 4), np.float32) if keep_color else None
        self.values: NDArray[np.float32] | None = _aligned((height, width, numbers), np.float32) if numbers else None
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self._image = cl.Buffer(gpu.context, flags, hostbuf=self.image)
        self._color = None if self.color is None else cl.Buffer(gpu.context, flags, hostbuf=self.color)
        self._values = None if self.values is None else cl.Buffer(gpu.context, flags, hostbuf=self.values)
        self._own_references = self._references()

    @property
    def found(self) -> NDArray[np.float32]:
        """`values`, of a technique that finds some."""
        assert self.values is not None
        return self.values

    def finished(
        self,
        maps: dict[str, Map] | None = None,
        stats: dict[str, object] | None = None,
        image: NDArray[np.uint8] | None = None,
        color: NDArray[np.float32] | None = None,
    ) -> Finished:
        """What a technique makes of the picture: maps, stats, and an image in place of the one that was drawn."""
        if image is None:
            image, color = self.image, self.color
        return Finished(image, color, maps or {}, stats or {})

    def _references(self) -> list[int]:
        arrays = [array for array in (self.image, self.color, self.values) if array is not None]
        return [sys.getrefcount(held) for array in arrays for held in (array, array.base)]

    def fits(self, size: tuple[int, int], keep_color: bool, numbers: int = 0) -> bool:
        """Whether it has this size and what is to be kept, `numbers` of `values`."""
        kept = self.color is not None, 0 if self.values is None else self.values.shape[2]
        return self.size == size and kept == (keep_color, numbers)

    def is_free(self) -> bool:
        """Whether nobody else holds its arrays, nor a view of them, so that it may be drawn over."""
        return self._references() == self._own_references

    def begin(self, side: int, background: Rgb | None) -> dict[str, cl.Buffer | float | None]:
        """The arguments of a kernel that composites tiles into it (composite.h).

        side: a pixel is the mean of side x side samples.
        """
        red, green, blue = background or (0.0, 0.0, 0.0)
        self._clamped = self.gpu.put("clamped", np.zeros(1, np.uint32))
        return {
            "side_bits": side.bit_length() - 1,
            "picture_width": self.size[0],
            "picture_height": self.size[1],
            "red": red,
            "green": green,
            "blue": blue,
            "has_background": background is not None,
            "keep_color": self._color is not None,
            "clamped": self._clamped,
            "image": self._image,
            "color": self._color,
            "parameters": None,  # of techniques that find values
            "values": self._values,
        }

    def fetch(self) -> int:
        """Brings everything drawn to the host.

        Returns in how many pixels the alphas added up to more than one, so that their colours had to be clamped.
        """
        for held, array in ((self._image, self.image), (self._color, self.color), (self._values, self.values)):
            if held is None or array is None:
                continue
            mapped, _ = cl.enqueue_map_buffer(
                self.gpu.queue, held, cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=True
            )
            mapped.base.release(self.gpu.queue)
        self.gpu.queue.finish()
        return int(self.gpu.get(self._clamped, 1, np.uint32)[0])
