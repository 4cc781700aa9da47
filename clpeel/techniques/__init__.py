"""The techniques: one module each, and the one registry that every menu, test and table goes through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pyopencl as cl

from clpeel.device import Gpu
from clpeel.errors import InputError
from clpeel.raster import Fragments
from clpeel.techniques import sort


@dataclass(frozen=True)
class Technique:
    """resolve: fills its pixels of a batch's layer (float32 [tiles, TILE_PIXELS, 4], premultiplied colour and the
    transmittance behind it) from a window's fragments; fragment_bytes: what it needs for each besides the fragment."""

    summary: str
    resolve: Callable[[Gpu, Fragments, cl.Buffer], None]
    fragment_bytes: int
    passes: int  # geometry passes, as the paper counts them
    exact: bool
    options: tuple[str, ...] = ()  # of `render`, that it has besides those of all techniques


TECHNIQUES: dict[str, Technique] = {
    "sort": Technique(sort.SUMMARY, sort.resolve, sort.SCRATCH_BYTES, passes=1, exact=True),
}


def technique(name: str) -> Technique:
    """The technique of that name. Raises InputError, which lists those there are."""
    if name not in TECHNIQUES:
        raise InputError(f"technique: expected one of {', '.join(TECHNIQUES)}; got {name!r}")
    return TECHNIQUES[name]
