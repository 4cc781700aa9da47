"""Layers: what peeling finds in each pixel, front to back (Everitt 2001; a layered depth image, Shade et al. 1998)."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import MAX_SIDE, GivenBackground, checked_background
from clpeel.errors import InputError
from clpeel.files import checked_file, write_whole
from clpeel.pictures.background import rows_of
from clpeel.pictures.formats import LAYERS, NPZ, Chosen, chosen
from clpeel.pictures.lengths import Lengths
from clpeel.pictures.over import straight
from clpeel.pictures.provenance import NPZ_KEY, Provenance, text_of

FORMAT = 1
"""The format number of the files that `Layers.save` writes."""

_ARRAYS = {"start": (np.int64,), "color": (np.float32,), "depth": (np.float32, np.float64), "triangle": (np.int32,)}
"""The types that each array may have. The first is the usual one."""


@dataclass(frozen=True, eq=False)
class Layers:
    """The layers of every pixel, front to back: a layered depth image (Shade et al. 1998).

    size: (width, height) in pixels.
    start: int64 [height * width + 1]. The layers of the pixel at (row, column), row 0 on top, have the indices
    start[p] : start[p + 1] with p = row * width + column.
    color: float32 [n, 4], straight RGBA 0..1, lit if the picture was lit.
    depth: float32 [n], the distance from the camera along its view axis in scene units. It is float64 if float32 cannot
    hold the distances.
    triangle: int32 [n], the index of the scene's face. Lines are counted behind the faces, and points behind the lines.

    Layers are ordered by (depth, submission). A pixel's layers end with the first opaque one, whose alpha is exactly 1,
    unless it was rendered with opaque="blend". Raises InputError if the arrays do not fit together.
    """

    size: tuple[int, int]
    start: NDArray[np.int64]
    color: NDArray[np.float32]
    depth: Lengths
    triangle: NDArray[np.int32]

    def __post_init__(self) -> None:
        width, height = self.size
        if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
            raise InputError(f"size: expected 1..{MAX_SIDE} pixels a side, got {width} x {height}")
        self._check_shape("start", width * height + 1)
        if self.start[0] != 0 or (self.start[1:] < self.start[:-1]).any():
            raise InputError("start: expected numbers that rise from 0, got others")
        n = int(self.start[-1])
        self._check_shape("color", n, 4)
        self._check_shape("depth", n)
        self._check_shape("triangle", n)
        if not np.isfinite(self.color).all():
            raise InputError("color: expected finite numbers, got NaN or infinity")
        if n and self.triangle.min() < 0:
            raise InputError(f"triangle: expected faces from 0 on, got {self.triangle.min()}")
        first = np.zeros(n + 1, bool)
        first[self.start] = True
        # A comparison with NaN is false, so NaN fails the order test, except as a pixel's only layer. Hence the test
        # for NaN.
        if np.isnan(self.depth).any() or not ((self.depth[1:] >= self.depth[:-1]) | first[1:-1]).all():
            raise InputError("depth: expected each pixel's front to back, got another order")

    def _check_shape(self, name: str, *shape: int) -> None:
        array, types = getattr(self, name), [np.dtype(dtype) for dtype in _ARRAYS[name]]
        if array.shape != shape or array.dtype not in types:
            raise InputError(f"{name}: expected {types[0]} {list(shape)}, got {array.dtype} {list(array.shape)}")

    @cached_property
    def count(self) -> int:
        """The most layers that a pixel has."""
        return int(np.diff(self.start).max())

    def layer(self, k: int) -> tuple[NDArray[np.float32], Lengths, NDArray[np.int32]]:
        """Return the k-th layer of all pixels, where 0 is the foremost: what peeling finds in its k-th pass.

        Returns color, depth and triangle. color: float32 [height, width, 4], straight, zeros where a pixel has no such
        layer. depth: float32 (or float64, as `depth`) [height, width], infinite there. triangle: int32 [height, width],
        -1 there. Raises InputError if no pixel has such a layer.
        """
        if not 0 <= k < self.count:
            there = f"0..{self.count - 1}" if self.count else "none, as no pixel has a layer"
            raise InputError(f"layer: expected {there}; got {k}")
        width, height = self.size
        pixels = np.flatnonzero(np.diff(self.start) > k)
        places = self.start[pixels] + k
        color = np.zeros((height * width, 4), np.float32)
        depth = np.full(height * width, np.inf, self.depth.dtype)
        triangle = np.full(height * width, -1, np.int32)
        color[pixels], depth[pixels], triangle[pixels] = self.color[places], self.depth[places], self.triangle[places]
        return color.reshape(height, width, 4), depth.reshape(height, width), triangle.reshape(height, width)

    def __len__(self) -> int:
        """Return `count`."""
        return self.count

    def __getitem__(self, k: int) -> tuple[NDArray[np.float32], Lengths, NDArray[np.int32]]:
        """Return `layer(k)`, so that `for color, depth, triangle in layers` goes through the layers front to back."""
        if not -self.count <= k < self.count:
            raise IndexError(k)  # this ends such a loop
        return self.layer(k % self.count)

    def blended(self) -> NDArray[np.float32]:
        """Return the layers blended front to back: float32 [height, width, 4], premultiplied, without the background.

        The float32 operations are the same as the kernels' (blending.h). So if no layer is missing, the bits are those
        of `Result.color` by `sort`, unless that was blended as linear light: layers are colours as they are shown.
        """
        rgb, through = self._blended()
        return np.concatenate([rgb, np.float32(1) - through], axis=-1)

    def _blended(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the premultiplied colour [height, width, 3] and the remaining transmittance [height, width, 1]."""
        width, height = self.size
        rgb = np.zeros((height * width, 3), np.float32)
        through = np.ones((height * width, 1), np.float32)
        count = np.diff(self.start)
        pixels = np.flatnonzero(count)
        for k in range(self.count):
            pixels = pixels[count[pixels] > k]
            source = self.color[self.start[pixels] + k]
            alpha = source[:, 3:]
            rgb[pixels] += through[pixels] * (alpha * source[:, :3])
            through[pixels] *= np.float32(1) - alpha
        return rgb.reshape(height, width, 3), through.reshape(height, width, 1)

    def composite(self, background: GivenBackground = (1, 1, 1)) -> NDArray[np.uint8]:
        """Return the picture made from the layers: uint8 [height, width, 4], row 0 on top.

        background: a colour, a pair (top, bottom), or None for straight alpha. If no layer is missing, the bits are
        those of `Result.image` by `sort` over the same background, as for `blended`. Raises InputError if the
        background is invalid.
        """
        return over_background(*self._blended(), background)

    def picture(self, k: int, background: GivenBackground = (1, 1, 1), keep_alpha: bool = False) -> NDArray[np.uint8]:
        """Return the k-th layer alone, opaque, as in Figure 2 of Bavoil and Myers (2008): uint8 [height, width, 4].

        background: as for `composite`. keep_alpha: show the layer with its own alpha instead. Raises InputError if
        there is no such layer.
        """
        color, _, triangle = self.layer(k)
        alpha = color[..., 3:] if keep_alpha else (triangle >= 0)[..., None].astype(np.float32)
        return over_background(alpha * color[..., :3], np.float32(1) - alpha, background)

    def save(self, path: str | os.PathLike[str], provenance: Provenance | None = None) -> None:
        """Write all layers, whole or not at all: as an .npz file for `load_layers`, or as a deep .exr file.

        If path is a link, its target is written. A deep file has the samples of each pixel from front to back: R, G, B
        (linear light, premultiplied), A, Z (the depth) and id (the triangle). provenance: what the file says of how it
        was made, such as `Result.provenance`.

        Raises InputError if the place cannot be written, if the name ends in anything but .npz or .exr, if the package
        OpenEXR is missing, or if an .exr file cannot hold the depths.
        """
        found = chosen(path, among=LAYERS)
        checked_file(path)  # before any work
        write_whole(path, self.encoded(found, provenance))

    def encoded(self, found: Chosen, provenance: Provenance | None = None) -> bytes | Callable[[IO[bytes]], object]:
        """Return the layers in that format: the bytes of a file, or a function that writes them to an open one."""
        if found.format is not NPZ:
            from clpeel.pictures.exr import encode_deep

            return encode_deep(self, provenance)
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        arrays |= {} if provenance is None else {NPZ_KEY: np.array(text_of(provenance))}
        size = np.array(self.size, np.int32)
        return lambda file: np.savez(file, format=np.int32(FORMAT), size=size, **arrays)


