"""Edges of faces in pictures: they never sink in, whatever the view, the technique, the lights and the scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import screen, strokes, wires

import clpeel
from clpeel.device.layout import MOST_AROUND

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (64, 48)
ABOVE = clpeel.Camera((1.5, -4, 2), (0, 0, 0), (0, 0, 1), 40.0)
FLAT = clpeel.Camera((0, 0, 5), (0, 0, 0), orthographic=True)
PALE = (200, 220, 255)
RED = (255, 0, 0)
SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
SQUARE_FACES = [[0, 1, 2], [0, 2, 3]]


def body(seed: int, count: int = 14) -> tuple[np.ndarray, np.ndarray]:
    """The convex hull of points of a unit ball's surface."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points, wires.hull(points)


def torus(n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """A ring of n times m quadrilaterals."""
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = i * 2 * np.pi / n, j * 2 * np.pi / m
    radius = 1 + 0.4 * np.cos(b)
    vertices = np.stack([radius * np.cos(a), radius * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)
    p, q, r, s = ((i + x) % n * m + (j + y) % m for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return vertices, np.stack([p, q, r, p, r, s], axis=-1).reshape(-1, 3)


# --- a wire over its own surface never flickers or sinks in -----------------------------------------------------------


def around(rng: np.random.Generator, nearest: float) -> clpeel.Camera:
    """A camera that looks at a body from any side, and from near to a thousand times its size."""
    eye, distance = rng.normal(size=3), float(np.exp(rng.uniform(math.log(nearest), math.log(2000))))
    eye *= distance / np.linalg.norm(eye)
    parallel = bool(rng.random() < 0.5)
    return clpeel.Camera(tuple(eye), (0, 0, 0), tuple(rng.normal(size=3)), 40.0, orthographic=parallel)


def towards(places: np.ndarray, camera: clpeel.Camera) -> np.ndarray:
    """The directions to the eye, of length 1."""
    to = np.asarray(camera.position) - (0 * places if camera.orthographic else places)
    return to / np.linalg.norm(to, axis=1)[:, None]


def hidden(places: np.ndarray, corners: np.ndarray, camera: clpeel.Camera) -> np.ndarray:
    """Which places lie behind triangles [m, 3, 3] (Moeller and Trumbore)."""
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    found = []
    for place, to in zip(places, towards(places, camera), strict=True):
        across = np.cross(to, c)
        scale = (b * across).sum(axis=1)
        scale[scale == 0] = 1e-300
        u, turn = ((place - a) * across).sum(axis=1) / scale, np.cross(place - a, b)
        v, t = turn @ to / scale, (c * turn).sum(axis=1) / scale
        found.append(bool(((np.minimum(np.minimum(u, v), 1 - u - v) > -1e-9) & (t > 1e-6)).any()))
    return np.array(found, bool)


def colors_at_edges(vertices: np.ndarray, faces: np.ndarray, camera: clpeel.Camera, convex: bool) -> np.ndarray:
    """What is drawn at the middles of all edges that are in view: edges with a face that faces the eye by a margin.

    Within 0.75 pixels of an edge of 2.5 pixels it covers all of a pixel, and a pixel's centre is within 0.7072 of all
    its places.
    """
    scene = clpeel.Scene.from_arrays(vertices, faces, color=PALE)
    image = plainly.render(scene, camera, SIZE, edges=True, edge_color="red", line_width=2.5).image
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = (normal * towards(corners[:, 0], camera)).sum(axis=1) / np.linalg.norm(normal, axis=1)
    ends = wires.edges(faces[facing > 0.05])
    middles = screen.screen(vertices, camera, SIZE)[:, :2][ends].mean(axis=1)
    if not convex:
        middles = middles[~hidden(vertices[ends].mean(axis=1), corners, camera)]
    column, row = (np.floor(middles / 256) + np.array(SIZE) // 2).astype(int).T
    seen = (column >= 0) & (column < SIZE[0]) & (row >= 0) & (row < SIZE[1])
    return image[row[seen], column[seen], :3]


@given(seed=st.integers(0, 10**6), count=st.integers(4, 20))
def test_all_edges_of_convex_bodies_are_in_view_at_any_distance(seed: int, count: int) -> None:
    for each in range(seed, seed + 5):
        found = colors_at_edges(*body(each, count), around(np.random.default_rng(each), 1.6), convex=True)
        assert (found == RED).all() and len(found)


@given(seed=st.integers(0, 10**6), n=st.integers(4, 20), m=st.integers(3, 12))
def test_all_edges_of_rings_are_in_view_unless_the_ring_hides_them(seed: int, n: int, m: int) -> None:
    found = colors_at_edges(*torus(n, m), around(np.random.default_rng(seed), 2.5), convex=False)
    assert (found == RED).all() and len(found)


@pytest.mark.parametrize("distance", [8.0, 60.0, 900.0])
def test_where_faces_are_smaller_than_pixels_all_is_of_the_edges_colour(distance: float) -> None:
    vertices, faces = torus(160, 90)
    camera = clpeel.Camera((0.3 * distance, -0.2 * distance, 0.9 * distance), (0, 0, 0), (0, 1, 0), 40.0)
    scene = clpeel.Scene.from_arrays(vertices, faces, color=PALE)
    bare = plainly.render(scene, camera, SIZE).image
    image = plainly.render(scene, camera, SIZE, edges=True, edge_color="red", line_width=2.5).image
    ring = (bare[..., :3] != 255).any(axis=-1)
    assert (image[ring][:, :3] == RED).all()
    column, row = (np.floor(screen.screen(vertices, camera, SIZE)[:, :2].T / 256)).astype(int)
    assert (image[row + SIZE[1] // 2, column + SIZE[0] // 2, :3] == RED).all()


# --- edges that are cut, or are none ----------------------------------------------------------------------------------


def check_on_both(scene: clpeel.Scene, camera: clpeel.Camera, **options: Any) -> np.ndarray:
    """The colours, which are the same for one lane and for 64."""
    one, many = (
        plainly.render(scene, camera, SIZE, background=None, lanes=lanes, **options).color for lanes in (1, 64)
    )
    np.testing.assert_array_equal(one.view(np.uint32), many.view(np.uint32))
    assert np.isfinite(one).all() and one.min() >= 0 and one.max() <= 1
    return one.astype(float)


BOX = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), axis=-1).reshape(-1, 3) * 1.0
BOX_FACES = np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]])
BOX_FACES = np.concatenate([BOX_FACES, [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]])


@pytest.mark.parametrize("width", [2.5, "0.2u"])
@pytest.mark.parametrize("parallel", [False, True])
def test_edges_around_the_eye_are_cut_by_the_near_plane(width: float | str, parallel: bool) -> None:
    """In a box whose edges are drawn. Its walls fill the picture, but for what the near plane takes."""
    near, far = 0.3, 9.0
    camera = clpeel.Camera((0.31, -0.2, 0.1), (-1, 0.1, -0.3), (0.1, 0.2, 1), 70.0, (near, far), orthographic=parallel)
    scene = clpeel.Scene.from_arrays(BOX, BOX_FACES, color=PALE)
    got = check_on_both(scene, camera, edges=True, edge_color="red", line_width=width)
    half = strokes_half(width, camera)
    corners = BOX[BOX_FACES]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward *= np.sign((outward * corners[:, 0]).sum(axis=1))[:, None]
    behind = (outward * towards(corners[:, 0], camera)).sum(axis=1) < 0  # seen from within
    found = wires.segments(BOX, wires.edges(BOX_FACES[behind]), camera, SIZE, near, far)
    share = np.max([wires.covered(each, half, *strokes.grid(SIZE)) for each in found], axis=0)
    wanted = wires.over(share, (1, 0, 0), np.array([*np.array(PALE) / 255, 1]))
    within = sight_begins_within(camera, near)
    assert within.mean() > 0.4 and share[within].max() > 0.99
    assert np.abs(got - wanted)[within].max() < 2e-3


def strokes_half(width: float | str, camera: clpeel.Camera) -> Any:
    """Half a width in subpixels, as a function of the view distance."""
    if not isinstance(width, str):
        return lambda distance: width / 2 * 256
    half = float(width.removesuffix("u")) / 2 * 256 * SIZE[1] / 2 / math.tan(math.radians(camera.view_angle) / 2)
    return lambda distance: half / (camera.distance if camera.orthographic else distance)


def sight_begins_within(camera: clpeel.Camera, near: float) -> np.ndarray:
    """Whether what is seen of each pixel begins within the box: where it passes the near plane, and a pixel around."""
    right, up, forward = camera.axes()
    half = math.tan(math.radians(camera.view_angle) / 2) * (camera.distance if camera.orthographic else near)
    x, y = (each / 256 / (SIZE[1] / 2) * half for each in strokes.grid(SIZE))
    start = np.asarray(camera.position) + near * forward + x[..., None] * right - y[..., None] * up
    return np.abs(start).max(axis=-1) < 1 - 2 * half / (SIZE[1] / 2)


def test_edges_that_reach_far_beyond_the_picture() -> None:
    """Their ends are up to 1e9 pixels away, and some behind the eye."""
    far = 1e8
    vertices = np.array([[-far, -far / 3, 0], [far, far / 3, 0.0], [0.2, far, -far], [0.1, -0.3, far / 9]])
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0, (0.5, 2 * far))
    scene = clpeel.Scene.from_arrays(vertices, [[0, 1, 2], [0, 1, 3]], color=(*PALE, 128))
    got = check_on_both(scene, camera, edges=True, edge_color="red", edge_opacity=0.5, line_width=5)
    distance = wires.nearest(
        wires.segments(vertices, np.array([[0, 1]]), camera, SIZE, 0.5, far)[0], *strokes.grid(SIZE)
    )
    on = distance[0] < 2.0 * 256 - 2
    assert on.sum() > 100 and (got[on][:, 3] > 0.49).all() and (got[on][:, 0] > got[on][:, 2]).all()


