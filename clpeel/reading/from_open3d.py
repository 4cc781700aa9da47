"""Converts Open3D's meshes, line sets and clouds to Scenes, both those of open3d.geometry and of open3d.t.geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.colors import unit_colors
from clpeel.reading.marks import marks
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Texture, linear

_KINDS = {"TriangleMesh": "triangles", "LineSet": "lines", "PointCloud": "points"}


def from_open3d(thing: Any) -> Scene:
    """Return the scene of an Open3D TriangleMesh, LineSet or PointCloud with its colours, normals and textures.

    Open3D's floats 0..1 are display-referred colours. What is outside of this is cut off, with a note.
    Raises InputError if there is nothing to draw.
    """
    kind = next(base.__name__ for base in type(thing).__mro__ if base.__name__ in _KINDS)
    arrays = _of_tensors(thing) if ".t.geometry" in type(thing).__module__ else _of_legacy(thing)
    notes = list[str]()
    points, cells = arrays["points"], arrays.get("cells", np.zeros(0, np.int64))
    scene: Scene | None = None
    colors = _colors(arrays.get("colors"), len(points), "vertex colours", notes)
    if kind == "TriangleMesh" and len(cells):
        scene = _surface(thing, arrays, colors, notes)
    elif kind == "LineSet" and len(cells):
        own = _colors(arrays.get("cell_colors"), len(cells), "line colours", notes)
        if own is not None:
            points, cells = points[cells.reshape(-1)], np.arange(cells.size).reshape(-1, 2)
            colors = np.repeat(own, 2, axis=0)
        scene = marks(points, lines=cells, vertex_colors=colors)
    elif kind == "PointCloud" and len(points):
        normals = _fitting(arrays.get("normals"), len(points))
        scene = marks(points, points=np.arange(len(points)), vertex_colors=colors, vertex_normals=normals)
    if scene is None:
        raise InputError(f"expected {_KINDS[kind]}, got none in the {kind}; the mesh is empty")
    return replace(scene, notes=(*scene.notes, *dict.fromkeys(notes)))


def _of_legacy(thing: Any) -> dict[str, AnyArray]:
    """Return the arrays of an object of open3d.geometry by the names of this module."""
    names = {
        "points": ("vertices", "points"),
        "cells": ("triangles", "lines"),
        "colors": ("vertex_colors",) if hasattr(thing, "vertices") else () if hasattr(thing, "lines") else ("colors",),
        "cell_colors": ("colors",) if hasattr(thing, "lines") else (),
        "normals": ("vertex_normals", "normals"),
        "uv": ("triangle_uvs",),
        "materials": ("triangle_material_ids",),
    }
    return {
        key: np.asarray(getattr(thing, name)) for key, ways in names.items() for name in ways if hasattr(thing, name)
    }


def _of_tensors(thing: Any) -> dict[str, AnyArray]:
    """Return the arrays of an object of open3d.t.geometry by the names of this module."""
    points = thing.vertex if hasattr(thing, "vertex") else thing.point
    cells = thing.triangle if hasattr(thing, "triangle") else thing.line if hasattr(thing, "line") else None
    names = {"points": (points, "positions"), "colors": (points, "colors"), "normals": (points, "normals")}
    if cells is not None:
        names |= {"cells": (cells, "indices"), "cell_colors": (cells, "colors"), "uv": (cells, "texture_uvs")}
    found = {key: table[name].cpu().numpy() for key, (table, name) in names.items() if name in table}
    if "uv" in found:
        found["uv"] = found["uv"].reshape(-1, 2) * [1, -1] + [0, 1]  # its readers leave images and v as files have them
    material = getattr(thing, "material", None)
    if material is not None and material.is_valid() and "base_color" in material.vector_properties:
        found["color"] = np.clip(np.asarray(material.vector_properties["base_color"], np.float64), 0, 1)
    return {"points": np.zeros((0, 3)), **found}


def _fitting(array: AnyArray | None, count: int) -> AnyArray | None:
    """Return an array with so many rows; None for any other, which Open3D has where there is none."""
    return array if array is not None and len(array) == count and count else None


def _colors(array: AnyArray | None, count: int, name: str, notes: list[str]) -> Colors | None:
    """Return colours [count, 3|4] as bytes or as floats 0..1, or None if there are none."""
    own = _fitting(array, count)
    if own is None or own.ndim != 2 or own.shape[1] not in (3, 4):
        return None
    if own.dtype.kind in "iu":
        return (
            own.astype(np.uint8) if own.dtype == np.uint8 else unit_colors(own / np.iinfo(own.dtype).max, name, notes)
        )
    return unit_colors(own, name, notes)


def _surface(thing: Any, arrays: Mapping[str, AnyArray], colors: Colors | None, notes: list[str]) -> Scene:
    """Return the scene of a TriangleMesh. Where there is a texture, it says the colours."""
    points, faces = arrays["points"], arrays["cells"].astype(np.int64)
    normals = _fitting(arrays.get("normals"), len(points))
    own = _colors(arrays.get("cell_colors"), len(faces), "triangle colours", notes)
    fields: dict[str, Any] = {"vertex_colors": colors} if own is None else {"face_colors": own}
    if own is not None and colors is not None:
        notes.append("vertex colours left out: the triangles have their own")
    color = arrays.get("color")
    if own is None and colors is None and color is not None:
        fields = {"color": color}
    uv, images = _fitting(arrays.get("uv"), 3 * len(faces)), _images(thing)
    if images and uv is None:
        notes.append("texture left out: the mesh has no coordinates for it")
    if images and uv is not None:
        corners = faces.reshape(-1)
        points, faces = points[corners], np.arange(len(corners)).reshape(-1, 3)
        normals = None if normals is None else normals[corners]
        if own is not None or colors is not None:
            notes.append("colours left out: the mesh has a texture")
        places = _fitting(arrays.get("materials"), len(faces))
        of_faces = np.zeros(len(faces), np.int64) if places is None else places.astype(np.int64)
        of_faces[(of_faces < 0) | (of_faces >= len(images))] = NO_MATERIAL
        red, green, blue = (1.0, 1.0, 1.0) if color is None else (float(value) for value in linear(color[:3]))
        textures = [None if image is None else Texture.of(image) for image in images]
        materials = [Material(base_color=(red, green, blue, 1.0), texture=texture) for texture in textures]
        fields = {"uv": uv, "materials": materials, "face_materials": of_faces}
    return Scene.from_arrays(points, faces, vertex_normals=normals, **fields)


def _images(thing: Any) -> list[AnyArray | None]:
    """Return the images of a mesh's textures, whose row 0 is where v is 0; None for an empty one. No images: []."""
    if hasattr(thing, "textures"):
        images = list(thing.textures)
    else:
        material = thing.material
        has_image = material.is_valid() and "albedo" in material.texture_maps
        images = [material.texture_maps["albedo"].to_legacy()] if has_image else []
    found = [None if image.is_empty() else np.asarray(image) for image in images]
    return found if any(image is not None for image in found) else []
