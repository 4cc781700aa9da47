"""Outputs: checks before any work where the command may write, and writes there whole or not at all."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import IO, TYPE_CHECKING, NamedTuple

from clpeel.command.streams import check_standard_output, standard_output
from clpeel.command.terminal import Progress
from clpeel.errors import InputError
from clpeel.files import checked_file, whole_folder, write_whole
from clpeel.pictures.formats import MAPS, PICTURES, Chosen, Format, check_holds, chosen
from clpeel.rendering.options import VIEW_MAPS

if TYPE_CHECKING:
    from clpeel.pictures.layers import Layers

LAYER_FILES = r"layer-\d+\.png|layers\.npz"
"""A pattern of the files that `clpeel layers` writes into its folder, and replaces there."""


def check_writable(path: str, option: str) -> str:
    """Check a path as checked_file does; `-` is standard output.

    Raises InputError, or OSError if standard output is closed.
    """
    if path != "-":
        return checked_file(path, option)
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


def check_picture(
    path: str,
    size: tuple[int, int],
    transparent: bool,
    bits: int | None = None,
    among: Sequence[Format] = PICTURES,
) -> tuple[str, Chosen]:
    """Check the picture's path as check_writable does. Returns it, and the format that its suffix asks for.

    size: (width, height) in pixels. transparent: whether it has no background. bits: of a channel, or None. among: the
    formats that it may have. Raises InputError also if the picture would go to a terminal, if the format cannot hold
    it, or if what writes it is not installed.
    """
    if path == "-" and sys.stdout.isatty():
        raise InputError("--output: will not write a PNG to a terminal; name a file, or send it on: -o - > out.png")
    found = chosen(path, bits, among, "--output")
    check_holds(found.format, size, transparent, "--output")
    return check_writable(path, "--output"), found


class MapOutput(NamedTuple):
    """A map to write. given: the path as it was given. path: with links resolved. found: the format of its suffix."""

    name: str
    given: str
    path: str
    found: Chosen


def check_maps(given: Sequence[str], having: Sequence[str]) -> list[MapOutput]:
    """Check the paths of maps, `NAME=FILE` each, or `FILE` for the technique's own map, as check_writable does.

    A name without a file is left out: such a map is for the picture's file. having: the names that the technique may
    make, its own first. Raises InputError also if it does not make the map, or for a format that holds no maps.
    """
    found = []
    for text in given:
        name, path = map_and_file(text)
        if name is None:
            name = own_map(having)
        if name not in having:
            raise InputError(f"--map: expected a map of this technique ({', '.join(having)}), got '{name}'")
        if path is None:
            continue
        if path == "-" or not os.path.splitext(path)[1]:
            suffixes = ", ".join(suffix for each in MAPS for suffix in each.suffixes)
            raise InputError(f"--map: expected a name ending in one of {suffixes}, got '{path}'")
        format = chosen(path, among=MAPS, name="--map")
        found.append(MapOutput(name, path, check_writable(path, "--map"), format))
    return found


def map_and_file(text: str) -> tuple[str | None, str | None]:
    """Return the name and the file that `--map` gives; None where it gives none. What is no map's name is a file's."""
    from clpeel.techniques import ERROR_BOUND, TECHNIQUES

    known = {*VIEW_MAPS, ERROR_BOUND, *(name for each in TECHNIQUES.values() for name in each.maps)}
    name, equals, path = text.partition("=")
    name = name.replace("-", "_")
    if name not in known:
        return None, text
    return name, path if equals else None


def own_map(having: Sequence[str]) -> str:
    """Return the first map of the technique's own, or raise InputError."""
    from clpeel.techniques import TECHNIQUES

    own = {name for technique in TECHNIQUES.values() for name in technique.maps[:1]}
    if having[0] in own:
        return having[0]
    makers = ", ".join(name for name, technique in TECHNIQUES.items() if technique.maps)
    raise InputError(
        f"--map: expected a technique that makes a map ({makers}), or NAME=FILE with a NAME of {', '.join(having)}"
    )


def write(path: str, data: bytes | Callable[[IO[bytes]], object]) -> None:
    """Write to standard output, or to a file, whole or not at all."""
    if path == "-":
        with standard_output():
            assert isinstance(data, bytes)
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
    else:
        write_whole(path, data)


def write_layers(
    folder: str,
    layers: Layers,
    options: argparse.Namespace,
    progress: Progress,
    provenance: Mapping[str, str] | None,
) -> str:
    """Write a picture for each layer and one file of all layers: all of these or none.

    provenance: what the files say of how they were made, or None. Returns a text of what was written.
    """
    from clpeel.pictures.png import encode_png

    background = None if options.no_background else options.background_color
    digits = max(2, len(str(layers.count)))
    with whole_folder(folder, LAYER_FILES) as whole:
        for k in range(layers.count):
            progress(k / layers.count, f"writing layer {k + 1} of {layers.count}")
            picture = encode_png(layers.picture(k, background, options.keep_alpha), provenance)
            write_whole(whole / f"layer-{k + 1:0{digits}}.png", picture)
        progress(1.0, "writing layers.npz")
        layers.save(whole / "layers.npz", provenance)
    return f"{os.path.join(options.output, 'layers.npz')}, {counted(layers)}"


def counted(layers: Layers) -> str:
    """Return how many layers there are, in words."""
    return f"{layers.count} layer{'' if layers.count == 1 else 's'}" if layers.count else "no layer is in view"


def plain(value: object) -> object:
    """Convert NumPy's numbers and arrays for json."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
