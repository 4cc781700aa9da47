"""A glTF primitive: its triangles, lines or points, and the numbers of its vertices, morphed by its targets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clpeel.errors import InputError
from clpeel.reading import compressed
from clpeel.reading.gltf_accessors import Accessors, unit
from clpeel.reading.gltf_document import DRACO, Json, damaged, extension, fields, objects, whole
from clpeel.reading.marks import chain
from clpeel.reading.strips import fan, strip
from clpeel.scene.arrays import AnyArray

_SHARES = ("COLOR_", "WEIGHTS_")
"""How attributes begin whose integers are normalized whether their accessors say so or not."""

_POINTS, _LINES, _LOOP, _LINE_STRIP, _TRIANGLES, _STRIP, _FAN = range(7)
_WIDTHS = {_POINTS: 1, _LINES: 2, _LOOP: 2, _LINE_STRIP: 2}
"""How many vertices a point and a line have, by the mode."""


class Primitive:
    """What a primitive consists of, and the numbers of its vertices, which are read when they are asked for.

    faces: its triangles, [m, 3] integers 0..count-1, or its lines [m, 2], or its points [m, 1]. count: how many
    vertices it has. Several primitives may share one long list of vertices, so each keeps only those that it uses.
    material: its index, or None. lacks: what it is, in words, if there is nothing to draw.

    Raises InputError if the primitive is damaged, or packed in a way that is not read.
    """

    def __init__(self, accessors: Accessors, primitive: Json) -> None:
        self._accessors, self._attributes = accessors, fields(primitive, "attributes")
        self.material = primitive.get("material")
        self.targets: Sequence[Json] = objects(primitive, "targets")
        self._unpacked: dict[str, AnyArray] = {}
        self._read: dict[str, AnyArray] = {}
        self._used: AnyArray | None = None
        self._stored = 0
        self.faces: AnyArray = np.zeros((0, 3), np.int32)
        mode = whole("mode", primitive.get("mode", _TRIANGLES))
        self.lacks = None if "POSITION" in self._attributes else "mesh(es) without positions"
        if self.lacks is None:
            self.faces = self._triangles(primitive, mode)
            self.lacks = None if len(self.faces) else "mesh(es) without faces"
        self.count = self._stored if self._used is None else len(self._used)

    @property
    def marks(self) -> bool:
        """Whether it consists of lines or points."""
        return self.faces.shape[1] < 3

    # --- numbers of vertices ------------------------------------------------------------------------------------------

    def has(self, name: str) -> bool:
        """Return whether the vertices have this attribute."""
        return name in self._attributes

    def morphs(self, name: str, weights: Sequence[float]) -> bool:
        """Return whether these weights of the targets change this attribute."""
        return any(weight and name in target for weight, target in zip(weights, self.targets, strict=False))

    def stored(self, name: str, *types: str) -> AnyArray:
        """Return an attribute's numbers as they are stored, [count, width]. Raises InputError.

        types: those that the accessor may have.
        """
        if name not in self._read:
            values = self._unpacked.get(name)
            if values is None:
                values = self._accessors.values(self._attributes[name], name, *types)
            self._read[name] = self._rows(name, values)
        return self._read[name]

    def floats(self, name: str, weights: Sequence[float], *types: str) -> AnyArray:
        """Return an attribute's numbers as floats, [count, width], morphed (glTF 2.0, section 3.7.2.2).

        Normalized integers become 0..1 or -1..1. weights: of the targets. types: as in stored. Raises InputError.
        """
        normalized = name.startswith(_SHARES) or self._accessors.normalized(self._attributes[name])
        values = unit(self.stored(name, *types), normalized)
        if self.morphs(name, weights):
            values = values.astype(np.float64)
            for weight, target in zip(weights, self.targets, strict=False):
                if weight and name in target:
                    delta = self._rows(name, self._accessors.floats(target[name], f"{name} of a target", *types))
                    width = min(delta.shape[1], values.shape[1])
                    values[:, :width] += weight * delta[:, :width]
        return values

    def _rows(self, name: str, values: AnyArray) -> AnyArray:
        """Return the numbers of the vertices that are used. Raises InputError if there are not as many as positions."""
        if len(values) != self._stored:
            damaged(f"{name}: expected {self._stored}, as there are positions, got {len(values)}")
        return values if self._used is None else values[self._used]

    # --- triangles ----------------------------------------------------------------------------------------------------

    def _triangles(self, primitive: Json, mode: int) -> AnyArray:
        """Return the triangles [m, 3], lines [m, 2] or points [m, 1]. Sets which vertices are used."""
        faces = self._draco(primitive)
        if faces is None:
            self._stored = len(self._accessors.values(self._attributes["POSITION"], "POSITION", "VEC3"))
            faces = self._indexed(primitive, mode)
        if self._stored <= faces.size:
            return faces
        used = np.zeros(self._stored, bool)
        used[faces.reshape(-1)] = True
        self._used = np.flatnonzero(used)
        return (np.cumsum(used) - 1)[faces]

    def _indexed(self, primitive: Json, mode: int) -> AnyArray:
        """Return the triangles, lines or points of the indices, or of the vertices in their order without indices."""
        if "indices" in primitive:
            indices = self._accessors.values(primitive["indices"], "indices", "SCALAR")[:, 0]
            _check(indices, self._stored)
        else:
            indices = np.arange(self._stored, dtype=np.int32 if self._stored < 2**31 else np.int64)
        if mode == _STRIP:
            return strip(indices)
        if mode == _FAN:
            return fan(indices)
        if mode in (_LOOP, _LINE_STRIP):
            return indices[chain(len(indices), closed=mode == _LOOP)]
        if mode not in (_POINTS, _LINES, _TRIANGLES):
            damaged(f"mode: expected 0..6, got {mode}")
        width = _WIDTHS.get(mode, 3)
        if len(indices) % width:
            what = "line" if mode == _LINES else "triangle"
            self._accessors.document.note(f"corners left out, as they make no whole {what}: {len(indices) % width}")
        return indices[: len(indices) // width * width].reshape(-1, width)

    def _draco(self, primitive: Json) -> AnyArray | None:
        """Return the triangles that Draco has packed, and keep its attributes. Raises InputError.

        None if the primitive is not packed, or cannot be unpacked but is stored plainly, too.
        """
        packed = extension(primitive, DRACO)
        if packed is None:
            return None
        try:
            faces, attributes = compressed.draco(bytes(self._accessors.view(packed.get("bufferView"))))
            ids = fields(packed, "attributes")
            self._unpacked = {
                name: attributes[key] for name, key in ids.items() if isinstance(key, int) and key in attributes
            }
        except InputError:
            plain = [*self._attributes.values(), *([primitive["indices"]] if "indices" in primitive else [])]
            if all(self._accessors.has_data(index) for index in plain):
                return None
            raise
        if "POSITION" not in self._unpacked:
            damaged(f"{DRACO}: expected positions, got none")
        self._stored = len(self._unpacked["POSITION"])
        return faces


def _check(indices: AnyArray, count: int) -> None:
    """Raise InputError if an index is not one of so many vertices."""
    if indices.dtype.kind not in "iu":
        damaged("indices: expected integers, got floats")
    if not len(indices):
        return
    least, most = int(indices.min()), int(indices.max())
    if most >= count and most == np.iinfo(indices.dtype).max:
        damaged(f"indices: expected 0..{count - 1}, got {most}, with which strips would begin anew; glTF has none such")
    if least < 0 or most >= count:
        damaged(f"indices: expected 0..{count - 1}, got {least if least < 0 else most}")
