"""Files that are written: where they may be, and whole or not at all, whatever ends the process meanwhile.

Imports nothing heavy: the command checks its outputs before anything else.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from clpeel.errors import InputError

_PART = re.compile(r"\.clpeel-[0-9a-f]{16}\.part")
"""Names of what is not whole yet. They are short, so that whatever name a file may have, its part may too."""


# --- where they may be ------------------------------------------------------------------------------------------------


def checked_file(path: str | os.PathLike[str], name: str = "output", suffix: str = "") -> str:
    """The file to write, links resolved; refuses, before any work, one that could not be.

    name: what errors call it. suffix: the only one that the file's name may have; it may have none. What is neither a
    file nor a folder, such as a pipe, stays as it is. Raises InputError.
    """
    given, target, kind = _resolved(path, name, "a file name")
    ending = os.path.splitext(given)[1]
    if suffix and ending and ending.lower() != suffix:
        only = suffix[1:].upper()
        raise InputError(f"{name}: only {only} is written; expected a name ending in {suffix}, got '{given}'")
    if kind == stat.S_IFDIR or given.endswith(os.sep):
        raise InputError(f"{name}: expected a file, got the folder '{given}'")
    if kind not in (0, stat.S_IFREG):
        return given
    if kind and not os.access(target, os.W_OK):
        raise InputError(f"{name}: '{given}' is read-only")
    _check_place(os.path.dirname(target), name)
    return target


def checked_folder(path: str | os.PathLike[str], name: str = "output") -> str:
    """The folder to write into, there or not, links resolved; refuses, before any work, one that could not be.

    name: what errors call it. Raises InputError.
    """
    given, target, kind = _resolved(path, name, "a folder")
    if kind not in (0, stat.S_IFDIR):
        raise InputError(f"{name}: expected a folder, got the file '{given}'")
    _check_place(target if kind else os.path.dirname(target), name)
    return target


def _resolved(path: str | os.PathLike[str], name: str, wanted: str) -> tuple[str, str, int]:
    """The path as text and with its links resolved, and what kind of file is there: one of stat.S_IF..., or 0."""
    try:
        given = os.fsdecode(path)
    except TypeError:
        raise InputError(f"{name}: expected {wanted}, got {type(path).__name__}") from None
    if not given:
        raise InputError(f"{name}: expected {wanted}, got ''")
    try:
        kind = stat.S_IFMT(os.stat(given).st_mode)
    except FileNotFoundError:
        kind = 0
    except (OSError, ValueError) as error:  # a name that is too long, links in a circle, a zero byte
        raise InputError(f"{name}: cannot write '{given}': {getattr(error, 'strerror', None) or error}") from None
    return given, os.path.realpath(given), kind


def _check_place(folder: str, name: str) -> None:
    """InputError where no file can be made in the folder."""
    if not os.path.isdir(folder):
        raise InputError(f"{name}: the folder '{folder}' does not exist; create it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{name}: the folder '{folder}' is not writable")


# --- whole or not at all ----------------------------------------------------------------------------------------------


def write_whole(path: str | os.PathLike[str], data: bytes | Callable[[IO[bytes]], object], suffix: str = "") -> None:
    """Writes a file so that it is there whole or as it was; where the path is a link, what it points to.

    data: the file's bytes, or what writes them to an open file, more than once where that is needed. suffix: the only
    one that the file's name may have; it may have none. Raises InputError when the place cannot be written.
    """
    target = checked_file(path, suffix=suffix)
    with _told(path):
        if os.path.exists(target) and not os.path.isfile(target):  # a device or pipe: nothing to replace
            with open(target, "wb") as file:
                _write(file, data)
            return
        part = _new_part(os.path.dirname(target))
        try:
            _replace(target, part, data, unnamed=True)
        except OSError:  # also where the system or the file system has no files without a name
            _replace(target, part, data, unnamed=False)


def _replace(target: str, part: str, data: bytes | Callable[[IO[bytes]], object], unnamed: bool) -> None:
    """Writes the data to `part`, a neighbour of the target, and renames that over it.

    unnamed: the part gets its name only once it is whole; until then it vanishes with the process.
    """
    if unnamed:
        descriptor = os.open(os.path.dirname(part), getattr(os, "O_TMPFILE", 0) | os.O_WRONLY, 0o666)
    else:
        descriptor = _held(part, lambda: os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    held = os.dup(descriptor)
    try:
        with os.fdopen(descriptor, "wb") as file:
            _write(file, data)
        # Closed: a file system over a network tells only now that it is full. `held` still holds the lock.
        if unnamed:
            _lock(held)
            # src_dir_fd, which means nothing to an absolute path, makes Python call linkat: link follows no links.
            os.link(f"/proc/self/fd/{held}", part, src_dir_fd=held)
        if os.path.exists(target):
            os.chmod(part, os.stat(target).st_mode & 0o777)
        os.replace(part, target)
    finally:
        _remove(part)
        os.close(held)


def _write(file: IO[bytes], data: bytes | Callable[[IO[bytes]], object]) -> None:
    if callable(data):
        data(file)
    else:
        file.write(data)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], earlier: str) -> Iterator[Path]:
    """A folder to write files into, which move to the folder `path` at the end; none do where anything goes wrong.

    path is made if it is missing. earlier: a pattern of the names of files that an earlier run may have left there:
    those that are not written anew are removed, and all others left alone. Raises InputError when the place cannot be
    written.
    """
    target = checked_folder(path)
    exists = os.path.isdir(target)
    # Within the folder, or where that is to be: the same file system, so that moving is renaming.
    part = _new_part(target if exists else os.path.dirname(target))
    held: int | None = None
    try:
        with _told(path):
            held = _held(part, lambda: _new_folder(part))
        yield Path(part)
        with _told(path):
            if not exists:
                os.rename(part, target)
                return
            names = os.listdir(part)
            for name in names:
                os.replace(os.path.join(part, name), os.path.join(target, name))
            for name in os.listdir(target):
                old = os.path.join(target, name)
                if re.fullmatch(earlier, name) and name not in names and not os.path.isdir(old):
                    os.unlink(old)
    finally:
        _remove(part)
        if held is not None:
            os.close(held)


@contextlib.contextmanager
def _told(path: str | os.PathLike[str]) -> Iterator[None]:
    """What the system refuses becomes an InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"output: cannot write '{os.fsdecode(path)}': {error.strerror or error}") from None


