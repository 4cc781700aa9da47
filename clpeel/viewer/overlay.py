"""The overlay: text on translucent plates over the picture. It shows the status, the keys, and the panel for the mouse.

Everything is laid out in real pixels, so that text is sharp. A plate always fits into the picture: if there is little
room, its text is smaller, and what does not fit even then is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from clpeel.rendering.options import Size
from clpeel.viewer.controls import KEYS
from clpeel.viewer.panel import Row, rows_of, texts
from clpeel.viewer.status import Status, lines_of

FONT = 13
"""The height of text in logical pixels."""

LEAST_FONT = 6
"""The least height of text in real pixels."""

WIDEST = 44
"""The width of lines, in heights of the text, after which they are broken."""

MARGIN = 8
"""The distance of plates from the edges of the picture, in logical pixels."""

Color = tuple[int, int, int, int]
PLATE: Color = (16, 18, 22, 184)
INK: Color = (255, 255, 255, 255)
DIM: Color = (200, 204, 210, 255)
GREY: Color = (140, 144, 150, 255)
BUTTON: Color = (72, 78, 90, 255)
ACCENT: Color = (140, 200, 255, 255)
NOTICE: Color = (255, 214, 110, 255)

LESS, MORE = "  <  ", "  >  "
"""What is clicked for a setting's previous and next value."""


class Cell(NamedTuple):
    """A text of a table. middle: whether it is in the middle of its column, not at the left. back: of its button."""

    text: str
    color: Color = INK
    middle: bool = False
    back: Color | None = None


Table = tuple[tuple[Cell, ...], ...]
"""Rows of cells. All rows have equally many."""


