"""The options of all pictures, whatever the technique. Nothing here needs NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

from clpeel import checks
from clpeel.checks import MAX_SIDE, Background, GivenBackground, Rgb, checked_background, checked_size
from clpeel.device.layout import MOST_WIDTH, DepthFormat, PointType
from clpeel.device.samples import PATTERNS, Pattern
from clpeel.errors import InputError
from clpeel.options import COLOR, MEMORY, SHARE, Kind, Options, not_negative, option, read_within

Size = tuple[int, int]
Lighting = Literal["none", "headlight", "kit", "scene"]
Highlights = Literal["dimmed", "full"]
Opaque = Literal["first", "blend"]
Execution = Literal["tiles", "passes"]
Backfaces = Literal["default", "visible", "hidden"]
BlendingSpace = Literal["srgb", "linear"]

BACKGROUND: Rgb = (200 / 255, 204 / 255, 210 / 255)
"""Behind a scene by default: a light grey, before which white things show and black ones, and those that let light
through.
"""

FOREMOST_MAPS = ("depth", "normal", "triangle")
"""Maps of the surface that is seen first at a pixel's centre, however transparent it is."""

VIEW_MAPS = (*FOREMOST_MAPS, "layer_count", "transmittance")
"""Maps that pictures of any technique may have besides the technique's own (rendering/maps.py)."""

SAMPLES = 4
"""Samples a pixel by default. Maps, such as thicknesses, and layers have 1: there the pixel's centre counts."""


def default_lighting(has_lights: bool) -> Lighting:
    """Return what light falls on a scene if nobody says it: its own, if it has some, else the kit."""
    return "scene" if has_lights else "kit"


def _checked_size(name: str, value: object) -> object:
    return checked_size(cast(Sequence[int], value))


def _checked_background(name: str, value: object) -> object:
    return checked_background(value)


def checked_layers(name: str, value: object) -> bool:
    """The value as a bool. Raises InputError for a number: its author probably meant layers_per_pass."""
    if type(value).__name__ not in ("bool", "bool_"):  # NumPy's bool has either name
        raise InputError(f"{name}: expected True or False, got {value!r}; layers in each pass are layers_per_pass")
    return bool(value)


def _checked_maps(name: str, value: object) -> tuple[str, ...]:
    """The names of maps, each once. Raises InputError if they are no names; the technique says which there are."""
    given = (value,) if isinstance(value, str) else value
    if not isinstance(given, Sequence) or not all(isinstance(each, str) for each in given):
        raise InputError(f"{name}: expected names of maps, such as ('depth', 'normal'), got {value!r}")
    return tuple(dict.fromkeys(given))


def _checked_length(name: str, value: object) -> object:
    return checks.length(name, value, MOST_WIDTH)


def _checked_angle(name: str, value: object) -> float:
    found = math.nan if isinstance(value, bool) else checks.number(value)
    if not 0 <= found <= 180:
        raise InputError(f"{name}: expected degrees, 0..180, got {value!r}")
    return found


