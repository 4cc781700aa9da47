"""A sheet's picture: a title, and cells side by side with their labels. A cell without a picture says why."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from sheets.programs import Cell
from sheets.views import SIDE

GAP, LINE, TEXT = 8, 30, 18
"""Pixels between cells, height of a line of text, and size of the letters."""

PAPER, INK, EMPTY = "white", "black", "#eeeeee"
MOST_BYTES = 300_000
"""A sheet that would have more bytes than this as PNG is a JPEG. A palette would lose the rare colours of marks."""


def composed(title: str, cells: Sequence[Cell]) -> Image.Image:
    """Return the sheet."""
    width = len(cells) * (SIDE + GAP) - GAP
    page = Image.new("RGB", (width, 2 * LINE + SIDE), PAPER)
    pen = ImageDraw.Draw(page)
    font = ImageFont.load_default(TEXT)
    pen.text((0, 4), title, INK, font)
    for place, cell in enumerate(cells):
        left = place * (SIDE + GAP)
        pen.text((left, LINE + 4), cell.label, INK, font)
        page.paste(cell.picture or empty(cell.why), (left, 2 * LINE))
    return page


def empty(why: str) -> Image.Image:
    """Return a cell that says why it has no picture."""
    cell = Image.new("RGB", (SIDE, SIDE), EMPTY)
    font = ImageFont.load_default(TEXT)
    text = "\n".join(textwrap.wrap(f"no picture: {why}", 48))
    ImageDraw.Draw(cell).multiline_text((SIDE / 2, SIDE / 2), text, INK, font, anchor="mm", align="center")
    return cell


def encoded(page: Image.Image) -> tuple[str, bytes]:
    """Return the sheet's file: how its name ends, and its bytes. It is PNG if that is small enough, else JPEG."""
    file = io.BytesIO()
    page.save(file, "PNG", optimize=True)
    if len(file.getvalue()) <= MOST_BYTES:
        return ".png", file.getvalue()
    file = io.BytesIO()
    page.save(file, "JPEG", quality=92, subsampling=0)
    return ".jpg", file.getvalue()
