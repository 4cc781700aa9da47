"""PNG: pictures of 8 and of 16 bits a channel as the bytes of files."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.pictures.provenance import KEY, Provenance, software_of, text_of

STEP = 1 / 255
"""The step between neighbouring 8-bit values. Colours that differ by at most this are at most one step apart once
rounded."""

_HEADER = 33
"""How many bytes come before a PNG's second chunk."""


def encode_png(image: NDArray[np.uint8], provenance: Provenance | None = None) -> bytes:
    """Return uint8 [height, width, 4] as the bytes of a PNG, without an alpha channel if every pixel is opaque.

    provenance: how the picture was made, if the file is to say it.
    """
    opaque = bool((image[..., 3] == 255).all())
    return encode_levels(image[..., :3] if opaque else image, provenance)


def encode_levels(levels: NDArray[Any], provenance: Provenance | None = None) -> bytes:
    """Return what Pillow has a mode for, such as uint16 [height, width] or uint8 [height, width, 3], as a PNG's bytes.

    provenance: as for encode_png.
    """
    from PIL import Image, PngImagePlugin

    words = PngImagePlugin.PngInfo()
    for keyword, text in _words(provenance).items():
        words.add_text(keyword, text)
    data = io.BytesIO()
    Image.fromarray(levels).save(data, "PNG", compress_level=4, pnginfo=words)
    return data.getvalue()


def encode_png16(levels: NDArray[np.uint16], provenance: Provenance | None = None) -> bytes:
    """Return uint16 [height, width, 4] as the bytes of a PNG of 16 bits, as encode_png does."""
    import png

    pixels = levels[..., :3] if bool((levels[..., 3] == 65535).all()) else levels
    height, width, channels = pixels.shape
    data = io.BytesIO()
    writer = png.Writer(width, height, greyscale=False, alpha=channels == 4, bitdepth=16, compression=4)
    writer.write_packed(data, (row.tobytes() for row in pixels.astype(">u2")))
    chunks = io.BytesIO()
    for keyword, text in _words(provenance).items():
        png.write_chunk(chunks, b"tEXt", f"{keyword}\0{text}".encode("latin-1"))
    whole = data.getvalue()
    return whole[:_HEADER] + chunks.getvalue() + whole[_HEADER:]


def _words(provenance: Provenance | None) -> dict[str, str]:
    """Return the texts that say how a picture was made, by their keywords."""
    return {} if provenance is None else {"Software": software_of(provenance), KEY: text_of(provenance)}
