"""Composition against the blending equation: over a background, straight alpha, means of samples."""

from __future__ import annotations

import numpy as np
import pytest

import clpeel


def quad(z: float = 0.0, side: float = 100.0) -> np.ndarray:
    return np.array([[-side, -side, z], [side, -side, z], [side, side, z], [-side, side, z]])


FACES = [[0, 1, 2], [0, 2, 3]]
CAMERA = clpeel.Camera((0, 0, 4), (0, 0, 0))


@pytest.mark.parametrize("lanes", [1, 64])
def test_over_a_background(lanes):
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(1.0, 0.5, 0.0, 0.25))
    result = clpeel.render(scene, CAMERA, (20, 10), background=(0.0, 0.2, 1.0), lanes=lanes)
    expected = 0.25 * np.array([1, 0.5, 0]) + 0.75 * np.array([0, 0.2, 1])
    assert result.image.shape == (10, 20, 4) and result.image.dtype == np.uint8
    assert (result.image == [*np.floor(expected * 255 + 0.5).astype(int), 255]).all()
    assert np.allclose(result.color, [0.25, 0.125, 0, 0.25], atol=2.0**-24)


def test_straight_alpha_composites_to_the_same_picture():
    # EXTREMES: the PNG over any background equals rendering on it, to the rounding of 8 bits each way.
    rng = np.random.default_rng(0)
    vertices = rng.uniform(-1, 1, (60, 3))
    scene = clpeel.Scene.from_arrays(
        vertices, np.arange(60).reshape(-1, 3), face_colors=rng.integers(0, 256, (20, 4), dtype=np.uint8)
    )
    straight = clpeel.render(scene, CAMERA, (64, 64), background=None).image / 255
    for background in ((0.0, 0.0, 0.0), (1.0, 0.3, 0.6)):
        over = clpeel.render(scene, CAMERA, (64, 64), background=background).image[..., :3] / 255
        alpha = straight[..., 3:]
        # Half a step of the colour, of the alpha times the colours' difference, and of the picture.
        assert np.abs(alpha * straight[..., :3] + (1 - alpha) * background - over).max() <= 1.5 / 255
    assert (straight[straight[..., 3] == 0] == 0).all()


@pytest.mark.parametrize("lanes", [1, 64])
@pytest.mark.parametrize("samples", [4, 16, 64, 256])
def test_samples_are_the_mean_of_a_larger_picture(samples, lanes):
    rng = np.random.default_rng(1)
    scene = clpeel.Scene.from_arrays(
        rng.uniform(-1, 1, (30, 3)), np.arange(30).reshape(-1, 3), face_colors=rng.random((10, 4))
    )
    side = int(samples**0.5)
    small = clpeel.render(scene, CAMERA, (37, 21), samples=samples, lanes=lanes)
    large = clpeel.render(scene, CAMERA, (37 * side, 21 * side), lanes=lanes)
    mean = large.color.astype(np.float64).reshape(21, side, 37, side, 4).mean(axis=(1, 3))
    assert np.abs(small.color - mean).max() <= samples * 2.0**-24
    assert small.stats["fragments"] == large.stats["fragments"]


def test_nothing_drawn_is_the_background_bit_for_bit():
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 255))
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    over = clpeel.render(scene, away, (33, 17), background=(0.2, 0.5, 0.9))
    assert (over.image == [51, 128, 230, 255]).all() and not over.color.any()
    assert not clpeel.render(scene, away, (33, 17), background=None).image.any()
    # The same bytes where a transparent quad (alpha 0) makes the compositor round them.
    clear = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 0))
    assert (clpeel.render(clear, CAMERA, (33, 17), background=(0.2, 0.5, 0.9)).image == over.image).all()


def test_color_not_kept_is_an_error_that_says_so():
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 255))
    result = clpeel.render(scene, CAMERA, (4, 4), keep_color=False)
    assert result.image.shape == (4, 4, 4)
    with pytest.raises(clpeel.InputError, match="keep_color"):
        _ = result.color
