"""Tables: formats the numbers of a comparison, and aligns columns of text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clpeel.study.comparison import Row


def milliseconds(seconds: float) -> str:
    """Return the time in milliseconds with three digits or more."""
    value = 1000 * seconds
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def share(value: float) -> str:
    """Return a share 0..1 as a percentage."""
    return "0" if value == 0 else "<.01%" if value < 5e-5 else f"{value:.2%}" if value < 0.0995 else f"{value:.1%}"


def error_text(value: float) -> str:
    """Return an error with two digits."""
    return "0" if value == 0 else f"{value:.1e}"


def bias_text(value: float) -> str:
    """Return a mean that may be below 0 with two digits. What float32 may round is 0."""
    return "0" if abs(value) < 1e-6 else f"{value:+.1e}"


def flip_text(value: float | None) -> str:
    """Return a FLIP error, or - if it was not measured."""
    return "-" if value is None else error_text(value) if value < 5e-5 else f"{value:.4f}"


COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("ms", lambda row: milliseconds(row.seconds_median)),
    ("spread", lambda row: f"{milliseconds(row.seconds_least)}-{milliseconds(row.seconds_greatest)}"),
    ("passes", lambda row: f"{row.passes}"),
    ("B/px", lambda row: f"{row.bytes_per_pixel:.0f}"),
    ("MiB", lambda row: f"{row.memory_bytes / 2**20:.{1 if row.memory_bytes < 100 * 2**20 else 0}f}"),
    ("max error", lambda row: error_text(row.max_error)),
    ("RMS", lambda row: error_text(row.rms_error)),
    ("PSNR", lambda row: f"{row.psnr:.1f}"),
    (">1/255", lambda row: share(row.share_above_1)),
    (">8/255", lambda row: share(row.share_above_8)),
    ("FLIP", lambda row: flip_text(row.flip)),
)
"""Headings and cells of the tables, after the column with the row's name."""


def aligned(cells: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines. The first column is left-aligned, the others right-aligned, one space apart.

    With so little space, even the widest names fit in 124 characters.
    """
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        " ".join([f"{row[0]:<{widths[0]}}", *(f"{text:>{n}}" for text, n in zip(row[1:], widths[1:], strict=True))])
        for row in cells
    ]
