"""stochastic: the paper's three passes sample by sample, its extremes, and how large its noise is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

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
from clpeel.pictures.layers import Layers
from clpeel.techniques import technique

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

Floats = NDArray[np.float64]
Samples = Literal[8, 16, 64]
SAMPLES: tuple[Samples, ...] = (8, 16, 64)
NAME = "stochastic"
WIDE = (200, 150)
"""A picture with so many pixels that means over it are known well: each has masks of its own."""

ERRORS = 5
"""So many standard errors a mean may be off by: less than one of a million means is."""


# --- the paper's passes, sample by sample -----------------------------------------------------------------------------


def hashed(number: int) -> int:
    """The hash of a whole number below 2^32."""
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        number = (number ^ number >> shift) * factor % 2**32
    return number ^ number >> 16


def mask_of(column: int, row: int, rank: int, alpha: float, count: int) -> set[int]:
    """Which of a pixel's samples a fragment covers: floor(alpha S + xi) of them, each set of them equally likely."""
    golden = 0x9E3779B9
    seed = hashed(hashed(column + row * 2**16) ^ rank * golden % 2**32)
    wanted, mask = int(int(alpha * 2**24) * count + (hashed(seed) >> 8)) >> 24, set()
    for sample in range(count):
        seed = (seed + golden) % 2**32
        if (hashed(seed) >> 8) * (count - sample) >> 24 < wanted - len(mask):
            mask.add(sample)
    return mask


def three_passes(layers: Layers, count: int, corrected: bool) -> Floats:
    """Premultiplied RGBA [h, w, 4] of a picture's layers: total alpha, then the samples' depths, then the colours."""
    width, height = layers.size
    shown = np.zeros((height * width, 4))
    rng = np.random.default_rng(0)
    for pixel in range(height * width):
        own = layers.color[layers.start[pixel] : layers.start[pixel + 1]].astype(float)
        through = float((1 - own[:, 3]).prod())
        depths = np.full(count, np.inf)
        for rank in rng.permutation(len(own)):  # a depth test knows no order
            covered = list(mask_of(pixel % width, pixel // width, int(rank), own[rank, 3], count))
            depths[covered] = np.minimum(depths[covered], rank)
        visible = np.array([(depths >= rank).mean() for rank in range(len(own))])
        color, seen = (visible * own[:, 3]) @ own[:, :3], float(visible @ own[:, 3])
        if corrected:
            shown[pixel] = *(color * ((1 - through) / seen if seen else 0)), 1 - through
        else:
            shown[pixel] = *color, np.isfinite(depths).mean()
    return shown.reshape(height, width, 4)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.sampled_from(SAMPLES),
    corrected=st.booleans(),
    alpha=st.sampled_from([(0.05, 0.95), (0.0, 0.02), (0.9, 1.0)]),
    lanes=st.sampled_from((1, 64)),
)
def test_the_passes_of_the_paper(
    seed: int, count: Samples, corrected: bool, alpha: tuple[float, float], lanes: int, judge: Judge
) -> None:
    scene = soups.random(seed, 25, "large", "flat", alpha=alpha).scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (21, 18), "lanes": lanes, "opaque": "blend"}
    options = {"stochastic_samples": count, "alpha_correction": corrected}
    exact = plainly.render(scene, **call, layers=True)
    got = plainly.render(scene, technique=NAME, **call, **options)
    # Sums of which no part is negative: a few roundings for each layer, of it and of what it is divided by.
    judge.color(got, three_passes(exact.layers, count, corrected), (4 * exact.stats["layers_max"] + 12) * UNIT)


@pytest.mark.parametrize("corrected", [True, False])
def test_opaque_surfaces_behind(corrected: bool, lanes: int) -> None:
    colors = np.float32([(1, 0, 0, 0.5), (1, 1, 1, 0.5), (0, 1, 0, 0.25), (0.25, 0.5, 1, 1)])
    away, size = np.array([1.0, 5.0, 2.0, 3.0]), (9, 7)
    options: dict[str, Any] = {"lanes": lanes, "alpha_correction": corrected}
    got = plainly.render(soups.stack(away, colors).scene(), AHEAD.camera(), size, NAME, **options).color
    front = soups.stack(away[[0, 2]], colors[[0, 2]]).scene()
    alone = plainly.render(front, AHEAD.camera(), size, NAME, **options).color
    want = alone[..., :3] + (1 - alone[..., 3:]) * colors[3, :3]
    assert np.abs(got[..., :3] - want).max() <= 4 * UNIT and (got[..., 3] == 1).all()


