"""What a command shows while it works and when it is done: the progress bar and the table of stats."""

from __future__ import annotations

import sys
import threading
from typing import Any


class Progress:
    """A one-line bar on standard error, on a terminal only, once the work has lasted `delay` seconds.

    A thread draws it, so that it also shows while a file is read or kernels are compiled, which report nothing.
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
        """Say that `done` (0..1) of the work is done, and what is being done."""
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
        """Take the bar away; the next call begins another."""
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
    "size": "pixels",
    "samples": "samples a pixel",
    "triangles": "triangles",
    "clipped": "clipped triangles",
    "discarded": "discarded triangles",
    "passes": "passes",
    "passes_issued": "passes issued",
    "fragments": "fragments",
    "layers_max": "most layers in a pixel",
    "truncated_pixels": "truncated pixels",
    "unpaired_pixels": "unpaired pixels",
    "batches": "batches",
    "bytes_per_pixel": "bytes per pixel",
}


def format_stats(stats: dict[str, Any]) -> str:
    """A render's stats as a readable table: what was done, the seconds of each stage, the bytes of each buffer."""

    def show(value: Any) -> str:
        if isinstance(value, list | tuple):
            return " x ".join(show(part) for part in value)
        if isinstance(value, str):
            return value
        return f"{value:,.1f}" if isinstance(value, float) else f"{value:,}"

    lines = [f"{label:<24} {show(stats[key])}" for key, label in STATS_ROWS.items() if stats.get(key) is not None]
    lines.append("seconds")
    lines += [f"  {stage:<22} {value:.4f}" for stage, value in stats.get("seconds", {}).items()]
    lines.append("bytes")
    lines += [f"  {name:<22} {_bytes(value)}" for name, value in stats.get("bytes", {}).items()]
    return "\n".join(lines)
