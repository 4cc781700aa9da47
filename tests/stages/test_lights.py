"""Lights on surfaces, pixel by pixel: against float64 (twins/lights.py), and the energy of light."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import lights as twin
from twins.textures import to_linear as linear
from twins.textures import to_srgb as srgb

import clpeel
from clpeel.errors import InputError
from clpeel.scene.lights import KIT, AmbientLight, DirectionalLight, Lamp, PointLight, SpotLight
from clpeel.scene.materials import Finish, Material
from clpeel.stages.albedo import albedo_of, albedo_tables
from clpeel.stages.shading import MATT

pytestmark = pytest.mark.usefixtures("shared_devices")

SIDE = 6
DISTANCE = 3.0

SHOWN = 1.5e-3
"""How far a shown value, 0..1, may be off: the table of what a reflection returns is interpolated, right to 1 %.
That is of what it adds or takes, which is no more than a seventh of what a surface shows here."""


def quad(turn: float, tilt: float, finish: Finish, color: Any, lights: tuple[Lamp, ...] = ()) -> clpeel.Scene:
    """A quad around the origin that fills the picture, turned about y and then tilted about x, in degrees."""
    a, b = math.radians(turn), math.radians(tilt)
    about_y = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    corners = np.array([(-99, -99, 0), (99, -99, 0), (99, 99, 0), (-99, 99, 0)]) @ (about_x @ about_y).T
    material = Material(plain=True, finish=finish)
    return clpeel.Scene.from_arrays(
        corners, [(0, 1, 2), (0, 2, 3)], color=color, materials=[material], lights=list(lights)
    )


def camera(parallel: bool = False) -> clpeel.Camera:
    """From +z, at the origin."""
    return clpeel.Camera((0, 0, DISTANCE), (0, 0, 0), view_angle=40, orthographic=parallel)


def drawn(scene: clpeel.Scene, lighting: str, *, parallel: bool = False, lanes: int = 1, **options: Any) -> np.ndarray:
    """The picture's colours, premultiplied float32 [SIDE, SIDE, 4]."""
    renderer = plainly.Renderer(scene, lanes=lanes)
    return renderer.render(camera(parallel), (SIDE, SIDE), lighting=lighting, background=None, **options).color


