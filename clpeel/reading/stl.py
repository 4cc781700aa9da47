"""STL: reads binary and text files into Scenes, with the colours that some programs put into the spare bytes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import Companions
from clpeel.reading.lines import Lines
from clpeel.reading.signatures import foreign, looks_like
from clpeel.scene.arrays import DEFAULT_COLOR, AnyArray, Colors
from clpeel.scene.scene import Scene

_ROW = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEAD = 84  # bytes before the first triangle; the last four of them hold the number of triangles


def stl(data: bytes, _: Companions) -> Scene:
    """Return the scene of an STL file, even if its count is wrong.

    Raises InputError if the file is cut, empty or of another type.
    """
    promised, held = int.from_bytes(data[80:_HEAD], "little"), (len(data) - _HEAD) // _ROW.itemsize
    if len(data) < _HEAD or len(data) != _HEAD + promised * _ROW.itemsize:
        text = re.match(rb"\s*solid", data, re.IGNORECASE) and b"\0" not in data[:512]
        if text and (len(data) < _HEAD or b"facet" in data.lower()):
            return _text(data)
        if len(data) < _HEAD or foreign(data):
            raise InputError(f"not a readable mesh: expected a .stl file, got {looks_like(data)}")
    rows = np.frombuffer(data, _ROW, held, _HEAD)
    rest, notes = (len(data) - _HEAD) % _ROW.itemsize, list[str]()
    if promised > held and rest:
        raise InputError(f"the file is cut: its header promises {promised:,} triangles, it holds {held:,}")
    if promised > held or (promised < held and _like_triangles(rows[promised:])):
        notes.append(f"the header promises {promised:,} triangle(s), the file holds {held:,}: all of them are read")
    else:
        rows = rows[:promised]
    left = len(data) - _HEAD - rows.nbytes
    if left:
        notes.append(f"{left:,} byte(s) after the {len(rows):,} triangle(s) left out")
    if not len(rows):
        raise InputError("expected triangles, got none; the mesh is empty")
    faces = np.arange(3 * len(rows)).reshape(-1, 3)
    scene = Scene.from_arrays(rows["corners"].reshape(-1, 3), faces, _colors(data[:80], rows["attribute"]))
    return replace(scene, notes=tuple(notes))


def _like_triangles(rows: AnyArray) -> bool:
    """Return whether the rows beyond an STL file's count look like triangles: usual sizes, and none all zero."""
    corners = rows["corners"].reshape(-1, 9)
    sizes = np.abs(corners)
    # Text, or anything else, would give numbers outside these sizes.
    usual = (corners == 0) | ((sizes > 1e-20) & (sizes < 1e20))
    return bool(usual.all() and corners.any(axis=1).all())


def _colors(head: bytes, attributes: AnyArray) -> Colors | None:
    """Return the colours of faces, uint8 [m, 4], or None if the file has none.

    The 16 bits of an attribute are a flag and three times five bits. VisCAM and SolidView set the flag, bit 15, of a
    face with a colour, and the bits from 0 on are blue, green, red. Magics writes COLOR= and RGBA of the whole body
    into the header. It clears the flag of a face with a colour, whose bits from 0 on are red, green, blue, and sets
    the flag of a face with the body's colour. If no attribute says anything, all faces have the body's colour. A body
    that could not be seen at all, of alpha 0, is opaque.
    """
    flag = attributes >> 15 == 1
    five = np.stack([attributes & 31, attributes >> 5 & 31, attributes >> 10 & 31], axis=1)
    levels = np.rint(five * (255 / 31)).astype(np.uint8)
    at = head.find(b"COLOR=")
    magics = 0 <= at <= 70
    if not magics and not flag.any():
        return None
    body = np.frombuffer(head[at + 6 : at + 10], np.uint8) if magics else np.array(DEFAULT_COLOR, np.uint8)
    colors = np.empty((len(attributes), 4), np.uint8)
    colors[:] = body
    if magics:
        own = ~flag & attributes.any()
        colors[own, :3] = levels[own]
        colors[:, 3] = body[3] or 255
    else:
        colors[flag, :3] = levels[flag, ::-1]
    return colors


def _text(data: bytes) -> Scene:
    """Return the scene of a text STL file. Raises InputError if it is cut, empty or damaged."""
    lines = Lines(data.lower())
    where, ends = lines.beginning_with(b"vertex"), lines.beginning_with(b"endfacet")
    if not len(where):
        raise InputError("expected triangles, got none; the mesh is empty")
    if (lines.counts[where] != 4).any() or len(where) != 3 * len(ends):
        raise InputError(
            f"the file is damaged or cut: expected three corners of three numbers in each facet, got {len(where):,} "
            f"corners in {len(ends):,} whole facets"
        )
    points = lines.numbers(where, len(b"vertex")).reshape(-1, 3)
    return Scene.from_arrays(points, np.arange(len(points)).reshape(-1, 3))
