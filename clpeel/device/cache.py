"""Compiled kernels kept from one process to the next: read only where they are whole, and never needed.

A file for each program, in a folder named after all that its contents depend on: the versions of clpeel and the driver,
the device and the processor. A file begins with a line that tells its size and SHA-256; one that was cut or changed is
not read, and is written anew. Where nothing can be kept, kernels are compiled each time, and a note says so.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Sequence
from functools import cache as remembered
from pathlib import Path

from clpeel.errors import InputError
from clpeel.files import open_at_once, write_whole

_FORMAT = "1"  # of the files: part of their folder's name, so that those of another are not taken for damaged
_SUFFIX = ".kernels"
_PROCESSOR_BYTES = 1 << 14  # of /proc/cpuinfo: the first processor's, whose abilities are all's

_notes: list[str] = []  # for the user
_noted: set[str] = set()  # what they begin with, up to a colon: one of a kind is enough for a process


def note(text: str) -> None:
    """Leaves a note for the next picture, unless one that begins alike was left before."""
    kind = text.partition(":")[0]
    if kind not in _noted:
        _noted.add(kind)
        _notes.append(text)


def take_notes() -> list[str]:
    """The notes that no picture has had yet."""
    notes = list(_notes)
    del _notes[: len(notes)]
    return notes


def root() -> Path:
    """Where compiled kernels are kept: below POCL_CACHE_DIR, XDG_CACHE_HOME or ~/.cache, whichever is set first."""
    given = os.environ.get("POCL_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    return Path(given or Path("~", ".cache").expanduser()) / "clpeel"


class Cache:
    """What was compiled for one device."""

    def __init__(self, device: Sequence[str]) -> None:
        """device: texts that tell it from all others; the first two are for people to read."""
        from clpeel import __version__

        told = (__version__, *device, _processor())
        readable = "-".join(re.sub(r"[^\w.]+", "-", text).strip("-")[:40] for text in told[:3])
        self.folder = root() / f"{readable}-{key_of(_FORMAT, *told)[:16]}"

    def _file(self, key: str) -> Path:
        return self.folder / f"{key}{_SUFFIX}"

    def read(self, key: str) -> bytes | None:
        """What was kept under the key (`key_of`); None where there is nothing, or what there is has been damaged."""
        try:
            with open(self._file(key), "rb", opener=open_at_once) as file:
                manifest, _, payload = file.read().partition(b"\n")
        except OSError:  # no such file, or no such folder, or none that can be read: write will tell
            return None
        if manifest == _manifest(payload):
            return payload
        note(f"compiled kernels kept in '{self.folder}' were damaged; they were compiled and written anew")
        return None

    def write(self, key: str, payload: bytes) -> None:
        """Keeps it, whole or not at all. Leaves a note where that cannot be done."""
        try:
            file = self._file(key)
            self.folder.mkdir(parents=True, exist_ok=True)
            if file.is_dir():
                shutil.rmtree(file)
            elif not file.is_file():
                file.unlink(missing_ok=True)
            write_whole(file, _manifest(payload) + b"\n" + payload)
        except (OSError, InputError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            note(f"compiled kernels cannot be kept in '{self.folder}', so each run compiles them: {reason}")


def key_of(*texts: str) -> str:
    """The name to keep something under that depends on these texts alone."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


def _manifest(payload: bytes) -> bytes:
    """The line that a file begins with."""
    return f"clpeel kernels, {len(payload)} bytes, SHA-256 {hashlib.sha256(payload).hexdigest()}".encode()


@remembered
def _processor() -> str:
    """What the processor can do: code compiled for one that can more must not run on one that can less."""
    try:
        with open("/proc/cpuinfo", "rb") as file:
            lines = file.read(_PROCESSOR_BYTES).partition(b"\n\n")[0].decode("latin-1").splitlines()
    except OSError:
        import platform

        return f"{platform.machine()} {platform.processor()}"
    return "\n".join(line for line in lines if re.match(r"(model name|flags|Features|CPU part)\s*:", line))
