"""Poses of glTF: skins and morph targets put vertices where the specification says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.documents import POINTS, UV, Document, plain, png, refusal, textured

HALF = 0.5**0.5
QUARTER = [0, 0, HALF, HALF]  # a quarter turn about Z: (x, y) becomes (-y, x)
UP = np.tile(np.float32([0, 1, 0]), (6, 1))

STRIP = np.array([[x, y, 0] for y in (0, 1, 2) for x in (0, 1)], np.float32)
"""A strip along Y, of which the upper half is bent: its joint is at y = 1."""


def columns(*matrices: Any) -> np.ndarray:
    """Matrices as glTF stores them, a column after another: float32 [k, 16]."""
    return np.array([np.asarray(matrix, np.float32).T.reshape(16) for matrix in matrices], np.float32)


def shift(x: float, y: float, z: float) -> np.ndarray:
    """The matrix of a shift."""
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def strip(weights: Any, joints: Any = None, **attributes: np.ndarray) -> Document:
    """A strip with a skin of two joints, of which the second is turned by 90 degrees about (0, 1, 0)."""
    document = Document(STRIP)
    document.primitive["indices"] = document.add(np.array([0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4], np.uint16))
    places = np.tile(np.uint8([0, 1, 0, 0]), (6, 1)) if joints is None else joints
    document.primitive["attributes"]["JOINTS_0"] = document.add(places)
    more = {} if weights.dtype == np.float32 else {"normalized": True}
    document.primitive["attributes"]["WEIGHTS_0"] = document.add(weights, **more)
    for name, values in attributes.items():
        document.primitive["attributes"][name] = document.add(values)
    rest = document.add(columns(np.eye(4), shift(0, -1, 0)))
    document.more = {
        "nodes": [
            {"mesh": 0, "skin": 0, "translation": [500, 600, 700]},
            {"children": [2]},
            {"translation": [0, 1, 0], "rotation": QUARTER},
        ],
        "scenes": [{"nodes": [0, 1]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": rest}],
    }
    return document


def bent(y: float) -> np.ndarray:
    """The weights of the two joints at a height of the strip: what is above y = 1 follows the second."""
    return np.array([0, 1, 0, 0] if y > 1 else [1, 0, 0, 0], np.float32)


WEIGHTS = np.array([bent(y) for _, y, _ in STRIP])


@pytest.mark.parametrize("top", [None, 255, 65535])
def test_a_strip_bends_at_its_joint(tmp_path: Path, top: int | None) -> None:
    weights = WEIGHTS if top is None else (WEIGHTS * top).astype(f"u{top.bit_length() // 8}")
    scene = strip(weights, NORMAL=UP).load(tmp_path)
    # Above the joint, (x, y) becomes (1 - y, 1 + x). The transform of the mesh's own node counts for nothing.
    want = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [-1, 1, 0], [-1, 2, 0]]
    np.testing.assert_allclose(scene.vertices, want, atol=1e-7)
    np.testing.assert_allclose(scene.vertex_normals, [[0, 1, 0]] * 4 + [[-1, 0, 0]] * 2, atol=1e-7)
    assert scene.notes == ()


def test_weights_are_shares_of_the_joints(tmp_path: Path) -> None:
    weights = np.tile(np.float32([0.25, 0.25, 0, 0]), (6, 1))  # their sum should be 1, so they are taken as halves
    scene = strip(weights).load(tmp_path)
    x, y, _ = STRIP.T
    np.testing.assert_allclose(scene.vertices, np.stack([(x + 1 - y) / 2, (y + 1 + x) / 2, 0 * x], 1), atol=1e-7)


def test_any_number_of_sets_of_joints_counts(tmp_path: Path) -> None:
    joints = np.zeros((6, 4), np.uint8)
    document = strip(np.tile(np.float32([0.5, 0, 0, 0]), (6, 1)), joints)
    document.primitive["attributes"]["JOINTS_1"] = document.add(joints.astype(np.uint16) + 1)
    document.primitive["attributes"]["WEIGHTS_1"] = document.add(np.tile(np.float32([0, 0, 0.5, 0]), (6, 1)))
    x, y, _ = STRIP.T
    want = np.stack([(x + 1 - y) / 2, (y + 1 + x) / 2, 0 * x], 1)
    np.testing.assert_allclose(document.load(tmp_path).vertices, want, atol=1e-7)


@pytest.mark.parametrize("bad", [0, np.nan, -1])
def test_vertices_without_weights_follow_their_first_joint(tmp_path: Path, bad: float) -> None:
    joints = np.tile(np.uint8([1, 0, 0, 0]), (6, 1))
    scene = strip(np.full((6, 4), bad, np.float32), joints).load(tmp_path)
    x, y, _ = STRIP.T
    np.testing.assert_allclose(scene.vertices, np.stack([1 - y, 1 + x, 0 * x], 1), atol=1e-7)


def test_joints_without_weight_may_be_any(tmp_path: Path) -> None:
    joints = np.tile(np.uint8([0, 1, 200, 255]), (6, 1))
    np.testing.assert_array_equal(
        strip(WEIGHTS, joints).load(tmp_path).vertices, strip(WEIGHTS).load(tmp_path).vertices
    )


def test_a_skin_that_mirrors_leaves_the_front_in_front(tmp_path: Path) -> None:
    document = strip(np.tile(np.float32([1, 0, 0, 0]), (6, 1)), NORMAL=np.tile(np.float32([0, 0, 1]), (6, 1)))
    document.more["nodes"][1]["scale"] = [-1, 1, 1]
    scene = document.load(tmp_path)
    a, b, c = scene.vertices[scene.faces].transpose(1, 0, 2)
    np.testing.assert_array_equal(np.cross(b - a, c - a), [[0, 0, 1]] * 4)
    np.testing.assert_array_equal(scene.vertex_normals, [[0, 0, 1]] * 6)


def test_without_rests_the_joints_move_from_the_origin(tmp_path: Path) -> None:
    document = strip(WEIGHTS)
    del document.more["skins"][0]["inverseBindMatrices"]
    x, y, _ = STRIP[4:].T
    np.testing.assert_allclose(document.load(tmp_path).vertices[4:], np.stack([-y, 1 + x, 0 * x], 1), atol=1e-7)


@pytest.mark.parametrize(
    ("joints", "change", "says"),
    [
        (np.tile(np.uint8([0, 2, 0, 0]), (6, 1)), {}, "JOINTS_0: expected joints 0..1 of the skin, got others"),
        (np.zeros((6, 4), np.float32), {}, "JOINTS_0: expected joints 0..1 of the skin, got others"),
        (None, {"joints": [1, 2, 1]}, "inverseBindMatrices: expected 3, one for each joint, got 2"),
        (None, {"joints": [1, 9]}, "joints: expected an index 0..2, got '9'"),
        (None, {"inverseBindMatrices": 0}, "inverseBindMatrices: expected an accessor of MAT4, got 'VEC3'"),
    ],
)
def test_skins_that_break_the_format_are_named(tmp_path: Path, joints: Any, change: Any, says: str) -> None:
    document = strip(WEIGHTS, joints)
    document.more["skins"][0] |= change
    assert says in refusal(document, tmp_path)
    document.more["nodes"][0]["skin"] = 1
    assert "skins: expected an index 0..0, got '1'" in refusal(document, tmp_path)


# --- morph targets ----------------------------------------------------------------------------------------------------

DELTA = np.array([[0, 0, 2], [4, 0, 0], [0, -8, 0]], np.float32)


def morphed(of_mesh: Any = None, **node: Any) -> Document:
    """A triangle with two targets: one of positions and normals, and one of positions alone."""
    document = plain(NORMAL=np.tile(np.float32([0, 0, 1]), (3, 1)))
    document.primitive["targets"] = [
        {"POSITION": document.add(DELTA), "NORMAL": document.add(np.tile(np.float32([0, 2, -1]), (3, 1)))},
        {"POSITION": document.add(DELTA[::-1].copy())},
    ]
    mesh = {"primitives": [document.primitive], **({} if of_mesh is None else {"weights": of_mesh})}
    document.more = {"meshes": [mesh], "nodes": [{"mesh": 0, **node}]}
    return document


@pytest.mark.parametrize(
    ("of_mesh", "of_node"), [([0.5, 0], {}), (None, {"weights": [0.5, 0]}), ([1, 1], {"weights": [0.5, 0]})]
)
def test_targets_are_added_by_their_weights(tmp_path: Path, of_mesh: Any, of_node: Any) -> None:
    scene = morphed(of_mesh, **of_node).load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, POINTS[:3] + DELTA / 2)
    np.testing.assert_array_equal(scene.vertex_normals, [[0, 1, 0.5]] * 3)
    assert scene.notes == ()


def test_several_targets_add_up(tmp_path: Path) -> None:
    scene = morphed([0.5, -0.25]).load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, POINTS[:3] + DELTA / 2 - DELTA[::-1] / 4)


def test_targets_without_weights_are_still(tmp_path: Path) -> None:
    np.testing.assert_array_equal(morphed().load(tmp_path).vertices, POINTS[:3])


def test_targets_come_before_the_node(tmp_path: Path) -> None:
    scene = morphed([1, 0], scale=[2, 2, 2]).load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, 2 * (POINTS[:3] + DELTA))


def test_nodes_with_one_mesh_have_weights_of_their_own(tmp_path: Path) -> None:
    document = morphed([1, 0])
    shifted = {"mesh": 0, "translation": [100, 0, 0]}
    document.more["nodes"] = [{"mesh": 0, "weights": [0, 0.5]}, {"mesh": 0}, shifted]
    document.more["scenes"] = [{"nodes": [0, 1, 2]}]
    once = POINTS[:3] + DELTA
    want = [*(POINTS[:3] + DELTA[::-1] / 2), *once, *(once + [100, 0, 0])]
    np.testing.assert_array_equal(document.load(tmp_path).vertices, want)


def test_quantized_and_sparse_targets_are_read(tmp_path: Path) -> None:
    document = morphed([1, 0])
    steps = np.array([[0, 0, 127]], np.int8)
    document.accessors.append(
        {
            "componentType": 5120,
            "normalized": True,
            "count": 3,
            "type": "VEC3",
            "sparse": {
                "count": 1,
                "indices": {"bufferView": document.view(np.array([2], np.uint8).tobytes()), "componentType": 5121},
                "values": {"bufferView": document.view(steps.tobytes())},
            },
        }
    )
    document.primitive["targets"][0]["POSITION"] = len(document.accessors) - 1
    np.testing.assert_array_equal(document.load(tmp_path).vertices, POINTS[:3] + [[0, 0, 0], [0, 0, 0], [0, 0, 1]])


def test_colors_and_coordinates_are_morphed_too(tmp_path: Path) -> None:
    document = textured(png())
    document.primitive["attributes"]["COLOR_0"] = document.add(np.full((3, 4), 51, np.uint8), normalized=True)
    document.primitive["targets"] = [
        {
            "TEXCOORD_0": document.add(UV),
            "COLOR_0": document.add(np.tile(np.float32([0.4, 4, -1, 0]), (3, 1))),
        }
    ]
    document.more["meshes"] = [{"primitives": [document.primitive], "weights": [0.5]}]
    scene = document.load(tmp_path)
    np.testing.assert_allclose(scene.uv, 1.5 * UV, atol=1e-7)
    assert scene.vertex_colors is not None
    np.testing.assert_allclose(scene.vertex_colors, [[0.4, 1, 0, 0.2]] * 3, atol=1e-7)


def test_targets_of_vertices_that_are_not_used_are_not_kept(tmp_path: Path) -> None:
    points = np.arange(30, dtype=np.float32).reshape(10, 3)
    document = Document(points)
    document.primitive["indices"] = document.add(np.array([9, 2, 4], np.uint8))
    document.primitive["targets"] = [{"POSITION": document.add(points * 10)}]
    document.more["meshes"] = [{"primitives": [document.primitive], "weights": [1]}]
    scene = document.load(tmp_path)
    np.testing.assert_array_equal(scene.vertices[scene.faces[0]], points[[9, 2, 4]] * 11)


@pytest.mark.parametrize(
    ("weights", "says"),
    [(["a"], "weights: expected a finite number, got 'a'"), ([10**400], "weights: expected a finite number, got '1")],
)
def test_weights_that_are_none_are_refused(tmp_path: Path, weights: Any, says: str) -> None:
    assert says in refusal(morphed(weights), tmp_path)


def test_targets_of_another_length_are_refused(tmp_path: Path) -> None:
    document = morphed([1])
    document.primitive["targets"] = [{"POSITION": document.add(POINTS)}]
    assert "POSITION: expected 3, as there are positions, got 5" in refusal(document, tmp_path)
