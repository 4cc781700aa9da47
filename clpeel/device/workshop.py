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
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from threading import Lock

from clpeel.errors import DeviceError
from clpeel.files import held_folder

ROOM = 64 << 20
"""Bytes that must be free: the largest program takes less than 1 MiB, and a compiler that runs out of space aborts."""

_PROGRAM, _KERNELS = "program.bc", ".so"
"""What is kept of a program's folder: the program, and its kernels as compiled for sizes of work-groups."""

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
    """The workshop's folder, which goes when the process ends. Raises DeviceError where there is room for none.

    In memory, unless TMPDIR says where: files that live so shortly cost a disk more than they are worth.
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
    """The system's folder for what is temporary; none where nothing can be written anywhere."""
    try:
        return [tempfile.gettempdir()]
    except FileNotFoundError:
        return []


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
    top = str(folder())
    return frozenset(
        os.path.relpath(os.path.join(at, name), top)
        for at, _, names in os.walk(os.path.join(top, program))
        for name in names
        if name == _PROGRAM or name.endswith(_KERNELS)
    )


def packed(files: frozenset[str]) -> bytes:
    """Files of the workshop as one, in an order of their own: the same files give the same bytes."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), (folder() / name).read_bytes())
    return data.getvalue()


def unpack(data: bytes) -> frozenset[str]:
    """Puts packed files back where they were, and returns their names; those that are there stay, as code may run."""
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
