"""Vertex normals: against a twin that compares every two faces, and on shapes whose normals are known."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.normals import distinct, with_normals
from clpeel.scene.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
MODELS = Path(os.environ.get("CLPEEL_SHARED", ROOT.parent / "shared")) / "models"


def twin(scene: Scene, crease_angle: float) -> np.ndarray:
    """float64 [m, 3, 3]: each corner's normal, its face compared with every one at its position; NaN for no area."""
    corners = scene.vertices[scene.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(area, axis=1)
    with np.errstate(invalid="ignore"):
        unit = area / length[:, None]
    result = np.full(corners.shape, np.nan)
    for face, corner in np.argwhere(length[:, None] * np.ones(3) > 0):
        total = np.zeros(3)
        for other in np.flatnonzero((corners == corners[face, corner]).all(axis=2).any(axis=1) & (length > 0)):
            cosine = unit[face] @ unit[other]
            if abs(cosine) >= np.cos(np.radians(crease_angle)) - 1e-5:
                total += area[other] * (1 if cosine >= 0 else -1)
        result[face, corner] = total / np.linalg.norm(total)
    return result


def check(scene: Scene, got: Scene) -> np.ndarray:
    """What always holds: same triangles, colours and order, unit normals; returns the corners' normals [m, 3, 3]."""
    assert got.vertex_normals is not None and got.vertex_normals.dtype == np.float32
    assert got.vertex_normals.shape == got.vertices.shape
    np.testing.assert_allclose(np.linalg.norm(got.vertex_normals.astype(np.float64), axis=1), 1, atol=1e-6)
    assert got.faces.dtype == np.int32 and got.faces.shape == scene.faces.shape
    np.testing.assert_array_equal(got.vertices[got.faces], scene.vertices[scene.faces])
    assert got.face_colors is scene.face_colors and got.color is scene.color
    if scene.vertex_colors is not None:
        assert got.vertex_colors is not None and got.vertex_colors.dtype == scene.vertex_colors.dtype
        np.testing.assert_array_equal(got.vertex_colors[got.faces], scene.vertex_colors[scene.faces])
    return got.vertex_normals[got.faces].astype(np.float64)


def shape(name: str, **options: Any) -> Scene:
    """A shape of trimesh's."""
    return load(getattr(pytest.importorskip("trimesh").creation, name)(**options))


def soup(scene: Scene) -> Scene:
    """The scene as an STL file has it: every face with vertices of its own."""
    return Scene.from_arrays(scene.vertices[scene.faces].reshape(-1, 3), np.arange(scene.faces.size).reshape(-1, 3))


def turned(scene: Scene, seed: int) -> Scene:
    """The scene with about half its faces wound the other way."""
    faces = scene.faces.copy()
    flip = np.random.default_rng(seed).random(len(faces)) < 0.5
    faces[flip] = faces[flip, ::-1]
    return Scene.from_arrays(scene.vertices, faces)


def face_normals(scene: Scene) -> np.ndarray:
    """float64 [m, 3], unit."""
    a, b, c = scene.vertices[scene.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


FORMS: list[Callable[[Scene], Scene]] = [lambda scene: scene, soup, lambda scene: turned(scene, 1)]
as_form = pytest.mark.parametrize("form", FORMS, ids=["indexed", "soup", "mixed winding"])


@as_form
def test_a_box_is_flat(form: Callable[[Scene], Scene]) -> None:
    scene = form(shape("box", extents=(1, 2, 3)))
    got = with_normals(scene)
    want = np.repeat(face_normals(scene)[:, None], 3, axis=1)
    np.testing.assert_allclose(check(scene, got), want, atol=1e-6)


def test_a_box_gets_four_vertices_a_side() -> None:
    got = with_normals(shape("box"))
    assert len(got.vertices) == 24


@as_form
def test_a_sphere_is_smooth(form: Callable[[Scene], Scene]) -> None:
    ball = shape("icosphere", subdivisions=3, radius=2.0)
    scene = form(ball)
    got = check(scene, with_normals(scene))
    radial = scene.vertices[scene.faces] / 2
    side = np.sign((face_normals(scene)[:, None] * radial).sum(axis=2))
    np.testing.assert_allclose(got * side[:, :, None], radial, atol=0.02)
    if form is FORMS[0]:
        assert len(with_normals(scene).vertices) == len(scene.vertices), "split although smooth"


@as_form
def test_a_cylinder_has_a_smooth_side_and_sharp_caps(form: Callable[[Scene], Scene]) -> None:
    scene = form(shape("cylinder", radius=1.0, height=2.0, sections=64))
    got = check(scene, with_normals(scene))
    flat = face_normals(scene)
    cap = np.abs(flat[:, 2]) > 0.5
    np.testing.assert_allclose(got[cap], np.repeat(flat[cap][:, None], 3, axis=1), atol=1e-6)
    radial = scene.vertices[scene.faces[~cap]] * [1, 1, 0]
    side = np.sign((flat[~cap][:, None] * radial).sum(axis=2))
    np.testing.assert_allclose(got[~cap] * side[:, :, None], radial, atol=0.02)


def test_the_crease_angle_decides() -> None:
    prism = shape("cylinder", radius=1.0, height=2.0, sections=12)  # 30 degrees from side to side
    flat = np.repeat(face_normals(prism)[:, None], 3, axis=1)
    at, below = check(prism, with_normals(prism, 30)), check(prism, with_normals(prism, 29))
    sides = np.abs(flat[:, 0, 2]) < 0.5
    assert ((at * flat).sum(axis=2)[sides] < 0.99).all(), "30 degrees are within 30"
    np.testing.assert_allclose(below, flat, atol=1e-6)


@pytest.mark.parametrize("angle", [-1, 180.5, float("nan"), float("inf")])
def test_bad_angles_are_refused(angle: float) -> None:
    with pytest.raises(InputError, match="crease_angle: expected 0..180 degrees, got "):
        with_normals(shape("box"), angle)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 15.0, 30.0, 60.0, 90.0]), st.integers(4, 9))
