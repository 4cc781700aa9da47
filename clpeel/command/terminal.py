"""What a command shows on the terminal: the progress bar while it works, and tables when it is done."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Mapping
from typing import Any

EXIT_FAILURE, EXIT_INTERRUPTED, EXIT_BROKEN_PIPE, EXIT_TERMINATED = 1, 130, 141, 143
"""Exit codes of the command. Those of clpeel's own errors are in errors.py."""

Figures = Mapping[str, Any]
"""Numbers, texts and lists of these, by name."""


class Progress:
    """A one-line progress bar on standard error.

    It appears on a terminal only, once the work has lasted `delay` seconds.

    A thread draws it, so that it also appears while a file is read or kernels are compiled, which report no progress.
    That is why it is our own: tqdm draws only when progress is reported to it, and rich, which has such a thread,
    brings four packages of 14 MB.
    """

    WIDTH = 30
    INTERVAL = 0.2  # seconds between two drawings

    def __init__(self, enabled: bool = True, delay: float = 1.5) -> None:
        self.enabled = enabled and sys.stderr is not None and sys.stderr.isatty()
        self.delay = delay
        self._bar = ""
        self._drawing: threading.Thread | None = None
        self._done = threading.Event()

    def __call__(self, done: float, text: str = "") -> None:
        """Report that `done` (0..1) of the work is done, and what is being done."""
        if not self.enabled:
            return
        done = min(max(done, 0.0), 1.0)
        filled = round(done * self.WIDTH)
        self._bar = f"\r[{'#' * filled}{'-' * (self.WIDTH - filled)}] {done:4.0%} {text[:40]}\x1b[K"
        if self._drawing is None:
            self._done.clear()
            self._drawing = threading.Thread(target=self._draw, daemon=True)
            self._drawing.start()

    def _draw(self) -> None:
        if self._done.wait(self.delay):
            return
        while True:
            print(self._bar, end="", file=sys.stderr, flush=True)
            if self._done.wait(self.INTERVAL):
                print("\r\x1b[K", end="", file=sys.stderr, flush=True)
                return

    def clear(self) -> None:
        """Remove the bar. The next call starts another one."""
        if self._drawing is not None:
            self._done.set()
            self._drawing.join()
            self._drawing = None


def _bytes(count: float) -> str:
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024 or unit == "GiB":
            break
        count /= 1024
    return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"


STATS_ROWS = {
    "device": "device",
    "lanes": "lanes",
    "technique": "technique",
    "execution": "execution",
    "size": "pixels",
    "samples": "samples a pixel",
    "triangles": "triangles",
    "lines": "lines",
    "points": "points",
    "clipped": "clipped triangles",
    "discarded": "discarded triangles",
    "passes": "passes",
    "passes_issued": "passes issued",
    "inner_passes": "inner passes of each peel",
    "fragments": "fragments",
    "layers_max": "most layers in a pixel",
    "truncated_pixels": "truncated pixels",
    "unpaired_pixels": "unpaired pixels",
    "batches": "batches",
    "bytes_per_pixel": "bytes per pixel",
}


def format_stats(stats: Figures) -> str:
    """Return a render's stats as a readable table: what was done, each stage's seconds, each buffer's bytes."""

    def show(value: object, between: str = ", ") -> str:
        if isinstance(value, list | tuple):
            return between.join(show(part) for part in value)
        if isinstance(value, str):
            return value
        return f"{value:,.1f}" if isinstance(value, float) else f"{value:,}"

    lines = [
        f"{label:<24} {show(stats[key], ' x ' if key == 'size' else ', ')}"
        for key, label in STATS_ROWS.items()
        if stats.get(key) is not None
    ]
    lines.append("seconds")
    lines += [f"  {stage:<22} {value:.4f}" for stage, value in stats.get("seconds", {}).items()]
    lines.append("bytes")
    lines += [f"  {name:<22} {_bytes(value)}" for name, value in stats.get("bytes", {}).items()]
    return "\n".join(lines)


HISTOGRAM_ROWS = 20
HISTOGRAM_WIDTH = 48


def format_complexity(figures: Figures) -> str:
    """Return the figures of a Complexity as text.

    These are the counts, a histogram of covered pixels, and what each technique needs.
    """
    width, height = figures["size"]
    marks = "".join(f", {figures[kind]:,} {kind}" for kind in ("lines", "points") if figures[kind])
    lines = [f"{width:,} x {height:,} pixels, {figures['triangles']:,} triangles{marks}"]
    if not figures["covered_pixels"]:
        return "\n".join([*lines, "nothing is in view"])
    opaque = figures["opaque_pixels"]
    lines += [
        f"covered    {figures['covered_share']:.1%} of the pixels ({figures['covered_pixels']:,})"
        + (f", {opaque:,} of them by an opaque surface" if opaque else ""),
        f"fragments  {figures['fragments']:,}" + (", transparent and in front of what is opaque" if opaque else ""),
        f"layers     most {figures['layers_max']:,}, 99th percentile {figures['layers_99th_percentile']:,}, "
        f"median {figures['layers_median']:,}, mean {figures['layers_mean']:.3g} of covered pixels",
        "",
        *_histogram(figures),
        "",
    ]
    rows = [("technique", "passes", "bytes a pixel", "seconds", "exact", "fragments left out")]
    for need in figures["techniques"]:
        seconds, left_out = need["seconds"], need["left_out"]
        rows.append(
            (
                need["technique"],
                f"{need['passes']:,}",
                f"{need['bytes_per_pixel']:,}",
                "?" if seconds is None else f"~{_two_digits(seconds)}",
                "yes" if need["exact"] else "no",
                "" if not left_out else f"{left_out:,} ({left_out / figures['fragments']:.1%})",
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        first, *numbers, last = (
            f"{cell:{'<' if column in (0, 5) else '>'}{wide}}"
            for column, (cell, wide) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join([first, *numbers, last]).rstrip())
    return "\n".join(lines)


def _histogram(figures: Figures) -> list[str]:
    """Return a bar chart of covered pixels by layers. It has at most HISTOGRAM_ROWS bins of equal width."""
    counts = list(figures["histogram"])
    counts[0] = figures["covered_pixels"] - sum(counts[1:])  # the pixels with opaque surfaces alone
    first = 0 if counts[0] else 1
    each = max(-(-(len(counts) - first) // HISTOGRAM_ROWS), 1)
    bins = [(low, min(low + each, len(counts))) for low in range(first, len(counts), each)]
    names = [f"{low}" if stop - low == 1 else f"{low}-{stop - 1}" for low, stop in bins]
    pixels = [sum(counts[low:stop]) for low, stop in bins]
    name_width = max(len("layers"), *map(len, names))
    number_width = max(len("pixels"), *(len(f"{count:,}") for count in pixels))
    lines = [f"{'layers':>{name_width}}  {'pixels':>{number_width}}"]
    for name, count in zip(names, pixels, strict=True):
        bar = "#" * -(-count * HISTOGRAM_WIDTH // max(pixels))  # at least one character if there is any pixel
        lines.append(f"{name:>{name_width}}  {count:>{number_width},}  {bar}".rstrip())
    return lines


def _two_digits(seconds: float) -> str:
    """Return two significant digits without an exponent: 0.0093, 0.12, 4.7, 31, 2500."""
    if seconds <= 0:
        return "0"
    place = max(-math.floor(math.log10(seconds)) + 1, 0)
    return f"{seconds:.{place}f}" if seconds < 100 else f"{round(seconds, -len(str(int(seconds))) + 2):.0f}"
