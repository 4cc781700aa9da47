"""Pictures and maps as files: PNG, and NumPy's format."""

from __future__ import annotations

import io
import os

import numpy as np
from numpy.typing import NDArray

from clpeel.files import write_whole

STEP = 1 / 255
"""The step between neighbouring 8-bit values. Colours that differ by at most this are at most one step apart once
rounded."""


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """Return uint8 [height, width, 4] as the bytes of a PNG, without an alpha channel if every pixel is opaque."""
    from PIL import Image

    opaque = bool((image[..., 3] == 255).all())
    data = io.BytesIO()
    Image.fromarray(image[..., :3] if opaque else image).save(data, "PNG", compress_level=4)
    return data.getvalue()


def encode_map(numbers: NDArray[np.float32]) -> bytes:
    """Return float32 [height, width] as the bytes of a file that numpy.load reads."""
    data = io.BytesIO()
    np.save(data, numbers, allow_pickle=False)
    return data.getvalue()


def save_png(path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
    """Write uint8 [height, width, 4], row 0 on top, as a PNG, whole or not at all.

    If path is a link, its target is written.

    Raises InputError if the place cannot be written, or if the name ends in anything but .png.
    """
    write_whole(path, lambda file: file.write(encode_png(image)), ".png")
