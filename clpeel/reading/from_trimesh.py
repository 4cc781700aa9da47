"""Converts trimesh's meshes and scenes to Scenes: transforms in float64, and colours from all of trimesh's sources."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.transforms import cofactors, moved, turned
from clpeel.scene.arrays import DEFAULT_COLOR, AnyArray, Colors, alike, as_float
from clpeel.scene.scene import Scene, joined


def from_trimesh(source: Any) -> Scene:
    """Return the triangles of a trimesh mesh, or of all nodes of a trimesh scene in graph order.

    Raises InputError if there are no triangles. Lines, points and meshes without faces are skipped, and a note says so.
    """
    if hasattr(source, "graph"):
        placed = [source.graph[node] for node in source.graph.nodes_geometry]
        pieces = [(source.geometry[name], np.asarray(matrix, dtype=np.float64)) for matrix, name in placed]
    else:
        pieces = [(source, np.eye(4))]
    meshes = [(mesh, matrix) for mesh, matrix in pieces if hasattr(mesh, "faces") and len(mesh.faces)]
    others = Counter(_kind(piece) for piece, _ in pieces if not (hasattr(piece, "faces") and len(piece.faces)))
    left_out = ", ".join(f"{count} {kind}" for kind, count in others.items())
    if not meshes:
        raise InputError(f"expected triangles, got {left_out or 'none'}; the mesh is empty")
    scene = joined([_from_mesh(mesh, matrix) for mesh, matrix in meshes])
    return replace(scene, notes=(*scene.notes, f"left out, not triangles: {left_out}")) if left_out else scene


def _kind(piece: Any) -> str:
    """Return in words what a piece without triangles is, for a message."""
    if hasattr(piece, "entities"):
        return "line set(s)"
    return "mesh(es) without faces" if hasattr(piece, "faces") else "point cloud(s)"


def _from_mesh(mesh: Any, matrix: NDArray[np.float64]) -> Scene:
    """Return the Scene of one trimesh.Trimesh, transformed by matrix [4, 4]."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    normals = np.asarray(mesh.vertex_normals) if "vertex_normals" in mesh._cache else None
    if normals is not None and normals.shape != vertices.shape:
        normals = None
    if not np.array_equal(matrix, np.eye(4)):
        vertices = moved(vertices, matrix)
        if normals is not None:
            normals = turned(normals, cofactors(matrix)[0])
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colors, notes = _mesh_colors(mesh)
    scene = Scene.from_arrays(vertices, np.asarray(mesh.faces), vertex_normals=normals, **colors)
    return replace(scene, notes=notes)


