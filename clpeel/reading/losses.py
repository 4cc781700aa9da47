"""Losses: what a reader of another library could not read, one note each."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Iterable

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named


def listed(words: Iterable[str], most: int = 5) -> str:
    """Return the words, each once. Beyond the first `most`, only their count is given."""
    words = list(dict.fromkeys(words))
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


_TELLS = re.compile(
    r"fail|unable|skip|unsupported|not loaded|didn't|could not|missing|no materials|weird", re.IGNORECASE
)
_TOLD = re.compile(
    r"specified material|textures are unsupported|unable to store texture|slow fallback|face_normals|^loaded "
)
"""Log messages that need no note: nothing is lost, or a note of the file by name says so."""


def logged(records: Iterable[logging.LogRecord]) -> list[str]:
    """Return notes of the log records that report a loss.

    Raises InputError if the reader says that it invented the numbers.
    """
    counts = Counter[str]()
    for record in records:
        text = " ".join(record.getMessage().split())
        if "placeholder zeros" in text:
            raise InputError(f"not a readable mesh: {text}")
        cause = record.exc_info[1] if record.exc_info else None
        lost = isinstance(cause, FileNotFoundError)
        if lost or _TOLD.search(text) or not (record.levelno >= logging.WARNING or _TELLS.search(text)):
            continue
        why = f" ({type(cause).__name__})" if cause else ""
        counts[f"the reader reports: {text[:160]}{why}"] += 1
    return [f"{text}, {count} times" if count > 1 else text for text, count in counts.items()]


def missing(companions: Companions, notes: Iterable[str]) -> list[str]:
    """Return a note for each file that could not be read, unless another note already names it."""
    said = "\n".join(notes)
    lost = companions.lost.items()
    return [f"file {named(name)} left out: {reason}" for name, reason in lost if named(name) not in said]