def over_background(
    rgb: NDArray[np.float32], through: NDArray[np.float32], background: GivenBackground
) -> NDArray[np.uint8]:
    """Return premultiplied colour [h, w, 3] and transmittance [h, w, 1] as a picture: uint8 [h, w, 4].

    The operations are those of composite.h, one by one.
    """
    over = checked_background(background)
    alpha = np.ones_like(through)
    if over is not None:
        shown = rgb + through * rows_of(over, len(rgb)).astype(np.float32)
    else:
        alpha = np.maximum(np.float32(1) - through, np.float32(0))
        shown = straight(rgb, alpha)
    levels = np.concatenate([shown, alpha], axis=-1) * np.float32(255) + np.float32(0.5)
    return np.clip(levels, np.float32(0), np.float32(255)).astype(np.uint8)


def load_layers(path: str | os.PathLike[str]) -> Layers:
    """Return the layers that `Layers.save` wrote, bit for bit.

    Raises InputError if there is no such file, or if it is damaged or of another kind.
    """
    name = os.fspath(path)
    try:
        # NumPy leaves a file open that it has opened and cannot read, so it is opened here.
        with open(path, "rb") as opened, np.load(opened, allow_pickle=False) as file:
            found = {key: file[key] for key in ("format", "size", *_ARRAYS)}
    except FileNotFoundError:
        raise InputError(f"{name}: no such file") from None
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror or error}") from None
    except Exception:  # NumPy and zipfile may raise anything on other bytes
        raise InputError(f"{name}: expected layers that clpeel has saved, got another or a damaged file") from None
    version = found.pop("format")
    if version.shape != () or version != FORMAT:
        raise InputError(f"{name}: expected format {FORMAT}, got {version!s:.40}; it may need a newer clpeel")
    size = found.pop("size")
    try:
        if size.shape != (2,) or size.dtype.kind not in "iu":
            raise InputError(f"size: expected 2 whole numbers, got {size.dtype} {list(size.shape)}")
        return Layers((int(size[0]), int(size[1])), **found)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
