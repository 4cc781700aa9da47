"""Writes clpeel/rendering/keywords.py, which tells editors and type checkers the options of `render`.

The file is made from the fields of all option classes. With `--check`, nothing is written, and the exit code is 1 if
the file is not up to date.
"""

from __future__ import annotations

import sys
import textwrap
import typing
from pathlib import Path

from clpeel.options import Option, options_of
from clpeel.rendering.request import all_options

FILE = Path(__file__).resolve().parent.parent / "clpeel" / "rendering" / "keywords.py"
EXPLICIT = ("size", "background", "lighting")
"""Options that `render` has as parameters of their own."""

HEAD = '''\
"""The options of `render` for editors and type checkers. Written by tools/write_keywords.py: do not edit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypedDict


class Keywords(TypedDict, total=False):
    """Options by name. Which technique has which, `clpeel techniques` lists; another is an InputError."""
'''


def spelled(annotation: object) -> str:
    """Return a type as it is written in a source file."""
    if typing.get_origin(annotation) is typing.Union:  # what a Literal | None is
        return " | ".join(map(spelled, typing.get_args(annotation)))
    if isinstance(annotation, type) and not typing.get_args(annotation):
        return "None" if annotation is type(None) else annotation.__name__
    return str(annotation).replace("typing.", "").replace("collections.abc.", "").replace("'", '"')


def keywords() -> str:
    """Return the text of the file."""
    found: dict[str, list[Option]] = {}
    for owner in all_options():
        for each in options_of(owner):
            if each.name not in EXPLICIT:
                found.setdefault(each.name, []).append(each)
    lines = [HEAD]
    for name, options in found.items():
        types = dict.fromkeys(part.strip() for each in options for part in spelled(each.annotation).split(" | "))
        lines.append(f"    {name}: {' | '.join(types)}")
        text = options[0].help
        lines.append("\n".join(textwrap.wrap(f'"""{text[0].upper()}{text[1:]}."""', 116, initial_indent="    ")))
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write the file, or check it. Returns the exit code."""
    text = keywords()
    if "--check" not in sys.argv[1:]:
        FILE.write_text(text, encoding="utf-8")
        return 0
    if FILE.read_text(encoding="utf-8") == text:
        return 0
    print(f"{FILE}: expected what tools/write_keywords.py writes, got another text; run it", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
