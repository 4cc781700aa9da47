"""Plain materials: the scene's colours stay as they are, whatever is done to a scene, and keep their finish."""

from __future__ import annotations

import pickle
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest

from clpeel.reading.load import load
from clpeel.rendering.blank import why_blank
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.camera import Camera
from clpeel.scene.materials import NO_MATERIAL, Finish, Material
from clpeel.scene.scene import Scene, joined, recolored, with_vertex_colors, without_faces
from clpeel.stages.shading import material_table, packed_textures, shading_of, used_materials

SHINY, DULL = (Material(plain=True, finish=Finish(1.0, roughness)) for roughness in (0.1, 0.9))
GLASS = Material(base_color=(0.5, 1, 1, 0.5), alpha_mode="BLEND")
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 1]], np.float64)
FACES = np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3]])
COLORS = np.array([[10, 20, 30, 255], [40, 50, 60, 51], [70, 80, 90, 255]], np.uint8)


def scene(*materials: Material, places: Any = None, **colors: Any) -> Scene:
    """Three triangles with these materials."""
    colors = colors or {"face_colors": COLORS}
    return Scene.from_arrays(POINTS, FACES, materials=materials, face_materials=places, **colors)


def bare(**colors: Any) -> Scene:
    """The same without materials."""
    return Scene.from_arrays(POINTS, FACES, **(colors or {"face_colors": COLORS}))


@pytest.mark.parametrize(
    "colors",
    [
        {"face_colors": COLORS},
        {"face_colors": (COLORS / 255).astype(np.float32)},
        {"vertex_colors": np.repeat(COLORS, 2, axis=0)[:5]},
        {"color": (1, 2, 3, 4)},
        {"color": (1, 2, 3)},
        {"color": (0.5, 0.5, 0.5, 0.25)},
    ],
)
@pytest.mark.parametrize("places", [None, [0, 1, 0], [0, -1, 1], [-1, -1, -1]])
def test_kinds_and_depths_are_those_of_the_colours(colors: Any, places: Any) -> None:
    found, want = scene(SHINY, DULL, places=places, **colors), bare(**colors)
    assert found.plain_faces.all() and found.surfaces == want.surfaces and found.opaque == want.opaque
    np.testing.assert_array_equal(found.kinds.opaque, want.kinds.opaque)
    assert not found.kinds.routed.any() and not found.kinds.hiding.any()
    assert astuple(found.optical_depths) == pytest.approx(astuple(want.optical_depths), abs=1e-12)


def test_other_materials_beside_them_count_by_themselves() -> None:
    found = scene(SHINY, GLASS, places=[0, 1, -1])
    assert found.plain_faces.tolist() == [True, False, True] and found.kinds.opaque.tolist() == [True, False, True]
    assert found.surfaces == "mixed"
    assert found.optical_depths.mean == pytest.approx(np.log(2)), "of glass, over the scene's greatest alpha, 1"


def test_without_colours_they_have_the_default_one() -> None:
    only = Scene.from_arrays(POINTS, FACES, materials=[SHINY])
    assert only.color is not None and tuple(only.color) == DEFAULT_COLOR
    some = Scene.from_arrays(POINTS, FACES, materials=[SHINY, GLASS], face_materials=[0, 1, NO_MATERIAL])
    assert some.face_colors is not None
    assert some.face_colors.tolist() == [list(DEFAULT_COLOR), [255] * 4, list(DEFAULT_COLOR)]


@pytest.mark.parametrize("color", [None, (1, 2, 3), (1, 2, 3, 102), (0.25, 0.5, 0.75)])
@pytest.mark.parametrize("opacity", [None, 0.5, 0.2])
@pytest.mark.parametrize("kind", ["face_colors", "vertex_colors", "color"])
def test_they_are_recolored_as_faces_without_a_material_are(color: Any, opacity: Any, kind: str) -> None:
    colors = {"face_colors": COLORS, "vertex_colors": np.repeat(COLORS, 2, axis=0)[:5], "color": COLORS[1]}[kind]
    given = None if color is None else np.array(color, np.uint8 if isinstance(color[0], int) else np.float32)
    found = recolored(scene(SHINY, DULL, places=[0, 1, -1], **{kind: colors}), given, opacity)
    want = recolored(bare(**{kind: colors}), given, opacity)
    assert found.materials == (SHINY, DULL)
    np.testing.assert_array_equal(found.colors, want.colors)
    assert found.colors.dtype == want.colors.dtype
    assert astuple(found.optical_depths) == pytest.approx(astuple(want.optical_depths), abs=1e-12)


