"""Reads common PLY and STL files without trimesh: vertices and triangles only. Any other file is left to trimesh.

This reads text about ten times as fast as trimesh does. Importing trimesh alone can take most of a command's time.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.signatures import foreign, looks_like
from clpeel.reading.uneven import COUNT_OF, INDICES, Element, ply_colors, ply_columns, uneven_ply
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene

_PLY_TYPES = dict(
    word.split(":")
    for word in "char:i1 uchar:u1 short:i2 ushort:u2 int:i4 uint:u4 float:f4 double:f8 "
    "int8:i1 uint8:u1 int16:i2 uint16:u2 int32:i4 uint32:u4 float32:f4 float64:f8".split()
)


def _plain_ply(data: bytes) -> Scene | None:
    """Return the scene of a PLY file of vertices and faces, or None if the file needs trimesh.

    Raises InputError if the file is cut.
    """
    if b"end_header" not in data:
        raise InputError("the file is cut: expected a header that ends with 'end_header', got none")
    try:
        header = _ply_header(data)
    except (ValueError, KeyError, IndexError):
        return None
    try:
        scene = _even_ply(data, *header)
    except (ValueError, KeyError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        scene = None
    return scene or uneven_ply(data, *header)


def _even_ply(data: bytes, kind: str, elements: list[Element], body: int) -> Scene | None:
    """Return the scene of a PLY file of vertices and triangles alone.

    Returns None, or raises ValueError, KeyError or IndexError, if there is anything else in it.
    """
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
    vertices, normals = ply_columns(points, "x y z"), ply_columns(points, "nx ny nz")
    face_colors, vertex_colors = ply_colors(faces), ply_colors(points)
    (index,) = [name for name in face_type.names or () if face_type[name].shape]
    if index not in INDICES or (faces[COUNT_OF + index] != 3).any():
        return None
    if vertices is None or (face_colors is not None and vertex_colors is not None):
        return None
    return Scene.from_arrays(vertices, faces[index], face_colors, vertex_colors, vertex_normals=normals)


def _ply_header(data: bytes) -> tuple[str, list[Element], int]:
    """Return the format, the elements and the offset of the first row.

    An element is its name, its count and the type of a row. At this point every list is assumed to have three items.
    Raises ValueError, KeyError or IndexError if the header is not a plain one.
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
                elements[-1][2].extend([(COUNT_OF + name, _PLY_TYPES[counter]), (name, _PLY_TYPES[item], (3,))])
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


def _ply_table(text: bytes, row: np.dtype, count: int) -> AnyArray:
    """Return `count` rows of numbers in text as a structured array. Raises ValueError if they do not fit."""
    widths = {name: math.prod(row[name].shape) for name in row.names or ()}
    columns, whole = sum(widths.values()), all(row[name].base.kind in "iu" for name in widths)
    numbers = np.fromstring(text, dtype=np.int64 if whole else np.float64, sep=" ")
    numbers = numbers.reshape(count, columns)
    table, column = np.empty(count, row), 0
    for name, width in widths.items():
        table[name] = numbers[:, column] if not row[name].shape else numbers[:, column : column + width]
        column += width
    return table


_STL_ROW = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_HEAD = 84  # bytes before the first triangle; the last four of them hold the number of triangles


def _plain_stl(data: bytes) -> Scene | None:
    """Return the scene of a binary STL file, even if its count is wrong. None if it is text, which trimesh reads.

    Raises InputError if the file is cut, empty or of another type.
    """
    promised, held = int.from_bytes(data[80:_STL_HEAD], "little"), (len(data) - _STL_HEAD) // _STL_ROW.itemsize
    if len(data) < _STL_HEAD or len(data) != _STL_HEAD + promised * _STL_ROW.itemsize:
        text = re.match(rb"\s*solid", data, re.IGNORECASE) and b"\0" not in data[:512]
        if text and (len(data) < _STL_HEAD or b"facet" in data.lower()):
            return None
        if len(data) < _STL_HEAD or foreign(data):
            raise InputError(f"not a readable mesh: expected a .stl file, got {looks_like(data)}")
    rows = np.frombuffer(data, _STL_ROW, held, _STL_HEAD)
    rest, notes = (len(data) - _STL_HEAD) % _STL_ROW.itemsize, list[str]()
    if promised > held and rest:
        raise InputError(f"the file is cut: its header promises {promised:,} triangles, it holds {held:,}")
    if promised > held or (promised < held and _like_triangles(rows[promised:])):
        notes.append(f"the header promises {promised:,} triangle(s), the file holds {held:,}: all of them are read")
    else:
        rows = rows[:promised]
    left = len(data) - _STL_HEAD - rows.nbytes
    if left:
        notes.append(f"{left:,} byte(s) after the {len(rows):,} triangle(s) left out")
    if not len(rows):
        raise InputError("expected triangles, got none; the mesh is empty")
    # The program Magics sets bit 15 of a face without a colour of its own. Other programs set it on a face with one.
    magics = b"COLOR=" in data[:80]
    colored = np.count_nonzero((rows["attribute"] >> 15 == 0) if magics else (rows["attribute"] >> 15 == 1))
    if colored:
        notes.append(f"colours of {colored:,} face(s) left out: they are in the attribute bytes of the STL file")
    scene = Scene.from_arrays(rows["corners"].reshape(-1, 3), np.arange(3 * len(rows)).reshape(-1, 3))
    return replace(scene, notes=tuple(notes))


def _like_triangles(rows: AnyArray) -> bool:
    """Return whether the rows beyond an STL file's count look like triangles: usual sizes, and none all zero."""
    corners = rows["corners"].reshape(-1, 9)
    sizes = np.abs(corners)
    # Text, or anything else, would give numbers outside these sizes.
    usual = (corners == 0) | ((sizes > 1e-20) & (sizes < 1e20))
    return bool(usual.all() and corners.any(axis=1).all())


READERS: dict[str, Callable[[bytes], Scene | None]] = {"ply": _plain_ply, "stl": _plain_stl}
