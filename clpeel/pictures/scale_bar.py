"""The scale bar: shows beside a picture's model, or in a corner, which colour stands for which number."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clpeel.pictures.colormap import OUTSIDE, colors_at

if TYPE_CHECKING:
    from PIL import Image

    from clpeel.pictures.colormaps import ColorMap, Rgba

LEAST_WIDTH, LEAST_HEIGHT = 160, 120
"""The least size in pixels of a picture that has room for a scale bar."""

PANEL = (255, 255, 255, 216)
INK = (32, 32, 32, 255)
PALE = 224
"""Colours whose least channel is above this have an outline."""

SIZES = (1.0, 0.8, 0.65)
"""How large a bar may be to fit beside the model, as a share of its usual size. The first that fits is taken."""

LEAST_TEXT = 10
"""The least height of text in pixels."""

MOST_TICKS = 6


@dataclass(frozen=True)
class Scale:
    """What a scale bar shows, from top to bottom.

    label: what the numbers are. ramp: the RGB of places 0..1 along the bar, 0..1; None without one. ticks: where
    numbers stand along it, and their texts. boxes: single colours, and their texts.
    """

    label: str
    ramp: Callable[[NDArray[np.float64]], NDArray[Any]] | None
    ticks: Sequence[tuple[float, str]]
    boxes: Sequence[tuple[str, Rgba]]


@dataclass(frozen=True)
class Box:
    """A part of a picture, in pixels: where its upper left corner is, and its size."""

    x: int
    y: int
    width: int
    height: int

    @property
    def rows_and_columns(self) -> tuple[slice, slice]:
        """The part of an array [height, width] that it is."""
        return slice(max(self.y, 0), self.y + self.height), slice(max(self.x, 0), self.x + self.width)


# --- numbers on it ----------------------------------------------------------------------------------------------------


def ticks(low: float, high: float, most: int = MOST_TICKS, whole: bool = False) -> list[float]:
    """Return at most `most` round numbers in low..high. They are 1, 2 or 5 times a power of ten apart.

    whole: the distance is at least 1.
    """
    step = 10.0 ** math.floor(math.log10((high - low) / most))
    step = max(step, 1.0) if whole else step
    for factor in (1, 2, 5, 10, 20, 50):
        first, last = math.ceil(low / (step * factor) - 1e-9), math.floor(high / (step * factor) + 1e-9)
        if last - first < most:
            break
    return [number * step * factor for number in range(first, last + 1)]


def log_ticks(low: float, high: float, most: int = MOST_TICKS) -> list[float]:
    """Return at most `most` round numbers in low..high for a logarithmic bar.

    They are powers of ten, and as many of their multiples as there is room for. Within less than a factor of two they
    are those of `ticks`.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    if first < -300 or last > 300:
        return [low, high]
    slack = 1 + 1e-9
    for digits in ((1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,)):
        found = [float(f"{digit}e{power}") for power in range(first, last + 1) for digit in digits]
        found = [value for value in found if low / slack <= value <= high * slack]
        if len(found) <= most:
            break
    if len(found) < 2:
        return ticks(low, high, most)
    step = math.ceil(len(found) / most)
    return found[::step]


def scale_of(colors: ColorMap) -> Scale:
    """Return the scale of a colour map."""
    if colors.categories:
        rows = zip(colors.categories, colors.colors.tolist(), strict=True)
        kinds = [(name, (red, green, blue, 255)) for name, (red, green, blue, _) in rows]
        return Scale(colors.label, None, (), [*kinds, *colors.boxes])
    low, high = colors.clim
    numbers = log_ticks(low, high) if colors.log_scale else ticks(low, high)
    count = len(colors.colors)

    def ramp(places: NDArray[np.float64]) -> NDArray[Any]:
        return colors.colors[np.minimum((places * count).astype(np.int64), count - 1), :3] / 255

    at = colors.places(numbers) / count
    shown = [(float(place), f"{value:.6g}") for place, value in zip(at, numbers, strict=True)]
    return Scale(colors.label, ramp, shown, colors.boxes)


# --- drawing it -------------------------------------------------------------------------------------------------------


def draw_scale_bar(
    image: NDArray[np.uint8],
    low: float,
    high: float,
    label: str,
    occupied: NDArray[np.bool_],
    unpaired: bool,
    whole: bool = False,
) -> None:
    """Draw the bar of a map for low..high into the least occupied corner, or nothing if the picture is too small.

    image: uint8 [height, width, 4], straight alpha, changed in place. occupied: bool [height, width]. unpaired: whether
    to explain the colour OUTSIDE, too. whole: whether there are only whole numbers.
    """
    height, width = occupied.shape
    if width < LEAST_WIDTH or height < LEAST_HEIGHT:
        return
    red, green, blue = (int(part * 255) for part in OUTSIDE)
    shown = [((value - low) / (high - low), f"{value:.6g}") for value in ticks(low, high, whole=whole)]
    boxes = [("unpaired", (red, green, blue, 255))] if unpaired else []
    panel, pad = _panel(Scale(label, colors_at, shown, boxes), width, height, 1.0)
    if panel.width + 2 * pad > width or panel.height + 2 * pad > height:
        return
    places = _corners(panel, pad, width, height)
    x, y = min(places, key=lambda at: int(occupied[at[1] : at[1] + panel.height, at[0] : at[0] + panel.width].sum()))
    _put(image, panel, x, y)


