"""multi-layer-alpha-blending: the paper's array in float64, where it is exact, and how wrong it gets elsewhere."""

from __future__ import annotations

from bisect import insort
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import soups
from twins.blends import Stacks
from twins.blends import kept_apart as kept_in
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.command import main as cli
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.precision import PRECISIONS

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

NAME = "multi-layer-alpha-blending"
SLOTS = (2, 4, 8, 16)
Floats = NDArray[np.float64]


def over(front: Floats, behind: Floats) -> Floats:
    """Premultiplied colour and transmittance of one layer over another."""
    return np.append(front[:3] + front[3] * behind[:3], front[3] * behind[3])


def composed(layers: list[Floats]) -> Floats:
    """Premultiplied RGBA of layers (Ai Ci, 1 - Ai), front to back."""
    shown = np.array([0.0, 0.0, 0.0, 1.0])
    for layer in layers:
        shown = over(shown, layer)
    return np.append(shown[:3], 1 - shown[3])


def kept_apart(away: Any, colors: Any, slots: int) -> Floats:
    """Premultiplied RGBA by the paper: sections 3.1 and 3.2, one fragment after the other in submission order."""
    array: list[tuple[float, int, Floats]] = []
    for number, (distance, (*rgb, alpha)) in enumerate(zip(away, np.asarray(colors, float), strict=True)):
        insort(array, (distance, number, np.append(np.array(rgb) * alpha, 1 - alpha)))
        if len(array) > slots:
            *array, near, far = array
            array.append((*near[:2], over(near[2], far[2])))
    return composed([layer for _, _, layer in array])


def exact(away: Any, colors: Any) -> Floats:
    """Premultiplied RGBA, blended in the order of distance, and of submission where that is equal."""
    return kept_apart(away, colors, len(away) + 1)


def bound(count: int, slots: int) -> float:
    """Of each fragment five roundings: of a c, of 1 - a, and three as it is merged. Of each slot three at the end."""
    return (5 * count + 3 * slots + 4) * UNIT


def render(away: Any, colors: Any, slots: int = 4, lanes: int = 1, **options: Any) -> Floats:
    """One pixel's premultiplied colour with these layers, in this order of submission."""
    scene = soups.stack(away, np.asarray(colors, np.float32)).scene()
    options = {"opaque": "blend", **options}
    result = plainly.render(scene, AHEAD.camera(), (5, 3), NAME, lanes=lanes, slots=slots, **options)
    assert (result.color == result.color[0, 0]).all()
    return result.color[0, 0].astype(float)


def some(seed: int, count: int, most: float = 1.0) -> tuple[Floats, NDArray[np.float32]]:
    """Distances in random order, some of them equal, and colours with alphas up to `most`."""
    rng = np.random.default_rng(seed)
    colors = rng.random((count, 4)).astype(np.float32)
    colors[:, 3] *= np.float32(most)
    return 1 + rng.integers(0, 2 * count, count) / 2**14, colors


# --- the paper --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("slots", SLOTS)
@pytest.mark.parametrize("count", [1, 2, 3, 5, 17, 300])
def test_the_array_of_the_paper(count: int, slots: int, lanes: int) -> None:
    for seed, most in ((count, 1.0), (count + 1, 0.1)):
        away, colors = some(seed, count, most)
        got = render(away, colors, slots, lanes)
        assert np.abs(got - kept_apart(away, colors, slots)).max() <= bound(count, slots)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 60), slots=st.sampled_from(SLOTS), most=st.floats(0, 1))
def test_what_the_nearest_hide_is_the_most_it_is_off(seed: int, count: int, slots: int, most: float) -> None:
    """The nearest k - 1 layers are never merged, and the others cover what they should: at most P - Q is wrong.

    P is the transmittance of the nearest k - 1 layers, and Q that of all.
    """
    away, colors = some(seed, count, most)
    got, want = render(away, colors, slots), exact(away, colors)
    assert np.abs(got - kept_apart(away, colors, slots)).max() <= bound(count, slots)
    order = np.argsort(away, kind="stable")
    through = 1 - colors[order, 3].astype(float)
    wrong = through[: slots - 1].prod() - through.prod() if count > slots else 0.0
    assert np.abs(got - want)[:3].max() <= wrong + bound(count, slots)
    assert abs(got[3] - want[3]) <= bound(count, slots)


def counted(soup: soups.Soup, size: tuple[int, int]) -> NDArray[np.int64]:
    """How many layers each pixel has."""
    return plainly.render(soup.scene(), BENCH.camera(), size, "layer-count", scale_bar=False).layer_count.astype(int)


