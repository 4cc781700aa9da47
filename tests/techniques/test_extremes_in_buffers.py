"""The list of extremes in the papers' buffers: 8 bits where layers are blended, 16-bit floats where they are summed up.

Each technique in the precision of its paper, beside itself in float32. Where such buffers fail by their nature the test
says at what number, and that float32 does not. Where they do not, they hold what `stored` holds, bit for bit.

Which tests reach which number of the list of extremes (docs/extremes.md says what they find):

    number                              all techniques, float32    here   elsewhere, with more detail
    1  face indices                                                       test_extremes
    2  ten thousand triangles                                      x      test_extremes
    3  vertices that are not finite                                x      test_extremes
    4  colours out of range                                               test_extremes
    5  through the eye                                             x      test_extremes
    6  any scale, far from the origin                              x      test_extremes, test_plot_extremes
    7  the same triangle k times        test_extremes_of_all       x      test_extremes, test_peeling
    8  coincident, different colours    test_extremes_of_all       x      test_extremes, test_peeling
    9  depths next to each other        test_extremes_of_all       x      test_extremes, test_raster
    10 100,000 fragments in a pixel     test_extremes_of_all       x      test_extremes
    11 more layers than are peeled                                 x      test_peeling, test_glowscript, test_max_error
    12 N equal layers                   test_extremes_of_all       x      test_extremes, test_plot_extremes
    13 a thousand of 1/255                                         x      test_plot_extremes
    14 sums that stick or overflow                                 x      test_weighted_average, test_plot_extremes
    15 all alphas zero                  test_extremes_of_all       x      test_extremes
    16 alphas too small for 1 - a       test_extremes_of_all       x      test_weighted_average
    17 one layer of 1/255               test_extremes_of_all       x      test_extremes
    18 averages, layers swapped         test_extremes_of_all       x      test_weighted_average
    19 an opaque fragment in front      test_extremes_of_all       x      test_extremes, test_opaque
    20 the middle layer                 test_extremes_of_all       x      test_peeling
    21 every sample once                                           x      test_extremes
    22 slivers                                                     x      test_extremes
    23 far / near of 10^7               test_extremes_of_all       x      test_depth, test_plot_extremes
    24 denormal transmittance           test_extremes_of_all       x
    25 shuffled, repeated, both shapes  test_extremes_of_all       x      test_extremes
    26 sizes of pictures                                           x      test_extremes
    bounds: float32                     test_accuracy              x      test_extremes, test_comparison
            8 bits, half, k layers                                 x      test_plot_extremes, test_max_error
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import reference, soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.precision import DEFAULT_PRECISION, blending_bound

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

single = np.float32
ELSEWHERE = ("moments",)
"""Whose buffers round other numbers than blends: their own tests have their bits and bounds."""
BLENDING = [
    name
    for name, technique in TECHNIQUES.items()
    if "precision" in technique.option_names and not technique.maps and name not in ELSEWHERE
]
PAPERS = {name: TECHNIQUES[name].paper_precision for name in BLENDING}
COARSE = [name for name in BLENDING if PAPERS[name] != DEFAULT_PRECISION]
IN_ORDER = [name for name in COARSE if PAPERS[name] == "unorm8"]
SUMMED = [name for name in COARSE if PAPERS[name] == "half"]
QUADRATIC = (
    "depth-peeling",
    "dual-depth-peeling",
    "multi-layer-peeling",
)  # as many passes as layers, or a share of that
MOST = 1000  # layers for them
PEELS = 4  # of glowscript
COLORS = np.random.default_rng(1).random((7, 4)).astype(single)


def most(technique: str, count: int) -> int:
    return min(count, MOST) if technique in QUADRATIC else count


def render(
    colors: Any,
    technique: str,
    precision: str,
    lanes: int,
    size: tuple[int, int] = (3, 2),
    away: Any = None,
    **more: Any,
) -> clpeel.Result:
    """A picture of layers that fill the view, front to back unless told how far away."""
    colors = np.asarray(colors, single)
    away = np.linspace(1, 7, len(colors)) if away is None else away
    more = {"opaque": "blend", **more}
    return plainly.render(
        soups.stack(away, colors).scene(), AHEAD.camera(), size, technique, lanes=lanes, precision=precision, **more
    )


def kept(value: Any, precision: str) -> Any:
    """What a buffer keeps of float32 numbers; of 8 bits in steps."""
    if precision == "half":
        return np.float16(value).astype(single)
    return np.minimum(np.floor(value + single(0.5)), single(255)) if precision == "unorm8" else value


def stored(technique: str, precision: str, colors: Any) -> np.ndarray:
    """Premultiplied RGBA of layers [n, 4], front to back: each blend in float32, then as the buffer keeps it.

    `weighted-average` ends with a quotient and a power, which are float64's here; all else is what must be found, to
    the bit.
    """
    colors, one = np.asarray(colors, single), single(1)
    full = single(255 if precision == "unorm8" else 1)

    def under(buffer: np.ndarray, rgba: np.ndarray) -> np.ndarray:
        rgb = kept(buffer[:3] + buffer[3] * (rgba[3] * rgba[:3]), precision)
        return np.append(rgb, kept(buffer[3] * (one - rgba[3]), precision))

    def over(buffer: np.ndarray, rgba: np.ndarray) -> np.ndarray:
        through = one - rgba[3]
        rgb = kept(rgba[3] * rgba[:3] * full + through * buffer[:3], precision)
        return np.append(rgb, kept(through * buffer[3], precision))

    clear = np.array([0, 0, 0, full], single)
    if technique.startswith("weighted"):
        sums = np.zeros(4, single)
        for rgba in colors:
            sums = kept(sums + np.append(rgba[3] * rgba[:3], rgba[3]) * full, precision)
        sums = sums / full
        if technique == "weighted-sum":
            return np.append(sums[:3], one - (one - sums[3]))
        n = min(len(colors), {"half": 2048, "unorm8": 255}.get(precision, len(colors)))
        cover = -np.expm1(n * np.log1p(-min(float(sums[3]) / n, 1 - 2.0**-53)))
        return np.append(sums[:3] * (cover / sums[3] if sums[3] else 0), cover)
    if technique == "glowscript":
        merged = np.array([0, 0, 0, 1], single)
        for rgba in kept(colors[:PEELS] * full, precision)[::-1] / full:
            through = one - rgba[3]
            merged = np.append(rgba[3] * rgba[:3] + through * merged[:3], through * merged[3])
    elif technique == "dual-depth-peeling":
        front, back = clear, clear
        while len(colors) and front[3] > 0:
            front = under(front, colors[0])
            if len(colors) > 1:
                back = over(back, colors[-1])
            colors = colors[1:-1]
        front, back = front / full, back / full
        merged = np.append(front[:3] + front[3] * back[:3], front[3] * back[3])
    else:
        merged = clear
        for rgba in colors:
            merged = under(merged, rgba)
        merged = merged / full
    return np.append(merged[:3], one - merged[3])


def as_stored(result: clpeel.Result, technique: str, precision: str, colors: Any) -> None:
    """Every pixel holds these layers, front to back."""
    want = stored(technique, precision, colors)
    if technique == "weighted-average":
        assert np.abs(result.color - want).max() <= 8 * UNIT
    else:
        np.testing.assert_array_equal(result.color, np.broadcast_to(want.astype(single), result.color.shape))


def exact(colors: Any) -> np.ndarray:
    """Premultiplied RGBA in float64."""
    rgb, alpha = np.split(np.asarray(colors, single).astype(float), [3], axis=1)
    clear = np.cumprod(np.append(1, 1 - alpha))
    return np.append((rgb * alpha * clear[:-1, None]).sum(axis=0), 1 - clear[-1])


def equal(rgba: tuple[float, ...], count: int) -> np.ndarray:
    """The closed form of N equal layers: c (1 - (1 - a)^N)."""
    *rgb, alpha = np.asarray(rgba, single).astype(float)
    cover = -np.expm1(count * np.log1p(-alpha))
    return np.append(np.array(rgb) * cover, cover)


# --- unsafe, hanging, or silently lost --------------------------------------------------------------------------------


@pytest.mark.parametrize("technique", BLENDING)
def test_02_and_10_thousands_of_layers(technique: str, lanes: int) -> None:
    """Alphas below half a step of 8 bits are not there at all; sums of 16-bit floats stop at 4; float32 has all."""
    count, size = most(technique, 10_000), (20, 7)
    rgba = (1.0, 0.5, 0.25, 0.001)
    fine = render([rgba] * count, technique, DEFAULT_PRECISION, lanes, size)
    assert fine.stats["fragments"] == count * 20 * 7
    if technique not in SUMMED:
        want = equal(rgba, PEELS if technique == "glowscript" else count)
        assert np.abs(fine.color - want).max() <= (3 * count + 4) * UNIT
    coarse = render([rgba] * count, technique, PAPERS[technique], lanes, size)
    assert coarse.stats["fragments"] == fine.stats["fragments"]
    if technique in IN_ORDER:
        assert not coarse.color.any()
    elif technique == "weighted-sum":
        assert (coarse.color == [4, 2, 1, 4]).all()
        assert np.abs(fine.color - np.array([10, 5, 2.5, 10])).max() <= 10 * (count + 4) * UNIT


@pytest.mark.parametrize("technique", BLENDING)
def test_03_vertices_that_are_not_finite(technique: str, lanes: int, judge: Judge) -> None:
    soup = soups.random(3, 30, "large", "flat")
    vertices = soup.vertices.copy()
    for corner, value in ((0, np.nan), (16, np.inf), (44, -np.inf), (89, np.nan)):
        vertices[corner, corner % 3] = value
    bad = [0, 5, 14, 29]
    for precision in {DEFAULT_PRECISION, PAPERS[technique]}:
        got, want = (
            plainly.render(one.scene(), BENCH.camera(), (40, 30), technique, lanes=lanes, precision=precision)
            for one in (replace(soup, vertices=vertices), soup.take(np.delete(np.arange(30), bad)))
        )
        assert got.stats["discarded"] == len(bad) and want.stats["discarded"] == 0
        judge.same_bits(got, want)


@pytest.mark.parametrize("technique", BLENDING)
def test_05_the_eye_within_a_closed_mesh(technique: str, lanes: int) -> None:
    rgba = (0.3, 0.6, 1.0, 0.4)
    soup = soups.sphere(1.0, rgba)
    view = soups.Eye((0.1, 0.05, 0.2), (1.0, 0.3, -0.4), (0.0, 1.0, 0.1), 70.0, (0.001, 10.0))
    # In float32, so that the kernels are those of the other tests.
    soup = replace(soup, vertices=soup.vertices.astype(single).astype(float))
    for precision in {DEFAULT_PRECISION, PAPERS[technique]}:
        got = plainly.render(soup.scene(), view.camera(), (37, 25), technique, lanes=lanes, precision=precision)
        as_stored(got, technique, precision, [rgba])


@pytest.mark.parametrize("technique", BLENDING)
def test_06_far_from_the_origin_and_of_any_size(technique: str, lanes: int, judge: Judge) -> None:
    """Detail of 1e-3 at 1e8 from the origin, and a scene 2^99 times as large, have the picture's own bits."""
    soup = soups.random(7, 40, "large", "flat")
    here = replace(soup, vertices=np.round(soup.vertices * 1e-3 * 2**20) / 2**20)
    view = replace(BENCH, position=(0.0, 0.0, 2.0**-8), clipping_range=(2.0**-10, 2.0**-6))
    offset, scale = np.array([1e8, -1e8, 1e8]), 2.0**99
    there = replace(here, vertices=here.vertices + offset)
    away = replace(view, position=tuple(offset + view.position), focal_point=tuple(offset))
    large = replace(here, vertices=here.vertices * scale)
    afar = replace(view, position=(0.0, 0.0, 2.0**91), clipping_range=(2.0**89, 2.0**93))
    for precision in {DEFAULT_PRECISION, PAPERS[technique]}:
        pictures = [
            plainly.render(one.scene(), eye.camera(), (60, 50), technique, lanes=lanes, precision=precision)
            for one, eye in ((here, view), (there, away), (large, afar))
        ]
        assert pictures[0].stats["layers_max"] >= PEELS
        judge.same_bits(pictures[1], pictures[0])
        judge.same_bits(pictures[2], pictures[0])


