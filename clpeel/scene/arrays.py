"""Arrays: what is given for vertices, faces, normals and colours, checked and in the types that a scene has."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel import checks
from clpeel.color import parse_color
from clpeel.errors import InputError

DEFAULT_COLOR = (120, 150, 190, 255)
"""RGBA of a mesh that brings no colour of its own, uint8."""

AnyArray = NDArray[Any]
"""An array of whatever type a file or a caller has."""

Colors = AnyArray
"""RGBA in the last axis: uint8 0..255 or float32 0..1."""


def checked_vertices(value: ArrayLike) -> NDArray[np.float64]:
    """value as float64 [n, 3], or InputError."""
    array = _array("vertices", value)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise InputError(f"vertices: expected [n, 3] real numbers, got {_described(array)}")
    return np.ascontiguousarray(array, dtype=np.float64)


def checked_faces(value: ArrayLike, count: int) -> NDArray[np.int32]:
    """value as int32 [m, 3] with every index in 0..count-1 and m >= 1, or InputError."""
    array = _array("faces", value)
    if array.size == 0:
        raise InputError("faces: expected at least one triangle, got none; the mesh is empty")
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise InputError(f"faces: expected [m, 3] integers, got {_described(array)}")
    least, greatest = int(array.min()), int(array.max())
    if least < 0 or greatest >= count:
        wrong = least if least < 0 else greatest
        face = int(np.argmax((array == wrong).any(axis=1)))
        raise InputError(f"faces: expected indices 0..{count - 1}, got {wrong} in face {face}; the mesh is damaged")
    return np.ascontiguousarray(array, dtype=np.int32)


def checked_normals(value: ArrayLike, count: int) -> NDArray[np.float32]:
    """value as float32 [count, 3], or InputError."""
    array = _array("vertex_normals", value)
    if array.shape != (count, 3) or array.dtype.kind not in "fiu":
        raise InputError(f"vertex_normals: expected [{count}, 3] real numbers, got {_described(array)}")
    with np.errstate(over="ignore", under="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)


def checked_color(name: str, value: ArrayLike) -> Colors:
    """value, numbers or text such as "red" or "#rrggbbaa", uint8 or float32 [3], or [4] with alpha, or InputError."""
    numbers = written(name, value, alpha=True)
    return checked_colors(name, numbers, ())[: np.shape(numbers)[0]]


def written(name: str, value: ArrayLike, alpha: bool = False) -> ArrayLike:
    """A colour that is text as numbers 0..1, or InputError; anything else as it is."""
    if not isinstance(value, str):
        return value
    try:
        return parse_color(value, alpha)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def checked_colors(name: str, value: ArrayLike, rows: tuple[int, ...]) -> Colors:
    """value as uint8 or float32 [*rows, 4], or InputError; a single colour may be text."""
    array = _array(name, value if rows else written(name, value, alpha=True))
    if array.shape not in ((*rows, 3), (*rows, 4)) or array.dtype.kind not in "fiu":
        shape = ", ".join(map(str, (*rows, "3 or 4")))
        raise InputError(f"{name}: expected [{shape}] integers 0..255 or floats 0..1, got {_described(array)}")
    top = 1 if array.dtype.kind == "f" else 255
    if array.size and array.dtype != np.uint8:
        least, greatest = array.min(), array.max()  # NaN if any is
        if not (least >= 0 and greatest <= top):
            wrong = greatest if not greatest <= top else least
            kind = "floats" if top == 1 else "integers"
            raise InputError(f"{name}: expected {kind} 0..{top}, got {wrong}")
    colors = np.empty((*rows, 4), dtype=np.float32 if top == 1 else np.uint8)
    colors[..., : array.shape[-1]] = array
    if array.shape[-1] == 3:
        colors[..., 3] = top
    return colors


def checked_opacity(value: object) -> float:
    """value as a float in 0..1, or InputError."""
    opacity = checks.number(value)
    if not 0 <= opacity <= 1:
        raise InputError(f"opacity: expected a number 0..1, got {value}")
    return opacity


def alike(arrays: list[Colors]) -> list[Colors]:
    """The colours as they are if all are uint8, else all as float32."""
    return arrays if all(array.dtype == np.uint8 for array in arrays) else [as_float(array) for array in arrays]


def as_float(colors: Colors) -> NDArray[np.float32]:
    """The colours as float32 0..1."""
    return np.asarray(colors / np.float32(255) if colors.dtype == np.uint8 else colors, dtype=np.float32)


def _array(name: str, value: ArrayLike) -> AnyArray:
    """value as an array of numbers, or InputError."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected an array of numbers, got {type(value).__name__}: {error}") from None


def _described(array: AnyArray) -> str:
    """An array's shape and type, or the text that it is, for an error message."""
    return repr(str(array)) if array.shape == () and array.dtype.kind == "U" else f"{list(array.shape)} {array.dtype}"
