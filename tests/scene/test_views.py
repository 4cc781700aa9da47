"""Views by name, cameras as PyVista has them, colours by name, and what a scene and a result say of themselves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.checks import VIEWS
from clpeel.scene.camera import checked_camera
from clpeel.scene.lights import AmbientLight, DirectionalLight
from clpeel.scene.materials import Finish, Material

BOX = clpeel.load(clpeel.Scene.from_arrays([[0, 0, 0], [2, 0, 0], [0, 4, 0], [0, 0, 6]], [[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize("word", [sign + word for word in VIEWS for sign in ("", "-")])
def test_views_are_those_of_pyvista(word: str) -> None:
    pv = pytest.importorskip("pyvista", reason="needs the package pyvista: pip install 'clpeel[test-ecosystem]'")
    plotter = pv.Plotter(off_screen=True)
    plotter.add_mesh(pv.Box((0, 2, 0, 4, 0, 6)))
    name = word.removeprefix("-").replace("iso", "isometric")
    getattr(plotter, f"view_{name}")(negative=word.startswith("-"))
    theirs = plotter.camera
    ours = clpeel.Camera.frame(BOX, word)
    np.testing.assert_allclose(ours.axes()[2], theirs.direction, atol=1e-9)
    np.testing.assert_allclose(ours.view_up, theirs.up)
    np.testing.assert_allclose(ours.focal_point, theirs.focal_point)


def test_the_first_axis_points_right_and_the_second_up() -> None:
    letters = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
    for word in VIEWS.keys() - {"iso", "yx", "zx"}:  # for these two, what is up in PyVista is the first one
        right, up, _ = clpeel.Camera.frame(BOX, word).axes()
        if word in ("xy", "xz", "yz"):
            np.testing.assert_allclose(right, letters[word[0]], atol=1e-12)
        np.testing.assert_allclose(up, letters[word[1]], atol=1e-12)


def test_up_that_is_given_counts() -> None:
    assert clpeel.Camera.frame(BOX, "xy", up="+X").view_up == (1, 0, 0)
    assert clpeel.Camera.frame(BOX, "ISO", aspect=0.5).view_up == (0, 0, 1)
    assert clpeel.Camera.frame(BOX, "-Z").view_up == (0, 1, 0)


def test_a_triple_is_position_focal_point_and_up() -> None:
    camera = checked_camera(BOX, [(1, 2, 9), (1, 1, 0), (0, 1, 0)], 1.0)
    assert camera == clpeel.Camera((1, 2, 9), (1, 1, 0), (0, 1, 0))
    assert checked_camera(BOX, np.array([(1, 2, 9), (1, 1, 0), (0, 1, 0)]), 1.0) == camera  # type: ignore[arg-type]
    assert checked_camera(BOX, camera, 1.0) is camera
    assert checked_camera(BOX, None, 2.0) == clpeel.Camera.frame(BOX, aspect=2.0)


@pytest.mark.parametrize("given", ["iso", [(5, 6, 9), (1, 1, 1), (0, 1, 0)]])
def test_pictures_take_what_stands_for_a_camera(given: Any, shared_devices: None) -> None:
    camera = checked_camera(BOX, given, 40 / 30)
    ours = plainly.render(BOX, given, (40, 30), lighting="kit").image
    assert (ours == plainly.render(BOX, camera, (40, 30), lighting="kit").image).all() and len(np.unique(ours)) > 2
    assert clpeel.complexity(clpeel.load(BOX, opacity=0.5), given, (40, 30)).fragments > 0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("oblique", "camera direction: expected an axis such as -Z or +Y, iso, xy, "),
        ("-xyz", "camera direction: expected an axis"),
        (
            5,
            "or (position, focal point, view up), got int",
        ),
        ([(1, 2, 3), (0, 0, 0)], "got list"),
        ([1, 2, 3], "camera position: expected 3 finite numbers"),
        ([(0, 0, 0), (0, 0, 0), (0, 1, 0)], "away from the focal point"),
    ],
)
def test_what_stands_for_no_camera_is_refused_in_one_line(given: Any, message: str) -> None:
    with pytest.raises(clpeel.InputError) as error:
        plainly.render(BOX, given, (8, 8))
    assert message in str(error.value) and "\n" not in str(error.value)


# --- colours by name --------------------------------------------------------------------------------------------------


def light(value: int) -> float:
    """A byte of sRGB as linear light, by IEC 61966-2-1."""
    share = value / 255
    return share / 12.92 if share <= 0.04045 else math.pow((share + 0.055) / 1.055, 2.4)


def test_names_are_colors_of_lights_and_materials() -> None:
    """steelblue is #4682b4. Lights and materials are linear."""
    blue = [light(level) for level in (0x46, 0x82, 0xB4)]
    word: Any = "steelblue"
    np.testing.assert_allclose(DirectionalLight(direction=(0, 0, -1), color=word).color, blue, rtol=1e-6)
    np.testing.assert_allclose(AmbientLight(sky=word, ground=word).ground, blue, rtol=1e-6)
    np.testing.assert_allclose(Material(base_color=word).base_color, [*blue, 1], rtol=1e-6)
    np.testing.assert_allclose(Finish(emissive=word).emissive, blue, rtol=1e-6)
    half: Any = "#4682b480"
    np.testing.assert_allclose(Material(base_color=half).base_color, [*blue, 128 / 255], rtol=1e-6)


