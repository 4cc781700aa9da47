"""`clpeel turntable`: load a scene, turn the camera around it, write the film."""

from __future__ import annotations

import argparse
import time

from clpeel.checks import AXES, named_view
from clpeel.command.additions import Additions
from clpeel.command.inputs import load_files, make_camera
from clpeel.command.outputs import check_apart
from clpeel.command.render import given_options
from clpeel.command.streams import quiet_libraries, say, say_notes
from clpeel.command.terminal import Progress
from clpeel.command.values import Vector
from clpeel.film.outputs import Output, checked_output


def run_turntable(options: argparse.Namespace) -> int:
    """Load, draw and write. Nothing slow begins before the film is known to be possible."""
    if not options.verbose:
        quiet_libraries()
    output = checked_output(options.output, "--output")
    check_apart({"--output": output.path}, options.inputs)
    additions = Additions.of(options)
    load, name = load_files(options)
    _check(options, output)

    import clpeel

    started = time.perf_counter()
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")

    def tell(text: str) -> None:
        progress.clear()
        if not options.quiet:
            say(text)

    try:
        scene = load()
        progress.clear()
        if not options.quiet:
            say_notes([*scene.notes, *additions.notes])
        film = clpeel.turntable(
            additions.around(scene),
            options.output,
            make_camera(options, scene),
            options.frames,
            options.degrees,
            options.fps,
            technique=options.technique,
            up=axis_of(options),
            quality=options.quality,
            lossless=options.lossless,
            axis=additions.axis,
            bar=additions.bar,
            device=options.device,
            lanes=options.lanes,
            progress=progress if progress.enabled else None,
            tell=tell,
            **given_options(options, scene),
        )
    except Exception:
        raise
    except BaseException:  # Ctrl-C, or SIGTERM
        progress.clear()
        _say_what_is_kept(output, options.frames)
        raise
    finally:
        progress.clear()
    if not options.quiet:
        say_notes(note for note in film.notes if note not in scene.notes)
        width, height = options.resolution
        seconds = time.perf_counter() - started
        say(f"wrote {options.output} ({film.frames} x {width} x {height}, {scene.described}, {seconds:.2f} s)")
    return 0


def _check(options: argparse.Namespace, output: Output) -> None:
    """Raise InputError if the options are wrong, or NoDeviceError if there is no such device."""
    from clpeel.device.devices import find_device
    from clpeel.film.turntable import check_technique, check_turntable
    from clpeel.rendering.request import checked_options

    given = given_options(options)
    check_turntable(
        output,
        options.resolution,
        options.no_background,
        options.frames,
        options.fps,
        options.quality,
        options.lossless,
    )
    checked_options(options.technique, given)
    check_technique(options.technique, given)
    find_device(options.device)


def axis_of(options: argparse.Namespace) -> Vector:
    """Return what the camera turns about: `--up`, the up of a view by name, `--camera-view-up`, or Y."""
    direction = options.camera_direction
    named = named_view(direction) if isinstance(direction, str) else None
    axis: Vector = options.up or (named[1] if named else None) or options.camera_view_up or AXES["Y"]
    return axis


def _say_what_is_kept(output: Output, frames: int) -> None:
    """Say that a film that was interrupted can be continued, if any frame is finished."""
    from clpeel.film.kept import finished

    if output.kind == "png":
        say("the numbered pictures stay; the same command continues with them")
    elif count := finished(output):
        say(f"{count} of {frames} frames are kept in a hidden folder; the same command continues")