def test_samples_of_the_picture_have_masks_of_their_own(lanes: int) -> None:
    """64 samples are those of a picture eight times as large: where they lie in it chooses the masks."""
    scene = soups.random(5, 60, "large", "vertex").scene()
    fine = plainly.render(scene, BENCH.camera(), (40, 24), NAME, lanes=lanes).color.astype(float)
    mean = plainly.render(scene, BENCH.camera(), (5, 3), NAME, lanes=lanes, samples=64).color
    assert np.abs(mean - fine.reshape(3, 8, 5, 8, 4).mean(axis=(1, 3))).max() <= 65 * UNIT


# --- extremes ---------------------------------------------------------------------------------------------------------


def render(
    away: Any, colors: Any, lanes: int, size: tuple[int, int] = (9, 7), view: Eye = AHEAD, **options: Any
) -> Any:
    """The colours [h, w, 4] of layers that fill the view, opaque ones too."""
    scene = soups.stack(away, np.asarray(colors, np.float32)).scene()
    return plainly.render(scene, view.camera(), size, NAME, lanes=lanes, opaque="blend", **options).color


@pytest.mark.parametrize("alpha", [0.0, 2.0**-20, 1 / 255, 0.3, 1.0])
def test_one_layer_is_exact(alpha: float, lanes: int) -> None:
    """Its visibility is one, whatever it covers."""
    one = np.float32([0.3, 0.7, 1.0, alpha])
    got = render([2.0], one[None], lanes)
    assert (got[..., 3] == np.float32(1) - (np.float32(1) - one[3])).all()
    assert np.abs(got[..., :3] - one[:3].astype(float) * got[..., 3:]).max() <= 4 * UNIT * float(one[3])


@pytest.mark.parametrize("corrected", [True, False])
def test_alphas_of_zero_and_one_have_no_noise(corrected: bool, lanes: int) -> None:
    colors = np.random.default_rng(4).random((7, 4)).astype(np.float32)
    colors[:, 3] = [0, 0, 1, 0, 1, 0, 1]
    got = render(np.linspace(1, 7, 7), colors, lanes, alpha_correction=corrected)
    assert np.abs(got - [*colors[2, :3], 1]).max() <= 2 * UNIT
    assert not render(np.linspace(1, 7, 7), colors * [1, 1, 1, 0], lanes, alpha_correction=corrected).any()


@pytest.mark.parametrize("samples", SAMPLES)
def test_thousands_of_layers(samples: Samples, lanes: int) -> None:
    """Alike, they show their colour and their exact opacity."""
    count, rgba = 3000, np.float32([0.5, 0.25, 1, 0.002])
    coverage = 1 - (1 - float(rgba[3])) ** count
    got = render(np.linspace(1, 7, count), np.tile(rgba, (count, 1)), lanes, (3, 2), stochastic_samples=samples)
    assert np.abs(got - np.r_[rgba[:3] * coverage, coverage]).max() <= (4 * count + 12) * UNIT


def test_a_range_of_ten_millions(lanes: int) -> None:
    """Two layers 2^-22 of their distance apart are two, near or far. The nearer one is seen whole."""
    view = Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4))
    colors = np.float32([(1, 0, 0, 0.5), (0, 1, 0, 0.5)])
    for distance in (2e-3, 1.0, 5e3):
        away = [distance * (1 + 2.0**-22), distance]
        got = render(away, colors, lanes, view=view, alpha_correction=False)
        # Half of the samples, exactly, lie behind the nearer one.
        assert (got[..., :3] == [0.25, 0.5, 0]).all()


def test_an_empty_view(lanes: int) -> None:
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    result = plainly.render(soups.random(1, 5).scene(), away, (20, 10), NAME, lanes=lanes)
    assert not result.color.any() and (result.image == 255).all()


@pytest.mark.parametrize("precision", ["half", "unorm8"])
def test_buffers_round_each_blend(precision: str, lanes: int) -> None:
    scene = soups.random(2, 40, "large", "flat", alpha=(0.2, 0.9)).scene()
    exact, got = (
        plainly.render(scene, BENCH.camera(), (30, 20), NAME, lanes=lanes, precision=each, alpha_correction=False)
        for each in ("float32", precision)
    )
    unit = {"half": 2.0**-11, "unorm8": 0.5 / 255}[precision]  # of sums up to 2
    error = np.abs(exact.color - got.color)
    assert UNIT * 100 < error[..., :3].max() <= exact.stats["layers_max"] * unit
    assert not error[..., 3].any(), "what masks leave is counted"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stochastic_samples": 4}, "stochastic_samples: expected one of 8, 16, 64; got 4"),
        ({"stochastic_samples": True}, "stochastic_samples: expected one of 8, 16, 64; got True"),
        ({"stochastic_samples": None}, "stochastic_samples: expected one of 8, 16, 64; got None"),
        ({"alpha_correction": "no"}, "alpha_correction: expected True or False, got 'no'"),
        ({"passes": 2}, "passes: the technique 'stochastic' has no such option"),
        ({"execution": "passes"}, "execution: expected 'tiles'.*stochastic"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=message) as error:
        plainly.render(soups.random(1, 5).scene(), BENCH.camera(), (4, 4), NAME, **options)
    assert "\n" not in str(error.value)


