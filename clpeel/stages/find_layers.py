"""Layers: what peeling finds in each pixel, front to back (Everitt 2001; a layered depth image, Shade et al. 1998)."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.device.devices import Gpu
from clpeel.device.layout import (
    BLOCK,
    BLOCK_PIXELS,
    BLOCKS_A_ROW,
    COLOR_BYTES,
    DEPTH_FORMATS,
    FLOAT32,
    FLOAT32_REVERSED,
    FRAGMENT_BYTES,
    INSERTED_MAX,
    MAX_SIDE,
    RGBA8,
    SOURCE_BYTES,
    TILE,
    TILE_PIXELS,
    UNORM24,
)
from clpeel.device.program import launch, program
from clpeel.errors import InputError
from clpeel.files import write_whole
from clpeel.pictures.lengths import Lengths, narrowed
from clpeel.scene.camera import Camera
from clpeel.scene.scene import Scene, checked_background
from clpeel.stages.binning import BATCH_SHARE, TILE_BYTES, Batch, bin_triangles
from clpeel.stages.projection import DeviceScene, Triangles, project
from clpeel.stages.windows import Fragments, rasterize

STAGE = "layers"
FORMAT = 1
"""Of the files that `Layers.save` writes."""

TILE_LAYERS_BYTES = TILE_BYTES + (4 + 4) * TILE_PIXELS + 4
"""Of a tile in a batch: as for drawing, where each pixel's list ends, its layers, and where the tile's lists begin."""

TURNS = ("fragments", "scratch", "colors", "sources", "pairs", "pixel_end", "kept")
"""Buffers that the picture and the layers have in turn, so that each keeps to the memory given."""

_ARRAYS = {"start": (np.int64,), "color": (np.float32,), "depth": (np.float32, np.float64), "triangle": (np.int32,)}
"""Their types, of which the first is the usual one."""


@dataclass(frozen=True, eq=False)
class Layers:
    """The layers of every pixel, front to back: a layered depth image.

    size: (width, height) in pixels. start: int64 [height * width + 1]: the layers of the pixel at (row, column), row 0
    on top, are start[p] : start[p + 1] with p = row * width + column. color: float32 [n, 4], straight RGBA 0..1, lit
    where the picture was. depth: float32 [n], distance from the camera along its view axis in scene units (float64
    where float32 cannot hold them). triangle: int32 [n], the face of the scene.

    The order is (depth, submission). A pixel's layers end with the first opaque one, whose alpha is exactly 1, unless
    it was rendered with opaque="blend". Raises InputError where the arrays do not fit together.
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
        # A NaN is not less than any other, nor at least: so it does not pass, wherever it is.
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
        """The k-th layer of all pixels, 0 the foremost: what peeling finds in its k-th pass.

        Returns color float32 [height, width, 4], straight, zeros where a pixel has no such layer; depth float32
        [height, width], infinite there; triangle int32 [height, width], -1 there. Raises InputError where none has.
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
        """The same as `count`."""
        return self.count

    def __getitem__(self, k: int) -> tuple[NDArray[np.float32], Lengths, NDArray[np.int32]]:
        """The same as `layer`, so that `for color, depth, triangle in layers` goes through them front to back."""
        if not -self.count <= k < self.count:
            raise IndexError(k)  # what ends that loop
        return self.layer(k % self.count)

    def blended(self) -> NDArray[np.float32]:
        """The layers blended front to back: float32 [height, width, 4], premultiplied, before the background.

        The same operations in float32 as the kernels' (blending.h), so that layers of which none is missing give the
        bits of `Result.color` by `sort`.
        """
        rgb, through = self._blended()
        return np.concatenate([rgb, np.float32(1) - through], axis=-1)

    def _blended(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Premultiplied colour [height, width, 3], and the transmittance [height, width, 1] that is left."""
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

    def composite(self, background: Sequence[float] | str | None = (1, 1, 1)) -> NDArray[np.uint8]:
        """The picture again: uint8 [height, width, 4], row 0 on top.

        background: 3 numbers 0..1, or None for straight alpha. Layers of which none is missing give the bits of
        `Result.image` by `sort` over the same. Raises InputError where the background cannot be.
        """
        return _shown(*self._blended(), background)

    def picture(
        self, k: int, background: Sequence[float] | str | None = (1, 1, 1), keep_alpha: bool = False
    ) -> NDArray[np.uint8]:
        """The k-th layer alone, opaque, as Bavoil and Myers (2008) show them in Figure 2: uint8 [height, width, 4].

        background: as for `composite`. keep_alpha: with its own alpha instead. Raises InputError where there is no such
        layer.
        """
        color, _, triangle = self.layer(k)
        alpha = color[..., 3:] if keep_alpha else (triangle >= 0)[..., None].astype(np.float32)
        return _shown(alpha * color[..., :3], np.float32(1) - alpha, background)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes them all as an .npz, whole or not at all, for `load_layers`; through a link, if path is one.

        Raises InputError when the place cannot be written, or its name ends in what is not .npz.
        """
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        size = np.array(self.size, np.int32)
        write_whole(path, lambda file: np.savez(file, format=np.int32(FORMAT), size=size, **arrays), ".npz")


def _shown(
    rgb: NDArray[np.float32], through: NDArray[np.float32], background: Sequence[float] | str | None
) -> NDArray[np.uint8]:
    """Premultiplied colour [h, w, 3] and transmittance [h, w, 1] to a picture: composite.h, operation by operation."""
    over = checked_background(background)
    alpha = np.ones_like(through)
    if over is not None:
        shown = rgb + through * np.array(over, np.float32)
    else:
        alpha = np.maximum(np.float32(1) - through, np.float32(0))
        shown = np.divide(rgb, alpha, out=np.zeros_like(rgb), where=alpha > 0)
    levels = np.concatenate([shown, alpha], axis=-1) * np.float32(255) + np.float32(0.5)
    return np.clip(levels, np.float32(0), np.float32(255)).astype(np.uint8)


def load_layers(path: str | os.PathLike[str]) -> Layers:
    """The layers that `Layers.save` wrote, bit for bit.

    Raises InputError where there is no such file, or it is damaged, or something else.
    """
    name = os.fspath(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in ("format", "size", *_ARRAYS)}
    except FileNotFoundError:
        raise InputError(f"{name}: no such file") from None
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror or error}") from None
    except Exception:  # whatever NumPy and zipfile make of bytes that are something else
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


# --- how they are found -----------------------------------------------------------------------------------------------


@dataclass
class _Piece:
    """The layers of a window's pixels: pixel, count int64 [m]; color, depth, triangle as of Layers, pixel by pixel."""

    pixel: NDArray[np.int64]
    count: NDArray[np.int64]
    color: NDArray[np.float32]
    depth: Lengths
    triangle: NDArray[np.int32]