@pytest.mark.parametrize("technique", COARSE)
@pytest.mark.parametrize("count", [2, 5, 300])
def test_07_and_08_coincident_layers(technique: str, count: int, lanes: int) -> None:
    colors = np.random.default_rng(count).random((count, 4)).astype(single) * single([1, 1, 1, 0.3])
    for layers in (colors, colors[:1].repeat(count, axis=0)):
        result = render(layers, technique, PAPERS[technique], lanes, away=[2.0] * count)
        as_stored(result, technique, PAPERS[technique], layers)
    if "coincident" in TECHNIQUES[technique].option_names and lanes == 1:  # the paper's buffers and its comparison
        result = render(colors, technique, PAPERS[technique], lanes, away=[2.0] * count, coincident="paper")
        as_stored(result, technique, PAPERS[technique], colors[:1])


@pytest.mark.parametrize("technique", COARSE)
def test_09_next_to_each_other(technique: str, lanes: int) -> None:
    colors = COLORS[:3]
    for away in ([2.0, np.nextafter(2.0, 3), 2.0 + 2.0**-20], [1.0, 1.0 + 2.0**-22, 7.0], [0.5, 0.5 + 2.0**-23, 8.0]):
        as_stored(render(colors, technique, PAPERS[technique], lanes, away=away), technique, PAPERS[technique], colors)


