"""The command: arguments, errors, files written, what it imports; with a stand-in for the renderer, then for real."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from reading.documents import Document

import clpeel
from clpeel.command import main as cli
from clpeel.command import parser as command_line
from clpeel.command.inputs import make_camera
from clpeel.command.terminal import Progress
from clpeel.errors import InputError, NoDeviceError
from clpeel.files import write_whole
from clpeel.options import options_of
from clpeel.pictures.encode import encode
from clpeel.pictures.shown import Shown
from clpeel.rendering.options import BACKGROUND, PictureOptions
from clpeel.techniques import TECHNIQUES

PYTHON = (sys.executable, "-P")  # -P: not the sources in the working folder, but the package that is installed
ROOT = Path(__file__).resolve().parents[2]
TETRAHEDRON = """OFF
4 4 0
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""


def parse(*arguments: str) -> Any:
    """The options of a render of a.ply."""
    return command_line.parse(["render", "a.ply", *arguments])


def run(*arguments: str, **options: Any) -> subprocess.CompletedProcess[bytes]:
    """The command in a process of its own."""
    command = [*PYTHON, "-m", "clpeel", *arguments]
    return subprocess.run(command, capture_output=True, check=False, timeout=120, **options)


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "tetrahedron.off"
    path.write_text(TETRAHEDRON)
    return path


def pixels(path: Path | str) -> np.ndarray:
    """A picture's pixels, [height, width, channels]."""
    with Image.open(path) as file:
        return np.asarray(file)


