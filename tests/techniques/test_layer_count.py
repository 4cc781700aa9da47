"""layer-count: the number of fragments of each pixel, as the twin counts them; its picture and its map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import reference, soups
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.pictures.colormap import colors_at

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")


def layer_count(scene: clpeel.Scene, camera: clpeel.Camera, size: tuple[int, int], **options: Any) -> clpeel.Result:
    return plainly.render(scene, camera, size, "layer-count", scale_bar=False, **options)


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_every_layer_is_counted(colors: str, lanes: int, judge: Judge) -> None:
    """As the twin counts them, but where a sample lies on an edge to within what corners are snapped by."""
    soup, size = soups.random(3, 200, "mixed", colors), (50, 40)
    result = layer_count(soup.scene(), BENCH.camera(), size, lanes=lanes)
    twin, excused, _ = judge.weigh(soup, BENCH, size)
    assert excused.mean() < 0.1 and result.layer_count.dtype == np.float32
    assert (result.layer_count == twin.layers)[~excused].all()
    assert result.stats.layers_max == result.layer_count.max() > 10
    assert result.stats.fragments == result.layer_count.sum() and result.stats.truncated_pixels == 0


def test_opaque_surfaces_are_layers_and_hide_none(lanes: int) -> None:
    colors = np.array([(255, 255, 255, 255), (9, 9, 9, 99), (0, 0, 0, 255)], np.uint8)
    for scene in (soups.stack([1.0, 2.0, 3.0], colors).scene(), soups.stack([1.0, 2.0, 3.0], colors[0]).scene()):
        assert (layer_count(scene, AHEAD.camera(), (8, 8), lanes=lanes).layer_count == 3).all()


def test_deep_pixels_and_little_memory(lanes: int) -> None:
    """More layers than rows hold, so that lists are made."""
    soup = soups.stack(np.linspace(1, 7, 3000), (255, 255, 255, 9))
    for memory in (None, "1M"):
        result = layer_count(soup.scene(), AHEAD.camera(), (20, 20), lanes=lanes, memory=memory)
        assert (result.layer_count == 3000).all()


def test_a_pixel_is_the_mean_of_its_samples(lanes: int) -> None:
    soup = soups.random(4, 60, "mixed")
    fine = layer_count(soup.scene(), BENCH.camera(), (64, 48), lanes=lanes).layer_count
    coarse = layer_count(soup.scene(), BENCH.camera(), (8, 6), lanes=lanes, samples=64).layer_count
    assert (coarse == fine.reshape(6, 8, 8, 8).mean(axis=(1, 3))).all()


@pytest.mark.parametrize("background", [None, (0.0, 0.5, 1.0), ((0.0, 0.5, 1.0), (0.75, 0.5, 0.25))])
def test_the_picture_is_the_map_in_colours(background: Any, judge: Judge) -> None:
    soup, size = soups.random(5, 40, "mixed"), (40, 30)
    result = layer_count(soup.scene(), BENCH.camera(), size, background=background)
    layers = result.layer_count
    inside = layers > 0
    want = np.concatenate([colors_at(layers / layers.max()), np.ones((30, 40, 1))], axis=-1) * inside[..., None]
    assert inside.any() and not inside.all()
    judge.color(result, want, np.full(inside.shape, 2.0**-23))
    behind = reference.image(np.zeros((30, 40, 4)), background)
    assert (result.image[~inside] == behind[~inside]).all()
    assert (result.image[inside] == (want[inside] * 255 + 0.5).astype(np.uint8)).all()


def test_nothing_in_view() -> None:
    away = clpeel.Camera((0.0, 0.0, 4.0), (0.0, 0.0, 8.0), clipping_range=(1.0, 2.0))
    result = layer_count(soups.random(1).scene(), away, (20, 10))
    assert (result.layer_count == 0).all() and (result.image == 255).all()


def test_the_scale_bar_is_of_whole_numbers() -> None:
    """It is drawn where there is room, over nothing but an empty corner."""
    scene = soups.stack([1.0, 2.0], (255, 255, 255, 128), reach=0.2).scene()
    plain = layer_count(scene, AHEAD.camera(), (320, 240))
    barred = plainly.render(scene, AHEAD.camera(), (320, 240), "layer-count")
    changed = (plain.image != barred.image).any(axis=-1)
    assert 500 < changed.sum() < 320 * 240 / 4 and not (changed & (plain.layer_count > 0)).any()
    assert (plain.layer_count == barred.layer_count).all()


def test_other_techniques_have_no_such_map_unless_it_is_asked_for() -> None:
    result = plainly.render(soups.random(1).scene(), BENCH.camera(), (8, 8))
    with pytest.raises(clpeel.InputError, match="layer_count: expected a result rendered with maps="):
        _ = result.layer_count
