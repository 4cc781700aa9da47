"""Open3D's meshes, line sets and clouds, legacy and of tensors: arrays, colours, normals and textures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest

import clpeel

o3d: Any = pytest.importorskip(
    "open3d", reason="needs the package open3d: pip install 'clpeel[test-ecosystem]'", exc_type=ImportError
)

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
LINES = np.array([[0, 1], [2, 3]], np.int32)
COLORS = np.array([[0, 0.25, 0.5], [1, 0.75, 0.5], [0, 0, 1], [1, 1, 1]])
NORMALS = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, -1.0]])


def vectors(array: Any) -> Any:
    return o3d.utility.Vector3dVector(array)


def legacy(kind: str) -> Any:
    """An object of open3d.geometry with all of the arrays above that it may have."""
    made = getattr(o3d.geometry, kind)()
    if kind == "TriangleMesh":
        made.vertices, made.triangles = vectors(POINTS), o3d.utility.Vector3iVector(FACES)
        made.vertex_colors, made.vertex_normals = vectors(COLORS), vectors(NORMALS)
    elif kind == "LineSet":
        made.points, made.lines = vectors(POINTS), o3d.utility.Vector2iVector(LINES)
        made.colors = vectors(COLORS[:2])
    else:
        made.points, made.colors, made.normals = vectors(POINTS), vectors(COLORS), vectors(NORMALS)
    return made


def tensors(kind: str) -> Any:
    """The same as one of open3d.t.geometry."""
    return getattr(o3d.t.geometry, kind).from_legacy(legacy(kind), o3d.core.Dtype.Float64)


@pytest.mark.parametrize("make", [legacy, tensors])
def test_meshes(make: Any) -> None:
    scene = clpeel.load(make("TriangleMesh"))
    assert scene.faces.tolist() == FACES.tolist() and scene.vertices.tolist() == POINTS.tolist()
    assert scene.vertex_colors is not None and scene.notes == ()
    np.testing.assert_allclose(scene.vertex_colors, np.column_stack([COLORS, np.ones(4)]))
    np.testing.assert_allclose(scene.vertex_normals, NORMALS)


@pytest.mark.parametrize("make", [legacy, tensors])
def test_line_sets_have_a_color_for_each_line(make: Any) -> None:
    scene = clpeel.load(make("LineSet"))
    assert scene.counts == (0, 2, 0) and scene.lines is not None and scene.vertex_colors is not None
    np.testing.assert_allclose(scene.vertices[scene.lines], POINTS[LINES])
    np.testing.assert_allclose(scene.vertex_colors[scene.lines][:, :, :3], COLORS[:2, None].repeat(2, axis=1))


@pytest.mark.parametrize("make", [legacy, tensors])
def test_clouds(make: Any) -> None:
    scene = clpeel.load(make("PointCloud"))
    assert scene.counts == (0, 0, 4) and scene.vertex_colors is not None
    np.testing.assert_allclose(scene.vertices, POINTS)
    np.testing.assert_allclose(scene.vertex_colors[:, :3], COLORS)
    np.testing.assert_allclose(scene.vertex_normals, NORMALS)


def test_colors_of_triangles_come_from_tensors() -> None:
    mesh = tensors("TriangleMesh")
    mesh.triangle["colors"] = o3d.core.Tensor(np.array([[255, 0, 0], [0, 255, 0]], np.uint8))
    scene = clpeel.load(mesh)
    assert scene.face_colors is not None
    assert scene.face_colors.tolist() == [[255, 0, 0, 255], [0, 255, 0, 255]]
    assert scene.notes == ("vertex colours left out: the triangles have their own",)


def test_colors_beyond_1_are_cut_off_with_a_note() -> None:
    cloud = legacy("PointCloud")
    cloud.colors = vectors(COLORS * 2)
    scene = clpeel.load(cloud)
    assert scene.vertex_colors is not None and scene.vertex_colors.max() == 1
    assert scene.notes == ("vertex colours: 3 of 4 are not within 0..1, and were cut off",)


@pytest.mark.parametrize("read", [o3d.io.read_triangle_mesh, o3d.t.io.read_triangle_mesh], ids=["legacy", "tensors"])
def test_textures_lie_where_those_of_the_same_file_do(read: Any, tmp_path: Path) -> None:
    from PIL import Image

    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32], pixels[32:, 32:] = (255, 0, 0), (0, 0, 255)
    Image.fromarray(pixels).save(tmp_path / "t.png")
    (tmp_path / "t.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd t.png\n")
    rows = ["mtllib t.mtl", "usemtl a"]
    rows += [f"v {x} {y} 0" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    rows += [f"vt {x} {y}" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    (tmp_path / "t.obj").write_text("\n".join([*rows, "f 1/1 2/2 3/3", "f 1/1 3/3 4/4", ""]))
    ours = plainly.render(clpeel.load(tmp_path / "t.obj"), size=(64, 64)).image
    theirs = plainly.render(clpeel.load(read(str(tmp_path / "t.obj"))), size=(64, 64)).image
    assert len(np.unique(ours.reshape(-1, 4), axis=0)) > 3
    np.testing.assert_allclose(theirs.astype(int), ours, atol=1)


@pytest.mark.parametrize("space", ["geometry", "t.geometry"])
@pytest.mark.parametrize("kind", ["TriangleMesh", "LineSet", "PointCloud"])
def test_what_is_empty_is_refused_in_one_line(space: str, kind: str) -> None:
    owner = o3d.geometry if space == "geometry" else o3d.t.geometry
    with pytest.raises(
        clpeel.InputError, match=f"Open3D object: expected .*, got none in the {kind}; the mesh is empty"
    ):
        clpeel.load(getattr(owner, kind)())
