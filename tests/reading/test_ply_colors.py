"""Colours and textures of PLY files: under every name and in every type, and which of several are drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.plys import INDICES, KINDS, SQUARE, XYZ, written

from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.scene import Scene

RGB = ("red", "green", "blue")
PAIR = [([0, 1, 2],), ([0, 2, 3],)]


def read(folder: Path, *elements: Any, kind: str = "ascii", comment: str = "by hand") -> Scene:
    """The scene of a PLY file of these elements."""
    (folder / "t.ply").write_bytes(written(kind, *elements, comment=comment))
    return load(folder / "t.ply")


def vertex(properties: list[str], values: Any) -> Any:
    """The element of the square's corners, with these values of further properties, [4, properties]."""
    return "vertex", (*XYZ, *properties), [(*a, *b) for a, b in zip(SQUARE, values, strict=True)]


def face(properties: list[str], values: Any) -> Any:
    """The element of the square's two triangles, with these values of further properties, [2, properties]."""
    return "face", (INDICES, *properties), [(*a, *b) for a, b in zip(PAIR, values, strict=True)]


def typed(kind: str, names: Any) -> list[str]:
    """Properties of one type."""
    return [f"{kind} {name}" for name in names]


# --- colours ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("names", "values", "want"),
    [
        (RGB, (255, 0, 51), (255, 0, 51, 255)),
        ((*RGB, "alpha"), (255, 0, 51, 102), (255, 0, 51, 102)),
        (("r", "g", "b", "a"), (255, 0, 51, 102), (255, 0, 51, 102)),
        (("r", "g", "b"), (255, 0, 51), (255, 0, 51, 255)),
        (tuple(f"diffuse_{name}" for name in RGB), (255, 0, 51), (255, 0, 51, 255)),
    ],
)
def test_colors_of_every_name(tmp_path: Path, kind: str, names: Any, values: Any, want: Any) -> None:
    properties = typed("uchar", names)
    scene = read(tmp_path, vertex(properties, [values] * 4), face([], [()] * 2), kind=kind)
    assert scene.vertex_colors is not None and scene.vertex_colors.tolist() == [list(want)] * 4
    scene = read(tmp_path, vertex([], [()] * 4), face(properties, [values, [0] * len(values)]), kind=kind)
    assert scene.face_colors is not None and scene.face_colors[0].tolist() == list(want)
    assert scene.face_colors.dtype == np.uint8 and scene.face_colors[1, :3].tolist() == [0, 0, 0]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("of", "values", "want"),
    [
        ("ushort", (65535, 0, 13107), (1, 0, 0.2, 1)),
        ("float", (1.0, 0.0, 0.25), (1, 0, 0.25, 1)),
        ("double", (1.0, 0.0, 0.25), (1, 0, 0.25, 1)),
        ("float", (255.0, 0.0, 51.0), (255, 0, 51, 255)),
        ("int", (255, 0, 51), (255, 0, 51, 255)),
    ],
)
def test_colors_of_every_type(tmp_path: Path, kind: str, of: str, values: Any, want: Any) -> None:
    scene = read(tmp_path, vertex(typed(of, RGB), [values] * 4), face([], [()] * 2), kind=kind)
    assert scene.vertex_colors is not None
    np.testing.assert_allclose(scene.vertex_colors[0], want, atol=1e-7)
    assert scene.vertex_colors.dtype == (np.uint8 if max(want) > 1 else np.float32)


def test_colors_of_polygons_are_those_of_their_triangles(tmp_path: Path) -> None:
    rows = [([0, 1, 2, 3], 255, 0, 0), ([0, 1], 9, 9, 9), ([0, 2, 1], 0, 255, 0)]
    scene = read(tmp_path, vertex([], [()] * 4), ("face", (INDICES, *typed("uchar", RGB)), rows))
    assert scene.face_colors is not None
    assert scene.face_colors[:, :3].tolist() == [[255, 0, 0], [255, 0, 0], [0, 255, 0]]


def test_of_two_kinds_of_colors_the_one_that_says_something_is_drawn(tmp_path: Path) -> None:
    properties = typed("uchar", RGB)
    flat, varied = [(255, 255, 255)] * 4, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (9, 9, 9)]
    own = face(properties, [(10, 20, 30), (40, 50, 60)])
    scene = read(tmp_path, vertex(properties, flat), own)
    assert scene.face_colors is not None and scene.face_colors[:, 0].tolist() == [10, 40]
    assert scene.notes == ("vertex colours left out: all are alike, and the faces have their own",)
    scene = read(tmp_path, vertex(properties, varied), own)
    assert scene.vertex_colors is not None and scene.vertex_colors[:, :3].tolist() == [list(c) for c in varied]
    assert scene.notes == ("face colours left out: the vertices have their own",)


# --- textures ---------------------------------------------------------------------------------------------------------

UV = [(0.0, 0.0), (0.25, 0.0), (0.25, 0.75), (0.0, 0.75)]


def picture(path: Path, color: Any) -> None:
    """A picture of one colour."""
    image = pytest.importorskip("PIL.Image")
    image.fromarray(np.full((2, 3, len(color)), color, np.uint8)).save(path)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_textures_at_vertices(tmp_path: Path, kind: str, names: Any) -> None:
    picture(tmp_path / "a b.png", (1, 2, 3))
    own = vertex(typed("float", names), UV)
    scene = read(tmp_path, own, face([], [()] * 2), kind=kind, comment="TextureFile a b.png")
    (material,) = scene.materials
    assert material.texture is not None and (material.texture.image == (1, 2, 3, 255)).all()
    assert material.alpha_mode == "OPAQUE" and material.base_color == (1, 1, 1, 1)
    assert scene.uv is not None and len(scene.vertices) == 4 and scene.notes == ()
    np.testing.assert_allclose(scene.uv, [[0, 1], [0.25, 1], [0.25, 0.25], [0, 0.25]])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("word", ["comment TextureFile", "obj_info texturefile"])
