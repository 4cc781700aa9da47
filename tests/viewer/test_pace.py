"""The pace: a machine with known seconds, and the scales that it is given."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.viewer.pace import AIM, FRAME, LEAST, SHARP, Pace

FULL = 1600 * 1200


def run(pace: Pace, fixed: float, pixel: float, frames: int, full: int = FULL) -> list[tuple[float, float]]:
    """Draw frames on a machine with these seconds. Returns each frame's scale and seconds."""
    found = []
    for _ in range(frames):
        scale = pace.scale("kind", full)
        pixels = max(int(full * scale * scale), 1)
        found.append((scale, fixed + pixel * pixels))
        pace.learn("kind", pixels, fixed, pixel * pixels)
    return found


@given(fixed=st.floats(1e-4, 0.01), pixel=st.floats(1e-10, 1e-6))
def test_frames_stay_within_their_time_and_are_as_fine_as_it_allows(fixed: float, pixel: float) -> None:
    scale, seconds = run(Pace(), fixed, pixel, 30)[-1]
    if scale > LEAST:
        assert seconds <= FRAME
    if scale < 1:
        finer = fixed + pixel * FULL * (scale * 2 ** (1 / 8)) ** 2
        assert finer > AIM or fixed + pixel * FULL > SHARP


def test_a_fast_scene_is_never_reduced() -> None:
    assert {scale for scale, _ in run(Pace(), 0.002, 1e-9, 20)[3:]} == {1.0}


def test_a_frame_that_was_held_up_costs_a_few_frames_their_resolution() -> None:
    pace = Pace()
    before = run(pace, 0.002, 3e-8, 20)[-1][0]
    pixels = int(FULL * before * before)
    pace.learn("kind", pixels, 0.002, 100 * 3e-8 * pixels)
    after = [scale for scale, _ in run(pace, 0.002, 3e-8, 12)]
    assert after[0] < before and after[-1] == pytest.approx(before)


def test_a_scene_that_became_slow_is_met_at_once() -> None:
    pace = Pace()
    run(pace, 0.002, 3e-9, 20)
    late = [seconds for _, seconds in run(pace, 0.002, 3e-8, 10)]
    assert max(late[4:]) <= FRAME


def test_the_first_frame_of_a_kind_teaches_nothing() -> None:
    pace = Pace()
    first = pace.scale("kind", FULL)
    pace.learn("kind", 1000, 0.0, 5.0)  # it compiled
    assert pace.scale("kind", FULL) == first
    assert pace.scale("other", FULL) == first


def test_scales_are_few() -> None:
    scales = {run(Pace(), 0.002, pixel * 1e-9, 10)[-1][0] for pixel in range(1, 400)}
    assert len(scales) < 40 and min(scales) >= LEAST
