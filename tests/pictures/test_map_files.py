"""Maps as files: the numbers themselves, or levels that stand for them as the line says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
import plainly
import pytest
import tifffile
from crossing import SIZE, scene
from PIL import Image

import clpeel

MAPS = ("depth", "normal", "triangle", "layer_count", "transmittance")


@pytest.fixture(scope="module")
def result() -> clpeel.Result:
    return plainly.render(scene(), size=SIZE, maps=MAPS)


@pytest.mark.parametrize("name", MAPS)
def test_arrays_and_floats_hold_the_numbers(result: clpeel.Result, name: str, tmp_path: Path) -> None:
    want = result.map(name)
    for suffix in ("npy", "npz", "tif", "exr"):
        assert result.save_map(name, tmp_path / f"x.{suffix}") is None
    read = np.load(tmp_path / "x.npy")
    assert read.dtype == want.dtype and np.array_equal(read, want)
    with np.load(tmp_path / "x.npz") as file:
        assert np.array_equal(file[name], want)
    read = tifffile.imread(tmp_path / "x.tif")
    assert read.dtype == want.dtype and np.array_equal(read, want)
    image = OpenImageIO.ImageInput.open(str(tmp_path / "x.exr"))
    channels = {"depth": ("Z",), "triangle": ("id",), "normal": ("normal.X", "normal.Y", "normal.Z")}
    assert image.spec().channelnames == channels.get(name, (name,))
    if name == "triangle":
        assert np.array_equal(image.read_image(OpenImageIO.UINT)[..., 0].astype(np.int32), want)
        assert (want == -1).any()
    else:
        assert np.array_equal(image.read_image(OpenImageIO.FLOAT).reshape(want.shape), want)


def levels(path: Path) -> np.ndarray:
    with Image.open(path) as file:
        return np.asarray(file).astype(np.float64)


def test_levels_of_a_png_stand_for_the_numbers(result: clpeel.Result, tmp_path: Path) -> None:
    path = tmp_path / "x.png"
    assert result.save_map("layer_count", path) is None
    assert (levels(path) == result.layer_count).all() and levels(path).max() == 3
    assert result.save_map("triangle", path) == "triangle: 0 is none, n + 1 is face n"
    assert (levels(path) == result.triangle + 1.0).all()
    assert result.save_map("transmittance", path) == "transmittance: 0 is 0, 65535 is 1"
    assert np.abs(levels(path) / 65535 - result.transmittance).max() <= 0.5 / 65535 + 1e-9
    assert "black where there is no face" in str(result.save_map("normal", path))
    there = result.triangle >= 0
    assert np.abs(levels(path) / 255 * 2 - 1 - result.normal)[there].max() <= 1 / 255 + 1e-6
    assert (levels(path)[~there] == 0).all()


def test_depths_in_a_png_are_told(result: clpeel.Result, tmp_path: Path) -> None:
    line = result.save_map("depth", tmp_path / "x.png")
    assert line is not None
    low, high = (float(word) for word in line.replace(",", "").split() if "." in word)
    read, there = levels(tmp_path / "x.png"), np.isfinite(result.depth)
    assert ((read == 0) == ~there).all() and read[there].min() == 1 and read.max() == 65535
    depth = low + (read[there] - 1) / 65534 * (high - low)
    assert np.abs(depth - result.depth[there]).max() <= (high - low) / 65534 * 0.5001


def test_what_a_technique_measures(tmp_path: Path) -> None:
    result = plainly.render(scene(), size=SIZE, technique="thickness", variant="total", maps=("depth",))
    line = result.save_map("thickness", tmp_path / "x.png")
    assert line == f"thickness: 0 is 0, 65535 is {float(result.thickness.max())!r}"
    share = result.thickness / result.thickness.max()
    assert np.abs(levels(tmp_path / "x.png") / 65535 - share).max() <= 0.5 / 65535 + 1e-7
    result.save_map("unpaired", tmp_path / "x.tif")
    assert (tifffile.imread(tmp_path / "x.tif") == result.unpaired).all()
    assert result.depth.shape == result.thickness.shape


def test_what_has_no_place_is_refused(result: clpeel.Result, tmp_path: Path) -> None:
    with pytest.raises(clpeel.InputError, match=r"ending in .npy, .npz, .exr, .tif, .tiff or .png, got"):
        result.save_map("depth", tmp_path / "x.jpg")
    with pytest.raises(clpeel.InputError, match="thickness: expected a result of a technique that makes this map"):
        result.save_map("thickness", tmp_path / "x.npy")
    many = clpeel.Scene.from_arrays(
        [(9, 9, 9), (-1, -1, 0), (1, -1, 0), (0, 1, 0)], [(0, 0, 0)] * 65535 + [(1, 2, 3)], color="red"
    )
    seen = plainly.render(many, clpeel.Camera((0, 0, 5), (0, 0, 0)), size=SIZE, maps=("triangle",))
    assert seen.triangle.max() == 65535
    with pytest.raises(clpeel.InputError, match=r"triangle: expected at most 65534 in a PNG, got 65535; write"):
        seen.save_map("triangle", tmp_path / "x.png")
    assert not list(tmp_path.iterdir())


def test_nothing_in_view(tmp_path: Path) -> None:
    away = clpeel.Camera((0, 0, 5), (0, 0, 9))
    result = plainly.render(scene(), away, size=SIZE, maps=MAPS)
    for name in MAPS:
        result.save_map(name, tmp_path / f"{name}.png")
    assert np.isinf(result.depth).all() and (result.triangle == -1).all() and not result.normal.any()
    assert (result.transmittance == 1).all() and not result.layer_count.any()
