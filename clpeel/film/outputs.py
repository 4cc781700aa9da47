"""Outputs: where a film goes, of which kind it is by its name, and what each kind can hold.

This imports nothing heavy, because the command checks its outputs before anything else.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal

from clpeel.errors import InputError
from clpeel.files import checked_file, checked_folder

Kind = Literal["gif", "webp", "mp4", "png"]

EXTRA = "pip install 'clpeel[video]'"

MOST_FPS: dict[Kind, float] = {"gif": 50, "webp": 100, "mp4": 240, "png": 1000}
"""The most frames a second. Browsers slow down a GIF of more than 50, and a WebP of more than 100."""

MOST_SIDE: dict[Kind, int] = {"gif": 65535, "webp": 16383, "mp4": 16384, "png": 65535}
"""The most pixels on a side that the formats have, and x264."""

MOST_PIXELS = 1 << 26
"""The most pixels of a frame. Pillow takes a file with more of them for an attack."""

_NUMBER = re.compile(
    r"(?P<before>[^#]*)(?P<hashes>#+)(?P<after>[^#]*)|(?P<head>[^%]*)%(?P<digits>0[1-9])?d(?P<tail>[^%]*)"
)


@dataclass(frozen=True)
class Output:
    """Where a film goes. path: the file with links resolved; of numbered pictures, their folder.

    before, digits, after: of numbered pictures, what is around a number in their names, and its least digits.
    """

    kind: Kind
    path: str
    before: str = ""
    digits: int = 1
    after: str = ""

    def name(self, k: int) -> str:
        """Return the name of frame k, from 0, in the folder of numbered pictures. The first is number 1."""
        return f"{self.before}{k + 1:0{self.digits}}{self.after}"

    def number(self, name: str) -> int | None:
        """Return which frame, from 0, has this name, or None."""
        found = re.fullmatch(f"{re.escape(self.before)}([0-9]+){re.escape(self.after)}", name)
        k = int(found[1]) - 1 if found and len(found[1]) < 10 else -1
        return k if k >= 0 and self.name(k) == name else None


def checked_output(path: str | os.PathLike[str], name: str = "path") -> Output:
    """Return where a film of this name goes. Raises InputError, before any work, if it cannot go there.

    name: what errors call it.
    """
    try:
        given = os.fsdecode(path)
    except TypeError:
        raise InputError(f"{name}: expected a file name, got {type(path).__name__}") from None
    ending = os.path.splitext(given)[1].lower()
    if ending == ".png":
        return _numbered(given, name)
    kind: Kind | None = {".gif": "gif", ".webp": "webp", ".mp4": "mp4"}.get(ending)  # type: ignore[assignment]
    if kind is None:
        raise InputError(
            f"{name}: expected a name ending in .gif, .webp or .mp4, or numbered pictures such as frames/####.png, "
            f"got '{given}'"
        )
    target = checked_file(given, name)
    if os.path.exists(target) and not os.path.isfile(target):
        raise InputError(f"{name}: expected a file, as a film is not written piece by piece, got '{given}'")
    return Output(kind, target)


def _numbered(given: str, name: str) -> Output:
    folder, base = os.path.split(given)
    found = _NUMBER.fullmatch(base)
    if found is None:
        raise InputError(
            f"{name}: expected one place for the frame's number, such as frames/####.png or %04d.png, or a name ending "
            f"in .gif, .webp or .mp4, got '{given}'"
        )
    place = checked_folder(folder or os.curdir, name)
    if found["hashes"]:
        output = Output("png", place, found["before"], len(found["hashes"]), found["after"])
    else:
        output = Output("png", place, found["head"], int(found["digits"] or 1), found["tail"])
    if os.path.isdir(place):
        checked_file(os.path.join(place, output.name(99999)), name)  # a name that is too long
    return output


def check_film(output: Output, size: tuple[int, int], transparent: bool, fps: float) -> None:
    """Raise InputError if this kind of film cannot hold the frames, or if it needs a package that is missing.

    size: (width, height) in pixels. transparent: whether frames have no background.
    """
    kind, (width, height) = output.kind, size
    name = {"gif": "GIF", "webp": "WebP", "mp4": "MP4", "png": "PNG"}[kind]
    if not 0 < fps <= MOST_FPS[kind]:
        raise InputError(f"fps: expected above 0, up to {MOST_FPS[kind]:g} for {name}, got {fps:g}")
    if transparent and kind in ("gif", "mp4"):
        raise InputError(f"background: expected a colour, as {name} holds no alpha, got none; .webp and .png hold it")
    if max(size) > MOST_SIDE[kind] or width * height > MOST_PIXELS:
        raise InputError(
            f"size: expected at most {MOST_SIDE[kind]:,} pixels a side and {MOST_PIXELS:,} in all for {name}, "
            f"got {width} x {height}"
        )
    if kind == "mp4" and (width % 2 or height % 2):
        raise InputError(f"size: expected even numbers for MP4, got {width} x {height}")
    if kind == "mp4" and find_spec("av") is None:
        raise InputError(f"path: expected the package av for MP4, got none: {EXTRA}")
