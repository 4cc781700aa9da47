"""Files that are written: where they may be; whole or not at all, whatever goes wrong, and nothing else left."""

from __future__ import annotations

import contextlib
import fcntl
import io
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clpeel
from clpeel import files
from clpeel.files import checked_file, checked_folder, whole_folder, write_new, write_whole

LONGEST = 255  # bytes of a name, on any file system that is common
WRITERS = {"unnamed": True, "named": False}


@pytest.fixture(params=WRITERS, autouse=True)
def writer(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """With files that have no name until they are whole, and as on systems that have no such files."""
    if request.param == "named":
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    return str(request.param)


@contextlib.contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Writing more than that into a file fails, as on a full disk.

    The signal that comes with it is ignored, as Python does. A driver's compiler may have put a handler of its own
    there, which brings back older handlers of all signals: SIGTERM might then end no process any more.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def killed(code: str, folder: Path, how: int = signal.SIGKILL) -> None:
    """Runs that code, which kills itself, in the folder."""
    text = f"import os; from clpeel.files import *; end = lambda *_: os.kill(os.getpid(), {int(how)}); {code}"
    done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, check=False)
    assert done.returncode == -how, done.stderr


# --- whole or not at all ----------------------------------------------------------------------------------------------


def test_a_file_is_there_and_nothing_else(tmp_path: Path) -> None:
    for data in (b"1", b"22"):
        write_whole(tmp_path / "a", data)
        assert (tmp_path / "a").read_bytes() == data and os.listdir(tmp_path) == ["a"]
    write_whole(os.fsencode(tmp_path / "b"), lambda file: file.write(b"3"))
    assert (tmp_path / "b").read_bytes() == b"3"


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a.png"
    target.write_bytes(b"old")

    def broken(*arguments: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(clpeel.InputError, match=r"output: cannot write .*a\.png.*No space left"):
        write_whole(target, b"new")
    assert target.read_bytes() == b"old" and os.listdir(tmp_path) == ["a.png"]


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a"
    target.write_bytes(b"old")
    writes = (bytes(5000), lambda file: file.write(bytes(5000)), lambda file: np.savez(file, np.zeros(5000)))
    for data in writes:
        with largest_file(1000), pytest.raises(clpeel.InputError, match=r"^output: cannot write '.*a': [^\n]+$"):
            write_whole(target, data)
        assert target.read_bytes() == b"old" and os.listdir(tmp_path) == ["a"]
    with largest_file(1000), pytest.raises(clpeel.InputError), whole_folder(tmp_path / "folder", "") as folder:
        write_whole(folder / "b", bytes(5000))
    assert os.listdir(tmp_path) == ["a"]


@pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="other systems have no files without a name")
def test_nothing_is_seen_of_a_file_before_it_is_whole(tmp_path: Path, writer: str) -> None:
    seen: list[list[str]] = []
    write_whole(tmp_path / "a", lambda file: seen.append(os.listdir(tmp_path)))
    assert [len(names) for names in seen] == [0 if writer == "unnamed" else 1]


def test_the_mode_is_that_of_any_new_file_or_the_old_one(tmp_path: Path) -> None:
    write_whole(tmp_path / "a", b"1")
    (tmp_path / "b").write_bytes(b"1")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode
    (tmp_path / "a").chmod(0o640)
    write_whole(tmp_path / "a", b"2")
    assert (tmp_path / "a").stat().st_mode & 0o7777 == 0o640


def test_a_special_file_is_written_through() -> None:
    write_whole(os.devnull, b"1")
    assert not os.path.isfile(os.devnull)


def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.png").symlink_to("folder/real")
    for data in (b"1", b"2"):
        write_whole(tmp_path / "link.png", data)
        assert (tmp_path / "link.png").is_symlink() and (tmp_path / "folder" / "real").read_bytes() == data
    assert os.listdir(tmp_path / "folder") == ["real"]


@pytest.mark.parametrize("length", [244, 245, LONGEST])
def test_any_name_that_a_file_may_have(tmp_path: Path, length: int) -> None:
    write_whole(tmp_path / ("x" * length), b"1")
    with whole_folder(tmp_path / ("y" * length), "") as folder:
        write_whole(folder / ("z" * length), b"2")
    assert sorted(os.listdir(tmp_path)) == ["x" * length, "y" * length]


# --- under a new name -------------------------------------------------------------------------------------------------


