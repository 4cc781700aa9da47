"""Tangents: against a loop over faces, and on surfaces where it is plain along which way u grows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.scene.materials import Finish, Material
from clpeel.scene.scene import Scene
from clpeel.scene.tangents import tangents_of
from clpeel.scene.textures import Texture

TEXTURE = Texture(np.full((1, 1, 4), 255, np.uint8))
SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], np.float64)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def bumpy(number: int = 0) -> Material:
    """A material whose normal texture lies by the coordinates of this number."""
    return Material(finish=Finish(normal_texture=TEXTURE, normal_uv=number))


def scene(uv: Any, vertices: Any = SQUARE, faces: Any = FACES, **more: Any) -> Scene:
    """A scene with these coordinates, whose one material has a normal texture."""
    return Scene.from_arrays(vertices, faces, uv=uv, **({"materials": [bumpy()]} | more))


def twin(found: Scene) -> np.ndarray:
    """float64 [n, 3]: at each vertex the faces' directions in which u grows and v does not, weighted by their areas."""
    assert found.uv is not None and found.face_materials is not None
    sums = np.zeros(found.vertices.shape)
    for face, number in zip(found.faces, found.face_materials, strict=True):
        finish = found.materials[number].finish if number >= 0 else None
        if finish is None or finish.normal_texture is None:
            continue
        uv = (found.uv, *found.more_uv)[finish.normal_uv].astype(np.float64)[face]
        corners = found.vertices[face]
        edges, grown = corners[1:] - corners[0], uv[1:] - uv[0]
        if np.linalg.det(grown) == 0 or not np.isfinite(corners).all():
            continue
        # The direction that is d of the edges, where d is 1 in u and 0 in v: grown^T d = (1, 0).
        direction = np.linalg.solve(grown.T, [1.0, 0.0]) @ edges
        area = np.linalg.norm(np.cross(edges[0], edges[1]))
        if area > 0:
            sums[face] += direction / np.linalg.norm(direction) * area
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(length > 0, sums / np.where(length > 0, length, 1), [1.0, 0, 0])


def turned(degrees: float, mirrored: bool = False) -> np.ndarray:
    """Coordinates of the square whose u grows along the direction of this angle from x; v grows to its right or left.

    u = along . p and v = across . p, so u grows along `along` where v stays.
    """
    a = math.radians(degrees)
    along, across = np.array([math.cos(a), math.sin(a)]), np.array([-math.sin(a), math.cos(a)])
    return np.stack([SQUARE[:, :2] @ along, SQUARE[:, :2] @ across * (1 if mirrored else -1)], axis=1)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("degrees", [0, 30, 90, 180, 270])
def test_tangents_point_along_u(degrees: float, mirrored: bool) -> None:
    found = tangents_of(scene(turned(degrees, mirrored)))
    assert found.dtype == np.float32 and found.shape == (4, 3)
    a = math.radians(degrees)
    np.testing.assert_allclose(found, np.tile([math.cos(a), math.sin(a), 0], (4, 1)), atol=1e-6)
    np.testing.assert_allclose(found, twin(scene(turned(degrees, mirrored))), atol=1e-6)


def test_the_winding_of_faces_does_not_matter() -> None:
    other = scene(turned(30), faces=FACES[:, ::-1])
    np.testing.assert_allclose(tangents_of(other), tangents_of(scene(turned(30))), atol=1e-7)


def test_sheared_coordinates_have_the_direction_along_which_v_stays() -> None:
    """u = x, v = x + y: v stays where y falls as x grows."""
    uv = np.stack([SQUARE[:, 0], SQUARE[:, 0] + SQUARE[:, 1]], axis=1)
    np.testing.assert_allclose(tangents_of(scene(uv)), np.tile([math.sqrt(0.5), -math.sqrt(0.5), 0], (4, 1)), atol=1e-6)


@given(st.integers(0, 10**6), st.sampled_from([1e-6, 1.0, 1e6]))
def test_tangents_are_those_of_the_loop(seed: int, size: float) -> None:
    """Faces share vertices; materials have different coordinates, or no normal texture; some faces have no material."""
    rng = np.random.default_rng(seed)
    vertices, faces = rng.normal(size=(8, 3)) * size, rng.permuted(np.tile(np.arange(8), (9, 1)), axis=1)[:, :3]
    materials = [bumpy(), Material(), bumpy(2), bumpy(1)]
    sets = [np.round(rng.uniform(-4, 4, (8, 2)) * 4) / 4 for _ in range(3)]  # some faces have no area on the texture
    found = Scene.from_arrays(
        vertices,
        faces,
        uv=sets[0],
        more_uv=sets[1:],
        materials=materials,
        face_materials=rng.integers(-1, 4, 9),
    )
    np.testing.assert_allclose(tangents_of(found), twin(found), atol=2e-6)


def test_large_faces_count_for_more() -> None:
    vertices = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 1, 0], [0, 0, 1.0]])
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 0], [0, 1]])
    found = tangents_of(scene(uv, vertices, [[0, 1, 2], [0, 3, 4]]))
    np.testing.assert_allclose(found[0], np.array([16, 1, 0]) / math.sqrt(257), atol=1e-6)


@pytest.mark.parametrize("uv", [np.zeros((4, 2)), np.full((4, 2), 1e30), [[0, 0], [1, 1], [2, 2], [3, 3]]])
def test_where_nothing_tells_it_is_x(uv: Any) -> None:
    assert tangents_of(scene(uv)).tolist() == [[1, 0, 0]] * 4


def test_what_has_no_area_or_no_place_tells_nothing() -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [np.nan, 0, 0], [0, 2, 0], [0, 0, 2], [9, 9, 9]])
    uv = np.array([[0, 0], [1, 0], [0, 1], [0, 0], [1, 0], [0, 1], [5, 5]])
    found = tangents_of(scene(uv, vertices, [[0, 1, 2], [3, 4, 5], [0, 4, 5]]))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[[1, 2, 3, 6]], np.tile([1, 0, 0], (4, 1)), atol=1e-7)
    np.testing.assert_allclose(found[[0, 4, 5]], np.tile([0, 1, 0], (3, 1)), atol=1e-7)


def test_tangents_that_cancel_out_are_x() -> None:
    """Two faces that are mirrored in u at their edge."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]])
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 0]])
    found = tangents_of(scene(uv, vertices, [[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(found, [[1, 0, 0], [1, 0, 0], [1, 0, 0], [-1, 0, 0]], atol=1e-7)
