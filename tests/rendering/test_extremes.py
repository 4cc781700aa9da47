"""Where such renderers break, and what is right: one test or more for each number of the list of extremes.

All for `sort`; those of NUMBERS, where neither layers by the ten thousand nor memory are the point, for every exact
technique.

a, c, b: a layer's alpha and colour, the background. u = 2^-24 is the unit roundoff of float32. Where nothing else is
said, `color` must be within the float32 bound of compositing N layers front to back: (3 N + 4) u at most, and tighter
where the transmittance falls (reference.composite derives both).
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import reference, soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH, Eye, Soup

import clpeel
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

ALPHAS = (1 / 255, 0.01, 0.5, 0.999)
NUMBERS = {"03", "05", "06", "08", "09", "15", "17", "19", "21", "22", "26"}
CHOSEN = {"technique": "sort"}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    number = re.match(r"test_(\d\d)_", metafunc.function.__name__)
    if number and number[1] in NUMBERS and "lanes" in metafunc.fixturenames:
        exact = [name for name, technique in TECHNIQUES.items() if technique.exact]
        metafunc.parametrize("chosen", exact, indirect=True)


@pytest.fixture(autouse=True)
def chosen(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The technique that `render` uses."""
    monkeypatch.setitem(CHOSEN, "technique", getattr(request, "param", "sort"))


def render(soup: Soup, view: Eye, size: tuple[int, int], lanes: int, **options: Any) -> clpeel.Result:
    """clpeel's picture of a soup."""
    return plainly.render(soup.scene(), view.camera(), size=size, lanes=lanes, **CHOSEN, **options)


def single(value: float) -> float:
    """The float32 nearest to a number, exactly."""
    return float(np.float32(value))


def covered(alpha: float, count: float) -> float:
    """1 - (1 - a)^N without cancellation."""
    return float(-np.expm1(count * np.log1p(-alpha))) if alpha < 1 else 1.0


def equal_layers(rgba: tuple[float, float, float, float], count: int) -> tuple[list[float], float]:
    """Premultiplied RGBA of N equal layers, c (1 - (1 - a)^N), and the float32 bound; a and c as float32 has them.

    The bound is reference.composite's, summed up: 4 + sum over N layers of min(S, T a / u) + 2 T.
    """
    *color, alpha = map(single, rgba)
    cover = covered(alpha, count)
    n = np.arange(count)
    clear = np.exp(n * np.log1p(-alpha)) if alpha < 1 else (n == 0).astype(float)
    bound = UNIT * (4 + np.minimum(1 - clear * (1 - alpha), clear * alpha / UNIT).sum() + 2 * clear.sum())
    assert bound <= (3 * count + 4) * UNIT
    return [c * cover for c in color] + [cover], bound


def over_in_order(colors: Any) -> np.ndarray:
    """Straight RGBA [n, 4], front to back, to premultiplied RGBA [4], as sums of T a c."""
    colors = np.asarray(colors, float)
    alpha = colors[:, 3]
    clear = np.cumprod(np.r_[1.0, 1 - alpha[:-1]])
    return np.append((clear * alpha) @ colors[:, :3], (clear * alpha).sum())


def bound_in_order(colors: Any) -> float:
    """The float32 bound of reference.composite for the same."""
    alpha = np.asarray(colors, float)[:, 3]
    clear = np.cumprod(np.r_[1.0, 1 - alpha[:-1]])
    weight = clear * alpha
    bound = UNIT * (4 + np.minimum(np.cumsum(weight), weight / UNIT).sum() + 2 * clear.sum())
    assert bound <= (3 * len(alpha) + 4) * UNIT
    return float(bound)


# --- unsafe, hanging, or silently lost --------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [-1, 3, 2**31, 2**31 - 1, -(2**31), 2**32, 2**63 - 1])
def test_01_face_index_out_of_range(index: int) -> None:
    with pytest.raises(clpeel.InputError, match="(?i)face"):
        clpeel.Scene.from_arrays(np.eye(3), np.array([[0, 1, 2], [0, 1, index]], np.int64))


@pytest.mark.parametrize("index", [-1, 9, 2**31 - 1, -(2**31)])
def test_01_the_kernels_guard(index: int, lanes: int, judge: Judge) -> None:
    # Past the host's check, in a scene whose faces were changed afterwards: the bad face is dropped, or refused.
    soup = soups.random(1, 3, "large")
    scene = soup.scene()
    assert scene.bounds.any()  # worked out, and kept, while the faces are still good
    faces = scene.faces.copy()
    faces[1, 2] = index
    object.__setattr__(scene, "faces", faces)
    view = replace(BENCH, clipping_range=(1.0, 8.0))
    try:
        result = plainly.render(scene, view.camera(), size=(40, 40), lanes=lanes)
    except clpeel.InputError:
        return
    judge.same_bits(result, render(soup.take([0, 2]), view, (40, 40), lanes))


def test_02_ten_thousand_full_screen_triangles(lanes: int, judge: Judge) -> None:
    count, size = 10_000, (64, 64)
    rgba = (0.25, 0.5, 1.0, 0.001)
    result = render(soups.stack(np.linspace(1, 7, count), rgba), AHEAD, size, lanes)
    assert result.stats["fragments"] == count * 64 * 64
    assert result.stats["layers_max"] == count
    want, bound = equal_layers(rgba, count)
    judge.color(result, want, bound)


