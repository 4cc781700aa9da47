"""meshio's meshes: cells as faces, lines and points; the surface of those with a volume; their colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import clpeel

meshio = pytest.importorskip("meshio", reason="needs the package meshio: pip install 'clpeel[meshio]'")

CUBE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
APEX = [0.5, 0.5, 2]


def volume(scene: clpeel.Scene) -> float:
    """The volume that the faces enclose: positive if they wind counterclockwise as seen from outside."""
    a, b, c = np.moveaxis(scene.vertices[scene.faces], 1, 0)
    return float(np.einsum("mc,mc->m", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize(
    ("kind", "cell", "inside", "sides"),
    [
        ("tetra", [0, 1, 3, 4], 1 / 6, 4),
        ("pyramid", [0, 1, 2, 3, 8], 2 / 3, 5),
        ("wedge", [0, 1, 3, 4, 5, 7], 1 / 2, 5),
        ("hexahedron", [0, 1, 2, 3, 4, 5, 6, 7], 1.0, 6),
    ],
)
def test_sides_of_cells_face_outward(kind: str, cell: list[int], inside: float, sides: int) -> None:
    """Cells as meshio (and VTK) number their corners; their volumes are those of geometry."""
    scene = clpeel.load(
        meshio.Mesh(np.array([*CUBE, APEX]) + [3, 4, 5], [(kind, [cell])])
    )  # no side in a plane of the origin
    assert volume(scene) == pytest.approx(inside)
    triangles = len(scene.faces) if scene.polygons is None else len(np.unique(scene.polygons))
    assert triangles == sides and scene.notes == ()


def test_sides_that_two_cells_share_are_inside() -> None:
    """A cube with a pyramid on top: 5 squares and 4 triangles are left."""
    mesh = meshio.Mesh([*CUBE, APEX], [("hexahedron", [list(range(8))]), ("pyramid", [[4, 5, 6, 7, 8]])])
    scene = clpeel.load(mesh)
    assert scene.counts == (14, 0, 0) and volume(scene) == pytest.approx(1 + 1 / 3)


def test_faces_lines_and_points_are_drawn() -> None:
    cells = [("triangle", [[0, 1, 2]]), ("quad", [[4, 5, 6, 7]]), ("line", [[0, 4]]), ("vertex", [[3]])]
    scene = clpeel.load(meshio.Mesh(CUBE, cells))
    assert scene.counts == (3, 1, 1) and scene.polygons is not None and scene.polygons.tolist() == [0, 1, 1]
    assert scene.lines is not None and scene.points is not None
    assert scene.vertices[scene.lines].tolist() == [[CUBE[0], CUBE[4]]]
    assert scene.vertices[scene.points].tolist() == [CUBE[3]]


def test_polygons_have_as_many_triangles_as_they_need() -> None:
    scene = clpeel.load(meshio.Mesh([[0, 0], [2, 0], [3, 1], [1, 3], [-1, 1]], [("polygon", [[0, 1, 2, 3, 4]])]))
    assert scene.counts == (3, 0, 0) and (scene.vertices[:, 2] == 0).all()


def test_curved_cells_are_straight_and_a_note_says_so() -> None:
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, -0.1, 0], [0.6, 0.6, 0], [0, 0.5, 0]]
    scene = clpeel.load(meshio.Mesh(points, [("triangle6", [[0, 1, 2, 3, 4, 5]]), ("line3", [[0, 1, 3]])]))
    assert scene.counts == (1, 1, 0)
    assert scene.notes == ("drawn straight between their corners: triangle6, line3",)


def test_colors_are_found_among_points_and_cells() -> None:
    colors = np.arange(24, dtype=np.uint8).reshape(8, 3)
    scene = clpeel.load(meshio.Mesh(CUBE, [("quad", [[0, 1, 2, 3]])], point_data={"t": np.zeros(8), "c": colors}))
    assert scene.vertex_colors is not None and (scene.vertex_colors[:, :3] == colors).all()
    own = [np.array([[1, 2, 3]], np.uint8), np.array([[4, 5, 6]], np.uint8)]
    cells = [("quad", [[0, 1, 2, 3]]), ("triangle", [[4, 5, 6]])]
    scene = clpeel.load(meshio.Mesh(CUBE, cells, cell_data={"c": own}))
    assert scene.face_colors is not None
    assert scene.face_colors[:, :3].tolist() == [[1, 2, 3], [1, 2, 3], [4, 5, 6]]


def test_numbers_are_arrays_of_the_scene() -> None:
    cells = [("quad", [[0, 1, 2, 3]]), ("line", [[4, 5]])]
    data = {"t": np.arange(8.0), "c": np.zeros((8, 3), np.uint8)}
    scene = clpeel.load(meshio.Mesh(CUBE, cells, point_data=data, cell_data={"part": [[7], [8]]}))
    assert scene.vertex_arrays.keys() == {"t"} and scene.face_arrays["part"].tolist() == [7, 7, 8]
    np.testing.assert_array_equal(scene.vertex_arrays["t"][scene.faces[0]], [0, 1, 2])


def test_what_is_empty_or_unknown_is_refused_in_one_line() -> None:
    empty: list[Any] = [meshio.Mesh(np.zeros((0, 3)), []), meshio.Mesh(CUBE, [])]
    for mesh in empty:
        with pytest.raises(clpeel.InputError, match="meshio object: expected triangles, lines or points, got none"):
            clpeel.load(mesh)
