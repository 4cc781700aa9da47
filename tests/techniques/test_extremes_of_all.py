"""The list of extremes on every technique that blends, each against its own closed form."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import reference, soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

ELSEWHERE = ("moments",)
"""Whose picture of many layers is another one: test_moments has its extremes."""
BLENDING = [name for name, technique in TECHNIQUES.items() if not technique.maps and name not in ELSEWHERE]
EXACT = [name for name in BLENDING if TECHNIQUES[name].exact]
PEELS = 4  # of glowscript


def render(soup: soups.Soup, technique: str, lanes: int, size: tuple[int, int] = (3, 2), **options: Any) -> Any:
    """A picture of a stack that fills the view."""
    return plainly.render(soup.scene(), AHEAD.camera(), size, technique, lanes=lanes, **options)


def closed_form(technique: str, colors: np.ndarray) -> np.ndarray:
    """Premultiplied RGBA of layers [n, 4], front to back, in float64, by the technique's own equation."""
    colors = np.asarray(colors, np.float32).astype(float)
    rgb, alpha = colors[:, :3], colors[:, 3]
    if technique == "weighted-sum":
        return np.r_[(rgb * alpha[:, None]).sum(axis=0), alpha.sum()]
    if technique == "weighted-average":
        total = alpha.sum()
        cover = -np.expm1(len(alpha) * np.log1p(-min(total / len(alpha), 1 - 2.0**-60)))
        return np.r_[(rgb * alpha[:, None]).sum(axis=0) * (cover / total if total else 0), cover]
    if technique == "glowscript":
        rgb, alpha = rgb[:PEELS], alpha[:PEELS]
    clear = np.cumprod(np.r_[1, 1 - alpha])
    return np.r_[(rgb * (alpha * clear[:-1])[:, None]).sum(axis=0), 1 - clear[-1]]


def bound(technique: str, count: int, want: np.ndarray) -> float:
    """3 N roundings, and 4; the sums' own size where they are not kept below one; as many for their power."""
    return (3 * count + 8) * UNIT * max(1.0, float(np.abs(want).max()))


def most(technique: str, count: int) -> int:
    """As many layers as the technique can go through in sane time: N passes over N triangles are N^2 steps."""
    return min(count, 3000) if technique in ("depth-peeling", "dual-depth-peeling") else count


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("count", [1, 2, 5, 40, 1000])
def test_07_the_same_triangle_k_times(technique: str, count: int, lanes: int) -> None:
    rgba = (0.5, 1.0, 0.25, 0.25 if count < 1000 else 0.01)
    soup = soups.stack([2.0] * count, rgba)
    got = render(soup, technique, lanes).color
    want = closed_form(technique, np.tile(rgba, (count, 1)))
    assert np.abs(got - want).max() <= bound(technique, count, want)
    if "coincident" in TECHNIQUES[technique].option_names:
        paper = render(soup, technique, lanes, coincident="paper").color
        one = np.float32(1)
        assert (paper[..., :3] == np.float32(rgba[:3]) * np.float32(rgba[3])).all()
        assert (paper[..., 3] == one - (one - np.float32(rgba[3]))).all()


@pytest.mark.parametrize("technique", [name for name in BLENDING if "weighted" not in name])
def test_08_coincident_and_09_next_to_each_other(technique: str, lanes: int) -> None:
    colors = np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.5)])
    for away in ([2.0] * 3, [2.0, np.nextafter(2.0, 3), 2.0 + 2.0**-20], [1.0, 1.0 + 2.0**-22, 7.0]):
        got = render(soups.stack(away, colors), technique, lanes).color
        assert (got == [0.5, 0.25, 0.125, 0.875]).all()
    # A distance apart that float32 has, 2^-22 of it, is one of depth; and the order is that of distance then.
    got = render(soups.stack([2.0 + 2.0**-20, 2.0], colors[:2]), technique, lanes).color
    assert (got == [0.25, 0.5, 0, 0.75]).all()


