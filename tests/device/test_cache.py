"""Compiled kernels that are kept: read only where they are whole, mended, and never needed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from clpeel.device import cache, workshop
from clpeel.device.cache import Cache

DEVICE = ("a platform", "a device", "1.0")


@pytest.fixture(autouse=True)
def own_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Nothing that is kept elsewhere is seen, nor notes that are left over."""
    monkeypatch.delenv("POCL_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(cache, "_noted", set())
    monkeypatch.setattr(cache, "_notes", [])


def cut(file: Path) -> None:
    os.truncate(file, file.stat().st_size // 2)


def change(file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[-1] ^= 1
    file.write_bytes(data)


def empty(file: Path) -> None:
    os.truncate(file, 0)


def lengthen(file: Path) -> None:
    file.write_bytes(file.read_bytes() + b"\0")


def replace_by_folder(file: Path) -> None:
    file.unlink()
    (file / "within").mkdir(parents=True)


def replace_by_pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


DAMAGES = (cut, change, empty, lengthen, replace_by_folder, replace_by_pipe)


def test_what_is_written_is_read() -> None:
    kept = Cache(DEVICE)
    kept.write("a", b"one\ntwo")
    kept.write("b", b"")
    assert (Cache(DEVICE).read("a"), Cache(DEVICE).read("b"), Cache(DEVICE).read("c")) == (b"one\ntwo", b"", None)
    assert cache.take_notes() == []


@pytest.mark.parametrize("other", [("another", "a device", "1.0"), ("a platform", "a device", "1.1"), DEVICE[:2]])
def test_another_device_or_driver_has_a_folder_of_its_own(other: tuple[str, ...]) -> None:
    Cache(DEVICE).write("a", b"one")
    assert Cache(other).read("a") is None


@pytest.mark.parametrize("what", ["version", "format", "processor"])
def test_another_version_or_processor_has_a_folder_of_its_own(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    Cache(DEVICE).write("a", b"one")
    if what == "version":
        monkeypatch.setattr("clpeel.version.VERSION", "0.0.0")
    elif what == "format":
        monkeypatch.setattr(cache, "_FORMAT", "0")
    else:
        monkeypatch.setattr(cache, "_processor", lambda: "flags: avx512f")
    assert Cache(DEVICE).read("a") is None


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_seen_and_mended(damage: Callable[[Path], None]) -> None:
    kept = Cache(DEVICE)
    kept.write("a", b"some kernels" * 99)
    (file,) = kept.folder.iterdir()
    damage(file)
    assert kept.read("a") is None
    kept.write("a", b"some kernels")
    assert kept.read("a") == b"some kernels"
    assert [path.name for path in kept.folder.iterdir()] == [file.name]


def test_one_note_is_enough() -> None:
    kept = Cache(DEVICE)
    for key in "abc":
        kept.write(key, b"some kernels")
        cut(kept.folder / f"{key}.kernels")
        kept.read(key)
    (note,) = cache.take_notes()
    assert note.startswith("compiled kernels kept in ") and "damaged" in note
    assert cache.take_notes() == []


def test_a_place_that_cannot_be_written_is_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", Path("/proc/nowhere")):
        monkeypatch.setenv("POCL_CACHE_DIR", str(place))
        for key in "ab":
            Cache(DEVICE).write(key, b"one")
            assert Cache(DEVICE).read(key) is None
        (note,) = cache.take_notes()
        assert note.startswith(f"compiled kernels cannot be kept in '{place}")


# --- for real, in processes of their own ------------------------------------------------------------------------------

SCRIPT = """
import numpy as np, pyopencl as cl
from clpeel.device import building
from clpeel.device import cache
from clpeel.device.devices import open_device

gpu = open_device()
with building.BUILDING:
    program = building.build(gpu.context, gpu.device, "kernel void f(global int *a) { a[0] = 7; }", [])
held = gpu.buffer("held", 64)
cl.Kernel(program, "f")(gpu.queue, (1,), (1,), held)
print(gpu.get(held, 1, np.int32)[0])
building.keep()
print(*cache.take_notes(), sep="\\n")
"""


def run(**environment: str) -> list[str]:
    """What a process prints that compiles a kernel and runs it: 7, and notes."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", SCRIPT],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("\n")


def kept_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if not path.is_dir()]


@pytest.mark.parametrize("damage", [cut, change, replace_by_pipe])
def test_a_damaged_cache_is_mended_for_the_next_process(damage: Callable[[Path], None], tmp_path: Path) -> None:
    assert run()[0] == "7"
    whole = {file: file.read_bytes() for file in kept_in(tmp_path)}
    assert whole, "nothing was kept"
    for file in whole:
        damage(file)
    first, note, *_ = run()
    assert first == "7" and "damaged" in note
    assert {file: len(file.read_bytes()) for file in kept_in(tmp_path)} == {f: len(data) for f, data in whole.items()}
    assert run()[:2] == ["7", ""]


@pytest.mark.parametrize("variable", ["POCL_CACHE_DIR", "XDG_CACHE_HOME"])
def test_a_cache_that_cannot_be_written_costs_a_note(variable: str) -> None:
    first, note, *rest = run(**{variable: "/proc/nowhere"})
    assert first == "7" and note.startswith("compiled kernels cannot be kept in '/proc/nowhere/clpeel") and rest == [""]


def test_nothing_is_compiled_again(tmp_path: Path) -> None:
    """The kernel that the first process compiled is what runs in the second: its file is neither new nor changed."""
    run()
    before = {file: file.stat().st_mtime_ns for file in kept_in(tmp_path)}
    run()
    assert {file: file.stat().st_mtime_ns for file in kept_in(tmp_path)} == before


def test_no_room_to_compile_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    assert workshop.folder().is_dir()
    monkeypatch.setattr(workshop, "ROOM", 1 << 62)
    with pytest.raises(RuntimeError, match=r"expected '.*' with \d+ MiB free, got less; make room"):
        workshop.check_room()


def test_the_environment_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    for value in (None, "/somewhere"):
        if value is not None:
            monkeypatch.setenv("POCL_CACHE_DIR", value)
        with workshop.drivers_start():
            assert os.environ["POCL_CACHE_DIR"] == str(workshop.folder())
        assert os.environ.get("POCL_CACHE_DIR") == value
