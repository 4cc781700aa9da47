"""`clpeel compare` and `clpeel complexity`: load a scene, measure, print and write."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

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


def run_compare(options: argparse.Namespace) -> int:
    """Load, compare, print and write. After an interrupt, it prints and writes the finished rows."""
    if not options.verbose:
        quiet_libraries()
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
    load, name, progress = _begin(options)
    code = 0
    try:
        scene = load()
        progress.clear()
        if not options.quiet:
            say_notes(scene.notes)
        progress(0.0, "comparing")
        comparison = clpeel.compare(
            scene,
            make_camera(options, scene),
            size=options.resolution,
            techniques=options.techniques,
            precisions=options.precisions,
            budgets=options.budgets,
            frames=options.frames,
            background=options.background_color,
            lighting=lighting_for(options, scene),
            opaque=options.opaque or "first",
            memory=options.memory,
            device=options.device,
            lanes=options.lanes,
            **given_marks(options),
            pictures="html" in files,
            progress=progress if progress.enabled else None,
        )
    except clpeel.Interrupted as interrupted:
        comparison, code = interrupted.comparison, EXIT_INTERRUPTED
    finally:
        progress.clear()
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