def test_02_more_triangles_than_pixels(lanes: int, judge: Judge) -> None:
    # 200,000 small triangles in 32 x 32 pixels, most of which cover no sample.
    rng = np.random.default_rng(2)
    triangles = rng.uniform(-16, 16, (200_000, 1, 3)) + rng.uniform(-0.7, 0.7, (200_000, 3, 3))
    triangles[..., 2] = rng.uniform(-1, 0.5, (200_000, 1))
    soup, view = soups.separate(triangles, (0.2, 0.9, 0.4, 0.02)), soups.pixel_view(32)
    result = render(soup, view, (32, 32), lanes)
    twin = reference.render(soup, view, (32, 32))
    # Every sample lies near some edge here: the counts must agree but for the few that snapping moves, of equal colour.
    lost = abs(result.stats["fragments"] - twin.layers.sum())
    assert lost <= 0.005 * twin.layers.sum()
    assert np.abs(result.color - twin.color).max() < 0.02 * 3


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_03_vertices_that_are_not_finite(colors: str, lanes: int, judge: Judge) -> None:
    soup = soups.random(3, 40, "large", colors)
    vertices, bad = soup.vertices.copy(), []
    places = [(value, axis, corner) for value in (np.nan, np.inf, -np.inf) for axis in range(3) for corner in range(3)]
    for number, (value, axis, corner) in enumerate(places):
        vertices[3 * number + corner, axis] = value
        bad.append(number)
    vertices[3 * 30], vertices[3 * 31 + 1] = np.nan, (np.inf, -np.inf, np.nan)
    bad += [30, 31]
    broken = replace(soup, vertices=vertices)
    rest = soup.take(np.delete(np.arange(40), bad))
    assert len(bad) == 29
    for view in (BENCH, replace(BENCH, clipping_range=None)):
        result = render(broken, view, (50, 30), lanes)
        assert result.stats["discarded"] == len(bad)
        if view.clipping_range:
            judge.same_bits(result, render(rest, view, (50, 30), lanes))
        else:
            judge.against_twin(result, rest, view, (50, 30))
    assert render(rest, BENCH, (50, 30), lanes).stats["discarded"] == 0


def test_03_nothing_but_infinity(lanes: int) -> None:
    soup = soups.separate(np.full((2, 3, 3), np.inf), (1.0, 1.0, 1.0, 1.0))
    result = render(soup, BENCH, (5, 5), lanes, background=(0, 1, 0))
    assert result.stats["discarded"] == 2
    assert not result.color.any() and (result.image == (0, 255, 0, 255)).all()


@pytest.mark.parametrize("name", ["face_colors", "vertex_colors", "color"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -0.001, 1.001, 256, -1])
@pytest.mark.parametrize("channel", [0, 3])
def test_04_bad_colours(name: str, value: float, channel: int) -> None:
    colors = np.full((3, 4), 0.5) if isinstance(value, float) else np.full((3, 4), 128)
    colors[1 if name != "color" else 0, channel] = value
    given: Any = colors[0] if name == "color" else colors[:2] if name == "face_colors" else colors
    with pytest.raises(clpeel.InputError, match=name):
        clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2], [0, 2, 1]], **{name: given})


@pytest.mark.parametrize("opacity", [np.nan, np.inf, -0.1, 1.1])
def test_04_bad_opacity(opacity: float) -> None:
    with pytest.raises(clpeel.InputError, match="opacity"):
        clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2]], opacity=opacity)


INSIDE = Eye((0.1, 0.05, 0.2), (1.0, 0.3, -0.4), (0.0, 1.0, 0.1), 70.0, (0.001, 10.0))
AT_ONE = Eye((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), view_angle=60.0, clipping_range=(1e-4, 10.0))
CROSSING = {
    # Corners at z < 1 are ahead of the eye at z = 1, those at z > 1 behind it.
    "one behind": [[-1, -1, 0], [1, -1, -1], [0.2, 0.3, 3]],
    "two behind": [[-0.3, 0.2, -2], [2, -1, 3], [-1, -1.5, 4]],
    "in the eye plane": [[-1, -0.5, 0], [1, -0.5, -1], [0.3, -0.2, 1]],
    "two in the eye plane": [[-1, -0.5, 1], [1, -0.5, 1], [0.3, 0.4, -3]],
    "a corner at the eye": [[0, 0, 1], [1, -0.5, -1], [-1, 0.6, -2]],
    "just ahead": [[-1, -0.5, 1 - 1e-7], [1, -0.5, 0], [0.3, 0.9, -1]],
    "just behind": [[-1, -0.5, 1 + 1e-7], [1, -0.5, 0], [0.3, 0.9, -1]],
    "edge-on": [[0, -1, 0], [0, 1, 0], [0, 0, 3]],
    "all behind": [[-1, -1, 2], [1, -1, 2], [0, 1, 5]],
    "floor": [[-100, -0.4, 100], [100, -0.4, 100], [0, -0.4, -300]],
}


@pytest.mark.parametrize("name", CROSSING)
@pytest.mark.parametrize("colors", ["flat", "vertex"])
def test_05_through_the_eye(name: str, colors: str, lanes: int, judge: Judge) -> None:
    painted = np.array([[1, 0, 0, 0.9], [0, 1, 0, 0.5], [0, 0.25, 1, 0.25]], np.float32)
    corners = np.array(CROSSING[name], float)
    if colors == "vertex":
        soup = Soup(corners, np.array([[0, 1, 2]]), vertex_colors=painted)
    else:
        soup = soups.paint(corners, [[0, 1, 2]], painted[0])
    for size in ((48, 48), (70, 33)):
        twin = judge.against_twin(render(soup, AT_ONE, size, lanes), soup, AT_ONE, size)
        assert bool(twin.layers.any()) == (name not in ("all behind", "edge-on", "a corner at the eye"))


@pytest.mark.parametrize("seed", range(4))
def test_05_eye_inside_a_soup(seed: int, lanes: int, judge: Judge) -> None:
    soup = soups.random(seed, 30, "large", ["flat8", "vertex"][seed % 2])
    view = replace(INSIDE, clipping_range=(0.01, 10.0))
    judge.against_twin(render(soup, view, (128, 128), lanes), soup, view, (128, 128))