def _read_angle(text: str) -> float:
    return read_within(text, 0, 180, "degrees, 0..180")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PictureOptions(Options):
    """The options of all pictures, whatever the technique.

    size: (width, height) in pixels. background: three numbers 0..1, text such as "white", a pair of these for a
    gradient from top to bottom, or None for straight alpha. samples, lighting: None for the defaults of a technique and
    a scene (rendering/request.py). memory: bytes of the device's memory that the scene and all
    buffers except the picture may take, or text such as "512M"; None for a share of the device's memory. execution:
    "tiles" makes all passes of a tile in one kernel. "passes" is the papers' machine: launches over all fragments and
    all pixels, with atomics as the blending hardware.
    """

    size: Size = option((1024, 1024), Kind(_checked_size, metavar="W,H"), help="width and height in pixels")
    background: GivenBackground = option(
        BACKGROUND,
        Kind(_checked_background, metavar="COLOR"),
        help="R,G,B in 0..1, #rrggbb or a name; TOP:BOTTOM for a gradient",
    )
    lighting: Lighting | None = option(
        None,
        help="none (the colours as given), headlight (dimmed by a light at the camera), kit (lights that move with "
        "the camera) or scene (the scene's own lights); by default scene if it has lights, else kit",
    )
    light_intensity: float = option(
        1.0,
        not_negative("a number of 0 or more"),
        help="what the light of kit and scene is multiplied with (default: 1)",
    )
    highlights: Highlights = option(
        "dimmed", help="highlights of transparent surfaces: dimmed by their alpha (default), or full, as of glass"
    )
    samples: Literal[1, 4, 8, 16, 64, 256] | None = option(
        None, help="samples a pixel, averaged for smooth edges: 1, 4, 8, 16, 64 or 256"
    )
    memory: int | str | None = option(
        None, MEMORY, help="device memory to use, such as 512M or 2G (default: a share of the device's)"
    )
    keep_color: bool = option(True, help="whether the result has the float32 colour besides the 8-bit picture")
    layers: bool = option(False, Kind(checked_layers), help="whether the result has the layers of every pixel")
    maps: Sequence[str] = option(
        (),
        Kind(_checked_maps),
        help="maps that the result has besides: depth, normal, triangle, layer_count, transmittance",
    )
    opaque: Opaque = option("first", help="draw opaque surfaces first (default), or blend them as any other")
    execution: Execution = option(
        "tiles", help="draw tile by tile (default), or pass by pass as the papers do, where the technique can"
    )
    backface_type: Backfaces = option(
        "default", help="faces seen from behind: drawn unless the file says one side only (default), visible, or hidden"
    )
    anisotropy: Literal[1, 2, 4, 8, 16] = option(
        1, help="the most samples of a texture where it is seen at a slant: 1, 2, 4, 8 or 16"
    )
    line_width: float | str = option(
        1.0, Kind(_checked_length, metavar="W"), help="width of lines in pixels, or in scene units, such as 0.01u"
    )
    point_size: float | str = option(
        3.0, Kind(_checked_length, metavar="W"), help="width of points in pixels, or in scene units, such as 0.01u"
    )
    point_type: PointType = option("sphere", help="points are discs that lights show as balls, discs, or squares")
    edges: bool = option(False, help="draw the edges of all faces")
    feature_edges: float | None = option(
        None,
        Kind(_checked_angle, _read_angle, "DEGREES"),
        help="draw the edges where faces bend by more than this, and those of one face alone",
    )
    silhouettes: bool = option(False, help="draw the outlines, where a surface hides what lies behind it")
    edge_color: Rgb | str = option("black", COLOR, help="colour of edges and outlines (default: black)")
    edge_opacity: float = option(1.0, SHARE, help="opacity of edges and outlines (default: 1)")
    hidden_edges: float = option(
        0.0, SHARE, help="opacity of edges and outlines that opaque surfaces hide, which shine through (default: 0)"
    )
    depth_format: DepthFormat = option("float32-reversed", help="what is kept of depths (default: float32-reversed)")
    blending_space: BlendingSpace = option(
        "srgb", help="blend colours as they are shown (srgb, default), or as light that adds up (linear)"
    )

    def check_together(self) -> None:
        """Raises InputError if samples make the picture or its lines too large, or for layers with several samples."""
        side = max(self.pattern.columns, self.pattern.rows)
        most = MAX_SIDE // side
        if max(self.size) > most:
            raise InputError(
                f"samples: expected at most {most} pixels a side with {self.samples} samples, got {max(self.size)}"
            )
        for name in ("line_width", "point_size"):
            width = getattr(self, name)
            if not isinstance(width, str) and width * side > MOST_WIDTH:
                pixels = f"{MOST_WIDTH // side:,} pixels with {self.samples} samples"
                raise InputError(f"{name}: expected at most {pixels}, got {width:g}")
        if self.layers and self.samples not in (None, 1):
            raise InputError(f"layers: expected samples=1, got {self.samples!r}")

    @property
    def pattern(self) -> Pattern:
        """Where the samples of a pixel lie."""
        return PATTERNS[self.samples or 1]

    @property
    def over(self) -> Background | None:
        """The background as it was checked."""
        return checked_background(self.background)

    @property
    def memory_limit(self) -> int | None:
        """`memory` in bytes."""
        return None if self.memory is None else checks.parse_memory(self.memory)
