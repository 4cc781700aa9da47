"""wavelet: the paper's equations against float64, where they are exact, how bad they get, and their logarithms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import soups
from twins.reference import UNIT
from twins.solids import DEPTH_ROUNDINGS
from twins.soups import AHEAD, BENCH, Eye

import clpeel

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

Floats = NDArray[np.float64]
SIZE = (60, 50)
NEAR, FAR = AHEAD.clipping_range
HIDES = 17 * np.log(2)  # an opaque layer's absorbance, as -ln 0 is infinite
WIDE = Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4))  # far is 10^7 times near


@dataclass
class Absorbed:
    """The absorbance of layers as a function of depth, in float64, without any wavelets.

    Haar wavelets of levels 0 to r keep its means over 2^(r + 1) cells, and in between it is interpolated: the paper's
    sums are another basis of the same functions. x: places of the layers in cells. front: what is absorbed before each.
    slope: by how much that changes at most, a cell. All float64 [n].
    """

    x: Floats
    front: Floats
    slope: float

    @classmethod
    def of(cls, alpha: Floats, distances: Floats, rank: int, ends: tuple[float, float] | None) -> Absorbed:
        """alpha, distances: float64 [n]. ends: the distances where cells begin and end, or None for the layers'."""
        low, high = ends or (distances.min(), distances.max())
        cells = 2 ** (rank + 1)
        x = np.clip((distances - low) / (high - low or 1), 0, 1) * (cells - 1)
        each = np.minimum(-np.log1p(-np.minimum(alpha, 1 - 2.0**-53)), HIDES)
        behind = np.clip(np.arange(-1, cells)[:, None] + 1 - x, 0, 1)  # the share of each cell that is behind a layer
        ends_of_cells = np.arange(cells + 1)
        total = np.interp(x, ends_of_cells, behind @ each)
        own = np.array([np.interp(at, ends_of_cells, share) for at, share in zip(x, behind.T, strict=True)]) * each
        steps = np.abs(np.diff(behind @ each))
        return cls(x, np.maximum(total - own, 0), float(steps.max(initial=0) + each.max()))


def blended(colors: Floats, distances: Floats, rank: int = 3, ends: tuple[float, float] | None = None) -> Floats:
    """Straight RGBA [n, 4] to premultiplied RGBA."""
    alpha = colors[:, 3]
    weight = alpha * np.exp(-np.minimum(Absorbed.of(alpha, distances, rank, ends).front, 60))
    coverage = -np.expm1(np.log1p(-np.minimum(alpha, 1 - 1e-300)).sum()) if (alpha < 1).all() else 1.0
    mean = weight @ colors[:, :3] / weight.sum() if weight.sum() else np.zeros(3)
    return np.r_[mean * coverage, coverage]


def bound(colors: Floats, distances: Floats, rank: int = 3, ends: tuple[float, float] | None = None) -> float:
    """How far off a channel may be.

    If what is absorbed before layers is off by d, a mean of their colours is off by 2 d. That is a rounding of the sum
    of all absorbances for each addend and some more, and the slope times the error of a place. A place is three
    distances, each off by DEPTH_ROUNDINGS of itself, divided by how far the ends are apart; and some roundings.
    """
    low, high = ends or (distances.min(), distances.max())
    there = Absorbed.of(colors[:, 3], distances, rank, ends)
    sums = np.minimum(-np.log1p(-np.minimum(colors[:, 3], 1 - 2.0**-53)), HIDES).sum()
    place = 2 ** (rank + 1) * (3 * DEPTH_ROUNDINGS * distances.max() / (high - low or 1) + 8 * UNIT)
    off = there.slope * place + (len(colors) + 2 ** (rank + 1) + 16) * sums * UNIT
    return float(2 * off + (4 * len(colors) + 16) * UNIT)


def over(colors: Floats, distances: Floats) -> Floats:
    """Straight RGBA [n, 4] to premultiplied RGBA, in order of distance."""
    result = np.zeros(4)
    for rgba in colors[np.argsort(distances, kind="stable")][::-1].astype(float):
        result = np.r_[rgba[:3], 1] * rgba[3] + (1 - rgba[3]) * result
    return result