def _mesh_colors(mesh: Any) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the colour argument of Scene.from_arrays for a trimesh.Trimesh ({} if it has no colour), and notes."""
    visual, notes = mesh.visual, list[str]()
    if visual.kind in ("face", "vertex"):
        name = f"{visual.kind}_colors"
        values = np.asarray(getattr(visual, name))
        if len(values) == len(mesh.faces if visual.kind == "face" else mesh.vertices):
            return {name: values}, ()
        return {}, (f"{name} left out: {len(values)} do not fit the mesh",)
    if visual.kind != "texture":
        return {}, ()
    if hasattr(visual.material, "materials"):  # each face has a material of its own
        table = [_material(material, None, notes) for material in visual.material.materials]
        default = np.array(DEFAULT_COLOR, np.uint8)
        rgba = alike([default if c is None else _finished(m, c) for m, c in zip(visual.material, table, strict=True)])
        return {"face_colors": np.array(rgba)[np.asarray(visual.face_materials)]}, tuple(notes)
    uv = visual.uv if np.shape(visual.uv) == (len(mesh.vertices), 2) else None
    colors = _material(visual.material, uv, notes)
    attributes = [a["color"] for a in (visual.vertex_attributes, mesh.vertex_attributes) if "color" in a]
    if attributes and np.shape(attributes[0]) in ((len(mesh.vertices), 3), (len(mesh.vertices), 4)):
        own = _unit_colors(np.asarray(attributes[0]))
        colors = own if colors is None else own * as_float(colors)
    elif attributes:
        notes.append("vertex colours left out: they do not fit the mesh")
    if colors is None:
        return {}, tuple(notes)
    return {"color" if colors.ndim == 1 else "vertex_colors": _finished(visual.material, colors)}, tuple(notes)


_INVENTED_DIFFUSE = (102, 102, 102, 255)  # trimesh gives this colour to a material without Kd
# trimesh gives this image to a mesh that has texture coordinates but no material.
_INVENTED_IMAGE = bytes((100, 100, 100, 255)) * 4


def _material(material: Any, uv: NDArray[np.float64] | None, notes: list[str]) -> Colors | None:
    """Return a material's RGBA: [4], or [n, 4] if it has a texture, sampled at uv [n, 2].

    None if trimesh invented it.
    """
    if hasattr(material, "baseColorFactor"):  # glTF
        factor, image = material.baseColorFactor, material.baseColorTexture
    else:  # OBJ and others
        image, invented = material.image, "kd" not in material.kwargs and tuple(material.diffuse) == _INVENTED_DIFFUSE
        if invented and (image is None or (image.size == (2, 2) and image.tobytes() == _INVENTED_IMAGE)):
            return None
        factor = None if invented else material.diffuse
    colors: Colors = np.full(4, 255, np.uint8) if factor is None else np.asarray(factor, dtype=np.uint8)
    if image is None:
        return colors
    if uv is None:
        notes.append("texture left out: the mesh has no coordinates for it")
        return colors
    try:
        texels = _texels(image, uv)
    except (OSError, ValueError) as error:
        notes.append(f"texture left out: {one_line(error)}")
        return colors
    notes.append("textures are sampled at the vertices only")
    return texels if (colors == 255).all() else as_float(texels) * as_float(colors)


def _texels(image: Any, uv: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the nearest texels [n, 4] of a PIL image at uv [n, 2], where v points up.

    The image repeats. Coordinates 0 and 1 are the centres of its outermost texels.
    """
    pixels: NDArray[np.uint8] = np.asarray(image.convert("RGBA"))
    size = np.array([image.width, image.height])
    spot = np.nan_to_num(uv * [1, -1] + [0, 1], posinf=0.0, neginf=0.0) * (size - 1)
    column, row = (np.rint(np.mod(spot, size)).astype(np.int64) % size).T
    return np.asarray(pixels[row, column])


def _finished(material: Any, colors: Colors) -> Colors:
    """Return the colours [4] or [n, 4] with the alpha that the material asks for: alphaMode in glTF, d or Tr in OBJ."""
    top = 255 if colors.dtype == np.uint8 else 1
    colors = colors.copy()
    if hasattr(material, "baseColorFactor"):
        mode = material.alphaMode or "OPAQUE"
        if mode == "MASK":
            cutoff = 0.5 if material.alphaCutoff is None else material.alphaCutoff
            colors[..., 3] = np.where(colors[..., 3] / top >= cutoff, top, 0)
        elif mode != "BLEND":
            colors[..., 3] = top
        return colors
    for key in ("d", "tr"):
        if key in material.kwargs:
            value = float(material.kwargs[key][-1])
            colors = as_float(colors)
            colors[..., 3] *= min(max(value if key == "d" else 1 - value, 0.0), 1.0)
            break
    return colors


def _unit_colors(colors: AnyArray) -> NDArray[np.float32]:
    """Return colours [n, 3|4] of any dtype as float32 [n, 4] in 0..1.

    Integers are normalised by their type's maximum.
    """
    top = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1
    rgba = np.ones((len(colors), 4), dtype=np.float32)
    rgba[:, : colors.shape[1]] = np.clip(np.nan_to_num(colors / top), 0, 1)
    return rgba


def one_line(error: BaseException) -> str:
    """Return an error's type and message on one short line, with control characters escaped."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in " ".join(str(error).split()))
    shown = text if len(text) <= 120 else f"{text[:119]}…"
    return f"{type(error).__name__}: {shown}" if shown else type(error).__name__