@dataclass(frozen=True)
class Plate:
    """A table that is laid out. All numbers are real pixels of the picture.

    left, top, width, height: of the plate. font: the height of its text. line: the height of a row. columns: the left
    edge of each column, from the plate's, and the right edge of the last one. table: the rows that fit.
    """

    left: int
    top: int
    width: int
    height: int
    font: int
    line: int
    columns: tuple[int, ...]
    table: Table

    def has(self, x: float, y: float) -> bool:
        """Return whether a place of the picture is on the plate."""
        return 0 <= x - self.left < self.width and 0 <= y - self.top < self.height

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Return the row and the column at a place of the picture, or None if there is none."""
        row = int((y - self.top - self.pad) // self.line)
        column = int(np.searchsorted(self.columns, x - self.left, side="right")) - 1
        if 0 <= row < len(self.table) and 0 <= column < len(self.columns) - 1:
            return row, column
        return None

    def box(self, row: int, column: int) -> tuple[int, int, int, int]:
        """Return the left, top, right and bottom edge of a cell in the picture."""
        top = self.top + self.pad + row * self.line
        return self.left + self.columns[column], top, self.left + self.columns[column + 1], top + self.line

    @property
    def pad(self) -> int:
        return self.font // 2

    def draw(self, image: NDArray[np.uint8]) -> None:
        """Draw the plate over uint8 [height, width, 4], which is opaque, in place."""
        if not self.table:
            return
        under = image[self.top : self.top + self.height, self.left : self.left + self.width]
        drawn = _drawn(self.width, self.height, self.font, self.line, self.columns, self.table)
        under[...] = np.asarray(Image.alpha_composite(Image.fromarray(np.ascontiguousarray(under)), drawn))


# --- what there is to show --------------------------------------------------------------------------------------------


def draw_overlay(
    image: NDArray[np.uint8], status: Status, ratio: float, *, help: bool = False, panel: bool = False
) -> None:
    """Draw what there is to show over a picture, in place.

    image: uint8 [height, width, 4], opaque. ratio: real pixels of a logical one. help, panel: whether they are shown.
    """
    size = free = image.shape[1], image.shape[0]
    if help:
        help_plate(size, ratio).draw(image)
    elif panel:
        plate = panel_plate(status, size, ratio)
        plate.draw(image)
        free = plate.left, size[1]
    beside = free[0] >= size[0] // 4  # whether there is room beside the panel
    if beside and not help:
        status_plate(lines_of(status), free, ratio).draw(image)
    if status["notice"]:
        notice_plate(status["notice"], free if beside else size, ratio).draw(image)


def status_plate(lines: Sequence[str], size: Size, ratio: float) -> Plate:
    """Lay out lines of text at the bottom left. They take the lower half at most."""
    first, *others = lines
    room = Room.of(size, ratio)._replace(top=size[1] // 2)
    return _text([Cell(first, ACCENT), *map(Cell, others)], room, ratio, (0.0, 1.0))


def notice_plate(text: str, size: Size, ratio: float) -> Plate:
    """Lay out a notice at the top, in the middle. It takes the upper half at most."""
    room = Room.of(size, ratio)._replace(bottom=size[1] // 2)
    return _text([Cell(text, NOTICE)], room, ratio, (0.5, 0.0))


def help_plate(size: Size, ratio: float) -> Plate:
    """Lay out what keys do, in the middle: in two columns, or in as many as make the text largest."""
    found = {columns: _help(size, ratio, columns) for columns in (2, 1, 3)}
    best = max(found, key=lambda columns: (min(len(found[columns].table) * columns, len(KEYS)), found[columns].font))
    return found[best]


def _help(size: Size, ratio: float, columns: int) -> Plate:
    count = -(-len(KEYS) // columns)
    cells = [(Cell(key, ACCENT), Cell(what), Cell("  ")) for key, what in KEYS]
    cells += [(Cell(""),) * 3] * (count * columns - len(cells))
    table = tuple(tuple(cell for key in cells[row::count] for cell in key) for row in range(count))
    return _fitted(lambda font: table, Room.of(size, ratio), ratio, (0.5, 0.5))


def panel_plate(status: Status, size: Size, ratio: float) -> Plate:
    """Lay out the panel at the top right. `setting_at` tells what is clicked there."""

    def cells(row: Row) -> tuple[Cell, ...]:
        color, ink, back = (DIM, INK, BUTTON) if row.live else (GREY, GREY, None)
        less, more = (Cell(text, ink, True, back) for text in (LESS, MORE))
        return Cell(row.label, color), less, Cell(row.value, ink, True), more

    table = tuple(map(cells, rows_of(status)))
    longest = tuple((Cell(""), Cell(""), Cell(text), Cell("")) for text in texts())  # so that the arrows stay in place
    return _fitted(lambda font: table, Room.of(size, ratio), ratio, (1.0, 0.0), longest)


def setting_at(plate: Plate, status: Status, x: float, y: float) -> tuple[str, int] | None:
    """Return the setting and 1 or -1 for its next or previous value, at a place of the picture in real pixels.

    It is None where there is nothing to click. plate: that of the panel.
    """
    found = plate.cell_at(x, y)
    if found is None:
        return None
    row = rows_of(status)[found[0]]
    by = {LESS: -1, MORE: 1}.get(plate.table[found[0]][found[1]].text)
    return (row.name, by) if by is not None and row.live else None


# --- laying out -------------------------------------------------------------------------------------------------------

Place = tuple[float, float]
"""Where in a room a plate is: (0, 0) is at the top left, (1, 1) is at the bottom right."""


class Room(NamedTuple):
    """A part of the picture, in real pixels."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def of(cls, size: Size, ratio: float) -> Room:
        """Return the whole picture but for a margin."""
        margin = min(round(MARGIN * ratio), min(size) // 16)
        return cls(margin, margin, size[0] - margin, size[1] - margin)


def _text(cells: Sequence[Cell], room: Room, ratio: float, place: Place) -> Plate:
    """Lay out lines, which are broken where they are too long."""

    def table(font: int) -> Table:
        width = min(room.right - room.left - 2 * (font // 2), WIDEST * font)
        return tuple((cell._replace(text=line),) for cell in cells for line in broken(cell.text, font, width))

    return _fitted(table, room, ratio, place)


def _fitted(table: Callable[[int], Table], room: Room, ratio: float, place: Place, widest: Table = ()) -> Plate:
    """Lay out a table with the largest text that fits, up to the usual one.

    table: takes the height of the text. widest: rows that are not shown. The columns are as wide as if they were.
    """
    across, down = room.right - room.left, room.bottom - room.top
    for font in range(max(round(FONT * ratio), LEAST_FONT), LEAST_FONT - 1, -1):
        rows = table(font)
        widths = _widths(rows + widest, font)
        line, pad = _line(font), font // 2
        width, height = sum(widths) + pad, len(rows) * line + 2 * pad
        if width <= across and height <= down:
            break
    else:
        rows = rows[: max((down - 2 * pad) // line, 0)]
        share = min((across - pad) / (width - pad), 1.0)
        widths = [int(each * share) for each in widths]
        width, height = sum(widths) + pad, len(rows) * line + 2 * pad
        rows = tuple(
            tuple(cell._replace(text=cut(cell.text, font, own - pad)) for cell, own in zip(row, widths, strict=True))
            for row in rows
        )
    columns = [pad]
    for each in widths:
        columns.append(columns[-1] + each)
    columns[-1] = width
    left, top = room.left + int((across - width) * place[0]), room.top + int((down - height) * place[1])
    return Plate(left, top, width, height, font, line, tuple(columns), rows)


def _line(font: int) -> int:
    return -(-font * 13 // 10)


def _widths(table: Table, font: int) -> list[int]:
    """Return the width of each column, with the gap after it."""
    return [max(int(length(cell.text, font)) + 1 for cell in column) + font // 2 for column in zip(*table, strict=True)]


def broken(text: str, font: int, width: float) -> Iterable[str]:
    """Break a text into lines of at most so many pixels, between its words. A longer word has a line of its own."""
    line = ""
    for word in text.split():
        longer = f"{line} {word}" if line else word
        if line and length(longer, font) > width:
            yield line
            longer = word
        line = longer
    yield line


def cut(text: str, font: int, width: float) -> str:
    """Return the text, or as much of it as fits into so many pixels."""
    while text and length(text, font) > width:
        text = text[:-1]
    return text


# --- drawing ----------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def _font(height: int) -> ImageFont.FreeTypeFont:
    found = ImageFont.load_default(height)
    assert isinstance(found, ImageFont.FreeTypeFont)
    return found


@lru_cache(maxsize=4096)
def length(text: str, font: int) -> float:
    """Return the width of a text in pixels. font: its height."""
    return _font(font).getlength(text)


@lru_cache(maxsize=256)
def _text_mask(text: str, font: int, line: int) -> Image.Image:
    """Return how much of each pixel a text covers, in the middle of its line. This takes most of the time."""
    mask = Image.new("L", (int(length(text, font)) + font // 2, line))
    ImageDraw.Draw(mask).text((0, line // 2), text, 255, _font(font), anchor="lm")
    return mask


@lru_cache(maxsize=8)
def _drawn(width: int, height: int, font: int, line: int, columns: tuple[int, ...], table: Table) -> Image.Image:
    """Return a plate's picture, RGBA."""
    plate = Image.new("RGBA", (width, height), PLATE)
    draw, gap = ImageDraw.Draw(plate), font // 2
    for y, row in zip(range(gap, height, line), table, strict=False):
        for cell, left, right in zip(row, columns, columns[1:], strict=False):
            if cell.back:
                draw.rounded_rectangle((left, y + 1, right - gap - 1, y + line - 2), font // 4, cell.back)
            if cell.text:
                aside = (right - gap - left - length(cell.text, font)) / 2 if cell.middle else 0
                plate.paste(cell.color, (left + int(aside), y), _text_mask(cell.text, font, line))
    return plate
