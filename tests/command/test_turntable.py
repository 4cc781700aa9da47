"""`clpeel turntable`: what its options ask for, what it says, and what Ctrl-C leaves."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import printed
from PIL import Image

import clpeel
from clpeel.command.main import main
from clpeel.command.parser import parse
from clpeel.command.turntable import axis_of
from clpeel.film import turntable as module

pytestmark = pytest.mark.usefixtures("shared_devices")

SMALL = ("--resolution", "128,96", "--frames", "4")


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as file:
        return np.asarray(file.convert("RGBA")).astype(int)


def test_its_frames_are_those_of_render(squares: Path, tmp_path: Path, capfd: Any) -> None:
    look = ("--opacity=0.4", "--camera-elevation-angle=30", "--edges", "--grid", "--axis", "--samples=8")
    assert main(["turntable", str(squares), *SMALL, *look, "-o", str(tmp_path / "f%02d.png")]) == 0
    _, said = printed(capfd)
    assert len(said) == 1 and said[0].startswith(f"clpeel: wrote {tmp_path}/f%02d.png (4 x 128 x 96, 4 triangles, ")
    first = ["render", str(squares), "--resolution=128,96", *look, "-o", str(tmp_path / "first.png")]
    assert main(first) == 0
    assert (pixels(tmp_path / "f01.png") == pixels(tmp_path / "first.png")).all()
    assert (pixels(tmp_path / "f02.png") != pixels(tmp_path / "first.png")).any()


def test_an_elevated_camera_turns_about_the_scene_and_stays_at_its_height(
    squares: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[Any] = []
    monkeypatch.setattr(clpeel, "turntable", lambda *given, **named: found.append((given, named)) or _film())
    assert (
        main(["turntable", str(squares), "--camera-elevation-angle=40", "--up=Z", "-o", str(tmp_path / "a.gif")]) == 0
    )
    (scene, path, camera, frames, degrees, fps), named = found[0]
    assert (path, frames, degrees, fps) == (str(tmp_path / "a.gif"), 90, 360, 30)
    heights = [each.position[2] - each.focal_point[2] for each in camera.orbit(frames, degrees, named["up"])]
    assert heights[0] > 1 and np.ptp(heights) < 1e-9
    assert (named["size"], named["technique"], named["lighting"]) == ((800, 600), "sort", "kit")


def _film() -> clpeel.Film:
    return clpeel.Film(("a.gif",), 90, 90, ())


@pytest.mark.parametrize(
    ("given", "axis"),
    [
        ([], (0, 1, 0)),
        (["--up=Z"], (0, 0, 1)),
        (["--camera-direction=iso"], (0, 0, 1)),
        (["--camera-view-up=1,0,0"], (1, 0, 0)),
        (["--camera-view-up=1,0,0", "--up=-Z"], (0, 0, -1)),
        (["--camera-direction=-Y"], (0, 1, 0)),
    ],
)
def test_it_turns_about_what_is_up(given: list[str], axis: tuple[float, ...]) -> None:
    assert axis_of(parse(["turntable", "a.ply", *given])) == axis


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["-o", "a.png"], "--output: expected one place for the frame's number"),
        (["-o", "-"], "--output: expected a name ending in .gif, .webp or .mp4"),
        (["-o", "a.gif", "--no-background"], "--background-color: expected a colour, as GIF holds no alpha"),
        (["-o", "a.gif", "--fps=100"], "fps: expected above 0, up to 50 for GIF"),
        (["--frames=0"], "--frames: expected a whole number of 1 or more"),
        (["--quality=150"], "quality: expected 0..100, got 150"),
        (["--degrees=far"], "--degrees: expected a number"),
        (["--bar"], "--bar: expected --coloring-array with it"),
        (["--technique=thickness"], "--thickness-range: expected"),
        (["--technique=magic"], "technique: expected one of"),
        (["--map=a.npy"], "this command has no option --map"),
    ],
)
def test_what_is_wrong_is_one_line_before_any_work(
    given: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["turntable", "no-such-file.ply", *given]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith("clpeel: error: ") and err.count("\n") == 1 and message in err
    assert os.listdir(tmp_path) == []


def test_a_film_never_replaces_its_model(squares: Path, tmp_path: Path, capfd: Any) -> None:
    os.link(squares, tmp_path / "squares.gif")
    assert main(["turntable", str(squares), "-o", str(tmp_path / "squares.gif")]) == 2
    assert "which is that of the input" in capfd.readouterr().err


@pytest.mark.parametrize(("name", "kept"), [("a.gif", "2 of 4 frames are kept"), ("##.png", "the numbered pictures")])
def test_after_ctrl_c_the_same_command_continues(
    name: str, kept: str, squares: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    command = ["turntable", str(squares), *SMALL, "-o", str(tmp_path / "out" / name)]
    (tmp_path / "out").mkdir()
    real = module._Work.draw

    def until_third(self: Any, k: int, progress: Any) -> Any:
        if k == 2:
            raise KeyboardInterrupt
        return real(self, k, progress)

    with monkeypatch.context() as patch:
        patch.setattr(module._Work, "draw", until_third)
        assert main(command) == 130
    _, said = printed(capfd)
    assert said[-1] == "clpeel: interrupted" and said[-2].startswith(f"clpeel: {kept}")
    assert main(command) == 0
    _, said = printed(capfd)
    assert "clpeel: 2 of 4 frames are finished already" in said
    assert [each for each in os.listdir(tmp_path / "out") if each.startswith(".")] == []


def test_a_model_that_has_changed_is_drawn_anew(squares: Path, tmp_path: Path, capfd: Any) -> None:
    command = ["turntable", str(squares), *SMALL, "-o", str(tmp_path / "##.png")]
    assert main(command) == 0
    squares.write_text(squares.read_text().replace("-.5 -.5 1", "-.6 -.5 1"))
    assert main(command) == 0
    assert "4 of 4 frames are there of another command, model or version; they are made anew" in capfd.readouterr().err


@pytest.mark.parametrize("arguments", [["turntable", "--help"], ["turntable", "a.ply", "-o", "a.png"]])
def test_it_answers_without_heavy_imports(arguments: list[str]) -> None:
    code = (
        "import sys, clpeel.command.main; clpeel.command.main.main(sys.argv[1:]); "
        "print({'numpy', 'pyopencl', 'trimesh', 'PIL', 'av'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    assert done.stderr.endswith("set()\n")
