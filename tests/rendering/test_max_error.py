"""A guaranteed error: what is left out is bounded, pixel by pixel, and no picture is off by more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.command import main as cli
from clpeel.techniques import TECHNIQUES

pytestmark = pytest.mark.usefixtures("shared_devices")

BOUNDED = [name for name, technique in TECHNIQUES.items() if "max_error" in technique.option_names]
STEPS = [0.0, 1 / 255, 1 / 64, 1 / 16, 0.3, 1.0]


def test_those_that_blend_in_order_have_it() -> None:
    assert [name for name, technique in TECHNIQUES.items() if technique.exact] == BOUNDED


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 120),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    colors=st.sampled_from(["flat8", "vertex"]),
    error=st.sampled_from(STEPS),
    opaque=st.booleans(),
    background=st.sampled_from([(1.0, 1.0, 1.0), (0.0, 0.5, 0.25)]),
)
def test_no_pixel_is_off_by_more(
    seed: int, count: int, size: tuple[int, int], colors: str, error: float, opaque: bool, background: Any
) -> None:
    soup = soups.random(seed, count, "large", colors, alpha=(0.1, 0.95))
    if opaque and soup.face_colors is not None:
        soup.face_colors[::7, 3] = 255
    scene = soup.scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "background": background}
    truth = plainly.render(scene, lanes=1, **call)
    rounding = (3 * (truth.stats["layers_max"] + 1) + 4) * UNIT  # of `truth`, which is float32 too
    for technique in BOUNDED:
        one, other = (plainly.render(scene, technique=technique, lanes=n, max_error=error, **call) for n in (1, 64))
        assert (one.color == other.color).all() and (one.error_bound == other.error_bound).all()
        off = np.abs(one.color.astype(float) - truth.color).max(axis=2)
        assert (off <= one.error_bound + rounding).all()
        over = [r.color[..., :3] + (1 - r.color[..., 3:].astype(float)) * np.array(background) for r in (one, truth)]
        assert (np.abs(over[0] - over[1]).max(axis=2) <= one.error_bound + 2 * rounding).all()
        assert one.stats["truncation_bound"] <= error and one.error_bound.dtype == np.float32
        assert (one.error_bound <= error + rounding).all()
        if error == 0:
            assert one.stats["truncated_pixels"] == 0


@pytest.mark.parametrize("technique", BOUNDED)
@pytest.mark.parametrize(("error", "kept"), [(0.0, 40), (2**-7, 7), (0.1, 4), (0.25, 2), (0.26, 2), (0.5, 1)])
def test_layers_of_a_half(technique: str, error: float, kept: int, lanes: int) -> None:
    """After k layers of 1/2 what is left is 2^-k, to the bit: the first k with 2^-k <= error are enough."""
    colors = np.tile([1.0, 0.5, 0.25, 0.5], (40, 1))
    scene = soups.stack(np.linspace(1, 7, 40), colors).scene()
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (5, 3), "lanes": lanes, "technique": technique}
    result = plainly.render(scene, max_error=error, **call)
    if technique == "multi-layer-peeling":
        kept = min(-(-kept // 8) * 8, 40)
    hidden = 2.0**-kept if kept < 40 else 0.0
    if technique == "dual-depth-peeling" and kept < 40:  # and as many from the back, seen through those
        hidden = 2.0**-kept
        behind = hidden * (1 - 2.0**-kept)
    else:
        behind = 0.0
    want = np.array([1.0, 0.5, 0.25, 1.0]) * ((1 - 2.0**-kept) + behind)
    assert np.abs(result.color - want).max() <= 3 * 40 * UNIT
    rounding = result.error_bound - np.float32(hidden)
    assert (result.error_bound == result.error_bound[0, 0]).all() and 0 <= rounding[0, 0] <= (3 * 41 + 5) * UNIT
    assert result.stats["truncated_pixels"] == (15 if hidden else 0)
    assert result.stats["truncation_bound"] == hidden


def test_a_pass_is_not_made_for_what_cannot_be_seen(lanes: int) -> None:
    scene = soups.stack(np.linspace(1, 7, 60), (1.0, 1.0, 1.0, 0.5)).scene()
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (8, 8), "lanes": lanes, "technique": "depth-peeling"}
    assert plainly.render(scene, max_error=1 / 255, **call).stats["passes"] == 8
    assert plainly.render(scene, **call).stats["passes"] == 60
    both = plainly.render(scene, max_error=1 / 255, passes=3, **call)
    assert both.stats["passes"] == 3 and (both.error_bound >= 0.125).all()


def test_samples_and_pictures_that_are_drawn_over(lanes: int) -> None:
    scene = soups.random(3, 100, "large", alpha=(0.3, 0.9)).scene()
    renderer = plainly.Renderer(scene, lanes=lanes)
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (15, 10)}
    fine = renderer.render(BENCH.camera(), (120, 80), max_error=0.1).error_bound.astype(float)
    mean = renderer.render(samples=64, max_error=0.1, **call)
    assert np.abs(mean.error_bound - fine.reshape(10, 8, 15, 8).mean(axis=(1, 3))).max() <= 65 * UNIT
    plain = renderer.render(**call)
    with pytest.raises(
        clpeel.InputError, match=r"^error_bound: expected a result rendered with max_error=..., got none$"
    ):
        _ = plain.error_bound
    other = renderer.render(BENCH.camera(), (60, 40), technique="weighted-sum")
    with pytest.raises(
        clpeel.InputError, match=r"^error_bound: .* technique that has it \(sort, .*, got weighted-sum$"
    ):
        _ = other.error_bound


@pytest.mark.parametrize("error", [-0.1, 1.5, float("nan"), "much"])
@pytest.mark.parametrize("technique", BOUNDED)
def test_what_cannot_be_is_refused(technique: str, error: Any) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match="max_error: expected 0..1, got"):
        plainly.render(scene, AHEAD.camera(), (4, 4), technique, max_error=error)


def test_others_do_not_have_it() -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match="max_error: the technique 'weighted-sum' has no such option"):
        plainly.render(scene, AHEAD.camera(), (4, 4), "weighted-sum", max_error=0.1)
    with pytest.raises(clpeel.InputError, match="max_error: expected none with hazard_window"):
        plainly.render(scene, AHEAD.camera(), (4, 4), "multi-layer-peeling", max_error=0.1, hazard_window=2)


def test_the_command(tmp_path: Path, capfd: Any) -> None:
    given = ["demo", "-o", str(tmp_path / "a.png"), "--resolution=48,36", "--samples=1"]
    assert cli.main([*given, "--max-error=0.02"]) == 0
    assert "note:" not in capfd.readouterr().err  # it was asked for
    assert cli.main([*given, "--max-error=2"]) == 2
    assert "--max-error: expected a number in 0..1, got '2'" in capfd.readouterr().err
