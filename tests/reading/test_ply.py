"""PLY files: polygons, strips and lists of every length come as they are, from text and from both byte orders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.plys import INDICES, KINDS, SQUARE, XYZ, written

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.scene import Scene

pytestmark = pytest.mark.parametrize("kind", KINDS)


def read(folder: Path, kind: str, *elements: Any) -> Scene:
    """The scene of a PLY file of these elements."""
    (folder / "t.ply").write_bytes(written(kind, *elements))
    return load(folder / "t.ply")


def vertex(extra: tuple[str, ...] = (), *values: Any) -> Any:
    """The element of the square's corners, with further properties of these values."""
    return "vertex", (*XYZ, *extra), [(*row, *values) for row in SQUARE]


def test_polygons_of_all_sizes_are_fans_in_their_order(tmp_path: Path, kind: str) -> None:
    rows = [([0, 1, 2],), ([0],), ([3, 2, 1, 0],), ([],), ([1, 2],), ([3, 1, 0],)]
    scene = read(tmp_path, kind, vertex(), ("face", [INDICES], rows))
    assert scene.faces.tolist() == [[0, 1, 2], [3, 2, 1], [3, 1, 0], [3, 1, 0]]
    assert "3 face(s) of fewer than 3 corners left out" in scene.notes
    np.testing.assert_array_equal(scene.vertices, SQUARE)


@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
@pytest.mark.parametrize(("counter", "item"), [("uint8", "int32"), ("int", "uint"), ("ushort", "short")])
def test_faces_with_other_properties_around_the_corners(
    tmp_path: Path, kind: str, name: str, counter: str, item: str
) -> None:
    properties = ["uchar flags", f"list {counter} {item} {name}", "list uchar float weights", "double quality"]
    for sizes in ((3, 3), (3, 4)):
        rows = [(7, list(range(size)), [0.5] * size, 0.25) for size in sizes]
        scene = read(tmp_path, kind, vertex(), ("face", properties, rows))
        assert scene.faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]][: sum(sizes) - 4]


def test_lists_among_the_vertices_are_passed_over(tmp_path: Path, kind: str) -> None:
    properties = ("float x", "list uchar int neighbours", "float y", "float z", "float nx", "float ny", "float nz")
    rows = [(x, list(range(k)), y, z, 0, 0, k) for k, (x, y, z) in enumerate(SQUARE)]
    scene = read(tmp_path, kind, ("vertex", properties, rows), ("face", [INDICES], [([0, 1, 2],)]))
    np.testing.assert_array_equal(scene.vertices, SQUARE)
    assert scene.vertex_normals is not None and scene.vertex_normals[:, 2].tolist() == [0, 1, 2, 3]
    assert scene.faces.tolist() == [[0, 1, 2]] and scene.notes == ()


def test_strips_begin_again_behind_minus_one(tmp_path: Path, kind: str) -> None:
    strips = ("tristrips", ["list int int vertex_indices"], [([0, 1, 2, 3, -1, 0, 1, 3],), ([1, 2, 3],)])
    scene = read(tmp_path, kind, vertex(), strips)
    assert scene.faces.tolist() == [[0, 1, 2], [1, 3, 2], [0, 1, 3], [1, 2, 3]]


def test_faces_and_strips_may_be_in_one_file(tmp_path: Path, kind: str) -> None:
    strips = ("tristrips", ["list int int vertex_indices"], [([0, 1, 3, 2],)])
    face = ("face", [INDICES, "uchar red", "uchar green", "uchar blue"], [([2, 3, 0], 255, 0, 0)])
    scene = read(tmp_path, kind, vertex(), face, strips)
    assert scene.faces.tolist() == [[2, 3, 0], [0, 1, 3], [1, 2, 3]]
    assert scene.face_colors is not None
    assert scene.face_colors.tolist() == [[255, 0, 0, 255], [120, 150, 190, 255], [120, 150, 190, 255]]


def test_other_elements_are_passed_over_and_edges_drawn(tmp_path: Path, kind: str) -> None:
    camera = ("camera", ["float view_px", "list uchar int frames"], [(1.5, [1, 2]), (2.5, [])])
    edge = ("edge", ["int vertex1", "int vertex2"], [(0, 2)])
    scene = read(tmp_path, kind, camera, vertex(), edge, ("face", [INDICES], [([0, 1, 2],)]))
    assert scene.faces.tolist() == [[0, 1, 2]] and scene.notes == ()
    assert scene.lines is not None
    np.testing.assert_array_equal(scene.vertices[scene.lines], np.asarray(SQUARE)[[[0, 2]]])


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_headers_end_in_any_newline(tmp_path: Path, kind: str, newline: str) -> None:
    data = written(kind, vertex(), ("face", [INDICES], [([0, 1, 2],)]))
    at = data.index(b"end_header\n") + len(b"end_header\n")
    (tmp_path / "t.ply").write_bytes(data[:at].replace(b"\n", newline.encode()) + data[at:])
    scene = load(tmp_path / "t.ply")
    np.testing.assert_array_equal(scene.vertices, SQUARE)
    assert scene.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("int vertex", "index vertex", "expected a type such as float or uchar in the header, got 'index'"),
        ("1.0\n", "1.0\nproperty float x\n", "expected elements and properties in the header, got 'property float x'"),
        ("face 1", "face one", "expected elements and properties in the header, got 'element face one'"),
        ("vertex_indices", "corners", "faces: expected a list of vertex_indices, got none"),
        ("float z", "float depth", "vertices: expected properties x, y and z, got none"),
        ("vertex 4", "points 4", "expected triangles, lines or points, got none; the mesh is empty"),
        ("face 1", "face 2", "the file is cut: its header promises 2 rows of 'face', it holds 1"),
        ("face 1", "face 99999999999", "the file is cut: its header promises 99,999,999,999 rows of 'face', it holds"),
        ("vertex 4", "vertex 400", "the file is cut: its header promises 400 rows of 'vertex', it holds"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, kind: str, old: str, new: str, says: str) -> None:
    data = written(kind, vertex(), ("face", [INDICES], [([0, 1, 2],)])).replace(old.encode(), new.encode(), 1)
    (tmp_path / "t.ply").write_bytes(data)
    with pytest.raises(InputError) as error:
        load(tmp_path / "t.ply")
    assert says in str(error.value)


def test_unknown_formats_are_said(tmp_path: Path, kind: str) -> None:
    data = written(kind, vertex(), ("face", [INDICES], [([0, 1, 2],)]))
    (tmp_path / "t.ply").write_bytes(data.replace(kind.encode(), b"packed", 1))
    with pytest.raises(InputError, match="expected the format ascii, .*, got 'packed'"):
        load(tmp_path / "t.ply")


@pytest.mark.parametrize("sizes", [(3, 3), (3, 4)])
def test_cut_rows_are_said(tmp_path: Path, kind: str, sizes: tuple[int, ...]) -> None:
    data = written(kind, vertex(), ("face", [INDICES], [(list(range(size)),) for size in sizes]))
    (tmp_path / "t.ply").write_bytes(data[:-3])
    with pytest.raises(InputError, match="the file is cut: its header promises 2 rows of 'face', it holds 1"):
        load(tmp_path / "t.ply")
