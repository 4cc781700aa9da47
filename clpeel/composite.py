"""Composition: a layer of premultiplied colour and transmittance into the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device import Gpu
from clpeel.layout import TILE
from clpeel.program import launch, program
from clpeel.raster import Fragments

STAGE = "composition"


@dataclass(frozen=True)
class Layer:
    """What a technique makes of a window's fragments: float32 [tiles, TILE_PIXELS, 4], the premultiplied colour and
    the transmittance left behind it, 1 where there is nothing."""

    fragments: Fragments
    color: cl.Buffer


class Picture:
    """The picture being made: device memory where it is the host's own, filled tile by tile.

    image: uint8 [height, width, 4]; color: float32 [height, width, 4] premultiplied, or None where not wanted.
    """

    def __init__(self, gpu: Gpu, size: tuple[int, int], background: tuple[float, float, float] | None, keep_color: bool):
        width, height = size
        self.gpu = gpu
        self.size = size
        self.background = background
        self.image: NDArray[np.uint8] = np.empty((height, width, 4), np.uint8)
        self.color: NDArray[np.float32] | None = None
        # Where nothing is drawn: the background, rounded as composite.cl rounds it.
        empty = [0.0] * 4 if background is None else [*background, 1.0]
        self.image[...] = (np.array(empty, np.float32) * np.float32(255) + np.float32(0.5)).astype(np.uint8)
        if keep_color:
            self.color = np.zeros((height, width, 4), np.float32)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self._image = cl.Buffer(gpu.context, flags, hostbuf=self.image)
        self._color = None if self.color is None else cl.Buffer(gpu.context, flags, hostbuf=self.color)

    def put(self, layer: Layer) -> None:
        """Composites a layer over the background into its place."""
        fragments = layer.fragments
        red, green, blue = self.background or (0.0, 0.0, 0.0)
        launch(
            self.gpu,
            STAGE,
            program(self.gpu, "composite.cl", fragments.features)["composite"],
            fragments.tiles,
            self.gpu.lanes,
            layer=layer.color,
            first_tile=fragments.batch_tile + fragments.window_tile,
            columns=-(-self.size[0] // TILE),
            width=self.size[0],
            height=self.size[1],
            first_pixel=fragments.first_pixel,
            last_pixel=fragments.last_pixel,
            red=red,
            green=green,
            blue=blue,
            has_background=self.background is not None,
            keep_color=self._color is not None,
            image=self._image,
            color=self._color,
        )

    def finish(self) -> None:
        """Brings everything drawn to the host and lets go of the device's side."""
        for held, array in ((self._image, self.image), (self._color, self.color)):
            if held is None or array is None:
                continue
            mapped, _ = cl.enqueue_map_buffer(
                self.gpu.queue, held, cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=True
            )
            mapped.base.release(self.gpu.queue)
            self.gpu.queue.finish()
            held.release()
