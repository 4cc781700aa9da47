"""What the host and the kernels share: constants and compile-time features. The structs are in records.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

SUBPIXEL_BITS = 8
"""Vertices are snapped to 1/256 pixel. Sample points lie at the centres of pixels."""

SUBPIXELS = 1 << SUBPIXEL_BITS

GUARD_BAND = 1 << 24
"""Largest |x| or |y| of a snapped vertex, in subpixels from the image's centre (65,536 pixels).

Extents then stay within 2**25 and edge functions within 2**51, and every coordinate is an exact float32.
"""

SMALL_EXTENT = 1 << 18
"""A triangle is small if its width and height are fewer subpixels than this (1,024 pixels).

All over the tiles that it meets, its edge functions fit 32 bits in steps of SUBPIXELS (walk.h):
|E| <= 2 * 2**18 * (2**18 + 2**12) < 2**38, and 2**38 / 2**8 = 2**30.
"""

REGULAR = 0x80800000
"""The pattern of samples that lie in the middle of their pixels (common.h, PATTERN)."""

PATTERN_STEP_BITS = 6
"""Samples in other patterns lie apart by multiples of 1/4 pixel: 2**6 subpixels, which are a step then."""

SMALL_EXTENT_IN_PATTERNS = 1 << 17
"""The same as SMALL_EXTENT in other patterns, where steps are smaller: in steps of 2**6 subpixels,
|E| <= 2 * 2**17 * (2**17 + 2**12) < 1.04 * 2**35, and 1.04 * 2**35 / 2**6 < 2**30.
"""

TILE_BITS = 4
TILE = 1 << TILE_BITS
"""Pixels on a side of a tile."""

TILE_PIXELS = TILE * TILE

BLOCK = 4
"""Pixels on a side of a block. Kernels go through a tile block by block, and store its pixels so (common.h)."""

BLOCK_PIXELS = BLOCK * BLOCK
BLOCKS_A_ROW = TILE // BLOCK
TILE_BLOCKS = BLOCKS_A_ROW * BLOCKS_A_ROW

FRAGMENT_BYTES = 8
"""Bytes of a fragment: its depth key and its payload, in one integer. Fragments are sorted as integers (walk.h)."""

FRAGMENT_PADDING = 16
"""Room for so many fragments behind the last one of a slab.

Kernels read eight fragments at once, so up to seven beyond the last (colors.h). With 16 the next slab begins where a
row of 16 may.
"""

IS_OPAQUE = 1 << 31
"""The bit of a pixel's count that says that an opaque surface lies behind. Counts are below 2**24 (binning.py)."""

LIST_GAP = 8
"""Room for so many fragments behind the last one of a pixel's list.

Fragments are moved eight at a time (sorting.h). Also, without a gap, lists of equal length would fall on the same
places of a cache.
"""

COLOR_BYTES = 16
"""Bytes of a colour of four floats. A fragment has one of its own where colours vary over a face."""

SOURCE_BYTES = 4
"""Bytes of a fragment's face number, which is stored on request where fragments have colours of their own."""

MAX_CLIP_VERTICES = 10
"""A triangle cut by the near and far planes and the 4 sides of the guard band has at most 3 + 6 corners. 1 is spare."""

CLIP_TRIANGLES = MAX_CLIP_VERTICES - 2
"""Records that are reserved for a clipped triangle: its polygon is drawn as a fan of triangles."""

CLIPPED_FACE = 0xFFFF
"""The first pixel column in the bounds of a face whose records are a clipped fan.

It is greater than any last column, so the face itself is not drawn.
"""

QUERY_LINES = 8
"""Cache lines that an occlusion query is counted in (peel_passes.h)."""

PASSED, LEFT_OVER = 0, 1
"""What an occlusion query counts, as places in each of its lines: samples that pass, and samples with layers left."""

RUN_MAX = 256
"""How many fragments of a pixel fit private memory at once. Deeper pixels are sorted in global memory (sorting.h)."""

INSERTED_MAX = 64
"""Pixels with up to so many fragments are sorted by insertion (find_layers.cl). Deeper ones are sorted by digits."""

ALL_LAYERS = (1 << 32) - 1
"""More layers than a pixel can have."""

AMBIENT = 0.2
"""The share of the headlight that does not depend on the normal. The rest is multiplied with |cos|."""

# Flags of a material, one bit each (records.py, MATERIAL). What they mean: kernels/shading/materials.h and textures.h.
CUT, BLENDED, UNLIT, RGB_OF_SCENE, ALPHA_OF_SCENE, ROUTED_BY_TEXELS, HIDES, TEXTURED = (1 << bit for bit in range(8))
PLAIN = 1 << 8

