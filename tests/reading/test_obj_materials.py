"""Materials of OBJ files: Kd, d, Tr and textures are what exporters mean by them, wherever the files are found."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clpeel.reading import mtl
from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.materials import Material
from clpeel.scene.scene import Scene

OBJ = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 0.25 0\nvt 0 0.5\nusemtl oak\nf 1/1 2/2 3/3\n"
MTL = "newmtl oak\nKd 1 1 1\n"


def light(value: float) -> float:
    """sRGB as linear light, by IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def picture(path: Path, pixels: Any) -> None:
    """Writes bytes [height, width, channels] as a picture."""
    image = pytest.importorskip("PIL.Image")
    path.parent.mkdir(exist_ok=True)
    image.fromarray(np.array(pixels, np.uint8)).save(path)


def red(path: Path) -> None:
    """A red picture."""
    picture(path, np.full((2, 2, 3), (255, 0, 0)))


def read(folder: Path, statements: str, obj: str = OBJ) -> Scene:
    """The scene of an OBJ file whose material oak says this, without the note of faces that lie on others."""
    (folder / "m.mtl").write_text(f"newmtl oak\n{statements}\n")
    (folder / "t.obj").write_text(obj)
    scene = load(folder / "t.obj")
    return replace(scene, notes=tuple(note for note in scene.notes if not note.startswith("duplicate")))


def oak(folder: Path, statements: str) -> Material:
    """The material that says this, which has no notes."""
    scene = read(folder, statements)
    assert scene.notes == ()
    (material,) = scene.materials
    return material


def texels(material: Material) -> np.ndarray:
    """The image of a material's texture."""
    assert material.texture is not None
    return material.texture.image


# --- colours and opacity ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "rgb", "alpha"),
    [
        ("Kd 0.2 0.4 0.6", (0.2, 0.4, 0.6), 1),
        ("Kd 0.4", (0.4, 0.4, 0.4), 1),
        ("Kd 0 0 0", (0, 0, 0), 1),
        ("\tKD 0.2\t0.4 0.6", (0.2, 0.4, 0.6), 1),
        ("Ns 5", [value / 255 for value in DEFAULT_COLOR[:3]], 1),
        ("Kd 1 0 0\nd 0.3", (1, 0, 0), 0.3),
        ("Kd 1 0 0\nd -halo 0.3", (1, 0, 0), 0.3),
        ("Kd 1 0 0\nd 1.5", (1, 0, 0), 1),
        ("Kd 1 0 0\nd 0", (1, 0, 0), 0),
        ("Kd 1 0 0\nTr 0.7", (1, 0, 0), 0.3),
        ("Kd 1 0 0\nTr 0", (1, 0, 0), 1),
        ("Kd 1 0 0\nTr 1.000000", (1, 0, 0), 1),  # what MeshLab means by it
        ("Kd 1 0 0\nd 0.25\nTr 0.25", (1, 0, 0), 0.25),
        ("Tr 0.25\nKd 1 0 0\nd 1", (1, 0, 0), 1),
        ("Kd 1 0 0\nillum 0", (1, 0, 0), 1),
        ("Kd 1 0 0\nillum 9\nTf 0 0 0", (1, 0, 0), 1),
        ("Kd 0 1 0\nKd 1 0 0", (1, 0, 0), 1),
    ],
)
def test_colors_and_opacities(tmp_path: Path, lines: str, rgb: Any, alpha: float) -> None:
    material = oak(tmp_path, lines)
    np.testing.assert_allclose(material.base_color, [*map(light, rgb), alpha], atol=1e-12)
    assert material.alpha_mode == ("BLEND" if alpha < 1 else "OPAQUE")
    assert material.name == "oak" and material.texture is None and not material.unlit


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("Kd 255 128 0", "Kd of material 'oak' is cut off at 1: '255 128 0'"),
        ("Kd spectral oak.rfl", "Kd of material 'oak' left out: expected three numbers, got 'spectral oak.rfl'"),
    ],
)
def test_colors_that_are_not_drawn_are_noted(tmp_path: Path, line: str, note: str) -> None:
    assert read(tmp_path, line).notes == (note,)


def test_the_shared_model_of_meshlab_is_opaque_and_textured(model: Any) -> None:
    scene = load(model("fuze/fuze.obj"))
    assert scene.opaque and scene.notes == () and texels(scene.materials[0]).shape == (1024, 1024, 4)
    assert len(scene.faces) == 1000 and scene.uv is not None and scene.vertex_normals is not None


