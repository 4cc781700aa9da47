"""dual-depth-peeling: each pass peels the nearest and the farthest layer that are left (Bavoil and Myers 2008)."""

from __future__ import annotations

import numpy as np
import plainly
import pytest
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel

pytestmark = pytest.mark.usefixtures("shared_devices")


def alternating(count: int) -> tuple[clpeel.Scene, np.ndarray]:
    """Layers submitted in some order, nearest first in the array of their colours."""
    order = np.random.default_rng(count).permutation(count)
    colors = np.random.default_rng(8).random((count, 4)) * [1, 1, 1, 0.5] + [0, 0, 0, 0.25]
    return soups.stack(np.linspace(1, 7, count)[order], colors[order]).scene(), colors.astype(np.float32)


def over(colors: np.ndarray) -> np.ndarray:
    """Premultiplied, front to back, in float64."""
    color, through = np.zeros(3), 1.0
    for red_green_blue, alpha in ((row[:3], row[3]) for row in colors.astype(float)):
        color, through = color + through * alpha * red_green_blue, through * (1 - alpha)
    return np.r_[color, 1 - through]


@pytest.mark.parametrize("count", [5, 6, 7, 12])
@pytest.mark.parametrize("passes", [1, 2, 3])
def test_the_outermost_layers_are_peeled_first(count: int, passes: int, lanes: int) -> None:
    """From both ends, and the middle one once."""
    scene, colors = alternating(count)
    got = plainly.render(scene, AHEAD.camera(), (4, 3), "dual-depth-peeling", passes=passes, lanes=lanes)
    some = np.arange(count)
    outer = colors[(some < passes) | (some >= count - passes)]
    assert np.abs(got.color - over(outer)).max() <= 3 * (len(outer) + 1) * UNIT
    assert got.stats.layers_max == len(outer)


def test_the_first_pass_only_looks_for_the_ends(lanes: int) -> None:
    """It passes all fragments by, and blends none; each further pass finds two layers a pixel, and at last one."""
    soup, size = soups.random(73, 150, "mixed", alpha=(0.05, 0.2)), (50, 40)
    layers = plainly.render(soup.scene(), BENCH.camera(), size, "layer-count").layer_count.astype(int)
    got = plainly.render(soup.scene(), BENCH.camera(), size, "dual-depth-peeling", lanes=lanes)
    most = int(layers.max())
    assert got.stats.passes == (most // 2 + 1 if most % 2 == 0 else (most + 1) // 2 + 1)
    assert got.stats.layers_max == most and got.stats.fragments == layers.sum()
