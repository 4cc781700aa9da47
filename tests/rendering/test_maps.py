"""Maps of a view: what is seen first at a pixel's centre, beside what geometry says by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import plainly
import pytest

import clpeel

SIZE = (40, 30)
TILTED = np.array([(-9, -9, -2.0), (9, -9, 1.0), (0, 9, 3.0)])
"""A triangle that fills the view, behind another one."""
FRONT = np.array([(0, 0, 4.0), (0, 2, 4), (2, 0, 4)])
"""A smaller one before it, wound the other way: its front is not seen."""


def scene(alpha: int = 128) -> clpeel.Scene:
    vertices = np.concatenate([TILTED, FRONT])
    return clpeel.Scene.from_arrays(vertices, [(0, 1, 2), (3, 4, 5)], color=(200, 100, 50, alpha))


CAMERA = clpeel.Camera((0, 0, 12), (0, 0, 0))
PARALLEL = clpeel.Camera((0, 0, 12), (0, 0, 0), orthographic=True)


def rays(camera: clpeel.Camera) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel's ray begins, and its direction, whose part along the view axis is 1: [h, w, 3] each."""
    width, height = SIZE
    half = np.tan(np.radians(camera.view_angle / 2))
    x = ((np.arange(width) + 0.5) * 2 / width - 1) * half * width / height
    y = (1 - (np.arange(height) + 0.5) * 2 / height) * half
    across, up = np.meshgrid(x, y)
    sideways = np.stack([across, up, np.zeros_like(up)], axis=-1)
    straight = np.array((0, 0, -1.0))
    if camera.orthographic:
        return np.asarray(camera.position) + sideways * camera.distance, np.broadcast_to(straight, sideways.shape)
    return np.broadcast_to(camera.position, sideways.shape), sideways + straight


