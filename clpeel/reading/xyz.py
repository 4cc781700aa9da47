"""XYZ: reads point clouds that are text, a point a line: x y z, and behind them colours and normals."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.lines import Lines, parsed
from clpeel.reading.marks import marks
from clpeel.scene.scene import Scene

XYZ = ("xyz", "xyzn", "xyzrgb", "pts", "asc", "txt")
"""The extensions of such files. They are read alike, but a fourth number of .pts is an intensity if colours follow."""

_COMMENT = re.compile(rb"^[ \t]*(?:#|//)[^\n]*", re.MULTILINE)
_NEAR_1 = 0.02
"""How far the lengths of unit normals may be off 1, as files have few decimals."""


def xyz(data: bytes, extension: str) -> Scene:
    """Return the scene of a text file of points.

    Each line has x, y and z, and in any order none, one or both of a colour (three numbers, 0..255 or 0..1) and a
    normal (three numbers, of length 1; in .xyzrgb files all are colours). Numbers are separated by spaces, commas or
    semicolons. What begins with # or // is a comment. A first line that begins with a word names the columns, and a
    first line of one number is how many points follow; neither is needed. All other numbers are arrays of the scene.

    Raises InputError if there are no points, or if the file is damaged.
    """
    table, names = _table(_COMMENT.sub(b"", data.removeprefix(b"\xef\xbb\xbf")).translate(_SPACES))
    fields, left = _fields(table[:, 3:], extension)
    if len(names) != table.shape[1]:
        names = [f"column {number}" for number in range(1, table.shape[1] + 1)]
        names[3:4] = ["intensity"] if extension == "pts" else names[3:4]
    arrays = {names[3 + column]: table[:, 3 + column] for column in left}
    scene = marks(table[:, :3], points=np.arange(len(table)), arrays=arrays, **fields)
    assert scene is not None
    return scene


_SPACES = bytes.maketrans(b",;", b"  ")


def _table(data: bytes) -> tuple[NDArray[np.float64], list[str]]:
    """Return the numbers of all points, [p, columns], and the names of the columns, if the file has some.

    Raises InputError if lines have different numbers of them.
    """
    lines, names = Lines(data), list[str]()
    rows = np.flatnonzero(lines.counts)
    if len(rows) and (lines.counts[rows[0]] == 1 or _begins_with_a_word(lines, int(rows[0]))):
        names = lines.text(rows[:1]).tobytes().decode("latin-1").split()
        rows = rows[1:]
    if not len(rows):
        raise InputError("expected points, got none; the file is empty")
    counts = lines.counts[rows]
    if counts.min() < 3 or counts.min() != counts.max():
        odd = int(rows[np.argmax(counts != counts[0])]) if counts[0] >= 3 else int(rows[0])
        first = max(int(counts[0]), 3)
        raise InputError(
            f"not a readable cloud: expected {first} numbers in each line, got {lines.counts[odd]} in line {odd + 1}"
        )
    return lines.numbers(rows).reshape(len(rows), -1), names


def _begins_with_a_word(lines: Lines, line: int) -> bool:
    """Return whether a line begins with anything but a number."""
    try:
        parsed(lines.text(np.array([line])).tobytes().split()[0])
    except InputError:
        return True
    return False


def _fields(extra: NDArray[np.float64], extension: str) -> tuple[dict[str, Any], list[int]]:
    """Return colours and normals as Scene.from_arrays has them, and which columns are neither.

    extra: the columns behind x, y and z.
    """
    first = 1 if extension == "pts" and extra.shape[1] in (4, 7) else 0  # behind an intensity
    fields: dict[str, Any] = {}
    left = list(range(extra.shape[1]))
    for at in range(first, extra.shape[1] - 2, 3):
        three = extra[:, at : at + 3]
        if "vertex_normals" not in fields and extension != "xyzrgb" and _are_normals(three):
            fields["vertex_normals"] = three
        elif "vertex_colors" not in fields and (colors := _colors(three)) is not None:
            fields["vertex_colors"] = colors
        else:
            continue
        del left[left.index(at) : left.index(at) + 3]
    return fields, left


def _are_normals(three: NDArray[np.float64]) -> bool:
    """Return whether most of the vectors [p, 3] have length 1. Others, such as zeros, stand for unknown ones."""
    lengths = np.sqrt((three * three).sum(axis=1))
    return bool(np.mean(np.abs(lengths - 1) < _NEAR_1) > 0.5)


def _whole(values: NDArray[np.float64]) -> bool:
    return bool((values == np.rint(values)).all())


def _colors(three: NDArray[np.float64]) -> NDArray[Any] | None:
    """Return colours [p, 3], uint8 or floats 0..1, or None if the numbers are no colours."""
    values = np.nan_to_num(three)
    low, high = values.min(), values.max()
    if low < 0 or high > 255:
        return None
    if _whole(values) and high > 1:
        return values.astype(np.uint8)
    return (values if high <= 1 else values / 255).astype(np.float32)
