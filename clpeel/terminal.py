"""What a command shows while it works and when it is done: the progress bar and the table of stats."""

from __future__ import annotations

import sys
import time
from typing import Any


class Progress:
    """A one-line bar on standard error, on a terminal only, once the work has lasted `delay` seconds."""

    WIDTH = 30

    def __init__(self, enabled: bool = True, delay: float = 1.5) -> None:
        self.enabled = enabled and sys.stderr is not None and sys.stderr.isatty()
        self.next_time = time.monotonic() + delay
        self.shown = False

    def __call__(self, done: float, text: str = "") -> None:
        """Show that `done` (0..1) of the work is done, at most ten times a second."""
        now = time.monotonic()
        if not self.enabled or now < self.next_time:
            return
        self.next_time = now + 0.1
        self.shown = True
        done = min(max(done, 0.0), 1.0)
        filled = round(done * self.WIDTH)
        bar = "#" * filled + "-" * (self.WIDTH - filled)
        print(f"\r[{bar}] {done:4.0%} {text[:40]}\x1b[K", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self.shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self.shown = False


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
