"""Whatever a mesh file holds and its picture lacks is a note by name, told once; nothing keeps the loader waiting."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from clpeel.reading.load import load

pytest.importorskip("trimesh")

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl oak\nf 1/1 2/1 3/1\n"
MTL = "newmtl oak\nKd 1 1 1\n"


def notes(path: Path, text: str | bytes) -> tuple[str, ...]:
    """The notes of a file with this content."""
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load(path).notes


def red(path: Path) -> None:
    """A red image."""
    pytest.importorskip("PIL.Image").new("RGB", (2, 2), (255, 0, 0)).save(path)


# --- OBJ --------------------------------------------------------------------------------------------------------------


def test_a_missing_material_file_is_noted(tmp_path: Path) -> None:
    assert notes(tmp_path / "t.obj", "mtllib no.mtl\n" + OBJ) == ("material file 'no.mtl' left out: no such file",)


def test_unknown_materials_are_noted(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text(MTL)
    text = "mtllib m.mtl\n" + OBJ.replace("usemtl oak", "usemtl elm")
    assert notes(tmp_path / "t.obj", text) == ("materials left out: 'elm'; the material files lack them",)
    assert notes(tmp_path / "t.obj", OBJ) == ("materials left out: 'oak'; the file names no material file",)


@pytest.mark.parametrize("line", ['"a b.mtl"', "a b.mtl", r".\a b.mtl", "m.mtl other.mtl", "m.mtl\nmtllib other.mtl"])
def test_material_files_of_every_spelling_are_read(tmp_path: Path, line: str) -> None:
    for name in ("a b.mtl", "other.mtl"):
        (tmp_path / name).write_text(MTL.replace("1 1 1", "1 0 0"))
    (tmp_path / "m.mtl").write_text("newmtl elm\n")
    path = tmp_path / "t.obj"
    assert notes(path, f"mtllib {line}\n{OBJ}") == ()
    color = load(path).color
    assert color is not None and color.tolist() == [255, 0, 0, 255]


def test_one_of_several_material_files_may_be_missing(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text(MTL)
    assert notes(tmp_path / "t.obj", "mtllib m.mtl no.mtl\n" + OBJ) == (
        "material file 'no.mtl' left out: no such file",
    )


@pytest.mark.parametrize("name", ["wood.png", r".\wood.png", r"textures\wood.png", '"wood.png"'])
def test_textures_with_paths_of_windows_are_read(tmp_path: Path, name: str) -> None:
    red(tmp_path / "wood.png")
    (tmp_path / "m.mtl").write_text(f"{MTL}map_Kd {name}\n")
    assert notes(tmp_path / "t.obj", "mtllib m.mtl\n" + OBJ) == ("textures are sampled at the vertices only",)


def test_textures_that_cannot_be_had_are_noted_by_name_and_once(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("hello")
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    for name, reason in {
        "no.png": "no such file",
        "text.png": "expected an image, got text that begins with 'hello'",
        "folder.png": "not a regular file",
        "pipe.png": "not a regular file",
        "/dev/zero": "it lies outside the folder of the mesh",
        "../no.png": "it lies outside the folder of the mesh",
    }.items():
        (tmp_path / "m.mtl").write_text(f"{MTL}map_Kd {name}\n")
        assert notes(tmp_path / "t.obj", "mtllib m.mtl\n" + OBJ) == (f"texture '{name}' left out: {reason}",)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "m.mtl")
    (note,) = notes(tmp_path / "t.obj", "mtllib m.mtl\n" + OBJ)
    assert note == "material file 'm.mtl' left out: not a regular file"


def test_textures_too_large_are_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    red(tmp_path / "wood.png")
    monkeypatch.setattr("clpeel.reading.images.MOST_TEXELS", 1)
    (tmp_path / "m.mtl").write_text(f"{MTL}map_Kd wood.png\n")
    (note,) = notes(tmp_path / "t.obj", "mtllib m.mtl\n" + OBJ)
    assert note == "texture 'wood.png' left out: too large, 2 x 2 texels; at most 1 x 1 are read"


def test_other_maps_of_a_used_material_are_one_note(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text(f"{MTL}map_d a.png\nbump b.png\nmap_Ks c.png\nnewmtl unused\nmap_Ke d.png\n")
    (note,) = notes(tmp_path / "t.obj", "mtllib m.mtl\n" + OBJ)
    assert note == "textures left out, as only map_Kd is drawn: map_d, bump, map_ks"


def test_curves_lines_and_points_are_noted(tmp_path: Path) -> None:
    text = OBJ.replace("usemtl oak\n", "") + "curv 0 1 1 2 3\nsurf 0 1 0 1 1 2 3\nl 1 2\np 1\nl 2 3\n"
    assert notes(tmp_path / "t.obj", text) == (
        "curves and surfaces left out: 1 curv, 1 surf",
        "left out, not triangles: 2 line(s), 1 point(s)",
    )


def test_obj_faces_of_two_corners_are_counted(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\nf 2 3\n"
    assert notes(tmp_path / "t.obj", text) == ("face of fewer than 3 corners left out, 2 times",)


def test_obj_indices_that_count_back_do_so_from_where_they_stand(tmp_path: Path) -> None:
    path = tmp_path / "t.obj"
    corners = "v {0} 0 0\nv {0} 1 0\nv {0} 0 1\nvn 1 0 0\nf -3//-1 -2//-1 \\\n-1//-1\n"
    assert notes(path, corners.format(0) + corners.format(5)) == ()
    scene = load(path)
    assert sorted(scene.vertices[scene.faces][:, :, 0].tolist()) == [[0, 0, 0], [5, 5, 5]]


# --- PLY --------------------------------------------------------------------------------------------------------------

HEADER = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
POINTS = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n"


def test_a_missing_ply_texture_is_noted(tmp_path: Path) -> None:
    text = (
        HEADER.replace("element vertex", "comment TextureFile no.png\nelement vertex") + POINTS + "3 0 1 2\n3 1 3 2\n"
    )
    assert notes(tmp_path / "t.ply", text) == ("texture 'no.png' left out: no such file",)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_faces_of_two_corners_are_left_out_and_counted(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "t.ply"
    order = ">" if "big" in kind else "<"
    rows = [[0, 1], [1, 3, 2]]
    if kind == "ascii":
        body = (POINTS + "2 0 1\n3 1 3 2\n").encode()
    else:
        body = np.array(POINTS.split(), order + "f4").tobytes()
        body += b"".join(bytes([len(row)]) + np.array(row, order + "i4").tobytes() for row in rows)
    assert notes(path, HEADER.replace("ascii", kind).encode() + body) == ("1 face(s) of fewer than 3 corners left out",)
    assert load(path).faces.tolist() == [[1, 3, 2]] and len(load(path).vertices) == 4


def test_the_lesser_of_two_kinds_of_ply_colors_is_noted(tmp_path: Path) -> None:
    three = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    header = HEADER.replace("element face", three + "element face").replace("end_header", three + "end_header")
    rows = "".join(f"{row} 255 0 0\n" for row in POINTS.splitlines()) + "3 0 1 2 0 0 255\n3 1 3 2 0 0 255\n"
    assert notes(tmp_path / "t.ply", header + rows) == ("face colours left out: the vertices have their own",)
    colors = load(tmp_path / "t.ply").vertex_colors
    assert colors is not None and colors.tolist() == [[255, 0, 0, 255]] * 4


def test_lists_among_the_vertices_are_passed_over(tmp_path: Path) -> None:
    header = HEADER.replace("property float y", "property list uchar int neighbours\nproperty float y")
    path = tmp_path / "t.ply"
    assert notes(path, header + "0 1 9 0 0\n1 0 0 0\n0 2 8 9 1 0\n1 0 1 0\n3 0 1 2\n4 0 1 3 2\n") == ()
    scene = load(path)
    np.testing.assert_array_equal(scene.vertices, np.array(POINTS.split(), float).reshape(4, 3))
    assert scene.faces.tolist() == [[0, 1, 2], [0, 1, 3], [0, 3, 2]]


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_ply_triangle_strips_are_read(tmp_path: Path, kind: str) -> None:
    header = HEADER.replace("element face 2", "element tristrips 1").replace("uchar", "int").replace("ascii", kind)
    path = tmp_path / "t.ply"
    values = [8, 0, 1, 2, 3, -1, 0, 1, 3]
    if kind == "ascii":
        body = (POINTS + " ".join(map(str, values)) + "\n").encode()
    else:
        body = np.array(POINTS.split(), "<f4").tobytes() + np.array(values, "<i4").tobytes()
    path.write_bytes(header.encode() + body)
    assert load(path).faces.tolist() == [[0, 1, 2], [1, 3, 2], [0, 1, 3]]


def test_binary_ply_of_mixed_polygons_is_read(tmp_path: Path) -> None:
    body = np.array(POINTS.split(), "<f4").tobytes()
    body += b"".join(bytes([len(row)]) + np.array(row, "<i4").tobytes() for row in ([0, 1, 2], [0, 1, 3, 2]))
    path = tmp_path / "t.ply"
    assert notes(path, HEADER.replace("ascii", "binary_little_endian").encode() + body) == ()
    assert load(path).faces.tolist() == [[0, 1, 2], [0, 1, 3], [0, 3, 2]]


# --- OFF, 3MF and STL -------------------------------------------------------------------------------------------------


def test_off_colors_and_short_faces_are_noted(tmp_path: Path) -> None:
    text = "COFF\n3 2 0\n0 0 0 1 0 0 1\n1 0 0 1 0 0 1\n0 1 0 1 0 0 1\n3 0 1 2 255 0 0\n2 0 1\n"
    assert notes(tmp_path / "t.off", text) == (
        "colours of 3 vertices left out: those of .off files are not read",
        "colours of 1 face(s) left out: those of .off files are not read",
        "1 face(s) of fewer than 3 corners left out",
    )


def package(path: Path, resources: str, build: str = '<item objectid="1"/>', **others: str) -> Path:
    """A 3MF package with these resources and further models."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", f"<model><resources>{resources}</resources><build>{build}</build></model>")
        for name, text in others.items():
            archive.writestr(f"3D/{name}.model", f"<model><resources>{text}</resources></model>")
    return path