# --- the same bits ----------------------------------------------------------------------------------------------------


def test_the_same_bits_with_any_lanes_memory_and_order(judge: Judge) -> None:
    deep = soups.stack(np.random.default_rng(2).uniform(1, 7, 900), (0.3, 0.6, 0.9, 0.01))
    for soup, view in ((deep, AHEAD), (soups.random(3, 150, "large", "vertex"), BENCH)):
        order = np.random.default_rng(1).permutation(len(soup.faces))
        runs = [
            plainly.render(each.scene(), view.camera(), (40, 33), NAME, lanes=lanes, memory=memory)
            for lanes in (1, 64)
            for memory in ("256M", "1M")
            for each in (soup, soup.take(order))
        ]
        for other in runs[1:]:
            judge.same_bits(other, runs[0])


def test_coincident_fragments_have_masks_of_their_own(lanes: int) -> None:
    """What lies behind both is seen through both, in the mean. The one that was submitted first is in front."""
    colors = np.float32([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 1)])
    got = render([2.0, 2.0, 3.0], colors, lanes, WIDE, alpha_correction=False).astype(float)
    assert (got[..., 0] == 0.5).all() and (got[..., 1] == 0.25).all()
    assert abs(got[..., 2].mean() - 0.25) <= standard_errors(got[..., 2])


# --- noise ------------------------------------------------------------------------------------------------------------


def standard_errors(values: Any) -> float:
    """How far off the mean of so many independent values may be."""
    return ERRORS * float(np.std(values)) / float(np.sqrt(np.size(values)))


LAYERS = np.float32([(1, 0, 0, 0.45), (0, 1, 0, 0.45), (0, 0, 1, 0.3), (1, 1, 1, 0.6)])
"""The first two are the paper's example 1. They are blended in this order."""

EXACT = np.array([0.45 + 0.12705, 0.2475 + 0.12705, 0.09075 + 0.12705, 0.9153])
"""What they show: each colour times its alpha and all 1 - A before it; 0.12705 of white."""


@pytest.mark.parametrize("samples", SAMPLES)
def test_the_mean_is_the_exact_picture(samples: Samples) -> None:
    got = render(np.arange(1, 5), LAYERS, 1, WIDE, stochastic_samples=samples, alpha_correction=False).astype(float)
    for channel in range(4):
        values = got[..., channel]
        assert abs(values.mean() - EXACT[channel]) <= standard_errors(values) + 20 * UNIT, channel
        assert values.std() > 0.01


def test_alpha_correction_takes_noise_away_and_leaves_a_bias_that_falls() -> None:
    """It is a quotient of two means, so it is off by a term in 1 / S. The opacity is exact."""
    biases = []
    for samples in SAMPLES:
        plain, got = (
            render(np.arange(1, 5), LAYERS, 1, WIDE, stochastic_samples=samples, alpha_correction=each).astype(float)
            for each in (False, True)
        )
        assert np.abs(got[..., 3] - EXACT[3]).max() <= 8 * UNIT
        error, before = (np.sqrt(((each - EXACT) ** 2).mean(axis=(0, 1))) for each in (got, plain))
        assert (error < 0.8 * before).all()
        biases.append(np.abs(got.mean(axis=(0, 1)) - EXACT).max())
    assert biases[0] > 4 * biases[2]


@pytest.mark.parametrize(("corrected", "errors"), [(True, (0.048, 0.030, 0.014)), (False, (0.077, 0.049, 0.023))])
def test_how_noisy_it_is(corrected: bool, errors: tuple[float, ...]) -> None:
    """The numbers of docs/techniques.md."""
    for samples, error in zip(SAMPLES, errors, strict=True):
        got = render(np.arange(1, 5), LAYERS, 1, WIDE, stochastic_samples=samples, alpha_correction=corrected)
        assert abs(np.sqrt(((got[..., :3] - EXACT[:3]) ** 2).mean()) - error) <= 0.001


def test_each_set_of_samples_is_as_likely() -> None:
    """Two layers of alpha 1/2 cover 4 of 8 samples each. How many are left to both is known: C(4, k)^2 / C(8, 4)."""
    colors = np.float32([(0, 0, 0, 0.5), (0, 0, 0, 0.5), (1, 1, 1, 1)])
    left = np.rint(8 * render([1, 2, 3], colors, 1, WIDE, alpha_correction=False)[..., 0]).astype(int)
    got = np.bincount(left.ravel(), minlength=5) / left.size
    want = np.array([1, 16, 36, 16, 1]) / 70
    assert (np.abs(got - want) <= ERRORS * np.sqrt(want * (1 - want) / left.size)).all()