def test_05_eye_inside_a_closed_mesh(lanes: int, judge: Judge) -> None:
    # Every ray from within a sphere leaves it exactly once.
    soup = soups.sphere(1.0, (0.5, 0.5, 0.5, 0.5))
    for view in (INSIDE, replace(INSIDE, clipping_range=None)):
        result = render(soup, view, (65, 47), lanes)
        assert (result.color[..., 3] == 0.5).all()
        assert result.stats["fragments"] == 65 * 47
        judge.against_twin(result, soup, view, (65, 47))


def test_05_near_plane_slices(lanes: int, judge: Judge) -> None:
    # Near and far cut through: two spheres around the origin, seen from 4 away, only a slab of them drawn.
    soup = soups.merge(soups.sphere(1.0, (0.9, 0.2, 0.1, 0.5)), soups.sphere(0.7, (0.1, 0.3, 0.9, 0.7)))
    view = replace(BENCH, clipping_range=(3.55, 4.2))
    twin = judge.against_twin(render(soup, view, (160, 160), lanes), soup, view, (160, 160))
    assert set(np.unique(twin.layers)) >= {0, 1, 2}


@pytest.mark.parametrize("scale", [1e30, 1e-30, 1e15, 1e-12])
@pytest.mark.parametrize("orthographic", [False, True])
def test_06_any_scale(scale: float, orthographic: bool, lanes: int, judge: Judge) -> None:
    soup, view = soups.random(6, 30, "large"), replace(BENCH, orthographic=orthographic)
    big = replace(soup, vertices=soup.vertices * scale)
    far = replace(view, position=(0.0, 0.0, 4 * scale), clipping_range=(2 * scale, 6 * scale))
    judge.against_twin(render(big, far, (96, 96), lanes), big, far, (96, 96))


def test_06_a_triangle_of_1e30_in_a_scene_of_1(lanes: int, judge: Judge) -> None:
    wall = [[-1e30, -1e30, 0.0], [1e30, -1e30, 0.0], [0.0, 1e30, 0.0]]
    soup = soups.merge(soups.separate([wall], (255, 0, 0, 128)), soups.quad(0.3, 0.5, (0, 0, 255, 64)))
    soup = replace(soup, vertices=soup.vertices + np.array([0, 0, 0.0, 0, 0, 0, 0]).reshape(-1, 1))
    soup.vertices[3:, 2] = 0.5  # the quad is in front
    result = render(soup, BENCH, (64, 64), lanes)
    twin = reference.render(soup, BENCH, (64, 64))
    assert twin.layers.min() == 1 and twin.layers.max() == 2
    quad = reference.edge_distance(soup.take([1, 2]), BENCH, (64, 64)) <= reference.SNAP
    judge.color(result, twin.color, np.where(quad, np.inf, twin.bound))


@pytest.mark.parametrize("reach", [1e4, 1e6, 1e9])
def test_06_a_triangle_a_million_pixels_wide(reach: float, lanes: int, judge: Judge) -> None:
    # Edges that cross the image, with ends that far off on either side.
    view, size = soups.pixel_view(48), (48, 48)
    rng = np.random.default_rng(int(reach) % 1000)
    triangles = []
    for _ in range(6):
        (x, y), angle = rng.uniform(-20, 20, 2), rng.uniform(0, 2 * np.pi)
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        corners = [along, -along, across]
        triangles.append([[x + reach * dx, y + reach * dy, rng.uniform(-1, 0.5)] for dx, dy in corners])
    soup = soups.separate(triangles, rng.uniform(0.2, 0.8, (6, 4)))
    twin, excused, bound = judge.weigh(soup, view, size)
    # Beyond 1e6 the twin's own edges, and the device's pairs of float32, resolve less than 1/512 pixel.
    slack = 2.0**-40 * reach + reach * reach / reach * 2.0**-44
    excused |= reference.edge_distance(soup, view, size) <= reference.SNAP + slack
    result = render(soup, view, size, lanes)
    assert excused.mean() < 0.2
    judge.color(result, twin.color, np.where(excused, np.inf, bound))


def test_06_far_from_the_origin(lanes: int, judge: Judge) -> None:
    # Detail of 1e-3, in steps of 2^-20, that 1e8 + detail holds exactly (float64's step there is 2^-26).
    detail = np.round(soups.random(7, 40, "large").vertices * 1e-3 * 2**20) / 2**20
    here = replace(soups.random(7, 40, "large"), vertices=detail)
    offset = np.array([1e8, -1e8, 1e8])
    there = replace(here, vertices=detail + offset)
    assert (there.vertices - offset == detail).all()
    view = replace(BENCH, position=(0.0, 0.0, 2.0**-8), clipping_range=(2.0**-10, 2.0**-6))
    away = replace(view, position=tuple(offset + view.position), focal_point=tuple(offset))
    result = render(there, away, (96, 96), lanes)
    judge.against_twin(result, there, away, (96, 96))
    judge.against_twin(result, here, view, (96, 96))


SLANTED = [[-9.0, -7.0, -2.1], [8.0, -9.0, -3.7], [1.0, 11.0, -5.3]]


@pytest.mark.parametrize("count", [1, 2, 3, 10, 100, 1000])
@pytest.mark.parametrize("alpha", ALPHAS)
def test_07_same_triangle_k_times(count: int, alpha: float, lanes: int, judge: Judge) -> None:
    rgba = (1.0, 0.5, 0.25, alpha)
    soup = soups.separate([SLANTED] * count, rgba)
    b = (0.125, 0.5, 0.875)
    result = render(soup, AHEAD, (17, 17), lanes, background=b)
    want, bound = equal_layers(rgba, count)
    drawn = result.color[..., 3] > 0
    assert result.stats["layers_max"] == count and result.stats["fragments"] == count * drawn.sum()
    assert drawn.mean() > 0.5
    judge.color(result, np.where(drawn[..., None], want, 0.0), bound)
    # c (1 - (1 - a)^k) + b (1 - a)^k, on the 8-bit picture: within its rounding.
    over = 255 * (np.array(want[:3]) + np.array(b) * (1 - want[3]))
    assert np.abs(result.image[drawn][:, :3] - over).max() <= 0.5 + 255 * 2 * bound


