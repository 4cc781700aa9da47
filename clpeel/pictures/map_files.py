"""Maps as files: arrays of numbers as they are, or as grey levels whose meaning a line tells."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.pictures import formats
from clpeel.pictures.encode import encode_npz, encode_tiff
from clpeel.pictures.exr import channels_of, encode_exr
from clpeel.pictures.formats import Chosen
from clpeel.pictures.png import encode_levels
from clpeel.pictures.provenance import Provenance

MOST = 65535
"""The greatest of 16 bits."""

SHARES = ("transmittance", "error_bound", "unpaired")
"""Maps whose numbers are 0..1."""


def encode_map(
    name: str, values: NDArray[Any], chosen: Chosen, provenance: Provenance | None = None
) -> tuple[bytes, str | None]:
    """Return a map [height, width] or [height, width, 3] as the bytes of a file, and a line on what its numbers mean.

    The line is None if they are those of the map. provenance: what the file says of how it was made, or None. A .npy
    file has no place for it. Raises InputError if the format cannot hold the numbers.
    """
    if chosen.format.name == formats.PNG.name:
        levels, note = grey_levels(name, values)
        words = provenance if provenance is None or note is None else {**provenance, "levels": note}
        return encode_levels(levels, words), note
    if chosen.format.name == formats.EXR.name:
        return encode_exr(channels_of({name: values}), provenance), None
    if chosen.format.name == formats.TIFF.name:
        return encode_tiff(values.astype(np.uint8) if values.dtype.kind == "b" else values, provenance), None
    if chosen.format.name == formats.NPZ.name:
        return encode_npz({name: values}, provenance), None
    data = io.BytesIO()
    np.save(data, values, allow_pickle=False)
    return data.getvalue(), None


def grey_levels(name: str, values: NDArray[Any]) -> tuple[NDArray[Any], str | None]:
    """Return a map as the levels of a grey picture, uint16 [height, width], and a line on what they stand for.

    Normals become colours, uint8 [height, width, 3]. Raises InputError if whole numbers are too large.
    """
    if name == "normal":
        there = (values != 0).any(axis=-1, keepdims=True)
        levels = np.where(there, np.floor(np.clip(values / 2 + 0.5, 0, 1) * 255 + 0.5), 0)
        return levels.astype(np.uint8), f"{name}: 0 is -1, 255 is 1; black where there is no face"
    if name == "triangle":
        most = int(values.max()) + 1
        if most > MOST:
            raise InputError(f"{name}: expected at most {MOST - 1} in a PNG, got {most - 1}; write .npy, .exr or .tif")
        return (values + 1).astype(np.uint16), f"{name}: 0 is none, n + 1 is face n"
    if name in SHARES:
        return _scaled(values, 1.0), f"{name}: 0 is 0, {MOST} is 1"
    if name == "depth":
        return _depths(values)
    greatest = float(values.max(initial=0))
    if name == "layer_count" and greatest <= MOST and (values == np.floor(values)).all():
        return values.astype(np.uint16), None
    return _scaled(values, greatest or 1.0), f"{name}: 0 is 0, {MOST} is {greatest or 1.0!r}"


def _depths(values: NDArray[Any]) -> tuple[NDArray[np.uint16], str]:
    """Return distances as levels from 1 on, with 0 where nothing is, and the line."""
    there = np.isfinite(values)
    if not there.any():
        return np.zeros(values.shape, np.uint16), "depth: 0 is none, and nothing else is there"
    low, high = (float(end) for end in (values[there].min(), values[there].max()))
    levels = np.where(there, 1 + np.floor((values - low) / ((high - low) or 1.0) * (MOST - 1) + 0.5), 0)
    return levels.astype(np.uint16), f"depth: 0 is none, 1 is {low!r}, {MOST} is {high!r} scene units"


def _scaled(values: NDArray[Any], high: float) -> NDArray[np.uint16]:
    share = np.clip(values.astype(np.float64) / high, 0, 1)
    return np.floor(share * MOST + 0.5).astype(np.uint16)
