"""Edges of faces in pictures: they never sink in, whatever the view, the technique, the lights and the scene."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from twins import screen, strokes, wires

import clpeel
import clpeel.stages.wires as stages
from clpeel.command.main import main
from clpeel.command.options import EDGES as FLAGS
from clpeel.command.parser import parse
from clpeel.device.layout import MOST_AROUND
from clpeel.errors import InputError

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


# --- techniques, colours, lights, materials ---------------------------------------------------------------------------

TORUS = torus(9, 6)
EDGES: dict[str, Any] = {"edges": True, "silhouettes": True, "edge_color": (0.8, 0.1, 0.3), "edge_opacity": 0.6}
EXACT = ["sort", "depth-peeling", "dual-depth-peeling", "multi-layer-peeling"]


def colored(rate: str, surfaces: str, floats: bool = False, **options: Any) -> clpeel.Scene:
    """A ring in a box, with colours of the scene, of its faces, or of its vertices."""
    rng = np.random.default_rng(len(rate + surfaces))
    vertices = np.concatenate([TORUS[0], 1.2 * BOX])
    faces = np.concatenate([TORUS[1], BOX_FACES + len(TORUS[0])])
    count = {"scene": 1, "face": len(faces), "vertex": len(vertices)}[rate]
    colors = rng.integers(0, 256, (count, 4))
    ring = np.arange(count) < {"scene": 0, "face": len(TORUS[1]), "vertex": len(TORUS[0])}[rate]
    colors[:, 3] = {"opaque": 255, "transparent": 100, "mixed": np.where(ring, 255, 100)}[surfaces]
    given = (colors / 255).astype(np.float32) if floats else colors.astype(np.uint8)
    name = {"scene": "color", "face": "face_colors", "vertex": "vertex_colors"}[rate]
    return clpeel.Scene.from_arrays(vertices, faces, **{name: given[0] if rate == "scene" else given}, **options)


def pictures_of(scene: clpeel.Scene, ways: list[tuple[str, int, str]], **options: Any) -> None:
    """Holds pictures of all (technique, lanes, execution) against that of sort with one lane, bit by bit."""
    wanted = plainly.render(scene, ABOVE, SIZE, lanes=1, background=None, **options)
    bare = plainly.render(
        scene, ABOVE, SIZE, lanes=1, background=None, **{**options, "edges": False, "silhouettes": False}
    )
    assert (wanted.image != bare.image).any(axis=-1).mean() > 0.2
    for technique, lanes, execution in ways:
        got = plainly.render(
            scene, ABOVE, SIZE, technique, lanes=lanes, execution=execution, background=None, **options
        )
        np.testing.assert_array_equal(got.image, wanted.image)
        if technique == "sort":
            np.testing.assert_array_equal(got.color.view(np.uint32), wanted.color.view(np.uint32))


@pytest.mark.parametrize("surfaces", ["mixed", "transparent"])
def test_exact_techniques_draw_the_same_edges(surfaces: str) -> None:
    ways = [(technique, 1, "tiles") for technique in EXACT] + [(each, 1, "passes") for each in EXACT if each != "sort"]
    if surfaces == "mixed":
        ways += [("depth-peeling", 64, "tiles"), ("dual-depth-peeling", 64, "passes")]
    pictures_of(colored("scene" if surfaces == "transparent" else "face", surfaces), ways, **EDGES, line_width=3)


@pytest.mark.parametrize(
    ("rate", "surfaces", "floats", "lighting", "samples"),
    [
        ("scene", "opaque", False, "none", 1),
        ("face", "opaque", True, "headlight", 1),
        ("vertex", "mixed", False, "kit", 4),
        ("vertex", "transparent", True, "none", 4),
    ],
)
def test_edges_have_the_same_bits_on_any_number_of_lanes(
    rate: str, surfaces: str, floats: bool, lighting: Any, samples: Any
) -> None:
    options = {**EDGES, "lighting": lighting, "samples": samples, "line_width": "0.05u"}
    pictures_of(colored(rate, surfaces, floats), [("sort", 64, "tiles")], **options)


def test_techniques_that_are_exact_for_one_layer_are_so_with_edges() -> None:
    scene = clpeel.Scene.from_arrays(SQUARE, SQUARE_FACES, color=(*PALE, 128))
    wanted = plainly.render(scene, FLAT, SIZE, **EDGES, line_width=4).image.astype(int)
    for technique in ("weighted-average", "weighted-sum"):
        got = plainly.render(scene, FLAT, SIZE, technique, **EDGES, line_width=4).image.astype(int)
        assert np.abs(got - wanted).max() <= 1
    assert len(np.unique(wanted.reshape(-1, 4), axis=0)) > 3


def test_edges_of_a_scene_are_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other edges of the same faces are chosen among those found, and the last choice alone stays on the device."""
    found: list[clpeel.Scene] = []
    real = stages.edges_of
    monkeypatch.setattr(stages, "edges_of", lambda scene: (found.append(scene), real(scene))[1])
    renderer = plainly.Renderer(clpeel.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), lanes=1)
    for angle in (10, 20, 30):
        renderer.render(ABOVE, SIZE, feature_edges=angle)
    assert len(found) == 1 and len(renderer._edges) == 1
    again = renderer.render(ABOVE, SIZE, edges=True).image
    np.testing.assert_array_equal(again, plainly.render(renderer.scene, ABOVE, SIZE, edges=True, lanes=1).image)