@pytest.fixture(params=["links", "no links"])
def links(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """With and without links, which some file systems lack."""

    def refuse(source: object, target: str, **options: Any) -> None:
        raise PermissionError("no links here")

    if request.param == "no links":
        monkeypatch.setattr(os, "link", refuse)


@pytest.mark.usefixtures("links")
def test_a_new_file_gets_the_first_name_that_is_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a-1.png").write_bytes(b"old")
    Path("a-3.png").symlink_to("nowhere")
    assert [write_new("a", ".png", data) for data in (b"0", b"2", b"4")] == ["a.png", "a-2.png", "a-4.png"]
    assert {name: Path(name).read_bytes() for name in ("a.png", "a-1.png", "a-2.png", "a-4.png")} == {
        "a.png": b"0",
        "a-1.png": b"old",
        "a-2.png": b"2",
        "a-4.png": b"4",
    }
    assert sorted(os.listdir()) == ["a-1.png", "a-2.png", "a-3.png", "a-4.png", "a.png"]
    assert write_new(str(tmp_path / "b"), "", b"") == str(tmp_path / "b")


@pytest.mark.usefixtures("links")
def test_many_at_once_get_names_of_their_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        names = list(pool.map(lambda number: write_new(str(tmp_path / "a"), ".png", b"%d" % number), range(40)))
    assert len(set(names)) == 40 == len(os.listdir(tmp_path))
    assert [Path(name).read_bytes() for name in names] == [b"%d" % number for number in range(40)]


@pytest.mark.usefixtures("links")
def test_a_full_disk_leaves_no_new_file(tmp_path: Path) -> None:
    with largest_file(1000), pytest.raises(clpeel.InputError, match="^output: cannot write '.*a.png': File too large"):
        write_new(str(tmp_path / "a"), ".png", bytes(2000))
    assert os.listdir(tmp_path) == []


def test_a_new_file_needs_its_folder(tmp_path: Path) -> None:
    with pytest.raises(clpeel.InputError, match="^output: the folder '.*missing' does not exist"):
        write_new(str(tmp_path / "missing" / "a"), ".png", b"")


# --- what killed runs leave -------------------------------------------------------------------------------------------


def test_a_killed_run_leaves_nothing_for_long(tmp_path: Path, writer: str) -> None:
    killed(f"{'' if writer == 'unnamed' else 'del os.O_TMPFILE; '}write_whole('a', end)", tmp_path)
    assert len(os.listdir(tmp_path)) == (0 if writer == "unnamed" else 1)
    write_whole(tmp_path / "b", b"1")
    assert os.listdir(tmp_path) == ["b"]


def test_a_killed_run_leaves_no_folder_for_long(tmp_path: Path) -> None:
    killed("folder = whole_folder('a', ''); path = folder.__enter__(); (path / 'x').write_text('x'); end()", tmp_path)
    (left,) = os.listdir(tmp_path)
    assert os.listdir(tmp_path / left) == ["x"]
    with whole_folder(tmp_path / "a", "") as folder:
        assert os.listdir(tmp_path) == [folder.name]
    assert os.listdir(tmp_path) == ["a"]


def test_what_a_running_process_writes_is_left_alone(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "folder", "") as folder:
        (folder / "x").write_text("x")
        write_whole(tmp_path / "a", lambda file: write_whole(tmp_path / "b", b"b"))
        write_whole(tmp_path / "c", b"c")
        assert os.listdir(folder) == ["x"]
    assert sorted(os.listdir(tmp_path)) == ["a", "b", "c", "folder"]


def test_other_hidden_files_are_left_alone(tmp_path: Path) -> None:
    names = [".clpeel-1.part", ".clpeel-0123456789abcdef.part.txt", ".a.part", "clpeel-0123456789abcdef.part"]
    for name in names:
        (tmp_path / name).write_text("mine")
    (tmp_path / ".clpeel-0123456789abcdef.part").symlink_to(names[0])
    os.mkfifo(tmp_path / ".clpeel-fedcba9876543210.part")
    write_whole(tmp_path / "a", b"1")
    assert set(names) <= set(os.listdir(tmp_path))


def test_a_part_that_is_swept_before_it_is_locked_is_made_anew(tmp_path: Path, monkeypatch: Any) -> None:
    locks: list[int] = []
    lock = fcntl.flock

    def flock(descriptor: int, how: int) -> None:
        if not locks:
            for name in os.listdir(tmp_path):
                files._remove(str(tmp_path / name))
        locks.append(descriptor)
        lock(descriptor, how)

    monkeypatch.setattr(fcntl, "flock", flock)
    with whole_folder(tmp_path / "folder", "") as folder:
        assert folder.is_dir()
    locks.clear()
    write_whole(tmp_path / "a", b"1")
    assert (tmp_path / "a").read_bytes() == b"1"


# --- where they may be ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("missing/a", "the folder '.*missing' does not exist; create it first"),
        (".", "expected a file, got the folder"),
        ("new/", "expected a file, got the folder"),
        ("", "expected a file name, got ''"),
        ("circle", "cannot write '.*circle': Too many levels of symbolic links"),
        ("circle/a", "cannot write '.*circle/a': Too many levels of symbolic links"),
        ("x" * (LONGEST + 1), "cannot write 'x+': File name too long"),
        ("long", "cannot write 'long': File name too long"),
        ("file/a", "cannot write 'file/a': Not a directory"),
        ("a\0b", "cannot write"),
        (3, "expected a file name, got int"),
        (io.BytesIO(), "expected a file name, got BytesIO"),
    ],
)
def test_places_that_cannot_be_written(tmp_path: Path, path: Any, message: str, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    Path("circle").symlink_to("circle")
    Path("long").symlink_to("x" * (LONGEST + 1))
    Path("file").touch()
    there = sorted(os.listdir())
    for write in (lambda: checked_file(path), lambda: write_whole(path, b"new")):
        with pytest.raises(clpeel.InputError, match=f"^output: {message}"):
            write()
    assert sorted(os.listdir()) == there and Path("circle").is_symlink()


@pytest.mark.parametrize("path", ["missing/a", "circle", "file", "x" * (LONGEST + 1), ""])
def test_folders_that_cannot_be_written(tmp_path: Path, path: str, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    Path("circle").symlink_to("circle")
    Path("file").touch()
    with pytest.raises(clpeel.InputError, match="^here: "):
        checked_folder(path, "here")
    with pytest.raises(clpeel.InputError, match="^output: "), whole_folder(path, ""):
        pytest.fail("there is such a folder")
    assert sorted(os.listdir()) == ["circle", "file"]
