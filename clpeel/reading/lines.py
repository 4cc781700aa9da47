"""Lines: finds the lines of a text file that begin with a word, and reads their numbers, without a loop over lines."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError

_SPACE, _NEWLINE = 32, 10
_WINDOWS_NAN = re.compile(rb"[-+]?(nan\(\w*\)|1\.#(IND|QNAN|SNAN|INF)\w*)$", re.IGNORECASE)
"""How C libraries on Windows write what is not a number."""


class Lines:
    """The lines of a text file and their words. Anything up to a space is white."""

    def __init__(self, data: bytes) -> None:
        self._text = np.frombuffer(data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") + b"\n" + b" " * 16, np.uint8)
        ends = np.flatnonzero(self._text == _NEWLINE) + 1
        self._starts = np.concatenate([[0], ends])
        self._words = word_starts(self._text)
        self._first = np.searchsorted(self._words, self._starts)
        self.counts = np.diff(self._first)
        """How many words each line has, int64 [lines]."""

    def beginning_with(self, word: bytes) -> NDArray[np.int64]:
        """Return the numbers of the lines whose first word is this one, counted from 0."""
        lines = np.flatnonzero(self.counts)
        begin = self._words[self._first[lines]]
        for place, letter in enumerate(word):
            kept = self._text[begin + place] == letter
            lines, begin = lines[kept], begin[kept]
        return lines[self._text[begin + len(word)] <= _SPACE]

    def rest(self, line: int) -> bytes:
        """Return what stands behind a line's first word."""
        words = self._text[self._words[self._first[line]] : self._starts[line + 1]].tobytes().split(maxsplit=1)
        return words[1].strip() if len(words) == 2 else b""

    def text(self, lines: NDArray[np.int64], word: int = 0) -> NDArray[np.uint8]:
        """Return the text of some lines, whose first words have this length and are made blank."""
        chosen = np.zeros(len(self.counts), bool)
        chosen[lines] = True
        lengths = np.diff(self._starts)
        end = self._starts[-1]
        text: NDArray[np.uint8] = self._text[:end][np.repeat(chosen, lengths)]
        if word and len(lines):
            moved = np.cumsum(lengths[lines]) - lengths[lines]
            begin = moved + self._words[self._first[lines]] - self._starts[lines]
            for place in range(word):
                text[begin + place] = _SPACE
        return text

    def numbers(self, lines: NDArray[np.int64], word: int = 0) -> NDArray[np.float64]:
        """Return the numbers in these lines, behind their first words of this length: float64 [numbers].

        `counts` says how many each line has, besides the word. Raises InputError if a word is no number.
        """
        return parsed(self.text(lines, word).tobytes())


def word_starts(text: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return where the words of a text begin."""
    ink = text > _SPACE
    ink[1:] &= text[:-1] <= _SPACE
    return np.flatnonzero(ink)


def parsed(text: bytes, kind: Any = np.float64) -> NDArray[Any]:
    """Return the numbers in a text of nothing else, as float64 or int64. Raises InputError if a word is no number."""
    count = len(word_starts(np.frombuffer(text, np.uint8)))
    if not count:
        return np.zeros(0, kind)
    try:
        values = np.fromstring(text, kind, sep=" ")
        if values.size == count:  # older NumPy gives no error
            return values
    except ValueError:
        pass
    return np.array([_number(word, kind) for word in text.split()], kind)


def _number(word: bytes, kind: Any) -> Any:
    """Return the number that a word is. Raises InputError if it is none."""
    try:
        return int(word) if kind is np.int64 else float(word)
    except ValueError:
        if kind is not np.int64 and _WINDOWS_NAN.match(word):
            return float("nan")
    shown = word[:20].decode("latin-1")
    raise InputError(f"not a readable mesh: expected numbers, got {shown!r}")