@pytest.mark.parametrize("technique", BLENDING)
def test_10_as_many_fragments_in_one_pixel_as_there_are(technique: str, lanes: int) -> None:
    count = most(technique, 100_000 if lanes == 1 else 20_000)
    colors = np.tile(np.float32([1.0, 0.5, 0.25, 1e-4]), (count, 1))
    away = np.random.default_rng(10).permutation(np.linspace(1, 7, count))
    options = {"layers_per_pass": 64} if technique == "multi-layer-peeling" else {}
    result = render(soups.stack(away, colors), technique, lanes, (1, 1), **options)
    want = closed_form(technique, colors)
    assert result.stats["fragments"] == count
    assert np.abs(result.color - want).max() <= bound(technique, count, want)


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("alpha", [1 / 255, 0.01, 0.5, 0.999])
@pytest.mark.parametrize("count", [1, 3, 100, 65_536])
def test_12_equal_layers(technique: str, alpha: float, count: int, lanes: int) -> None:
    """Where all layers are alike every technique that keeps them all agrees: what differs is numeric alone."""
    count = count if most(technique, count) == count and technique != "multi-layer-peeling" else min(count, 300)
    rgba = (1.0, 0.5, 0.125, alpha)
    got = render(soups.stack(np.linspace(1, 7, count), rgba), technique, lanes, (1, 1)).color
    want = closed_form(technique, np.tile(rgba, (count, 1)))
    assert np.abs(got - want).max() <= bound(technique, count, want)


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("background", [(1 / 3, 0.999, 1e-3), None])
def test_15_all_alphas_zero(technique: str, background: Any, lanes: int, judge: Judge) -> None:
    soup = soups.random(15, 60, "large", "flat", alpha=(0.0, 0.0))
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (30, 20), "background": background, "lanes": lanes}
    got = plainly.render(soup.scene(), technique=technique, **call)
    assert got.stats["fragments"] > 500 and not got.color.any()
    np.testing.assert_array_equal(got.image, reference.image(np.zeros((20, 30, 4)), background))


@pytest.mark.parametrize("technique", BLENDING)
def test_16_alphas_too_small_for_one_minus_alpha(technique: str, lanes: int) -> None:
    """Colour comes in whatever alpha rounds to; the transmittance only where its power is taken of pairs of floats."""
    count = 1000
    colors = np.tile(np.float32([1.0, 1.0, 1.0, 2.0**-25]), (count, 1))
    got = render(soups.stack(np.linspace(1, 7, count), colors), technique, lanes, (1, 1)).color[0, 0]
    want = closed_form(technique, colors)
    assert got[:3] == pytest.approx(want[:3], rel=count * UNIT)
    kept = technique.startswith("weighted")
    assert got[3] == pytest.approx(want[3] if kept else 0.0, abs=UNIT)


@pytest.mark.parametrize("technique", BLENDING)
def test_17_one_layer_is_exact(technique: str, lanes: int) -> None:
    one = np.array([0.3, 0.7, 1.0, 1 / 255], np.float32)
    got = render(soups.stack([2.0], one[None]), technique, lanes).color
    assert (got[..., :3] == one[:3] * one[3]).all()
    assert (got[..., 3] == np.float32(1) - (np.float32(1) - one[3])).all()


@pytest.mark.parametrize("technique", BLENDING)
def test_18_two_layers_swapped(technique: str, lanes: int) -> None:
    """Exact pictures change by a^2 (c1 - c2); those without an order do not, and the average sits midway."""
    a, first, second = 0.5, np.array([1, 0, 0.25]), np.array([0, 0.5, 0.25])
    pair = [soups.stack([2.0, 3.0], np.c_[np.array(c), [a, a]]) for c in ([first, second], [second, first])]
    one, other = (render(soup, technique, lanes).color[0, 0] for soup in pair)
    change = 0 * first if technique.startswith("weighted") else a**2 * (first - second)
    assert (one[:3] - other[:3] == change).all() and one[3] == other[3]
    if technique == "weighted-average":
        exact = [render(soup, "sort", lanes).color[0, 0] for soup in pair]
        assert (one == (exact[0] + exact[1]) / 2).all()


