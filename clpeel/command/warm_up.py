"""`clpeel warm-up`: compiles kernels ahead, at install time or while an image is built."""

from __future__ import annotations

import argparse
import os

from clpeel.command.streams import quiet_libraries, say
from clpeel.command.terminal import Progress

EXIT_FAILURE = 1


def run_warm_up(options: argparse.Namespace) -> int:
    """Compile, and say what is kept where. It has failed if nothing can be kept."""
    if not options.verbose:
        quiet_libraries()

    import clpeel

    progress = Progress(enabled=not (options.quiet or options.no_progress))

    def report(done: float, text: str) -> None:
        progress(done, text)
        if options.verbose:
            say(f"{done:4.0%} {text}")

    try:
        warmed = clpeel.warm_up(
            options.techniques,
            options.device,
            options.lanes,
            jobs=options.jobs or os.cpu_count() or 1,
            progress=report,
        )
    finally:
        progress.clear()
    if warmed.notes:
        say(f"error: {'; '.join(warmed.notes)}")
        return EXIT_FAILURE
    if not options.quiet:
        say(f"{warmed.kinds} kinds of pictures are compiled, in {warmed.seconds:.1f} s, and kept in '{warmed.folder}'")
    return 0
