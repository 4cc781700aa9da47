"""The ground grid as a scene: where its lines lie, how strong they are, and what it refuses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import clpeel
from clpeel.errors import InputError
from clpeel.scene.grid import AXIS_COLORS, BELOW, COLOR, FAINT, STRONG
from clpeel.scene.scene import Scene

FACES = [[0, 1, 2], [0, 2, 3]]


def box(low: Any, high: Any, **options: Any) -> Scene:
    """A scene with these bounds."""
    (a, b, c), (x, y, z) = low, high
    return Scene.from_arrays([[a, b, c], [x, b, z], [x, y, z], [a, y, c]], FACES, **options)


def radius_of(scene: Scene) -> float:
    return math.dist(*scene.bounds) / 2


def ends(grid: Scene) -> np.ndarray:
    assert grid.lines is not None
    return grid.vertices[grid.lines]


BOX = box((-1.3, 0.4, 2.1), (2.7, 3.4, 3.2))


@given(st.floats(1e-6, 1e6))
def test_cells_are_round_and_8_to_20_of_them_cross_the_scene(size: float) -> None:
    scene = box((0, 0, 0), (size, size / 2, size / 3))
    across = ends(clpeel.grid(scene))[:, 0]
    places = np.unique(across[:, 0])
    steps = np.diff(places)
    width = 2 * radius_of(scene)
    allowed = [float(f"{digit}e{power}") for digit in (1, 2, 5) for power in range(-9, 8)]
    along = ends(clpeel.grid(scene))
    fixed = np.unique(along[along[:, 0, 2] != along[:, 1, 2]][:, 0, 0])  # lines along Z
    unit = float(np.diff(fixed).min())
    assert min(abs(unit / each - 1) for each in allowed) < 1e-6
    assert 8 - 1e-6 <= width / unit <= 20 + 1e-6 and len(steps) > 8


@pytest.mark.parametrize(("up", "axis", "side"), [("+Y", 1, 0), ("-Y", 1, 1), ("+Z", 2, 0), ("X", 0, 0)])
def test_lines_lie_at_all_multiples_of_the_unit_at_the_bottom(up: str, axis: int, side: int) -> None:
    radius, unit = radius_of(BOX), 0.5
    found = clpeel.grid(BOX, up, unit)
    bottom = BOX.bounds[side, axis] + (1 if side else -1) * BELOW * radius
    np.testing.assert_allclose(found.vertices[:, axis], bottom, atol=1e-12)
    centre = BOX.bounds.mean(axis=0)
    lines = ends(found)
    others = [each for each in range(3) if each != axis]
    for along, across in (others, others[::-1]):
        own = lines[lines[:, 0, along] != lines[:, 1, along]]
        np.testing.assert_array_equal(own[:, 0, across], own[:, 1, across])
        numbers = np.unique(np.rint(own[:, 0, across] / unit).astype(int))
        wanted = [k for k in range(-40, 40) if abs(k * unit - centre[across]) <= 2 * radius]
        np.testing.assert_allclose(own[:, 0, across] / unit, np.rint(own[:, 0, across] / unit), atol=1e-9)
        assert numbers.tolist() == wanted
        for number in wanted:  # its pieces cover the chord of the circle, once
            pieces = own[np.rint(own[:, 0, across] / unit) == number][:, :, along]
            chord = math.sqrt(max(4 * radius**2 - (number * unit - centre[across]) ** 2, 0))
            assert abs(np.abs(pieces[:, 1] - pieces[:, 0]).sum() - 2 * chord) < 1e-9
            assert abs(pieces.min() - (centre[along] - chord)) < 1e-9


def test_every_fifth_is_stronger_and_all_fade_from_the_radius_on() -> None:
    found = clpeel.grid(BOX, unit=0.5)
    assert found.face_colors is not None and found.face_colors.dtype == np.uint8
    lines, radius, centre = ends(found), radius_of(BOX), BOX.bounds.mean(axis=0)
    along_x = lines[:, 0, 0] != lines[:, 1, 0]
    number = np.rint(np.where(along_x, lines[:, 0, 2], lines[:, 0, 0]) / 0.5).astype(int)
    away = np.hypot(*(lines.mean(axis=1) - centre)[:, [0, 2]].T)
    alpha = np.where(number % 5 == 0, STRONG, FAINT) * np.clip(2 - away / radius, 0, 1)
    assert np.abs(found.face_colors[:, 3] - 255 * alpha).max() <= 0.51
    colors = np.where(
        (number == 0)[:, None], np.where(along_x[:, None], AXIS_COLORS[0], AXIS_COLORS[2]), np.array([COLOR])
    )
    assert np.abs(found.face_colors[:, :3] - 255 * colors).max() <= 0.51
    assert (number == 0).any()
    lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    assert lengths.max() <= 4 * radius / 40 + 1e-9  # so no piece is much stronger than the next


def test_a_colour_of_its_own_leaves_those_of_the_axes() -> None:
    found = clpeel.grid(BOX, "+Z", color="#ff8000")
    assert found.face_colors is not None
    kinds = {tuple(color) for color in found.face_colors[:, :3].tolist()}
    axes = {tuple(round(255 * part) for part in AXIS_COLORS[axis]) for axis in (0, 1)}
    assert kinds == {(255, 128, 0), *axes}


def test_up_may_be_any_direction() -> None:
    up = np.array([0.3, -2.0, 0.7])
    found = clpeel.grid(BOX, up)
    corners = np.array(np.meshgrid(*BOX.bounds.T)).reshape(3, -1).T
    unit = up / np.linalg.norm(up)
    heights = found.vertices @ unit
    np.testing.assert_allclose(heights, (corners @ unit).min() - BELOW * radius_of(BOX), atol=1e-9)
    assert found.face_colors is not None and len(np.unique(found.face_colors[:, :3], axis=0)) == 1


def test_it_reads_no_more_of_the_scene_than_its_bounds() -> None:
    cloud = Scene.from_arrays([[0, 0, 0], [1, 1, 1], [math.nan, 5, 5]], points=[0, 1, 2])
    np.testing.assert_array_equal(clpeel.grid(cloud).vertices, clpeel.grid(box((0, 0, 0), (1, 1, 1))).vertices)


@pytest.mark.parametrize("size", [5e-324, 1e-310, 1e-200, 0.0, 1e200, 1e306])
def test_scenes_of_any_size_have_one(size: float) -> None:
    found = clpeel.grid(box((0, 0, 0), (size, size, size)))
    assert np.isfinite(found.vertices).all() and 20 < found.counts[1] < 20_000


def test_a_scene_far_from_the_origin_has_it_around_itself() -> None:
    far = np.array([3e7, -2e7, 1e7])
    found = clpeel.grid(box(far, far + 1))
    radius = math.sqrt(3) / 2
    assert np.abs(ends(found).mean(axis=1) - (far + 0.5))[:, [0, 2]].max() <= 2 * radius


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"up": "W"}, r"grid up: expected an axis such as -Z or \+Y, or 3 numbers, got 'W'"),
        ({"up": (0, 0, 0)}, r"grid up: expected a direction, got \(0, 0, 0\)"),
        ({"unit": 1e-3}, r"grid unit: expected 0\.0256 to 5\.12 for a scene of this size, got 0\.001"),
        ({"unit": 5.13}, r"grid unit: expected 0\.0256 to 5\.12 for a scene of this size, got 5\.13"),
        ({"unit": math.nan}, "grid unit: expected .* got nan"),
        ({"unit": "wide"}, "grid unit: expected .* got 'wide'"),
        ({"color": "nearly red"}, "grid color: expected R,G,B in 0..1, #rrggbb or a colour name, got 'nearly red'"),
        ({"color": (1, 2, 3)}, "grid color: expected 3 numbers 0..1"),
    ],
)
def test_what_is_wrong_is_named(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=f"^{text}") as caught:
        clpeel.grid(BOX, **options)
    assert "\n" not in str(caught.value)


def test_a_scene_at_the_end_of_numbers_has_none() -> None:
    with pytest.raises(InputError, match="^grid: expected a scene within the range of numbers, got one of radius"):
        clpeel.grid(box((-1e308, -1e308, 0), (1e308, 1e308, 0)))


def test_the_smallest_and_the_largest_unit_are_as_said() -> None:
    for unit, wanted in ((0.0256, 400), (5.12, 2)):
        found = ends(clpeel.grid(BOX, unit=unit))
        lines = np.unique(found[found[:, 0, 0] != found[:, 1, 0]][:, 0, 2])
        assert abs(len(lines) - wanted) <= 1
