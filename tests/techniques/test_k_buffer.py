"""k-buffer: the paper's formulas against float64, from weighted-average to sort, and its extremes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

Floats = NDArray[np.float64]
SIZE = (60, 50)


def average(colors: Floats) -> Floats:
    """Straight RGBA [n, 4] to premultiplied RGBA: n layers of their average (Bavoil and Myers 2008)."""
    n, total = len(colors), colors[:, 3].sum()
    coverage = -np.expm1(n * np.log1p(-min(total / max(n, 1), 1 - 2.0**-60)))
    shown = (colors[:, :3] * colors[:, 3:]).sum(axis=0) / total if total else np.zeros(3)
    return np.r_[shown * coverage, coverage]


def hybrid(colors: Floats, distances: Floats, k: int, kept_by: str = "depth", tail: str = "weighted-average") -> Floats:
    """Straight RGBA [n, 4] as submitted to premultiplied RGBA: k in order, over the average of the rest."""
    order = np.argsort(distances, kind="stable") if kept_by == "depth" else np.arange(len(colors))
    kept, rest = order[:k], order[k:] if tail != "none" else order[:0]
    shown = average(colors[rest])
    for rgba in colors[kept[np.argsort(distances[kept], kind="stable")]][::-1]:
        shown = np.r_[rgba[:3], 1] * rgba[3] + (1 - rgba[3]) * shown
    return shown


def render(colors: Any, distances: Any, lanes: int, **options: Any) -> clpeel.Result:
    """A few pixels that all see these layers; opaque ones are blended too."""
    scene = soups.stack(distances, np.asarray(colors, np.float32)).scene()
    return plainly.render(scene, AHEAD.camera(), (5, 3), "k-buffer", lanes=lanes, opaque="blend", **options)


def shown(colors: Any, distances: Any, lanes: int, **options: Any) -> Floats:
    """The premultiplied colour of these layers."""
    result = render(colors, distances, lanes, **options)
    assert (result.color == result.color[0, 0]).all()
    return result.color[0, 0].astype(float)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 60),
    alpha=st.sampled_from([0.02, 0.5, 1.0]),
    places=st.sampled_from([1, 5, 10_000]),
)
@pytest.mark.parametrize(("kept", "kept_by"), [(1, "depth"), (7, "depth"), (8, "arrival")])
def test_the_formulas_of_the_papers(
    kept: int, kept_by: str, seed: int, count: int, alpha: float, places: int, lanes: int
) -> None:
    rng = np.random.default_rng(seed)
    colors = rng.random((count, 4)).astype(np.float32) * np.array([1, 1, 1, alpha], np.float32)
    distances = rng.choice(np.linspace(1, 7, places), count)  # of which many may be equal
    got = shown(colors, distances, lanes, kept_layers=kept, kept_by=kept_by)
    # Sums have n roundings for their alphas and n for their colours, and a few to divide; each kept layer three.
    bound = (3 * count + 12) * UNIT
    assert np.abs(got - hybrid(colors.astype(float), distances, kept, kept_by)).max() <= bound


def test_from_weighted_average_to_sort(lanes: int, judge: Judge) -> None:
    scene = soups.random(7, 400, "mixed", "flat8").scene()

    def picture(technique: str, **options: Any) -> clpeel.Result:
        return plainly.render(scene, BENCH.camera(), SIZE, technique, lanes=lanes, **options)

    average, exact = picture("weighted-average"), picture("sort")
    assert 8 < exact.stats["layers_max"] <= 24
    judge.same_bits(picture("k-buffer", kept_layers=0), average, "nothing is kept: expected weighted-average's bits")
    for kept_by in ("depth", "arrival"):
        all_of_them = picture("k-buffer", kept_layers=24, kept_by=kept_by)
        judge.same_bits(all_of_them, exact, f"all are kept, by {kept_by}: expected sort's bits")
    nearest = picture("k-buffer", kept_layers=8, tail="none")
    judge.same_bits(nearest, picture("multi-layer-peeling", layers_per_pass=8, passes=1), "the eight nearest alone")
    errors = [
        np.abs(picture("k-buffer", kept_layers=kept).color - exact.color).max(axis=2) for kept in (0, 1, 2, 4, 8, 16)
    ]
    means = [error.mean() for error in errors]
    assert means == sorted(means, reverse=True) and means[0] > 0.05 and means[-1] < 1e-6


def test_no_channel_is_off_by_more_than_what_is_seen_of_the_tail(lanes: int) -> None:
    rng = np.random.default_rng(4)
    for kept in (0, 2, 5):
        colors = rng.random((12, 4)).astype(np.float32)
        distances = rng.permutation(np.linspace(1, 7, 12))
        got = shown(colors, distances, lanes, kept_layers=kept)
        nearest = colors[np.argsort(distances)][:kept].astype(float)
        error = np.abs(got - hybrid(colors.astype(float), distances, 12)).max()
        assert 0 < error <= np.prod(1 - nearest[:, 3]) + 60 * UNIT


@pytest.mark.parametrize("colors", ["flat", "vertex"])
def test_the_same_bits_on_both_shapes(colors: str, judge: Judge) -> None:
    soup = soups.random(9, 300, "mixed", colors)
    scene = (soups.with_opaque(soup) if colors == "flat" else soup).scene()
    for kept, kept_by, precision in ((3, "depth", "float32"), (9, "depth", "half"), (5, "arrival", "unorm8")):
        one, other = (
            plainly.render(
                scene,
                BENCH.camera(),
                SIZE,
                "k-buffer",
                lanes=lanes,
                kept_layers=kept,
                kept_by=kept_by,  # type: ignore[arg-type]
                precision=precision,  # type: ignore[arg-type]
            )
            for lanes in (1, 64)
        )
        judge.same_bits(one, other, f"{kept} by {kept_by}, {precision}")


def test_the_tail_that_is_left_out_is_counted(lanes: int) -> None:
    scene = soups.random(7, 400, "mixed", "flat8").scene()
    layers = plainly.render(scene, BENCH.camera(), SIZE, "layer-count", lanes=lanes).layer_count
    for kept, kept_by in ((0, "depth"), (4, "depth"), (8, "arrival")):
        stats = plainly.render(
            scene, BENCH.camera(), SIZE, "k-buffer", lanes=lanes, kept_layers=kept, kept_by=kept_by, tail="none"
        ).stats
        assert stats["truncated_pixels"] == np.count_nonzero(layers > kept) > 0
        assert stats["truncation_bound"] == 1
    stats = plainly.render(scene, BENCH.camera(), SIZE, "k-buffer", lanes=lanes, kept_layers=4).stats
    assert stats["truncated_pixels"] == stats["truncation_bound"] == 0


def test_extremes(lanes: int) -> None:
    rng = np.random.default_rng(0)
    # All alphas zero: the background, bit for bit, with and without a tail.
    assert not shown([[1, 1, 1, 0.0]] * 12, np.linspace(1, 7, 12), lanes).any()
    # One layer is exact: its colour times its alpha, rounded once, and its alpha, whether it is kept or the tail.
    one = np.array([0.3, 0.7, 1.0, 1 / 255], np.float32)
    for kept in (0, 1, 64):
        got = shown(one[None], [3.0], lanes, kept_layers=kept)
        assert (got[:3] == one[:3] * one[3]).all() and got[3] == np.float32(1) - (np.float32(1) - one[3])
    # An opaque layer among those kept hides the tail; as part of the tail it is one of many.
    colors = np.r_[np.full((20, 4), (0.25, 0.5, 1, 0.5)), [[1, 0, 0, 1]]]
    distances = np.r_[np.linspace(3, 7, 20), 1.0]
    assert (shown(colors, distances, lanes) == [1, 0, 0, 1]).all()
    # Thousands of layers, all alike, are what the average takes them for. So many at one depth are kept by submission.
    for n, alpha in ((3000, 1 / 255), (65_536, 2.0**-20)):
        alike = shown(np.full((n, 4), (0.5, 0.25, 1, alpha)), np.full(n, 2.0), lanes)
        want = np.array([0.5, 0.25, 1, 1]) * -np.expm1(n * np.log1p(-float(np.float32(alpha))))
        assert np.abs(alike - want).max() <= (2 * n + 60) * UNIT
    colors = rng.random((700, 4)).astype(np.float32) * np.array([1, 1, 1, 0.01], np.float32)
    for kept_by in ("depth", "arrival"):
        got = shown(colors, np.full(700, 2.0), lanes, kept_layers=64, kept_by=kept_by)
        want = hybrid(colors.astype(float), np.full(700, 2.0), 64, kept_by)
        assert np.abs(got - want).max() <= (2 * 700 + 200) * UNIT


def test_near_and_far_ten_million_apart(lanes: int) -> None:
    view = soups.Eye(
        position=(0.0, 0.0, 0.0), focal_point=(0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4)
    )
    rng = np.random.default_rng(2)
    distances = rng.permutation(np.geomspace(2e-3, 5e3, 30))
    colors = rng.random((30, 4)).astype(np.float32) * np.array([1, 1, 1, 0.3], np.float32)
    scene = soups.stack(distances, colors).scene()
    got = plainly.render(scene, view.camera(), (4, 4), "k-buffer", lanes=lanes, kept_layers=5).color
    assert np.abs(got - hybrid(colors.astype(float), distances, 5)).max() <= 120 * UNIT


def test_nothing_to_be_seen(lanes: int) -> None:
    away = soups.stack([20.0], (1.0, 1.0, 1.0, 0.5)).scene()
    result = plainly.render(away, AHEAD.camera(), (4, 4), "k-buffer", lanes=lanes)
    assert not result.color.any() and (result.image == 255).all()


def test_hardware_takes_eight_a_pass() -> None:
    technique = TECHNIQUES["k-buffer"]
    for kept, passes in ((0, 0), (8, 1), (9, 2), (16, 2), (64, 8)):
        assert technique.passes_for(100, technique.options(kept_layers=kept, kept_by="arrival")) == passes
        assert technique.passes_for(100, technique.options(kept_layers=kept)) == 1


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"kept_layers": -1}, "kept_layers: expected 0..64, got -1"),
        ({"kept_layers": 65}, "kept_layers: expected 0..64, got 65"),
        ({"kept_layers": 2.5}, "kept_layers: expected 0..64, got 2.5"),
        ({"kept_by": "luck"}, "kept_by: expected one of depth, arrival; got 'luck'"),
        ({"tail": "sort"}, "tail: expected one of weighted-average, none; got 'sort'"),
        ({"max_error": 0.1}, "max_error: the technique 'k-buffer' has no such option"),
    ],
)
def test_options_that_there_are_not(options: dict[str, Any], error: str) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match=error):
        plainly.render(scene, AHEAD.camera(), (2, 2), "k-buffer", **options)