def shown(colors: Any, distances: Any, lanes: int, view: Eye = AHEAD, **options: Any) -> Floats:
    """The premultiplied colour of these layers, opaque ones too."""
    scene = soups.stack(distances, np.asarray(colors, np.float32)).scene()
    result = plainly.render(scene, view.camera(), (5, 3), "wavelet", lanes=lanes, opaque="blend", **options)
    assert (result.color == result.color[0, 0]).all()
    return result.color[0, 0].astype(float)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 60),
    alpha=st.sampled_from([0.02, 0.5, 1.0]),
    places=st.sampled_from([1, 5, 10_000]),
)
@pytest.mark.parametrize(("rank", "within"), [(2, "pixel"), (3, "pixel"), (3, "scene")])
def test_the_equations_of_the_paper(
    rank: int, within: str, seed: int, count: int, alpha: float, places: int, lanes: int
) -> None:
    rng = np.random.default_rng(seed)
    colors = rng.random((count, 4)).astype(np.float32) * np.array([1, 1, 1, alpha], np.float32)
    distances = np.r_[rng.choice(np.linspace(1, 7, places), count)]
    ends = (NEAR, FAR) if within == "scene" else None
    got = shown(colors, distances, lanes, wavelet_rank=rank, wavelet_range=within)
    exact = colors.astype(float)
    assert np.abs(got - blended(exact, distances, rank, ends)).max() <= bound(exact, distances, rank, ends)


@pytest.mark.parametrize("rank", [2, 3])
def test_where_it_is_exact(rank: int, lanes: int) -> None:
    """Layers at whole cells, or at least two cells apart, are blended as sorting does."""
    rng = np.random.default_rng(rank)
    cells = 2 ** (rank + 1)
    for places in ([0], [0, 1], list(range(cells)), [0, 1.3, 3.5, 5.5, cells - 1]):
        at = np.array(places) * (7 - 1) / (places[-1] or 1) + 1
        order = rng.permutation(len(places))
        colors = rng.random((len(places), 4)).astype(np.float32).astype(float)
        got = shown(colors[order], at[order], lanes, wavelet_rank=rank)
        assert np.abs(got - over(colors, at)).max() <= bound(colors, at, rank), places
    # All at one depth hide each other not at all: the mean by alpha, with all their coverage.
    colors = rng.random((20, 4)).astype(np.float32).astype(float)
    got = shown(colors, np.full(20, 3.0), lanes, wavelet_rank=rank)
    coverage = 1 - np.prod(1 - colors[:, 3])
    mean = colors[:, 3] @ colors[:, :3] / colors[:, 3].sum()
    assert np.abs(got - np.r_[mean, 1] * coverage).max() <= 100 * UNIT


def test_how_bad_it_gets(lanes: int) -> None:
    """Two surfaces in one cell look like their mean; docs/techniques.md has these numbers.

    Red lies in the middle of a cell, and green d of a cell behind it. Half of what red absorbs counts in that cell, and
    1/2 - d of what green does, and A is 1/2 and 1/2 + d of the way to that. So what hides the two differs by d of an
    absorbance, and red weighs e^(d a) times as much as green.
    """
    for alpha, coverage in ((1.0, 1.0), (0.5, 0.75)):
        absorbed = min(-np.log(max(1 - alpha, 1e-9)), HIDES)
        clear, red, green = [1, 1, 1, 0.0], [1, 0, 0, alpha], [0, 1, 0, alpha]
        for apart, red_share in ((0.0, 0.5), (0.05, 0.643), (0.25, 0.95), (0.5, 0.997)):
            got = shown([clear, green, red, clear], [1.0, 4.0 + 0.4 * apart, 4.0, 7.0], lanes)
            share = 1 / (1 + np.exp(-apart * absorbed))
            assert np.abs(got - np.array([share, 1 - share, 0, 1]) * coverage).max() < 1e-4
            assert alpha < 1 or share == pytest.approx(red_share, abs=5e-4)


def test_errors_on_a_soup(lanes: int) -> None:
    scene = soups.random(7, 400, "mixed", "flat8").scene()

    def error(technique: str, **options: Any) -> float:
        color = plainly.render(scene, BENCH.camera(), SIZE, technique, lanes=lanes, **options).color
        return float(np.abs(color - exact).max(axis=2).mean())

    exact = plainly.render(scene, BENCH.camera(), SIZE, lanes=lanes).color
    coarse, fine = error("wavelet", wavelet_rank=2), error("wavelet")
    assert fine < coarse < error("wavelet", wavelet_range="scene") < error("weighted-average")


