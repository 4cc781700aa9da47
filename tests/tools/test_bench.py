"""The benchmark tool: its arithmetic, its tables and refusals, and a tiny run; nothing here depends on the clock."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bench as tool
import numpy as np
import plainly
import pytest
from benchmark import figures, makers, report
from benchmark.figures import FIGURES, Figure
from benchmark.runs import QUICK, SCENES, Bench, Failed, Settings, Skipped, ratio, run, spread, target
from twins.soups import Soup

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = f"# Title\n\nabove\n\n{report.BEGIN}\n\nold\n\n{report.END}\n\nbelow\n"


def made_up() -> dict[str, Any]:
    """What a run could have found."""
    return {
        "date": "2024-02-29",
        "machine": {"processor": "slide rule", "cores": 2},
        "reduced": ["pixels a side: 64 in place of 1,024"],
        "missing": {"dragon": "asleep"},
        "figures": {
            "layers": {
                "title": "Time against layers",
                "values": {"ns": {"4": spread([2.0]), "16": spread([1.0, 3.0])}, "reference": "4"},
                "targets": [
                    target("one", 2.0, "<=", 3),
                    target("two", 4.0, "<=", 3),
                    target("three", 5, ">=", 3, judged=False),
                ],
                "table": [["layers", "ns | fragment"], ["4", "2.00"], ["16", "2.00 (1.00 .. 3.00)"]],
                "notes": ["a note"],
            },
            "camera": {"title": "Camera", "skipped": "nothing to see"},
            "stages": {"title": "Stages", "failed": "broken"},
        },
    }


class Stub(SimpleNamespace):
    """Stands in for a Bench."""

    peer_reason = ""

    def full(self, *names: str) -> bool:
        return True


def rounds(ours: list[float], theirs: list[float], fragments: int = 10, triangles: int = 5) -> dict[str, Any]:
    """A scene's rounds as a Bench has them."""
    stats = {"fragments": fragments, "triangles": triangles, "layers_max": 3}
    return {"clpeel": ours, "dual": theirs, "unsorted": theirs, "stats": [stats]}


# --- arithmetic -------------------------------------------------------------------------------------------------------


def test_spread_and_ratio() -> None:
    assert spread([3.0, 1.0, 2.0]) == {"median": 2.0, "least": 1.0, "greatest": 3.0, "rounds": [3.0, 1.0, 2.0]}
    quotients = ratio([2.0, 9.0, 8.0], [1.0, 3.0, 2.0])  # round by round: not the quotient of the medians
    assert quotients["rounds"] == [2.0, 3.0, 4.0]
    assert quotients["median"] == 3.0
    assert ratio([2.0, 4.0, 6.0], [1.0])["rounds"] == [2.0]  # a peer that took part in one round only


@pytest.mark.parametrize(
    ("value", "sense", "bound", "judged", "met"),
    [
        (2.0, "<=", 2, True, True),
        (2.1, "<=", 2, True, False),
        (2.0, ">=", 2, True, True),
        (1.9, ">=", 2, True, False),
        (1.9, ">=", 2, False, None),
    ],
)
def test_target(value: float, sense: str, bound: float, judged: bool, met: bool | None) -> None:
    assert target("it", value, sense, bound, judged)["met"] is met


def test_peeling_is_the_geometric_mean() -> None:
    found = {name: rounds([1.0, 2.0], [times, 2 * times]) for name, times in zip(SCENES, (30, 40, 90, 80), strict=True)}
    mean, least = figures.peeling(Stub(scene_rounds=found))["targets"]
    assert mean["value"] == pytest.approx((30 * 40 * 90 * 80) ** 0.25)
    assert mean["met"] is True
    assert (least["value"], least["met"]) == (30, True)
    del found["dragon"]
    assert figures.peeling(Stub(scene_rounds=found))["targets"][0]["met"] is None  # not the four it speaks of


