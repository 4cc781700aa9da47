"""Damaged glTF files are refused in plain words, which name the part that breaks the format."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading import test_gltf_animations, test_gltf_pose
from reading.documents import POINTS, Document, plain, png, refusal, textured

from clpeel.errors import InputError
from clpeel.reading.load import load


def test_missing_buffers_are_errors(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.more = {"buffers": [{"byteLength": 36, "uri": "none.bin"}]}
    assert "the buffer 'none.bin': no such file" in refusal(document, tmp_path)
    document.more = {"buffers": [{"byteLength": 36}]}
    assert "the file is damaged: buffer 0 has no data" in refusal(document, tmp_path)


def test_cut_files_say_so(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.views[0]["byteLength"] = 99
    assert "the file is cut: part 0 ends at byte 99 of a buffer of 36" in refusal(document, tmp_path)
    document.views[0]["byteLength"] = 10 * 2**30
    assert "the file is cut: part 0 ends at byte 10,737,418,240 of a buffer of 36" in refusal(document, tmp_path)
    path = Document(POINTS[:3]).glb(tmp_path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match="the file is cut: expected a chunk of 36 bytes, got 28"):
        load(path)


SPARSE = {"count": 1, "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 0}}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"count": 4}, "the file is cut: POSITION ends at byte 48 of a part of 36"),
        ({"count": 10**30}, "the file is cut: POSITION ends at byte 12,000,"),
        ({"count": -3}, "accessor's count: expected a whole number of 1 or more, got '-3'"),
        ({"count": 3.0}, "accessor's count: expected a whole number of 1 or more, got '3.0'"),
        ({"count": None}, "accessor's count: expected a whole number of 1 or more, got 'None'"),
        ({"byteOffset": -12}, "POSITION byteOffset: expected a whole number of 0 or more, got '-12'"),
        ({"byteOffset": 4}, "the file is cut: POSITION ends at byte 40 of a part of 36"),
        ({"type": "VEC2"}, "POSITION: expected an accessor of VEC3, got 'VEC2'"),
        ({"type": []}, "POSITION: expected an accessor of VEC3, got '[]'"),
        ({"componentType": 5124}, "POSITION componentType: expected one of 5120, 5121, 5122, 5123, 5125, 5126, got"),
        ({"componentType": []}, "POSITION componentType: expected one of"),
        ({"bufferView": 7}, "bufferViews: expected an index 0..0, got '7'"),
        ({"bufferView": -1}, "bufferViews: expected an index 0..0, got '-1'"),
        ({"bufferView": True}, "bufferViews: expected an index 0..0, got 'True'"),
        (
            {"sparse": {**SPARSE, "count": 10**9}},
            "the file is cut: POSITION ends at byte 1,000,000,000 of a part of 36",
        ),
        (
            {"sparse": {**SPARSE, "indices": {"bufferView": 0, "componentType": 5125, "byteOffset": 12}}},
            "in places 0..2",
        ),
        ({"sparse": {**SPARSE, "indices": {"bufferView": 0, "componentType": 5126}}}, "in places 0..2"),
    ],
)
def test_accessors_that_break_the_format_are_named(tmp_path: Path, change: Any, says: str) -> None:
    document = Document(POINTS[:3])
    document.accessors[0] |= change
    assert says in refusal(document, tmp_path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"byteStride": 4}, "POSITION: expected a byteStride of 12 or more, got 4"),
        ({"byteStride": -12}, "POSITION byteStride: expected a whole number of 0 or more, got '-12'"),
        ({"byteStride": 2**40}, "the file is cut: POSITION ends at byte"),
        ({"byteOffset": -1}, "part 0 byteOffset: expected a whole number of 0 or more, got '-1'"),
        ({"byteLength": -1}, "part 0: expected a whole number of 0 or more, got '-1'"),
        ({"buffer": 1}, "buffers: expected an index 0..0, got '1'"),
    ],
)
def test_parts_that_break_the_format_are_named(tmp_path: Path, change: Any, says: str) -> None:
    document = Document(POINTS[:3])
    document.views[0] |= change
    assert says in refusal(document, tmp_path)


@pytest.mark.parametrize(
    ("indices", "says"),
    [
        (np.array([0, 1, 3], np.uint16), "indices: expected 0..2, got 3"),
        (np.array([0, 1, 255], np.uint8), "indices: expected 0..2, got 255, with which strips would begin anew"),
        (np.array([0, 1, 2**32 - 1], np.uint32), "got 4294967295, with which strips would begin anew"),
        (np.array([0, -1, 2], np.int16), "indices: expected 0..2, got -1"),
        (np.array([0, 1, 2], np.float32), "indices: expected integers, got floats"),
    ],
)
@pytest.mark.parametrize("mode", [4, 5, 6])
def test_indices_beyond_the_vertices_are_refused(tmp_path: Path, indices: Any, says: str, mode: int) -> None:
    document = Document(POINTS[:3], mode=mode)
    document.primitive["indices"] = document.add(indices)
    assert says in refusal(document, tmp_path)


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        ([{"mesh": 0, "children": [0]}], "nodes: 1 of them are their own ancestors"),
        ([{"mesh": 0}, {"children": [2]}, {"children": [1]}], "nodes: 2 of them are their own ancestors"),
        ([{"children": [2]}, {"children": [2]}, {"mesh": 0}], "nodes: expected one parent for node 2, got two"),
        ([{"children": [1, 1]}, {"mesh": 0}], "nodes: expected one parent for node 1, got two"),
        ([{"children": [9]}], "children: expected an index 0..0, got '9'"),
        ([{"children": [-1]}], "children: expected an index 0..0, got '-1'"),
        ([{"mesh": 3}], "meshes: expected an index 0..0, got '3'"),
        ([{"mesh": 0, "matrix": [1]}], "matrix: expected 16 numbers, got '[1]'"),
        ([{"mesh": 0, "scale": [1, "a", 1]}], "scale: expected a finite number, got 'a'"),
        ([{"mesh": 0, "scale": [1, 10**400, 1]}], "scale: expected a finite number, got"),
        ([{"mesh": 0, "translation": [1, float("nan"), 1]}], "expected JSON, got what is not: NaN"),
        ([7], "nodes: expected a list of objects, got other values"),
        ({"a": 1}, "nodes: expected a list, got"),
        ([], "scene: there are none"),
        ([{}], "expected triangles, got 1 mesh(es) that no node shows; the mesh is empty"),
    ],
)
def test_nodes_that_break_the_format_are_named(tmp_path: Path, nodes: Any, says: str) -> None:
    document = Document(POINTS[:3])
    document.more["nodes"] = nodes
    assert says in refusal(document, tmp_path)


def test_attributes_of_other_lengths_are_refused(tmp_path: Path) -> None:
    document = plain(NORMAL=POINTS[:2])
    assert "NORMAL: expected 3, as there are positions, got 2" in refusal(document, tmp_path)


def test_small_files_cannot_ask_for_all_the_memory(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.accessors[0] = {"componentType": 5126, "count": 10**12, "type": "VEC3"}
    assert "promises more than" in refusal(document, tmp_path)
    document = Document(np.tile(POINTS[:3], (30_000, 1)))
    document.more["nodes"] = [{"children": list(range(1, 3000))}, *[{"mesh": 0}] * 2999]
    assert "expected at most 134,217,728 vertices or triangles of a file with 1,080,000 bytes" in refusal(
        document, tmp_path
    )


def test_the_first_gltf_is_refused_in_plain_words(tmp_path: Path) -> None:
    document = Document(POINTS[:3])
    document.more = {"asset": {"version": "1.0"}}
    assert "expected glTF 2, got version '1.0'" in refusal(document, tmp_path)


# --- any change of any part -------------------------------------------------------------------------------------------

VALUES = (None, -1, 0, 1, 7, 10**12, 2**31, 2**70, 1.5, 1e308, True, "", "x", [], {}, [0], [0, 0], {"a": 1})
VALUES += ("MASK", "VEC3", "SCALAR", "MAT4", "STEP", "CUBICSPLINE", 5121, 5125, 5126, "data:,")


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to each part of a document."""
    for key, held in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield (*path, key)
        yield from places(held, (*path, key))


