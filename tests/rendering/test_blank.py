"""Blank pictures: each says why, and no other does."""

from __future__ import annotations

from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel import Camera, Scene
from clpeel.techniques import TECHNIQUES

SQUARE, FACES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64), [[0, 1, 2], [0, 2, 3]]
FACING, EDGE_ON = Camera((0.5, 0.5, 3), (0.5, 0.5, 0)), Camera((3, 0.5, 0), (0.5, 0.5, 0))
pytestmark = pytest.mark.usefixtures("shared_devices")


def square(color: Any = (1.0, 0.0, 0.0), opacity: float | None = None) -> Scene:
    return Scene.from_arrays(SQUARE, FACES, color=color, opacity=opacity)


def notes(scene: Scene, camera: Camera | None = FACING, **options: Any) -> list[str]:
    return plainly.render(scene, camera, size=(24, 16), **options).stats["notes"]


@pytest.mark.parametrize(
    ("scene", "camera", "options", "says"),
    [
        (square(opacity=0), FACING, {}, "every surface is wholly transparent"),
        (square(opacity=0), FACING, {"background": None}, "every surface is wholly transparent"),
        (square((1.0, 1.0, 1.0)), FACING, {}, "its surfaces have the background's colour"),
        (square((1.0, 0.0, 0.0), 1e-3), FACING, {}, "or are too transparent to be seen"),
        (square((1.0, 0.0, 0.0), 1e-3), FACING, {"background": None}, "too transparent to be seen"),
        (square((0.0, 0.0, 0.0)), FACING, {"background": "black"}, "its surfaces have the background's colour"),
        (square(opacity=1e-3), FACING, {"background": "red:blue"}, "its surfaces have the background's colour"),
        (square(), EDGE_ON, {}, "its mesh is flat and seen edge-on"),
        (square(), EDGE_ON, {"technique": "thickness"}, "its mesh is flat and seen edge-on"),
        (square(), Camera((3, 0.5, 0), (0.5, 0.5, 0), orthographic=True), {}, "its mesh is flat and seen edge-on"),
        (square(), Camera((0.5, 0.5, 3), (0.5, 0.5, 9)), {}, "all surfaces are behind the camera"),
        (square(), Camera((0.5, 0.5, 3), (0.5, 0.5, 0), clipping_range=(4, 9)), {}, "outside --clipping-range 4,9"),
        (square(), Camera((9.5, 0.5, 3), (9.5, 0.5, 0)), {}, "no triangle covers a sample"),
        (
            Scene.from_arrays(SQUARE * np.nan, FACES),
            FACING,
            {},
            "all 2 triangles have corners that are NaN or infinite",
        ),
    ],
)
def test_a_blank_picture_says_why(scene: Scene, camera: Camera, options: dict[str, Any], says: str) -> None:
    (note,) = notes(scene, camera, **options)
    assert note.startswith("the picture is blank: ") and says in note


def test_a_surface_of_one_of_a_gradients_colours_shows() -> None:
    assert notes(square((1.0, 0.0, 0.0)), background="red:blue") == []


@pytest.mark.parametrize("technique", list(TECHNIQUES))
@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_a_picture_that_shows_something_says_nothing(technique: str, opacity: float) -> None:
    assert notes(square(opacity=opacity), technique=technique) == []


def test_one_pixel_is_enough() -> None:
    speck = Scene.from_arrays(SQUARE * 0.01, FACES, color=(0.0, 0.0, 0.0))
    at_pixel = Camera((0, 0, 1), (0.0, 0.0, 0), view_angle=30)
    result = plainly.render(speck, at_pixel, size=(101, 101))
    assert 0 < (result.image[..., 0] == 0).sum() < 16
    assert result.stats["notes"] == []


@pytest.mark.parametrize("step", [1, 2, 3, 9])
def test_what_nobody_can_see_is_blank(step: int) -> None:
    """One or two steps of 255 beside white are, three are not."""
    found = notes(square(np.array([255 - step] * 3, np.uint8)))
    assert bool(found) == (step <= 2)


@given(st.integers(0, 2), st.floats(0, 6.3), st.floats(0, 6.3))
def test_the_default_camera_sees_the_face_of_any_flat_mesh(axis: int, first: float, second: float) -> None:
    """Wherever the square is turned, most of the picture is covered: its face is looked at squarely."""

    def turn(about: int, angle: float) -> np.ndarray:
        matrix, (i, j) = np.eye(3), [k for k in range(3) if k != about]
        matrix[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
        return matrix

    corners = SQUARE @ turn(axis, first).T @ turn((axis + 1) % 3, second).T
    result = plainly.render(Scene.from_arrays(corners, FACES, color=(1.0, 0.0, 0.0)), size=(60, 60))
    # The square fills 2 / pi of the bounding circle at least; bounds along the axes may be up to sqrt(3) times larger.
    assert (result.image[..., 1] < 255).mean() > 0.15
    assert result.stats["notes"] == []