def test_the_order_of_submission_is_all_but_lost(lanes: int) -> None:
    rng = np.random.default_rng(8)
    colors = rng.random((300, 4)).astype(np.float32) * np.array([1, 1, 1, 0.2], np.float32)
    distances = rng.uniform(1, 7, 300)
    most = bound(colors.astype(float), distances)
    first = shown(colors, distances, lanes)
    others = (rng.permutation(300) for _ in range(3))
    assert (
        max(np.abs(shown(colors[other], distances[other], lanes) - first).max() for other in others) <= 2 * most < 0.01
    )


def test_extremes(lanes: int) -> None:
    # All alphas zero: the background, bit for bit.
    assert not shown([[1, 1, 1, 0.0]] * 5, np.linspace(1, 7, 5), lanes).any()
    # One layer: its colour, its alpha.
    one = np.array([0.3, 0.7, 1.0, 1 / 255], np.float32)
    for within in ("pixel", "scene"):
        got = shown(one[None], [3.0], lanes, wavelet_range=within)
        assert np.abs(got[:3] / (one[:3] * one[3]) - 1).max() <= 8 * UNIT * 255 and got[3] == 1 - (
            np.float32(1) - one[3]
        )
    # Opaque layers cover all, however many there are. The first one hides the others.
    for count in (2, 16, 3000):
        at = np.linspace(1, 7, count)
        got = shown(np.r_[[[1, 0, 0, 1]], np.full((count - 1, 4), (0, 1, 0, 1))], at, lanes)
        assert got[3] == 1 and np.isfinite(got).all() and got[0] + got[1] == pytest.approx(1, abs=1e-5)
        assert got[0] == pytest.approx(1, abs=1e-4) or count > 16
    # They do so at one depth, too, where each is hidden by all the others: in the middle of a cell of 0.5, from 0.5 on.
    alike = shown(np.full((3000, 4), (0.25, 0.5, 1, 1)), np.full(3000, 3.25), lanes, wavelet_range="scene")
    assert alike == pytest.approx([0.25, 0.5, 1, 1], abs=1e-3)
    # Thousands of thin layers, all alike, are what they are.
    for n, alpha in ((3000, 1 / 255), (65_536, 2.0**-20)):
        got = shown(np.full((n, 4), (0.5, 0.25, 1, alpha)), np.linspace(1, 7, n), lanes)
        want = np.array([0.5, 0.25, 1, 1]) * -np.expm1(n * np.log1p(-float(np.float32(alpha))))
        assert np.abs(got - want).max() <= (3 * n + 60) * UNIT


@pytest.mark.parametrize("within", ["pixel", "scene"])
def test_near_and_far_ten_million_apart(within: str, lanes: int) -> None:
    rng = np.random.default_rng(2)
    distances = rng.permutation(np.geomspace(2e-3, 5e3, 30))
    colors = (rng.random((30, 4)).astype(np.float32) * np.array([1, 1, 1, 0.3], np.float32)).astype(float)
    ends = (1e-3, 1e4) if within == "scene" else None
    got = shown(colors, distances, lanes, WIDE, wavelet_range=within)
    assert np.abs(got - blended(colors, distances, ends=ends)).max() <= bound(colors, distances, ends=ends) < 1e-3


@pytest.mark.parametrize("colors", ["flat", "vertex"])
def test_the_same_bits_on_both_shapes(colors: str, judge: Judge) -> None:
    soup = soups.random(9, 300, "mixed", colors)
    scene = (soups.with_opaque(soup) if colors == "flat" else soup).scene()
    for rank, within, precision in ((2, "pixel", "float32"), (3, "scene", "half"), (3, "pixel", "unorm8")):
        options: dict[str, Any] = {"wavelet_rank": rank, "wavelet_range": within, "precision": precision}
        one, other = (
            plainly.render(scene, BENCH.camera(), SIZE, "wavelet", lanes=lanes, **options) for lanes in (1, 64)
        )
        judge.same_bits(one, other, f"rank {rank}, {within}, {precision}")