@pytest.mark.parametrize("technique", [name for name in COARSE if "passes" in TECHNIQUES[name].option_names])
@pytest.mark.parametrize("passes", [1, 3])
def test_11_more_layers_than_are_peeled(technique: str, passes: int, lanes: int) -> None:
    """What is hidden is at most what still comes through, give or take each blend's rounding; and it is said."""
    count = 40
    colors = np.random.default_rng(11).random((count, 4)) * [1, 1, 1, 0.1]
    for precision in (DEFAULT_PRECISION, PAPERS[technique]):
        result = render(colors, technique, precision, lanes, passes=passes)
        assert result.stats["truncated_pixels"] == 6 and 0 < result.stats["truncation_bound"] < 1
        off = np.abs(result.color - exact(colors)).max()
        assert off <= result.stats["truncation_bound"] + blending_bound(count, precision)


# --- a wrong picture --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("technique", COARSE)
@pytest.mark.parametrize("alpha", [1 / 255, 0.01, 0.5, 0.999])
@pytest.mark.parametrize("count", [1, 3, 100, 65_536])
def test_12_equal_layers(technique: str, alpha: float, count: int, lanes: int) -> None:
    """White in 8 bits is off by at most 0.5 / a steps, and what shines through by that much once it sticks.

    T sticks at the last whole number of steps of which a layer takes less than a half; from both ends, twice. Float32
    is not off.
    """
    count = most(technique, count)
    rgba = (1.0, 0.5, 0.125, alpha)
    coarse = render([rgba] * count, technique, PAPERS[technique], lanes, (1, 1)).color[0, 0].astype(float)
    seen = min(count, PEELS) if technique == "glowscript" else count
    want = equal(rgba, seen)
    if count <= 100:
        as_stored(
            render([rgba] * count, technique, PAPERS[technique], lanes), technique, PAPERS[technique], [rgba] * count
        )
    if technique in IN_ORDER:
        off = 255 * abs(coarse[0] - want[0])
        assert off <= 0.5 / alpha + 0.5
        if count * alpha > 9 and technique != "glowscript":
            lost = 0.5 / alpha if technique != "dual-depth-peeling" else (0.5 / alpha) ** 2 / 255
            assert 255 * (want[3] - coarse[3]) == pytest.approx(lost, abs=1.1)
    elif technique == "weighted-sum":
        total = np.array(rgba) * [alpha, alpha, alpha, 1] * count
        assert (np.abs(coarse - total) <= (count + 1) * 2.0**-11 * total).all()
    else:
        # Sums that stick do so at powers of two, and white, 1/2 and 1/8 at the same ones: their quotients are right.
        assert np.abs(coarse - want).max() <= max(2.0**-11 * min(count, 100), 1e-6)
    fine = render([rgba] * count, technique, DEFAULT_PRECISION, lanes, (1, 1)).color[0, 0]
    want = np.array(rgba) * [alpha, alpha, alpha, 1] * count if technique == "weighted-sum" else want
    assert np.abs(fine - want).max() <= (3 * count + 8) * UNIT * max(1, want.max())