def test_unsorted_has_a_bound_for_each_scene() -> None:
    found = {name: rounds([0.8], [1.0]) for name in SCENES}
    assert [one["met"] for one in figures.unsorted(Stub(scene_rounds=found))["targets"]] == [False, False, True, True]
    with pytest.raises(Skipped, match="no vtk"):
        figures.unsorted(Stub(peer_reason="no vtk"))


def test_limit_counts_bytes() -> None:
    copied = {"bytes_per_second": 1e6, "nbytes": 2**20, "way": "kernel"}
    found = figures.limit(Stub(bandwidth=copied, scene_rounds={"boxes": rounds([0.01], [1], 1000, 100)}))
    assert found["values"]["scenes"]["boxes"]["limit_s"] == pytest.approx((16 * 1000 + 60 * 100) / 1e6)
    assert found["targets"][0]["value"] == pytest.approx(0.01 / 0.022)


def test_exactness_goes_through_the_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    from clpeel import techniques

    sort = SimpleNamespace(exact=True, least_passes=1, maps=())
    cheap = SimpleNamespace(exact=False, least_passes=1, maps=())
    monkeypatch.setattr(techniques, "TECHNIQUES", {"sort": sort})
    with pytest.raises(Skipped, match="weighted-sum"):
        figures.exactness(Stub(scenes={"boxes": ["boxes"]}))
    slow = SimpleNamespace(exact=False, least_passes=9, maps=())
    monkeypatch.setattr(techniques, "TECHNIQUES", {"sort": sort, "weighted-sum": cheap, "slow": slow})
    timed = [[{"median_s": 3.0}], [{"median_s": 2.0}]]
    stub = Stub(
        scenes={"boxes": ["boxes"]}, job=lambda *scene, **options: options, take_turns=lambda jobs, together: timed
    )
    found = figures.exactness(stub)
    assert found["targets"][0]["value"] == 1.5
    assert found["table"][0] == ["scene", "sort, s", "weighted-sum, s", "sort / weighted-sum"]


def test_a_peer_that_fails_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def peer(self: Bench, mode: str, scene: list[Any], out: str) -> float:
        if scene == ["boxes"]:
            raise Failed("no display")
        return 2.0

    (tmp_path / "scenes.py").touch()
    stats = {"triangles": 1, "fragments": 2, "layers_max": 3}
    answer = {"jobs": [{"median_s": 1.0, "stats": stats}]}
    monkeypatch.setattr(Bench, "measure", lambda self, case, **options: answer)
    monkeypatch.setattr(Bench, "_peer", peer)
    tested = Bench(Settings(rounds=3, peer_rounds=2, scenes=("boxes", "grass")), tmp_path, None, ["unsorted"])
    tested.peer_reason = ""
    assert tested.scene_rounds["grass"] == {
        "clpeel": [1.0] * 3,
        "dual": [],
        "unsorted": [2.0] * 2,
        "stats": [stats] * 3,
    }
    assert tested.missing == {"VTK unsorted, boxes": "no display"}
    assert figures.beside(tested, "unsorted").keys() == {"grass"}
    with pytest.raises(Skipped):
        figures.beside(tested, "dual")
    tested.close()


def test_textures_are_set_beside_flat_and_vertex_colours() -> None:
    asked: list[Any] = []

    def take_turns(jobs: list[Any], together: bool) -> list[Any]:
        asked.extend(jobs)
        return [[{"median_s": float(seconds)}] for seconds in (2, 4, 6, 8, 10, 12, 14)]

    scenes = {"dragon": ["d.ply"], "boxes": ["boxes"]}
    stub = Stub(scenes=scenes, job=lambda scene, **options: (scene, options), take_turns=take_turns)
    found = figures.textures(stub)
    plain, lit = {"keep_color": False}, {"keep_color": False, "lighting": "kit"}
    assert asked[:3] == [
        (["boxes"], plain),
        (["vertex colors", "boxes"], plain),
        (["textured", False, "nearest", "boxes"], plain),
    ]
    assert asked[-1] == (["textured", False, "linear-mipmap-linear", "boxes"], {**lit, "anisotropy": 4})
    assert found["table"][0] == ["frame", "boxes, unlit", "boxes, headlight", "boxes, kit"]
    assert [cell.split()[0] for cell in found["table"][3][1:]] == ["3.00", "3.00", "3.00"]
    assert found["values"]["a colour for each vertex"]["boxes"]["headlight"]["median"] == 2
    with pytest.raises(Skipped, match="none of boxes, spheres"):
        figures.textures(Stub(scenes={"dragon": ["d.ply"]}))


