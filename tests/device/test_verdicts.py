"""Verdicts that are kept: on which pictures they are, and that a damaged or missing file costs no more than a test."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from clpeel.device import verdicts
from clpeel.device.verdicts import Kind, Verdict, Verdicts

A, B, C = frozenset({"a"}), frozenset({"b"}), frozenset({"c"})


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "not yet there" / "verdicts"


def read(file: Path) -> Verdicts:
    """What a new process would know."""
    found = Verdicts(file)
    for line in verdicts._lines(file):
        verdict = verdicts._verdict(line)
        if verdict is not None:
            found.add(verdict)
    return found


def verdict(parts: frozenset[str], kind: Kind = "right", reason: str = "") -> Verdict:
    return Verdict(kind, 1, parts, reason)


def test_what_is_kept_is_read(file: Path) -> None:
    kept = [verdict(A | B), verdict(C, "close", "rounds otherwise"), verdict(frozenset("xy"), "wrong", "got\t0\nfor 1")]
    known = Verdicts(file)
    for each in kept:
        known.keep(each)
    again = read(file)
    assert again.of(A) == kept[0] and again.of(A | B) == kept[0] and again.of(B | C) == kept[1]
    assert again.of(frozenset("xy")) == Verdict("wrong", 1, frozenset("xy"), "got 0 for 1")


def test_a_picture_needs_all_its_parts(file: Path) -> None:
    known = Verdicts(file)
    known.add(verdict(A))
    assert known.of(A) is not None and known.of(A | B) is None and known.of(B) is None
    known.add(verdict(B))
    assert known.of(A | B) is not None


def test_what_is_wrong_with_more_says_nothing_of_less(file: Path) -> None:
    known = Verdicts(file)
    known.add(verdict(A | B, "wrong", "clipping"))
    assert known.of(A) is None and known.of(B) is None
    assert known.of(A | B) == known.of(A | B | C) == verdict(A | B, "wrong", "clipping")


def test_the_last_verdict_counts(file: Path) -> None:
    known = Verdicts(file)
    known.keep(verdict(A, "wrong", "a bad day"))
    known.keep(verdict(A | B))
    found = read(file).of(A)
    assert found is not None and found.kind == "right"
    known.keep(verdict(A, "wrong", "again"))
    assert read(file).of(A | B) == verdict(A, "wrong", "again")


def test_what_other_sources_drew_does_not_count_any_more(file: Path) -> None:
    known = Verdicts(file)
    known.keep(verdict(frozenset({"sort: lanes 1 [aaaa]"}), "wrong", "a change that was no good"))
    known.keep(verdict(frozenset({"sort: lanes 1 [bbbb]"})))
    assert known.summary(1) == read(file).summary(1) == "right"
    known.keep(verdict(frozenset({"sort: lanes 1, lit [bbbb]"}), "wrong", "another picture"))
    known.keep(verdict(frozenset({"sort: lanes 1 [cccc]"})))
    assert known.summary(1) == read(file).summary(1) == "wrong"


def test_a_summary_is_of_its_lanes_alone(file: Path) -> None:
    known = Verdicts(file)
    assert known.summary(1) == "not yet"
    known.add(verdict(A))
    known.add(Verdict("wrong", 64, B, "reason"))
    assert (known.summary(1), known.summary(64), known.summary(16)) == ("right", "wrong", "not yet")
    known.add(verdict(C, "wrong", "reason"))
    assert known.summary(1) == "wrong"


@pytest.mark.parametrize("where", [0, 3, 17, 20, -2])
def test_a_damaged_line_is_not_used(file: Path, where: int) -> None:
    """Were it used, a changed letter could make a right one of a wrong one."""
    known = Verdicts(file)
    known.keep(verdict(A, "wrong", "reason"))
    known.keep(verdict(B))
    lines = file.read_bytes().split(b"\n")
    changed = bytearray(lines[1])
    changed[where] ^= 1
    file.write_bytes(b"\n".join([lines[0], bytes(changed), *lines[2:]]))
    again = read(file)
    assert again.of(A) is None and again.of(B) is not None


def test_lines_behind_one_that_was_cut_are_whole(file: Path) -> None:
    known = Verdicts(file)
    known.keep(verdict(A))
    os.truncate(file, file.stat().st_size - 5)
    known.keep(verdict(B))
    again = read(file)
    assert again.of(A) is None and again.of(B) is not None


def test_garbage_is_no_verdict(file: Path) -> None:
    file.parent.mkdir()
    file.write_bytes(os.urandom(4096) + b"\n\n\t\nright\t1\t\ta\n")
    assert read(file).of(A) is None


def test_a_place_that_cannot_be_written_does_no_harm(tmp_path: Path) -> None:
    folder, pipe = tmp_path / "folder", tmp_path / "pipe"
    folder.mkdir()
    os.mkfifo(pipe)
    for file in (folder, pipe, Path("/proc/nowhere/verdicts"), pipe / "within"):
        known = read(file)
        known.keep(verdict(A))
        assert known.of(A) is not None and read(file).of(A) is None


def test_processes_side_by_side_lose_nothing(file: Path) -> None:
    script = (
        "import sys\nfrom pathlib import Path\nfrom clpeel.device.verdicts import Verdict, Verdicts\n"
        "for k in range(200): Verdicts(Path(sys.argv[1])).keep(Verdict('right', 1, frozenset({sys.argv[2] + str(k)})))"
    )
    command = [sys.executable, "-P", "-c", script, str(file)]
    running = [subprocess.Popen([*command, name]) for name in ("one ", "two ", "three ")]
    assert [process.wait(60) for process in running] == [0, 0, 0]
    known = read(file)
    assert len(known.good) == 600


def test_a_long_file_is_cut_to_its_last_verdicts(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each process reads all of it, so it must not grow with every version of the kernels."""

    class Folder:
        folder = file.parent

    class Device:
        int_ptr = 1

    def known() -> Verdicts:
        monkeypatch.setattr(verdicts, "_known", {})
        return verdicts.verdicts_of(Device())  # type: ignore[arg-type]

    monkeypatch.setattr(verdicts, "cache_of", lambda device: Folder)
    monkeypatch.setattr(verdicts, "_KEPT", 3)
    monkeypatch.setattr(verdicts, "_MOST", 6)
    parts = [frozenset({f"sort: lanes 1, kind {k} [aaaa]"}) for k in range(7)]
    for count, each in enumerate(parts, 1):
        known().keep(verdict(each))
        assert len([line for line in verdicts._lines(file) if line]) == count
    first = known()
    assert all(first.of(each) for each in parts), "it has read them before it cuts the file"
    assert [known().of(each) is not None for each in parts] == [False] * 4 + [True] * 3
    known().keep(verdict(parts[0], "wrong", "a bad day"))
    found = known().of(parts[0])
    assert found is not None and found.kind == "wrong"
