"""The grid and the axes on the command line: what they add, what they leave as it is, and which errors they make."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import printed
from PIL import Image

import clpeel
from clpeel.command.main import main
from clpeel.rendering.axis import place_of
from clpeel.scene.grid import AXIS_COLORS

pytestmark = pytest.mark.usefixtures("shared_devices")

SMALL = ("--resolution", "120,100", "--camera-direction", "-1,-1,-1.5")


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as file:
        return np.asarray(file.convert("RGBA")).astype(int)


def render(squares: Path, tmp_path: Path, *arguments: str) -> np.ndarray:
    assert main(["render", str(squares), *SMALL, *arguments, "-o", str(tmp_path / "out.png")]) == 0
    return pixels(tmp_path / "out.png")


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[tuple[clpeel.Scene, clpeel.Camera]]:
    """What the command lets draw."""
    found = []
    real = clpeel.render

    def noted(scene: Any, camera: Any, *rest: Any, **options: Any) -> Any:
        found.append((scene, camera))
        return real(scene, camera, *rest, **options)

    monkeypatch.setattr(clpeel, "render", noted)
    return found


def test_a_grid_adds_lines_and_changes_neither_camera_nor_scene(
    squares: Path, tmp_path: Path, seen: list[Any], capfd: pytest.CaptureFixture[str]
) -> None:
    plain = render(squares, tmp_path, f"--stats={tmp_path / 'plain.json'}")
    _, before = printed(capfd)
    found = render(squares, tmp_path, "--grid", f"--stats={tmp_path / 'grid.json'}")
    _, after = printed(capfd)
    (scene, camera), (both, with_grid) = seen
    assert camera == with_grid and both.counts[0] == scene.counts[0] and both.counts[1] > 500
    np.testing.assert_array_equal(both.bounds[1, 1], scene.bounds[1, 1])
    first, second = (json.loads((tmp_path / name).read_text()) for name in ("plain.json", "grid.json"))
    assert second["triangles"] == first["triangles"] == 4 and second["lines"] == both.counts[1]
    assert second["notes"] == first["notes"] and len(before) == len(after) == 1
    assert before[0].split(",")[0] == after[0].split(",")[0]
    assert (found != plain).any(axis=-1).sum() > 500


def test_its_options(squares: Path, tmp_path: Path, seen: list[Any]) -> None:
    render(squares, tmp_path, "--grid", "--grid-unit", "0.7", "--grid-color", "#ff8000", "--up", "+Z")
    scene = seen[0][0]
    ends = scene.vertices[scene.lines]
    assert scene.bounds[0, 2] < 0 and np.ptp(ends[:, :, 2]) == 0
    along_x = ends[ends[:, 0, 0] != ends[:, 1, 0]]
    np.testing.assert_allclose(along_x[:, 0, 1] / 0.7, np.rint(along_x[:, 0, 1] / 0.7), atol=1e-9)
    colors = {tuple(row) for row in scene.face_colors[4:, :3].tolist()}
    assert colors == {(255, 128, 0), *(tuple(round(255 * part) for part in AXIS_COLORS[axis]) for axis in (0, 1))}


def test_colours_and_opacities_of_the_scene_are_not_those_of_the_grid(
    squares: Path, tmp_path: Path, seen: list[Any]
) -> None:
    render(squares, tmp_path, "--grid", "--opacity", "0.2", "--color", "red")
    scene = seen[0][0]
    np.testing.assert_allclose(scene.face_colors[:4], [[1, 0, 0, 0.2]] * 4, atol=1e-6)
    grid = clpeel.grid(clpeel.load(squares))
    assert grid.face_colors is not None
    np.testing.assert_allclose(scene.face_colors[4:], grid.face_colors / 255, atol=1e-6)


def test_axes_are_in_the_corner_alone(squares: Path, tmp_path: Path) -> None:
    for background in (["--no-background"], []):
        plain, found = (render(squares, tmp_path, *background, *axis) for axis in ([], ["--axis"]))
        changed = (plain != found).any(axis=-1)
        x, y, side = place_of(120, 100)
        assert changed.sum() == changed[y : y + side, x : x + side].sum() > side**2 / 2


def test_the_demo_has_them_too(tmp_path: Path, seen: list[Any]) -> None:
    out = tmp_path / "demo.png"
    assert (
        main(["demo", "--boxes", "--grid", "--axis", "--resolution", "100,100", "--samples", "1", "-o", str(out)]) == 0
    )
    assert seen[0][0].counts[1] > 500


@pytest.mark.parametrize("technique", ["thickness", "translucency", "layer-count"])
def test_maps_have_none_and_one_line_says_so(
    technique: str, squares: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    plain = render(squares, tmp_path, "--technique", technique)
    printed(capfd)
    found = render(squares, tmp_path, "--technique", technique, "--grid", "--axis")
    np.testing.assert_array_equal(found, plain)
    _, lines = printed(capfd)
    assert f"clpeel: note: --grid and --axis left out: the picture of {technique} is a map" in lines
    assert not any("line(s)" in line for line in lines)
    render(squares, tmp_path, "--technique", technique, "--axis", "--quiet")
    assert printed(capfd) == ([], [])


def test_a_picture_too_small_for_axes_has_a_note(
    squares: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out.png")
    assert main(["render", str(squares), "--axis", "--resolution", "95,200", "-o", out]) == 0
    assert "clpeel: note: no axes: 95 x 200 pixels are too few, they need 96 on each side" in printed(capfd)[1]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--grid-unit", "1"], "--grid-unit: expected --grid with it, got none"),
        (["--grid-color", "red"], "--grid-color: expected --grid with it, got none"),
        (["--grid", "--grid-unit", "0"], "--grid-unit: expected a number above 0, got '0' (see clpeel render --help)"),
        (["--grid", "--grid-unit", "1e9"], "grid unit: expected 0.015 to 3 for a scene of this size, got 1000000000.0"),
        (
            ["--grid", "--grid-color", "0,0,0,1"],
            "--grid-color: expected R,G,B in 0..1, #rrggbb or a colour name, got '0,0,0,1', which has an alpha "
            "(see clpeel render --help)",
        ),
    ],
)
def test_errors_are_one_line(
    arguments: list[str], text: str, squares: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.png"
    assert main(["render", str(squares), *arguments, "-o", str(out)]) == 2
    assert printed(capfd) == ([], [f"clpeel: error: {text}"]) and not out.exists()


@pytest.mark.parametrize("command", ["layers", "complexity", "compare", "view"])
def test_other_commands_have_no_such_options(command: str, squares: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for option in ("--grid", "--axis"):
        assert main([command, str(squares), option]) == 2
        assert f"this command has no option {option}" in printed(capfd)[1][0]
