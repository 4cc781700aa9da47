"""Outputs: checks before any work where the command may write, and writes there whole or not at all."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from clpeel.command.streams import check_standard_output, standard_output
from clpeel.command.terminal import Progress
from clpeel.errors import InputError
from clpeel.files import checked_file, whole_folder, write_whole

if TYPE_CHECKING:
    from clpeel.pictures.layers import Layers

LAYER_FILES = r"layer-\d+\.png|layers\.npz"
"""A pattern of the files that `clpeel layers` writes into its folder, and replaces there."""


def check_writable(path: str, option: str, suffix: str = "") -> str:
    """Check a path as checked_file does; `-` is standard output.

    Raises InputError, or OSError if standard output is closed.
    """
    if path != "-":
        return checked_file(path, option, suffix)
    check_standard_output()
    return path


def check_apart(outputs: Mapping[str, str | None], files: Sequence[str]) -> None:
    """Raise InputError, before any work, if an output would replace an input or another output.

    outputs: the paths, by the names that errors use; None where there is no output. files: the inputs.
    """
    taken = {_identity(path): f"the input '{path}'" for path in files}
    for option, path in outputs.items():
        if path in (None, "-") or (os.path.exists(path) and not os.path.isfile(path)):
            continue
        other = taken.setdefault(_identity(path), option)
        if other != option:
            raise InputError(f"{option}: expected a file of its own, got '{path}', which is that of {other}")


def _identity(path: str) -> tuple[object, ...]:
    """Return a value that is the same for all names of one file."""
    with contextlib.suppress(OSError):
        found = os.stat(path)
        return found.st_dev, found.st_ino
    return (os.path.realpath(path),)


def check_picture(path: str) -> str:
    """Check the picture's path as check_writable does. Raises InputError also if the PNG would go to a terminal."""
    if path == "-" and sys.stdout.isatty():
        raise InputError("--output: will not write a PNG to a terminal; name a file, or send it on: -o - > out.png")
    return check_writable(path, "--output", ".png")


def check_map(path: str, maps: Sequence[str]) -> str:
    """Check the path of a technique's map as check_writable does.

    Raises InputError also if the technique makes no map.
    """
    if not maps:
        from clpeel.techniques import TECHNIQUES

        having = ", ".join(name for name, technique in TECHNIQUES.items() if technique.maps)
        raise InputError(f"--map: expected a technique that makes a map ({having})")
    suffix = os.path.splitext(path)[1]
    if suffix.lower() != ".npy":
        raise InputError(f"--map: expected a name ending in .npy, got '{path}'")
    return check_writable(path, "--map")


def write(path: str, data: bytes) -> None:
    """Write to standard output, or to a file, whole or not at all."""
    if path == "-":
        with standard_output():
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
    else:
        write_whole(path, data)


def write_layers(folder: str, layers: Layers, options: argparse.Namespace, progress: Progress) -> str:
    """Write a picture for each layer and one file of all layers: all of these or none.

    Returns a text of what was written.
    """
    from clpeel.pictures.png import save_png

    background = None if options.no_background else options.background_color
    digits = max(2, len(str(layers.count)))
    with whole_folder(folder, LAYER_FILES) as whole:
        for k in range(layers.count):
            progress(k / layers.count, f"writing layer {k + 1} of {layers.count}")
            save_png(whole / f"layer-{k + 1:0{digits}}.png", layers.picture(k, background, options.keep_alpha))
        progress(1.0, "writing layers.npz")
        layers.save(whole / "layers.npz")
    pictures = f"{layers.count} layer{'' if layers.count == 1 else 's'}" if layers.count else "no layer is in view"
    return f"{os.path.join(options.output, 'layers.npz')}, {pictures}"


def plain(value: object) -> object:
    """Convert NumPy's numbers and arrays for json."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
