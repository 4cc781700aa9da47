"""Motions: what stays under the hand, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.scene.camera import Camera
from clpeel.viewer import motion

SIZE = (400.0, 300.0)
CAMERAS = [
    Camera((3.0, 2.0, 5.0), (0.5, -0.25, 1.0), (0.1, 1.0, 0.0), 40.0, orthographic=parallel)
    for parallel in (False, True)
]
PLACES = st.tuples(st.floats(0, SIZE[0]), st.floats(0, SIZE[1]))


def seen_at(camera: Camera, point: np.ndarray) -> np.ndarray:
    """Where a point is seen, in pixels from the top left: the pinhole camera's own formula."""
    right, up, forward = camera.axes()
    arm = np.asarray(point) - camera.position
    depth = camera.distance if camera.orthographic else arm @ forward
    pixels = SIZE[1] / 2 / math.tan(math.radians(camera.view_angle) / 2) / depth
    return np.array([SIZE[0] / 2 + arm @ right * pixels, SIZE[1] / 2 - arm @ up * pixels])


@pytest.mark.parametrize("camera", CAMERAS)
@given(at=PLACES)
def test_the_point_under_a_place_is_seen_there(camera: Camera, at: motion.Place) -> None:
    point = motion.point_under(camera, at, SIZE)
    assert seen_at(camera, point) == pytest.approx(at, abs=1e-9)
    assert (point - camera.focal_point) @ camera.axes()[2] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("camera", CAMERAS)
@given(at=PLACES, by=PLACES)
def test_panning_keeps_what_is_under_the_hand_there(camera: Camera, at: motion.Place, by: motion.Place) -> None:
    held = motion.point_under(camera, at, SIZE)
    moved = motion.panned(camera, by, SIZE)
    assert seen_at(moved, held) == pytest.approx([at[0] + by[0], at[1] + by[1]], abs=1e-8)
    assert moved.axes() == pytest.approx(camera.axes(), abs=1e-12)


@pytest.mark.parametrize("camera", CAMERAS)
@given(at=PLACES, wheel=st.floats(-500, 500))
def test_the_wheel_keeps_what_is_under_the_pointer_there(camera: Camera, at: motion.Place, wheel: float) -> None:
    under = motion.point_under(camera, at, SIZE)
    moved = motion.zoomed(camera, wheel, at, SIZE, radius=1.0)
    assert seen_at(moved, under) == pytest.approx(at, abs=1e-8)
    assert moved.distance == pytest.approx(camera.distance * 1.0015**wheel)


def test_the_wheel_and_dollying_have_bounds() -> None:
    camera = CAMERAS[0]
    near, far = (motion.zoomed(camera, wheel, (200, 150), SIZE, 1.0) for wheel in (-1e5, 1e4))
    assert near.distance == pytest.approx(1e-6) and far.distance == pytest.approx(1e6)
    assert motion.dollied(camera, (0, 1e4), SIZE, 1.0).distance == pytest.approx(1e-6)


def test_dollying_down_comes_nearer_along_the_view() -> None:
    camera = CAMERAS[0]
    moved = motion.dollied(camera, (7, SIZE[1] / 2), SIZE, 1.0)
    assert moved.focal_point == camera.focal_point
    assert moved.distance == pytest.approx(camera.distance / motion.DOLLY)
    assert moved.axes() == pytest.approx(camera.axes(), abs=1e-12)


@pytest.mark.parametrize("camera", CAMERAS)
def test_rotating_turns_about_the_focal_point(camera: Camera) -> None:
    moved = motion.rotated(camera, (SIZE[0] * 0.9, 0), SIZE)  # 180 degrees about the view's up
    assert moved.focal_point == camera.focal_point and moved.distance == pytest.approx(camera.distance)
    straight = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    half = motion.rotated(straight, (SIZE[0] * 0.9, 0), SIZE)
    assert half.position == pytest.approx((0, 0, -5), abs=1e-12)
    quarter = motion.rotated(straight, (0, SIZE[1] * 0.45), SIZE)  # 90 degrees: seen from straight above
    assert quarter.position == pytest.approx((0, 5, 0), abs=1e-12)
    assert quarter.axes()[1] == pytest.approx((0, 0, -1), abs=1e-12)


def test_rotating_follows_the_hand() -> None:
    straight = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    front = np.array([0.0, 0.0, 1.0])  # on the side that faces the eye
    moved = motion.rotated(straight, (10, 5), SIZE)
    x, y = seen_at(moved, front)
    assert x > SIZE[0] / 2 and y > SIZE[1] / 2


@given(steps=st.lists(st.tuples(st.floats(-300, 300), st.floats(-300, 300)), min_size=1, max_size=20))
def test_any_drag_leaves_a_right_camera(steps: list[motion.Place]) -> None:
    camera = CAMERAS[0]
    for step in steps:
        camera = motion.rotated(camera, step, SIZE)
    axes = camera.axes()
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert camera.distance == pytest.approx(CAMERAS[0].distance, rel=1e-12)
    assert camera.view_up == pytest.approx(axes[1], abs=1e-9)


@pytest.mark.parametrize("camera", CAMERAS)
@given(at=PLACES, depth=st.floats(0.1, 100))
def test_focusing_puts_what_was_there_in_the_middle(camera: Camera, at: motion.Place, depth: float) -> None:
    ray = motion.through(camera, at, SIZE)
    point = np.asarray(ray.position) + ray.axes()[2] * depth
    assert seen_at(camera, point) == pytest.approx(at, abs=1e-6)
    moved = motion.focused(camera, depth, at, SIZE)
    assert moved.focal_point == pytest.approx(point, abs=1e-9)
    assert moved.distance == pytest.approx(camera.distance)
    assert moved.axes() == pytest.approx(camera.axes(), abs=1e-9)