# --- parts, and those that killed runs have left ----------------------------------------------------------------------


def _new_part(folder: str) -> str:
    """A name for what is not whole yet. Parts in the folder that no running process holds are removed."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            if _PART.fullmatch(name):
                _remove_left(os.path.join(folder, name))
    return os.path.join(folder, f".clpeel-{os.urandom(8).hex()}.part")


def _remove_left(part: str) -> None:
    """Removes a part, unless a running process holds it, or nobody can tell."""
    try:
        descriptor = os.open(part, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return
    try:
        if _lock(descriptor):
            _remove(part)
    finally:
        os.close(descriptor)


def _new_folder(part: str) -> int:
    """Makes a folder, and opens it."""
    os.mkdir(part)
    return os.open(part, os.O_RDONLY)


def _held(part: str, make: Callable[[], int]) -> int:
    """Makes the part and locks it, which says that it is in use; returns its descriptor."""
    while True:
        descriptor = make()
        _lock(descriptor, wait=True)
        if os.path.lexists(part):
            return descriptor
        os.close(descriptor)  # another process saw it before it was locked, and removed it


def _lock(descriptor: int, wait: bool = False) -> bool:
    """Locks a file until it is closed; whether that could be done: some systems and file systems have no locks."""
    try:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except (ImportError, OSError):
        return False
    return True


def _remove(part: str) -> None:
    """Removes a file or a folder, if it is there."""
    try:
        os.unlink(part)
    except OSError:
        shutil.rmtree(part, ignore_errors=True)


# --- reading ----------------------------------------------------------------------------------------------------------


def open_at_once(path: str, flags: int) -> int:
    """What `open` takes as its opener, to wait for nobody: a file that another names may be a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


# --- folders of this process alone ------------------------------------------------------------------------------------


def held_folder(within: str) -> str:
    """Makes a folder that no other user can enter; once this process has ended, however, `within` is swept of it."""
    part = _new_part(within)

    def make() -> int:
        os.mkdir(part, 0o700)
        return os.open(part, os.O_RDONLY)

    _held(part, make)  # its descriptor stays open as long as the process lives
    return part
