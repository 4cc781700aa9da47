"""Recipes: a short text for all that a film's frames depend on, so that no frame of another film is taken for one."""

from __future__ import annotations

import hashlib
import os
import pickle
from dataclasses import fields, is_dataclass
from typing import Any


class _Sum:
    """A file that keeps nothing of what is written to it but a digest."""

    def __init__(self) -> None:
        self.digest = hashlib.blake2b(digest_size=16)

    def write(self, data: Any) -> int:
        view = memoryview(data)  # of bytes, or of an array
        self.digest.update(view)
        return view.nbytes


class _Pickler(pickle.Pickler):
    """Pickles dataclasses by their fields alone, as what they have computed from these, and kept, comes and goes."""

    def reducer_override(self, thing: Any) -> Any:
        if isinstance(thing, type) or not is_dataclass(thing):
            return NotImplemented
        held = vars(thing)
        return type(thing), tuple(held[each.name] for each in fields(thing))


def recipe_of(*parts: Any) -> str:
    """Return the digest of anything that can be pickled: scenes, cameras, options. It is the same in every process.

    Parts that cannot be pickled have a digest that is never the same again.
    """
    found = _Sum()
    try:
        _Pickler(found, protocol=5).dump(parts)
    except (pickle.PicklingError, AttributeError, TypeError):  # which of these, is up to the part
        return os.urandom(16).hex()
    return found.digest.hexdigest()
