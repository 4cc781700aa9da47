"""Assimp: converts what the Open Asset Import Library reads, such as 3DS, X, LWO and AC3D, to Scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.losses import listed
from clpeel.reading.marks import together
from clpeel.reading.paints import Pictures, painted, with_opacities
from clpeel.reading.transforms import Reals, cofactors, moved, product, turned
from clpeel.reading.words import one_line
from clpeel.scene.arrays import AnyArray
from clpeel.scene.materials import Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Texture, linear

_DIFFUSE, _OPACITY, _BASE_COLOR = 1, 8, 12
"""Numbers of Assimp's kinds of textures, aiTextureType."""

_MOST_NODES = 1 << 16
"""The most nodes that are followed, so that a damaged file cannot ask for more."""


def from_assimp(path: str, companions: Companions) -> Scene:
    """Return the scene of a file that Assimp reads, as its nodes stand at rest. Assimp turns them so that Y is up.

    Polygons are triangles, as assimp_py gives no others, and no lines and points. Colours are display-referred.
    companions: the files beside it, for textures.
    Raises InputError if there is nothing to draw, or Assimp says that the file is damaged.
    """
    import assimp_py

    steps = assimp_py.Process_Triangulate | assimp_py.Process_SortByPType | assimp_py.Process_TransformUVCoords
    try:
        file = assimp_py.import_file(path, steps)
    except RuntimeError as error:
        told = one_line(RuntimeError(str(error).rpartition(f"'{path}': ")[2])).removeprefix("RuntimeError: ")
        raise InputError(f"not a readable mesh: the file is damaged (Assimp: {told})") from None
    except ValueError as error:
        if "triangulated" not in str(error):
            raise
        raise InputError(
            "expected triangles alone, got lines or points too, which assimp_py does not pass on"
        ) from None
    paints, others = _Paints(file.materials, Pictures(companions)), Counter[str]()
    scenes = list[Scene | None]()
    smoothed = path.lower().endswith((".3ds", ".ase"))
    for place, matrix in _placed(file.root_node, np.eye(4)):
        scenes.append(_mesh(file.meshes[place], matrix, paints, others, smoothed))
    scene = together(scenes)
    if scene is None:
        raise InputError("expected triangles, got none; the mesh is empty")
    notes = [f"{count} {words}" for words, count in others.items()]
    return replace(scene, notes=tuple(dict.fromkeys((*scene.notes, *notes, *paints.notes()))))


def _placed(root: Any, matrix: Reals) -> Iterator[tuple[int, Reals]]:
    """Yield the meshes that nodes show, by number, and where they stand. Raises InputError if nodes are too many."""
    left, seen = [(root, matrix)], 0
    while left:
        node, above = left.pop()
        seen += 1
        if seen > _MOST_NODES:
            raise InputError(f"expected at most {_MOST_NODES:,} nodes, got more")
        world = product(above, np.asarray(node.transformation, np.float64))
        for place in node.mesh_indices:
            yield int(place), world
        left += [(child, world) for child in reversed(node.children)]


def _rows(view: Any, width: int) -> AnyArray:
    """Return the numbers of a memoryview in rows."""
    return np.asarray(view).reshape(-1, width)


def _mesh(mesh: Any, matrix: Reals, paints: _Paints, others: Counter[str], smoothed: bool) -> Scene | None:
    """Return the triangles of a mesh in their place, or None without any. Raises InputError.

    smoothed: whether its normals are Assimp's, of smoothing groups. They are not kept: where a file has faces with both
    fronts, these cancel each other out.
    """
    points = moved(_rows(mesh.vertices, 3).astype(np.float64), matrix)
    if not mesh.num_faces:
        return None
    faces = _rows(mesh.indices, 3).astype(np.int64)
    colors = None
    if mesh.colors and mesh.colors[0] is not None:
        colors = np.clip(np.nan_to_num(_rows(mesh.colors[0], 4).astype(np.float64)), 0, 1)
    material = paints.of(mesh.material_index)
    given: dict[str, Any] = {}
    if mesh.normals and not smoothed:
        given["vertex_normals"] = turned(_rows(mesh.normals, 3).astype(np.float64), cofactors(matrix)[0])
    if colors is not None:
        if material is not None:
            colors[:, :3] = linear(colors[:, :3])
        given["vertex_colors"] = colors
    if material is not None:
        given["materials"] = (material,)
        if material.texture is not None:
            given["uv"] = _coordinates(mesh, len(points))
            if given["uv"] is None:
                others["mesh(es) lack texture coordinates, and have one colour of their texture"] += 1
                given["uv"] = np.zeros((len(points), 2))
    return Scene.from_arrays(points, faces, **given)


def _coordinates(mesh: Any, count: int) -> AnyArray | None:
    """Return a mesh's first texture coordinates, [count, 2], v pointing down, or None if it has none."""
    if not mesh.texcoords or mesh.texcoords[0] is None:
        return None
    found = np.asarray(mesh.texcoords[0], np.float64).reshape(count, -1)
    return found[:, :2] * [1, -1] + [0, 1] if found.shape[1] >= 2 else None


class _Paints:
    """The Materials of Assimp's, each made once, and only if a mesh has it."""

    def __init__(self, materials: Any, pictures: Pictures) -> None:
        self._given, self._pictures = materials, pictures
        self._made: dict[int, Material | None] = {}
        self._others: dict[str, None] = {}

    def notes(self) -> list[str]:
        """Return what is not drawn of the materials that were made."""
        others = f"textures left out, as only those of colour and opacity are drawn: {listed(self._others, 9)}"
        return [*self._pictures.notes, *([others] if self._others else [])]

    def of(self, place: int) -> Material | None:
        """Return a material, or None for the one that Assimp invents where a file has none."""
        if place not in self._made:
            says = self._given[place] if 0 <= place < len(self._given) else {}
            invented = not says or str(says.get("NAME", "")) == "DefaultMaterial"
            self._made[place] = None if invented else self._of(says)
        return self._made[place]

    def _of(self, says: dict[str, Any]) -> Material:
        """Return the Material of what Assimp says. A colour that is black or missing below a texture is white."""
        textures = says.get("TEXTURES", {})
        files = {kind: str(names[0]) for kind, names in textures.items() if names}
        color, mask = files.get(_BASE_COLOR) or files.get(_DIFFUSE), files.get(_OPACITY)
        name = str(says.get("NAME", ""))
        self._others |= {
            f"{named(file)} of {named(name)}": None for file in files.values() if file not in (color, mask)
        }
        images = [None if file is None else self._image(file) for file in (color, None if mask == color else mask)]
        rgba = images[0] if images[1] is None else with_opacities(images[0], images[1])
        texture = None if rgba is None else Texture(rgba)
        *rgb, alpha = [*says.get("COLOR_DIFFUSE", (1.0, 1.0, 1.0)), 1.0][:4]
        if texture is not None and not any(rgb):
            rgb = [1.0, 1.0, 1.0]
        return painted(name, rgb, float(says.get("OPACITY", alpha)), texture)

    def _image(self, file: str) -> AnyArray | None:
        """Return the texels of an image, or None, after a note, if it cannot be read or Assimp keeps it to itself."""
        if file.startswith("*"):
            self._pictures.notes.append(f"texture {named(file)} left out: it lies within the file")
            return None
        return self._pictures.image(file)
