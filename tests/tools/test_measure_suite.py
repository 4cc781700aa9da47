"""The tool that writes the suite's tables: what stands in them, where they go, and bad input in one line."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import measure_suite as tool
import numpy as np
import pytest
from benchmark.report import BEGIN, END

import clpeel
from clpeel.study.comparison import Comparison, Row
from clpeel.study.standings import Chapter, SuiteComparison


def chapter(name: str, *rows: tuple[str, float, float, bool, float]) -> Chapter:
    """A scene with rows (technique, seconds, error, exact, opacity bias)."""
    made = []
    for technique, seconds, error, exact, bias in rows:
        row = Row(technique, None, None, exact, (seconds,), 1, 8, 2**20, error, error, 0, 0, 0, None, 0, 0, 0, bias)
        made.append(replace(row, psnr=-20 * math.log10(error) if error else math.inf))
    truth = np.zeros((3, 4, 4))
    return Chapter(name, f"about {name}", Comparison(made, truth, (1, 1, 1), "none", "first", 1234, 1, 2, "dev", 1))


@pytest.fixture
def figures(tmp_path: Path) -> Path:
    """A file of two scenes: sorting takes 2 and 3 times as long as not sorting."""
    suite = SuiteComparison(
        [
            chapter("one", ("sort", 0.020, 0.0, True, 0.0), ("weighted-sum", 0.010, 0.25, False, 0.125)),
            chapter("two", ("sort", 0.030, 0.0, True, 0.0), ("weighted-sum", 0.010, 0.5, False, 0.25)),
        ],
        ("left out: three",),
    )
    path = tmp_path / "suite.json"
    path.write_text(suite.to_json())
    return path


def test_the_tables_say_what_was_measured(figures: Path) -> None:
    lines = tool.tables(json.loads(figures.read_text())).splitlines()
    assert lines[0] == "2 scenes, 4 × 3, frames of each row: 1; dev. Note: left out: three."
    # The geometric mean of 1/2 and 1/3, the root mean square of 1/4 and 1/2, and their geometric mean.
    assert "| * weighted-sum | 0.41 | 4.0e-01 | 3.5e-01 | 5.0e-01 | - | +1.9e-01 | 1.0 | 2.0 |" in lines
    assert "| weighted-sum | 1/2 | 1/2 |" in lines
    assert "| weighted-sum | 2.00 | 3.00 | +0.1875 |" in lines  # against sorting
    assert lines.count("| sort | 2.00 | 3.00 |") == 1  # against unsorted
    assert "**two**: about two; 1,234 triangles, 1 fragments, at most 2 in a pixel" in lines
    assert "| * sort | 20.0 | 1 | 8 | 1.0 | 0 | 0 | ∞ | - |" in lines


def test_tables_go_between_the_markers(figures: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"above\n\n{BEGIN}\n\nold\n\n{END}\n\nbelow\n")
    assert tool.main(["--read", str(figures), "--report", str(page)]) == 0
    text = page.read_text()
    assert text.startswith(f"above\n\n{BEGIN}\n\n2 scenes") and text.endswith(f"{END}\n\nbelow\n")
    assert "old" not in text and "Exact, against unsorted" in text
    tool.main(["--read", str(figures), "--report", str(page)])
    assert page.read_text() == text


def test_it_measures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "found.json"
    arguments = "--scenes grass --techniques sort,weighted-sum --size 16 --frames 1 --json".split()
    assert tool.main([*arguments, str(path)]) == 0
    printed = capsys.readouterr().out
    assert tool.main(["--read", str(path)]) == 0
    assert capsys.readouterr().out == printed and "**grass**" in printed
    assert json.loads(path.read_text())["machine"]["cores"]


def test_ctrl_c_keeps_the_finished_scenes_and_the_document(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise clpeel.InterruptedSuite(
            SuiteComparison([chapter("one", ("sort", 0.02, 0.0, True, 0.0))], ("interrupted",))
        )

    monkeypatch.setattr(clpeel, "compare_suite", interrupted)
    page, path = tmp_path / "page.md", tmp_path / "found.json"
    page.write_text(f"{BEGIN}\n\nold\n\n{END}\n")
    assert tool.main(["--report", str(page), "--json", str(path)]) == 130
    assert "old" in page.read_text() and "**one**" in capsys.readouterr().out
    assert json.loads(path.read_text())["notes"] == ["interrupted"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--read", "nothing.json"], "--read: 'nothing.json': No such file"),
        (["--read", "other.json"], "--read: expected a file of 'clpeel compare --suite --json', got 'other.json'"),
        (["--report", "plain.md"], f"--report: 'plain.md': expected the lines {BEGIN}"),
        (["--report", "nothing.md"], "--report: 'nothing.md': No such file"),
        (["--frames", "few"], "argument --frames: invalid int value: 'few'"),
    ],
)
def test_bad_input(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("other.json").write_text('{"scenes": []}')
    Path("plain.md").write_text("nothing here")
    with pytest.raises(SystemExit) as left:
        tool.main(arguments)
    assert left.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and lines[0].startswith(f"measure_suite: error: {message}")
