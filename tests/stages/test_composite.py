"""Composition against the blending equation: over a background, straight alpha, means of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import reference, soups

import clpeel
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge


def quad(z: float = 0.0, side: float = 100.0) -> np.ndarray:
    return np.array([[-side, -side, z], [side, -side, z], [side, side, z], [-side, side, z]])


FACES = [[0, 1, 2], [0, 2, 3]]
CAMERA = clpeel.Camera((0, 0, 4), (0, 0, 0))


@pytest.mark.parametrize("lanes", [1, 64])
def test_over_a_background(lanes):
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(1.0, 0.5, 0.0, 0.25))
    result = plainly.render(scene, CAMERA, (20, 10), background=(0.0, 0.2, 1.0), lanes=lanes)
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
    straight = plainly.render(scene, CAMERA, (64, 64), background=None).image / 255
    for background in ((0.0, 0.0, 0.0), (1.0, 0.3, 0.6)):
        over = plainly.render(scene, CAMERA, (64, 64), background=background).image[..., :3] / 255
        alpha = straight[..., 3:]
        # Half a step of the colour, of the alpha times the colours' difference, and of the picture.
        assert np.abs(alpha * straight[..., :3] + (1 - alpha) * background - over).max() <= 1.5 / 255
    assert (straight[straight[..., 3] == 0] == 0).all()


@pytest.mark.parametrize("lanes", [1, 64])
@pytest.mark.parametrize("samples", [64, 256])
def test_samples_are_the_mean_of_a_larger_picture(samples, lanes):
    rng = np.random.default_rng(1)
    scene = clpeel.Scene.from_arrays(
        rng.uniform(-1, 1, (30, 3)), np.arange(30).reshape(-1, 3), face_colors=rng.random((10, 4))
    )
    side = int(samples**0.5)
    small = plainly.render(scene, CAMERA, (37, 21), samples=samples, lanes=lanes)
    large = plainly.render(scene, CAMERA, (37 * side, 21 * side), lanes=lanes)
    mean = large.color.astype(np.float64).reshape(21, side, 37, side, 4).mean(axis=(1, 3))
    assert np.abs(small.color - mean).max() <= samples * 2.0**-24
    assert small.stats["fragments"] == large.stats["fragments"]


def test_nothing_drawn_is_the_background_bit_for_bit():
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 255))
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    over = plainly.render(scene, away, (33, 17), background=(0.2, 0.5, 0.9))
    assert (over.image == [51, 128, 230, 255]).all() and not over.color.any()
    assert not plainly.render(scene, away, (33, 17), background=None).image.any()
    # The same bytes where a transparent quad (alpha 0) makes the compositor round them.
    clear = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 0))
    assert (plainly.render(clear, CAMERA, (33, 17), background=(0.2, 0.5, 0.9)).image == over.image).all()


GRADIENT = ((1.0, 0.9, 0.2), (0.1, 0.3, 0.6))
WAYS = [
    (name, execution) for name, each in TECHNIQUES.items() for execution in ("tiles", "passes")[: 1 + each.has_passes]
]


@pytest.mark.parametrize("lanes", [1, 64])
@pytest.mark.parametrize("samples", [1, 4, 8, 16, 64, 256])
def test_a_gradient_is_of_the_pictures_rows_and_not_of_samples(samples: int, lanes: int, judge: Judge) -> None:
    """The top edge has the first colour, and the first row's centre is half a row below; 37 rows are no whole tiles."""
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 255))
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    result = plainly.render(scene, away, (21, 37), background=GRADIENT, samples=samples, lanes=lanes)
    judge.image(result, GRADIENT)
    top, bottom = np.array(GRADIENT)
    for row, way in ((0, 0.5 / 37), (18, 0.5), (36, 36.5 / 37)):
        want = (top + way * (bottom - top)) * 255
        assert np.abs(result.image[row, :, :3] - want).max() <= 0.501, row
    assert (result.image == result.image[:, :1]).all() and (result.image[..., 3] == 255).all()


@pytest.mark.parametrize(("technique", "execution"), WAYS)
def test_every_technique_is_put_over_a_gradient(technique: str, execution: str, judge: Judge) -> None:
    scene = soups.random(21, 60, "mixed", "flat8").scene()
    options: dict[str, Any] = {"variant": "total"} if technique in ("thickness", "translucency") else {}
    if technique in ("thickness", "layer-count"):
        options["scale_bar"] = False
    call: dict[str, Any] = {"technique": technique, "execution": execution, "background": GRADIENT, **options}
    for samples in (1, 4, 8):
        one, many = (
            plainly.render(scene, soups.BENCH.camera(), (50, 41), lanes=lanes, samples=samples, **call)
            for lanes in (1, 64)
        )
        judge.same_bits(many, one)
        judge.image(one, GRADIENT)
    assert one.image[..., :3].std() > 10


@pytest.mark.parametrize("lanes", [1, 64])
def test_a_gradient_goes_on_over_batches_and_opaque_surfaces(lanes: int, judge: Judge) -> None:
    soup = soups.random(22, 20_000, "mixed", "flat8")
    soup.face_colors[::7, 3] = 255
    for opacity in (None, 1.0):
        scene = clpeel.load(soup.scene(), opacity=opacity)
        call: dict[str, Any] = {
            "camera": soups.BENCH.camera(),
            "size": (150, 140),
            "background": GRADIENT,
            "lanes": lanes,
        }
        whole, parts = (plainly.render(scene, memory=memory, **call) for memory in (None, "1M"))
        judge.same_bits(parts, whole)
        judge.image(whole, GRADIENT)
        assert parts.stats.batches > 1


SHADE = st.sampled_from([0.0, 1 / 255, 0.25, 1 / 3, 0.999, 1.0])
COLOR = st.tuples(SHADE, SHADE, SHADE)


@given(
    top=COLOR,
    bottom=COLOR,
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    samples=st.sampled_from([1, 4, 8, 256]),
)
def test_any_gradient(top: Any, bottom: Any, size: tuple[int, int], samples: int, judge: Judge) -> None:
    """It has the same bits at 1 and 64 lanes. If both colours are the same, these are the bits of that colour."""
    scene = soups.random(23, 20, "mixed", "flat8").scene()
    call: dict[str, Any] = {"camera": soups.BENCH.camera(), "size": size, "samples": samples}
    one, many = (plainly.render(scene, background=(top, bottom), lanes=lanes, **call) for lanes in (1, 64))
    judge.same_bits(many, one)
    judge.image(one, (top, bottom))
    plain, alike = (plainly.render(scene, background=behind, **call) for behind in (top, (top, top)))
    judge.same_bits(alike, plain)


def test_the_twin_sees_a_gradient_that_is_upside_down(judge: Judge) -> None:
    scene = soups.random(21, 60, "mixed", "flat8").scene()
    result = plainly.render(scene, soups.BENCH.camera(), (50, 41), background=GRADIENT)
    with pytest.raises(pytest.fail.Exception, match="not its color over the background"):
        judge.image(result, GRADIENT[::-1])
    assert (reference.image(result.color, GRADIENT) == result.image).mean() > 0.99


def test_color_not_kept_is_an_error_that_says_so():
    scene = clpeel.Scene.from_arrays(quad(), FACES, color=(255, 0, 0, 255))
    result = plainly.render(scene, CAMERA, (4, 4), keep_color=False)
    assert result.image.shape == (4, 4, 4)
    with pytest.raises(clpeel.InputError, match="keep_color"):
        _ = result.color
