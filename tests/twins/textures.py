"""The float64 twin of textures: sRGB, mip maps, wrapping, filters and the level of detail, in NumPy alone.

Texel (row j, column i) of an image W wide and H high fills i / W .. (i + 1) / W in u, and j / H .. (j + 1) / H in v.
Level 0 of a mip map is the image. All sampling is in linear light. Footprints are per pixel of the sampled picture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

TINY = 1e-30  # texels; what is shorter is a point
LEVEL_OFF = 0.032
"""How far from a byte's half the mip map may round the other way, in bytes.

clpeel adds up light in steps of 1/65535. Each texel is off by half a step, and the mean by an eighth: by 0.625 / 65535,
which is at most 12.92 * 255 times as much of a byte where sRGB is steepest.
"""


class Image(Protocol):
    """What the twin reads of a texture (clpeel.scene.textures.Texture has these fields)."""

    @property
    def image(self) -> NDArray[Any]: ...
    @property
    def wrap(self) -> Any: ...
    @property
    def magnify(self) -> str: ...
    @property
    def minify(self) -> str: ...


@dataclass(frozen=True)
class Footprint:
    """Where samples fall, and how far from pixel to pixel: float64 [n, 2] each, in texture coordinates."""

    uv: Floats
    along_x: Floats
    along_y: Floats


# --- sRGB (IEC 61966-2-1) and what is stored --------------------------------------------------------------------------


def to_linear(values: Any) -> Floats:
    """Light of sRGB values 0..1."""
    given = np.asarray(values, np.float64)
    return np.where(given <= 0.04045, given / 12.92, ((np.maximum(given, 0.04045) + 0.055) / 1.055) ** 2.4)


def to_srgb(values: Any) -> Floats:
    """SRGB of light 0..1."""
    given = np.asarray(values, np.float64)
    return np.where(given <= 0.0031308, given * 12.92, 1.055 * np.maximum(given, 0.0031308) ** (1 / 2.4) - 0.055)


def decoded(image: NDArray[Any]) -> Floats:
    """RGBA in linear light: bytes are sRGB, but for alpha; floats are linear already."""
    if image.dtype != np.uint8:
        return image.astype(np.float64)
    values = image / 255.0
    return np.concatenate([to_linear(values[..., :3]), values[..., 3:]], axis=-1)


def stored(values: Floats, dtype: Any, bias: float = 0.0) -> NDArray[Any]:
    """The image that is nearest to RGBA in linear light: bytes of sRGB, but for alpha, or float32.

    bias: in bytes; what is added before they are rounded.
    """
    if dtype != np.uint8:
        return values.astype(np.float32)
    levels = np.concatenate([to_srgb(values[..., :3]), values[..., 3:]], axis=-1) * 255
    return np.clip(np.floor(levels + 0.5 + bias), 0, 255).astype(np.uint8)


# --- mip maps ---------------------------------------------------------------------------------------------------------


def halved(values: Floats, axis: int) -> Floats:
    """Half as many texels along an axis, rounded down, each the mean of what it covers of the others.

    Of 2 n + 1 texels, n are made. Each covers 2 + 1 / n of them: two or three in part.
    """
    count = values.shape[axis]
    n = max(count // 2, 1)
    edges = np.arange(n + 1) * (count / n)
    covered = np.minimum(edges[1:, None], np.arange(1, count + 1)) - np.maximum(edges[:-1, None], np.arange(count))
    weights = np.maximum(covered, 0) * (n / count)
    return np.moveaxis(np.tensordot(weights, values, axes=(1, axis)), 0, axis)


def mip_levels(image: NDArray[Any], bias: float = 0.0) -> list[NDArray[Any]]:
    """All levels as they are stored, down to a single texel. Each is made from the one before, as that is stored.

    bias: as in `stored`. A mean rises with what it is of. So biases down and up make the least and the most possible.
    """
    levels = [image]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(stored(halved(halved(decoded(levels[-1]), 0), 1), image.dtype, bias))
    return levels


@lru_cache(maxsize=64)
def _levels(texture: Any, bias: float) -> list[Floats]:
    """The levels of a texture that its filters use, in linear light."""
    levels = mip_levels(texture.image, bias) if "mipmap" in texture.minify else [texture.image]
    return [decoded(level) for level in levels]


# --- one level --------------------------------------------------------------------------------------------------------


def texel(index: Integers, count: int, wrap: str) -> Integers:
    """The texel that stands at any index (OpenGL 4.6, table 8.20)."""
    if wrap == "repeat":
        return index % count
    if wrap == "mirror":
        turned = index % (2 * count)
        return np.where(turned < count, turned, 2 * count - 1 - turned)
    assert wrap == "clamp"
    return np.clip(index, 0, count - 1)


def nearest(level: Floats, uv: Floats, wrap: Any) -> Floats:
    """The texels that samples fall into."""
    height, width = level.shape[:2]
    i, j = (np.floor(uv[:, k] * count).astype(np.int64) for k, count in enumerate((width, height)))
    return level[texel(j, height, wrap[1]), texel(i, width, wrap[0])]


def linear(level: Floats, uv: Floats, wrap: Any) -> Floats:
    """The four texels around samples, weighted by how near their middles are."""
    height, width = level.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, down = (x - i)[:, None], (y - j)[:, None]
    columns = [texel(i + k, width, wrap[0]) for k in (0, 1)]
    rows = [texel(j + k, height, wrap[1]) for k in (0, 1)]
    upper, lower = ((1 - right) * level[row, columns[0]] + right * level[row, columns[1]] for row in rows)
    return (1 - down) * upper + down * lower


FILTERS: dict[str, Callable[[Floats, Floats, Any], Floats]] = {"nearest": nearest, "linear": linear}


# --- between levels (OpenGL 4.6, section 8.14) ------------------------------------------------------------------------


def sample(texture: Image, uv: Floats, lod: Floats, bias: float = 0.0) -> Floats:
    """RGBA in linear light at coordinates [n, 2], with a level of detail [n]: float64 [n, 4]. bias: of `mip_levels`."""
    levels = _levels(texture, bias)
    within, _, between = texture.minify.partition("-mipmap-")
    last = len(levels) - 1
    if between == "linear":
        lower = np.floor(np.clip(lod, 0, last))
        share = np.clip(lod, 0, last) - lower
    else:
        level = np.where(lod <= 0.5, 0, np.ceil(np.maximum(lod, 0) + 0.5) - 1) if between else np.zeros(len(lod))
        lower, share = np.minimum(level, last), np.zeros(len(lod))
    found = np.empty((len(uv), 4))
    magnified = lod <= 0
    found[magnified] = FILTERS[texture.magnify](levels[0], uv[magnified], texture.wrap)
    for number in np.unique(lower[~magnified]).astype(int):
        own = ~magnified & (lower == number)
        found[own] = FILTERS[within](levels[number], uv[own], texture.wrap)
        if share[own].any():
            upper = FILTERS[within](levels[min(number + 1, last)], uv[own], texture.wrap)
            found[own] += share[own, None] * (upper - found[own])
    return found


def lengths(texture: Image, at: Footprint) -> tuple[Floats, Floats]:
    """How many texels of level 0 a pixel is long, along x and along y: float64 [n] each."""
    size = np.array(texture.image.shape[1::-1], np.float64)
    return np.linalg.norm(at.along_x * size, axis=1), np.linalg.norm(at.along_y * size, axis=1)


def logarithm(values: Floats) -> Floats:
    """Log2, -inf of 0."""
    with np.errstate(divide="ignore"):
        return np.log2(values)


def probe_count(longest: Floats, shortest: Floats, anisotropy: int) -> Integers:
    """How many probes a footprint takes (EXT_texture_filter_anisotropic)."""
    with np.errstate(all="ignore"):
        wanted = np.where(longest > shortest * anisotropy, float(anisotropy), np.ceil(longest / shortest))
    return np.where(longest > 0, np.maximum(wanted, 1), 1).astype(np.int64)


def probes(texture: Image, uv: Floats, axis: Floats, count: Integers, lod: Floats) -> Floats:
    """The mean of so many samples side by side along the footprint's long axis [n, 2]."""
    total = np.zeros((len(uv), 4))
    for i in range(int(count.max(initial=0))):
        own = count > i
        offset = (i + 0.5) / count[own, None] - 0.5
        total[own] += sample(texture, uv[own] + offset * axis[own], lod[own])
    return total / count[:, None]


