"""Checks: converts a user's value to the value that the code uses, or raises an InputError of one line.

Everything here can be imported without NumPy, so that the command's help and its errors appear at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

from clpeel.color import parse_color
from clpeel.errors import InputError

MAX_SIDE = 1 << 16
"""The most pixels on a side of a picture. Half of it lies inside the rasterizer's guard band."""

AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
"""The unit vectors of the axes, by letter."""

VIEWS = {
    "iso": ((-1.0, -1.0, -1.0), (0.0, 0.0, 1.0)),
    "xy": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "yx": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "xz": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "zx": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0)),
    "yz": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "zy": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}
"""Views by the names that PyVista has for them: where the camera looks, and what is up. The first axis points right."""

MIN_MEMORY = 1 << 20
"""The fewest bytes of memory that a render may be given. Fragments get at least as many, however little is left."""

Rgb = tuple[float, float, float]
Gradient = tuple[Rgb, Rgb]
"""The colours at the top edge and at the bottom edge of a picture."""

Background = Rgb | Gradient
"""What is behind a scene, after its check."""

GivenBackground = Sequence[float] | Sequence[Sequence[float] | str] | str | None
"""What a user may give: 3 numbers 0..1, text such as "white", a pair (top, bottom) of these, text such as
"white:#8090a0", or None for none.
"""


def named_view(word: str) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
    """Return where a camera looks in the view of this name (VIEWS), and what is up. None if there is no such view.

    A minus before the name is for the view from the other side.
    """
    name = word.strip().lower()
    found = VIEWS.get(name.removeprefix("-").removeprefix("+"))
    if found is None or not name.startswith("-"):
        return found
    (x, y, z), up = found
    return (-x, -y, -z), up


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise InputError unless value is one of the known values."""
    known = tuple(known)
    try:
        found = value in known
    except ValueError:  # comparing an array as a whole raises this
        found = False
    if not found:
        raise InputError(f"{name}: expected one of {', '.join(map(str, known))}; got {value!r}")


def number(value: object) -> float:
    """Return the value as a float, or NaN if it is not a number."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan


def whole_number(name: str, value: object, most: int, least: int = 1) -> int:
    """Return the value as a whole number least..most, or raise InputError."""
    try:
        whole = int(value)  # type: ignore[call-overload]
    except (TypeError, ValueError, OverflowError):
        whole = least - 1
    if whole != value or not least <= whole <= most:
        raise InputError(f"{name}: expected {least}..{most}, got {value!r}")
    return int(whole)


def true_or_false(name: str, value: object, hint: str = "") -> bool:
    """Return the value as a bool, or raise InputError. hint: added to the error, on what else may have been meant."""
    if type(value).__name__ not in ("bool", "bool_") and value not in (0, 1):
        raise InputError(f"{name}: expected True or False, got {value!r}{hint}")
    return bool(value)


def share(name: str, value: object) -> float:
    """Return the value as a float 0..1, or raise InputError."""
    found = number(value)
    if not 0 <= found <= 1:
        raise InputError(f"{name}: expected 0..1, got {value!r}")
    return found


def not_negative(name: str, value: object, what: str) -> float:
    """Return the value as a finite float of 0 or more, or raise InputError. what: the expected number, in words."""
    found = number(value)
    if not 0 <= found < math.inf:
        raise InputError(f"{name}: expected {what}, got {value!r}")
    return found


def length(name: str, value: object, most: float) -> float | str:
    """Return a length as a number of pixels, or as text such as "0.01u", scene units. Raises InputError.

    value: a number above 0, or text that is one, of pixels up to `most`; with a "u" behind it, of scene units.
    """
    text = value.strip() if isinstance(value, str) else ""
    found = number(text.removesuffix("u") if text else value)
    if text.endswith("u") and 0 < found < math.inf:
        return f"{found!r}u"
    if not 0 < found <= most:
        raise InputError(
            f"{name}: expected pixels above 0, up to {most:,g}, or scene units such as 0.01u, got {value!r}"
        )
    return found


def number_range(name: str, value: object) -> tuple[float, float]:
    """Return the value as (low, high) with 0 <= low < high, or raise InputError."""
    try:
        low, high = (float(part) for part in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected (low, high), got {value!r}") from None
    if not 0 <= low < high < math.inf:
        raise InputError(f"{name}: expected 0 <= low < high, got {low:g}, {high:g}")
    return low, high


def checked_rgb(name: str, value: object, or_none: str = "") -> Rgb:
    """Return a colour as three numbers 0..1, or raise InputError.

    value: numbers, or text such as "red". or_none: words for the error that say what else the value may be.
    """
    numbers: object = value
    if isinstance(value, str):
        try:
            numbers = parse_color(value)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    try:
        red, green, blue = (float(part) for part in numbers)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected 3 numbers 0..1{or_none}, got {value!r}") from None
    if not all(0 <= part <= 1 for part in (red, green, blue)):
        raise InputError(f"{name}: expected 3 numbers 0..1, got {value!r}")
    return red, green, blue


def checked_background(background: object) -> Background | None:
    """Return what a user gave (GivenBackground) as three numbers 0..1, as a pair of these, or as None.

    Raises InputError.
    """
    if background is None:
        return None
    given = _given_shades(background)
    if len(given) == 1:
        return checked_rgb("background", given[0], ", (top, bottom) or None")
    if len(given) != 2:
        raise InputError(f"background: expected a colour, or 2 for top and bottom, got {len(given)}: {background!r}")
    return checked_rgb("background: top", given[0]), checked_rgb("background: bottom", given[1])


def _given_shades(background: object) -> Sequence[object]:
    """Return what may be the colours of a gradient. Else the background is the only one."""
    if isinstance(background, str):
        return background.split(":")
    try:
        parts = list(background)  # type: ignore[call-overload]
    except TypeError:
        return [background]
    return parts if len(parts) > 1 and any(isinstance(part, Iterable) for part in parts) else [background]


def shades_of(background: Background) -> tuple[Rgb, ...]:
    """Return the colours of a checked background from top to bottom: one or two."""
    return background if len(background) == 2 else (background,)


def checked_size(size: Sequence[int]) -> tuple[int, int]:
    """Return (width, height), each 1..MAX_SIDE, or raise InputError."""
    try:
        width, height = (int(side) if int(side) == side else -1 for side in size)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"size: expected (width, height) in pixels, got {size!r}") from None
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise InputError(f"size: expected 1..{MAX_SIDE} pixels a side, got {size[0]} x {size[1]}")
    return width, height


def parse_memory(memory: int | str) -> int:
    """Return bytes from a number or from text such as "512M" or "2G" (powers of 1024), or raise InputError."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?\s*", str(memory), re.IGNORECASE)
    if not match:
        raise InputError(f"memory: expected bytes or a size such as 512M, got {memory!r}")
    nbytes = int(float(match[1]) * 1024 ** " KMGT".index(match[2].upper() or " "))
    if nbytes < MIN_MEMORY:
        raise InputError(f"memory: expected at least 1M, got {memory!r}")
    return nbytes
