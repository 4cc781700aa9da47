"""glTF by hand: strips, fans, packed and sparse numbers are read; what is not read is refused or noted by name."""

from __future__ import annotations

import base64
import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clpeel.reading.gltf
from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.scene import Scene

pytest.importorskip("trimesh")

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5], [2, 0, 1]], np.float32)
COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}


class Document:
    """A glTF document of one mesh with one primitive, its numbers in one embedded buffer."""

    def __init__(self, points: np.ndarray = POINTS, **primitive: Any) -> None:
        self.data = b""
        self.views: list[Any] = []
        self.accessors: list[Any] = []
        self.primitive = {"attributes": {"POSITION": self.add(points)}, **primitive}
        self.more: dict[str, Any] = {}

    def view(self, data: bytes) -> int:
        """The bytes as a new bufferView."""
        self.data += bytes(-len(self.data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.views) - 1

    def add(self, values: np.ndarray, **more: Any) -> int:
        """The numbers as a new accessor."""
        kind = "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}"
        component = COMPONENTS[values.dtype.name]
        accessor = {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values)}
        self.accessors.append({**accessor, "type": kind, **more})
        return len(self.accessors) - 1

    def tree(self, uri: bool = True) -> dict[str, Any]:
        """The whole JSON."""
        buffer: dict[str, Any] = {"byteLength": len(self.data)}
        if uri:
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        return {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [self.primitive]}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [buffer],
            **self.more,
        }

    def load(self, folder: Path) -> Scene:
        """What `load` makes of it as a .gltf file."""
        path = folder / "t.gltf"
        path.write_text(json.dumps(self.tree()))
        return load(path)

    def glb(self, folder: Path) -> Path:
        """The path of it as a .glb file."""
        text = json.dumps(self.tree(uri=False)).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + bytes(-len(self.data) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        path = folder / "t.glb"
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)
        return path


def refusal(document: Document, folder: Path) -> str:
    """The one line that refuses the document."""
    with pytest.raises(InputError) as error:
        document.load(folder)
    assert "\n" not in str(error.value)
    return str(error.value)


def image(size: tuple[int, int] = (2, 2)) -> bytes:
    """A red PNG."""
    stream = io.BytesIO()
    pytest.importorskip("PIL.Image").new("RGB", size, (255, 0, 0)).save(stream, "PNG")
    return stream.getvalue()


# --- strips, fans and numbers -----------------------------------------------------------------------------------------

TRIANGLES = {5: [[0, 1, 2], [1, 3, 2], [2, 3, 4]], 6: [[0, 1, 2], [0, 2, 3], [0, 3, 4]]}


def turned(faces: Any) -> list[list[int]]:
    """Faces with the least corner first, their winding kept."""
    return [np.roll(face, -int(np.argmin(face))).tolist() for face in faces]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32, None])
@pytest.mark.parametrize("mode", [5, 6])
def test_strips_and_fans_of_every_index_type(tmp_path: Path, mode: int, dtype: Any) -> None:
    document = Document(mode=mode)
    if dtype is not None:
        document.primitive["indices"] = document.add(np.arange(5).astype(dtype))
    scene = document.load(tmp_path)
    assert turned(scene.faces) == TRIANGLES[mode] and scene.notes == ()
    np.testing.assert_array_equal(scene.vertices, POINTS)
    np.testing.assert_array_equal(load(document.glb(tmp_path)).faces, scene.faces)


def test_strip_triangles_without_area_are_dropped_and_the_winding_goes_on(tmp_path: Path) -> None:
    document = Document(mode=5)
    document.primitive["indices"] = document.add(np.array([0, 1, 2, 2, 3, 3, 4, 1], np.uint16))
    # Of (0 1 2), (1 2 2), (2 2 3), (2 3 3), (3 3 4), (3 4 1) the first and the last have area; the last is turned.
    assert turned(document.load(tmp_path).faces) == [[0, 1, 2], [1, 4, 3]]


def test_lines_beside_triangles_are_noted_in_every_mode(tmp_path: Path) -> None:
    for mode in (1, 2, 3):
        document = Document(POINTS[:3])
        tree = document.tree()
        tree["meshes"][0]["primitives"].append({**document.primitive, "mode": mode})
        path = tmp_path / "t.gltf"
        path.write_text(json.dumps(tree))
        assert load(path).notes == ("left out, not triangles: 1 line set(s)",)