@pytest.mark.parametrize("slots", SLOTS)
def test_pixels_with_as_many_layers_have_the_bits_of_sort_in_any_order(slots: int, lanes: int) -> None:
    """Beyond k layers the order of submission shows, as the paper says."""
    soup, size = soups.random(3, 50 * slots, "large", "flat", alpha=(0.05, 0.5)), (30, 20)
    shuffled = soup.take(np.random.default_rng(3).permutation(len(soup.faces)))
    layers = counted(soup, size)
    want = plainly.render(soup.scene(), BENCH.camera(), size, "sort", lanes=lanes).color
    one, other = (
        plainly.render(each.scene(), BENCH.camera(), size, NAME, lanes=lanes, slots=slots).color
        for each in (soup, shuffled)
    )
    few = layers <= slots  # at the border
    assert (one[few] == want[few]).all() and (other[few] == want[few]).all()
    assert few.any() and np.abs(one - other)[~few].max() > 1e-3


def test_a_layer_that_comes_late_between_two_that_are_one(lanes: int) -> None:
    """The smallest wrong picture: of two slots the second has layers 2 and 4 by the time that layer 3 comes."""
    colors = np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.5), (1, 1, 1, 0.5)])

    def front_to_back(*order: int) -> list[float]:
        return [*(colors[list(order), :3].T @ [1 / 2, 1 / 4, 1 / 8, 1 / 16]), 15 / 16]

    for slots, order, shown in (
        (2, (0, 1, 3, 2), (0, 1, 3, 2)),
        (2, (3, 2, 1, 0), (0, 1, 2, 3)),
        (4, (0, 1, 3, 2), (0, 1, 2, 3)),
    ):
        got = render(1.0 + np.array(order), colors[list(order)], slots, lanes)
        assert (got == front_to_back(*shown)).all(), (slots, order)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("slots", SLOTS)
def test_each_merge_is_rounded_as_it_is_stored(slots: int, precision: str, lanes: int, judge: Judge) -> None:
    """In buffers of fewer bytes, to the bit; opaque surfaces are behind, and lists are long."""
    soup = soups.random(5, 20 + 40 * slots, "large", "flat", alpha=(0.05, 0.6))
    assert soup.face_colors is not None
    soup.face_colors[::97, 3] = 1
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (19, 17), "lanes": lanes}
    stacks = Stacks(plainly.render(soup.scene(), layers=True, **call).layers, precision)
    got = plainly.render(soup.scene(), technique=NAME, precision=precision, slots=slots, **call)
    want = stacks.shown(*kept_in(stacks, slots))
    assert want.dtype == np.float32 and stacks.count.max() > slots
    judge.same_bits(got, SimpleNamespace(color=want, image=got.image))


@pytest.mark.parametrize("slots", SLOTS)
def test_how_bad_it_gets(slots: int, lanes: int) -> None:
    """docs/techniques.md: behind k clear layers a white wall, which comes first, hides a black one in front of it."""
    away = [*range(1, slots + 1), slots + 2, slots + 1]
    colors = [(0, 0, 0, 0.0625)] * slots + [(1, 1, 1, 1), (0, 0, 0, 1)]
    got, want = render(1 + np.array(away) / 8, colors, slots, lanes), exact(away, colors)
    assert want[:3].max() == 0 and got[0] == pytest.approx((15 / 16) ** slots, abs=bound(slots + 2, slots))
    assert {2: "0.88", 4: "0.77", 8: "0.60", 16: "0.36"}[slots] == f"{got[0]:.2f}"


# --- extremes ---------------------------------------------------------------------------------------------------------


