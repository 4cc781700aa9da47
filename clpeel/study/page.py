"""A comparison as one self-contained HTML page: a plot, a table, pictures, and maps of their errors.

Jinja2 fills in the template (templates/comparison.html). The plot (chart.py) and the colour scale are SVG.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.pictures.colormap import colors_at
from clpeel.pictures.png import STEP, encode_png
from clpeel.study.chart import Point, chart
from clpeel.study.tables import COLUMNS, error_text, milliseconds

if TYPE_CHECKING:
    from markupsafe import Markup

    from clpeel.study.comparison import Comparison, Row

TRUTH = "truth"
"""The name of the truth's picture on the page."""

LEAST_STEP, MOST_STEP = 0.25, 255.0
"""The errors, in steps of 8 bits, that the first and the last colour stand for. Smaller errors are invisible, and so
are drawn black."""


@dataclass(frozen=True)
class Card:
    """A picture and its map of errors, both uint8 [height, width, 4], and the names of the rows that share them.

    id: the picture's name on the page.
    """

    id: str
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
    made = cards(comparison)
    points = [
        Point(
            row.name,
            row.seconds_median,
            row.rms_error,
            (row.seconds_least, row.seconds_greatest),
            on,
            f"{row.name}: {milliseconds(row.seconds_median)} ms, RMS {error_text(row.rms_error)}",
        )
        for row, on in zip(comparison.rows, comparison.front(), strict=True)
    ]
    names = [("truth", TRUTH), *((name, card.id) for card in made for name in card.rows)]
    return filled(
        "comparison.html",
        title=title,
        comparison=comparison,
        columns=COLUMNS,
        rows=list(zip(comparison.rows, comparison.front(), strict=True)),
        plot=markup(chart(points, "milliseconds a frame, median", 1e3)),
        scale=markup(scale()),
        cards=made,
        truth=TRUTH,
        groups=[("", names)],
    )


def filled(template: str, **values: object) -> str:
    """Return a template of this package with its values filled in, which are escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(loader=PackageLoader("clpeel.study"), autoescape=True, undefined=StrictUndefined)
    return environment.get_template(template).render(picture=picture, **values)


def markup(text: str) -> Markup:
    """Return text that is HTML already, and not escaped."""
    from markupsafe import Markup

    return Markup(text)


def picture(image: NDArray[np.uint8], text: str, id: str = "") -> Markup:
    """Return an image element with the picture [height, width, 4] in it. id: its name on the page, if it has one."""
    data = base64.b64encode(encode_png(image)).decode()
    height, width = image.shape[:2]
    form = "<img{} src='data:image/png;base64,{}' alt='{}' width='{}' height='{}' loading='lazy'/>"
    return markup(form).format(markup(f" id='{id}'" if id else ""), data, text, width, height)


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
    found: list[Card] = []
    for rows in groups.values():
        image, error = rows[0].image, rows[0].error
        assert image is not None and error is not None
        worst = max(row.max_error for row in rows) / STEP
        found.append(Card(f"picture-{len(found)}", [row.name for row in rows], image, heat(error), _steps(worst)))
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
