"""Materials of glTF: colours, textures, samplers and coordinates by the specification; what is not drawn is noted."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.documents import POINTS, UV, Document, plain, png, refusal, textured

import clpeel.reading.gltf_textures
from clpeel.reading.images import texels
from clpeel.scene.scene import Scene

PURPLE = np.array([[128, 0, 255, 255], [128, 0, 255, 255], [128, 0, 255, 255]], np.uint8)
FIVE = [0.8, 0.5, 0.2, 0.25]


def only(scene: Scene) -> Any:
    """The one material of a scene that all of its faces have."""
    (material,) = scene.materials
    assert scene.face_materials is not None and (scene.face_materials == 0).all()
    return material


def finish(scene: Scene) -> tuple[float, float, tuple[float, ...]]:
    """Metallic, roughness and emissive of a scene's one material, which is plain: the scene's colours are shown."""
    material = only(scene)
    assert material.plain and material.finish is not None and material.finish.uv_sets == 0
    return material.finish.metallic, material.finish.roughness, material.finish.emissive


def based(*factor: float, **more: Any) -> dict[str, Any]:
    """A material of this base colour."""
    return {"pbrMetallicRoughness": {"baseColorFactor": list(factor)}, **more}


# --- plain colours ----------------------------------------------------------------------------------------------------


def srgb(value: float) -> float:
    """The formula of IEC 61966-2-1."""
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055


@pytest.mark.parametrize(("mode", "alpha"), [("OPAQUE", 1), ("BLEND", 0.25)])
def test_plain_colors_are_shown_as_srgb(tmp_path: Path, mode: str, alpha: float) -> None:
    scene = plain(based(0.8, 0.002, 0.2, 0.25, alphaMode=mode)).load(tmp_path)
    assert scene.color is not None and scene.color.dtype == np.float32
    assert finish(scene) == (1, 1, (0, 0, 0)) and scene.surfaces == ("opaque" if alpha == 1 else "transparent")
    np.testing.assert_allclose(scene.color, [srgb(0.8), 0.02584, srgb(0.2), alpha], atol=1e-7)
    assert math.floor(scene.color[0] * 255 + 0.5) == 231


def test_colors_that_are_whole_bytes_are_stored_as_bytes(tmp_path: Path) -> None:
    levels = np.array([200, 7, 51]) / 255
    factor = np.float32(np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4))
    scene = plain(based(*map(float, factor), 102 / 255, alphaMode="BLEND")).load(tmp_path)
    assert scene.color is not None and scene.color.dtype == np.uint8 and scene.color.tolist() == [200, 7, 51, 102]


@pytest.mark.parametrize("material", [None, {}])
def test_the_default_material_is_white_and_single_sided(tmp_path: Path, material: Any) -> None:
    scene = plain(material).load(tmp_path)
    assert scene.color is not None and scene.color.tolist() == [255, 255, 255, 255]
    assert finish(scene) == (1, 1, (0, 0, 0)), "glTF 2.0, section 3.9.6: all properties have their default values"
    assert scene.single_sided is not None and scene.single_sided.tolist() == [True]


def test_plain_materials_have_what_lights_need(tmp_path: Path) -> None:
    material = based(0, 0, 0, 1, emissiveFactor=[1, 0, 0.5])
    material["pbrMetallicRoughness"] |= {"metallicFactor": 0.25, "roughnessFactor": 0.75}
    scene = plain(material).load(tmp_path)
    assert scene.notes == () and finish(scene) == (0.25, 0.75, (1, 0, 0.5))
    material["pbrMetallicRoughness"] |= {"metallicFactor": 7, "roughnessFactor": -1}
    assert finish(plain(material).load(tmp_path))[:2] == (1, 0)


def test_plain_materials_of_the_same_numbers_are_one(tmp_path: Path) -> None:
    """Models of parts have thousands of colours, and few finishes."""
    document = plain(based(1, 0, 0, 1, name="red"))
    dull = based(1, 0, 0, 1)
    dull["pbrMetallicRoughness"]["roughnessFactor"] = 0.5
    document.more["materials"] += [based(0, 0, 1, 1, name="blue"), dull]
    primitives = [{**document.primitive, "material": number} for number in (0, 1, 2, 0)]
    document.more["meshes"] = [{"primitives": [*primitives, {"attributes": document.primitive["attributes"]}]}]
    scene = document.load(tmp_path)
    assert [(m.plain, m.finish and m.finish.roughness) for m in scene.materials] == [(True, 1), (True, 0.5)]
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, 0, 1, 0, 0]
    red, blue, white = [255, 0, 0, 255], [0, 0, 255, 255], [255] * 4
    assert scene.face_colors is not None and scene.face_colors.tolist() == [red, blue, red, red, white]
    again = pickle.loads(pickle.dumps(scene))
    assert [vars(m.finish) for m in again.materials] == [vars(m.finish) for m in scene.materials]
    np.testing.assert_array_equal(again.face_materials, scene.face_materials)


def test_double_sided_faces_are_seen_from_both_sides(tmp_path: Path) -> None:
    assert plain({"doubleSided": True}).load(tmp_path).single_sided is None


@pytest.mark.parametrize("cutoff", [None, 0.25, 0.75])
def test_masks_of_one_alpha_are_decided_at_once(tmp_path: Path, cutoff: float | None) -> None:
    more = {} if cutoff is None else {"alphaCutoff": cutoff}
    document = plain(based(1, 1, 1, 0.5, alphaMode="MASK", name="net", **more))
    if cutoff == 0.75:
        assert "expected triangles, got faces that are cut away" in refusal(document, tmp_path)
        tree_of = document.primitive
        document.more["meshes"] = [{"primitives": [tree_of, {"attributes": tree_of["attributes"]}]}]
        scene = document.load(tmp_path)
        assert scene.notes == ("faces left out, as their materials cut all of them away: 'net'",)
        assert len(scene.faces) == 1
    else:
        scene = document.load(tmp_path)
        assert scene.color is not None and scene.color.tolist() == [255, 255, 255, 255]
        assert only(scene).plain and scene.opaque


def test_specular_glossiness_has_a_base_color_too(tmp_path: Path) -> None:
    gloss = {"diffuseFactor": [1, 0, 0, 0.2], "glossinessFactor": 0.75}
    material = based(0, 1, 0, 1, alphaMode="BLEND", extensions={"KHR_materials_pbrSpecularGlossiness": gloss})
    scene = plain(material).load(tmp_path)
    assert scene.color is not None and scene.color.tolist() == [255, 0, 0, 51]
    assert finish(scene) == (0, 0.25, (0, 0, 0)), "a dielectric, whose roughness is 1 - glossiness"


# --- materials --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["OPAQUE", "MASK", "BLEND"])
def test_a_material_has_what_the_file_says(tmp_path: Path, mode: str) -> None:
    document = textured(png(), alphaMode=mode, alphaCutoff=0.3, name="wood", emissiveFactor=[0.1, 0.2, 0.3])
    color = document.more["materials"][0]["pbrMetallicRoughness"]
    color |= {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.6, "roughnessFactor": 0.7}
    scene = document.load(tmp_path)
    material = only(scene)
    assert material.base_color == (0.1, 0.2, 0.3, 0.4) and material.name == "wood"
    assert (material.alpha_mode, material.alpha_cutoff, material.opacity, material.unlit) == (mode, 0.3, 1, False)
    assert (material.finish.metallic, material.finish.roughness) == (0.6, 0.7)
    assert material.finish.emissive == (0.1, 0.2, 0.3) and not material.plain
    assert scene.color is not None and scene.color.tolist() == [255, 255, 255, 255]
    np.testing.assert_array_equal(material.texture.image, np.full((2, 2, 4), (255, 0, 0, 255)))
    np.testing.assert_array_equal(scene.uv, UV)


@pytest.mark.parametrize(
    ("stored", "want"),
    [
        (PURPLE, PURPLE),
        (PURPLE[:, :3], PURPLE),
        (PURPLE * np.uint16(257), PURPLE / 255),
        (np.tile(np.float32([0.5, 2, -1]), (3, 1)), np.tile([0.5, 1, 0, 1], (3, 1))),
    ],
)
def test_vertex_colors_are_linear_and_make_a_material(tmp_path: Path, stored: np.ndarray, want: np.ndarray) -> None:
    scene = plain(based(*FIVE), COLOR_0=stored).load(tmp_path)
    assert only(scene).base_color == tuple(FIVE) and only(scene).texture is None
    assert scene.vertex_colors is not None
    assert scene.vertex_colors.dtype == (np.uint8 if stored.dtype == np.uint8 else np.float32)
    np.testing.assert_allclose(scene.vertex_colors, want, atol=1e-7)


def test_unlit_faces_keep_their_material(tmp_path: Path) -> None:
    scene = plain(based(1, 1, 1, 1, extensions={"KHR_materials_unlit": {}})).load(tmp_path)
    assert only(scene).unlit


def test_a_material_of_several_primitives_is_one_object(tmp_path: Path) -> None:
    document = textured(png())
    other = {**document.primitive, "material": 1}
    document.more["materials"].append({"name": "other"})
    document.more["meshes"] = [{"primitives": [document.primitive, other, document.primitive]}]
    scene = document.load(tmp_path)
    assert [material.plain for material in scene.materials] == [False, True]
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, 1, 0]


# Transmission t leaves 1 - t of the alpha, and 0.1 or more of it.
@pytest.mark.parametrize(
    ("mode", "transmitted", "alpha"),
    [
        ("OPAQUE", 0.75, 0.25),
        ("OPAQUE", 1, 0.1),
        ("BLEND", 0.75, 0.125),
        ("BLEND", 1, 0.1),
        ("MASK", 0.75, 0.25),
        ("OPAQUE", 0, 1),
    ],
)
def test_glass_is_transparent_and_noted(tmp_path: Path, mode: str, transmitted: float, alpha: float) -> None:
    glass = {"KHR_materials_transmission": {"transmissionFactor": transmitted}}
    scene = plain(based(1, 1, 1, 0.5, alphaMode=mode, name="pane", extensions=glass)).load(tmp_path)
    assert scene.color is not None
    np.testing.assert_allclose(
        scene.color * (1 if scene.color.dtype == np.float32 else 1 / 255), [1, 1, 1, alpha], atol=1e-7
    )
    note = "glass drawn as transparency (KHR_materials_transmission): 'pane'"
    assert scene.notes == ((note,) if transmitted else ())


def test_glass_with_a_texture_is_as_transparent_everywhere(tmp_path: Path) -> None:
    glass = {"KHR_materials_transmission": {"transmissionFactor": 0.75}}
    scene = textured(png(np.full((1, 1, 4), 99)), extensions=glass).load(tmp_path)
    # Of an opaque material the alpha of its texture counts for nothing.
    assert (only(scene).alpha_mode, only(scene).opacity) == ("OPAQUE", 0.25) and scene.surfaces == "transparent"


@pytest.mark.parametrize(
    ("material", "says"),
    [
        ({"alphaMode": "CLEAR"}, "alphaMode: expected OPAQUE, MASK, BLEND, got 'CLEAR'"),
        ({"alphaMode": []}, "alphaMode: expected OPAQUE, MASK, BLEND, got '[]'"),
        ({"alphaCutoff": "x"}, "alphaCutoff: expected a finite number, got 'x'"),
        (based(1, 1, 1), "baseColorFactor: expected 4 numbers, got '[1, 1, 1]'"),
        ({"pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}}, "textures: there are none"),
        ({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": -1}}}, "texCoord: expected a whole"),
        ({"extensions": {"KHR_materials_transmission": 3}}, "KHR_materials_transmission: expected an object, got '3'"),
    ],
)
def test_materials_that_break_the_format_are_named(tmp_path: Path, material: Any, says: str) -> None:
    assert says in refusal(plain(material, TEXCOORD_0=UV), tmp_path)
    assert "materials: expected an index 0..0, got '5'" in refusal(materialless(), tmp_path)


def materialless() -> Document:
    """A triangle with a material that the file lacks."""
    document = plain({})
    document.primitive["material"] = 5
    return document


# --- coordinates ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("override", [True, False])
def test_a_texture_has_the_coordinates_it_names(tmp_path: Path, override: bool) -> None:
    info = (
        {"texCoord": 2} if not override else {"texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 2}}}
    )
    document = textured(png(), info)
    document.primitive["attributes"]["TEXCOORD_2"] = document.add(UV * 3)
    np.testing.assert_array_equal(document.load(tmp_path).uv, UV * 3)


def test_coordinates_are_scaled_turned_and_shifted(tmp_path: Path) -> None:
    # Counterclockwise as the image is seen, and v points down: a quarter turn takes (u, v) to (v, -u).
    quarter = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2, 3]}
    scene = textured(png(), {"extensions": {"KHR_texture_transform": quarter}}).load(tmp_path)
    want = np.stack([3 * UV[:, 1] + 0.25, -2 * UV[:, 0] + 0.5], axis=1)
    np.testing.assert_allclose(scene.uv, want, atol=1e-7)
    third = {"rotation": math.pi / 6}
    scene = textured(png(), {"extensions": {"KHR_texture_transform": third}}).load(tmp_path)
    matrix = np.array([[3**0.5 / 2, 0.5], [-0.5, 3**0.5 / 2]])
    np.testing.assert_allclose(scene.uv, UV @ matrix.T, atol=1e-7)


def test_a_texture_without_coordinates_is_noted(tmp_path: Path) -> None:
    scene = textured(png(), {"texCoord": 1}, name="oak").load(tmp_path)
    assert scene.notes == ("textures left out, as meshes lack the coordinates for those of materials: 'oak'",)
    assert only(scene).plain and scene.uv is None


# --- samplers and images ----------------------------------------------------------------------------------------------


def test_samplers_by_default(tmp_path: Path) -> None:
    texture = only(textured(png()).load(tmp_path)).texture
    assert (texture.wrap, texture.magnify, texture.minify) == (("repeat", "repeat"), "linear", "linear-mipmap-linear")


@pytest.mark.parametrize(
    ("number", "word"),
    [
        (9728, "nearest"),
        (9729, "linear"),
        (9984, "nearest-mipmap-nearest"),
        (9985, "linear-mipmap-nearest"),
        (9986, "nearest-mipmap-linear"),
        (9987, "linear-mipmap-linear"),
    ],
)
def test_samplers_by_their_numbers(tmp_path: Path, number: int, word: str) -> None:
    document = textured(png())
    document.more["textures"][0]["sampler"] = 0
    document.more["samplers"] = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": number}]
    texture = only(document.load(tmp_path)).texture
    assert (texture.wrap, texture.magnify, texture.minify) == (("clamp", "mirror"), "nearest", word)


def test_samplers_that_are_not_known_are_noted(tmp_path: Path) -> None:
    document = textured(png())
    document.more["textures"][0]["sampler"] = 0
    document.more["samplers"] = [{"wrapS": 7, "magFilter": []}]
    scene = document.load(tmp_path)
    assert only(scene).texture.wrap == ("repeat", "repeat")
    assert scene.notes == (
        "wrapS '7' of sampler 0 left out: it is not known",
        "magFilter '[]' of sampler 0 left out: it is not known",
    )


def test_images_are_decoded_once_and_only_if_they_are_drawn(tmp_path: Path, monkeypatch: Any) -> None:
    decoded = []

    def noting(data: bytes, colors: bool) -> Any:
        decoded.append(data)
        return texels(data, colors)

    monkeypatch.setattr(clpeel.reading.gltf_textures, "texels", noting)
    document = textured(png(), name="a", normalTexture={"index": 2}, emissiveTexture={"index": 2})
    other = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}, "metallicRoughnessTexture": {"index": 2}}}
    unused = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 2}}, "occlusionTexture": {"index": 2}}
    document.more["materials"] += [other, unused]
    document.more["textures"] += [{"source": 0, "sampler": 0}, {"source": 1}]
    document.more["samplers"] = [{"magFilter": 9728}]
    document.more["images"].append({"bufferView": document.view(png(np.zeros((1, 1, 3)))), "mimeType": "image/png"})
    document.more["meshes"] = [{"primitives": [document.primitive, {**document.primitive, "material": 1}]}]
    scene = document.load(tmp_path)
    assert decoded == [png()]
    first, second = (material.texture for material in scene.materials)
    assert first is not None and second is not None and first.image is second.image
    assert (first.magnify, second.magnify) == ("linear", "nearest")
    assert not [note for note in scene.notes if not note.startswith("duplicate faces")]


@pytest.mark.parametrize("name", ["EXT_texture_webp", "KHR_texture_basisu"])
@pytest.mark.parametrize("good", ["both", "own", "plain"])
def test_the_image_of_an_extension_comes_first(tmp_path: Path, name: str, good: str) -> None:
    own, other = png(np.full((1, 1, 3), 7)), png(np.full((1, 1, 3), 8))
    document = textured(b"none" if good == "own" else other)
    document.more["images"].append({"bufferView": document.view(b"none" if good == "plain" else own)})
    document.more["textures"] = [{"source": 0, "extensions": {name: {"source": 1}}}]
    scene = document.load(tmp_path)
    assert only(scene).texture.image[0, 0, 0] == (8 if good == "plain" else 7) and scene.notes == ()
    del document.more["textures"][0]["source"]
    assert document.load(tmp_path).notes == (
        ("texture 'image 1' left out: expected an image, got text that begins with 'none'",) if good == "plain" else ()
    )


def test_bad_images_are_noted_by_name(tmp_path: Path) -> None:
    scene = textured(b"no image").load(tmp_path)
    assert scene.notes == ("texture 'wood' left out: expected an image, got text that begins with 'no image'",)
    assert scene.color is not None and scene.color.tolist() == [255] * 4 and finish(scene) == (1, 1, (0, 0, 0))
    (note,) = textured(png(np.zeros((1, 16385, 3)))).load(tmp_path).notes
    assert note == "texture 'wood' left out: too large, 16,385 x 1 texels; at most 16,384 x 16,384 are read"


@pytest.mark.parametrize("uri", ["none.png", "../none.png", "data:image/png,", "data:image/png;base64,@"])
def test_missing_images_are_noted_by_name(tmp_path: Path, uri: str) -> None:
    document = textured(png())
    document.more["images"] = [{"uri": uri}]
    (note,) = document.load(tmp_path).notes
    assert note.startswith(f"texture '{'image 0' if uri.startswith('data:') else uri}' left out: ")


def test_a_texture_without_an_image_is_noted(tmp_path: Path) -> None:
    document = textured(png())
    document.more["textures"] = [{}]
    assert document.load(tmp_path).notes == ("texture 0 left out: it has no image of a kind that is read",)


def test_images_beside_the_file_may_have_escaped_names(tmp_path: Path) -> None:
    document = textured(png())
    document.more["images"] = [{"uri": "red%20one.png"}]
    (tmp_path / "red one.png").write_bytes(png())
    assert only(document.load(tmp_path)).texture.image[0, 0].tolist() == [255, 0, 0, 255]


def test_textures_that_are_not_drawn_are_one_note(tmp_path: Path) -> None:
    texture = {"index": 0}
    drawn = {"emissiveTexture": texture, "normalTexture": texture, "occlusionTexture": texture}
    assert textured(png(), **drawn).load(tmp_path).notes == ()
    others = {
        "KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": texture, "specularGlossinessTexture": texture},
        "KHR_materials_transmission": {"transmissionTexture": texture},
    }
    document = textured(png(), **drawn, extensions=others)
    assert document.load(tmp_path).notes == ("textures left out: specular-glossiness, transmission",)


def test_coordinates_stay_beside_faces_without_a_texture(tmp_path: Path) -> None:
    document = textured(png())
    document.more["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}, document.primitive]}]
    scene = document.load(tmp_path)
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, 1]
    assert [material.plain for material in scene.materials] == [True, False]
    np.testing.assert_array_equal(scene.uv, [*np.zeros((3, 2)), *UV])
    np.testing.assert_array_equal(scene.vertices, [*POINTS[:3], *POINTS[:3]])


def test_copies_of_a_mesh_have_its_colors_and_coordinates(tmp_path: Path) -> None:
    document = textured(png())
    document.primitive["attributes"]["COLOR_0"] = document.add(PURPLE, normalized=True)
    document.more |= {"nodes": [{"mesh": 0}, {"mesh": 0, "scale": [2, 2, 2]}], "scenes": [{"nodes": [0, 1]}]}
    scene = document.load(tmp_path)
    assert len(scene.materials) == 1 and scene.face_materials is not None and scene.face_materials.tolist() == [0, 0]
    np.testing.assert_array_equal(scene.uv, [*UV, *UV])
    np.testing.assert_array_equal(scene.vertex_colors, [*PURPLE, *PURPLE])
    np.testing.assert_array_equal(scene.vertices, [*POINTS[:3], *(2 * POINTS[:3])])
