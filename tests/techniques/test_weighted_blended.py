"""weighted-blended: the paper's equations against float64, their extremes, 16-bit sums, and how wrong it may be."""

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
from twins.soups import AHEAD, BENCH, Eye

import clpeel
from clpeel.techniques import technique
from clpeel.techniques.weighted_blended import WEIGHTS, WeightedBlendedOptions

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

Floats = NDArray[np.float64]

DEPTH_ROUNDINGS = 12
"""Of a depth: a corner's, its shift to the snapped corner, and the interpolation's."""


def window_depth(z: Floats, near: float, far: float, linear: bool) -> Floats:
    """The paper's equation 11 with distances in place of its negative z: OpenGL's depth, 0 near to 1 far.

    linear: in parallel projection.
    """
    return (z - near) / (far - near) if linear else (near * far / z - far) / (near - far)


def weight_of(equation: str, z: Floats, alpha: Floats, near: float, far: float, linear: bool) -> Floats:
    """The weights of the paper's equations 7 to 10, at distances z."""
    inner = {
        "7": 10 / (1e-5 + (z / 5) ** 2 + (z / 200) ** 6),
        "8": 10 / (1e-5 + (z / 10) ** 3 + (z / 200) ** 6),
        "9": 0.03 / (1e-5 + (z / 200) ** 4),
        "10": 3e3 * (1 - window_depth(z, near, far, linear)) ** 3,
    }[equation]
    return alpha * np.maximum(1e-2, np.minimum(3e3, inner))


def blended(equation: str, z: Any, colors: Any, near: float, far: float, linear: bool = False) -> Floats:
    """Equation 6: straight RGBA [n, 4] at distances [n] to premultiplied RGBA, without what is behind."""
    z, colors = np.asarray(z, float), np.asarray(colors, float)
    alpha = colors[:, 3]
    weights = weight_of(equation, z, alpha, near, far, linear)
    coverage = 1 - (1 - alpha).prod()
    total = (alpha * weights).sum()
    mean = (colors[:, :3] * (alpha * weights)[:, None]).sum(axis=0) / total if total else np.zeros(3)
    return np.r_[mean * coverage, coverage]


def bound(count: int, z: Any, near: float, far: float) -> float:
    """How far off a channel may be after `count` layers of which the farthest is at distance z.

    A mean moves by twice what its weights are off by. A power is off by its exponent times the roundings of its base,
    which are those of a depth and 4. 1 - d is the difference of near far / z and near, over far - near, and so it is
    off by these roundings of the former. It does not count where (1 - d)^3 < 1/300,000, as the weight is 1/100 there.
    The sums above and below the line, and the product of all 1 - A, have a rounding for each layer.
    """
    before = near * far / float(np.max(z)) / (far - near)
    left = max(before - near / (far - near), (1 / 3e5) ** (1 / 3))
    own = 6 * (DEPTH_ROUNDINGS + 4) * max(1.0, before / left)
    return (2 * own + 4 * count + 12) * UNIT


def render(z: Any, colors: Any, lanes: int = 1, view: Eye = AHEAD, **options: Any) -> Floats:
    """One pixel's premultiplied colour with these layers, opaque ones too, in the order that they are given in."""
    scene = soups.stack(z, np.asarray(colors, np.float32)).scene()
    result = plainly.render(scene, view.camera(), (5, 3), "weighted-blended", lanes=lanes, opaque="blend", **options)
    assert (result.color == result.color[0, 0]).all()
    color: Floats = result.color[0, 0].astype(float)
    return color


# --- the equations ----------------------------------------------------------------------------------------------------


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.sampled_from((1, 2, 3, 9, 100, 300)),
    equation=st.sampled_from(WEIGHTS),
    alpha=st.sampled_from((0.02, 0.5, 1.0)),
    far=st.sampled_from((8.0, 90.0, 3000.0)),
    lanes=st.sampled_from((1, 64)),
)
def test_the_equations_of_the_paper(seed: int, count: int, equation: str, alpha: float, far: float, lanes: int) -> None:
    rng = np.random.default_rng(seed)
    colors = rng.random((count, 4)).astype(np.float32)
    colors[:, 3] *= np.float32(alpha)
    view = Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(0.5, far))
    away = np.exp(rng.uniform(np.log(0.6), np.log(0.95 * far), count))
    got = render(away, colors, lanes, view, weight=equation)
    assert np.abs(got - blended(equation, away, colors, 0.5, far)).max() <= bound(count, away, 0.5, far)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("equation", WEIGHTS)
