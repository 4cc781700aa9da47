"""Config: the user's own defaults of options, from a TOML file, for all commands or for one."""

from __future__ import annotations

import os
from collections.abc import Collection
from typing import Any

from clpeel.command.toml import NOT_IN_FILES, Keys, read_toml, said, spelled, unknown
from clpeel.errors import InputError

VARIABLE = "CLPEEL_CONFIG"
"""Names another file than the user's; an empty text names none."""


def users_file() -> str | None:
    """Return the path of the user's own file of defaults, or None if there is none."""
    path = os.environ.get(VARIABLE)
    if path is None:
        folder = os.environ.get("XDG_CONFIG_HOME") or os.path.join("~", ".config")
        path = os.path.join(os.path.expanduser(folder), "clpeel", "config.toml")
        if not os.path.isabs(path):  # there is no home, or the variable is to be ignored by its specification
            return None
        try:
            os.stat(path)
        except (OSError, ValueError):
            return None
    return path or None


def defaults(path: str, command: str, commands: Collection[str], keys: Keys) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the values that a file gives a command's options, by name, and where each comes from.

    Keys outside of tables hold for all commands that have such an option. Those of a table hold for the command that it
    is named after. Raises InputError, which begins with the path.
    """
    top = read_toml(path)
    tables = {key: value for key, value in top.items() if key in commands}
    others = {key: value for key, value in top.items() if key not in commands}
    found: dict[str, Any] = {}
    origins: dict[str, str] = {}
    for key, value in spelled(f"{path}: ", others).items():
        if key in NOT_IN_FILES or key not in {*keys.actions, *keys.others}:
            unknown(path, key, {*keys.actions, *keys.others, *commands})
        if key in keys.actions:
            name, found_value = keys.converted(path, key, value)
            found[name], origins[name] = found_value, path
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise InputError(f"{path}: {name}: expected a table, [{name}], got {said(table)}")
    where = f"{path}: [{command}]"
    for key, value in spelled(f"{where}: ", tables.get(command, {})).items():
        if key not in keys.actions:
            unknown(where, key, keys.actions)
        name, found_value = keys.converted(where, key, value)
        found[name], origins[name] = found_value, where
    return found, origins