# --- how light falls on them ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "metallic", "roughness", "emissive"),
    [
        ("Ns 0", 0, 1, (0, 0, 0)),
        ("Ns 30", 0, 0.5, (0, 0, 0)),  # (2 / 32)^(1/4)
        ("Ns 510", 0, 0.25, (0, 0, 0)),  # (2 / 512)^(1/4)
        ("Ns 30\nKs 0.5 0.5 0.5", 0, 0.5, (0, 0, 0)),
        ("Ns 510\nKs 0 0 0", 0, 1, (0, 0, 0)),  # no highlight, however narrow it would be
        ("Ks 0", 0, 1, (0, 0, 0)),
        ("Ks 0 0 0\nPr 0.3", 0, 0.3, (0, 0, 0)),
        ("Pr 0.3\nNs 510", 0, 0.3, (0, 0, 0)),
        ("Pm 0.75", 0.75, 0.5, (0, 0, 0)),
        ("Pm 0.75\nPr 0.1", 0.75, 0.1, (0, 0, 0)),
        ("PR 0\nPM 1", 1, 0, (0, 0, 0)),
        ("Ke 0.5 0.2 1", 0, 0.5, (light(0.5), light(0.2), 1)),
        ("Ke 0.5", 0, 0.5, (light(0.5),) * 3),
        ("Ke 5 0.5 -1", 0, 0.5, (1, light(0.5), 0)),
        ("Ke 0 0 0\nNs 30", 0, 0.5, (0, 0, 0)),
        ("Ns -7", 0, 1, (0, 0, 0)),
        ("Ns 1e30\nKs 1 1 1", 0, 0, (0, 0, 0)),
        ("Pr 7\nPm -3", 0, 1, (0, 0, 0)),
        ("Pr -7\nPm 3", 1, 0, (0, 0, 0)),
        ("Pr x\nNs 30", 0, 0.5, (0, 0, 0)),
        ("Ns 30 # dull\nKs 1 # white", 0, 0.5, (0, 0, 0)),
    ],
)
def test_finishes(tmp_path: Path, lines: str, metallic: float, roughness: float, emissive: Any) -> None:
    found = oak(tmp_path, f"Kd 1 0 0\n{lines}").finish
    assert found is not None and found.uv_sets == 0
    np.testing.assert_allclose([found.metallic, found.roughness], [metallic, roughness], atol=1e-7)
    np.testing.assert_allclose(found.emissive, emissive, atol=1e-12)


@pytest.mark.parametrize(
    "lines", ["d 1", "Ke 0 0 0", "Ks 1 1 1", "Ns shiny", "Ns nan", "Pr inf", "Pm", "Ke spectral lamp.rfl", "Ks xyz 1 2"]
)
def test_materials_that_say_nothing_of_light_have_no_finish(tmp_path: Path, lines: str) -> None:
    assert oak(tmp_path, f"Kd 1 0 0\n{lines}").finish is None


def test_textured_and_clear_materials_have_a_finish_too(tmp_path: Path) -> None:
    red(tmp_path / "wood.png")
    found = oak(tmp_path, "map_Kd wood.png\nd 0.5\nPr 0.25")
    assert found.texture is not None and found.alpha_mode == "BLEND" and not found.plain
    assert found.finish is not None and found.finish.roughness == 0.25


# --- textures ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kd", "base"), [("Kd 0.5 1 0.2", (light(0.5), 1, light(0.2))), ("Kd 0 0 0", (1, 1, 1)), ("Ka 0 0 0", (1, 1, 1))]
)
def test_kd_multiplies_the_texture_unless_it_is_black_or_missing(tmp_path: Path, kd: str, base: Any) -> None:
    red(tmp_path / "wood.png")
    material = oak(tmp_path, f"{kd}\nmap_Kd wood.png")
    np.testing.assert_allclose(material.base_color, [*base, 1], atol=1e-12)
    assert (texels(material) == (255, 0, 0, 255)).all() and material.alpha_mode == "OPAQUE"
    assert material.texture is not None and material.texture.wrap == ("repeat", "repeat")


