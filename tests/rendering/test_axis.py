"""The axes in the corner: where a float64 projection says, in the right order, on any background, at any size."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.rendering.axis import place_of, with_axes
from clpeel.scene.axes import BACK_ALPHA, BACK_BALL, BALL, COLORS, HALF, INK, PLATE

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (640, 480)
SIDE = 80  # a sixth of the smaller side
MARGIN = 8
WHITE = np.full((480, 640, 4), 255, np.uint8)
CLEAR = np.zeros((480, 640, 4), np.uint8)


def seen(*position: float, up: tuple[float, float, float] = (0, 1, 0)) -> clpeel.Camera:
    return clpeel.Camera(position, (0, 0, 0), up, 45.0)


def at(camera: clpeel.Camera, place: np.ndarray, right: float = 0, up: float = 0) -> tuple[int, int]:
    """The row and the column of the pixel where a place of the axes is, and so much to its right and above it."""
    forward = np.subtract(camera.focal_point, camera.position)
    forward = forward / np.linalg.norm(forward)
    aside = np.cross(forward, camera.view_up)
    aside /= np.linalg.norm(aside)
    x, y = place @ aside + right, place @ np.cross(aside, forward) + up
    centre = SIZE[0] - MARGIN - SIDE / 2, SIZE[1] - MARGIN - SIDE / 2
    pixels = SIDE / 2 / HALF
    return math.floor(centre[1] - y * pixels), math.floor(centre[0] + x * pixels)


def dimmed(away: float) -> float:
    """What a light at the camera leaves of the colour of a ball, so many radii from its middle."""
    return 0.2 + 0.8 * math.sqrt(1 - away**2)


def drawn(camera: clpeel.Camera, image: np.ndarray = WHITE) -> np.ndarray:
    found = with_axes(image, camera)
    assert not isinstance(found, str)
    return found


ASLANT = [np.array(signs) * scale for signs in product((1, -1), repeat=3) for scale in [(1.0, 0.6, 1.4)]]


@pytest.mark.parametrize("position", ASLANT, ids=str)
def test_tips_are_where_they_project_to(position: np.ndarray) -> None:
    camera = seen(*position)
    found = drawn(camera) / 255
    for axis, tip in enumerate(np.eye(3)):
        color = np.array(COLORS[axis])
        for ball, sign, place in ((BALL, 1, (0.65, 0.0)), (BACK_BALL, -1, (0.0, 0.0))):
            pixel = at(camera, sign * tip, ball * place[0], ball * place[1])
            shown = color * dimmed(math.hypot(*place))
            if sign < 0:  # its front and its back, over the plate, over white
                under = (1 - PLATE[3]) + PLATE[3] * np.array(PLATE[:3])
                shown = shown + (1 - BACK_ALPHA) ** 2 * (under - shown)
            assert np.abs(found[pixel][:3] - shown).max() < 0.12, (axis, sign)
            assert np.argmax(found[pixel][:3]) == axis
        assert np.abs(found[at(camera, tip)][:3] - INK[:3]).max() < 0.25  # the letters' strokes meet in the middle


def test_what_is_in_front_hides_what_is_behind() -> None:
    """Seen along X + Y, the tip of X and the negative end of Y lie at one place."""
    front, back = drawn(seen(1, 1, 0, up=(0, 0, 1))) / 255, drawn(seen(-1, -1, 0, up=(0, 0, 1))) / 255
    red, green = np.array(COLORS[0]), np.array(COLORS[1])
    x = np.array([1.0, 0, 0])
    beside = 0.72 * BACK_BALL  # of the letter, within both balls
    opaque = red * dimmed(beside / BALL)
    pixel = at(seen(1, 1, 0, up=(0, 0, 1)), x, beside)
    assert np.abs(front[pixel][:3] - opaque).max() < 0.06
    pixel = at(seen(-1, -1, 0, up=(0, 0, 1)), x, beside)
    over = green * dimmed(beside / BACK_BALL)
    assert np.abs(back[pixel][:3] - (over + (1 - BACK_ALPHA) ** 2 * (opaque - over))).max() < 0.06
    assert np.abs(front[pixel][:3] - back[pixel][:3]).max() > 0.15


def test_an_axis_that_points_away_is_behind_the_others() -> None:
    """Seen from behind, Z is in the middle: its stick, tip and letter lie behind its negative end."""
    front, back = seen(0, 0, 5), seen(0, 0, -5)
    tip = np.array([0, 0, 1.0])
    assert drawn(front)[at(front, tip)][:3].max() < 60
    blue = drawn(back)[at(back, tip)]
    assert blue[2] > 100 and blue[2] > blue[0] + 40


def test_the_pictures_of_the_axes_turn_with_the_camera() -> None:
    turned = seen(0, 0, 5, up=(1, 0, 0))
    row, column = at(turned, np.array([1.0, 0, 0]), 0.85 * BALL)
    assert row < SIZE[1] - MARGIN - SIDE * 0.7  # X points up
    assert np.argmax(drawn(turned)[row, column, :3]) == 0


def test_on_a_transparent_picture_it_has_its_own_alpha() -> None:
    camera = seen(*ASLANT[0])
    found = drawn(camera, CLEAR)
    plate = at(camera, np.zeros(3), 1.2, 0.35)
    assert np.abs(found[plate] - 255 * np.array(PLATE)).max() <= 1
    assert (found[at(camera, np.array([1.0, 0, 0]), 0.85 * BALL)][3]) == 255
    left, top = SIZE[0] - MARGIN - SIDE, SIZE[1] - MARGIN - SIDE
    outside = np.ones(found.shape[:2], bool)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    outside = np.hypot(rows - top - SIDE / 2, columns - left - SIDE / 2) > SIDE / 2 + 1
    assert (found[outside] == 0).all() and found[~outside].any()
    opaque = drawn(camera) / 255
    straight = found / 255
    over = straight[..., :3] * straight[..., 3:] + 1 - straight[..., 3:]
    assert np.abs(over - opaque[..., :3]).max() <= 2 / 255 and (opaque[..., 3] == 1).all()


def test_16_bits_have_it_as_8_have() -> None:
    camera = seen(*ASLANT[3])
    fine = drawn(camera, np.full((480, 640, 4), 65535, np.uint16))
    assert fine.dtype == np.uint16 and np.abs(fine / 257 - drawn(camera)).max() <= 0.51


def test_letters_are_as_dark_as_they_can_be_read_on_any_background() -> None:
    camera = seen(1.0, 0.6, 1.4)
    for level in (0, 128, 255):
        found = drawn(camera, np.full((480, 640, 4), level, np.uint8) | np.uint8([0, 0, 0, 255]))
        for tip in np.eye(3):
            ink, ball = found[at(camera, tip)][:3], found[at(camera, tip, 0.8 * BALL)][:3]
            assert int(ball.max()) - int(ink.max()) > 60


@pytest.mark.parametrize(
    ("size", "side"), [((96, 96), 48), ((1000, 96), 48), ((300, 600), 50), ((1024, 1024), 170)], ids=str
)
def test_its_size_and_its_place(size: tuple[int, int], side: int) -> None:
    x, y, found = place_of(*size)
    assert found == side and x + side + side // 10 == size[0] and y + side + side // 10 == size[1]


def test_small_pictures_have_none_and_a_note_says_so() -> None:
    scene = clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2]])
    camera = clpeel.Camera.frame(scene, (-1, -1, -1))
    for size, there in (((95, 400), False), ((96, 96), True)):
        plain = plainly.render(scene, camera, size)
        found = plain.with_axis(camera)
        note = f"no axes: {size[0]} x {size[1]} pixels are too few, they need 96 on each side"
        assert (note in found.stats.notes) != there and note not in plain.stats.notes
        assert np.array_equal(found.image, plain.image) != there
        assert found.stats.fragments == plain.stats.fragments and found.color is plain.color


def test_the_picture_without_it_stays_as_it_is(lanes: int) -> None:
    scene = clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2]])
    camera = clpeel.Camera.frame(scene, (-1, -1, -1))
    plain = plainly.render(scene, camera, (200, 150), lanes=lanes)
    before = plain.image.copy()
    found = plain.with_axis(camera, lanes=lanes)
    np.testing.assert_array_equal(plain.image, before)
    changed = (found.image != before).any(axis=-1)
    x, y, side = place_of(200, 150)
    assert changed[y : y + side, x : x + side].sum() == changed.sum() > side**2 / 2