def texels(texture: Image, at: Footprint, anisotropy: int = 1) -> Floats:
    """What a texture has where samples fall: RGBA in linear light, float64 [n, 4]."""
    x, y = lengths(texture, at)
    longest, shortest = np.maximum(x, y), np.minimum(x, y)
    count = probe_count(longest, shortest, anisotropy)
    axis = np.where((x >= y)[:, None], at.along_x, at.along_y)
    return probes(texture, at.uv, axis, count, logarithm(longest / count))


# --- how far that may be off ------------------------------------------------------------------------------------------


def texel_range(
    texture: Image, at: Footprint, off: Footprint, uv_off: float = 0.0, lod_off: float = 0.0, anisotropy: int = 1
) -> tuple[Floats, Floats]:
    """The least and the greatest texels, float64 [n, 4], where footprints are known to within `off`.

    uv_off, lod_off: how far off coordinates and levels of detail are besides.
    """
    size = np.array(texture.image.shape[1::-1], np.float64)
    reach = off.uv + uv_off + (np.maximum(off.along_x, off.along_y) / 2 if anisotropy > 1 else 0.0)
    middle = texels(texture, at, anisotropy)
    stray = np.zeros((len(at.uv), 4))
    wide = (reach * size > 0.25).any(axis=1)
    for rows, axis, count, lod, span in _variants(texture, at, off, anisotropy):
        wide[rows] |= span + 2 * lod_off > 0.5
        total, around = np.zeros((2, len(rows), 4))
        for i in range(count):
            uv = at.uv[rows] + ((i + 0.5) / count - 0.5) * axis
            total += sample(texture, uv, lod)
            around += _around(texture, uv, reach[rows], lod, span / 2 + lod_off)
        stray[rows] = np.maximum(stray[rows], np.abs(total / count - middle[rows]) + around / count)
    whole = decoded(texture.image).reshape(-1, 4)
    least, most = whole.min(axis=0), whole.max(axis=0)
    low, high = np.clip(middle - stray, least, most), np.clip(middle + stray, least, most)
    low[wide], high[wide] = least, most
    return low, high


