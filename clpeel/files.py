"""Output files: checks where they may be, and writes them whole or not at all, however the process ends.

This imports nothing heavy, because the command checks its outputs before anything else.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from clpeel.errors import InputError

_PART = re.compile(r"\.clpeel-[0-9a-f]{16}\.part")
"""The names of unfinished files and folders ("parts"). They are short, so that a part's name fits wherever the file's
does."""


# --- where they may be ------------------------------------------------------------------------------------------------


def checked_file(path: str | os.PathLike[str], name: str = "output") -> str:
    """Return the path of the file to write, with links resolved.

    Raises InputError, before any work, if it cannot be written.

    name: what errors call it. A path that is neither a file nor a folder, such as a pipe, is returned unchanged.
    """
    given, target, kind = _resolved(path, name, "a file name")
    if kind == stat.S_IFDIR or given.endswith(os.sep):
        raise InputError(f"{name}: expected a file, got the folder '{given}'")
    if kind not in (0, stat.S_IFREG):
        return given
    if kind and not os.access(target, os.W_OK):
        raise InputError(f"{name}: '{given}' is read-only")
    _check_place(os.path.dirname(target), name)
    return target


def checked_folder(path: str | os.PathLike[str], name: str = "output") -> str:
    """Return the path of the folder to write into, with links resolved. The folder need not exist.

    Raises InputError, before any work, if it cannot be written. name: what errors call it.
    """
    given, target, kind = _resolved(path, name, "a folder")
    if kind not in (0, stat.S_IFDIR):
        raise InputError(f"{name}: expected a folder, got the file '{given}'")
    _check_place(target if kind else os.path.dirname(target), name)
    return target


def _resolved(path: str | os.PathLike[str], name: str, wanted: str) -> tuple[str, str, int]:
    """Return the path as text, the path with links resolved, and the kind of file there: one of stat.S_IF..., or 0.

    Raises InputError.
    """
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
    except (OSError, ValueError) as error:  # a name that is too long, a loop of links, or a zero byte
        raise InputError(f"{name}: cannot write '{given}': {getattr(error, 'strerror', None) or error}") from None
    return given, os.path.realpath(given), kind


def _check_place(folder: str, name: str) -> None:
    """Raise InputError if no file can be made in the folder."""
    if not os.path.isdir(folder):
        raise InputError(f"{name}: the folder '{folder}' does not exist; create it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{name}: the folder '{folder}' is not writable")


# --- whole or not at all ----------------------------------------------------------------------------------------------


def write_whole(path: str | os.PathLike[str], data: bytes | Callable[[IO[bytes]], object]) -> None:
    """Write a file so that afterwards it is either complete or as it was. If the path is a link, its target is written.

    data: the file's bytes, or a function that writes them to an open file. The function may be called more than once.
    Raises InputError if the place cannot be written.
    """
    target = checked_file(path)
    with told(path):
        if os.path.exists(target) and not os.path.isfile(target):  # a device or a pipe cannot be replaced
            with open(target, "wb") as file:
                _write(file, data)
            return
        part = _new_part(os.path.dirname(target))
        try:
            _replace(target, part, data, unnamed=True)
        except OSError:  # among others, if the system or the file system has no unnamed files
            _replace(target, part, data, unnamed=False)


def write_new(stem: str, suffix: str, data: bytes) -> str:
    """Write a file under the first of these names that no file has: `stem.suffix`, `stem-1.suffix`, `stem-2.suffix`...

    Returns the name. suffix: with its dot. The file is complete, or it is not there. No file that is there is changed,
    even if another process makes it meanwhile. Raises InputError if the place cannot be written.
    """
    folder = os.path.dirname(stem) or os.curdir
    _check_place(folder, "output")
    with told(stem + suffix):
        part = _new_part(folder)
        held = _held(part, lambda: os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        try:
            with os.fdopen(os.dup(held), "wb") as file:
                file.write(data)
            for number in itertools.count():
                name = f"{stem}-{number}{suffix}" if number else stem + suffix
                with contextlib.suppress(FileExistsError):
                    _name(part, name)
                    return name
        finally:
            os.close(held)
            _remove(part)
    raise AssertionError("numbers never end")


def _name(part: str, name: str) -> None:
    """Give a file a name that no file has. Raises FileExistsError if one has it."""
    try:
        os.link(part, name)
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        os.replace(part, name)


def _replace(target: str, part: str, data: bytes | Callable[[IO[bytes]], object], unnamed: bool) -> None:
    """Write the data to `part`, in the target's folder, and then rename it to the target.

    unnamed: the part gets its name only once it is complete. Until then it vanishes if the process ends.
    """
    if unnamed:
        descriptor = os.open(os.path.dirname(part), getattr(os, "O_TMPFILE", 0) | os.O_WRONLY, 0o666)
    else:
        descriptor = _held(part, lambda: os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    held = os.dup(descriptor)
    try:
        with os.fdopen(descriptor, "wb") as file:
            _write(file, data)
        # The file is closed first, because a network file system reports only then that it is full. `held` keeps the
        # lock.
        if unnamed:
            _lock(held)
            # An absolute path ignores src_dir_fd, but it makes Python call linkat, which follows links. Plain link does
            # not.
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
    """Give a folder to write files into.

    At the end they move to the folder `path`. If anything fails, none of them move.

    path is created if it is missing. earlier: a pattern of the names of files that an earlier run may have left there.
    Those that are not written again are removed, and all other files are left alone. Raises InputError if the place
    cannot be written.
    """
    target = checked_folder(path)
    exists = os.path.isdir(target)
    # The part is inside the folder, or next to it if it does not exist: on the same file system, moving is renaming.
    part = _new_part(target if exists else os.path.dirname(target))
    held: int | None = None
    try:
        with told(path):
            held = _held(part, lambda: _new_folder(part))
        yield Path(part)
        with told(path):
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
def told(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn the system's errors into InputErrors."""
    try:
        yield
    except OSError as error:
        raise InputError(f"output: cannot write '{os.fsdecode(path)}': {error.strerror or error}") from None


