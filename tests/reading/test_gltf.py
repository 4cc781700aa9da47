"""glTF by hand: triangles, numbers and nodes are read; what is not read is refused or noted by name."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.documents import POINTS, Document, plain, png, refusal, textured

from clpeel.errors import InputError
from clpeel.reading import compressed
from clpeel.reading.load import load

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


def test_lines_and_points_beside_triangles_are_drawn_in_every_mode(tmp_path: Path) -> None:
    drawn = {0: (1, 0, 3), 1: (1, 1, 0), 2: (1, 3, 0), 3: (1, 2, 0)}
    lost = ("corners left out, as they make no whole line: 1",)
    for mode, counts in drawn.items():
        document = Document(POINTS[:3])
        tree = document.tree()
        tree["meshes"][0]["primitives"].append({**document.primitive, "mode": mode})
        path = tmp_path / "t.gltf"
        path.write_text(json.dumps(tree))
        scene = load(path)
        assert scene.counts == counts and scene.notes == (lost if mode == 1 else ())


def test_corners_that_make_no_whole_triangle_are_left_out_and_noted(tmp_path: Path) -> None:
    scene = Document().load(tmp_path)
    assert scene.faces.tolist() == [[0, 1, 2]]
    assert scene.notes == ("corners left out, as they make no whole triangle: 2",)


def test_vertices_that_no_triangle_uses_are_not_kept(tmp_path: Path) -> None:
    points = np.arange(30, dtype=np.float32).reshape(10, 3)
    document = Document(points)
    document.primitive["indices"] = document.add(np.array([9, 2, 4], np.uint8))
    document.primitive["attributes"]["NORMAL"] = document.add(points + 1)
    scene = document.load(tmp_path)
    assert len(scene.vertices) == 3
    np.testing.assert_array_equal(scene.vertices[scene.faces[0]], points[[9, 2, 4]])
    np.testing.assert_array_equal(scene.vertex_normals[scene.faces[0]], points[[9, 2, 4]] + 1)


def test_numbers_may_be_interleaved(tmp_path: Path) -> None:
    rows = np.concatenate([POINTS[:3], POINTS[1:4], np.ones((3, 1), np.float32)], axis=1)
    document = Document(POINTS[:3])
    view = document.view(rows.tobytes())
    document.views[view]["byteStride"] = 28
    for name, offset in (("POSITION", 0), ("NORMAL", 12)):
        accessor = {"bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 3, "type": "VEC3"}
        document.accessors.append(accessor)
        document.primitive["attributes"][name] = len(document.accessors) - 1
    scene = document.load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, POINTS[:3])
    np.testing.assert_array_equal(scene.vertex_normals, POINTS[1:4])


def test_a_stride_of_zero_means_none(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.views[0]["byteStride"] = 0
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3])


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


@pytest.mark.parametrize(
    ("normalized", "want"), [(True, [[0, 1], [0.2, 0.4], [1, 0]]), (False, [[0, 255], [51, 102], [255, 0]])]
)
def test_quantized_texture_coordinates(tmp_path: Path, normalized: bool, want: Any) -> None:
    document = textured(png())
    corners = np.array([[0, 255], [51, 102], [255, 0]], np.uint8)
    document.primitive["attributes"]["TEXCOORD_0"] = document.add(corners, normalized=normalized)
    np.testing.assert_allclose(document.load(tmp_path).uv, want, atol=1e-7)


def test_sparse_positions_are_put_in_their_places(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    moved = np.array([[7, 8, 9]], np.float32)
    document.accessors[0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": document.view(np.array([1], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": document.view(moved.tobytes())},
    }
    np.testing.assert_array_equal(document.load(tmp_path).vertices, [POINTS[0], moved[0], POINTS[2]])


@pytest.mark.parametrize("base", [True, False])
def test_sparse_numbers_may_have_nothing_below_them(tmp_path: Path, base: bool) -> None:
    document = Document(POINTS[:3])
    document.accessors[0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": document.view(np.array([1, 2], np.uint8).tobytes()), "componentType": 5121},
        "values": {"bufferView": document.view(POINTS[1:3].tobytes())},
    }
    if not base:
        del document.accessors[0]["bufferView"]
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3])  # the first of them is zero


# --- nodes ------------------------------------------------------------------------------------------------------------


def test_meshes_of_nodes_with_a_camera_are_drawn(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}
    document.more = {"nodes": [{"mesh": 0, "camera": 0, "translation": [1, 2, 3]}], "cameras": [camera]}
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3] + [1, 2, 3])


HALF = 0.5**0.5
TURN = {"rotation": [0, 0, HALF, HALF]}  # a quarter turn about Z: x becomes y, and y becomes -x


def test_transforms_of_nodes_are_applied_to_their_children(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    shift = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1]  # a column after another
    child = {"mesh": 0, **TURN, "scale": [2, 3, 4], "translation": [100, 0, 0]}
    document.more = {"nodes": [child, {"matrix": shift, "children": [0]}], "scenes": [{"nodes": [1]}]}
    # Scaled, turned, then shifted: (x, y, z) becomes (-3 y, 2 x, 4 z), all moved by (110, 20, 30).
    want = [[110, 20, 30], [110, 22, 30], [107, 20, 30]]
    np.testing.assert_allclose(document.load(tmp_path).vertices, want, atol=1e-14 * 110)


def test_a_mesh_may_be_shown_by_several_nodes(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.more = {
        "nodes": [{"mesh": 0}, {"children": [0, 2]}, {"mesh": 0, "translation": [5, 0, 0]}],
        "scenes": [{"nodes": [1]}],
    }
    scene = document.load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, [*POINTS[:3], *(POINTS[:3] + [5, 0, 0])])
    assert scene.faces.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize(
    ("more", "shows", "notes"),
    [
        ({"scene": 1, "scenes": [{"nodes": [0], "name": "a"}, {"nodes": [1]}]}, [1], ["'a'"]),
        ({"scenes": [{"nodes": [1]}, {"nodes": [0], "name": "b"}, {}], "scene": 0}, [1], ["'b'"]),
        ({"scenes": [{"nodes": [2, 0]}]}, [2, 0], []),
        ({"scenes": []}, [0, 1, 2], []),
    ],
)
def test_the_default_scene_is_drawn(tmp_path: Path, more: Any, shows: list[int], notes: list[str]) -> None:
    document = Document(POINTS[:3])
    nodes = [{"mesh": 0, "translation": [10 * index, 0, 0]} for index in range(3)]
    document.more = {"nodes": nodes, "scene": 0, **more}
    if "scene" not in more:
        tree = document.tree()
        del tree["scene"]
        (tmp_path / "t.gltf").write_text(json.dumps(tree))
        scene = load(tmp_path / "t.gltf")
    else:
        scene = document.load(tmp_path)
    assert scene.vertices[::3, 0].tolist() == [10 * index for index in shows]
    assert scene.notes == tuple(f"scenes left out, as only the default one is drawn: {name}" for name in notes)


def test_mirrors_leave_the_front_in_front(tmp_path: Path) -> None:
    document = plain(NORMAL=np.tile(np.array([0, 0, 1], np.float32), (3, 1)))
    document.more = {"nodes": [{"mesh": 0, "scale": [-2, 1, 1]}]}
    scene = document.load(tmp_path)
    a, b, c = scene.vertices[scene.faces[0]]
    np.testing.assert_array_equal(np.cross(b - a, c - a), [0, 0, 2])
    np.testing.assert_array_equal(scene.vertex_normals, [[0, 0, 1]] * 3)
    document.more["nodes"][0]["scale"] = [-2, -1, 1]  # two mirrors are a turn
    assert document.load(tmp_path).faces.tolist() == [[0, 1, 2]]


def test_normals_stay_perpendicular_to_what_is_stretched(tmp_path: Path) -> None:
    document = plain(NORMAL=np.tile(np.array([1, 1, 0], np.float32), (3, 1)))
    for scale in ([4, 1, 1], [-4, 1, 1], [4e160, 1e160, 1e160], [4e-160, 1e-160, 1e-160]):
        document.more = {"nodes": [{"mesh": 0, "scale": scale}]}
        # The plane x + y = 0 becomes x / 4 + y = 0.
        want = np.array([np.sign(scale[0]) / 4, 1, 0]) / np.hypot(0.25, 1)
        np.testing.assert_allclose(document.load(tmp_path).vertex_normals, [want] * 3, atol=1e-7)


def test_instances_stand_in_all_their_places(tmp_path: Path) -> None:
    document = plain(NORMAL=np.tile(np.array([0, 0, 1], np.float32), (3, 1)))
    attributes = {
        "TRANSLATION": document.add(np.array([[1, 0, 0], [0, 5, 0]], np.float32)),
        "SCALE": document.add(np.array([[1, 1, 1], [-2, 1, 1]], np.float32)),
        "_ID": document.add(np.array([7, 8], np.uint16)),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    document.more = {"nodes": [{"mesh": 0, "translation": [0, 0, 9], "extensions": extension}]}
    document.more["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    scene = document.load(tmp_path)
    first, second = POINTS[:3] + [1, 0, 9], POINTS[:3] * [-2, 1, 1] + [0, 5, 9]
    np.testing.assert_array_equal(scene.vertices, [*first, *second])
    assert scene.faces.tolist() == [[0, 1, 2], [3, 5, 4]]  # the second one is mirrored
    np.testing.assert_array_equal(scene.vertex_normals, [[0, 0, 1]] * 6)
    assert scene.notes == ("attributes of instances left out: '_ID'",)


def test_very_long_chains_of_nodes_are_read(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    count = 20_000
    nodes = [{"children": [index + 1], "translation": [1, 0, 0]} for index in range(count)]
    document.more = {"nodes": [*nodes, {"mesh": 0}]}
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3] + [count, 0, 0])


# --- extensions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["EXT_made_up", "ACME_fur"])
def test_required_extensions_that_are_not_read_are_refused_by_name(tmp_path: Path, name: str) -> None:
    document = Document(POINTS[:3])
    document.more = {"extensionsRequired": [name], "extensionsUsed": [name]}
    assert f"requires the glTF extension '{name}', which is not read" in refusal(document, tmp_path)


@pytest.mark.parametrize("required", [True, False])
@pytest.mark.parametrize("name", ["KHR_materials_clearcoat", "EXT_lights_image_based", "EXT_texture_avif"])
def test_extensions_of_appearance_are_noted_by_name(tmp_path: Path, name: str, required: bool) -> None:
    document = Document(POINTS[:3])
    document.more = {"extensionsUsed": [name], **({"extensionsRequired": [name]} if required else {})}
    assert document.load(tmp_path).notes == (f"glTF extensions left out: {name}",)


@pytest.mark.parametrize(
    "name",
    [
        *(
            "KHR_materials_unlit KHR_texture_transform KHR_texture_basisu EXT_texture_webp KHR_mesh_quantization"
        ).split(),
        *("KHR_materials_pbrSpecularGlossiness KHR_draco_mesh_compression EXT_mesh_gpu_instancing KHR_xmp").split(),
        *("EXT_meshopt_compression KHR_meshopt_compression KHR_materials_transmission KHR_lights_punctual").split(),
    ],
)
def test_extensions_that_are_read_need_no_note(tmp_path: Path, name: str) -> None:
    document = Document(POINTS[:3])
    document.more = {"extensionsUsed": [name], "extensionsRequired": [name]}
    assert document.load(tmp_path).notes == ()


def lacking(*_: Any) -> Any:
    """In place of a decoder: its library is missing."""
    raise InputError("expected the package, which is not installed")


def packed_by_draco() -> Document:
    """A triangle that is packed, with plain numbers as a fallback."""
    document = plain(NORMAL=np.tile(np.array([0, 0, 1], np.float32), (3, 1)))
    view = document.view(b"DRACO")
    attributes = {"POSITION": 7, "NORMAL": 3}
    document.primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": attributes}}
    document.primitive["indices"] = document.add(np.array([0, 1, 2], np.uint8))
    document.more["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    return document


def test_draco_gives_triangles_and_attributes_by_their_ids(tmp_path: Path, monkeypatch: Any) -> None:
    points = np.array([[9, 0, 0], [0, 9, 0], [0, 0, 9], [9, 9, 9]], np.float32)

    def draco(data: bytes) -> Any:
        assert data == b"DRACO"
        return np.array([[0, 1, 2], [1, 3, 2]], np.uint32), {3: points / 9, 7: points}

    monkeypatch.setattr(compressed, "draco", draco)
    document = packed_by_draco()
    document.primitive["attributes"]["COLOR_0"] = document.add(np.full((4, 4), 51, np.uint8), normalized=True)
    for accessor in document.accessors[:2]:
        del accessor["bufferView"]
    scene = document.load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, points)
    np.testing.assert_array_equal(scene.vertex_normals, points / 9)
    assert scene.faces.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert scene.vertex_colors is not None and scene.vertex_colors.tolist() == [[51] * 4] * 4  # this one is not packed


def test_draco_may_hold_normalized_integers(tmp_path: Path, monkeypatch: Any) -> None:
    points = np.array([[32767, 0, 0], [0, -32768, 0], [0, 0, 0]], np.int16)
    monkeypatch.setattr(compressed, "draco", lambda _: (np.array([[0, 1, 2]]), {7: points}))
    document = packed_by_draco()
    document.accessors[0] |= {"componentType": 5122, "normalized": True}
    np.testing.assert_array_equal(document.load(tmp_path).vertices, [[1, 0, 0], [0, -1, 0], [0, 0, 0]])


@pytest.mark.parametrize("fallback", [True, False])
def test_draco_that_cannot_be_unpacked_needs_a_fallback(tmp_path: Path, fallback: bool, monkeypatch: Any) -> None:
    monkeypatch.setattr(compressed, "draco", lacking)
    document = packed_by_draco()
    if fallback:
        np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3])
    else:
        del document.accessors[0]["bufferView"]
        assert "expected the package, which is not installed" in refusal(document, tmp_path)


def test_draco_is_refused_by_name_without_its_library(model: Callable[[str], Path], monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(InputError) as error:
        load(model("draco-engine/2CylinderEngine.gltf"))
    assert "KHR_draco_mesh_compression" in str(error.value)


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt_is_unpacked_by_its_mode_and_filter(tmp_path: Path, monkeypatch: Any, name: str) -> None:
    asked = []

    def meshopt(*given: Any) -> bytes:
        asked.append(given)
        return POINTS[:3].tobytes()

    monkeypatch.setattr(compressed, "meshopt", meshopt)
    document = Document(POINTS[:3])
    document.primitive["attributes"]["NORMAL"] = document.primitive["attributes"]["POSITION"]
    packed = {"buffer": 0, "byteOffset": 2, "byteLength": 5, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}
    document.views[0] = {"buffer": 1, "byteLength": 36, "extensions": {name: {**packed, "filter": "EXPONENTIAL"}}}
    document.data = b"..MESHOPT"
    document.more = {"extensionsRequired": [name], "buffers": [*document.tree()["buffers"], {"byteLength": 36}]}
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3])
    assert asked == [(b"MESHO", 3, 12, "ATTRIBUTES", "EXPONENTIAL")]  # once, for both of its accessors


@pytest.mark.parametrize("fallback", [True, False])
def test_meshopt_that_cannot_be_unpacked_needs_a_fallback(tmp_path: Path, fallback: bool, monkeypatch: Any) -> None:
    monkeypatch.setattr(compressed, "meshopt", lacking)
    document = Document(POINTS[:3])
    packed = {"buffer": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}
    document.views[0]["extensions"] = {"EXT_meshopt_compression": packed}
    if fallback:
        np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3])
    else:
        document.views[0]["buffer"] = 1
        document.more["buffers"] = [*document.tree()["buffers"], {"byteLength": 36}]
        assert "expected the package, which is not installed" in refusal(document, tmp_path)


def test_real_draco_and_meshopt_data_are_read(tmp_path: Path) -> None:
    draco, meshopt = pytest.importorskip("DracoPy"), pytest.importorskip("meshopt")
    faces = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]])
    plain_one = Document(POINTS)
    plain_one.primitive["indices"] = plain_one.add(faces.reshape(-1).astype(np.uint16))
    want = plain_one.load(tmp_path)

    by_meshopt = Document(POINTS)
    by_meshopt.primitive["indices"] = by_meshopt.add(faces.reshape(-1).astype(np.uint16))
    packings = ((POINTS, "ATTRIBUTES", 12), (faces.reshape(-1).astype(np.uint16), "TRIANGLES", 2))
    for view, (values, mode, stride) in enumerate(packings):
        part = by_meshopt.views[by_meshopt.view(meshopt.encode_gltf_buffer(values, mode))]
        packed = {**part, "byteStride": stride, "count": len(values), "mode": mode}
        extensions = {"EXT_meshopt_compression": packed}
        by_meshopt.views[view] = {"buffer": 1, "byteLength": values.nbytes, "extensions": extensions}
    by_meshopt.more["buffers"] = [*by_meshopt.tree()["buffers"], {"byteLength": 9999}]

    by_draco = Document(POINTS)
    data = draco.encode(POINTS, faces.astype(np.uint32), preserve_order=True, quantization_bits=24)
    packed = {"bufferView": by_draco.view(data), "attributes": {"POSITION": 0}}
    by_draco.primitive |= {"extensions": {"KHR_draco_mesh_compression": packed}}
    del by_draco.accessors[0]["bufferView"]

    for document, near in ((by_meshopt, 0), (by_draco, 2**-22)):
        scene = document.load(tmp_path)
        np.testing.assert_allclose(scene.vertices, want.vertices, atol=near)
        assert turned(scene.faces) == turned(faces)


# --- files that need little -------------------------------------------------------------------------------------------


def test_numbers_that_are_none_are_left_to_the_picture(tmp_path: Path) -> None:
    points = POINTS[:3].copy()
    points[1] = np.nan
    scene = Document(points).load(tmp_path)
    assert np.isnan(scene.vertices[1]).all() and scene.notes == ()


def test_gltf_needs_no_trimesh(tmp_path: Path) -> None:
    path = textured(png()).glb(tmp_path)
    code = f"import sys; from clpeel.reading.load import load; load({str(path)!r}); sys.exit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
