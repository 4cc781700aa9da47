"""The twin against closed forms, before anything is held against it. Needs neither clpeel nor OpenCL."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from twins import reference, soups
from twins.soups import AHEAD, BENCH, Eye

TINY = 1e-12  # float64, a few operations on numbers of size 1


def exact_over(layers: np.ndarray) -> np.ndarray:
    """Straight RGBA [n, 4], front to back, written as the recursion from the back."""
    color = np.zeros(4)
    for r, g, b, a in layers[::-1]:
        color = np.array([a * r, a * g, a * b, a]) + (1 - a) * color
    return color


def test_a_layer_is_alpha_times_colour() -> None:
    picture = reference.render(soups.stack([2.0], (0.5, 0.25, 1.0, 0.4)), AHEAD, (5, 3))
    assert (picture.layers == 1).all()
    want = np.array([0.5, 0.25, 1.0, 1.0]) * float(np.float32(0.4))
    np.testing.assert_allclose(picture.color, np.broadcast_to(want, (3, 5, 4)), rtol=0, atol=TINY)


@pytest.mark.parametrize("count", [1, 2, 3, 100])
def test_equal_layers(count: int) -> None:
    a = float(np.float32(0.1))
    picture = reference.render(soups.stack(np.linspace(1, 4, count), (1.0, 0.5, 0.0, 0.1)), AHEAD, (4, 4))
    cover = 1 - (1 - a) ** count
    want = np.broadcast_to([cover, 0.5 * cover, 0, cover], (4, 4, 4))
    np.testing.assert_allclose(picture.color, want, rtol=0, atol=TINY)
    assert (picture.bound <= (3 * count + 4) * reference.UNIT).all()


def test_order_is_by_distance_then_by_submission() -> None:
    rng = np.random.default_rng(3)
    rgba = rng.random((6, 4)).astype(np.float32)
    distances = np.array([3.0, 1.0, 2.0, 1.0, 2.0, 0.75])
    picture = reference.render(soups.stack(distances, rgba), AHEAD, (2, 2))
    order = [5, 1, 3, 2, 4, 0]
    np.testing.assert_allclose(picture.color[0, 0], exact_over(rgba[order].astype(float)), rtol=0, atol=TINY)
    assert not reference.near_tie(picture).any()


def test_row_0_is_on_top_and_x_goes_right() -> None:
    corner = soups.quad(0.0, 0.5, (255, 0, 0, 255), centre=(0.5, 0.5))  # the upper right quarter of [-1, 1]
    view = Eye((0, 0, 1), (0, 0, 0), view_angle=90.0, clipping_range=None)
    layers = reference.render(corner, view, (8, 8)).layers
    want = np.zeros((8, 8), int)
    want[:4, 4:] = 1
    np.testing.assert_array_equal(layers, want)
    wide = reference.render(corner, view, (16, 8)).layers  # the angle is vertical: a wider image sees more at its sides
    np.testing.assert_array_equal(wide[:, 4:12], want)
    assert wide.sum() == want.sum()
    # From the side: looking along -x, with z up, y points to the right... and from below it is mirrored.
    side = Eye((1, 0.5, 0.5), (0, 0.5, 0.5), (0, 0, 1), 90.0, None)
    flag = soups.paint([[0, 0.5, 0.5], [0, 1.5, 0.5], [0, 0.5, 1.5]], [[0, 1, 2]], (1.0, 1.0, 1.0, 1.0))
    hits = np.argwhere(reference.render(flag, side, (8, 8)).layers)
    assert (hits[:, 0] < 4).all() and (hits[:, 1] >= 4).all() and len(hits) > 4


def test_orthographic_half_height() -> None:
    view = Eye(
        (0, 0, 4), (0, 0, 0), view_angle=2 * np.degrees(np.arctan(0.5)), clipping_range=(1, 10), orthographic=True
    )
    square = soups.quad(0.0, 1.0, (0, 0, 0, 255))  # half height is 4 * 0.5 = 2, so the square takes the middle half
    for z in (0.0, 2.0, -5.0):
        moved = replace(square, vertices=square.vertices + [0, 0, z])
        layers = reference.render(moved, view, (16, 8)).layers
        want = np.zeros((8, 16), int)
        want[2:6, 6:10] = 1
        np.testing.assert_array_equal(layers, want)


def test_interpolation_is_perspective_correct() -> None:
    # A floor at y = -1 whose red channel is its depth / 16: the ray through row r meets it at depth 1 / slope.
    corners = [[-40.0, -1, -1], [40, -1, -1], [40, -1, -16], [-40, -1, -16]]
    red = np.array([1, 1, 16, 16], np.float32) / 16
    colors = np.stack([red, np.zeros(4), np.zeros(4), np.ones(4)], -1).astype(np.float32)
    floor = soups.Soup(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), vertex_colors=colors)
    view = replace(AHEAD, clipping_range=None)
    size = 32
    picture = reference.render(floor, view, (size, size))
    slope = -(1 - (np.arange(size) + 0.5) / size * 2)
    with np.errstate(divide="ignore"):
        depth = 1 / slope
    seen = (depth >= 1) & (depth <= 16)
    np.testing.assert_array_equal(picture.layers, np.repeat(seen[:, None], size, axis=1).astype(int))
    np.testing.assert_allclose(picture.color[seen, 5, 0], depth[seen] / 16, rtol=TINY)


def test_a_plane_through_the_eye_plane() -> None:
    # The floor y = -1 without end, ahead and behind: a ray that points down meets it at 1 / slope, no other does.
    triangle = soups.separate([[[-1e3, -1, 1e3], [1e3, -1, 1e3], [0, -1, -1e6]]], (1.0, 1.0, 1.0, 0.5))
    size = 16
    picture = reference.render(triangle, replace(AHEAD, clipping_range=None), (size, size))
    want = np.zeros((size, size), int)
    want[size // 2 :] = 1
    np.testing.assert_array_equal(picture.layers, want)
    slope = -(1 - (picture.pixel // size + 0.5) / size * 2)
    np.testing.assert_allclose(picture.distance, 1 / slope, rtol=1e-9)
    # Clipped to [2, 4], only rows whose rays arrive within that are left.
    clipped = reference.render(triangle, replace(AHEAD, clipping_range=(2, 4)), (size, size))
    np.testing.assert_array_equal(clipped.layers.ravel()[picture.pixel], (1 / slope >= 2) & (1 / slope <= 4))


def test_clipping_range_includes_its_ends() -> None:
    picture = reference.render(soups.stack([0.4, 0.5, 1, 8, 8.001], (1.0, 1.0, 1.0, 0.5)), AHEAD, (3, 3))
    assert (picture.layers == 3).all()


def test_behind_the_eye_is_not_seen() -> None:
    scene = soups.stack([-1.0, -2.0], (1.0, 1.0, 1.0, 1.0))
    assert not reference.render(scene, replace(AHEAD, clipping_range=None), (4, 4)).layers.any()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_triangles_that_are_not_finite_are_skipped(value: float, axis: int) -> None:
    scene = soups.random(5, 40)
    broken = scene.vertices.copy()
    broken[3 * 7 + 1, axis] = value
    rest = np.delete(np.arange(40), 7)
    want = reference.render(scene.take(rest), BENCH, (24, 24))
    got = reference.render(replace(scene, vertices=broken), BENCH, (24, 24))
    np.testing.assert_array_equal(got.color, want.color)


@pytest.mark.parametrize("seed", range(3))
def test_a_grid_on_the_samples_covers_each_once(seed: int) -> None:
    # World units are pixels here, so the grid's vertices, edges and diagonals run through samples.
    soup = soups.grid(16, 16, (-7.5, -7.5), (8.5, 8.5), (0, 0, 0, 128), jitter=0.0, seed=seed)
    layers = reference.render(soup, soups.pixel_view(32), (32, 32)).layers
    want = np.zeros((32, 32), int)
    want[7:23, 8:24] = (
        1  # x from -7.5 on, without 8.5 (left edge owns); y (down) from -8.5 on, without 7.5 (top edge owns)
    )
    np.testing.assert_array_equal(layers, want)


def test_a_fan_covers_each_sample_once() -> None:
    layers = reference.render(soups.fan(37, 12.0, (0, 0, 0, 128), (0.5, 0.5)), soups.pixel_view(32), (32, 32)).layers
    assert layers.max() == 1
    y, x = np.mgrid[:32, :32] - 15.5
    radius = np.hypot(x - 0.5, -y - 0.5)
    assert (layers[radius < 12 * np.cos(np.pi / 37)] == 1).all() and (layers[radius > 12] == 0).all()


def test_windings_do_not_matter() -> None:
    scene = soups.random(9, 60, colors="vertex")
    turned = replace(scene, faces=scene.faces[:, ::-1])
    a, b = (reference.render(soup, BENCH, (32, 32)) for soup in (scene, turned))
    np.testing.assert_array_equal(a.layers, b.layers)
    np.testing.assert_allclose(a.color, b.color, rtol=0, atol=TINY)


def test_zero_area_is_not_seen() -> None:
    points = [[[0, 0, 0]] * 3, [[0, 0, 0], [1, 1, 0], [2, 2, 0]], [[0, 0, 0], [0, 0, 0], [1, 0, 0]]]
    assert not reference.render(soups.separate(points, (1.0, 1.0, 1.0, 1.0)), BENCH, (33, 33)).layers.any()


def test_against_a_ray_caster_written_another_way() -> None:
    # Moeller and Trumbore's test, one ray at a time, with the ray made from angles.
    scene, view, size = (
        soups.random(21, 30, "large", "vertex"),
        Eye((1, 2, 3), (0.1, 0, -0.2), (0.2, 1, 0), 40, (1, 6)),
        12,
    )
    picture = reference.render(scene, view, (size, size))
    position = np.array(view.position)
    ahead = np.array(view.focal_point) - position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, view.view_up)
    right /= np.linalg.norm(right)
    top = np.cross(right, ahead)
    assert scene.vertex_colors is not None
    for row, column in np.ndindex(size, size):
        u, v = ((column + 0.5) / size * 2 - 1, 1 - (row + 0.5) / size * 2)
        ray = ahead + np.tan(np.radians(20)) * (u * right + v * top)
        hits = []
        for number, face in enumerate(scene.faces):
            a, b, c = scene.vertices[face]
            s, t, distance = np.linalg.solve(np.stack([b - a, c - a, -ray], 1), position - a)
            if s >= 0 and t >= 0 and s + t <= 1 and 1 <= distance <= 6:
                shade = np.array([1 - s - t, s, t]) @ scene.vertex_colors[face].astype(float)
                hits.append((distance, number, shade))
        hits.sort(key=lambda hit: hit[:2])
        want = exact_over(np.array([hit[2] for hit in hits]).reshape(-1, 4))
        np.testing.assert_allclose(picture.color[row, column], want, rtol=0, atol=1e-9)
        assert picture.layers[row, column] == len(hits)


def test_image_rule() -> None:
    color = np.array([[[0.0, 0, 0, 0], [0.25, 0.5, 0.0, 0.5], [1.0, 1, 1, 1]]])
    over = reference.image(color, (0.0, 0.5, 1.0))
    np.testing.assert_array_equal(over[0], [[0, 128, 255, 255], [64, 191, 128, 255], [255, 255, 255, 255]])
    straight = reference.image(color, None)
    np.testing.assert_array_equal(straight[0], [[0, 0, 0, 0], [128, 255, 0, 128], [255, 255, 255, 255]])


def test_the_bound_is_kept_by_a_float32_loop() -> None:
    rng = np.random.default_rng(0)
    worst = 0.0
    for count in (1, 2, 5, 50, 1000):
        rgba = rng.integers(0, 256, (count, 4)).astype(np.uint8)
        rgba[:, 3] = rng.choice([1, 3, 50, 255], p=[0.5, 0.3, 0.15, 0.05], size=count)
        exact, bound = reference.composite(np.zeros(count, np.int64), rgba / 255.0, (1, 1))
        color: Any = np.zeros(4, np.float32)
        clear = np.float32(1)
        for r, g, b, a in (rgba / np.float32(255)).astype(np.float32):
            color = color + clear * np.array([a * r, a * g, a * b, a])
            clear = clear * (np.float32(1) - a)
        assert color.dtype == np.float32
        error = np.abs(color - exact[0, 0]).max()
        assert error <= bound[0, 0] <= (3 * count + 4) * reference.UNIT
        worst = max(worst, error / bound[0, 0])
    assert worst > 0.02, "the bound is so loose that it proves nothing"


def test_edge_distance_of_a_known_square() -> None:
    view, size = soups.pixel_view(16), (16, 16)
    square = soups.quad(0.0, 3.3, (0, 0, 0, 255))  # edges at 3.3 from the middle; samples at 0.5, 1.5, ...
    distance = reference.edge_distance(square, view, size)
    assert distance[8, 11] == pytest.approx(0.2)  # sample x = 3.5
    assert distance[8, 10] == np.inf  # sample x = 2.5, farther than 1/2 from x = 3.3, and from the diagonal
    assert distance[11, 11] == pytest.approx(0.2)  # beyond the corner, in the measure max(|dx|, |dy|)
    assert distance[3, 4] == np.inf and distance[4, 4] == pytest.approx(0.2)
    assert distance[7, 8] == pytest.approx(0.0) or distance[8, 8] == pytest.approx(0.0)  # on the diagonal
    eased = reference.edge_distance(square, view, size, relative=0.1)
    assert eased[8, 11] == 0


def test_edge_distance_by_brute_force() -> None:
    rng = np.random.default_rng(4)
    size = 12
    lines = rng.uniform(-8, 8, (40, 2, 2))
    lines[0] = lines[0, 0]  # a point
    lines[1, 1, 0] = lines[1, 0, 0]  # upright
    lines[2] *= 1e6
    for line in lines:
        got = reference.outline_distance(line[None], (size, size))
        t = np.linspace(0, 1, 4001)[:, None]
        t = t if np.abs(line).max() < 100 else np.zeros((1, 1))
        walk = line[0] + t * (line[1] - line[0])
        for row, column in np.ndindex(size, size):
            sample = np.array([column + 0.5 - size / 2, row + 0.5 - size / 2])
            want = np.abs(walk - sample).max(axis=1).min()
            if len(t) > 1 and min(want, got[row, column]) < 0.49:
                assert got[row, column] == pytest.approx(want, abs=6e-3)  # the walk's step is up to 5e-3


def test_an_edge_from_behind_the_eye() -> None:
    # The edge x = 1, y = -1 runs from behind to far ahead: on the screen, from the lower right towards the middle.
    view = replace(AHEAD, clipping_range=None)
    size = 16
    scene = soups.separate([[[1, -1, 50], [1, -1, -1e5], [1e7, -1, 50]]], (1.0, 1.0, 1.0, 1.0))
    distance = reference.edge_distance(scene, view, (size, size))
    below = np.arange(size // 2, size)
    np.testing.assert_allclose(distance[below, below], 0, atol=1e-3)
    assert (distance[below, below - 2] == np.inf).all() and (distance[: size // 2 - 1] == np.inf).all()
    # The same cut at a near distance: the cut is an edge.
    cut = reference.edge_distance(scene, replace(AHEAD, clipping_range=(2, 100)), (size, size))
    assert (cut[12, 13:] == 0.5).all() and (
        cut[11, 13:] == 0.5
    ).all()  # y = -1 at distance 2 is half way down: row 12's top
    assert (cut[13:, 13:] == np.inf).all()


def test_near_ties_lie_where_planes_cross() -> None:
    # x = z and x = -z cross at x = 0; columns are symmetric about it, so only an odd width has samples on it.
    planes = [[[-2, -9, -4], [2, -9, 0], [0, 9, -2]], [[-2, -9, 0], [2, -9, -4], [0, 9, -2]]]
    soup = soups.separate(planes, (1.0, 1.0, 1.0, 0.5))
    view = replace(AHEAD, clipping_range=None)
    odd = reference.render(soup, view, (9, 9))
    tie = reference.near_tie(odd, 1e-6)
    assert odd.layers.max() == 2
    assert not np.delete(tie, 4, axis=1).any()
    exact = np.array([len(set(odd.distance[odd.pixel == row * 9 + 4])) == 1 for row in range(9)])
    assert (tie[:, 4] | exact | (odd.layers[:, 4] < 2)).all()
    even = reference.render(soup, view, (64, 64))
    assert not reference.near_tie(even, 1e-6).any()
    wide = reference.near_tie(even, 1e-6, shift=0.6)
    assert wide[:, 31:33][even.layers[:, 31:33] == 2].all() and not wide[:, :29].any() and not wide[:, 35:].any()


def test_near_ties_at_the_ends_of_the_clipping_range() -> None:
    for distance, want in (
        (0.5, True),
        (0.5 * (1 - 1e-8), True),
        (0.51, False),
        (8.0, True),
        (8 + 1e-7, True),
        (7.9, False),
    ):
        picture = reference.render(soups.stack([distance], (1.0, 1.0, 1.0, 0.5)), AHEAD, (2, 2))
        assert (reference.near_tie(picture) == want).all(), distance


def test_interpolation_bound_holds_what_a_moved_corner_does() -> None:
    rng = np.random.default_rng(8)
    soup = soups.random(8, 12, "large", "vertex")
    view, size = soups.pixel_view(32), (32, 32)
    flat = soup.vertices * [14, 14, 0.4]
    picture = reference.render(replace(soup, vertices=flat), view, size)
    safe = (reference.edge_distance(replace(soup, vertices=flat), view, size) > 0.1) & ~reference.near_tie(
        picture, shift=0.1
    )
    bound = reference.interpolation_bound(picture, shift=0.1, rounding=0.0)
    used = 0.0
    for _ in range(8):
        moved = flat + rng.choice([-0.1, 0.1], flat.shape) * [1, 1, 0]
        error = np.abs(reference.render(replace(soup, vertices=moved), view, size).color - picture.color).max(axis=2)
        assert (error[safe] <= bound[safe] + TINY).all()
        used = max(used, (error[safe] / np.maximum(bound[safe], TINY)).max())
    assert safe.mean() > 0.3 and 0.1 < used <= 1


def test_expand_lists_every_part_once() -> None:
    counts = np.array([0, 3, 0, 0, 5, 1, 20, 0])
    pieces = list(reference.expand(counts, 4))
    item = np.concatenate([a for a, _ in pieces])
    part = np.concatenate([b for _, b in pieces])
    np.testing.assert_array_equal(np.bincount(item, minlength=8), counts)
    assert all(b == a + 1 or b == 0 for a, b in pairwise(part))
