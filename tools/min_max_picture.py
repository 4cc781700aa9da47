"""Draws the min-max depth buffer after each pass of dual depth peeling: python tools/min_max_picture.py.

It peels the demo's scene by passes and copies the buffer from the device after each of them. It writes
docs/techniques/min-max.png, which docs/techniques.md shows: for each pass the nearest depths of what is left, and below
them the farthest. Pixels where nothing is left are white.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import clpeel
import clpeel.stages.frame
import clpeel.stages.passes
from clpeel.device.layout import BLOCK, BLOCKS_A_ROW, TILE, TILE_PIXELS
from clpeel.pictures.colormap import colors_at
from clpeel.scene.demo import DIRECTION, ZOOM, demo_scene

OUTPUT = Path(__file__).resolve().parent.parent / "docs" / "techniques" / "min-max.png"
SIZE = (176, 132)
COLUMNS = 6
"""Passes side by side in the picture."""

Buffer = NDArray[np.uint32]


def pixel_places(tiles: int, first_tile: int, width: int, height: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The row and the column in the picture of each pixel of some tiles, in the order of kernels/base/common.h."""
    tile, pixel = np.divmod(np.arange(tiles * TILE_PIXELS), TILE_PIXELS)
    block, in_block = np.divmod(pixel, BLOCK * BLOCK)
    tile_row, tile_column = np.divmod(first_tile + tile, -(-width // TILE))
    row = tile_row * TILE + block // BLOCKS_A_ROW * BLOCK + in_block // BLOCK
    column = tile_column * TILE + block % BLOCKS_A_ROW * BLOCK + in_block % BLOCK
    return row, column


class Watched(clpeel.stages.passes.Peeler):
    """A Peeler that copies its depth buffer after each pass.

    passes: for each pass the keys, uint32 [2, height, width], nearest and farthest.
    """

    passes: dict[int, Buffer] = {}

    def _blend(self, number: int) -> cl.Event:
        event = super()._blend(number)
        width, height = self.canvas.triangles.size
        if (width, height) != SIZE:
            return event  # the self-test draws a picture of its own before
        held: dict[str, Any] = self.held
        plane, pixels = held["plane"], held["strips"] * self.canvas.triangles.features.strip
        words = self.gpu.get(held["bounds"], (2, plane), np.uint64)[:, :pixels]
        first = int(held["screen"]["first_tile"]) + held["first_tile"]
        row, column = pixel_places(pixels // TILE_PIXELS, first, width, height)
        inside = (row < height) & (column < width)
        found = self.passes.setdefault(number, np.zeros((2, height, width), np.uint32))
        found[:, row[inside], column[inside]] = (words >> np.uint64(32)).astype(np.uint32)[:, inside]
        return event


def distances(keys: Buffer) -> NDArray[np.float64]:
    """Distances, in near planes, of depth keys (fragments/depth.h); infinite where a pixel has none."""
    depth = (~keys & np.uint32(0x7FFFFFFF)).view(np.float32).astype(np.float64)
    there = (keys != 0) & (keys != 0xFFFFFFFF)
    return np.divide(1.0, depth, out=np.full(keys.shape, np.inf), where=there)


def montage(passes: dict[int, Buffer]) -> Image.Image:
    """All passes in one picture, COLUMNS side by side."""
    found = [distances(passes[number]) for number in sorted(passes)]
    found = [one for one in found if np.isfinite(one).any()]
    seen = found[0][np.isfinite(found[0])]
    low, high = float(seen.min()), float(seen.max())
    width, height = SIZE
    rows = -(-len(found) // COLUMNS)
    picture = Image.new("RGB", (COLUMNS * width, rows * 2 * height), "white")
    draw = ImageDraw.Draw(picture)
    for number, both in enumerate(found):
        for half, one in enumerate(both):
            there = np.isfinite(one)
            rgb = np.ones((height, width, 3))
            rgb[there] = colors_at((one[there] - low) / (high - low))
            left, top = number % COLUMNS * width, (number // COLUMNS * 2 + half) * height
            picture.paste(Image.fromarray((rgb * 255 + 0.5).astype(np.uint8)), (left, top))
            draw.text((left + 4, top + 2), f"pass {number + 1}, {('nearest', 'farthest')[half]}", fill="black")
    return picture


def main() -> None:
    """Draw and write it."""
    scene = demo_scene()
    camera = clpeel.Camera.frame(scene, DIRECTION, aspect=SIZE[0] / SIZE[1]).zoom(ZOOM)
    vars(clpeel.stages.frame)["Peeler"] = Watched
    options: dict[str, Any] = {"background": "white", "lighting": "headlight", "samples": 1, "execution": "passes"}
    clpeel.render(scene, camera, SIZE, "dual-depth-peeling", **options)
    montage(Watched.passes).save(OUTPUT)


if __name__ == "__main__":
    main()
