"""Assimp: files of 3DS, X, AC3D and others that the tests write themselves come as their formats say."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clpeel
from clpeel.command.main import main
from clpeel.scene.textures import linear

pytest.importorskip("assimp_py", reason="needs pip install 'clpeel[assimp]'")

SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], np.float64)
FACES = [[0, 1, 2], [0, 2, 3]]
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 0.25]])


def corners(scene: clpeel.Scene) -> np.ndarray:
    return scene.vertices[scene.faces]


def chunk(number: int, *parts: bytes) -> bytes:
    data = b"".join(parts)
    return struct.pack("<HI", number, 6 + len(data)) + data


def text(word: str) -> bytes:
    return word.encode() + b"\0"


def three_ds(file: str = "t.png") -> bytes:
    """A square with a material, half transparent, with a texture. Its z is up, as 3DS files have it."""
    points = struct.pack("<H12f", 4, *SQUARE.reshape(-1))
    uv = struct.pack("<H8f", 4, *UV.reshape(-1))
    faces = struct.pack("<H", 2) + b"".join(struct.pack("<4H", *face, 7) for face in FACES)
    of_faces = chunk(0x4130, text("red"), struct.pack("<3H", 2, 0, 1))
    shape = chunk(0x4100, chunk(0x4110, points), chunk(0x4140, uv), chunk(0x4120, faces, of_faces))
    color = chunk(0xA020, chunk(0x0011, bytes([255, 128, 0])))
    transparency = chunk(0xA050, chunk(0x0030, struct.pack("<H", 75)))
    picture = [chunk(0xA200, chunk(0x0030, struct.pack("<H", 100)), chunk(0xA300, text(file)))] if file else []
    material = chunk(0xAFFF, chunk(0xA000, text("red")), color, transparency, *picture)
    return chunk(0x4D4D, chunk(0x0002, struct.pack("<I", 3)), chunk(0x3D3D, material, chunk(0x4000, text("s"), shape)))


def test_3ds_is_turned_upright_and_has_its_material(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (2, 2), (0, 255, 0)).save(tmp_path / "t.png")
    (tmp_path / "a.3ds").write_bytes(three_ds())
    scene = clpeel.load(tmp_path / "a.3ds")
    x, y, z = np.moveaxis(SQUARE[FACES], -1, 0)
    np.testing.assert_allclose(corners(scene), np.stack([x, z, -y], axis=-1), atol=1e-6)
    (only,) = scene.materials
    assert only.name == "red" and only.alpha_mode == "BLEND" and only.texture is not None and scene.notes == ()
    np.testing.assert_allclose(only.base_color, [1, linear(128 / 255), 0, 0.25], atol=1e-6)
    assert only.texture.image[0, 0].tolist() == [0, 255, 0, 255] and scene.uv is not None
    np.testing.assert_allclose(scene.uv[scene.faces], (UV * [1, -1] + [0, 1])[FACES], atol=1e-6)


def test_a_texture_that_is_missing_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.3ds").write_bytes(three_ds())
    assert clpeel.load(tmp_path / "a.3ds").notes == ("texture 't.png' left out: no such file",)


AC = """AC3Db
MATERIAL "blue" rgb 0 0.5 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0.4
OBJECT world
kids 1
OBJECT poly
loc 1 2 3
numvert 4
0 0 0
2 0 0
2 1 0
0 1 0
numsurf 1
SURF 0x20
mat 0
refs 4
0 0 0
1 1 0
2 1 1
3 0 1
kids 0
"""

X = """xof 0303txt 0032
Mesh {
 4;
 0.0;0.0;0.0;, 2.0;0.0;0.0;, 2.0;1.0;0.0;, 0.0;1.0;0.0;;
 1;
 4;0,3,2,1;;
 MeshMaterialList {
  1; 1; 0;;
  Material { 0.0;0.5;1.0;0.6;; 0.0; 0.0;0.0;0.0;; 0.0;0.0;0.0;; }
 }
}
"""

ASE = """*3DSMAX_ASCIIEXPORT 200
*MATERIAL_LIST {
 *MATERIAL_COUNT 1
 *MATERIAL 0 { *MATERIAL_NAME "blue" *MATERIAL_DIFFUSE 0.0 0.5 1.0 *MATERIAL_TRANSPARENCY 0.4 }
}
*GEOMOBJECT {
 *NODE_NAME "s"
 *MESH {
  *MESH_NUMVERTEX 4 *MESH_NUMFACES 2
  *MESH_VERTEX_LIST {
   *MESH_VERTEX 0 0.0 0.0 0.0
   *MESH_VERTEX 1 2.0 0.0 0.0
   *MESH_VERTEX 2 2.0 1.0 0.0
   *MESH_VERTEX 3 0.0 1.0 0.0
  }
  *MESH_FACE_LIST {
   *MESH_FACE 0: A: 0 B: 1 C: 2 AB: 1 BC: 1 CA: 0 *MESH_SMOOTHING 1 *MESH_MTLID 0
   *MESH_FACE 1: A: 0 B: 2 C: 3 AB: 1 BC: 1 CA: 0 *MESH_SMOOTHING 1 *MESH_MTLID 0
  }
 }
 *MATERIAL_REF 0
}
"""


def unordered(triangles: np.ndarray) -> list[list[float]]:
    return sorted({tuple(np.round(point, 6) + 0.0) for point in triangles.reshape(-1, 3)})  # type: ignore[return-value]


@pytest.mark.parametrize(("extension", "words", "at"), [("ac", AC, (1, 2, 3)), ("x", X, (0, 0, 0)), ("ase", ASE, None)])
def test_files_of_text(extension: str, words: str, at: Any, tmp_path: Path) -> None:
    """Corners, the area, and the material. X is left-handed, with z forwards, so Assimp turns z around."""
    (tmp_path / f"a.{extension}").write_text(words)
    scene = clpeel.load(tmp_path / f"a.{extension}")
    assert scene.counts == (2, 0, 0)
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(2)
    if at is not None:
        assert unordered(corners(scene)) == unordered(SQUARE + at)
    (only,) = scene.materials
    np.testing.assert_allclose(only.base_color, [0, linear(0.5), 1, 0.6], atol=1e-6)
    assert only.alpha_mode == "BLEND"


def x3d(kind: str) -> str:
    """A shape of three points."""
    points = '<Coordinate point="0 0 0 1 0 0 1 1 0"/>'
    shape = f'<Shape><{kind} coordIndex="0 1 2 -1">{points}</{kind}></Shape>'
    return f'<X3D version="3.0"><Scene>{shape}</Scene></X3D>'


def test_lines_are_said_to_be_what_the_package_does_not_give(tmp_path: Path) -> None:
    (tmp_path / "a.x3d").write_text(x3d("IndexedFaceSet"))
    assert clpeel.load(tmp_path / "a.x3d").counts == (1, 0, 0)
    (tmp_path / "a.x3d").write_text(x3d("IndexedLineSet"))
    with pytest.raises(clpeel.InputError, match="expected triangles alone, got lines or points too"):
        clpeel.load(tmp_path / "a.x3d")


@pytest.mark.parametrize("extension", ["3ds", "x", "lwo", "ac", "md2", "b3d"])
@pytest.mark.parametrize("data", [b"", b"these are words\n", three_ds("")[:60]])
def test_damaged_files_are_one_line(extension: str, data: bytes, tmp_path: Path, capfd: Any) -> None:
    path = tmp_path / f"a.{extension}"
    path.write_bytes(data)
    assert main(["render", str(path), "-o", str(tmp_path / "a.png")]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith(f"clpeel: error: {path}: ") and err.count("\n") == 1, err
    assert len(err) < 300 + len(str(path)) and str(path) not in err.removeprefix(f"clpeel: error: {path}")