def test_07_an_indexed_triangle_k_times(lanes: int, judge: Judge) -> None:
    soup = soups.paint(SLANTED, [[0, 1, 2]] * 50, (1.0, 0.5, 0.25, 0.05))
    want, bound = equal_layers((1.0, 0.5, 0.25, 0.05), 50)
    result = render(soup, AHEAD, (16, 16), lanes)
    judge.color(result, np.where(result.color[..., 3:] > 0, want, 0.0), bound)


@pytest.mark.parametrize("count", [2, 24, 25, 48, 49, 400])
@pytest.mark.parametrize("indexed", [False, True])
def test_08_coincident_triangles_keep_their_order(count: int, indexed: bool, lanes: int, judge: Judge) -> None:
    # Lists of 24 and less, and longer ones, may be sorted in different ways: each must keep the order of submission.
    rgba = np.random.default_rng(count).uniform(0.05, 0.9, (count, 4)).astype(np.float32)
    for colors in (rgba, rgba[::-1]):
        if indexed:
            soup = soups.paint(SLANTED, [[0, 1, 2]] * count, colors)
        else:
            soup = soups.separate([SLANTED] * count, colors)
        result = render(soup, AHEAD, (17, 17), lanes)
        drawn = result.color[..., 3:] > 0
        assert drawn.mean() > 0.5
        judge.color(result, np.where(drawn, over_in_order(colors), 0.0), bound_in_order(colors))


@pytest.mark.parametrize("order", [[1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]])
def test_08_coincident_whatever_the_winding(order: list[int], lanes: int, judge: Judge) -> None:
    # The same triangle, its corners listed in another order (a mesh with both sides given): still exactly as deep.
    rgba = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5]], np.float32)
    soup = soups.paint(SLANTED, [[0, 1, 2], order], rgba)
    result = render(soup, AHEAD, (33, 33), lanes)
    drawn = result.color[..., 3:] > 0
    judge.color(result, np.where(drawn, over_in_order(rgba), 0.0), (3 * 2 + 4) * UNIT)


RANGES = [(0.5, 8.0), (0.1, 3.0), (0.3, 7.7), (1e-3, 1e3), (0.9, 1.1), (2.0, 6.0), (0.7, 123.456)]


@pytest.mark.parametrize("clipping", RANGES)
@pytest.mark.parametrize("orthographic", [False, True])
def test_09_depth_exactly_0_and_1(clipping: tuple[float, float], orthographic: bool, lanes: int, judge: Judge) -> None:
    """Layers exactly at the near and at the far distance are drawn; those beyond float32's resolution of it are not.

    Depth near / z resolves 2^-24 of a distance, and (far - z) / (far - near) resolves 2^-24 of the range; eight times
    that is beyond doubt.
    """
    near, far = clipping
    beyond = [8 * UNIT * (far - near)] * 2 if orthographic else [8 * UNIT * near, 8 * UNIT * far]
    rgba = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5], [1, 1, 1, 0.5]], np.float32)
    view = Eye((0, 0, 0), (0, 0, -1), view_angle=90.0, clipping_range=clipping, orthographic=orthographic)
    soup = soups.stack([far, near, near - beyond[0], far + beyond[1]], rgba)
    if orthographic:
        soup = replace(soup, vertices=soup.vertices * [9 / near, 9 / near, 1])
    result = render(soup, view, (5, 4), lanes)
    assert result.stats["layers_max"] == 2
    judge.color(result, over_in_order(rgba[[1, 0]]), 10 * UNIT)


def test_09_minus_zero(lanes: int, judge: Judge) -> None:
    # z = 0.0 and z = -0.0 are the same place: two layers, in the order of submission.
    rgba = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5]], np.float32)
    for zeros in ((0.0, -0.0), (-0.0, 0.0)):
        soup = soups.separate([[[-9, -9, z], [9, -9, z], [0, 12, z]] for z in zeros], rgba)
        for view in (BENCH, replace(BENCH, orthographic=True)):
            judge.color(render(soup, view, (6, 6), lanes), over_in_order(rgba), 10 * UNIT)


def test_09_distances_below_0(lanes: int, judge: Judge) -> None:
    # They exist in orthographic views, whose clipping range may begin behind the camera.
    rgba = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5]], np.float32)
    soup = soups.separate([[[-9, -9, z], [9, -9, z], [0, 12, z]] for z in (-1.0, 2.0, 0.0)], rgba)
    view = Eye((0, 0, 0), (0, 0, -1), view_angle=90.0, clipping_range=(-3.0, 3.0), orthographic=True)
    judge.color(render(soup, view, (6, 6), lanes), over_in_order(rgba[[1, 2, 0]]), 13 * UNIT)


