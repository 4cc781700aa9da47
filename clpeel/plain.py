"""Plain PLY and STL files read at once: vertices and triangles, as most are; any other is left to trimesh.

Text is read about ten times as fast as by trimesh, whose import alone can take most of a command.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.scene import Scene

_COUNT_OF = "count of "  # the name of a list's count: no PLY name holds a space
_PLY_TYPES = dict(
    word.split(":")
    for word in "char:i1 uchar:u1 short:i2 ushort:u2 int:i4 uint:u4 float:f4 double:f8 "
    "int8:i1 uint8:u1 int16:i2 uint16:u2 int32:i4 uint32:u4 float32:f4 float64:f8".split()
)


def _plain_ply(data: bytes) -> Scene | None:
    """The scene of a PLY file of vertices and triangles, as most are; None for any other, which is left to trimesh."""
    try:
        kind, elements, body = _ply_header(data)
        (vertex, vertex_count, vertex_type), (face, face_count, face_type) = elements
        if (vertex, face) != ("vertex", "face") or 0 in (vertex_count, face_count):
            return None
        if kind == "ascii":
            middle = body
            for _ in range(vertex_count):
                middle = data.index(b"\n", middle) + 1
            points = _ply_table(data[body:middle], vertex_type, vertex_count)
            faces = _ply_table(data[middle:], face_type, face_count)
        else:
            points = np.frombuffer(data, vertex_type, vertex_count, body)
            faces = np.frombuffer(data, face_type, face_count, body + points.nbytes)
        vertices, normals = _ply_columns(points, "x y z"), _ply_columns(points, "nx ny nz")
        face_colors, vertex_colors = _ply_colors(faces), _ply_colors(points)
        (index,) = [name for name in face_type.names or () if face_type[name].shape]
        if index not in ("vertex_indices", "vertex_index") or (faces[_COUNT_OF + index] != 3).any():
            return None
    except InputError:
        raise
    except (ValueError, KeyError, IndexError):
        return None
    if vertices is None or (face_colors is not None and vertex_colors is not None):
        return None
    return Scene.from_arrays(vertices, faces[index], face_colors, vertex_colors, vertex_normals=normals)


def _ply_header(data: bytes) -> tuple[str, list[tuple[str, int, np.dtype[Any]]], int]:
    """The format, the elements (name, count, type of a row, lists taken to be of three) and where the rows begin.

    Raises ValueError, KeyError or IndexError where the header is not a plain one.
    """
    end = data.index(b"end_header")
    body = data.index(b"\n", end) + 1
    kind, elements = "", list[tuple[str, int, list[Any]]]()
    for line in data[:body].decode("latin-1").splitlines():
        match line.split():
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as kind, "1.0"]:
                pass
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", counter, item, name]:
                elements[-1][2].extend([(_COUNT_OF + name, _PLY_TYPES[counter]), (name, _PLY_TYPES[item], (3,))])
            case ["property", scalar, name]:
                elements[-1][2].append((name, _PLY_TYPES[scalar]))
            case ["comment", *_] if "texturefile" in line.lower():
                raise ValueError(line)
            case [] | ["ply"] | ["end_header"] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise ValueError(line)
    rows = [(name, count, np.dtype(fields)) for name, count, fields in elements]
    file_order: Literal["<", ">"] = ">" if kind == "binary_big_endian" else "<"
    return kind, [(name, count, row.newbyteorder(file_order)) for name, count, row in rows], body


def _ply_table(text: bytes, row: np.dtype[Any], count: int) -> NDArray[Any]:
    """count rows of numbers in text as a structured array; InputError if too few, ValueError if they do not fit."""
    widths = {name: math.prod(row[name].shape) for name in row.names or ()}
    columns, whole = sum(widths.values()), all(row[name].base.kind in "iu" for name in widths)
    numbers = np.fromstring(text, dtype=np.int64 if whole else np.float64, sep=" ")
    if numbers.size < count * columns:
        raise InputError(f"expected {count} rows of {columns} numbers, got {numbers.size} in all; the file is cut")
    numbers = numbers.reshape(count, columns)
    table, column = np.empty(count, row), 0
    for name, width in widths.items():
        table[name] = numbers[:, column] if not row[name].shape else numbers[:, column : column + width]
        column += width
    return table


def _ply_columns(table: NDArray[Any], names: str) -> NDArray[Any] | None:
    """The named scalar columns side by side, [rows, columns]; None if one is missing."""
    if not set(names.split()) <= set(table.dtype.names or ()):
        return None
    return np.stack([table[name] for name in names.split()], axis=1)


def _ply_colors(table: NDArray[Any]) -> NDArray[Any] | None:
    """uint8 [rows, 3 or 4] if the table has colours; ValueError if they are no bytes, whose range would be a guess."""
    colors = _ply_columns(table, "red green blue alpha")
    if colors is None:
        colors = _ply_columns(table, "red green blue")
    if colors is not None and colors.dtype != np.uint8:
        raise ValueError(f"colours of {colors.dtype}")
    return colors


def _plain_stl(data: bytes) -> Scene | None:
    """The scene of a binary STL file; None for text, which is left to trimesh, as is a file of another length."""
    row = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    count = int.from_bytes(data[80:84], "little")
    if not count or len(data) != 84 + count * row.itemsize:
        return None
    corners = np.frombuffer(data, row, count, 84)["corners"]
    return Scene.from_arrays(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


READERS: dict[str, Callable[[bytes], Scene | None]] = {"ply": _plain_ply, "stl": _plain_stl}
