"""Scene files: what they mean, beside command lines and Python; which errors they make; how they are written."""

from __future__ import annotations

import math
import os
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import printed
from hypothesis import example, given
from hypothesis import strategies as st

import clpeel
from clpeel.command.main import main
from clpeel.command.order import EACH
from clpeel.command.parser import make_parser, parse
from clpeel.command.scene_file import PATHS, _turn
from clpeel.command.write_scene import scene_text
from clpeel.scene.lights import AmbientLight, DirectionalLight, PointLight, SpotLight

TRIANGLE = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder `scenes`, with two meshes beside it; the working folder is another one."""
    for name in ("a.off", "b.off"):
        (tmp_path / name).write_text(TRIANGLE)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    return tmp_path / "scenes"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What render is asked for; then it stops."""
    calls = list[Any]()

    def render(scene: Any, camera: Any, **options: Any) -> Any:
        calls.append(SimpleNamespace(scene=scene, camera=camera, **options))
        raise KeyboardInterrupt

    monkeypatch.setattr(clpeel, "render", render)
    return calls


def scene(folder: Path, text: str, name: str = "scene.toml") -> str:
    (folder / name).write_text(text)
    return str(folder / name)


FULL = """
resolution = [40, 30]
background-color = ["white", [0, 0.5, 1]]
technique = "depth-peeling"
passes = 3
unlit = false
opacity = 0.5
output = "out.png"

[camera]
position = [1, 2, 3]
focal_point = [0, 0, 0]
up = "+Z"
view-angle = 40

[[mesh]]
path = "../a.off"
color = "red"

[[mesh]]
path = "../b.off"
opacity = 0.25
translate = [10, 0, 0]

[[light]]
kind = "ambient"
sky = "gold"

[[light]]
kind = "directional"
direction = [0, 0, -1]
follows-camera = true

[[light]]
kind = "point"
position = [0, 0, 5]
intensity = 20
range = 30

[[light]]
kind = "spot"
position = [0, 0, 5]
direction = [0, 0, -1]
outer-angle = 30
"""


def test_it_says_what_a_command_line_and_python_say(folder: Path, asked: list[Any]) -> None:
    assert main(["render", scene(folder, FULL)]) == 130
    [call] = asked
    a, b = (clpeel.load(folder.parent / name, opacity=o) for name, o in (("a.off", 0.5), ("b.off", 0.25)))
    np.testing.assert_array_equal(call.scene.vertices, np.concatenate([a.vertices, b.vertices + (10, 0, 0)]))
    assert call.scene.colors[0].tolist() == [1, 0, 0, 0.5] and call.scene.colors[-1, 3] == 0.25
    assert call.camera == clpeel.Camera((1, 2, 3), (0, 0, 0), (0, 0, 1), 40)
    assert (call.size, call.technique, call.passes) == ((40, 30), "depth-peeling", 3)
    assert call.background == ((1, 1, 1), (0, 0.5, 1)) and call.lighting == "scene"
    spot = SpotLight(position=(0, 0, 5), direction=(0, 0, -1), outer_angle=30)
    assert call.scene.lights == (
        AmbientLight(sky="gold"),  # type: ignore[arg-type]
        DirectionalLight(direction=(0, 0, -1), follows_camera=True),
        PointLight(position=(0, 0, 5), intensity=20, range=30),
        spot,
    )


def test_its_paths_are_beside_it(folder: Path) -> None:
    options = parse(["render", scene(folder, '[[mesh]]\npath = "own.off"')])
    assert options.files == [str(folder / "own.off")]
    name = scene(folder, '[[mesh]]\npath = "../a.off"\n[camera]\nview = "iso"', "p.toml")
    options = parse(["render", name])
    assert [os.path.samefile(path, folder.parent / "a.off") for path in options.files] == [True]
    options = parse(["render", scene(folder, 'output = "x.png"\nstats = true\n[[mesh]]\npath = "/m.off"')])
    assert (options.files, options.output, options.stats) == (["/m.off"], str(folder / "x.png"), "-")


