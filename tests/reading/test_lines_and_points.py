"""Lines and points of files: PLY, OBJ and glTF, and the clouds of XYZ and PCD files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading.documents import Document
from reading.plys import KINDS, written

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.reading.pcd import unpacked
from clpeel.scene.scene import Scene
from clpeel.scene.textures import srgb

PLACES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], np.float32)
COLORS = np.array([[255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 64], [9, 8, 7, 0]], np.uint8)


def read(folder: Path, name: str, content: bytes | str) -> Scene:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return load(folder / name)


def refusal(folder: Path, name: str, content: bytes | str) -> str:
    with pytest.raises(InputError) as error:
        read(folder, name, content)
    assert "\n" not in str(error.value)
    return str(error.value)


def ends(scene: Scene) -> list[Any]:
    """The places of the ends of all lines."""
    return [] if scene.lines is None else scene.vertices[scene.lines].tolist()


def dots(scene: Scene) -> list[Any]:
    """The places of all points."""
    return [] if scene.points is None else scene.vertices[scene.points].tolist()


# --- PLY --------------------------------------------------------------------------------------------------------------

VERTEX = ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue", "uchar alpha"]
ROWS = [(*place, *color) for place, color in zip(PLACES.tolist(), COLORS.tolist(), strict=True)]


@pytest.mark.parametrize("kind", KINDS)
def test_vertices_of_ply_alone_are_points(tmp_path: Path, kind: str) -> None:
    scene = read(tmp_path, "t.ply", written(kind, ("vertex", VERTEX, ROWS)))
    assert dots(scene) == PLACES.tolist() and scene.counts == (0, 0, 4) and scene.notes == ()
    assert scene.vertex_colors is not None and (scene.vertex_colors == COLORS).all()


@pytest.mark.parametrize("kind", KINDS)
def test_edges_of_ply_are_lines(tmp_path: Path, kind: str) -> None:
    edge = (
        "edge",
        ["int vertex1", "int vertex2", "uchar red", "uchar green", "uchar blue"],
        [(0, 2, 1, 2, 3), (2, 3, 4, 5, 6)],
    )
    scene = read(tmp_path, "t.ply", written(kind, ("vertex", VERTEX, ROWS), edge))
    assert ends(scene) == PLACES[[[0, 2], [2, 3]]].tolist() and scene.counts == (0, 2, 0)
    assert scene.notes == ("colours of 2 edge(s) left out: they have those of their vertices",)
    assert scene.lines is not None and scene.vertex_colors is not None
    assert (scene.vertex_colors[scene.lines] == COLORS[[[0, 2], [2, 3]]]).all()


def test_damaged_edges_of_ply_are_said(tmp_path: Path) -> None:
    vertex = ("vertex", VERTEX, ROWS)
    beyond = written("ascii", vertex, ("edge", ["int vertex1", "int vertex2"], [(0, 4)]))
    assert "lines: expected indices 0..3, got 4; the mesh is damaged" in refusal(tmp_path, "t.ply", beyond)
    nameless = written("ascii", vertex, ("edge", ["int a", "int b"], [(0, 1)]))
    assert "edges: expected properties vertex1 and vertex2, got none" in refusal(tmp_path, "t.ply", nameless)


# --- OBJ --------------------------------------------------------------------------------------------------------------

OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in PLACES.tolist())


def test_polylines_and_points_of_obj(tmp_path: Path) -> None:
    scene = read(tmp_path, "t.obj", OBJ + "l 1 2 3\nl -1 1\np 2 -1\nl 4\n")
    assert ends(scene) == PLACES[[[0, 1], [1, 2], [3, 0]]].tolist() and dots(scene) == PLACES[[1, 3]].tolist()
    assert scene.counts == (0, 3, 2)


def test_texture_coordinates_of_lines_of_obj_are_passed_over(tmp_path: Path) -> None:
    assert ends(read(tmp_path, "t.obj", OBJ + "vt 0 0\nl 1/1 2/1\n")) == [PLACES[:2].tolist()]


def test_vertices_of_obj_alone_are_points(tmp_path: Path) -> None:
    scene = read(tmp_path, "t.obj", "v 0 0 0 1 0 0\nv 1 2 3 0 1 0\n")
    assert dots(scene) == [[0, 0, 0], [1, 2, 3]] and scene.vertex_colors is not None
    assert scene.vertex_colors.tolist() == [[255, 0, 0, 255], [0, 255, 0, 255]]


def test_lines_of_obj_have_the_colours_of_their_materials(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\nd 0.5\nnewmtl b\nKd 0 0.2 0\n")
    text = OBJ + "f 1 2 3\nl 1 2\nusemtl a\nl 2 3\nusemtl b\np 4\nusemtl c\np 1\n"
    scene = read(tmp_path, "t.obj", "mtllib m.mtl\n" + text)
    assert scene.counts == (1, 2, 2) and scene.lines is not None and scene.points is not None
    colors = scene.vertex_colors
    assert colors is not None and colors.dtype == np.float32
    plain = np.array([120, 150, 190, 255]) / 255
    np.testing.assert_allclose(colors[scene.lines[0]], [plain, plain], atol=1e-6)
    np.testing.assert_allclose(colors[scene.lines[1]], [[1, 0, 0, 0.5]] * 2, atol=1e-6)
    np.testing.assert_allclose(colors[scene.points], [[0, 0.2, 0, 1], plain], atol=1e-6)


# --- glTF -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "wanted"),
    [(1, [[0, 1], [2, 3]]), (2, [[0, 1], [1, 2], [2, 3], [3, 0]]), (3, [[0, 1], [1, 2], [2, 3]]), (0, [0, 1, 2, 3])],
)
def test_lines_and_points_of_gltf(tmp_path: Path, mode: int, wanted: list[Any]) -> None:
    document = Document(PLACES, mode=mode)
    document.primitive.pop("indices", None)
    scene = document.load(tmp_path)
    found = dots(scene) if mode == 0 else ends(scene)
    np.testing.assert_allclose(found, PLACES[wanted])
    assert scene.notes == () and scene.surfaces == "opaque"


def test_colours_of_points_of_gltf(tmp_path: Path) -> None:
    """COLOR_0 times the base colour, which are linear; alpha counts where the material blends (section 3.9.2)."""
    document = Document(PLACES, mode=0)
    linear = np.array([[0.5, 1, 0, 1], [1, 1, 1, 0.5], [0, 0, 0, 0], [0.2, 0.4, 0.6, 0.25]], np.float32)
    document.primitive["attributes"]["COLOR_0"] = document.add(linear)
    document.primitive["material"] = 0
    document.primitive.pop("indices", None)
    base = [0.8, 0.5, 1, 0.5]
    for mode, alpha in (("BLEND", linear[:, 3] * 0.5), ("OPAQUE", np.ones(4)), ("MASK", [1, 0, 0, 0])):
        tree = document.tree()
        tree["materials"] = [{"alphaMode": mode, "pbrMetallicRoughness": {"baseColorFactor": base}}]
        path = tmp_path / f"{mode}.gltf"
        path.write_text(json.dumps(tree))
        scene = load(path)
        colors = np.asarray(scene.vertex_colors, np.float64) / (255 if scene.vertex_colors.dtype == np.uint8 else 1)
        np.testing.assert_allclose(colors[:, :3], srgb(linear[:, :3] * base[:3]), atol=1e-6)
        np.testing.assert_allclose(colors[:, 3], alpha, atol=1e-6)


def test_nodes_move_the_lines_of_gltf(tmp_path: Path) -> None:
    document = Document(PLACES, mode=3)
    document.primitive.pop("indices", None)
    tree = document.tree()
    tree["nodes"] = [{"mesh": 0, "translation": [5, 0, 0]}, {"mesh": 0, "scale": [-1, 1, 1]}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    path = tmp_path / "t.gltf"
    path.write_text(json.dumps(tree))
    scene = load(path)
    chain = PLACES[[[0, 1], [1, 2], [2, 3]]]
    np.testing.assert_allclose(ends(scene), np.concatenate([chain + [5, 0, 0], chain * [-1, 1, 1]]))


# --- XYZ --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "color", "normal", "left"),
    [
        ("a.xyz", "1 2 3\n4 5 6\n", None, None, 0),
        ("a.xyz", "# a comment\n1 2 3 255 0 9\n\n4 5 6 1 2 3\n", [255, 0, 9, 255], None, 0),
        ("a.xyzn", "1 2 3 0 0.6 0.8\n4 5 6 1 0 0\n", None, [0, 0.6, 0.8], 0),
        ("a.xyzrgb", "1 2 3 1 0 0.5\n4 5 6 0 1 0\n", [1, 0, 0.5, 1], None, 0),
        ("a.pts", "2\n1 2 3 -999 255 128 0\n4 5 6 20 1 2 3\n", [255, 128, 0, 255], None, 1),
        ("a.pts", "1 2 3 7\n4 5 6 8\n", None, None, 1),
        ("a.txt", "X,Y,Z,R,G,B\n1,2,3,10,20,30\n4,5,6,7,8,9\n", [10, 20, 30, 255], None, 0),
        ("a.asc", "1;2;3;10;20;30;0;0;1\r\n4;5;6;7;8;9;0;1;0\r\n", [10, 20, 30, 255], [0, 0, 1], 0),
        ("a.xyz", "1 2 3 0 0 1 10 20 30 0.7\n4 5 6 0 1 0 40 50 60 0.8\n", [10, 20, 30, 255], [0, 0, 1], 1),
    ],
)
def test_text_clouds(tmp_path: Path, name: str, text: str, color: Any, normal: Any, left: int) -> None:
    scene = read(tmp_path, name, text)
    assert dots(scene) == [[1, 2, 3], [4, 5, 6]] and len(scene.notes) == (left > 0)
    assert len(scene.vertex_arrays) == left and all("arrays left out" in note for note in scene.notes)
    assert (scene.vertex_colors is None) == (color is None) and (scene.vertex_normals is None) == (normal is None)
    if color is not None:
        assert scene.vertex_colors is not None
        np.testing.assert_allclose(scene.vertex_colors[0], color, atol=1e-6)
    if normal is not None:
        assert scene.vertex_normals is not None
        np.testing.assert_allclose(scene.vertex_normals[0], normal, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "expected a .xyz file, got an empty file"),
        ("5\n", "expected points, got none; the file is empty"),
        ("1 2\n", "expected 3 numbers in each line, got 2 in line 1"),
        ("1 2 3\n4 5\n", "expected 3 numbers in each line, got 2 in line 2"),
        ("1 2 x\n4 5 6\n", "not a readable mesh: expected numbers, got 'x'"),
        ("1 2 3\n4 5 x\n", "not a readable mesh: expected numbers, got 'x'"),
        ("\x89PNG\r\n", "got a PNG image"),
    ],
)
def test_damaged_text_clouds_are_said(tmp_path: Path, text: str, says: str) -> None:
    assert says in refusal(tmp_path, "t.xyz", text.encode("latin-1"))


# --- PCD --------------------------------------------------------------------------------------------------------------

NORMALS = [(f"normal_{axis}", "<f4") for axis in "xyz"]
PCD = np.dtype([*((axis, "<f4") for axis in "xyz"), ("rgb", "<u4"), *NORMALS, ("label", "<u2"), ("curve", "<f8")])
HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z {color} normal_x normal_y normal_z label curve
SIZE 4 4 4 4 4 4 4 2 8
TYPE F F F {type} F F F U F
COUNT 1 1 1 1 1 1 1 1 1
WIDTH {count}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {count}
DATA {form}
"""


