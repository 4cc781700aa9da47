"""Lights of glTF (KHR_lights_punctual): where they stand, what they give, and that none refuses a file."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.documents import POINTS, Document

from clpeel.scene.lights import DirectionalLight, PointLight, SpotLight
from clpeel.scene.scene import Scene

NAME = "KHR_lights_punctual"
HALF = math.sqrt(0.5)


def lamps(lights: Any, *nodes: dict[str, Any], **more: Any) -> Document:
    """A triangle in node 0, and these nodes after it, all of them in the scene."""
    document = Document(POINTS[:3])
    document.more = {
        "extensionsUsed": [NAME],
        "extensions": {NAME: {"lights": lights}},
        "nodes": [{"mesh": 0}, *nodes],
        "scenes": [{"nodes": list(range(len(nodes) + 1))}],
        **more,
    }
    return document


def shines(light: Any = 0, **more: Any) -> dict[str, Any]:
    """A node with a light."""
    return {"extensions": {NAME: {"light": light}}, **more}


def only(scene: Scene) -> Any:
    """The one light of a scene, which has no notes."""
    assert scene.notes == ()
    (light,) = scene.lights
    return light


# --- what they give ---------------------------------------------------------------------------------------------------


def test_lights_have_what_the_file_says(tmp_path: Path) -> None:
    common = {"color": [1, 0.5, 0.25], "intensity": 20}
    cone = {"innerConeAngle": 0.25, "outerConeAngle": 0.5}
    lights = [
        {"type": "directional", **common},
        {"type": "point", **common, "range": 7},
        {"type": "spot", **common, "range": 8, "spot": cone},
    ]
    sun, bulb, spot = lamps(lights, shines(0), shines(1), shines(2)).load(tmp_path).lights
    assert sun == DirectionalLight(direction=(0, 0, -1), color=(1, 0.5, 0.25), intensity=20)
    assert bulb == PointLight(position=(0, 0, 0), color=(1, 0.5, 0.25), intensity=20, range=7)
    assert isinstance(spot, SpotLight)
    assert (spot.position, spot.direction, spot.range, spot.color) == ((0, 0, 0), (0, 0, -1), 8, (1, 0.5, 0.25))
    np.testing.assert_allclose([spot.inner_angle, spot.outer_angle], [45 / math.pi, 90 / math.pi], rtol=1e-12)


def test_lights_have_the_defaults_of_the_extension(tmp_path: Path) -> None:
    lights = [{"type": "directional"}, {"type": "point"}, {"type": "spot"}]
    sun, bulb, spot = lamps(lights, shines(0), shines(1), shines(2)).load(tmp_path).lights
    assert sun == DirectionalLight(direction=(0, 0, -1), color=(1, 1, 1), intensity=1)
    assert bulb == PointLight(position=(0, 0, 0), color=(1, 1, 1), intensity=1, range=None)
    assert isinstance(spot, SpotLight) and spot.range is None and spot.inner_angle == 0
    assert spot.outer_angle == pytest.approx(45, rel=1e-12)


@pytest.mark.parametrize(
    ("spot", "inner", "outer"),
    [
        ({"innerConeAngle": 0.5, "outerConeAngle": 0.5}, math.degrees(0.5), math.degrees(0.5)),
        ({"innerConeAngle": 1, "outerConeAngle": 0.5}, math.degrees(0.5), math.degrees(0.5)),
        ({"outerConeAngle": 3}, 0, 90),
    ],
)
def test_cones_that_are_too_wide_are_made_narrower(tmp_path: Path, spot: Any, inner: float, outer: float) -> None:
    """An inner cone as wide as the outer one has a sharp edge."""
    light = only(lamps([{"type": "spot", "spot": spot}], shines()).load(tmp_path))
    assert light.inner_angle < light.outer_angle
    np.testing.assert_allclose([light.inner_angle, light.outer_angle], [inner, outer], atol=1e-4)


# --- where they stand -------------------------------------------------------------------------------------------------


def test_lights_stand_where_their_nodes_do(tmp_path: Path) -> None:
    """A quarter turn about x takes -z to y, and then one about z takes that to -x. Scales move, and change no light."""
    parent = {"rotation": [0, 0, HALF, HALF], "scale": [2, 3, 4], "translation": [10, 20, 30], "children": [2]}
    child = shines(translation=[1, 1, 1], rotation=[HALF, 0, 0, HALF], scale=[5, 5, 5])
    cone = {"outerConeAngle": math.radians(30)}
    document = lamps([{"type": "spot", "intensity": 6, "range": 9, "spot": cone}], parent, child)
    document.more["scenes"] = [{"nodes": [0, 1]}]
    light = only(document.load(tmp_path))
    np.testing.assert_allclose(light.position, [10 - 3, 20 + 2, 30 + 4], atol=1e-12)
    np.testing.assert_allclose(light.direction / np.linalg.norm(light.direction), [-1, 0, 0], atol=1e-12)
    assert (light.intensity, light.range) == (6, 9) and light.outer_angle == pytest.approx(30)
    assert pickle.loads(pickle.dumps(light)) == light and all(type(x) is float for x in light.position)


def test_matrices_of_nodes_count_too(tmp_path: Path) -> None:
    matrix = [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 5, 6, 7, 1]  # by columns: x to -z, y to y, z to x
    point, sun = (
        lamps([{"type": "point"}, {"type": "directional"}], shines(matrix=matrix), shines(1, matrix=matrix))
        .load(tmp_path)
        .lights
    )
    assert isinstance(point, PointLight) and point.position == (5, 6, 7)
    assert isinstance(sun, DirectionalLight)
    np.testing.assert_allclose(sun.direction / np.linalg.norm(sun.direction), [-1, 0, 0], atol=1e-12)


def test_lights_move_with_an_animation(tmp_path: Path) -> None:
    document = lamps([{"type": "point"}], shines())
    times = document.add(np.float32([0, 2]), min=[0], max=[2])
    places = document.add(np.float32([[0, 0, 0], [4, 0, 0]]))
    document.more["animations"] = [
        {
            "samplers": [{"input": times, "output": places}],
            "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
        }
    ]
    light = only(document.load(tmp_path, animation_index=0, animation_time=0.5))
    np.testing.assert_allclose(light.position, [1, 0, 0], atol=1e-6)


def test_one_light_may_stand_in_several_places(tmp_path: Path) -> None:
    """Of nodes that name it, each has one. Copies of a mesh make none, and a node that is listed twice is one node."""
    document = lamps([{"type": "point"}], shines(translation=[1, 0, 0]), shines(translation=[2, 0, 0]))
    places = document.add(np.float32([[0, 0, 5], [0, 0, 6]]))
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
    document.more["nodes"].append({"mesh": 0, "extensions": {NAME: {"light": 0}, **instancing}})
    document.more["scenes"] = [{"nodes": [0, 1, 2, 3, 1]}]
    document.more["extensionsUsed"] = [NAME, "EXT_mesh_gpu_instancing"]
    scene = document.load(tmp_path)
    assert len(scene.faces) == 3 and scene.notes == ()
    assert [light.position for light in scene.lights if isinstance(light, PointLight)] == [
        (1, 0, 0),
        (2, 0, 0),
        (0, 0, 0),
    ]


def test_lights_that_the_scene_does_not_show_are_not_there(tmp_path: Path) -> None:
    document = lamps([{"type": "point"}, {"type": "nonsense"}], shines(translation=[1, 0, 0]), shines(1))
    document.more["scenes"] = [{"nodes": [0]}]
    scene = document.load(tmp_path)
    assert scene.lights == () and scene.notes == ()
    document.more["scenes"] = [{"nodes": [0, 1]}]
    assert only(document.load(tmp_path)).position == (1, 0, 0)


# --- damage -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("light", "says"),
    [
        ({"type": "area"}, "the file is damaged: type of a light: expected directional, point or spot, got 'area'"),
        ({}, "the file is damaged: type of a light: expected directional, point or spot, got 'None'"),
        ({"type": "point", "intensity": -1}, "intensity: expected a number of 0 or more, got -1.0"),
        ({"type": "point", "intensity": "x"}, "the file is damaged: intensity: expected a finite number, got 'x'"),
        ({"type": "point", "color": [1, 1]}, "the file is damaged: color: expected 3 numbers, got '[1, 1]'"),
        ({"type": "point", "color": [1, -1, 0]}, "color: expected R,G,B of 0 or more, got (1.0, -1.0, 0.0)"),
        ({"type": "point", "range": 0}, "range: expected a distance above 0, got 0.0"),
        ({"type": "spot", "spot": 3}, "the file is damaged: spot: expected an object, got '3'"),
        (
            {"type": "spot", "spot": {"outerConeAngle": 0}},
            "inner_angle, outer_angle: expected 0 <= inner < outer <= 90 degrees, got ",
        ),
    ],
)
def test_damaged_lights_are_noted_by_the_name_of_their_node(tmp_path: Path, light: Any, says: str) -> None:
    scene = lamps([light, {"type": "point"}], shines(name="lamp"), shines(1)).load(tmp_path)
    assert len(scene.faces) == 1 and scene.lights == (PointLight(position=(0, 0, 0)),)
    (note,) = scene.notes
    assert note.startswith(f"light of node 'lamp' left out: {says}")


@pytest.mark.parametrize(
    ("lights", "named", "says"),
    [
        ([{"type": "point"}], {"light": 3}, "lights: expected an index 0..0, got '3'"),
        ([{"type": "point"}], {"light": True}, "lights: expected an index 0..0, got 'True'"),
        ([{"type": "point"}], {"light": -1}, "lights: expected an index 0..0, got '-1'"),
        ([{"type": "point"}], {}, "lights: expected an index 0..0, got 'None'"),
        ([{"type": "point"}], [], "KHR_lights_punctual: expected an object, got '[]'"),
        ([], {"light": 0}, "lights: there are none"),
        ({}, {"light": 0}, "lights: expected a list, got '{}'"),
        ([3], {"light": 0}, "lights: expected a list of objects, got other values"),
    ],
)
def test_lights_that_are_not_there_are_noted(tmp_path: Path, lights: Any, named: Any, says: str) -> None:
    scene = lamps(lights, {"extensions": {NAME: named}}).load(tmp_path)
    assert scene.lights == () and len(scene.faces) == 1
    assert scene.notes == (f"light of node '1' left out: the file is damaged: {says}",)


@pytest.mark.parametrize("held", [3, [], {}, None])
def test_an_extension_without_lights_matters_only_to_nodes_that_name_one(tmp_path: Path, held: Any) -> None:
    assert lamps([], extensions={NAME: held}).load(tmp_path).notes == ()
    (note,) = lamps([], shines(), extensions={NAME: held}).load(tmp_path).notes
    assert note.startswith("light of node '1' left out: the file is damaged: ")


def test_a_light_without_a_direction_is_noted(tmp_path: Path) -> None:
    (note,) = lamps([{"type": "directional"}], shines(scale=[0, 0, 0])).load(tmp_path).notes
    assert note == ("light of node '1' left out: direction: expected X,Y,Z, not all of them 0, got (-0.0, -0.0, -0.0)")
    point = only(lamps([{"type": "point"}], shines(translation=[1, 2, 3], scale=[0, 0, 0])).load(tmp_path))
    assert point.position == (1, 2, 3)


def test_files_without_lights_have_none(tmp_path: Path) -> None:
    assert Document(POINTS[:3]).load(tmp_path).lights == ()