@pytest.mark.parametrize(
    ("options", "uv"),
    [
        ("", [[0, 1], [0.25, 1], [0, 0.5]]),
        ("-s 2 4 1", [[0, 1], [0.5, 1], [0, -1]]),
        ("-o 0.5 0.25 0", [[0.5, 0.75], [0.75, 0.75], [0.5, 0.25]]),
        ("-s 2 4 -o 0.5 0.25", [[0.5, 0.75], [1, 0.75], [0.5, -1.25]]),
        ("-o 0.5", [[0.5, 1], [0.75, 1], [0.5, 0.5]]),
        ("-o 0.5#2", [[0.5, 1], [0.75, 1], [0.5, 0.5]]),
    ],
)
def test_v_points_up_in_files_and_options_shift_and_scale(tmp_path: Path, options: str, uv: Any) -> None:
    """The scene has u, 1 - v of u, v scaled by -s, then shifted by -o."""
    red(tmp_path / "wood.png")
    scene = read(tmp_path, f"map_Kd {options} wood.png")
    assert scene.uv is not None and scene.notes == ()
    np.testing.assert_allclose(scene.uv[scene.faces[0]], uv)


def test_corners_of_several_placings_are_split(tmp_path: Path) -> None:
    red(tmp_path / "wood.png")
    obj = OBJ + "usemtl elm\nf 3/3 2/2 1/1\nusemtl oak\nf 2/2 1/1 3/3\n"
    scene = read(tmp_path, "map_Kd wood.png\nnewmtl elm\nmap_Kd -s 2 2 wood.png", obj)
    assert scene.uv is not None and len(scene.vertices) == 6
    own = scene.uv[scene.faces]
    np.testing.assert_allclose(own[0], [[0, 1], [0.25, 1], [0, 0.5]])
    np.testing.assert_allclose(own[1], [[0, 0], [0.5, 1], [0, 1]])
    np.testing.assert_allclose(own[2], own[0][[1, 0, 2]])
    assert scene.materials[0].texture is scene.materials[1].texture


@pytest.mark.parametrize(
    "options",
    [
        "-blendu on -blendv off -cc on -type sphere",
        "-bm 0.5 -boost 2 -mm 0 1 -t 1 1 1 -texres 512 -imfchan r",
        "-t 1 -mm 0.1 -s 1 1 1",
    ],
)
def test_other_options_do_not_become_part_of_the_name(tmp_path: Path, options: str) -> None:
    name = "2 dark wood.png"
    red(tmp_path / name)
    scene = read(tmp_path, f"map_Kd {options} {name}")
    assert (texels(scene.materials[0]) == (255, 0, 0, 255)).all()
    (note,) = scene.notes
    assert note.startswith("options of textures of material 'oak' left out: -")


def test_clamped_textures_are_clamped(tmp_path: Path) -> None:
    red(tmp_path / "wood.png")
    for text, wrap in (("-clamp on", "clamp"), ("-clamp off", "repeat")):
        texture = oak(tmp_path, f"map_Kd {text} wood.png").texture
        assert texture is not None and texture.wrap == (wrap, wrap)


def test_faces_without_texture_coordinates_are_counted(tmp_path: Path) -> None:
    red(tmp_path / "wood.png")
    scene = read(tmp_path, "map_Kd wood.png", OBJ + "f 3 2 1\nf 3/3 2 1/1\nf 1/9 2/9 3/9\n")
    assert scene.notes == ("texture coordinates are missing: 3 face(s) have one colour of their texture",)
    assert scene.uv is not None
    np.testing.assert_allclose(scene.uv[scene.faces[0]], [[0, 1], [0.25, 1], [0, 0.5]])


# --- alpha ------------------------------------------------------------------------------------------------------------

LEAF = [[[10, 20, 30, 255], [40, 50, 60, 128]], [[70, 80, 90, 0], [1, 2, 3, 255]]]


def test_alpha_of_a_texture_blends(tmp_path: Path) -> None:
    picture(tmp_path / "leaf.png", LEAF)
    material = oak(tmp_path, "map_Kd leaf.png")
    assert material.alpha_mode == "BLEND" and texels(material).tolist() == LEAF
    material = oak(tmp_path, "map_Kd leaf.png\nmap_d leaf.png\nd 0.5")
    assert texels(material).tolist() == LEAF and material.base_color[3] == 0.5


def test_map_d_is_the_luminance_of_its_image_or_its_alpha(tmp_path: Path) -> None:
    picture(tmp_path / "wood.png", [[[10, 20, 30], [40, 50, 60]]])
    picture(tmp_path / "grey.png", [[0, 200]])
    picture(tmp_path / "rgb.png", [[[255, 0, 0], [0, 255, 0]]])
    picture(tmp_path / "cut.png", [[[255, 255, 255, 7], [255, 255, 255, 9]]])
    for name, alphas in {"grey.png": (0, 200), "rgb.png": (54, 182), "cut.png": (7, 9)}.items():
        material = oak(tmp_path, f"map_Kd wood.png\nmap_d {name}")
        assert texels(material).tolist() == [[[10, 20, 30, alphas[0]], [40, 50, 60, alphas[1]]]]
        assert material.alpha_mode == "BLEND"


