"""The tool for contact sheets: layout, labels, and what is missing. Peers are scripts that stand in for them."""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path
from typing import Any

import contact_sheet as tool
import numpy as np
import plainly
import pytest
from PIL import Image
from sheets import programs
from sheets.layout import EMPTY, GAP, LINE, MOST_BYTES, composed, encoded
from sheets.programs import Cell
from sheets.views import BACKGROUND, DEFAULTS, SIDE, View

import clpeel

RED, BLUE = (255, 0, 0), (0, 0, 255)
DRAWS = """
import json, sys
from PIL import Image
job = json.loads(sys.argv[1])
Image.new("RGB", (job["side"],) * 2, "{color}").save(job["out"])
print("noise")
print("{label}")
"""


@pytest.fixture
def peers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """peers(NAME=script) puts scripts in the place of the peers'."""

    def put(**scripts: str) -> None:
        found = {name: tmp_path / f"{name}.py" for name in scripts}
        for name, text in scripts.items():
            found[name].write_text(text)
        monkeypatch.setattr(programs, "PEERS", found)

    return put


def cell_colors(page: Image.Image, place: int) -> list[Any]:
    """The colours of a cell of a sheet."""
    left = place * (SIDE + GAP)
    found = page.crop((left, 2 * LINE, left + SIDE, 2 * LINE + SIDE)).getcolors(1 << 20)
    assert found is not None
    return [color for _, color in sorted(found, reverse=True)]


def pixels_of(folder: Path, name: str) -> Image.Image:
    with Image.open(folder / f"{name}.png") as picture:
        return picture.convert("RGB")


# --- the picture ------------------------------------------------------------------------------------------------------


def test_cells_stand_side_by_side() -> None:
    cells = [Cell("a", Image.new("RGB", (SIDE, SIDE), color)) for color in (RED, BLUE)]
    page = composed("a title", cells)
    assert page.size == (2 * SIDE + GAP, 2 * LINE + SIDE)
    assert cell_colors(page, 0) == [RED]
    assert cell_colors(page, 1) == [BLUE]


def test_the_title_and_each_label_are_written_above() -> None:
    blank = Image.new("RGB", (SIDE, SIDE), RED)
    bare = np.asarray(composed("", [Cell("", blank), Cell("", blank)]))
    page = np.asarray(composed("a title", [Cell("clpeel", blank), Cell("f3d", blank)]))
    differs = (page != bare).any(axis=2)
    assert differs[:LINE].any()
    assert differs[LINE : 2 * LINE, :SIDE].any() and differs[LINE : 2 * LINE, SIDE + GAP :].any()
    assert not differs[2 * LINE :].any()


def test_a_cell_without_a_picture_says_why() -> None:
    one, other = (composed("", [Cell("f3d", None, why)]) for why in ("no display", "no such file"))
    assert cell_colors(one, 0)[0] == Image.new("RGB", (1, 1), EMPTY).getpixel((0, 0))
    assert len(cell_colors(one, 0)) > 1
    assert one.tobytes() != other.tobytes()


def test_a_long_reason_stays_within_its_cell() -> None:
    page = np.asarray(composed("", [Cell("", None, " ".join(["reason"] * 60))]))[2 * LINE :]
    inner = np.zeros(page.shape[:2], bool)
    inner[8:-8, 8:-8] = True
    written = (page != page[0, 0]).any(axis=2)
    assert written.any() and not (written & ~inner).any()


def test_a_large_sheet_is_a_jpeg_with_its_colours() -> None:
    flat = Image.new("RGB", (400, 400), (1, 2, 3))
    noise = Image.fromarray(np.random.default_rng(0).integers(0, 256, (400, 400, 3), np.uint8))
    noise.paste(RED, (8, 8, 16, 16))
    assert encoded(flat)[0] == ".png" and 400 * 400 * 3 > MOST_BYTES
    suffix, data = encoded(noise)
    with Image.open(io.BytesIO(data)) as read:
        assert (suffix, read.format) == (".jpg", "JPEG")
        assert np.abs(np.subtract(read.getpixel((12, 12)), RED)).max() < 16


# --- what is drawn ----------------------------------------------------------------------------------------------------


def test_a_job_has_the_view_of_clpeel(tmp_path: Path) -> None:
    view = View("it", tmp_path / "it.ply", lit=True, opacity=0.4)
    camera = clpeel.Camera((1, 2, 3), (0, 0, 1), (0, 0, 1), view_angle=20)
    job = json.loads(json.dumps(view.job(camera, tmp_path / "it.png")))
    assert (job["position"], job["focal_point"], job["view_up"]) == ([1, 2, 3], [0, 0, 1], [0, 0, 1])
    assert (job["view_angle"], job["side"], job["lit"], job["opacity"]) == (20, SIDE, True, 0.4)
    assert job["background"] == list(BACKGROUND)
    assert view.title == "it.ply, a light at the camera, opacity 0.4"