def test_settings_say_what_is_reduced() -> None:
    assert Settings().reduced == []
    assert "most triangles: 1,000,000 in place of 10,000,000" in QUICK.reduced
    given = tool.settings_of(tool.parse(["--quick", "--size", "64", "boxes"]))
    assert (given.size, given.triangles, given.scenes) == (64, QUICK.triangles, ("boxes",))
    assert tool.settings_of(tool.parse(["--rounds", "9"])).peer_rounds == 9


def test_the_soak_takes_part_only_if_it_is_asked_for() -> None:
    assert "soak" not in tool.parse([]).only
    assert tool.parse(["--only", "soak"]).only == ["soak"]
    assert tool.parse(["--only", "live", "--soak", "1.5"]).only == ["live", "soak"]


# --- scenes -----------------------------------------------------------------------------------------------------------


def test_own_boxes_are_those_of_the_shared_bench(bench: Callable[..., Soup]) -> None:
    ours, theirs = makers.make("boxes", 4), bench("boxes", n=4)
    assert np.array_equal(ours.vertices, theirs.vertices)
    assert np.array_equal(ours.faces, theirs.faces)
    assert np.array_equal(ours.colors, theirs.face_colors)


def test_soup_is_of_less_than_a_pixel() -> None:
    size = 64
    scene = makers.make("soup", 1000, size)
    away = 4 - scene.vertices[:, 2:]
    pixels = scene.vertices[:, :2] / away / math.tan(makers.HALF_ANGLE) * size / 2
    extent = np.ptp(pixels.reshape(-1, 3, 2), axis=1)
    assert extent.max() < 1
    assert extent.max() > 0.9
    assert np.abs(pixels).max() < size / 2
    assert len(np.unique(scene.faces)) == 3000


def test_a_textured_scene_has_the_fragments_of_the_plain_one(shared_devices: None) -> None:
    plain, textured = makers.make("boxes", 3), makers.make("textured", False, "linear-mipmap-linear", "boxes", 3)
    [texture] = [material.texture for material in textured.materials]
    assert texture is not None and texture.image.shape == (512, 512, 4)
    assert textured.surfaces == "transparent" and not textured.kinds.routed.any()
    ours, theirs = (plainly.Renderer(scene).render(makers.CAMERA, (96, 96), layers=True) for scene in (plain, textured))
    assert ours.stats.fragments == theirs.stats.fragments > 1000
    assert np.array_equal(ours.color[..., 3], theirs.color[..., 3])
    assert not np.array_equal(ours.image, theirs.image)


def test_each_side_of_a_box_gets_the_whole_texture() -> None:
    scene = makers.make("textured", False, "nearest", "boxes", 2)
    assert scene.uv is not None
    side = scene.faces[4:6].reshape(-1)  # the corners of two triangles
    assert {tuple(uv) for uv in scene.uv[side]} == {(0, 0), (1, 0), (1, 1), (0, 1)}
    at = {tuple(uv): point for uv, point in zip(scene.uv[side].tolist(), scene.vertices[side], strict=True)}
    assert all((at[tuple(uv)] == point).all() for uv, point in zip(scene.uv[side], scene.vertices[side], strict=True))
    across, down = at[1, 0] - at[0, 0], at[0, 1] - at[0, 0]
    assert at[1, 1] == pytest.approx(at[0, 0] + across + down)
    assert np.dot(across, down) == pytest.approx(0, abs=1e-6)
    assert len(scene.vertices) < 3 * len(scene.faces)  # corners that are the same share a vertex


