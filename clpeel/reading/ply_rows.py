"""PLY rows: reads the header and the rows of PLY files, text and binary, whatever their properties are."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.lines import parsed
from clpeel.scene.arrays import AnyArray

_TYPES = dict(
    word.split(":")
    for word in "char:i1 uchar:u1 short:i2 ushort:u2 int:i4 uint:u4 float:f4 double:f8 "
    "int8:i1 uint8:u1 int16:i2 uint16:u2 int32:i4 uint32:u4 float32:f4 float64:f8".split()
)
_FORMATS: dict[str, Literal["=", "<", ">"]] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_TEXTURE = re.compile(r"^\s*(?:comment|obj_info)\s+texturefile\s+(.*?)\s*$", re.IGNORECASE)


@dataclass(frozen=True)
class Lists:
    """Lists of several lengths, one after another. values: of all of them. counts: the length of each, int64 [rows]."""

    values: AnyArray
    counts: NDArray[np.int64]


@dataclass(frozen=True)
class Rows:
    """The rows of an element by the names of its properties. Numbers are in this machine's byte order."""

    count: int
    scalars: dict[str, AnyArray]
    lists: dict[str, Lists]


NO_ROWS = Rows(0, {}, {})


@dataclass(frozen=True)
class _Property:
    """What a row holds under a name: a number, or a list of such with its length before it."""

    name: str
    kind: np.dtype
    counter: np.dtype | None = None


@dataclass
class _Element:
    """A name, the number of rows that the header promises, and what each holds, in order."""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read(data: bytes) -> tuple[dict[str, Rows], list[str]]:
    """Return the elements of a PLY file by name, and the names of its textures in order.

    Raises InputError if the header is not one of a PLY file, if rows are missing, or if a word is no number.
    """
    kind, elements, textures, body = _header(data)
    source = _Text(data[body:]) if kind == "ascii" else _Binary(data[body:])
    return {element.name: _rows(source, element) for element in elements}, textures


def _header(data: bytes) -> tuple[str, list[_Element], list[str], int]:
    """Return the format, the elements, the names of textures, and where the rows begin."""
    end = data.find(b"end_header")
    if end < 0:
        raise InputError("the file is cut: expected a header that ends with 'end_header', got none")
    newline = re.compile(rb"[^\n]*\n" if b"\n" in data[:end] else rb"[^\r]*\r").match(data, end)
    if newline is None:
        raise InputError("the file is cut: expected rows after the header, got none")
    kind, elements, textures = "", list[_Element](), list[str]()
    for line in data[:end].decode("utf-8", "replace").splitlines():
        match line.split():
            case ["format", word, *_]:
                kind = word
            case ["element", name, count] if count.isdigit():
                elements.append(_Element(name, int(count)))
            case ["property", "list", counter, item, name] if elements:
                elements[-1].properties.append(_Property(name, _type(item, kind), _type(counter, kind)))
            case ["property", item, name] if elements:
                elements[-1].properties.append(_Property(name, _type(item, kind)))
            case ["element" | "property", *_]:
                raise InputError(f"not a readable mesh: expected elements and properties in the header, got {line!r}")
            case _:
                textures += _TEXTURE.findall(line)
    if kind not in _FORMATS:
        raise InputError(f"not a readable mesh: expected the format {', '.join(_FORMATS)}, got {kind!r}")
    return kind, elements, textures, newline.end()


def _type(word: str, kind: str) -> np.dtype:
    """Return the type that a word of the header names, in the file's byte order. Raises InputError if it is none."""
    if word not in _TYPES:
        raise InputError(f"not a readable mesh: expected a type such as float or uchar in the header, got {word!r}")
    return np.dtype(_TYPES[word]).newbyteorder(_FORMATS.get(kind, "="))


# --- rows -------------------------------------------------------------------------------------------------------------


class _Text:
    """The rows of a text file: numbers, each of which is one step."""

    def __init__(self, body: bytes) -> None:
        self.numbers, self.at = parsed(body), 0
        self.end = self.numbers.size

    def step(self, _: np.dtype) -> int:
        """Return how far the next number is."""
        return 1

    def one(self, at: int, _: np.dtype) -> int:
        """Return the whole number here, or 0 if there is none."""
        value = self.numbers[at]
        return int(value) if np.isfinite(value) else 0

    def table(self, at: int, row: int, count: int, width: int, kind: np.dtype) -> AnyArray:
        """Return `width` numbers [count, width] from here on, and in each next row."""
        if not count or not width:
            return np.zeros((count, width), kind)
        strides = (row * self.numbers.itemsize, self.numbers.itemsize)
        return np.ndarray((count, width), self.numbers.dtype, self.numbers, at * self.numbers.itemsize, strides)

    def gathered(self, places: NDArray[np.int64], _: np.dtype) -> AnyArray:
        """Return the numbers at these places."""
        return self.numbers[places]


