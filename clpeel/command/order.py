"""Order: which value of an option each file has, by where the option stands among the files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from clpeel.command.coloring import COLORING
from clpeel.errors import InputError

T = TypeVar("T")

MOMENT = ("animation_index", "animation_time")
"""The options of a moment of an animation."""

EACH = ("opacity", "color", "backface_type", *MOMENT, *COLORING)
"""The options that each file may have a value of its own of."""

FILE = "file"
"""The value that stands for what the file itself says: None, once it is read."""


def or_file(read: Callable[[str], object] | None) -> Callable[[str], object]:
    """Return a reader of an option's text that also takes FILE."""
    return lambda text: None if text == FILE else text if read is None else read(text)


def spread(flag: str, given: Sequence[tuple[int, T]], files: int) -> list[T]:
    """Return the value of an option for each file, or one value for all.

    given: each value in the order of the command line, with how many files stand before it. There is at least one.
    files: how many files there are.

    One value before the first file or behind the last holds for all. As many values as files belong to them in order,
    wherever they stand. Otherwise each value holds for the file behind it, and for those after that file until the next
    value. Raises InputError if this could be meant in two ways, or if a value would hold for nothing.
    """
    places, values = [place for place, _ in given], [value for _, value in given]
    count = len(given)
    if count == 1 and (files < 2 or places[0] in (0, files)):
        return [values[0]]
    if count == files:
        return list(values)
    if files < 2:
        raise InputError(f"{flag}: expected once, got {count} of them")
    if count == 1:
        raise InputError(
            f"{flag}: between files it may be meant for all of them, or for those behind it; write it before the first "
            f"file for all, or once before each (as '{flag} {FILE}' to leave one as it is)"
        )
    if places[0] != 0 or places[-1] == files or len({*places}) != count:
        raise InputError(
            f"{flag}: expected once for all files, or once for each of the {files}, or before the first and before "
            f"each file at which it changes, got {count} of them"
        )
    return [values[max(k for k, place in enumerate(places) if place <= file)] for file in range(files)]
