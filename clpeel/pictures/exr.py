"""OpenEXR: pictures, maps and deep pictures as files, by the package OpenEXR."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.pictures.provenance import KEY, Provenance, software_of, text_of
from clpeel.scene.textures import linear

if TYPE_CHECKING:
    from clpeel.pictures.layers import Layers

NAMES = {"depth": "Z", "triangle": "id"}
"""What OpenEXR calls maps. Others keep their names, and a map of three numbers has .X, .Y and .Z behind it."""

NO_TRIANGLE = 0xFFFFFFFF
"""What a channel of triangles has where there is none. Its numbers have no sign."""


def encode_exr(channels: Mapping[str, NDArray[Any]], provenance: Provenance | None = None) -> bytes:
    """Return channels [height, width] as the bytes of an OpenEXR file. Each keeps its type: float16, float32, uint32.

    A channel "RGBA" is [height, width, 4]. provenance: how the picture was made, if the file is to say it.
    """
    import OpenEXR

    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **_words(provenance)}
    return _written(header, {name: np.ascontiguousarray(channel) for name, channel in channels.items()})


def channels_of(maps: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return maps by name as channels: float32, or uint32 where they have whole numbers.

    Raises InputError if float32 cannot hold a map's numbers.
    """
    found: dict[str, NDArray[Any]] = {}
    for name, values in maps.items():
        channel = NAMES.get(name, name)
        if values.ndim == 3:
            found.update({f"{channel}.{axis}": as_float32(name, values[..., k]) for k, axis in enumerate("XYZ")})
        elif values.dtype.kind in "iub":
            found[channel] = values.astype(np.uint32)  # -1 becomes NO_TRIANGLE
        else:
            found[channel] = as_float32(name, values)
    return found


def as_float32(name: str, values: NDArray[Any]) -> NDArray[np.float32]:
    """Return numbers as float32. Raises InputError if that loses more than half a step of any of them."""
    with np.errstate(over="ignore"):
        found: NDArray[np.float32] = values.astype(np.float32)
    lost = (np.isinf(found) & np.isfinite(values)) | ((values != 0) & (np.abs(found) < np.finfo(np.float32).tiny))
    if values.dtype.itemsize > 4 and lost.any():
        raise InputError(
            f"{name}: expected numbers that float32 holds, got {values[lost].flat[0]:g}; write .npz or .npy"
        )
    return found


def encode_deep(layers: Layers, provenance: Provenance | None = None) -> bytes:
    """Return all layers as the bytes of a deep OpenEXR file: each pixel's samples from front to back.

    R, G, B: float32, linear light, premultiplied. A: float32. Z: float32, the distance along the view axis in scene
    units. id: uint32, the scene's face. Raises InputError if float32 cannot hold the distances.
    """
    import OpenEXR

    alpha = layers.color[:, 3:]
    light = (linear(layers.color[:, :3]) * alpha).astype(np.float32)
    flat = {name: light[:, k] for k, name in enumerate("RGB")}
    flat |= {"A": layers.color[:, 3], "Z": as_float32("depth", layers.depth), "id": layers.triangle.astype(np.uint32)}
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION, **_words(provenance)}
    return _written(header, {name: _by_pixel(layers, np.ascontiguousarray(values)) for name, values in flat.items()})


def _by_pixel(layers: Layers, values: NDArray[Any]) -> NDArray[np.object_]:
    """Return the values of layers [n] as an array of arrays [height, width], None where a pixel has none.

    The first pixel always has one, as OpenEXR takes the type from there if there are no values at all.
    """
    width, height = layers.size
    found = np.empty(height * width, np.object_)
    found[0] = values[:0]
    start = layers.start.tolist()
    for pixel in np.flatnonzero(np.diff(layers.start)).tolist():
        found[pixel] = values[start[pixel] : start[pixel + 1]]
    return found.reshape(height, width)


def _words(provenance: Provenance | None) -> dict[str, str]:
    """Return the attributes that say how a picture was made."""
    return {} if provenance is None else {"software": software_of(provenance), KEY: text_of(provenance)}


def _written(header: dict[str, Any], channels: dict[str, NDArray[Any]]) -> bytes:
    import OpenEXR

    data = io.BytesIO()
    OpenEXR.File(header, channels).write(data)
    return data.getvalue()