def test_solids_are_measured_without_edges() -> None:
    scene = clpeel.Scene.from_arrays(BOX, BOX_FACES, color=(*PALE, 128))
    plain, got = (plainly.render(scene, ABOVE, SIZE, "thickness", **options) for options in ({}, EDGES))
    np.testing.assert_array_equal(got.thickness, plain.thickness)
    note = "edges left out: they have no inside, which thickness measures"
    assert note in got.stats.notes and note not in plain.stats.notes
    np.testing.assert_array_equal(got.image, plain.image)


def test_edges_are_drawn_on_what_textures_leave(model: Any) -> None:
    """Where a cut-out leaves nothing of a face, nothing is left of the strokes on it."""
    scene = clpeel.load(model("AlphaBlendModeTest.glb"))
    camera = clpeel.Camera.frame(scene)
    options: dict[str, Any] = {"lighting": "none", "background": None}
    bare = plainly.render(scene, camera, SIZE, **options).color
    options |= {"edges": True, "edge_color": "red", "line_width": 2}
    got = plainly.render(scene, camera, SIZE, **options)
    changed = (got.color != bare).any(axis=-1)
    assert 0.05 < changed.mean() < 0.9
    whole = changed & (got.color[..., 3] == 1) & (got.color[..., 1:3] == 0).all(axis=-1)
    assert whole.sum() > 50 and (got.color[whole][:, 0] == 1).all()
    np.testing.assert_array_equal(plainly.render(scene, camera, SIZE, "depth-peeling", **options).image, got.image)


@pytest.mark.parametrize("hide", ["backface_type", "single_sided"])
def test_faces_that_are_not_seen_from_behind_have_no_edges_there(hide: str) -> None:
    given: dict[str, Any] = {"color": (*PALE, 255)}
    if hide == "single_sided":
        given |= {"single_sided": np.ones(2, bool)}
    options: dict[str, Any] = {**EDGES, "background": None, "line_width": 4}
    if hide == "backface_type":
        options["backface_type"] = "hidden"
    square = clpeel.Scene.from_arrays(SQUARE, SQUARE_FACES, **given)
    behind = clpeel.Camera((0, 0, -5), (0, 0, 0), orthographic=True)
    assert plainly.render(square, behind, SIZE, **options).color.max() == 0
    front = plainly.render(square, FLAT, SIZE, **options).color
    assert (front[..., 3] > 0).sum() > (plainly.render(square, FLAT, SIZE, background=None).color[..., 3] > 0).sum()
    # Of an opaque body nothing is missed that is behind.
    vertices, faces = body(5)
    given["single_sided"] = np.full(len(faces), hide == "single_sided")
    del given["color"]
    one, two = (
        plainly.render(clpeel.Scene.from_arrays(vertices, faces, **each), ABOVE, SIZE, **more).image
        for each, more in ((given, options), ({}, {**options, "backface_type": "visible"}))
    )
    np.testing.assert_array_equal(one, two)


