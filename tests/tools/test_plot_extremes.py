"""What tools/plot_extremes.py measures keeps to the bounds that it draws; its command, tables and plots."""

from __future__ import annotations

import math
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import plot_extremes as tool
import pytest
from extremes import measure
from extremes.measure import AS_GIVEN, DETAIL, PEER, ROUNDED, UNIT
from twins import soups

from clpeel.device.layout import DEPTH_FORMATS, FLOAT32_REVERSED
from clpeel.techniques import TECHNIQUES

pytestmark = pytest.mark.usefixtures("shared_devices")

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "extremes.md"


def quiet(text: str) -> None:
    """No progress."""


@pytest.mark.parametrize("alpha", [0.01, None])
def test_errors_against_layers_keep_to_their_bounds(alpha: float | None) -> None:
    found = measure.against_layers([1, 16, 300], alpha, quiet, seeds=2)
    assert list(found) == [
        f"{name}, {precision}" for name in measure.blending() for precision in measure.own_precisions(name)
    ]
    for name, points in found.items():
        technique, _, precision = name.rpartition(", ")
        for count, error in points.items():
            if precision == "float32":
                assert error <= measure.float32_bound(count), (name, count)
            elif technique == "weighted-sum":
                assert error <= measure.half_bound(count + 1), (name, count)
            elif precision == "unorm8" and alpha:
                assert error <= measure.over_bound(alpha) + 0.5 / 255, (name, count)
        if precision != "float32" and technique != "glowscript" and alpha:
            assert points[300] > 30 * measure.float32_bound(300)


def test_errors_against_alpha_keep_to_their_bounds() -> None:
    count = 300
    found = measure.against_alpha([0.02, 0.5], count, quiet)
    for name, points in found.items():
        for alpha, error in points.items():
            if name.endswith("float32"):
                assert error <= measure.float32_bound(count)
            elif name.endswith("unorm8"):
                assert error <= measure.over_bound(alpha) + 0.5 / 255
    sticks = found["depth-peeling, unorm8"]
    assert sticks[0.02] == pytest.approx(25 / 255, abs=1.1 / 255)


def test_own_truth_is_each_techniques_equation() -> None:
    colors = np.array([[1, 0, 0.5, 0.5], [0, 1, 0.5, 0.25]])
    assert measure.own_truth("sort", colors) == pytest.approx([0.5, 0.125, 0.3125, 0.625])
    assert measure.own_truth("weighted-sum", colors) == pytest.approx([0.5, 0.25, 0.375, 0.75])
    cover = 1 - (1 - 0.375) ** 2
    assert measure.own_truth("weighted-average", colors) == pytest.approx([cover * 2 / 3, cover / 3, cover / 2, cover])
    many = np.tile([1, 1, 1, 0.5], (9, 1))
    assert measure.own_truth("glowscript", many)[3] == 1 - 0.5**4


def test_sums_stick_where_they_are_known_to() -> None:
    found = measure.sums_of([1.0, 0.5, 0.1], [100, 4000], quiet)
    assert found["1"] == {100: 100, 4000: 2048}
    assert found["0.5"] == {100: 50, 4000: 1024}
    assert found["0.1"][4000] == 256


def test_depth_formats_tell_apart_what_they_can() -> None:
    ratios = [10.0, 1e4]
    found = measure.against_range(ratios, quiet, steps=12)
    assert list(found) == list(DEPTH_FORMATS)
    for name, points in found.items():
        for ratio, least in points.items():
            distance = measure.SHARE * measure.NEAR * ratio
            if name == DEPTH_FORMATS[FLOAT32_REVERSED]:
                assert 0.4 < least / measure.reversed_resolution() < 2
            else:
                assert 0.6 < least / measure.window_resolution(distance, measure.NEAR) < 1.6
    assert math.isinf(measure.least_separation(1e7, DEPTH_FORMATS[-1], steps=1))
    assert measure.tells_apart(2.0**-20, 1e7, DEPTH_FORMATS[FLOAT32_REVERSED])


