"""Finding layers: what peeling finds in each pixel, as arrays on the host (stages/find_layers.cl)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import (
    BAND_TRIANGLES,
    BLOCK,
    BLOCK_PIXELS,
    BLOCKS_A_ROW,
    COLOR_BYTES,
    DEPTH_FORMATS,
    FLOAT32,
    FLOAT32_REVERSED,
    FRAGMENT_BYTES,
    INSERTED_MAX,
    RGBA8,
    SOURCE_BYTES,
    TILE,
    TILE_PIXELS,
    UNORM24,
    DepthFormat,
)
from clpeel.device.memory import Budget
from clpeel.device.program import launch, program
from clpeel.device.workspace import Workspace
from clpeel.pictures.layers import Layers
from clpeel.pictures.lengths import Lengths, narrowed
from clpeel.scene.camera import Camera
from clpeel.scene.scene import Scene
from clpeel.stages.binning import TILE_BYTES, Batch, bin_triangles
from clpeel.stages.outlines import Marks
from clpeel.stages.projection import Lit, Triangles, project
from clpeel.stages.upload import DeviceScene
from clpeel.stages.windows import Fragments, rasterize

if TYPE_CHECKING:
    from clpeel.stages.wires import Wired

STAGE = "layers"

TILE_LAYERS_BYTES = TILE_BYTES + (4 + 4) * TILE_PIXELS + 4
"""Bytes that a tile takes in a batch besides its list.

These are: what drawing takes, the end of each pixel's list, each pixel's number of layers, and the tile's start.
"""

TURNS = ("fragments", "scratch", "colors", "sources", "pairs", "pixel_end", "kept")
"""Buffers that drawing the picture and finding its layers both use. They are released in between.

So each of the two stays within the memory that the request allows.
"""


@dataclass(frozen=True, kw_only=True)
class Peeled:
    """Which layers of a view are peeled.

    size: (width, height) in pixels. headlight: whether there is one. lit: other lights. front, back: how many
    transparent layers of a pixel are peeled from the front, and from the back. keep_coincident: peel all fragments of
    equal depth, instead of only the first submitted. opaque_first: whether a pixel's layers end with the first opaque
    one. depth_format: one of DEPTH_FORMATS (layout.py). backfaces, probes, marks, wired: as for `project`.
    """

    camera: Camera
    size: tuple[int, int]
    headlight: bool
    lit: Lit | None
    front: int
    back: int
    keep_coincident: bool
    opaque_first: bool
    depth_format: DepthFormat
    backfaces: str
    probes: int
    marks: Marks
    wired: Wired | None = None


@dataclass
class _Piece:
    """The layers of a window's m pixels that have any.

    pixel: int64 [m], row * width + column. count: int64 [m], layers of each. color, depth, triangle: as in Layers,
    pixel by pixel, count.sum() long.
    """

    pixel: NDArray[np.int64]
    count: NDArray[np.int64]
    color: NDArray[np.float32]
    depth: Lengths
    triangle: NDArray[np.int32]


def find_layers(
    gpu: Workspace, scene: DeviceScene, peeled: Peeled, budget: Budget, report: Callable[[float, str], None]
) -> Layers:
    """The layers of a view. They are found window by window, within the budget.

    report: called with the share done, 0..1, and a text. Raises InputError if the fragments of a single pixel do not
    fit the budget.
    """
    gpu.release(*TURNS)
    try:
        # Without opaque_first: a pixel's list then has its opaque and transparent fragments in the order of submission.
        triangles = project(
            gpu,
            scene,
            peeled.camera,
            peeled.size,
            peeled.headlight,
            depth_format=peeled.depth_format,
            backfaces=peeled.backfaces,
            probes=peeled.probes,
            lit=peeled.lit,
            marks=peeled.marks,
            wired=peeled.wired,
        )
        features = triangles.features
        tiles = bin_triangles(gpu, triangles, budget.lists)
        each = features.fragment_bytes + FRAGMENT_BYTES + (SOURCE_BYTES if features.fragment_color else 0)
        capacity = budget.capacity(each, COLOR_BYTES if features.fragment_color else FRAGMENT_BYTES)
        done_pairs = np.cumsum(tiles.tile_pairs) / max(int(tiles.tile_pairs.sum()), 1)
        pieces: list[_Piece] = []
        for batch in tiles.batches(budget.batch, TILE_LAYERS_BYTES):
            for window in rasterize(gpu, triangles, batch, capacity, with_sources=True):
                if window.count:
                    pieces.append(_peel(gpu, triangles, batch, window, peeled))
                report(float(done_pairs[batch.first_tile + window.window_tile + window.tiles - 1]), "peeling layers")
    finally:
        gpu.queue.finish()
        gpu.release(*TURNS)
    return _joined(peeled.size, pieces)


def _peel(gpu: Workspace, triangles: Triangles, batch: Batch, window: Fragments, peeled: Peeled) -> _Piece:
    """Peels a window's fragments on the device, and fetches the layers."""
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
        faces=triangles.face_corners,
        palette=triangles.scene.palette,
        pixel_end=window.pixel_end,
        tile_start=window.tile_start,
        window_tile=window.window_tile,
        tiles=window.tiles,
        window_start=window.start,
        first_pixel=window.first_pixel,
        last_pixel=window.last_pixel,
        front=peeled.front,
        back=peeled.back,
        keep_coincident=peeled.keep_coincident,
        opaque_first=peeled.opaque_first,
        kept=kept_buffer,
    )
    shape = (window.tiles, TILE_PIXELS)
    kept = gpu.get(kept_buffer, shape, np.uint32)
    ends = gpu.get(window.pixel_end, shape, np.uint32, offset=4 * TILE_PIXELS * window.window_tile)
    starts = gpu.get(window.tile_start, window.tiles, np.uint32, offset=4 * window.window_tile)
    tile, place = np.nonzero(kept)
    count = kept[tile, place].astype(np.int64)
    before = np.where(place > 0, ends[tile, place - 1], np.uint32(0))
    begin = (starts[tile] - np.uint32(window.start) + before).astype(np.int64)  # wraps modulo 2**32, as in kernels
    fragments = gpu.get(window.fragments, window.count, np.uint64)[_runs(begin, count)]
    payload = fragments.astype(np.uint32)
    if window.sources is None:
        colors, triangle = straight_colors(triangles.scene.scene), payload
        of_scene = triangles.scene.color_rate == "scene"
        color_at = np.zeros_like(payload) if of_scene else _numbered(payload.astype(np.int32), triangles)
    else:
        colors, color_at = gpu.get(window.colors, (window.count, 4), np.float32), payload
        triangle = gpu.get(window.sources, window.count, np.uint32)[payload]
    return _Piece(
        pixel=_pixels(batch.first_tile + window.window_tile + tile, place, triangles.size[0]),
        count=count,
        color=colors[color_at],
        depth=_distances((fragments >> np.uint64(32)).astype(np.uint32), triangles),
        triangle=_numbered(triangle.astype(np.int32), triangles),
    )


