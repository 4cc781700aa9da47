"""OFF: reads text files of Geomview's format into Scenes, with their colours and normals."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.corners import Places, fans
from clpeel.reading.lines import Lines
from clpeel.scene.arrays import DEFAULT_COLOR, Colors
from clpeel.scene.scene import Scene

_HEAD = re.compile(rb"\s*(ST)?(C)?(N)?(4)?(n)?OFF(?:\s+BINARY\b)?")


def off(data: bytes, _: Companions) -> Scene:
    """Return the scene of an OFF file.

    A row of vertices is x y z, then a normal (NOFF), a colour of 3 or 4 numbers (COFF), and texture coordinates
    (STOFF), which no OFF file has an image for. A row of faces is the number of corners, the corners, and maybe a
    colour of 3 or 4 numbers. Colours are integers 0..255, or floats 0..1 if none in the file is above 1. Raises
    InputError if the file is binary, cut or damaged, or has other than three coordinates.
    """
    data = re.sub(rb"#[^\n\r]*", b"", data.removeprefix(b"\xef\xbb\xbf"))
    head = _HEAD.match(data)
    if head is None or head[4] or head[5]:
        shown = (data.split() or [b""])[0].decode("latin-1")
        raise InputError(f"expected an .off file of three coordinates, got {named(shown)}")
    if head[0].endswith(b"BINARY"):
        raise InputError("expected a text .off file, got a binary one; convert it to text or PLY")
    lines = Lines(data[head.end() :])
    rows = np.flatnonzero(lines.counts)
    sizes = lines.numbers(rows[:1])
    if len(sizes) < 2 or not (sizes[:2] >= 0).all() or (sizes[:2] % 1).any():
        raise InputError("not a readable mesh: expected the numbers of vertices and faces behind OFF, got neither")
    vertices, faces = (int(size) for size in sizes[:2])
    if len(rows) - 1 < vertices + faces:
        raise InputError(
            f"the file is cut: its header promises {vertices + faces:,} vertices and faces, it holds {len(rows) - 1:,}"
        )
    if not vertices or not faces:
        got = f"{vertices:,} point(s) alone" if vertices else "none"
        raise InputError(f"expected triangles, got {got}; the mesh is empty")
    notes = list[str]()
    points, fields = _points(lines, rows[1 : 1 + vertices], head, notes)
    triangles, polygons, colors = _faces(lines, rows[1 + vertices : 1 + vertices + faces], notes)
    if colors is not None and "vertex_colors" in fields:
        notes.append("face colours left out: the vertices have their own")
    elif colors is not None:
        fields["face_colors"] = colors
    return replace(Scene.from_arrays(points, triangles, polygons=polygons, **fields), notes=tuple(notes))


def _points(
    lines: Lines, rows: Places, head: re.Match[bytes], notes: list[str]
) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Return the vertices [n, 3], and their normals and colours for Scene.from_arrays."""
    width = int(lines.counts[rows[0]])
    colors = 3 + 3 * bool(head[3])
    own = width - colors - 2 * bool(head[1])
    if (lines.counts[rows] != width).any() or width < colors or (head[2] and own not in (3, 4)):
        raise InputError(
            "not a readable mesh: expected rows of vertices with x y z"
            f"{', a normal' if head[3] else ''}{', a colour of 3 or 4 numbers' if head[2] else ''}, got {width} numbers"
        )
    table = lines.numbers(rows).reshape(len(rows), width)
    fields: dict[str, Any] = {}
    if head[3]:
        fields["vertex_normals"] = table[:, 3:6]
    if head[2]:
        fields["vertex_colors"] = _as_colors(table[:, colors : colors + own])
    elif own > 0:
        notes.append(f"{own} number(s) of each vertex left out: the header is not that of a file with colours")
    return table[:, :3], fields


def _faces(lines: Lines, rows: Places, notes: list[str]) -> tuple[Places, Places, Colors | None]:
    """Return the triangles [m, 3], the faces that they are of [m], and their colours [m, 4], if the file has any."""
    values, widths = lines.numbers(rows), lines.counts[rows]
    begin = np.cumsum(widths) - widths
    corners = values[begin].astype(np.int64)
    wrong = (corners < 0) | (corners + 1 > widths)
    if wrong.any():
        at = int(np.argmax(wrong))
        raise InputError(
            f"the file is damaged: face {at} promises {corners[at]:,} corner(s), its row holds {widths[at] - 1:,}"
        )
    short = np.count_nonzero(corners < 3)
    if short:
        notes.append(f"{short:,} face(s) of fewer than 3 corners left out")
    place, of_face = fans(corners)
    if not len(place):
        raise InputError("expected triangles, got none; the mesh is empty")
    skipped = np.repeat(begin + 1 - (np.cumsum(corners) - corners), corners)
    triangles = values[place + skipped[place]].astype(np.int64)
    extra = widths - 1 - corners
    indexed = np.count_nonzero((extra == 1) | (extra == 2))
    if indexed:
        notes.append(f"colours of {indexed:,} face(s) left out: they are numbers of a table that the file lacks")
    colored = extra >= 3
    if not colored.any():
        return triangles, of_face, None
    colors = np.full((len(rows), 4), np.nan)
    for column in range(4):
        has = colored & (extra > column)
        colors[has, column] = values[(begin + 1 + corners)[has] + column]
    return triangles, of_face, _as_colors(colors)[of_face]


def _as_colors(values: NDArray[np.float64]) -> Colors:
    """Return colours as in Scene, [rows, 4], from integers 0..255 or floats 0..1. A row of NaN has DEFAULT_COLOR."""
    rgba = np.full((len(values), 4), np.nan)
    rgba[:, : values.shape[1]] = values
    top = 255.0 if np.nanmax(rgba) > 1 else 1.0
    none = np.isnan(rgba[:, :3]).any(axis=1)
    rgba[np.isnan(rgba[:, 3]), 3] = top
    rgba[none] = np.array(DEFAULT_COLOR) * (top / 255)
    rgba = np.clip(rgba, 0, top)
    return np.rint(rgba).astype(np.uint8) if top == 255 else rgba.astype(np.float32)