def expected(
    turn: float, tilt: float, finish: Finish, color: tuple[float, ...], lights: tuple[Lamp, ...], parallel: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The linear light of each pixel without highlights, and that of its highlights: [SIDE, SIDE, 3] each."""
    corners = quad(turn, tilt, finish, (0, 0, 0)).vertices
    normal = twin.unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    half = math.tan(math.radians(20))
    plain, shine = np.empty((SIDE, SIDE, 3)), np.empty((SIDE, SIDE, 3))
    for row in range(SIDE):
        for column in range(SIDE):
            x, y = (2 * column + 1 - SIDE) / SIDE * half, (SIDE - 2 * row - 1) / SIDE * half
            if parallel:
                start, ahead = np.array([x * DISTANCE, y * DISTANCE, DISTANCE]), np.array([0, 0, -1.0])
            else:
                start, ahead = np.array([0, 0, DISTANCE]), twin.unit((x, y, -1))
            place = start - ahead * float(normal @ start) / float(normal @ ahead)
            plain[row, column], shine[row, column] = twin.seen(color, normal, place, -ahead, lights, finish)
    return plain, shine


directions = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, -0.1))
rgb = st.tuples(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
places = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(1.5, 4))
kinds = st.one_of(
    st.builds(AmbientLight, sky=rgb, ground=rgb, intensity=st.floats(0, 1), up=st.none() | directions),
    st.builds(DirectionalLight, direction=directions, color=rgb, intensity=st.floats(0, 3), highlights=st.booleans()),
    st.builds(PointLight, position=places, color=rgb, intensity=st.floats(0, 10), range=st.none() | st.floats(3, 8)),
    st.builds(
        SpotLight,
        position=places,
        color=rgb,
        intensity=st.floats(0, 10),
        direction=directions,
        inner_angle=st.floats(0, 30),
        outer_angle=st.floats(31, 90),
    ),
)
finishes = st.builds(
    Finish, metallic=st.floats(0, 1), roughness=st.floats(0.2, 1), emissive=rgb.map(lambda c: (c[0], 0, 0))
)


@given(
    st.floats(-60, 60),
    st.floats(-60, 60),
    finishes,
    rgb,
    st.lists(kinds, min_size=1, max_size=4),
    st.booleans(),
    st.sampled_from((1, 64)),
)
def test_each_light_is_as_its_formula_says(
    turn: float, tilt: float, finish: Finish, color: tuple[float, ...], lights: list[Lamp], parallel: bool, lanes: int
) -> None:
    shown = tuple(float(value) for value in srgb(np.array(color)))
    scene = quad(turn, tilt, finish, (*shown, 1.0), tuple(lights))
    got = drawn(scene, "scene", parallel=parallel, lanes=lanes)
    plain, shine = expected(turn, tilt, finish, tuple(linear(np.float32(shown))), tuple(lights), parallel)
    want = np.minimum(srgb(plain + shine), 1)
    assert (got[..., 3] == 1).all()
    np.testing.assert_allclose(got[..., :3], want, atol=SHOWN + 0.01 * 12.92 * 0.0031308)


@pytest.mark.parametrize("parallel", [False, True])
def test_the_kit_moves_with_the_camera(parallel: bool) -> None:
    finish = Finish(0.0, 0.4)
    plain, shine = expected(
        20, -30, finish, (0.5, 0.25, 0.75), tuple(KIT), parallel
    )  # the camera's axes are the scene's
    color = (*(float(v) for v in srgb(np.array([0.5, 0.25, 0.75]))), 1.0)
    got = drawn(quad(20, -30, finish, color), "kit", parallel=parallel)
    np.testing.assert_allclose(got[..., :3], srgb(plain + shine), atol=SHOWN)
    brighter = drawn(quad(20, -30, finish, color), "kit", parallel=parallel, light_intensity=0.5)
    np.testing.assert_allclose(brighter[..., :3], srgb((plain + shine) / 2), atol=SHOWN)
    turned = np.array([(0, 0, 1), (0, 1, 0), (-1, 0, 0)])  # about y, by a right angle, as the camera is
    scene = replace(quad(20, -30, finish, color), vertices=quad(20, -30, finish, color).vertices @ turned.T)
    eye = tuple(turned @ (0, 0, DISTANCE))
    seen = plainly.render(
        scene, clpeel.Camera(eye, (0, 0, 0), view_angle=40, orthographic=parallel), (SIDE, SIDE), lighting="kit"
    )
    np.testing.assert_allclose(seen.color[..., :3], got[..., :3], atol=2e-6)


# --- energy -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("turn", [0.0, 50.0, 75.0])
def test_a_white_surface_in_even_light_from_lamps_is_white(metallic: float, roughness: float, turn: float) -> None:
    """A white furnace: lamps all around, as many as the integral needs. Half of white is not cut off."""
    count = 72
    cosine = (np.arange(count) + 0.5) / count  # equal shares of the hemisphere
    around = (np.arange(2 * count) + 0.5) / (2 * count) * 2 * np.pi
    height, angle = (grid.ravel() for grid in np.meshgrid(cosine, around))
    ring = np.sqrt(1 - height**2)
    a = math.radians(turn)
    toward = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    toward = toward @ np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]]).T
    share = 0.5 * 2 * np.pi / len(toward)
    lamps = tuple(DirectionalLight(direction=tuple(-each), intensity=share) for each in toward)
    scene = quad(turn, 0, Finish(metallic, roughness), (255, 255, 255, 255), lamps)
    got = linear(drawn(scene, "scene", parallel=True)[..., :3].astype(float))
    np.testing.assert_allclose(got, 0.5, rtol=0.01)


@pytest.mark.parametrize("finish", [Finish(m, r) for m in (0.0, 0.5, 1.0) for r in (0.0, 0.3, 1.0)])
def test_a_white_surface_in_light_from_everywhere_is_white(finish: Finish) -> None:
    for turn in (0.0, 60.0, 85.0):
        scene = quad(turn, 0, finish, (255, 255, 255, 255), (AmbientLight(intensity=0.5),))
        got = linear(drawn(scene, "scene", parallel=True)[..., :3].astype(float))
        np.testing.assert_allclose(got, 0.5, rtol=1e-5)


def test_the_table_is_what_reflections_return() -> None:
    table = albedo_tables()
    for rough in (0.2, 0.4, 0.6, 0.8, 1.0):
        for root in (0.2, 0.4, 0.6, 0.8, 1.0):
            scaled, fixed = twin.returned(root**2, rough)
            any_f0, whole = table[:, round(15 * rough), round(15 * root)]
            np.testing.assert_allclose((any_f0, whole), (scaled, scaled + fixed), atol=5e-4)
    np.testing.assert_array_equal(albedo_of(1.0), table[:, 15])
    np.testing.assert_allclose(albedo_of(0.5), (table[:, 7] + table[:, 8]) / 2, atol=1e-6)
    for facing in (0.03, 0.1, 0.3, 0.77):
        for rough in (0.1, 0.37, 0.63, 0.9):
            scaled, fixed = twin.returned(facing, rough)
            row, place = albedo_of(rough)[1].astype(float), math.sqrt(facing) * 15
            whole = np.interp(place, np.arange(16), row)
            assert abs(whole / (scaled + fixed) - 1) < 0.01


# --- what else there is -----------------------------------------------------------------------------------------------


def test_faces_without_a_material_are_matt() -> None:
    scene = quad(30, 10, MATT, (200, 100, 50, 255))
    bare = clpeel.Scene.from_arrays(scene.vertices, scene.faces, color=(200, 100, 50, 255))
    np.testing.assert_array_equal(drawn(scene, "kit"), drawn(bare, "kit"))


def test_both_sides_are_lit_alike() -> None:
    scene = quad(30, 10, MATT, (200, 100, 50, 255))
    turned = replace(scene, faces=scene.faces[:, ::-1].copy())
    np.testing.assert_allclose(
        drawn(scene, "kit"), drawn(turned, "kit"), atol=4e-7
    )  # shares are added up in another order
    given = replace(scene, vertex_normals=np.tile(np.float32([0, 0, 1]), (4, 1)))
    behind = replace(given, vertex_normals=-given.vertex_normals)
    np.testing.assert_array_equal(drawn(given, "kit"), drawn(behind, "kit"))


def test_plain_materials_show_the_scenes_colours_without_lights() -> None:
    scene = quad(0, 0, Finish(1.0, 0.1, (1.0, 1.0, 1.0)), (200, 100, 50, 128))
    bare = clpeel.Scene.from_arrays(scene.vertices, scene.faces, color=(200, 100, 50, 128))
    for lighting in ("none", "headlight"):
        np.testing.assert_array_equal(drawn(scene, lighting), drawn(bare, lighting))
    assert not scene.opaque and scene.optical_depths == bare.optical_depths


def test_what_only_lights_show_is_noted_without_them() -> None:
    scene = quad(0, 0, Finish(emissive=(1.0, 0.5, 0.0)), (0, 0, 0, 255))
    (note,) = plainly.render(scene, size=(8, 8)).stats.notes
    assert note == "left out, as emissive light only shows under lights: lighting 'kit' has some"
    assert plainly.render(scene, size=(8, 8), lighting="kit").stats.notes == []


@pytest.mark.parametrize("alpha", [0.0, 0.25, 0.5, 0.9, 1.0])
def test_full_highlights_cover_what_they_lie_on(alpha: float) -> None:
    """alpha' = 1 - (1 - alpha) (1 - s), and the colour, premultiplied, is T - (1 - alpha) (1 - s) D, within alpha'."""
    finish, base = Finish(0.0, 0.35), (0.3, 0.1, 0.05)
    color = (*(float(v) for v in srgb(np.array(base))), alpha)
    lights: tuple[Lamp, ...] = (AmbientLight(intensity=0.3), DirectionalLight(direction=(0.1, -0.4, -1), intensity=1.2))
    got = drawn(quad(0, 0, finish, color, lights), "scene", highlights="full", opaque="blend")
    plain, shine = expected(0, 0, finish, base, lights, False)
    with_it, without = np.minimum(srgb(plain + shine), 1), srgb(plain)
    cover = ((with_it - without) / np.maximum(1 - without, 0.25)).max(axis=-1, keepdims=True)
    assert cover.max() > 0.3 > cover.min()
    through = (1 - alpha) * (1 - cover)
    np.testing.assert_allclose(got[..., 3:], 1 - through, atol=SHOWN)
    np.testing.assert_allclose(got[..., :3], with_it - through * without, atol=SHOWN)
    assert (got[..., :3] <= got[..., 3:] + 1e-6).all()
    dimmed = drawn(quad(0, 0, finish, color, lights), "scene", opaque="blend")
    np.testing.assert_allclose(dimmed[..., :3], with_it * alpha, atol=SHOWN)


def test_a_scene_without_lights_has_none_to_draw_by() -> None:
    with pytest.raises(InputError, match="^lighting: expected lights in the scene with 'scene', got none; 'kit' has"):
        drawn(quad(0, 0, MATT, (1, 1, 1)), "scene")


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda: AmbientLight(intensity=-1), "intensity: expected a number of 0 or more, got -1"),
        (lambda: AmbientLight(sky=(1, 2)), r"color: expected R,G,B of 0 or more, got \(1, 2\)"),
        (lambda: DirectionalLight(direction=(0, 0, 0)), "direction: expected X,Y,Z, not all of them 0"),
        (lambda: PointLight(position=(0, math.nan, 0)), "position: expected X,Y,Z, got"),
        (lambda: PointLight(position=(0, 0, 0), range=0), "range: expected a distance above 0, got 0"),
        (
            lambda: SpotLight(position=(0, 0, 0), direction=(1, 0, 0), inner_angle=50),
            "inner_angle, outer_angle: expected",
        ),
        (lambda: quad(0, 0, MATT, (1, 1, 1), ("sun",)), "lights: expected lights, such as DirectionalLight, got str"),
        (lambda: Material(plain=True, unlit=True), "plain: expected no texture, and no unlit, with it"),
    ],
)
def test_what_is_no_light_is_refused(made: Any, says: str) -> None:
    with pytest.raises(InputError, match=f"^{says}"):
        made()


@pytest.mark.parametrize("intensity", [4.0, 7.0, 20.0, 1e4, 1e30])
@pytest.mark.parametrize("highlights", ["dimmed", "full"])
@pytest.mark.parametrize("lanes", [1, 64])
def test_what_is_brighter_than_white_is_white(intensity: float, highlights: str, lanes: int) -> None:
    lights = (DirectionalLight(direction=(0, 0, -1), intensity=intensity),)
    got = drawn(quad(0, 0, MATT, (255, 255, 255, 255), lights), "scene", highlights=highlights, lanes=lanes)
    np.testing.assert_array_equal(got, np.ones((SIDE, SIDE, 4), np.float32))
