"""The camera: framing, VTK's moves, the matrix against float64, and what is refused."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from twins import screen as twins

import clpeel
from clpeel.scene.camera import flat_normal
from clpeel.stages.projection import matrix_of

CUBE = clpeel.Scene.from_arrays(
    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], [[0, 1, 2], [5, 6, 7]], color=(255, 0, 0)
)
coordinate = st.floats(-100, 100, allow_subnormal=False)
vector = st.tuples(coordinate, coordinate, coordinate)


@given(vector, vector, vector, st.floats(1, 170), st.booleans(), vector)
def test_the_matrix_is_the_projection(position, focal, up, angle, orthographic, point):
    view = np.subtract(focal, position)
    assume(abs(np.dot(np.subtract(point, position), view)) > 1e-2 * np.linalg.norm(view))  # beside the eye
    assume(np.linalg.norm(view) > 1e-3 and np.linalg.norm(np.cross(view, up)) > 1e-2 * np.linalg.norm(view))
    camera = clpeel.Camera(position, focal, up, angle, (0.1, 1000.0), orthographic)
    origin, scale = np.array([1.0, -2.0, 3.0]), 0.5
    matrix, depth_near, depth_far = matrix_of(camera, origin, scale, (0.1, 1000.0), (640, 480))
    rows = matrix.astype(np.float64).sum(axis=1)
    x, y, z, w = rows @ [*((np.array(point) - origin) * scale), 1.0]
    exact_x, exact_y, distance = twins.screen(np.array([point]), camera, (640, 480))[0]
    # Pairs keep 2**-48 of each term; the terms are at most some thousand units times the scale of a pixel.
    slack = 1e-9 * (1 + 480 * 128 / math.tan(math.radians(angle) / 2) / min(abs(w), 1))
    assert x / w == pytest.approx(exact_x, rel=1e-9, abs=slack)
    assert y / w == pytest.approx(exact_y, rel=1e-9, abs=slack)
    if orthographic:
        assert z / w == pytest.approx((1000 - distance) / (1000 - 0.1), abs=1e-9)
        assert (depth_near, depth_far) == (1 + 2.0**-22, -(2.0**-22))
    else:
        assert z / w == pytest.approx(0.1 / distance, rel=1e-6, abs=1e-12)
        assert (depth_near, depth_far) == (1 + 2.0**-22, np.float32(1e-4 * (1 - 2.0**-22)))


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("direction", ["-Z", "+X", "y", (1, 2, -3)])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 2.0])
def test_frame_holds_the_scene_just(direction, orthographic, aspect):
    up = "Z" if direction == "y" else "+Y"
    camera = clpeel.Camera.frame(CUBE, direction, up, 30, aspect=aspect, orthographic=orthographic)
    assert np.allclose(camera.focal_point, 0)
    size = (int(400 * aspect), 400)
    # The bounding sphere's outline touches the nearer sides of the picture and nothing of it is cut.
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(20000, 3))
    sphere *= math.sqrt(3) / np.linalg.norm(sphere, axis=1, keepdims=True)
    reach = np.abs(twins.screen(sphere, camera, size)[:, :2]).max(axis=0) / 256 / (np.array(size) / 2)
    assert reach.max() == pytest.approx(1, abs=0.01) and reach.max() <= 1 + 1e-9


def test_moves_are_those_of_vtk():
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 30.0)
    assert np.allclose(camera.azimuth(90).position, (5, 0, 0))
    assert np.allclose(camera.elevation(30).position, (0, 2.5, 5 * math.cos(math.radians(30))))
    assert np.allclose(camera.elevation(30).view_up, (0, math.cos(math.radians(30)), -0.5))
    assert camera.zoom(2).view_angle == 15
    flat = clpeel.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 30.0, orthographic=True).zoom(2)
    assert math.tan(math.radians(flat.view_angle) / 2) == pytest.approx(math.tan(math.radians(15)) / 2)


def test_moves_against_vtk():
    pytest.importorskip("vtk", reason="the vtk wheel is not installed")
    import vtk

    ours = clpeel.Camera((1, 2, 5), (0.1, 0.2, 0.3), (0.1, 1, 0), 30.0).azimuth(25).elevation(-40)
    theirs = vtk.vtkCamera()
    theirs.SetPosition(1, 2, 5)
    theirs.SetFocalPoint(0.1, 0.2, 0.3)
    theirs.SetViewUp(0.1, 1, 0)
    theirs.Azimuth(25)
    theirs.Elevation(-40)
    assert np.allclose(ours.position, theirs.GetPosition())


def test_fitted_range_holds_the_scene():
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0))
    near, far = camera.fitted_range(CUBE)
    assert 3.9 < near < 4 and 6 < far < 6.1
    near, far = clpeel.Camera((0, 0, 0), (0, 0, -1)).fitted_range(CUBE)  # the eye inside
    assert 0 < near < 1e-5 and far > 1
    near, far = clpeel.Camera((0, 0, 9), (0, 0, 10)).fitted_range(CUBE)  # all of it behind
    assert 0 < near < far
    near, far = clpeel.Camera((0, 0, 0), (0, 0, -1), orthographic=True).fitted_range(CUBE)
    assert near < -1 and far > 1
    assert clpeel.Camera((0, 0, 5), (0, 0, 0), clipping_range=(1, 2)).fitted_range(CUBE) == (1, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"position": (0, 0, 0), "focal_point": (0, 0, 0)}, "away from the focal point"),
        ({"view_up": (0, 0, 3)}, "parallel to the view"),
        ({"view_up": (0, 0, 0)}, "parallel to the view"),
        ({"view_angle": 0}, "between 0 and 180"),
        ({"view_angle": 180}, "between 0 and 180"),
        ({"view_angle": math.nan}, "between 0 and 180"),
        ({"view_angle": "wide"}, "expected degrees"),
        ({"position": (0, 0)}, "3 finite numbers"),
        ({"position": (0, math.nan, 1)}, "3 finite numbers"),
        ({"position": "here"}, "expected 3 numbers"),
        ({"clipping_range": (2, 1)}, "near < far"),
        ({"clipping_range": (1, 1)}, "near < far"),
        ({"clipping_range": (0, 1)}, "near > 0"),
        ({"clipping_range": (1,)}, "(near, far)"),
        ({"clipping_range": (1, math.inf)}, "near < far"),
    ],
)
def test_what_cannot_be_is_refused(arguments, message):
    with pytest.raises(clpeel.InputError) as error:
        clpeel.Camera(**{"position": (0, 0, 5), "focal_point": (0, 0, 0), **arguments})
    assert message in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("direction", ["W", "-", "", "--Z", (0, 0), (0, 0, 0)])
def test_directions_that_are_none_are_refused(direction):
    with pytest.raises(clpeel.InputError, match="camera direction: expected"):
        clpeel.Camera.frame(CUBE, direction)


@pytest.mark.parametrize(("move", "value"), [("zoom", 0), ("zoom", -1), ("zoom", math.nan), ("azimuth", math.inf)])
def test_moves_that_cannot_be_are_refused(move, value):
    with pytest.raises(clpeel.InputError, match="expected"):
        getattr(clpeel.Camera((0, 0, 5), (0, 0, 0)), move)(value)


# --- radians ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0.5, 1, 22.5, 30, 45, 60, 90, 120, 179.5])
def test_radians_are_refused(degrees):
    angle = math.radians(degrees)
    message = f"expected degrees, got {angle:.4g}, which is {degrees:g} degrees in radians; use math.degrees"
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0))
    for name, make in (
        ("view_angle", lambda: clpeel.Camera((0, 0, 5), (0, 0, 0), view_angle=angle)),
        ("view_angle", lambda: clpeel.Camera.frame(CUBE, view_angle=np.float64(angle))),
        ("view_angle", lambda: replace(camera, view_angle=angle)),
        ("azimuth", lambda: camera.azimuth(angle)),
        ("elevation", lambda: camera.elevation(angle)),
    ):
        with pytest.raises(clpeel.InputError) as error:
            make()
        assert str(error.value).startswith(f"camera {name}: {message}")
    with pytest.raises(clpeel.InputError, match=f"which is -{degrees:g} degrees"):
        camera.azimuth(-angle)


@pytest.mark.parametrize("angle", [1e-300, 1e-3, 0.008726, 0.5236, 0.52, 0.5, 1, 1.5708, 2, 3, 3.14159, 7.0, 30, 179])
def test_small_angles_in_degrees_are_taken(angle):
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), view_angle=angle)
    assert camera.view_angle == angle and str(angle) in repr(camera)
    camera.azimuth(angle).elevation(-angle)


def test_what_a_zoom_makes_is_degrees():
    zoomed = clpeel.Camera((0, 0, 5), (0, 0, 0), view_angle=30).zoom(180 / math.pi)
    assert zoomed.view_angle == pytest.approx(math.pi / 6, rel=1e-12)
    for camera in (zoomed.azimuth(10).elevation(5), replace(zoomed, clipping_range=(1, 2)), copy.deepcopy(zoomed)):
        assert camera.view_angle == zoomed.view_angle
    parallel = clpeel.Camera((0, 0, 5), (0, 0, 0), view_angle=30, orthographic=True)
    wanted = math.tan(math.radians(math.pi / 6) / 2)
    assert parallel.zoom(math.tan(math.radians(15)) / wanted).view_angle == pytest.approx(math.pi / 6, rel=1e-12)


# --- flat scenes ------------------------------------------------------------------------------------------------------

SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0.5, 0.2]], float)


def flat(right, up, scale=1.0, offset=0.0):
    """A square with a point in it, in the plane of two directions."""
    return clpeel.Scene.from_arrays(
        SQUARE @ np.array([right, up], float) * scale + offset, [[0, 1, 2], [0, 2, 3], [0, 1, 4]]
    )


FLOOR = ((1, 0, 0), (0, 0, 1))
SLOPE = ((1, 0, 0), (0, 0.8, -0.6))  # it rises away from the camera

PLANES = [  # two directions in it, up, where the camera then looks, and what is up in the picture
    (FLOOR, "+Y", (0, -1, 0), (0, 0, -1)),
    (((0, 0, 1), (0, 1, 0)), "+Y", (-1, 0, 0), (0, 1, 0)),
    (((1, 0, 0), (0, 1, 0)), "+Y", (0, 0, -1), (0, 1, 0)),
    (SLOPE, "+Y", (0, -0.6, -0.8), (0, 1, 0)),
    (((1, 0, 0), (0, 0.6, -0.8)), "+Y", (0, -0.8, -0.6), (0, 1, 0)),
    (((1, 0, 0), (0, 1, 0)), "+Z", (0, 0, -1), (0, 1, 0)),
    (((1, 0, 0), (0, 0, 1)), "+Z", (0, 1, 0), (0, 0, 1)),
    (((0, 1, 0), (0, 0, 1)), "+Z", (-1, 0, 0), (0, 0, 1)),
    (FLOOR, "-Y", (0, 1, 0), (0, 0, 1)),
]


@pytest.mark.parametrize(("plane", "up", "looks", "view_up"), PLANES)
def test_a_flat_scene_is_looked_at(plane, up, looks, view_up):
    for scale, offset in ((1, 0), (1e6, 1e6), (1e-6, 0), (1e-100, 0), (1e100, 0)):
        camera = clpeel.Camera.frame(flat(*plane, scale, offset), up=up)
        assert np.allclose(camera.axes()[2], looks, rtol=0, atol=1e-9)
        assert np.allclose(camera.view_up, view_up)
        clpeel.Camera.frame(flat(*plane[::-1], -scale, offset), up=up).axes()


def test_a_given_direction_is_kept():
    camera = clpeel.Camera.frame(flat(*FLOOR), "-Z")
    assert camera.axes()[2].tolist() == [0, 0, -1]
    assert clpeel.Camera.frame(CUBE) == clpeel.Camera.frame(CUBE, "-Z")


def test_a_plane_across_the_view_is_seen_as_ever():
    scene = flat((1, 0, 0), (0, 1, 0))
    assert clpeel.Camera.frame(scene) == clpeel.Camera.frame(scene, "-Z")
    assert clpeel.Camera.frame(CUBE, up="+Z") == clpeel.Camera.frame(CUBE, (0, 1, 0), "+Z")


@pytest.mark.parametrize("scale", [1e-320, 1e-300, 1e-160, 1e-40, 1, 1e40, 1e160, 1e300])
def test_flat_is_flat_at_any_scale(scale):
    with np.errstate(all="raise", under="ignore"):
        assert np.abs(flat_normal(flat(*FLOOR, scale))).tolist() == [0, 1, 0]
        normal = flat_normal(flat((0, 1, 2), (3, 4, 5), scale))
    want = np.cross((0, 1, 2), (3, 4, 5)) / np.linalg.norm(np.cross((0, 1, 2), (3, 4, 5)))
    assert abs(normal @ want) == pytest.approx(1, abs=1e-9 if scale > 1e-310 else 1e-3)


@pytest.mark.parametrize("thick", [3e-7, 3e-6])
@pytest.mark.parametrize("faces", [2, 5000])
def test_what_is_a_little_thick_is_not_flat(thick, faces):
    rng = np.random.default_rng(faces)
    points = rng.uniform(-1, 1, (3 * faces, 3))
    points[:3] = [[-1, -1, 0], [1, -1, 0], [1, 1, 0]]
    points[:, 2] = 0
    points[-1, 2] = 2 * thick * 2**0.5  # of the diagonal
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    scene = clpeel.Scene.from_arrays(points @ turn, np.arange(3 * faces).reshape(-1, 3))
    normal = flat_normal(scene)
    assert (normal is None) == (thick > 1e-6)
    assert normal is None or abs(normal @ turn[2]) == pytest.approx(1, abs=1e-9)


def test_what_is_not_drawn_does_not_count():
    points = np.vstack([SQUARE @ np.array(FLOOR, float), [[0, 9, 0], [0, np.nan, 0], [np.inf, 1, 0]]])
    scene = clpeel.Scene.from_arrays(points, [[0, 1, 2], [0, 2, 3], [0, 1, 6], [1, 2, 7]])
    assert np.abs(flat_normal(scene)).tolist() == [0, 1, 0]


@pytest.mark.parametrize("points", [[[0, 0, 0]], [[0, 0, 0], [1, 2, 3], [2, 4, 6]], [[np.nan, 0, 0]]])
def test_points_in_a_line_have_no_face(points):
    scene = clpeel.Scene.from_arrays(points, [[0, len(points) // 2, len(points) - 1]])
    assert flat_normal(scene) is None
    assert clpeel.Camera.frame(scene) == clpeel.Camera.frame(scene, "-Z")


def test_a_few_faces_tell_that_a_large_scene_is_not_flat(monkeypatch):
    looked_at = []
    eigh = np.linalg.eigh
    monkeypatch.setattr(np.linalg, "eigh", lambda matrix: looked_at.append(matrix) or eigh(matrix))
    faces = np.arange(300_000).reshape(-1, 3)
    assert flat_normal(clpeel.Scene.from_arrays(np.random.default_rng(0).normal(size=(300_000, 3)), faces)) is None
    assert len(looked_at) == 1 and np.trace(looked_at[0]) < 3 * 2 * 1000


def test_an_orbit_goes_around_evenly() -> None:
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0))
    places = [each.position for each in camera.orbit(4)]
    np.testing.assert_allclose(places, [(0, 0, 5), (5, 0, 0), (0, 0, -5), (-5, 0, 0)], atol=1e-14)
    assert [each == camera.azimuth(90 * k) for k, each in enumerate(camera.orbit(4))] == [True] * 4
    assert camera.orbit(1) == [camera]


def test_an_orbit_that_is_no_whole_turn_ends_where_it_says() -> None:
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0))
    np.testing.assert_allclose(camera.orbit(4, -90)[-1].position, (-5, 0, 0), atol=1e-14)
    np.testing.assert_allclose(camera.orbit(3, 180)[1].position, (5, 0, 0), atol=1e-14)


def test_an_orbit_about_another_axis_turns_the_camera_as_a_whole() -> None:
    """Looking straight down the axis, too, where azimuth would have no axis to turn about."""
    raised = clpeel.Camera((0, 0, 5), (0, 0, 0)).elevation(30)
    for each in raised.orbit(8, about="Y"):
        assert abs(each.position[1] - 2.5) < 1e-14
        right, _, _ = each.axes()
        assert abs(right[1]) < 1e-14, "it leans"
    down = clpeel.Camera((0, 5, 0), (0, 0, 0), (0, 0, -1))
    np.testing.assert_allclose([each.position for each in down.orbit(3, about=(0, 2, 0))], [(0, 5, 0)] * 3, atol=1e-14)
    np.testing.assert_allclose(down.orbit(4, about="Y")[1].view_up, (-1, 0, 0), atol=1e-14)


@pytest.mark.parametrize(
    "wrong", [{"count": 0}, {"count": 1.5}, {"degrees": "far"}, {"about": (0, 0, 0)}, {"about": "W"}]
)
def test_what_is_no_orbit_is_said(wrong) -> None:
    with pytest.raises(clpeel.InputError, match="camera orbit: expected"):
        clpeel.Camera((0, 0, 5), (0, 0, 0)).orbit(**{"count": 4, **wrong})
