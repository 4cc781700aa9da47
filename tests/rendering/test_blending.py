"""Colour buffers: each blend rounded as it is stored, against NumPy twins; where they stick, and what they may cost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import soups
from twins.blends import FULL, KEPT, F, Stacks, blended
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH, Soup

import clpeel
from clpeel.command import main as cli
from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.pictures.layers import Layers
from clpeel.rendering.renderer import Renderer
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISIONS, blending_bound

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

BLENDING = [name for name, technique in TECHNIQUES.items() if "precision" in technique.option_names]
ELSEWHERE = ("moments",)
"""What a rounding may decide otherwise, by far: test_moments has its bounds."""
PICTURES = [name for name in BLENDING if not TECHNIQUES[name].maps and name not in ELSEWHERE]
EXACT = [name for name in BLENDING if TECHNIQUES[name].exact]
LANES = (1, 64)


# --- what is right ------------------------------------------------------------------------------------------------


AVERAGE_ROUNDINGS = (
    12 * UNIT
)  # of a weighted average's power, quotient and product, and of putting it over what is behind


def truth(layers: Layers) -> NDArray[np.float64]:
    """The layers blended in float64."""
    color = np.zeros((len(layers.start) - 1, 4))
    for pixel in range(len(color)):
        for r, g, b, a in layers.color[layers.start[pixel] : layers.start[pixel + 1]][::-1].astype(float):
            color[pixel] = a * np.array([r, g, b, 1]) + (1 - a) * color[pixel]
    return color.reshape(layers.size[1], layers.size[0], 4)


def off(got: Any, want: Any) -> NDArray[np.float64]:
    """How far off pixels are [h, w], in any channel and over any background: of these black and white are the worst."""
    got, want = np.asarray(got, float), np.asarray(want, float)
    error = got - want
    over_white = error[..., :3] - error[..., 3:]
    return np.maximum(np.abs(error).max(axis=-1), np.abs(over_white).max(axis=-1))


def stack(count: int, rgba: Any) -> Soup:
    """So many layers, nearest first."""
    colors = np.broadcast_to(np.asarray(rgba, F), (count, 4))
    return soups.with_opaque(soups.stack(np.linspace(1, 7, count), colors))


def scattered(seed: int, count: int, alpha: tuple[float, float], opaque: bool) -> Soup:
    soup = soups.random(seed, count, "large", "flat", alpha=alpha)
    if opaque and soup.face_colors is not None:
        soup.face_colors[::7, 3] = 1
    return soups.with_opaque(soup)


SCENES = {
    "seed": st.integers(0, 10**6),
    "count": st.integers(1, 80),
    "alpha": st.sampled_from([(0.05, 0.95), (0.0, 0.02), (0.4, 0.6), (0.9, 0.999)]),
    "opaque": st.booleans(),
}


# --- equal to the twins -----------------------------------------------------------------------------------------------


@given(**SCENES)
def test_each_blend_is_rounded(seed: int, count: int, alpha: tuple[float, float], opaque: bool, judge: Judge) -> None:
    """Every technique's picture, in every precision, is the twin's to the bit, and off by no more than the bound.

    Lane counts take turns: test_extremes_in_buffers.py has both in the precisions of the papers.
    """
    scene, call = scattered(seed, count, alpha, opaque).scene(), {"camera": BENCH.camera(), "size": (19, 17)}
    sorted_ = plainly.render(scene, layers=True, lanes=1, **call)
    right = truth(sorted_.layers)
    for turn, precision in enumerate(PRECISIONS):
        stacks = Stacks(sorted_.layers, precision)
        bound = blending_bound(sorted_.stats["layers_max"] + 1, precision)
        for place, technique in enumerate(PICTURES):
            want, lanes = blended(technique, stacks), LANES[(turn + place) % len(LANES)]
            got = plainly.render(scene, technique=technique, precision=precision, lanes=lanes, **call)
            reason = f"{technique}, {precision}, {lanes} lanes"
            if technique == "weighted-average":
                judge.color(got, want, AVERAGE_ROUNDINGS, reason)
            else:
                assert want.dtype == np.float32
                judge.same_bits(got, SimpleNamespace(color=want, image=got.image), reason)
            judge.image(got, (1.0, 1.0, 1.0))
            if technique in EXACT:
                assert off(got.color, right).max() <= bound, reason


@pytest.mark.parametrize("precision", PRECISIONS)
def test_translucency_is_stored_once(precision: str, lanes: int, judge: Judge) -> None:
    scene = scattered(3, 60, (0.1, 0.9), True).scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (19, 17), "technique": "translucency", "lanes": lanes}
    plain, got = (plainly.render(scene, precision=p, variant="total", **call) for p in (DEFAULT_PRECISION, precision))
    want = KEPT[precision](plain.color * FULL[precision]) / FULL[precision]
    want[..., 3] = plain.color[..., 3]
    judge.same_bits(got, SimpleNamespace(color=want, image=got.image))
    assert (got.thickness == plain.thickness).all() and set(np.unique(want[..., 3])) == {0, 1}
    assert (want != plain.color).any() or precision == DEFAULT_PRECISION


@pytest.mark.parametrize("precision", PRECISIONS)
def test_opaque_surfaces_alone(precision: str, lanes: int) -> None:
    """The one pass that is made of them, whatever the technique, is into a buffer like any."""
    rgb = np.random.default_rng(0).random((5, 3)).astype(F)
    scene = soups.stack(np.arange(1, 6), np.c_[rgb, np.ones(5, F)]).scene()
    want = KEPT[precision](rgb[0] * FULL[precision]) / FULL[precision]
    assert (want != rgb[0]).all() or precision == DEFAULT_PRECISION
    for technique in PICTURES:
        got = plainly.render(scene, AHEAD.camera(), (3, 2), technique, precision=precision, lanes=lanes)
        assert (got.color == [*want, 1]).all() and got.stats["passes"] == 0


@pytest.mark.parametrize("precision", PRECISIONS)
def test_samples_have_buffers_of_their_own(precision: str, lanes: int) -> None:
    """Several samples a pixel: the mean of colours that are rounded, and not the rounded mean."""
    scene, camera = scattered(5, 60, (0.1, 0.9), True).scene(), BENCH.camera()
    for technique in PICTURES:
        options = {"technique": technique, "precision": precision, "lanes": lanes}
        fine = plainly.render(scene, camera, (40, 24), **options).color.astype(float)
        mean = plainly.render(scene, camera, (5, 3), samples=64, **options).color
        want = fine.reshape(3, 8, 5, 8, 4).mean(axis=(1, 3))
        assert np.abs(mean - want).max() <= 65 * UNIT * max(1, np.abs(want).max()), technique


# --- extremes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("technique", EXACT)
def test_eight_bits_stick(technique: str, lanes: int) -> None:
    """EXTREMES 13: a thousand white layers of a = 1/255 on black are 249.99 of 255.

    Under: T falls by T / 255 a layer, which is less than half a step from 127 on; the colour rises by as much, to
    128. Over: by 1 - C / 255, to 128. So the two halves of dual peeling are 128 + 127 / 255 128 = 191.7.
    """
    scene = stack(1000, (1, 1, 1, 1 / 255)).scene()
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (2, 2), "background": (0, 0, 0), "lanes": lanes}
    float32, unorm8 = (plainly.render(scene, technique=technique, precision=p, **call) for p in ("float32", "unorm8"))
    exact = 1 - (1 - 1 / 255) ** 1000
    assert (float32.image[..., :3] == 250).all()
    assert np.abs(float32.color - exact).max() <= blending_bound(1000)
    dual = technique == "dual-depth-peeling"
    assert (unorm8.image[..., :3] == (192 if dual else 128)).all()
    through = (127 / 255) * (
        127 / 255 if dual else 1
    )  # the transmittance of over blending sticks where that of under does
    assert np.abs(unorm8.color[..., 3] - (1 - through)).max() <= 4 * UNIT
    assert off(unorm8.color, exact).max() <= blending_bound(1000, "unorm8")


def test_the_error_of_over_blending_does_not_grow(lanes: int) -> None:
    """8 bits, equal alphas, back to front: an error e becomes (1 - a) e + 0.5 steps, so that it stays below 0.5 / a."""
    rng = np.random.default_rng(1)
    errors = {}
    for a in (0.02, 0.1, 0.5, 0.9):
        for n in (1, 2, 10, 250):
            # Dual peeling with a front half that is not there: the back alone.
            rgba = np.concatenate([np.zeros((n, 4)), np.tile([1, *rng.random(2), a], (n, 1))]).astype(F)
            got = plainly.render(
                stack(2 * n, rgba).scene(),
                AHEAD.camera(),
                (2, 2),
                "dual-depth-peeling",
                precision="unorm8",
                lanes=lanes,
            )
            alpha = float(F(a))
            want = np.r_[rgba[-1, :3].astype(float), 1] * (1 - (1 - alpha) ** n)
            errors[a, n] = 255 * np.abs(got.color - want).max()
            assert errors[a, n] <= 0.5 / alpha + 255 * blending_bound(2 * n), (a, n)
    assert errors[0.02, 250] > 10  # where front to back it may be 250 steps


def test_the_bound_is_of_the_right_size() -> None:
    """Layers of just less than half a step are lost, each: half of what 2 N roundings of half a step allow."""
    n, a = 100, 0.49 / 255
    got = plainly.render(stack(n, (1, 1, 1, a)).scene(), AHEAD.camera(), (2, 2), precision="unorm8", lanes=1)
    assert (got.color == 0).all()
    error, bound = 1 - (1 - a) ** n, blending_bound(n, "unorm8")
    assert bound / 4 < error < bound / 2 < 0.5


@pytest.mark.parametrize(
    ("a", "steps"),
    [(0.49 / 255, 0), (0.6 / 255, 300), (0.1, 26 * 300)],  # 0.1 is 25.5 steps: from a whole number, 26 the first time
)
def test_sums_of_8_bits(a: float, steps: int, lanes: int) -> None:
    """What is less than half a step never arrives, what is more counts whole; and no sum leaves 0..1."""
    scene = stack(300, (1, 0.5, 0, a)).scene()
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (2, 2), "technique": "weighted-sum", "lanes": lanes}
    got = plainly.render(scene, precision="unorm8", **call)
    assert (got.color[..., [0, 3]] == min(steps, 255) / F(255)).all() and (got.color[..., 2] == 0).all()
    assert got.stats["clamped_pixels"] == 0
    exact = plainly.render(scene, precision="float32", **call)
    assert np.abs(exact.color[..., 0] - 300 * float(F(a))).max() <= 300 * UNIT * 300 * a
    assert exact.stats["clamped_pixels"] == (4 if 300 * a > 1 else 0)


# --- a guaranteed error, in any precision -----------------------------------------------------------------------------


@given(**SCENES, error=st.sampled_from([0.0, 1 / 255, 1 / 16, 0.3]))
def test_no_pixel_is_off_by_more(seed: int, count: int, alpha: tuple[float, float], opaque: bool, error: float) -> None:
    scene, call = scattered(seed, count, alpha, opaque).scene(), {"camera": BENCH.camera(), "size": (19, 17)}
    right = truth(plainly.render(scene, layers=True, lanes=1, **call).layers)
    for technique in EXACT:
        # One shape for each kernel, the one that is built sooner: test_max_error.py has both in float32.
        lanes = 1 if technique == "sort" else 64
        for precision in PRECISIONS:
            if precision == DEFAULT_PRECISION:
                continue
            got = plainly.render(scene, technique=technique, precision=precision, lanes=lanes, max_error=error, **call)
            assert (off(got.color, right) <= got.error_bound).all(), (technique, precision)
            most = error + blending_bound(got.stats["layers_max"] + 1, precision)
            assert (got.error_bound <= min(most, 1) + UNIT).all()


# --- the option -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("technique", "buffers"),
    [("depth-peeling", 1), ("dual-depth-peeling", 2), ("multi-layer-peeling", 1), ("glowscript", 4)],
)
def test_bytes_a_pixel(technique: str, buffers: int) -> None:
    """Of a colour 16, 8 or 4; and what opaque surfaces fill has one, too."""
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (2, 2), "technique": technique, "lanes": 1}
    mixed, float32 = stack(2, (1, 1, 1, 0.5)).scene(), {}
    for precision, color in (("float32", 16), ("half", 8), ("unorm8", 4)):
        held = plainly.render(mixed, precision=precision, **call).stats["buffer_bytes_per_pixel"]
        float32[precision] = held - (FRAGMENT_BYTES + color) - buffers * color
    assert len(set(float32.values())) == 1 and float32["half"] > 0


def test_those_that_blend_have_it() -> None:
    assert all(TECHNIQUES[name].maps for name in TECHNIQUES if name not in BLENDING) and "thickness" not in BLENDING
    assert [name for name in EXACT if "max_error" not in TECHNIQUES[name].option_names] == []
    assert {TECHNIQUES[name].paper_precision for name in BLENDING} == set(PRECISIONS)
    assert blending_bound(3) < blending_bound(3, "half") < blending_bound(3, "unorm8") < blending_bound(4, "unorm8")


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("opaque", [True, False])
def test_a_precision_there_is_not(technique: str, opaque: bool) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 1.0 if opaque else 0.5)).scene()
    for name in ("double", "FLOAT32", "", 8, None):
        with pytest.raises(clpeel.InputError) as caught:
            plainly.render(scene, AHEAD.camera(), (2, 2), technique, precision=name)
        assert str(caught.value) == f"precision: expected one of float32, half, unorm8; got {name!r}"


def test_what_does_not_blend_has_none() -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match="precision: the technique 'thickness' has no such option; it has "):
        plainly.render(scene, AHEAD.camera(), (2, 2), "thickness", precision="half")


def test_the_command(tmp_path: Any, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    asked = []

    def render(self: Renderer, *arguments: Any, **options: Any) -> Any:
        asked.append(options)
        raise clpeel.InputError("enough")

    given = ["demo", "-o", str(tmp_path / "a.png"), "--resolution=8,6"]
    assert cli.main([*given, "--precision=double"]) == 2
    lines = [line for line in capfd.readouterr().err.splitlines() if "warnings generated" not in line]
    assert len(lines) == 1 and "precision: expected one of float32, half, unorm8; got 'double'" in lines[0]
    assert cli.main([*given, "--depth-format=16"]) == 2
    lines = [line for line in capfd.readouterr().err.splitlines() if "warnings generated" not in line]
    assert len(lines) == 1 and "expected one of float32-reversed, float32, unorm24, rgba8; got '16'" in lines[0]
    monkeypatch.setattr(Renderer, "render", render)
    for technique in ("sort", "dual-depth-peeling"):
        arguments = ["--technique", technique, "--precision", "unorm8", "--depth-format", "unorm24"]
        assert cli.main([*given, *arguments]) == 2
        assert (asked[-1]["precision"], asked[-1]["depth_format"]) == ("unorm8", "unorm24")
