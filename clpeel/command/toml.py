"""TOML: reads a file of options, and turns its keys and values into those of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, NoReturn

from clpeel.command.order import EACH, FILE
from clpeel.errors import InputError

NOT_IN_FILES = ("config", "no_config", "write_scene", "help", "help_all", "version")
"""Options of the command line alone."""

BETWEEN_COLONS = ("background_color", "colormap")
"""Options whose texts have colons between colours."""

NUMBERS_TOO = ("device",)
"""Options of text that may be a number in a file."""

AGAINST = {
    "no_background": ("background_color",),
    "lighting": ("unlit",),
    "unlit": ("lighting",),
    "camera_position": ("camera_direction",),
    "opacity_map": ("opacity_array",),
    "opacity_array": ("opacity_map",),
    "quiet": ("verbose",),
}
"""For an option of a file, those that put it out of force if they are given in a stronger place."""

SUFFIX = ".toml"
"""Of scene files."""

PATHS = ("output", "stats", "map", "json", "csv", "html")
"""Options that name files, which are relative to the scene file."""

MOST_BYTES = 1 << 24


def is_scene_file(path: str) -> bool:
    """Return whether a file of the command line is a scene file."""
    return path.lower().endswith(SUFFIX)


def over(weaker: Mapping[str, Any], stronger: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of both places, where those of the stronger one win."""
    return {
        **{
            name: value
            for name, value in weaker.items()
            if not any(rival in stronger for rival in AGAINST.get(name, ()))
        },
        **stronger,
    }


def read_toml(path: str) -> dict[str, Any]:
    """Return what a TOML file says. Raises InputError of one line, which begins with the path."""
    import tomllib

    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        missing = isinstance(error, FileNotFoundError)
        reason = "no such file" if missing else f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise InputError(f"{path}: {reason}") from None
    if len(data) > MOST_BYTES:
        raise InputError(f"{path}: expected at most {MOST_BYTES >> 20} MiB of options, got more")
    try:
        return tomllib.loads(data.decode())
    except UnicodeDecodeError:
        raise InputError(f"{path}: expected TOML, which is UTF-8, got other bytes") from None
    except RecursionError:
        raise InputError(f"{path}: not TOML: it is nested too deep") from None
    except ValueError as error:
        raise InputError(f"{path}: not TOML: {next(iter(str(error).splitlines()), '')}") from None


def plain(key: str) -> str:
    """Return a key as options are named in Python: `camera-direction` and `camera_direction` are the same."""
    return key.replace("-", "_")


def spelled(where: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table with plain keys. Raises InputError if two of them are the same."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        if plain(key) in found:
            raise InputError(f"{where}{key}: expected once, got it with - and with _")
        found[plain(key)] = value
    return found


def unknown(where: str, key: str, known: Iterable[str]) -> NoReturn:
    """Raise an InputError that names the nearest of the known keys."""
    import difflib

    names = sorted(name.replace("_", "-") for name in known)
    close = difflib.get_close_matches(key.replace("_", "-"), names, n=1)
    hint = (
        f"; did you mean {close[0]}?" if close else f"; expected one of {', '.join(names)}" if len(names) < 20 else ""
    )
    raise InputError(f"{where}: unknown key {ascii(key)}{hint}")


class Keys(NamedTuple):
    """The keys that stand for options. actions: those of a command, by key. others: the keys of other commands."""

    actions: Mapping[str, argparse.Action]
    others: frozenset[str]

    @classmethod
    def of(cls, command: Iterable[argparse.Action], all_options: Iterable[argparse.Action]) -> Keys:
        """Return the keys of a command's options, and those of all commands."""
        own, others = keyed(command), keyed(all_options)
        return cls(own, frozenset(others) - frozenset(own))

    def converted(self, where: str, key: str, value: Any) -> tuple[str, Any]:
        """Return the name and the value of an option. Raises InputError, which begins with `where`, if it is wrong."""
        action = self.actions[key]
        shown = f"{where}: {key.replace('_', '-')}"
        if value == FILE and action.dest in EACH:
            return action.dest, None
        if action.nargs == 0:
            if not isinstance(value, bool):
                raise InputError(f"{shown}: expected true or false, got {said(value)}")
            return action.dest, action.const if value else action.default
        text = "-" if key == "stats" and value is True else text_of(shown, value, action)
        try:
            return action.dest, text if action.type is None else action.type(text)  # type: ignore[operator]
        except argparse.ArgumentTypeError as error:
            raise InputError(f"{shown}: {error}") from None


def keyed(actions: Iterable[argparse.Action]) -> dict[str, argparse.Action]:
    """Return options by the keys that stand for them: their long flags, without dashes in front."""
    found = {}
    for action in actions:
        key = plain(action.option_strings[0].removeprefix("--"))
        if key not in NOT_IN_FILES:
            found[key] = action
    return found


def text_of(shown: str, value: Any, action: argparse.Action) -> str:
    """Return the text that the command line would have for a value. Raises InputError, which begins with `shown`."""
    wanted = action.metavar or "text"
    between = ":" if action.dest in BETWEEN_COLONS else ","
    if isinstance(value, list) and value:
        if all(map(is_number, value)):
            return ",".join(map(repr, value))
        if between == ":" or all(isinstance(part, str) for part in value):
            parts = [text_of(shown, part, action) for part in value]
            return between.join(parts)
    if isinstance(value, str):
        return value
    if is_number(value) and (action.type is not None or action.dest in NUMBERS_TOO):
        return repr(value)
    raise InputError(f"{shown}: expected {wanted}, got {said(value)}")


def is_number(value: object) -> bool:
    """Return whether a value of a TOML file is a number, of at most 64 bits as TOML has them."""
    return isinstance(value, float) or (isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 63)


def said(value: object) -> str:
    """Return a value of a TOML file in words of one line, for an error."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, bool):
        return str(value).lower()
    try:
        text = ascii(value)
    except (ValueError, RecursionError):  # Python writes no whole number of thousands of digits
        return "a value that is too large"
    return text if len(text) <= 60 else f"{text[:57]}..."