# --- parts, and how parts of killed runs are removed ------------------------------------------------------------------


def _new_part(folder: str) -> str:
    """Return a name for a new part in the folder. Parts there that no running process has locked are removed."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            if _PART.fullmatch(name):
                _remove_left(os.path.join(folder, name))
    return os.path.join(folder, f".clpeel-{os.urandom(8).hex()}.part")


def _remove_left(part: str) -> None:
    """Remove a part, unless a running process has locked it, or locks do not work."""
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
    """Make a folder and open it. Returns the descriptor."""
    os.mkdir(part)
    return os.open(part, os.O_RDONLY)


def _held(part: str, make: Callable[[], int]) -> int:
    """Make a part and lock it, which shows other processes that it is in use. Returns its descriptor."""
    while True:
        descriptor = make()
        _lock(descriptor, wait=True)
        if os.path.lexists(part):
            return descriptor
        os.close(descriptor)  # another process found it before it was locked, and removed it


def _lock(descriptor: int, wait: bool = False) -> bool:
    """Lock a file until it is closed. Returns whether that worked, as some systems and file systems have no locks."""
    try:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except (ImportError, OSError):
        return False
    return True


@contextlib.contextmanager
def locked(folder: str) -> Iterator[bool]:
    """Lock a folder, and say whether no other process has locked it. Where there are no locks, nobody has."""
    try:
        import fcntl
    except ImportError:
        yield True
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        alone = True
    except OSError as error:
        alone = error.errno not in (errno.EAGAIN, errno.EACCES)
    try:
        yield alone
    finally:
        os.close(descriptor)


def _remove(part: str) -> None:
    """Remove a file or a folder, if it exists."""
    try:
        os.unlink(part)
    except OSError:
        shutil.rmtree(part, ignore_errors=True)


# --- reading ----------------------------------------------------------------------------------------------------------


def open_at_once(path: str, flags: int) -> int:
    """An opener for `open` that never blocks. A file that another file names may be a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


# --- folders of this process alone ------------------------------------------------------------------------------------


def held_folder(within: str) -> str:
    """Make a folder in `within` that no other user can enter, and return its path.

    It is locked while this process runs. However the process ends, the next call for `within` then removes the folder.
    """
    part = _new_part(within)

    def make() -> int:
        os.mkdir(part, 0o700)
        return os.open(part, os.O_RDONLY)

    _held(part, make)  # its descriptor stays open as long as the process lives
    return part
