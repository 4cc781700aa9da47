"""VTK's and PyVista's data sets: faces, lines, points, colours and normals become those of the Scene."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.scene.arrays import DEFAULT_COLOR

pv = pytest.importorskip("pyvista", reason="needs the package pyvista: pip install 'clpeel[test-ecosystem]'")
model = pytest.importorskip("vtkmodules.vtkCommonDataModel", reason="needs the package vtk")

SQUARE = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def corners(scene: clpeel.Scene) -> Any:
    return scene.vertices[scene.faces]


def area(scene: clpeel.Scene) -> float:
    """The area of all faces, where those that face -Z count negative."""
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    return float(np.cross(b - a, c - a)[:, 2].sum() / 2)


def test_triangles_stay_as_they_are_and_in_order() -> None:
    mesh = pv.PolyData(SQUARE, faces=[3, 0, 1, 2, 3, 0, 2, 3])
    scene = clpeel.load(mesh)
    assert scene.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and scene.vertices.tolist() == SQUARE
    assert scene.polygons is None and scene.notes == () and scene.color is not None
    assert scene.color.tolist() == list(DEFAULT_COLOR)


def test_polygons_are_known_to_edges_and_concave_ones_stay_concave() -> None:
    """An arrowhead, whose fan around its first corner would cover its notch; its area is 1, not 2."""
    arrow = [[2, 0, 0], [0, 1, 0], [1, 0, 0], [0, -1, 0]]
    mesh = pv.PolyData([*SQUARE, *np.add(arrow, [4, 0, 0])], faces=[4, 0, 1, 2, 3, 4, 4, 5, 6, 7])
    scene = clpeel.load(mesh)
    assert scene.counts == (4, 0, 0) and scene.polygons is not None and scene.polygons.tolist() == [0, 0, 1, 1]
    assert area(scene) == pytest.approx(2)
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    assert np.abs(np.cross(b - a, c - a)[:, 2]).sum() / 2 == pytest.approx(2)


def test_strips_become_triangles_that_all_wind_one_way() -> None:
    data = pv.PolyData()
    data.points = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0]])
    data.strips = [5, 0, 1, 2, 3, 4]
    scene = clpeel.load(data)
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert scene.counts == (3, 0, 0) and (np.sign(areas) == np.sign(areas[0])).all()
    assert scene.polygons is None


def test_polylines_and_vertices_are_lines_and_points() -> None:
    points = np.arange(18, dtype=float).reshape(6, 3)
    mesh = pv.PolyData(points, lines=[3, 0, 1, 2, 2, 4, 5], verts=[2, 3, 0])
    scene = clpeel.load(mesh)
    assert scene.counts == (0, 3, 2) and scene.lines is not None and scene.points is not None
    np.testing.assert_array_equal(scene.vertices[scene.lines], points[[[0, 1], [1, 2], [4, 5]]])
    np.testing.assert_array_equal(scene.vertices[scene.points], points[[3, 0]])


def test_colors_of_points_are_those_that_are_active() -> None:
    mesh = pv.PolyData(SQUARE, faces=[3, 0, 1, 2, 3, 0, 2, 3])
    mesh["RGB"] = np.full((4, 3), 9, np.uint8)
    mesh["own"] = np.arange(16, dtype=np.uint8).reshape(4, 4)
    mesh.set_active_scalars("own")
    scene = clpeel.load(mesh)
    assert scene.vertex_colors is not None and scene.vertex_colors.tolist() == np.arange(16).reshape(4, 4).tolist()
    mesh.set_active_scalars(None)
    scene = clpeel.load(mesh)
    assert scene.vertex_colors is not None and scene.vertex_colors[0].tolist() == [9, 9, 9, 255]


def test_colors_of_cells_follow_their_cells_of_every_kind() -> None:
    """VTK counts vertices first, then lines, then polygons."""
    mesh = pv.PolyData(SQUARE, faces=[4, 0, 1, 2, 3], lines=[3, 0, 1, 2], verts=[1, 3])
    mesh.cell_data["colors"] = np.array([[1, 0, 0], [2, 0, 0], [3, 0, 0]], np.uint8)
    scene = clpeel.load(mesh)
    colors = scene.colors
    assert scene.counts == (2, 2, 1) and scene.vertex_colors is not None
    assert {int(level) for level in colors[scene.faces][..., 0].reshape(-1)} == {3}
    assert scene.lines is not None and {int(level) for level in colors[scene.lines][..., 0].reshape(-1)} == {2}
    assert scene.points is not None and colors[scene.points][..., 0].tolist() == [1]


def test_numbers_are_arrays_of_the_scene_which_colors_can_be_made_of() -> None:
    mesh = pv.PolyData(SQUARE, faces=[4, 0, 1, 2, 3], lines=[3, 0, 1, 2], verts=[1, 3])
    assert clpeel.load(mesh).vertex_arrays == {}
    mesh["height"] = np.arange(4.0)
    mesh["own"] = np.full((4, 3), 9, np.uint8)
    mesh.cell_data["kind"] = [10, 20, 30]
    scene = clpeel.load(mesh)
    assert scene.vertex_arrays.keys() == {"height"} and scene.face_arrays["kind"].tolist() == [30, 30, 20, 20, 10]
    assert scene.vertex_arrays["height"][scene.faces].tolist() == scene_heights(scene)
    assert clpeel.load(pv.Sphere()).vertex_arrays == {}  # whose normals are no such numbers
    colored = clpeel.load(mesh, scalars="kind", cmap=["red", "lime", "blue"])
    assert colored.colors[:, :3].tolist() == [[0, 0, 255]] * 2 + [[0, 255, 0]] * 2 + [[255, 0, 0]]


def scene_heights(scene: clpeel.Scene) -> Any:
    """The numbers of the corners of the square, by where these are."""
    return [[float(SQUARE.index(place)) for place in face] for face in scene.vertices[scene.faces].tolist()]


def test_floats_are_colors_by_their_name_and_are_cut_off_with_a_note() -> None:
    mesh = pv.PolyData(SQUARE, faces=[4, 0, 1, 2, 3])
    mesh["RGB"] = np.array([[0, 0.5, 1], [2, -1, 0], [math.nan, 1, 1], [0.25, 0, 0]])
    scene = clpeel.load(mesh)
    assert scene.vertex_colors is not None
    np.testing.assert_allclose(scene.vertex_colors[:, :3], [[0, 0.5, 1], [1, 0, 0], [0, 1, 1], [0.25, 0, 0]])
    assert scene.notes == ("colours 'RGB': 2 of 4 are not within 0..1, and were cut off",)
    bare = pv.PolyData(SQUARE, faces=[4, 0, 1, 2, 3])
    bare["velocity"] = np.full((4, 3), 0.5)
    assert clpeel.load(bare).color is not None


def test_normals_are_kept() -> None:
    ball = pv.Sphere()
    scene = clpeel.load(ball)
    np.testing.assert_array_equal(scene.vertex_normals, ball.point_data["Normals"])


def test_points_that_are_nan_are_left_to_the_renderer() -> None:
    mesh = pv.PolyData(np.array([*SQUARE, [math.nan, 0, 0]]), faces=[3, 0, 1, 2, 3, 0, 2, 4])
    scene = clpeel.load(mesh)
    assert scene.counts == (2, 0, 0)
    assert plainly.render(scene, size=(16, 16), lighting="kit").stats.discarded == 1


@pytest.mark.parametrize(
    ("mesh", "sides", "outside"),
    [
        (pv.ImageData(dimensions=(3, 4, 5)), 2 * (2 * 3 + 3 * 4 + 2 * 4), 52.0),
        (pv.RectilinearGrid([0.0, 1, 3], [0.0, 2], [0.0, 1]), 10, 22.0),
        (pv.ImageData(dimensions=(2, 2, 2)).cast_to_structured_grid(), 6, 6.0),
        (pv.ImageData(dimensions=(3, 2, 2)).cast_to_unstructured_grid(), 10, 10.0),
    ],
)
def test_grids_show_their_surface(mesh: Any, sides: int, outside: float) -> None:
    scene = clpeel.load(mesh)
    assert scene.polygons is not None and len(np.unique(scene.polygons)) == sides
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(outside)


def test_a_surface_has_the_colors_of_its_cells() -> None:
    grid = pv.ImageData(dimensions=(3, 2, 2)).cast_to_unstructured_grid()
    grid.cell_data["rgb"] = np.array([[10, 0, 0], [20, 0, 0]], np.uint8)
    scene = clpeel.load(grid)
    middles = corners(scene).mean(axis=1)[:, 0]
    assert scene.face_colors is not None
    assert (scene.face_colors[:, 0] == np.where(middles < 1, 10, 20)).all()


def test_all_blocks_are_drawn_in_order() -> None:
    blocks = pv.MultiBlock([pv.Cube(center=(5, 0, 0)), None, pv.MultiBlock([pv.PolyData(np.zeros((1, 3)))])])
    scene = clpeel.load(blocks)
    assert scene.counts == (12, 0, 1) and scene.bounds.tolist() == [[0, -0.5, -0.5], [5.5, 0.5, 0.5]]


def test_plain_vtk_is_read_as_pyvista_is() -> None:
    ball = pv.Sphere()
    data = model.vtkPolyData()
    data.ShallowCopy(ball)
    ours, theirs = clpeel.load(data), clpeel.load(ball)
    assert (ours.faces == theirs.faces).all() and (ours.vertices == theirs.vertices).all()


def test_several_sources_are_joined() -> None:
    scene = clpeel.load(pv.Cube(), pv.Sphere(), opacity=0.5, color="red")
    assert scene.counts == (12 + 1680, 0, 0) and scene.color is not None and scene.color[3] == pytest.approx(0.5)


@pytest.mark.parametrize("mesh", [pv.PolyData(), pv.UnstructuredGrid(), pv.MultiBlock(), pv.MultiBlock([None])])
def test_what_is_empty_is_refused_in_one_line(mesh: Any) -> None:
    with pytest.raises(
        clpeel.InputError, match="PyVista object: expected triangles, lines or points, got none"
    ) as error:
        clpeel.load(mesh)
    assert "\n" not in str(error.value)


def test_a_table_is_no_mesh() -> None:
    with pytest.raises(clpeel.InputError, match="expected a path, a trimesh, PyVista, VTK.* got Table"):
        clpeel.load(pv.Table())


def test_a_real_mesh_is_that_of_its_file(model: Any, tmp_path: Path) -> None:
    path = model("bunny.ply")
    ours, theirs = clpeel.load(path), clpeel.load(pv.read(path))
    np.testing.assert_allclose(corners(ours), corners(theirs), rtol=1e-6)
