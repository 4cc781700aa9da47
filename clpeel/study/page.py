"""A comparison as one self-contained HTML page: a plot, a table, pictures, and maps of their errors.

Jinja2 fills in the template (templates/comparison.html). The plot and the colour scale are SVG, written here.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.pictures.colormap import colors_at
from clpeel.pictures.png import STEP, encode_png
from clpeel.study.tables import COLUMNS, error_text, milliseconds

if TYPE_CHECKING:
    from clpeel.study.comparison import Comparison, Row

LEAST_STEP, MOST_STEP = 0.25, 255.0
"""The errors, in steps of 8 bits, that the first and the last colour stand for. Smaller errors are invisible, and so
are drawn black."""


@dataclass(frozen=True)
class Card:
    """A picture and its map of errors, both uint8 [height, width, 4], and the names of the rows that share them."""

    rows: list[str]
    image: NDArray[np.uint8]
    errors: NDArray[np.uint8]
    off_by: str

    @property
    def names(self) -> str:
        """The names of the rows in one line."""
        return "; ".join(self.rows)


def page(comparison: Comparison, title: str) -> str:
    """Return the whole page, which is also well-formed XML. Raises InputError if the rows have no pictures."""
    if any(row.image is None or row.error is None for row in comparison.rows):
        raise InputError("pictures: expected a comparison made with pictures=True, got one without")
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def picture(image: NDArray[np.uint8], text: str) -> Markup:
        data = base64.b64encode(encode_png(image)).decode()
        height, width = image.shape[:2]
        form = "<img src='data:image/png;base64,{}' alt='{}' width='{}' height='{}' loading='lazy'/>"
        return Markup(form).format(data, text, width, height)

    loader = PackageLoader("clpeel.study")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined)
    return environment.get_template("comparison.html").render(
        title=title,
        comparison=comparison,
        columns=COLUMNS,
        rows=list(zip(comparison.rows, comparison.front(), strict=True)),
        plot=Markup(plot(comparison)),
        scale=Markup(scale()),
        cards=cards(comparison),
        picture=picture,
    )


def _class(on_front: bool) -> str:
    return " class='on'" if on_front else ""


# --- pictures ---------------------------------------------------------------------------------------------------------


def heat(error: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return errors [height, width], of 1, as colours on a logarithmic scale: uint8 [height, width, 4]."""
    steps = np.asarray(error, np.float64) / STEP
    place = np.log(np.maximum(steps, LEAST_STEP) / LEAST_STEP) / math.log(MOST_STEP / LEAST_STEP)
    colors = np.where((steps >= LEAST_STEP)[..., None], colors_at(place), 0.0)
    return np.concatenate([(colors * 255 + 0.5).astype(np.uint8), np.full((*error.shape, 1), 255, np.uint8)], axis=-1)


def cards(comparison: Comparison) -> list[Card]:
    """Return one card for each distinct pair of picture and error map, with the names of all rows that have it."""
    groups: dict[tuple[bytes, bytes], list[Row]] = {}
    for row in comparison.rows:
        assert row.image is not None and row.error is not None
        groups.setdefault((row.image.tobytes(), heat(row.error).tobytes()), []).append(row)
    found = []
    for rows in groups.values():
        image, error = rows[0].image, rows[0].error
        assert image is not None and error is not None
        worst = max(row.max_error for row in rows) / STEP
        found.append(Card([row.name for row in rows], image, heat(error), _steps(worst)))
    return found


def _steps(steps: float) -> str:
    return "less than a thousandth of a step" if steps < 1e-3 else f"at most {steps:.3g} steps"


