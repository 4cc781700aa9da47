"""GIF: one palette for all frames of a film, so that nothing flickers from frame to frame.

There is no dithering. Dots that spread errors move from frame to frame, or lie over the model like a grid. With a
palette of the film's own colours, steps between these are hardly seen.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image

SAMPLES = 1 << 19
"""About how many pixels, of all frames together, the palette is made for."""

COLORS = 256

CHUNK = 1 << 14
"""How many different colours of a frame are compared with the palette at once."""


def encode(
    frame: Callable[[int], Image.Image], count: int, milliseconds: Sequence[int], report: Callable[[int], None]
) -> bytes:
    """Return a film as the bytes of a GIF that plays again and again.

    frame: returns frame k, RGB. milliseconds: of each frame, whole hundredths of a second. report: called with the
    number of each frame that is done.
    """
    palette = palette_of(frame, count)

    def frames() -> Iterator[Image.Image]:
        for k in range(count):
            yield in_palette(np.asarray(frame(k).convert("RGB")), palette)
            report(k)

    each = frames()
    first, data = next(each), io.BytesIO()
    # Without `palette`, each frame would get one of its own.
    options: dict[str, Any] = {"palette": bytes(palette.getpalette() or ()), "optimize": False, "loop": 0}
    options |= {"duration": list(milliseconds)} if count > 1 else {}
    first.save(data, "GIF", save_all=True, append_images=chain(each), **options)
    return data.getvalue()


def palette_of(frame: Callable[[int], Image.Image], count: int) -> Image.Image:
    """Return a picture with the palette of all frames. Their most frequent colour, such as a background's, is exact."""
    from PIL import Image

    found = np.concatenate([_some(np.asarray(frame(k).convert("RGB")), SAMPLES // count) for k in range(count)])
    colors, counts = np.unique(found.view("V3").reshape(-1), return_counts=True)
    most = colors[counts.argmax()].tobytes()
    others = found[(found != np.frombuffer(most, np.uint8)).any(axis=1)]
    best = b""
    if len(others):
        shown = Image.fromarray(others[None])
        made = shown.quantize(COLORS - 1, method=Image.Quantize.MEDIANCUT, kmeans=1, dither=Image.Dither.NONE)
        best = bytes(made.getpalette() or ())
    found_palette = Image.new("P", (1, 1))
    found_palette.putpalette(most + best[: 3 * (COLORS - 1)])
    return found_palette


def in_palette(pixels: NDArray[np.uint8], palette: Image.Image) -> Image.Image:
    """Return a picture with the nearest colour of the palette for each pixel of [height, width, 3].

    Pillow's own nearest colours are those of cubes with a side of 4. On smooth surfaces their steps go to and fro.
    """
    from PIL import Image

    colors = np.array(palette.getpalette(), np.float32).reshape(-1, 3)
    codes, places = np.unique(pixels.astype(np.int32) @ (1 << 16, 1 << 8, 1), return_inverse=True)
    nearest = np.empty(len(codes), np.uint8)
    for first in range(0, len(codes), CHUNK):
        part = codes[first : first + CHUNK]
        own = np.stack([part >> 16, part >> 8 & 255, part & 255], axis=1).astype(np.float32)
        # |own - color|^2, without |own|^2. All numbers are whole, and float32 holds them.
        nearest[first : first + CHUNK] = ((colors**2).sum(axis=1) - 2 * own @ colors.T).argmin(axis=1)
    found = Image.fromarray(nearest[places.reshape(pixels.shape[:2])])
    found.putpalette(palette.getpalette() or ())
    return found


def _some(pixels: NDArray[np.uint8], most: int) -> NDArray[np.uint8]:
    """Return about `most` pixels of [height, width, 3], spread evenly, or all: uint8 [n, 3]."""
    flat = pixels.reshape(-1, 3)
    step = max(len(flat) // max(most, 1), 1)
    step += step > 1 and step % 2 == 0  # an odd step reaches every column
    return np.ascontiguousarray(flat[::step])
