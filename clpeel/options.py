"""Options: a field of a frozen dataclass holds everything that is known of one option.

Its type, default, check and line of help give the checks and errors for Python callers, the command's flags and help,
`clpeel techniques`, the table in README.md, the keyword types for editors (rendering/keywords.py), and the keys of the
measurements. Nothing here needs NumPy.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeVar, cast

from clpeel import checks
from clpeel.color import parse_color
from clpeel.errors import InputError

T = TypeVar("T")

Check = Callable[[str, object], object]
"""Takes (name, value) and returns the value as the code uses it, or raises InputError."""

Parse = Callable[[str], object]
"""Turns the text of a flag into a value, or raises an InputError without the flag's name."""

_KEY = "option"


@dataclass(frozen=True)
class Kind:
    """The kind of value that an option has: how it is checked, and how the command reads and shows it."""

    check: Check
    parse: Parse = str
    metavar: str = ""


@dataclass(frozen=True)
class Option:
    """What is known of one field.

    annotation: its type. flag: the command's flag, such as `--passes`. kind: None for a switch, whose flag takes no
    value.
    """

    name: str
    annotation: object
    default: object
    flag: str
    help: str
    kind: Kind | None

    @property
    def flag_help(self) -> str:
        """The line of help for the flag. If a switch is on by default, its flag turns it off."""
        return f"do not {self.help}" if self.default is True else self.help

    @property
    def choices(self) -> tuple[str | int, ...]:
        """The values of a Literal, or no values for other types."""
        return _choices(self.annotation)

    def checked(self, value: object) -> object:
        """Return the value as the code uses it, or raise InputError. None is accepted if it is the default."""
        if value is None and self.default is None:
            return None
        if self.choices:
            checks.one_of(self.name, value, self.choices)
            return value
        return checks.true_or_false(self.name, value) if self.kind is None else self.kind.check(self.name, value)


def option(default: T, kind: Kind | None = None, *, help: str, flag: str = "") -> T:
    """Define a field of an Options class.

    kind: required, except for switches (bool) and choices (Literal), whose types are enough. flag: by default it is
    `--the-name`, or `--no-the-name` for a switch that is on by default.
    """
    return dataclasses.field(default=default, metadata={_KEY: (kind, help, flag)})


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Options:
    """Base of all options. Values are checked on construction. Raises InputError if one is invalid."""

    def __post_init__(self) -> None:
        for each in options_of(type(self)):
            object.__setattr__(self, each.name, each.checked(getattr(self, each.name)))
        self.check_together()

    # A command makes all classes of options as it starts. Without methods of their own that takes half the time.
    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash((type(self), *self._values()))

    def __repr__(self) -> str:
        names = (each.name for each in options_of(type(self)))
        given = zip(names, self._values(), strict=True)
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in given)})"

    def _values(self) -> tuple[object, ...]:
        return tuple(getattr(self, each.name) for each in options_of(type(self)))

    def check_together(self) -> None:
        """Raise InputError if two values, each of them valid, do not go together."""

    def given(self) -> Iterator[tuple[str, object]]:
        """Yield the names and values of options that differ from their defaults, in the order of the fields."""
        for each in options_of(type(self)):
            value = getattr(self, each.name)
            if value not in (each.default, each.checked(each.default)):
                yield each.name, value


_FOUND: dict[type[Options], tuple[Option, ...]] = {}


def options_of(owner: type[Options]) -> tuple[Option, ...]:
    """Return the options of a class. Those of its base classes come first."""
    if owner not in _FOUND:
        _FOUND[owner] = tuple(_read_fields(owner))
    return _FOUND[owner]


def _read_fields(owner: type[Options]) -> Iterator[Option]:
    hints = typing.get_type_hints(owner)
    for each in dataclasses.fields(owner):
        kind, text, flag = each.metadata[_KEY]
        if not flag:
            no = "no-" if each.default is True else ""
            flag = f"--{no}{each.name.replace('_', '-')}"
        annotation = hints[each.name]
        values = _choices(annotation)
        if values:
            read = read_count if isinstance(values[0], int) else str
            kind = Kind(_unchecked, read, "|".join(map(str, values)) if read is str else "N")
        yield Option(each.name, annotation, each.default, flag, text, kind)


def _unchecked(name: str, value: object) -> object:
    return value


def _choices(annotation: object) -> tuple[str | int, ...]:
    union = typing.get_origin(annotation) in (types.UnionType, typing.Union)
    parts = typing.get_args(annotation) if union else (annotation,)
    return tuple(value for part in parts if typing.get_origin(part) is Literal for value in typing.get_args(part))


# --- the kinds of values ----------------------------------------------------------------------------------------------


def count(most: int, least: int = 1) -> Kind:
    """Return the kind of a whole number least..most. least: 0 or 1."""
    return Kind(
        lambda name, value: checks.whole_number(name, value, most, least), read_count if least else _read_whole, "N"
    )


def read_count(text: str) -> int:
    """Read a whole number of 1 or more, or raise InputError."""
    return _read_whole(text, 1)


def _read_whole(text: str, least: int = 0) -> int:
    """Read a whole number of `least` or more, or raise InputError."""
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise InputError(f"expected a whole number of {least} or more, got '{text}'")
    return value


def read_numbers(text: str) -> list[float]:
    """Read finite numbers with commas between them. Raises ValueError."""
    values = [float(part) for part in text.split(",")]
    if not all(abs(value) < float("inf") for value in values):
        raise ValueError(text)
    return values


def read_within(text: str, low: float, high: float, expected: str) -> float:
    """Read a number low..high, or raise InputError. expected: what was expected, in words."""
    try:
        (value,) = read_numbers(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise InputError(f"expected {expected}, got '{text}'")
    return value


def read_share(text: str) -> float:
    """Read a number 0..1, or raise InputError."""
    return read_within(text, 0, 1, "a number in 0..1")


def _read_range(text: str) -> tuple[float, float]:
    try:
        low, high = read_numbers(text)
        if not 0 <= low < high:
            raise ValueError(text)
    except ValueError:
        raise InputError(f"expected LOW,HIGH (two numbers, 0 <= LOW < HIGH), got '{text}'") from None
    return low, high


def _read_not_negative(text: str) -> float:
    try:
        (value,) = read_numbers(text)
    except ValueError:
        raise InputError(f"expected a number, got '{text}'") from None
    if value < 0:
        raise InputError(f"expected a number of 0 or more, got '{text}'")
    return value


def read_color(text: str) -> checks.Rgb:
    """Read `R,G,B` in 0..1, `#rrggbb` or a name such as `steelblue` as three numbers 0..1, or raise InputError."""
    red, green, blue = parse_color(text)
    return red, green, blue


SHARE = Kind(checks.share, read_share, "0..1")
RANGE = Kind(checks.number_range, _read_range, "LOW,HIGH")
COLOR = Kind(checks.checked_rgb, read_color, "COLOR")
MEMORY = Kind(lambda name, value: checks.parse_memory(cast(str, value)), str, "SIZE")


def not_negative(what: str) -> Kind:
    """Return the kind of a finite number of 0 or more. what: the expected number, in words."""
    return Kind(lambda name, value: checks.not_negative(name, value, what), _read_not_negative, "NUMBER")
