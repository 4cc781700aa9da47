"""Animations of glTF: a moment of one, by the formulas of the specification's appendix C."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading.documents import POINTS, Document, refusal

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.scene import Scene

HALF = 0.5**0.5
TIMES = np.array([1, 3, 4], np.float32)


def animated(path: str, output: np.ndarray, how: str | None = None, **sampler: Any) -> Document:
    """A triangle whose node is animated by these values at 1, 3 and 4 seconds."""
    document = Document(POINTS[:3])
    made = {"input": document.add(TIMES), "output": document.add(output, **sampler)}
    animation = {
        "name": "walk",
        "samplers": [{**made, **({} if how is None else {"interpolation": how})}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
    }
    document.more = {"animations": [animation], "nodes": [{"mesh": 0, "translation": [0, 0, 0]}]}
    return document


def moved(document: Document, folder: Path, time: float) -> Scene:
    """The scene at a moment."""
    return document.load(folder, animation_index=0, animation_time=time)


STEPS = np.array([[10, 0, 0], [30, 8, 0], [70, 0, 0]], np.float32)


@pytest.mark.parametrize(
    ("how", "time", "shift"),
    [
        (None, 2, [20, 4, 0]),
        ("LINEAR", 1.5, [15, 2, 0]),
        ("LINEAR", 3.75, [60, 2, 0]),
        ("LINEAR", 3, [30, 8, 0]),
        ("LINEAR", 0, [10, 0, 0]),
        ("LINEAR", -1e300, [10, 0, 0]),
        ("LINEAR", 4, [70, 0, 0]),
        ("LINEAR", 9, [70, 0, 0]),
        ("STEP", 2.999, [10, 0, 0]),
        ("STEP", 3, [30, 8, 0]),
        ("STEP", 0, [10, 0, 0]),
        ("STEP", 9, [70, 0, 0]),
    ],
)
def test_translations_by_their_interpolation(tmp_path: Path, how: str | None, time: float, shift: list[float]) -> None:
    scene = moved(animated("translation", STEPS, how), tmp_path, time)
    np.testing.assert_array_equal(scene.vertices, POINTS[:3] + shift)
    assert scene.notes == ()


@pytest.mark.parametrize("time", [0.5, 1, 2, 3.25, 4, 5])
def test_cubic_splines_by_the_formula(tmp_path: Path, time: float) -> None:
    rows = np.random.default_rng(3).integers(-8, 9, (3, 3, 3)).astype(np.float32)  # in-tangent, value, out-tangent
    scene = moved(animated("translation", rows.reshape(9, 3), "CUBICSPLINE"), tmp_path, time)
    if time <= 1 or time >= 4:
        want = rows[0 if time <= 1 else 2, 1]
    else:
        k = 0 if time < 3 else 1
        gap = float(TIMES[k + 1] - TIMES[k])
        t = (time - float(TIMES[k])) / gap
        a, b = gap * rows[k + 1, 0], gap * rows[k, 2]
        want = (2 * t**3 - 3 * t**2 + 1) * rows[k, 1] + (t**3 - 2 * t**2 + t) * b
        want = want + (-2 * t**3 + 3 * t**2) * rows[k + 1, 1] + (t**3 - t**2) * a
    np.testing.assert_allclose(scene.vertices, POINTS[:3] + want, atol=1e-13)


def about_z(degrees: float) -> list[float]:
    """The quaternion of a turn about Z."""
    return [0, 0, math.sin(math.radians(degrees) / 2), math.cos(math.radians(degrees) / 2)]


@pytest.mark.parametrize(("time", "degrees"), [(1, 0), (2, 45), (1.5, 22.5), (3, 90), (3.5, 70), (4, 50)])
@pytest.mark.parametrize("other_sign", [False, True])
def test_rotations_turn_evenly_and_the_shorter_way(
    tmp_path: Path, time: float, degrees: float, other_sign: bool
) -> None:
    keys = np.array([about_z(0), about_z(90), about_z(50)], np.float32)
    if other_sign:
        keys[1] *= -1  # the same rotation
    scene = moved(animated("rotation", keys), tmp_path, time)
    angle = math.radians(degrees)
    np.testing.assert_allclose(scene.vertices[1], [math.cos(angle), math.sin(angle), 0], atol=1e-6)
    np.testing.assert_allclose(scene.vertices[2], [-math.sin(angle), math.cos(angle), 0], atol=1e-6)


def test_rotations_that_hardly_differ_are_mixed(tmp_path: Path) -> None:
    keys = np.array([about_z(30), about_z(30), about_z(30)], np.float32)
    scene = moved(animated("rotation", keys), tmp_path, 2)
    np.testing.assert_allclose(scene.vertices[1], [3**0.5 / 2, 0.5, 0], atol=1e-6)


def test_rotations_may_be_normalized_integers(tmp_path: Path) -> None:
    keys = np.rint(np.array([about_z(0), about_z(90), about_z(90)]) * 32767).astype(np.int16)
    scene = moved(animated("rotation", keys, normalized=True), tmp_path, 2)
    np.testing.assert_allclose(scene.vertices[1], [HALF, HALF, 0], atol=1e-4)


def test_splines_of_rotations_are_made_unit_ones(tmp_path: Path) -> None:
    zero = [0, 0, 0, 0]
    keys = np.array([zero, about_z(0), zero, zero, about_z(90), zero, zero, about_z(90), zero], np.float32)
    scene = moved(animated("rotation", keys, "CUBICSPLINE"), tmp_path, 2)
    np.testing.assert_allclose(scene.vertices[1], [HALF, HALF, 0], atol=1e-6)  # halfway: their mean, made longer


def test_scales_are_animated(tmp_path: Path) -> None:
    scene = moved(animated("scale", np.array([[1, 1, 1], [3, 5, 1], [1, 1, 1]], np.float32)), tmp_path, 2)
    np.testing.assert_array_equal(scene.vertices, POINTS[:3] * [2, 3, 1])


def test_what_is_not_animated_stays(tmp_path: Path) -> None:
    document = animated("translation", STEPS)
    document.more["nodes"] = [{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0, "translation": [0, 0, 7]}]
    np.testing.assert_array_equal(moved(document, tmp_path, 3).vertices, 2 * (POINTS[:3] + [0, 0, 7]) + [30, 8, 0])


@pytest.mark.parametrize("how", ["LINEAR", "CUBICSPLINE"])
def test_weights_of_targets_are_animated(tmp_path: Path, how: str) -> None:
    values = np.array([[0, 0], [0.5, 0.25], [1, 1]], np.float32)
    if how == "CUBICSPLINE":
        values = np.stack([np.zeros_like(values), values, np.zeros_like(values)], axis=1)
    document = animated("weights", values.reshape(-1), how)
    first, second = np.eye(3, dtype=np.float32), np.ones((3, 3), np.float32)
    document.primitive["targets"] = [{"POSITION": document.add(first)}, {"POSITION": document.add(second)}]
    document.more["meshes"] = [{"primitives": [document.primitive], "weights": [9, 9]}]
    document.more["nodes"][0]["weights"] = [8, 8]
    scene = moved(document, tmp_path, 2)  # halfway from the first key to the second, also on a spline without slopes
    np.testing.assert_array_equal(scene.vertices, POINTS[:3] + 0.25 * first + 0.125 * second)


def test_joints_are_animated(tmp_path: Path) -> None:
    document = animated("translation", STEPS)
    for name, values in (
        ("JOINTS_0", np.zeros((3, 4), np.uint8)),
        ("WEIGHTS_0", np.eye(4, dtype=np.float32)[[0, 0, 0]]),
    ):
        document.primitive["attributes"][name] = document.add(values)
    document.more["nodes"] = [{}, {"mesh": 0, "skin": 0}]
    document.more["skins"] = [{"joints": [0]}]
    document.more["scenes"] = [{"nodes": [0, 1]}]
    np.testing.assert_array_equal(moved(document, tmp_path, 3).vertices, POINTS[:3] + [30, 8, 0])


# --- which moment -----------------------------------------------------------------------------------------------------


def two() -> Document:
    """A triangle with two animations, of which the second has no name."""
    document = animated("translation", STEPS)
    other = json.loads(json.dumps(document.more["animations"][0]))
    del other["name"]
    other["samplers"][0]["output"] = document.add(-STEPS)
    document.more["animations"].append(other)
    return document


def test_without_a_moment_the_pose_is_that_at_rest(tmp_path: Path) -> None:
    scene = two().load(tmp_path)
    np.testing.assert_array_equal(scene.vertices, POINTS[:3])
    assert scene.notes == (
        "animations left out: 2 ('walk', '1'); --animation-index and --animation-time show a moment of one",
    )


@pytest.mark.parametrize(
    ("options", "x"),
    [
        ({"animation_index": 0}, 10),
        ({"animation_index": 1}, -10),
        ({"animation_time": 3}, 30),
        ({"animation_index": 1, "animation_time": 3.0}, -30),
        ({"animation_index": np.int64(1), "animation_time": np.float32(3)}, -30),
    ],
)
def test_the_moment_is_chosen_by_index_and_time(tmp_path: Path, options: Any, x: float) -> None:
    assert two().load(tmp_path, **options).vertices[0, 0] == x


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            {"animation_index": 2},
            "animation_index: expected 0..1, as the file has 2, got 2",
        ),
        ({"animation_index": -1}, "animation_index: expected 0..1, as the file has 2, got -1"),
        ({"animation_index": 0.5}, "animation_index: expected a whole number, got 0.5"),
        ({"animation_index": "0"}, "animation_index: expected a whole number, got '0'"),
        ({"animation_time": math.nan}, "animation_time: expected a number of seconds, got nan"),
        ({"animation_time": "x"}, "animation_time: expected a number of seconds, got 'x'"),
    ],
)
def test_moments_that_are_not_there_are_refused(tmp_path: Path, options: Any, says: str) -> None:
    assert says in refusal(two(), tmp_path, **options)


def test_files_without_animations_say_so(tmp_path: Path) -> None:
    says = "animation_index, animation_time: expected a file with animations, got one that has none"
    assert says in refusal(Document(POINTS[:3]), tmp_path, animation_time=1)
    still = Scene.from_arrays(POINTS[:3], [[0, 1, 2]])
    with pytest.raises(InputError, match="animation_time: expected a glTF file among the sources"):
        load(still, animation_time=1)
    scene = load(still, two().path(tmp_path), animation_index=0)
    np.testing.assert_array_equal(scene.vertices, [*POINTS[:3], *(POINTS[:3] + [10, 0, 0])])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"interpolation": "WILD"}, "interpolation: expected LINEAR, STEP, CUBICSPLINE, got 'WILD'"),
        ({"interpolation": []}, "interpolation: expected LINEAR, STEP, CUBICSPLINE, got '[]'"),
        ({"input": 3}, "times of an animation: expected rising ones, got others"),
        ({"input": 0}, "times of an animation: expected an accessor of SCALAR, got 'VEC3'"),
        ({"input": 99}, "accessors: expected an index 0..4, got '99'"),
        ({"output": 1}, "translation of an animation: expected 3 times 3 numbers, got 3"),
        ({"output": 4}, "translation of an animation: expected 3 times 3 numbers, got 15"),
    ],
)
def test_animations_that_break_the_format_are_named(tmp_path: Path, change: Any, says: str) -> None:
    document = animated("translation", STEPS)  # of the accessors 0, 1 and 2
    document.add(TIMES[::-1].copy())
    document.add(POINTS)
    document.more["animations"][0]["samplers"][0] |= change
    assert says in refusal(document, tmp_path, animation_index=0)
