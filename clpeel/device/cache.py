"""The cache: keeps compiled kernels from one process to the next. Everything works without it.

Each program has a file. Its folder is named after everything that the contents depend on: the versions of clpeel and
the driver, the device and the processor. A file begins with a line that gives its size and SHA-256. A file that was cut
or changed is not used, and is written again. If nothing can be kept, kernels are compiled in each process, and a note
says so.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Sequence
from functools import cache as remembered
from pathlib import Path

from clpeel import version
from clpeel.errors import InputError
from clpeel.files import open_at_once, write_whole

_FORMAT = "1"  # of the files. It is part of the folder's name: files of another format then do not look damaged
_SUFFIX = ".kernels"
_PROCESSOR_BYTES = 1 << 14  # of /proc/cpuinfo: enough for the first processor, and all have the same abilities

_notes: list[str] = []  # for the user, not shown yet
_lost = 0  # how often kernels could not be kept
_noted: set[str] = set()  # the beginnings of all notes so far, up to the colon: a process shows one of each kind


def note(text: str) -> None:
    """Leaves a note for the next picture, unless this process had a note with the same text before the colon."""
    kind = text.partition(":")[0]
    if kind not in _noted:
        _noted.add(kind)
        _notes.append(text)


def take_notes() -> list[str]:
    """Returns the notes that no picture has shown yet, and forgets them."""
    notes = list(_notes)
    del _notes[: len(notes)]
    return notes


def times_lost() -> int:
    """How often this process could not keep what it had compiled. A note says so only the first time."""
    return _lost


def root() -> Path:
    """The folder of all compiled kernels: `clpeel` in POCL_CACHE_DIR, else in XDG_CACHE_HOME, else in ~/.cache."""
    given = os.environ.get("POCL_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    return Path(given or Path("~", ".cache").expanduser()) / "clpeel"


class Cache:
    """The kernels that were compiled for one device."""

    def __init__(self, device: Sequence[str]) -> None:
        """device: texts that together identify the device and its driver. The first two appear in the folder's name."""
        told = (version.VERSION, *device, _processor())
        readable = "-".join(re.sub(r"[^\w.]+", "-", text).strip("-")[:40] for text in told[:3])
        self.folder = root() / f"{readable}-{key_of(_FORMAT, *told)[:16]}"

    def _file(self, key: str) -> Path:
        return self.folder / f"{key}{_SUFFIX}"

    def read(self, key: str) -> bytes | None:
        """What was kept under the key (`key_of`), or None if there is nothing or it is damaged.

        Leaves a note if it is damaged.
        """
        try:
            with open(self._file(key), "rb", opener=open_at_once) as file:
                manifest, _, payload = file.read().partition(b"\n")
        except OSError:  # no such file or folder, or it cannot be read: `write` leaves a note then
            return None
        if manifest == _manifest(payload):
            return payload
        note(f"compiled kernels kept in '{self.folder}' were damaged; they were compiled and written anew")
        return None

    def write(self, key: str, payload: bytes) -> None:
        """Keeps the payload under the key, whole or not at all. Leaves a note if it cannot be kept."""
        try:
            file = self._file(key)
            self.folder.mkdir(parents=True, exist_ok=True)
            if file.is_dir():
                shutil.rmtree(file)
            elif not file.is_file():
                file.unlink(missing_ok=True)
            write_whole(file, _manifest(payload) + b"\n" + payload)
        except (OSError, InputError, RuntimeError) as error:
            global _lost
            _lost += 1
            reason = getattr(error, "strerror", None) or str(error)
            note(f"compiled kernels cannot be kept in '{self.folder}', so each run compiles them: {reason}")


def key_of(*texts: str) -> str:
    """A key that depends on these texts alone: SHA-256, 64 hexadecimal digits."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


def _manifest(payload: bytes) -> bytes:
    """The first line of the payload's file, without the line break."""
    return f"clpeel kernels, {len(payload)} bytes, SHA-256 {hashlib.sha256(payload).hexdigest()}".encode()


@remembered
def _processor() -> str:
    """The processor and its instruction sets, as text.

    Code that was compiled for a processor with more instructions must not run on one with fewer.
    """
    try:
        with open("/proc/cpuinfo", "rb") as file:
            lines = file.read(_PROCESSOR_BYTES).partition(b"\n\n")[0].decode("latin-1").splitlines()
    except OSError:
        import platform

        return f"{platform.machine()} {platform.processor()}"
    return "\n".join(line for line in lines if re.match(r"(model name|flags|Features|CPU part)\s*:", line))