def test_random_soups_match_the_twin(seed: int, angle: float, count: int) -> None:
    """Few positions, so that many faces meet, in unequal indices, windings and creases; no angle at the limit."""
    rng = np.random.default_rng(seed)
    vertices = rng.integers(-3, 4, size=(count, 3)).astype(np.float64) * [1, 1, 0.125]
    faces = rng.integers(0, count, size=(24, 3))
    scene = Scene.from_arrays(vertices, faces, vertex_colors=rng.integers(0, 256, (count, 4)).astype(np.uint8))
    area = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    unit = area[np.linalg.norm(area, axis=1) > 0]
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    cosines = np.abs(unit @ unit.T)
    if (np.abs(cosines - np.cos(np.radians(angle))) < 1e-4)[cosines < 1 - 1e-9].any() or (cosines < 1e-9).any():
        return  # a right angle has no side to be on, and a limit none to be decided
    got, want = check(scene, with_normals(scene, angle)), twin(scene, angle)
    known = ~np.isnan(want)
    np.testing.assert_allclose(got[known], want[known], atol=1e-5)


@pytest.mark.parametrize("size", [1e30, 1e-30, 1e150, 1e-150, 1e300, 1e-300])
def test_any_size(size: float) -> None:
    scene = shape("icosphere", subdivisions=2)
    scaled = Scene.from_arrays(scene.vertices * size, scene.faces)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        got = with_normals(scaled)
    np.testing.assert_allclose(check(scaled, got), check(scene, with_normals(scene)), atol=1e-6)


def test_a_tiny_part_beside_a_huge_one() -> None:
    box = shape("box")
    vertices = np.concatenate([box.vertices * 1e40, box.vertices * 1e-60])
    scene = Scene.from_arrays(vertices, np.concatenate([box.faces, box.faces + len(box.vertices)]))
    got = check(scene, with_normals(scene))
    np.testing.assert_allclose(got, np.tile(np.repeat(face_normals(box)[:, None], 3, axis=1), (2, 1, 1)), atol=1e-6)


def test_far_from_the_origin() -> None:
    box = shape("box", extents=(1e-3, 2e-3, 1e-3))
    scene = Scene.from_arrays(box.vertices + 1e6, box.faces)
    flat = np.repeat(face_normals(box)[:, None], 3, axis=1)
    np.testing.assert_allclose(check(scene, with_normals(scene)), flat, atol=1e-5)


NAN, INF = float("nan"), float("inf")


