"""Lines and points against their twins: which samples they cover, and at which depth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import screen, strokes
from twins.samples import PLACES

import clpeel
from clpeel.stages.outlines import TOLERANCE

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (150, 110)
CLIPPING = (0.5, 20.0)
VIEWS = {
    "perspective": clpeel.Camera((4, 1, 2), (0, 0, 0), (0.1, 0, 1), 50.0, CLIPPING),
    "parallel": clpeel.Camera((4, 1, 2), (0, 0, 0), (0.1, 0, 1), 50.0, CLIPPING, orthographic=True),
    "within": clpeel.Camera((0.2, 0.1, 0), (-1, 0.2, 0.1), (0.1, 0, 1), 90.0, CLIPPING),
}
RED = (255, 0, 0, 128)


def layers(scene: clpeel.Scene, camera: clpeel.Camera, lanes: int, size=SIZE, **options: Any) -> clpeel.Layers:
    found = plainly.render(scene, camera, size, lanes=lanes, layers=True, **options).layers
    assert found is not None
    return found


def depths(found: clpeel.Layers, number: int, size=SIZE) -> np.ndarray:
    """The distance of a line or point at each sample that it covers, NaN elsewhere. It covers none of them twice."""
    pixel = np.repeat(np.arange(size[0] * size[1]), np.diff(found.start))
    own = found.triangle == number
    assert len(np.unique(pixel[own])) == own.sum()
    depth = np.full(size[0] * size[1], np.nan)
    depth[pixel[own]] = found.depth[own]
    return depth.reshape(size[1], size[0])


def half_of(size: float | str, camera: clpeel.Camera, height: int):
    """Half a width in subpixels, as a function of the view distance."""
    if not isinstance(size, str):
        return lambda distance: size / 2 * 256
    units = float(size.removesuffix("u"))
    per_unit = 256 * height / 2 / math.tan(math.radians(camera.view_angle) / 2)
    return lambda distance: units / 2 * per_unit / (camera.distance if camera.orthographic else distance)


def check(found: np.ndarray, stroke: strokes.Stroke, off: float, camera: clpeel.Camera) -> int:
    """Holds what was drawn of a stroke against its twin. Returns how many samples it covers."""
    covered, sure = ~np.isnan(found), np.abs(stroke.inside) > off
    np.testing.assert_array_equal(covered[sure], (stroke.inside > 0)[sure])
    # Beyond the end that a sample is near to, depth is that of the end: a sample on the outline may be there.
    near, far = CLIPPING

    def key(distance: np.ndarray) -> np.ndarray:
        return (far - distance) / (far - near) if camera.orthographic else near / distance

    both = covered & np.isfinite(stroke.distance)
    error = np.abs(key(found[both]) - key(stroke.distance[both]))
    assert error.max(initial=0) <= DEPTH, error.max()
    return int(covered.sum())


DEPTH = 64 * 2.0**-24
"""How far a depth may be off, 0..1 between the planes: that of a corner, of its plane, and of its interpolation."""


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("width", [0.1, 1.0, 2.7, 40.0, 500.0, "0.01u", "0.3u"])
def test_lines_cover_the_samples_within_half_a_width(view: str, width: float | str, lanes: int) -> None:
    rng = np.random.default_rng(sum(map(ord, f"{view}{width}")))
    camera, spread = VIEWS[view], 1.5 if view != "within" else 4.0
    vertices = rng.uniform(-spread, spread, (40, 3))
    scene = clpeel.Scene.from_arrays(vertices, lines=np.arange(40).reshape(-1, 2), color=RED)
    found = layers(scene, camera, lanes, line_width=width)
    half = half_of(width, camera, SIZE[1])
    covered = sum(
        check(depths(found, k), strokes.line(a, b, camera, SIZE, half, *CLIPPING), strokes.SNAPPED, camera)
        for k, (a, b) in enumerate(vertices.reshape(-1, 2, 3))
    )
    assert covered > (0 if width == 0.1 else 30)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", ["square", "disc", "sphere"])
@pytest.mark.parametrize("size", [0.4, 1.0, 3.0, 25.0, 300.0, "0.02u", "0.4u"])
def test_points_cover_the_samples_around_them(view: str, kind: Any, size: float | str, lanes: int) -> None:
    rng = np.random.default_rng(sum(map(ord, f"{view}{kind}{size}")))
    camera, spread = VIEWS[view], 1.5 if view != "within" else 4.0
    vertices = rng.uniform(-spread, spread, (25, 3))
    scene = clpeel.Scene.from_arrays(vertices, points=np.arange(25), color=RED)
    found = layers(scene, camera, lanes, point_size=size, point_type=kind)
    half = half_of(size, camera, SIZE[1])
    off = strokes.GRID_SNAPPED + (0 if kind == "square" else TOLERANCE * 256)
    covered = [
        check(depths(found, k), strokes.point(at, camera, SIZE, half, *CLIPPING, square=kind == "square"), off, camera)
        for k, at in enumerate(vertices)
    ]
    if size not in (0.4, "0.02u"):
        assert sum(covered) >= 5


def test_a_square_of_one_pixel_covers_one_sample(lanes: int) -> None:
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), orthographic=True)
    vertices = np.c_[np.random.default_rng(3).uniform(-1, 1, (200, 2)), np.zeros(200)]
    vertices[:50] = np.round(vertices[:50] * 64) / 64  # on and between samples
    scene = clpeel.Scene.from_arrays(vertices, points=np.arange(200), color=RED)
    found = layers(scene, camera, lanes, (128, 128), point_size=1, point_type="square")
    assert np.bincount(found.triangle, minlength=200).tolist() == [1] * 200


FAR = [1e3, 1e6, 1e9]


@pytest.mark.parametrize("far", FAR)
def test_lines_that_reach_far_outside_the_picture(far: float, lanes: int) -> None:
    """Their ends are up to 1e11 pixels away, and one of them behind the eye."""
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), view_angle=40.0, clipping_range=(0.5, 2 * far))
    vertices = np.array(
        [[-far, -far / 3, 0], [far, far / 3, 0], [0.1, 0, -far / 2], [0.3, 0.2, far], [0, far, 0], [0, 0, 0]]
    )
    scene = clpeel.Scene.from_arrays(vertices, lines=np.arange(6).reshape(-1, 2), color=RED)
    found = layers(scene, camera, lanes, line_width=7)
    for k, (a, b) in enumerate(vertices.reshape(-1, 2, 3)):
        stroke = strokes.line(a, b, camera, SIZE, lambda _: 3.5 * 256, 0.5, 2 * far)
        covered, sure = ~np.isnan(depths(found, k)), np.abs(stroke.inside) > 1.0
        np.testing.assert_array_equal(covered[sure], (stroke.inside > 0)[sure])
        assert covered.sum() > 100


def test_what_is_not_finite_is_discarded_once_each(lanes: int) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [0.5, 0.5, 0]])
    lines = [[0, 1], [1, 2], [3, 4], [0, 4]]
    scene = clpeel.Scene.from_arrays(vertices, lines=lines, points=[0, 2, 3], faces=[[0, 1, 4], [0, 1, 2]], color=RED)
    result = plainly.render(scene, size=(64, 64), lanes=lanes, layers=True, line_width=3)
    assert result.stats.discarded == 5 and result.layers is not None
    assert set(result.layers.triangle.tolist()) == {0, 2, 5, 6}
    assert (result.stats.triangles, result.stats.lines, result.stats.points) == (2, 4, 3)


@given(st.integers(0, 10**6))
def test_lines_without_length_draw_nothing(seed: int) -> None:
    at = np.random.default_rng(seed).uniform(-1, 1, 3)
    towards_the_eye = np.array([at, at * 0.5 + np.array([0, 0, 5]) * 0.5])
    scene = clpeel.Scene.from_arrays(
        np.array([at, at, *towards_the_eye]), lines=[[0, 1], [0, 0], [2, 3]], faces=[[0, 2, 3]], color=RED
    )
    found = layers(scene, clpeel.Camera((0, 0, 5), (0, 0, 0)), 1, line_width=20)
    assert not {1, 2} & set(found.triangle.tolist())


@pytest.mark.parametrize("width", [0.1, 1.0, 30.0])
def test_lines_within_a_pixel_keep_their_depth(width: float, lanes: int) -> None:
    camera = VIEWS["perspective"]
    rng = np.random.default_rng(5)
    starts = rng.uniform(-1, 1, (60, 3))
    vertices = np.stack([starts, starts + rng.uniform(-0.01, 0.01, (60, 3))], axis=1).reshape(-1, 3)
    scene = clpeel.Scene.from_arrays(vertices, lines=np.arange(120).reshape(-1, 2), color=RED)
    found = layers(scene, camera, lanes, line_width=width)
    distance = screen.screen(vertices, camera, SIZE)[:, 2].reshape(-1, 2)
    low, high = distance.min(axis=1)[found.triangle], distance.max(axis=1)[found.triangle]
    assert ((found.depth >= low * (1 - 1e-6)) & (found.depth <= high * (1 + 1e-6))).all()


def test_colours_run_along_a_line_in_perspective(lanes: int) -> None:
    """Also along one that the near plane cuts: its colour there is not that of its end."""
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), view_angle=40.0, clipping_range=(1, 30))
    vertices = np.array([[-1, -0.5, 7.0], [0.5, 0.4, -20.0]])
    colors = np.array([[255, 0, 0, 255], [0, 0, 255, 255]], np.uint8)
    scene = clpeel.Scene.from_arrays(vertices, lines=[[0, 1]], vertex_colors=colors)
    found = layers(scene, camera, lanes, line_width=9)
    assert len(found.depth) > 100
    share = (found.depth - -2.0) / 27.0  # distances of the ends are -2 and 25
    wanted = np.stack([1 - share, 0 * share, share, 1 + 0 * share], axis=1)
    assert np.abs(found.color - wanted).max() < 1e-5


@pytest.mark.parametrize("view", ["perspective", "parallel"])
@pytest.mark.parametrize("width", [3.0, 22.0])
def test_across_a_joint_depth_and_colour_are_those_of_the_nearest_place(view: str, width: float, lanes: int) -> None:
    """So it is on either segment: at the inner side of a joint, and around the tip of its mitre."""
    camera = VIEWS[view]
    points = np.array([[-1.5, -1.0, -0.9], [1.8, 0.2, -0.3], [-1.0, 0.9, -0.2], [-2.5, 0.6, 0.9]])
    colors = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5], [1, 1, 0, 0.5]], np.float32)
    scene = clpeel.Scene.from_arrays(points, lines=[[0, 1], [1, 2], [2, 3]], vertex_colors=colors)
    found = layers(scene, camera, lanes, line_width=width)
    pixel = np.repeat(np.arange(SIZE[0] * SIZE[1]), np.diff(found.start))
    for k in range(3):
        stroke = strokes.line(points[k], points[k + 1], camera, SIZE, half_of(width, camera, SIZE[1]), *CLIPPING)
        own = found.triangle == k
        wanted = stroke.distance.reshape(-1)[pixel[own]]
        near, far = CLIPPING
        error = found.depth[own] - wanted if camera.orthographic else near / found.depth[own] - near / wanted
        assert own.sum() > 50 and np.abs(error).max() <= DEPTH * (far - near if camera.orthographic else 1)
        a, b = screen.screen(points[k : k + 2], camera, SIZE)[:, 2]
        share = ((wanted - a) / (b - a))[:, None]
        assert np.abs(found.color[own] - (1 - share) * colors[k] - share * colors[k + 1]).max() < 2e-5


# --- several samples a pixel ------------------------------------------------------------------------------------------

SAMPLES = sorted(set(PLACES) - {1})


def shares(scene: clpeel.Scene, camera: clpeel.Camera, lanes: int, samples: Any, **options: Any) -> np.ndarray:
    """How much of each pixel's samples is covered, if the scene is opaque, 0..1."""
    result = plainly.render(scene, camera, SIZE, background=None, lanes=lanes, samples=samples, **options)
    return result.color[..., 3]


