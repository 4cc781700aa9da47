"""OFF files: polygons, colours of vertices and of faces, and normals are read as Geomview defines them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.scene import Scene

POINTS = ("0 0 0", "1 0 0", "1 1 0", "0 1 0")


def read(folder: Path, text: str) -> Scene:
    """The scene of an OFF file with this text."""
    (folder / "t.off").write_bytes(text.encode())
    return load(folder / "t.off")


def off(faces: list[str], head: str = "OFF", extra: Any = ("",) * 4) -> str:
    """An OFF file of the square's corners, with more behind each, and these faces."""
    points = [f"{point} {more}" for point, more in zip(POINTS, extra, strict=True)]
    return "\n".join([head, f"4 {len(faces)} 0", *points, *faces, ""])


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", " # a comment 1 2\n\n# and\n"),
        lambda text: text.replace("OFF\n", "OFF "),
        lambda text: text.replace(" ", "\t"),
        lambda text: "# begins\n" + text,
        lambda text: "\ufeff" + text,
        lambda text: text.replace("4 3 0", "4 3"),
    ],
)
def test_polygons_of_all_sizes_are_fans_in_their_order(tmp_path: Path, change: Any) -> None:
    scene = read(tmp_path, change(off(["3 0 1 2", "4 3 2 1 0", "3 1 2 3"])))
    assert scene.faces.tolist() == [[0, 1, 2], [3, 2, 1], [3, 1, 0], [1, 2, 3]]
    np.testing.assert_array_equal(scene.vertices, [list(map(float, point.split())) for point in POINTS])
    assert scene.color is not None and tuple(scene.color) == DEFAULT_COLOR


def test_faces_of_fewer_corners_are_counted(tmp_path: Path) -> None:
    scene = read(tmp_path, off(["2 0 1", "3 0 1 2 255 0 0", "1 3", "0"]))
    assert scene.faces.tolist() == [[0, 1, 2]] and scene.notes == ("3 face(s) of fewer than 3 corners left out",)
    assert scene.face_colors is not None and scene.face_colors.tolist() == [[255, 0, 0, 255]]


@pytest.mark.parametrize(
    ("values", "want"),
    [
        ("255 0 51", [255, 0, 51, 255]),
        ("255 0 51 102", [255, 0, 51, 102]),
        ("1.0 0 0.25", [1, 0, 0.25, 1]),
        ("1.0 0 0.25 0.5", [1, 0, 0.25, 0.5]),
        ("0 0 1", [0, 0, 1, 1]),
    ],
)
def test_colors_of_vertices_and_faces(tmp_path: Path, values: str, want: Any) -> None:
    kind = np.uint8 if max(want) > 1 else np.float32
    scene = read(tmp_path, off(["3 0 1 2"], "COFF", [values] * 4))
    assert scene.vertex_colors is not None and scene.vertex_colors.dtype == kind
    np.testing.assert_array_equal(scene.vertex_colors, [want] * 4)
    scene = read(tmp_path, off([f"4 0 1 2 3 {values}", f"3 0 1 2 {values}"]))
    assert scene.face_colors is not None and scene.face_colors.dtype == kind
    np.testing.assert_array_equal(scene.face_colors, [want] * 3)


def test_some_faces_may_have_colors(tmp_path: Path) -> None:
    scene = read(tmp_path, off(["3 0 1 2 255 0 0", "3 0 2 3", "3 1 2 3 7", "3 3 2 1 0 255 0 51"]))
    assert scene.face_colors is not None
    assert scene.face_colors.tolist() == [[255, 0, 0, 255], list(DEFAULT_COLOR), list(DEFAULT_COLOR), [0, 255, 0, 51]]
    assert "colours of 1 face(s) left out: they are numbers of a table that the file lacks" in scene.notes


def test_colors_of_vertices_come_before_those_of_faces(tmp_path: Path) -> None:
    scene = read(tmp_path, off(["3 0 1 2 255 0 0"], "COFF", ["0 0 9"] * 4))
    assert scene.vertex_colors is not None and scene.notes == ("face colours left out: the vertices have their own",)


@pytest.mark.parametrize(
    ("head", "extra"),
    [
        ("NOFF", "0 0 2"),
        ("CNOFF", "0 0 2 255 0 0 255"),
        ("STNOFF", "0 0 2 0.5 0.5"),
        ("STCNOFF", "0 0 2 9 9 9 0.5 0.5"),
    ],
)
def test_normals_stand_behind_the_coordinates(tmp_path: Path, head: str, extra: str) -> None:
    scene = read(tmp_path, off(["3 0 1 2"], head, [extra] * 4))
    assert scene.vertex_normals is not None and scene.vertex_normals.tolist() == [[0, 0, 2]] * 4
    assert (scene.vertex_colors is not None) == ("C" in head) and scene.notes == ()


def test_more_numbers_than_the_header_says_are_noted(tmp_path: Path) -> None:
    scene = read(tmp_path, off(["3 0 1 2"], "OFF", ["9 9 9"] * 4))
    assert scene.notes == ("3 number(s) of each vertex left out: the header is not that of a file with colours",)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (off(["3 0 1 4"]), "faces: expected indices 0..3, got 4 in face 0; the mesh is damaged"),
        (off(["3 0 1 -1"]), "faces: expected indices 0..3, got -1 in face 0; the mesh is damaged"),
        (off(["5 0 1 2"]), "the file is damaged: face 0 promises 5 corner(s), its row holds 3"),
        (off(["3 0 1 2"]).replace("4 1 0", "4 2 0"), "the file is cut: its header promises 6 vertices and faces"),
        (off(["3 0 1 2"]).replace("4 1 0", "4 0 0"), "expected triangles, got 4 point(s) alone; the mesh is empty"),
        (off(["2 0 1"]), "expected triangles, got none; the mesh is empty"),
        (off(["3 0 1 x"]), "not a readable mesh: expected numbers, got 'x'"),
        (off(["3 0 1 2"], "COFF"), "expected rows of vertices with x y z, a colour of 3 or 4 numbers, got 3 numbers"),
        ("OFF\n", "expected the numbers of vertices and faces behind OFF"),
        ("OFF\n4\n", "expected the numbers of vertices and faces behind OFF"),
        ("4OFF\n1 1 0\n", "expected an .off file of three coordinates, got '4OFF'"),
        ("OFF BINARY\n", "expected a text .off file, got a binary one"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert says in str(error.value)
