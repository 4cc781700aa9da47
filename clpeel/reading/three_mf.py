"""3MF: reads packages into Scenes: what is to be built, with its components, transforms, colours and textures.

Numbers stay as the file has them, in its unit. lib3mf would round them to float32, and does not tell the colour that
an assembly gives its parts. trimesh reads no colours, and places components of other parts wrongly.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import named
from clpeel.reading.corners import split
from clpeel.reading.gltf_pose import placed
from clpeel.reading.losses import listed
from clpeel.reading.three_mf_colors import Palette, Rows
from clpeel.reading.three_mf_parts import Model, Object, Package, Placed, plain
from clpeel.reading.transforms import Reals, product
from clpeel.scene.arrays import checked_faces
from clpeel.scene.materials import NO_MATERIAL
from clpeel.scene.scene import Scene, joined

_MOST_OBJECTS, _MOST_TRIANGLES, _DEEPEST = 1 << 20, 1 << 28, 100
"""The most objects and triangles that are built, and how deep components may nest. A small file could ask for more."""


def three_mf(data: bytes) -> Scene:
    """Return the scene of a 3MF package, with notes of what it lacks.

    Objects that are not to be built are not in it. Those of every type are, and those that a slicer would not print.
    Raises InputError if there are no triangles, or if the package is damaged; and KeyError, ValueError, BadZipFile and
    ExpatError where a part of it is.
    """
    package = Package(data)
    palette = Palette(package)
    build = _Build(package, palette)
    model = package.model(package.root)
    assert model is not None
    build.check(model.build)
    for item in model.build:
        build.place(item, package.root, np.eye(4), 0)
    left_out = dict.fromkeys(words for each in package.models.values() for words in each.left_out.values())
    notes = [*build.notes(), *palette.notes]
    if left_out:
        notes.append(f"left out of the 3MF package, as it is not read: {listed(left_out, 9)}")
    if not build.pieces:
        raise InputError(f"expected triangles, got none; {notes[0] if notes else 'the package builds nothing'}")
    shapes = {key: _shape(build.objects[key[0]], entries, palette.table) for key, entries in build.entries.items()}
    scene = joined([_in_place(shapes[piece.key], piece.matrix) for piece in build.pieces])
    return replace(scene, notes=tuple(dict.fromkeys(notes)))


# --- what is built ----------------------------------------------------------------------------------------------------

_Where = tuple[str, int]
"""An object's part and number."""

_Key = tuple[_Where, int]
"""A mesh that looks alike wherever it is put, and the entry of the palette that its parents give it."""


@dataclass(frozen=True)
class _Piece:
    """A mesh in its place."""

    key: _Key
    matrix: Reals


class _Build:
    """The meshes that are built, in order, as components unfold.

    objects: by part and number. entries: for each kind of mesh, its entries of the palette, int64 [m, 3].
    """

    def __init__(self, package: Package, palette: Palette) -> None:
        self.package, self.palette = package, palette
        self.pieces: list[_Piece] = []
        self.objects: dict[_Where, Object] = {}
        self.entries: dict[_Key, NDArray[np.int64]] = {}
        self.lost = Counter[str]()
        self._sizes: dict[_Where, tuple[int, int, int]] = {}

    def check(self, items: list[Placed]) -> None:
        """Raise InputError if more is to be built than anybody would mean, or something is a part of itself."""
        sizes = [self._size(item, self.package.root, ()) for item in items]
        objects, triangles = (sum(size[place] for size in sizes) for place in (0, 1))
        if objects > _MOST_OBJECTS or triangles > _MOST_TRIANGLES:
            raise InputError(
                f"expected at most {_MOST_OBJECTS:,} objects and {_MOST_TRIANGLES:,} triangles to be built by a 3MF "
                f"package, got {objects:,} and {triangles:,}"
            )

    def _size(self, what: Placed, part: str, chain: tuple[_Where, ...]) -> tuple[int, int, int]:
        """Return how many objects and triangles an object is made of, and how deep it nests. chain: its parents."""
        part = what.path or part
        where, (_, found) = _where(part, what), self._find(part, what)
        if found is None:
            return 0, 0, 0
        if where in chain:
            raise InputError(f"the file is damaged: object {what.number} of its 3MF package is a part of itself")
        if where not in self._sizes and len(chain) <= _DEEPEST:
            inside = [self._size(component, part, (*chain, where)) for component in found.components]
            objects, triangles = (sum(size[place] for size in inside) for place in (0, 1))
            depth = 1 + max((size[2] for size in inside), default=0)
            self._sizes[where] = 1 + objects, len(found.corners) // 3 + triangles, depth
        if len(chain) + self._sizes.get(where, (0, 0, 0))[2] > _DEEPEST:
            raise InputError(f"expected at most {_DEEPEST} levels of components in a 3MF package, got more")
        return self._sizes[where]

    def _find(self, part: str, what: Placed) -> tuple[Model | None, Object | None]:
        """Return an object and the model that it is in, as far as they are there."""
        model = self.package.model(part)
        return model, model.objects.get(what.number) if model else None

    def place(self, what: Placed, part: str, matrix: Reals, entry: int) -> None:
        """Build an object, and all that it is made of.

        part: the part that names it. matrix: of its parent. entry: of the palette, for what has no properties of its
        own: an object's properties are those of its components, too.
        """
        part = what.path or part
        where, (model, found) = _where(part, what), self._find(part, what)
        if model is None or found is None:
            self.lost[f"object {what.number} of {named(part)}" if model else f"part {named(part)}"] += 1
            return
        if found.group >= 0:
            entry = self.palette.entry(model, found.group, found.index)
        matrix = product(matrix, what.matrix)
        if found.corners:
            key = where, entry
            if key not in self.entries:
                self.objects[where] = found
                self.entries[key] = _entries(found, model, self.palette, entry)
            self.pieces.append(_Piece(key, matrix))
        for component in found.components:
            self.place(component, part, matrix, entry)

    def notes(self) -> list[str]:
        """Return a note of what is to be built but is not in the package."""
        if not self.lost:
            return []
        return [f"{self.lost.total()} component(s) left out, as the 3MF package lacks: {listed(self.lost)}"]