SHAPE = (
    "<mesh><vertices>"
    + "".join(f'<vertex x="{x}" y="{y}" z="0"/>' for x, y in ((0, 0), (1, 0), (0, 1)))
    + "</vertices>"
    '<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
)


def test_colors_of_3mf_are_noted(tmp_path: Path) -> None:
    resources = f'<m:colorgroup id="5"/><basematerials id="6"/><object id="1">{SHAPE}</object>'
    assert load(package(tmp_path / "t.3mf", resources.replace("m:", ""))).notes == (
        "colours and properties of the 3MF file left out: base materials, colour groups",
    )


def test_3mf_components_that_are_put_together_wrongly_are_noted(tmp_path: Path) -> None:
    part, whole = f'<object id="1">{SHAPE}</object>', '<object id="2"><components>{}</components></object>'
    one = whole.format('<component path="/3D/a.model" objectid="1"/>')
    two = whole.format('<component path="/3D/a.model" objectid="1"/><component path="/3D/b.model" objectid="1"/>')
    item = '<item objectid="2"/>'
    assert load(package(tmp_path / "one.3mf", one, item, a=part)).notes == ()
    (note,) = [n for n in load(package(tmp_path / "two.3mf", two, item, a=part, b=part)).notes if "duplicate" not in n]
    assert "components" in note and "'3D/a.model', '3D/b.model'" in note