def test_the_command_line_wins(folder: Path) -> None:
    name = scene(folder, FULL)
    options = parse(["render", name, "--resolution=9,8", "--opacity=0.75", "--camera-direction=iso", "-o", "y.png"])
    assert (options.resolution, options.output, options.passes) == ((9, 8), "y.png", 3)
    assert [piece.options["opacity"] for piece in options.pieces] == [0.75, 0.75]
    assert (options.camera_position, options.camera_direction) == (None, "iso")
    own = parse(["render", name, "--opacity=file"])
    assert [piece.options["opacity"] for piece in own.pieces] == [None, None]
    beside = parse(["render", "--opacity=1", name, "--opacity=0.1", "c.off"])
    assert [piece.options["opacity"] for piece in beside.pieces] == [1, 1, 0.1]
    switched = scene(folder, 'no-background = true\ngrid = true\nunlit = true\n[[mesh]]\npath = "a.off"')
    options = parse(["render", switched, "--background-color=red", "--no-grid", "--lighting=kit"])
    assert (options.no_background, options.grid, options.unlit, options.lighting) == (False, False, False, "kit")


def test_other_commands_take_what_they_have(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    name = scene(folder, 'grid = true\noutput = "x.png"\nresolution = [9, 9]\n[[mesh]]\npath = "a.off"')
    for command, left_out in (("compare", "grid, output"), ("complexity", "grid, output"), ("view", "grid, output")):
        options = parse([command, name])
        assert options.resolution == (9, 9)
        assert options.notes == (f"{name}: not options of clpeel {command}, left out: {left_out}",)
    assert parse(["layers", name]).output == "layers"


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "expected a mesh, [[mesh]] with its path, got none"),
        ("x =", "not TOML: Invalid value (at end of document)"),
        ("x = [" + "[" * 5000, "not TOML: it is nested too deep"),
        ("x = 1" + "0" * 5000, "not TOML: Exceeds the limit"),
        ("resolutoin = [1, 2]\n", "unknown key 'resolutoin'; did you mean resolution?"),
        ("config = 'x'\n", "unknown key 'config'"),
        ("resolution = [1, 2, 3]\n", "resolution: expected W,H (two whole numbers), got '1,2,3'"),
        ("resolution = true\n", "resolution: expected W,H, got true"),
        ("resolution = []\n", "resolution: expected W,H, got []"),
        ("resolution = 1979-05-27\n", "resolution: expected W,H, got datetime.date(1979, 5, 27)"),
        ("unlit = 1\n", "unlit: expected true or false, got 1"),
        ("samples = nan\n", "samples: expected a whole number of 1 or more, got 'nan'"),
        ("samples = 0x" + "f" * 5000 + "\n", "samples: expected N, got a value that is too large"),
        ("output = 3\n", "output: expected OUT.png, got 3"),
        ('"a\\u001bb" = 3\n', "unknown key 'a\\x1bb'"),
        ("technique = 'srot'\n", "technique: expected one of sort"),
        ("passes = 2\n", "passes: the technique 'sort' has no such option; 'clpeel techniques' lists those of each"),
        ("camera-direction = 'iso'\ncamera_direction = 'xy'\n", "camera_direction: expected once, got it with -"),
        ("camera = 'isometric'\n", 'camera: expected a view such as "iso" or "-xy", or a table, [camera], got'),
        ("[camera]\npositon = [1, 2, 3]\n", "camera: unknown key 'positon'; did you mean position?"),
        ("[camera]\nview = 'iso'\ndirection = 'xy'\n", "camera: direction: expected one of two that mean the same"),
        (
            "[camera]\nview-angle = 0.5235987755982988\n",
            "camera-view-angle: expected degrees, got 0.5236, which is 30",
        ),
        ("mesh = 3", "mesh: expected tables, each below [[mesh]], got 3"),
        ("[[mesh]]\n", "mesh 1: path: expected the name of a mesh file, got none"),
        ("[[mesh]]\npath = 3\n", "mesh 1: path: expected the name of a mesh file, got 3"),
        ('[[mesh]]\npath = "a\\u0000b"\n', "mesh 1: path: expected the name of a mesh file, got 'a\\x00b'"),
        ("[[mesh]]\npath = 'x.toml'\n", "mesh 1: path: expected a mesh file, got the scene file 'x.toml'"),
        (
            "[[mesh]]\npath = '../a.off'\n[[mesh]]\npath = '../a.off'\nopacity = 2\n",
            "mesh 2: opacity: expected a number",
        ),
        ("[[mesh]]\npath = '../a.off'\ncolour = 'red'\n", "mesh 1: unknown key 'colour'; did you mean color?"),
        ("[[mesh]]\npath = '../a.off'\ncolor = 'rde'\n", "mesh 1: color: expected R,G,B in 0..1"),
        ("[[mesh]]\npath = '../a.off'\nscale = 0\n", "mesh 1: scale: expected numbers other than 0, got 0"),
        ("[[mesh]]\npath = '../a.off'\nscale = 'big'\n", "mesh 1: scale: expected a number, or 3 numbers, got 'big'"),
        ("[[mesh]]\npath = '../a.off'\nrotate = [1, 2]\n", "mesh 1: rotate: expected 3 angles in degrees, about X, Y"),
        ("[[mesh]]\npath = '../a.off'\nrotate = [1, 2, inf]\n", "about X, Y and Z that are finite, got [1, 2, inf]"),
        ("[[mesh]]\npath = '../a.off'\nmatrix = 3\n", "mesh 1: matrix: expected 4 rows of 4 numbers, got 3"),
        (
            "[[mesh]]\npath = '../a.off'\nmatrix = [[1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 1]]\n",
            "mesh 1: matrix: expected one that leaves the mesh its extent, got one that makes it flat",
        ),
        (
            "[[mesh]]\npath = '../a.off'\nmatrix = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\nscale = 2\n",
            "mesh 1: matrix: expected no scale with it, got both",
        ),
        ("[[mesh]]\npath = '../a.off'\ncolormap = 'gray'\n", "mesh 1: colormap: expected --coloring-array with it"),
        (
            "[[mesh]]\npath = '../a.off'\n[[light]]\n",
            "light 1: kind: expected one of ambient, directional, point, spot",
        ),
        (
            "[[mesh]]\npath = '../a.off'\n[[light]]\nkind = 'spot'\nposition = [0, 0, 1]\n",
            "light 1: direction: expected X",
        ),
        (
            "[[mesh]]\npath = '../a.off'\n[[light]]\nkind = 'ambient'\nskye = 1\n",
            "unknown key 'skye'; did you mean sky?",
        ),
        ("[[mesh]]\npath = '../a.off'\n[[light]]\nkind = 'ambient'\nsky = 'gld'\n", "light 1: sky: expected"),
        (
            "[[mesh]]\npath = '../a.off'\n[[light]]\nkind = 'ambient'\nintensity = 'a'\n",
            "light 1: intensity: expected a n",
        ),
        (
            "[[mesh]]\npath = '../a.off'\n[[light]]\nkind = 'ambient'\nintensity = -1\n",
            "light 1: intensity: expected a n",
        ),
        ("[[mesh]]\npath = '../no.off'\n", "no.off: no such file"),
    ],
)
def test_what_is_wrong_is_one_line_that_says_where(
    folder: Path, text: str, error: str, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = text if "[[mesh]]" in text or not text.endswith("\n") else f"{text}[[mesh]]\npath = '../a.off'\n"
    assert main(["render", scene(folder, whole), "-o", "out.png"]) == 2
    _, lines = printed(capfd)
    assert len(lines) == 1 and lines[0].startswith(f"clpeel: error: {folder}") and error in lines[0], lines
    assert os.listdir(folder) == ["scene.toml"] and os.listdir() == []


def test_files_that_are_none_are_one_line(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (folder / "bytes.toml").write_bytes(b"\xff\xfe")
    (folder / "folder.toml").mkdir()
    one = scene(folder, '[[mesh]]\npath = "a.off"')
    for names, error in (
        (("no.toml",), "no.toml: no such file"),
        (("bytes.toml",), "expected TOML, which is UTF-8, got other bytes"),
        (("folder.toml",), "cannot be read: Is a directory"),
        (("scene.toml", "./scene.toml"), "expected one scene file, got 2"),
        (("x\0.toml",), "cannot be read: embedded null byte"),
        (("scene.toml", "scene.toml"), "expected one scene file, got 2"),
    ):
        assert main(["render", *(f"{folder}/{name}" for name in names)]) == 2
        _, lines = printed(capfd)
        assert len(lines) == 1 and error in lines[0], lines
    assert main(["render", one, "-o", one]) == 2
    assert "ending in .png" in printed(capfd)[1][0]
    assert main(["render", one, f"--stats={one}"]) == 2
    assert "expected a file of its own" in printed(capfd)[1][0]


@given(st.tuples(*[st.floats(-400, 400)] * 3))
def test_turns_are_those_of_their_axes_in_order(degrees: tuple[float, float, float]) -> None:
    """Beside products of matrices as textbooks have them."""
    x, y, z = (math.radians(angle) for angle in degrees)
    about_x = np.array([[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]])
    about_y = np.array([[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]])
    about_z = np.array([[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]])
    np.testing.assert_allclose(_turn(degrees), about_z @ about_y @ about_x, atol=1e-12)


def test_scale_comes_first_then_turns_then_the_place(folder: Path) -> None:
    """A quarter turn about Z takes X to Y and Y to -X."""
    moves = "scale = [2, 3, 4]\nrotate = [0, 0, 90]\ntranslate = [10, 20, 30]"
    [piece] = parse(["render", scene(folder, f'[[mesh]]\npath = "a.off"\n{moves}')]).pieces
    assert piece.matrix is not None
    x, y, z = np.array(piece.matrix)[:3] @ (1, 1, 1, 1)
    assert (x, y, z) == (10 - 3, 20 + 2, 30 + 4) and piece.matrix[3] == (0, 0, 0, 1)
    [piece] = parse(["render", scene(folder, '[[mesh]]\npath = "a.off"\nscale = -2')]).pieces
    assert np.diag(piece.matrix).tolist() == [-2, -2, -2, 1]


def test_quarter_turns_are_exact() -> None:
    assert _turn((90, 0, 0)) == [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert _turn((0, -90, 0)) == [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    assert _turn((0, 0, 180)) == [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]


# --- writing ----------------------------------------------------------------------------------------------------------


def same(first: Any, second: Any) -> None:
    """Two command lines mean the same. Names of files may be written in two ways."""
    for name in {action.dest for action in make_parser().commands["render"].options()} - {*EACH, "help", "help_all"}:
        one, other = (getattr(options, name) for options in (first, second))
        if name in PATHS and one not in (None, "-"):
            one, other = os.path.realpath(one), os.path.realpath(other)
        assert one == other, name
    assert len(first.pieces) == len(second.pieces)
    for one, other in zip(first.pieces, second.pieces, strict=True):
        assert os.path.realpath(one.path) == os.path.realpath(other.path)
        assert {**one.options} == {**other.options}


@pytest.mark.parametrize(
    "words",
    [
        "../a.off",
        "--opacity .3 ../a.off --opacity=file ../b.off --resolution 40,30 --camera-direction -1,0,2e-3",
        "../a.off ../b.off --color #ff0000 --color 1,0,0.5 --technique auto --max-error=1e-2 --no-background",
        "--coloring-array 12 --categories ../a.off --no-categories ../b.off --colormap red:blue --stats",
        "../a.off --samples 4 --samples=04 -oq.png --stats=st.json --passes 3 --technique depth-peeling",
        "../a.off --background-color white:0,0,1 --line-width 0.01u --no-scale-bar --device 0 --memory 1e9 --unlit",
        "../a.off --camera-position=-.5,-0,+1 --up -Z --camera-view-angle 33 --samples 16 --no-grid --axis",
    ],
)
def test_what_is_written_means_the_same(folder: Path, words: str) -> None:
    options = parse(["render", *words.split()])
    text = scene_text(options, str(folder / "scene.toml"))
    same(options, parse(["render", scene(folder, text)]))


@example("\x7f\t\n\\\"'")
@given(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), min_size=1))
def test_any_name_is_written_as_it_is(name: str) -> None:
    options = parse(["render", "--device", "x", "--", f"/{name}.ply"])
    assert tomllib.loads(scene_text(options, "s.toml"))["mesh"] == [{"path": f"/{name}.ply"}]


@pytest.mark.usefixtures("shared_devices")
def test_it_is_written_with_the_picture_and_draws_the_same(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    given = [
        "render",
        "--opacity=0.3",
        "../a.off",
        "--opacity=1",
        "../b.off",
        "--resolution=20,16",
        "--quiet",
        "--no-provenance",
    ]
    assert main([*given, "-o", "x.png", "--write-scene", "../scenes/s.toml"]) == 0
    assert main(["render", "../scenes/s.toml", "--no-provenance", "-o", "y.png"]) == 0
    assert Path("x.png").read_bytes() == Path("y.png").read_bytes()
    printed(capfd)
    for words, error in (
        (["--write-scene=s.txt"], "--write-scene: expected a name ending in .toml, got 's.txt'"),
        (["--write-scene=no/s.toml"], "--write-scene: the folder"),
        (["../scenes/s.toml", "--write-scene=s.toml"], "--write-scene: expected mesh files, got the scene file"),
        (["\udcff.off", "--write-scene=s.toml"], "--write-scene: expected names that are Unicode, got '\\udcff.off'"),
    ):
        assert main(["render", *(["../a.off"] if words[0][0] == "-" else []), *words]) == 2
        _, lines = printed(capfd)
        assert len(lines) == 1 and error in lines[0], lines
    assert main(["render", "no.off", "--write-scene=s.toml"]) == 2 and not Path("s.toml").exists()


# --- the page ---------------------------------------------------------------------------------------------------------

COMMAND = Path(__file__).resolve().parents[2] / "docs" / "command"


@pytest.mark.usefixtures("shared_devices")
def test_the_page_quotes_its_scene_file_and_shows_its_picture(folder: Path) -> None:
    import trimesh
    from PIL import Image

    text = (COMMAND / "rings.toml").read_text()
    assert f"```toml docs/command/rings.toml\n{text}```" in (COMMAND.parent / "command.md").read_text()
    (folder / "ring.off").write_text(
        trimesh.creation.torus(2, 0.6, major_sections=64, minor_sections=32).export(file_type="off")
    )
    assert main(["render", scene(folder, text), "--quiet"]) == 0
    with Image.open(COMMAND / "rings.png") as shown, Image.open(folder / "rings.png") as drawn:
        off = np.abs(np.asarray(shown, int) - np.asarray(drawn, int))
    assert off.max() <= 1 and off.size > 400 * 400


def test_the_page_names_all_keys() -> None:
    text = (COMMAND.parent / "command.md").read_text()
    for kind in (AmbientLight, DirectionalLight, PointLight, SpotLight):
        for name in kind.__dataclass_fields__:
            assert f"`{name.replace('_', '-')}`" in text, name
