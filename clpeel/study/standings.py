"""Standings: every technique on all scenes of the suite: ranks of each scene, means over the scenes, and who leads."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.study.comparison import ERRORS, FIGURES, FLIP_HINT, Comparison, as_csv, unbeaten
from clpeel.study.tables import aligned, bias_text, error_text, flip_text

REFERENCE = "sort"
"""The row whose time counts as 1."""

LEAST_ERROR = 2.0**-24
"""What an error counts at least in a geometric mean: half a unit in the last place of float32 below 1."""

STANDINGS = ("rank_time", "rank_error")
"""What a row's files have besides the figures of a comparison."""


@dataclass(frozen=True, eq=False)
class Chapter:
    """A scene of the suite, and how the techniques did on it.

    pictures: for the page, by the names of rows and "truth": uint8 [height, width, 4], of a reduced size. There are
    none unless they were asked for.
    """

    name: str
    about: str
    comparison: Comparison
    pictures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)

    @cached_property
    def times(self) -> dict[str, float]:
        """The median seconds of a frame of each row, by its name."""
        return {row.name: row.seconds_median for row in self.comparison.rows}

    @cached_property
    def errors(self) -> dict[str, float]:
        """The RMS error of each row, by its name. It is 0 if its errors are within what float32 rounds."""
        return {row.name: self.comparison.weighed_error(row) for row in self.comparison.rows}

    @cached_property
    def ranks(self) -> dict[str, tuple[int, int]]:
        """The ranks of each row by time and by error, by its name."""
        by_time, by_error = (ranks(list(values.values())) for values in (self.times, self.errors))
        return dict(zip(self.times, zip(by_time, by_error, strict=True), strict=True))


@dataclass(frozen=True)
class Standing:
    """A technique with its options, on all scenes.

    time: the geometric mean of its time as a multiple of that of REFERENCE. rms_error: the root of the mean square
    over all scenes, pixels and channels. rms_geometric: the geometric mean of the RMS errors of the scenes, none of
    which counts as less than LEAST_ERROR. max_error: the greatest of all. flip: the mean of the scenes, or None.
    opacity_bias: the mean of the scenes. rank_time, rank_error: the means of its ranks. Errors within what float32
    rounds count as 0.
    """

    name: str
    technique: str
    time: float
    rms_error: float
    rms_geometric: float
    max_error: float
    flip: float | None
    opacity_bias: float
    rank_time: float
    rank_error: float


