"""adaptive: the paper's curve in float64 and as pictures show it; where it is exact, and how wrong it gets."""

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
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.command import main as cli
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.precision import PRECISIONS, blending_bound

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

NODES = (4, 8, 16, 32)
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """Visibility as a step function, by section 3 of the paper.

    seen: of each fragment, vis(zi). lost: the areas of all steps that were moved. clear: whether no rounding of float32
    may move another step.
    """

    seen: Floats
    lost: float
    clear: bool


def is_clear(z: Floats, t: Floats, gone: int, roundings: int) -> bool:
    """Whether the step `gone` takes the least area whatever so many roundings of t, and a few of z, do.

    Equal distances are equal in float32, too. Where nothing comes through nobody sees which step is moved.
    """
    dz, dt = np.diff(z)[:-1], -np.diff(t)[:-1]
    off = UNIT * np.where(dz > 0, dz * t[:-2] * roundings + 4 * z[1:-1] * dt, 0)
    area, own = dz * dt, dz[gone - 1] * dt[gone - 1] + off[gone - 1]
    others = (np.arange(1, len(t) - 1) != gone) & (t[:-2] > 1e-30)
    return bool(((area - off > own) | ((area == 0) & (own == 0)))[others].all())


def curve(away: Any, alphas: Any, nodes: int) -> Curve:
    """The curve of fragments that come in this order."""
    steps: list[tuple[tuple[float, int], float]] = []  # (distance, number) of a fragment; what comes through behind it
    lost, clear = 0.0, True

    def before(place: tuple[float, int]) -> float:
        return min((through for other, through in steps if other < place), default=1.0)

    places = [(float(distance), number) for number, distance in enumerate(away)]
    for place, alpha in zip(places, np.asarray(alphas, float), strict=True):
        own = (place, before(place) * (1 - alpha))
        steps = sorted([own, *((other, t * (1 - alpha) if other > place else t) for other, t in steps)])
        if len(steps) > nodes:
            z, t = np.array([step[0][0] for step in steps]), np.array([step[1] for step in steps])
            areas = (np.diff(z) * -np.diff(t))[:-1]
            gone = int(np.argmin(areas)) + 1
            lost, clear = lost + areas[gone - 1], clear and is_clear(z, t, gone, 4 * len(places))
            steps[gone - 1] = (steps[gone - 1][0], steps[gone][1])
            del steps[gone]
    return Curve(np.array([before(place) for place in places]), lost, clear)


def exact(away: Any, alphas: Any) -> Floats:
    """vis(zi) of each fragment; of equal distances the one that was submitted first is in front."""
    order = np.argsort(away, kind="stable")
    seen = np.empty(len(order))
    seen[order] = np.cumprod(np.append(1, 1 - np.asarray(alphas, float)[order]))[:-1]
    return seen


def blended(seen: Floats, colors: Any) -> Floats:
    """Premultiplied RGBA: equation 3 of the paper, and the product of all 1 - Ai."""
    colors = np.asarray(colors, float)
    shown = (colors[:, :3] * (colors[:, 3:] * seen[:, None])).sum(axis=0)
    return np.append(shown, 1 - (1 - colors[:, 3]).prod())


def bound(count: int) -> float:
    """Of each fragment five roundings of what is at most 1: 1 - a, the curve's product, a c, and twice the sum."""
    return (5 * count + 4) * UNIT


def render(away: Any, colors: Any, nodes: int = 8, lanes: int = 1, **options: Any) -> Floats:
    """One pixel's premultiplied colour with these layers, in this order of submission."""
    scene = soups.stack(away, np.asarray(colors, np.float32)).scene()
    options = {"opaque": "blend", **options}
    result = plainly.render(scene, AHEAD.camera(), (5, 3), "adaptive", lanes=lanes, nodes=nodes, **options)
    assert (result.color == result.color[0, 0]).all()
    return result.color[0, 0].astype(float)


