"""Backgrounds: rows of a gradient against its definition, in numbers that binary fractions hold exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.checks import Rgb, checked_background, shades_of
from clpeel.errors import InputError
from clpeel.pictures.background import levels_of, rows_of

SHADE = st.floats(0, 1)
COLOR = st.tuples(SHADE, SHADE, SHADE)


def test_a_row_has_the_colour_of_its_centre() -> None:
    """Of 4 rows the centres lie at 1/8, 3/8, 5/8 and 7/8 of the way from the top edge to the bottom edge."""
    rows = rows_of(((1.0, 0.0, 0.5), (0.0, 1.0, 0.5)), 4)
    assert rows[:, 0].tolist() == [[0.875, 0.125, 0.5], [0.625, 0.375, 0.5], [0.375, 0.625, 0.5], [0.125, 0.875, 0.5]]
    assert rows.dtype == np.float64 and rows.shape == (4, 1, 3)


def test_a_single_row_has_the_colour_between() -> None:
    assert rows_of(((1.0, 0.5, 0.0), (0.0, 1.0, 0.0)), 1).tolist() == [[[0.5, 0.75, 0.0]]]


@given(color=COLOR, height=st.integers(1, 300))
def test_one_colour_is_that_of_all_rows(color: Rgb, height: int) -> None:
    assert (rows_of(color, height) == color).all() and len(rows_of(color, height)) == height
    assert (rows_of((color, color), height) == color).all()


@given(top=COLOR, bottom=COLOR, height=st.integers(1, 300))
def test_rows_go_from_top_to_bottom_in_equal_steps(top: Rgb, bottom: Rgb, height: int) -> None:
    rows = rows_of((top, bottom), height)[:, 0]
    step = (np.array(bottom) - top) / height
    assert np.abs(rows[0] - (top + step / 2)).max() < 1e-15 and np.abs(rows[-1] - (bottom - step / 2)).max() < 1e-15
    assert np.abs(np.diff(rows, axis=0) - step).max(initial=0) < 1e-15
    assert np.abs(rows[::-1] - rows_of((bottom, top), height)[:, 0]).max() < 1e-15


def test_levels_are_rounded_and_opaque() -> None:
    levels = levels_of(((0.0, 0.2, 1.0), (1.0, 0.2, 1.0)), 2)
    assert levels.tolist() == [[[64, 51, 255, 255]], [[191, 51, 255, 255]]]  # 63.75 and 191.25
    assert levels.dtype == np.uint8


@pytest.mark.parametrize(
    ("background", "shades"),
    [
        ("white", [(1, 1, 1)]),
        ("white:black", [(1, 1, 1), (0, 0, 0)]),
        ("0,0.25,1:#336699", [(0, 0.25, 1), (0.2, 0.4, 0.6)]),
        (("white", (0, 0, 1)), [(1, 1, 1), (0, 0, 1)]),
        (["#ff0000", "0,1,0"], [(1, 0, 0), (0, 1, 0)]),
        (np.array([[1, 0.5, 0], [0, 0.5, 1]]), [(1, 0.5, 0), (0, 0.5, 1)]),
        (np.array([1, 0.5, 0]), [(1, 0.5, 0)]),
    ],
)
def test_what_may_be_given(background: object, shades: list[Rgb]) -> None:
    found = checked_background(background)
    assert found is not None and list(shades_of(found)) == shades
    assert checked_background(found) == found, "checking it again changes nothing"


@pytest.mark.parametrize(
    ("background", "says"),
    [
        ("a:b:c", "background: expected a colour, or 2 for top and bottom, got 3: 'a:b:c'"),
        ("white:", "background: bottom: expected R,G,B in 0..1, #rrggbb or a colour name, got ''"),
        (
            ("whit", "black"),
            "background: top: expected R,G,B in 0..1, #rrggbb or a colour name, got 'whit'; did you mean white?",
        ),
        (((1, 1, 1), (0, 0, 2)), "background: bottom: expected 3 numbers 0..1, got (0, 0, 2)"),
        (((1, 1, 1), 0), "background: bottom: expected 3 numbers 0..1, got 0"),
        (((1, 1, 1), (0, 0)), "background: bottom: expected 3 numbers 0..1, got (0, 0)"),
        (((1, 1, 1), None), "background: bottom: expected 3 numbers 0..1, got None"),
        (((1, 1, 1),), "background: expected 3 numbers 0..1, (top, bottom) or None, got ((1, 1, 1),)"),
        (("a", "b", "c"), "background: expected a colour, or 2 for top and bottom, got 3: ('a', 'b', 'c')"),
        ((0, 0), "background: expected 3 numbers 0..1, (top, bottom) or None, got (0, 0)"),
        (5, "background: expected 3 numbers 0..1, (top, bottom) or None, got 5"),
        (np.array(5), "background: expected 3 numbers 0..1, (top, bottom) or None, got array(5)"),
        ((), "background: expected 3 numbers 0..1, (top, bottom) or None, got ()"),
    ],
)
def test_what_is_no_background_is_one_line(background: object, says: str) -> None:
    with pytest.raises(InputError) as error:
        checked_background(background)
    assert str(error.value) == says
