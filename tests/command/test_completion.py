"""Completion: the scripts that shtab makes, in a real shell."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import printed

from clpeel.command.main import main

BASH = shutil.which("bash")


@pytest.mark.skipif(BASH is None, reason="there is no bash")
def test_bash_completes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """As it does when Tab is pressed: the function that the script registers is called with the words of the line."""
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "clpeel.sh"
    script.write_text("\n".join(printed(capfd)[0]))
    (tmp_path / "part 1.stl").touch()

    def completed(*words: str) -> set[str]:
        ask = (
            f'source "{script}"; name=$(complete -p clpeel | sed "s/.*-F \\([^ ]*\\).*/\\1/"); '
            'COMP_WORDS=(clpeel "$@"); '
            'COMP_CWORD=$#; "$name" clpeel "${COMP_WORDS[-1]}" "${COMP_WORDS[-2]}"; printf "%s\\n" "${COMPREPLY[@]}"'
        )
        command = [str(BASH), "-c", ask, "bash", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path, timeout=20)
        assert done.stderr == ""
        return set(done.stdout.splitlines())

    assert completed("re") == {"render", "report"}
    assert {"--opacity", "--technique"} <= completed("render", "--")
    assert "--no-grid" not in completed("render", "--no-") and "--no-background" in completed("render", "--no-")
    assert completed("render", "--technique", "dual") == {"dual-depth-peeling"}
    assert completed("render", "--execution", "") == {"tiles", "passes"}
    assert completed("render", "--camera-direction", "is") == {"iso"}
    assert "part 1.stl" in completed("render", "pa")
    assert completed("completion", "b") == {"bash"}


@pytest.mark.parametrize("shell", ["zsh", "tcsh", "fish"])
def test_other_shells_have_a_script(shell: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    text = "\n".join(printed(capfd)[0])
    assert "clpeel" in text and "depth-peeling" in text
    if program := shutil.which(shell):
        (tmp_path / "script").write_text(text)
        subprocess.run([program, "-n", str(tmp_path / "script")], check=True, timeout=20)


def test_what_is_missing_or_unknown_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", "powershell"]) == 2
    assert main(["completion"]) == 2
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 2
    _, (first, second, third) = printed(capfd)
    assert first.endswith("completion: expected one of bash, zsh, tcsh, fish, got 'powershell'")
    assert second.endswith("expected SHELL, got none (see clpeel completion --help)")
    assert third.endswith("completion: expected the package shtab; pip install 'clpeel[completion]'")
