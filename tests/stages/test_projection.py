"""Projection against float64: snapped corners, depths of the exact plane, clipping, what is counted."""

from __future__ import annotations

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import screen as twins

import clpeel
from clpeel.device.devices import open_device
from clpeel.device.layout import CLIPPED_FACE, GUARD_BAND
from clpeel.device.records import TRIANGLE
from clpeel.device.workspace import Workspace
from clpeel.stages.projection import Triangles, project
from clpeel.stages.upload import upload

SIZE = (200, 120)


@pytest.fixture(scope="module")
def gpu() -> Workspace:
    return open_device()


def records(gpu: Workspace, triangles: Triangles) -> tuple[np.ndarray, np.ndarray]:
    count = triangles.count
    return gpu.get(triangles.records, count, TRIANGLE), gpu.get(triangles.bounds, (count, 4), np.uint16)


def soup(seed: int, count: int, spread: float = 1.0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-spread, spread, (3 * count, 3))


def projected(gpu: Workspace, vertices: np.ndarray, camera: clpeel.Camera, size=SIZE) -> Triangles:
    scene = clpeel.Scene.from_arrays(vertices, np.arange(len(vertices)).reshape(-1, 3), color=(255, 0, 0, 128))
    return project(gpu, upload(gpu, scene), camera, size, False)


@given(st.integers(0, 10**6), st.booleans(), st.floats(1e-3, 1e6))
def test_corners_are_snapped_to_the_nearest_subpixel(seed, orthographic, distance):
    gpu = open_device()
    vertices = soup(seed, 20)
    camera = clpeel.Camera((distance + 2, 0.3, 0.2), (0.1, 0, 0), (0, 0, 1), 40.0, orthographic=orthographic)
    triangles = projected(gpu, vertices, camera)
    assert triangles.clipped == 0
    rows, bounds = records(gpu, triangles)
    exact = twins.screen(vertices, camera, SIZE).reshape(-1, 3, 3)
    assert len(rows) or distance > 100
    # Float32 positions are exact pairs here; what is left is the pairs' own rounding, far below a thousandth.
    for row, corners in zip(rows, exact[rows["source"]], strict=True):
        found = np.stack([row["x"], row["y"]], axis=1)
        for corner in corners:
            assert np.abs(found - corner[:2]).max(axis=1).min() <= 0.5 + 1e-3


def plane_at_corners(row: np.void, exact: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """The plane through these depths at the exact corners, at the snapped ones, in float64."""
    plane = np.linalg.solve(np.c_[exact[:, :2], np.ones(3)], depths)
    return np.stack([row["x"], row["y"], np.ones(3)], axis=1) @ plane


def depths(row: np.void) -> np.ndarray:
    """At the snapped corners: the record holds the first and what is more at the others."""
    first, second, third = row["depth"].astype(np.float64)
    return np.array([first, first + second, first + third])


def test_depth_is_that_of_the_exact_plane(gpu):
    # A plane seen almost edge-on: moving its corners by 1/512 pixel without its depths would shift them far more.
    vertices = np.array([[-3.0, -0.02, -1], [3, -0.021, -1.3], [0.3, 0.9, -40]])
    camera = clpeel.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 60.0, (0.5, 100.0))
    row = records(gpu, projected(gpu, vertices, camera))[0][0]
    exact = twins.screen(vertices, camera, SIZE)
    assert np.allclose(depths(row), plane_at_corners(row, exact, 0.5 / exact[:, 2]), rtol=4 * 2.0**-23, atol=0)


def test_orthographic_depth_runs_from_one_at_near_to_zero_at_far(gpu):
    vertices = np.array([[0, 0, -2.0], [1, 0, -4], [0, 1, -6]])
    camera = clpeel.Camera((0, 0, 0), (0, 0, -3), (0, 1, 0), 60.0, (2.0, 6.0), orthographic=True)
    row = records(gpu, projected(gpu, vertices, camera))[0][0]
    assert row["depth_max"] == 1 and row["depth_min"] == 0
    exact = twins.screen(vertices, camera, SIZE)
    assert np.allclose(depths(row), plane_at_corners(row, exact, (6 - exact[:, 2]) / 4), rtol=0, atol=4 * 2.0**-23)


def test_positive_area_whatever_the_winding(gpu):
    vertices = soup(3, 50)
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0))
    flipped = vertices.reshape(-1, 3, 3)[:, ::-1].reshape(-1, 3)
    for points in (vertices, flipped):
        rows, bounds = records(gpu, projected(gpu, points, camera))
        rows = rows[bounds[:, 0] <= bounds[:, 1]]
        x, y = rows["x"].astype(np.int64), rows["y"].astype(np.int64)
        area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
        assert (area > 0).all()
        assert np.allclose(rows["inverse_area"], 1 / area, rtol=2.0**-22)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("component", [0, 1, 2])
def test_triangles_that_are_not_finite_are_counted(gpu, bad, component):
    vertices = soup(1, 5)
    vertices[4, component] = bad
    triangles = projected(gpu, vertices, clpeel.Camera((0, 0, 5), (0, 0, 0)))
    assert triangles.discarded == 1
    assert 1 not in records(gpu, triangles)[0]["source"]


def test_a_clipped_fan_covers_what_lies_in_front(gpu):
    # One corner behind the eye: a quad is left, two records, within the near plane's depth.
    vertices = np.array([[-1, -1, -3.0], [1, -1, -3.0], [0, 2, 5.0]])
    camera = clpeel.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 60.0, (0.1, 10.0))
    triangles = projected(gpu, vertices, camera)
    assert triangles.clipped == 1
    rows, bounds = records(gpu, triangles)
    assert bounds[0, 0] == CLIPPED_FACE
    fan = rows[1:][bounds[1:, 0] <= bounds[1:, 1]]
    assert len(fan) >= 1
    assert (fan["depth_max"] <= 1 + 2.0**-21).all() and (fan["depth_min"] > 0).all() and (fan["source"] == 0).all()


def test_clipped_corners_stay_within_the_guard_band(gpu):
    vertices = soup(5, 200, spread=1e4)
    camera = clpeel.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 20.0, (1e-3, 1e5))
    triangles = projected(gpu, vertices, camera)
    assert triangles.clipped > 50
    rows, bounds = records(gpu, triangles)
    drawn = rows[bounds[:, 0] <= bounds[:, 1]]
    assert len(drawn) and max(np.abs(drawn["x"]).max(), np.abs(drawn["y"]).max()) <= GUARD_BAND + 1


def test_far_plane_cuts(gpu):
    vertices = np.array([[-1, -1, -3.0], [1, -1, -3.0], [0, 2, -50.0]])
    camera = clpeel.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 60.0, (1.0, 10.0))
    triangles = projected(gpu, vertices, camera)
    rows, bounds = records(gpu, triangles)
    drawn = rows[bounds[:, 0] <= bounds[:, 1]]
    assert triangles.clipped == 1 and drawn["depth_min"].min() == pytest.approx(0.1, rel=1e-6)


def test_more_than_can_be_numbered_is_refused(monkeypatch):
    monkeypatch.setattr("clpeel.stages.upload.MOST_ITEMS", 5)
    scene = clpeel.Scene.from_arrays(np.zeros((6, 3)), [[0, 1, 2]], color=(1.0, 0, 0, 0.5))
    with pytest.raises(clpeel.InputError, match="scene: expected at most 5 vertices and triangles, got 6"):
        plainly.render(scene, clpeel.Camera((0, 0, 4), (0, 0, 0)), (4, 4))
