"""Pictures as files: what is written is what was rendered."""

from __future__ import annotations

import io
import os

import numpy as np
import pytest
from PIL import Image

import clpeel
from clpeel.pictures.png import encode_png, save_png


@pytest.mark.parametrize("alpha", [255, 254])
def test_the_png_holds_the_picture(tmp_path, alpha):
    image = np.random.default_rng(0).integers(0, 256, (7, 11, 4), dtype=np.uint8)
    image[..., 3] = alpha
    save_png(tmp_path / "a.png", image)
    with Image.open(tmp_path / "a.png") as read:
        assert read.mode == ("RGB" if alpha == 255 else "RGBA")
        assert (np.asarray(read.convert("RGBA")) == image).all()
    assert os.listdir(tmp_path) == ["a.png"]


def test_encoding_is_repeatable():
    image = np.zeros((3, 3, 4), np.uint8)
    assert encode_png(image) == encode_png(image)
    assert Image.open(io.BytesIO(encode_png(image))).size == (3, 3)


@pytest.mark.parametrize("name", ["x.jpg", "x.PNGG", "x.npz"])
def test_a_png_under_another_name_is_refused(tmp_path, name):
    with pytest.raises(clpeel.InputError, match=r"^output: only PNG is written; expected a name ending in .png, got"):
        save_png(tmp_path / name, np.zeros((1, 1, 4), np.uint8))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["x", "x.PNG", ".png"])
def test_a_name_without_an_ending_is_as_good(tmp_path, name):
    save_png(str(tmp_path / name), np.zeros((1, 1, 4), np.uint8))
    assert os.listdir(tmp_path) == [name]
