"""Images: the bytes of a picture file as the texels of a Texture."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.arrays import AnyArray
from clpeel.scene.textures import Texture


def texels(data: bytes) -> AnyArray:
    """Return the texels of a picture file, [height, width, 4] as in Texture: uint8, or float32 for 16 bits a channel.

    Raises ValueError, with the reason in words for a note, if the bytes are not a picture that can be read.
    """
    from PIL import Image

    with Image.open(io.BytesIO(data)) as image:
        pixels: NDArray[np.uint8] = np.asarray(image.convert("RGBA"))
    return Texture.of(pixels).image
