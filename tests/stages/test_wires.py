"""Edges of faces against their twin: how much of each pixel strokes cover, on faces and beside them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import screen, strokes, wires
from twins.samples import PLACES

import clpeel

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (64, 48)
CLIPPING = (0.1, 30.0)
EDGE = (0.9, 0.2, 0.1)
BLUE = (51, 102, 204, 128)


def half_of(width: float | str, camera: clpeel.Camera, height: int) -> Any:
    """Half a width in subpixels of a pixel, as a function of the view distance."""
    if not isinstance(width, str):
        return lambda distance: width / 2 * 256
    units = float(width.removesuffix("u"))
    per_unit = 256 * height / 2 / math.tan(math.radians(camera.view_angle) / 2)
    return lambda distance: units / 2 * per_unit / (camera.distance if camera.orthographic else distance)


def draw(scene: clpeel.Scene, camera: clpeel.Camera, size: tuple[int, int] = SIZE, **options: Any) -> np.ndarray:
    """The colours, premultiplied, without a background."""
    return plainly.render(scene, camera, size, background=None, **options).color.astype(float)


# --- a sheet that fills the picture -----------------------------------------------------------------------------------


def sheet(rng: np.random.Generator, count: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """A planar sheet of jittered triangles around the origin, none of them turned over."""
    x, y = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    places = np.stack([x, y], axis=-1).reshape(-1, 2) + rng.uniform(-0.2, 0.2, ((count + 1) ** 2, 2))
    vertices = np.c_[(places / count - 0.5) * 5.4, np.zeros(len(places))]
    corner = (x[:-1, :-1] * (count + 1) + y[:-1, :-1]).reshape(-1)
    a, b, c, d = corner, corner + count + 1, corner + count + 2, corner + 1
    turned = (rng.random(len(a)) < 0.5)[:, None]
    first = np.where(turned, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(turned, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    return vertices, np.concatenate([first, second])


def above(rng: np.random.Generator, orthographic: bool) -> clpeel.Camera:
    """A camera that sees nothing but the sheet, up to 35 degrees aslant."""
    tilt, turn = rng.uniform(0, math.radians(35)), rng.uniform(0, 2 * math.pi)
    place = 3 * np.array([math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), math.cos(tilt)])
    return clpeel.Camera(tuple(place), (0, 0, 0), tuple(rng.normal(size=3)), 30.0, CLIPPING, orthographic=orthographic)


def sheet_twin(
    vertices: np.ndarray, faces: np.ndarray, camera: clpeel.Camera, size: tuple[int, int], half: Any, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """How much edges cover at each sample, [samples, h, w], and which of these are too near to an edge to tell.

    A face shows its own edges. Up to 16 samples, faces are shaded at the middle of a pixel, and strokes are smooth over
    a pixel; with more they are so at each sample.
    """
    each, steps = samples > 16, math.isqrt(samples) if samples > 16 else 1
    on_screen = screen.screen(vertices, camera, size)
    ends = faces[:, [[0, 1], [1, 2], [2, 0]]]
    found, doubtful = [], []
    for place in PLACES[samples]:
        within = wires.inside(on_screen[faces][:, :, :2], *strokes.grid(size, place))
        face = within.argmax(axis=0)
        rows = math.isqrt(samples) if samples != 8 else 2
        doubtful.append(within.max(axis=0) < strokes.SNAPPED / rows)
        x, y = strokes.grid(size, place if each else strokes.MIDDLE)
        covers = np.zeros(face.shape)
        for number in np.unique(face):
            own = face == number
            for a, b in ends[number]:
                here = wires.covered(on_screen[[a, b]], half, (x + 0 * y)[own], (y + 0 * x)[own], 256 / steps)
                covers[own] = np.maximum(covers[own], here)
        found.append(covers)
    return np.array(found), np.array(doubtful)


def check_sheet(
    rng: np.random.Generator, lanes: int, samples: int, alpha: int, width: float | str, **options: Any
) -> None:
    size = SIZE if samples <= 16 else (32, 24)
    orthographic, opacity = bool(rng.random() < 0.5), float(rng.uniform(0.2, 1))
    vertices, faces = sheet(rng)
    camera = above(rng, orthographic)
    scene = clpeel.Scene.from_arrays(vertices, faces, color=(*BLUE[:3], alpha))
    common: dict[str, Any] = {"lanes": lanes, "samples": samples, **options}
    plain = draw(scene, camera, size, **common)
    got = draw(scene, camera, size, **common, edges=True, edge_color=EDGE, edge_opacity=opacity, line_width=width)
    assert (plain[..., 3] > alpha / 256).all(), "the sheet fills the picture"
    share, doubtful = sheet_twin(vertices, faces, camera, size, half_of(width, camera, size[1]), samples)
    wanted = wires.over(share * opacity, EDGE, plain).mean(axis=0)
    doubt = (doubtful & (np.ptp(share, axis=0) > 0)).any(axis=0) if samples > 1 else doubtful[0]
    largest = np.abs(screen.screen(vertices, camera, size)[:, :2]).max()
    bound = wires.ROUNDING * largest / 256 * (8 if samples > 16 else 1) + (samples + 8) * 2.0**-24
    error = np.abs(got - wanted).max(axis=-1)
    assert (error[~doubt] <= bound).all(), (error[~doubt].max(), bound)
    assert doubt.mean() < 0.2 and 0.02 < share.mean() < 0.98
    if samples == 1:  # either face has the edge between them
        assert (error <= bound + 1e-2).all()


WIDTHS: list[float | str] = [0.6, 1.0, 2.5, 6.0, "0.02u", "0.15u"]


@pytest.mark.parametrize("width", WIDTHS)
@given(seed=st.integers(0, 10**6))
def test_strokes_cover_a_sheet_as_their_twin_does(width: float | str, seed: int) -> None:
    check_sheet(np.random.default_rng(seed), 1, 1, 128, width)


@pytest.mark.parametrize(
    ("samples", "alpha", "lighting", "lanes"),
    [
        (4, 128, "none", 1),
        (4, 128, "none", 64),
        (8, 128, "none", 1),
        (16, 128, "none", 1),
        (64, 128, "none", 1),
        (1, 255, "none", 1),
        (4, 255, "kit", 1),
    ],
)
def test_strokes_are_the_same_at_any_number_of_samples(samples: int, alpha: int, lighting: str, lanes: int) -> None:
    rng = np.random.default_rng(samples + alpha)
    for width in (1.5, "0.05u"):
        check_sheet(rng, lanes, samples, alpha, width, lighting=lighting)


# --- beside outlines --------------------------------------------------------------------------------------------------


def outline(places: np.ndarray) -> np.ndarray:
    """The corners of the convex hull of places on the screen, in order, [n, 2] (Andrew's monotone chain)."""

    def chain(points: list[np.ndarray]) -> list[np.ndarray]:
        found: list[np.ndarray] = []
        for point in points:
            while len(found) > 1:
                (ax, ay), (bx, by) = found[-1] - found[-2], point - found[-2]
                if ax * by - ay * bx > 0:
                    break
                found.pop()
            found.append(point)
        return found[:-1]

    ordered = sorted(places, key=tuple)
    return np.array(chain(ordered) + chain(ordered[::-1]))


def round_body(rng: np.random.Generator, count: int = 14) -> tuple[np.ndarray, np.ndarray]:
    """The convex hull of points of a unit ball's surface."""
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points, wires.hull(points)


def around(rng: np.random.Generator, distance: float, orthographic: bool) -> clpeel.Camera:
    """A camera that looks at a unit ball from any side."""
    eye = rng.normal(size=3)
    eye *= distance / np.linalg.norm(eye)
    return clpeel.Camera(
        tuple(eye), (0, 0, 0), tuple(rng.normal(size=3)), 40.0, (distance / 30, distance * 3), orthographic=orthographic
    )


def to_outline(corners: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """How far each sample is from a convex polygon, in subpixels, negative within; and from its nearest sharp corner.

    A corner is sharp if a band's tip there is cut off (TIP_LIMIT in wires.cl): the mitre would be longer than twice the
    band's width where the sides meet at less than 60 degrees.
    """
    x, y = strokes.grid(size)
    after, before = np.roll(corners, -1, axis=0), np.roll(corners, 1, axis=0)
    distance, sharp = np.full((size[1], size[0]), np.inf), np.full((size[1], size[0]), np.inf)
    within = np.full(distance.shape, True)
    for a, b, c in zip(before, corners, after, strict=True):
        distance = np.minimum(distance, wires.nearest(np.array([[*b, 1], [*c, 1]]), x, y)[0])
        within &= (c - b)[0] * (y - b[1]) - (c - b)[1] * (x - b[0]) > 0
        to, back = (c - b) / np.hypot(*(c - b)), (a - b) / np.hypot(*(a - b))
        if to @ back > 0.5:
            sharp = np.minimum(sharp, np.hypot(x - b[0], y - b[1]))
    return np.where(within, -distance, distance), sharp


OUTLINES: dict[str, tuple[dict[str, Any], float]] = {
    "edges": ({"edges": True}, 0.5),
    "features": ({"feature_edges": 0.0}, 0.5),
    "silhouettes": ({"silhouettes": True}, 1.0),
    "both": ({"edges": True, "silhouettes": True}, 0.5),
}


def check_body(seed: int, which: str, width: float, lanes: int = 1) -> None:
    """A translucent body, whose front and back are blended within, with bands around it."""
    rng = np.random.default_rng(seed)
    vertices, faces = round_body(rng)
    camera, opacity = around(rng, float(rng.uniform(2.5, 4)), bool(rng.random() < 0.5)), 0.5
    options, outer = OUTLINES[which]
    scene = clpeel.Scene.from_arrays(vertices, faces, color=BLUE)
    got = draw(scene, camera, **options, edge_color=EDGE, edge_opacity=opacity, line_width=width, lanes=lanes)
    on_screen = screen.screen(vertices, camera, SIZE)
    distance, sharp = to_outline(outline(on_screen[:, :2]), SIZE)
    reach = outer * width * 256
    beside = (distance > strokes.SNAPPED) & (sharp > reach + 256)
    cover = wires.stroke_over(np.abs(distance), np.full(distance.shape, reach), 256.0)
    wanted = wires.over(cover * opacity, EDGE, np.zeros(4))
    error = np.abs(got - wanted).max(axis=-1)
    at_the_rim = np.abs(distance - reach - 128) < strokes.SNAPPED  # the band ends there
    assert error[beside & ~at_the_rim].max() < 1e-4 and error[beside].max() < strokes.SNAPPED / 256
    assert (got[distance > reach + 128 + strokes.SNAPPED] == 0).all()
    assert (beside & (cover > 0)).sum() > 30
    # Within, a face has the strokes of its own edges, and either side of the body is like a sheet.
    x, y = strokes.grid(SIZE)
    plane = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    eye = np.asarray(camera.position) - (0 if camera.orthographic else vertices[faces[:, 0]])
    front = (plane * eye).sum(axis=1) > 0
    color = np.zeros(4)
    for side in (faces[~front], faces[front]):
        share = np.zeros(distance.shape)
        for ends in wires.edges(side) if which != "silhouettes" else ():
            share = np.maximum(share, wires.covered(on_screen[ends], lambda _: width * 128, x, y))
        own = wires.over(share * opacity, EDGE, np.array([*np.array(BLUE[:3]) * BLUE[3] / 255, BLUE[3]]) / 255)
        color = own + (1 - own[..., 3:]) * color
    assert np.abs(got - color).max(axis=-1)[distance < -strokes.SNAPPED].max() < 5e-3


@pytest.mark.parametrize("which", OUTLINES)
@given(seed=st.integers(0, 10**6), width=st.floats(0.5, 9))
def test_bands_beside_an_outline_go_on_where_strokes_end(which: str, seed: int, width: float) -> None:
    check_body(seed, which, width)


@pytest.mark.parametrize("which", OUTLINES)
def test_places_on_an_outline_belong_to_the_face_or_to_the_band(which: str) -> None:
    """The corners of a polygon are centres of pixels, and so are many places on its sides."""
    camera = clpeel.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 90.0, (1, 10), orthographic=True)
    corners = np.array([[-15, -8], [-5, -13], [6, -13], [14, -5], [14, 3], [6, 11], [-7, 11], [-15, 3]]) + 0.5
    vertices = np.c_[corners * 10 / SIZE[1], np.zeros(len(corners))]
    scene = clpeel.Scene.from_arrays(vertices, [[0, k, k + 1] for k in range(1, 7)], color=BLUE)
    options, _ = OUTLINES[which]
    got = draw(scene, camera, **options, edge_color=EDGE, edge_opacity=0.5, line_width=4)
    distance, _ = to_outline(outline(screen.screen(vertices, camera, SIZE)[:, :2]), SIZE)
    on = np.abs(distance) < 1e-6
    face = np.array([*np.array(BLUE[:3]) * BLUE[3] / 255, BLUE[3]]) / 255
    stroke = wires.over(0.5, EDGE, np.zeros(4))
    on_face = face if which == "silhouettes" else wires.over(0.5, EDGE, face)
    is_face, is_band = (np.abs(got[on] - wanted).max(axis=-1) < 1e-6 for wanted in (on_face, stroke))
    assert (is_face | is_band).all() and is_face.sum() > 20 and is_band.sum() > 20
