"""trimesh's objects: their colours, and their materials with real textures, become those of the Scene."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.materials import Material

trimesh = pytest.importorskip("trimesh")
image = pytest.importorskip("PIL.Image")
PBR, Simple = trimesh.visual.material.PBRMaterial, trimesh.visual.material.SimpleMaterial

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
PIXELS = np.array([[[255, 0, 0, 255], [0, 255, 0, 128]], [[0, 0, 255, 255], [255, 255, 255, 0]]], np.uint8)
UV = np.array([[0, 1], [1, 1], [0, 0], [1, 0.25]])


def light(value: float) -> float:
    """sRGB as linear light, by IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def mesh(material: Any, uv: Any = UV, **options: Any) -> Any:
    """A trimesh tetrahedron with a material."""
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material, **options)
    return trimesh.Trimesh(POINTS, FACES, process=False, visual=visual)


def only(source: Any) -> Material:
    """The one material of a source whose scene has no notes."""
    scene = load(source)
    assert scene.notes == ()
    (material,) = scene.materials
    return material


@pytest.mark.parametrize("mode", [None, "OPAQUE", "BLEND", "MASK"])
@pytest.mark.parametrize("cutoff", [None, 0.25])
def test_materials_for_gltf_keep_their_linear_color_and_alpha_mode(mode: Any, cutoff: Any) -> None:
    material = only(mesh(PBR(name="a", baseColorFactor=[200, 100, 50, 128], alphaMode=mode, alphaCutoff=cutoff)))
    np.testing.assert_allclose(material.base_color, np.array([200, 100, 50, 128]) / 255)
    assert material.alpha_mode == (mode or "OPAQUE") and material.alpha_cutoff == (cutoff or 0.5)
    assert material.name == "a" and material.texture is None


@pytest.mark.parametrize("sided", [None, False, True])
def test_trimesh_objects_are_seen_from_both_sides(sided: Any) -> None:
    """In trimesh, False is what every material says that says nothing."""
    assert load(mesh(PBR(baseColorFactor=[1, 2, 3], doubleSided=sided))).single_sided is None


@pytest.mark.parametrize("make", [lambda i: PBR(baseColorTexture=i, alphaMode="BLEND"), lambda i: Simple(image=i)])
def test_textures_are_kept_whole_and_v_points_down(make: Any) -> None:
    scene = load(mesh(make(image.fromarray(PIXELS))))
    (material,) = scene.materials
    assert material.texture is not None and material.alpha_mode == "BLEND" and scene.notes == ()
    np.testing.assert_array_equal(material.texture.image, PIXELS)
    assert scene.uv is not None
    np.testing.assert_allclose(scene.uv, [[0, 0], [1, 0], [0, 1], [1, 0.75]])


@pytest.mark.parametrize("kind", ["L", "P", "RGB", "1"])
def test_pictures_of_every_kind_are_textures(kind: str) -> None:
    texture = only(mesh(PBR(baseColorTexture=image.new("RGB", (3, 2), (255, 255, 255)).convert(kind)))).texture
    assert texture is not None and texture.size == (3, 2) and (texture.image == 255).all()


@pytest.mark.parametrize("mode", ["I;16", "I"])
def test_greys_of_16_bits_stay_so(mode: str) -> None:
    picture = image.fromarray(np.full((2, 3), 13107, np.uint16)).convert(mode)
    texture = only(mesh(PBR(baseColorTexture=picture))).texture
    assert texture is not None and texture.image.dtype == np.float32
    np.testing.assert_allclose(texture.image[0, 0], [*[light(0.2)] * 3, 1], atol=1e-6)


def test_a_picture_is_one_texture_however_often_it_is_used() -> None:
    picture = image.fromarray(PIXELS)
    one, other = PBR(baseColorTexture=picture), PBR(baseColorTexture=picture, baseColorFactor=[1, 2, 3, 255])
    scene = load(trimesh.Scene([mesh(one), mesh(one), mesh(other)]))
    assert len(scene.materials) == 2 and scene.materials[0].texture is scene.materials[1].texture
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0] * 8 + [1] * 4


def test_textures_that_cannot_be_had_are_noted() -> None:
    material = PBR(baseColorTexture=image.new("RGB", (4, 4), (255, 0, 0)), baseColorFactor=[1, 2, 3, 255])
    for uv in (None, np.zeros((2, 2))):
        scene = load(mesh(material, uv))
        assert scene.notes == ("texture left out: the mesh has no coordinates for it",) and scene.uv is None
        np.testing.assert_allclose(scene.materials[0].base_color, np.array([1, 2, 3, 255]) / 255)
    file = io.BytesIO()
    image.fromarray(np.random.default_rng(1).integers(0, 255, (50, 50, 3), np.uint8)).save(file, "png")
    cut = image.open(io.BytesIO(file.getvalue()[:4000]))
    (note,) = load(mesh(PBR(baseColorTexture=cut))).notes
    assert note.startswith("texture left out: OSError: image file is truncated")


