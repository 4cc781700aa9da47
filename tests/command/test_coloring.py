"""Colours that stand for numbers, on the command line: what its options mean, and which errors they make."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from conftest import printed
from PIL import Image

import clpeel
from clpeel.command.main import main
from clpeel.pictures.colormaps import sampled

pytestmark = pytest.mark.usefixtures("shared_devices")

PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float height
property float fade
element face 2
property list uchar int vertex_indices
property int part
end_header
0 0 0 0 0.5
1 0 0 2 0.5
1 1 0 2 0.5
0 1 0 0 0.5
3 0 1 2 4
3 0 2 3 6
"""
SIZE = ("--resolution", "300,160", "--unlit", "--no-background", "--samples", "1")


@pytest.fixture
def square(tmp_path: Path) -> Path:
    path = tmp_path / "square.ply"
    path.write_text(PLY)
    return path


def render(square: Path, *arguments: str) -> np.ndarray:
    output = square.parent / "out.png"
    assert main(["render", str(square), *SIZE, *arguments, "-o", str(output)]) == 0
    with Image.open(output) as file:
        return np.asarray(file.convert("RGBA")).astype(int)


def middle(image: np.ndarray) -> np.ndarray:
    """The colours across the square, from left to right."""
    row: np.ndarray = image[len(image) // 2]
    return row[row[:, 3] > 0]


def test_colors_follow_an_array(square: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shown = middle(render(square, "--coloring-array", "height"))
    colors = sampled("viridis")
    wanted = colors[((np.arange(len(shown)) + 0.5) / len(shown) * 256).astype(int)].astype(int)
    assert len(shown) > 90 and np.abs(shown - wanted).max() < 12
    _, lines = printed(capfd)
    assert not any("left out" in line for line in lines)


def test_options_are_those_of_python(square: Path) -> None:
    halves = middle(render(square, "--coloring-array=height", "--colormap=red:blue", "--coloring-range=-2,7"))
    assert (halves == (255, 0, 0, 255)).all()
    steps = middle(render(square, "--coloring-array=height", "--colormap=gray_r", "--colormap-discretization=2"))
    assert sorted(np.unique(steps[:, 0])) == [0, 255] and steps[0, 0] == 255
    ends = ("--below-color=red", "--above-color=#00ff00", "--coloring-range=0.5,1.5")
    beyond = middle(render(square, "--coloring-array=height", *ends))
    assert (beyond[:20] == (255, 0, 0, 255)).all() and (beyond[-20:] == (0, 255, 0, 255)).all()
    logs = middle(
        render(square, "--coloring-array=height", "--coloring-log-scale", "--coloring-range=1,2", "--below-color=red")
    )
    assert (logs[:-1] == (255, 0, 0, 255)).all()  # half of the corners are 0
    parts = render(square, "--coloring-array=part", "--categories", "--colormap=red:lime")
    assert {tuple(color) for color in parts[parts[..., 3] > 0]} == {(255, 0, 0, 255), (0, 255, 0, 255)}


def test_opacities(square: Path) -> None:
    for arguments, alpha in [
        (["--opacity-array=fade"], 128),
        (["--opacity=0.25"], 64),
        (["--opacity-map=1,0.5,1", "--coloring-range=-2,2"], None),
    ]:
        shown = middle(render(square, "--coloring-array=height", *arguments))
        if alpha is not None:
            assert (np.abs(shown[:, 3] - alpha) <= 1).all() and len(np.unique(shown[:, 0])) > 20
        else:
            assert shown[0, 3] < 132 and shown[-1, 3] > 250 and (np.diff(shown[:, 3]) >= 0).all()


def test_a_bar_lies_beside_the_model(square: Path) -> None:
    plain, barred = (render(square, "--coloring-array=height", *more) for more in ((), ("--bar",)))
    changed = (plain != barred).any(axis=2)
    assert changed.sum() > 2000 and not (changed & (plain[..., 3] > 0)).any()


def test_a_map_has_no_bar_and_one_line_says_so(square: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["complexity", str(square), "--coloring-array=height", "-o", str(square.parent / "c.png")]) == 0
    scene = clpeel.load(square, scalars="height")
    result = plainly.render(scene, size=(60, 40), technique="weighted-sum")
    assert result.with_bar(*scene.color_maps).stats.notes[-1].startswith("no scale bar of 'height'")


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["--coloring-array=x"], "--coloring-array: expected an array of the scene, height, fade, part; got 'x'"),
        (["--colormap=gray"], "--colormap: expected --coloring-array with it, got none"),
        (["--coloring-by-cells"], "--coloring-by-cells: expected --coloring-array with it, got none"),
        (["--bar"], "--bar: expected --coloring-array with it, got none"),
        (["--opacity-map=linear"], "--opacity-map: expected --coloring-array with it, got none"),
        (["--coloring-array=height", "--colormap=virdis"], "--colormap: expected a name of"),
        (["--coloring-array=height", "--colormap=red:rad"], "--colormap: expected R,G,B in 0..1"),
        (
            ["--coloring-array=height", "--coloring-range=2,1"],
            "--coloring-range: expected LOW,HIGH (two numbers, LOW <",
        ),
        (["--coloring-array=height", "--coloring-component=-2"], "--coloring-component: expected a whole number"),
        (["--coloring-array=height", "--opacity-map=linar"], "got 'linar'; did you mean linear?"),
        (["--coloring-array=height", "--opacity-map=1,2"], "--opacity-map: expected numbers 0..1, got 1 to 2"),
        (
            ["--coloring-array=height", "--opacity-map=linear", "--opacity-array=fade"],
            "--opacity-array: expected no --opacity-map with it, got both",
        ),
    ],
)
def test_errors_are_one_line(square: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], error: str) -> None:
    assert main(["render", str(square), *arguments, "-o", str(square.parent / "out.png")]) != 0
    _, lines = printed(capfd)
    assert len(lines) == 1 and error in lines[0]
    assert not (square.parent / "out.png").exists()


def test_several_files_share_one_range(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = list[Any]()
    monkeypatch.setattr(
        clpeel, "render", lambda scene, *_, **__: seen.append(scene) or (_ for _ in ()).throw(KeyboardInterrupt)
    )
    for name, top in (("a", 2), ("b", 20)):
        (tmp_path / f"{name}.ply").write_text(PLY.replace("1 1 0 2 ", f"1 1 {top} {top} "))
    files = [str(tmp_path / f"{name}.ply") for name in "ab"]
    main(["render", *files, "--coloring-array=height", "--opacity=0.5", "--opacity=1", "-o", str(tmp_path / "o.png")])
    [scene] = seen
    assert [colors.clim for colors in scene.color_maps] == [(0, 20)]
    assert [scene.materials[place].opacity for place in scene.face_materials] == pytest.approx(
        [0.5, 0.5, 1, 1], abs=0.01
    )