def test_corners_that_make_no_whole_triangle_are_left_out(tmp_path: Path) -> None:
    assert Document().load(tmp_path).faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(("dtype", "top"), [(np.int8, 127), (np.uint8, 255), (np.int16, 32767), (np.uint16, 65535)])
def test_quantized_meshes_are_read_rightly(tmp_path: Path, dtype: Any, top: int) -> None:
    raw = np.array([[0, 0, 0], [top, 0, 0], [0, top // 2, 3]], dtype)
    normalized, plain = Document(raw), Document(raw)
    for document in (normalized, plain):
        document.more = {name: ["KHR_mesh_quantization"] for name in ("extensionsRequired", "extensionsUsed")}
    normalized.accessors[0]["normalized"] = True
    scene = normalized.load(tmp_path)
    np.testing.assert_allclose(scene.vertices, raw / top, atol=1e-7)
    assert scene.notes == ()
    np.testing.assert_array_equal(plain.load(tmp_path).vertices, raw)


def test_quantized_texture_coordinates_find_their_texels(tmp_path: Path) -> None:
    document = Document(POINTS[:3], material=0)
    corners = np.array([[16384, 0], [65535, 0], [16384, 50000]], np.uint16)
    document.primitive["attributes"]["TEXCOORD_0"] = document.add(corners, normalized=True)
    stream = io.BytesIO()
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]], np.uint8)
    pytest.importorskip("PIL.Image").fromarray(pixels).save(stream, "PNG")
    document.more = textured(document, stream.getvalue())
    colors = document.load(tmp_path).vertex_colors
    assert colors is not None and colors[:, :3].tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255]]


def test_sparse_positions_are_put_in_their_places(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    moved = np.array([[7, 8, 9]], np.float32)
    document.accessors[0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": document.view(np.array([1], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": document.view(moved.tobytes())},
    }
    np.testing.assert_array_equal(document.load(tmp_path).vertices, [POINTS[0], moved[0], POINTS[2]])


def test_meshes_of_nodes_with_a_camera_are_drawn(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}
    document.more = {"nodes": [{"mesh": 0, "camera": 0, "translation": [1, 2, 3]}], "cameras": [camera]}
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3] + [1, 2, 3])


# --- extensions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression", "EXT_made_up", "ACME_fur"])
def test_required_extensions_that_are_not_read_are_refused_by_name(tmp_path: Path, name: str) -> None:
    document = Document(POINTS[:3])
    document.more = {"extensionsRequired": [name], "extensionsUsed": [name]}
    assert name in refusal(document, tmp_path)


@pytest.mark.parametrize("required", [True, False])
@pytest.mark.parametrize(
    "name",
    ["KHR_materials_unlit", "KHR_texture_transform", "KHR_texture_basisu", "KHR_lights_punctual"],
)
def test_extensions_of_appearance_are_noted_by_name(tmp_path: Path, name: str, required: bool) -> None:
    document = Document(POINTS[:3])
    document.more = {"extensionsUsed": [name], **({"extensionsRequired": [name]} if required else {})}
    assert document.load(tmp_path).notes == (f"glTF extensions left out: {name}",)


def test_draco_is_refused_unless_it_is_decoded(model: Callable[[str], Path], monkeypatch: Any) -> None:
    path = model("draco-engine/2CylinderEngine.gltf")
    monkeypatch.setattr(clpeel.reading.gltf, "_decodes_draco", lambda: False)
    with pytest.raises(InputError) as error:
        load(path)
    assert "KHR_draco_mesh_compression" in str(error.value) and "without Draco compression" in str(error.value)


@pytest.mark.parametrize("fallback", [True, False])
def test_draco_that_is_not_required_needs_a_fallback(tmp_path: Path, fallback: bool, monkeypatch: Any) -> None:
    monkeypatch.setattr(clpeel.reading.gltf, "_decodes_draco", lambda: False)
    document = Document(POINTS[:3])
    view = document.view(b"DRACO")
    document.primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {}}}
    document.more = {"extensionsUsed": ["KHR_draco_mesh_compression"]}
    if fallback:
        np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3])
    else:
        del document.accessors[0]["bufferView"]
        assert "KHR_draco_mesh_compression" in refusal(document, tmp_path)


def test_draco_data_that_no_decoder_takes_are_refused(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(clpeel.reading.gltf, "_decodes_draco", lambda: True)  # but the data are none of Draco's
    document = Document(POINTS[:3])
    view = document.view(b"DRACO")
    document.primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {}}}
    del document.accessors[0]["bufferView"]
    assert "KHR_draco_mesh_compression" in refusal(document, tmp_path)


