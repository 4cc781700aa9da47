"""Paints: materials of files whose colours are display-referred, and the pictures that they name or hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clpeel.reading.companions import Companions, named
from clpeel.reading.images import texels
from clpeel.scene.arrays import AnyArray
from clpeel.scene.materials import Finish, Material
from clpeel.scene.textures import Texture, linear, srgb


def painted(
    name: str, rgb: Sequence[float], alpha: float, texture: Texture | None, finish: Finish | None = None
) -> Material:
    """Return the Material of a display-referred colour, 0..1 once it is cut off there.

    It is blended if it has texels or an alpha below 1.
    """
    red, green, blue = (float(value) for value in linear(np.clip(np.nan_to_num(rgb), 0, 1)))
    alpha = float(np.clip(np.nan_to_num(alpha, nan=1.0), 0, 1))
    material = Material(name, (red, green, blue, alpha), texture, finish=finish)
    blends = alpha < 1 or material.texel_alphas[0] < 1
    return replace(material, alpha_mode="BLEND") if blends else material


class Pictures:
    """The images that a file names, each decoded once. notes: why some are not there."""

    def __init__(self, companions: Companions) -> None:
        self.companions = companions
        self.notes: list[str] = []
        self._images: dict[str, AnyArray | None] = {}

    def image(self, name: str, held: bytes = b"", colors: bool = True) -> AnyArray | None:
        """Return the texels of an image, or None, after a note, if it cannot be read.

        held: its bytes, if the file holds them. Otherwise it lies beside the file. colors: as for `texels`.
        """
        key = f"{colors} {name}"
        if key not in self._images:
            self._images[key] = None
            try:
                self._images[key] = texels(held or self.companions.get(name), colors)
            except FileNotFoundError:
                self.notes.append(f"texture {named(name)} left out: {self.companions.lost[name]}")
            except ValueError as error:
                self.notes.append(f"texture {named(name)} left out: {error}")
        return self._images[key]


def with_opacities(color: AnyArray | None, mask: AnyArray) -> AnyArray:
    """Return texels, white if there are none, whose alphas are multiplied by what another image says.

    That is its alpha if it has any below 1, else its luminance as stored. Both images get the larger width and height.
    """
    one = 255.0 if mask.dtype == np.uint8 else 1.0
    alpha = mask[..., 3] / one
    if (alpha == 1).all():
        stored = mask[..., :3] / one if mask.dtype == np.uint8 else srgb(mask[..., :3])
        alpha = stored @ np.array([0.2126, 0.7152, 0.0722])
    if color is None:
        color = np.full((*alpha.shape, 4), 255, np.uint8)
    height, width = (max(sides) for sides in zip(alpha.shape, color.shape[:2], strict=True))
    top = 255.0 if color.dtype == np.uint8 else 1.0
    planes = [fitted(color[..., channel] / top, width, height) for channel in range(4)]
    planes[3] = planes[3] * fitted(alpha, width, height)
    image = np.stack(planes, axis=-1)
    return np.rint(image * 255).astype(np.uint8) if top == 255 else image.astype(np.float32)


def fitted(plane: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    """Return one channel [height, width] of an image in this size, interpolated."""
    if plane.shape == (height, width):
        return plane
    from PIL import Image

    image = Image.fromarray(plane.astype(np.float32)).resize((width, height), Image.Resampling.BILINEAR)
    return np.clip(np.asarray(image, np.float64), 0, 1)
