"""Deep OpenEXR: OpenImageIO reads every fragment, in order, and blends them to the picture of `sort`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
import plainly
import pytest
from crossing import SIZE, scene
from twins import soups
from twins.textures import to_linear

import clpeel
from clpeel.pictures.exr import as_float32

HALF = 2.0**-11


@pytest.fixture(scope="module", params=["squares", "soup"])
def result(request: pytest.FixtureRequest) -> clpeel.Result:
    made = scene() if request.param == "squares" else soups.random(5, 60).scene()
    return plainly.render(made, size=SIZE, background=None, layers=True, blending_space="linear")


def test_every_fragment_is_there_in_order(result: clpeel.Result, tmp_path: Path) -> None:
    layers = result.layers
    layers.save(tmp_path / "x.exr")
    file = OpenImageIO.ImageInput.open(str(tmp_path / "x.exr"))
    spec = file.spec()
    assert spec.deep and (spec.width, spec.height) == SIZE
    at = {name: spec.channelindex(name) for name in ("R", "G", "B", "A", "Z", "id")}
    deep = file.read_native_deep_image()
    light = to_linear(layers.color[:, :3]) * layers.color[:, 3:].astype(np.float64)
    count = np.diff(layers.start)
    assert count.max() > 2 and count.min() == 0
    for pixel in range(SIZE[0] * SIZE[1]):
        assert deep.samples(pixel) == count[pixel]
        for k in range(count[pixel]):
            n = layers.start[pixel] + k
            for channel, name in enumerate("RGB"):
                assert (
                    abs(deep.deep_value(pixel, at[name], k) - light[n, channel]) <= 2.0**-24 * light[n, channel] + 1e-12
                )
            assert deep.deep_value(pixel, at["A"], k) == layers.color[n, 3]
            assert deep.deep_value(pixel, at["Z"], k) == layers.depth[n]
            assert deep.deep_value_uint(pixel, at["id"], k) == layers.triangle[n]


def test_blended_they_are_the_picture_of_sort(result: clpeel.Result, tmp_path: Path) -> None:
    result.layers.save(tmp_path / "x.exr")
    flat = OpenImageIO.ImageBufAlgo.flatten(OpenImageIO.ImageBuf(str(tmp_path / "x.exr")))
    assert flat.spec().channelnames[:4] == ("R", "G", "B", "A")
    read = flat.get_pixels(OpenImageIO.FLOAT)[..., :4]
    color = result.color.astype(np.float64)
    alpha = color[..., 3:]
    straight = np.divide(color[..., :3], alpha, out=np.zeros_like(color[..., :3]), where=alpha > 0)
    light = np.concatenate([to_linear(straight) * alpha, alpha], axis=-1)
    assert (np.abs(read - light) <= np.maximum(light * HALF, 2.0**-25)).all()


def test_no_layer_at_all(tmp_path: Path) -> None:
    away = clpeel.Camera((0, 0, 5), (0, 0, 9))
    plainly.render(scene(), away, size=SIZE, layers=True).layers.save(tmp_path / "x.exr")
    deep = OpenImageIO.ImageInput.open(str(tmp_path / "x.exr")).read_native_deep_image()
    assert sum(deep.samples(pixel) for pixel in range(SIZE[0] * SIZE[1])) == 0


def test_depths_that_float32_cannot_hold_are_refused(tmp_path: Path) -> None:
    layers = clpeel.Layers(
        (1, 1), np.array([0, 1]), np.ones((1, 4), np.float32), np.array([1e300]), np.zeros(1, np.int32)
    )
    with pytest.raises(clpeel.InputError, match="depth: expected numbers that float32 holds, got 1e\\+300"):
        layers.save(tmp_path / "x.exr")
    assert not list(tmp_path.iterdir())
    with pytest.raises(clpeel.InputError):
        as_float32("depth", np.array([1e-300]))
    assert as_float32("depth", np.array([0.0, np.inf, 1.5])).tolist() == [0, np.inf, 1.5]
