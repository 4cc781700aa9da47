"""Images: the bytes of a picture file as the texels of a Texture."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import numpy as np

from clpeel.reading.reader_log import collected
from clpeel.reading.signatures import looks_like
from clpeel.reading.words import one_line
from clpeel.scene.arrays import AnyArray
from clpeel.scene.images import MOST_TEXELS
from clpeel.scene.textures import Texture, as_rgba

_FORMATS = "PNG JPEG WEBP AVIF GIF BMP DDS TIFF JPEG2000 PCX PPM PSD SGI TGA".split()
"""Pillow's names of the formats that are read. Pillow would hand some others, such as EPS, to another program.

TGA is the last one, as any bytes may begin such a file.
"""

_KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"

_TRANSCODER = "opengl_basisu"
_LACKING = f"a KTX2 image, which the package {_TRANSCODER} reads; run: pip install 'clpeel[formats]'"

_MOST_DEEP = 1 << 26
"""The most texels of an image with 16 bits a channel: they take four times the memory of 8 bits."""

_STEPS = {"1": 255, "L;2": 85, "L;4": 17}
"""By Pillow's name of how greys of few bits are packed, how far apart they are once Pillow has unpacked them."""


class _Unusable(ValueError):
    """Why a picture is not read, though it may be whole."""


def texels(data: bytes, colors: bool = True) -> AnyArray:
    """Return the texels of a picture file, [height, width, 4] as in Texture: uint8, or float32 for 16 bits a channel.

    colors: whether the texels are colours, which are sRGB in files. Otherwise they are numbers, and stay as they are.
    Colour profiles and the orientation that a camera notes are ignored, as glTF asks. Of several frames, the first
    counts. Raises ValueError, with the reason in words for a note, if the bytes are not a picture that can be read.
    """
    with _in_words():
        return _transcoded(data) if data.startswith(_KTX2) else _pixels(_opened(data), data, colors)


def check_picture(data: bytes) -> None:
    """Raise ValueError, as texels does, unless the bytes begin as a picture that can be read. No pixel is decoded."""
    with _in_words():
        if not data.startswith(_KTX2):
            _opened(data)
        elif find_spec(_TRANSCODER) is None:
            raise _Unusable(_LACKING)


@contextmanager
def _in_words() -> Iterator[None]:
    """Turn any error inside into a ValueError that gives the reason in words. This thread's warnings end here."""
    with collected():
        try:
            yield
        except _Unusable:
            raise
        except Exception as error:  # a decoder may raise anything on a broken image
            raise ValueError(f"the image is damaged ({one_line(error)})") from None


def _opened(data: bytes) -> Any:
    """Return a Pillow image whose pixels are still to be decoded. Raises _Unusable if there is none, or a large one.

    Image.open has a limit of its own for the number of pixels. It is one for the whole process, and so not ours to set.
    """
    from PIL import Image

    Image.preinit()  # this loads the plugins of common formats alone, as all of them take time
    image = _first(data, Image.OPEN)
    if image is None:
        Image.init()
        image = _first(data, Image.OPEN)
    if image is None:
        raise _Unusable(f"expected an image, got {looks_like(data)}")
    _check_size(image.width, image.height, deep=_deep(image))
    return image


def _first(data: bytes, plugins: dict[str, Any]) -> Any:
    """Return the image that the first of Pillow's plugins makes which knows these bytes, or None if none does."""
    for name in _FORMATS:
        if name not in plugins:
            continue
        factory, accepts = plugins[name]
        known = accepts(data[:16]) if accepts else True
        if isinstance(known, str):  # why this Pillow has no decoder
            raise _Unusable(known)
        if known:
            try:
                return factory(io.BytesIO(data), "")
            except Exception:
                if accepts:
                    raise
    return None


def _check_size(width: int, height: int, deep: bool = False) -> None:
    """Raise _Unusable if an image of this size is not read. A small file may promise a large image."""
    if max(width, height) > MOST_TEXELS:
        most = f"{MOST_TEXELS:,} x {MOST_TEXELS:,}"
    elif deep and width * height > _MOST_DEEP:
        most = f"{_MOST_DEEP:,} of 16 bits a channel"
    else:
        return
    raise _Unusable(f"too large, {width:,} x {height:,} texels; at most {most} are read")


def _packing(image: Any) -> str:
    """Return Pillow's name of how a PNG image's pixels are packed, or "" for other formats."""
    return str(image.tile[0][3]) if image.format == "PNG" and image.tile else ""


def _deep(image: Any) -> bool:
    """Return whether an open image has more than 8 bits a channel, and Pillow can give them."""
    return _packing(image).endswith(";16B") or image.mode[0] in "IF"


def _pixels(image: Any, data: bytes, colors: bool) -> AnyArray:
    """Return the texels of an open image. Raises _Unusable, and what Pillow's decoders raise."""
    if _deep(image):
        deep = _sixteen_bits(image, data)
        return Texture.of(deep).image if colors else as_rgba(deep) / np.float32(65535)
    step = _STEPS.get(_packing(image))
    if step and "transparency" in image.info:  # Pillow would compare a grey that it has unpacked with a packed one
        image.info["transparency"] = min(image.info["transparency"] * step, 255)
    return np.asarray(image if image.mode == "RGBA" else image.convert("RGBA"))


# --- 16 bits a channel ------------------------------------------------------------------------------------------------


def _sixteen_bits(image: Any, data: bytes) -> AnyArray:
    """Return the channels of an image of 16 bits, uint16 [height, width, 1 to 4], with its transparent colour.

    Pillow has such numbers for greys alone. Of colours, it unpacks one byte of each number: here the upper ones, then
    the lower ones. Grey with alpha is unpacked as if it were four channels.
    """
    packing = _packing(image)
    if packing.startswith("RGB"):
        upper, lower = _unpacked(image, packing), _unpacked(_opened(data), packing.replace("16B", "16L"))
        values: AnyArray = upper.astype(np.uint16) << 8 | lower
    elif packing.startswith("LA"):
        values = _unpacked(image, "RGBA").view(">u2")
    else:
        greys = np.asarray(image)
        if greys.dtype.kind == "f" or greys.min() < 0 or greys.max() > 65535:
            raise _Unusable("expected 8 or 16 bits a channel, got 32")
        values = greys.astype(np.uint16)[..., None]
    key = image.info.get("transparency")
    if key is None:
        return values
    alpha = (values != np.array(key)).any(axis=2, keepdims=True) * np.uint16(65535)
    return np.concatenate([values, alpha], axis=2)


def _unpacked(image: Any, packing: str) -> AnyArray:
    """Return what Pillow makes of an image's bytes, uint8 [height, width, channels], if they were packed like this."""
    image.tile = [(*tile[:3], packing) for tile in image.tile]
    return np.asarray(image)


# --- KTX2 -------------------------------------------------------------------------------------------------------------


def _transcoded(data: bytes) -> AnyArray:
    """Return the texels of a KTX2 image of Basis Universal. Raises _Unusable, and what its decoder raises."""
    try:
        import opengl_basisu
    except ImportError:
        raise _Unusable(_LACKING) from None
    return np.asarray(opengl_basisu.open(data).transcode("rgba8").data)  # it refuses more than 16,384 texels a side