WHITE_THOUSAND = {"dual-depth-peeling": 128 + 127 * 128 / 255, "glowscript": 255 * (1 - (254 / 255) ** 4)}


@pytest.mark.parametrize("technique", BLENDING)
def test_13_a_thousand_layers_of_a_255th(technique: str, lanes: int) -> None:
    """White on black is 249.99 of 255. An 8-bit buffer sticks at 128, from either end; sums do not stick yet."""
    layers = [(1.0, 1.0, 1.0, 1 / 255)] * 1000
    call: dict[str, Any] = {"lanes": lanes, "background": (0, 0, 0)}
    fine = render(layers, technique, DEFAULT_PRECISION, **call)
    coarse = render(layers, technique, PAPERS[technique], **call)
    if technique in IN_ORDER:
        want = WHITE_THOUSAND.get(technique, 128)
        np.testing.assert_allclose(255 * coarse.color[..., 0], want, rtol=4 * UNIT, atol=0.02)
        assert (coarse.image[..., :3] == int(want + 0.5)).all()
    elif technique == "weighted-average":
        assert np.abs(coarse.image[..., :3].astype(int) - 250).max() <= 1
    if technique == "glowscript":
        assert (fine.image[..., :3] == 4).all()
    else:
        assert (fine.image[..., :3] == (255 if technique == "weighted-sum" else 250)).all()