@pytest.mark.parametrize("distance", [1.0, 1.25, 1.5, 1.999, 2.0, 3.0, 4.0, 5.7])
@pytest.mark.parametrize("swap", [False, True])
def test_09_next_to_each_other(distance: float, swap: bool, lanes: int, judge: Judge) -> None:
    """Layers at z and at nextafter(z) are separate layers; which is in front shows where float32 can tell.

    near / z of neighbours differ by between half and one step of float32 where z's mantissa is small, so that they may
    round to the same depth: then the order is that of submission. They are never out of order and never lost.
    """
    z = np.float32(distance)
    behind = np.nextafter(z, np.float32(np.inf))
    rgba = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5]], np.float32)
    pair = [float(behind), float(z)] if swap else [float(z), float(behind)]
    result = render(soups.stack(pair, rgba), AHEAD, (6, 6), lanes)
    resolved = np.float32(0.5) / z > np.float32(0.5) / behind
    order = [1, 0] if swap and resolved else [0, 1]
    assert result.stats["layers_max"] == 2
    judge.color(result, over_in_order(rgba[order]), 10 * UNIT)


def test_09_two_steps_apart_are_always_in_order(lanes: int, judge: Judge) -> None:
    rgba = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5]], np.float32)
    for z in np.random.default_rng(9).uniform(0.6, 7, 6).astype(np.float32):
        behind = np.nextafter(np.nextafter(z, np.float32(9)), np.float32(9))
        behind = np.nextafter(behind, np.float32(9))
        result = render(soups.stack([float(behind), float(z)], rgba), AHEAD, (3, 3), lanes)
        judge.color(result, over_in_order(rgba[::-1]), 10 * UNIT)


def test_10_a_hundred_thousand_fragments_in_one_pixel(lanes: int, judge: Judge) -> None:
    # Small triangles around the sample of pixel (row 5, column 2) of 8 x 8; distances all differ, in random order.
    count = 100_000
    rng = np.random.default_rng(10)
    middle = np.array([2 + 0.5 - 4, 4 - 5 - 0.5])
    corners = np.zeros((count, 3, 3))
    corners[..., :2] = middle + np.array([[-0.4, -0.3], [0.4, -0.3], [0.0, 0.45]])
    corners[..., 2] = rng.permutation(np.linspace(-2.9, 0.7, count))[:, None]
    rgba = rng.random((count, 4))
    rgba[:, 3] = 10 ** rng.uniform(-6, -3, count)
    soup, view = soups.separate(corners, rgba), soups.pixel_view(8)
    result = render(soup, view, (8, 8), lanes)
    assert result.stats["layers_max"] == result.stats["fragments"] == count
    assert soup.face_colors is not None
    colors = soup.face_colors[np.argsort(-corners[:, 0, 2])]
    want = np.zeros((8, 8, 4))
    want[5, 2] = over_in_order(colors)
    judge.color(result, want, bound_in_order(colors))


def test_10_a_hundred_thousand_equal_depths(lanes: int, judge: Judge) -> None:
    # The sorter's worst case is often that all keys are equal, or that they come sorted or reversed.
    count = 100_000
    view = soups.pixel_view(4)
    colors = np.random.default_rng(11).random((count, 4)).astype(np.float32) * np.array([1, 1, 1, 1e-3], np.float32)
    shape = np.array([[0.1, 0.1, 0], [0.9, 0.1, 0], [0.5, 0.9, 0]])
    for depths in (np.zeros(count), np.linspace(0.5, -2, count), np.linspace(-2, 0.5, count)):
        corners = shape + depths[:, None, None] * [0, 0, 1]
        result = render(soups.separate(corners, colors), view, (4, 4), lanes)
        sorted_colors = colors[::-1] if depths[-1] > depths[0] else colors
        want = np.zeros((4, 4, 4))
        want[1, 2] = over_in_order(sorted_colors)
        judge.color(result, want, bound_in_order(sorted_colors))


def test_11_nothing_is_truncated(lanes: int, judge: Judge) -> None:
    # sort takes all layers in one pass, in whatever memory: no error beyond the bound, and the flag says so.
    count = 4000
    soup = soups.stack(np.linspace(1, 7, count), (0.75, 0.5, 0.25, 0.001))
    want, bound = equal_layers((0.75, 0.5, 0.25, 0.001), count)
    for memory in ("1M", "64M"):
        result = render(soup, AHEAD, (20, 12), lanes, memory=memory)
        assert result.stats["truncated_pixels"] == 0
        assert result.stats["layers_max"] == count and result.stats["fragments"] == count * 240
        judge.color(result, want, bound)


def test_11_too_many_layers_for_the_memory(lanes: int) -> None:
    # One pixel that does not fit is an error that says what to do, not a wrong picture.
    count = 100_000
    soup = soups.stack(np.full(count, 2.0), (0.75, 0.5, 0.25, 0.001))
    with pytest.raises(clpeel.InputError, match="memory"):
        render(soup, AHEAD, (2, 2), lanes, memory="1M")


# --- a wrong picture --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("count", [1, 2, 3, 10, 24, 25, 100, 1000, 65_536])
def test_12_equal_layers(alpha: float, count: int, lanes: int, judge: Judge) -> None:
    rgba = (1.0, 0.5, 0.125, alpha)
    b = (0.25, 0.75, 1.0)
    result = render(soups.stack(np.linspace(1, 7, count), rgba), AHEAD, (3, 2), lanes, background=b)
    want, bound = equal_layers(rgba, count)
    judge.color(result, want, bound)
    judge.image(result, b)
    over = 255 * (np.array(want[:3]) + np.array(b) * (1 - want[3]))
    assert np.abs(result.image[..., :3] - over).max() <= 0.5 + 255 * 2 * bound


@pytest.mark.parametrize("count", [1000])
def test_12_layers_of_a_255th_in_bytes(count: int, lanes: int, judge: Judge) -> None:
    # uint8 colours take another way than floats; white on black, as 8-bit buffers stick at 128 (number 13).
    result = render(
        soups.stack(np.linspace(1, 7, count), (255, 255, 255, 1)), AHEAD, (2, 2), lanes, background=(0, 0, 0)
    )
    want, bound = equal_layers((1.0, 1.0, 1.0, 1 / 255), count)
    judge.color(result, want, bound)
    assert (result.image[..., :3] == 250).all()  # 249.99


