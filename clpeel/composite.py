"""Composition: the picture that layers of premultiplied colour and transmittance are put over a background in."""

from __future__ import annotations

import sys

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device import Gpu
from clpeel.layout import TILE, Features
from clpeel.program import launch, program

STAGE = "composition"


class Picture:
    """The picture being made, in the host's own arrays, which the device fills tile by tile.

    image: uint8 [height, width, 4]; color: float32 [height, width, 4] premultiplied, or None where not wanted.
    """

    def __init__(self, gpu: Gpu, size: tuple[int, int], keep_color: bool):
        width, height = size
        self.gpu = gpu
        self.size = size
        self.image: NDArray[np.uint8] = np.empty((height, width, 4), np.uint8)
        self.color: NDArray[np.float32] | None = np.empty((height, width, 4), np.float32) if keep_color else None
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self._image = cl.Buffer(gpu.context, flags, hostbuf=self.image)
        self._color = None if self.color is None else cl.Buffer(gpu.context, flags, hostbuf=self.color)
        self._own_references = self._references()

    def _references(self) -> list[int]:
        return [sys.getrefcount(array) for array in (self.image, self.color) if array is not None]

    def fits(self, size: tuple[int, int], keep_color: bool) -> bool:
        """Whether it has this size and what is to be kept."""
        return self.size == size and (self.color is not None) == keep_color

    def is_free(self) -> bool:
        """Whether nobody else holds its arrays, nor a view of them, so that it may be drawn over."""
        return self._references() == self._own_references

    def begin(self, features: Features, side: int, background: tuple[float, float, float] | None) -> None:
        """Starts anew. side: a pixel is the mean of side x side samples."""
        width, height = self.size
        self.features = features
        self._columns = -(-width * side // TILE)
        self._tiles = self._columns * -(-height * side // TILE)
        self._done = 0  # tiles, from the first
        # Where nothing is drawn: the background, rounded as composite.cl rounds it.
        empty = [0.0] * 4 if background is None else [*background, 1.0]
        self._empty = (np.array(empty, np.float32) * np.float32(255) + np.float32(0.5)).astype(np.uint8).view(np.uint32)
        red, green, blue = background or (0.0, 0.0, 0.0)
        self._places = {
            "side_bits": side.bit_length() - 1,
            "keep_color": self._color is not None,
            "image": self._image,
            "color": self._color,
        }
        # What kernels that composite take (composite.h).
        self.target = {
            **self._places,
            "picture_width": width,
            "picture_height": height,
            "red": red,
            "green": green,
            "blue": blue,
            "has_background": background is not None,
            "clamped": self.gpu.put("clamped", np.zeros(1, np.uint32)),
        }

    def reach(self, first_tile: int, tiles: int) -> None:
        """Says that these tiles are drawn next; those before them that were not are cleared."""
        self._clear(first_tile)
        self._done = first_tile + tiles

    def _clear(self, end: int) -> None:
        """Fills the tiles before `end` that nothing was drawn in."""
        width, height = self.size
        first, self._done = self._done, end
        launch(
            self.gpu,
            STAGE,
            program(self.gpu, "composite.cl", self.features)["clear"],
            end - first,
            self.gpu.lanes,
            first_tile=first,
            columns=self._columns,
            width=width,
            height=height,
            empty=self._empty[0],
            **self._places,
        )

    def finish(self) -> int:
        """Completes what holds nothing, and brings everything drawn to the host.

        Returns in how many pixels the alphas added up to more than one, so that their colours had to be clamped.
        """
        self._clear(self._tiles)
        for held, array in ((self._image, self.image), (self._color, self.color)):
            if held is None or array is None:
                continue
            mapped, _ = cl.enqueue_map_buffer(
                self.gpu.queue, held, cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=True
            )
            mapped.base.release(self.gpu.queue)
        self.gpu.queue.finish()
        return int(self.gpu.get(self.target["clamped"], 1, np.uint32)[0])
