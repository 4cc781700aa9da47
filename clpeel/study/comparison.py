"""A comparison: every technique on one view, beside what blending the same fragments in float64 gives."""

from __future__ import annotations

import csv
import io
import json
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.study.tables import COLUMNS, aligned
from clpeel.techniques.precision import DEFAULT_PRECISION, blending_bound

FLIP_HINT = "FLIP: not measured; pip install 'flip-evaluator>=1.6'"

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
)
"""Of a row, as files have them: fields and properties of `Row`."""


@dataclass(frozen=True, eq=False)
class Row:
    """A technique with its options, and how its picture and its frames have turned out.

    Errors are of red, green and blue, premultiplied over the background and clamped to 0..1 as the picture shows them,
    before they are rounded to 8 bits; a number that is none (NaN) is off by 1. Shares are of the picture's pixels.

    precision: of the colour buffers. budget: the `passes` it was told to stop after, or None.
    exact: whether the technique is, when nothing stops it. seconds: of each timed frame, from a scene on the device to
    the picture on the host. passes: geometry passes, as the papers count them. bytes_per_pixel: what it keeps of a
    sample. memory_bytes: all on the device but the picture. max_error, rms_error: of 1. psnr: dB, infinite where the
    error is 0. share_above_1, share_above_8: pixels with a channel that is off by more than 1/255, 8/255. flip: the
    mean of FLIP (Andersson et al. 2020) between the 8-bit pictures, 0 alike .. 1, or None where flip-evaluator is not
    installed. truncated_pixels, truncation_bound, clamped_pixels: as of `Result.stats`. image: uint8 [height, width,
    4], and error: float32 [height, width], the greatest of a pixel's channels; None unless pictures were asked for.
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
    image: NDArray[np.uint8] | None = None
    error: NDArray[np.float32] | None = None

    @property
    def name(self) -> str:
        """The technique and what it was told: `weighted-sum, half`; `depth-peeling, passes 4`."""
        return named(self.technique, self.precision, self.budget)

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
        """How many were timed."""
        return len(self.seconds)

    def figures(self) -> dict[str, Any]:
        """All FIGURES by name."""
        return {name: getattr(self, name) for name in FIGURES}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Rows in the registry's order, and what they were compared on.

    truth: float64 [height, width, 4], premultiplied, before the background: the layers of each pixel, whose colours are
    float32, blended in float64. layers_max: most of them in a pixel; fragments: all that were blended. notes: what was
    left out, and why.
    """

    rows: list[Row]
    truth: NDArray[np.float64]
    background: tuple[float, float, float]
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
        """What blending so many layers in float32 may be off by: (3 N + 4) 2^-24, of 1."""
        return blending_bound(self.layers_max)

    def front(self) -> list[bool]:
        """Of each row, whether no other is at once as fast and as near the truth, and better in one of these.

        By median time and RMS error; errors within `rounding` are all taken for none.
        """
        weighed = [(row.seconds_median, 0.0 if row.max_error <= self.rounding else row.rms_error) for row in self.rows]
        return [
            not any(other[0] <= mine[0] and other[1] <= mine[1] and other != mine for other in weighed)
            for mine in weighed
        ]

    def facts(self) -> dict[str, Any]:
        """What was compared on, by name, without the rows."""
        names = "background lighting opaque triangles fragments layers_max rounding device lanes notes".split()
        return {"size": self.size, **{name: getattr(self, name) for name in names}}

    def truth_image(self) -> NDArray[np.uint8]:
        """The truth over the background: uint8 [height, width, 4], by the rule x 255 + 0.5."""
        levels = np.floor(shown(self.truth, self.background) * 255 + 0.5).astype(np.uint8)
        return np.concatenate([levels, np.full_like(levels[..., :1], 255)], axis=-1)

    def table(self) -> str:
        """The rows as a table of text, and what it says."""
        front = self.front()
        lines = aligned(
            [
                ["  technique", *(heading for heading, _ in COLUMNS)],
                *(
                    [("* " if on else "  ") + row.name, *(cell(row) for _, cell in COLUMNS)]
                    for row, on in zip(self.rows, front, strict=True)
                ),
            ]
        )
        return "\n".join([*lines, "", *self.legend()])

    def legend(self) -> list[str]:
        """What the table's numbers are, a line each."""
        width, height = self.size
        return [
            f"truth: the same {self.fragments:,} fragments, at most {self.layers_max} in a pixel, blended in float64; "
            f"{width} x {height} pixels",
            "errors: of RGB over the background, of 1, before rounding to 8 bits; >1/255: share of pixels off by more",
            f"* nothing here is both faster and nearer the truth; errors within float32's {self.rounding:.1e} count as "
            "none",
            *([FLIP_HINT] if any(row.flip is None for row in self.rows) else []),
            *(f"note: {note}" for note in self.notes),
        ]

    def to_json(self) -> str:
        """`facts`, and of each row its figures, `on_front` and the `seconds` of each frame; infinite ones are null."""
        rows = [
            {**row.figures(), "on_front": on, "seconds": list(row.seconds)}
            for row, on in zip(self.rows, self.front(), strict=True)
        ]
        for row in rows:
            row["psnr"] = row["psnr"] if math.isfinite(row["psnr"]) else None
        return json.dumps({"format": 1, **self.facts(), "rows": rows}, indent=2, allow_nan=False) + "\n"

    def to_csv(self) -> str:
        """A heading and a line for each row: FIGURES and `on_front`; what a row has not is empty."""
        file = io.StringIO()
        writer = csv.DictWriter(file, [*FIGURES, "on_front"], lineterminator="\n")
        writer.writeheader()
        for row, on in zip(self.rows, self.front(), strict=True):
            writer.writerow({**row.figures(), "on_front": on})
        return file.getvalue()

    def to_html(self, title: str = "clpeel compare") -> str:
        """One page with all in it: the plot of time against error, the table, pictures and maps of errors.

        Raises InputError where the comparison was made without pictures.
        """
        from clpeel.study.page import page

        return page(self, title)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a comparison; `comparison` has the rows that were finished, with as many frames as were timed."""

    def __init__(self, comparison: Comparison):
        super().__init__()
        self.comparison = comparison


def named(technique: str, precision: str | None, budget: int | None) -> str:
    """`Row.name`: float32 goes without saying."""
    told = ["" if precision in (None, DEFAULT_PRECISION) else precision, "" if budget is None else f"passes {budget}"]
    return ", ".join([technique, *filter(None, told)])


def shown(color: NDArray[np.floating], background: Sequence[float]) -> NDArray[np.float64]:
    """Premultiplied RGBA [height, width, 4] over the background as a picture shows it: float64 [height, width, 3]."""
    color = color.astype(np.float64)
    return np.clip(color[..., :3] + (1 - color[..., 3:]) * np.asarray(background, np.float64), 0, 1)
