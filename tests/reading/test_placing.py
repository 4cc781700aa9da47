"""Scenes moved by a matrix, and with other sides: beside the same arrays moved by hand."""

from __future__ import annotations

import numpy as np
import pytest

import clpeel
from clpeel.errors import InputError
from clpeel.reading.placing import moved_scene, sided
from clpeel.scene.lights import AmbientLight, DirectionalLight, PointLight, SpotLight

TURN = ((0.0, -2.0, 0.0, 5.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, -1.0), (0.0, 0.0, 0.0, 1.0))
"""A quarter turn about Z, twice as large along X, then moved."""


def scene(**fields: object) -> clpeel.Scene:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], float)
    return clpeel.Scene.from_arrays(corners, [[0, 1, 2], [1, 3, 2]], **fields)  # type: ignore[arg-type]


def test_vertices_and_normals_move() -> None:
    normals = np.array([[0, 0, 1], [1, 1, 0], [0, 2, 0], [np.nan] * 3])
    found = moved_scene(scene(vertex_normals=normals), TURN)
    x, y, z = scene().vertices.T
    np.testing.assert_array_equal(found.vertices, np.stack([5 - 2 * y, x, z - 1], axis=1))
    want = normals @ np.linalg.inv(np.array(TURN)[:3, :3])  # rows times the inverse are columns times its transpose
    got = found.vertex_normals
    assert got is not None and np.isnan(got[3]).all()
    cosines = (got[:3] * want[:3]).sum(axis=1) / np.linalg.norm(got[:3], axis=1) / np.linalg.norm(want[:3], axis=1)
    np.testing.assert_allclose(cosines, 1, atol=1e-6)
    np.testing.assert_array_equal(found.faces, scene().faces)


def test_where_it_mirrors_fronts_stay_fronts() -> None:
    mirror = np.diag([-1.0, 1, 1, 1])
    found = moved_scene(scene(vertex_normals=[[0, 0, 1]] * 4), mirror.tolist())
    a, b, c = found.vertices[found.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert found.vertex_normals is not None and found.vertex_normals[0].tolist() == [0, 0, 1]


def test_lights_move_with_their_mesh() -> None:
    lights = (
        AmbientLight(up=(1, 0, 0)),
        DirectionalLight(direction=(1, 0, 0)),
        DirectionalLight(direction=(1, 0, 0), follows_camera=True),
        PointLight(position=(1, 0, 0)),
        SpotLight(position=(0, 1, 0), direction=(0, 1, 0)),
    )
    assert moved_scene(scene(lights=lights), TURN).lights == (
        AmbientLight(up=(0, 1, 0)),
        DirectionalLight(direction=(0, 1, 0)),
        lights[2],
        PointLight(position=(5, 1, -1)),
        SpotLight(position=(3, 0, -1), direction=(-2, 0, 0)),
    )


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((4, 4)),
        np.eye(3),
        np.diag([1, 1, 0, 1]),
        np.diag([0, 0, 0, 1]),
        np.diag([1, 1, np.nan, 1]),
        np.ones((4, 4)),
    ],
)
def test_what_flattens_or_is_none_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(InputError, match="^matrix: expected"):
        moved_scene(scene(), matrix.tolist())


def test_sides() -> None:
    given = scene(single_sided=[True, False])
    assert sided(given, None) is given and sided(given, "default") is given
    assert sided(given, "visible").single_sided is None
    hidden = sided(given, "hidden").single_sided
    assert hidden is not None and hidden.all()