def cloud(count: int = 4) -> np.ndarray:
    rng = np.random.default_rng(count)
    rows = np.zeros(count, PCD)
    for axis in "xyz":
        rows[axis] = rng.uniform(-1, 1, count)
    colors = rng.integers(0, 256, (count, 4), dtype=np.uint32)
    rows["rgb"] = colors[:, 3] << 24 | colors[:, 0] << 16 | colors[:, 1] << 8 | colors[:, 2]
    rows["normal_z"] = 1
    rows["label"] = 7
    return rows


def packed(data: bytes) -> bytes:
    """LZF of plain runs, and of a copy wherever the last 3 bytes come again at once. Every decoder must read it."""
    found, at = bytearray(), 0
    while at < len(data):
        run = 1
        while at + run < len(data) and data[at + run] == data[at] and run < 260:
            run += 1
        if run > 4:  # a plain byte, and then copies of the one before
            found += bytes([0, data[at]])
            length = run - 1 - 2
            found += bytes([length << 5, 0]) if length < 7 else bytes([7 << 5, length - 7, 0])
        else:
            run = min(32, len(data) - at)
            found += bytes([run - 1]) + data[at : at + run]
        at += run
    return bytes(found)


def pcd(rows: np.ndarray, form: str, color: str = "rgb", kind: str = "F") -> bytes:
    head = HEADER.format(count=len(rows), form=form, color=color, type=kind).encode()
    if form == "binary":
        return head + rows.tobytes()
    if form == "binary_compressed":
        body = b"".join(rows[name].tobytes() for name in rows.dtype.names)
        small = packed(body)
        return head + np.array([len(small), len(body)], "<u4").tobytes() + small
    lines = []
    for row in rows:
        bits = row["rgb"] if kind == "U" else row["rgb"].view(np.float32)
        numbers = [row["x"], row["y"], row["z"], bits, *list(row)[4:7], row["label"], row["curve"]]
        lines.append(
            " ".join(f"{number:.9g}" if isinstance(number, np.floating) else str(number) for number in numbers)
        )
    return head + ("\n".join(lines) + "\n").encode()