@pytest.mark.parametrize("background", [(0.2, 0.4, 0.6), (1.0, 1.0, 1.0), (1 / 3, 0.999, 1e-3), None])
@pytest.mark.parametrize("colors", ["flat8", "flat", "vertex"])
def test_15_all_transparent(
    background: tuple[float, float, float] | None, colors: str, lanes: int, judge: Judge
) -> None:
    soup = soups.random(15, 60, "large", colors, alpha=(0.0, 0.0))
    result = render(soup, BENCH, (40, 24), lanes, background=background)
    assert result.stats["fragments"] > 1000
    assert not result.color.any()
    empty = render(soups.stack([-5.0], (1.0, 1.0, 1.0, 1.0)), AHEAD, (40, 24), lanes, background=background)
    judge.same_bits(result, empty)
    want = reference.image(np.zeros((24, 40, 4)), background)
    np.testing.assert_array_equal(result.image, want)


@pytest.mark.parametrize("color", [255, 254, 128, 127, 1, 0])
@pytest.mark.parametrize("b", [0.0, 1.0, 0.25])
def test_17_one_layer_of_a_255th(color: int, b: float, lanes: int, judge: Judge) -> None:
    result = render(soups.stack([2.0], (color, 255, 0, 1)), AHEAD, (2, 2), lanes, background=(b, b, b))
    a = 1 / 255
    want = np.array([a * color / 255, a, 0, a])
    # One layer: a and c are rounded once each and so is their product; alpha may be had as 1 - (1 - a).
    error = np.abs(result.color - want).max(axis=(0, 1))
    assert (error <= [3 * a * UNIT, 3 * a * UNIT, 0, UNIT]).all()
    over = want[:3] + (1 - a) * b
    exact = np.floor(255 * over + 0.5)
    half = np.abs(255 * over + 0.5 - np.round(255 * over + 0.5)) < 1e-3  # too near a half step to call
    assert ((result.image[..., :3] == exact) | half).all()


@pytest.mark.parametrize("rgb", [(255, 0, 17), (1, 2, 3), (128, 254, 99)])
@pytest.mark.parametrize("floats", [False, True])
def test_19_an_opaque_fragment_in_front(rgb: tuple[int, int, int], floats: bool, lanes: int) -> None:
    behind = np.random.default_rng(19).integers(0, 256, (1000, 4)).astype(np.uint8)
    colors: Any = np.concatenate([behind[:500], [(*rgb, 255)], behind[500:]]).astype(np.uint8)
    if floats:
        colors = colors.astype(np.float32) / np.float32(255)
    distances = np.r_[np.linspace(2, 7, 500), 1.0, np.linspace(2, 7, 500)]
    for b in ((1.0, 1.0, 1.0), (0.0, 0.5, 0.0)):
        result = render(soups.stack(distances, colors), AHEAD, (4, 4), lanes, background=b)
        exact = np.append(np.array(rgb, np.float32) / np.float32(255), np.float32(1))
        assert (result.color == exact).all()
        assert (result.image == (*rgb, 255)).all()


def test_19_only_what_is_in_front_counts(lanes: int, judge: Judge) -> None:
    distances = np.linspace(1, 7, 61)
    front = np.random.default_rng(20).uniform(0.05, 0.9, (30, 4)).astype(np.float32)
    wall = np.array([[0.2, 0.4, 0.6, 1.0]], np.float32)
    pictures = []
    for seed in (1, 2):
        rest = np.random.default_rng(seed).random((30, 4)).astype(np.float32)
        soup = soups.stack(distances, np.concatenate([front, wall, rest]))
        order = np.random.default_rng(seed).permutation(61)
        pictures.append(render(soup.take(order), AHEAD, (4, 4), lanes))
    judge.same_bits(pictures[0], pictures[1])
    assert (pictures[0].color[..., 3] == 1).all()


HALF = (1.0, 0.5, 0.0, 0.5)


def covered_once(result: clpeel.Result) -> np.ndarray:
    """Where one layer of HALF was drawn: bool [h, w]; fails where two were."""
    alpha = result.color[..., 3]
    assert set(np.unique(alpha)) <= {0.0, 0.5}, f"covered twice: {np.argwhere(alpha > 0.5)[:5]}"
    assert result.stats["fragments"] == (alpha == 0.5).sum()
    return np.asarray(alpha == 0.5)


@pytest.mark.parametrize("corners", [3, 4, 7, 64, 500])
@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.5, 0.5), (0.25, -3.1)])
def test_21_fans(corners: int, centre: tuple[float, float], lanes: int, judge: Judge) -> None:
    size = (53, 40)
    for phase in (0.0, 0.37):
        soup = soups.fan(corners, 17.3, HALF, centre, phase)
        result = render(soup, soups.pixel_view(40), size, lanes)
        inside = covered_once(result)
        y, x = np.mgrid[:40, :53] + 0.5
        radius = np.hypot(x - 26.5 - centre[0], 20 - y - centre[1])
        assert inside[radius < 17.3 * np.cos(np.pi / corners) - 0.01].all() and not inside[radius > 17.31].any()


@pytest.mark.parametrize("view", ["pixels", "perspective"])
@pytest.mark.parametrize("jitter", [0.0, 0.24])
@pytest.mark.parametrize("cells", [1, 7, 60])
def test_21_grids_cover_the_screen(view: str, jitter: float, cells: int, lanes: int) -> None:
    # A jitter below 1/4 of a cell keeps all quads convex.
    low, high = (-40.0, -40.0), (40.0, 40.0)
    soup = soups.grid(cells, cells + 3, low, high, HALF, jitter, seed=cells)
    eye = soups.pixel_view(45)
    if view == "perspective":
        eye = Eye((3, -7, 40), (1, 2, 0), (0.3, 1, 0), 50.0, (1, 200))
    result = render(soup, eye, (50, 45), lanes)
    assert covered_once(result).all()
    assert result.stats["fragments"] == 50 * 45