def some(seed: int, count: int, most: float = 1.0) -> tuple[Floats, NDArray[np.float32]]:
    """Distances in random order, some of them equal, and colours with alphas up to `most`."""
    rng = np.random.default_rng(seed)
    colors = rng.random((count, 4)).astype(np.float32)
    colors[:, 3] *= np.float32(most)
    return 1 + rng.integers(0, 3 * count, count) / 2**8, colors


# --- the paper --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("nodes", NODES)
@pytest.mark.parametrize("count", [1, 3, 5, 9, 40, 300])
def test_the_curve_of_the_paper(count: int, nodes: int, lanes: int) -> None:
    compared = 0
    for seed in range(4):
        away, colors = some(100 * count + seed, count, (1.0, 0.1, 0.01, 0.4)[seed])
        found = curve(away, colors[:, 3], nodes)
        if found.clear:
            compared += 1
            error = np.abs(render(away, colors, nodes, lanes) - blended(found.seen, colors)).max()
            assert error <= bound(count), seed
    assert compared >= (1 if count > 40 else 2)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_in_buffers_of_fewer_bytes(precision: str, lanes: int) -> None:
    """The curve and the sums are kept in the buffers: two roundings a fragment."""
    away, colors = some(3, 30, 0.5)
    got = render(away, colors, 32, lanes, precision=precision)
    assert np.abs(got - blended(exact(away, colors[:, 3]), colors)).max() <= 30 * blending_bound(30, precision)
    # A buffer of 8 bits sums whole steps, so halves of 1/255 and more are kept: 0.5 + 0.25 + ... of 255, rounded.
    got = render([1, 2, 3], [(1, 1, 1, 0.5)] * 3, 8, lanes, precision="unorm8")
    assert (got == np.float32([224 / 255] * 3 + [1 - 32 / 255])).all()


def read(away: Any, alphas: Any, nodes: int) -> Floats:
    """vis(zi) of each fragment, as the kernel has it: the colour over the alpha of a white layer among black ones."""
    seen = []
    for number, alpha in enumerate(alphas):
        colors = np.zeros((len(alphas), 4))
        colors[:, 3], colors[number, :3] = alphas, 1
        seen.append(render(away, colors, nodes)[0] / alpha)
    return np.array(seen)


@pytest.mark.parametrize("nodes", [4, 8])
def test_the_curve_lies_below_the_true_one_by_no_more_area_than_was_lost(nodes: int) -> None:
    away, colors = some(nodes, 20, 0.5)
    away = away + np.arange(20) / 2**14  # all apart
    alphas = np.maximum(colors[:, 3], np.float32(0.05))
    got, want, order = read(away, alphas, nodes), exact(away, alphas), np.argsort(away)
    slack = bound(20) / 0.05
    assert (got <= want + slack).all() and (np.diff(got[order]) <= slack).all()
    assert got[order[0]] == pytest.approx(1, abs=slack) and (got >= (1 - alphas).prod() - slack).all()
    # Of fragment i the curve is known behind fragment i - 1.
    area = ((want - got)[order][1:] * np.diff(away[order])).sum()
    assert 0 < area <= curve(away, alphas, nodes).lost + 20 * slack
    assert len(np.unique(np.round(got, 5))) <= nodes + 1


@given(seed=st.integers(0, 10**6), count=st.integers(1, 60), nodes=st.sampled_from(NODES), most=st.floats(0, 1))
def test_it_is_never_too_bright_and_coverage_is_exact(seed: int, count: int, nodes: int, most: float) -> None:
    """The foremost layer is seen in full, and what the others are off by is at most what they cover of the rest."""
    away, colors = some(seed, count, most)
    got, want = render(away, colors, nodes), blended(exact(away, colors[:, 3]), colors)
    missing = want - got
    through = 1 - colors[np.argsort(away, kind="stable"), 3].astype(float)
    wrong = through[0] - through.prod() if count > nodes else 0.0
    assert (missing >= -bound(count)).all() and (missing <= wrong + bound(count)).all()
    assert abs(missing[3]) <= bound(count)


