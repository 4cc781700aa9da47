"""Materials of glTF for lights: factors, and textures that are kept without decoding them (glTF 2.0, section 3.9)."""

from __future__ import annotations

import io
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from reading.documents import UV, Document, plain, png, refusal, textured

import clpeel.reading.gltf_textures
from clpeel.errors import InputError
from clpeel.reading.images import texels
from clpeel.scene.materials import Finish
from clpeel.scene.scene import Scene

BLUE, GREEN = (np.full((1, 1, 3), rgb) for rgb in ((0, 0, 200), (0, 100, 0)))
KEYS = {
    "metallicRoughnessTexture": "metallic_roughness",
    "normalTexture": "normal",
    "occlusionTexture": "occlusion",
    "emissiveTexture": "emissive",
}


def deep(levels: list[int]) -> bytes:
    """A grey PNG image of one row with 16 bits a channel."""
    stream = io.BytesIO()
    Image.fromarray(np.array([levels], np.uint16)).save(stream, "PNG")
    return stream.getvalue()


def with_image(document: Document, picture: bytes, **more: Any) -> Document:
    """The document with a further image and texture, which is the last one."""
    images, textures = document.more.setdefault("images", []), document.more.setdefault("textures", [])
    images.append({"bufferView": document.view(picture), "name": "bumps"})
    textures.append({"source": len(images) - 1, **more})
    return document


def lit(picture: bytes, key: str = "normalTexture", **info: Any) -> Document:
    """A triangle with a red base colour texture 0, and another texture 1 for lights."""
    named = {key: {"index": 1, **info}}
    document = textured(png(), **({} if key == "metallicRoughnessTexture" else named))
    if key == "metallicRoughnessTexture":
        document.more["materials"][0]["pbrMetallicRoughness"] |= named
    return with_image(document, picture)


def finish(scene: Scene) -> Finish:
    """The finish of a scene's one material."""
    (material,) = scene.materials
    assert material.finish is not None
    return material.finish


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """The pictures that were decoded."""
    found = []

    def noting(data: bytes, colors: bool = True) -> Any:
        found.append(data)
        return texels(data, colors)

    monkeypatch.setattr(clpeel.reading.gltf_textures, "texels", noting)
    return found


# --- factors ----------------------------------------------------------------------------------------------------------


def test_factors_of_textures(tmp_path: Path) -> None:
    assert finish(lit(png(BLUE), scale=-0.5).load(tmp_path)).normal_scale == -0.5
    assert finish(lit(png(BLUE)).load(tmp_path)).normal_scale == 1
    for strength, want in ((0.25, 0.25), (7, 1)):
        assert finish(lit(png(BLUE), "occlusionTexture", strength=strength).load(tmp_path)).occlusion_strength == want
    assert finish(lit(png(BLUE), "occlusionTexture").load(tmp_path)).occlusion_strength == 1


@pytest.mark.parametrize(("strength", "want"), [({"emissiveStrength": 8}, 8), ({}, 1), ({"emissiveStrength": -1}, 0)])
def test_emissive_factors_are_multiplied_by_their_strength(tmp_path: Path, strength: Any, want: float) -> None:
    name = "KHR_materials_emissive_strength"
    document = textured(png(), emissiveFactor=[0.5, 0, 0.25], extensions={name: strength})
    document.more["extensionsUsed"] = [name]
    scene = document.load(tmp_path)
    assert finish(scene).emissive == (0.5 * want, 0, 0.25 * want)
    assert scene.notes == ()