def draw_beside(image: NDArray[np.uint8], scale: Scale, occupied: NDArray[np.bool_]) -> Box | None:
    """Draw a scale bar where nothing is, and return where; or None if there is no such place, however small the bar.

    image, occupied: as for draw_scale_bar. Corners come first, then other places, the rightmost of them.
    """
    height, width = occupied.shape
    if width < LEAST_WIDTH or height < LEAST_HEIGHT:
        return None
    sums = np.pad(np.cumsum(np.cumsum(occupied, axis=0, dtype=np.int64), axis=1), ((1, 0), (1, 0)))
    for size in SIZES:
        panel, pad = _panel(scale, width, height, size)
        down, across = height - panel.height - 2 * pad, width - panel.width - 2 * pad
        if down < 0 or across < 0:
            continue
        tall, wide = panel.height, panel.width
        inside = sums[tall:, wide:] - sums[:-tall, wide:] - sums[tall:, :-wide] + sums[:-tall, :-wide]
        free = inside[pad : pad + down + 1, pad : pad + across + 1] == 0
        corners = [(x, y) for x, y in _corners(panel, pad, width, height) if free[y - pad, x - pad]]
        rows, columns = np.nonzero(free)
        if not len(rows):
            continue
        best = int(np.lexsort((-rows, -columns))[0])
        x, y = corners[0] if corners else (int(columns[best]) + pad, int(rows[best]) + pad)
        _put(image, panel, x, y)
        return Box(x, y, panel.width, panel.height)
    return None


def _corners(panel: Image.Image, pad: int, width: int, height: int) -> list[tuple[int, int]]:
    """Return where a panel is in each corner of a picture: below and on the right first."""
    return [(x, y) for y in (height - panel.height - pad, pad) for x in (width - panel.width - pad, pad)]


def _put(image: NDArray[np.uint8], panel: Image.Image, x: int, y: int) -> None:
    """Put a panel over a picture, which is changed in place."""
    from PIL import Image

    under = image[y : y + panel.height, x : x + panel.width]
    under[...] = np.asarray(Image.alpha_composite(Image.fromarray(np.ascontiguousarray(under)), panel))


def _panel(scale: Scale, width: int, height: int, share: float) -> tuple[Image.Image, int]:
    """Return the bar with its texts on a panel, and how far it lies from the edges of a picture of this size."""
    from PIL import Image, ImageDraw, ImageFont

    size = max(LEAST_TEXT, int(min(width, height) // 36 * share))
    font = ImageFont.load_default(size)

    def length(text: str) -> int:
        return math.ceil(font.getlength(text))

    pad, bar_width, gap, line = size // 2, size, max(size // 4, 2), math.ceil(size * 1.3)
    bar_height = 0 if scale.ramp is None else max(int(height * 3 // 10 * share), 4 * size)
    boxes = _that_fit(scale.boxes, (height - 4 * pad - bar_height - 2 * line) // line)
    widths = [bar_width + 2 * gap + length(text) for _, text in scale.ticks]
    widths += [bar_width + gap + length(text) for text in [text for text, _ in boxes] or [scale.label]]
    inner_width = max(length(scale.label), *widths)
    panel_height = bar_height + line * (len(boxes) + 1 + (scale.ramp is not None)) + 2 * pad
    panel = Image.new("RGBA", (inner_width + 2 * pad, panel_height), PANEL)
    draw = ImageDraw.Draw(panel)
    draw.text((pad, pad), scale.label, INK, font)
    top = pad + line + size // 2
    if scale.ramp is not None:
        ramp = scale.ramp(1 - (np.arange(bar_height) + 0.5) / bar_height)[:, None] * 255 + 0.5
        panel.paste(Image.fromarray(np.repeat(ramp, bar_width, axis=1).astype(np.uint8)), (pad, top))
    for place, text in scale.ticks:
        y = top + round((1 - place) * (bar_height - 1))
        draw.line((pad + bar_width, y, pad + bar_width + gap, y), INK)
        draw.text((pad + bar_width + 2 * gap, y), text, INK, font, anchor="lm")
    first = top + bar_height + size * 3 // 4 if scale.ramp is not None else top - size // 4
    for number, (text, color) in enumerate(boxes):
        y = first + number * line
        if color[3]:
            pale = INK if min(color[:3]) > PALE else None  # on the panel
            draw.rectangle((pad, y, pad + bar_width - 1, y + bar_width - 1), color, pale)
        draw.text((pad + bar_width + gap, y + bar_width // 2), text, INK, font, anchor="lm")
    return panel, pad


def _that_fit(boxes: Sequence[tuple[str, Rgba]], most: int) -> Sequence[tuple[str, Rgba]]:
    """Return the boxes, or as many as fit and how many more there are."""
    if len(boxes) <= max(most, 2):
        return boxes
    shown = max(most, 2) - 1
    return [*boxes[:shown], (f"and {len(boxes) - shown} more", (0, 0, 0, 0))]