def test_against_the_twin(equation: str, orthographic: bool, lanes: int, judge: Judge) -> None:
    soup, size = soups.random(7, 200, "mixed", "flat8"), (60, 50)
    view = Eye(orthographic=orthographic)
    twin, excused, _ = judge.weigh(soup, view, size)
    result = plainly.render(soup.scene(), view.camera(), size, "weighted-blended", lanes=lanes, weight=equation)
    straight = twin.projected.colors[twin.triangle][:, 0]
    want = np.zeros((size[0] * size[1], 4))
    for pixel in np.unique(twin.pixel):
        here = twin.pixel == pixel
        want[pixel] = blended(equation, twin.distance[here], straight[here], 2.0, 6.0, orthographic)
    farthest = twin.distance.max()
    assert farthest < 5.75 and twin.layers.max() > 5
    most = bound(int(twin.layers.max()), farthest, 2.0, 6.0)
    # In parallel projection a depth is off by roundings of the clipping range, and 1 - d is at least 1/16 of it.
    most = 16 * most if orthographic else most
    error = np.abs(result.color - want.reshape(size[1], size[0], 4)).max(axis=2)
    assert (error <= most)[~excused].all()


@pytest.mark.parametrize("equation", WEIGHTS)
def test_opaque_surfaces_behind(equation: str, lanes: int) -> None:
    """Equation 6's C0 is what is opaque, and layers behind it are not there."""
    away = np.array([1.0, 5.0, 2.0, 3.0])
    colors = np.float32([(1, 0, 0, 0.5), (1, 1, 1, 0.5), (0, 1, 0, 0.25), (0.25, 0.5, 1, 1)])
    scene = soups.stack(away, colors).scene()
    got = plainly.render(scene, AHEAD.camera(), (5, 3), "weighted-blended", lanes=lanes, weight=equation).color
    front = blended(equation, away[[0, 2]], colors[[0, 2]], 0.5, 8.0)
    want = np.r_[front[:3] + (1 - front[3]) * colors[3, :3], 1]
    assert np.abs(got - want).max() <= bound(3, 3.0, 0.5, 8.0)


def test_several_samples_are_the_mean(lanes: int) -> None:
    scene = soups.random(5, 60, "large", "vertex").scene()
    fine = plainly.render(scene, BENCH.camera(), (40, 24), "weighted-blended", lanes=lanes).color.astype(float)
    mean = plainly.render(scene, BENCH.camera(), (5, 3), "weighted-blended", lanes=lanes, samples=64).color
    assert np.abs(mean - fine.reshape(3, 8, 5, 8, 4).mean(axis=(1, 3))).max() <= 65 * UNIT


# --- extremes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("equation", WEIGHTS)
@pytest.mark.parametrize("alpha", [0.0, 2.0**-20, 1 / 255, 0.3, 1.0])
def test_one_layer_is_exact(equation: str, alpha: float, lanes: int) -> None:
    one = np.float32([0.3, 0.7, 1.0, alpha])
    got = render([2.0], one[None], lanes, weight=equation)
    assert got[3] == np.float32(1) - (np.float32(1) - one[3])
    # Two products with the weight, a quotient and a product: 4 roundings of the colour, and none of alpha 0.
    assert np.abs(got[:3] - one[:3].astype(float) * got[3]).max() <= 4 * UNIT * float(got[3])


