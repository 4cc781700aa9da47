"""Pictures as files: what is written is what was rendered."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from clpeel.pictures.png import encode_png


@pytest.mark.parametrize("alpha", [255, 254])
def test_the_png_holds_the_picture(alpha):
    image = np.random.default_rng(0).integers(0, 256, (7, 11, 4), dtype=np.uint8)
    image[..., 3] = alpha
    with Image.open(io.BytesIO(encode_png(image))) as read:
        assert read.mode == ("RGB" if alpha == 255 else "RGBA")
        assert (np.asarray(read.convert("RGBA")) == image).all()


def test_encoding_is_repeatable():
    image = np.zeros((3, 3, 4), np.uint8)
    assert encode_png(image) == encode_png(image)
    assert Image.open(io.BytesIO(encode_png(image))).size == (3, 3)
