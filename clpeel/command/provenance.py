"""Provenance of the command: its own words, as a picture's file carries them."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence

ASIDE = (
    "--output",
    "-o",
    "--stats",
    "--map",
    "--explain",
    "--memory",
    "--no-progress",
    "--quiet",
    "--verbose",
    "--bit-depth",
)
"""Options that change nothing that is seen. Left out, one picture has the same words under any name."""


def command_words(made: Mapping[str, str], words: Sequence[str]) -> dict[str, str]:
    """Return how a picture was made with the command line in place of Python's options.

    made: Result.provenance. words: those of the command line, options as `--option=value`.
    """
    kept = {name: text for name, text in made.items() if name not in ("python", "camera")}
    software = kept.pop("software", "clpeel")
    return {"software": software, "command": shlex.join(["clpeel", *_kept(words)]), **kept}


def _kept(words: Sequence[str]) -> Iterator[str]:
    """Yield the words that matter. Files keep their names, but not the folders that lead there from the root."""
    for word in words:
        option, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
        if option in ASIDE or (word.startswith("-o") and not word.startswith("--")):
            continue
        yield f"{option}{equals}{os.path.basename(value) if os.path.isabs(value) else value}"


def provenance_table(path: str) -> list[str]:
    """Return how a picture was made, a line for each of its words. Raises InputError if it does not say.

    What is not printable is shown as an escape, as the file may be a stranger's.
    """
    from clpeel.command.report import table
    from clpeel.pictures.provenance import read_provenance

    return table((_printable(name), _printable(text)) for name, text in read_provenance(path).items())


def _printable(text: str) -> str:
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)
