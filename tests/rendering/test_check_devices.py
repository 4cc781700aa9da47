"""Checking devices: the outcomes of tests in processes of their own, and that these are killed for good."""

from __future__ import annotations

import pickle
import time
from pathlib import Path
from typing import Any

import pytest
from twins.kinds import Crashing, Failing, Hanging

from clpeel.command import main as cli
from clpeel.device.devices import list_devices
from clpeel.rendering import check_devices as checking
from clpeel.rendering.check_devices import Checked, check_devices, kinds_to_check
from clpeel.rendering.checking import WrongPictureError
from clpeel.rendering.warm_up import Kind
from clpeel.techniques import TECHNIQUES

COUNT = Kind("layer-count", "face", "transparent", "none")


def outcomes(kinds: list[Kind], timeout: float = 60.0) -> list[tuple[str, str]]:
    found = [each for each in check_devices(list_devices()[:1], kinds, timeout) if isinstance(each, Checked)]
    assert [each.kind for each in found] == kinds
    return [(each.outcome, each.reason) for each in found]


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def like(kind: type[Kind], **options: Any) -> Kind:
    return kind("layer-count", "face", "transparent", "none", **options)


def test_every_technique_is_checked_lit_and_unlit() -> None:
    kinds = kinds_to_check()
    assert {(kind.technique, kind.lighting) for kind in kinds} == {
        (name, light) for name in TECHNIQUES for light in ("none", "kit")
    }
    assert {kind.surfaces for kind in kinds} == {"transparent", "mixed", "opaque"} and any(
        kind.layers for kind in kinds
    )
    assert len(set(kinds)) == len(kinds)


def test_what_is_right_is_said_to_be() -> None:
    assert outcomes([COUNT]) == [("right", "")]


def test_a_process_that_ends_is_an_outcome_and_another_goes_on() -> None:
    crashed, right = outcomes([like(Crashing), COUNT])
    assert crashed == ("ended the process", "by signal 9") and right == ("right", "")


def test_other_failures_are_outcomes() -> None:
    assert outcomes([like(Failing), like(Failing, floats=True), COUNT]) == [
        ("not compiled", "clBuildProgram failed"),
        ("wrong", "a short reason"),
        ("right", ""),
    ]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to see processes")
def test_what_takes_too_long_is_killed_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TEST_PIDS", str(tmp_path / "pids"))
    monkeypatch.setattr(checking, "PATIENCE", 1)
    begun = time.monotonic()
    assert outcomes([like(Hanging), COUNT], timeout=5) == [
        ("took too long", "more than 5 s"),
        ("not tried", "1 in a row took too long"),
    ]
    assert time.monotonic() - begun < 30
    pids = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    deadline = time.monotonic() + 5
    while any(map(is_running, pids)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, pids))


def test_one_that_is_not_wanted_any_more_is_killed_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As after Ctrl-C."""
    monkeypatch.setenv("TEST_PIDS", str(tmp_path / "pids"))
    found = check_devices(list_devices()[:1], [COUNT, like(Hanging)])
    assert next(found) and next(found) and next(found)
    found.close()
    assert not (tmp_path / "pids").exists()


def test_a_wrong_picture_may_be_raised_in_another_process() -> None:
    error = pickle.loads(pickle.dumps(WrongPictureError("message", "reason")))
    assert (str(error), error.reason) == ("message", "reason")


# --- the command ------------------------------------------------------------------------------------------------------


def test_the_command_prints_a_table(capfd: Any) -> None:
    assert cli.main(["devices", "--check", "--techniques", "layer-count", "--device", "0"]) == 0
    heading, *rows = capfd.readouterr().out.splitlines()
    assert heading.split() == ["device", "name", "kernels", "self-test"]
    assert len(rows) == len(kinds_to_check(["layer-count"])) and all(row.endswith(" right") for row in rows)


@pytest.mark.parametrize("outcome", ["wrong", "not compiled", "took too long"])
def test_it_fails_if_the_default_is_not_right(outcome: Any, capfd: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def check(devices: Any, kinds: Any, timeout: float) -> Any:
        assert timeout == 7.5
        yield devices[0], kinds[0]
        yield Checked(devices[0], kinds[0], outcome, "a reason")

    monkeypatch.setattr(checking, "check_devices", check)
    assert cli.main(["devices", "--check", "--timeout", "7.5"]) == 1
    out, err = capfd.readouterr()
    assert out.splitlines()[-1].endswith(": a reason") and err.startswith("clpeel: 1 of ") and err.count("\n") == 1


def test_a_technique_that_is_none_is_refused(capfd: Any) -> None:
    assert cli.main(["devices", "--check", "--techniques", "sort,sorted"]) == 2
    assert capfd.readouterr().err.startswith("clpeel: error: --techniques: expected one of ")
