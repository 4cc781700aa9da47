"""weighted-sum: the paper's sum against float64, alphas that add up to more than one, and what it reports."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import plainly
import pytest
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

from clpeel.device.layout import RUN_MAX

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")


@pytest.mark.parametrize("count", [0, 1, 2, 15, 16, 17, 100, RUN_MAX + 1, 3000])
def test_the_sum_of_the_paper(count: int, lanes: int, judge: Judge) -> None:
    rng = np.random.default_rng(count)
    colors = rng.random((count + 1, 4)).astype(np.float32)
    soup = soups.stack(rng.uniform(1, 7, count + 1), colors)
    result = plainly.render(soup.scene(), AHEAD.camera(), size=(5, 3), lanes=lanes, technique="weighted-sum")
    straight = colors.astype(float)
    want = np.r_[(straight[:, :3] * straight[:, 3:]).sum(axis=0), straight[:, 3].sum()]
    # A product and as many sums as layers, and 1 - (1 - sum) where alpha is read from the transmittance.
    judge.color(result, want, (count + 4) * UNIT * (1 + want.max()), f"{count + 1} layers")
    assert result.stats["layers_max"] == count + 1


@pytest.mark.parametrize("colors", ["flat8", "flat"])
def test_against_the_twin(colors: str, lanes: int, judge: Judge) -> None:
    soup, size = soups.random(7, 200, "mixed", colors, alpha=(0.02, 0.1)), (60, 50)
    twin, excused, _ = judge.weigh(soup, BENCH, size)
    result = plainly.render(soup.scene(), BENCH.camera(), size=size, lanes=lanes, technique="weighted-sum")
    straight = twin.projected.colors[twin.triangle][:, 0]  # flat: that of any corner
    want = np.zeros((size[1] * size[0], 4))
    np.add.at(want, twin.pixel, np.c_[straight[..., :3] * straight[..., 3:], straight[..., 3:]])
    want = want.reshape(size[1], size[0], 4)
    assert want[..., 3].max() > 0.3
    bound = (twin.layers[..., None] + 4) * UNIT * (1 + want)
    assert (np.abs(result.color - want) <= bound)[~excused].all()


def test_alphas_beyond_one_are_clamped_and_counted(lanes: int) -> None:
    background = (0.25, 0.5, 1.0)
    soup = soups.stack([1.0, 2.0, 3.0], (0.125, 0.25, 0.25, 0.5))
    result = plainly.render(
        soup.scene(), AHEAD.camera(), size=(20, 10), lanes=lanes, technique="weighted-sum", background=background
    )
    # C + C0 (1 - 1.5): the sum is 3 x 0.5 x the colour.
    want = 1.5 * np.array([0.125, 0.25, 0.25]) - 0.5 * np.array(background)
    assert want[2] < 0
    assert (result.color == np.r_[1.5 * np.array([0.125, 0.25, 0.25]), 1.5].astype(np.float32)).all()
    assert (result.image[..., :3] == (np.clip(want, 0, 1) * 255 + 0.5).astype(np.uint8)).all()
    assert result.stats["clamped_pixels"] == 200
    exact = plainly.render(soup.scene(), AHEAD.camera(), size=(20, 10), lanes=lanes)
    assert exact.stats["clamped_pixels"] == 0


def test_colours_that_vary(lanes: int, judge: Judge) -> None:
    # One layer everywhere: nothing to sort, so it is what `sort` shows.
    corners, faces = np.array([[-1.0, -1, 0], [1, -1, 0.5], [0, 1, -0.5]]), np.array([[0, 1, 2]])
    soup = soups.Soup(corners, faces, vertex_colors=np.random.default_rng(3).random((3, 4)))
    both = [
        plainly.render(soup.scene(), BENCH.camera(), size=(40, 30), lanes=lanes, technique=name, lighting="headlight")
        for name in ("sort", "weighted-sum")
    ]
    assert both[0].stats["fragments"] > 20
    assert np.abs(both[0].color - both[1].color).max() <= 4 * UNIT


def test_the_same_bits_with_any_lanes_and_memory(judge: Judge) -> None:
    soup = soups.stack(np.random.default_rng(2).uniform(1, 7, 900), (0.3, 0.6, 0.9, 0.001))
    scene = soup.scene()
    runs = [
        plainly.render(scene, AHEAD.camera(), size=(16, 16), lanes=lanes, memory=memory, technique="weighted-sum")
        for lanes in (1, 64)
        for memory in ("256M", "1M")
    ]
    for other in runs[1:]:
        judge.same_bits(other, runs[0])


def test_what_it_reports(lanes: int) -> None:
    soup = soups.stack([1.0, 2.0, 3.0], (1.0, 1.0, 1.0, 0.25))
    stats = plainly.render(soup.scene(), AHEAD.camera(), (20, 10), "weighted-sum", lanes=lanes).stats
    assert stats["technique"] == "weighted-sum" and stats["passes"] == 1
    assert stats["fragments"] == 600 and stats["samples_passed"] == [600] and stats["layers_max"] == 3
    assert stats["seconds"]["weighted-sum"] > 0 and stats["bytes_per_pixel"] > 0