def test_coordinates_without_a_picture_say_nothing() -> None:
    scene = load(mesh(None))
    assert scene.color is not None and tuple(scene.color) == DEFAULT_COLOR and not scene.materials and scene.uv is None


def test_coordinates_that_are_no_numbers_are_zero() -> None:
    scene = load(mesh(Simple(image=image.fromarray(PIXELS)), np.full((4, 2), np.nan)))
    assert scene.uv is not None and (scene.uv == 0).all()


def test_linear_vertex_colors_multiply_the_material() -> None:
    source = mesh(PBR(baseColorFactor=[255, 51, 255, 255], alphaMode="BLEND"))
    source.visual.vertex_attributes["color"] = np.full((4, 4), [65535, 65535, 0, 32768], np.uint16)
    scene = load(source)
    np.testing.assert_allclose(scene.vertex_colors, np.tile([1, 1, 0, 0.5], (4, 1)), atol=1e-4)
    np.testing.assert_allclose(scene.materials[0].base_color, [1, 0.2, 1, 1])
    source.visual.vertex_attributes["color"] = np.zeros((3, 4), np.uint8)
    assert load(source).notes == ("vertex colours left out: they do not fit the mesh",)


def test_each_face_may_have_a_material() -> None:
    red, blue = PBR(baseColorFactor=[255, 0, 0, 255]), PBR(baseColorFactor=[0, 0, 255, 64], alphaMode="BLEND")
    several = trimesh.visual.material.MultiMaterial([red, blue])
    scene = load(mesh(several, None, face_materials=[0, 1, 1, 0]))
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, 1, 1, 0]
    assert [material.base_color[2] for material in scene.materials] == [0, 1]
    assert scene.kinds.opaque.tolist() == [True, False, False, True]


@pytest.mark.parametrize(
    ("material", "rgb", "alpha"),
    [
        (Simple(diffuse=[51, 102, 153, 255]), (0.2, 0.4, 0.6), 1),
        (Simple(diffuse=[51, 102, 153, 51]), (0.2, 0.4, 0.6), 0.2),
        (Simple(diffuse=[51, 102, 153, 255], d=["0.25"]), (0.2, 0.4, 0.6), 0.25),
        (Simple(diffuse=[51, 102, 153, 255], tr=["1.000000"]), (0.2, 0.4, 0.6), 1),
    ],
)
def test_simple_materials_are_display_referred_as_in_mtl_files(material: Any, rgb: Any, alpha: float) -> None:
    np.testing.assert_allclose(only(mesh(material)).base_color, [*map(light, rgb), alpha], atol=1e-6)


def test_obj_files_that_trimesh_has_read_look_as_the_files_do(tmp_path: Path) -> None:
    image.fromarray(PIXELS).save(tmp_path / "a.png")
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 1 0.2\nTr 0.75\nmap_Kd a.png\n")
    (tmp_path / "t.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.25\nusemtl a\nf 1/1 2/2 3/3\n"
    )
    file, source = load(tmp_path / "t.obj"), load(trimesh.load_scene(tmp_path / "t.obj", process=False))
    (want,), (got,) = file.materials, source.materials
    np.testing.assert_allclose(got.base_color, want.base_color, atol=1e-6)
    assert got.alpha_mode == want.alpha_mode == "BLEND" and got.texture is not None and want.texture is not None
    np.testing.assert_array_equal(got.texture.image, want.texture.image)
    np.testing.assert_array_equal(source.uv, file.uv)


def test_colors_of_collada_are_display_referred_and_their_alpha_counts(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    source = mesh(PBR(baseColorFactor=[51, 102, 153, 255]))
    path = tmp_path / "t.dae"
    path.write_bytes(source.export(file_type="dae"))
    (material,) = load(path).materials
    np.testing.assert_allclose(material.base_color, [light(0.2), light(0.4), light(0.6), 1], atol=1e-6)
    path.write_text(re.sub(r"(<transparent>\s*<color>)[^<]*", r"\g<1>0 0 0 0.25", path.read_text()))
    (material,) = load(path).materials
    assert material.base_color[3] == pytest.approx(0.25, abs=1 / 255) and material.alpha_mode == "BLEND"
