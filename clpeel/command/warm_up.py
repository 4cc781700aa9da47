"""`clpeel warm-up`: compiles kernels ahead, at install time or while an image is built."""

from __future__ import annotations

import argparse
import os

from clpeel.command.streams import quiet_libraries, say, say_notes
from clpeel.command.terminal import Progress


def run_warm_up(options: argparse.Namespace) -> int:
    """Compile, and say what is kept where. Raises DeviceError if it cannot be kept, as then nothing was gained."""
    if not options.verbose:
        quiet_libraries()

    import clpeel
    from clpeel.errors import DeviceError
    from clpeel.rendering.warm_up import MOST_JOBS

    progress = Progress(enabled=not (options.quiet or options.no_progress))

    def report(done: float, text: str) -> None:
        progress(done, text)
        if options.verbose:
            say(f"{done:4.0%} {text}")

    jobs = options.jobs or min(_cores(), MOST_JOBS)
    try:
        warmed = clpeel.warm_up(options.techniques, options.device, options.lanes, jobs=jobs, progress=report)
    finally:
        progress.clear()
    if not warmed.kept:
        raise DeviceError("; ".join(warmed.notes))
    if not options.quiet:
        say_notes(warmed.notes)
        say(f"{warmed.kinds} kinds of pictures are compiled, in {warmed.seconds:.1f} s, and kept in '{warmed.folder}'")
    return 0


def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
