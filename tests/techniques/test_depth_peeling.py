"""depth-peeling: pass k passes the k-th nearest fragment of each pixel, and nothing else (Everitt 2001)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import plainly
import pytest
from twins import soups
from twins.soups import AHEAD, BENCH

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")


def test_each_pass_peels_one_layer_of_each_pixel_that_has_one_left(lanes: int) -> None:
    """More samples pass than that, as the depth test also passes what a nearer fragment replaces later."""
    soup, size = soups.random(71, 150, "mixed", alpha=(0.05, 0.2)), (50, 40)
    layers = plainly.render(soup.scene(), BENCH.camera(), size, "layer-count").layer_count
    got = plainly.render(soup.scene(), BENCH.camera(), size, "depth-peeling", lanes=lanes)
    left = [int((layers > peeled).sum()) for peeled in range(int(layers.max()) + 1)]
    assert len(got.stats.samples_passed) == len(left) > 8 and left[-1] == got.stats.samples_passed[-1] == 0
    assert all(passed >= peeled for passed, peeled in zip(got.stats.samples_passed, left, strict=True))


@pytest.mark.parametrize("passes", [1, 2, 5])
def test_the_nearest_layers_are_peeled_first(passes: int, lanes: int) -> None:
    """Of layers submitted in any order the colours of the nearest, in exact powers of two."""
    order = np.random.default_rng(7).permutation(6)
    colors = np.zeros((6, 4))
    colors[np.arange(6), np.arange(6) % 3] = 1
    colors[:, 3] = 0.5
    scene = soups.stack(1.0 + order, colors[order]).scene()
    got = plainly.render(scene, AHEAD.camera(), (4, 3), "depth-peeling", passes=passes, lanes=lanes)
    want = sum(colors[k] * [0.5, 0.5, 0.5, 1] * 0.5**k for k in range(passes))
    assert (got.color == want).all()


def test_it_is_multi_layer_peeling_of_one_layer_a_pass(lanes: int, judge: Judge) -> None:
    soup, size = soups.random(72, 120, "mixed", "vertex"), (40, 30)
    one, other = (
        plainly.render(soup.scene(), BENCH.camera(), size, technique, lanes=lanes, passes=3, **options)
        for technique, options in (("depth-peeling", {}), ("multi-layer-peeling", {"layers_per_pass": 1}))
    )
    judge.same_bits(one, other, "depth-peeling")
    assert one.stats.samples_passed == other.stats.samples_passed