class _Binary:
    """The rows of a binary file: bytes, each of which is one step."""

    def __init__(self, body: bytes) -> None:
        self.data, self.at, self.end = body, 0, len(body)

    def step(self, kind: np.dtype) -> int:
        """Return how far it is to what is behind a number."""
        return kind.itemsize

    def one(self, at: int, kind: np.dtype) -> int:
        """Return the number here."""
        order = ">" if kind.byteorder == ">" else "<"
        return int(struct.unpack_from(order + kind.char, self.data, at)[0])

    def table(self, at: int, row: int, count: int, width: int, kind: np.dtype) -> AnyArray:
        """Return `width` numbers [count, width] from here on, and in each next row."""
        if not count or not width:
            return np.zeros((count, width), kind)
        return np.ndarray((count, width), kind, self.data, at, (row, kind.itemsize))

    def gathered(self, places: NDArray[np.int64], kind: np.dtype) -> AnyArray:
        """Return the numbers at these places."""
        spread = places[:, None] + np.arange(kind.itemsize)
        return np.frombuffer(self.data, np.uint8)[spread].view(kind).reshape(-1)


def _rows(source: _Text | _Binary, element: _Element) -> Rows:
    """Return the next rows, which are this element's. Raises InputError if there are fewer."""
    sizes = _first_sizes(source, element)
    row = sum(_length(source, each, size) for each, size in zip(element.properties, sizes, strict=True))
    even = all(each.counter is None for each in element.properties)
    if even and source.end - source.at < element.count * row:
        raise _cut(element, (source.end - source.at) // row)
    if source.at + element.count * row <= source.end:
        found = _even_rows(source, element, sizes, row)
        if found is not None:
            source.at += element.count * row
            return found
    return _uneven_rows(source, element)


def _cut(element: _Element, held: int) -> InputError:
    """Return the error of a file that ends too early."""
    return InputError(
        f"the file is cut: its header promises {element.count:,} rows of {element.name!r}, it holds {held:,}"
    )


def _length(source: _Text | _Binary, each: _Property, size: int) -> int:
    """Return how far it is to what is behind a property, if it is a list of this size or a number."""
    item = source.step(each.kind)
    return item if each.counter is None else source.step(each.counter) + size * item


def _first_sizes(source: _Text | _Binary, element: _Element) -> list[int]:
    """Return the lengths of the lists in the first row, and 0 for what is none. 0 beyond the end of the file, too."""
    at, sizes = source.at, list[int]()
    for each in element.properties:
        known = each.counter is not None and element.count and at + source.step(each.counter) <= source.end
        sizes.append(max(source.one(at, each.counter), 0) if known and each.counter is not None else 0)
        at += _length(source, each, sizes[-1])
    return sizes


def _even_rows(source: _Text | _Binary, element: _Element, sizes: list[int], row: int) -> Rows | None:
    """Return the rows if all lists are as long as those of the first row, else None."""
    at, count = source.at, element.count
    found = Rows(count, {}, {})
    for each, size in zip(element.properties, sizes, strict=True):
        if each.counter is None:
            found.scalars[each.name] = _native(source.table(at, row, count, 1, each.kind)[:, 0], each.kind)
        else:
            if (source.table(at, row, count, 1, each.counter) != size).any():
                return None
            values = source.table(at + source.step(each.counter), row, count, size, each.kind).reshape(-1)
            found.lists[each.name] = Lists(_native(values, each.kind), np.full(count, size, np.int64))
        at += _length(source, each, size)
    return found


def _uneven_rows(source: _Text | _Binary, element: _Element) -> Rows:
    """Return the rows after a walk over them, which alone can tell where each begins."""
    places: list[list[int]] = [[] for _ in element.properties]
    sizes: list[list[int]] = [[] for _ in element.properties]
    at, end = source.at, source.end
    plan = [
        (each.counter, 0 if each.counter is None else source.step(each.counter), source.step(each.kind), place, size)
        for each, place, size in zip(element.properties, places, sizes, strict=True)
    ]
    for done in range(element.count):
        for counter, head, item, place, size in plan:
            if counter is None:
                place.append(at)
                at += item
            else:
                if at + head > end:
                    raise _cut(element, done)
                size.append(max(source.one(at, counter), 0))
                at += head
                place.append(at)
                at += size[-1] * item
        if at > end:
            raise _cut(element, done)
    source.at = at
    found = Rows(element.count, {}, {})
    for each, place, size in zip(element.properties, places, sizes, strict=True):
        begin = np.array(place, np.int64)
        if each.counter is None:
            found.scalars[each.name] = _native(source.gathered(begin, each.kind), each.kind)
        else:
            counts = np.array(size, np.int64)
            step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
            items = np.repeat(begin, counts) + step * source.step(each.kind)
            found.lists[each.name] = Lists(_native(source.gathered(items, each.kind), each.kind), counts)
    return found


def _native(values: AnyArray, kind: np.dtype) -> AnyArray:
    """Return numbers in the type of the header and in this machine's byte order."""
    with np.errstate(all="ignore"):
        return np.ascontiguousarray(values, kind.newbyteorder("="))