def find_layers(
    gpu: Gpu,
    scene: DeviceScene,
    camera: Camera,
    size: tuple[int, int],
    headlight: bool,
    budget: int,
    peeled: tuple[int, int],
    keep_coincident: bool,
    opaque_first: bool,
    depth_format: str,
    report: Callable[[float, str], None],
) -> Layers:
    """The layers of a view, found in windows within `budget` bytes of the device's memory.

    peeled: how many of a pixel's transparent layers from the front and from the back. keep_coincident: of equal depths
    all, not the first submitted alone. opaque_first: whether a pixel's layers end with the first opaque one.
    depth_format: one of DEPTH_FORMATS (layout.py). Raises InputError where the budget does not hold one pixel's
    fragments.
    """
    gpu.release(*TURNS)
    try:
        # Opaque faces too, all in the order of submission.
        triangles = project(gpu, scene, camera, size, headlight, depth_format=depth_format)
        features = triangles.features
        batch_budget, largest = budget // BATCH_SHARE, int(gpu.device.max_mem_alloc_size)
        tiles = bin_triangles(gpu, triangles, batch_budget)
        each = features.fragment_bytes + FRAGMENT_BYTES + (SOURCE_BYTES if features.fragment_color else 0)
        capacity = min(
            (budget - batch_budget) // each,
            largest // (COLOR_BYTES if features.fragment_color else FRAGMENT_BYTES),
            2**31 - 1,
        )
        done_pairs = np.cumsum(tiles.tile_pairs) / max(int(tiles.tile_pairs.sum()), 1)
        pieces: list[_Piece] = []
        for batch in tiles.batches(min(batch_budget, largest), TILE_LAYERS_BYTES):
            for window in rasterize(gpu, triangles, batch, capacity, with_sources=True):
                if window.count:
                    pieces.append(_peel(gpu, triangles, batch, window, peeled, keep_coincident, opaque_first))
                report(float(done_pairs[batch.first_tile + window.window_tile + window.tiles - 1]), "peeling layers")
    finally:
        gpu.queue.finish()
        gpu.release(*TURNS)
    return _joined(size, pieces)