def test_what_is_not_finite_has_no_edges() -> None:
    """A face with such a corner is not drawn, and neither are the two of its edges that end there."""
    vertices = np.concatenate([SQUARE, [[np.nan, 0, 0], [np.inf, 3, 0], [0, 0, -np.inf]]])
    faces = [*SQUARE_FACES, [0, 1, 4], [1, 2, 5], [4, 5, 6]]
    options: dict[str, Any] = {"edges": True, "edge_opacity": 0.5, "silhouettes": True, "line_width": 4}
    got = check_on_both(clpeel.Scene.from_arrays(vertices, faces, color=(*PALE, 128)), FLAT, **options)
    wanted = check_on_both(clpeel.Scene.from_arrays(SQUARE, SQUARE_FACES, color=(*PALE, 128)), FLAT, **options)
    np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize("kind", ["edges", "feature_edges", "silhouettes"])
def test_scenes_of_next_to_nothing(kind: str) -> None:
    options: dict[str, Any] = {kind: 10.0 if kind == "feature_edges" else True, "line_width": 3}
    bare: dict[str, Any] = {"lines": [[0, 1]], "color": (*PALE, 128)}
    lines = clpeel.Scene.from_arrays(SQUARE, **bare)
    np.testing.assert_array_equal(check_on_both(lines, FLAT, **options), check_on_both(lines, FLAT, line_width=3))
    pointed = clpeel.Scene.from_arrays(SQUARE, [[0, 0, 1], [2, 2, 2]], **bare)
    np.testing.assert_array_equal(check_on_both(pointed, FLAT, **options), check_on_both(lines, FLAT, line_width=3))
    one = clpeel.Scene.from_arrays(SQUARE[:3], [[0, 1, 2]], color=(*PALE, 128))
    got = check_on_both(one, FLAT, **options)
    assert ((got[..., 3] == 1) & (got[..., :3] == 0).all(axis=-1)).sum() > 60  # black edges
    assert check_on_both(one, clpeel.Camera((0, 0, 5), (0, 0, 9)), **options).max() == 0  # behind the eye