@pytest.mark.parametrize("equation", WEIGHTS)
def test_alphas_of_zero_and_one(equation: str, lanes: int) -> None:
    colors = np.random.default_rng(4).random((7, 4)).astype(np.float32)
    colors[:, 3] = 0
    assert not render(np.linspace(1, 7, 7), colors, lanes, weight=equation).any()
    # One of alpha 1 among them: what has alpha 0 does not weigh.
    colors[4, 3] = 1
    got = render(np.linspace(1, 7, 7), colors, lanes, weight=equation)
    assert got[3] == 1 and np.abs(got[:3] - colors[4, :3]).max() <= 4 * UNIT
    # All have it: nothing comes through, and the colour is a mean of all of them, by nearness alone.
    colors[:, 3] = 1
    got = render(np.linspace(1, 7, 7), colors, lanes, weight=equation)
    assert got[3] == 1
    assert np.abs(got - blended(equation, np.linspace(1, 7, 7), colors, 0.5, 8.0)).max() <= bound(7, 7.0, 0.5, 8.0)


@pytest.mark.parametrize("count", [300, 3000])
def test_thousands_of_layers_that_are_alike(count: int, lanes: int) -> None:
    rgba = np.float32([0.5, 0.25, 1, 0.002])
    coverage = 1 - (1 - float(rgba[3])) ** count
    got = render(np.linspace(1, 7, count), np.tile(rgba, (count, 1)), lanes)
    assert np.abs(got - np.r_[rgba[:3] * coverage, coverage]).max() <= (4 * count + 12) * UNIT


def test_equal_depths_weigh_by_alpha_alone(lanes: int) -> None:
    colors = np.float32([(1, 0, 0, 0.5), (0, 1, 0, 0.25), (0, 0, 1, 0.75)])
    got = [render([2.0] * 3, colors, lanes, weight=equation) for equation in WEIGHTS]
    coverage, square = 1 - 0.5 * 0.75 * 0.25, np.array([0.25, 0.0625, 0.5625])
    want = np.r_[square / square.sum() * coverage, coverage]
    assert np.abs(np.array(got) - want).max() <= 12 * UNIT


@pytest.mark.parametrize("depth_format", ["float32-reversed", "float32", "unorm24", "rgba8"])
def test_a_range_of_ten_millions(depth_format: str, lanes: int) -> None:
    """By equation 10 what is a thousand times as far as the near plane weighs 1/100, the least; by 9 it does not."""
    view = Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4))
    colors = np.float32([(1, 0, 0, 0.5), (0, 1, 0, 0.5)])
    got = render([1.0, 9e3], colors, lanes, view, depth_format=depth_format)
    assert np.abs(got - [0.375, 0.375, 0, 0.75]).max() <= 8 * UNIT
    near = render([1.001e-3, 9e3], colors, lanes, view, depth_format=depth_format)
    assert near[0] == pytest.approx(0.75 * 299_100 / 299_101, rel=1e-4)  # 3000 (1 - 0.001)^3 and 1/100
    if depth_format == "float32-reversed":  # the others do not tell these distances apart
        got = render([100.0, 400.0], colors, lanes, view, weight="9")
        want = blended("9", [100.0, 400.0], colors, 1e-3, 1e4)
        assert np.abs(got - want).max() <= bound(2, 1.0, 1e-3, 1e4) and want[0] > 10 * want[1]


def test_an_empty_view(lanes: int) -> None:
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    result = plainly.render(soups.random(1, 5).scene(), away, (20, 10), "weighted-blended", lanes=lanes)
    assert not result.color.any() and (result.image == 255).all()


# --- 16-bit buffers ---------------------------------------------------------------------------------------------------


def test_half_buffers_round_each_blend(lanes: int) -> None:
    rng = np.random.default_rng(2)
    away, colors = rng.permutation(np.linspace(1, 7, 20)), rng.uniform(0.1, 0.6, (20, 4)).astype(np.float32)
    got = render(away, colors, lanes, precision="half")
    want = blended("10", away, colors, 0.5, 8.0)
    # A sum is off by 2^-11 of itself at each of 20 blends, above and below the line, and coverage by 2^-12 of 1.
    assert UNIT * 100 < np.abs(got - want).max() <= (2 * 20 * 2.0**-11 + 20 * 2.0**-12)


