"""Arrays: checks vertices, faces, normals and colours, and converts them to the types that a scene stores."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel import checks
from clpeel.color import parse_color
from clpeel.errors import InputError

DEFAULT_COLOR = (120, 150, 190, 255)
"""RGBA of a mesh without any colour of its own, uint8."""

AnyArray = NDArray[Any]
"""An array of any type that a file or a caller may have."""

Colors = AnyArray
"""RGBA in the last axis: uint8 0..255 or float32 0..1."""


def checked_vertices(value: ArrayLike) -> NDArray[np.float64]:
    """Return value as float64 [n, 3], or raise InputError."""
    array = _array("vertices", value)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise InputError(f"vertices: expected [n, 3] real numbers, got {_described(array)}")
    return np.ascontiguousarray(array, dtype=np.float64)


def checked_faces(value: ArrayLike, count: int, least_faces: int = 1) -> NDArray[np.int32]:
    """Return value as int32 [m, 3], or raise InputError. Every index must be in 0..count-1.

    least_faces: 1, or 0 if there may be none.
    """
    array = _array("faces", value)
    if array.size == 0:
        if least_faces == 0:
            return np.zeros((0, 3), np.int32)
        raise InputError("faces: expected at least one triangle, got none, nor a line or a point; the mesh is empty")
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise InputError(f"faces: expected [m, 3] integers, got {_described(array)}")
    least, greatest = int(array.min()), int(array.max())
    if least < 0 or greatest >= count:
        wrong = least if least < 0 else greatest
        face = int(np.argmax((array == wrong).any(axis=1)))
        raise InputError(f"faces: expected indices 0..{count - 1}, got {wrong} in face {face}; the mesh is damaged")
    return np.ascontiguousarray(array, dtype=np.int32)


def checked_indices(name: str, value: ArrayLike, count: int, width: int | None = None) -> NDArray[np.int32] | None:
    """Return the vertices of lines (width 2) or points (None) as int32 [k, width] or [k], or None if there are none.

    Every index must be in 0..count-1. Raises InputError, which calls them by `name`.
    """
    array = _array(name, value)
    if array.size == 0:
        return None
    if array.shape[1:] != (() if width is None else (width,)) or array.ndim == 0 or array.dtype.kind not in "iu":
        shape = "[p]" if width is None else f"[k, {width}]"
        raise InputError(f"{name}: expected {shape} integers, got {_described(array)}")
    least, greatest = int(array.min()), int(array.max())
    if least < 0 or greatest >= count:
        wrong = least if least < 0 else greatest
        raise InputError(f"{name}: expected indices 0..{count - 1}, got {wrong}; the mesh is damaged")
    return np.ascontiguousarray(array, dtype=np.int32)


def checked_normals(value: ArrayLike, count: int) -> NDArray[np.float32]:
    """Return value as float32 [count, 3], or raise InputError."""
    array = _array("vertex_normals", value)
    if array.shape != (count, 3) or array.dtype.kind not in "fiu":
        raise InputError(f"vertex_normals: expected [{count}, 3] real numbers, got {_described(array)}")
    with np.errstate(over="ignore", under="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)


def checked_uv(name: str, value: ArrayLike, count: int) -> NDArray[np.float32]:
    """Return texture coordinates as float32 [count, 2], or raise InputError. What is not finite becomes 0."""
    array = _array(name, value)
    if array.shape != (count, 2) or array.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected [{count}, 2] real numbers, got {_described(array)}")
    with np.errstate(over="ignore", under="ignore"):
        uv = np.ascontiguousarray(array, dtype=np.float32)
    return uv if np.isfinite(uv).all() else np.nan_to_num(uv, nan=0.0, posinf=0.0, neginf=0.0)


def checked_flags(name: str, value: ArrayLike, count: int) -> NDArray[np.bool_]:
    """Return value as bool [count], or raise InputError. A single one counts for all."""
    array = _array(name, value)
    if array.shape not in ((), (count,)) or array.dtype != bool:
        raise InputError(f"{name}: expected [{count}] booleans, got {_described(array)}")
    return np.ascontiguousarray(np.broadcast_to(array, (count,)))


def checked_polygons(value: ArrayLike, count: int) -> NDArray[np.int32] | None:
    """Return the polygon of each face, int32 [count], counted from 0; None if each has its own. Raises InputError."""
    array = _array("polygons", value)
    if array.shape != (count,) or array.dtype.kind not in "iu":
        raise InputError(f"polygons: expected [{count}] integers, got {_described(array)}")
    if (array[1:] > array[:-1]).all():
        return None
    kinds, kind = np.unique(array, return_inverse=True)
    return None if len(kinds) == count else kind.reshape(-1).astype(np.int32)


def checked_color(name: str, value: ArrayLike) -> Colors:
    """Return one colour as uint8 or float32: [3], or [4] if it has an alpha. Raises InputError.

    value: numbers, or text such as "red" or "#rrggbbaa". name: what the error calls it.
    """
    numbers = written(name, value, alpha=True)
    return checked_colors(name, numbers, ())[: np.shape(numbers)[0]]


def written(name: str, value: ArrayLike, alpha: bool = False) -> ArrayLike:
    """Return a colour that is text as numbers 0..1, or raise InputError. Anything else is returned as it is."""
    if not isinstance(value, str):
        return value
    try:
        return parse_color(value, alpha)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def checked_colors(name: str, value: ArrayLike, rows: tuple[int, ...]) -> Colors:
    """Return value as uint8 or float32 [*rows, 4], or raise InputError. A single colour (no rows) may be text."""
    array = _array(name, value if rows else written(name, value, alpha=True))
    if array.shape not in ((*rows, 3), (*rows, 4)) or array.dtype.kind not in "fiu":
        shape = ", ".join(map(str, (*rows, "3 or 4")))
        raise InputError(f"{name}: expected [{shape}] integers 0..255 or floats 0..1, got {_described(array)}")
    top = 1 if array.dtype.kind == "f" else 255
    if array.size and array.dtype != np.uint8:
        least, greatest = array.min(), array.max()  # NaN if any of them is NaN
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
    """Return value as a float in 0..1, or raise InputError."""
    opacity = checks.number(value)
    if not 0 <= opacity <= 1:
        raise InputError(f"opacity: expected a number 0..1, got {value}")
    return opacity


def alike(arrays: list[Colors]) -> list[Colors]:
    """Return the colours unchanged if all of them are uint8, else all of them as float32."""
    return arrays if all(array.dtype == np.uint8 for array in arrays) else [as_float(array) for array in arrays]


def as_float(colors: Colors) -> NDArray[np.float32]:
    """Return the colours as float32 0..1."""
    return np.asarray(colors / np.float32(255) if colors.dtype == np.uint8 else colors, dtype=np.float32)


def counted_alphas(alpha: Colors, below: float = 1.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distinct alphas below a bound, 0..1, and how often each occurs."""
    if alpha.dtype == np.uint8:
        values, counts = np.arange(256) / 255, np.bincount(alpha.reshape(-1), minlength=256)
        return values[values < below], counts[values < below].astype(np.float64)
    values, counts = np.unique(alpha[alpha < below].astype(np.float64), return_counts=True)
    return values, counts.astype(np.float64)


def _array(name: str, value: ArrayLike) -> AnyArray:
    """Return value as an array of numbers, or raise InputError."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected an array of numbers, got {type(value).__name__}: {error}") from None


def _described(array: AnyArray) -> str:
    """Return an array's shape and type for an error message, or its text if it is text."""
    return repr(str(array)) if array.shape == () and array.dtype.kind == "U" else f"{list(array.shape)} {array.dtype}"