@pytest.mark.parametrize("technique", SUMMED)
@pytest.mark.parametrize(("alpha", "sticks"), [(1.0, 2048), (0.5, 1024), (0.1, 256)])
def test_14_sums_of_16_bit_floats_stick(technique: str, alpha: float, sticks: int, lanes: int) -> None:
    """At the number whose neighbour is twice as far away as what is added; and so they never overflow.

    65520 and more would become infinity, and their quotient NaN. But no sum of numbers up to one gets beyond 2048.
    """
    layers = 65_536 if alpha == 1 else 5000
    result = render([(1.0, 0.7, 0.0, alpha)] * layers, technique, "half", lanes)
    assert np.isfinite(result.color).all() and (result.image[..., 3] == 255).all()
    if technique == "weighted-sum":
        assert (result.color[..., [0, 3]] == sticks).all()
    else:
        # Both count no further than 2048. Where 0.7 a sticks earlier than a does, the quotient is no longer 0.7.
        cover = -np.expm1(2048 * np.log1p(-min(sticks / 2048, 1 - 2.0**-53)))
        green = float(stored("weighted-sum", "half", [(1.0, 0.7, 0.0, alpha)] * 5000)[1]) / sticks
        assert result.color[0, 0] == pytest.approx([cover, cover * green, 0, cover], abs=8 * UNIT)
        assert abs(green - 0.7) > 0.15
    fine = render([(1.0, 0.7, 0.0, alpha)] * layers, technique, DEFAULT_PRECISION, lanes).color[0, 0].astype(float)
    assert fine[1] / fine[0] == pytest.approx(0.7, rel=2 * layers * UNIT)
    if technique == "weighted-sum":
        assert fine[0] == pytest.approx(alpha * layers, rel=layers * UNIT)


@pytest.mark.parametrize("technique", COARSE)
@pytest.mark.parametrize("background", [(1 / 3, 0.999, 1e-3), None])
def test_15_all_alphas_zero(technique: str, background: Any, lanes: int) -> None:
    result = render(COLORS * [1, 1, 1, 0], technique, PAPERS[technique], lanes, (9, 5), background=background)
    assert result.stats["fragments"] == 7 * 45 and not result.color.any()
    np.testing.assert_array_equal(result.image, reference.image(np.zeros((5, 9, 4)), background))


@pytest.mark.parametrize("technique", COARSE)
def test_16_alphas_too_small(technique: str, lanes: int) -> None:
    """2^-25 is half of the least 16-bit float, and rounds to zero; one more bit, and sums have it."""
    for alpha, held in ((2.0**-25, 0.0), (1.5 * 2.0**-25, 1000 * 2.0**-24)):
        layers = [(1.0, 1.0, 1.0, alpha)] * 1000
        coarse = render(layers, technique, PAPERS[technique], lanes, (1, 1)).color[0, 0]
        fine = render(layers, technique, DEFAULT_PRECISION, lanes, (1, 1)).color[0, 0]
        assert fine[0] == pytest.approx((PEELS if technique == "glowscript" else 1000) * alpha, rel=1e-4)
        assert coarse[0] == pytest.approx(held if technique in SUMMED else 0.0, rel=1e-4)


