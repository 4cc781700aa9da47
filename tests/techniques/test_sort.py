"""sort: the order it promises, at every length where its ways of sorting change, in any memory, and what it reports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD

import clpeel
from clpeel.device.layout import TILE_PIXELS

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

# Below, at and above powers of two and their multiples: where runs, vectors and merges begin and end.
LENGTHS = [0, 1, 2, 3, 5, 8, *(n + d for n in (16, 24, 32, 48, 64, 128, 192, 256) for d in (-1, 0, 1)), 700, 4097]


def over(colors: np.ndarray) -> np.ndarray:
    """Straight RGBA [n, 4], front to back, to premultiplied RGBA: the recursion from the back."""
    result = np.zeros(4)
    for rgba in colors.astype(float)[::-1]:
        result = np.r_[rgba[:3], 1] * rgba[3] + (1 - rgba[3]) * result
    return result


def layers(rng: np.random.Generator, count: int, places: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances at so many places only, so that many coincide, and colours: float64 [n], float32 [n, 4]."""
    colors = rng.random((count, 4)).astype(np.float32)
    colors[:, 3] *= np.float32(min(1.0, 8 / max(count, 1)))  # so that the last layers still show
    return rng.choice(np.linspace(1, 7, places), count), colors


@pytest.mark.parametrize("places", [1, 7, 100_000])
@pytest.mark.parametrize("arrival", ["random", "sorted", "reversed"])
def test_order_is_depth_then_submission(places: int, arrival: str, lanes: int, judge: Judge) -> None:
    for count in LENGTHS:
        distances, colors = layers(np.random.default_rng(count), count, places)
        if arrival != "random":
            distances = np.sort(distances) if arrival == "sorted" else -np.sort(-distances)
        # One more behind everything, fully transparent, so that a count of 0 is a scene too.
        soup = soups.stack(np.append(distances, 7.5), np.concatenate([colors, np.zeros((1, 4), np.float32)]))
        result = plainly.render(soup.scene(), AHEAD.camera(), size=(3, 3), lanes=lanes, technique="sort")
        order = np.argsort(distances, kind="stable")
        assert result.stats["layers_max"] == count + 1
        judge.color(result, over(colors[order]), (3 * count + 7) * UNIT, f"{count} layers")


def test_pixels_of_a_tile_have_lengths_of_their_own(lanes: int, judge: Judge) -> None:
    # Layer k covers the pixels right of column k * 40 / count only: lengths from 0 to 100 side by side.
    count, width = 100, 40
    rng = np.random.default_rng(5)
    depth = rng.permutation(np.linspace(-2, 0.5, count))
    left = np.arange(count) * width / count - width / 2
    corners = np.empty((count, 3, 3))
    corners[..., 0] = np.stack([left, left, left + 400], -1)
    corners[..., 1] = [-200, 200, 0]
    corners[..., 2] = depth[:, None]
    colors = rng.random((count, 4)).astype(np.float32) * np.array([1, 1, 1, 0.2], np.float32)
    view = soups.pixel_view(10)
    result = plainly.render(soups.separate(corners, colors).scene(), view.camera(), size=(width, 10), lanes=lanes)
    for column in range(width):
        here = np.flatnonzero(left <= column + 0.5 - width / 2)
        want = over(colors[here[np.argsort(-depth[here])]])
        assert np.abs(result.color[:, column] - want).max() <= (3 * len(here) + 4) * UNIT


@pytest.mark.parametrize("colors", ["flat8", "flat", "vertex"])
def test_windows_within_a_tile_change_nothing(colors: str, lanes: int, judge: Judge) -> None:
    """One tile with more fragments than the memory holds at once is drawn in runs of its pixels."""
    count = 900
    rng = np.random.default_rng(6)
    painted: Any = rng.random((count, 4)).astype(np.float32) * np.array([1, 1, 1, 0.05], np.float32)
    if colors == "flat8":
        painted = np.round(painted * 255).astype(np.uint8)
    soup = soups.stack(rng.uniform(1, 7, count), painted)
    if colors == "vertex":
        soup = soups.Soup(soup.vertices, soup.faces, vertex_colors=np.repeat(painted, 3, axis=0))
    scene, size = soup.scene(), (16, 16)
    plenty = plainly.render(scene, AHEAD.camera(), size=size, lanes=lanes, memory="256M")
    assert plenty.stats["fragments"] == count * TILE_PIXELS > 2**20 / 8, "fits a window"
    tight = plainly.render(scene, AHEAD.camera(), size=size, lanes=lanes, memory="1M")
    judge.same_bits(tight, plenty)
    assert tight.stats["fragments"] == plenty.stats["fragments"]
    assert tight.stats["layers_max"] == plenty.stats["layers_max"] == count


def test_near_n_log_n(lanes: int) -> None:
    """Sixteen times the layers take about 20 times as long to sort, and would take 256 times if each met each."""
    seconds = []
    for count in (8192, 131_072):
        distances = np.random.default_rng(count).uniform(1, 7, count)
        soup = soups.stack(distances, (0.5, 0.5, 0.5, 1e-4))
        renderer = plainly.Renderer(soup.scene(), lanes=lanes)
        times = [renderer.render(AHEAD.camera(), size=(1, 1)).stats["seconds"]["sort"] for _ in range(3)]
        seconds.append(min(times))
    assert seconds[1] < 80 * seconds[0]


def test_what_it_reports(lanes: int) -> None:
    soup = soups.stack([1.0, 2.0, 3.0], (1.0, 1.0, 1.0, 0.5))
    stats = plainly.render(soup.scene(), AHEAD.camera(), size=(20, 10), lanes=lanes, technique="sort").stats
    assert stats["technique"] == "sort" and stats["passes"] == 1 and stats["passes_issued"] >= 1
    assert stats["fragments"] == 600 and stats["samples_passed"] == [600] and stats["layers_max"] == 3
    assert stats["discarded"] == 0 and stats["truncated_pixels"] == 0
    assert stats["seconds"] and all(value >= 0 for value in stats["seconds"].values())
    assert stats["bytes"] and all(value >= 0 for value in stats["bytes"].values())
    assert stats["bytes_per_pixel"] > 0 and stats["device"]


def test_it_is_the_default() -> None:
    soup = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5))
    assert plainly.render(soup.scene(), AHEAD.camera(), size=(2, 2)).stats["technique"] == "sort"


def test_unknown_techniques_and_options() -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match="sort.*'sorted'"):
        plainly.render(scene, AHEAD.camera(), size=(2, 2), technique="sorted")
    with pytest.raises(clpeel.InputError, match="passes: the technique 'sort' has no such option; it has camera"):
        plainly.render(scene, AHEAD.camera(), size=(2, 2), passes=3)
