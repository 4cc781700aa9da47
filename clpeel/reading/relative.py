"""Rewrites OBJ faces whose negative indices count backwards, with indices from the start of the file."""

from __future__ import annotations

import re

_BACKWARDS = re.compile(rb"^[ \t]*f[ \t][^\n]*[ \t/]-\d", re.MULTILINE)


def with_absolute_indices(data: bytes) -> bytes:
    """Return the OBJ file's data with no negative index in its faces.

    A negative index counts back from its own line, but trimesh counts it back from the end of the file.
    """
    start = _first_face(data)
    # Most files have no negative index, and this test is fast.
    if data.find(b"-", start) < 0 or not _BACKWARDS.search(data, start):
        return data
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    lines = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    for number, line in enumerate(lines):
        word, _, rest = line.strip().replace(b"\t", b" ").partition(b" ")
        if word in counts:
            counts[word] += 1
        elif word == b"f" and b"-" in rest:
            corners = [corner.split(b"/") for corner in rest.split()]
            lines[number] = b"f " + b" ".join(
                b"/".join(_absolute(part, count) for part, count in zip(corner, counts.values(), strict=False))
                for corner in corners
            )
    return b"\n".join(lines)


def _first_face(data: bytes) -> int:
    """Return the offset where the first face may begin. This is 0 if any line is indented."""
    if data[:1] in (b"f", b" ", b"\t") or b"\n " in data or b"\n\t" in data:
        return 0
    at = data.find(b"\nf")
    return len(data) if at < 0 else at


def _absolute(index: bytes, count: int) -> bytes:
    """Return an index as it is. If it is negative, it counts back from `count`, the number of elements so far."""
    return b"%d" % (count + 1 + int(index)) if index.startswith(b"-") else index