class StandIn(dict[str, Any]):
    """Some stats, by name and by attribute as of a picture."""

    __getattr__ = dict.__getitem__


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A renderer that notes what it is asked for; `outcome` may be an exception to raise."""
    record = SimpleNamespace(calls=[], outcome=None, layers=None)

    def render(scene: Any, camera: Any, **options: Any) -> Any:
        record.calls.append(SimpleNamespace(scene=scene, camera=camera, **options))
        if record.outcome is not None:
            raise record.outcome
        width, height = options["size"]
        image = np.full((height, width, 4), 255, np.uint8)
        stats = StandIn(
            technique=options["technique"],
            passes=1,
            samples_passed=np.array([7]),
            fragments=np.int64(1234567),
            layers_max=9,
            discarded=2,
            seconds={"raster": 0.25},
            bytes={"fragments": 4096},
            device="a device",
            notes=[],
        )
        numbers = np.zeros((height, width), np.float32)
        return SimpleNamespace(
            image=image,
            stats=stats,
            map=lambda name: numbers,
            layers=record.layers,
            provenance={},
            encoded=lambda found, provenance: encode(Shown(image, None), found, provenance),
        )

    monkeypatch.setattr(clpeel, "render", render)
    return record


# --- start-up ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["render", "--help"],
        ["layers", "--help"],
        ["compare", "--help"],
        [],
        ["render", "a.ply", "--resolution=0,0"],
    ],
)
def test_answers_without_heavy_imports(arguments: list[str]) -> None:
    code = (
        "import sys, clpeel.command.main; code = clpeel.command.main.main(sys.argv[1:]); "
        "heavy = {'numpy', 'pyopencl', 'trimesh', 'PIL', 'importlib.metadata'} & set(sys.modules); "
        "sys.exit(f'imported {heavy}' if heavy else code)"
    )
    done = subprocess.run([*PYTHON, "-c", code, *arguments], capture_output=True, text=True, check=False)
    assert "imported" not in done.stderr
    assert done.returncode == (2 if "--resolution=0,0" in arguments else 0)


def test_help_is_ascii_and_names_every_option() -> None:
    text = run("render", "--help-all").stdout.decode("ascii")
    for option in (
        "--output -o --drop-duplicates --animation-index --animation-time "
        "--resolution --opacity --color --background-color --no-background --unlit "
        "--camera-position --camera-focal-point --camera-view-up --camera-view-angle --camera-direction "
        "--camera-azimuth-angle --camera-elevation-angle --camera-zoom-factor --camera-orthographic --up "
        "--clipping-range --technique --passes --no-occlusion-query --coincident --precision --layers --memory "
        "--device --lanes --samples --variant --projected --thickness-range --no-scale-bar --map --sigma --light-color "
        "--stats[=FILE.json] --verbose --quiet --no-progress"
    ).split():
        assert option in text


def test_version() -> None:
    assert re.fullmatch(rb"clpeel (\d+\.\d+\.\d+|not installed)\n", run("--version").stdout)


def test_runs_against_the_installed_package() -> None:
    """A tree full of sources must not hide that a file is missing from the wheel."""
    required = "CLPEEL_REQUIRE_INSTALLED" in os.environ
    try:
        origin = json.loads(metadata.distribution("clpeel").read_text("direct_url.json") or "{}")
    except metadata.PackageNotFoundError:
        origin = {"dir_info": {"editable": True}}
    if origin.get("dir_info", {}).get("editable") and not required:
        pytest.skip("clpeel is not installed, or editable")
    assert not Path(clpeel.__file__).resolve().is_relative_to(ROOT / "clpeel")
    assert "site-packages" in Path(clpeel.__file__).parts


# --- arguments --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["{}={}", "{} {}"])
@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--resolution", "640,480", (640, 480)),
        ("--camera-position", "-1,0,2", (-1, 0, 2)),
        ("--camera-position", "-.5,-0,-1e3", (-0.5, 0, -1000)),
        ("--camera-focal-point", "0,-1,2", (0, -1, 2)),
        ("--camera-direction", "-Z", (0, 0, -1)),
        ("--camera-direction", "-1,-1,0", (-1, -1, 0)),
        ("--camera-direction", "-xy", "-xy"),
        ("--camera-view-up", "+X", (1, 0, 0)),
        ("--up", "-Y", (0, -1, 0)),
        ("--up", "z", (0, 0, 1)),
        ("--camera-azimuth-angle", "-30", -30),
        ("--camera-elevation-angle", "-1e1", -10),
        ("--camera-zoom-factor", "1.5", 1.5),
        ("--clipping-range", "0.1,10", (0.1, 10)),
        ("--clipping-range", "-1,10", (-1, 10)),
        ("--opacity", "0.6", 0.6),
        ("--color", "1,0.5,0", (1, 0.5, 0)),
        ("--color", "#ff0000", (1, 0, 0)),
        ("--background-color", "white", (1, 1, 1)),
        ("--background-color", "white:0,0.5,1", ((1, 1, 1), (0, 0.5, 1))),
        ("--technique", "sort", "sort"),
        ("--memory", "512M", "512M"),
        ("--device", "1", "1"),
        ("--lanes", "64", 64),
        ("--samples", "16", 16),
        ("--output", "-", "-"),
        ("-o", "x.png", "x.png"),
    ],
)
def test_both_forms_of_an_option(form: str, option: str, value: str, expected: Any) -> None:
    if option == "-o" and form == "{}={}":
        form = "{}{}"
    dest = {"-o": "output", "--layers": "layers_per_pass"}.get(option, option[2:].replace("-", "_"))
    options = parse(*form.format(option, value).split(" "))
    assert {**vars(options), **options.pieces[0].options}[dest] == expected


def test_files_may_stand_anywhere() -> None:
    options = parse("--unlit", "b.ply", "--up", "-Z", "c.ply", "-o", "-", "--stats", "d.ply")
    assert options.files == ["a.ply", "b.ply", "c.ply", "d.ply"]
    assert (options.unlit, options.up, options.output, options.stats) == (True, (0, 0, -1), "-", "-")


def test_a_file_may_begin_with_a_minus() -> None:
    assert parse("--unlit", "--", "-b.ply", "--unlit").files == ["a.ply", "-b.ply", "--unlit"]


def test_stats_takes_a_file_only_after_an_equals_sign() -> None:
    assert parse().stats is None
    assert parse("--stats", "b.ply").stats == "-"
    assert parse("--stats=b.json").stats == "b.json"


@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_any_vector_passes_unharmed(vector: tuple[float, float, float]) -> None:
    text = ",".join(repr(x) for x in vector)
    assert parse("--camera-position", text).camera_position == vector


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "FILE"),
        (["a.ply", "--resolution", "0,10"], "each in 1..65536, got '0,10'"),
        (["a.ply", "--resolution", "-5,10"], "each in 1..65536, got '-5,10'"),
        (["a.ply", "--resolution", "10,99999999999"], "each in 1..65536"),
        (["a.ply", "--resolution", "10"], "expected W,H"),
        (["a.ply", "--resolution", "1.5,2"], "expected W,H"),
        (["a.ply", "--resolution", "axb"], "expected W,H"),
        (["a.ply", "--opacity", "1.1"], "0..1, got '1.1'"),
        (["a.ply", "--opacity", "-0.1"], "0..1, got '-0.1'"),
        (["a.ply", "--opacity", "nan"], "0..1, got 'nan'"),
        (["a.ply", "--color", "2,0,0"], "--color: expected R,G,B"),
        (["a.ply", "--color", "nan,0,0"], "--color: expected R,G,B"),
        (["a.ply", "--color", "0,0"], "--color: expected R,G,B"),
        (["a.ply", "--color", "no-such-colour"], "--color: expected R,G,B"),
        (["a.ply", "--background-color", "#12"], "--background-color: expected R,G,B"),
        (["a.ply", "--background-color", "white:"], "--background-color: bottom: expected R,G,B"),
        (["a.ply", "--background-color", "red:blu"], "got 'blu'; did you mean blue?"),
        (["a.ply", "--background-color", "red:white:blue"], "--background-color: expected a colour, or 2 for top and"),
        (["a.ply", "--color", "#11223344"], "--opacity"),
        (["a.ply", "--camera-position", "1,2"], "expected X,Y,Z"),
        (["a.ply", "--camera-position", "1,2,inf"], "expected X,Y,Z"),
        (["a.ply", "--camera-direction", "-Q"], "expected an axis"),
        (["a.ply", "--camera-direction", "isometric"], "a view such as iso or -xy"),
        (["a.ply", "--camera-direction", "0,0,0"], "expected an axis"),
        (["a.ply", "--up", "0,0,0"], "expected an axis"),
        (["a.ply", "--camera-zoom-factor", "0"], "above 0"),
        (["a.ply", "--camera-view-angle", "wide"], "expected a number"),
        (["a.ply", "--clipping-range", "1"], "expected NEAR,FAR"),
        (["a.ply", "--lanes", "0"], "1 or more"),
        (["a.ply", "--lanes", "x"], "1 or more"),
        (["a.ply", "--samples", "-4"], "1 or more"),
        (["a.ply", "--up"], "expected one argument"),
        (["a.ply", "--technique", "-o", "x.png"], "expected one argument"),
        (["a.ply", "--opcity", "1"], "did you mean --opacity? (see clpeel render --help)"),
        (["a.ply", "--no-such-thing-at-all"], "unknown option --no-such-thing-at-all (see clpeel render --help)"),
        (["a.ply", "-q"], "unknown option -q (see clpeel render --help)"),
        (["a.ply", "--opacity=.4", "--opacity=.8"], "--opacity: expected once, got 2 of them"),
        (["a.ply", "b.ply", "c.ply", *["--color=red"] * 2], "expected once for all files, or once for each of the 3"),
        (["a.ply", "--samples=1", "--samples=4"], "--samples: expected once, got two that differ"),
        (["a.ply", "-o", "x.png", "--output=y.png"], "--output: expected once, got two that differ"),
        (["a.ply", "--color", "stealblue"], "did you mean steelblue?"),
        (["a.ply", "-o", "x.gif"], "ending in .png, .jpg, .jpeg, .webp, .tif, .tiff, .exr or .npz, got 'x.gif'"),
        (["a.ply", "-o", ""], "expected a file name"),
        (["a.ply", "-o", "/no/such/folder/x.png"], "does not exist"),
        (["a.ply", "-o", "x" * 300 + ".png"], "cannot write"),
        (["a.ply", "-o", "/"], "got the folder"),
        (["a.ply", "--stats=/no/such/folder/x.json"], "--stats: the folder"),
        (["a.ply", "--technique", "no-such"], "sort"),
        (["a.ply", "--memory", "lots"], "512M"),
        (["no-such-file.ply"], "no-such-file.ply"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["render", *arguments]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("clpeel: error: ") and err.count("\n") == 1
    assert message in err
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("arguments", [["part.stl"], ["frobnicate"], ["devices", "x"]])
def test_a_wrong_command_is_one_line(arguments: list[str], capfd: Any) -> None:
    assert cli.main(arguments) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert ("clpeel render part.stl" in err) == (arguments == ["part.stl"])


def test_one_opacity_for_all_files_or_one_for_each() -> None:
    assert parse().pieces[0].options == {}
    for between in (["b.ply", "--opacity=.4", "--opacity=.8"], ["--opacity=.4", "b.ply", "--opacity", "0.8"]):
        options = parse(*between, "--color=red")
        assert options.files == ["a.ply", "b.ply"]
        assert [piece.options for piece in options.pieces] == [
            {"opacity": opacity, "color": (1, 0, 0)} for opacity in (0.4, 0.8)
        ]


def test_an_option_may_be_repeated_with_the_same_value() -> None:
    options = parse("--samples=4", "--samples", "4", "--unlit", "--unlit")
    assert (options.samples, options.unlit) == (4, True)


# --- the camera -------------------------------------------------------------------------------------------------------


@pytest.fixture
def box() -> Any:
    corners = np.array([[x, y, z] for x in (1, 3) for y in (2, 4) for z in (3, 5)], float)
    return clpeel.Scene.from_arrays(corners, [[0, 1, 2], [5, 6, 7]], color=(255, 0, 0, 128))


def test_camera_by_default_sees_all_from_the_front(box: Any) -> None:
    camera = make_camera(parse(), box)
    expected = clpeel.Camera.frame(box, "-Z", "+Y", 30.0, aspect=1.0)
    assert camera == expected


def test_camera_position_alone_looks_at_the_centre(box: Any) -> None:
    camera = make_camera(parse("--camera-position", "9,3,4"), box)
    np.testing.assert_allclose(camera.focal_point, (2, 3, 4))
    np.testing.assert_allclose(camera.position, (9, 3, 4))


def test_camera_focal_point_alone_keeps_direction_and_distance(box: Any) -> None:
    plain = make_camera(parse(), box)
    camera = make_camera(parse("--camera-focal-point", "0,0,0"), box)
    np.testing.assert_allclose(camera.position, np.subtract(plain.position, plain.focal_point))


@pytest.mark.parametrize(
    ("up", "looks"),
    [("+Y", "-Z"), ("-Y", "+Z"), ("+Z", "+Y"), ("-Z", "-Y"), ("+X", "-Z"), ("-X", "-Z")],
)
def test_up_chooses_the_front_as_f3d_does(box: Any, up: str, looks: str) -> None:
    camera = make_camera(parse("--up", up), box)
    expected = clpeel.Camera.frame(box, looks, up)
    np.testing.assert_allclose(camera.position, expected.position)
    np.testing.assert_allclose(camera.view_up, expected.view_up)


def test_a_named_view_says_what_is_up(box: Any) -> None:
    for word in ("iso", "-xz"):
        assert make_camera(parse("--camera-direction", word), box) == clpeel.Camera.frame(box, word)
    camera = make_camera(parse("--camera-direction", "xy", "--up", "+X"), box)
    assert camera == clpeel.Camera.frame(box, "xy", "+X")


def test_looking_straight_down_is_allowed_unless_up_was_given(box: Any) -> None:
    camera = make_camera(parse("--camera-direction", "-Y"), box)
    np.testing.assert_allclose(camera.view_up, (0, 0, -1))
    with pytest.raises(InputError, match="view_up"):
        make_camera(parse("--camera-direction", "-Y", "--camera-view-up", "+Y"), box)


def test_azimuth_elevation_and_zoom_come_last(box: Any) -> None:
    angles = ("--camera-azimuth-angle=20", "--camera-elevation-angle=-10", "--camera-zoom-factor=2")
    camera = make_camera(parse(*angles, "--resolution=200,100"), box)
    assert camera == clpeel.Camera.frame(box, aspect=2.0).azimuth(20).elevation(-10).zoom(2)


def test_a_flat_scene_is_looked_at_unless_a_direction_was_given() -> None:
    floor = clpeel.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])

    def seen(*given: str) -> Any:
        camera = make_camera(parse(*given), floor)
        return camera.axes()[1:].round(9).tolist()

    assert seen() == seen("--camera-focal-point=0,0,0") == [[0, 0, -1], [0, -1, 0]]
    assert seen("--up=+Z") == [[0, 0, 1], [0, 1, 0]]
    assert seen("--up=-Y") == [[0, 0, 1], [0, 1, 0]]
    assert seen("--camera-view-up=+X") == [[1, 0, 0], [0, -1, 0]]
    assert seen("--camera-direction=-Z") == seen("--camera-position=0.5,0,9") == [[0, 1, 0], [0, 0, -1]]


def test_orthographic_angle_and_clipping_range(box: Any) -> None:
    camera = make_camera(parse("--camera-orthographic", "--camera-view-angle=45", "--clipping-range=-1,9"), box)
    assert (camera.orthographic, camera.view_angle, camera.clipping_range) == (True, 45, (-1, 9))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--clipping-range=2,1"],
        ["--clipping-range=1,1"],
        ["--camera-view-angle=180"],
        ["--camera-view-angle=0"],
        ["--camera-view-angle=0.5235987755982988"],
        ["--camera-azimuth-angle=-1.5707963267948966"],
        ["--camera-position=1,1,1", "--camera-focal-point=1,1,1"],
        ["--camera-position=0,5,0", "--camera-focal-point=0,0,0", "--camera-view-up=0,1,0"],
    ],
)
def test_impossible_cameras_are_one_line(mesh: Path, fake: Any, arguments: list[str], capfd: Any) -> None:
    output = mesh.with_name("out.png")
    assert cli.main(["render", str(mesh), "-o", str(output), *arguments]) == 2
    assert capfd.readouterr().err.count("\n") == 1
    assert not output.exists() and not fake.calls


# --- what render is asked, and what is written ------------------------------------------------------------------------


def test_render_is_asked_for_what_the_options_say(mesh: Path, fake: Any, tmp_path: Path, capfd: Any) -> None:
    output = str(tmp_path / "out.png")
    assert cli.main(["render", str(mesh), "-o", output]) == 0
    assert f"wrote {output}" in capfd.readouterr().err
    arguments = (
        "--resolution 30,20 --unlit --no-background --memory 64M --device 0 --lanes 16 --opacity 0.5 --samples 8"
    )
    assert cli.main(["render", str(mesh), "-o", output, "--quiet", *arguments.split()]) == 0
    plain, full = fake.calls
    assert (plain.size, plain.technique, plain.lighting, plain.background) == (
        (1024, 1024),
        "sort",
        "kit",
        BACKGROUND,
    )
    assert (plain.device, plain.lanes) == (None, None)
    assert not vars(plain).keys() & {"memory", "opaque", "samples"}  # what is not given keeps its default
    assert (full.size, full.lighting, full.background) == ((30, 20), "none", None)
    assert (full.memory, full.device, full.lanes) == ("64M", "0", 16)
    assert full.samples == 8
    assert len(full.scene.faces) == 4
    assert pixels(output).shape[:2] == (20, 30)
    assert capfd.readouterr() == ("", "")


def test_stats_as_a_table(mesh: Path, fake: Any, tmp_path: Path, capfd: Any) -> None:
    assert cli.main(["render", str(mesh), "--stats", "-o", str(tmp_path / "out.png")]) == 0
    out, err = capfd.readouterr()
    for row in (
        "technique +sort",
        "fragments +1,234,567",
        "most layers in a pixel +9",
        "discarded triangles +2",
        r"raster +0\.2500",
        r"fragments +4\.0 KiB",
        "device +a device",
        "load +0",
    ):
        assert re.search(row, out), row
    assert "2 triangles with NaN" in err


def test_stats_as_json(mesh: Path, fake: Any, tmp_path: Path, capfd: Any) -> None:
    path = tmp_path / "stats.json"
    assert cli.main(["render", str(mesh), f"--stats={path}", "-o", str(tmp_path / "out.png")]) == 0
    stats = json.loads(path.read_text())
    assert (stats["fragments"], stats["samples_passed"]) == (1234567, [7])
    assert stats["seconds"]["raster"] == 0.25
    assert capfd.readouterr().out == ""
    assert sorted(os.listdir(tmp_path)) == ["out.png", "stats.json", "tetrahedron.off"]


@pytest.mark.parametrize("to", ["stdout", "pipe"])
def test_png_alone_on_standard_output(mesh: Path, tmp_path: Path, to: str) -> None:
    arguments = ["render", str(mesh), "--resolution=40,30", "--stats", "--opacity=.5"]
    if to == "stdout":
        done = run(*arguments, "-o", "-")
        assert b"technique" in done.stderr
    else:
        done = run(*arguments, "-o", "/dev/stderr")  # not a regular file: it is written to, not replaced
        done.stdout, done.stderr = done.stderr[done.stderr.index(b"\x89PNG") :], done.stdout
    assert done.returncode == 0, done.stderr
    assert Image.open(io.BytesIO(done.stdout)).size == (40, 30)
    if to == "stdout":
        assert done.stdout.endswith(b"IEND\xaeB`\x82")


@pytest.mark.parametrize(
    "options",
    [
        ["--stats={mesh}"],
        ["--stats={folder}/../{name}/tetrahedron.off"],
        ["--stats={folder}/out.png"],
        ["--technique=thickness", "--map={folder}/a.npy", "--stats={folder}/a.npy"],
        ["--technique=thickness", "--map={folder}/link.npy"],
    ],
)
def test_no_output_is_an_input_or_another_output(
    options: list[str], mesh: Path, fake: Any, tmp_path: Path, capfd: Any
) -> None:
    (tmp_path / "link.npy").symlink_to(mesh)
    given = [option.format(mesh=mesh, folder=tmp_path, name=tmp_path.name) for option in options]
    assert cli.main(["render", str(mesh), "-o", str(tmp_path / "out.png"), *given]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and ": expected a file of its own, got " in err
    assert not fake.calls and mesh.read_text() == TETRAHEDRON and not (tmp_path / "out.png").exists()


def test_outputs_that_keep_nothing_may_be_the_same(mesh: Path, fake: Any) -> None:
    nowhere = ["-o", os.devnull, f"--stats={os.devnull}"]
    assert cli.main(["render", str(mesh), *nowhere]) == 0
    assert not Path(os.devnull).is_file()


def test_links_in_a_circle_are_refused_before_any_work(mesh: Path, fake: Any, tmp_path: Path, capfd: Any) -> None:
    (tmp_path / "x.png").symlink_to("x.png")
    assert cli.main(["render", str(mesh), "-o", str(tmp_path / "x.png")]) == 2
    assert "Too many levels of symbolic links" in capfd.readouterr().err
    assert not fake.calls and (tmp_path / "x.png").is_symlink()


def test_each_file_gets_its_own_opacity_and_colour(mesh: Path, fake: Any, tmp_path: Path) -> None:
    given = ["render", str(mesh), "--opacity=0.2", str(mesh), "--opacity=1", "--quiet", "-o", str(tmp_path / "out.png")]
    assert cli.main(given) == cli.main([*given, "--color=red", "--color=blue"]) == 0
    plain, colored = ([*dict.fromkeys(map(tuple, call.scene.colors.tolist()))] for call in fake.calls)
    assert [alpha for *_, alpha in plain] == [51, 255]
    assert colored == [(1, 0, 0, pytest.approx(0.2)), (0, 0, 1, 1)]


def test_duplicates_are_dropped_where_that_is_asked_for(
    mesh: Path, fake: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load, asked = clpeel.load, []

    def noting(*sources: Any, **options: Any) -> Any:
        asked.append(options.pop("drop_duplicates", None))
        return load(*sources, **options)

    monkeypatch.setattr(clpeel, "load", noting)
    given = ["render", str(mesh), str(mesh), "--quiet", "-o", str(tmp_path / "out.png")]
    assert cli.main(given) == cli.main([*given, "--drop-duplicates"]) == 0
    assert asked == [None, True]
    assert cli.main([*given, "--drop-duplicates", "--opacity=1", "--opacity=0.5"]) == 0
    assert asked == [None, True, None, None, True]  # those of both files together
    assert cli.main(["demo", "--drop-duplicates"]) == 2


def test_a_moment_of_an_animation_is_asked_for(
    mesh: Path, fake: Any, tmp_path: Path, monkeypatch: Any, capfd: Any
) -> None:
    asked, still = [], clpeel.load(mesh)

    def noting(*sources: Any, **options: Any) -> Any:
        asked.append((sources, options.get("animation_index"), options.get("animation_time")))
        return still

    monkeypatch.setattr(clpeel, "load", noting)
    words = ["--quiet", "-o", str(tmp_path / "out.png")]
    moment = ["--animation-index", "1", "--animation-time", "-0.5"]
    assert cli.main(["render", "a.glb", "b.ply", *words, *moment]) == cli.main(["render", "a.glb", *words]) == 0
    assert asked == [(("a.glb", "b.ply"), 1, -0.5), (("a.glb",), None, None)]
    asked.clear()
    each = ["--opacity=1", "--opacity=0.5"]
    assert cli.main(["render", "a.GLTF.gz", "b.ply", *words, *moment, *each]) == 0
    assert asked == [(("a.GLTF.gz",), 1, -0.5), (("b.ply",), None, None), ((still, still), None, None)]
    asked.clear()
    assert cli.main(["render", "b.ply", "c.ply", *words, *moment, *each]) == 0
    assert asked[0] == (("b.ply",), 1, -0.5)  # which is an error
    for wrong in ("--animation-index=-1", "--animation-index=x", "--animation-time=x"):
        assert cli.main(["render", "a.glb", wrong]) == 2
        assert wrong.partition("=")[0] in capfd.readouterr().err


def test_notes_about_the_picture_are_said_once(mesh: Path, tmp_path: Path, capfd: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(clpeel, "load", lambda *_, **__: replace(load(mesh), notes=("of the scene",)))
    load, render = clpeel.reading.load.load, clpeel.render

    def noting(*arguments: Any, **options: Any) -> Any:
        result = render(*arguments, **options)
        return replace(result, stats=replace(result.stats, notes=["of the scene", "of the picture"]))

    monkeypatch.setattr(clpeel, "render", noting)
    given = ["render", str(mesh), "--resolution=8,8", "-o", str(tmp_path / "out.png")]
    assert cli.main(given) == 0
    notes = re.findall(r"clpeel: note: (.*)", capfd.readouterr().err)
    assert notes == ["of the scene", "of the picture"]
    assert cli.main([*given, "--quiet"]) == 0 and capfd.readouterr().err == ""


def test_a_link_is_written_through(mesh: Path, fake: Any, tmp_path: Path) -> None:
    (tmp_path / "link.png").symlink_to(tmp_path / "real.png")
    assert cli.main(["render", str(mesh), "-o", str(tmp_path / "link.png")]) == 0
    assert (tmp_path / "link.png").is_symlink() and (tmp_path / "real.png").is_file()


# --- when things go wrong ---------------------------------------------------------------------------------------------


def opencl_error(kind: str, text: str) -> Exception:
    import pyopencl

    error: Exception = getattr(pyopencl, kind)(text)
    return error


@pytest.mark.parametrize(
    ("make", "code", "message"),
    [
        (lambda: InputError("layers: expected 1..64, got 0"), 2, "layers: expected 1..64, got 0"),
        (lambda: NoDeviceError("no OpenCL device found: install one"), 3, "install one"),
        (lambda: KeyboardInterrupt(), 130, "interrupted"),
        (lambda: MemoryError(), 1, "--resolution"),
        (lambda: opencl_error("MemoryError", "clEnqueue failed: MEM_OBJECT_ALLOCATION_FAILURE"), 1, "--memory"),
        (lambda: opencl_error("RuntimeError", "clBuild failed: OUT_OF_HOST_MEMORY"), 1, "--memory"),
        (lambda: opencl_error("LogicError", "clBuild failed: INVALID_VALUE"), 1, "--device"),
        (lambda: OSError(28, "No space left on device", "x.png"), 1, "No space left on device"),
        (lambda: ZeroDivisionError("a\nb"), 1, "clpeel report"),
    ],
)
def test_a_failure_is_one_line_and_leaves_the_old_file(
    mesh: Path, fake: Any, tmp_path: Path, capfd: Any, make: Any, code: int, message: str
) -> None:
    output = tmp_path / "out.png"
    output.write_bytes(b"the old picture")
    fake.outcome = make()
    assert cli.main(["render", str(mesh), "-o", str(output)]) == code
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and message in err
    assert output.read_bytes() == b"the old picture"
    assert sorted(os.listdir(tmp_path)) == ["out.png", "tetrahedron.off"]


def test_verbose_shows_the_trace(mesh: Path, fake: Any, tmp_path: Path, capfd: Any) -> None:
    fake.outcome = ZeroDivisionError("oh")
    assert cli.main(["render", str(mesh), "-o", str(tmp_path / "out.png"), "--verbose"]) == 1
    assert "Traceback" in capfd.readouterr().err


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_refused_at_once(mesh: Path, fake: Any, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    assert cli.main(["render", str(mesh), "-o", str(folder / "out.png")]) == 2
    assert "not writable" in capfd.readouterr().err and not fake.calls


def test_a_reader_that_goes_away_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as pipe:
        done = subprocess.run([*PYTHON, "-m", "clpeel", "report"], stdout=pipe, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (cli.EXIT_BROKEN_PIPE, b"")


@pytest.mark.parametrize(
    ("arguments", "streams", "code", "message"),
    [
        (["techniques"], ">&-", 1, "cannot write to standard output: it is closed"),
        (["render", "{mesh}", "-o", "-"], ">&-", 1, "cannot write to standard output: it is closed"),
        (["render", "{mesh}", "-o", "x.png", "--stats"], ">&-", 1, "cannot write to standard output: it is closed"),
        (["techniques"], ">/dev/full", 1, "cannot write to standard output: No space left on device"),
        (["--help"], ">/dev/full", 1, "cannot write to standard output: No space left on device"),
        (["render", "{mesh}", "--no-such"], "2>&-", 2, ""),
        (["render", "{mesh}", "--no-such"], "2>/dev/full", 2, ""),
    ],
)
def test_streams_that_cannot_be_written(
    arguments: list[str], streams: str, code: int, message: str, mesh: Path, tmp_path: Path
) -> None:
    if "/dev/full" in streams and not os.path.exists("/dev/full"):
        pytest.skip("other systems have no /dev/full")
    command = [*PYTHON, "-m", "clpeel", *(argument.format(mesh=mesh) for argument in arguments)]
    shell = ["sh", "-c", f'"$@" {streams}', "sh", *command]
    done = subprocess.run(shell, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr == (f"clpeel: error: {message}\n" if message else "")
    assert os.listdir(tmp_path) == [mesh.name]


def test_a_picture_needs_no_stream(mesh: Path, tmp_path: Path) -> None:
    shell = ["sh", "-c", '"$@" <&- >&- 2>&-', "sh", *PYTHON, "-m", "clpeel", "render", str(mesh), "--resolution=9,9"]
    assert subprocess.run([*shell, "-o", "x.png"], check=False, cwd=tmp_path).returncode == 0
    assert pixels(tmp_path / "x.png").shape[:2] == (9, 9)


def test_without_streams_main_works_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert cli.main(["techniques"]) == 1
    assert cli.main(["render", "--no-such"]) == 2


def test_terminated_it_leaves_nothing_behind(tmp_path: Path, mesh: Path, fake: Any, capfd: Any) -> None:
    def layers(*_: Any) -> None:
        write_whole(next(tmp_path.glob(".clpeel-*.part")) / "layer-01.png", b"1")
        os.kill(os.getpid(), signal.SIGTERM)

    fake.layers = SimpleNamespace(count=1, picture=layers)
    assert cli.main(["layers", str(mesh), "-o", str(tmp_path / "out")]) == 143
    assert capfd.readouterr().err.endswith("clpeel: terminated\n")
    assert os.listdir(tmp_path) == [mesh.name]
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_who_handles_sigterm_goes_on_doing_so(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        monkeypatch.setitem(cli.COMMANDS, "techniques", lambda _: os.kill(os.getpid(), signal.SIGTERM) or 0)
        assert cli.main(["techniques"]) == 0
    finally:
        signal.signal(signal.SIGTERM, before)
    assert seen == [signal.SIGTERM]


@pytest.fixture
def no_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    import pyopencl

    def get_platforms() -> list[Any]:
        raise pyopencl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    monkeypatch.setattr(pyopencl, "get_platforms", get_platforms)


@pytest.mark.parametrize("arguments", [["demo", "-o", "x.png"], ["devices"]])
def test_no_device_is_exit_code_3_and_says_how_to_install_one(
    no_devices: None, arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 3
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and "pip install pocl-binary-distribution" in err
    assert os.listdir(tmp_path) == []


def test_report_works_without_a_device(no_devices: None, capfd: Any) -> None:
    assert cli.main(["report"]) == 0
    assert "no OpenCL device found" in capfd.readouterr().out


# --- progress ---------------------------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_shows_on_a_terminal_once_work_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    late = Progress(delay=60)
    late(0.5, "rasterize")
    late.clear()
    assert sys.stderr.getvalue() == ""
    now = Progress(delay=0)
    now.INTERVAL = 60  # no second drawing
    now(0.5, "rasterize")
    while not sys.stderr.getvalue():
        time.sleep(0.01)
    now(0.6, "too soon after")
    now.clear()
    assert re.fullmatch(r"\r\[#{15}-{15}\]  50% rasterize\x1b\[K\r\x1b\[K", sys.stderr.getvalue())


def test_progress_is_silent_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    for stream, enabled in ((io.StringIO(), True), (Terminal(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        bar = Progress(enabled, delay=0)
        bar(0.5, "rasterize")
        bar.clear()
        assert stream.getvalue() == ""


# --- for real ---------------------------------------------------------------------------------------------------------


def test_techniques_are_listed(capfd: Any) -> None:
    from clpeel.techniques import TECHNIQUES

    assert cli.main(["techniques"]) == 0
    lines = capfd.readouterr().out.splitlines()
    for name, technique in TECHNIQUES.items():
        assert sum(line.split(" ")[0] == name and technique.summary in line for line in lines) == 1
    assert sum("options: " in line and "--hazard-window" in line for line in lines) == 1


def test_a_picture_by_passes_is_the_one_by_tiles(tmp_path: Path, squares: Path, capfd: Any) -> None:
    call = ["render", str(squares), "--opacity", "0.5", "--resolution", "40,30", "--technique", "multi-layer-peeling"]
    pictures = []
    for name, extra in (("tiles", []), ("passes", ["--execution", "passes"]), ("race", ["--racing-writes"])):
        path, stats = tmp_path / f"{name}.png", tmp_path / f"{name}.json"
        by_passes = ["--execution=passes"] if name == "race" else []
        assert cli.main([*call, *extra, *by_passes, "-o", str(path), f"--stats={stats}"]) == 0, name
        assert json.loads(stats.read_text())["execution"] == ("tiles" if name == "tiles" else "passes")
        pictures.append(pixels(path))
    assert (pictures[0] == pictures[1]).all() and (pictures[0] == pictures[2]).all()
    assert json.loads((tmp_path / "race.json").read_text())["inner_passes"] == [2, 1]
    assert cli.main(["render", str(squares), "-o", str(tmp_path / "no.png"), "--execution", "passes"]) == 2
    assert "execution: expected 'tiles' for the technique 'sort', got 'passes'" in capfd.readouterr().err
    assert not (tmp_path / "no.png").exists()


@pytest.mark.parametrize("color", ["white", "black"])
@pytest.mark.parametrize("more", [[], ["--opacity=0.4"], ["--opacity=0.4", "--unlit"]])
def test_white_things_and_black_ones_show_before_the_default(
    tmp_path: Path, capfd: Any, color: str, more: list[str]
) -> None:
    """A square that faces the camera differs from what is behind it by some steps of 255 in each channel."""
    (tmp_path / "t.off").write_text("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    output = str(tmp_path / "out.png")
    call = ["render", str(tmp_path / "t.off"), "-o", output, "--resolution=20,20", f"--color={color}", *more]
    assert cli.main(call) == 0
    seen = pixels(output).astype(int)[..., :3]
    assert (
        seen[0, 0].tolist() == [200, 204, 210]
        and (np.abs(seen[10, 10] - seen[0, 0]) >= (10 if more == ["--opacity=0.4"] else 17)).all()
    )
    assert "is blank:" not in capfd.readouterr().err


def test_a_picture_that_is_blank_before_the_default_is_noted(tmp_path: Path, capfd: Any, mesh: Path) -> None:
    call = ["render", str(mesh), "-o", str(tmp_path / "out.png"), "--resolution=20,20", "--unlit"]
    assert cli.main([*call, "--color=#c8ccd2"]) == 0
    assert "note: the picture is blank: its surfaces have the background's colour" in capfd.readouterr().err
    assert cli.main([*call, "--color=white"]) == 0 and "is blank:" not in capfd.readouterr().err


def test_all_options_of_pictures_have_a_flag() -> None:
    render = command_line.make_parser().commands["render"]
    flags = {flag for action in render.options() for flag in action.option_strings}
    elsewhere = {"size": "--resolution", "background": "--background-color", "lighting": "--lighting"}
    not_here = {"keep_color", "layers", "maps"}  # the command writes files: these are --map, and `clpeel layers`
    for each in options_of(PictureOptions):
        assert each.name in not_here or elsewhere.get(each.name, each.flag) in flags, each.name


def test_devices_are_numbered(capfd: Any) -> None:
    assert cli.main(["devices"]) == 0
    heading, *rows = capfd.readouterr().out.splitlines()
    assert heading.split() == ["number", "kind", "units", "memory", "OpenCL", "self-test", "platform", "name"]
    devices = [row for row in rows if row[0].isdigit()]
    assert [row.split()[0] for row in devices] == [str(number) for number in range(len(devices))]


def test_the_default_device_has_a_star_and_a_reason(capfd: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CLPEEL_DEVICE", raising=False)
    assert cli.main(["devices"]) == 0
    _, first, *others = capfd.readouterr().out.splitlines()
    assert first.startswith("0 * ") and sum(line.startswith("* default: ") for line in others) == 1
    assert any(line.endswith("; choose another by --device or CLPEEL_DEVICE") for line in others)


def test_drivers_that_offer_no_device_are_listed(tmp_path: Path, capfd: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken.icd").write_text("/nonexistent/libbroken.so")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    for command in ("devices", "report"):
        assert cli.main([command]) == 0
        said = capfd.readouterr().out
        assert f"driver '{tmp_path / 'broken.icd'}': /nonexistent/libbroken.so does not load: " in said


def test_report_names_versions_and_devices(capfd: Any) -> None:
    assert cli.main(["report"]) == 0
    out = capfd.readouterr().out
    for name in (
        "python",
        "clpeel",
        "pyopencl",
        "numpy",
        "trimesh",
        "Pillow",
        "system",
        "processor",
        "platform",
        "own defaults",
    ):
        assert name in out


def test_renders_over_a_gradient(mesh: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.png"
    words = "--resolution 64,48 --camera-direction -1,-1,-1 --background-color 0,1,0:#ff0000"
    assert cli.main(["render", str(mesh), "-o", str(output), *words.split()]) == 0
    column = pixels(output)[:, 0].astype(float)
    way = (np.arange(48) + 0.5) / 48
    assert np.abs(column[:, 0] - way * 255).max() <= 0.501 and np.abs(column[:, 1] - (1 - way) * 255).max() <= 0.501


def test_renders_a_file(mesh: Path, tmp_path: Path, capfd: Any) -> None:
    output = tmp_path / "out.png"
    arguments = "--resolution 64,48 --opacity 0.5 --no-background --camera-direction -1,-1,-1"
    assert cli.main(["render", str(mesh), str(mesh), "-o", str(output), *arguments.split()]) == 0
    image = pixels(output)
    assert image.shape == (48, 64, 4)
    assert image[0, 0, 3] == 0  # nothing in the corner
    assert image[24, 32, 3] in (239, 240)  # 1 - 0.5^4: two surfaces of each of two copies


def test_other_outcomes_leave_nothing_half_written(mesh: Path, tmp_path: Path, capfd: Any) -> None:
    bad = tmp_path / "bad.ply"
    bad.write_bytes(b"ply\nformat ascii 1.0\nend_header\n")
    assert cli.main(["render", str(bad), "-o", str(tmp_path / "out.png")]) == 2
    err = capfd.readouterr().err
    assert err.startswith("clpeel: error: ") and err.count("\n") == 1
    assert not (tmp_path / "out.png").exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems keep caches elsewhere")
def test_renders_without_a_home(mesh: Path, tmp_path: Path) -> None:
    environment = {
        name: value for name, value in os.environ.items() if name not in ("XDG_CACHE_HOME", "POCL_CACHE_DIR")
    }
    output = str(tmp_path / "out.png")
    done = run("render", str(mesh), "-o", output, "--resolution=9,9", env={**environment, "HOME": "/dev/null/nowhere"})
    note, wrote = done.stderr.splitlines()
    assert done.returncode == 0 and b"note: compiled kernels cannot be kept" in note and b"wrote" in wrote
    assert pixels(output).shape[:2] == (9, 9)


def test_demo_renders(tmp_path: Path, capfd: Any) -> None:
    output = tmp_path / "demo.png"
    assert cli.main(["demo", "-o", str(output), "--resolution=96,72", f"--stats={tmp_path / 'stats.json'}"]) == 0
    image = pixels(output)[..., :3]
    assert image.shape == (72, 96, 3)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 900
    stats = json.loads((tmp_path / "stats.json").read_text())
    assert stats["layers_max"] >= 15
    assert stats["discarded"] == 0


def test_peeling_less_than_there_is_says_what_that_hides(tmp_path: Path, capfd: Any) -> None:
    given = ["-o", str(tmp_path / "out.png"), "--resolution=48,36", f"--stats={tmp_path / 'stats.json'}"]
    assert cli.main(["demo", *given, "--technique=multi-layer-peeling", "--passes=2", "--layers=3"]) == 0
    stats = json.loads((tmp_path / "stats.json").read_text())
    assert (stats["passes"], stats["layers_max"]) == (2, 6)
    note = re.search(
        r"note: ([\d,]+) samples have more .* change no channel by more than (\S+) of 1", capfd.readouterr().err
    )
    assert note and int(note[1].replace(",", "")) == stats["truncated_pixels"] > 0
    assert float(note[2]) == pytest.approx(stats["truncation_bound"], rel=0.01)
    assert cli.main(["demo", *given, "--technique=depth-peeling", "--no-occlusion-query", "--coincident=paper"]) == 2
    assert "--passes: expected a number with --no-occlusion-query, as" in capfd.readouterr().err


@pytest.mark.parametrize("technique", [name for name, made in TECHNIQUES.items() if made.maps])
def test_a_map_is_written(technique: str, mesh: Path, tmp_path: Path, capfd: Any) -> None:
    picture, written = tmp_path / "out.png", tmp_path / "out.npy"
    given = ["render", str(mesh), "--resolution=200,150", f"--technique={technique}", f"--map={written}", "-o"]
    has_variants = "variant" in TECHNIQUES[technique].option_names
    for options in ([], ["--variant=total"], ["--variant", "first-solid", "--samples=4"]) if has_variants else ([],):
        written.unlink(missing_ok=True)
        assert cli.main([*given, str(picture), *options]) == 0
        numbers = np.load(written)
        assert numbers.dtype == np.float32 and numbers.shape == (150, 200) and numbers.max() > 0.2
    assert "note" not in capfd.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.npy", "out.png", "tetrahedron.off"]
    if "unpaired" not in TECHNIQUES[technique].maps:
        return
    # An open mesh: said in one line.
    opened = tmp_path / "open.off"
    opened.write_text(TETRAHEDRON.replace("4 4 0", "4 3 0", 1).replace("3 0 2 1\n", "", 1))
    assert cli.main([*given, str(picture), "--camera-direction=1,1,1"]) == 0
    given[1] = str(opened)
    assert cli.main([*given, str(picture), "--camera-direction=0,0,-1"]) == 0
    assert re.search(r"note: [\d,]+ pixels have crossings that do not pair up: the mesh is not", capfd.readouterr().err)


def test_thickness_on_the_command_line(mesh: Path, tmp_path: Path, capfd: Any) -> None:
    stats = tmp_path / "stats.json"
    given = ["render", str(mesh), "-o", str(tmp_path / "x.png"), "--resolution=200,150", f"--stats={stats}"]
    options = ["--technique=thickness", "--projected", "--thickness-range", "0,0.5", "--no-scale-bar"]
    assert cli.main([*given, *options]) == 0
    told = json.loads(stats.read_text())
    assert told["unit"] == "projected" and told["thickness_range"] == [0, 0.5] and told["unpaired_pixels"] == 0
    assert cli.main([*given, "--technique=translucency", "--sigma", "2.5", "--light-color=white"]) == 0
    assert json.loads(stats.read_text())["sigma"] == 2.5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--map=x.npy"], "--map: expected a technique that makes a map (thickness, translucency"),
        (
            ["--technique=thickness", "--map=x.jpg"],
            "--map: expected a name ending in .npy, .npz, .exr, .tif, .tiff or .png",
        ),
        (["--technique=thickness", "--map=no/such/x.npy"], "--map: the folder"),
        (["--technique=thickness", "--variant=all"], "variant: expected one of exact, total, first-solid; got 'all'"),
        (["--technique=thickness", "--thickness-range=2,1"], "--thickness-range: expected LOW,HIGH"),
        (["--technique=thickness", "--sigma=1"], "sigma: the technique 'thickness' has no such option"),
        (["--technique=translucency", "--sigma=-1"], "--sigma: expected a number of 0 or more, got '-1'"),
        (["--technique=translucency", "--light-color=nocolor"], "--light-color: expected R,G,B"),
        (
            ["--technique=translucency", "--no-scale-bar"],
            "--no-scale-bar: the technique 'translucency' has no such option",
        ),
        (["--projected"], "projected: the technique 'sort' has no such option"),
    ],
)
def test_thickness_options_that_cannot_be(
    options: list[str], message: str, mesh: Path, tmp_path: Path, capfd: Any
) -> None:
    assert cli.main(["render", str(mesh), "-o", str(tmp_path / "x.png"), *options]) == 2
    error = capfd.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "x.png").exists()


def test_every_command_has_its_texts_and_its_function() -> None:
    for bare in (False, True):
        assert list(command_line.make_parser(bare).commands) == list(command_line.TEXTS)
    assert set(command_line.TEXTS) == set(cli.COMMANDS)


def test_help_needs_no_options_of_commands(capfd: Any) -> None:
    """The help of clpeel itself is the same whether or not those are made."""
    assert cli.main(["--help"]) == 0
    assert capfd.readouterr().out == command_line.make_parser().format_help()
    check = (
        "import sys; from clpeel.command.main import main; main(['--help']); print('clpeel.techniques' in sys.modules)"
    )
    done = subprocess.run([*PYTHON, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("\nFalse\n")


NOT_NEEDED = (
    "trimesh numpy.ma difflib tomllib clpeel.rendering.self_test clpeel.rendering.known_layers "
    "clpeel.rendering.hidden_edges clpeel.stages.wires clpeel.stages.find_layers clpeel.stages.passes "
    "clpeel.stages.windows clpeel.scene.edges clpeel.scene.scalars clpeel.scene.grid clpeel.reading.libraries "
    "clpeel.pictures.colormaps clpeel.pictures.layers clpeel.command.scene_file clpeel.command.write_scene"
).split()
"""What a plain picture does without. Each of them takes a millisecond or more of a command's start, numpy.ma 20."""


