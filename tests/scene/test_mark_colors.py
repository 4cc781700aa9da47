"""Colours of lines and points beside face colours: a row for each, behind those of the faces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.materials import Material
from clpeel.scene.scene import Scene, faces_alone, joined, recolored, with_vertex_colors, without_faces
from clpeel.viewer.coarse import coarse_scene

PLACES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
RED, GREEN, BLUE, GREY = [255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 255], [9, 9, 9, 60]
DEFAULT = list(DEFAULT_COLOR)


def mixed(**options: Any) -> Scene:
    """Two faces, a line, and a point, each with its colour."""
    faces = Scene.from_arrays(PLACES, [[0, 1, 2], [0, 1, 3]], [RED, GREEN], **options)
    return joined(
        [
            faces,
            Scene.from_arrays(PLACES[:2], lines=[[0, 1]], color=BLUE),
            Scene.from_arrays(PLACES[3:], points=[0], color=GREY),
        ]
    )


def rows(scene: Scene) -> list[list[int]]:
    assert scene.face_colors is not None
    return [list(row) for row in scene.face_colors.tolist()]


def test_joining_keeps_every_colour_and_every_vertex() -> None:
    found = mixed()
    assert rows(found) == [RED, GREEN, BLUE, GREY] and len(found.vertices) == 7
    assert found.kinds.opaque.tolist() == [True, False] and found.opaque_marks.tolist() == [True, False]
    assert found.surfaces == "mixed"
    twice = joined([found, Scene.from_arrays(PLACES, [[1, 2, 3]], color=GREY), found])
    assert rows(twice) == [RED, GREEN, GREY, RED, GREEN, BLUE, BLUE, GREY, GREY]
    assert twice.counts == (5, 2, 2)


def test_from_arrays_gives_them_the_default() -> None:
    found = Scene.from_arrays(PLACES, [[0, 1, 2]], [RED], lines=[[0, 1], [1, 2]], points=[3])
    assert rows(found) == [RED, DEFAULT, DEFAULT, DEFAULT] and len(found.vertices) == 4
    with pytest.raises(InputError, match=r"^face_colors: expected \[1, 3 or 4\]"):
        Scene.from_arrays(PLACES, [[0, 1, 2]], [RED, RED], lines=[[0, 1]])


def test_vertex_colours_look_the_same() -> None:
    found = with_vertex_colors(mixed())
    assert found.vertex_colors is not None and found.lines is not None and found.points is not None
    assert found.vertex_colors[found.faces].tolist() == [[RED] * 3, [GREEN] * 3]
    assert found.vertex_colors[found.lines].tolist() == [[BLUE] * 2]
    assert found.vertex_colors[found.points].tolist() == [GREY]
    beside = joined([mixed(), Scene.from_arrays(PLACES[:3], [[0, 1, 2]], vertex_colors=[GREEN] * 3)])
    assert beside.vertex_colors is not None and beside.lines is not None
    assert beside.vertex_colors[beside.lines].tolist() == [[BLUE] * 2]


def test_rows_follow_faces_that_go() -> None:
    assert rows(without_faces(mixed(), np.array([0]))) == [GREEN, BLUE, GREY]
    assert rows(faces_alone(mixed())) == [RED, GREEN]


def test_colours_and_opacities_reach_them() -> None:
    assert rows(recolored(mixed(), np.array([1, 2, 3], np.uint8), None)) == [
        [1, 2, 3, 255],
        [1, 2, 3, 128],
        [1, 2, 3, 255],
        [1, 2, 3, 60],
    ]
    assert [row[3] for row in rows(recolored(mixed(), None, 0.2))] == [51] * 4
    material = Material(base_color=(1, 0, 0, 1))
    found = recolored(mixed(materials=[material], face_materials=[0, -1]), np.array([1, 2, 3, 4], np.uint8), None)
    assert rows(found) == [RED, [1, 2, 3, 4], [1, 2, 3, 4], [1, 2, 3, 4]] and found.materials != (material,)
    alone = recolored(mixed(materials=[material]), None, 0.2)
    assert [row[3] for row in rows(alone)] == [255, 128, 51, 51]


@pytest.mark.parametrize("materials", [False, True])
def test_optical_depths_count_them(materials: bool) -> None:
    options = {"materials": [Material()], "face_materials": [-1, -1]} if materials else {}
    found = mixed(**options).optical_depths
    depths = -np.log1p(-np.array([128, 60]) / 255)
    assert abs(found.mean - depths.mean()) < 1e-12 and found.most_alpha == 128 / 255
    glass = Material(base_color=(1, 1, 1, 0.25), alpha_mode="BLEND")
    seen = mixed(materials=[glass]).optical_depths
    wanted = -np.log1p(-np.array([0.25, 0.25, 60 / 255]))  # a material counts with the scene's greatest alpha
    assert abs(seen.mean - wanted.mean()) < 1e-6


def test_the_coarser_scene_keeps_them() -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(-1, 1, (900, 3))
    colors = rng.integers(0, 256, (350, 4), dtype=np.uint8)
    faces = np.arange(900).reshape(-1, 3)
    lines = np.array([[k, k + 1] for k in range(50)])
    scene = replace(Scene.from_arrays(places, faces), color=None, face_colors=colors, lines=lines.astype(np.int32))
    coarse = coarse_scene(scene, 100)
    assert coarse.face_colors is not None and coarse.lines is not None
    assert len(coarse.face_colors) == len(coarse.faces) + len(coarse.lines) and len(coarse.lines) > 10
    known = {tuple(row) for row in colors[300:].tolist()}
    kept = [tuple(row) for row in coarse.face_colors[len(coarse.faces) :].tolist()]
    assert set(kept) <= known and len(set(kept)) == len(kept)
