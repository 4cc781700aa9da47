"""Placing: a whole scene moved by a matrix, or with other sides of its faces seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.transforms import Reals, cofactors, moved, turned
from clpeel.scene.lights import AmbientLight, DirectionalLight, Lamp, PointLight
from clpeel.scene.scene import Scene


def moved_scene(scene: Scene, matrix: Sequence[Sequence[float]]) -> Scene:
    """Return the scene moved by an affine matrix, 4 rows of 4 numbers, with its normals and its lights.

    Where the matrix mirrors, two corners of each face are swapped, so that its front stays its front. Raises InputError
    if the matrix is not affine, or flattens.
    """
    rows = np.asarray(matrix, np.float64)
    if rows.shape != (4, 4) or not np.isfinite(rows).all() or rows[3].tolist() != [0, 0, 0, 1]:
        raise InputError("matrix: expected 4 rows of 4 numbers, the last of them 0, 0, 0, 1")
    if not rows[:3, :3].any():
        raise InputError("matrix: expected one that leaves the mesh its extent, got one that makes it a point")
    turns, sign = cofactors(rows)
    if not abs(sign) > 0:
        raise InputError("matrix: expected one that leaves the mesh its extent, got one that makes it flat")
    normals = scene.vertex_normals
    if normals is not None:
        around = turned(normals.astype(np.float64), turns * np.sign(sign))
        longest = np.abs(around).max(axis=1, keepdims=True)
        normals = np.divide(around, longest, out=around, where=longest > 0).astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is discarded when drawn, and counted there
        vertices = moved(scene.vertices, rows)
    return replace(
        scene,
        vertices=vertices,
        vertex_normals=normals,
        faces=scene.faces[:, [0, 2, 1]] if sign < 0 else scene.faces,
        lights=tuple(_moved_light(light, rows) for light in scene.lights),
    )


def _moved_light(light: Lamp, rows: Reals) -> Lamp:
    """Return a light at its new place. Its brightness stays, as that of glTF's lights does where a node scales."""

    def at(vector: Sequence[float], move: bool = False) -> Any:
        found = (moved if move else turned)(np.asarray(vector, np.float64)[None], rows)[0]
        return tuple(map(float, found))

    if isinstance(light, AmbientLight):
        return light if light.up is None else replace(light, up=at(light.up))
    if isinstance(light, DirectionalLight):
        return light if light.follows_camera else replace(light, direction=at(light.direction))
    changed: dict[str, Any] = {"position": at(light.position, move=True)}
    if hasattr(light, "direction"):
        changed["direction"] = at(light.direction)
    placed: PointLight = replace(light, **changed)
    return placed


def sided(scene: Scene, sides: str | None) -> Scene:
    """Return the scene with the faces seen from behind that are asked for, as `backface_type` has them.

    sides: "visible", "hidden", or None or "default" for those that the scene has. Raises InputError.
    """
    if sides in (None, "default"):
        return scene
    if sides == "visible":
        return replace(scene, single_sided=None)
    if sides != "hidden":
        raise InputError(f"backface_type: expected one of default, visible, hidden; got {sides!r}")
    return replace(scene, single_sided=np.ones(len(scene.faces), bool))