def _around(texture: Image, uv: Floats, reach: Floats, lod: Floats, lod_reach: Floats) -> Floats:
    """How far off one sample may be, float64 [n, 4], if coordinates and levels of detail are known to within a reach.

    Along each of the three, sampling is made of straight pieces, of which at most two meet within the reach. So a value
    is off by no more than one at the two ends is: on one side the first piece goes on to the end, at least as far as it
    does to the bend on the other side. What is off along the three adds up. Where filters make steps, the ends of all
    three together show them.
    """
    middle = sample(texture, uv, lod)
    biases = (-LEVEL_OFF, LEVEL_OFF) if "mipmap" in texture.minify else (0.0,)

    def off(*ends: tuple[int, int, int]) -> Floats:
        found = [
            sample(texture, uv + reach * end[:2], lod + end[2] * lod_reach, bias) for end in ends for bias in biases
        ]
        return np.abs(np.array(found) - middle).max(axis=0)

    alone = off((-1, 0, 0), (1, 0, 0)) + off((0, -1, 0), (0, 1, 0)) + off((0, 0, -1), (0, 0, 1))
    return np.maximum(alone, off(*product((-1, 1), repeat=3)))


def _variants(
    texture: Image, at: Footprint, off: Footprint, anisotropy: int
) -> Iterator[tuple[Integers, Floats, int, Floats, Floats]]:
    """What a footprint may be: which rows, its long axis, how many probes, the middle level of detail, and its span."""
    x, y = lengths(texture, at)
    off_x, off_y = lengths(texture, off)
    for long, off_long, axis, short, off_short in (
        (x, off_x, at.along_x, y, off_y),
        (y, off_y, at.along_y, x, off_x),
    ):
        rows = np.flatnonzero(long + off_long >= short - off_short)
        most, least = long[rows] + off_long[rows], np.maximum(long[rows] - off_long[rows], 0)
        # Of the axes that may be the long one, the other is at most as long.
        other = np.maximum(short[rows] - off_short[rows], 0), np.minimum(short[rows] + off_short[rows], most)
        counts = probe_count(least, np.minimum(other[1], least), anisotropy), probe_count(most, other[0], anisotropy)
        for count in range(int(counts[0].min(initial=1)), int(counts[1].max(initial=0)) + 1):
            own = (counts[0] <= count) & (count <= counts[1])
            top, bottom = (logarithm(np.maximum(length[own], TINY) / count) for length in (most, least))
            yield rows[own], axis[rows[own]], count, (top + bottom) / 2, top - bottom
