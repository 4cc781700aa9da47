"""A comparison: every technique on one view, compared with the same fragments blended in float64."""

from __future__ import annotations

import csv
import io
import json
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import Background
from clpeel.pictures.background import rows_of
from clpeel.study.tables import COLUMNS, aligned
from clpeel.techniques.precision import DEFAULT_PRECISION, blending_bound

FLIP_HINT = "FLIP: not measured; pip install 'flip-evaluator>=1.6'"

ERRORS = "errors: of RGB over the background, of 1, before rounding to 8 bits; >1/255: share of pixels off by more"

FIGURES = (
    "technique",
    "precision",
    "budget",
    "exact",
    "seconds_median",
    "seconds_least",
    "seconds_greatest",
    "frames",
    "passes",
    "bytes_per_pixel",
    "memory_bytes",
    "max_error",
    "rms_error",
    "psnr",
    "share_above_1",
    "share_above_8",
    "flip",
    "truncated_pixels",
    "truncation_bound",
    "clamped_pixels",
    "opacity_bias",
    "options",
)
"""The figures of a row that files contain: names of fields and properties of `Row`."""


@dataclass(frozen=True, eq=False)
class Row:
    """A technique with its options, and the measurements of its picture and its frames.

    Errors are those of red, green and blue. These are premultiplied, over the background, clamped to 0..1 as the
    picture shows them, and not yet rounded to 8 bits. A NaN counts as an error of 1. Shares are shares of the picture's
    pixels.

    precision: the precision of the colour buffers. budget: the number of `passes` to stop after, or None.
    exact: whether the technique is exact if nothing stops it. seconds: the time of each timed frame, from a scene on
    the device to the picture on the host.
    passes: geometry passes, as the papers count them. bytes_per_pixel: what the technique keeps per sample.
    memory_bytes: all memory on the device except the picture.
    max_error, rms_error: on a scale of 0..1. psnr: dB, infinite if the error is 0. share_above_1, share_above_8: the
    share of pixels with a channel that is off by more than 1/255 or 8/255. flip: the mean of FLIP (Andersson et al.
    2020) between the 8-bit pictures, from 0 (alike) to 1, or None if flip-evaluator is not installed.
    truncated_pixels, truncation_bound, clamped_pixels: as in `Result.stats`.
    opacity_bias: how much too opaque the pixels are, on average: the mean of their alpha less that of the truth.
    options: the technique's other options that are not at their defaults, by name, such as {"slots": 8}.
    image: uint8 [height, width, 4]. error: float32 [height, width], the greatest of a pixel's channels. Both are None
    unless pictures were asked for.
    """

    technique: str
    precision: str | None
    budget: int | None
    exact: bool
    seconds: tuple[float, ...]
    passes: int
    bytes_per_pixel: float
    memory_bytes: int
    max_error: float
    rms_error: float
    psnr: float
    share_above_1: float
    share_above_8: float
    flip: float | None
    truncated_pixels: int
    truncation_bound: float
    clamped_pixels: int
    opacity_bias: float = 0.0
    options: Mapping[str, Any] = field(default_factory=dict)
    image: NDArray[np.uint8] | None = None
    error: NDArray[np.float32] | None = None

    @property
    def name(self) -> str:
        """The technique with its options, such as `weighted-sum, half` or `depth-peeling, passes 4`."""
        return named(self.technique, self.precision, self.budget, self.options)

    @property
    def seconds_median(self) -> float:
        """The median of `seconds`."""
        return statistics.median(self.seconds)

    @property
    def seconds_least(self) -> float:
        """The least of `seconds`."""
        return min(self.seconds)

    @property
    def seconds_greatest(self) -> float:
        """The greatest of `seconds`."""
        return max(self.seconds)

    @property
    def frames(self) -> int:
        """The number of timed frames."""
        return len(self.seconds)

    def figures(self) -> dict[str, Any]:
        """Return all FIGURES by name."""
        return {name: getattr(self, name) for name in FIGURES}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Rows in the registry's order, and the view that they were compared on.

    truth: float64 [height, width, 4], premultiplied, without the background. It is made of the layers of each pixel:
    their colours are float32, and they are blended in float64. layers_max: the most layers in a pixel. fragments: the
    number of all fragments that were blended. notes: what was skipped, and why.
    """

    rows: list[Row]
    truth: NDArray[np.float64]
    background: Background
    lighting: str
    opaque: str
    triangles: int
    fragments: int
    layers_max: int
    device: str
    lanes: int
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.truth.shape[1], self.truth.shape[0]

    @property
    def rounding(self) -> float:
        """The bound of the error of blending so many layers in float32: (3 N + 4) 2^-24, on a scale of 0..1."""
        return blending_bound(self.layers_max)

    def front(self) -> list[bool]:
        """Return for each row whether it is on the Pareto front of time and error.

        It is, unless another row is at least as fast and at least as near the truth, and better in one of the two. Time
        is the median, and error the RMS error. Errors within `rounding` count as zero.
        """
        return unbeaten([(row.seconds_median, self.weighed_error(row)) for row in self.rows])

    def weighed_error(self, row: Row) -> float:
        """Return the row's RMS error, or 0 if its errors are within `rounding`."""
        return 0.0 if row.max_error <= self.rounding else row.rms_error

    def facts(self) -> dict[str, Any]:
        """Return what the rows were compared on, by name."""
        names = "background lighting opaque triangles fragments layers_max rounding device lanes notes".split()
        return {"size": self.size, **{name: getattr(self, name) for name in names}}

    def truth_image(self) -> NDArray[np.uint8]:
        """Return the truth over the background: uint8 [height, width, 4], by the rule floor(x 255 + 0.5)."""
        levels = np.floor(shown(self.truth, self.background) * 255 + 0.5).astype(np.uint8)
        return np.concatenate([levels, np.full_like(levels[..., :1], 255)], axis=-1)

    def table(self) -> str:
        """Return the rows as a text table, followed by its legend."""
        return "\n".join([*self.lines(), "", *self.legend()])

    def lines(self) -> list[str]:
        """Return the lines of the table: a heading, and one for each row."""
        front = self.front()
        return aligned(
            [
                ["  technique", *(heading for heading, _ in COLUMNS)],
                *(
                    [("* " if on else "  ") + row.name, *(cell(row) for _, cell in COLUMNS)]
                    for row, on in zip(self.rows, front, strict=True)
                ),
            ]
        )

    def about_truth(self) -> str:
        """Return what the pictures were compared with, as a line."""
        width, height = self.size
        return (
            f"truth: the same {self.fragments:,} fragments, at most {self.layers_max} in a pixel, blended in float64; "
            f"{width} x {height} pixels"
        )

    def legend(self) -> list[str]:
        """Return what the table's numbers mean, one line each."""
        return [
            self.about_truth(),
            ERRORS,
            f"* nothing here is both faster and nearer the truth; errors within float32's {self.rounding:.1e} count as "
            "none",
            *([FLIP_HINT] if any(row.flip is None for row in self.rows) else []),
            *(f"note: {note}" for note in self.notes),
        ]

    def to_json(self) -> str:
        """Return JSON: `facts`, and `entries` as `rows`."""
        return json.dumps({"format": 1, **self.facts(), "rows": self.entries()}, indent=2, allow_nan=False) + "\n"

    def entries(self) -> list[dict[str, Any]]:
        """Return each row for JSON: its figures, `on_front` and `seconds` of each frame. Infinite numbers are None."""
        rows = [
            {**row.figures(), "on_front": on, "seconds": list(row.seconds)}
            for row, on in zip(self.rows, self.front(), strict=True)
        ]
        for row in rows:
            row["psnr"] = row["psnr"] if math.isfinite(row["psnr"]) else None
        return rows

    def to_csv(self) -> str:
        """Return CSV: a heading, and a line for each row with FIGURES and `on_front`. A missing figure is empty."""
        return as_csv([*FIGURES, "on_front"], self.lines_of_figures())

    def lines_of_figures(self) -> list[dict[str, Any]]:
        """Return of each row, for CSV, its FIGURES and `on_front`."""
        return [
            {**row.figures(), "options": texts(row.options), "on_front": on}
            for row, on in zip(self.rows, self.front(), strict=True)
        ]

    def to_html(self, title: str = "clpeel compare") -> str:
        """Return one HTML page with everything: the plot of time against error, the table, pictures and error maps.

        Raises InputError if the comparison was made without pictures.
        """
        from clpeel.study.page import page

        return page(self, title)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a comparison. `comparison` has the finished rows, with as many frames as were timed."""

    def __init__(self, comparison: Comparison):
        super().__init__()
        self.comparison = comparison


def as_csv(names: Sequence[str], lines: Iterable[Mapping[str, Any]]) -> str:
    """Return CSV with these columns: a heading, and a line for each mapping. What is None is empty."""
    file = io.StringIO()
    writer = csv.DictWriter(file, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return file.getvalue()


def unbeaten(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return for each point whether it is on the Pareto front of both of its numbers.

    It is, unless another point is at most as great in both numbers, and smaller in one.
    """
    return [
        not any(other[0] <= mine[0] and other[1] <= mine[1] and other != mine for other in points) for mine in points
    ]


def named(technique: str, precision: str | None, budget: int | None, options: Mapping[str, object]) -> str:
    """Return `Row.name`. The default precision, float32, is not mentioned."""
    told = ["" if precision in (None, DEFAULT_PRECISION) else precision, "" if budget is None else f"passes {budget}"]
    return ", ".join([technique, *filter(None, (texts(options), *told))])


def texts(options: Mapping[str, object]) -> str:
    """Return options as text, such as `slots 8`."""
    return ", ".join(f"{name} {value}" for name, value in options.items())


def shown(color: NDArray[np.floating], background: Background) -> NDArray[np.float64]:
    """Return premultiplied RGBA [height, width, 4] over the background, clamped to 0..1: float64 [height, width, 3]."""
    color = color.astype(np.float64)
    return np.clip(color[..., :3] + (1 - color[..., 3:]) * rows_of(background, len(color)), 0, 1)