@pytest.mark.parametrize("nodes", NODES)
def test_pixels_with_as_many_layers_are_exact_in_any_order(nodes: int, lanes: int, judge: Judge) -> None:
    """Beyond n layers the order of submission shows."""
    soup, size = soups.random(3, 50 * nodes, "large", "flat", alpha=(0.05, 0.5)), (30, 20)
    shuffled = soup.take(np.random.default_rng(3).permutation(len(soup.faces)))
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "lanes": lanes}
    layers = plainly.render(soup.scene(), technique="layer-count", scale_bar=False, **call).layer_count
    want = plainly.render(soup.scene(), technique="sort", **call).color.astype(float)
    one, other = (plainly.render(each.scene(), technique="adaptive", nodes=nodes, **call) for each in (soup, shuffled))
    few = layers <= nodes
    for got in (one, other):
        judge.color(got, want, np.where(few, 2 * bound(nodes), 1.0))
    assert few.any() and np.abs(one.color - other.color)[~few].max() > 1e-6


# --- how bad it gets --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("nodes", NODES)
def test_how_bad_it_gets(nodes: int, lanes: int) -> None:
    """docs/techniques.md: a hundred white layers of alpha 0.05 at one depth.

    Steps of no width cost no area. So they are moved to the first one, until all but the last n - 1 are one step.
    """
    count, alpha = 100, np.float32(0.05)
    got = render([2.0] * count, [(1, 1, 1, alpha)] * count, nodes, lanes)
    a, merged = float(alpha), count - nodes + 1
    behind = (1 - a) ** merged
    # The foremost is seen in full; merged - 1 others through all of them; the last n - 1 as they should be.
    want = a + (merged - 1) * a * behind + behind * (1 - (1 - a) ** (nodes - 1))
    cover = 1 - (1 - a) ** count
    assert np.abs(got - [want, want, want, cover]).max() <= bound(count)
    assert {4: "0.08", 8: "0.09", 16: "0.11", 32: "0.17"}[nodes] == f"{got[0]:.2f}" and f"{cover:.2f}" == "0.99"


# --- extremes ---------------------------------------------------------------------------------------------------------


def test_extremes(lanes: int) -> None:
    assert not render([1, 2, 3, 4, 5, 6], [(1, 1, 1, 0)] * 6, 4, lanes).any()  # all alphas zero
    one = np.array([0.3, 0.7, 1.0, 1 / 255], np.float32)
    got = render([2.0], one[None], 8, lanes)  # one layer: rounded once
    assert (got[:3] == one[:3] * one[3]).all() and got[3] == np.float32(1) - (np.float32(1) - one[3])
    # An opaque layer in front hides all behind it, whenever it comes.
    rest = [(1, 1, 1, 0.5)] * 12
    for place in (0, 5, 12):
        colors = [*rest[:place], (0.25, 0.5, 0.75, 1), *rest[place:]]
        away = [*range(2, 2 + place), 1, *range(2 + place, 14)]
        assert (render(np.array(away) / 2, colors, 4, lanes) == [0.25, 0.5, 0.75, 1]).all()
    # Thousands of layers: coverage is exact, and nothing is too bright.
    for count, alpha in ((3000, 1 / 255), (20_000, 0.999)):
        rgba = np.array([0.5, 0.25, 1, alpha], np.float32)
        away = np.random.default_rng(count).permutation(np.linspace(1, 7, count))
        cover = -np.expm1(count * np.log1p(-float(rgba[3])))
        got = render(away, np.tile(rgba, (count, 1)), 8, lanes)
        assert abs(got[3] - cover) <= bound(count) and (got[:3] <= rgba[:3] * cover + bound(count)).all()
        assert (got[:3] >= rgba[:3] * rgba[3]).all()
    # Equal depths are in the order of submission, and exact while there are nodes for them.
    colors = np.random.default_rng(1).random((8, 4)).astype(np.float32)
    assert np.abs(render([2.0] * 8, colors, 8, lanes) - blended(exact([2.0] * 8, colors[:, 3]), colors)).max() <= bound(
        8
    )


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_range_of_ten_millions(orthographic: bool, lanes: int) -> None:
    """Areas are of distances: of five layers, the step of the second, near by, costs least."""
    view = soups.Eye((0, 0, 0), (0, 0, -1), view_angle=90.0, clipping_range=(1e-3, 1e4), orthographic=orthographic)
    order = np.array([2, 0, 4, 3, 1])
    away, colors = np.array([2e-3, 1.0, 70.0, 800.0, 5e3]), np.c_[np.eye(5, 3) / 2 + 0.25, [0.5] * 5]
    scene = soups.stack(away[order], colors[order], reach=1e4).scene()
    got = plainly.render(scene, view.camera(), (3, 2), "adaptive", lanes=lanes, nodes=4).color[0, 0]
    seen = np.array([1, 0.25, 0.25, 0.125, 0.0625])
    assert np.abs(got - blended(seen, colors)).max() <= bound(5)
    assert np.abs(seen[order] - curve(away[order], [0.5] * 5, 4).seen).max() == 0


