"""Reads PLY files that trimesh misreads: lists in vertices, faces of one or two corners, triangle strips, cut files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.strips import strip
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene

COUNT_OF = "count of "
"""Prefix of the field name of a list's count in a row's type. It cannot clash, as no PLY name has a space."""

INDICES = ("vertex_indices", "vertex_index")
"""Names that files use for the list of a face's corners."""

Element = tuple[str, int, np.dtype]
"""An element's name, its number of rows, and the type of a row. In the type, a list is its count and three items."""

_Columns = dict[str, Any]
"""By name, an element's scalars as arrays, and its lists as lists of arrays."""


def uneven_ply(data: bytes, kind: str, elements: list[Element], body: int) -> Scene | None:
    """Return the scene of a PLY file whose rows differ in length, or None if trimesh reads the file correctly.

    Raises InputError if rows are missing, or are not numbers.
    """
    by_name = {name: (count, row) for name, count, row in elements}
    rows = _Text(data, body) if kind == "ascii" else _Binary(data, body)
    columns = {name: rows.element(name, count, row) for name, count, row in elements}
    if "vertex" not in by_name or not by_name["vertex"][0]:
        return None
    corners: Any = next((columns["face"][n] for n in INDICES if n in columns.get("face", {})), [])
    strips = [part for n in INDICES for part in columns.get("tristrips", {}).get(n, [])]
    short = sum(len(part) < 3 for part in corners)
    odd = any(name.startswith(COUNT_OF) for name in by_name["vertex"][1].names or ())
    mixed = kind != "ascii" and len(set(map(len, corners))) > 1
    if not (short or odd or strips or mixed) or not (len(corners) > short or strips):
        return None
    points = columns["vertex"]
    vertices = np.stack([points[name] for name in "xyz"], axis=1)
    notes = [f"{short} face(s) of fewer than 3 corners left out"] if short else []
    fans = [_fan(part) for part in corners if len(part) >= 3]
    parts = [np.concatenate(fans)] if fans else []
    for run in strips:
        run = run.astype(np.int64)
        parts += [strip(part[part >= 0]) for part in np.split(run, np.flatnonzero(run < 0))]
    colors = _colors(columns, corners, bool(strips), notes)
    normals = np.stack([points[n] for n in ("nx", "ny", "nz")], axis=1) if {"nx", "ny", "nz"} <= set(points) else None
    scene = Scene.from_arrays(vertices, np.concatenate(parts), vertex_normals=normals, **colors)
    return replace(scene, notes=tuple(notes))


def _fan(part: AnyArray) -> NDArray[np.int64]:
    """Return the triangles [n - 2, 3] of a polygon of n corners."""
    part = part.astype(np.int64)
    return np.stack([np.broadcast_to(part[:1], part[2:].shape), part[1:-1], part[2:]], axis=1)


def _colors(columns: dict[str, _Columns], corners: Any, strips: bool, notes: list[str]) -> dict[str, Any]:
    """Return the colour argument of Scene.from_arrays: the vertices' colours, else the faces', if they are bytes."""
    found: dict[str, Any] = {}
    for element, argument in (("vertex", "vertex_colors"), ("face", "face_colors")):
        table = columns.get(element, {})
        names = [name for name in ("red", "green", "blue", "alpha") if name in table]
        if len(names) < 3:
            continue
        values = np.stack([table[name] for name in names], axis=1)
        if values.dtype != np.uint8 or found or (strips and element == "face"):
            notes.append(f"colours of the {element} rows left out: only one kind, of bytes, is read here")
            continue
        sizes = [max(len(part) - 2, 0) for part in corners]
        found[argument] = values if element == "vertex" else np.repeat(values, sizes, axis=0)
    return found


def ply_columns(table: AnyArray, names: str) -> AnyArray | None:
    """Return the named scalar columns side by side, [rows, columns], or None if any is missing."""
    if not set(names.split()) <= set(table.dtype.names or ()):
        return None
    return np.stack([table[name] for name in names.split()], axis=1)


def ply_colors(table: AnyArray) -> AnyArray | None:
    """Return the table's colours as uint8 [rows, 3 or 4], or None if it has none.

    Raises ValueError if they are not bytes, because their range would be a guess.
    """
    colors = ply_columns(table, "red green blue alpha")
    if colors is None:
        colors = ply_columns(table, "red green blue")
    if colors is not None and colors.dtype != np.uint8:
        raise ValueError(f"colours of {colors.dtype}")
    return colors


# --- rows -----------------------------------------------------------------------------------------------------------


def _cut(name: str, promised: int, held: int) -> InputError:
    """Return the error of a file that ends too early."""
    return InputError(f"the file is cut: its header promises {promised:,} rows of {name!r}, it holds {held:,}")