@pytest.mark.parametrize("technique", COARSE)
def test_17_one_layer(technique: str, lanes: int) -> None:
    """Of a = 1/255 exact in 8 bits, where its colour is; of 16-bit floats the nearest one."""
    precision = PAPERS[technique]
    for rgba in ((1.0, 0.0, 1.0, 1 / 255), (0.3, 0.7, 1.0, 1 / 255), (0.3, 0.7, 1.0, 0.6)):
        result = render([rgba], technique, precision, lanes)
        as_stored(result, technique, precision, [rgba])
    result = render([(1.0, 0.0, 1.0, 1 / 255)], technique, precision, lanes, background=(0, 0, 0))
    assert (result.image == [1, 0, 1, 255]).all()
    if precision == "unorm8":
        assert (result.color[..., 0] == single(1 / 255)).all()


@pytest.mark.parametrize("technique", COARSE)
def test_18_two_layers_swapped(technique: str, lanes: int) -> None:
    """Exact pictures change by a^2 (c1 - c2), to one and a half steps of 8 bits; averages and sums not at all."""
    a, first, second = 0.5, np.array([1, 0, 0.25]), np.array([0, 0.5, 0.25])
    pair = [np.c_[np.array(c), [a, a]] for c in ([first, second], [second, first])]
    one, other = (render(colors, technique, PAPERS[technique], lanes).color[0, 0] for colors in pair)
    change = 0 * first if technique in SUMMED else a**2 * (first - second)
    assert np.abs(one[:3] - other[:3] - change).max() <= (0 if technique in SUMMED else 1.5 / 255)
    assert one[3] == other[3]


@pytest.mark.parametrize("technique", COARSE)
@pytest.mark.parametrize("opaque", ["blend", "first"])
def test_19_an_opaque_surface_in_front(technique: str, opaque: str, lanes: int) -> None:
    """Its colour as the buffer keeps it, and nothing of what is behind. Sums know no front."""
    if opaque == "first" and lanes != 1:
        pytest.skip("one shape is enough here: kernels of their own")
    precision = PAPERS[technique]
    rgb = single([0.2, 0.5, 1.0])
    full = single(255 if precision == "unorm8" else 1)
    colors = np.concatenate([[(*rgb, 1.0)], np.random.default_rng(19).random((30, 4)) * [1, 1, 1, 0.5]])
    result = render(colors, technique, precision, lanes, opaque=opaque)
    if opaque == "first" or technique in IN_ORDER:
        assert (result.color == np.append(kept(rgb * full, precision) / full, single(1))).all()
        assert (result.image == [51, 128, 255, 255]).all()
    else:
        as_stored(result, technique, precision, colors)


@pytest.mark.parametrize("technique", COARSE)
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 7])
def test_20_the_middle_layer_is_blended_once(technique: str, count: int, lanes: int) -> None:
    as_stored(render(COLORS[:count], technique, PAPERS[technique], lanes), technique, PAPERS[technique], COLORS[:count])


@pytest.mark.parametrize("technique", BLENDING)
def test_21_and_22_every_sample_once(technique: str, lanes: int) -> None:
    """A grid and a fan of slivers fill the view: one layer of it everywhere, in whatever precision."""
    rgba = (1.0, 0.5, 0.0, 0.5)
    xs = np.sort(np.r_[-9.0, 9.0, np.random.default_rng(23).uniform(-2, 2, 300)])
    k = np.arange(len(xs) - 1)
    corners = np.concatenate([np.stack([xs, np.full_like(xs, y), 0 * xs], -1) for y in (9.0, -9.0)])
    slivers = np.concatenate(
        [np.stack([k, k + 1, len(xs) + k], -1), np.stack([k + 1, len(xs) + k + 1, len(xs) + k], -1)]
    )
    for soup in (soups.grid(23, 31, (-9, -9), (9, 9), rgba, 0.24), soups.paint(corners, slivers, rgba)):
        soup = replace(soup, vertices=soup.vertices.astype(single).astype(float))
        for precision in {DEFAULT_PRECISION, PAPERS[technique]}:
            call: dict[str, Any] = {"lanes": lanes, "precision": precision}
            result = plainly.render(soup.scene(), BENCH.camera(), (50, 45), technique, **call)
            assert result.stats["fragments"] == 50 * 45
            as_stored(result, technique, precision, [rgba])


