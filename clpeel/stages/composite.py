"""Composition: the picture, in which layers (premultiplied colour and transmittance) are put over the background."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import DTypeLike, NDArray

from clpeel.checks import Background, shades_of
from clpeel.device.program import Arguments
from clpeel.device.samples import Pattern
from clpeel.device.workspace import Workspace
from clpeel.pictures.background import rows_of
from clpeel.scene.textures import linear
from clpeel.stages.shading import srgb_scales

Map = NDArray[Any]
"""A map [height, width] that a technique makes. Its dtype is that of its values."""

CACHE_LINE = 64
"""Bytes of a cache line of the device, or a multiple of that."""

ROW_BYTES = 16
"""Bytes of the background of a row on the device: a float4."""


FEW_BYTES = 1 << 18
"""Arrays of so many bytes are filled before they are drawn into, which takes some microseconds.

Memory may hold an earlier picture. A kernel that leaves out a part of the known layers (rendering/self_test.py) would
then show them whole."""


def _aligned(shape: tuple[int, ...], dtype: DTypeLike) -> Map:
    """An array that begins on a cache line. A device that writes to it directly then stores whole lines."""
    nbytes = int(np.prod(shape)) * np.dtype(dtype).itemsize
    held = np.empty(nbytes + CACHE_LINE, np.uint8)
    if nbytes <= FEW_BYTES:
        held.fill(0x5A)
    start = -held.ctypes.data % CACHE_LINE
    return held[start : start + nbytes].view(dtype).reshape(shape)


@dataclass(frozen=True, eq=False)
class Finished:
    """A picture after its technique's `finish`: the arrays of `Picture`, maps by name, and the technique's stats.

    image: uint8 [height, width, 4]. color: float32 [height, width, 4], premultiplied, or None. maps: [height, width].
    """

    image: NDArray[np.uint8]
    color: NDArray[np.float32] | None
    maps: dict[str, Map]
    stats: dict[str, object]


class Picture:
    """The picture that is being made. Its arrays are on the host, and the device fills them tile by tile.

    size: (width, height) in pixels. image: uint8 [height, width, 4]. color: float32 [height, width, 4], premultiplied,
    or None if it is not wanted. values: float32 [height, width, 1 or 4], other numbers that a technique finds (means
    over a pixel's samples), or None.
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
        """`values`, for techniques that find some. They must not be None."""
        assert self.values is not None
        return self.values

    def finished(
        self,
        maps: dict[str, Map] | None = None,
        stats: dict[str, object] | None = None,
        image: NDArray[np.uint8] | None = None,
        color: NDArray[np.float32] | None = None,
    ) -> Finished:
        """The finished picture, with a technique's maps and stats.

        image, color: replace what was drawn, if an image is given.
        """
        if image is None:
            image, color = self.image, self.color
        return Finished(image, color, maps or {}, stats or {})

    def _references(self) -> list[int]:
        arrays = [array for array in (self.image, self.color, self.values) if array is not None]
        return [sys.getrefcount(held) for array in arrays for held in (array, array.base)]

    def fits(self, size: tuple[int, int], keep_color: bool, numbers: int = 0) -> bool:
        """Whether the picture has this size, has a color if `keep_color`, and has `numbers` values a pixel."""
        kept = self.color is not None, 0 if self.values is None else self.values.shape[2]
        return self.size == size and kept == (keep_color, numbers)

    def is_free(self) -> bool:
        """Whether nobody else refers to its arrays or to a view of them. Only then may it be drawn over."""
        return self._references() == self._own_references

    def begin(self, pattern: Pattern, background: Background | None, as_light: bool = False) -> Arguments:
        """The arguments of a kernel that composites tiles into the picture (composite.h).

        pattern: a pixel is the mean of so many samples. background: None for straight alpha. as_light: whether
        colours are blended as linear light.
        """
        rows = None if background is None else self._rows(background, as_light)
        self._clamped = self.gpu.put("clamped", np.zeros(1, np.uint32))
        return {
            "side_bits": pattern.side_bits,
            "background": rows,
            "gradient": rows is not None and rows.size > ROW_BYTES,
            "scales": self.gpu.put("scales", srgb_scales()) if as_light else None,
            "clamped": self._clamped,
            "image": self._image,
            "color": self._color,
            "parameters": None,  # Canvas.arguments replaces it for techniques that have parameters
            "values": self._values,
        }

    def _rows(self, background: Background, as_light: bool) -> cl.Buffer:
        """The background of each row on the device: float32 [height, 4], or [1, 4] if it is no gradient."""
        height = self.size[1] if len(shades_of(background)) > 1 else 1
        rows = rows_of(background, height)[:, 0]
        rows = (linear(rows) if as_light else rows).astype(np.float32)
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self.gpu.context, flags, hostbuf=np.pad(rows, ((0, 0), (0, 1))))

    def fetch(self) -> int:
        """Waits for the device, and brings everything that was drawn to the host's arrays.

        Returns the number of clamped pixels: their alphas add up to more than one, so their colours were clamped.
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