def test_half_sums_that_overflow_leave_a_mean(lanes: int) -> None:
    """The paper's weights go to 3000, so that 16-bit floats hold 21 opaque layers at the near plane, and no more."""
    view = Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1.0, 1e6))
    colors = np.tile(np.float32([1.0, 0.25, 0.0, 1.0]), (100, 1))
    few = render(np.full(21, 1.0001), colors[:21], lanes, view, precision="half")
    assert np.abs(few - [1, 0.25, 0, 1]).max() <= 21 * 2.0**-10
    many = render(np.full(100, 1.0001), colors, lanes, view, precision="half")
    # Both sums are at their end, 65504, but green: it is 100 x 750, which is beyond it, too.
    assert (many == [1, 1, 0, 1]).all()
    assert (render(np.full(100, 1.0001), colors, lanes, view) <= 1 + 4 * UNIT).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"precision": "unorm8"}, "precision: expected one of float32, half with .*weighted-blended, got 'unorm8'"),
        ({"weight": "6"}, "weight: expected one of 7, 8, 9, 10; got '6'"),
        ({"weight": None}, "weight: expected one of 7, 8, 9, 10"),
        ({"passes": 2}, "passes: the technique 'weighted-blended' has no such option"),
        ({"max_error": 0.1}, "max_error: the technique 'weighted-blended' has no such option"),
        ({"execution": "passes"}, "execution: expected 'tiles'.*weighted-blended"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=message) as error:
        plainly.render(soups.random(1, 5).scene(), BENCH.camera(), (4, 4), "weighted-blended", **options)
    assert "\n" not in str(error.value)


# --- order, and what it costs not to know it --------------------------------------------------------------------------


def test_the_same_bits_with_any_lanes_and_memory(judge: Judge) -> None:
    scene = soups.stack(np.random.default_rng(2).uniform(1, 7, 900), (0.3, 0.6, 0.9, 0.001)).scene()
    for precision in ("float32", "half"):
        runs = [
            plainly.render(scene, AHEAD.camera(), (16, 16), "weighted-blended", **call, precision=precision)
            for call in ({"lanes": lanes, "memory": memory} for lanes in (1, 64) for memory in ("256M", "1M"))
        ]
        for other in runs[1:]:
            judge.same_bits(other, runs[0])


def test_the_order_of_submission_changes_roundings_alone(lanes: int) -> None:
    soup, size = soups.random(3, 150, "large"), (40, 30)
    order = np.random.default_rng(1).permutation(len(soup.faces))
    one, other = (
        plainly.render(each.scene(), BENCH.camera(), size, "weighted-blended", lanes=lanes)
        for each in (soup, soup.take(order))
    )
    # A rounding of each sum for each layer: of two sums and a product, in both pictures.
    most = 2 * (3 * one.stats["layers_max"] + 3) * UNIT
    assert 0 < np.abs(one.color.astype(float) - other.color).max() <= most


def test_how_wrong_it_may_be(lanes: int) -> None:
    """The numbers of docs/techniques.md: behind a red layer that hides them, so many blue ones as near as it is."""
    errors = {}
    for behind in (1, 9, 99):
        colors = np.tile(np.float32([0, 0, 1, 0.99]), (behind + 1, 1))
        colors[0] = 1, 0, 0, 0.99
        away = 2 + np.arange(behind + 1) * 2.0**-12
        scene = soups.stack(away, colors).scene()
        exact, got = (plainly.render(scene, AHEAD.camera(), (2, 2), name, lanes=lanes) for name in ("sort", TECHNIQUE))
        errors[behind] = float(np.abs(exact.color - got.color).max())
    assert {behind: round(error, 2) for behind, error in errors.items()} == {1: 0.49, 9: 0.89, 99: 0.98}


TECHNIQUE = "weighted-blended"


def test_it_is_compared_with_each_of_its_weights() -> None:
    made = technique(TECHNIQUE)
    assert made.options().weight == "10"
    assert [each.weight for each in made.compared()] == ["7", "8", "9"]
    assert all(isinstance(each, WeightedBlendedOptions) for each in made.compared())
    assert made.error_without_order(3, 0.1) is None, "so that auto never chooses it"