@pytest.mark.parametrize("offset", [0.0, 0.5, 0.25, 1 / 512])
def test_21_grids_on_the_samples(offset: float, lanes: int) -> None:
    # Unit cells: with an offset of 0.5 all vertices, edges and diagonals run through samples.
    low, high = (-12 + offset, -12 + offset), (12 + offset, 12 + offset)
    result = render(soups.grid(24, 24, low, high, HALF, seed=3), soups.pixel_view(32), (32, 32), lanes)
    assert covered_once(result).sum() == 24 * 24


@pytest.mark.parametrize("steps", [24])
def test_21_rotated_quads(steps: int, lanes: int, judge: Judge) -> None:
    view, size = soups.pixel_view(40), (40, 40)
    for angle in np.linspace(0, np.pi / 2, steps):
        soup = soups.quad(angle, 11.7, HALF, (0.3, -0.2))
        result = render(soup, view, size, lanes)
        inside = covered_once(result)
        twin = reference.render(soup, view, size)
        edge = reference.edge_distance(soup, view, size) <= reference.SNAP + 1e-9
        assert ((inside == (twin.layers == 1)) | edge).all()


def test_21_the_outside_of_a_hole_meets_its_filling(lanes: int) -> None:
    # A screen with a fan-shaped hole, and the fan that fills it: the shared rim belongs to one side only.
    corners, radius = 37, 14.2
    rim = soups.fan(corners, radius, HALF, (0.2, 0.1), 0.05).vertices[1:]
    wide = soups.fan(corners, 90.0, HALF, (0.2, 0.1), 0.05).vertices[1:]
    k = np.arange(corners)
    after = (k + 1) % corners
    ring = np.concatenate([np.stack([k, after, corners + k], -1), np.stack([after, corners + after, corners + k], -1)])
    around = soups.paint(np.concatenate([rim, wide]), ring, HALF)
    both = soups.merge(around, soups.fan(corners, radius, HALF, (0.2, 0.1), 0.05))
    result = render(both, soups.pixel_view(41), (41, 41), lanes)
    assert covered_once(result).all()


def test_22_zero_area(lanes: int) -> None:
    point = [[0.5, 0.5, 0]] * 3
    line = [[-9, -9, 0], [0.5, 0.5, 0], [9, 9, 0]]
    twice = [[-9, 0.5, 0], [9, 0.5, 0], [-9, 0.5, 0]]
    edge_on = [[-9, 0.5, 0], [9, 0.5, 0.2], [0, 0.5, -0.2]]
    soup = soups.separate([point, line, twice, edge_on], HALF)
    result = render(soup, soups.pixel_view(20), (20, 20), lanes)
    assert result.stats["fragments"] == 0 and not result.color.any()
    assert result.stats["discarded"] == 0


def test_22_between_the_samples(lanes: int) -> None:
    # Triangles within a pixel that miss its sample, all over the image: nothing; those that hold it: all of them.
    rows, columns = np.mgrid[:24, :24].reshape(2, -1)
    middle = np.stack([columns + 0.5 - 12, 12 - rows - 0.5, np.zeros(576)], -1)[:, None]
    beside = np.array([[0.05, 0.05, 0], [0.45, 0.05, 0], [0.05, 0.45, 0]])
    around = np.array([[-0.02, -0.02, 0], [0.03, -0.01, 0], [0.0, 0.02, 0]])
    view = soups.pixel_view(24)
    for shape, count in ((beside, 0), (-beside, 0), (beside * [1, -1, 1], 0), (around, 576)):
        result = render(soups.separate(middle + shape, HALF), view, (24, 24), lanes)
        assert result.stats["fragments"] == count
        assert covered_once(result).sum() == count


def test_22_slivers(lanes: int, judge: Judge) -> None:
    # Width to length of 1 to 10^6, at many angles: what they cover may differ from the twin only at their edges.
    view, size = soups.pixel_view(64), (64, 64)
    rng = np.random.default_rng(22)
    triangles = []
    for thickness in (1e-6, 1e-4, 1e-2, 3e-2):
        for _ in range(20):
            angle, length = rng.uniform(0, np.pi), 10 ** rng.uniform(1, 4)
            along = np.array([np.cos(angle), np.sin(angle)])
            across = np.array([-along[1], along[0]]) * thickness * length
            at = rng.uniform(-20, 20, 2)
            ends = [at - along * length / 2, at + along * length / 2, at + across]
            triangles.append([[*end, rng.uniform(-2, 0.5)] for end in ends])
    soup = soups.separate(triangles, rng.uniform(0.1, 0.6, (len(triangles), 4)))
    judge.against_twin(render(soup, view, size, lanes), soup, view, size)


def test_22_slivers_leave_no_gap(lanes: int) -> None:
    # A screen cut by hundreds of slivers that share their edges: each sample once, though most are thinner than a step.
    rng = np.random.default_rng(23)
    xs = np.sort(
        np.r_[-30.0, 30.0, rng.uniform(-26, 26, 300), rng.uniform(-26, -26 + 1e-2, 100), rng.choice(64, 20) - 32.5]
    )
    top = np.stack([xs, np.full_like(xs, 30), np.zeros_like(xs)], -1)
    lean = np.stack([np.sort(xs + rng.uniform(-3, 3, len(xs))), np.full_like(xs, -30), np.zeros_like(xs)], -1)
    k, n = np.arange(len(xs) - 1), len(xs)
    faces = np.concatenate([np.stack([k, k + 1, n + k], -1), np.stack([k + 1, n + k + 1, n + k], -1)])
    soup = soups.paint(np.concatenate([top, lean]), rng.permutation(faces), HALF)
    result = render(soup, soups.pixel_view(48), (40, 48), lanes)
    assert covered_once(result)[:, 2:-2].all()