def _numbered(triangle: NDArray[np.int32], triangles: Triangles) -> NDArray[np.int32]:
    """The numbers of triangles, where those of lines and points become the numbers that these have behind the faces.

    Those of bands become faces that the edges belong to.
    """
    scene = triangles.scene
    faces = np.int32(len(scene.scene.faces))
    if triangles.seen is not None and triangles.seen.bands:
        band = (triangle - scene.face_count) // BAND_TRIANGLES
        triangle = np.where(band < 0, triangle, triangles.seen.band_faces[np.maximum(band, 0)])
    if scene.outlines is None:
        return triangle
    return np.where(triangle < faces, triangle, faces + scene.outlines.marks_of(triangle - faces))


def straight_colors(scene: Scene) -> NDArray[np.float32]:
    """The scene's colours as the kernels read them: float32 [k, 4], straight RGBA.

    A byte becomes the float32 that is nearest to byte / 255.
    """
    colors = np.atleast_2d(scene.colors)
    return colors.astype(np.float32) / np.float32(255) if colors.dtype == np.uint8 else colors.astype(np.float32)


def _pixels(tile: NDArray[np.int64], place: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """The pixels (row * width + column) at these places within these tiles of the image (pixel_at in common.h)."""
    columns = -(-width // TILE)
    block, within = place // BLOCK_PIXELS, place % BLOCK_PIXELS
    row = tile // columns * TILE + block // BLOCKS_A_ROW * BLOCK + within // BLOCK
    column = tile % columns * TILE + block % BLOCKS_A_ROW * BLOCK + within % BLOCK
    return row * width + column


def _distances(keys: NDArray[np.uint32], triangles: Triangles) -> Lengths:
    """The view distances of depth keys, in world units: the inverse of depth_key (depth.h) and of the projection.

    float32, or float64 where float32 cannot hold them.
    """
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
        distance = near / depth if triangles.perspective else far - depth * (far - near)
        return narrowed(distance)


def _runs(begin: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Concatenated runs of numbers: begin[0], begin[0] + 1, ..., count[0] of them; then begin[1], ...; int64."""
    return np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(count.sum())


def _joined(size: tuple[int, int], pieces: list[_Piece]) -> Layers:
    """The layers of all windows in one, pixels row by row. Empties `pieces` on the way, which frees their memory."""
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
