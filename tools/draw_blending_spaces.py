"""Draws docs/looks/blending-space.png: translucent files blended as they are shown, and as linear light.

    python tools/draw_blending_spaces.py [-o FILE]

The files come from the folder `models` in the folder that CLPEEL_SHARED names. Exit codes: 0 done, 2 bad input.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from benchmark.runs import SHARED
from PIL import Image, ImageDraw, ImageFont
from sheets.layout import GAP, INK, LINE, PAPER, TEXT
from sheets.views import ASLANT, View

import clpeel
from clpeel.errors import ClpeelError
from clpeel.files import write_whole
from clpeel.rendering.options import BACKGROUND

OUTPUT = Path(__file__).resolve().parent.parent / "docs" / "looks" / "blending-space.png"
CELL = (400, 210)
"""Pixels of a picture."""

Space = Literal["srgb", "linear"]
SPACES: dict[Space, str] = {"srgb": "srgb: as shown (default)", "linear": "linear: as light"}

MODELS = SHARED / "models"
TRUCK = View("truck", MODELS / "CesiumMilkTruck.glb", ASLANT, zoom=1.35, opacity=0.4)
BOARD = View("board", MODELS / "AlphaBlendModeTest.glb", at=(-2.1, 1.2, 0.0), zoom=3.8)

ROWS: tuple[tuple[str, View, tuple[float, float, float]], ...] = (
    ("glTF, opacity 0.4, over light grey", TRUCK, BACKGROUND),
    ("the same over dark grey", TRUCK, (0.13, 0.14, 0.16)),
    ("glTF with alpha modes: opaque, and blended from 0 at the top to 1", BOARD, BACKGROUND),
)
"""A title, what is seen, and the background."""


def pictures(view: View, background: tuple[float, float, float]) -> Iterator[Image.Image]:
    """Yield the picture in each space, with the light and the smooth edges of the command."""
    scene = clpeel.load(view.model, opacity=view.opacity)
    camera = view.camera(scene)
    for space in SPACES:
        result = clpeel.render(
            scene, camera, CELL, background=background, lighting="kit", samples=4, blending_space=space
        )
        yield Image.fromarray(result.image)


def page() -> Image.Image:
    """Return the sheet: a row for each file, and a column for each space."""
    width, height = CELL
    sheet = Image.new("RGB", (2 * width + GAP, LINE + len(ROWS) * (height + LINE)), PAPER)
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(TEXT)
    for column, label in enumerate(SPACES.values()):
        pen.text((column * (width + GAP), 4), label, INK, font)
    for place, (title, view, background) in enumerate(ROWS):
        top = LINE + place * (height + LINE)
        pen.text((0, top + 4), title, INK, font)
        for column, picture in enumerate(pictures(view, background)):
            sheet.paste(picture, (column * (width + GAP), top + LINE))
    return sheet


def encoded(sheet: Image.Image) -> bytes:
    """Return the sheet as a PNG."""
    file = io.BytesIO()
    sheet.save(file, "PNG", optimize=True)
    return file.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    parser = argparse.ArgumentParser(prog="draw_blending_spaces.py", description=__doc__)
    parser.add_argument("--output", "-o", type=Path, default=OUTPUT, metavar="FILE")
    options = parser.parse_args(arguments)
    try:
        write_whole(options.output, encoded(page()))
    except ClpeelError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
