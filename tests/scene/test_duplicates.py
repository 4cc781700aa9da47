"""Duplicate faces are found exactly, noted at load, and dropped on demand with what belongs to them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import clpeel.scene.duplicates
from clpeel.reading.load import load
from clpeel.scene.duplicates import duplicates
from clpeel.scene.scene import Scene

VALUES = st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, float("inf"), float("nan")])
POINTS = hnp.arrays(np.float64, st.tuples(st.integers(1, 8), st.just(3)), elements=VALUES)


def by_hand(vertices: np.ndarray, faces: np.ndarray, single_sided: np.ndarray | None = None) -> list[int]:
    """Duplicates by comparing sorted tuples of corners; in tuples of new floats NaN equals nothing.

    The corners of single-sided faces are turned until the least is first, and so keep their winding.
    """
    seen: list[list[tuple[float, ...]]] = []
    repeats = []
    for index, face in enumerate(faces):
        given = [tuple(float(x) + 0.0 for x in vertices[corner]) for corner in face]
        if np.isnan(given).any():
            continue
        corners = sorted(given)
        if single_sided is not None and single_sided[index]:
            corners = [(), *min(given[first:] + given[:first] for first in range(3))]
        if corners in seen:
            repeats.append(index)
        seen.append(corners)
    return repeats


@given(POINTS, st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_duplicates_are_those_found_by_hand(vertices: np.ndarray, seed: int, count: int) -> None:
    faces = np.random.default_rng(seed).integers(0, len(vertices), (count, 3), dtype=np.int32)
    assert duplicates(vertices, faces).tolist() == by_hand(vertices, faces)


@given(POINTS, st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_single_sided_faces_back_to_back_are_no_duplicates(vertices: np.ndarray, seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    faces = rng.integers(0, len(vertices), (count, 3), dtype=np.int32)
    for sides in (rng.integers(0, 2, count) == 1, np.ones(count, bool), np.zeros(count, bool)):
        assert duplicates(vertices, faces, sides).tolist() == by_hand(vertices, faces, sides)


@given(POINTS, st.integers(0, 2**32 - 1))
def test_hashes_that_collide_change_nothing(vertices: np.ndarray, seed: int) -> None:
    faces = np.random.default_rng(seed).integers(0, len(vertices), (20, 3), dtype=np.int32)
    with pytest.MonkeyPatch.context() as patch:  # the corners' order must come from something, so only sums collide
        patch.setattr(clpeel.scene.duplicates, "_sums", lambda corners, faces: np.zeros(len(faces), corners.dtype))
        assert duplicates(vertices, faces).tolist() == by_hand(vertices, faces)


def test_mirrored_points_have_hashes_of_their_own() -> None:
    """Symmetric meshes have many: where their hashes were equal, all their faces would be compared one with another."""
    rng = np.random.default_rng(8)
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    points = (rng.uniform(0.1, 1, (50, 1, 3)) * signs).reshape(-1, 3)
    turned = np.concatenate([points[:, [0, 1, 2]], points[:, [1, 2, 0]], points[:, [2, 0, 1]]])
    assert len(np.unique(clpeel.scene.duplicates._hashes(turned))) == len(turned) == 1200


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]], dtype=np.float64)
FACES = np.array([[0, 1, 2], [1, 3, 2], [2, 0, 4], [3, 2, 1], [0, 1, 3]])


def test_load_notes_duplicates_and_from_arrays_does_not() -> None:
    source = Scene.from_arrays(SQUARE, FACES)
    assert source.notes == ()
    scene = load(source)
    assert len(scene.faces) == 5 and len(scene.notes) == 1
    assert scene.notes[0].startswith("duplicate faces: 2 of 5 ") and "--drop-duplicates" in scene.notes[0]
    assert "--coincident paper" in scene.notes[0] and "twice as opaque" in scene.notes[0]


def test_a_note_of_duplicates_is_not_told_twice() -> None:
    scene = load(load(Scene.from_arrays(SQUARE, FACES)), Scene.from_arrays(SQUARE + 5, FACES[:2]))
    assert [note[:26] for note in scene.notes] == ["duplicate faces: 2 of 7 li"]


def test_dropping_keeps_the_first_of_each_with_its_color() -> None:
    colors = np.arange(20, dtype=np.uint8).reshape(5, 4)
    scene = load(Scene.from_arrays(SQUARE, FACES, colors), drop_duplicates=True)
    assert scene.faces.tolist() == [[0, 1, 2], [1, 3, 2], [0, 1, 3]]
    assert scene.face_colors is not None and scene.face_colors.tolist() == colors[[0, 1, 4]].tolist()
    assert scene.notes == ("duplicate faces: 2 of 5 dropped",) and len(scene.vertices) == 5


def test_vertex_colors_stay_when_duplicates_are_dropped() -> None:
    colors = np.arange(20, dtype=np.uint8).reshape(5, 4)
    scene = load(Scene.from_arrays(SQUARE, FACES, vertex_colors=colors), drop_duplicates=True)
    np.testing.assert_array_equal(scene.vertex_colors, colors)


def test_duplicates_of_the_chair(model: Callable[[str], Path]) -> None:
    path = model("chair_model.obj")
    whole, thin = load(path), load(path, drop_duplicates=True)
    assert any(note.startswith("duplicate faces: 6,382 of 12,756") for note in whole.notes)
    kept = {tuple(sorted(map(tuple, corners))) for corners in whole.vertices[whole.faces].tolist()}
    assert len(thin.faces) == len(kept) == 12756 - 6382
