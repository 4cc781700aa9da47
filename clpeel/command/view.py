"""`clpeel view`: load a scene, and look at it live."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from clpeel.command.coloring import COLORING
from clpeel.command.inputs import load_demo, load_files, make_camera
from clpeel.command.order import FILE, MOMENT
from clpeel.command.render import given_options
from clpeel.command.streams import quiet_libraries, say, say_notes
from clpeel.command.terminal import Progress
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.viewer.command_line import Source


def run_view(options: argparse.Namespace) -> int:
    """Show the scene until its window is closed, or until Ctrl-C."""
    if not options.verbose:
        quiet_libraries()
    built_in = [name for name in ("demo", "boxes") if getattr(options, name)]
    if len(options.files[:1]) + len(built_in) != 1:
        came = " and ".join([*(["files"] if options.files else []), *(f"--{name}" for name in built_in)])
        raise InputError(f"view: expected FILE..., --demo or --boxes, got {came or 'none'} (see clpeel view --help)")
    load, name = load_demo(options) if built_in else load_files(options)

    from clpeel.device.devices import find_device
    from clpeel.rendering.request import checked_options
    from clpeel.viewer.open import checked_backend, view

    backend = checked_backend(options.backend)
    given = given_options(options)
    checked_options(options.technique, given)  # before files are read
    find_device(options.device)
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")
    try:
        scene = load()
    finally:
        progress.clear()
    if not options.quiet:
        say_notes(scene.notes)
        if options.host not in ("127.0.0.1", "::1", "localhost") and backend == "browser":
            say("note: others on the network who learn the page's address can look on and steer")
    view(
        scene,
        lambda pixels: make_camera(argparse.Namespace(**{**vars(options), "resolution": pixels}), scene),
        technique=options.technique,
        backend=backend,
        turning=options.turn or options.boxes,
        host=options.host,
        port=options.port,
        open_page=not options.no_open,
        title=name,
        device=options.device,
        lanes=options.lanes,
        source=source_of(options),
        warn=say,
        **given_options(options, scene),
    )
    return 0


def source_of(options: argparse.Namespace) -> Source:
    """Return the words that make the same scene, for the command line of a picture."""
    from clpeel.viewer.command_line import Source

    def scene() -> Iterator[str]:
        for text in ("opacity", "color", *MOMENT):
            for value in options.each.get(text, ()):
                words = FILE if value is None else ",".join(map(repr, value)) if text == "color" else repr(value)
                yield f"--{text.replace('_', '-')}={words}"
        for name in COLORING:
            for value, text in zip(options.each.get(name, ()), options.each_texts.get(name, ()), strict=True):
                flag = name.replace("_", "-")
                yield f"--{flag}={text}" if text is not None else f"--{flag}" if value else f"--no-{flag}"
        if options.drop_duplicates:
            yield "--drop-duplicates"

    def device() -> Iterator[str]:
        for name in ("device", "lanes"):
            if getattr(options, name) is not None:
                yield f"--{name}={getattr(options, name)}"

    return Source(("clpeel", *_words(options)), tuple(scene()), tuple(device()))


def _words(options: argparse.Namespace) -> Sequence[str]:
    if options.boxes:
        every = options.transparent_every
        return ("demo", "--boxes", *([] if every is None else [f"--transparent-every={every}"]))
    if options.demo:
        return ("demo",)
    return ("render", *(f"./{name}" if name.startswith("-") else name for name in options.named))
