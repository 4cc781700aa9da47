"""Scalars in pictures: each fragment has the colour of the number there, as a float64 twin interpolates it."""

from __future__ import annotations

from typing import Any

import numpy as np
import plainly
import pytest
from numpy.typing import NDArray

import clpeel
from clpeel.pictures.colormaps import sampled
from clpeel.scene.transfer import transfer

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (180, 140)
CAMERA = clpeel.Camera((1.7, 1.1, 1.6), (0.0, 0.0, 0.0), view_angle=50)
BARE = {"lighting": "none", "background": None, "samples": 1}


def sphere() -> clpeel.Scene:
    """A sphere of 20 vertices: two poles, and three rings of six. The edges of its faces are seen at a slant."""
    ring = np.arange(6) / 6 * 2 * np.pi
    rings = [
        np.stack([np.sin(t) * np.cos(ring), np.full(6, np.cos(t)), np.sin(t) * np.sin(ring)], axis=1)
        for t in (np.pi / 4, np.pi / 2, 3 * np.pi / 4)
    ]
    vertices = np.concatenate([[[0.0, 1, 0]], *rings, [[0.0, -1, 0]]])
    k = np.arange(6)
    right = (k + 1) % 6
    faces = [np.stack([0 * k, 1 + right, 1 + k], axis=1), np.stack([0 * k + 19, 13 + k, 13 + right], axis=1)]
    for first in (1, 7):
        faces.append(np.stack([first + k, first + right, first + 6 + right], axis=1))
        faces.append(np.stack([first + k, first + 6 + right, first + 6 + k], axis=1))
    return clpeel.Scene.from_arrays(vertices, np.concatenate(faces))


SPHERE = sphere()
HEIGHTS = np.sin(np.arange(20) * 2.1) * 3 + SPHERE.vertices[:, 1]


def shares(scene: clpeel.Scene, layers: clpeel.Layers) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The face of each pixel's first layer, -1 for none, and the shares of its corners: [h, w], and [h, w, 3]."""
    width, height = layers.size
    triangle = np.full(width * height, -1)
    there = np.flatnonzero(np.diff(layers.start))
    triangle[there] = layers.triangle[layers.start[there]]
    right, up, forward = CAMERA.axes()
    reach = np.tan(np.radians(CAMERA.view_angle) / 2)
    rows, columns = np.divmod(np.arange(width * height), width)
    x = (2 * (columns + 0.5) - width) / height * reach
    y = (height - 2 * (rows + 0.5)) / height * reach
    rays = forward + x[:, None] * right + y[:, None] * up
    a, b, c = scene.vertices[scene.faces[triangle]].transpose(1, 0, 2)
    system = np.stack([b - a, c - a, -rays], axis=-1)
    found = np.linalg.solve(system, (np.array(CAMERA.position) - a)[..., None])[..., 0]
    weights = np.stack([1 - found[:, 0] - found[:, 1], found[:, 0], found[:, 1]], axis=-1)
    return triangle.reshape(height, width), weights.reshape(height, width, 3)


def drawn(values: Any, scene: clpeel.Scene = SPHERE, **options: Any) -> clpeel.Result:
    lanes = options.pop("lanes", 1)
    return plainly.render(clpeel.with_scalars(scene, values, **options), CAMERA, SIZE, lanes=lanes, **BARE)


@pytest.fixture(scope="module")
def twin() -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.float64]]:
    """Where the sphere is seen, the corners of the face there, and their shares, all in float64."""
    layers = plainly.render(SPHERE, CAMERA, SIZE, layers=True, **BARE).layers
    triangle, weights = shares(SPHERE, layers)
    return triangle >= 0, SPHERE.faces[triangle], weights