@pytest.mark.parametrize("alpha", [0.5, 0.3])
def test_the_noise_is_as_large_as_it_must_be(alpha: float) -> None:
    """Of what is seen through two layers, in closed form.

    A layer covers R of S samples, R = floor(A S) or one more; a second one so many, and of those that the first leaves
    L = S - R a hypergeometric number. `clpeel compare` finds the same.
    """
    colors = np.float32([(0, 0, 0, alpha), (0, 0, 0, alpha), (1, 1, 1, 1)])
    for samples in SAMPLES:
        least, more = int(alpha * samples), alpha * samples - int(alpha * samples)
        mean = square = 0.0
        for first, p in ((least, 1 - more), (least + 1, more)):
            for second, q in ((least, 1 - more), (least + 1, more)):
                left, through = samples - first, 1 - second / samples
                spread = left * first * second * (samples - second) / (samples**2 * (samples - 1))
                mean += p * q * left * through / samples
                square += p * q * (spread + (left * through) ** 2) / samples**2
        got = render([1, 2, 3], colors, 1, WIDE, stochastic_samples=samples, alpha_correction=False)[..., 0].astype(
            float
        )
        squares = (got - (1 - float(np.float32(alpha))) ** 2) ** 2
        assert mean == pytest.approx((1 - alpha) ** 2)
        assert abs(squares.mean() - (square - mean**2)) <= standard_errors(squares) + 1e-6


@pytest.mark.parametrize("corrected", [True, False])
def test_the_error_falls_with_the_root_of_the_samples(corrected: bool) -> None:
    """As 1 / sqrt(S): over a random scene, of all pixels with more than one layer.

    Equal sets of R give 1 / sqrt(S - 1), which is a slope of -0.53 from 8 to 64. That R is a whole number adds a term
    in 1 / S, which falls faster.
    """
    scene, size = soups.random(7, 60, "large", "flat", alpha=(0.2, 0.8)).scene(), (80, 60)
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "lanes": 1}
    exact = plainly.render(scene, **call)
    errors = []
    for samples in SAMPLES:
        got = plainly.render(scene, technique=NAME, stochastic_samples=samples, alpha_correction=corrected, **call)
        errors.append(np.sqrt(((got.color.astype(float) - exact.color) ** 2).mean()))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(SAMPLES))
    assert ((slopes < -0.48) & (slopes > -0.7)).all(), slopes


def test_the_error_meter_finds_the_noise() -> None:
    """`clpeel.compare` of the picture: over white and in closed form, by the share of samples that are left."""
    scene = soups.stack([1.0, 2.0], np.float32([(0, 0, 0, 0.5), (0, 0, 0, 0.5)])).scene()
    compared = clpeel.compare(scene, AHEAD.camera(), WIDE, techniques=[NAME], frames=1, precisions=["float32"])
    (row,) = [row for row in compared.rows if row.technique == NAME and row.precision == "float32"][:1]
    # With alpha correction black layers have the exact opacity, and no colour to be wrong.
    assert row.rms_error <= 4 * UNIT and row.max_error <= 4 * UNIT
    scene = soups.stack([1.0, 2.0, 3.0], np.float32([(0, 0, 0, 0.5), (0, 0, 0, 0.5), (1, 1, 1, 0.5)])).scene()
    compared = clpeel.compare(scene, AHEAD.camera(), WIDE, techniques=[NAME], frames=1, background=(0, 0, 0))
    # k of 8 samples are left to the white layer: the picture is k/16 over 3/4 + k/16, times 7/8; exact is 1/8.
    chance, k = np.array([1, 16, 36, 16, 1]) / 70, np.arange(5)
    squares = (k / 16 / (0.75 + k / 16) * 7 / 8 - 1 / 8) ** 2
    assert compared.rows[0].max_error == pytest.approx(np.sqrt(squares.max()), abs=1e-6)
    spread = np.sqrt(chance @ squares**2 - (chance @ squares) ** 2)
    off = ERRORS * spread / np.sqrt(WIDE[0] * WIDE[1])
    assert abs(compared.rows[0].rms_error ** 2 - chance @ squares) <= off


def test_it_is_compared_with_more_samples() -> None:
    made = technique(NAME)
    assert [dict(each.given()) for each in made.compared()] == [
        {"stochastic_samples": 16},
        {"stochastic_samples": 64},
        {"alpha_correction": False},
    ]
    assert made.error_without_order(3, 0.1) is None, "so that auto never chooses it"