def test_faces_without_a_normal_do_no_harm() -> None:
    box = shape("box")
    n = len(box.vertices)
    vertices = np.concatenate([box.vertices, [[NAN, 0, 0], [INF, 0, 0], [0, -INF, NAN], [7, 7, 7]]])
    bad = [[0, 0, 1], [0, 1, 1], [2, 2, 2], [0, 1, n], [1, 2, n + 1], [n, n + 1, n + 2]]
    scene = Scene.from_arrays(vertices, np.concatenate([box.faces, bad]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        got = check(scene, with_normals(scene))
    np.testing.assert_allclose(got[: len(box.faces)], np.repeat(face_normals(box)[:, None], 3, axis=1), atol=1e-6)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1.0, 1e300, NAN, INF]))
def test_vertices_that_no_face_uses_change_nothing(seed: int, size: float) -> None:
    """Not the last ones, nor those between, nor ones so far away that the faces beside them would vanish."""
    rng = np.random.default_rng(seed)
    vertices, faces = rng.normal(size=(9, 3)), rng.integers(0, 9, (12, 3))
    colors = rng.integers(0, 256, (9, 4)).astype(np.uint8)
    alone = Scene.from_arrays(vertices, faces, vertex_colors=colors)
    at = np.sort(rng.integers(0, 10, 5))  # an unused vertex is put before these
    among = Scene.from_arrays(
        np.insert(vertices, at, rng.normal(size=(5, 3)) * size, axis=0),
        np.searchsorted(at, np.arange(9), side="right")[faces] + faces,
        vertex_colors=np.insert(colors, at, 0, axis=0),
    )
    want, got = check(alone, with_normals(alone)), check(among, with_normals(among))
    np.testing.assert_array_equal(got, want)


@pytest.mark.parametrize("vertices", [np.zeros((3, 3)), np.full((3, 3), NAN), np.full((3, 3), INF), -np.zeros((3, 3))])
def test_nothing_but_bad_faces(vertices: np.ndarray) -> None:
    scene = Scene.from_arrays(vertices, [[0, 1, 2]])
    assert (check(scene, with_normals(scene)) == [0, 0, 1]).all()


def test_minus_zero_is_zero() -> None:
    """Two triangles in one plane that share an edge in -0.0 and 0.0, and a third below it."""
    vertices = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0.2], [-0.0, -0.0, -0.0], [-0.0, 1, 0], [-1, 0, 0.2]])
    scene = Scene.from_arrays(vertices, [[0, 2, 1], [3, 4, 5]])
    got = check(scene, with_normals(scene, 60))
    np.testing.assert_allclose(got[0, 0], got[1, 0], atol=1e-6)


def test_given_normals_are_kept() -> None:
    """Those of a ball, each tilted by up to a third of a right angle, which leaves it in front of its faces."""
    ball = shape("icosphere", subdivisions=1)
    rng = np.random.default_rng(0)
    given_normals = (ball.vertices + rng.uniform(-0.25, 0.25, ball.vertices.shape)).astype(np.float32)
    scene = Scene.from_arrays(ball.vertices, ball.faces, vertex_normals=given_normals * 1e30)
    got = with_normals(scene)
    assert got.vertices is scene.vertices and got.faces is scene.faces
    np.testing.assert_allclose(
        got.vertex_normals, given_normals / np.linalg.norm(given_normals, axis=1)[:, None], atol=1e-6
    )


def sided(scene: Scene, normals: np.ndarray) -> np.ndarray:
    """float64 [m, 3, 3]: the normal of each corner, turned if it lies on the back of the face. An obvious loop."""
    found = normals[scene.faces].astype(np.float64)
    for face, corner in np.ndindex(scene.faces.shape):
        if found[face, corner] @ face_normals(scene)[face] < 0:
            found[face, corner] *= -1
    return found


def test_given_normals_on_the_back_of_a_face_are_turned_there() -> None:
    """Lights ask on which side of its face a normal lies."""
    ball = shape("icosphere", subdivisions=1)
    normals = ball.vertices.astype(np.float32)
    inward = Scene.from_arrays(ball.vertices, ball.faces, vertex_normals=-normals)
    got = check(inward, with_normals(inward))
    np.testing.assert_allclose(got, ball.vertices[ball.faces], atol=1e-6)
    assert len(with_normals(inward).vertices) == len(ball.vertices), "all faces at a vertex agree, so none is split"
    mixed = turned(ball, 3)
    mixed = Scene.from_arrays(mixed.vertices, mixed.faces, vertex_normals=normals, vertex_colors=np.abs(normals) / 2)
    np.testing.assert_allclose(check(mixed, with_normals(mixed)), sided(mixed, normals), atol=1e-6)
    random = np.random.default_rng(4).normal(size=normals.shape).astype(np.float32)
    random /= np.linalg.norm(random, axis=1)[:, None]
    random = np.where(np.arange(len(random))[:, None] % 3 == 0, 0, random)  # of these, none is given
    some = Scene.from_arrays(ball.vertices, ball.faces, vertex_normals=random)
    got = check(some, with_normals(some))
    here = random.any(axis=1)[some.faces]
    np.testing.assert_allclose(got[here], sided(some, random)[here], atol=1e-6)
    computed = with_normals(replace(some, vertex_normals=None))
    assert computed.vertex_normals is not None
    np.testing.assert_allclose(got[~here], computed.vertex_normals[computed.faces][~here], atol=1e-6)


