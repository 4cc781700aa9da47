"""Writes PLY files of any elements, as text or binary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

KINDS = ("ascii", "binary_little_endian", "binary_big_endian")
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
TYPES |= {"double": "f8", "uint8": "u1", "int32": "i4", "float32": "f4"}

XYZ = ("float x", "float y", "float z")
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
INDICES = "list uchar int vertex_indices"


def written(kind: str, *elements: tuple[str, Sequence[str], Sequence[Any]], comment: str = "by hand") -> bytes:
    """A PLY file. elements: a name, the properties as in the header, and rows of numbers and lists."""
    head = f"ply\nformat {kind} 1.0\ncomment {comment}\n"
    order, body = "<" if "little" in kind else ">", b""
    for name, properties, rows in elements:
        head += f"element {name} {len(rows)}\n" + "".join(f"property {each}\n" for each in properties)
        for row in rows:
            line, packed = list[str](), b""
            for each, value in zip(properties, row, strict=True):
                words = each.split()
                if words[0] == "list":
                    line += [str(len(value)), *map(str, value)]
                    packed += np.array(len(value), order + TYPES[words[1]]).tobytes()
                    packed += np.array(value, order + TYPES[words[2]]).tobytes()
                else:
                    line.append(str(value))
                    packed += np.array(value, order + TYPES[words[0]]).tobytes()
            body += (" ".join(line) + "\n").encode() if kind == "ascii" else packed
    return head.encode() + b"end_header\n" + body