def test_textures_at_corners_split_vertices_where_they_differ(tmp_path: Path, kind: str, word: str) -> None:
    picture(tmp_path / "a.png", (1, 2, 3))
    other = [0.5, 0.0, *UV[2], *UV[3]]
    own = face(["list uchar float texcoord"], [([x for k in range(3) for x in UV[k]],), (other,)])
    data = written(kind, vertex([], [()] * 4), own, comment="by hand").replace(
        b"comment by", f"{word} a.png\ncomment by".encode()
    )
    (tmp_path / "t.ply").write_bytes(data)
    scene = load(tmp_path / "t.ply")
    assert scene.uv is not None and len(scene.vertices) == 5, "the first vertex is there twice"
    np.testing.assert_allclose(scene.uv[scene.faces[0]], [[0, 1], [0.25, 1], [0.25, 0.25]])
    np.testing.assert_allclose(scene.uv[scene.faces[1]], [[0.5, 1], [0.25, 0.25], [0, 0.25]])
    np.testing.assert_array_equal(scene.vertices[scene.faces], np.array(SQUARE)[[[0, 1, 2], [0, 2, 3]]])


def test_textures_of_quads_and_of_faces_without_coordinates(tmp_path: Path) -> None:
    picture(tmp_path / "a.png", (1, 2, 3, 4))
    rows = [([0, 1, 2, 3], [x for pair in UV for x in pair]), ([0, 2, 1], []), ([0, 1], [0.0] * 4)]
    own = ("face", (INDICES, "list uchar float texcoord"), rows)
    scene = read(tmp_path, vertex([], [()] * 4), own, comment="TextureFile a.png")
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, 0, -1]
    assert scene.materials[0].alpha_mode == "BLEND" and scene.uv is not None
    np.testing.assert_allclose(scene.uv[scene.faces[1]], [[0, 1], [0.25, 0.25], [0, 0.25]])
    assert scene.face_colors is not None and tuple(scene.face_colors[2]) == DEFAULT_COLOR


def test_each_face_has_the_texture_of_its_number(tmp_path: Path) -> None:
    for name, level in (("a.png", 10), ("b.png", 20), ("c.png", 30)):
        picture(tmp_path / name, (level, 0, 0))
    rows = [([0, 1, 2], [0.0] * 6, 2), ([0, 2, 3], [0.0] * 6, 0), ([3, 2, 1], [0.0] * 6, -1), ([1, 2, 3], [0.0] * 6, 2)]
    own = ("face", (INDICES, "list uchar float texcoord", "int texnumber"), rows)
    names = "\ncomment ".join(f"TextureFile {name}.png" for name in "abc")
    scene = read(tmp_path, vertex([], [()] * 4), own, comment=names)
    assert scene.face_materials is not None
    levels = [0 if k < 0 else int(scene.materials[k].texture.image[0, 0, 0]) for k in scene.face_materials]
    assert levels == [30, 10, 0, 30] and len(scene.materials) == 2


def test_textures_replace_other_colors(tmp_path: Path) -> None:
    picture(tmp_path / "a.png", (1, 2, 3))
    own = vertex(["float s", "float t", *typed("uchar", RGB)], [(*uv, 9, 9, k) for k, uv in enumerate(UV)])
    scene = read(tmp_path, own, face([], [()] * 2), comment="TextureFile a.png")
    assert scene.notes == ("colours left out: 2 face(s) have a texture instead",)
    assert scene.color is not None and scene.color.tolist() == [255] * 4


def test_textures_that_cannot_be_had_are_noted(tmp_path: Path) -> None:
    own = vertex(["float s", "float t", *typed("uchar", RGB)], [(*uv, 9, 9, k) for k, uv in enumerate(UV)])
    scene = read(tmp_path, own, face([], [()] * 2), comment="TextureFile no.png")
    assert scene.notes == ("texture 'no.png' left out: no such file",)
    assert scene.vertex_colors is not None and not scene.materials and scene.uv is None
    scene = read(tmp_path, vertex([], [()] * 4), face([], [()] * 2), comment="TextureFile no.png")
    assert scene.notes == ("texture 'no.png' left out: the file has no texture coordinates",)
    (tmp_path / "no.png").write_text("hello")
    (note,) = read(tmp_path, own, face([], [()] * 2), comment="TextureFile no.png").notes
    assert note == "texture 'no.png' left out: expected an image, got text that begins with 'hello'"


def test_colors_of_faces_without_a_texture_stay(tmp_path: Path) -> None:
    picture(tmp_path / "a.png", (1, 2, 3))
    rows = [([0, 1, 2], [0.0] * 6), ([0, 2, 3], [])]
    own = ("face", (INDICES, "list uchar float texcoord"), rows)
    scene = read(tmp_path, vertex(typed("uchar", RGB), [(9, 9, k) for k in range(4)]), own, comment="TextureFile a.png")
    assert scene.notes == ("colours left out: 1 face(s) have a texture instead",)
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, -1]
    assert not scene.materials[0].rgb_of_scene and not scene.materials[0].alpha_of_scene
    assert scene.vertex_colors is not None
    assert scene.vertex_colors[scene.faces[1]][:, :3].tolist() == [[9, 9, 0], [9, 9, 2], [9, 9, 3]]
