"""Ranges and sizes beyond float32: depths keep their order, and lengths are finite and right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import plainly
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from twins import reference

import clpeel
from clpeel import Camera, Scene
from clpeel.pictures.lengths import narrowed

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (48, 32)
RANGES = [(1e-46, 30.0), (1e-30, 30.0), (1e-300, 1e300), (1e-37, 1e37), (0.1, 1e300), (1e-320, 1e-5 + 30)]


def soup(seed: int = 3, triangles: int = 12) -> Scene:
    rng = np.random.default_rng(seed)
    colors = rng.integers(0, 256, (3 * triangles, 4)).astype(np.uint8)
    return Scene.from_arrays(
        rng.normal(size=(3 * triangles, 3)), np.arange(3 * triangles).reshape(-1, 3), vertex_colors=colors
    )


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("clipping_range", RANGES)
@pytest.mark.parametrize("technique", ["sort", "dual-depth-peeling"])
def test_a_range_far_beyond_the_scene_changes_nothing(
    clipping_range: tuple[float, float], orthographic: bool, technique: str, lanes: int
) -> None:
    """Nothing is clipped, and depths are told apart as with the range that is fitted to the scene."""
    scene = soup()
    fitted = Camera.frame(scene, orthographic=orthographic)
    given = replace(fitted, clipping_range=clipping_range)
    want = plainly.render(scene, fitted, size=SIZE, technique=technique, lanes=lanes)
    got = plainly.render(scene, given, size=SIZE, technique=technique, lanes=lanes)
    assert got.stats["fragments"] == want.stats["fragments"] > 0
    # The same layers in the same order; where depths are counted from changes how weights and colours round.
    assert np.abs(got.color - want.color).max() <= (3 * got.stats["layers_max"] + 40) * reference.UNIT


@pytest.mark.parametrize("depth_format", ["float32", "unorm24", "rgba8"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_window_depths_of_such_a_range_are_all_equal(depth_format: str, orthographic: bool) -> None:
    """As the format has it, all lie where the range ends: the order of submission is left, and numbers are finite."""
    scene = soup()
    camera = replace(Camera.frame(scene, orthographic=orthographic), clipping_range=(1e-300, 1e300))
    result = plainly.render(scene, camera, size=SIZE, depth_format=depth_format)
    assert np.isfinite(result.color).all() and result.stats["fragments"] > 0


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_range_that_the_scene_is_not_in_draws_nothing(orthographic: bool) -> None:
    scene = soup()
    for clipping_range in ((1e-46, 1e-45), (1e-300, 1e-3), (1e3, 1e300), (1e38, 1e39), (1e39, 1e300)):
        camera = replace(Camera.frame(scene, orthographic=orthographic), clipping_range=clipping_range)
        result = plainly.render(scene, camera, size=SIZE)
        assert result.stats["fragments"] == 0 and (result.image == 255).all()


def test_a_near_plane_that_cuts_is_kept_though_the_far_one_is_far_away() -> None:
    """Halves of the scene on either side of the plane: the range from it on, and the range up to it, make up all."""
    scene = soup()
    whole = Camera.frame(scene, orthographic=True)
    middle = whole.distance
    parts = [
        plainly.render(scene, replace(whole, clipping_range=part), size=SIZE).stats["fragments"]
        for part in ((middle, 1e300), (-1e300, middle))
    ]
    assert sum(parts) == plainly.render(scene, whole, size=SIZE).stats["fragments"] and min(parts) > 0


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("size", [1e-300, 1e-46, 1e-30, 1.0, 1e30, 1e37, 1e39, 1e100, 1e300])
def test_thickness_is_finite_and_right_at_any_size(size: float, orthographic: bool) -> None:
    """The ray through the middle of a box looks straight along an edge: it runs as far as the box is deep."""
    box = trimesh.creation.box((1.0, 1.0, 0.75))
    scene = Scene.from_arrays(box.vertices * size, box.faces, color=(1.0, 0.0, 0.0, 0.5))
    camera = Camera.frame(scene, orthographic=orthographic)
    for technique in ("thickness", "translucency"):
        for variant in ("exact", "total", "first-solid"):
            result = plainly.render(scene, camera, size=(31, 31), technique=technique, variant=variant)
            assert np.isfinite(result.thickness).all() and np.isfinite(result.color).all()
            # Depths are relative to the distance, some 5 boxes: a few of their roundings, of 2^-24 each.
            assert result.thickness[15, 15] / size == pytest.approx(0.75, rel=64 * reference.UNIT)
            assert (result.thickness.dtype == np.float32) == (1e-37 < size < 1e38)


def test_translucency_knows_no_size() -> None:
    box = trimesh.creation.icosphere(subdivisions=2)
    images = []
    for size in (1.0, 2.0**140, 2.0**-150):
        scene = Scene.from_arrays(box.vertices * size, box.faces, color=(1.0, 0.5, 0.2, 0.5))
        images.append(plainly.render(scene, size=SIZE, technique="translucency").image)
    assert len(np.unique(images[0])) > 9
    for image in images[1:]:
        assert np.abs(image.astype(int) - images[0]).max() <= 1


@pytest.mark.parametrize("size", [1e-300, 1e-40, 1.0, 1e38, 1e300])
def test_layers_have_finite_depths_at_any_size(size: float, tmp_path: Path) -> None:
    box = trimesh.creation.box()
    scene = Scene.from_arrays(box.vertices * size, box.faces, color=(1.0, 0.0, 0.0, 0.5))
    camera = Camera.frame(scene)
    layers = plainly.render(scene, camera, size=(31, 31), layers=True).layers
    depths = [layers.layer(k)[1][15, 15] / size for k in range(2)]
    middle = camera.distance / size
    np.testing.assert_allclose(depths, [middle - 0.5, middle + 0.5], rtol=16 * reference.UNIT)
    layers.save(tmp_path / "layers.npz")
    np.testing.assert_array_equal(clpeel.load_layers(tmp_path / "layers.npz").depth, layers.depth)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=True, width=64), max_size=9))
def test_lengths_are_narrowed_where_nothing_is_lost(values: list[float]) -> None:
    given = np.array(values, np.float64)
    got = narrowed(given)
    if got.dtype == np.float64:
        np.testing.assert_array_equal(got, given)
        greatest = float(np.finfo(np.float32).max)
        assert any(0 < abs(v) < 2.0**-126 or greatest < abs(v) < np.inf for v in values)
    else:
        np.testing.assert_allclose(got.astype(np.float64), given, rtol=2.0**-24, atol=0)
