"""OBJ files: every polygon comes in the order of the file, with the indices, normals and colours that it is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.scene import Scene

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 0\n"


def read(folder: Path, text: str) -> Scene:
    """The scene of an OBJ file with this text."""
    (folder / "t.obj").write_bytes(text.encode())
    return load(folder / "t.obj")


def corners(scene: Scene) -> list[list[list[float]]]:
    """x and y of each corner of each face."""
    return scene.vertices[scene.faces][..., :2].tolist()


# --- faces ------------------------------------------------------------------------------------------------------------


def test_faces_stay_in_the_order_of_the_file_whatever_their_materials(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n")
    scene = read(
        tmp_path,
        f"mtllib m.mtl\n{SQUARE}f 1 2 3\nusemtl b\nf 2 3 4\nusemtl a\nf 3 4 5\nusemtl b\no x\nf 4 5 1\n"
        "usemtl\nf 5 1 2\n",
    )
    assert scene.faces.tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 0], [4, 0, 1]]
    assert scene.face_materials is not None
    assert [material.name for material in scene.materials] == ["b", "a"]
    assert scene.face_materials.tolist() == [-1, 0, 1, 0, -1] and len(scene.vertices) == 5 and scene.notes == ()


def test_polygons_of_all_sizes_are_fans_in_their_places(tmp_path: Path) -> None:
    scene = read(tmp_path, SQUARE + "f 1 2 3 4 5\nf 5 4 3\nf 1 2 3 4\n")
    assert scene.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2], [0, 1, 2], [0, 2, 3]]


def test_faces_of_one_and_two_corners_are_counted(tmp_path: Path) -> None:
    scene = read(tmp_path, SQUARE + "f 1\nf 1 2 3\nf 1 2\nf 2 3 4\nf 2 3\nf\n")
    assert scene.faces.tolist() == [[0, 1, 2], [1, 2, 3]]
    assert scene.notes == ("4 face(s) of fewer than 3 corners left out",)


def test_indices_that_count_back_do_so_from_their_own_line(tmp_path: Path) -> None:
    part = "v {0} 0 0\nv {0} 1 0\nv {0} 0 1\nvn 1 0 0\nf -3//-1 -2//-1 \\\n-1//-1\n"
    scene = read(tmp_path, part.format(0) + part.format(5) + "f 1 -1 2\n")
    assert scene.vertices[scene.faces][:, :, 0].tolist() == [[0, 0, 0], [5, 5, 5], [0, 5, 0]]
    assert scene.notes == ()


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3\nf 2 3 4\n",
        (SQUARE + "f 1 2 3\nf 2 3 4\n").replace("\n", "\r\n"),
        (SQUARE + "f 1 2 3\nf 2 3 4\n").replace("\n", "\r"),
        (SQUARE + "f 1 2 3\nf 2 3 4").replace(" ", "\t"),
        (SQUARE + "f 1 2 3\nf 2 3 4\n").replace("\n", "\n   \n  "),
        (SQUARE + "f 1 2 3\nf 2 3 4\n").replace("\n", " # a comment, 7 8 9\n"),
        (SQUARE + "f 1 2 3\nf 2 3 4\n").replace("f 1 2 3", "f 1 2 \\\n3"),
        (SQUARE + "f 1 2 3\nf 2 3 4\n").replace("0\nv", "0 1.0\nv"),  # with a weight
        "f 1 2 3\nf 2 3 4\n" + SQUARE,
        "vt 0 0\n" + SQUARE + "f 1/1 2/1 3/1\nf 2 3/1/ 4//\n",
    ],
)
def test_every_spelling_of_the_same_mesh_is_read(tmp_path: Path, text: str) -> None:
    scene = read(tmp_path, text)
    assert corners(scene) == [[[0, 0], [1, 0], [1, 1]], [[1, 0], [1, 1], [0, 1]]]
    assert scene.notes == () and scene.color is not None and tuple(scene.color) == DEFAULT_COLOR


def test_numbers_of_all_kinds_are_read(tmp_path: Path) -> None:
    scene = read(tmp_path, "v 1e-3 +2 -.5\nv nan inf -inf\nv -nan(ind) 1.#INF 7\nf 1 2 3\n".replace("1.#INF", "nan(7)"))
    np.testing.assert_array_equal(scene.vertices, [[1e-3, 2, -0.5], [np.nan, np.inf, -np.inf], [np.nan, np.nan, 7]])


def test_normals_come_where_corners_have_them(tmp_path: Path) -> None:
    scene = read(tmp_path, SQUARE + "vn 0 0 2\nvn 0 1 0\nf 1//1 2//1 3//2\nf 1//1 3//1 4\n")
    assert scene.vertex_normals is not None and len(scene.vertices) == 5  # the third is there twice, the last not used
    normals = scene.vertex_normals[scene.faces]
    np.testing.assert_array_equal(normals[0], [[0, 0, 2], [0, 0, 2], [0, 1, 0]])
    np.testing.assert_array_equal(normals[1], [[0, 0, 2], [0, 0, 2], [np.nan] * 3])
    assert corners(scene) == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]


def test_vertices_are_split_only_where_corners_differ(tmp_path: Path) -> None:
    scene = read(tmp_path, SQUARE + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n")
    assert len(scene.vertices) == 5 and scene.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert scene.vertex_normals is not None and np.isnan(scene.vertex_normals[4]).all()


def test_curves_are_noted_and_lines_and_points_drawn(tmp_path: Path) -> None:
    text = SQUARE + "f 1 2 3\ncurv 0 1 1 2 3\nsurf 0 1 0 1 1 2 3\nl 1 2\np 1\nl 2 3\n"
    scene = read(tmp_path, text)
    assert scene.notes == ("curves and surfaces left out: 1 curv, 1 surf",)
    assert scene.counts == (1, 2, 1)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (SQUARE + "f 1 2 6\n", "faces: expected indices 1..5, got 6 in line 6; the mesh is damaged"),
        (SQUARE + "f 1 2 3\nf 1 0 3\n", "faces: expected indices 1..5, got 0 in line 7; the mesh is damaged"),
        (SQUARE + "f 1 2 -6\n", "faces: expected indices 1..5, got -6 in line 6; the mesh is damaged"),
        (SQUARE + "f 1/1/1/1 2 3\n", "expected corners of faces as v/vt/vn, got more than two slashes"),
        (SQUARE + "f 1 2 x\n", "not a readable mesh: expected numbers, got 'x'"),
        (SQUARE + "f 1 2 3.5\n", "not a readable mesh: expected numbers, got '3.5'"),
        (SQUARE.replace("1 1 0", "1 1,5 0") + "f 1 2 3\n", "not a readable mesh: expected numbers, got '1,5'"),
        (SQUARE.replace("1 1 0", "1 1") + "f 1 2 3\n", "vertices: expected three coordinates, got 2"),
        (SQUARE + "l 1 6\n", "lines: expected indices 1..5, got 6 in line 6; the mesh is damaged"),
        (SQUARE + "p 0\n", "points: expected indices 1..5, got 0 in line 6; the mesh is damaged"),
        ("hello\n", "expected triangles, lines or points, got none; the mesh is empty"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert says in str(error.value)


# --- vertex colours ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("values", ["1 0 0.2", "255 0 51", "1.000 0.000 0.200"])
def test_vertex_colors_are_bytes_where_they_are_whole(tmp_path: Path, values: str) -> None:
    scene = read(tmp_path, f"v 0 0 0 {values}\nv 1 0 0 0 0 0\nv 0 1 0\nf 1 2 3\n")
    assert scene.vertex_colors is not None and scene.vertex_colors.dtype == np.uint8
    assert scene.vertex_colors.tolist() == [[255, 0, 51, 255], [0, 0, 0, 255], [255, 255, 255, 255]]


def test_other_vertex_colors_are_floats(tmp_path: Path) -> None:
    scene = read(tmp_path, "v 0 0 0 1 0.5 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n")
    assert scene.vertex_colors is not None and scene.vertex_colors[0].tolist() == [1, 0.5, 0, 1]