@pytest.mark.parametrize("count", [MOST_AROUND - 2, 3000])
def test_fans_of_many_faces_around_one_vertex(count: int) -> None:
    """A cone whose spokes are features by turns. Its rim and its spokes are drawn wherever they are in view."""
    angle = np.arange(count) * 2 * np.pi / count
    rim = np.stack([np.cos(angle), np.sin(angle), 0.2 * (np.arange(count) % 2)], axis=1)
    vertices = np.concatenate([[[0, 0, 0.5]], rim])
    faces = np.stack([np.zeros(count, int), np.arange(count) + 1, (np.arange(count) + 1) % count + 1], axis=1)
    scene = clpeel.Scene.from_arrays(vertices, faces, color=(*PALE, 255))
    got = check_on_both(scene, FLAT, feature_edges=0.0, edge_color="red", line_width=2.5)
    column, row = (np.floor(screen.screen(rim * 0.999, FLAT, SIZE)[:, :2].T / 256)).astype(int)
    np.testing.assert_array_equal(got[row + SIZE[1] // 2, column + SIZE[0] // 2], [[1, 0, 0, 1]] * count)
    np.testing.assert_array_equal(got[SIZE[1] // 2 - 1 : SIZE[1] // 2 + 1, 31:33], np.full((2, 2, 4), [1, 0, 0, 1]))
