"""Drawing: strips of any depth, by whichever way, against float32 under blending in the order of depth."""

from __future__ import annotations

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.device.layout import RUN_MAX, TILE

CAMERA = clpeel.Camera((0, 0, 4), (0, 0, 0), view_angle=30, clipping_range=(2.0, 6.0))
SIDE = TILE


def curtain(layers: int, columns: int = SIDE, seed: int = 0) -> tuple[clpeel.Scene, np.ndarray, np.ndarray]:
    """Triangles over the picture's first `columns` pixel columns, at so many distances, in random order."""
    rng = np.random.default_rng(seed)
    away = rng.permutation(np.linspace(2.5, 5.5, layers))
    edge = (2 * columns / SIDE - 1) * np.tan(np.radians(15)) * away  # what that column's right side is at that distance
    corners = np.zeros((layers, 3, 3))
    corners[:, :, 0] = edge[:, None] - [0, 0, 80]
    corners[:, :, 1] = [-40, 40, 0]
    corners[:, :, 2] = (4 - away)[:, None]
    colors = rng.integers(0, 256, (layers, 4), dtype=np.uint8)
    colors[:, 3] = 1
    faces = np.arange(3 * layers).reshape(layers, 3)
    return clpeel.Scene.from_arrays(corners.reshape(-1, 3), faces, face_colors=colors), away, colors


def under(away: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """Premultiplied colour and alpha of those layers, front to back, each step rounded to float32."""
    color, through = np.zeros(3, np.float32), np.float32(1)
    for source in (colors[np.argsort(away)] / 255).astype(np.float32):
        color = color + through * (source[3] * source[:3])
        through = through * (np.float32(1) - source[3])
    return np.append(color, np.float32(1) - through)


COUNTS = [1, 7, 8, 9, 31, 32, 33, 34, 35, 40, 63, 65, 100, RUN_MAX - 1, RUN_MAX, RUN_MAX + 1, RUN_MAX + 3, 700]


@pytest.mark.parametrize("lanes", [1, 16, 64])
@pytest.mark.parametrize("layers", COUNTS)
def test_any_number_of_layers(lanes, layers):
    scene, away, colors = curtain(layers)
    result = plainly.render(scene, CAMERA, (SIDE, SIDE), lanes=lanes)
    assert result.stats["layers_max"] == layers and result.stats["fragments"] == layers * SIDE**2
    assert (result.color == under(away, colors)).all()


@pytest.mark.parametrize("lanes", [1, 16, 64])
@pytest.mark.parametrize("deep", [60, 300])
def test_a_strip_of_deep_and_shallow_pixels(lanes, deep):
    # Columns 0..5 have all layers, the rest of the same strips only the nine that reach further.
    far, far_away, far_colors = curtain(9)
    near, near_away, near_colors = curtain(deep, columns=6, seed=1)
    near_away = near_away + 1e-3  # no two at one distance
    scene = clpeel.Scene.from_arrays(
        np.concatenate([far.vertices, near.vertices - [0, 0, 1e-3]]),
        np.concatenate([far.faces, near.faces + len(far.vertices)]),
        face_colors=np.concatenate([far_colors, near_colors]),
    )
    result = plainly.render(scene, CAMERA, (SIDE, SIDE), lanes=lanes)
    both = under(np.concatenate([far_away, near_away]), np.concatenate([far_colors, near_colors]))
    assert (result.color[:, :6] == both).all()
    assert (result.color[:, 6:] == under(far_away, far_colors)).all()


@pytest.mark.parametrize(("lanes", "layers"), [(1, 70_000), (64, 20_000)])
def test_a_pixel_deeper_than_a_slab_is_drawn_in_a_larger_one(lanes, layers):
    scene, away, colors = curtain(layers, columns=1)
    result = plainly.render(scene, CAMERA, (SIDE, SIDE), lanes=lanes)
    assert result.stats["layers_max"] == layers and result.stats["fragments"] == layers * SIDE
    assert (result.color[:, 0] == under(away, colors)).all() and not result.color[:, 1:].any()


@pytest.mark.parametrize("lanes", [1, 64])
def test_little_memory_means_small_slabs_and_the_same_bits(lanes, judge):
    scene, _, _ = curtain(3000)
    size = (5 * SIDE, 3 * SIDE)
    much, little = (plainly.render(scene, CAMERA, size, lanes=lanes, memory=memory) for memory in ("256M", "1M"))
    assert little.stats["bytes"]["fragments"] < 1 << 20 <= much.stats["bytes"]["fragments"]
    judge.same_bits(little, much)


def test_a_pixel_deeper_than_the_memory_is_an_error_that_says_so():
    scene, _, _ = curtain(50_000, columns=1)
    with pytest.raises(
        clpeel.InputError, match=r"room for the 50,000 fragments of one pixel, got room for \d\d,\d\d\d; raise"
    ):
        plainly.render(scene, CAMERA, (SIDE, SIDE), memory="1M")


@pytest.mark.parametrize("lanes", [1, 64])
def test_tiles_that_nothing_meets_are_the_background(lanes):
    scene, _, _ = curtain(3)
    result = plainly.render(scene, CAMERA, (9 * SIDE, SIDE), lanes=lanes)
    assert result.color[:, : 4 * SIDE].any() and result.stats["clamped_pixels"] == 0
    behind = clpeel.Camera((0, 0, 4), (0, 0, 8), clipping_range=(2.0, 6.0))
    assert not plainly.render(scene, behind, (9 * SIDE, SIDE), lanes=lanes).color.any()