def test_a_second_skin_has_no_bands_of_its_own() -> None:
    """A mesh with each face twice, once for either side, has the outlines that it has with each face once."""
    vertices, faces = body(5)
    scenes = [
        clpeel.Scene.from_arrays(vertices, each, color=PALE)
        for each in (faces, np.concatenate([faces, faces[:, ::-1]]))
    ]
    one, two = (
        plainly.render(scene, clpeel.Camera((0, 0, 4), (0, 0, 0)), SIZE, silhouettes=True, line_width=3).image
        for scene in scenes
    )
    np.testing.assert_array_equal(one, two)
    assert (one == [0, 0, 0, 255]).all(axis=-1).sum() > 50


# --- hidden edges -----------------------------------------------------------------------------------------------------


def behind_a_sheet(opacity: int = 255) -> clpeel.Scene:
    """A small box, of which the lower half lies behind a sheet, in its colour."""
    sheet = np.array([[-2, -2, 2], [2, -2, 2], [2, 0, 2], [-2, 0, 2]])
    vertices, faces = np.concatenate([0.7 * BOX, sheet]), [*BOX_FACES, [8, 9, 10], [8, 10, 11]]
    colors = [[*PALE, opacity]] * 12 + [[40, 90, 160, opacity]] * 2
    return clpeel.Scene.from_arrays(vertices, faces, face_colors=np.array(colors, np.uint8))


def test_hidden_edges_shine_through_with_an_opacity_of_their_own() -> None:
    """Behind the sheet, each side of the box is blended like a layer of strokes alone. In front, nothing changes."""
    camera = clpeel.Camera((0.3, 0.2, 6), (0, 0, 0), (0, 1, 0), 40.0)
    options: dict[str, Any] = {"feature_edges": 30.0, "edge_color": "red", "line_width": 3}
    plain = draw(behind_a_sheet(), camera, **options)
    got = draw(behind_a_sheet(), camera, **options, hidden_edges=0.3)
    corners = 0.7 * BOX[BOX_FACES]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward *= np.sign((outward * corners[:, 0]).sum(axis=1))[:, None]
    front = (outward * towards(corners[:, 0], camera)).sum(axis=1) > 0
    on_screen = screen.screen(0.7 * BOX, camera, SIZE)
    x, y = strokes.grid(SIZE)
    wanted = plain
    for side in (~front, front):
        ends = wires.edges(BOX_FACES[side])
        ends = ends[(BOX[ends[:, 0]] != BOX[ends[:, 1]]).sum(axis=1) == 1]  # not the diagonals
        share = np.max([wires.covered(on_screen[each], strokes_half(3, camera), x, y) for each in ends], axis=0)
        within = wires.inside(on_screen[BOX_FACES[side]][:, :, :2], x, y).max(axis=0) > 0
        wanted = wires.over(0.3 * share * within, (1, 0, 0), wanted)
    sheet = screen.screen(np.array([[-2, -2, 2], [2, 0, 2]]), camera, SIZE)
    behind = (y > sheet[1, 1] + 1024) & (y < sheet[0, 1] - 1024) & (x > sheet[0, 0] + 1024) & (x < sheet[1, 0] - 1024)
    distance = wires.inside(on_screen[BOX_FACES][:, :, :2], x, y).max(axis=0)
    assert ((wanted != plain).any(axis=-1) & behind & (distance > 1)).sum() > 50
    assert np.abs(got - wanted)[behind & (distance > 1)].max() < 2e-3
    # Beside the box its bands are one layer, as wide as half of the stroke.
    beside = behind & (distance < -1)
    ends = wires.edges(BOX_FACES)
    share = np.max([wires.covered(on_screen[each], strokes_half(3, camera), x, y) for each in ends], axis=0)
    band = wires.over(0.3 * share, (1, 0, 0), plain)
    assert (share[beside] > 0).sum() > 20 and np.abs(got - band)[beside].max() < 2e-3
    in_front = (plain[..., :3] == [1, 0, 0]).all(axis=-1)
    assert in_front.sum() > 20
    np.testing.assert_array_equal(got[in_front], plain[in_front])


