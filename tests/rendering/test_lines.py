"""Lines and points in pictures: joints, techniques, lights, sizes, and what is left out."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import lights as twin
from twins import screen, strokes
from twins.textures import to_linear as linear
from twins.textures import to_srgb as srgb

import clpeel
from clpeel.errors import InputError
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.demo import demo_scene
from clpeel.scene.lights import DirectionalLight, PointLight
from clpeel.scene.materials import Finish, Material
from clpeel.scene.textures import Texture
from clpeel.stages import outlines
from clpeel.stages.shading import MATT

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (120, 90)
FLAT = clpeel.Camera((0, 0, 5), (0, 0, 0), orthographic=True)
ABOVE = clpeel.Camera((1.5, -4, 2), (0, 0, 0), (0, 0, 1), 40.0)
TILTED = clpeel.Camera((0.5, -2, 4.5), (0, 0, 0), (0, 1, 0), 30.0)
HALF = (200, 30, 40, 128)


def polyline(points: np.ndarray, shared: bool = True, **options: Any) -> clpeel.Scene:
    """A polyline: its segments share vertices, or have vertices of their own at the same places."""
    places = np.arange(len(points))
    lines = np.stack([places[:-1], places[1:]], axis=1)
    if not shared:
        points, lines = points[lines].reshape(-1, 3), np.arange(lines.size).reshape(-1, 2)
    return clpeel.Scene.from_arrays(points, lines=lines, color=HALF, **options)


def counts(scene: clpeel.Scene, camera: clpeel.Camera, lanes: int, **options: Any) -> np.ndarray:
    """How many layers each sample has."""
    found = plainly.render(scene, camera, SIZE, lanes=lanes, layers=True, **options).layers
    assert found is not None
    return np.diff(found.start).reshape(SIZE[1], SIZE[0])


def spiral(count: int) -> np.ndarray:
    angle = np.linspace(0, 4 * np.pi, count)
    radius = 0.25 + angle / (4 * np.pi)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.05 * np.sin(3 * angle)], axis=1)


ZIGZAG = np.array(
    [[-1.2, -0.6, 0], [-0.7, 0.6, 0.2], [-0.2, -0.5, -0.3], [0.4, 0.2, 0], [0.6, -0.6, 0], [1.3, 0.5, 0.0]]
)
BENT = np.array([[-1.2, 0.3, 0], [-0.4, 0.2, 0], [-0.1, 0.5, 0.3], [0.5, 0.5001, 0.1], [1.2, -0.6, 0]])


@pytest.mark.parametrize("camera", [FLAT, TILTED], ids=["flat", "tilted"])
@pytest.mark.parametrize("width", [1.0, 3.3, 6.0])
@pytest.mark.parametrize("name", ["spiral", "fine", "zigzag", "bent"])
def test_joints_cover_each_pixel_once(name: str, width: float, camera: clpeel.Camera, lanes: int) -> None:
    points = {"spiral": spiral(60), "fine": spiral(2000), "zigzag": ZIGZAG, "bent": BENT}[name]
    found = counts(polyline(points), camera, lanes, line_width=width)
    corners = screen.screen(points, camera, SIZE)[:, :2]
    distance = strokes.to_polyline(corners, SIZE)
    half = width / 2 * 256
    first, last = corners[0], corners[-1]
    x, y = strokes.grid(SIZE)
    at_an_end = np.minimum(np.hypot(x - first[0], y - first[1]), np.hypot(x - last[0], y - last[1])) < half + 1
    # Between the segments of a curve, chords are at most half * (1 - cos(turn / 2)) nearer than the mitres.
    within = (distance < half - strokes.SNAPPED) & ~at_an_end
    assert (found[within] == 1).all() and within.sum() > 30
    assert found.max() == 1
    assert (found[distance > 4 * half + 2] == 0).all()


@pytest.mark.parametrize("width", [2.0, 30.0])
@given(seed=st.integers(0, 10**6))
def test_lines_of_any_shape_leave_no_gap(width: float, seed: int) -> None:
    """Where they turn back or within less than their width they may cover pixels twice, but none is missing."""
    points = np.random.default_rng(seed).uniform(-0.7, 0.7, (6, 3))
    found = counts(polyline(points), FLAT, 1, line_width=width)
    corners = screen.screen(points, FLAT, SIZE)[:, :2]
    half = width / 2 * 256
    for a, b in zip(corners[:-1], corners[1:], strict=True):
        # The straight part of each segment: what is nearest to its inner half, away from the mitres.
        length = np.hypot(*(b - a))
        if length < 4 * half:
            continue
        x, y = strokes.grid(SIZE)
        along = ((x - a[0]) * (b - a)[0] + (y - a[1]) * (b - a)[1]) / length
        across = np.abs((y - a[1]) * (b - a)[0] - (x - a[0]) * (b - a)[1]) / length
        inner = (along > length / 2 - half / 4) & (along < length / 2 + half / 4) & (across < half - 1)
        assert (found[inner] >= 1).all()


def test_segments_meet_where_their_ends_are_at_one_place(lanes: int) -> None:
    pictures = [
        plainly.render(polyline(spiral(40), shared), TILTED, SIZE, lanes=lanes, line_width=5).image
        for shared in (True, False)
    ]
    np.testing.assert_array_equal(*pictures)
    assert len(np.unique(pictures[0].reshape(-1, 4), axis=0)) == 2  # each pixel is blended once, or not at all


def test_three_segments_at_one_place_end_there() -> None:
    star = np.array([[0, 0, 0], [1, 0, 0], [-0.5, 0.8, 0], [-0.5, -0.8, 0]])
    scene = clpeel.Scene.from_arrays(star, lines=[[0, 1], [0, 2], [3, 0]], color=HALF)
    found = outlines.outlines_of(scene, outlines.SQUARE, np.ones(4, bool))
    assert (
        found is not None
        and found.ends == 2
        and found.lines.tolist() == [[-1, 0, 1, -1], [-1, 0, 2, -1], [-1, 3, 0, -1]]
    )


def mixed(seed: int, count: int = 12) -> clpeel.Scene:
    """Triangles, lines, polylines and points, transparent and opaque, with colours of their vertices."""
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (6 * count, 3))
    colors = rng.integers(0, 256, (6 * count, 4)).astype(np.uint8)
    colors[rng.random(6 * count) < 0.3, 3] = 255
    places = np.arange(6 * count)
    chain = np.stack([places[3 * count : -1], places[3 * count + 1 :]], axis=1)
    return clpeel.Scene.from_arrays(
        vertices,
        places[: 3 * count].reshape(-1, 3),
        lines=np.concatenate([places[: 2 * count].reshape(-1, 2), chain]),
        points=places[: 4 * count],
        vertex_colors=colors,
    )


EXACT = ["sort", "depth-peeling", "dual-depth-peeling", "multi-layer-peeling"]


@pytest.mark.parametrize("lighting", ["none", "headlight", "kit"])
def test_exact_techniques_draw_the_same_picture(lighting: Any) -> None:
    scene = mixed(5)
    options: dict[str, Any] = {"line_width": 4, "point_size": 9, "lighting": lighting}
    wanted = plainly.render(scene, ABOVE, SIZE, lanes=1, **options)
    assert wanted.stats.layers_max > 3 and wanted.stats.opaque_samples > 100
    for technique in EXACT if lighting == "none" else EXACT[:2]:  # lights are done with before fragments are sorted
        ways = [(1, "tiles"), (64, "tiles")]
        if "peeling" in technique and lighting == "none":
            ways += [(1, "passes"), (64, "passes")]
        for lanes, execution in ways:
            got = plainly.render(scene, ABOVE, SIZE, technique, lanes=lanes, execution=execution, **options)
            np.testing.assert_array_equal(got.image, wanted.image)


@given(seed=st.integers(0, 10**6), width=st.floats(0.1, 60), samples=st.sampled_from([1, 4, 8]))
def test_any_scene_is_the_same_by_lanes_and_by_technique(seed: int, width: float, samples: Any) -> None:
    options: dict[str, Any] = {"line_width": width, "point_size": width / 2, "samples": samples}
    pictures = [
        plainly.render(mixed(seed, 4), ABOVE, (48, 40), technique, lanes=lanes, **options).image
        for technique, lanes in [("sort", 1), ("sort", 64), ("depth-peeling", 1)]
    ]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


def test_layers_lie_in_the_order_of_their_depth_and_name_what_they_are_of(lanes: int) -> None:
    """A line goes through a square, and points lie before and behind it."""
    vertices = np.array(
        [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-0.9, 0, 1], [0.9, 0, -1], [0, 0.5, 0.5], [0, -0.5, -0.5]]
    )
    scene = clpeel.Scene.from_arrays(
        vertices, [[0, 1, 2], [0, 2, 3]], lines=[[4, 5]], points=[6, 7], vertex_colors=np.tile(np.uint8(HALF), (8, 1))
    )
    found = plainly.render(scene, FLAT, SIZE, lanes=lanes, layers=True, line_width=3, point_size=5).layers
    assert found is not None and set(found.triangle.tolist()) == {0, 1, 2, 3, 4}
    first = {}
    for pixel in np.flatnonzero(np.diff(found.start) == 2):
        front, behind = found.triangle[found.start[pixel] : found.start[pixel + 1]]
        first.setdefault(int(max(front, behind)), []).append((pixel % SIZE[0], front >= 2))
    assert all(is_front for _, is_front in first[3]) and not any(is_front for _, is_front in first[4])
    left = [is_front for column, is_front in first[2] if column < 59]
    right = [is_front for column, is_front in first[2] if column > 61]
    assert all(left) and not any(right) and len(left) > 30 and len(right) > 30


def test_lines_and_points_are_unlit_without_normals_and_lit_with_them(lanes: int) -> None:
    vertices = np.array([[-1, 0, 0], [1, 0, 0], [0, 0.6, 0]])
    options: dict[str, Any] = {"lanes": lanes, "line_width": 9, "point_size": 15, "point_type": "disc"}
    scenes = [
        clpeel.Scene.from_arrays(vertices, lines=[[0, 1]], points=[2], color=(200, 100, 50), vertex_normals=normals)
        for normals in (None, np.tile([0, 0.6, 0.8], (3, 1)))
    ]
    plain, unlit, lit = (
        plainly.render(scene, FLAT, SIZE, lighting=lighting, background=(0, 0, 0), **options)
        .image.reshape(-1, 4)
        .max(axis=0)
        for scene, lighting in [(scenes[0], "none"), (scenes[0], "headlight"), (scenes[1], "headlight")]
    )
    assert plain.tolist() == unlit.tolist() == [200, 100, 50, 255]
    assert lit.tolist() == [round(200 * (0.2 + 0.8 * 0.8)), 84, 42, 255]


def test_a_sphere_is_a_disc_that_darkens_towards_its_rim(lanes: int) -> None:
    scene = clpeel.Scene.from_arrays(np.zeros((1, 3)), points=[0], color=(255, 255, 255))
    ball, disc = (
        plainly.render(
            scene,
            FLAT,
            (81, 81),
            lighting="headlight",
            background=(0, 0, 0),
            lanes=lanes,
            point_size=80,
            point_type=kind,
        )
        .image[40, 40:, 0]
        .astype(int)
        for kind in ("sphere", "disc")
    )
    assert (disc[:40] == 255).all() and disc[40] == 0
    assert ball[0] == 255 and (np.diff(ball[:40]) <= 0).all()
    place = np.arange(36) / 40
    light = 0.2 + 0.8 * np.sqrt(1 - place**2)
    assert np.abs(ball[:36] / 255 - light).max() < 0.1  # of a true ball


# --- lights -----------------------------------------------------------------------------------------------------------

WHITE = (255, 255, 255)
LAMPS = (DirectionalLight(direction=(0.3, -0.4, -1), intensity=2.0), PointLight(position=(1, 2, 4), intensity=9.0))
LIT: list[dict[str, Any]] = [
    {"lighting": "kit"},
    {"lighting": "kit", "highlights": "full", "samples": 8},
    {"lighting": "scene", "samples": 4},
]


@pytest.mark.parametrize("options", LIT)
def test_lights_leave_what_has_no_normals_as_it_is(options: dict[str, Any], lanes: int) -> None:
    """To the bit, transparent or not, beside faces that are lit."""
    rng = np.random.default_rng(3)
    vertices = rng.uniform(-1, 1, (20, 3))
    colors = rng.uniform(0, 1, (20, 4)).astype(np.float32)
    colors[:6, 3] = 1
    given: dict[str, Any] = {"lines": np.arange(12).reshape(-1, 2), "points": np.arange(12, 20), "lights": LAMPS}
    scene = clpeel.Scene.from_arrays(vertices, vertex_colors=colors, **given)
    call: dict[str, Any] = {"line_width": 6, "point_size": 9, "point_type": "disc", "lanes": lanes, "background": None}
    unlit, lit = (
        plainly.render(scene, ABOVE, SIZE, **call, **{**options, **more}) for more in ({"lighting": "none"}, {})
    )
    np.testing.assert_array_equal(lit.color, unlit.color)
    assert (lit.color[..., 3] > 0).mean() > 0.05
    with_face = clpeel.Scene.from_arrays(vertices, [[0, 7, 9]], vertex_colors=colors, **given)
    unlit, lit = (
        plainly.render(with_face, ABOVE, SIZE, **call, **{**options, **more}) for more in ({"lighting": "none"}, {})
    )
    changed = (lit.color != unlit.color).any(axis=-1)
    assert 0.01 < changed.mean() < 0.5


@pytest.mark.parametrize("samples", [1, 8])
@pytest.mark.parametrize("towards", [1, -1], ids=["towards the eye", "away from it"])
def test_normals_of_lines_and_points_take_light_from_where_they_are_seen(
    towards: int, samples: Any, lanes: int
) -> None:
    normal, color, finish = twin.unit((0.3, 0.5, 0.8)), (0.5, 0.25, 0.1), MATT
    vertices = np.array([[-1, -0.6, 0], [1, -0.6, 0], [0, 0.4, 0]])
    scene = clpeel.Scene.from_arrays(
        vertices,
        lines=[[0, 1]],
        points=[2],
        color=srgb(np.array(color)),
        vertex_normals=np.tile(towards * normal, (3, 1)),
        lights=LAMPS[:1],
    )
    options: dict[str, Any] = {"line_width": 9, "point_size": 15, "point_type": "disc", "samples": samples}
    found = plainly.render(scene, FLAT, SIZE, lighting="scene", background=None, lanes=lanes, **options).color
    plain, shine = twin.seen(color, normal, np.zeros(3), np.array([0, 0, 1.0]), LAMPS[:1], finish)
    whole = found[found[..., 3] == 1]
    assert len(whole) > 400
    np.testing.assert_allclose(whole[:, :3], np.tile(srgb(plain + shine), (len(whole), 1)), atol=2e-3)


@pytest.mark.parametrize("samples", [1, 4, 8])
@pytest.mark.parametrize("at", [(0, 0), (-1.1, 0.7)], ids=["in the middle", "aside"])
def test_points_are_balls_under_lights(at: tuple[float, float], samples: Any, lanes: int) -> None:
    """Their brightness is that of a true ball, which light falls on from the upper left, up to near the rim."""
    lamp = DirectionalLight(direction=(1, -1, -1), intensity=3.0, highlights=False)
    scene = clpeel.Scene.from_arrays([(*at, 0.0)], points=[0], color=(128, 128, 128), lights=[lamp])
    found = plainly.render(scene, FLAT, SIZE, lighting="scene", samples=samples, lanes=lanes, point_size=40).image
    (px, py, _), *_ = screen.screen(np.array([(*at, 0.0)]), FLAT, SIZE) / 256
    x, y = np.arange(SIZE[0])[None] + 0.5 - SIZE[0] / 2 - px, np.arange(SIZE[1])[:, None] + 0.5 - SIZE[1] / 2 - py
    inner = np.hypot(x, y) < 16
    normals = np.stack([x + 0 * y, -y + 0 * x, np.sqrt(np.maximum(400 - x**2 - y**2, 0))], axis=-1)[inner] / 20
    eye = np.array([0, 0, 1.0])
    wanted = [
        srgb(sum(twin.seen((linear(128 / 255),) * 3, n, np.zeros(3), eye, [lamp], MATT))[0]) for n in normals[::9]
    ]
    got = found[inner][::9, 0] / 255
    assert np.abs(got - wanted).mean() < 0.04 and np.corrcoef(got, wanted)[0, 1] > 0.97


def test_lines_and_points_move_no_map(lanes: int) -> None:
    """Maps find their coordinates and tangents behind all vertices, also behind corners of lines and points."""
    rng = np.random.default_rng(8)

    def texture() -> Texture:
        return Texture(rng.integers(90, 200, (8, 8, 4)).astype(np.uint8))

    finish = Finish(
        metallic=0.5,
        roughness=0.8,
        normal_texture=texture(),
        normal_uv=1,
        metallic_roughness_texture=texture(),
        metallic_roughness_uv=2,
    )
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [40, 40, 0], [41, 40, 0], [42, 40, 0]])
    material = Material(texture=texture(), finish=finish)
    uv = [rng.uniform(0, 1, (7, 2)) for _ in range(3)]
    pictures = [
        plainly.render(
            clpeel.Scene.from_arrays(
                square, [[0, 1, 2], [0, 2, 3]], materials=[material], uv=uv[0], more_uv=uv[1:], color=WHITE, **marks
            ),
            FLAT,
            SIZE,
            lighting="kit",
            lanes=lanes,
        ).image
        for marks in ({}, {"lines": [[4, 5], [5, 6]], "points": [4, 6]})
    ]
    np.testing.assert_array_equal(*pictures)
    assert len(np.unique(pictures[0].reshape(-1, 4), axis=0)) > 500


def test_materials_of_faces_leave_lines_and_points_their_default_colour() -> None:
    material = Material(base_color=(1, 0, 0, 1))
    both = clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2]], lines=[[0, 1]], points=[2], materials=[material])
    assert both.face_colors is not None
    assert both.face_colors.tolist() == [[255] * 4, list(DEFAULT_COLOR), list(DEFAULT_COLOR)]
    alone = clpeel.Scene.from_arrays(np.eye(3), points=[2], materials=[material])
    assert (np.broadcast_to(alone.colors, (3, 4))[alone.mark_vertices] == DEFAULT_COLOR).all()


@pytest.mark.parametrize("technique", ["thickness", "translucency"])
def test_solids_are_measured_without_lines_and_points(technique: str, lanes: int) -> None:
    demo = demo_scene()
    places = np.random.default_rng(1).uniform(-1, 1, (30, 3))
    marks = clpeel.Scene.from_arrays(places, lines=np.arange(20).reshape(-1, 2), points=np.arange(20, 30))
    both = clpeel.load(demo, marks)
    camera = clpeel.Camera.frame(demo)
    plain, got = (plainly.render(scene, camera, SIZE, technique, lanes=lanes) for scene in (demo, both))
    np.testing.assert_array_equal(got.thickness, plain.thickness)
    assert f"10 line(s) and 10 point(s) left out: they have no inside, which {technique} measures" in got.stats.notes


@pytest.mark.parametrize("lighting", ["none", "headlight"])
def test_opacity_and_backfaces_reach_lines_and_points(lighting: Any, lanes: int) -> None:
    places = np.array([[-1, 0, 0], [1, 0, 0], [0, 0.6, 0]])
    scene = clpeel.Scene.from_arrays(places, lines=[[0, 1]], points=[2], color=(0, 0, 0))
    renderer = plainly.Renderer(scene, lanes=lanes)
    options: dict[str, Any] = {"line_width": 9, "point_size": 15, "lighting": lighting, "point_type": "disc"}
    whole = renderer.render(FLAT, SIZE, backface_type="hidden", **options)
    assert whole.image[45, 60, 0] == 0 and whole.image[:, :, 0].min(axis=1)[:35].min() == 0
    assert scene.surfaces == "opaque" and whole.stats.opaque_samples > 500
    renderer.set_opacity(0.5)
    half = renderer.render(FLAT, SIZE, **options)
    assert half.stats.opaque_samples == 0 and half.image[45, 60, 0] in (127, 128)


def test_clouds_too_large_for_discs_are_squares_and_a_note_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outlines, "MOST_CORNERS", 100)
    places = np.random.default_rng(2).uniform(-1, 1, (50, 3))
    scene = clpeel.Scene.from_arrays(places, points=np.arange(50), color=HALF)
    got, wanted = (plainly.render(scene, FLAT, SIZE, point_type=kind, point_size=6) for kind in ("disc", "square"))
    np.testing.assert_array_equal(got.image, wanted.image)
    assert got.stats.notes == ["50 points are drawn as squares: they are too many for --point-type disc"]
    assert wanted.stats.notes == []


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"line_width": 0}, "line_width: expected pixels above 0, up to 8,192, or scene units such as 0.01u, got 0"),
        ({"line_width": "wide"}, "line_width: expected pixels above 0"),
        ({"point_size": "-1u"}, "point_size: expected pixels above 0"),
        ({"point_size": float("nan")}, "point_size: expected pixels above 0"),
        ({"line_width": 2100, "samples": 8}, "line_width: expected at most 2,048 pixels with 8 samples, got 2100"),
        ({"point_size": 1000, "samples": 256}, "point_size: expected at most 512 pixels with 256 samples, got 1000"),
        ({"point_type": "gaussian"}, "point_type: expected one of sphere, disc, square; got 'gaussian'"),
    ],
)
def test_wrong_sizes_are_refused(options: dict[str, Any], says: str) -> None:
    scene = clpeel.Scene.from_arrays(np.zeros((1, 3)), points=[0])
    with pytest.raises(InputError) as error:
        plainly.render(scene, size=(8, 8), **options)
    assert says in str(error.value)


def test_sizes_are_of_pixels_whatever_the_samples() -> None:
    scene = clpeel.Scene.from_arrays(np.zeros((1, 3)), points=[0], color=(0, 0, 0))
    for samples in (1, 4, 8, 64):
        image = plainly.render(scene, FLAT, (64, 64), samples=samples, point_size=20, point_type="disc").image
        assert abs((1 - image[..., 0] / 255).sum() / (np.pi * 100) - 1) < 0.03


def test_scenes_of_lines_and_points_are_pickled_joined_and_recoloured() -> None:
    scene = mixed(7, 3)
    again = pickle.loads(pickle.dumps(scene))
    np.testing.assert_array_equal(again.lines, scene.lines)
    one = clpeel.Scene.from_arrays(np.eye(3) * 9, lines=[[0, 1]], points=[2], color=(255, 0, 0))
    both = clpeel.load(scene, one)
    assert both.counts == tuple(map(sum, zip(scene.counts, one.counts, strict=True)))
    assert both.lines is not None and both.points is not None and both.vertex_colors is not None
    np.testing.assert_array_equal(both.vertices[both.lines[-1]], np.eye(3)[:2] * 9)
    assert (both.vertex_colors[both.lines[-1]] == [255, 0, 0, 255]).all() and both.bounds[1].tolist() == [9, 9, 9]
    red = clpeel.load(both, color="red", opacity=1)
    assert red.surfaces == "opaque" and (red.colors[..., :3] == [1, 0, 0]).all()
    blue = clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2]], face_colors=[[0, 0, 255]])
    kept = clpeel.load(blue, one)
    assert kept.face_colors is not None  # the face, the line, the point
    assert kept.face_colors.tolist() == [[0, 0, 255, 255], [255, 0, 0, 255], [255, 0, 0, 255]]


def test_complexity_and_compare_know_lines_and_points() -> None:
    scene = mixed(9, 4)
    found = clpeel.complexity(scene, ABOVE, SIZE, line_width=5, point_size="0.2u")
    wanted = plainly.render(scene, ABOVE, SIZE, line_width=5, point_size="0.2u")
    assert found.max == wanted.stats.layers_max
    rows = clpeel.compare(scene, ABOVE, SIZE, techniques=["sort"], precisions=["float32"], frames=1, line_width=5)
    assert rows.rows[0].max_error < 1e-5