@dataclass(frozen=True, eq=False)
class SuiteComparison:
    """The scenes that were drawn, in their order. notes: what was left out, and why."""

    chapters: list[Chapter]
    notes: tuple[str, ...] = ()

    @cached_property
    def names(self) -> list[str]:
        """The names of all rows, in the registry's order."""
        most = max(self.chapters, key=lambda chapter: len(chapter.times))
        return list(most.times)

    @cached_property
    def whole(self) -> list[Chapter]:
        """The scenes that have all rows. A scene that was interrupted may lack some, and then counts in no mean."""
        return [chapter for chapter in self.chapters if list(chapter.times) == self.names]

    @property
    def counted(self) -> str:
        """The number of whole scenes in words."""
        return f"{len(self.whole)} scene{'s' * (len(self.whole) != 1)}"

    @cached_property
    def reference(self) -> str:
        """The name of the row whose time counts as 1: `sort`, or the first one if that was not asked for."""
        return REFERENCE if REFERENCE in self.names else self.names[0]

    @cached_property
    def standings(self) -> list[Standing]:
        """The means of each row over all whole scenes, in the registry's order."""
        return [self._standing(name) for name in self.names]

    def _standing(self, name: str) -> Standing:
        rows = [next(row for row in each.comparison.rows if row.name == name) for each in self.whole]
        errors = [each.errors[name] for each in self.whole]
        flips = [row.flip for row in rows if row.flip is not None]
        places = [each.ranks[name] for each in self.whole]
        return Standing(
            name=name,
            technique=rows[0].technique,
            time=geometric_mean([each.times[name] / each.times[self.reference] for each in self.whole]),
            rms_error=math.sqrt(mean([error * error for error in errors])),
            rms_geometric=geometric_mean([max(error, LEAST_ERROR) for error in errors]),
            max_error=max(row.max_error if error > 0 else 0.0 for row, error in zip(rows, errors, strict=True)),
            flip=mean(flips) if len(flips) == len(rows) else None,
            opacity_bias=mean([row.opacity_bias for row in rows]),
            rank_time=mean([by_time for by_time, _ in places]),
            rank_error=mean([by_error for _, by_error in places]),
        )

    def front(self) -> list[bool]:
        """Return for each standing whether it is on the Pareto front of `time` and `rms_error`."""
        return unbeaten([(each.time, each.rms_error) for each in self.standings])

    # --- tables and files ---------------------------------------------------------------------------------------------

    def table(self) -> str:
        """Return a table of each scene, that of the means, that of the ranks, and the legend."""
        parts = [
            [f"{each.name}: {each.about}", *each.comparison.lines(), each.comparison.about_truth()]
            for each in self.chapters
        ]
        parts += [self.lines(), self.rank_lines(), self.legend()]
        return "\n\n".join("\n".join(lines) for lines in parts)

    def lines(self) -> list[str]:
        """Return the lines of the table of means: a heading, and one for each row."""
        return aligned(
            [
                [f"  {self.counted}", *(heading for heading, _ in MEANS)],
                *(
                    [("* " if on else "  ") + each.name, *(cell(each) for _, cell in MEANS)]
                    for each, on in zip(self.standings, self.front(), strict=True)
                ),
            ]
        )

    def rank_lines(self) -> list[str]:
        """Return the lines of the table of ranks: for each row and scene, its ranks by time and by error."""
        heading = ["  rank by time/error", *(each.name for each in self.chapters)]
        return aligned([heading, *([f"  {name}", *cells] for name, *cells in self.rank_cells())])

    def rank_cells(self) -> list[list[str]]:
        """Return of each row its name, and for each scene its ranks by time and by error, as `3/1`."""
        return [[name, *(rank_text(each.ranks.get(name)) for each in self.chapters)] for name in self.names]

    def legend(self) -> list[str]:
        """Return what the tables' numbers mean, one line each."""
        rounding = max(each.comparison.rounding for each in self.chapters)
        return [
            ERRORS,
            "* nothing there is both faster and nearer the truth; errors within what float32 rounds, at most "
            f"{rounding:.1e}, count as none",
            f"time: geometric mean of the scenes, that of {self.reference} is 1; RMS: over all pixels of all scenes; "
            "gm RMS: geometric mean",
            "opacity: how much too opaque pixels are, on average; #time, #error: means of the ranks; equals share the "
            "better rank",
            *([FLIP_HINT] if any(each.flip is None for each in self.standings) else []),
            *(f"note: {note}" for note in self.notes),
        ]

    def to_json(self) -> str:
        """Return JSON: `scenes` with their facts, and their rows with ranks; and `overall`, the standings."""
        scenes = [
            {
                "name": each.name,
                "about": each.about,
                **each.comparison.facts(),
                "rows": [
                    {**row, **self._ranks(each, name)}
                    for row, name in zip(each.comparison.entries(), each.times, strict=True)
                ],
            }
            for each in self.chapters
        ]
        overall = [{**asdict(each), "on_front": on} for each, on in zip(self.standings, self.front(), strict=True)]
        told = {"format": 1, "reference": self.reference, "notes": self.notes, "scenes": scenes, "overall": overall}
        return json.dumps(told, indent=2, allow_nan=False) + "\n"

    def to_csv(self) -> str:
        """Return CSV: a heading, and a line for each scene and row: its FIGURES, `on_front` and its ranks."""
        lines = [
            {"scene": each.name, **line, **self._ranks(each, name)}
            for each in self.chapters
            for line, name in zip(each.comparison.lines_of_figures(), each.times, strict=True)
        ]
        return as_csv(["scene", *FIGURES, "on_front", *STANDINGS], lines)

    def _ranks(self, chapter: Chapter, name: str) -> dict[str, Any]:
        return dict(zip(STANDINGS, chapter.ranks[name], strict=True))

    def to_html(self, title: str = "clpeel compare --suite") -> str:
        """Return one HTML page: the front over all scenes, all tables, and two pictures beside each other.

        Raises InputError if the suite was drawn without pictures.
        """
        from clpeel.study.suite_page import suite_page

        return suite_page(self, title)


MEANS: tuple[tuple[str, Callable[[Standing], str]], ...] = (
    ("time", lambda each: f"{each.time:.2f}"),
    ("RMS", lambda each: error_text(each.rms_error)),
    ("gm RMS", lambda each: error_text(each.rms_geometric)),
    ("max error", lambda each: error_text(each.max_error)),
    ("FLIP", lambda each: flip_text(each.flip)),
    ("opacity", lambda each: bias_text(each.opacity_bias)),
    ("#time", lambda each: f"{each.rank_time:.1f}"),
    ("#error", lambda each: f"{each.rank_error:.1f}"),
)
"""Headings and cells of the table of means, after the column with the row's name."""


class InterruptedSuite(KeyboardInterrupt):
    """Ctrl-C during a suite. `comparison` has the finished scenes, and the last one with its finished rows."""

    def __init__(self, comparison: SuiteComparison):
        super().__init__()
        self.comparison = comparison


def rank_text(found: tuple[int, int] | None) -> str:
    """Return ranks by time and by error as `3/1`."""
    return "-" if found is None else f"{found[0]}/{found[1]}"


def ranks(values: Sequence[float]) -> list[int]:
    """Return the rank of each value, 1 for the least. Equals all have the best rank of theirs (1, 1, 3)."""
    return [1 + sum(other < value for other in values) for value in values]


def mean(values: Sequence[float]) -> float:
    """Return the arithmetic mean."""
    return math.fsum(values) / len(values)


def geometric_mean(values: Sequence[float]) -> float:
    """Return the geometric mean of values above 0."""
    return math.exp(mean([math.log(value) for value in values]))