def test_a_texture_around_a_sphere_never_turns_back() -> None:
    angles = np.linspace(0, 2 * np.pi, 33)
    points = np.stack([np.cos(angles), np.sin(angles), np.full(33, 0.5)], -1)
    triangles = np.stack([points[:-1], points[1:], np.tile([0.6, 0.0, 2.0], (32, 1))], 1)
    uv = makers.uv_around(triangles.reshape(-1, 3)).reshape(-1, 3, 2)
    assert np.abs(uv[:, 1, 0] - uv[:, 0, 0]) == pytest.approx(1 / 32)  # at the seam, too
    assert (uv[..., 1] > 0).all() and (uv[..., 1] < 0.5).all()  # the upper half: z is up
    assert (uv[:, 2, 1] < uv[:, 0, 1]).all()


# --- text -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (1234.5, "1,234"), (52.31, "52.3"), (1.254, "1.25"), (0.1082, "0.108"), (0.00123, "0.0012")],
)
def test_digits(value: float, text: str) -> None:
    assert figures.digits(value) == text


def test_text_shows_tables_targets_and_what_is_missing() -> None:
    lines = report.as_text(made_up()).splitlines()
    assert "processor: slide rule" in lines[0]
    assert "16      2.00 (1.00 .. 3.00)" in lines
    verdicts = [line for line in lines if line.startswith("layers ") and "3 " in line]
    assert [line.split("  ")[-1].strip() for line in verdicts] == ["met", "not met", "not judged"]
    assert lines[-4:] == [
        "changed: pixels a side: 64 in place of 1,024",
        "left out: dragon: asleep",
        "skipped: camera: nothing to see",
        "failed: stages: broken",
    ]


def test_markdown_goes_between_the_markers() -> None:
    text = report.as_markdown(made_up(), ["performance/layers.png"])
    assert "| layers | ns / fragment |\n| --- | --: |\n| 4 | 2.00 |" in text
    assert "| layers | two | <= 3 | 4.00 | not met |" in text
    assert "A note." in text
    assert "![Time against layers](performance/layers.png)" in text
    document = report.between_markers(DOCUMENT, text)
    assert document.startswith("# Title\n\nabove\n")
    assert document.endswith("\n\nbelow\n")
    assert "old" not in document
    assert report.between_markers(document, text) == document


@pytest.mark.parametrize("document", ["", report.BEGIN, f"{report.END}\n{report.BEGIN}", DOCUMENT + DOCUMENT])
def test_markers_are_needed_once(document: str) -> None:
    with pytest.raises(ValueError, match="expected the lines"):
        report.between_markers(document, "text")


def test_the_document_has_its_markers() -> None:
    report.between_markers((ROOT / "docs/performance.md").read_text(encoding="utf-8"), "text")


def test_plots() -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from benchmark.plots import PLOTS, draw

    assert PLOTS.keys() <= FIGURES.keys()
    found = made_up()
    times = {who: spread([1.0, 2.0]) for who in ("clpeel", "vtk", "times", "share")}
    found["figures"] |= {name: {"values": {"boxes": times}} for name in ("peeling", "unsorted")}
    found["figures"]["stages"] = {"values": {"boxes": {"seconds": {"sort": spread([1.0]), "total": spread([1.0])}}}}
    pictures = draw(found)
    assert pictures.keys() == {"peeling", "unsorted", "layers", "stages"}
    assert all(data.startswith(b"\x89PNG") for data in pictures.values())


