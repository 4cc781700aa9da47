"""Colours as they are written: the same for the command and for Python."""

from __future__ import annotations

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.checks import checked_background, checked_rgb
from clpeel.color import parse_color
from clpeel.scene.arrays import checked_color

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]


@pytest.mark.parametrize(
    ("text", "color"),
    [
        ("red", (1, 0, 0)),
        ("SteelBlue", (70 / 255, 130 / 255, 180 / 255)),
        ("#336699", (0.2, 0.4, 0.6)),
        ("0.25,0.5,1", (0.25, 0.5, 1)),
        ("rgb(51, 102, 255)", (0.2, 0.4, 1)),
        ("#33669900", (0.2, 0.4, 0.6, 0)),
        ("0.25,0.5,1,0.75", (0.25, 0.5, 1, 0.75)),
    ],
)
def test_names_and_numbers(text: str, color: tuple[float, ...]) -> None:
    assert parse_color(text, alpha=True) == pytest.approx(color)
    if len(color) == 4:
        with pytest.raises(clpeel.InputError, match="which has an alpha$"):
            parse_color(text)
    else:
        assert checked_rgb("color", text) == checked_background(text) == parse_color(text)
    assert checked_color("color", text).tolist() == pytest.approx(color)
    scene = clpeel.Scene.from_arrays(*TRIANGLE, color=text)
    assert scene.colors.tolist() == pytest.approx((*color, 1)[:4])


def test_numbers_stay_what_they_are() -> None:
    for color in ((1, 2, 3), (1, 2, 3, 4), (0.5, 0.5, 0.5), np.zeros(4, np.float32)):
        got = checked_color("color", color)
        assert got.tolist() == list(color) and got.dtype == (np.uint8 if isinstance(color[0], int) else np.float32)


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("rde", "got 'rde'; did you mean red?"),
        ("steel-blue", "got 'steel-blue'; did you mean steelblue?"),
        ("qqqq", "got 'qqqq'"),
        ("#12", "got '#12'"),
        ("", "got ''"),
        ("1,2,3", "got '1,2,3'"),
        ("1,1", "got '1,1'"),
        ("0,0,nan", "got '0,0,nan'"),
        ("rgb(300,0,0)", "got 'rgb(300,0,0)'"),
    ],
)
def test_what_is_no_colour_is_one_line(text: str, end: str) -> None:
    message = f"expected R,G,B in 0..1, #rrggbb or a colour name, {end}"
    for read in (
        lambda: checked_rgb("light", text),
        lambda: checked_color("light", text),
        lambda: clpeel.Scene.from_arrays(*TRIANGLE, color=text),
        lambda: checked_background(text),
    ):
        with pytest.raises(clpeel.InputError) as error:
            read()
        assert str(error.value).partition(": ")[2] == message


def test_one_name_for_many_faces_is_refused() -> None:
    with pytest.raises(clpeel.InputError, match=r"^face_colors: expected \[1, 3 or 4\] integers .* got 'red'$"):
        clpeel.Scene.from_arrays(*TRIANGLE, face_colors="red")


def test_the_background_of_a_picture_by_name() -> None:
    scene = clpeel.Scene.from_arrays(*TRIANGLE, color="red")
    away = clpeel.Camera((0, 0, 5), (0, 0, 9))
    image = plainly.render(scene, away, (2, 2), background="navy").image
    assert (image == [0, 0, 128, 255]).all()
