"""Draws where the samples of a pixel lie, as docs/samples.md shows: python tools/sample_patterns.py.

It writes docs/samples/patterns.png: a pixel with 4, with 8 and with 16 samples, and the columns and rows between them.
Below it is a fan of thin lines with 1, 4, 8, 16 and 64 samples, in docs/samples/lines.png.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw

import clpeel
from clpeel.device.samples import PATTERNS

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "samples"
SIDE, GAP, DOT = 240, 24, 6
LINES, SIZE, ENLARGED = 14, 72, 3
NUMBERS: tuple[Literal[1, 4, 8, 16, 64], ...] = (1, 4, 8, 16, 64)


def patterns() -> Image.Image:
    """A pixel for each rotated pattern, with a dot for each sample."""
    shown = [pattern for pattern in PATTERNS.values() if pattern.down is not None]
    picture = Image.new("RGB", (len(shown) * (SIDE + GAP) + GAP, SIDE + 2 * GAP), "white")
    draw = ImageDraw.Draw(picture)
    for number, pattern in enumerate(shown):
        left, count = GAP + number * (SIDE + GAP), len(pattern.places)
        for line in range(count + 1):
            at = line * SIDE // count
            draw.line((left + at, GAP, left + at, GAP + SIDE), fill="#d8dce2")
            draw.line((left, GAP + at, left + SIDE, GAP + at), fill="#d8dce2")
        for column in range(pattern.columns + 1):
            at = left + column * SIDE // pattern.columns
            draw.line((at, GAP, at, GAP + SIDE), fill="#707880", width=2)
        for row in range(pattern.rows + 1):
            at = GAP + row * SIDE // pattern.rows
            draw.line((left, at, left + SIDE, at), fill="#707880", width=2)
        for x, y in pattern.places:
            at_x, at_y = left + x * SIDE, GAP + y * SIDE
            draw.ellipse((at_x - DOT, at_y - DOT, at_x + DOT, at_y + DOT), fill="#c0392b")
    return picture


def fan() -> clpeel.Scene:
    """Lines 1.2 pixels wide, at many angles, in a view of SIZE pixels that is one unit high for each."""
    angle = np.radians(2 + 5 * np.arange(LINES))[:, None, None]
    along = np.concatenate([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=2)
    across = along[..., [1, 0, 2]] * (-1, 1, 0)
    ends, sides = np.array([9, 66, 66, 9])[:, None], np.array([-0.6, -0.6, 0.6, 0.6])[:, None]
    corners = along * ends + across * sides - (SIZE / 2 - 2, SIZE / 2 - 2, 0)
    faces = 4 * np.arange(LINES)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return clpeel.Scene.from_arrays(corners.reshape(-1, 3), faces.reshape(-1, 3), color=(0.1, 0.2, 0.5, 0.9))


def lines() -> Image.Image:
    """The fan with each number of samples, enlarged."""
    angle = float(np.degrees(2 * np.arctan(SIZE / 2)))
    camera = clpeel.Camera((0, 0, 1), (0, 0, 0), view_angle=angle, clipping_range=(0.25, 4), orthographic=True)
    renderer = clpeel.Renderer(fan())
    drawn = [
        renderer.render(camera, (SIZE, SIZE), background="white", lighting="none", samples=number).image[..., :3]
        for number in NUMBERS
    ]
    picture = Image.fromarray(np.concatenate(drawn, axis=1))
    return picture.resize((picture.width * ENLARGED, picture.height * ENLARGED), Image.Resampling.NEAREST)


def main() -> None:
    """Draw and write both."""
    FOLDER.mkdir(exist_ok=True)
    patterns().save(FOLDER / "patterns.png", optimize=True)
    lines().save(FOLDER / "lines.png", optimize=True)


if __name__ == "__main__":
    main()