def at(tree: Any, path: tuple[Any, ...]) -> Any:
    """The part of a document at the end of a way."""
    for key in path:
        tree = tree[key]
    return tree


def changed(tree: Any, chance: random.Random) -> Any:
    """A document with a part left out, or with another value in its place, which may be that of another part."""
    tree = copy.deepcopy(tree)
    ways = list(places(tree))
    *way, key = chance.choice(ways)
    holder, other = at(tree, tuple(way)), copy.deepcopy(at(tree, chance.choice(ways)))
    what = chance.random()
    if what < 0.2:
        del holder[key]
    else:
        holder[key] = other if what < 0.4 else copy.deepcopy(chance.choice(VALUES))
    return tree


def seeds() -> Iterator[Any]:
    """Documents with a skin, targets, animations, and a texture."""
    yield test_gltf_pose.strip(test_gltf_pose.WEIGHTS, NORMAL=test_gltf_pose.UP).tree()
    yield test_gltf_pose.morphed([0.5, 0.2]).tree()
    yield test_gltf_animations.two().tree()
    turned = {"offset": [0.5, 0], "rotation": 1, "scale": [1, 2]}
    glass = {"KHR_materials_transmission": {"transmissionFactor": 0.4}}
    info = {"texCoord": 0, "extensions": {"KHR_texture_transform": turned}}
    yield textured(png(), info, alphaMode="MASK", alphaCutoff=0.3, extensions=glass).tree()


@pytest.mark.parametrize("seed", range(4))
def test_whatever_is_changed_is_read_or_refused_by_name(tmp_path: Path, seed: int) -> None:
    chance, path, trees = random.Random(seed), tmp_path / "t.gltf", list(seeds())
    read = 0
    for _ in range(300):
        path.write_text(json.dumps(changed(chance.choice(trees), chance)))
        moment = chance.choice(({}, {"animation_index": 0, "animation_time": 2}))
        try:
            scene = load(path, **moment)
        except InputError as error:
            text = str(error)
            assert "\n" not in text and len(text) < 400 and "the reader stopped with" not in text, text
        else:
            read += 1
            assert scene.faces.max() < len(scene.vertices) and all(note.isprintable() for note in scene.notes)
    assert read > 30