# --- what the picture lacks -------------------------------------------------------------------------------------------


def textured(document: Document, picture: bytes, **material: Any) -> dict[str, Any]:
    """A material with this picture as its texture, for a document's JSON."""
    return {
        "images": [{"bufferView": document.view(picture), "mimeType": "image/png", "name": "wood"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, **material}],
    }


def with_texture(picture: bytes, **material: Any) -> Document:
    """A triangle with a material, and texture coordinates."""
    document = Document(POINTS[:3], material=0)
    document.primitive["attributes"]["TEXCOORD_0"] = document.add(np.zeros((3, 2), np.float32))
    document.more = textured(document, picture, **material)
    return document


def test_textures_that_are_no_base_color_are_one_note(tmp_path: Path) -> None:
    texture = {"index": 0}
    document = with_texture(image(), emissiveTexture=texture, normalTexture=texture, occlusionTexture=texture)
    assert document.load(tmp_path).notes == (
        "textures left out, as only base colours are drawn: normal, occlusion, emissive",
        "textures are sampled at the vertices only",
    )


def test_bad_images_are_noted_by_name(tmp_path: Path, monkeypatch: Any) -> None:
    assert with_texture(b"no image").load(tmp_path).notes == (
        "texture 'wood' left out: expected an image, got text that begins with 'no image'",
    )
    picture = image((30, 30))
    monkeypatch.setattr("clpeel.reading.images.MOST_TEXELS", 29)
    (note,) = with_texture(picture).load(tmp_path).notes
    assert note == "texture 'wood' left out: too large, 30 x 30 texels; at most 29 x 29 are read"


@pytest.mark.parametrize("uri", ["none.png", "../none.png", "data:image/png,", "data:image/png;base64,@"])
def test_missing_images_are_noted_by_name(tmp_path: Path, uri: str) -> None:
    document = with_texture(image())
    document.more["images"] = [{"uri": uri}]
    (note,) = document.load(tmp_path).notes
    assert note.startswith(f"texture '{'image 0' if uri.startswith('data:') else uri}' left out: ")


def test_images_beside_the_file_may_have_escaped_names(tmp_path: Path) -> None:
    document = with_texture(image())
    document.more["images"] = [{"uri": "red%20one.png"}]
    (tmp_path / "red one.png").write_bytes(image())
    colors = document.load(tmp_path).vertex_colors
    assert colors is not None and colors.tolist() == [[255, 0, 0, 255]] * 3


def test_second_texture_coordinates_are_noted(tmp_path: Path) -> None:
    document = with_texture(image(), name="oak")
    document.more["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1
    assert document.load(tmp_path).notes[0] == "second texture coordinates left out: 'oak' drawn with the first set"


def test_skins_and_morph_weights_are_noted(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.more = {"nodes": [{"mesh": 0, "skin": 0, "weights": [0, 0.5]}], "skins": [{"joints": [0]}]}
    assert document.load(tmp_path).notes == (
        "skins left out: 1 mesh(es) are drawn as stored, not posed",
        "morph targets left out: 1 mesh(es) are drawn without their weights",
    )
    document.more = {"nodes": [{"mesh": 0, "weights": [0, 0]}]}
    assert document.load(tmp_path).notes == ()


# --- damaged files ----------------------------------------------------------------------------------------------------


def test_missing_buffers_are_errors(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.more = {"buffers": [{"byteLength": 36, "uri": "none.bin"}]}
    assert "the buffer 'none.bin': no such file" in refusal(document, tmp_path)


def test_cut_files_say_so(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.views[0]["byteLength"] = 99
    assert "the file is cut: part 0 ends at byte 99 of a buffer of 36" in refusal(document, tmp_path)
    path = Document(POINTS[:3]).glb(tmp_path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match="the file is cut: expected a chunk of 36 bytes, got 28"):
        load(path)


def test_small_files_cannot_ask_for_all_the_memory(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.accessors.append({"componentType": 5126, "count": 10**12, "type": "VEC3"})
    assert "promises more than" in refusal(document, tmp_path)


def test_the_first_gltf_is_refused_in_plain_words(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.more = {"asset": {"version": "1.0"}}
    assert "expected glTF 2, got version '1.0'" in refusal(document, tmp_path)