def _is_number(word: bytes) -> bool:
    """Return whether a word of a text file is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


class _Text:
    """The rows of a text PLY file, read in order."""

    def __init__(self, data: bytes, body: int) -> None:
        text = data[body:]
        self.at = 0
        try:
            self.numbers = np.fromstring(text, dtype=np.float64, sep=" ")
            whole = len(text.split(maxsplit=self.numbers.size)) == self.numbers.size  # older NumPy gives no error
        except ValueError:
            whole = False
        if not whole:
            wrong = next((word for word in text.split() if not _is_number(word)), b"")[:20].decode("latin-1")
            raise InputError(f"not a readable mesh: expected numbers after the header, got {wrong!r}")

    def element(self, name: str, count: int, row: np.dtype) -> _Columns:
        """Return the next `count` rows by column. Raises InputError if there are fewer."""
        fields = [field for field in row.names or () if not row[field].shape]
        lists = [field.startswith(COUNT_OF) for field in fields]
        if not any(lists):
            width = len(fields)
            held = (self.numbers.size - self.at) // width if width else count
            if held < count:
                raise _cut(name, count, held)
            table = self.numbers[self.at : self.at + count * width].reshape(count, width)
            self.at += count * width
            with np.errstate(all="ignore"):
                return {field: table[:, i].astype(row[field]) for i, field in enumerate(fields)}
        # Maybe all lists are equally long.
        if lists.count(True) == 1 and count and self.at + len(fields) <= self.numbers.size:
            column = lists.index(True)
            width = len(fields) + max(int(self.numbers[self.at + column]), 0)
            table = self.numbers[self.at : self.at + count * width]
            if table.size == count * width and (table[column::width] == table[column]).all():
                self.at += table.size
                table, length = table.reshape(count, width), width - len(fields)
                after = [i if i <= column else i + length for i in range(len(fields))]
                even: _Columns = {f: table[:, i].astype(row[f]) for f, i in zip(fields, after, strict=True)}
                even[fields[column].removeprefix(COUNT_OF)] = table[:, column + 1 : column + 1 + length]
                return even
        places: list[list[int]] = [[] for _ in fields]
        sizes: list[list[int]] = [[] for _ in fields]
        values, at = self.numbers, self.at
        for done in range(count):
            for place, size, is_list in zip(places, sizes, lists, strict=True):
                place.append(at)
                if is_list and at < values.size:
                    size.append(max(int(values[at]), 0))
                    at += size[-1]
                at += 1
            if at > values.size:
                raise _cut(name, count, done)
        self.at = at
        columns: _Columns = {}
        for field, place, size, is_list in zip(fields, places, sizes, lists, strict=True):
            if is_list:
                parts = zip(place, size, strict=True)
                columns[field.removeprefix(COUNT_OF)] = [values[p + 1 : p + 1 + n] for p, n in parts]
            else:
                columns[field] = values[place].astype(row[field])
        return columns


class _Binary:
    """The rows of a binary PLY file, read in order."""

    def __init__(self, data: bytes, body: int) -> None:
        self.data, self.at = data, body

    def element(self, name: str, count: int, row: np.dtype) -> _Columns:
        """Return the next `count` rows by column. Raises InputError if there are fewer."""
        fields = [field for field in row.names or () if not row[field].shape]
        if not any(field.startswith(COUNT_OF) for field in fields):
            held = (len(self.data) - self.at) // row.itemsize if row.itemsize else count
            if held < count:
                raise _cut(name, count, held)
            table = np.frombuffer(self.data, row, count, self.at)
            self.at += table.nbytes
            return {field: table[field] for field in fields}
        even = self._even(fields, count, row)
        if even is not None:
            return even
        found: _Columns = {field.removeprefix(COUNT_OF): [] for field in fields}
        for done in range(count):
            for field in fields:
                kind = row[field]
                number = np.frombuffer(self._take(kind.itemsize, name, count, done), kind)
                if field.startswith(COUNT_OF):
                    field = field.removeprefix(COUNT_OF)
                    item = row[field].base
                    size = max(int(number[0]), 0)
                    number = np.frombuffer(self._take(size * item.itemsize, name, count, done), item)
                found[field].append(number)
        for field in fields:
            if not field.startswith(COUNT_OF):
                found[field] = np.concatenate(found[field]) if found[field] else np.zeros(0, row[field])
        return found

    def _even(self, fields: list[str], count: int, row: np.dtype) -> _Columns | None:
        """Return the next `count` rows if their lists are all as long as the first row's.

        Otherwise return None, and leave the position unchanged.
        """
        types: list[Any] = []
        for field in fields:
            types.append((field, row[field]))
            if field.startswith(COUNT_OF):
                end = self.at + np.dtype(types).itemsize
                if end > len(self.data):
                    return None
                size = np.frombuffer(self.data, row[field], 1, end - row[field].itemsize)[0]
                if not 0 <= size <= len(self.data):
                    return None
                types.append((field.removeprefix(COUNT_OF), row[field.removeprefix(COUNT_OF)].base, (int(size),)))
        kind = np.dtype(types)
        if self.at + count * kind.itemsize > len(self.data) or not count:
            return None
        table = np.frombuffer(self.data, kind, count, self.at)
        counts = [field for field in fields if field.startswith(COUNT_OF)]
        if not all((table[field] == table[field][0]).all() for field in counts):
            return None
        self.at += table.nbytes
        return {name: table[name] for name in kind.names or ()}

    def _take(self, size: int, name: str, count: int, done: int) -> bytes:
        """Return the next `size` bytes. Raises InputError if there are fewer."""
        if self.at + size > len(self.data):
            raise _cut(name, count, done)
        self.at += size
        return self.data[self.at - size : self.at]
