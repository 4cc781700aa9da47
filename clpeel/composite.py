"""Composition: a batch's layer of premultiplied colour and transmittance into the picture."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.binning import Batch
from clpeel.device import Gpu
from clpeel.layout import TILE, Features
from clpeel.program import launch, program

STAGE = "composition"


class Picture:
    """The picture being made, in the host's own arrays, which the device fills tile by tile.

    image: uint8 [height, width, 4]; color: float32 [height, width, 4] premultiplied, or None where not wanted.
    side: a pixel is the mean of side x side samples.
    """

    def __init__(
        self,
        gpu: Gpu,
        size: tuple[int, int],
        side: int,
        background: tuple[float, float, float] | None,
        keep_color: bool,
    ):
        width, height = size
        self.gpu = gpu
        self.size = size
        self.side = side
        self.background = background
        self.image: NDArray[np.uint8] = np.empty((height, width, 4), np.uint8)
        self.color: NDArray[np.float32] | None = np.zeros((height, width, 4), np.float32) if keep_color else None
        # Where nothing is drawn: the background, rounded as composite.cl rounds it.
        empty = [0.0] * 4 if background is None else [*background, 1.0]
        pixel = (np.array(empty, np.float32) * np.float32(255) + np.float32(0.5)).astype(np.uint8)
        self.image.view(np.uint32)[...] = pixel.view(np.uint32)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self._image = cl.Buffer(gpu.context, flags, hostbuf=self.image)
        self._color = None if self.color is None else cl.Buffer(gpu.context, flags, hostbuf=self.color)

    def put(self, features: Features, batch: Batch, layer: cl.Buffer) -> None:
        """Composites a layer, float32 [tiles, TILE_PIXELS, 4], over the background into its place."""
        red, green, blue = self.background or (0.0, 0.0, 0.0)
        width, height = self.size
        launch(
            self.gpu,
            STAGE,
            program(self.gpu, "composite.cl", features)["composite"],
            batch.tiles,
            self.gpu.lanes,
            layer=layer,
            first_tile=batch.first_tile,
            columns=-(-width * self.side // TILE),
            side=self.side,
            width=width,
            height=height,
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