def _peel(
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    window: Fragments,
    peeled: tuple[int, int],
    keep_coincident: bool,
    opaque_first: bool,
) -> _Piece:
    """The layers of a window, on the host."""
    kept_buffer = gpu.buffer("kept", 4 * TILE_PIXELS * window.tiles)
    deep = window.layers_max > INSERTED_MAX
    launch(
        gpu,
        STAGE,
        program(gpu, "stages/find_layers.cl", window.features)["peel_layers"],
        TILE_PIXELS * window.tiles,
        fragments=window.fragments,
        spare=gpu.buffer("scratch", FRAGMENT_BYTES * window.count) if deep else None,
        colors=window.colors,
        sources=window.sources,
        faces=triangles.scene.faces,
        palette=triangles.scene.palette,
        pixel_end=window.pixel_end,
        tile_start=window.tile_start,
        window_tile=window.window_tile,
        tiles=window.tiles,
        window_start=window.start,
        first_pixel=window.first_pixel,
        last_pixel=window.last_pixel,
        front=peeled[0],
        back=peeled[1],
        keep_coincident=keep_coincident,
        opaque_first=opaque_first,
        kept=kept_buffer,
    )
    shape = (window.tiles, TILE_PIXELS)
    kept = gpu.get(kept_buffer, shape, np.uint32)
    ends = gpu.get(window.pixel_end, shape, np.uint32, offset=4 * TILE_PIXELS * window.window_tile)
    starts = gpu.get(window.tile_start, window.tiles, np.uint32, offset=4 * window.window_tile)
    tile, place = np.nonzero(kept)
    count = kept[tile, place].astype(np.int64)
    before = np.where(place > 0, ends[tile, place - 1], np.uint32(0))
    begin = (starts[tile] - np.uint32(window.start) + before).astype(np.int64)  # modulo 2**32, as the kernels
    fragments = gpu.get(window.fragments, window.count, np.uint64)[_runs(begin, count)]
    payload = fragments.astype(np.uint32)
    if window.sources is None:
        colors, color_at, triangle = straight_colors(triangles.scene.scene), payload, payload
        if triangles.scene.color_rate == "scene":
            color_at = np.zeros_like(payload)
    else:
        colors, color_at = gpu.get(window.colors, (window.count, 4), np.float32), payload
        triangle = gpu.get(window.sources, window.count, np.uint32)[payload]
    return _Piece(
        pixel=_pixels(batch.first_tile + window.window_tile + tile, place, triangles.size[0]),
        count=count,
        color=colors[color_at],
        depth=_distances((fragments >> np.uint64(32)).astype(np.uint32), triangles),
        triangle=triangle.astype(np.int32),
    )


def straight_colors(scene: Scene) -> NDArray[np.float32]:
    """The scene's colours as the kernels have them: float32 [k, 4], a byte's the float nearest to byte / 255."""
    colors = np.atleast_2d(scene.colors)
    return colors.astype(np.float32) / np.float32(255) if colors.dtype == np.uint8 else colors.astype(np.float32)


def _pixels(tile: NDArray[np.int64], place: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """The pixels, row by row, at these places in these tiles of the image (common.h)."""
    columns = -(-width // TILE)
    block, within = place // BLOCK_PIXELS, place % BLOCK_PIXELS
    row = tile // columns * TILE + block // BLOCKS_A_ROW * BLOCK + within // BLOCK
    column = tile % columns * TILE + block % BLOCKS_A_ROW * BLOCK + within % BLOCK
    return row * width + column


def _distances(keys: NDArray[np.uint32], triangles: Triangles) -> Lengths:
    """Depth keys to view distances: depth.h and the camera's projection, turned round."""
    near, far = triangles.clipping
    kept = DEPTH_FORMATS.index(triangles.features.depth_format)
    with np.errstate(over="ignore", divide="ignore"):
        if kept == FLOAT32_REVERSED:
            negative = np.uint32(0x80000000)
            depth = np.where(keys & negative, keys, ~(keys | negative)).view(np.float32).astype(np.float64)
        else:
            bits = keys - np.uint32(1)
            steps = {UNORM24: 2.0**24 - 1, RGBA8: 2.0**32}
            window = bits.view(np.float32).astype(np.float64) if kept == FLOAT32 else bits / steps[kept]
            depth = 1 - window / triangles.depth_scale
        distance = near / depth if triangles.features.perspective else far - depth * (far - near)
        return narrowed(distance)


def _runs(begin: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """begin[0], begin[0] + 1, ... count[0] of them; then begin[1], ..."""
    return np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(count.sum())


def _joined(size: tuple[int, int], pieces: list[_Piece]) -> Layers:
    """All windows' layers, row by row; the pieces are used up on the way."""
    start = np.zeros(size[0] * size[1] + 1, np.int64)
    for piece in pieces:
        start[piece.pixel + 1] = piece.count
    np.cumsum(start, out=start)
    n = int(start[-1])
    color, triangle = np.empty((n, 4), np.float32), np.empty(n, np.int32)
    depth: Lengths = np.empty(n, np.result_type(np.float32, *(piece.depth.dtype for piece in pieces)))
    while pieces:
        piece = pieces.pop()
        at = _runs(start[piece.pixel], piece.count)
        color[at], depth[at], triangle[at] = piece.color, piece.depth, piece.triangle
    return Layers(size, start, color, depth, triangle)
