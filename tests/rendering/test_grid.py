"""The ground grid in pictures: at the pixels where it must be from above, hidden by surfaces, and let through."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.scene.grid import AXIS_COLORS, COLOR, FAINT, STRONG
from clpeel.scene.scene import joined, with_vertex_colors

pytestmark = pytest.mark.usefixtures("shared_devices")

SIDE, SCALE, UNIT = 200, 40, 0.5  # pixels, pixels a scene unit, scene units
BOX = np.array([[x, y, z] for x in (-1, 1) for y in (0, 1) for z in (-1, 1)], float)
FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
FACES += [[1, 5, 7], [1, 7, 3]]
RED = (200, 30, 40)

ABOVE = clpeel.Camera(
    (0.5 / SCALE, 10, 0.5 / SCALE),
    (0.5 / SCALE, 0, 0.5 / SCALE),
    (0, 0, -1),
    2 * np.degrees(np.arctan(SIDE / 2 / SCALE / 10)),
    orthographic=True,
)
"""Half a pixel aside, so that lines run along the middles of pixels: column 99 + 40 x, row 99 + 40 z."""


def box(alpha: int) -> clpeel.Scene:
    return clpeel.Scene.from_arrays(BOX, FACES, color=(*RED, alpha))


def drawn(scene: clpeel.Scene, camera: clpeel.Camera = ABOVE, **options: Any) -> np.ndarray:
    return plainly.render(scene, camera, (SIDE, SIDE), **options).image[..., :3] / 255


def line_at(x: float, z: float, of_x: bool, radius: float) -> tuple[np.ndarray, float]:
    """The colour and the alpha of a line at a place: of one along X, or else along Z."""
    number = round((z if of_x else x) / UNIT)
    pieces = np.ceil(UNIT * 40 / (4 * radius))
    step = UNIT / pieces
    along = (np.floor((x if of_x else z) / step) + 0.5) * step  # the middle of its piece
    away = np.hypot(along, number * UNIT)
    alpha = (STRONG if number % 5 == 0 else FAINT) * np.clip(2 - away / radius, 0, 1)
    axis = AXIS_COLORS[0 if of_x else 2]
    return np.array(axis if number == 0 else COLOR), float(alpha)


def test_from_above_lines_are_where_they_must_be(lanes: int) -> None:
    scene = box(255)
    radius = np.sqrt(2.25)
    found = drawn(joined([scene, clpeel.grid(scene, unit=UNIT)]), lanes=lanes)
    seen = 0
    for row, column in np.ndindex(SIDE, SIDE):
        x, z = (column - 99) / SCALE, (row - 99) / SCALE
        of_x, of_z = (row - 99) % 20 == 0, (column - 99) % 20 == 0
        if max(abs(x), abs(z)) <= 1 + 0.6 / SCALE:
            continue  # the box, and its rim
        if not of_x and not of_z:
            assert (found[row, column] == 1).all()
        elif of_x != of_z and (column if of_x else row) % 20 not in (18, 0):  # crossings, and pixels beside them
            color, alpha = line_at(x, z, bool(of_x), radius)
            step = UNIT / np.ceil(UNIT * 40 / (4 * radius))
            if abs(((x if of_x else z) / step + 0.5) % 1 - 0.5) * step * SCALE < 1:
                continue  # where two pieces meet
            assert np.abs(found[row, column] - (1 + alpha * (color - 1))).max() < 1.6 / 255, (row, column)
            seen += alpha > 0.2
    assert seen > 500


def test_an_opaque_box_hides_it_and_nothing_else_changes(lanes: int) -> None:
    scene = box(255)
    plain, found = drawn(scene, lanes=lanes), drawn(joined([scene, clpeel.grid(scene, unit=UNIT)]), lanes=lanes)
    inside = slice(99 - 38, 99 + 39)
    np.testing.assert_array_equal(found[inside, inside], plain[inside, inside])
    assert (found != plain).any()


def test_a_translucent_box_lets_it_through(lanes: int) -> None:
    scene = box(100)
    plain, found = drawn(scene, lanes=lanes), drawn(joined([scene, clpeel.grid(scene, unit=UNIT)]), lanes=lanes)
    for x, z in ((0.25, 0.5), (-0.7, -0.5), (0.3, 0), (0.6, 0.5)):
        row, column = round(99 + SCALE * z), round(99 + SCALE * x)
        color, alpha = line_at((column - 99) / SCALE, z, True, np.sqrt(2.25))
        shown = np.ones(3) + alpha * (color - 1)
        for _ in range(2):  # the bottom and the top
            shown = shown + 100 / 255 * (np.array(RED) / 255 - shown)
        assert np.abs(found[row, column] - shown).max() < 1.6 / 255
        assert np.abs(found[row, column] - plain[row, column]).max() > 3 / 255
    assert (found[99 + 10, 99 + 10] == plain[99 + 10, 99 + 10]).all()


def test_from_below_it_lies_before_the_box(lanes: int) -> None:
    scene = box(255)
    below = replace(ABOVE, position=(0.5 / SCALE, -10, 0.5 / SCALE))
    plain = drawn(scene, below, lanes=lanes)
    found = drawn(joined([scene, clpeel.grid(scene, unit=UNIT)]), below, lanes=lanes)
    changed = (found != plain).any(axis=-1)[70:130, 70:130]
    assert (changed.sum(axis=0) > 50).sum() >= 3 and (changed.sum(axis=1) > 50).sum() >= 3


@pytest.mark.parametrize("orthographic", [False, True])
def test_the_default_range_of_depths_holds_all_of_it(orthographic: bool, lanes: int) -> None:
    """Low above the ground it reaches from behind the eye to far behind the scene."""
    scene = box(255)
    camera = clpeel.Camera((0.3, 0.4, 2.4), (0.2, 0.3, 0), view_angle=70.0, orthographic=orthographic)
    both = joined([scene, clpeel.grid(scene)])
    wide = (-100.0, 100.0) if orthographic else (1e-3, 1e3)
    found = drawn(both, camera, lanes=lanes)
    np.testing.assert_array_equal(found, drawn(both, replace(camera, clipping_range=wide), lanes=lanes))
    assert (found != drawn(scene, camera, lanes=lanes)).any(axis=-1).sum() > 500
    narrow = camera.fitted_range(scene)
    assert (found != drawn(both, replace(camera, clipping_range=narrow), lanes=lanes)).any()


@pytest.mark.parametrize("kind", ["color", "face_colors", "vertex_colors", "floats"])
@pytest.mark.parametrize("lighting", ["none", "kit"])
def test_the_scene_has_its_own_colours_to_the_bit(kind: str, lighting: Any, lanes: int) -> None:
    rng = np.random.default_rng(3)
    count = {"color": (), "face_colors": (12,), "vertex_colors": (8,), "floats": (12,)}[kind]
    colors = rng.integers(0, 256, (*count, 3), dtype=np.uint8)
    named: dict[str, Any] = {"face_colors" if kind == "floats" else kind: colors / 255 if kind == "floats" else colors}
    scene = clpeel.Scene.from_arrays(BOX, FACES, **named)
    both = joined([scene, clpeel.grid(scene)])
    if kind != "vertex_colors":
        assert both.vertex_colors is None
    assert both.counts[0] == 12 and len(both.vertices) == 8 + 2 * both.counts[1]
    options = {"lighting": lighting, "lanes": lanes}
    inside = slice(99 - 38, 99 + 39)
    plain, found = drawn(scene, **options), drawn(both, **options)
    np.testing.assert_array_equal(found[inside, inside], plain[inside, inside])


@pytest.mark.parametrize("technique", ["sort", "multi-layer-peeling", "weighted-average"])
def test_rows_for_lines_look_as_vertex_colours_do(technique: str, lanes: int) -> None:
    """The same picture, layers and opacity, whether lines have a row behind the faces' colours or colours at ends."""
    scene = box(100)
    rows = joined([scene, clpeel.grid(scene)])
    camera = clpeel.Camera.frame(scene, (-1, -0.7, -1.2))
    ends = with_vertex_colors(rows)
    assert rows.face_colors is not None and ends.vertex_colors is not None
    pictures, layers = [], []
    for each in (rows, ends):
        renderer = plainly.Renderer(each, lanes=lanes)
        pictures.append(renderer.render(camera, (90, 90), technique).image.astype(int))
        if technique == "sort":
            layers.append(renderer.render(camera, (90, 90), layers=True, execution="tiles").layers)
        renderer.set_opacity(0.3)
        pictures.append(renderer.render(camera, (90, 90), technique).image.astype(int))
    assert np.abs(pictures[0] - pictures[2]).max() <= 1 and np.abs(pictures[1] - pictures[3]).max() <= 1
    assert np.abs(pictures[0] - pictures[1]).max() > 10
    for one, other in [layers] if layers else []:
        np.testing.assert_array_equal(one.triangle, other.triangle)
        np.testing.assert_allclose(one.color, other.color, atol=1e-6)
