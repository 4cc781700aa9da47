"""Compressed meshes: decodes what glTF packs by Draco and meshopt, where their libraries are installed."""

from __future__ import annotations

import numpy as np

from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray

_STORED = "bool int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64 bool".split()
"""NumPy's names of Draco's data types, by number. 0 is none."""

_MOST_PACKED = 1024
"""The most bytes that meshopt packs into one: four zeros in each of 256 rows."""


def draco(data: bytes) -> tuple[AnyArray, dict[int, AnyArray]]:
    """Return the triangles uint32 [m, 3] of a Draco mesh, and its attributes [n, width] by their unique ids.

    Attributes have the types that they are stored in. Integers that stand for fractions are integers here, too.
    Raises InputError if DracoPy is not installed, or if the data is damaged.
    """
    try:
        import DracoPy
    except ImportError:
        raise InputError(_missing("KHR_draco_mesh_compression", "DracoPy")) from None
    try:
        mesh = DracoPy.decode(bytes(data))
        found = {each["unique_id"]: _as_stored(each["data"], _STORED[each["data_type"]]) for each in mesh.attributes}
        faces = getattr(mesh, "faces", np.zeros((0, 3), np.uint32))
    except Exception:  # it has errors of its own for a damaged file
        raise InputError("the file is damaged: its Draco data cannot be decoded") from None
    count = min(map(len, found.values()), default=0)
    if faces.size and faces.max() >= count:
        raise InputError(f"the file is damaged: its Draco data has vertex {faces.max():,} of {count:,}")
    return faces, found


def _as_stored(values: AnyArray, stored: str) -> AnyArray:
    """Return an attribute in its stored type. DracoPy widens uint16, and makes floats of signed integers.

    It divides those that stand for fractions by the greatest of their type.
    """
    kind = np.dtype(stored)
    if kind.kind == "i" and values.dtype.kind == "f" and (values != np.rint(values)).any():
        values = np.rint(values * np.float64(np.iinfo(kind).max))
    return values.astype(kind, copy=False)


def meshopt(data: bytes, count: int, stride: int, mode: str, filter: str) -> bytes:
    """Return count * stride bytes that meshopt has packed: mode and filter as in EXT_meshopt_compression.

    The filter COLOR of KHR_meshopt_compression is undone, too. Raises InputError if the package meshopt is not
    installed, or if the data is damaged.
    """
    try:
        import meshopt as library
    except ImportError:
        raise InputError(_missing("EXT_meshopt_compression", "meshopt")) from None
    if count * stride > _MOST_PACKED * len(data):
        raise InputError(f"the file is damaged: {len(data):,} bytes of meshopt data promise {count:,} rows of {stride}")
    try:
        return bytes(library.decode_gltf_buffer(data, count, stride, mode, filter).tobytes())
    except (TypeError, ValueError, MemoryError) as error:
        raise InputError(f"the file is damaged: its meshopt data cannot be decoded ({error})") from None


def _missing(extension: str, package: str) -> str:
    """Return the error of a file that needs a package which is not installed."""
    return f"{extension}: expected the package {package} to decode it; run: pip install 'clpeel[formats]'"