# Flags of how a texture is sampled (records.py, MAPPING).
FLOAT_TEXELS, MIRROR_U, CLAMP_U, MIRROR_V, CLAMP_V = (1 << bit for bit in range(5))
MAGNIFY_LINEAR, MINIFY_LINEAR, BETWEEN_LEVELS, NUMBERS = (1 << bit for bit in range(5, 9))

SRGB_SCALES = 256
"""Where the second table of textures begins: behind the linear light of each byte (kernels/shading/reals.h)."""

ALBEDO_SIDE = 16
"""Rows and columns of each table of how much light a reflection returns (clpeel/stages/albedo.py)."""

ALBEDO_TABLES = SRGB_SCALES + 16
"""Where these tables begin among the words of textures: behind the two for sRGB."""

DIELECTRIC = 0.04
"""How much light a surface that is no metal mirrors head-on (glTF 2.0, appendix B.2)."""

LEAST_FACING = 1e-3
"""The least cosine between a normal and the view that lights are computed for. Interpolated normals may turn away."""

LEAST_ROUGHNESS = 0.045
"""The least roughness that lights are computed for. Smoother surfaces would show lamps as points that no sample
hits."""

LEVEL_STARTS = 16
"""Words before a texture's texels: where each of its levels begins (kernels/shading/textures.h)."""

MOST_WIDTH = 8192
"""The greatest width of a line, or size of a point, in samples. Kernels limit widths in scene units to it.

A 1/16 of the guard band is half of it, so that lines that are cut at 3/4 of the band stay within it (expand.cl).
"""

PointType = Literal["sphere", "disc", "square"]
"""How a point is drawn. A sphere is a disc, but lights show it as a ball."""

DepthFormat = Literal["float32-reversed", "float32", "unorm24", "rgba8"]
DEPTH_FORMATS: tuple[DepthFormat, ...] = get_args(DepthFormat)
"""How a depth is stored. The order is that of the kernels' numbers (depth.h)."""

FLOAT32_REVERSED, FLOAT32, UNORM24, RGBA8 = range(len(DEPTH_FORMATS))

# Bits of a projected vertex's outcode: one for each clipping plane that it lies outside of, one for NaN or infinity.
OUT_NEAR, OUT_FAR, OUT_LEFT, OUT_RIGHT, OUT_TOP, OUT_BOTTOM, NOT_FINITE = (1 << bit for bit in range(7))

# What a face needs: nothing (0), a record, a record and clipping, or to be counted as not finite.
DRAWN, CLIPPED, DISCARDED = 1, 2, 3

# Flags of a record, one bit each. SMALL: its edge functions fit 32 bits (SMALL_EXTENT). BACK_FACING: the face is seen
# from behind (its corners, as given, run clockwise). OPAQUE: all its alphas are 1; a face's state has this bit, too.
# TURNED: it has no sides, as it is of a line or a point, so lights find its normals turned to the eye.
SMALL, BACK_FACING, OPAQUE, TURNED = 1, 2, 4, 8

# What is known of an edge before it is seen, one bit each (clpeel/stages/wires.py). WIRED: it is drawn on its faces.
# FIRST_ONE_SIDED, SECOND_ONE_SIDED: its first or second face is not seen from behind. ALIKE: both run along it the same
# way.
WIRED, FIRST_ONE_SIDED, SECOND_ONE_SIDED, ALIKE = 1, 2, 4, 8

MOST_AROUND = 64
"""Where more edges than this are drawn that end at one place, faces there have only their own: lists would be long, and
strokes overlap there anyway."""

BAND_CORNERS, BAND_TRIANGLES = 6, 4
"""Corners and triangles of a band, which an edge is drawn as beside the surface (kernels/stages/wires.cl)."""

LIST_RUN = 64
"""How many faces list_triangles goes through at once (projection.cl)."""

PADDING = 16
"""How many vertices, faces or records a work-item computes at once (wide.h), so it may write some past the last one.

It is also how many numbers a cache line has. Binning writes unwanted numbers to a line of their own (binning.cl).
"""