def test_map_d_of_16_bits_counts_as_stored() -> None:
    """Such images have linear texels, but an opacity is no colour."""
    mask = np.full((1, 1, 4), light(0.4), np.float32)
    mask[..., 3] = 1
    np.testing.assert_array_equal(mtl.with_opacities(None, mask), [[[255, 255, 255, 102]]])


def test_map_d_alone_has_the_color_of_kd(tmp_path: Path) -> None:
    picture(tmp_path / "grey.png", [[0, 200]])
    material = oak(tmp_path, "Kd 0 0 0\nmap_d grey.png")
    assert texels(material).tolist() == [[[255, 255, 255, 0], [255, 255, 255, 200]]]
    assert material.base_color == (0, 0, 0, 1) and material.alpha_mode == "BLEND"


def test_images_of_two_sizes_get_the_larger_one(tmp_path: Path) -> None:
    picture(tmp_path / "wood.png", np.full((4, 2, 3), (10, 20, 30)))
    picture(tmp_path / "grey.png", np.full((1, 8), 51))
    assert texels(oak(tmp_path, "map_Kd wood.png\nmap_d grey.png")).shape == (4, 8, 4)
    assert (texels(oak(tmp_path, "map_Kd wood.png\nmap_d grey.png")) == (10, 20, 30, 51)).all()


def test_white_map_d_is_opaque(tmp_path: Path) -> None:
    picture(tmp_path / "grey.png", [[255, 255]])
    assert oak(tmp_path, "Kd 1 0 0\nmap_d grey.png").alpha_mode == "OPAQUE"


# --- vertex colours beside materials ----------------------------------------------------------------------------------

COLORED = (
    "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0.2 0.2 0.2\nv 0 1 0 1 1 1\nvt 0 0\nf 1 2 3\nusemtl oak\nf 1/1 2/1 3/1\n"
)


def test_vertex_colors_multiply_materials_in_linear_light(tmp_path: Path) -> None:
    scene = read(tmp_path, "Kd 0.5 0.5 0.5", COLORED)
    assert scene.vertex_colors is not None and scene.face_materials is not None
    assert scene.face_materials.tolist() == [-1, 0] and scene.materials[0].rgb_of_scene
    own = scene.vertex_colors[scene.faces]
    np.testing.assert_allclose(own[0], [[1, 0, 0, 1], [0.2, 0.2, 0.2, 1], [1, 1, 1, 1]], atol=1e-7)
    np.testing.assert_allclose(own[1], [[1, 0, 0, 1], [*[light(0.2)] * 3, 1], [1, 1, 1, 1]], atol=1e-7)


def test_textures_replace_vertex_colors(tmp_path: Path) -> None:
    red(tmp_path / "wood.png")
    scene = read(tmp_path, "map_Kd wood.png", COLORED)
    assert scene.notes == ("vertex colours left out: 1 face(s) have a texture instead",)
    assert scene.vertex_colors is not None and not scene.materials[0].rgb_of_scene
    scene = read(tmp_path, "map_Kd wood.png", COLORED.replace("f 1 2 3\n", ""))
    assert scene.color is not None and scene.color.tolist() == [255, 255, 255, 255]


# --- files ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", ['"a b.mtl"', "a b.mtl", r".\a b.mtl", "m.mtl other.mtl", "m.mtl\nmtllib other.mtl"])
def test_material_files_of_every_spelling_are_read(tmp_path: Path, line: str) -> None:
    for name in ("a b.mtl", "other.mtl"):
        (tmp_path / name).write_text(MTL.replace("1 1 1", "1 0 0"))
    (tmp_path / "m.mtl").write_text("newmtl elm\n")
    (tmp_path / "t.obj").write_text(OBJ.replace("mtllib m.mtl", f"mtllib {line}"))
    scene = load(tmp_path / "t.obj")
    assert scene.notes == () and scene.materials[0].base_color == (1, 0, 0, 1)


@pytest.mark.parametrize(
    "name",
    [
        "wood.png",
        "Dark Wood.png",
        r".\wood.png",
        "./wood.png",
        r"textures\wood.png",
        '"wood.png"',
        r"C:\Users\me\wood.png",
        "WOOD.PNG",
        r"TEXTURES\Wood.png",
    ],
)
def test_textures_of_every_spelling_are_read(tmp_path: Path, name: str) -> None:
    for each in ("wood.png", "Dark Wood.png", "textures/wood.png"):
        red(tmp_path / each)
    assert (texels(oak(tmp_path, f"map_Kd {name}")) == (255, 0, 0, 255)).all()