def test_22_exactly_on_edges_and_vertices(lanes: int) -> None:
    # A unit square whose four edges run through samples owns those at its left and top; so does each of its halves.
    view = soups.pixel_view(8)
    square = [[-1.5, -1.5, 0], [1.5, -1.5, 0], [1.5, 1.5, 0], [-1.5, 1.5, 0]]
    want = np.zeros((8, 8), bool)
    want[2:5, 2:5] = True  # of samples -1.5, -0.5, 0.5, 1.5: x without 1.5, and y (up) without -1.5
    for faces in ([[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]], [[2, 1, 0], [0, 2, 3]], [[3, 1, 0], [1, 3, 2]]):
        result = render(soups.paint(square, faces, HALF), view, (8, 8), lanes)
        np.testing.assert_array_equal(covered_once(result), want)


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_25_shuffled_triangles(colors: str, lanes: int, judge: Judge) -> None:
    soup = soups.random(25, 250, "large", colors)
    size = (70, 50)
    first = render(soup, BENCH, size, lanes)
    assert first.stats["layers_max"] > 24, "too few layers to take the long sort"
    tie = judge.ties(reference.render(soup, BENCH, size))
    assert tie.mean() < 0.001
    for seed in range(5):
        other = render(soup.take(np.random.default_rng(seed).permutation(250)), BENCH, size, lanes)
        bad = (other.color.view(np.uint32) != first.color.view(np.uint32)).any(axis=2) & ~tie
        if bad.any():
            judge.fail(f"shuffled with seed {seed}", other.image, first.image, bad)


@pytest.mark.parametrize("colors", soups.COLORS)
def test_25_lanes_and_repeats(colors: str, judge: Judge) -> None:
    soup = soups.random(26, 100, "mixed", colors)
    renderers = [plainly.Renderer(soup.scene(), lanes=lanes) for lanes in (1, 64, 16)]
    first = renderers[0].render(BENCH.camera(), size=(64, 40))
    for renderer in renderers:
        for _ in range(100 if colors == "flat8" else 10):
            judge.same_bits(renderer.render(BENCH.camera(), size=(64, 40)), first)


THREADS = """
import hashlib, sys
sys.path.insert(0, sys.argv[1])
import clpeel
from twins import soups
soup = soups.random(27, 150, "large", "vertex")
for lanes in (1, 64):
    result = clpeel.render(soup.scene(), soups.BENCH.camera(), size=(100, 70), lanes=lanes)
    print(hashlib.sha256(result.color.tobytes() + result.image.tobytes()).hexdigest())
"""


def test_25_any_number_of_threads() -> None:
    tests = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    seen = set()
    for threads in ("1", "2", "7"):
        # PoCL's names for its number of threads, old and new; other drivers ignore them.
        environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": threads, "POCL_CPU_MAX_CU_COUNT": threads}
        done = subprocess.run(
            [sys.executable, "-c", THREADS, tests], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        seen.update(done.stdout.split())
    soup = soups.random(27, 150, "large", "vertex")
    here_too = render(soup, BENCH, (100, 70), 1)
    seen.add(hashlib.sha256(here_too.color.tobytes() + here_too.image.tobytes()).hexdigest())
    assert len(seen) == 1


@pytest.mark.parametrize("size", [(1, 1), (1, 16384), (16384, 1), (17, 33), (15, 16), (31, 1), (1, 17)])
def test_26_odd_sizes(size: tuple[int, int], lanes: int, judge: Judge) -> None:
    # In pixels, so that the picture's extent is known: a wall over all of it, and a soup over its middle.
    width, height = size
    wall = soups.separate(
        [[[-width, -height, 0.5], [3 * width, -height, 0.5], [-width, 3 * height, 0.5]]], (9, 99, 199, 51)
    )
    soup = soups.random(26, 40, "large")
    soup = soups.merge(wall, replace(soup, vertices=soup.vertices * [width * 0.4, height * 0.4, 0.2]))
    view = soups.pixel_view(height)
    result = render(soup, view, size, lanes)
    assert result.image.shape == (height, width, 4) and result.color.shape == (height, width, 4)
    twin, excused, bound = judge.weigh(soup, view, size)
    judge.color(result, twin.color, np.where(excused, np.inf, bound))
    judge.image(result, (1.0, 1.0, 1.0))
    assert (twin.layers >= 1).all() and (result.color[..., 3] >= 0.199).all()


@pytest.mark.parametrize("size", [(1, 1), (300, 2), (2, 300), (16384, 1), (1, 16384)])
def test_26_odd_sizes_in_perspective(size: tuple[int, int], lanes: int, judge: Judge) -> None:
    aspect = max(size[0] / size[1], 1)
    soup = soups.stack([1.0, 3.0], np.array([[255, 0, 0, 128], [0, 255, 0, 64]], np.uint8), reach=1.5 * aspect)
    result = render(soup, AHEAD, size, lanes)
    judge.color(result, over_in_order(np.array([[255, 0, 0, 128], [0, 255, 0, 64]]) / 255), 10 * UNIT)
    assert result.stats["fragments"] == 2 * size[0] * size[1]


@pytest.mark.parametrize(
    "size", [(0, 10), (10, 0), (0, 0), (-1, 5), (5, -3), (1.5, 2), (10,), (10, 10, 10), "ab", None]
)
def test_26_no_such_size(size: Any) -> None:
    soup = soups.random(26, 2)
    with pytest.raises(clpeel.InputError, match="size"):
        plainly.render(soup.scene(), BENCH.camera(), size=size)
