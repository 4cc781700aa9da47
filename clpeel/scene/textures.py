"""Textures: pictures that colours come from, how they are sampled, and sRGB. The kernels sample them (textures.h)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.checks import one_of
from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray, as_float, checked_color
from clpeel.scene.images import ImageField, LateImage, check_image

Wrap = Literal["repeat", "mirror", "clamp"]
WRAPS: tuple[Wrap, ...] = get_args(Wrap)
"""What is beyond 0..1: the image again, the image mirrored each time, or its outermost texels."""

Magnify = Literal["nearest", "linear"]
Minify = Literal[
    "nearest",
    "linear",
    "nearest-mipmap-nearest",
    "linear-mipmap-nearest",
    "nearest-mipmap-linear",
    "linear-mipmap-linear",
]
MAGNIFY: tuple[Magnify, ...] = get_args(Magnify)
MINIFY: tuple[Minify, ...] = get_args(Minify)
"""The filters of OpenGL and glTF 2.0 (sampler.magFilter and sampler.minFilter) in words. Before the hyphen: the filter
within a level of the mip map; behind it: between levels.
"""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture that the colours of faces come from, or numbers for lights, and how it is sampled.

    image: [height, width, 4], straight RGBA, row 0 on top, where v is 0 (as in glTF). uint8 0..255 or float32 0..1.
    Where it is uint8, red, green and blue are sRGB and are decoded before they are filtered. Where it is float32, they
    are linear: this is for files with 16 bits a channel. Alpha is linear in both. Where the texels are numbers (Finish
    says of which textures), nothing is sRGB: the numbers are uint8 / 255, or float32 as they are.
    A LateImage is decoded when the image is first asked for, which then raises InputError if that cannot be done.
    wrap: what is beyond 0..1, along u and along v. magnify, minify: the filters (MINIFY).

    Raises InputError if the image or a word is none of these.
    """

    image: ImageField = ImageField()
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    magnify: Magnify = "linear"
    minify: Minify = "linear-mipmap-linear"

    def __post_init__(self) -> None:
        if not isinstance(vars(self)["image"], LateImage):
            check_image(self.image)
        for each in self.wrap:
            one_of("wrap", each, WRAPS)
        one_of("magnify", self.magnify, MAGNIFY)
        one_of("minify", self.minify, MINIFY)

    def __repr__(self) -> str:
        """Return the fields as any dataclass does, but decode nothing."""
        return f"Texture({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"

    @staticmethod
    def of(
        image: ArrayLike,
        wrap: tuple[Wrap, Wrap] = ("repeat", "repeat"),
        magnify: Magnify = "linear",
        minify: Minify = "linear-mipmap-linear",
    ) -> Texture:
        """Return a texture of an array or a Pillow image, whatever its channels are.

        image: [height, width], or [height, width, 1 to 4]: grey, grey and alpha, RGB or RGBA; uint8, uint16, or floats
        0..1, all of them sRGB as in picture files. Raises InputError for anything else.
        """
        rgba = as_rgba(image)
        if rgba.dtype.kind == "f":
            rgba = np.concatenate([linear(rgba[..., :3]), rgba[..., 3:]], axis=2).astype(np.float32)
        elif rgba.dtype != np.uint8:  # a table takes a fraction of the time and the memory
            table = linear(np.arange(65536) / 65535).astype(np.float32)
            rgba = np.concatenate([table[rgba[..., :3]], rgba[..., 3:] / np.float32(65535)], axis=2)
        return Texture(rgba, wrap, magnify, minify)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.image.shape[1], self.image.shape[0]

    @property
    def mipmapped(self) -> bool:
        """Whether the minifying filter wants smaller copies of the image."""
        return "mipmap" in self.minify


def as_rgba(image: ArrayLike) -> AnyArray:
    """Return an image's channels as four, [height, width, 4], of the same type. See Texture.of."""
    given = np.asarray(image)
    values = given[..., None] if given.ndim == 2 else given
    if values.ndim != 3 or not 1 <= values.shape[2] <= 4 or values.dtype.kind not in "uf" or 0 in values.shape:
        raise InputError(
            f"image: expected [height, width, 1 to 4] of uint8, uint16 or floats, got {list(given.shape)} {given.dtype}"
        )
    if values.dtype.kind == "u" and values.dtype.itemsize > 2:
        raise InputError(f"image: expected uint8, uint16 or floats 0..1, got {values.dtype}")
    one = 1.0 if values.dtype.kind == "f" else np.iinfo(values.dtype).max
    if values.dtype.kind == "f" and not (values.min() >= 0 and values.max() <= 1):
        raise InputError(f"image: expected floats 0..1, got {values.min()} to {values.max()}")
    rgba = np.full((*values.shape[:2], 4), one, values.dtype)
    channels = values.shape[2]
    rgba[..., :3] = values[..., :3] if channels >= 3 else values[..., :1]
    if channels in (2, 4):
        rgba[..., 3] = values[..., -1]
    return rgba


# --- sRGB -------------------------------------------------------------------------------------------------------------


def linear(values: ArrayLike) -> NDArray[np.float64]:
    """Return sRGB values 0..1 as linear light 0..1 (IEC 61966-2-1)."""
    given = np.asarray(values, np.float64)
    return np.where(given <= 0.04045, given / 12.92, ((np.maximum(given, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_color(name: str, text: str) -> tuple[float, float, float, float]:
    """Return a colour that is text, such as "gold" or "#rrggbbaa", as linear RGBA 0..1. Raises InputError.

    name: what the error calls it.
    """
    color = as_float(checked_color(name, text))
    red, green, blue = (float(value) for value in linear(color[:3]))
    return red, green, blue, float(color[3]) if len(color) == 4 else 1.0


def srgb(values: ArrayLike) -> NDArray[np.float64]:
    """Return linear light 0..1 as sRGB values 0..1 (IEC 61966-2-1)."""
    given = np.asarray(values, np.float64)
    return np.where(given <= 0.0031308, given * 12.92, 1.055 * np.maximum(given, 0.0) ** (1 / 2.4) - 0.055)


@cache
def linear_of_bytes() -> NDArray[np.float32]:
    """Return the linear light of each byte of sRGB: float32 [256]."""
    table: NDArray[np.float32] = linear(np.arange(256) / 255).astype(np.float32)
    table.flags.writeable = False
    return table