@pytest.mark.parametrize("technique", COARSE)
def test_23_a_range_of_ten_millions(technique: str, lanes: int) -> None:
    view = soups.Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4))
    precision = PAPERS[technique]
    for distance in (2e-3, 1.0, 5e3):
        for away in ([1.0, 1 + 2.0**-22], [1 + 2.0**-22, 1.0]):
            scene = soups.stack(single(distance) * np.array(away), COLORS[:2]).scene()
            got = plainly.render(scene, view.camera(), (3, 2), technique, lanes=lanes, precision=precision)
            in_order = technique in SUMMED or away[0] < away[1]
            as_stored(got, technique, precision, COLORS[:2] if in_order else COLORS[1::-1])


@pytest.mark.parametrize("technique", IN_ORDER)
@pytest.mark.parametrize("count", [9, 127, 150])
def test_24_halves_of_halves(technique: str, count: int, lanes: int) -> None:
    """What 8 bits keep of a half of one step is one step again: the transmittance stays there, and never is denormal.

    A white layer then adds half a step, rounded to a whole one, each time: over all layers the picture goes on to
    full white, where it belongs anyway. Darker ones add nothing.
    """
    for white in (1.0, 0.75):
        layers = np.tile(single([white, 0.5, 0.25, 0.5]), (count, 1))
        result = render(layers, technique, "unorm8", lanes)
        as_stored(result, technique, "unorm8", layers)
        if technique != "glowscript":
            off = 255 * np.abs(result.color - equal((white, 0.5, 0.25, 0.5), count)).max()
            assert off <= 2
            left = 255 * (1 - result.color[0, 0, 3].astype(float))
            assert technique == "dual-depth-peeling" or left == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("technique", COARSE)
def test_25_shuffled_both_shapes_and_a_hundred_repeats(technique: str, judge: Judge) -> None:
    """Sorted or peeled pictures are the same of shuffled triangles; sums are of the order of submission."""
    soup, size, precision = soups.random(25, 120, "mixed", "flat"), (50, 40), PAPERS[technique]
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "technique": technique, "precision": precision}
    renderers = [plainly.Renderer(soup.scene(), lanes=lanes) for lanes in (1, 64)]
    want = renderers[0].render(**call)
    for renderer in renderers:
        for _ in range(50):
            judge.same_bits(renderer.render(**call), want)
    order = np.random.default_rng(25).permutation(len(soup.faces))
    for lanes in (1, 64):
        other = plainly.render(soup.take(order).scene(), lanes=lanes, **call)
        if technique in IN_ORDER:
            judge.same_bits(other, want)
        else:
            off = np.abs(other.color - want.color).max()
            assert 0 < off <= 4 * want.stats["layers_max"] * 2.0**-11 * np.abs(want.color).max()


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("size", [(1, 1), (1, 16384), (16384, 1), (17, 33)])
def test_26_odd_sizes(technique: str, size: tuple[int, int], lanes: int) -> None:
    distances = np.linspace(1, 7, len(COLORS))
    soup = soups.stack(distances, COLORS, reach=1.5 * max(size[0] / size[1], 1))
    soup = replace(soup, vertices=soup.vertices.astype(single).astype(float))
    precision = PAPERS[technique]
    result = plainly.render(soup.scene(), AHEAD.camera(), size, technique, lanes=lanes, precision=precision)
    assert result.image.shape == result.color.shape == (size[1], size[0], 4)
    assert result.stats["fragments"] == len(COLORS) * size[0] * size[1]
    as_stored(result, technique, precision, COLORS)


# --- the bounds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("alpha", "layers"), [(0.9, 3), (0.5, 9), (0.1, 60)])
@pytest.mark.parametrize("technique", [name for name in BLENDING if "max_error" in TECHNIQUES[name].option_names])
def test_bounds_after_so_many_layers_nothing_is_seen(technique: str, alpha: float, layers: int, lanes: int) -> None:
    """After k layers the rest changes less than half a step of 8 bits, in float32."""
    count = 200
    colors = np.random.default_rng(60).random((count, 4)) * [1, 1, 1, 0] + [0, 0, 0, alpha]
    result = render(colors[:layers], technique, DEFAULT_PRECISION, lanes)
    assert (1 - alpha) ** layers < 0.5 / 255 < (1 - alpha) ** (layers - 1)
    assert np.abs(result.color - exact(colors)).max() <= (1 - alpha) ** layers + blending_bound(layers)
