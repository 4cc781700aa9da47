"""The help: what it shows of a command, and how errors are worded."""

from __future__ import annotations

import re

import pytest
from conftest import printed

from clpeel.command.everyday import EVERYDAY
from clpeel.command.main import main
from clpeel.command.parser import make_parser, parse
from clpeel.command.wording import in_words_of_the_command


def shown(capfd: pytest.CaptureFixture[str], *words: str) -> list[str]:
    assert main(words) == 0
    lines, errors = printed(capfd)
    assert not errors
    return lines


def test_help_render_is_render_help(capfd: pytest.CaptureFixture[str]) -> None:
    assert shown(capfd, "help", "render") == shown(capfd, "render", "--help") == shown(capfd, "render", "-h")
    assert shown(capfd, "help") == shown(capfd, "--help") == shown(capfd)
    assert main(["help", "rendr"]) == 2


def test_the_everyday_help_is_short_and_says_that_there_is_more(capfd: pytest.CaptureFixture[str]) -> None:
    lines = shown(capfd, "render", "--help")
    every = shown(capfd, "render", "--help-all")
    assert len(lines) <= 46 < 100 < len(every)
    hidden = next(line for line in lines if line.endswith("more options: clpeel render --help-all"))
    flags, more = (set(re.findall(r"^  (?:-\w, )?(--[\w-]+)", "\n".join(text), re.M)) for text in (lines, every))
    assert flags < more and int(hidden.split()[0]) == len(more - flags)


def test_all_that_is_everyday_is_there() -> None:
    names = {action.dest for action in make_parser().commands["render"]._actions}
    assert names >= EVERYDAY


def test_what_other_commands_have_of_their_own_is_shown(capfd: pytest.CaptureFixture[str]) -> None:
    for command, flag in (("layers", "--keep-alpha"), ("compare", "--html"), ("complexity", "--json")):
        assert any(line.strip().startswith(flag) for line in shown(capfd, command, "--help"))
    assert not any("--max-error" in line for line in shown(capfd, "layers", "--help"))


def test_what_undoes_a_switch_is_not_in_the_help(capfd: pytest.CaptureFixture[str]) -> None:
    text = "\n".join(shown(capfd, "render", "--help-all"))
    assert "--no-grid" not in text and "--no-background" in text and "--occlusion-query" not in text


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("--unlit=3", "--unlit: expected no value, got '3' (see clpeel render --help)"),
        ("--grid --no-grid", "--grid: expected once, got two that differ (see clpeel render --help)"),
        ("--passes=0", "--passes: expected a whole number of 1 or more, got '0' (see clpeel render --help)"),
        ("--passes=3", "--passes: the technique 'sort' has no such option; 'clpeel techniques' lists those of each"),
        (
            "--technique=depth-peeling --no-occlusion-query",
            "--passes: expected a number with --no-occlusion-query, as nothing else ends the passes; got none",
        ),
        (
            "--technique=multi-layer-peeling --racing-writes",
            "--racing-writes: expected --execution passes with it, got 'tiles', where no writes meet",
        ),
        (
            "--camera-view-angle=0.5235987755982988",
            "--camera-view-angle: expected degrees, got 0.5236, which is 30 deg",
        ),
        ("--technique=multi-layer-peeling --layers=1000", "--layers: expected 1..64, got 1000"),
    ],
)
def test_errors_are_in_the_words_of_the_command(
    words: str, error: str, capfd: pytest.CaptureFixture[str], squares: object, tmp_path: object
) -> None:
    assert main(["render", str(squares), *words.split(), "-o", f"{tmp_path}/out.png"]) == 2
    _, lines = printed(capfd)
    assert len(lines) == 1 and lines[0].startswith(f"clpeel: error: {error}"), lines


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("size: expected at most 9", "--resolution: expected at most 9"),
        ("layers_per_pass: expected 1..64, got 0", "--layers: expected 1..64, got 0"),
        ("racing_writes: expected execution='passes' with it", "--racing-writes: expected --execution passes with it"),
        ("a.ply: size: expected", "a.ply: --resolution: expected"),
        ("a.ply: no such file", "a.ply: no such file"),
        ("output: cannot write 'size=3.png'", "--output: cannot write 'size=3.png'"),
        ("--stats: the folder size=3 does not exist", "--stats: the folder size=3 does not exist"),
        ("nothing of ours", "nothing of ours"),
        ("", ""),
    ],
)
def test_words_of_python_and_of_the_command(said: str, shown: str) -> None:
    assert in_words_of_the_command(said, parse(["render", "a.ply", "size=3"])) == shown
