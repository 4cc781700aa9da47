"""What the host and the kernels share: constants and compile-time features. Structs are in records.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

SUBPIXEL_BITS = 8
"""Vertices are snapped to 1/256 pixel; sample points lie at the pixels' centres."""

SUBPIXELS = 1 << SUBPIXEL_BITS

GUARD_BAND = 1 << 24
"""Largest |x| or |y| of a snapped vertex, in subpixels from the image's centre (65,536 pixels).
Extents then stay below 2**25, edge functions below 2**51, and every coordinate is an exact float32."""

SMALL_EXTENT = 1 << 18
"""A triangle of fewer subpixels (1,024 pixels) a side has edge functions that fit 32 bits all over the tiles it meets,
in steps of SUBPIXELS (raster.h): |E| <= 2 * 2**18 * (2**18 + 2**12) < 2**38."""

TILE_BITS = 4
TILE = 1 << TILE_BITS
"""Pixels on a side of a tile."""

TILE_PIXELS = TILE * TILE

BLOCK = 4
"""Pixels on a side of a block: a tile is walked block by block, and its pixels lie so in memory (common.h)."""

BLOCK_PIXELS = BLOCK * BLOCK
BLOCKS_A_ROW = TILE // BLOCK
TILE_BLOCKS = BLOCKS_A_ROW * BLOCKS_A_ROW

FRAGMENT_BYTES = 8
"""A fragment: its depth key and its payload, as one integer that orders it (raster.h)."""

FRAGMENT_PADDING = 16
"""Fragments that a slab has room for beyond its last: up to seven are read with others (shading.h), and slabs begin
where rows of 16 may."""

IS_OPAQUE = 1 << 31
"""Of a pixel's count: an opaque surface lies behind. Counts are below 2**24 (binning.py)."""

LIST_GAP = 8
"""Fragments that a pixel's list has room for beyond its last: they are moved eight at a time (sorting.h), and lists of
equal length would fall on the same places of a cache."""

COLOR_BYTES = 16
"""A colour of four floats: a fragment's own where it varies over a face."""

SOURCE_BYTES = 4
"""The face of a fragment that has a colour of its own, where it is asked for."""

MAX_CLIP_VERTICES = 10
"""A triangle cut by near, far and the four sides of the guard band has at most 3 + 6 corners; one more for room."""

CLIP_TRIANGLES = MAX_CLIP_VERTICES - 2
"""Records kept for the fan of one clipped triangle."""

CLIPPED_FACE = 0xFFFF
"""First pixel column of a face whose records are a clipped fan: it has no columns, being greater than the last."""

RUN_MAX = 256
"""Fragments of a pixel that are held in private memory at once: deeper ones are sorted in global memory (sorting.h)."""

INSERTED_MAX = 64
"""Fragments of a pixel that are put into order one by one where they lie (layers.cl); more are sorted by digits."""

ALL_LAYERS = (1 << 32) - 1
"""More layers than a pixel can have."""

AMBIENT = 0.2
"""Headlight: the share of the colour that does not depend on the normal; the rest is times |cos|."""

DepthFormat = Literal["float32-reversed", "float32", "unorm24", "rgba8"]
DEPTH_FORMATS: tuple[DepthFormat, ...] = get_args(DepthFormat)
"""What is kept of a depth, in the order of the kernels' numbers (depth.h)."""

FLOAT32_REVERSED, FLOAT32, UNORM24, RGBA8 = range(len(DEPTH_FORMATS))

# Outcodes of a projected vertex: one bit for each clipping plane it lies outside of.
OUT_NEAR, OUT_FAR, OUT_LEFT, OUT_RIGHT, OUT_TOP, OUT_BOTTOM, NOT_FINITE = (1 << bit for bit in range(7))

# What a face needs: nothing (0), a record, clipping, or to be counted as not finite.
DRAWN, CLIPPED, DISCARDED = 1, 2, 3

# What is known of a record's face, one bit each: its edge functions fit 32 bits (SMALL_EXTENT), it is seen from behind
# (its corners, as given, run clockwise), all its alphas are 1. The last stands beside a face's state, too.
SMALL, BACK_FACING, OPAQUE = 1, 2, 4

LIST_RUN = 64
"""Faces that are sifted at once (projection.cl)."""

PADDING = 16
"""Vertices, faces or records that a work-item may write past the last one: as many as it does at once (wide.h).
Also numbers in a line of a cache, where what is not wanted is written (binning.cl)."""


@dataclass(frozen=True)
class Features:
    """What a scene and a request need, and so what the kernels are compiled for."""

    lanes: int
    perspective: bool
    low_positions: bool  # positions are float32 pairs
    color_rate: str  # "scene" | "face" | "vertex"
    packed_color: bool  # colours come as 4 bytes rather than 4 floats
    headlight: bool
    surfaces: str = "transparent"  # or "opaque", or "mixed": what is drawn first needs telling apart
    depth_format: DepthFormat = DEPTH_FORMATS[FLOAT32_REVERSED]

    @property
    def fragment_color(self) -> bool:
        """Whether each fragment has a colour of its own rather than its face's."""
        return self.color_rate == "vertex" or self.headlight

    @property
    def fragment_bytes(self) -> int:
        """Bytes of one fragment: depth and payload, and a float4 where the colour varies."""
        return FRAGMENT_BYTES + (COLOR_BYTES if self.fragment_color else 0)

    @property
    def strip(self) -> int:
        """Pixels of a block that a lane works on at once."""
        return min(BLOCK_PIXELS, TILE_PIXELS // self.lanes)

    @property
    def wide(self) -> int:
        """Vertices or triangles that a work-item computes at once: one that has a tile to itself has vectors too."""
        return PADDING if self.lanes == 1 else 1

    def options(self) -> list[str]:
        """-D options for the kernels."""
        flags = {
            "LANES": self.lanes,
            "STRIP": self.strip,
            "WIDE": self.wide,
            "PERSPECTIVE": int(self.perspective),
            "LOW_POSITIONS": int(self.low_positions),
            "COLOR_RATE_FACE": int(self.color_rate == "face"),
            "COLOR_RATE_VERTEX": int(self.color_rate == "vertex"),
            "PACKED_COLOR": int(self.packed_color),
            "HEADLIGHT": int(self.headlight),
            "FRAGMENT_COLOR": int(self.fragment_color),
            "MIXED": int(self.surfaces == "mixed"),
            "DEPTH_FORMAT": DEPTH_FORMATS.index(self.depth_format),
        }
        return [f"-D{name}={value}" for name, value in flags.items()]
