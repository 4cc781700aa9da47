"""A coarser scene: within its number of triangles, and near the scene that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import clpeel
from clpeel.viewer.coarse import coarse_scene


def ball(rows: int = 60, **colors: object) -> clpeel.Scene:
    """A sphere of 2 rows^2 triangles or so."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, rows, endpoint=False), indexing="ij"
    )
    points = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], -1).reshape(
        -1, 3
    )
    i, j = np.mgrid[0 : rows - 1, 0:rows]
    a, b = i * rows + j, i * rows + (j + 1) % rows
    faces = np.concatenate([np.stack([a, a + rows, b], -1), np.stack([b, a + rows, b + rows], -1)]).reshape(-1, 3)
    return clpeel.Scene.from_arrays(points, faces, **colors)  # type: ignore[arg-type]


@given(triangles=st.integers(100, 6000))
def test_it_has_at_most_so_many_triangles_and_each_is_near_the_ball(triangles: int) -> None:
    coarse = coarse_scene(ball(), triangles)
    assert 0 < len(coarse.faces) <= triangles
    corners = np.linalg.norm(coarse.vertices[coarse.faces], axis=-1)
    assert corners.max() <= 1 + 1e-12
    cells = np.sqrt(
        triangles / 40
    )  # a ball of c cells across has at most about 4 pi (c / 2)^2 of them, twice the faces
    assert corners.min() >= 1 - 2 * np.sqrt(3) / max(cells, 1)


def test_it_uses_what_it_may() -> None:
    scene = ball(200)
    for triangles in (1000, 5000, 20000):
        assert len(coarse_scene(scene, triangles).faces) > 0.6 * triangles


def test_faces_keep_their_colours() -> None:
    scene = ball()
    colors = np.zeros((len(scene.faces), 4), np.uint8)
    middle = scene.vertices[scene.faces].mean(axis=1)
    colors[:, 0], colors[:, 3] = np.where(middle[:, 1] > 0, 255, 0), 100
    coarse = coarse_scene(ball(face_colors=colors), 800)
    assert coarse.face_colors is not None and coarse.surfaces == "transparent"
    high = coarse.vertices[coarse.faces].mean(axis=1)[:, 1]
    assert (coarse.face_colors[high > 0.2, 0] == 255).all() and (coarse.face_colors[high < -0.2, 0] == 0).all()


def test_vertices_keep_their_colours() -> None:
    points = ball().vertices
    colors = np.ones((len(points), 4), np.float32)
    colors[:, 1] = points[:, 0] > 0
    coarse = coarse_scene(ball(vertex_colors=colors), 800)
    assert coarse.vertex_colors is not None
    used = np.unique(coarse.faces)
    for side, green in ((1, 1), (-1, 0)):
        assert (coarse.vertex_colors[used][side * coarse.vertices[used, 0] > 0.2, 1] == green).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_corners_that_are_no_numbers_pull_nothing(bad: float) -> None:
    scene = ball()
    points = scene.vertices.copy()
    points[7] = bad
    coarse = coarse_scene(clpeel.Scene.from_arrays(points, scene.faces), 800)
    assert np.isfinite(coarse.vertices).all() and np.abs(coarse.vertices).max() <= 1 + 1e-12


def test_the_same_scene_each_time() -> None:
    one, two = (coarse_scene(ball(), 700) for _ in range(2))
    assert (one.vertices == two.vertices).all() and (one.faces == two.faces).all()


def test_a_scene_in_one_point_stays_itself() -> None:
    scene = clpeel.Scene.from_arrays(np.zeros((3, 3)), [[0, 1, 2]])
    assert coarse_scene(scene, 10) is scene
