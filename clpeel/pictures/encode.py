"""Encoding: turns a finished picture into the bytes of a file of each format."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.pictures import formats
from clpeel.pictures.formats import Chosen, check_holds
from clpeel.pictures.png import encode_png, encode_png16
from clpeel.pictures.provenance import DESCRIPTION, NPZ_KEY, SOFTWARE, Provenance, software_of, text_of
from clpeel.pictures.shown import Shown

if TYPE_CHECKING:
    from PIL import Image

QUALITY = 95
"""Of JPEG, as Pillow counts. Colours are not subsampled: edges of thin transparent surfaces would fray."""


def encode(shown: Shown, chosen: Chosen, provenance: Provenance | None = None) -> bytes:
    """Return a picture as the bytes of a file.

    provenance: how the picture was made, if the file is to say it. Raises InputError if the format cannot hold the
    picture, or if it needs the colours of a result that has none.
    """
    height, width = shown.image.shape[:2]
    check_holds(chosen.format, (width, height), shown.transparent)
    return _ENCODERS[chosen.format.name](shown, chosen.bits, provenance)


def _png(shown: Shown, bits: int, provenance: Provenance | None) -> bytes:
    return encode_png(shown.image, provenance) if bits == 8 else encode_png16(shown.levels(), provenance)


def _jpeg(shown: Shown, bits: int, provenance: Provenance | None) -> bytes:
    return _by_pillow(shown, "JPEG", provenance, quality=QUALITY, subsampling=0)


def _webp(shown: Shown, bits: int, provenance: Provenance | None) -> bytes:
    # Without `exact`, colours of pixels with alpha 0 change. Greater effort takes ten times as long for a fifth less.
    return _by_pillow(shown, "WEBP", provenance, lossless=True, exact=True, quality=20, method=0)


def _by_pillow(shown: Shown, name: str, provenance: Provenance | None, **options: Any) -> bytes:
    """Return the 8-bit picture as Pillow writes it."""
    data = io.BytesIO()
    if provenance is not None:
        options["exif"] = _exif(provenance)
    _image(shown).save(data, name, **options)
    return data.getvalue()


def _image(shown: Shown) -> Image.Image:
    from PIL import Image

    return Image.fromarray(shown.image if shown.transparent else np.ascontiguousarray(shown.image[..., :3]))


def _exif(provenance: Provenance) -> Image.Exif:
    from PIL import Image

    found = Image.Exif()
    found[SOFTWARE], found[DESCRIPTION] = software_of(provenance), text_of(provenance)
    return found


def _tiff(shown: Shown, bits: int, provenance: Provenance | None) -> bytes:
    if bits == 8:
        tags = {} if provenance is None else {SOFTWARE: software_of(provenance), DESCRIPTION: text_of(provenance)}
        data = io.BytesIO()
        _image(shown).save(data, "TIFF", compression="tiff_adobe_deflate", tiffinfo=tags)
        return data.getvalue()
    pixels: NDArray[Any] = shown.levels() if bits == 16 else shown.numbers()
    return encode_tiff(pixels if shown.transparent else pixels[..., :3], provenance)


def encode_tiff(pixels: NDArray[Any], provenance: Provenance | None = None) -> bytes:
    """Return pixels [height, width], [height, width, 3] or [height, width, 4] as the bytes of a TIFF of their type."""
    import tifffile

    words: dict[str, Any] = {"software": False, "metadata": None}
    if provenance is not None:
        words |= {"software": software_of(provenance), "description": text_of(provenance)}
    colors = pixels.ndim == 3
    data = io.BytesIO()
    tifffile.imwrite(
        data,
        np.ascontiguousarray(pixels),
        photometric="rgb" if colors else "minisblack",
        extrasamples=["unassalpha"] if colors and pixels.shape[2] == 4 else None,
        compression="zlib",
        compressionargs={"level": 4},
        **words,
    )
    return data.getvalue()


def _exr(shown: Shown, bits: int, provenance: Provenance | None) -> bytes:
    from clpeel.pictures.exr import channels_of, encode_exr

    light = shown.light(np.float16 if bits == 16 else np.float32)
    if not np.isfinite(light).all():
        raise InputError("output: expected light that half floats hold, at most 65504, got more; give --bit-depth 32")
    return encode_exr({"RGBA": light, **channels_of(shown.maps)}, provenance)


def _npz(shown: Shown, bits: int, provenance: Provenance | None) -> bytes:
    if shown.color is None:
        raise InputError("color: expected a result rendered with keep_color=True for this file, got False")
    return encode_npz({"image": shown.image, "color": shown.color, **shown.maps}, provenance)


def encode_npz(arrays: dict[str, NDArray[Any]], provenance: Provenance | None = None) -> bytes:
    """Return arrays by name as the bytes of a file that numpy.load reads."""
    named: dict[str, Any] = dict(arrays)
    if provenance is not None:
        named[NPZ_KEY] = np.array(text_of(provenance))
    data = io.BytesIO()
    np.savez(data, **named)
    return data.getvalue()


_ENCODERS: dict[str, Callable[[Shown, int, Provenance | None], bytes]] = {
    formats.PNG.name: _png,
    formats.JPEG.name: _jpeg,
    formats.WEBP.name: _webp,
    formats.TIFF.name: _tiff,
    formats.EXR.name: _exr,
    formats.NPZ.name: _npz,
}