def test_beside_other_materials_they_are_recolored_in_their_colours() -> None:
    found = recolored(scene(SHINY, GLASS, places=[0, 1, -1]), np.array([255, 0, 0], np.uint8), 0.2)
    assert found.materials[0] is SHINY and found.materials[1].base_color == (1, 0, 0, 1)
    assert found.materials[1].opacity == 0.2 and not found.materials[1].rgb_of_scene
    assert found.face_colors is not None and found.face_colors.tolist() == [
        [255, 0, 0, 51],
        COLORS[1].tolist(),
        [255, 0, 0, 51],
    ]
    assert found.surfaces == "transparent"


def test_options_of_the_loader_recolor_them() -> None:
    found = load(scene(SHINY, DULL, places=[0, 1, 1]), color="#0000ff", opacity=0.2)
    assert found.materials == (SHINY, DULL)
    np.testing.assert_allclose(np.unique(found.colors.reshape(-1, 4), axis=0), [[0, 0, 1, 0.2]], atol=1e-7)


def test_joined_scenes_have_each_material_once() -> None:
    first, second = scene(SHINY, DULL, places=[0, 1, -1]), scene(DULL, GLASS, places=[0, 0, 1])
    found = joined([first, bare(color=(9, 9, 9)), second])
    assert found.materials == (SHINY, DULL, GLASS) and found.face_materials is not None
    assert found.face_materials.tolist() == [0, 1, -1, -1, -1, -1, 1, 1, 2]
    assert found.face_colors is not None
    np.testing.assert_array_equal(found.face_colors, [*COLORS, *[[9, 9, 9, 255]] * 3, *COLORS])
    one = joined([scene(SHINY, color=(9, 9, 9)), bare(color=(9, 9, 9))])
    assert one.color is not None and one.color.tolist() == [9, 9, 9, 255]
    assert one.face_materials is not None and one.face_materials.tolist() == [0, 0, 0, -1, -1, -1]


def test_they_stay_when_faces_go_and_vertices_are_split() -> None:
    source = scene(SHINY, DULL, places=[0, 1, -1])
    fewer = without_faces(source, np.array([0]))
    assert fewer.face_materials is not None and fewer.face_materials.tolist() == [1, -1]
    split = with_vertex_colors(source)
    assert split.face_materials is source.face_materials and split.materials == source.materials


def test_they_are_the_same_after_pickling() -> None:
    source = replace(scene(SHINY, DULL, places=[0, 1, -1]), notes=("a",))
    again = pickle.loads(pickle.dumps(source))
    assert [(m.plain, m.finish.metallic, m.finish.roughness) for m in again.materials] == [
        (True, 1, 0.1),
        (True, 1, 0.9),
    ]
    np.testing.assert_array_equal(again.face_materials, source.face_materials)
    np.testing.assert_array_equal(again.colors, source.colors)
    assert again.surfaces == source.surfaces and again.notes == ("a",)


def test_a_mesh_of_trimesh_and_plain_scenes_are_joined() -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(POINTS, FACES, face_colors=COLORS, process=False)
    found = load(mesh, scene(SHINY))
    assert found.materials == (SHINY,) and found.face_materials is not None
    assert found.face_materials.tolist() == [-1, -1, -1, 0, 0, 0]
    np.testing.assert_array_equal(found.face_colors, [*COLORS, *COLORS])


def test_a_blank_picture_of_them_is_explained_by_their_colours() -> None:
    image, camera = np.full((4, 4, 4), 255, np.uint8), Camera((0.5, 0.5, 5), (0.5, 0.5, 0))
    clear = [Scene.from_arrays(POINTS, FACES, color=(1, 2, 3, 0), materials=m) for m in ((), (SHINY,))]
    bare_one, plain_one = (why_blank(image, (1.0, 1.0, 1.0), each, camera, 5, 0) for each in clear)
    assert plain_one is not None and plain_one == bare_one


def test_without_lights_they_cost_nothing() -> None:
    plain, mixed = scene(SHINY, DULL), scene(SHINY, GLASS, places=[0, 1, 0])
    assert used_materials(plain, False) == () and used_materials(plain, True) == plain.materials
    assert used_materials(mixed, False) == mixed.materials
    assert not shading_of(plain, False).materials and shading_of(plain, True).materials
    table = material_table(plain, packed_textures(plain.materials, lights=True), len(plain.vertices))
    np.testing.assert_allclose(table["roughness"], [0.5, 0.1, 0.9])
    np.testing.assert_allclose(table["metallic"], [0, 1, 1])
