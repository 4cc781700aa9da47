"""The numbers of a glTF file: buffers, the parts of them that bufferViews name, and accessors, sparse and packed."""

from __future__ import annotations

from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading import compressed
from clpeel.reading.companions import named
from clpeel.reading.gltf_document import MESHOPT, Document, Json, damaged, extension, fields, whole
from clpeel.scene.arrays import AnyArray

_MOST_ZEROS = 2**26
"""The most numbers that accessors without data may have, all together. Otherwise a small file could ask for all the
memory there is."""

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Accessors:
    """The numbers of a document, read when they are asked for. They stay where they lie, where that is possible."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self._buffers: dict[int, bytes] = {}
        self._unpacked: dict[int, memoryview] = {}
        self._made: dict[int, AnyArray] = {}
        self._zeros = 0

    @property
    def size(self) -> int:
        """How many bytes of buffers have been read or unpacked so far."""
        return sum(map(len, (*self._buffers.values(), *self._unpacked.values())))

    # --- bytes --------------------------------------------------------------------------------------------------------

    def view(self, index: Any) -> memoryview:
        """Return the bytes of a bufferView, unpacked. Raises InputError."""
        view = self.document.entry("bufferViews", index)
        packed = _packed(view)
        if packed is None:
            return self._part(f"part {index}", view)
        if index not in self._unpacked:
            self._unpacked[index] = self._meshopt(index, view, packed)
        return self._unpacked[index]

    def _part(self, name: str, view: Json) -> memoryview:
        """Return the bytes that a bufferView, or its packed form, names."""
        start, size = whole(f"{name} byteOffset", view.get("byteOffset", 0)), whole(name, view.get("byteLength"))
        data = self._buffer(view.get("buffer"))
        if start + size > len(data):
            raise InputError(f"the file is cut: {name} ends at byte {start + size:,} of a buffer of {len(data):,}")
        return memoryview(data)[start : start + size]

    def _buffer(self, index: Any) -> bytes:
        """Return the bytes of a buffer, or raise InputError."""
        buffer = self.document.entry("buffers", index)
        if index not in self._buffers:
            if "uri" in buffer:
                try:
                    self._buffers[index] = self.document.companions.get(str(buffer["uri"]))
                except FileNotFoundError as error:
                    raise InputError(f"not a readable mesh: the buffer {error}") from None
            elif index == 0 and self.document.binary is not None:
                self._buffers[index] = self.document.binary
            else:
                damaged(f"buffer {index} has no data")
        return self._buffers[index]

    def _meshopt(self, index: int, view: Json, packed: Json) -> memoryview:
        """Return the bytes that meshopt has packed, or the plain ones if they cannot be unpacked and the file has them.

        Raises InputError.
        """
        name = f"packed part {index}"
        count = whole(f"{name} count", packed.get("count"))
        stride = whole(f"{name} byteStride", packed.get("byteStride"), 1)
        try:
            data = self._part(name, packed)
            return memoryview(
                compressed.meshopt(
                    bytes(data), count, stride, str(packed.get("mode")), str(packed.get("filter", "NONE"))
                )
            )
        except InputError:
            held = self.document.entry("buffers", view.get("buffer"))
            if "uri" in held or (view["buffer"] == 0 and self.document.binary is not None):
                return self._part(f"part {index}", view)
            raise

    # --- numbers ------------------------------------------------------------------------------------------------------

    def values(self, index: Any, what: str, *types: str) -> AnyArray:
        """Return an accessor's numbers, [count, width], in the type they are stored in.

        what: what they are, for an error. types: those that the accessor may have. Raises InputError.
        """
        accessor = self.document.entry("accessors", index)
        if accessor.get("type") not in types:
            damaged(f"{what}: expected an accessor of {' or '.join(types)}, got {named(str(accessor.get('type')))}")
        count, width, kind = self.count(index), _WIDTHS[accessor["type"]], _kind(what, accessor)
        if "sparse" not in accessor and "bufferView" in accessor:
            return self._stored(what, accessor, kind, count, width)
        if index not in self._made:
            self._made[index] = self._sparse(what, accessor, kind, count, width)
        return self._made[index]

    def floats(self, index: Any, what: str, *types: str) -> AnyArray:
        """Return an accessor's numbers as floats, [count, width]: float32 as stored, or float64 if they were integers.

        Normalized integers become 0..1 or -1..1. what, types: as in values. Raises InputError.
        """
        return unit(self.values(index, what, *types), self.normalized(index))

    def normalized(self, index: Any) -> bool:
        """Return whether an accessor's integers stand for 0..1 or -1..1."""
        return self.document.entry("accessors", index).get("normalized") is True

    def count(self, index: Any) -> int:
        """Return how many numbers, or vectors, an accessor has. Raises InputError."""
        return whole("accessor's count", self.document.entry("accessors", index).get("count"), 1)

    def has_data(self, index: Any) -> bool:
        """Return whether an accessor has data of its own."""
        accessor = self.document.entry("accessors", index)
        return "bufferView" in accessor or "sparse" in accessor

    def _stored(self, what: str, holder: Json, kind: np.dtype, count: int, width: int) -> AnyArray:
        """Return the numbers [count, width] at a byteOffset of a bufferView, which holder names, without a copy."""
        data = self.view(holder.get("bufferView"))
        view = self.document.entry("bufferViews", holder["bufferView"])
        row, offset = kind.itemsize * width, whole(f"{what} byteOffset", holder.get("byteOffset", 0))
        stride = (
            whole(f"{what} byteStride", view.get("byteStride") or (_packed(view) or {}).get("byteStride", 0)) or row
        )
        if stride < row:
            damaged(f"{what}: expected a byteStride of {row} or more, got {stride}")
        end = offset + (count - 1) * stride + row if count else 0
        if end > len(data):
            raise InputError(f"the file is cut: {what} ends at byte {end:,} of a part of {len(data):,}")
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))

    def _sparse(self, what: str, accessor: Json, kind: np.dtype, count: int, width: int) -> AnyArray:
        """Return zeros or stored numbers, [count, width], with the accessor's sparse numbers in their places."""
        if "bufferView" in accessor:
            values = self._stored(what, accessor, kind, count, width).copy()
        else:
            self._zeros += count * width
            if self._zeros > _MOST_ZEROS:
                damaged(f"it promises more than {_MOST_ZEROS:,} numbers that it does not hold")
            values = np.zeros((count, width), kind)
        if "sparse" in accessor:
            sparse = fields(accessor, "sparse")
            some, indices = whole(f"{what} sparse count", sparse.get("count")), fields(sparse, "indices")
            places = self._stored(what, indices, _kind(what, indices), some, 1)[:, 0]
            if places.dtype.kind != "u" or (some and int(places.max()) >= count):
                damaged(f"{what}: expected sparse numbers in places 0..{count - 1}, got others")
            values[places] = self._stored(what, fields(sparse, "values"), kind, some, width)
        return values


def _packed(view: Json) -> Json | None:
    """Return how meshopt has packed a bufferView, or None if it has not."""
    return next((each for name in MESHOPT if (each := extension(view, name)) is not None), None)


def _kind(what: str, holder: Json) -> np.dtype:
    """Return the type of an accessor's numbers, or raise InputError."""
    name = holder.get("componentType")
    if not isinstance(name, int) or name not in _TYPES:
        damaged(f"{what} componentType: expected one of {', '.join(map(str, _TYPES))}, got {named(str(name))}")
    return np.dtype(_TYPES[name])


def unit(values: AnyArray, normalized: bool) -> AnyArray:
    """Return numbers as floats. Normalized integers become 0..1, or -1..1 (glTF 2.0, section 3.6.2.2)."""
    if values.dtype.kind == "f":
        return values
    if not normalized:
        return values.astype(np.float64)
    reals = values / float(np.iinfo(values.dtype).max)
    return np.maximum(reals, -1.0) if values.dtype.kind == "i" else reals