def test_a_plain_picture_imports_nothing_that_it_does_not_need(mesh: Path, tmp_path: Path) -> None:
    check = "import sys; from clpeel.command.main import main; main(sys.argv[1:]); print(*sys.modules)"
    command = [*PYTHON, "-c", check, "render", str(mesh), "-o", str(tmp_path / "a.png"), "--resolution", "32,32"]
    subprocess.run(command, capture_output=True, check=True)  # the kernels are tested once
    modules = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert "clpeel.rendering.checking" in modules
    assert not {*NOT_NEEDED} & {*modules}


# --- light ------------------------------------------------------------------------------------------------------------


def test_files_with_lights_are_seen_by_them(mesh: Path, tmp_path: Path, fake: Any) -> None:
    """Other files are seen by the kit. What is asked for comes first."""
    document = Document()
    document.more["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "directional"}]}}
    document.more["nodes"] = [{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]
    lamp, output = str(document.path(tmp_path)), str(tmp_path / "out.png")
    for file, words, lighting in (
        (str(mesh), (), "kit"),
        (lamp, (), "scene"),
        (lamp, ("--lighting=kit",), "kit"),
        (lamp, ("--lighting=headlight",), "headlight"),
        (lamp, ("--unlit",), "none"),
        (lamp, ("--unlit", "--lighting=none"), "none"),
    ):
        assert cli.main(["render", file, "-o", output, *words]) == 0
        assert fake.calls[-1].lighting == lighting, words
    words = ("--light-intensity=2.5", "--highlights=full")
    assert cli.main(["render", lamp, "-o", output, *words]) == 0
    assert (fake.calls[-1].light_intensity, fake.calls[-1].highlights) == (2.5, "full")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--lighting=moon"], "--lighting: expected one of none, headlight, kit, scene; got 'moon'"),
        (["--lighting=kit", "--unlit"], "--unlit: expected no --lighting with it, got 'kit'"),
        (
            ["--lighting=scene"],
            "--lighting: expected lights in the file with 'scene', got none; 'kit' has lights of its own",
        ),
        (["--light-intensity=-1"], "--light-intensity: expected a number of 0 or more, got '-1'"),
        (["--highlights=some"], "--highlights: expected one of dimmed, full; got 'some'"),
    ],
)
def test_light_that_cannot_be_is_one_line(words: list[str], says: str, mesh: Path, tmp_path: Path, capfd: Any) -> None:
    output = tmp_path / "out.png"
    assert cli.main(["render", str(mesh), "-o", str(output), *words]) == 2
    lines = capfd.readouterr().err.strip().splitlines()
    assert lines[-1].startswith(f"clpeel: error: {says}"), lines
    assert not output.exists()