def test_the_colors_of_shared_3mf_models_are_noted(model: Callable[[str], Path]) -> None:
    assert load(model("3mf/counterXP.3MF")).notes == ("colours and properties of the 3MF file left out: colour groups",)
    assert "components in other files" in load(model("3mf/production_components.3mf")).notes[0]


ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl(count: int, promised: int, more: bytes = b"", head: bytes = b"", attribute: int = 0) -> bytes:
    """A binary STL file of count triangles."""
    rows = np.zeros(count, ROW)
    rows["corners"] = np.arange(1, 9 * count + 1).reshape(count, 3, 3)
    rows["attribute"] = attribute
    return head.ljust(80, b" ") + promised.to_bytes(4, "little") + rows.tobytes() + more


@pytest.mark.parametrize("promised", [0, 1, 9, 2**32 - 1])
def test_a_wrong_count_in_stl_is_noted_and_all_is_read(tmp_path: Path, promised: int) -> None:
    (note,) = notes(tmp_path / "t.stl", stl(3, promised))
    assert note == f"the header promises {promised:,} triangle(s), the file holds 3: all of them are read"
    assert len(load(tmp_path / "t.stl").faces) == 3


@pytest.mark.parametrize("more", [b"\r\n", bytes(50), bytes(100), b"made by hand " * 20])
def test_bytes_after_the_stl_triangles_are_noted(tmp_path: Path, more: bytes) -> None:
    (note,) = notes(tmp_path / "t.stl", stl(3, 3, more))
    assert note == f"{len(more)} byte(s) after the 3 triangle(s) left out"
    assert len(load(tmp_path / "t.stl").faces) == 3


def test_a_binary_stl_may_begin_with_solid(tmp_path: Path) -> None:
    assert notes(tmp_path / "t.stl", stl(3, 3, b"\n", head=b"solid facet")) == (
        "1 byte(s) after the 3 triangle(s) left out",
    )


def test_stl_colors_are_noted(tmp_path: Path) -> None:
    text = "colours of 3 face(s) left out: they are in the attribute bytes of the STL file"
    assert notes(tmp_path / "t.stl", stl(3, 3, attribute=0x8000)) == (text,)
    assert notes(tmp_path / "t.stl", stl(3, 3, head=b"COLOR=abcd", attribute=7)) == (text,)
    assert notes(tmp_path / "t.stl", stl(3, 3, attribute=7)) == ()
