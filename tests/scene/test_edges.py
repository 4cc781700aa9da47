"""Edges of faces against brute force: a dictionary of places."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import clpeel
from clpeel.scene.edges import Edges, edges_of

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
CUBE_FACES = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]]
CUBE_FACES += [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
CUBE = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1]

Found = dict[frozenset[Any], tuple[list[Any], list[int], int]]


def edges(vertices: Any, faces: Any) -> Edges:
    return edges_of(clpeel.Scene.from_arrays(np.asarray(vertices, float), faces))


def by_hand(vertices: np.ndarray, faces: np.ndarray) -> dict[frozenset[Any], list[tuple[int, Any, Any, Any]]]:
    """For each pair of places the faces there, in order: (face, from, to, across). Second skins count once."""
    found, skins = defaultdict(list), set()
    for number, face in enumerate(faces):
        corner = [tuple(float(v) + 0.0 for v in vertices[k]) for k in face]
        if len(set(corner)) < 3 or frozenset(corner) in skins:
            continue
        skins.add(frozenset(corner))
        for k in range(3):
            start, end, across = corner[k], corner[(k + 1) % 3], corner[(k + 2) % 3]
            found[frozenset((start, end))].append((number, start, end, across))
    return found


def bend_of(sides: list[tuple[int, Any, Any, Any]]) -> float:
    """The angle between normals: a half turn less the angle between the half-planes that two faces lie in."""
    if len(sides) != 2:
        return math.pi
    (_, start, end, one), (_, _, _, other) = sides
    axis = np.subtract(end, start)
    axis = axis / np.linalg.norm(axis)
    a, b = (np.subtract(apex, start) for apex in (one, other))
    a, b = a - (a @ axis) * axis, b - (b @ axis) * axis
    if not (a.any() and b.any()):
        return 0.0
    return math.pi - math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


@given(st.integers(0, 10**6), st.integers(1, 30), st.sampled_from([2, 3, 50]))
def test_edges_are_those_of_a_dictionary_of_places(seed: int, count: int, steps: int) -> None:
    """Few steps leave few places, so there are seams, second skins, folds, lines and points among the faces."""
    rng = np.random.default_rng(seed)
    vertices = rng.integers(-steps, steps + 1, (count + 3, 3)) / steps
    vertices[rng.random(vertices.shape) < 0.5] *= -1  # zeros of either sign
    faces = rng.integers(0, len(vertices), (count, 3))
    found, wanted = edges(vertices, faces), by_hand(vertices, faces)
    place = [tuple(float(v) + 0.0 for v in vertex) for vertex in vertices]
    assert len({*zip(found.places.tolist(), place, strict=True)}) == len(set(place)) == len(set(found.places.tolist()))
    numbers: dict[frozenset[Any], int] = {}
    for number, (ends, apexes, of, alike, bend) in enumerate(
        zip(found.ends, found.apexes, found.faces, found.alike, found.bend, strict=True)
    ):
        key = frozenset(place[k] for k in ends)
        assert key not in numbers
        numbers[key] = number
        sides = wanted[key]
        first, second = (*sides, None)[:2]
        assert first is not None
        assert (of[0], place[ends[0]], place[ends[1]], place[apexes[0]]) == first
        assert set(ends) | {apexes[0]} == set(faces[of[0]])
        if second is None:
            assert of[1] == -1 and apexes[1] == -1
        else:
            assert (of[1], place[apexes[1]]) == (second[0], second[3]) and apexes[1] in faces[of[1]]
            assert alike == (second[1] == first[1])
        assert abs(bend - bend_of(sides)) < 2e-6
    assert set(numbers) == {key for key, sides in wanted.items() if sides}
    for face, own in zip(faces, found.of_face, strict=True):
        corner = [place[k] for k in face]
        whole = len(set(corner)) == 3
        assert own.tolist() == [numbers[frozenset((corner[k], corner[(k + 1) % 3]))] if whole else -1 for k in range(3)]


def test_a_cube_has_twelve_features_and_six_flat_edges() -> None:
    found = edges(CUBE, CUBE_FACES)
    assert len(found.ends) == 18 and not found.alike.any()
    assert sorted(found.bend.tolist()) == pytest.approx([0] * 6 + [math.pi / 2] * 12)
    assert [int(found.features(angle).sum()) for angle in (0, 30, 89.9, 90.1, 180)] == [12, 12, 12, 0, 0]


@pytest.mark.parametrize("angle", [1e-4, 0.01, 0.5, 3.0])
@pytest.mark.parametrize("turned", [False, True])
def test_bends_are_right_however_small_and_however_faces_wind(angle: float, turned: bool) -> None:
    vertices = [[0, 0, 0], [0, 1, 0], [1, 0.3, 0], [-math.cos(angle), 0.6, math.sin(angle)]]
    found = edges(vertices, [[0, 1, 2], [0, 1, 3] if turned else [1, 0, 3]])
    (shared,) = np.flatnonzero(found.apexes[:, 1] >= 0)
    assert found.bend[shared] == pytest.approx(angle, rel=1e-6)
    assert found.alike[shared] == turned
    assert (np.delete(found.bend, shared) == np.float32(math.pi)).all()


def test_borders_and_edges_of_three_faces_are_features_at_any_angle() -> None:
    fan = edges([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert (fan.bend == np.float32(math.pi)).all() and len(fan.ends) == 7
    assert fan.features(179).all()


def test_seams_second_skins_and_minus_zero_split_no_edge() -> None:
    """A square of vertices of its own for each face, with a second skin that winds the other way."""
    vertices = np.array(SQUARE, float)[[0, 1, 2, 0, 2, 3]]
    vertices[3] *= -1.0
    assert np.signbit(vertices[3]).all()
    found = edges(vertices, [[0, 1, 2], [3, 4, 5], [0, 2, 1], [5, 4, 3]])
    assert len(found.ends) == 5 and sorted(found.bend.tolist()) == pytest.approx([0] + [math.pi] * 4)
    assert sorted(found.faces.tolist()) == sorted([[0, -1], [0, -1], [0, 1], [1, -1], [1, -1]])
    assert found.of_face[2].tolist() == found.of_face[0, ::-1].tolist() and (found.of_face >= 0).all()


@pytest.mark.parametrize("size", [1e-300, 1e-30, 1e30, 1e300])
def test_bends_of_tiny_and_huge_faces_are_right(size: float) -> None:
    found = edges(CUBE * size, CUBE_FACES)
    assert sorted(found.bend.tolist()) == pytest.approx([0] * 6 + [math.pi / 2] * 12)


def test_faces_on_a_line_have_edges_but_no_bend() -> None:
    found = edges([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], [[0, 1, 2], [1, 0, 3]])
    assert len(found.ends) == 5 and sorted(found.bend.tolist()) == pytest.approx([0] + [math.pi] * 4)


def test_vertices_that_are_no_numbers_bend_nothing() -> None:
    vertices = np.array([*SQUARE, [np.nan, 0, 0], [np.nan, 0, 0], [np.inf, 1, 0]])
    found = edges(vertices, [[0, 1, 2], [0, 2, 4], [2, 4, 3], [0, 5, 6]])
    assert np.isfinite(found.bend).all()
    assert {frozenset(each) for each in found.ends[:3].tolist()} <= {
        frozenset(each) for each in ([0, 1], [1, 2], [0, 2], [2, 4], [0, 4], [0, 5])
    }
    shared = [k for k, ends in enumerate(found.ends.tolist()) if set(ends) == {0, 2}]
    assert len(shared) == 1 and found.bend[shared[0]] == 0


@pytest.mark.parametrize("given", [{"lines": [[0, 1]]}, {"points": [0]}, {"faces": [[0, 0, 1]]}])
def test_scenes_without_faces_have_no_edges(given: dict[str, Any]) -> None:
    found = edges_of(clpeel.Scene.from_arrays(np.array(SQUARE, float), **given))
    assert len(found.ends) == len(found.faces) == len(found.bend) == 0
    assert found.of_face.shape == (len(given.get("faces", [])), 3) and (found.of_face == -1).all()
    assert found.features(0).shape == (0,) and found.places.shape == (4,)
