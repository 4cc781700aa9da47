"""Values: turns the text of an option into its value, or raises an error that argparse shows with the option's name."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable

from clpeel.checks import AXES, MAX_SIDE, checked_background, named_view
from clpeel.color import parse_color
from clpeel.errors import InputError
from clpeel.options import read_color, read_count, read_numbers, read_share

Vector = tuple[float, float, float]
Reader = Callable[[str], object]


def for_argparse(read: Reader) -> Reader:
    """Return the reader with its InputErrors turned into errors that argparse shows as they are."""

    def reader(text: str) -> object:
        try:
            return read(text)
        except InputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return reader


def number(text: str) -> float:
    """Read a finite number. Raises ArgumentTypeError, as all readers here do."""
    try:
        (value,) = read_numbers(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got '{text}'") from None
    return value


def positive(text: str) -> float:
    """Read a number above 0."""
    value = number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got '{text}'")
    return value


def vector(text: str) -> Vector:
    """Read three numbers."""
    try:
        x, y, z = read_numbers(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected X,Y,Z (three numbers), got '{text}'") from None
    return x, y, z


def view_direction(text: str) -> Vector | str:
    """Read the name of a view, such as `iso` or `-xy`, which stays as it is, or a direction."""
    if named_view(text):
        return text
    try:
        return direction(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(
            str(error).replace(", or X,Y,Z", ", a view such as iso or -xy, or X,Y,Z")
        ) from None


def direction(text: str) -> Vector:
    """Read an axis such as `-Z`, or three numbers that are not all zero."""
    axis = re.fullmatch(r"([+-]?)([XYZxyz])", text)
    if axis:
        sign = -1.0 if axis[1] == "-" else 1.0
        x, y, z = AXES[axis[2].upper()]
        return sign * x, sign * y, sign * z
    try:
        x, y, z = read_numbers(text)
        if x == y == z == 0:
            raise ValueError(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected an axis such as +Y or -Z, or X,Y,Z not all zero, got '{text}'"
        ) from None
    return x, y, z


def number_range(text: str) -> tuple[float, float]:
    """Read two numbers, of which the first is less."""
    try:
        low, high = read_numbers(text)
        if not low < high:
            raise ValueError(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected LOW,HIGH (two numbers, LOW < HIGH), got '{text}'") from None
    return low, high


def component(text: str) -> int:
    """Read a whole number of 0 or more, or -1."""
    return -1 if text == "-1" else index(text)


def colormap(text: str) -> object:
    """Read the name of a colour map, or colours with colons between them."""
    if ":" not in text:
        return text
    return [any_color(part) for part in text.split(":")]


def opacity_map(text: str) -> object:
    """Read the name of a transfer function, or numbers 0..1 with commas between them."""
    if not re.match(r"[-+.0-9]", text):
        return text
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a name, or numbers 0..1 such as 0,0.2,1, got '{text}'") from None


def any_color(text: str) -> object:
    """Read a colour, which may have an alpha."""
    try:
        return parse_color(text, alpha=True)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def clipping_range(text: str) -> tuple[float, float]:
    """Read two numbers."""
    try:
        near, far = read_numbers(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected NEAR,FAR (two numbers), got '{text}'") from None
    return near, far


def resolution(text: str) -> tuple[int, int]:
    """Read a width and a height in pixels, each 1..MAX_SIDE."""
    try:
        width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected W,H (two whole numbers), got '{text}'") from None
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise argparse.ArgumentTypeError(f"expected W,H with each in 1..{MAX_SIDE}, got '{text}'")
    return width, height


def surface_color(text: str) -> object:
    """Read a colour as `color` does. If it has an alpha, the error also names --opacity."""
    try:
        return color(text)
    except argparse.ArgumentTypeError as error:
        hint = "; give it with --opacity" if "alpha" in str(error) else ""
        raise argparse.ArgumentTypeError(f"{error}{hint}") from None


def background(text: str) -> object:
    """Read a colour as `color` does, or two with a colon between them: those at the top and at the bottom."""
    try:
        return checked_background(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error).removeprefix("background: ")) from None


def port(text: str) -> int:
    """Read the number of a port, 0..65535; 0 stands for any that is free."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value < 1 << 16:
        raise argparse.ArgumentTypeError(f"expected a whole number 0..65535, got '{text}'")
    return value


def bit_depth(text: str) -> int:
    """Read 8, 16 or 32."""
    if text not in ("8", "16", "32"):
        raise argparse.ArgumentTypeError(f"expected 8, 16 or 32, got '{text}'")
    return int(text)


def index(text: str) -> int:
    """Read a whole number of 0 or more."""
    if not re.fullmatch(r"[0-9]+", text):
        raise argparse.ArgumentTypeError(f"expected a whole number of 0 or more, got '{text}'")
    return int(text)


def counts(text: str) -> tuple[int, ...]:
    """Read whole numbers of 1 or more, with commas between them."""
    try:
        return tuple(read_count(part) for part in text.split(","))
    except InputError:
        raise argparse.ArgumentTypeError(f"expected whole numbers of 1 or more, such as 1,2,4, got '{text}'") from None


def names(text: str) -> tuple[str, ...]:
    """Read words with commas between them."""
    return tuple(part.strip() for part in text.split(","))


color = for_argparse(read_color)
count = for_argparse(read_count)
opacity = for_argparse(read_share)