def check_share(found: np.ndarray, inside: list[np.ndarray], off: float) -> None:
    """Holds a pixel's share against its samples, of which those within `off` of the outline may be in or out."""
    least, most = (np.mean([each > by for each in inside], axis=0) for by in (off, -off))
    assert ((found >= least - 1e-6) & (found <= most + 1e-6)).all()
    assert (least < most).mean() < 0.1


@pytest.mark.parametrize("samples", SAMPLES)
@pytest.mark.parametrize("view", ["perspective", "parallel"])
@pytest.mark.parametrize("width", [0.4, 1.0, 7.5, "0.2u"])
def test_lines_have_their_width_at_any_number_of_samples(
    samples: int, view: str, width: float | str, lanes: int
) -> None:
    camera, half = VIEWS[view], half_of(width, VIEWS[view], SIZE[1])
    for a, b in (
        ((-1, -1.2, -0.4), (0.4, 1.3, 0.9)),
        ((0.2, -0.9, 0.5), (0.3, 0.9, 0.52)),
        ((0, 0.1, -1), (0, 0.12, 1)),
    ):
        scene = clpeel.Scene.from_arrays([a, b], lines=[[0, 1]])
        found = shares(scene, camera, lanes, samples, line_width=width)
        ends = np.array(a, float), np.array(b, float)
        twins = [strokes.line(*ends, camera, SIZE, half, *CLIPPING, place) for place in PLACES[samples]]
        check_share(found, [twin.inside for twin in twins], strokes.SNAPPED)
        assert found.sum() > 10