# --- textures ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", KEYS)
def test_textures_are_kept_and_decoded_when_they_are_asked_for(tmp_path: Path, decoded: list[bytes], key: str) -> None:
    scene = lit(png(BLUE), key).load(tmp_path)
    assert decoded == [png()] and scene.notes == ()
    held = vars(finish(scene))
    texture = held[f"{KEYS[key]}_texture"]
    assert decoded == [png()] and held[f"{KEYS[key]}_uv"] == 0 and scene.more_uv == ()
    np.testing.assert_array_equal(texture.image, [[[0, 0, 200, 255]]])
    assert texture.image is texture.image and decoded == [png(), png(BLUE)]
    assert [name for name, value in held.items() if name.endswith("_texture") and value is not None] == [
        f"{KEYS[key]}_texture"
    ]


def test_textures_have_samplers(tmp_path: Path) -> None:
    document = lit(png(BLUE))
    document.more["textures"][1]["sampler"] = 0
    document.more["samplers"] = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9729}]
    texture = finish(document.load(tmp_path)).normal_texture
    assert texture is not None
    assert (texture.wrap, texture.magnify, texture.minify) == (("clamp", "mirror"), "nearest", "linear")


def test_numbers_of_16_bits_stay_as_they_are_and_colours_are_made_linear(tmp_path: Path) -> None:
    want = np.array([0, 13107, 65535]) / 65535
    normal = finish(lit(deep([0, 13107, 65535])).load(tmp_path)).normal_texture
    assert normal is not None and normal.image.dtype == np.float32
    np.testing.assert_allclose(normal.image, [[[v, v, v, 1] for v in want]], atol=1e-7)
    emissive = finish(lit(deep([0, 13107, 65535]), "emissiveTexture").load(tmp_path)).emissive_texture
    assert emissive is not None
    linear = ((0.2 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1
    np.testing.assert_allclose(emissive.image[0, :, 0], [0, linear, 1], atol=1e-7)


def test_textures_of_one_image_share_its_texels(tmp_path: Path, decoded: list[bytes]) -> None:
    document = lit(png(BLUE), occlusionTexture={"index": 1})
    material = document.more["materials"][0]
    material |= {"occlusionTexture": {"index": 2}, "emissiveTexture": {"index": 0}}
    document.more["textures"].append({"source": 1, "sampler": 0})
    document.more["samplers"] = [{"magFilter": 9728}]
    scene = document.load(tmp_path)
    found = finish(scene)
    assert found.normal_texture and found.occlusion_texture and found.emissive_texture
    assert found.normal_texture.image is found.occlusion_texture.image
    assert (found.normal_texture.magnify, found.occlusion_texture.magnify) == ("linear", "nearest")
    assert found.emissive_texture is scene.materials[0].texture and len(decoded) == 2


def test_a_deep_image_is_another_one_as_numbers(tmp_path: Path) -> None:
    scene = textured(deep([13107]), normalTexture={"index": 0}).load(tmp_path)
    texture = finish(scene).normal_texture
    assert texture is not None and texture.image[0, 0, 0] == np.float32(0.2)
    assert scene.materials[0].texture is not None and scene.materials[0].texture.image[0, 0, 0] < 0.05


def test_images_beside_the_file_may_vanish_later(tmp_path: Path) -> None:
    document = lit(png(BLUE))
    document.more["images"][1] = {"uri": "bumps.png"}
    (tmp_path / "bumps.png").write_bytes(png(BLUE))
    scene = document.load(tmp_path)
    (tmp_path / "bumps.png").unlink()
    again = pickle.loads(pickle.dumps(scene))
    for each in (scene, again):
        texture = finish(each).normal_texture
        assert texture is not None and texture.image.tolist() == [[[0, 0, 200, 255]]]


def test_specular_glossiness_has_no_metallic_roughness_texture(tmp_path: Path) -> None:
    document = lit(png(BLUE), "metallicRoughnessTexture")
    gloss = {"diffuseTexture": {"index": 0}, "glossinessFactor": 0.25}
    document.more["materials"][0]["extensions"] = {"KHR_materials_pbrSpecularGlossiness": gloss}
    found = finish(document.load(tmp_path))
    assert found.metallic_roughness_texture is None and (found.metallic, found.roughness) == (0, 0.75)


def test_unlit_materials_keep_no_textures_for_lights(tmp_path: Path) -> None:
    document = lit(png(BLUE))
    document.more["materials"][0]["extensions"] = {"KHR_materials_unlit": {}}
    assert finish(document.load(tmp_path)).normal_texture is None


# --- coordinates ------------------------------------------------------------------------------------------------------


def test_a_material_without_a_base_colour_texture_has_coordinates(tmp_path: Path, decoded: list[bytes]) -> None:
    color = {"baseColorFactor": [0.5, 0.25, 1, 0.5]}
    document = plain({"pbrMetallicRoughness": color, "alphaMode": "BLEND", "normalTexture": {"index": 0}})
    document.primitive["attributes"]["TEXCOORD_0"] = document.add(UV)
    scene = with_image(document, png(BLUE)).load(tmp_path)
    assert finish(scene).normal_texture is not None and finish(scene).normal_uv == 0 and not decoded
    assert scene.materials[0].base_color == (0.5, 0.25, 1, 0.5) and scene.materials[0].texture is None
    np.testing.assert_array_equal(scene.uv, UV)
    assert scene.more_uv == () and scene.color is not None and scene.color.tolist() == [255] * 4


def test_other_coordinates_are_kept_once_each(tmp_path: Path) -> None:
    shifted = {"extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}}
    document = lit(png(BLUE), texCoord=1)
    document.primitive["attributes"]["TEXCOORD_1"] = document.add(UV * 3)
    document.more["materials"][0] |= {
        "occlusionTexture": {"index": 1, "texCoord": 1},
        "emissiveTexture": {"index": 1, **shifted},
    }
    document.more["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {"index": 1}
    scene = document.load(tmp_path)
    found = finish(scene)
    assert (found.metallic_roughness_uv, found.normal_uv, found.occlusion_uv, found.emissive_uv) == (0, 1, 1, 2)
    np.testing.assert_array_equal(scene.uv, UV)
    assert len(scene.more_uv) == 2
    np.testing.assert_array_equal(scene.more_uv[0], UV * 3)
    np.testing.assert_array_equal(scene.more_uv[1], UV + [0.5, 0])


def test_copies_of_a_mesh_have_all_coordinates(tmp_path: Path) -> None:
    document = lit(png(BLUE), texCoord=1)
    document.primitive["attributes"]["TEXCOORD_1"] = document.add(UV * 3)
    document.more |= {"nodes": [{"mesh": 0}, {"mesh": 0, "scale": [2, 2, 2]}], "scenes": [{"nodes": [0, 1]}]}
    scene = document.load(tmp_path)
    np.testing.assert_array_equal(scene.uv, [*UV, *UV])
    np.testing.assert_array_equal(scene.more_uv[0], [*(UV * 3), *(UV * 3)])


def test_primitives_that_lack_coordinates_have_a_material_of_their_own(tmp_path: Path) -> None:
    document = lit(png(BLUE), texCoord=1)
    lacking = {**document.primitive, "attributes": dict(document.primitive["attributes"])}
    document.primitive["attributes"]["TEXCOORD_1"] = document.add(UV * 3)
    document.more["meshes"] = [{"primitives": [lacking, document.primitive]}]
    document.more["materials"][0]["name"] = "oak"
    scene = document.load(tmp_path)
    first, second = (material.finish for material in scene.materials)
    assert first and first.normal_texture is None and second and second.normal_texture is not None
    assert "textures left out, as meshes lack the coordinates for those of materials: 'oak'" in scene.notes
    np.testing.assert_array_equal(scene.more_uv[0], [*np.zeros((3, 2)), *(UV * 3)])


# --- what is missing --------------------------------------------------------------------------------------------------


def test_missing_images_are_noted_by_name(tmp_path: Path) -> None:
    document = lit(b"no image")
    scene = document.load(tmp_path)
    says = "texture 'bumps' left out: expected an image, got text that begins with 'no image'"
    assert scene.notes == (says,) and finish(scene).normal_texture is None
    document.more["images"][1] = {"uri": "none.png"}
    scene = document.load(tmp_path)
    assert scene.notes == ("texture 'none.png' left out: no such file",)
    document.more["textures"][1] = {}
    assert document.load(tmp_path).notes[0] == "texture 1 left out: it has no image of a kind that is read"


def test_large_images_are_noted_by_name(tmp_path: Path, decoded: list[bytes]) -> None:
    scene = lit(png(np.zeros((1, 16385, 3)))).load(tmp_path)
    assert scene.notes[0] == "texture 'bumps' left out: too large, 16,385 x 1 texels; at most 16,384 x 16,384 are read"
    assert decoded == [png()]


@pytest.mark.parametrize("installed", [True, False])
def test_images_without_a_decoder_are_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, decoded: list[bytes], installed: bool
) -> None:
    if installed:
        pytest.importorskip("opengl_basisu")
    else:
        monkeypatch.setitem(sys.modules, "opengl_basisu", None)
    scene = lit(b"\xabKTX 20\xbb\r\n\x1a\n").load(tmp_path)
    hint = "a KTX2 image, which the package opengl_basisu reads; run: pip install 'clpeel[formats]'"
    assert scene.notes == (() if installed else (f"texture 'bumps' left out: {hint}",))
    assert decoded == [png()]


@pytest.mark.parametrize("name", ["EXT_texture_webp", "KHR_texture_basisu"])
@pytest.mark.parametrize("good", ["both", "own", "plain"])
def test_the_image_of_an_extension_comes_first(tmp_path: Path, name: str, good: str) -> None:
    document = lit(b"none" if good == "own" else png(GREEN))
    own = b"none" if good == "plain" else png(BLUE)
    document.more["images"].append({"bufferView": document.view(own), "name": "own"})
    document.more["textures"][1]["extensions"] = {name: {"source": 2}}
    scene = document.load(tmp_path)
    texture = finish(scene).normal_texture
    assert texture is not None and texture.image[0, 0, 1] == (100 if good == "plain" else 0)
    assert scene.notes == ()


def test_an_image_that_cannot_be_decoded_is_named_when_it_is_asked_for(tmp_path: Path) -> None:
    whole = png(np.random.default_rng(1).integers(0, 256, (64, 64, 3)))
    texture = finish(lit(whole[: len(whole) // 2]).load(tmp_path)).normal_texture
    assert texture is not None
    with pytest.raises(InputError) as error:
        texture.image  # noqa: B018
    text = str(error.value)
    assert text.startswith("texture 'bumps' cannot be decoded: the image is damaged (") and "\n" not in text


@pytest.mark.parametrize(
    ("info", "says"),
    [
        ({"index": 9}, "textures: expected an index 0..1, got '9'"),
        (3, "normalTexture: expected an object, got '3'"),
        ({"index": 1, "scale": "x"}, "scale: expected a finite number, got 'x'"),
        ({"index": 1, "texCoord": -1}, "texCoord: expected a whole number of 0 or more, got '-1'"),
    ],
)
def test_damage_to_textures_for_lights_refuses_no_file(tmp_path: Path, info: Any, says: str) -> None:
    document = lit(png(BLUE))
    document.more["materials"][0] |= {"normalTexture": info, "name": "oak"}
    scene = document.load(tmp_path)
    assert scene.notes[0] == f"normal texture of material 'oak' left out: the file is damaged: {says}"
    assert finish(scene).normal_texture is None and scene.materials[0].texture is not None


def test_a_bad_strength_is_named(tmp_path: Path) -> None:
    bad = {"KHR_materials_emissive_strength": {"emissiveStrength": "x"}}
    assert "emissiveStrength: expected a finite number, got 'x'" in refusal(plain({"extensions": bad}), tmp_path)