def test_edges_stay_where_float64_has_them() -> None:
    size = 128
    least = measure.edges_moved(0.0, size)[1]
    assert measure.edges_moved(0.0, size)[0] == 0
    for distance in (1.0, 1e4, 1e8):
        float64s = distance * 2.0**-53 / DETAIL
        moved = measure.edges_moved(distance, size)[0]
        assert moved <= 4 * float64s + (0 if float64s < 1e-7 else 4 * least)
    found = measure.against_distance([10.0, 1e5], quiet, size=size)
    assert found[AS_GIVEN] == {10.0: 0, 1e5: 0}
    assert 0 < found[ROUNDED][10.0] <= 10 * UNIT / DETAIL < found[ROUNDED][1e5]


@pytest.mark.skipif(soups.bench("grass") is None, reason="needs bench/scenes.py below CLPEEL_SHARED")
def test_pictures_of_8_bits() -> None:
    found, missing = measure.in_8_bits(quiet, size=200)
    assert bool(missing) == (PEER not in found)
    for name, figures in found.items():
        if name.endswith("float32"):
            assert figures["values alike"] >= 0.9999 and figures["> 1"] == 0
        else:
            assert figures["> 2, of covered pixels"] > 0.15 and figures["rms"] > 0.8
    ours, alone = found["dual-depth-peeling, unorm8"], found["depth-peeling, unorm8"]
    assert ours["rms"] < alone["rms"]
    if not missing:  # the same buffers, and thus as far off
        assert ours["rms"] == pytest.approx(found[PEER]["rms"], abs=0.1)
        assert ours["> 2"] == pytest.approx(found[PEER]["> 2"], abs=0.02)


def test_without_a_bench_it_says_what_is_missing(tmp_path: Path) -> None:
    found, missing = measure.in_8_bits(quiet, tmp_path)
    assert not found and "no scenes.py" in missing
    assert "no vtk_peer.py" in measure.peers_picture(tmp_path, "grass", 8)


# --- the command ------------------------------------------------------------------------------------------------------


def test_tables_and_plots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = tmp_path / "page.md"
    document.write_text("# Title\n\n<!-- bench: begin -->\n\nold\n\n<!-- bench: end -->\n\nbelow\n")
    drawn = find_spec("matplotlib") is not None
    output = ["--output", str(tmp_path / "plots")] if drawn else []
    names = ["layers", "sums", "depth", "origin"]
    assert tool.main(["--quick", "--only", ",".join(names), "--report", str(document), *output]) == 0
    printed = capsys.readouterr()
    text = document.read_text()
    assert printed.out.strip() in text and "\nold\n" not in text and text.endswith("\nbelow\n")
    for name in TECHNIQUES:
        assert (f"\n| {name}, float32 |" in text) == (name in measure.blending())
    assert "| 1 | 2,048 | 4,096 |" in text and "layers: sort, float32" in printed.err
    for row in re.findall(r"^\|.*\|$", text, re.MULTILINE):
        assert "nan" not in row
    if drawn:
        for name in names:
            data = (tmp_path / "plots" / f"{name}.png").read_bytes()
            assert data.startswith(b"\x89PNG") and len(data) < 150_000


def test_series_that_agree_are_one_line() -> None:
    plots = pytest.importorskip("extremes.plots")
    found = {"a, half": {1: 2.0, 2: 3.0}, "b, half": {1: 2.0}, "c, half": {1: 9.0}, "d, unorm8": {1: 2.0}}
    assert plots.together(found) == [
        (["a", "b"], "half", {1: 2.0, 2: 3.0}),
        (["c"], "half", {1: 9.0}),
        (["d"], "unorm8", {1: 2.0}),
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "layers,none"], "--only: expected some of layers, alpha, sums, depth, origin, steps; got 'none'"),
        (["--report", "/no/such/page.md"], "--report: '/no/such/page.md': No such file or directory"),
        (["--nonsense"], "unrecognized arguments: --nonsense"),
    ],
)
def test_bad_input(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        tool.main(arguments)
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"plot_extremes: error: {message}\n"


def test_without_matplotlib(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(SystemExit) as ended:
        tool.main(["--output", str(tmp_path)])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said == "plot_extremes: error: --output: matplotlib is not installed (pip install '.[bench]')\n"


def test_the_page_has_the_tools_tables() -> None:
    """Every figure's table and every technique's row is there, as the tool writes them."""
    text = DOCUMENT.read_text()
    measured: dict[str, Any] = {}
    for line in text.splitlines():
        if line.startswith("| ") and ", float32 |" in line:
            name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            measured.setdefault(name, []).append(cells)
    for name in measure.blending():
        assert len(measured[f"{name}, float32"]) >= 3, name
