"""Files of FBX for tests: a tree of nodes, written as text or as bytes."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Value = int | float | str | bytes | np.ndarray

QUAD = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1]], np.float64)
"""The points of a mesh of two polygons: a quadrilateral in the plane of x and y, and a triangle on its lower edge."""


@dataclass
class Node:
    """A node: its values, then the nodes within."""

    name: str
    values: tuple[Value, ...] = ()
    within: list[Node] = field(default_factory=list)


def node(name: str, *values: Value, within: list[Node] | None = None) -> Node:
    return Node(name, values, within or [])


def properties(**named: tuple[str, tuple[Value, ...]]) -> Node:
    return node("Properties70", within=[node("P", name, kind, "", "A", *of) for name, (kind, of) in named.items()])


def color(*rgb: float) -> tuple[str, tuple[Value, ...]]:
    return "Color", rgb


def number(value: float) -> tuple[str, tuple[Value, ...]]:
    return "Number", (value,)


def vector(*xyz: float) -> tuple[str, tuple[Value, ...]]:
    return "Vector3D", xyz


def layer(kind: str, how: tuple[str, str], **arrays: np.ndarray) -> Node:
    held = [node("MappingInformationType", how[0]), node("ReferenceInformationType", how[1])]
    return node(kind, 0, within=[*held, *(node(name, array) for name, array in arrays.items())])


def scene(*objects: Node, links: list[tuple[Any, ...]], up: int = 1) -> list[Node]:
    """Return the nodes of a file. links: child, parent, and perhaps the property for it. up: 1 is Y, 2 is Z."""
    front, sign = (2, 1) if up == 1 else (1, -1)
    axes = {
        "UpAxis": up,
        "UpAxisSign": 1,
        "FrontAxis": front,
        "FrontAxisSign": sign,
        "CoordAxis": 0,
        "CoordAxisSign": 1,
    }
    settings = properties(**{name: ("int", (value,)) for name, value in axes.items()})
    connections = [node("C", "OP" if len(link) > 2 else "OO", *link) for link in links]
    return [
        node("FBXHeaderExtension", within=[node("FBXVersion", 7400)]),
        node("GlobalSettings", within=[settings]),
        node("Objects", within=list(objects)),
        node("Connections", within=connections),
    ]


def geometry(*layers: Node, number: int = 10, points: np.ndarray = QUAD) -> Node:
    """Return the mesh of QUAD. The last corner of each polygon is written as -1 - index."""
    corners = np.array([0, 1, 2, -4, 0, 1, -5], np.int32)
    held = [node("Vertices", points.reshape(-1)), node("PolygonVertexIndex", corners)]
    return node("Geometry", number, "Geometry::quad", "Mesh", within=[*held, *layers])


def model(number: int, name: str, **of: tuple[str, tuple[Value, ...]]) -> Node:
    return node("Model", number, f"Model::{name}", "Mesh", within=[node("Version", 232), properties(**of)])


def material(number: int, name: str, **of: tuple[str, tuple[Value, ...]]) -> Node:
    held = [node("ShadingModel", "phong"), properties(**of)]
    return node("Material", number, f"Material::{name}", "", within=held)


# --- text -------------------------------------------------------------------------------------------------------------


def text(nodes: list[Node]) -> bytes:
    return ("; FBX 7.4.0 project file\n" + "".join(_lines(each, "") for each in nodes)).encode()


def _lines(each: Node, indent: str) -> str:
    within = "".join(_lines(child, indent + "\t") for child in each.within)
    if each.values and isinstance(each.values[0], np.ndarray):
        numbers = ",".join(repr(value) for value in each.values[0].tolist())
        return f"{indent}{each.name}: *{each.values[0].size} {{\n{indent}\ta: {numbers}\n{indent}}}\n"
    values = ", ".join(f'"{value}"' if isinstance(value, str) else repr(value) for value in each.values)
    body = f" {{\n{within}{indent}}}" if within or not each.values else ""
    return f"{indent}{each.name}: {values}{body}\n"


# --- bytes ------------------------------------------------------------------------------------------------------------


def binary(nodes: list[Node]) -> bytes:
    data = bytearray(b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400))
    for each in nodes:
        _add(data, each)
    return bytes(data + bytes(13))


def _add(data: bytearray, each: Node) -> None:
    start, name = len(data), each.name.encode()
    values = b"".join(map(_value, each.values))
    data += struct.pack("<IIIB", 0, len(each.values), len(values), len(name)) + name + values
    for child in each.within:
        _add(data, child)
    data += bytes(13) if each.within else b""
    data[start : start + 4] = struct.pack("<I", len(data))


def _value(value: Value) -> bytes:
    if isinstance(value, np.ndarray):
        kind, raw = (b"d", value.astype("<f8")) if value.dtype.kind == "f" else (b"i", value.astype("<i4"))
        return kind + struct.pack("<III", value.size, 0, raw.nbytes) + raw.tobytes()
    if isinstance(value, int):
        return b"L" + struct.pack("<q", value)
    if isinstance(value, float):
        return b"D" + struct.pack("<d", value)
    if isinstance(value, bytes):
        return b"R" + struct.pack("<I", len(value)) + value
    kind, mark, name = value.partition("::")
    raw = f"{name}\0\1{kind}".encode() if mark else value.encode()
    return b"S" + struct.pack("<I", len(raw)) + raw
