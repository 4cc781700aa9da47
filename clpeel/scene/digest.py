"""Digest: a number that tells scenes apart, made of all that is drawn of them."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

import numpy as np

from clpeel.errors import InputError

LEFT_OUT = ("notes", "vertex_arrays", "face_arrays")
"""Fields of a Scene that no picture shows."""


def digest(scene: Any) -> str:
    """Return the SHA-256 of a scene, in 64 hexadecimal digits: of its arrays, colours, materials, textures and lights.

    Textures that are not decoded yet are decoded for it. One that cannot be decoded counts as none.
    """
    found = hashlib.sha256()
    for each in dataclasses.fields(scene):
        if each.name not in LEFT_OUT:
            found.update(f"{each.name}:".encode())
            _feed(found, getattr(scene, each.name))
    return found.hexdigest()


def _feed(found: Any, value: Any) -> None:
    """Add a value to the sum. Before each stands what kind it is, so that no two values give the same bytes."""
    if isinstance(value, np.ndarray):
        found.update(f"{value.dtype.str}{list(value.shape)}".encode())
        found.update(np.ascontiguousarray(value).reshape(-1).view(np.uint8))
    elif dataclasses.is_dataclass(value):
        found.update(f"{type(value).__name__}(".encode())
        for each in dataclasses.fields(value):
            found.update(f"{each.name}=".encode())
            _feed(found, _of(value, each.name))
        found.update(b")")
    elif isinstance(value, tuple | list):
        found.update(f"{len(value)}[".encode())
        for each in value:
            _feed(found, each)
    elif isinstance(value, bool | int | float | np.number):
        found.update(f"{float(value)!r};".encode())
    else:
        text = value if isinstance(value, str) else type(value).__name__
        found.update(f"{len(text)}'{text}".encode())


def _of(owner: Any, name: str) -> Any:
    """Return a field, or None if it is an image that cannot be decoded."""
    try:
        return getattr(owner, name)
    except InputError:
        return None
