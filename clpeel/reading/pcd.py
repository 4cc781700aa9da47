"""PCD: reads the files of the Point Cloud Library: text, binary and compressed ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import named
from clpeel.reading.lines import parsed
from clpeel.reading.losses import listed
from clpeel.reading.marks import marks
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene

_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_KINDS = {("F", 4), ("F", 8), ("I", 1), ("I", 2), ("I", 4), ("I", 8), ("U", 1), ("U", 2), ("U", 4), ("U", 8)}
_PLACE = ("x", "y", "z")
_NORMAL = ("normal_x", "normal_y", "normal_z")
_UNSEEN = ("_", "padding")
_MOST_POINTS = 2**31 - 1


def pcd(data: bytes) -> Scene:
    """Return the scene of a PCD file: x, y, z, and rgb or rgba and normals if there are any.

    Points whose places are not finite are those that a sensor lacks, and are dropped, with a note of their number.
    Raises InputError if the file is damaged, or has no points.
    """
    header = _Header.of(data)
    columns = header.columns(data)
    lacking = [name for name in _PLACE if name not in columns]
    if lacking:
        raise InputError(f"not a readable cloud: expected fields x, y and z, got {listed(map(named, columns), 9)}")
    places = np.stack([columns[name].astype(np.float64) for name in _PLACE], axis=1)
    there = np.flatnonzero(np.isfinite(places).all(axis=1))
    if not len(there):
        raise InputError("expected points, got none that are finite; the file is empty")
    fields: dict[str, Any] = {}
    color = next((name for name in ("rgba", "rgb") if name in columns), None)
    if color is not None:
        fields["vertex_colors"] = _colors(columns[color], with_alpha=color == "rgba")[there]
    if all(name in columns for name in _NORMAL):
        normals = np.stack([columns[name].astype(np.float32) for name in _NORMAL], axis=1)
        fields["vertex_normals"] = normals[there]
    shown = {*_PLACE, *_NORMAL, "rgb", "rgba", *_UNSEEN}
    arrays = {name: column[there] for name, column in columns.items() if name not in shown}
    scene = marks(places[there], points=np.arange(len(there)), arrays=arrays, **fields)
    assert scene is not None
    notes = list[str]()
    if len(there) < len(places):
        notes.append(f"{len(places) - len(there):,} point(s) without a place left out")
    return replace(scene, notes=tuple(notes))


def _colors(packed: AnyArray, with_alpha: bool) -> NDArray[np.uint8]:
    """Return colours [p, 3 or 4] of numbers whose bits are 0xAARRGGBB, whatever type the file says they have."""
    if packed.dtype.kind == "f":
        bits = packed.astype(np.float32).view(np.uint32)
    else:
        bits = packed.astype(np.int64).astype(np.uint32)
    rgb = [(bits >> np.uint32(shift)).astype(np.uint8) for shift in (16, 8, 0)]
    # Many programs write an alpha of 0 and mean nothing by it.
    alpha = (bits >> np.uint32(24)).astype(np.uint8)
    return np.stack([*rgb, alpha] if with_alpha and alpha.any() else rgb, axis=1)


@dataclass(frozen=True)
class _Header:
    """What the beginning of a file says. names, kinds, counts: of the fields. start: where the points begin."""

    names: tuple[str, ...]
    kinds: tuple[np.dtype[Any], ...]
    counts: tuple[int, ...]
    points: int
    form: str
    start: int

    @staticmethod
    def of(data: bytes) -> _Header:
        """Read the header. Raises InputError if it is damaged."""
        says: dict[str, list[str]] = {}
        at = 0
        while "DATA" not in says:
            end = data.find(b"\n", at)
            if end < 0 or end - at > 65536:
                raise InputError("not a readable cloud: expected a header that ends with DATA, got none; it is cut")
            words = data[at:end].decode("latin-1").split()
            at = end + 1
            if words and words[0] in _KEYS:
                says[words[0]] = words[1:]
            elif words and not words[0].startswith("#"):
                raise InputError(f"not a readable cloud: expected a line of the header, got {named(words[0][:20])}")
        names = says.get("FIELDS", [])
        sizes, counts = (_numbers(says, key, len(names)) for key in ("SIZE", "COUNT"))
        types = says.get("TYPE", [])
        if not names or len(types) != len(names):
            raise InputError(f"not a readable cloud: expected a TYPE of each of {len(names)} fields, got {len(types)}")
        for name, kind, size in zip(names, types, sizes, strict=True):
            if (kind, size) not in _KINDS:
                raise InputError(f"not a readable cloud: expected a number, got {kind}{size} for {named(name)}")
        points = _numbers(says, "POINTS", 1)[0] if "POINTS" in says else _product(says)
        if not 0 <= points <= _MOST_POINTS:
            raise InputError(f"not a readable cloud: expected up to {_MOST_POINTS:,} points, got {points:,}")
        kinds = tuple(np.dtype(f"<{kind.lower()}{size}") for kind, size in zip(types, sizes, strict=True))
        form = " ".join(says["DATA"])
        return _Header(tuple(names), kinds, tuple(counts), points, form, at)

    @property
    def row(self) -> np.dtype[Any]:
        """What a point is in a binary file."""
        own = [
            (f"{place}", kind, (count,))
            for place, (kind, count) in enumerate(zip(self.kinds, self.counts, strict=True))
        ]
        return np.dtype(own)

    def columns(self, data: bytes) -> dict[str, AnyArray]:
        """Return the fields of one number, each [points]. Raises InputError if the file has less than it says."""
        if not self.points:
            raise InputError("expected points, got none; the file is empty")
        body = data[self.start :]
        if self.form == "ascii":
            found = self._of_text(body)
        elif self.form == "binary":
            self._check(len(body), self.row.itemsize * self.points)
            rows = np.frombuffer(body, self.row, self.points)
            found = [rows[name] for name in self.row.names or ()]
        elif self.form == "binary_compressed":
            found = self._of_compressed(body)
        else:
            raise InputError(
                f"not a readable cloud: expected ascii, binary or binary_compressed, got {named(self.form[:20])}"
            )
        named_columns = zip(self.names, found, self.counts, strict=True)
        return {name: column.reshape(self.points, -1)[:, 0] for name, column, count in named_columns if count == 1}

    def _of_text(self, body: bytes) -> list[AnyArray]:
        values = parsed(body)
        width = sum(self.counts)
        self._check(values.size, width * self.points, "numbers")
        table = values[: width * self.points].reshape(self.points, width)
        ends = np.cumsum(self.counts)
        parts = [table[:, end - count : end] for end, count in zip(ends, self.counts, strict=True)]
        # A colour whose type is float is the digits of the float that has its bits.
        return [part.astype(kind) for part, kind in zip(parts, self.kinds, strict=True)]

    def _of_compressed(self, body: bytes) -> list[AnyArray]:
        """Return the fields of a compressed body: two sizes, and then all of the first field, of the second, ..."""
        self._check(len(body), 8)
        packed, whole = (int(size) for size in np.frombuffer(body, "<u4", 2))
        self._check(len(body) - 8, packed)
        if whole != self.row.itemsize * self.points:
            raise InputError(
                f"not a readable cloud: expected {self.row.itemsize * self.points:,} bytes of points, got {whole:,}"
            )
        plain = unpacked(body[8 : 8 + packed], whole)
        found, at = [], 0
        for kind, count in zip(self.kinds, self.counts, strict=True):
            found.append(np.frombuffer(plain, kind, count * self.points, at))
            at += kind.itemsize * count * self.points
        return found

    def _check(self, got: int, needed: int, what: str = "bytes") -> None:
        """Raise InputError if there are fewer than needed."""
        if got < needed:
            raise InputError(f"the file is cut: expected {needed:,} {what} of points, got {got:,}")


def _numbers(says: dict[str, list[str]], key: str, count: int) -> list[int]:
    """Return so many whole numbers from a line of the header. COUNT is 1 if it is not there. Raises InputError."""
    words = says.get(key, ["1"] * count if key == "COUNT" else [])
    if len(words) != count or not all(word.isdecimal() and len(word) < 12 for word in words):
        raise InputError(
            f"not a readable cloud: expected {count} number(s) of {key}, got {named(' '.join(words)[:40])}"
        )
    return [int(word) for word in words]


def _product(says: dict[str, list[str]]) -> int:
    """Return how many points WIDTH and HEIGHT make. Raises InputError."""
    return _numbers(says, "WIDTH", 1)[0] * _numbers(says, "HEIGHT", 1)[0]


def unpacked(data: bytes, size: int) -> bytes:
    """Return what LZF has packed into data, `size` bytes. Raises InputError if it is damaged.

    A control byte below 32 stands before so many plain bytes and one more. Any other stands for bytes that came before.
    Its upper three bits are how many, less two; 7 if the next byte counts on. Its lower five bits and another byte are
    how far back they begin, less one.
    """
    found = bytearray()
    at, end = 0, len(data)
    try:
        while at < end:
            control = data[at]
            at += 1
            if control < 32:
                found += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            back = ((control & 31) << 8 | data[at]) + 1
            at += 1
            length += 2
            start = len(found) - back
            if start < 0:
                raise InputError("not a readable cloud: its compressed points are damaged")
            # Bytes may be copies of those that this run itself writes.
            run = found[start : start + length]
            found += run if len(run) == length else (run * (length // back + 1))[:length]
            if len(found) > size:
                break
    except IndexError:
        raise InputError("the file is cut: its compressed points end too early") from None
    if len(found) != size:
        raise InputError(f"not a readable cloud: expected {size:,} bytes of points, got {len(found):,}; it is damaged")
    return bytes(found)
