"""Shown: a finished picture in more than 8 bits, computed from its float32 colours and its background."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from clpeel.checks import Background
from clpeel.errors import InputError
from clpeel.pictures.background import rows_of
from clpeel.pictures.over import straight
from clpeel.scene.textures import linear, srgb

STRIP_PIXELS = 1 << 18
"""How many pixels are computed at once. This bounds the memory that float64 takes besides the picture."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A finished picture.

    image: uint8 [height, width, 4], straight alpha, row 0 on top. color: float32 [height, width, 4], premultiplied,
    without the background, as Result.color; or None. background: None if the picture is transparent. as_light: whether
    colours were blended as linear light. maps: [height, width] or [height, width, 3], by name, to write beside the
    colours where the format can.
    """

    image: NDArray[np.uint8]
    color: NDArray[np.float32] | None
    background: Background | None = None
    as_light: bool = False
    maps: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def transparent(self) -> bool:
        """Whether a pixel lets a background through."""
        return bool((self.image[..., 3] < 255).any())

    def levels(self) -> NDArray[np.uint16]:
        """Return the picture in 16 bits, each rounded once, halves up: uint16 [height, width, 4], straight alpha."""
        return self._converted(np.uint16, lambda shown: np.floor(np.clip(shown, 0, 1) * 65535 + 0.5))

    def numbers(self) -> NDArray[np.float32]:
        """Return the picture as sRGB values, 0..1 unless colours are brighter: float32 [height, width, 4], straight."""
        return self._converted(np.float32, lambda shown: shown)

    def light(self, dtype: DTypeLike) -> NDArray[Any]:
        """Return the picture as linear light, premultiplied: [height, width, 4] of that dtype."""

        def lit(shown: NDArray[np.float64]) -> NDArray[np.float64]:
            rgb, alpha = shown[..., :3], shown[..., 3:]
            return np.concatenate([linear(rgb) * alpha, alpha], axis=-1)

        return self._converted(dtype, lit)

    def _converted(
        self, dtype: DTypeLike, convert: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[Any]:
        found = np.empty(self.image.shape, dtype)
        for top, shown in self._strips():
            with np.errstate(over="ignore"):  # what half floats cannot hold becomes infinite
                found[top : top + len(shown)] = convert(shown)
        return found

    def _strips(self) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Yield the picture in strips: its first row, and float64 [rows, width, 4], sRGB with straight alpha.

        What was drawn over the finished image alone, such as axes and scale bars, has 8 bits. It is found by comparing:
        there, the image is further from its colours than rounding would be.
        """
        if self.color is None:
            raise InputError("color: expected a result rendered with keep_color=True for this file, got False")
        height, width = self.image.shape[:2]
        rows = max(STRIP_PIXELS // width, 1)
        behind = None if self.background is None else rows_of(self.background, height)
        for top in range(0, height, rows):
            part = slice(top, top + rows)
            shown = over(self.color[part].astype(np.float64), None if behind is None else behind[part], self.as_light)
            image = self.image[part]
            steps = np.clip(np.floor(np.clip(shown, 0, 1) * 255 + 0.5), 0, 255)
            apart = (np.abs(steps - image) > 1).any(axis=-1)
            shown[apart] = image[apart] / 255
            yield top, shown


def over(color: NDArray[np.float64], background: NDArray[np.float64] | None, as_light: bool) -> NDArray[np.float64]:
    """Return premultiplied colours [h, w, 4] over the background [h, 1, 3] as straight ones: float64 [h, w, 4].

    background: None for none. as_light: whether colours add up as linear light. They are sRGB here all the same.
    """
    rgb, alpha = color[..., :3], color[..., 3:]
    if background is None:
        return np.concatenate([straight(rgb, alpha), alpha], axis=-1)
    opaque = np.ones_like(alpha)
    if not as_light:
        return np.concatenate([rgb + (1 - alpha) * background, opaque], axis=-1)
    light = alpha * linear(straight(rgb, alpha)) + (1 - alpha) * linear(background)
    return np.concatenate([srgb(light), opaque], axis=-1)
