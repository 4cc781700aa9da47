"""Fields: the numbers that vertices or faces carry, by name or as an array, one for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import one_of, whole_number
from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene

PREFERENCES = ("vertex", "face")
"""What has the numbers where both may: a scene may have an array of one name for both, or as many faces as vertices."""

MAGNITUDE = -1
"""The component that stands for the length of a vector, as in f3d."""

NOT_SHOWN = "arrays left out: "
"""Notes about arrays that the picture does not show begin like this."""


class Field(NamedTuple):
    """One number for each vertex, [n], or for each face, line and point, [m + k + p]. Or text, for categories.

    of_faces: whether it is the latter. name: "" if it was given without one.
    """

    values: AnyArray
    of_faces: bool
    name: str


def with_arrays(scene: Scene, of_vertices: Mapping[str, Any], of_faces: Mapping[str, Any]) -> Scene:
    """Return the scene with these arrays by name, besides those that it has.

    of_vertices: [n] or [n, components] each. of_faces: [m + k + p] rows each, those of faces, lines and points; or [m],
    those of faces alone. Raises InputError, which names the array, if one has another number of rows.
    """
    vertices = {name: _rows(scene, name, np.asarray(array), False) for name, array in of_vertices.items()}
    faces = {name: _rows(scene, name, np.asarray(array), True) for name, array in of_faces.items()}
    return replace(scene, vertex_arrays={**scene.vertex_arrays, **vertices}, face_arrays={**scene.face_arrays, **faces})


def names_of(scene: Scene) -> list[str]:
    """Return the names of the scene's arrays, each once."""
    return list(dict.fromkeys([*scene.vertex_arrays, *scene.face_arrays]))


def field_of(
    scene: Scene, given: Any, component: int | None = None, preference: str = "vertex", option: str = "scalars"
) -> Field:
    """Return the field of an array, or of a name of one of the scene's.

    given: the name, or [n] for vertices, or [m + k + p] or [m] for faces; or as many rows of components. component: of
    a vector, from 0; MAGNITUDE or None for its length. preference: one of PREFERENCES. option: what errors call it.
    Raises InputError.
    """
    one_of("preference", preference, PREFERENCES)
    if isinstance(given, str):
        array, of_faces = _named(scene, given, preference, option)
        name = given
    else:
        array, name = np.asarray(given), ""
        fits = {"vertex": len(scene.vertices), "face": sum(scene.counts)}
        rows = len(array) if array.ndim else -1
        other = PREFERENCES[preference == PREFERENCES[0]]
        of_faces = (preference if rows == fits[preference] else other) == "face"
        array = _rows(scene, option, array, of_faces)
    return Field(_component(array, component, option), of_faces, name)


def numbers(field: Field, option: str = "scalars") -> NDArray[np.float64]:
    """Return a field's values as float64, or raise InputError if they are no real numbers."""
    if field.values.dtype.kind not in "fiub":
        raise InputError(f"{option}: expected real numbers, got {field.values.dtype}")
    return np.asarray(field.values, np.float64)


def _named(scene: Scene, name: str, preference: str, option: str) -> tuple[AnyArray, bool]:
    """Return the scene's array of that name, and whether it is of faces. Raises InputError."""
    places = [(scene.vertex_arrays, False), (scene.face_arrays, True)]
    for arrays, of_faces in places if preference == "vertex" else places[::-1]:
        if name in arrays:
            return arrays[name], of_faces
    known = names_of(scene)
    raise InputError(
        f"{option}: expected an array of the scene, {', '.join(known)}; got {name!r}"
        if known
        else f"{option}: expected an array, or a name in a scene that has some, got {name!r}"
    )


def _rows(scene: Scene, name: str, array: AnyArray, of_faces: bool) -> AnyArray:
    """Return the array, with rows of NaN for lines and points if it has some for faces alone. Raises InputError."""
    faces, marks = len(scene.faces), sum(scene.counts[1:])
    if array.ndim not in (1, 2) or (array.ndim == 2 and not array.shape[1]):
        raise InputError(f"{name}: expected numbers in rows, [rows] or [rows, components], got {list(array.shape)}")
    if of_faces and marks and len(array) == faces and array.dtype.kind in "fiub":
        return np.concatenate([array, np.full((marks, *array.shape[1:]), np.nan)])
    if len(array) != (faces + marks if of_faces else len(scene.vertices)):
        cells = f"{faces + marks:,} (faces{', lines and points' if marks else ''})"
        raise InputError(f"{name}: expected {len(scene.vertices):,} (vertices) or {cells} rows, got {len(array):,}")
    return array


def _component(array: AnyArray, component: int | None, option: str) -> AnyArray:
    """Return one number of each row [rows, components], or its length."""
    if array.ndim == 1 or array.shape[1] == 1:
        if component not in (None, MAGNITUDE, 0):
            raise InputError(f"component: expected 0, as {option} are single numbers, got {component!r}")
        return array.reshape(-1)
    if component is not None and component != MAGNITUDE:
        chosen: AnyArray = array[:, whole_number("component", component, array.shape[1] - 1, 0)]
        return chosen
    if array.dtype.kind not in "fiub":
        raise InputError(f"{option}: expected real numbers, got {array.dtype}")
    with np.errstate(all="ignore"):
        wide = array.astype(np.float64)
        most = np.max(np.abs(wide), axis=1, keepdims=True)
        scale = np.where((most > 0) & np.isfinite(most), most, 1.0)  # so that squares stay in range
        return np.asarray(np.sqrt(((wide / scale) ** 2).sum(axis=1)) * scale[:, 0])