def draw(scene: clpeel.Scene, camera: clpeel.Camera, **options: Any) -> np.ndarray:
    """The colours, premultiplied, without a background."""
    return plainly.render(scene, camera, SIZE, background=None, **options).color.astype(float)


def test_hidden_edges_change_no_scene_without_opaque_surfaces() -> None:
    scene = behind_a_sheet(128)
    plain, got = (draw(scene, ABOVE, **EDGES, hidden_edges=share) for share in (0.0, 0.5))
    np.testing.assert_array_equal(got, plain)
    opaque = behind_a_sheet()
    plain, got = (draw(opaque, ABOVE, **EDGES, opaque="blend", hidden_edges=share) for share in (0.0, 0.5))
    np.testing.assert_array_equal(got, plain)


def test_hidden_edges_are_the_same_by_technique_and_by_what_is_kept() -> None:
    scene = colored("face", "mixed")
    options: dict[str, Any] = {**EDGES, "hidden_edges": 0.4, "line_width": 3}
    for background in (None, (1.0, 0.9, 0.2)):
        wanted = plainly.render(scene, ABOVE, SIZE, background=background, **options)
        without = plainly.render(scene, ABOVE, SIZE, background=background, **{**options, "hidden_edges": 0})
        assert (wanted.image != without.image).any(axis=-1).mean() > 0.02
        for technique, lanes, keep in (("sort", 1, False), ("depth-peeling", 1, True), ("sort", 64, True)):
            got = plainly.render(
                scene, ABOVE, SIZE, technique, background=background, lanes=lanes, keep_color=keep, **options
            )
            np.testing.assert_array_equal(got.image, wanted.image)


# --- layers, stats, and a renderer that is used again -----------------------------------------------------------------