def test_parallel_projection(lanes: int) -> None:
    view = Eye((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), view_angle=90.0, clipping_range=(0.25, 4.0), orthographic=True)
    rng = np.random.default_rng(6)
    depth = rng.uniform(-2, 0.5, 12)
    corners = np.empty((12, 3, 3))
    corners[..., :2] = np.array([[-9.0, -9.0], [27.0, -9.0], [-9.0, 27.0]])
    corners[..., 2] = depth[:, None]
    colors = rng.random((12, 4)).astype(np.float32) * np.array([1, 1, 1, 0.5], np.float32)
    scene = soups.separate(corners, colors).scene()
    exact, distances = colors.astype(float), 1 - depth
    for within, ends in (("pixel", None), ("scene", (0.25, 4.0))):
        got = plainly.render(scene, view.camera(), (3, 3), "wavelet", lanes=lanes, wavelet_range=within).color
        # Depths are shares of the clipping range, so each distance is off by that of the whole range.
        most = bound(exact, distances, ends=ends) * 4
        assert np.abs(got - blended(exact, distances, ends=ends)).max() <= most < 1e-3


def test_nothing_to_be_seen(lanes: int) -> None:
    away = soups.stack([20.0], (1.0, 1.0, 1.0, 0.5)).scene()
    result = plainly.render(away, AHEAD.camera(), (4, 4), "wavelet", lanes=lanes)
    assert not result.color.any() and (result.image == 255).all()


@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_logarithms_are_those_of_numpy() -> None:
    import pyopencl as cl

    from clpeel.device.devices import open_device
    from clpeel.device.layout import Features
    from clpeel.device.program import source

    rng = np.random.default_rng(3)
    alphas = np.concatenate(
        [rng.random(50_000), 10 ** rng.uniform(-37, 0, 50_000), 1 - 2.0 ** -rng.uniform(0, 17, 50_000)]
    )
    absorbances = np.concatenate(
        [rng.uniform(0, 90, 50_000), 10 ** rng.uniform(-37, 2, 50_000), [0.0, 88.0, 1e9, np.inf]]
    )
    gpu = open_device(lanes=1)
    text = source("fragments/absorbance.h") + (
        "kernel void there(global float16 *values) { int i = get_global_id(0); values[i] = absorbance_of(values[i]); }"
        "kernel void back(global float16 *values) { int i = get_global_id(0); values[i] = through(values[i]); }"
    )
    built = cl.Program(gpu.context, text).build(options=Features(1).options())

    def run(name: str, values: Floats) -> tuple[Floats, Floats]:
        given = np.resize(values.astype(np.float32), -(-len(values) // 16) * 16)
        held = gpu.put(name, given)
        cl.Kernel(built, name)(gpu.queue, (len(given) // 16,), None, held)
        return given.astype(float), gpu.get(held, len(given), np.float32).astype(float)

    alpha, absorbed = run("there", np.r_[0.0, alphas, 1.0, 1 + 2.0**-23])
    want = np.minimum(-np.log1p(-np.minimum(alpha, 1 - 2.0**-53)), HIDES)
    assert (absorbed[alpha == 0] == 0).all() and (np.abs(absorbed - want) <= 2.0**-21 * want).all()
    given, left = run("back", absorbances)
    # The absorbance is reduced to +-0.35, which is off by a rounding. The polynomial has eight, and a few more.
    want = np.exp(-given)
    seen = want >= 2.0**-125
    assert (
        (np.abs(left - want) <= 2.0**-20 * want)[seen].all()
        and (left[want < 2.0**-127] == 0).all()
        and (left <= 1).all()
    )


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"wavelet_rank": 4}, "wavelet_rank: expected one of 2, 3; got 4"),
        ({"wavelet_rank": "3"}, "wavelet_rank: expected one of 2, 3; got '3'"),
        ({"wavelet_range": "tile"}, "wavelet_range: expected one of pixel, scene; got 'tile'"),
        ({"precision": "double"}, "precision: expected one of float32, half, unorm8; got 'double'"),
        ({"kept_layers": 4}, "kept_layers: the technique 'wavelet' has no such option"),
    ],
)
def test_options_that_there_are_not(options: dict[str, Any], error: str) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match=error):
        plainly.render(scene, AHEAD.camera(), (2, 2), "wavelet", **options)
