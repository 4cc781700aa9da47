"""`clpeel compare` and `clpeel complexity`: load a scene, measure, print and write."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from clpeel.checks import parse_memory
from clpeel.command.inputs import load_files, make_camera
from clpeel.command.outputs import check_apart, check_picture, check_writable, write
from clpeel.command.render import given_marks, lighting_for
from clpeel.command.streams import check_standard_output, print_text, quiet_libraries, say, say_notes
from clpeel.command.terminal import EXIT_INTERRUPTED, Progress
from clpeel.errors import InputError
from clpeel.pictures.formats import EIGHT_BITS

if TYPE_CHECKING:
    from clpeel.scene.scene import Scene
    from clpeel.study.comparison import Comparison
    from clpeel.study.standings import SuiteComparison


def _begin(options: argparse.Namespace) -> tuple[Callable[[], Scene], str, Progress]:
    """Check the memory and the device. Then return a function that reads the files, their name, and the progress bar.

    Raises InputError or NoDeviceError.
    """
    from clpeel.device.devices import find_device

    if options.memory is not None:
        parse_memory(options.memory)
    find_device(options.device)
    load, name = load_files(options)
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")
    return load, name, progress


SUITES_OWN = frozenset(
    "suite scenes models techniques precisions budgets frames json csv html resolution memory device lanes no_progress "
    "quiet verbose config no_config".split()
)
"""The options of `compare` that hold with --suite, whose scenes have their own colours, lights and cameras."""


def run_compare(options: argparse.Namespace) -> int:
    """Load, compare, print and write. After an interrupt, it prints and writes the finished rows."""
    if not options.verbose:
        quiet_libraries()
    _check_suite(options)
    files = {name: path for name in ("json", "csv", "html") if (path := getattr(options, name)) is not None}
    if list(files.values()).count("-") > 1:
        raise InputError("-: expected one of --json, --csv and --html on standard output, got several")
    files = {name: check_writable(path, f"--{name}") for name, path in files.items()}
    check_apart({f"--{name}": path for name, path in files.items()}, options.inputs)
    if "-" not in files.values() and not (options.quiet and files):
        check_standard_output()  # the table goes there

    import clpeel
    from clpeel.study.compare import check_choice

    check_choice(options.techniques, options.precisions)
    comparison: Comparison | SuiteComparison
    code, name = 0, "clpeel compare --suite"
    try:
        if options.suite:
            comparison = _of_suite(options, "html" in files)
        else:
            load, name, progress = _begin(options)
            comparison = _of_files(options, load, progress, "html" in files)
    except (clpeel.Interrupted, clpeel.InterruptedSuite) as interrupted:
        comparison, code = interrupted.comparison, EXIT_INTERRUPTED
    if not options.quiet or not files:
        print_text(comparison.table(), aside="-" in files.values())
    for kind, path in files.items():
        text = comparison.to_html(name) if kind == "html" else getattr(comparison, f"to_{kind}")()
        write(path, text.encode())
        if not options.quiet and path != "-":
            say(f"wrote {getattr(options, kind)}")
    if code:
        say("interrupted")
    return code


def _check_suite(options: argparse.Namespace) -> None:
    """Raise InputError if files and --suite are given, or neither, or an option that goes with the other one alone."""
    if not options.suite:
        for name in ("scenes", "models"):
            if getattr(options, name) is not None:
                raise InputError(f"--{name}: expected --suite with it, got none")
        if not options.named:
            raise InputError("FILE: expected mesh files, or --suite, got none (see clpeel compare --help)")
        return
    if options.named:
        raise InputError(f"--suite: expected no file with it, got '{options.named[0]}'")
    for name in getattr(options, "given", {}).keys() - {"files"}:
        if name not in SUITES_OWN:
            flag = f"--{name.replace('_', '-')}"
            raise InputError(f"{flag}: expected no such option with --suite, whose scenes have their own; got one")


def _of_files(options: argparse.Namespace, load: Callable[[], Scene], progress: Progress, pictures: bool) -> Comparison:
    """Return the comparison on the scene of the files."""
    import clpeel

    try:
        scene = load()
        progress.clear()
        if not options.quiet:
            say_notes(scene.notes)
        progress(0.0, "comparing")
        return clpeel.compare(
            scene,
            make_camera(options, scene),
            size=options.resolution,
            background=options.background_color,
            lighting=lighting_for(options, scene),
            opaque=options.opaque or "first",
            **given_marks(options),
            **_choices(options, progress),
            pictures=pictures,
        )
    finally:
        progress.clear()


def _of_suite(options: argparse.Namespace, pictures: bool) -> SuiteComparison:
    """Return the comparison on the scenes of the suite."""
    import clpeel

    progress = Progress(enabled=not (options.quiet or options.no_progress))
    try:
        return clpeel.compare_suite(
            options.scenes,
            options.resolution,
            models=options.models,
            **_choices(options, progress),
            pictures=pictures,
        )
    finally:
        progress.clear()


def _choices(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Return the parameters that comparisons on files and on the suite share, by name."""
    names = "techniques precisions budgets frames memory device lanes".split()
    return {**{name: getattr(options, name) for name in names}, "progress": progress if progress.enabled else None}


def run_complexity(options: argparse.Namespace) -> int:
    """Load, count and write. Nothing slow begins before the request is known to be possible."""
    if not options.verbose:
        quiet_libraries()
    output, format = check_picture(options.output, options.resolution, options.no_background, among=EIGHT_BITS)
    figures_output = None if options.json is None else check_writable(options.json, "--json")
    if figures_output == "-":
        raise InputError("--json: expected a file of its own, got '-'")
    check_apart({"--output": output, "--json": figures_output}, options.inputs)
    if output != "-" and not options.quiet:
        check_standard_output()  # the figures go there
    if options.opaque not in ("first", "blend"):
        raise InputError(f"--opaque: expected first or blend, got '{options.opaque}'")

    import clpeel
    from clpeel.command.terminal import format_complexity
    from clpeel.device.cache import take_notes
    from clpeel.pictures.encode import encode
    from clpeel.pictures.shown import Shown

    load, _, progress = _begin(options)
    try:
        scene = load()
        camera = make_camera(options, scene)
        progress(0.0, "counting")
        found = clpeel.complexity(
            scene,
            camera,
            options.resolution,
            lighting_for(options, scene),
            opaque=options.opaque,
            memory=options.memory,
            device=options.device,
            lanes=options.lanes,
            **given_marks(options),
            progress=progress if progress.enabled else None,
        )
        progress(1.0, "writing")
        background = None if options.no_background else options.background_color
        write(output, encode(Shown(found.image(background, not options.no_scale_bar), None), format))
        if figures_output is not None:
            import json

            write(figures_output, (json.dumps(found.figures(), indent=2) + "\n").encode())
    finally:
        progress.clear()
    if not options.quiet:
        say_notes((*scene.notes, *take_notes()))
        print_text(format_complexity(found.figures()), aside=output == "-")
        if output != "-":
            width, height = options.resolution
            say(f"wrote {options.output} ({width} x {height}, {scene.described})")
    return 0
