"""Pictures as files: what is written is what was rendered, whole or not at all."""

from __future__ import annotations

import io
import os

import numpy as np
import pytest
from PIL import Image

import clpeel
from clpeel.image import encode_png, save_png, write_whole


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


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "a.png"
    target.write_bytes(b"old")

    def broken(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(clpeel.InputError, match=r"output: cannot write .*a\.png.*No space left"):
        write_whole(target, b"new")
    assert target.read_bytes() == b"old" and os.listdir(tmp_path) == ["a.png"]


@pytest.mark.parametrize("place", ["missing/a.png", "."])
def test_places_that_cannot_be_written(tmp_path, place):
    with pytest.raises(clpeel.InputError, match="output: cannot write"):
        write_whole(tmp_path / place, b"new")


def test_the_mode_is_that_of_any_new_file(tmp_path):
    write_whole(tmp_path / "a", b"1")
    (tmp_path / "b").write_bytes(b"1")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_a_special_file_is_written_through():
    write_whole(os.devnull, b"1")
    assert not os.path.isfile(os.devnull)