def test_an_empty_picture_and_opaque_surfaces(lanes: int) -> None:
    behind = soups.stack([-1.0], (1.0, 1.0, 1.0, 0.5)).scene()  # the eye
    assert not plainly.render(behind, AHEAD.camera(), (5, 3), "adaptive", lanes=lanes).color.any()
    colors = np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 1), (1, 1, 1, 0.5)])
    scene = soups.stack([2, 1, 3, 4], colors).scene()
    got = plainly.render(scene, AHEAD.camera(), (5, 3), "adaptive", lanes=lanes)
    assert (got.color == [0.25, 0.5, 0.25, 1]).all() and got.stats["fragments"] == 2 * 15


def test_the_same_bits_on_both_shapes(judge: Judge) -> None:
    soup = soups.random(9, 300, "mixed", "vertex")
    for nodes, precision in ((4, "float32"), (8, "half"), (16, "unorm8"), (32, "float32")):
        one, other = (
            plainly.render(
                soup.scene(), BENCH.camera(), (60, 40), "adaptive", lanes=n, nodes=nodes, precision=precision
            )
            for n in (1, 64)
        )
        judge.same_bits(one, other, f"{nodes} {precision}")


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("nodes", [0, 2, 64, -4, 4.5, "8", None, True])
def test_nodes_there_are_not(nodes: Any) -> None:
    with pytest.raises(clpeel.InputError, match=r"^nodes: expected one of 4, 8, 16, 32; got "):
        render([1.0], [(1, 1, 1, 0.5)], nodes)


@pytest.mark.parametrize("text", ["3", "x", "-1", ""])
def test_the_flag_says_what_it_takes(text: str, squares: Any, tmp_path: Any, capfd: Any) -> None:
    command = ["render", str(squares), "-o", str(tmp_path / "a.png"), "--technique", "adaptive", f"--nodes={text}"]
    assert cli.main(command) == 2
    said = capfd.readouterr().err.strip().splitlines()
    assert len(said) == 1 and "nodes" in said[0] and not (tmp_path / "a.png").exists()


def test_it_says_what_it_takes() -> None:
    technique = TECHNIQUES["adaptive"]
    defaults = technique.options()
    assert defaults.nodes == 8 and not technique.exact and not technique.sorts
    assert [each.nodes for each in technique.compared()] == [4, 16, 32]
    assert technique.buffer_bytes(10, defaults) == 10 * 8 + 8 * 16 + 16
    assert technique.error_without_order(5, 0.1) is None  # so `auto` never chooses it
