"""Texture coordinates: those of lights' textures stay with their vertices, whatever is done to a scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.scene.materials import Finish, Material
from clpeel.scene.normals import with_normals
from clpeel.scene.scene import Scene, joined, recolored, with_vertex_colors, without_faces
from clpeel.scene.textures import Texture
from clpeel.viewer.coarse import coarse_scene

TEXTURE = Texture(np.full((1, 1, 4), 255, np.uint8))
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 1, 1]], np.float64)
FACES = np.array([[0, 1, 2], [0, 2, 3], [2, 3, 4]])


def told(vertices: NDArray[Any], number: int) -> NDArray[Any]:
    """Texture coordinates that say at which place a vertex is."""
    return np.asarray(vertices[:, :2] + 10 * number + 3 * vertices[:, 2:])


def lit(number: int = 2) -> Material:
    """A material with a normal texture whose coordinates have this number."""
    return Material(finish=Finish(normal_texture=TEXTURE, normal_uv=number))


def scene(sets: int = 2, **more: Any) -> Scene:
    """A scene with so many further sets of coordinates."""
    given = {"materials": [lit(sets)], "uv": told(SQUARE, 0), "more_uv": [told(SQUARE, 1 + k) for k in range(sets)]}
    return Scene.from_arrays(SQUARE, FACES, **(given | more))


def check(found: Scene, sets: int = 2) -> None:
    """Every vertex still has its own coordinates."""
    assert found.uv is not None and len(found.more_uv) == sets
    for number, uv in enumerate((found.uv, *found.more_uv)):
        assert uv.dtype == np.float32
        np.testing.assert_allclose(uv, told(found.vertices, number), atol=1e-5)


def test_coordinates_are_kept_as_they_are_given() -> None:
    own = told(SQUARE, 1).astype(np.float32)
    found = scene(1, more_uv=[own])
    check(found, 1)
    assert found.more_uv[0] is own
    assert Scene.from_arrays(SQUARE, FACES).more_uv == ()


def test_coordinates_stay_when_vertices_are_split() -> None:
    check(with_vertex_colors(scene(vertex_colors=np.full((5, 4), 255))))
    split = with_normals(scene(), 30)
    assert len(split.vertices) > 5
    check(split)


def test_coordinates_stay_when_faces_go_or_change_colour() -> None:
    check(without_faces(scene(), np.array([1])))
    check(recolored(scene(), np.array([255, 0, 0], np.uint8), 0.5))


def test_coordinates_stay_in_coarse_scenes() -> None:
    coarse = coarse_scene(scene(), 3)
    check(coarse)


def test_joined_scenes_have_as_many_sets_as_any_of_them() -> None:
    plain = Scene.from_arrays(SQUARE, FACES)
    found = joined([scene(1), plain, scene(2)])
    assert found.uv is not None and [len(found.more_uv), len(found.materials)] == [2, 2]
    np.testing.assert_allclose(found.uv, [*told(SQUARE, 0), *np.zeros((5, 2)), *told(SQUARE, 0)])
    np.testing.assert_allclose(found.more_uv[0], [*told(SQUARE, 1), *np.zeros((5, 2)), *told(SQUARE, 1)])
    np.testing.assert_allclose(found.more_uv[1], [*np.zeros((10, 2)), *told(SQUARE, 2)])
    assert all(uv.dtype == np.float32 for uv in found.more_uv)
    assert joined([plain, plain]).uv is None and joined([plain, plain]).more_uv == ()


def test_a_material_says_how_many_sets_it_needs() -> None:
    assert (Material().uv_sets, Material(finish=Finish(normal_uv=3)).uv_sets) == (0, 0)
    assert (Material(texture=TEXTURE).uv_sets, lit(0).uv_sets, lit(2).uv_sets) == (1, 1, 3)
    for name in ("metallic_roughness", "normal", "occlusion", "emissive"):
        assert Finish(**{f"{name}_texture": TEXTURE, f"{name}_uv": 4}).uv_sets == 5  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"uv": None}, "uv: expected texture coordinates for a material with a texture, got none"),
        ({"uv": None, "more_uv": [], "materials": [lit(0)]}, "uv: expected texture coordinates"),
        ({"materials": [lit(3)]}, "more_uv: expected 3, as a texture of a light names it, got 2"),
        ({"more_uv": [told(SQUARE, 1), np.zeros((4, 2))]}, "more_uv: expected [5, 2] real numbers, got [4, 2] float64"),
    ],
)
def test_coordinates_that_are_missing_are_named(more: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as error:
        scene(**more)
    assert str(error.value).startswith(says)


def test_numbers_of_coordinates_are_checked() -> None:
    with pytest.raises(InputError, match="^finish: expected numbers of texture coordinates of 0 or more, got -1$"):
        Finish(occlusion_uv=-1)
