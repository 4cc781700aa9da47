"""Words: a command line as it was written, and in the order and form that argparse understands."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from typing import NamedTuple


class Words(NamedTuple):
    """The words of a command line. arguments: in the order and form that argparse understands.

    options: each option as it was given: its flag, its text, or None for a switch, and how many files stand before it.
    """

    arguments: list[str]
    options: list[tuple[str, str | None, int]]

    def in_order(self, files: Sequence[str]) -> list[str]:
        """Return the options, as `--opt=value`, and the files as they were given, each in its place."""
        found = []
        for k in range(len(files) + 1):
            found += [flag if text is None else f"{flag}={text}" for flag, text, before in self.options if before == k]
            found += files[k : k + 1]
        return found


def tidied(arguments: Sequence[str], known_options: Iterable[argparse.Action]) -> Words:
    """Bring a command's arguments into the order and form that argparse understands: options first, as `--opt=value`.

    Otherwise argparse would take a value that begins with a minus for an option (`--camera-position -1,0,2`). It would
    take whatever comes next for an optional value (`--stats FILE`). And it would refuse files on both sides of an
    option.
    known_options: those of all commands.
    """
    known = {flag: action for action in known_options for flag in action.option_strings}
    valued = {flag: action.option_strings[0] for flag, action in known.items() if action.nargs is None}
    options: list[str] = []
    given: list[tuple[str, str | None, int]] = []
    files: list[str] = []
    left = list(arguments)
    while left:
        argument = left.pop(0)
        flag, equals, value = argument.partition("=")
        before = max(len(files) - 1, 0)
        if argument == "--":
            files += left
            break
        if argument == "--stats":
            flag, equals, value = "--stats", "=", "-"
        elif argument in valued:
            if not left or left[0] in known or left[0].startswith("--"):
                return Words([*files[:1], argument], [])  # its value is missing, which is the only error to report
            equals, value = "=", left.pop(0)
        elif argument[:2] in valued and flag not in valued:
            flag, equals, value = argument[:2], "=", argument[2:]  # as -oFILE
        if flag in valued and equals:
            options.append(f"{valued[flag]}={value}")
            given.append((valued[flag], value, before))
        elif argument.startswith("-") and argument != "-":
            options.append(argument)
            given.append((argument, None, before))
        else:
            files.append(argument)
    dashes = ["--"] if any(name.startswith("-") for name in files) else []
    return Words([*files[:1], *options, *dashes, *files[1:]], given)