def hits(corners: np.ndarray, camera: clpeel.Camera) -> np.ndarray:
    """The view distance of a triangle at each pixel's centre, infinite beside it: [h, w]."""
    begin, along = rays(camera)
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    t = ((a - begin) @ normal) / (along @ normal)
    point = begin + t[..., None] * along
    inside = np.ones(t.shape, bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.cross(q - p, point - p) @ normal > 0
    return np.where(inside, t, np.inf)


@pytest.mark.parametrize("camera", [CAMERA, PARALLEL], ids=["perspective", "parallel"])
@pytest.mark.parametrize("samples", [1, 4])
def test_what_is_seen_first(camera: clpeel.Camera, samples: int, lanes: int) -> None:
    names = ("depth", "normal", "triangle", "layer_count")
    result = plainly.render(scene(), camera, SIZE, samples=samples, maps=names, lanes=lanes)
    assert list(result.maps) == list(names)
    distances = np.stack([hits(TILTED, camera), hits(FRONT, camera)])
    want = np.where(np.isinf(distances.min(axis=0)), -1, distances.argmin(axis=0))
    assert {0, 1} <= set(want.ravel()) and result.triangle.dtype == np.int32
    assert (result.triangle == want).mean() > 0.99  # edges are snapped to 1/256 of a pixel
    same = result.triangle == want
    depth = distances.min(axis=0)
    assert np.allclose(result.depth[same], depth[same], rtol=1e-6)
    assert (result.layer_count[same] == np.isfinite(distances).sum(axis=0)[same]).all()
    normal = np.cross(TILTED[1] - TILTED[0], TILTED[2] - TILTED[0])
    assert np.allclose(result.normal[want == 0][0], normal / np.linalg.norm(normal), atol=1e-6)
    assert np.allclose(result.normal[(want == 1) & same], (0, 0, 1))  # towards the camera, not as it is wound


def test_transmittance_is_what_alpha_leaves() -> None:
    result = plainly.render(scene(51), CAMERA, SIZE, maps=("transmittance", "layer_count"))
    assert np.allclose(result.transmittance, 0.8**result.layer_count, atol=1e-6)


def test_a_map_changes_no_picture(judge: Any) -> None:
    plain = plainly.render(scene(), CAMERA, SIZE, samples=4)
    with_maps = plainly.render(scene(), CAMERA, SIZE, samples=4, maps="depth")
    judge.same_bits(with_maps, plain)
    assert list(with_maps.maps) == ["depth"] and not plain.maps


@pytest.mark.parametrize("technique", ["depth-peeling", "weighted-sum", "thickness", "layer-count", "auto"])
def test_any_technique_has_them(technique: str) -> None:
    """The nearest triangle is seen from behind and single-sided, so it is not there; the next one is opaque."""
    vertices = np.concatenate([TILTED - (0, 0, 3), TILTED, FRONT])
    colors = [(9, 9, 9, 128), (200, 100, 50, 255), (9, 9, 9, 128)]
    made = clpeel.Scene.from_arrays(
        vertices, [(0, 1, 2), (3, 4, 5), (6, 7, 8)], face_colors=np.array(colors, np.uint8), single_sided=True
    )
    names = ("depth", "triangle", "layer_count")
    result = plainly.render(made, CAMERA, SIZE, technique=technique, maps=names)
    truth = plainly.render(made, CAMERA, SIZE, maps=names)
    assert 1 in truth.triangle and 2 not in truth.triangle
    assert (result.depth == truth.depth).all() and (result.triangle == truth.triangle).all()
    if technique != "layer-count":  # which counts all
        assert truth.layer_count.max() == 1 and (result.layer_count == truth.layer_count).all()


def test_peeling_less_leaves_the_maps() -> None:
    result = plainly.render(
        scene(), CAMERA, SIZE, technique="depth-peeling", passes=1, layers=True, maps=("layer_count",)
    )
    assert result.layers.count == 1 and result.layer_count.max() == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"maps": ("deepness",)},
            "maps: expected names that 'sort' makes (depth, normal, triangle, layer_count, transm",
        ),
        ({"maps": 3}, "maps: expected names of maps, such as ('depth', 'normal'), got 3"),
        ({"maps": ("error_bound",)}, "got 'error_bound'"),
        (
            {"maps": "transmittance", "technique": "thickness"},
            "maps: expected names that 'thickness' makes (thickness, ",
        ),
        (
            {"maps": "transmittance", "keep_color": False},
            "maps: expected keep_color=True with transmittance, got False",
        ),
    ],
)
def test_maps_that_cannot_be(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError) as raised:
        plainly.render(scene(), CAMERA, SIZE, **options)
    assert message in str(raised.value)


def test_a_map_that_was_not_asked_for() -> None:
    with pytest.raises(clpeel.InputError, match=r"depth: expected a result rendered with maps=\('depth',\), got one"):
        _ = plainly.render(scene(), CAMERA, SIZE).depth


def test_lines_and_points_have_no_normal() -> None:
    marks = clpeel.Scene.from_arrays([(-1, 0, 0), (1, 0, 0), (0, 1, 0)], lines=[(0, 1)], points=[2], color="red")
    result = plainly.render(marks, CAMERA, SIZE, line_width=9, point_size=9, maps=("normal", "triangle", "depth"))
    assert {-1, 0, 1} == set(result.triangle.ravel()) and not result.normal.any()
    assert np.isfinite(result.depth[result.triangle >= 0]).all()


@pytest.mark.parametrize("size", [1e-150, 1e150])
def test_normals_of_any_size(size: float) -> None:
    from clpeel.rendering.maps import face_normals

    huge = clpeel.Scene.from_arrays(TILTED * size, [(0, 1, 2)], color="red")
    view = clpeel.Camera((0, 0, 12 * size), (0, 0, 0))
    normal = np.cross(TILTED[1] - TILTED[0], TILTED[2] - TILTED[0])
    found = face_normals(np.array([[0, -1]], np.int32), huge, view)
    assert np.allclose(found[0, 0], normal / np.linalg.norm(normal), atol=1e-6) and not found[0, 1].any()
