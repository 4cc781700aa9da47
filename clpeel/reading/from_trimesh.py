"""Converts trimesh's meshes and scenes to Scenes: transforms in float64, colours, and materials with their textures."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.marks import chains, marks
from clpeel.reading.mtl import finished
from clpeel.reading.transforms import cofactors, moved, turned
from clpeel.reading.words import one_line
from clpeel.scene.arrays import AnyArray
from clpeel.scene.materials import ALPHA_MODES, NO_MATERIAL, Material
from clpeel.scene.scene import Scene, joined
from clpeel.scene.textures import Texture, linear


def from_trimesh(source: Any, display_referred: bool = False) -> Scene:
    """Return what a trimesh mesh, cloud or path shows, or all nodes of a trimesh scene in graph order.

    display_referred: whether the colours of materials for glTF are, as in a COLLADA file. They are linear in glTF.
    Raises InputError if there is nothing to draw. Meshes without faces are skipped, and a note says so.
    """
    if hasattr(source, "graph"):
        placed = [source.graph[node] for node in source.graph.nodes_geometry]
        pieces = [(source.geometry[name], np.asarray(matrix, dtype=np.float64)) for matrix, name in placed]
    else:
        pieces = [(source, np.eye(4))]
    made = _Materials(display_referred)
    scenes = list[Scene]()
    others = Counter[str]()
    for piece, matrix in pieces:
        found = (
            _from_mesh(piece, matrix, made) if hasattr(piece, "faces") and len(piece.faces) else _marks(piece, matrix)
        )
        if found is None:
            others[_kind(piece)] += 1
        else:
            scenes.append(found)
    left_out = ", ".join(f"{count} {kind}" for kind, count in others.items())
    if not scenes:
        raise InputError(f"expected triangles, lines or points, got {left_out or 'none'}; the mesh is empty")
    scene = joined(scenes)
    return replace(scene, notes=(*scene.notes, f"left out, nothing to draw: {left_out}")) if left_out else scene


def _marks(piece: Any, matrix: NDArray[np.float64]) -> Scene | None:
    """Return the Scene of one trimesh path or cloud, transformed by matrix [4, 4], or None if it has nothing."""
    if hasattr(piece, "faces"):
        return None
    vertices = np.asarray(piece.vertices, dtype=np.float64)
    if not len(vertices):
        return None
    lines, points, colors = None, np.arange(len(vertices)), getattr(piece, "colors", None)
    if hasattr(piece, "entities"):
        curves = [np.asarray(entity.discrete(vertices)) for entity in piece.entities]
        counts = np.array([len(curve) for curve in curves], np.int64)
        lines, points = chains(counts), np.zeros(0, np.int64)
        colors = None if colors is None or len(colors) != len(curves) else np.repeat(colors, counts, axis=0)
        vertices = np.concatenate(curves) if curves else np.zeros((0, 3))
    if vertices.shape[1] == 2:
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    given = colors if colors is not None and len(colors) == len(vertices) and len(colors) else None
    return marks(moved(vertices, matrix), lines, points, vertex_colors=given)


def _kind(piece: Any) -> str:
    """Return in words what a piece without triangles is, for a message."""
    if hasattr(piece, "entities"):
        return "line set(s)"
    return "mesh(es) without faces" if hasattr(piece, "faces") else "point cloud(s)"


def _from_mesh(mesh: Any, matrix: NDArray[np.float64], made: _Materials) -> Scene:
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
    surface, notes = _surface(mesh, made)
    scene = Scene.from_arrays(vertices, np.asarray(mesh.faces), vertex_normals=normals, **surface)
    return replace(scene, notes=tuple(notes))


# --- colours and materials --------------------------------------------------------------------------------------------


def _surface(mesh: Any, made: _Materials) -> tuple[dict[str, Any], list[str]]:
    """Return the colours and materials of a trimesh.Trimesh, as Scene.from_arrays has them, and notes."""
    visual, notes = mesh.visual, list[str]()
    if visual.kind in ("face", "vertex"):
        name = f"{visual.kind}_colors"
        values = np.asarray(getattr(visual, name))
        if len(values) == len(mesh.faces if visual.kind == "face" else mesh.vertices):
            return {name: values}, []
        return {}, [f"{name} left out: {len(values)} do not fit the mesh"]
    if visual.kind != "texture":
        return {}, []
    several = hasattr(visual.material, "materials")  # each face has a material of its own
    own = visual.material.materials if several else [visual.material]
    uv = np.asarray(visual.uv, np.float64) if np.shape(visual.uv) == (len(mesh.vertices), 2) else None
    found = [made.material(material, uv is not None, notes) for material in own]
    fields: dict[str, Any] = {}
    materials = [material for material in found if material is not None]
    if materials:
        places = np.array([materials.index(m) if m is not None else NO_MATERIAL for m in found], np.int64)
        of_faces = np.asarray(visual.face_materials, np.int64) if several else np.zeros(len(mesh.faces), np.int64)
        fields |= {"materials": materials, "face_materials": places[of_faces]}
    if uv is not None and any(material.texture is not None for material in materials):
        fields["uv"] = uv * [1, -1] + [0, 1]  # trimesh's v points up
    attributes = [a["color"] for a in (visual.vertex_attributes, mesh.vertex_attributes) if "color" in a]
    if attributes and np.shape(attributes[0]) in ((len(mesh.vertices), 3), (len(mesh.vertices), 4)):
        fields["vertex_colors"] = _unit_colors(np.asarray(attributes[0]))
    elif attributes:
        notes.append("vertex colours left out: they do not fit the mesh")
    return fields, notes


_INVENTED_DIFFUSE = (102, 102, 102, 255)  # trimesh gives this colour to a material without Kd
# trimesh gives this image to a mesh that has texture coordinates but no material.
_INVENTED_IMAGE = bytes((100, 100, 100, 255)) * 4


class _Materials:
    """The Materials of trimesh's materials. Each of these, and each image, is turned into one only once.

    display_referred: whether the colours of glTF materials are so, and their alpha counts: trimesh makes such materials
    of COLLADA files, too, whose colours are not linear.
    """

    def __init__(self, display_referred: bool) -> None:
        self._display_referred = display_referred
        self._made: dict[tuple[int, bool], tuple[Any, Material | None, list[str]]] = {}
        self._textures: dict[int, tuple[Any, Texture | str]] = {}

    def material(self, source: Any, has_uv: bool, notes: list[str]) -> Material | None:
        """Return a trimesh material as a Material, and add notes. None if trimesh invented it.

        has_uv: whether the mesh has coordinates for a texture. trimesh's doubleSided is ignored: False is what it is
        in every material that says nothing of it.
        """
        key = id(source), has_uv
        if key not in self._made:
            own = list[str]()
            pbr = hasattr(source, "baseColorFactor")
            made = self._of_gltf(source, has_uv, own) if pbr else self._of_obj(source, has_uv, own)
            self._made[key] = source, made, own  # the source is kept, so that no other one gets its id
        notes += [note for note in self._made[key][2] if note not in notes]
        return self._made[key][1]

    def _of_gltf(self, source: Any, has_uv: bool, notes: list[str]) -> Material:
        """Return the Material of a PBRMaterial. trimesh keeps its linear colour as bytes."""
        factor = source.baseColorFactor
        rgba = np.ones(4) if factor is None else np.asarray(factor, np.float64) / 255
        texture = self._texture(source.baseColorTexture, has_uv, notes)
        mode = source.alphaMode or "OPAQUE"
        if self._display_referred:
            rgba[:3] = linear(rgba[:3])
            mode = "BLEND" if rgba[3] < 1 else mode
        red, green, blue, alpha = (float(value) for value in rgba)
        cutoff = 0.5 if source.alphaCutoff is None else max(float(source.alphaCutoff), 0.0)
        known = mode if mode in ALPHA_MODES else "OPAQUE"
        return Material(str(source.name or ""), (red, green, blue, alpha), texture, known, cutoff)

    def _of_obj(self, source: Any, has_uv: bool, notes: list[str]) -> Material | None:
        """Return the Material of a SimpleMaterial, which has what an MTL file says, as far as trimesh keeps it."""
        image, says = source.image, {key: _words(value) for key, value in source.kwargs.items()}
        invented = "kd" not in says and tuple(source.diffuse) == _INVENTED_DIFFUSE
        if invented and (image is None or (image.size == (2, 2) and image.tobytes() == _INVENTED_IMAGE)):
            return None
        if "kd" not in says and not invented:
            says["kd"] = _words(np.asarray(source.diffuse)[:3] / 255)
            says.setdefault("d", str(float(source.diffuse[3]) / 255))
        if image is not None:
            says["map_kd"] = ""
        return finished(str(source.name or ""), says, self._texture(image, has_uv, notes))

    def _texture(self, image: Any, has_uv: bool, notes: list[str]) -> Texture | None:
        """Return the texture of a Pillow image, or None, after a note, if there is none."""
        if image is None:
            return None
        if not has_uv:
            notes.append("texture left out: the mesh has no coordinates for it")
            return None
        if id(image) not in self._textures:
            try:
                deep = image.mode.startswith("I")  # 16 bits of grey, which Pillow would cut off at 8
                pixels = np.asarray(image).astype(np.uint16) if deep else np.asarray(image.convert("RGBA"))
                self._textures[id(image)] = image, Texture.of(pixels)
            except (OSError, ValueError) as error:
                self._textures[id(image)] = image, f"texture left out: {one_line(error)}"
        texture = self._textures[id(image)][1]
        if isinstance(texture, str):
            notes.append(texture)
            return None
        return texture


def _words(value: Any) -> str:
    """Return a value that trimesh has read from an MTL file as text again."""
    return " ".join(map(str, value)) if np.ndim(value) else str(value)


def _unit_colors(colors: AnyArray) -> NDArray[np.float32]:
    """Return colours [n, 3|4] of any dtype as float32 [n, 4] in 0..1.

    Integers are normalised by their type's maximum.
    """
    top = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1
    rgba = np.ones((len(colors), 4), dtype=np.float32)
    rgba[:, : colors.shape[1]] = np.clip(np.nan_to_num(colors / top), 0, 1)
    return rgba