def places_of(twin: Any, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the pixels' numbers are along the map, from those of the vertices."""
    there, corners, weights = twin
    return np.asarray((places[corners] * weights).sum(axis=-1))[there]


def check(result: clpeel.Result, twin: Any, places: NDArray[np.float64], colors: NDArray[np.uint8]) -> None:
    """Each pixel has the colour of its number, or of the next one where float32, and corners on a grid, come near it.

    colors: with those below and above, [k + 2, 4]. places: of vertices, 0..k.
    """
    shown, exact = result.image[twin[0]], places_of(twin, places)
    assert len(exact) > 5000
    count = len(colors) - 2
    off = 0.05 * max(count / 256, 1)  # corners lie on a grid of 1/256 pixel
    choices = [colors[np.clip(np.floor(exact + by), -1, count).astype(int) + 1] for by in (-off, 0, off)]
    assert np.any([(choice == shown).all(axis=1) for choice in choices], axis=0).all()
    assert ((choices[1] == shown).all(axis=1)).mean() > 0.9
    assert len(np.unique(shown, axis=0)) > min(count, 100) * 0.8


def row_of(colors: NDArray[np.uint8], below: Any = None, above: Any = None) -> NDArray[np.uint8]:
    return np.vstack([colors[0] if below is None else below, colors, colors[-1] if above is None else above])


@pytest.mark.parametrize("count", [256, 7, 1000])
@pytest.mark.parametrize("lanes", [1, 64])
def test_a_fragment_has_the_color_of_its_number(twin: Any, lanes: int, count: int) -> None:
    """And, unlit, the map's own bytes, to the bit."""
    low, high = HEIGHTS.min(), HEIGHTS.max()
    result = drawn(HEIGHTS, n_colors=count, lanes=lanes)
    check(result, twin, (HEIGHTS - low) / (high - low) * count, row_of(sampled("viridis", count)))
    assert (result.image == drawn(HEIGHTS, n_colors=count, lanes=65 - lanes).image).all()


def test_numbers_beyond_the_range(twin: Any) -> None:
    places = (HEIGHTS + 1) / 2.5 * 256
    plain = row_of(sampled("viridis", 256))
    check(drawn(HEIGHTS, clim=(-1, 1.5)), twin, places, plain)
    marked = row_of(sampled("viridis", 256), (255, 0, 0, 255), (255, 255, 255, 255))
    result = drawn(HEIGHTS, clim=(-1, 1.5), below_color="red", above_color=(1, 1, 1))
    check(result, twin, places, marked)
    assert all((result.image == color).all(axis=2).sum() > 100 for color in (marked[0], marked[-1]))


def test_the_logarithm_is_interpolated(twin: Any) -> None:
    values = 10.0**HEIGHTS
    low, high = HEIGHTS.min(), HEIGHTS.max()
    check(drawn(values, log_scale=True), twin, (HEIGHTS - low) / (high - low) * 256, row_of(sampled("viridis", 256)))


@pytest.mark.parametrize("count", [2, 4, 256])
def test_the_ends_of_the_range_are_of_the_map(count: int) -> None:
    """So is a number where two colours meet: it has the upper one's, on all of a face."""
    colors = sampled("viridis", count)
    for place, wanted in [(0, 0), (count, count - 1), (count // 2, count // 2), (1, 1)]:
        result = drawn(np.full(20, place / count), clim=(0, 1), n_colors=count, below_color="red", above_color="red")
        shown = result.image[result.color[..., 3] > 0]
        assert len(shown) > 5000 and (shown == colors[wanted]).all(), place
    over, under = (drawn(np.full(20, v), clim=(0, 1), below_color="red", above_color="lime") for v in (1 + 1e-9, -1e-9))
    assert (over.image[over.color[..., 3] > 0] == (0, 255, 0, 255)).all()
    assert (under.image[under.color[..., 3] > 0] == (255, 0, 0, 255)).all()


def test_infinite_numbers_are_beyond_the_range(twin: Any) -> None:
    values = HEIGHTS.copy()
    values[0], values[19] = np.inf, -np.inf
    result = drawn(values, below_color="red", above_color="lime")
    upper = (twin[1] == 0).any(axis=-1) & twin[0]
    assert (result.image[upper] == (0, 255, 0, 255)).all(axis=1).mean() > 0.95
    finite = ~np.isin(twin[1], (0, 19)).any(axis=-1) & twin[0]
    low, high = HEIGHTS[1:19].min(), HEIGHTS[1:19].max()
    plain = drawn(HEIGHTS, clim=(low, high))
    assert finite.sum() > 1000 and (result.image[finite] == plain.image[finite]).all()


def test_where_there_is_no_number_nothing_is_drawn_or_its_color(twin: Any) -> None:
    values = HEIGHTS.copy()
    values[0] = np.nan
    touched = (twin[1] == 0).any(axis=-1) & twin[0]
    full = drawn(HEIGHTS, clim=(HEIGHTS[1:].min(), HEIGHTS[1:].max()))
    colored = drawn(values, nan_color="#ff8000")
    assert touched.sum() > 500 and (colored.image[touched] == (255, 128, 0, 255)).all()
    assert (colored.image[~touched] == full.image[~touched]).all()
    left_out = drawn(values)
    assert (
        left_out.stats.triangles == len(SPHERE.faces) - 6 and (left_out.image[~touched] == full.image[~touched]).all()
    )
    assert "6 faces without a number left out" in left_out.stats.notes[0]
    faint = drawn(values, nan_color=(1, 0.5, 0, 0.5))
    assert faint.stats.fragments > 500 and (faint.image[~touched] == full.image[~touched]).all()


def test_without_any_number_there_is_nothing_to_see() -> None:
    for rows in (len(SPHERE.vertices), len(SPHERE.faces)):
        result = drawn(np.full(rows, np.nan))
        assert not result.image[..., 3].any() and "36 faces without a number" in result.stats.notes[0]


def test_one_number_has_the_color_in_the_middle() -> None:
    for value, log in [(5.0, False), (0.0, False), (-3.0, False), (7.0, True)]:
        result = drawn(np.full(20, value), log_scale=log)
        assert (result.image[result.color[..., 3] > 0] == sampled("viridis")[128]).all()


def test_numbers_of_faces() -> None:
    values = np.arange(len(SPHERE.faces)) % 5.0
    layers = plainly.render(SPHERE, CAMERA, SIZE, layers=True, **BARE).layers
    triangle, _ = shares(SPHERE, layers)
    wanted = sampled("viridis", 5)[(triangle % 5)]
    for options in ({}, {"opacity": np.ones(20)}):
        result = drawn(values, n_colors=5, clim=(-0.5, 4.5), **options)
        assert (result.image[triangle >= 0] == wanted[triangle >= 0]).all()


@pytest.mark.parametrize("function", ["linear", "sigmoid_5", [0.0, 0.2, 1.0]])
def test_the_opacity_of_a_color(twin: Any, function: Any) -> None:
    low, high = HEIGHTS.min(), HEIGHTS.max()
    scene = clpeel.with_scalars(SPHERE, HEIGHTS, opacity=function)
    layers = plainly.render(scene, CAMERA, SIZE, layers=True, lanes=1, **BARE).layers
    assert layers.count == 2 and not scene.opaque
    color, _, triangle = layers.layer(0)
    front = np.zeros(triangle.shape, bool)
    front[twin[0]] = (np.sort(SPHERE.faces[triangle[twin[0]]]) == np.sort(twin[1][twin[0]])).all(axis=1)
    exact = places_of((front, *twin[1:]), (HEIGHTS - low) / (high - low) * 256)
    alpha = transfer(function, 256) / 255
    choices = [alpha[np.clip(np.floor(exact + by), 0, 255).astype(int)] for by in (-0.05, 0, 0.05)]
    got = color[front][:, 3]
    assert len(got) > 2000 and np.any([np.abs(choice - got) < 1e-6 for choice in choices], axis=0).all()


@pytest.mark.parametrize("lanes", [1, 64])
def test_opacity_may_vary_apart_from_the_number(twin: Any, lanes: int) -> None:
    fade = 0.1 + 0.8 * (np.arange(20) % 7) / 7
    scene = clpeel.with_scalars(SPHERE, HEIGHTS, opacity=fade)
    layers = plainly.render(scene, CAMERA, SIZE, layers=True, lanes=lanes, **BARE).layers
    color, _, triangle = layers.layer(0)
    assert (triangle[twin[0]] >= 0).all()
    want = places_of(twin, fade)
    assert np.abs(color[twin[0]][:, 3] - want).max() < 2e-3  # corners lie on a grid of 1/256 pixel
    rgb = drawn(HEIGHTS).color[twin[0]][:, :3]
    assert (color[twin[0]][:, :3] == rgb).mean() > 0.99


def test_light_falls_on_it_as_on_colors_without_a_material() -> None:
    colors = sampled("viridis")
    for lighting in ("kit", "headlight"):
        options: dict[str, Any] = {**BARE, "lighting": lighting}
        mapped = clpeel.with_scalars(SPHERE, np.full(20, 5.0))
        plain = clpeel.load(SPHERE, color=colors[128] / 255)
        images = [plainly.render(scene, CAMERA, SIZE, **options).image.astype(int) for scene in (mapped, plain)]
        assert np.abs(images[0] - images[1]).max() <= 1 and len(np.unique(images[0])) > 30


def test_points_and_lines_have_the_colors_of_their_vertices() -> None:
    cloud = clpeel.Scene.from_arrays([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]], points=[0, 1, 2])
    scene = clpeel.with_scalars(cloud, [0, np.nan, 10.0], cmap=["red", "lime", "blue"])
    result = plainly.render(scene, clpeel.Camera((0, 0, 5), (0, 0, 0)), (60, 60), point_size=9, **BARE)
    shown = np.unique(result.image[result.color[..., 3] == 1], axis=0)
    assert shown.tolist() == [[0, 0, 255, 255], [255, 0, 0, 255]]
    wire = clpeel.Scene.from_arrays([[-1.0, 0, 0], [1, 0, 0]], lines=[[0, 1]])
    assert "mixtures" in clpeel.with_scalars(wire, [0.0, 1]).notes[0]


# --- scale bars -------------------------------------------------------------------------------------------------------


def test_a_bar_covers_neither_the_model_nor_the_axes_nor_another_bar() -> None:
    first = clpeel.with_scalars(SPHERE, HEIGHTS, label="height")
    moved = clpeel.Scene.from_arrays(SPHERE.vertices * 0.9, SPHERE.faces)
    second = clpeel.with_scalars(moved, HEIGHTS, cmap="gray", label="grey")
    scene = clpeel.load(first, second)
    for background in ((1.0, 1.0, 1.0), None):
        plain = plainly.render(scene, CAMERA, (700, 300), lighting="none", samples=4, background=background)
        axes = plain.with_axis(CAMERA)
        assert [each.label for each in scene.color_maps] == ["height", "grey"]
        one = axes.with_bar(scene.color_maps[0])
        both = axes.with_bar(*scene.color_maps)
        changes = [(a.image != b.image).any(axis=2) for a, b in ((plain, axes), (axes, one), (one, both))]
        assert all(change.sum() > 1000 for change in changes)
        covered = np.sum([*changes, plain.color[..., 3] > 0], axis=0)
        assert covered.max() == 1 and not both.stats.notes
        rows, columns = np.nonzero(changes[1])
        panel = both.image[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        for color in sampled("viridis")[[0, 128, 255]]:
            assert (np.abs(panel.astype(int) - color).max(axis=2) <= 2).any()


def test_a_bar_without_a_place_is_left_out_with_a_note() -> None:
    scene = clpeel.with_scalars(SPHERE, HEIGHTS, label="height")
    near = plainly.render(scene, CAMERA.zoom(3), (320, 240), lighting="none")
    found = near.with_bar(*scene.color_maps)
    assert (found.image == near.image).all() and found.stats.notes[-1].startswith("no scale bar of 'height'")
    with pytest.raises(clpeel.InputError, match="keep_color=True"):
        plainly.render(scene, CAMERA, (320, 240), keep_color=False).with_bar(*scene.color_maps)


def test_bars_of_categories_logarithms_and_ends_are_drawn() -> None:
    kinds = np.array(["cement", "sand", "water"])[np.arange(len(SPHERE.faces)) % 3]
    for options in (
        {"values": kinds, "cmap": ["red", "lime", "blue"]},
        {"values": 10.0**HEIGHTS, "log_scale": True, "below_color": "magenta", "clim": (0.1, 100)},
    ):
        scene = clpeel.with_scalars(SPHERE, label="it", **options)
        plain = plainly.render(scene, CAMERA.zoom(0.5), (320, 240), lighting="none")
        [colors] = scene.color_maps
        changed = (plain.with_bar(colors).image != plain.image).any(axis=2)
        panel = plain.with_bar(colors).image[changed]
        named = [color for _, color in colors.boxes] if not colors.categories else colors.colors.tolist()
        assert len(named) in (1, 3) and all((panel == color).all(axis=1).sum() > 50 for color in named)