@dataclass(frozen=True)
class Targets:
    """The render targets of a technique that is executed by passes (peel_passes.h, targets.h).

    depths: depth targets that fragments are blended into. bounds: how many of the last of these the next pass compares
    with. colors: colour targets. facing: whether fragments say from which side they are seen. racing: whether fragments
    read and write the targets without atomics, as on the hardware of Liu, Wei and Xu (2006).
    """

    depths: int
    bounds: int
    colors: int
    facing: bool = False
    racing: bool = False

    @property
    def constants(self) -> dict[str, int]:
        """The constants of a kernel with these targets."""
        counts = {"TARGETS": self.depths, "BOUNDS": self.bounds, "COLOR_TARGETS": self.colors}
        return {"PASSES": 1, **counts, "RACING": int(self.racing)}

    @property
    def take_turns(self) -> bool:
        """Whether all depth targets are compared with in the next pass. Two sets of them then take turns."""
        return self.bounds == self.depths

    @property
    def pixel_bytes(self) -> int:
        """Bytes of a pixel in all buffers together. Besides targets there are three numbers of 4 bytes."""
        return FRAGMENT_BYTES * (self.depths + self.bounds) + COLOR_BYTES * self.colors + 12

    @property
    def widest_bytes(self) -> int:
        """Bytes of a pixel in the largest of the buffers."""
        return max(FRAGMENT_BYTES * self.depths, COLOR_BYTES * self.colors)


@dataclass(frozen=True)
class Features:
    """What kernels are compiled for. It depends on the scene and the request.

    lanes: work-items that share a tile. Stages that make no fragments use nothing but this, so they are compiled once
    for all kinds of scenes: for `Features(lanes)`.
    """

    lanes: int
    color_rate: str = "scene"  # or "face", or "vertex"
    packed_color: bool = True  # colours come as 4 bytes rather than 4 floats
    headlight: bool = False  # a light at the camera dims the colours as given
    surfaces: str = "transparent"  # or "opaque", or "mixed": opaque faces are marked and drawn first
    materials: bool = False  # faces may have materials
    routed: bool = False  # the texels of some say which of their fragments are there
    hiding: bool = False  # and which of them are opaque
    levels: bool = False  # textures have mip maps, or filters of which level of detail chooses one
    probes: int = 1  # the most samples of a texture along a pixel's longer side
    pattern: int = REGULAR  # where samples lie (samples.py)
    depth_format: DepthFormat = DEPTH_FORMATS[FLOAT32_REVERSED]
    lights: bool = False  # lights fall on surfaces (kernels/shading/lights.h)
    positioned: bool = False  # some of them have places
    maps: bool = False  # textures say what some materials are, besides their colours
    full_highlights: bool = False  # what highlights lie on does not dim them
    wires: bool = False  # edges are drawn (kernels/shading/wires.h)
    linear: bool = False  # colours are blended as linear light, instead of as they are shown

    @property
    def fragment_color(self) -> bool:
        """Whether each fragment has a colour of its own, instead of its face's colour."""
        return self.color_rate == "vertex" or self.headlight or self.lights or self.materials or self.wires

    @property
    def fragment_bytes(self) -> int:
        """Bytes of one fragment: depth and payload, and a float4 if fragments have colours of their own."""
        return FRAGMENT_BYTES + (COLOR_BYTES if self.fragment_color else 0)

    @property
    def strip(self) -> int:
        """How many pixels of a block a lane works on at once."""
        return min(BLOCK_PIXELS, TILE_PIXELS // self.lanes)

    @property
    def wide(self) -> int:
        """How many vertices or triangles a work-item computes at once.

        A CPU has vectors, so it computes several. It is also where a work-item has a tile to itself: lanes is 1.
        """
        return PADDING if self.lanes == 1 else 1

    def options(self) -> list[str]:
        """The features as -D options of the compiler."""
        flags = {
            "LANES": self.lanes,
            "STRIP": self.strip,
            "WIDE": self.wide,
            "COLOR_RATE_FACE": int(self.color_rate == "face"),
            "COLOR_RATE_VERTEX": int(self.color_rate == "vertex"),
            "PACKED_COLOR": int(self.packed_color),
            "HEADLIGHT": int(self.headlight),
            "LIGHTS": int(self.lights),
            "POSITIONED": int(self.positioned),
            "MAPS": int(self.maps),
            "FULL_HIGHLIGHTS": int(self.full_highlights),
            "WIRES": int(self.wires),
            "FRAGMENT_COLOR": int(self.fragment_color),
            "MIXED": int(self.surfaces == "mixed"),
            "MATERIALS": int(self.materials),
            "ROUTED": int(self.routed),
            "HIDING": int(self.hiding),
            "LEVELS": int(self.levels),
            "PROBES": self.probes,
            "PATTERN": f"{self.pattern:#x}u",
            "DEPTH_FORMAT": DEPTH_FORMATS.index(self.depth_format),
            "LINEAR": int(self.linear),
        }
        return [f"-D{name}={value}" for name, value in flags.items()]
