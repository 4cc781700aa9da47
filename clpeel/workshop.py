"""The workshop: a folder of this process's own that PoCL compiles in, taken apart and put together by program.

PoCL keeps what it compiles in files, and trusts those that it finds: one that was cut crashes the process when its
code runs. So it gets an empty folder. What earlier processes compiled is put there program by program, once it is known
to be whole (cache.py), and what is new is taken from there to be kept.
"""

from __future__ import annotations

import atexit
import io
import os
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from threading import Lock

from clpeel.errors import DeviceError
from clpeel.files import held_folder

ROOM = 64 << 20
"""Bytes that must be free: the largest program takes less than 1 MiB, and a compiler that runs out of space aborts."""

_KEPT = ("program.bc", "*/*/*.so")
"""Of a program's folder: the program, and the kernels as compiled for sizes of work-groups."""

_starting = Lock()


@contextmanager
def drivers_start() -> Iterator[None]:
    """While the drivers are asked for their devices: PoCL then learns where it may compile.

    The environment is afterwards what it was, as processes that this one starts have workshops of their own.
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
    """The workshop's folder, which goes when the process ends. Raises DeviceError where there is room for none."""
    places = ["/var/tmp", "/dev/shm", os.path.expanduser("~")]
    with suppress(FileNotFoundError):  # where nothing can be written
        places.insert(0, tempfile.gettempdir())
    tried = dict.fromkeys(places)
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


def at_exit(do: Callable[[], object]) -> None:
    """Does it when this process ends, but not when one does that was forked from it."""
    process = os.getpid()

    def do_at_exit() -> None:
        if os.getpid() == process:
            do()

    atexit.register(do_at_exit)


def _has_room(place: str) -> bool:
    """Whether code can be compiled there, and run."""
    try:
        there = os.statvfs(place)
    except (OSError, AttributeError):
        return os.path.isdir(place) and not hasattr(os, "statvfs")
    runs = not there.f_flag & getattr(os, "ST_NOEXEC", 0)
    return runs and there.f_bavail * there.f_frsize >= ROOM and os.access(place, os.W_OK | os.X_OK)


def check_room() -> None:
    """Raises DeviceError where the workshop's disk has become full: the compiler would end the process."""
    if not _has_room(str(folder())):
        raise DeviceError(f"compiling kernels: expected '{folder()}' with {ROOM >> 20} MiB free, got less; make room")


def programs() -> frozenset[str]:
    """The folders of all programs in the workshop, by their names within it."""
    return frozenset(
        f"{outer.name}/{inner.name}"
        for outer in os.scandir(folder())
        if outer.is_dir(follow_symlinks=False)
        for inner in os.scandir(outer.path)
    )


def files_of(program: str) -> frozenset[str]:
    """The files that make up a program, by their names within the workshop."""
    top = folder()
    return frozenset(str(file.relative_to(top)) for kept in _KEPT for file in (top / program).glob(kept))


def packed(files: frozenset[str]) -> bytes:
    """Files of the workshop as one, in an order of their own: the same files give the same bytes."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), (folder() / name).read_bytes())
    return data.getvalue()


def unpack(data: bytes) -> None:
    """Puts packed files back where they were; those that are there stay, as their code may be running."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for name in archive.namelist():
            path = folder() / name
            if not path.exists():
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(archive.read(name))
