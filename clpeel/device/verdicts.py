"""Verdicts: whether a device's kernels have drawn a known picture rightly, kept from one process to the next.

They are lines of a file in the folder of the device's compiled kernels (cache.py), so another driver or another version
of clpeel begins anew. A line begins with a digest of the rest. A line that was cut or changed is not used. If the file
cannot be read or written, pictures are tested again in each process. A file that has become long is cut to its last
lines, as each process reads all of it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Literal, get_args

import pyopencl as cl

from clpeel.device.building import cache_of
from clpeel.device.cache import key_of, root
from clpeel.errors import InputError
from clpeel.files import open_at_once, write_whole

Kind = Literal["right", "close", "wrong"]
"""close: right but for roundings that the device says it does not make correctly."""

Parts = frozenset[str]
"""What a test went through: sets of kernels, each named by a text of one line.

A name may end with a digest of the sources, in brackets: `sort: lanes 1 [0123456789abcdef]`.
"""

_TEST = 2
"""Rises when the tests themselves are mended, so that no verdict of an earlier one is believed."""

_DIGEST = 16
_MOST_BYTES = 1 << 24
"""Of the file. A line takes some hundred bytes, so nobody's file is that long."""

_KEPT, _MOST = 1000, 2000
"""How many of the last verdicts stay in a file that has more than so many. Those that go cost a test of about 10 ms."""

_KINDS = get_args(Kind)


@dataclass(frozen=True)
class Verdict:
    """What a test has shown. lanes: work-items that share a tile. reason: one line; empty if all is right."""

    kind: Kind
    lanes: int
    parts: Parts
    reason: str = ""

    @property
    def line(self) -> str:
        """The verdict as a line of the file, without the line break."""
        told = "\t".join(re.sub(r"\s+", " ", text) for text in (self.kind, str(self.lanes), self.reason))
        told = "\t".join([told, *(re.sub(r"\s+", " ", part) for part in sorted(self.parts))])
        return f"{_digest(told)}\t{told}"


def _digest(told: str) -> str:
    """The digest of a line's text."""
    return key_of(f"{_TEST}\t{told}")[:_DIGEST]


def _verdict(line: str) -> Verdict | None:
    """The verdict that a line has; None if the line is none, or is damaged."""
    digest, _, told = line.partition("\t")
    words = told.split("\t")
    if digest != _digest(told) or len(words) < 4 or words[0] not in _KINDS:
        return None
    kind: Kind = "right" if words[0] == "right" else "close" if words[0] == "close" else "wrong"
    return Verdict(kind, int(words[1]), frozenset(words[3:]), words[2])


@dataclass
class Verdicts:
    """The verdicts on one device. Threads may share them.

    file: where they are kept. good: for each part that was drawn rightly, the last such verdict. wrong: the others.
    """

    file: Path
    good: dict[str, Verdict] = field(default_factory=dict)
    wrong: list[Verdict] = field(default_factory=list)
    lock: Lock = field(default_factory=Lock)

    def of(self, parts: Parts) -> Verdict | None:
        """The verdict on a picture that needs these parts, or None if it has to be tested.

        A picture is wrong if a test was wrong that went through parts of it alone.
        """
        with self.lock:
            for verdict in self.wrong:
                if verdict.parts <= parts:
                    return verdict
            found = [self.good.get(part) for part in sorted(parts)]
        known = [verdict for verdict in found if verdict is not None]
        if len(known) < len(parts):
            return None
        return next((verdict for verdict in known if verdict.kind == "close"), known[0])

    def summary(self, lanes: int) -> str:
        """What all verdicts with so many lanes say together: "wrong" if any does, "right", or "not yet"."""
        with self.lock:
            if any(verdict.lanes == lanes for verdict in self.wrong):
                return "wrong"
            return "right" if any(verdict.lanes == lanes for verdict in self.good.values()) else "not yet"

    def add(self, verdict: Verdict) -> None:
        """Notes a verdict. Earlier ones on the same parts do not count any more."""
        with self.lock:
            self._take(verdict)

    def keep(self, verdict: Verdict) -> None:
        """`add`, and writes the verdict to the file. If that fails, a later process tests again."""
        self.add(verdict)
        # The line is written at once and at the end of the file, so lines of several processes do not mix. It begins
        # with a line break, because the last line there may have been cut.
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0)
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.file, flags, 0o666)
            try:
                os.write(descriptor, f"\n{verdict.line}\n".encode())
            finally:
                os.close(descriptor)
        except OSError:
            pass

    def _take(self, verdict: Verdict) -> None:
        # Verdicts on other sources of the same kernels do not count any more, either.
        if self.wrong:
            names = _without_digests(verdict.parts)
            self.wrong = [other for other in self.wrong if not _without_digests(other.parts) <= names]
        if verdict.kind == "wrong":
            self.wrong.append(verdict)
        else:
            self.good.update(dict.fromkeys(verdict.parts, verdict))


def _without_digests(parts: Parts) -> Parts:
    return frozenset(part.partition(" [")[0] for part in parts)


_known: dict[tuple[int, Path], Verdicts] = {}  # by device, and by the folder of all compiled kernels
_knowing = Lock()


def verdicts_of(device: cl.Device) -> Verdicts:
    """The verdicts on the device. The file is read once in each process."""
    key = device.int_ptr, root()
    with _knowing:
        if key not in _known:
            found = Verdicts(cache_of(device).folder / "verdicts")
            read = [verdict for line in _lines(found.file) if (verdict := _verdict(line)) is not None]
            for verdict in read:
                found.add(verdict)
            if len(read) > _MOST:
                _shorten(found.file, read)
            _known[key] = found
        return _known[key]


def _lines(file: Path) -> Iterator[str]:
    try:
        with open(file, "rb", opener=open_at_once) as opened:
            yield from opened.read(_MOST_BYTES).decode("utf-8", "replace").split("\n")
    except OSError:  # there is none yet, or it cannot be read
        return


def _shorten(file: Path, read: Sequence[Verdict]) -> None:
    """Cuts the file to its last verdicts. What another process adds meanwhile may be lost, and is tested again."""
    with suppress(InputError, OSError):
        write_whole(file, "".join(f"{verdict.line}\n" for verdict in read[-_KEPT:]).encode())
