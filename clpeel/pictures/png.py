"""Pictures and maps as files: PNG and NumPy's."""

from __future__ import annotations

import io
import os

import numpy as np
from numpy.typing import NDArray

from clpeel.files import write_whole

STEP = 1 / 255
"""Between two neighbouring values of 8 bits. Colours no farther apart are at most one step apart when rounded."""


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """uint8 [height, width, 4] to the bytes of a PNG; without an alpha channel where every pixel is opaque."""
    from PIL import Image

    opaque = bool((image[..., 3] == 255).all())
    data = io.BytesIO()
    Image.fromarray(image[..., :3] if opaque else image).save(data, "PNG", compress_level=4)
    return data.getvalue()


def encode_map(numbers: NDArray[np.float32]) -> bytes:
    """float32 [height, width] to the bytes of a file that numpy.load reads."""
    data = io.BytesIO()
    np.save(data, numbers, allow_pickle=False)
    return data.getvalue()


def save_png(path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
    """Writes uint8 [height, width, 4], row 0 on top, as a PNG, whole or not at all; through a link, if path is one.

    Raises InputError when the place cannot be written, or its name ends in what is not .png.
    """
    write_whole(path, lambda file: file.write(encode_png(image)), ".png")