def test_layers_number_bands_with_a_face_of_their_edge(lanes: int) -> None:
    """A band beside a face has the number of that face."""
    vertices = np.array([[-1.6, -1, 0], [-0.4, -1, 0], [-1, 1, 0], [0.4, -1, 0], [1.6, -1, 0], [1, 1, 0]])
    scene = clpeel.Scene.from_arrays(vertices, [[0, 1, 2], [3, 4, 5]], color=(*PALE, 128))
    result = plainly.render(scene, FLAT, SIZE, layers=True, edges=True, line_width=4, lanes=lanes)
    found = result.layers
    assert found is not None and result.stats.triangles == 2
    pixel = np.repeat(np.arange(SIZE[0] * SIZE[1]), np.diff(found.start))
    assert set(found.triangle.tolist()) == {0, 1}
    assert ((pixel % SIZE[0] < SIZE[0] // 2) == (found.triangle == 0)).all()
    on_screen = screen.screen(vertices, FLAT, SIZE)[:, :2].reshape(2, 3, 2)
    within = (wires.inside(on_screen, *strokes.grid(SIZE)).max(axis=0) > 0).reshape(-1)
    beside = ~within[pixel]
    assert beside.sum() > 100 and (found.color[beside & (found.color[:, 3] == 1)][:, :3] == 0).all()


def test_a_renderer_draws_edges_then_none_then_others() -> None:
    scene = colored("face", "mixed")
    renderer = plainly.Renderer(scene, lanes=1)
    options: list[dict[str, Any]] = [
        {},
        {"edges": True},
        {},
        {"feature_edges": 40.0},
        {"silhouettes": True, "hidden_edges": 0.3},
        {"edges": True, "edge_color": "red", "line_width": 4},
        {"edges": True},
        {"lighting": "headlight", "edges": True},
    ]
    for each in options:
        wanted, got = plainly.render(scene, ABOVE, SIZE, lanes=1, **each), renderer.render(ABOVE, SIZE, **each)
        np.testing.assert_array_equal(got.image, wanted.image)
        assert got.stats.triangles == len(scene.faces)
    renderer.set_opacity(0.4)
    faded = renderer.render(ABOVE, SIZE, edges=True, line_width=4, background=None).color
    assert ((faded[..., 3] == 1) & (faded[..., :3] == 0).all(axis=-1)).sum() > 100  # edges are as they were
    assert faded[..., 3][faded[..., 3] > 0].min() < 0.7


def test_edges_count_as_memory() -> None:
    vertices, faces = torus(60, 40)
    scene = clpeel.Scene.from_arrays(vertices, faces, color=(*PALE, 128))
    plain, got = (plainly.render(scene, ABOVE, SIZE, edges=each).stats for each in (False, True))
    edge_count = 3 * len(faces) // 2
    # Each has 4 vertices, a kind and a face, 2 places in lists of faces, and 2 in those of vertices.
    least = edge_count * (16 + 1 + 4 + 8 + 8) + 4 * (2 * len(vertices) + len(faces) + 2)
    assert got.bytes["edges"] == least and "edges" not in plain.bytes
    small = plainly.render(scene, ABOVE, SIZE, edges=True, memory="1M").image
    np.testing.assert_array_equal(small, plainly.render(scene, ABOVE, SIZE, edges=True).image)


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"edges": "yes"}, "edges: expected"),
        ({"feature_edges": -1}, "feature_edges: expected degrees, 0..180, got -1"),
        ({"feature_edges": 181}, "feature_edges: expected degrees, 0..180, got 181"),
        ({"feature_edges": float("nan")}, "feature_edges: expected degrees, 0..180, got nan"),
        ({"feature_edges": "wide"}, "feature_edges: expected"),
        ({"feature_edges": True}, "feature_edges: expected degrees, 0..180, got True"),
        ({"silhouettes": 2}, "silhouettes: expected"),
        ({"edge_color": "no colour"}, "edge_color: expected"),
        ({"edge_color": (1, 2)}, "edge_color: expected"),
        ({"edge_opacity": 1.5}, "edge_opacity: expected"),
        ({"edge_opacity": None}, "edge_opacity: expected"),
        ({"hidden_edges": -0.1}, "hidden_edges: expected"),
    ],
)
def test_wrong_values_are_refused_in_one_line(options: dict[str, Any], says: str) -> None:
    scene = clpeel.Scene.from_arrays(SQUARE, SQUARE_FACES)
    with pytest.raises(InputError) as error:
        plainly.render(scene, size=(8, 8), **options)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_flags_of_edges_do_what_the_options_do(squares: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.png"
    flags = "--edges --feature-edges 30 --silhouettes --edge-color red --edge-opacity .5 --hidden-edges .2".split()
    call = ["render", str(squares), "-o", str(out), "--resolution", "64,48", "--lighting", "none", "--no-background"]
    assert main([*call, "--samples", "1", *flags]) == 0
    scene = clpeel.load(squares)
    options: dict[str, Any] = {"edges": True, "feature_edges": 30, "silhouettes": True, "edge_color": "red"}
    options |= {"edge_opacity": 0.5, "hidden_edges": 0.2, "background": None, "lighting": "none"}
    wanted = plainly.render(scene, clpeel.Camera.frame(scene), SIZE, **options).image
    np.testing.assert_array_equal(np.asarray(Image.open(out).convert("RGBA")), wanted)
    assert (wanted[..., 0] > wanted[..., 1] + 60).sum() > 100
    viewed = parse(["view", str(squares), *flags])
    assert all(getattr(viewed, name) == options[name] for name in FLAGS if name != "edge_color")