def test_extremes(lanes: int) -> None:
    assert not render([1, 2, 3, 4, 5, 6], [(1, 1, 1, 0)] * 6, 4, lanes).any()  # all alphas zero
    one = np.array([0.3, 0.7, 1.0, 1 / 255], np.float32)
    got = render([2.0], one[None], 4, lanes)  # one layer: rounded once
    assert (got[:3] == one[:3] * one[3]).all() and got[3] == np.float32(1) - (np.float32(1) - one[3])
    # An opaque layer hides all behind it, whenever it comes, where it is within the first k - 1.
    rest = [(1, 1, 1, 0.5)] * 6
    for place in (0, 3, 6):
        colors = [*rest[:place], (0.25, 0.5, 0.75, 1), *rest[place:]]
        away = [*range(2, 2 + place), 1, *range(2 + place, 8)]
        assert (render(np.array(away) / 2, colors, 2, lanes) == [0.25, 0.5, 0.75, 1]).all()
    # Layers all alike need no order: 1 - (1 - a)^n of their colour.
    for count, alpha in ((300, 0.5), (3000, 1 / 255), (20_000, 0.999)):
        rgba = np.array([0.5, 0.25, 1, alpha], np.float32)
        away = np.random.default_rng(count).permutation(np.linspace(1, 7, count))
        cover = -np.expm1(count * np.log1p(-float(rgba[3])))
        got = render(away, np.tile(rgba, (count, 1)), 4, lanes)
        assert np.abs(got - np.append(rgba[:3].astype(float), 1) * cover).max() <= bound(count, 4)
    # Equal depths are in the order of submission, so what is merged at the end is what it should be.
    colors = np.random.default_rng(1).random((40, 4)).astype(np.float32) * np.float32([1, 1, 1, 0.2])
    assert np.abs(render([2.0] * 40, colors, 2, lanes) - exact([2.0] * 40, colors)).max() <= bound(40, 2)


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_range_of_ten_millions(orthographic: bool, lanes: int) -> None:
    view = soups.Eye((0, 0, 0), (0, 0, -1), view_angle=90.0, clipping_range=(1e-3, 1e4), orthographic=orthographic)
    order = np.array([2, 0, 3, 1])
    away, colors = np.array([2e-3, 1.0, 70.0, 5e3]), np.eye(4, 3) / 2 + 0.25
    colors = np.c_[colors, [0.5] * 4]
    scene = soups.stack(away[order], colors[order], reach=1e4).scene()
    got, want = (plainly.render(scene, view.camera(), (3, 2), name, lanes=lanes).color for name in (NAME, "sort"))
    assert (got == want).all() and np.abs(got[0, 0] - exact(away, colors)).max() <= bound(4, 4)


def test_an_empty_picture_and_opaque_surfaces(lanes: int) -> None:
    behind = soups.stack([-1.0], (1.0, 1.0, 1.0, 0.5)).scene()  # the eye
    assert not plainly.render(behind, AHEAD.camera(), (5, 3), NAME, lanes=lanes).color.any()
    colors = np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 1), (1, 1, 1, 0.5)])
    scene = soups.stack([2, 1, 3, 4], colors).scene()
    got = plainly.render(scene, AHEAD.camera(), (5, 3), NAME, lanes=lanes, slots=2)
    assert (got.color == [0.25, 0.5, 0.25, 1]).all() and got.stats["fragments"] == 2 * 15


def test_the_same_bits_on_both_shapes(judge: Judge) -> None:
    soup = soups.random(9, 300, "mixed", "vertex")
    for slots, precision in ((2, "float32"), (4, "half"), (8, "unorm8"), (16, "float32")):
        one, other = (
            plainly.render(soup.scene(), BENCH.camera(), (60, 40), NAME, lanes=n, slots=slots, precision=precision)
            for n in (1, 64)
        )
        judge.same_bits(one, other, f"{slots} {precision}")


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("slots", [0, 3, 32, -4, 4.5, "4", None, True])
def test_slots_there_are_not(slots: Any) -> None:
    with pytest.raises(clpeel.InputError, match=r"^slots: expected one of 2, 4, 8, 16; got "):
        render([1.0], [(1, 1, 1, 0.5)], slots)


@pytest.mark.parametrize("text", ["3", "x", "-1", ""])
def test_the_flag_says_what_it_takes(text: str, squares: Any, tmp_path: Any, capfd: Any) -> None:
    command = ["render", str(squares), "-o", str(tmp_path / "a.png"), "--technique", NAME, f"--slots={text}"]
    assert cli.main(command) == 2
    said = capfd.readouterr().err.strip().splitlines()
    assert len(said) == 1 and "slots" in said[0] and not (tmp_path / "a.png").exists()


def test_it_says_what_it_takes() -> None:
    technique = TECHNIQUES[NAME]
    defaults = technique.options()
    assert defaults.slots == 4 and not technique.exact and not technique.sorts
    assert [each.slots for each in technique.compared()] == [2, 8, 16]
    assert technique.buffer_bytes(10, defaults) == 10 * 8 + 4 * (4 + 16)
    assert technique.buffer_bytes(10, technique.options(slots=8, precision="unorm8")) == 10 * 8 + 8 * (4 + 4)
    assert technique.error_without_order(5, 0.1) is None  # so `auto` never chooses it
