"""The workshop: a temporary folder of this process alone, in which PoCL compiles.

PoCL stores what it compiles in files, and it trusts the files that it finds. A file that was cut crashes the process
when its code runs. So PoCL gets an empty folder. The cache (cache.py) knows which files are whole: only these are put
into the folder, program by program. New files are taken from there to the cache.
"""

from __future__ import annotations

import atexit
import io
import os
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from threading import Lock

from clpeel.errors import DeviceError
from clpeel.files import held_folder

ROOM = 64 << 20
"""Bytes that must be free. The largest program takes less than 1 MiB, but a compiler without space ends the process."""

_PROGRAM, _KERNELS = "program.bc", ".so"
"""The files of a program's folder that are kept: the program, and its kernels as compiled for sizes of work-groups."""

_starting = Lock()


@contextmanager
def drivers_start() -> Iterator[None]:
    """Wraps a request for the drivers' devices: at the first one PoCL reads from the environment where to compile.

    Afterwards the environment is as before, because child processes must have workshops of their own.
    """
    with _starting:
        before = os.environ.get("POCL_CACHE_DIR")
        os.environ["POCL_CACHE_DIR"] = str(folder())
        try:
            yield
        finally:
            if before is None:
                del os.environ["POCL_CACHE_DIR"]
            else:
                os.environ["POCL_CACHE_DIR"] = before


@cache
def folder() -> Path:
    """The workshop's folder. It is removed when the process ends. Raises DeviceError if no place has room for it.

    It is in memory (/dev/shm) if possible, unless TMPDIR names a place: writing such short-lived files to a disk would
    be wasteful.
    """
    tried = dict.fromkeys((os.environ.get("TMPDIR", "/dev/shm"), *_temporary(), "/var/tmp", os.path.expanduser("~")))
    for place in tried:
        if _has_room(place):
            try:
                made = held_folder(place)
            except OSError:
                continue
            at_exit(partial(shutil.rmtree, made, ignore_errors=True))
            return Path(made)
    raise DeviceError(
        f"compiling kernels: expected a folder with {ROOM >> 20} MiB free, found none of {', '.join(tried)}; "
        "make room, or name another in TMPDIR"
    )


def _temporary() -> list[str]:
    """The system's folder for temporary files; an empty list if Python finds none that it can write to."""
    try:
        return [tempfile.gettempdir()]
    except FileNotFoundError:
        return []


def at_exit(do: Callable[[], object]) -> None:
    """Calls `do` when this process ends, but not when a process ends that was forked from it."""
    process = os.getpid()

    def do_at_exit() -> None:
        if os.getpid() == process:
            do()

    atexit.register(do_at_exit)


def _has_room(place: str) -> bool:
    """Whether code can be compiled at this place, and run from there."""
    try:
        there = os.statvfs(place)
    except (OSError, AttributeError):
        return os.path.isdir(place) and not hasattr(os, "statvfs")
    runs = not there.f_flag & getattr(os, "ST_NOEXEC", 0)
    return runs and there.f_bavail * there.f_frsize >= ROOM and os.access(place, os.W_OK | os.X_OK)


def check_room() -> None:
    """Raises DeviceError if the workshop's disk has become full: the compiler would end the process."""
    if not _has_room(str(folder())):
        raise DeviceError(f"compiling kernels: expected '{folder()}' with {ROOM >> 20} MiB free, got less; make room")


def programs() -> frozenset[str]:
    """The folders of all programs in the workshop, as paths relative to it."""
    return frozenset(
        f"{outer.name}/{inner.name}"
        for outer in os.scandir(folder())
        if outer.is_dir(follow_symlinks=False)
        for inner in os.scandir(outer.path)
    )


def files_of(program: str) -> frozenset[str]:
    """The files of a program that are kept, as paths relative to the workshop. program: its folder (programs)."""
    top = str(folder())
    return frozenset(
        os.path.relpath(os.path.join(at, name), top)
        for at, _, names in os.walk(os.path.join(top, program))
        for name in names
        if name == _PROGRAM or name.endswith(_KERNELS)
    )


def packed(files: frozenset[str]) -> bytes:
    """Packs files of the workshop into one archive. The order is fixed, so the same files give the same bytes."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), (folder() / name).read_bytes())
    return data.getvalue()


def unpack(data: bytes) -> frozenset[str]:
    """Puts packed files back to their places in the workshop, and returns their names.

    Files that exist already are not overwritten, as their code may be running.
    """
    top = str(folder())
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = archive.namelist()
        for name in names:
            path = os.path.join(top, name)
            if not os.path.exists(path):
                os.makedirs(os.path.dirname(path), exist_ok=True)
                with open(path, "wb") as file:
                    file.write(archive.read(name))
    return frozenset(names)