def test_textures_are_looked_for_beside_their_material_file_first(tmp_path: Path) -> None:
    picture(tmp_path / "wood.png", [[[0, 0, 255]]])
    red(tmp_path / "look" / "wood.png")
    (tmp_path / "look" / "m.mtl").write_text(f"{MTL}map_Kd wood.png\n")
    (tmp_path / "t.obj").write_text(OBJ.replace("m.mtl", r"look\m.mtl"))
    assert (texels(load(tmp_path / "t.obj").materials[0]) == (255, 0, 0, 255)).all()
    (tmp_path / "look" / "wood.png").unlink()
    scene = load(tmp_path / "t.obj")
    assert (texels(scene.materials[0]) == (0, 0, 255, 255)).all() and scene.notes == ()


def test_a_missing_material_file_is_noted(tmp_path: Path) -> None:
    (tmp_path / "t.obj").write_text(OBJ)
    scene = load(tmp_path / "t.obj")
    assert scene.notes == ("material file 'm.mtl' left out: no such file",)
    assert scene.color is not None and tuple(scene.color) == DEFAULT_COLOR and not scene.materials


def test_one_of_several_material_files_may_be_missing(tmp_path: Path) -> None:
    scene = read(tmp_path, "Kd 1 0 0", OBJ.replace("m.mtl", "m.mtl no.mtl"))
    assert scene.notes == ("material file 'no.mtl' left out: no such file",) and len(scene.materials) == 1


def test_unknown_materials_are_noted(tmp_path: Path) -> None:
    scene = read(tmp_path, "Kd 1 0 0", OBJ.replace("usemtl oak", "usemtl elm"))
    assert scene.notes == ("materials left out: 'elm'; the material files lack them",)
    scene = read(tmp_path, "Kd 1 0 0", OBJ.replace("mtllib m.mtl\n", ""))
    assert scene.notes == ("materials left out: 'oak'; the file names no material file",)


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
        scene = read(tmp_path, f"Kd 0.5 1 0\nmap_Kd {name}")
        assert scene.notes == (f"texture '{name}' left out: {reason}",)
        np.testing.assert_allclose(scene.materials[0].base_color, [light(0.5), 1, 0, 1])
        assert scene.uv is None and scene.materials[0].texture is None


def test_a_texture_of_two_used_materials_is_noted_once(tmp_path: Path) -> None:
    obj = OBJ + "usemtl elm\nf 3 2 1\n"
    assert read(tmp_path, "map_Kd no.png\nnewmtl elm\nmap_Kd no.png\n", obj).notes == (
        "texture 'no.png' left out: no such file",
    )


def test_a_black_kd_beside_a_lost_texture_means_nothing(tmp_path: Path) -> None:
    scene = read(tmp_path, "Kd 0 0 0\nmap_Kd no.png")
    want = [*(light(value / 255) for value in DEFAULT_COLOR[:3]), 1]
    np.testing.assert_allclose(scene.materials[0].base_color, want, atol=1e-12)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "m.mtl")
    (tmp_path / "t.obj").write_text(OBJ)
    assert load(tmp_path / "t.obj").notes == ("material file 'm.mtl' left out: not a regular file",)


def test_textures_too_large_are_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    red(tmp_path / "wood.png")
    monkeypatch.setattr("clpeel.reading.images.MOST_TEXELS", 1)
    (note,) = read(tmp_path, "map_Kd wood.png").notes
    assert note.startswith("texture 'wood.png' left out: too large")


def test_other_maps_of_a_used_material_are_one_note(tmp_path: Path) -> None:
    (note,) = read(tmp_path, "bump b.png\nmap_Ks c.png\nnewmtl unused\nmap_Ke d.png").notes
    assert note == "textures left out, as only map_Kd and map_d are drawn: bump, map_ks"


def test_an_image_is_decoded_once_and_only_if_a_face_uses_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("wood.png", "other.png"):
        red(tmp_path / name)
    decode, calls = mtl.texels, list[bytes]()
    monkeypatch.setattr(mtl, "texels", lambda data: calls.append(data) or decode(data))
    text = "map_Kd wood.png\nnewmtl elm\nmap_Kd -clamp on wood.png\nnewmtl unused\nmap_Kd other.png"
    scene = read(tmp_path, text, OBJ + "usemtl elm\nf 3/3 2/2 1/1\n")
    assert len(calls) == 1 and len(scene.materials) == 2
