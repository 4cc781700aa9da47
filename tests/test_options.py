"""Options: that all classes of them compare, hash and show themselves as frozen dataclasses do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import pytest

from clpeel.options import Options
from clpeel.rendering.options import PictureOptions
from clpeel.techniques import TECHNIQUES


def classes(owner: type[Options] = Options) -> Iterator[type[Options]]:
    for below in owner.__subclasses__():
        yield below
        yield from classes(below)


def test_options_are_equal_if_all_their_values_are() -> None:
    plain, larger = PictureOptions(), PictureOptions(size=(32, 16))
    assert plain == PictureOptions() and hash(plain) == hash(PictureOptions())
    assert plain != larger and replace(larger, size=plain.size) == plain
    assert len({plain, larger, PictureOptions()}) == 2
    of_two = [type(TECHNIQUES[name].options()) for name in ("sort", "depth-peeling")]
    assert of_two[0]() != of_two[1]() and of_two[0]() != ()


@pytest.mark.parametrize("owner", sorted({*classes()}, key=lambda owner: owner.__name__))
def test_options_show_their_values_and_stay_as_they_are(owner: type[Options]) -> None:
    made = owner()
    shown = ", ".join(f"{each.name}={getattr(made, each.name)!r}" for each in fields(owner))
    assert repr(made) == f"{owner.__name__}({shown})"
    for each in fields(owner):
        with pytest.raises(AttributeError):
            setattr(made, each.name, None)


@pytest.mark.parametrize("owner", sorted({*classes()}, key=lambda owner: owner.__name__))
def test_no_class_of_options_takes_time_for_methods_of_its_own(owner: type[Options]) -> None:
    """Each of them would be compiled when a command starts."""
    assert not {"__eq__", "__hash__", "__repr__"} & {*vars(owner)}