@pytest.mark.parametrize("samples", SAMPLES)
@pytest.mark.parametrize("kind", ["square", "disc", "sphere"])
@pytest.mark.parametrize("size", [1.0, 3.0, 40.0, "0.4u"])
def test_points_have_their_size_at_any_number_of_samples(
    samples: int, kind: Any, size: float | str, lanes: int
) -> None:
    camera, half = VIEWS["perspective"], half_of(size, VIEWS["perspective"], SIZE[1])
    at = np.array([0.3, -0.2, 0.41])
    scene = clpeel.Scene.from_arrays([at], points=[0])
    found = shares(scene, camera, lanes, samples, point_size=size, point_type=kind)
    square = kind == "square"
    twins = [strokes.point(at, camera, SIZE, half, *CLIPPING, square, place) for place in PLACES[samples]]
    off = strokes.GRID_SNAPPED + (0 if square else TOLERANCE * 256 / math.isqrt(samples))
    check_share(found, [twin.inside for twin in twins], off)
    if square and size == 1.0:
        assert found.sum() == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("samples", SAMPLES)
def test_joints_have_their_width_at_any_number_of_samples(samples: int, lanes: int) -> None:
    """They cover each sample within half a width of the lines once, and none far away."""
    camera = VIEWS["perspective"]
    points = np.array([[0, -1.2, -0.6], [0.2, -0.7, 0.6], [-0.3, -0.2, -0.5], [0, 0.4, 0.2], [0, 0.9, 0.25]])
    lines = np.stack([np.arange(4), np.arange(1, 5)], axis=1)
    scene = clpeel.Scene.from_arrays(points, lines=lines, color=RED)
    found = shares(scene, camera, lanes, samples, line_width=9) * 255 / RED[3]
    corners, half = screen.screen(points, camera, SIZE)[:, :2], 4.5 * 256
    distance = np.array([strokes.to_polyline(corners, SIZE, place) for place in PLACES[samples]])
    x, y = strokes.grid(SIZE)
    ends = np.min([np.hypot(x - corner[0], y - corner[1]) for corner in corners[[0, -1]]], axis=0)
    within = (distance < half - strokes.SNAPPED).all(axis=0) & (ends > half + 512)
    np.testing.assert_allclose(found[within], 1, atol=1e-5)
    assert within.sum() > 200 and found.max() < 1 + 1e-5
    assert (found[(distance > 4 * half + 2).all(axis=0)] == 0).all()
    narrow = (distance > half + strokes.SNAPPED).all(axis=0) & (distance < 1.8 * half).all(axis=0) & (ends > 2 * half)
    away = np.min([np.hypot(x - corner[0], y - corner[1]) for corner in corners], axis=0) > 2 * half  # from mitres
    assert (narrow & away).sum() > 20 and (found[narrow & away] == 0).all()
