"""The scale bar: shows in a corner of a picture which colour stands for which number."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clpeel.pictures.colormap import OUTSIDE, colors_at

LEAST_WIDTH, LEAST_HEIGHT = 160, 120
"""The least size in pixels of a picture that has room for a scale bar."""

PANEL = (255, 255, 255, 216)
INK = (32, 32, 32, 255)


def ticks(low: float, high: float, most: int = 6, whole: bool = False) -> list[float]:
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


def draw_scale_bar(
    image: NDArray[np.uint8],
    low: float,
    high: float,
    label: str,
    occupied: NDArray[np.bool_],
    unpaired: bool,
    whole: bool = False,
) -> None:
    """Draw the bar for low..high into the least occupied corner, or nothing if the picture is too small.

    image: uint8 [height, width, 4], straight alpha, changed in place. occupied: bool [height, width]. unpaired: whether
    to explain the colour OUTSIDE, too. whole: whether there are only whole numbers.
    """
    from PIL import Image, ImageDraw, ImageFont

    height, width = occupied.shape
    if width < LEAST_WIDTH or height < LEAST_HEIGHT:
        return
    size = max(10, min(width, height) // 36)
    font = ImageFont.load_default(size)
    shown = ticks(low, high, whole=whole)
    texts = [f"{value:.6g}" for value in shown]
    notes = [label, *(["unpaired"] if unpaired else [])]

    def length(text: str) -> int:
        return math.ceil(font.getlength(text))

    pad, bar_width, gap, line = size // 2, size, max(size // 4, 2), math.ceil(size * 1.3)
    bar_height = max(height * 3 // 10, 4 * size)
    inner_width = max(bar_width + 2 * gap + max(map(length, texts)), length(label), bar_width + gap + length(notes[-1]))
    panel_width, panel_height = inner_width + 2 * pad, bar_height + line * (len(notes) + 1) + 2 * pad
    if panel_width + 2 * pad > width or panel_height + 2 * pad > height:
        return
    panel = Image.new("RGBA", (panel_width, panel_height), PANEL)
    draw = ImageDraw.Draw(panel)
    draw.text((pad, pad), label, INK, font)
    top = pad + line + size // 2
    ramp = colors_at(1 - (np.arange(bar_height) + 0.5) / bar_height)[:, None] * 255 + 0.5
    panel.paste(Image.fromarray(np.repeat(ramp, bar_width, axis=1).astype(np.uint8)), (pad, top))
    for value, text in zip(shown, texts, strict=True):
        y = top + round((high - value) / (high - low) * (bar_height - 1))
        draw.line((pad + bar_width, y, pad + bar_width + gap, y), INK)
        draw.text((pad + bar_width + 2 * gap, y), text, INK, font, anchor="lm")
    if unpaired:
        y = top + bar_height + size // 2
        draw.rectangle((pad, y, pad + bar_width - 1, y + bar_width - 1), tuple(int(part * 255) for part in OUTSIDE))
        draw.text((pad + bar_width + gap, y + bar_width // 2), "unpaired", INK, font, anchor="lm")

    places = [(x, y) for y in (height - panel_height - pad, pad) for x in (width - panel_width - pad, pad)]
    x, y = min(places, key=lambda at: int(occupied[at[1] : at[1] + panel_height, at[0] : at[0] + panel_width].sum()))
    under = image[y : y + panel_height, x : x + panel_width]
    under[...] = np.asarray(Image.alpha_composite(Image.fromarray(np.ascontiguousarray(under)), panel))
