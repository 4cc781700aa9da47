"""Images: the texels of a Texture, which are there at once, or are decoded when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray

MOST_TEXELS = 1 << 14
"""The most texels on a side of a texture."""


def check_image(image: Any) -> None:
    """Raise InputError unless this is an image as Texture has it."""
    if not isinstance(image, np.ndarray) or image.ndim != 3 or image.shape[2] != 4 or 0 in image.shape:
        got = f"{list(np.shape(image))} {getattr(image, 'dtype', type(image).__name__)}"
        raise InputError(f"image: expected [height, width, 4], got {got}; see Texture.of")
    if image.dtype not in (np.uint8, np.float32):
        raise InputError(f"image: expected uint8 or float32, got {image.dtype}; see Texture.of")
    if max(image.shape) > MOST_TEXELS:
        raise InputError(
            f"image: expected at most {MOST_TEXELS:,} texels a side, got {image.shape[1]:,} x {image.shape[0]:,}"
        )
    if image.dtype == np.float32 and not (image.min() >= 0 and image.max() <= 1):
        raise InputError(f"image: expected floats 0..1, got {image.min()} to {image.max()}")


class LateImage:
    """An image that is decoded when it is first asked for, and only once, whichever thread asks.

    decode: returns the image as Texture has it, or raises InputError. A copy, and what is pickled, has decode alone. So
    it can be pickled if decode can: a function of a module, or a partial of one.
    """

    def __init__(self, decode: Callable[[], AnyArray]) -> None:
        self._decode, self._lock = decode, Lock()
        self._decoded: AnyArray | None = None

    @property
    def texels(self) -> AnyArray:
        """The image, [height, width, 4]. Raises InputError if it cannot be decoded, or is no image."""
        with self._lock:
            if self._decoded is None:
                image = self._decode()
                check_image(image)
                self._decoded = image
            return self._decoded

    def __reduce__(self) -> tuple[Any, ...]:
        return LateImage, (self._decode,)


class ImageField:
    """The field of Texture that holds its image. It shows the texels of a late one, which are decoded by that.

    A field without a default has no value in the class, so asking the class raises AttributeError.
    """

    def __get__(self, texture: object | None, owner: type | None = None) -> AnyArray:
        if texture is None:
            raise AttributeError("image")
        held: AnyArray | LateImage = vars(texture)["image"]
        return held.texels if isinstance(held, LateImage) else held

    def __set__(self, texture: object, image: AnyArray | LateImage) -> None:
        vars(texture)["image"] = image
