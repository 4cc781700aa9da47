"""Wording: errors that speak of Python's keywords, said in the command's flags, or of the file that gave the value."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator

OTHER_NAMES = {
    "size": "--resolution",
    "background": "--background-color",
    "scalars": "--coloring-array",
    "cmap": "--colormap",
    "clim": "--coloring-range",
    "n_colors": "--colormap-discretization",
    "log_scale": "--coloring-log-scale",
    "component": "--coloring-component",
    "camera view_angle": "--camera-view-angle",
    "camera azimuth": "--camera-azimuth-angle",
    "camera elevation": "--camera-elevation-angle",
    "camera view_up": "--camera-view-up",
    "camera position": "--camera-position",
    "camera clipping_range": "--clipping-range",
}
"""Flags of options that have another name in Python."""


def in_words_of_the_command(message: str, options: argparse.Namespace) -> str:
    """Return an error's line in the command's own words.

    `passes: expected ...` becomes `--passes: expected ...`, and `execution='passes'` becomes `--execution passes`.
    Where a file gave the value, its name and the key come first, in place of a flag.
    """
    from clpeel.command.parser import make_parser

    actions = list(make_parser().commands[options.command].options())
    flags = {action.dest: action.option_strings[0] for action in actions} | OTHER_NAMES
    place = next((place for place in _places(options) if message.startswith(f"{place}: ")), "")
    rest = message.removeprefix(f"{place}: " if place else "")
    rest = re.sub(r"; it has camera, .*", "; 'clpeel techniques' lists those of each", rest)
    rest = re.sub(r"; use math\.degrees\(\.\.\.\)", "", rest)
    for name, flag in ({} if rest.startswith("--") else flags).items():
        rest = re.sub(rf"(?<!['\w/]){name}=(?:True|False)\b", flag, rest)
        rest = re.sub(rf"(?<!['\w/]){name}='?([\w.]+)'?", rf"{flag} \1", rest)
    found = re.match(r"(?:--)?([a-z][\w -]*): ", rest)
    known = found and (flags.get(found[1]) or flags.get(found[1].replace("-", "_")))
    if found is None or known is None:
        return ": ".join(filter(None, (place, rest)))
    in_file = any(place == piece.origin for piece in options.pieces if place)
    if not place:
        dest = next((action.dest for action in actions if known in action.option_strings), "")
        place = options.origins.get(dest, "")
        in_file = bool(place)
    shown = known.removeprefix("--") if in_file else known  # a file has keys, a command line flags
    return ": ".join(filter(None, (place, shown, rest[found.end() :])))


def _places(options: argparse.Namespace) -> Iterator[str]:
    """Yield the places that an error may begin with, before the name of an option."""
    for piece in options.pieces:
        yield from filter(None, (piece.origin, piece.path))