@pytest.mark.parametrize("technique", BLENDING)
def test_19_an_opaque_surface_in_front(technique: str, lanes: int) -> None:
    colors = np.r_[[[0.25, 0.5, 1.0, 1.0]], np.random.default_rng(19).random((60, 4)) * [1, 1, 1, 0.5]]
    result = render(soups.stack(np.linspace(1, 7, 61), colors), technique, lanes)
    assert (result.color == [0.25, 0.5, 1.0, 1.0]).all() and result.stats["fragments"] == 0


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7])
def test_20_the_middle_layer_is_blended_once(technique: str, count: int, lanes: int) -> None:
    colors = np.random.default_rng(count).random((count, 4)).astype(np.float32)
    got = render(soups.stack(np.linspace(1, 7, count), colors), technique, lanes).color
    want = closed_form(technique, colors)
    assert np.abs(got - want).max() <= bound(technique, count, want)


@pytest.mark.parametrize("technique", BLENDING)
def test_23_a_range_of_ten_millions(technique: str, lanes: int) -> None:
    """Two layers 2^-22 of their distance apart are two, near or far: depths are as precise everywhere."""
    view = soups.Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4))
    for distance in (2e-3, 1.0, 5e3):
        for near, far in ((0, 1), (1, 0)):
            away = [distance * (1 + 2.0**-22 * near), distance * (1 + 2.0**-22 * far)]
            scene = soups.stack(away, np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5)])).scene()
            got = plainly.render(scene, view.camera(), (3, 2), technique, lanes=lanes).color
            want = closed_form(technique, np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5)])[[near, far]])
            assert (got == want).all()


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("count", [127, 128, 149, 150, 151])
def test_24_denormal_transmittance(technique: str, count: int, lanes: int) -> None:
    """(1/2)^N below 2^-126: flushed to zero or not, the image is the same, and the right one."""
    colors = np.random.default_rng(24).random((count, 4)).astype(np.float32)
    colors[:, 3] = 0.5
    result = render(soups.stack(np.linspace(1, 7, count), colors), technique, lanes, background=(0.5, 0.25, 1.0))
    want = closed_form(technique, colors)
    assert np.abs(result.color - want).max() <= bound(technique, count, want)
    over = (np.clip(want[:3] + (1 - want[3]) * np.array([0.5, 0.25, 1.0]), 0, 1) * 255 + 0.5).astype(int)
    assert (np.abs(result.image[..., :3].astype(int) - over) <= (technique == "weighted-average")).all()
    assert (result.image[..., 3] == 255).all()


@pytest.mark.parametrize("technique", EXACT)
def test_25_shuffled_triangles_and_repeats(technique: str, judge: Judge) -> None:
    soup, size = soups.random(25, 150, "mixed"), (50, 40)
    want = plainly.render(soup.scene(), BENCH.camera(), size, technique, lanes=1)
    rng = np.random.default_rng(25)
    for lanes in (1, 16, 64):
        for _ in range(2):
            shuffled = soup.take(rng.permutation(len(soup.faces))).scene()
            judge.same_bits(plainly.render(shuffled, BENCH.camera(), size, technique, lanes=lanes), want)


@pytest.mark.parametrize("technique", BLENDING)
def test_25_a_hundred_repeats(technique: str, lanes: int) -> None:
    renderer = plainly.Renderer(soups.random(26, 60, "mixed", "vertex").scene(), lanes=lanes)
    digests = {
        hashlib.sha256(renderer.render(BENCH.camera(), (40, 30), technique).color.tobytes()).digest()
        for _ in range(100)
    }
    assert len(digests) == 1