@pytest.mark.parametrize("kind", ["F", "U"])
@pytest.mark.parametrize("color", ["rgb", "rgba"])
@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
def test_clouds_of_pcd(tmp_path: Path, form: str, color: str, kind: str) -> None:
    rows = cloud(30)
    if kind == "F":
        rows["rgb"] &= 0x7EFFFFFF  # so that none is NaN as a float
    scene = read(tmp_path, "t.pcd", pcd(rows, form, color, kind))
    np.testing.assert_array_equal(dots(scene), np.stack([rows[axis] for axis in "xyz"], axis=1))
    shifts = (16, 8, 0, 24) if color == "rgba" else (16, 8, 0)
    wanted = np.stack([(rows["rgb"] >> shift & 255).astype(np.uint8) for shift in shifts], axis=1)
    assert scene.vertex_colors is not None and scene.vertex_normals is not None
    np.testing.assert_array_equal(scene.vertex_colors[:, : len(shifts)], wanted)
    assert (scene.vertex_normals == [0, 0, 1]).all()
    assert scene.notes == ("arrays left out: 'label', 'curve'; --coloring-array, or scalars, shows one",)
    np.testing.assert_allclose(scene.vertex_arrays["curve"], rows["curve"], rtol=1e-6)


def test_points_of_pcd_without_a_place_are_dropped_and_noted(tmp_path: Path) -> None:
    rows = cloud(5)
    rows["y"][[1, 3]] = np.nan
    scene = read(tmp_path, "t.pcd", pcd(rows, "binary"))
    assert scene.counts == (0, 0, 3) and scene.notes[0] == "2 point(s) without a place left out"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"POINTS 4", b"POINTS 5", "the file is cut: expected 190 bytes of points, got 152"),
        (b"POINTS 4", b"POINTS -1", "expected 1 number(s) of POINTS, got '-1'"),
        (b"POINTS 4", b"POINTS 0", "expected points, got none; the file is empty"),
        (b"FIELDS x", b"FIELDS u", "expected fields x, y and z, got 'u', 'y'"),
        (b"SIZE 4", b"SIZE 3", "expected a number, got F3 for 'x'"),
        (b"SIZE 4 4", b"SIZE 4", "expected 9 number(s) of SIZE"),
        (b"DATA binary", b"DATA packed", "expected ascii, binary or binary_compressed, got 'packed'"),
        (b"DATA binary\n", b"", "not a readable cloud: expected"),
        (b"WIDTH", b"WIDE", "expected a line of the header, got 'WIDE'"),
    ],
)
def test_damaged_pcd_is_said(tmp_path: Path, old: bytes, new: bytes, says: str) -> None:
    assert says in refusal(tmp_path, "t.pcd", pcd(cloud(), "binary").replace(old, new, 1))


def test_damaged_compressed_pcd_is_said(tmp_path: Path) -> None:
    whole = pcd(cloud(), "binary_compressed")
    assert "the file is cut" in refusal(tmp_path, "t.pcd", whole[:-3])
    start = whole.index(b"compressed\n") + len(b"compressed\n")
    size = np.frombuffer(whole, "<u4", 2, start)
    wrong = whole[:start] + np.array([size[0], size[1] + 1], "<u4").tobytes() + whole[start + 8 :]
    assert "expected 152 bytes of points, got 153" in refusal(tmp_path, "t.pcd", wrong)
    backwards = whole[:start] + np.array([2, size[1]], "<u4").tobytes() + b"\x20\xff"
    assert "its compressed points are damaged" in refusal(tmp_path, "t.pcd", backwards)


@given(st.binary(max_size=400), st.integers(1, 9))
def test_what_is_packed_is_unpacked(data: bytes, times: int) -> None:
    data = b"".join(bytes([byte]) * times for byte in data)
    assert unpacked(packed(data), len(data)) == data


@given(st.binary(max_size=60))
def test_any_bytes_are_unpacked_or_refused(data: bytes) -> None:
    try:
        assert len(unpacked(data, 100)) == 100
    except InputError:
        pass
