"""The suite as one self-contained HTML page: the front over all scenes, means, ranks, each scene, and the pictures.

Jinja2 fills in the template (templates/suite.html). The page has small pictures and no maps of errors: it would be
hundreds of megabytes otherwise. A slider shows where two pictures differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.study.chart import Point, chart
from clpeel.study.page import filled, markup
from clpeel.study.tables import COLUMNS, error_text

if TYPE_CHECKING:
    from clpeel.study.standings import Chapter, SuiteComparison

MOST_LABELS = 24
"""The most rows that all have their names in the chart. If there are more, only some have: see `suite_points`."""


@dataclass(frozen=True)
class Picture:
    """A picture uint8 [height, width, 4], its name on the page, and the names of the rows that have it."""

    id: str
    rows: list[str]
    image: NDArray[np.uint8]

    @property
    def names(self) -> str:
        """The names of the rows in one line."""
        return "; ".join(self.rows)


def suite_page(suite: SuiteComparison, title: str) -> str:
    """Return the whole page, which is also well-formed XML. Raises InputError if the scenes have no pictures."""
    if not all(chapter.pictures for chapter in suite.chapters):
        raise InputError("pictures: expected a suite that was drawn with pictures=True, got one without")
    from clpeel.study.standings import MEANS

    scenes = [(chapter, pictures_of(chapter, number)) for number, chapter in enumerate(suite.chapters)]
    names = [
        (chapter.name, [(name, picture.id) for picture in pictures for name in picture.rows])
        for chapter, pictures in scenes
    ]
    return filled(
        "suite.html",
        title=title,
        suite=suite,
        device=suite.chapters[0].comparison.device,
        size=suite.chapters[0].comparison.size,
        columns=COLUMNS,
        means=MEANS,
        standings=list(zip(suite.standings, suite.front(), strict=True)),
        plot=markup(chart(suite_points(suite), f"time, of {suite.reference}: geometric mean of the scenes", 1.0)),
        scenes=[
            (chapter, list(zip(chapter.comparison.rows, chapter.comparison.front(), strict=True)), pictures)
            for chapter, pictures in scenes
        ],
        groups=names,
    )


def suite_points(suite: SuiteComparison) -> list[Point]:
    """Return the points of the chart. Of many, those on the front and the techniques' defaults have names."""
    standings, front = suite.standings, suite.front()
    all_labelled = len(standings) <= MOST_LABELS
    points = []
    for each, on in zip(standings, front, strict=True):
        ratios = [chapter.times[each.name] / chapter.times[suite.reference] for chapter in suite.whole]
        about = f"{each.name}: {each.time:.2f} times {suite.reference}, RMS {error_text(each.rms_error)}"
        labelled = all_labelled or on or each.name == each.technique
        points.append(Point(each.name, each.time, each.rms_error, (min(ratios), max(ratios)), on, about, labelled))
    return points


def pictures_of(chapter: Chapter, number: int) -> list[Picture]:
    """Return the distinct pictures of a scene, the truth first. number: of the scene."""
    found: dict[bytes, Picture] = {}
    for name in ("truth", *(row.name for row in chapter.comparison.rows)):
        image = chapter.pictures[name]
        picture = found.setdefault(image.tobytes(), Picture(f"picture-{number}-{len(found)}", [], image))
        picture.rows.append(name)
    return list(found.values())
