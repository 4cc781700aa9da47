"""Completion: `clpeel completion SHELL` prints what makes a shell complete the command, by shtab."""

from __future__ import annotations

import argparse
from typing import Any

from clpeel.command.streams import print_text
from clpeel.errors import InputError

SHELLS = ("bash", "zsh", "tcsh", "fish")


def run_completion(options: argparse.Namespace) -> int:
    """Print the script for a shell. Raises InputError if it is not known, or if shtab is missing."""
    if options.shell not in SHELLS:
        raise InputError(f"completion: expected one of {', '.join(SHELLS)}, got '{options.shell}'")
    try:
        import shtab
    except ImportError:
        raise InputError("completion: expected the package shtab; pip install 'clpeel[completion]'") from None
    print_text(script(shtab, options.shell).rstrip("\n"))
    return 0


def script(shtab: Any, shell: str) -> str:
    """Return the script. shtab: the module."""
    from clpeel.command.parser import make_parser

    parser = make_parser()
    choices = _choices()
    for action in parser.options():
        action.option_strings = [flag for flag in action.option_strings if flag in parser.known]
        if action.dest in choices and action.nargs is None:
            action.choices = choices[action.dest]
    for command in parser.commands.values():
        for action in command._actions:
            metavar = str(action.metavar)
            if "FILE" in metavar or metavar.startswith("OUT"):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
            elif metavar == "DIR":
                action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
            elif metavar == "SHELL":
                action.choices = SHELLS
    return str(shtab.complete(parser, shell=shell))


def _choices() -> dict[str, tuple[str, ...]]:
    """Return the texts that options with few values take, by name."""
    from clpeel.checks import AXES, VIEWS
    from clpeel.options import Options, options_of
    from clpeel.rendering.options import PictureOptions
    from clpeel.techniques import AUTO, TECHNIQUES

    owners: tuple[type[Options], ...] = (PictureOptions, *(technique.options for technique in TECHNIQUES.values()))
    found = {each.name: tuple(map(str, each.choices)) for owner in owners for each in options_of(owner) if each.choices}
    axes = tuple(f"{sign}{axis}" for axis in AXES for sign in "+-")
    return {
        **found,
        "technique": (*TECHNIQUES, AUTO),
        "up": axes,
        "camera_direction": (*VIEWS, *axes),
    }