# --- the command ------------------------------------------------------------------------------------------------------


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(ROOT / "tools/bench.py"), *arguments],
        env={**os.environ, "CLPEEL_SHARED": "nowhere"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_help_names_the_figures() -> None:
    done = command("--help")
    assert done.returncode == 0
    assert all(name in done.stdout for name in FIGURES)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--only", "layers,nonsense"], "got 'nonsense'"),
        (["--rounds", "0"], "above 0, got '0'"),
        (["--triangles", "9"], "at least 10"),
        (["--nonsense"], "--nonsense"),
        (["teapot"], "got 'teapot'"),
        (["--soak", "0"], "above 0, got '0'"),
        (["--soak", "long"], "above 0, got 'long'"),
        (["--peer-python", "missing/python"], "--peer-python"),
        (["--json", "missing/file.json"], "--json"),
        (["--report", "missing"], "--report"),
        (["--scenes", "missing"], "no scenes.py"),
        (["--from", "missing.json"], "No such file"),
        (["--from", str(ROOT / "pyproject.toml")], "was not written by --json"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    arguments: list[str], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        tool.main(arguments)
    message = capsys.readouterr().err
    assert end.value.code == 2
    assert text in message
    assert message.startswith("bench: error: ")
    assert message.count("\n") == 1


def test_an_unknown_device_is_refused() -> None:
    done = command("--only", "layers", "--device", "no such thing")
    assert done.returncode == 3
    assert done.stderr.startswith("bench: error: device: expected ")
    assert done.stderr.count("\n") == 1


def test_a_tiny_run(tmp_path: Path) -> None:
    (tmp_path / "performance.md").write_text(DOCUMENT)
    numbers = tmp_path / "bench.json"
    tiny = ["--only", "peeling,layers,triangles,camera", "--size", "32", "--triangles", "1000", "--rounds", "1"]
    done = command(*tiny, "--json", str(numbers), "--report", str(tmp_path))
    assert done.returncode == 0, done.stderr
    found = json.loads(numbers.read_text())
    assert found["figures"].keys() == {"peeling", "layers", "triangles", "camera"}
    assert "--scenes" in found["figures"]["peeling"]["skipped"]
    assert {row[2] for row in found["figures"]["layers"]["table"][1:]} == {"4,096"}  # as many fragments however deep
    assert found["figures"]["camera"]["values"]["boxes"]["again"]["programs"] == 0
    assert found["machine"]["OpenCL device"]
    assert "## Time per fragment against layers" in (tmp_path / "performance.md").read_text()
    assert "pixels a side: 32 in place of 1,024" in done.stdout
    assert [line.split()[0] for line in done.stderr.splitlines()][:4] == ["peeling", "layers", "triangles", "camera"]


def test_what_is_finished_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(bench: Any) -> dict[str, Any]:
        raise KeyboardInterrupt

    def failed(bench: Any) -> dict[str, Any]:
        return {"values": run([sys.executable, "-c", "raise SystemExit('the last word')"], {})}

    stages = {
        "layers": lambda bench: {"targets": [target("it", 1, "<=", 2)], "table": [["a"], ["b"]], "notes": []},
        "pixels": failed,
        "camera": interrupted,
        "stages": failed,
    }
    for name in tuple(FIGURES):
        monkeypatch.delitem(FIGURES, name)
    for name, measure in stages.items():
        monkeypatch.setitem(FIGURES, name, Figure(name, measure))
    monkeypatch.setattr(tool.Bench, "measure", lambda self, case: {"OpenCL device": "none"})
    assert tool.main(["--json", str(tmp_path / "bench.json")]) == 130
    found = json.loads((tmp_path / "bench.json").read_text())
    assert list(found["figures"]) == ["layers", "pixels"]
    assert found["figures"]["pixels"]["failed"] == "the last word"
    assert "broken off" in capsys.readouterr().out
    assert tool.main(["--only", "layers"]) == 0
    assert tool.main(["--only", "layers,pixels"]) == 1


def test_a_program_that_fails_says_why() -> None:
    with pytest.raises(Failed, match="exit code 7"):
        run([sys.executable, "-c", "import os; os._exit(7)"], dict(os.environ))