def test_names_are_colors_of_scenes_backgrounds_and_edges(shared_devices: None) -> None:
    scene = clpeel.load(BOX, color="tomato")
    given: dict[str, Any] = {
        "background": "navy",
        "edges": True,
        "edge_color": "lime",
        "line_width": 2,
        "samples": 1,
        "lighting": "none",
    }
    found = {
        tuple(int(v) for v in pixel[:3])
        for pixel in plainly.render(scene, "-xz", (99, 99), **given).image.reshape(-1, 4)
    }
    assert {(255, 99, 71), (0, 0, 128), (0, 255, 0)} <= found


@pytest.mark.parametrize(
    "make",
    [
        lambda word: DirectionalLight(direction=(0, 0, -1), color=word),
        lambda word: AmbientLight(sky=word),
        lambda word: Material(base_color=word),
        lambda word: Finish(emissive=word),
        lambda word: clpeel.load(BOX, color=word),
        lambda word: plainly.render(BOX, background=word),
        lambda word: plainly.render(BOX, edge_color=word),
        lambda word: clpeel.grid(BOX, color=word),
        lambda word: clpeel.Scene.from_arrays(BOX.vertices, BOX.faces, color=word),
    ],
)
def test_a_wrong_name_is_told_with_the_right_one(make: Any) -> None:
    with pytest.raises(clpeel.InputError, match=r"got 'steelblu'; did you mean steelblue\?$"):
        make("steelblu")


# --- what they say of themselves --------------------------------------------------------------------------------------


def test_a_scene_says_what_it_has() -> None:
    scene = clpeel.load(BOX, color=(255, 0, 16))
    assert repr(scene) == "<Scene: 2 triangles, colour #ff0010, from (0, 0, 0) to (2, 4, 6)>"
    fields: dict[str, Any] = {"vertices": BOX.vertices, "faces": BOX.faces, "lines": [[0, 1]], "points": [0, 1]}
    several = clpeel.Scene.from_arrays(**fields, vertex_colors=np.zeros((4, 4)), materials=[Material(plain=True)])
    assert repr(several) == (
        "<Scene: 2 triangles, 1 line, 2 points, vertex colours, 1 material, from (0, 0, 0) to (2, 4, 6)>"
    )
    large = clpeel.Scene.from_arrays(np.random.default_rng(1).random((9000, 3)), np.arange(9000).reshape(-1, 3))
    assert len(repr(large)) < 120


def test_a_result_says_what_it_is_and_shows_it(shared_devices: None) -> None:
    result = plainly.render(clpeel.load(BOX, opacity=0.5), "iso", (40, 30))
    words = repr(result)
    assert words.startswith("<Result: 40 x 30, sort, ") and words.endswith(" layers>") and len(words) < 100
    png = result._repr_png_()
    assert png.startswith(b"\x89PNG")