def _where(part: str, what: Placed) -> _Where:
    """Return an object's part and number, the part as all who mean it write it."""
    return plain(part), what.number


def _entries(found: Object, model: Model, palette: Palette, entry: int) -> NDArray[np.int64]:
    """Return the entries of the palette for a mesh's corners, [m, 3]. entry: for triangles without any of their own.

    If a triangle does not give all three properties, its first one is that of all corners (core specification, 4.1.4).
    """
    entries = np.full((len(found.corners) // 3, 3), entry, np.int64)
    given: NDArray[np.int64] = np.array(found.given, np.int64).reshape(-1, 5)
    given = given[given[:, 2] >= 0]  # without a first one, the object's counts
    groups: NDArray[np.int64] = np.where(given[:, 1] >= 0, given[:, 1], found.group)
    indices = np.where(np.all(given[:, 2:] >= 0, axis=1, keepdims=True), given[:, 2:], given[:, 2:3])
    for group in np.unique(groups):
        own = np.flatnonzero(groups == group)
        entries[given[own, 0]] = palette.entries(model, int(group), indices[own], entry)
    return entries


# --- scenes -----------------------------------------------------------------------------------------------------------


def _shape(found: Object, entries: NDArray[np.int64], table: Rows) -> Scene:
    """Return the scene of a mesh, where it was made. A vertex is split where its corners differ in their properties."""
    points = np.array(found.points).reshape(-1, 3)
    faces = checked_faces(np.array(found.corners).reshape(-1, 3), len(points)).astype(np.int64)
    colors, of_faces = table.colors, table.material_of[entries[:, 0]]
    used = np.unique(of_faces[of_faces >= 0])
    first = colors[entries[:, 0]]
    flat = np.array_equal(colors[entries], np.broadcast_to(first[:, None], (len(first), 3, 4)))
    fields: dict[str, Any] = {}
    if flat:
        fields = {"color": first[0]} if np.ptp(first, axis=0).max() == 0 else {"face_colors": first}
    if len(used) or not flat:
        source, (own,), index = split(faces.reshape(-1), len(points), entries.reshape(-1))
        points, faces = points[source], index.reshape(-1, 3)
        if not flat:
            fields["vertex_colors"] = colors[own]
        if len(used):
            fields["materials"] = [table.materials[place] for place in used]
            fields["face_materials"] = np.where(of_faces >= 0, np.searchsorted(used, of_faces), NO_MATERIAL)
            fields["uv"] = table.uv[own]
    return Scene.from_arrays(points, faces, **fields)


def _in_place(shape: Scene, matrix: Reals) -> Scene:
    """Return a mesh's scene, moved. Where the transform mirrors, faces are turned, so that outside stays outside."""
    vertices, _, faces = placed(shape.vertices, None, shape.faces, matrix[None, None])
    return replace(shape, vertices=vertices, faces=faces)