def scale() -> str:
    """Return an SVG that shows which colour of an error map stands for how many steps."""
    left, bar = 90, 420
    parts = [
        f"<rect x='0' y='4' width='{left - 14}' height='16' fill='#000'/>"
        f"<text x='{(left - 14) / 2}' y='36' text-anchor='middle'>less</text>"
    ]
    for k in range(bar // 6):
        red, green, blue = (colors_at(np.array((k + 0.5) * 6 / bar)) * 255 + 0.5).astype(int)
        parts.append(f"<rect x='{left + 6 * k}' y='4' width='6.5' height='16' fill='rgb({red},{green},{blue})'/>")
    for steps, text in ((0.25, "¼"), (1, "1"), (4, "4"), (16, "16"), (64, "64"), (255, "255 steps")):
        x = left + bar * math.log(steps / LEAST_STEP) / math.log(MOST_STEP / LEAST_STEP)
        parts.append(f"<text x='{x:.1f}' y='36' text-anchor='middle'>{text}</text>")
    return f"<svg class='scale' viewBox='0 0 560 42' role='img' aria-label='colours of errors'>{''.join(parts)}</svg>"


# --- the plot ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Axis:
    """Maps numbers to places along a line, on a logarithmic scale."""

    low: float
    high: float
    start: float
    end: float

    def at(self, value: float) -> float:
        """Return the place of a value. A value outside the axis is put at the nearer end."""
        value = min(max(value, self.low), self.high)
        return self.start + (self.end - self.start) * math.log(value / self.low) / math.log(self.high / self.low)


WIDTH, HEIGHT = 960, 560
LEFT, RIGHT, TOP, BOTTOM = 70, 24, 20, 46
CHARACTER, LINE = 7.6, 15
"""The most space of a label, in the plot's units: the mean width of a bold letter, and the height of a line."""


def plot(comparison: Comparison) -> str:
    """Return an SVG of time against RMS error, both on logarithmic scales, with the Pareto front."""
    rows, front = comparison.rows, comparison.front()
    errors = [row.rms_error for row in rows if row.rms_error > 0] or [1e-8]
    x = Axis(
        0.8 * min(row.seconds_least for row in rows),
        1.35 * max(row.seconds_greatest for row in rows),
        LEFT,
        WIDTH - RIGHT,
    )
    low = 10.0 ** (math.floor(math.log10(min(errors))) - 1)
    y = Axis(low, max(10.0 ** math.ceil(math.log10(max(errors))), 1e-2), HEIGHT - BOTTOM, TOP)
    parts = [*_grid(x, y), _steps_line(x, y, comparison)]
    points = [(x.at(row.seconds_median), y.at(row.rms_error)) for row in rows]
    parts.append(_front(points, front))
    labels = place_labels(points, [row.name for row in rows], front)
    lines, marks = [], []
    # Rows on the front are drawn last, over the others. Words are drawn over all lines.
    for k in sorted(range(len(rows)), key=lambda k: front[k]):
        row, (px, py), (lx, ly) = rows[k], points[k], labels[k]
        about = f"{row.name}: {milliseconds(row.seconds_median)} ms, RMS {error_text(row.rms_error)}"
        nearest = min(max(px, lx), lx + CHARACTER * len(row.name))
        least, greatest = x.at(row.seconds_least), x.at(row.seconds_greatest)
        lines.append(
            f"<line class='leader' x1='{px:.1f}' y1='{py:.1f}' x2='{nearest:.1f}' y2='{ly - 4:.1f}'/>"
            f"<line class='spread' x1='{least:.1f}' y1='{py:.1f}' x2='{greatest:.1f}' y2='{py:.1f}'/>"
        )
        marks.append(
            f"<g{_class(front[k])}><title>{escape(about)}</title><circle cx='{px:.1f}' cy='{py:.1f}' r='5.5'/>"
            f"<text x='{lx:.1f}' y='{ly:.1f}'>{escape(row.name)}</text></g>"
        )
    parts += lines + marks
    box = f"viewBox='0 0 {WIDTH} {HEIGHT}' role='img' aria-label='time against error'"
    return f"<svg class='plot' {box}>{''.join(parts)}</svg>"


def _grid(x: Axis, y: Axis) -> list[str]:
    """Return lines and numbers at 1, 2 and 5 times powers of ten of milliseconds, and at powers of ten of errors."""
    parts = []
    for power in range(math.floor(math.log10(1e3 * x.low)), math.ceil(math.log10(1e3 * x.high)) + 1):
        for factor in (1, 2, 5):
            value = factor * 10.0**power
            if x.low <= value / 1e3 <= x.high:
                at = x.at(value / 1e3)
                parts.append(
                    f"<line class='grid' x1='{at:.1f}' y1='{TOP}' x2='{at:.1f}' y2='{HEIGHT - BOTTOM}'/>"
                    f"<text x='{at:.1f}' y='{HEIGHT - BOTTOM + 18}' text-anchor='middle'>{value:g}</text>"
                )
    for power in range(round(math.log10(y.low)), round(math.log10(y.high)) + 1):
        at = y.at(10.0**power)
        # The lowest line stands for rows without any error.
        label = "0" if power == round(math.log10(y.low)) else f"1e{power}" if power else "1"
        parts.append(
            f"<line class='grid' x1='{LEFT}' y1='{at:.1f}' x2='{WIDTH - RIGHT}' y2='{at:.1f}'/>"
            f"<text x='{LEFT - 8}' y='{at + 4:.1f}' text-anchor='end'>{label}</text>"
        )
    middle = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(
        f"<text x='{(LEFT + WIDTH - RIGHT) / 2}' y='{HEIGHT - 6}' text-anchor='middle'>"
        "milliseconds a frame, median</text>"
        f"<text transform='translate(16 {middle}) rotate(-90)' text-anchor='middle'>RMS error, of 1</text>"
    )
    return parts


def _steps_line(x: Axis, y: Axis, comparison: Comparison) -> str:
    """Return a line at an error of one step of 8 bits."""
    at = y.at(STEP)
    return (
        f"<line class='eye' x1='{x.start}' y1='{at:.1f}' x2='{x.end}' y2='{at:.1f}'/>"
        f"<text x='{x.end - 4}' y='{at - 5:.1f}' text-anchor='end'>1/255</text>"
    )


def _front(points: Sequence[tuple[float, float]], front: Sequence[bool]) -> str:
    """Return the staircase below which no point lies. Each stair goes right at the same error, then down."""
    on = sorted(point for point, is_on in zip(points, front, strict=True) if is_on)
    if not on:
        return ""
    path = f"M{on[0][0]:.1f} {TOP}V{on[0][1]:.1f}"
    for px, py in on[1:]:
        path += f"H{px:.1f}V{py:.1f}"
    return f"<path class='step' d='{path}H{WIDTH - RIGHT}'/>"


def place_labels(
    points: Sequence[tuple[float, float]], names: Sequence[str], front: Sequence[bool]
) -> list[tuple[float, float]]:
    """Return where each label begins, on its baseline: beside its point, or near it where it overlaps nothing."""
    boxes = [(px - 6, py - 6, px + 6, py + 6) for px, py in points]
    places: list[tuple[float, float]] = [(0.0, 0.0)] * len(points)
    for k in sorted(range(len(points)), key=lambda k: (not front[k], points[k])):
        (px, py), length = points[k], CHARACTER * len(names[k])
        best = None
        for away in range(0, 400, 8):
            for dx, dy in ((10, 4), (-10 - length, 4), (10, 4 - away), (10, 4 + away), (-10 - length, 4 - away),
                           (-10 - length, 4 + away), (-length / 2, -12 - away), (-length / 2, 20 + away)):  # fmt: skip
                left = min(max(px + dx, LEFT + 4), WIDTH - RIGHT - length)
                base = py + dy
                box = (left, base - LINE + 3, left + length, base + 4)
                if box[1] < TOP or box[3] > HEIGHT - BOTTOM - 2:
                    continue
                if not any(
                    box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3]
                    for other in boxes
                ):
                    best = (left, base, box)
                    break
            if best:
                break
        if best is None:
            left = min(px + 10, WIDTH - RIGHT - length)
            best = (left, py + 4, (left, py - LINE + 7, left + length, py + 8))
        places[k] = best[0], best[1]
        boxes.append(best[2])
    return places
