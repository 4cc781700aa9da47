"""weighted-average: the paper's formula against float64, its extremes, and the 16-bit sums of both that do not sort."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import plainly
import pytest
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")


def average(colors: np.ndarray) -> np.ndarray:
    """Straight RGBA [n, 4] to premultiplied RGBA by the paper's formula, in float64."""
    n, total = len(colors), colors[:, 3].sum()
    coverage = -np.expm1(n * np.log1p(-min(total / n, 1 - 2.0**-60)))
    return np.r_[(colors[:, :3] * colors[:, 3:]).sum(axis=0) / total * coverage, coverage]


def render(colors: np.ndarray, lanes: int = 1, **options: str) -> np.ndarray:
    """One pixel's premultiplied colour with these layers, opaque ones too, in random order of distance."""
    away = np.random.default_rng(0).permutation(np.linspace(1, 7, len(colors)))
    scene = soups.stack(away, np.asarray(colors, np.float32)).scene()
    result = plainly.render(scene, AHEAD.camera(), (5, 3), "weighted-average", lanes=lanes, opaque="blend", **options)
    assert (result.color == result.color[0, 0]).all()
    return result.color[0, 0].astype(float)


@pytest.mark.parametrize("count", [1, 2, 3, 8, 9, 100, 257, 3000])
@pytest.mark.parametrize("alpha", [0.01, 0.5, 1.0])
def test_the_formula_of_the_paper(count: int, alpha: float, lanes: int) -> None:
    colors = np.random.default_rng(count).random((count, 4)).astype(np.float32)
    colors[:, 3] *= np.float32(alpha)
    # Of n alphas n roundings of their sum, by which A is off, and the coverage by n A (1 - A)^(n - 1) < 1 times that;
    # as many of the colour's sum; a few more to divide and multiply.
    assert np.abs(render(colors, lanes) - average(colors.astype(float))).max() <= (2 * count + 8) * UNIT


def test_against_the_twin(lanes: int, judge: Judge) -> None:
    soup, size = soups.random(7, 200, "mixed", "flat8"), (60, 50)
    twin, excused, _ = judge.weigh(soup, BENCH, size)
    result = plainly.render(soup.scene(), BENCH.camera(), size, "weighted-average", lanes=lanes)
    straight = twin.projected.colors[twin.triangle][:, 0]
    want = np.zeros((size[0] * size[1], 4))
    for pixel in np.unique(twin.pixel):
        want[pixel] = average(straight[twin.pixel == pixel])
    error = np.abs(result.color - want.reshape(size[1], size[0], 4)).max(axis=2)
    assert (error <= (2 * twin.layers + 8) * UNIT)[~excused].all() and twin.layers.max() > 5


def test_extremes(lanes: int) -> None:
    # 15: all alphas zero: the background, bit for bit.
    assert not render(np.array([[1, 1, 1, 0.0]] * 5), lanes).any()
    # 16: A = 2^-25, n = 1000: 1 - A rounds to one, and yet the coverage is 2.98e-5.
    tiny = render(np.array([[1, 0.5, 0, 2.0**-25]] * 1000), lanes)
    coverage = -np.expm1(1000 * np.log1p(-(2.0**-25)))
    assert tiny[0] == pytest.approx(coverage, rel=1e-6) and coverage == pytest.approx(2.98e-5, rel=1e-3)
    # 17: one layer is exact: its colour times its alpha, rounded once, and its alpha.
    one = np.array([0.3, 0.7, 1.0, 1 / 255], np.float32)
    got = render(one[None], lanes)
    assert (got[:3] == one[:3] * one[3]).all() and got[3] == np.float32(1) - (np.float32(1) - one[3])
    # 18: of two alphas the coverage misses by (a1 - a2)^2 / 4, exactly.
    for a, b in ((0.25, 0.75), (0.0, 1.0), (0.5, 0.5)):
        missing = (1 - (1 - a) * (1 - b)) - render(np.array([[1, 1, 1, a], [1, 1, 1, b]]), lanes)[3]
        assert missing == (a - b) ** 2 / 4
    # 12: layers all alike are what the formula takes them for.
    for n, a in ((300, 0.5), (65_536, 1 / 255), (65_536, 0.999)):
        same = render(np.array([[0.5, 0.25, 1, a]] * n), lanes)
        want = np.array([0.5, 0.25, 1, 1]) * -np.expm1(n * np.log1p(-float(np.float32(a))))
        assert np.abs(same - want).max() <= (2 * n + 8) * UNIT


def test_the_same_bits_on_both_shapes(judge: Judge) -> None:
    soup = soups.random(9, 300, "mixed", "flat")
    for technique in ("weighted-average", "weighted-sum"):
        for precision in ("float32", "half"):
            one, other = (
                plainly.render(soup.scene(), BENCH.camera(), (60, 40), technique, lanes=n, precision=precision)
                for n in (1, 64)
            )
            judge.same_bits(one, other, f"{technique} {precision}")


@pytest.mark.parametrize(("alpha", "sticks"), [(1.0, 2048), (0.5, 1024), (0.1, 256), (2**-12, 0.5)])
def test_half_sums_stick(alpha: float, sticks: float, lanes: int) -> None:
    """EXTREMES 14: where half a step of the sum is more than what is added, and float32 does not."""
    scene = soups.stack(np.linspace(1, 7, 5000), (1.0, 0.0, 0.0, alpha)).scene()
    call = {"camera": AHEAD.camera(), "size": (2, 2), "technique": "weighted-sum", "lanes": lanes, "opaque": "blend"}
    assert (plainly.render(scene, precision="half", **call).color[..., 0] == sticks).all()
    exact = 5000 * float(np.float32(alpha))
    assert abs(plainly.render(scene, precision="float32", **call).color[0, 0, 0] - exact) <= 5000 * UNIT * exact
    # The average counts its layers in such a buffer, too: to 2048.
    call["technique"] = "weighted-average"
    got = plainly.render(scene, precision="half", **call).color[0, 0]
    assert got[[0, 3]] == pytest.approx(1 - (1 - sticks / 2048) ** 2048, abs=4 * UNIT)


@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_half_is_that_of_numpy() -> None:
    import pyopencl as cl

    from clpeel.device.devices import open_device
    from clpeel.device.layout import Features
    from clpeel.device.program import source

    rng = np.random.default_rng(3)
    values = np.concatenate(
        [
            np.exp2(rng.uniform(-30, 17, 50_000)),
            np.arange(2048) * 2.0**-25,
            1 + np.arange(1023.5) / 2048,
            [65504, 65519.996, 65520, 1e9],
        ]
    )
    values = np.r_[0.0, values, np.inf].astype(np.float32)
    values = values[: len(values) // 16 * 16]
    gpu = open_device(lanes=1)
    text = source("fragments/sums.h") + (
        "kernel void halves(global float16 *values) { int i = get_global_id(0); values[i] = to_half(values[i]); }"
    )
    built = cl.Program(gpu.context, text).build(options=Features(1).options())
    held = gpu.put("halves", values)
    cl.Kernel(built, "halves")(gpu.queue, (len(values) // 16,), None, held)
    with np.errstate(over="ignore"):
        assert (gpu.get(held, len(values), np.float32) == values.astype(np.float16).astype(np.float32)).all()


def test_a_precision_there_is_not() -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match="precision: expected one of float32, half, unorm8; got 'double'"):
        plainly.render(scene, AHEAD.camera(), (2, 2), "weighted-average", precision="double")