def test_a_view_may_be_of_a_part() -> None:
    scene = clpeel.Scene.from_arrays([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    whole = View("it", Path("it.ply")).camera(scene)
    part = View("it", Path("it.ply"), at=(4.0, 0.0, 0.0), zoom=2.0).camera(scene)
    assert whole.focal_point == (2, 2, 0)
    assert part.focal_point == (4, 0, 0)
    assert np.subtract(part.position, part.focal_point) == pytest.approx(np.subtract(whole.position, whole.focal_point))
    assert part.view_angle == pytest.approx(15)


def test_every_sheet_of_the_page_is_a_view() -> None:
    for name, (file, seen) in DEFAULTS.items():
        assert View(name, Path(file), **seen).title


# --- the command ------------------------------------------------------------------------------------------------------


def test_each_program_draws_the_file(squares: Path, tmp_path: Path, peers: Any) -> None:
    peers(PyVista=DRAWS.format(color="red", label="PyVista 9"), f3d=DRAWS.format(color="blue", label="f3d 9"))
    view = View("squares", squares, opacity=0.5)
    said: list[str] = []
    cells = programs.sheet(view, tmp_path, sys.executable, dict(os.environ), said.append)
    assert [cell.label for cell in cells] == [f"clpeel {clpeel.__version__}", "PyVista 9", "f3d 9"]
    page = composed("", cells)
    drawn = plainly.render(clpeel.load(squares, opacity=0.5), size=(SIDE, SIDE), background=BACKGROUND).image
    assert np.array_equal(np.asarray(cells[0].picture), drawn)
    assert cell_colors(page, 1) == [RED] and cell_colors(page, 2) == [BLUE]
    assert said == []


def test_a_missing_peer_gets_an_empty_cell_and_a_line(
    squares: Path, tmp_path: Path, peers: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    peers(PyVista="import no_such_package", f3d=DRAWS.format(color="blue", label="f3d 9"))
    assert tool.main([str(squares), "-o", str(tmp_path / "out")]) == 0
    line, done = capsys.readouterr().err.splitlines()
    assert line.startswith("squares: PyVista: ModuleNotFoundError: No module named 'no_such_package' (pip install ")
    assert "--peer-python" in line
    assert "squares.png" in done
    page = pixels_of(tmp_path / "out", "squares")
    assert cell_colors(page, 1)[0] == Image.new("RGB", (1, 1), EMPTY).getpixel((0, 0))
    assert cell_colors(page, 2) == [BLUE]


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("raise SystemExit('nothing was read')", "nothing was read"),
        ("print('f3d 9')", "it wrote no picture"),
        ("import os; os._exit(3)", "exit code 3"),
    ],
)
def test_a_peer_that_fails_says_why(script: str, why: str, squares: Path, tmp_path: Path, peers: Any) -> None:
    peers(f3d=script)
    said: list[str] = []
    cells = programs.sheet(View("squares", squares), tmp_path, sys.executable, dict(os.environ), said.append)
    assert cells[1].picture is None and why in cells[1].why
    assert said == [f"squares: f3d: {cells[1].why}"]


def test_a_reason_names_the_file_without_its_folder(squares: Path, tmp_path: Path, peers: Any) -> None:
    peers(f3d="import json, sys; raise SystemExit('no reader for ' + json.loads(sys.argv[1])['model'])")
    cells = programs.sheet(View("squares", squares), tmp_path, sys.executable, dict(os.environ), lambda text: None)
    assert cells[1].why == "no reader for squares.off"


def test_what_clpeel_leaves_out_is_said(tmp_path: Path, peers: Any) -> None:
    peers()
    model = tmp_path / "it.obj"
    model.write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    said: list[str] = []
    programs.sheet(View("it", model), tmp_path, sys.executable, {}, said.append)
    assert len(said) == 1 and said[0].startswith("it: clpeel: ") and "gone.mtl" in said[0]


def test_a_missing_model_is_left_out_by_its_name(
    squares: Path, tmp_path: Path, peers: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    peers()
    missing = str(tmp_path / "gone.glb")
    assert tool.main([missing, str(squares), "-o", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().err.splitlines()[0] == f"{missing} left out: no file {missing!r}"
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["squares.png"]
    assert tool.main([missing]) == 1


def test_a_sheet_of_the_page_needs_its_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tool, "SHARED", tmp_path)
    assert tool.main(["duck"]) == 1
    assert capsys.readouterr().err == f"duck left out: no file {str(tmp_path / 'models' / 'Duck.glb')!r}\n"


def test_a_file_that_clpeel_cannot_read_is_left_out(
    tmp_path: Path, peers: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    peers()
    (tmp_path / "it.ply").write_text("no mesh")
    assert tool.main([str(tmp_path / "it.ply"), "-o", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith(f"it left out: {tmp_path / 'it.ply'}: ")


def test_options_replace_what_a_sheet_has() -> None:
    options = tool.parse(["duck", "--opacity", "0.25", "--lit"])
    options.names = [__file__]  # a file that is there
    [view] = tool.views(options)
    assert (view.opacity, view.lit, view.model) == (0.25, True, Path(__file__))
    plain = tool.parse([__file__])
    assert (tool.views(plain)[0].opacity, tool.views(plain)[0].lit) == (None, False)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [(["--opacity", "2"], "0..1, got 2"), (["--peer-python", "missing/python"], "got 'missing/python'")],
)
def test_bad_input_is_refused(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        tool.parse(arguments)
    assert end.value.code == 2
    assert text in capsys.readouterr().err
