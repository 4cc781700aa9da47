"""A chart of time against error, as SVG: on logarithmic scales, with the Pareto front and labels apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from clpeel.pictures.png import STEP


@dataclass(frozen=True)
class Point:
    """A row in the chart.

    time, error: its place. spread: the least and the greatest time. on: whether it is on the front. about: the text
    that shows up when the mouse rests on it. labelled: whether its name stands beside it.
    """

    name: str
    time: float
    error: float
    spread: tuple[float, float]
    on: bool
    about: str
    labelled: bool = True


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


def chart(points: Sequence[Point], heading: str, factor: float) -> str:
    """Return an SVG of the points. heading: what the times are, after they were multiplied by the factor."""
    errors = [point.error for point in points if point.error > 0] or [1e-8]
    x = Axis(
        0.8 * min(point.spread[0] for point in points),
        1.35 * max(point.spread[1] for point in points),
        LEFT,
        WIDTH - RIGHT,
    )
    low = 10.0 ** (math.floor(math.log10(min(errors))) - 1)
    y = Axis(low, max(10.0 ** math.ceil(math.log10(max(errors))), 1e-2), HEIGHT - BOTTOM, TOP)
    places = [(x.at(point.time), y.at(point.error)) for point in points]
    front = [point.on for point in points]
    parts = [*_grid(x, y, heading, factor), _steps_line(x, y), _front(places, front)]
    labels = place_labels(places, [point.name if point.labelled else "" for point in points], front)
    lines, marks = [], []
    # Rows on the front are drawn last, over the others. Words are drawn over all lines.
    for k in sorted(range(len(points)), key=lambda k: front[k]):
        point, (px, py), (lx, ly) = points[k], places[k], labels[k]
        nearest = min(max(px, lx), lx + CHARACTER * len(point.name))
        least, greatest = (x.at(time) for time in point.spread)
        if point.labelled:
            lines.append(f"<line class='leader' x1='{px:.1f}' y1='{py:.1f}' x2='{nearest:.1f}' y2='{ly - 4:.1f}'/>")
        lines.append(f"<line class='spread' x1='{least:.1f}' y1='{py:.1f}' x2='{greatest:.1f}' y2='{py:.1f}'/>")
        text = f"<text x='{lx:.1f}' y='{ly:.1f}'>{escape(point.name)}</text>" if point.labelled else ""
        on = " class='on'" if point.on else ""
        circle = f"<circle cx='{px:.1f}' cy='{py:.1f}' r='5.5'/>"
        marks.append(f"<g{on}><title>{escape(point.about)}</title>{circle}{text}</g>")
    parts += lines + marks
    box = f"viewBox='0 0 {WIDTH} {HEIGHT}' role='img' aria-label='time against error'"
    return f"<svg class='plot' {box}>{''.join(parts)}</svg>"


def _grid(x: Axis, y: Axis, heading: str, factor: float) -> list[str]:
    """Return lines and numbers at 1, 2 and 5 times powers of ten of times, and at powers of ten of errors."""
    parts = []
    for power in range(math.floor(math.log10(factor * x.low)), math.ceil(math.log10(factor * x.high)) + 1):
        for digit in (1, 2, 5):
            value = digit * 10.0**power
            if x.low <= value / factor <= x.high:
                at = x.at(value / factor)
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
        f"{escape(heading)}</text>"
        f"<text transform='translate(16 {middle}) rotate(-90)' text-anchor='middle'>RMS error, of 1</text>"
    )
    return parts


def _steps_line(x: Axis, y: Axis) -> str:
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
    """Return where each label begins, on its baseline: beside its point, or near it where it overlaps nothing.

    A name without letters takes no room.
    """
    boxes = [(px - 6, py - 6, px + 6, py + 6) for px, py in points]
    places: list[tuple[float, float]] = [(0.0, 0.0)] * len(points)
    for k in sorted(range(len(points)), key=lambda k: (not front[k], points[k])):
        (px, py), length = points[k], CHARACTER * len(names[k])
        if not names[k]:
            continue
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