def test_a_face_without_an_area_has_no_back() -> None:
    scene = Scene.from_arrays([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], vertex_normals=[[0, 0, -1.0]] * 3)
    assert (check(scene, with_normals(scene)) == [0, 0, -1]).all()


def test_only_missing_normals_are_computed() -> None:
    box = shape("box")
    given_normals = np.tile(np.array([0.6, 0.8, 0], np.float32), (len(box.vertices), 1))
    given_normals[0], given_normals[1], given_normals[2] = 0, NAN, INF
    scene = Scene.from_arrays(box.vertices, box.faces, vertex_normals=given_normals)
    got = check(scene, with_normals(scene))
    flat = np.repeat(face_normals(box)[:, None], 3, axis=1)
    missing = scene.faces < 3
    np.testing.assert_allclose(got[missing], flat[missing], atol=1e-6)
    kept = np.where((flat @ [0.6, 0.8, 0] < 0)[..., None], -1.0, 1.0) * [0.6, 0.8, 0]
    np.testing.assert_allclose(got[~missing], kept[~missing], atol=1e-6)
    assert given_normals[0].any() == np.False_, "the caller's array was changed"


@as_form
@pytest.mark.parametrize("count", [200, 300, 20_000])
def test_crowded_tips_are_bounded_and_near(count: int, form: Callable[[Scene], Scene]) -> None:
    """Two cones of so many faces: at the tips, every normal is within the crease angle of its own face's."""
    angle = np.arange(count) / count * 2 * np.pi
    cone = np.vstack([[0, 0, 1], np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)])
    faces = np.array([[0, k + 1, (k + 1) % count + 1] for k in range(count)])
    scene = form(Scene.from_arrays(np.concatenate([cone, cone * 2 + 5]), np.concatenate([faces, faces + len(cone)])))
    got = check(scene, with_normals(scene))
    assert ((got * face_normals(scene)[:, None]).sum(axis=2) > np.cos(np.radians(30))).all()


def test_the_order_of_faces_does_not_matter() -> None:
    scene = shape("capsule", radius=0.5, height=1.0, count=[8, 8])
    order = np.random.default_rng(3).permutation(len(scene.faces))
    shuffled = Scene.from_arrays(scene.vertices, scene.faces[order])
    np.testing.assert_allclose(
        check(shuffled, with_normals(shuffled)), check(scene, with_normals(scene))[order], atol=1e-6
    )


def test_distinct_columns_are_told_apart_even_where_their_keys_are_equal() -> None:
    keys = []
    for first in (1.0, 2.0):
        key = np.uint64(np.float64(first).view(np.uint64)) * np.array(0x9E3779B97F4A7C15, np.uint64)
        keys.append(key ^ (key >> np.uint64(32)))
    last = (keys[0] ^ keys[1]).reshape(1).view(np.float64)[0]  # takes the second key to the first
    columns = np.array([[1.0, 2.0, 1.0], [0.0, last, 0.0]])
    first_of, kind = distinct(columns)
    assert kind[0] == kind[2] != kind[1] and len(first_of) == 2
    np.testing.assert_array_equal(columns[:, first_of[kind]].view(np.uint64), columns.view(np.uint64))


def test_the_dragon() -> None:
    path = MODELS / "dragon_vrip.ply.gz"
    if not path.is_file():
        pytest.skip(f"needs the model {path.name} in a folder models below CLPEEL_SHARED (now {MODELS.parent})")
    scene = load(path)
    got = with_normals(scene)
    assert len(got.vertices) < 1.2 * len(scene.vertices)
    check(scene, got)
