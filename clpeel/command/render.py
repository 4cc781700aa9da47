"""`clpeel render`, `layers` and `demo`: load a scene, render it, write the result."""

from __future__ import annotations

import argparse
import os
import re
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from clpeel.command.additions import Additions
from clpeel.command.inputs import load_demo, load_files, make_camera
from clpeel.command.options import EDGES, MARKS, METHOD, technique_options
from clpeel.command.outputs import (
    LAYER_FILES,
    MapOutput,
    check_apart,
    check_maps,
    check_picture,
    check_writable,
    counted,
    map_and_file,
    plain,
    write,
    write_layers,
)
from clpeel.command.provenance import command_words
from clpeel.command.streams import check_standard_output, print_text, quiet_libraries, say, say_notes
from clpeel.command.terminal import Progress, format_stats
from clpeel.errors import InputError
from clpeel.files import checked_folder
from clpeel.pictures.formats import EXR, LAYERS, NPZ, Chosen, chosen

if TYPE_CHECKING:
    from clpeel.rendering.options import Lighting
    from clpeel.rendering.result import Result
    from clpeel.scene.scene import Scene


def run_render(options: argparse.Namespace) -> int:
    return _render(options, *load_files(options))


def run_layers(options: argparse.Namespace) -> int:
    return _render(options, *load_files(options), layers=True)


def run_demo(options: argparse.Namespace) -> int:
    return _render(options, *load_demo(options))


def _render(options: argparse.Namespace, load: Callable[[], Scene], name: str, layers: bool = False) -> int:
    """Load, render and write. Nothing slow begins before the request is known to be possible.

    layers: write the layers into a folder instead of the picture into a file.
    """
    if not options.verbose:
        quiet_libraries()
    outputs = _outputs(options, layers)
    additions = Additions() if layers else Additions.of(options)
    _check_request(options, layers)
    started = time.perf_counter()
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")
    try:
        scene = load()
    finally:
        progress.clear()
    loaded = time.perf_counter()
    _say_what_was_read(options, scene, name, loaded - started, layers)
    if not options.quiet:
        say_notes(additions.notes)
    try:
        progress(0.0, "rendering")
        result = _result(options, scene, additions, layers, progress)
        rendered = time.perf_counter()
        progress(1.0, "writing")
        wrote = _write_result(options, outputs, result, layers, progress)
    finally:
        progress.clear()
    written = time.perf_counter()

    from clpeel.rendering.result import left_out

    seconds = {"load": loaded - started, **result.stats.seconds, "save": written - rendered}
    stats = {**result.stats, "seconds": seconds}
    if not options.quiet:
        say_notes(note for note in result.stats.notes if note not in scene.notes)
        say_notes(left_out(stats, bounded=options.max_error is not None))
    if options.explain:
        print_text("\n".join(stats["auto"]["explanation"]), aside=outputs.picture == "-")
    if outputs.stats == "-":
        print_text(format_stats(stats), aside=outputs.picture == "-")
    elif outputs.stats is not None:
        import json

        write(outputs.stats, (json.dumps(stats, indent=2, default=plain) + "\n").encode())
    if not options.quiet and outputs.picture != "-":
        width, height = options.resolution
        say(f"wrote {wrote} ({width} x {height}, {scene.described}, {written - started:.2f} s)")
    return 0


class _Outputs(NamedTuple):
    """Where each output goes: the name of a file, `-` for standard output, or None if it is not asked for."""

    picture: str
    stats: str | None
    maps: Sequence[MapOutput]
    format: Chosen | None
    """The picture's, or that of a single file of layers. None for a folder of layers."""


def _outputs(options: argparse.Namespace, layers: bool) -> _Outputs:
    """Return where each output goes. Raises InputError or OSError if it cannot go there."""
    output, format = _layers_output(options) if layers else _picture_output(options)
    stats = None if options.stats is None else check_writable(options.stats, "--stats")
    if options.explain:
        check_standard_output()

    from clpeel.techniques import AUTO

    if options.explain and options.technique != AUTO:
        raise InputError(f"--explain: expected --technique auto, whose choice it explains, got '{options.technique}'")
    found = _Outputs(output, stats, check_maps(options.map or (), _having_maps(options)), format)
    if layers and format is None:
        beside = [("--map", each.given, each.path) for each in found.maps]
        _check_beside_layers(output, [("--stats", options.stats, stats), *beside])
    _check_held_maps(options, format)
    maps = {f"--map {each.name}={each.given}": each.path for each in found.maps}
    check_apart({"--output": output, "--stats": stats, **maps}, options.inputs)
    return found


def _picture_output(options: argparse.Namespace) -> tuple[str, Chosen]:
    """Return where the picture goes, and in which format. Raises InputError or OSError if it cannot."""
    return check_picture(options.output, options.resolution, options.no_background, options.bit_depth)


def _layers_output(options: argparse.Namespace) -> tuple[str, Chosen | None]:
    """Return where layers go, and the format if that is one file. Raises InputError or OSError if they cannot."""
    if options.output == "-":
        raise InputError("--output: expected a folder, got '-'")
    suffix = os.path.splitext(options.output)[1].lower()
    if os.path.isdir(options.output) or not any(suffix in each.suffixes for each in LAYERS):
        return checked_folder(options.output, "--output"), None
    if options.keep_alpha:
        raise InputError(f"--keep-alpha: expected a folder of pictures, got the file '{options.output}'")
    return check_writable(options.output, "--output"), chosen(options.output, among=LAYERS, name="--output")


def _check_beside_layers(folder: str, files: Iterable[tuple[str, str, str | None]]) -> None:
    """Raise InputError if a file would be one of those that layers are written into.

    files: the option, the path as it was given, and the path with links resolved, None where there is no file.
    """
    for option, given, path in files:
        if path and os.path.dirname(path) == folder and re.fullmatch(LAYER_FILES, os.path.basename(path)):
            raise InputError(f"{option}: expected a file of its own, got '{given}', which is that of a layer")


def _check_held_maps(options: argparse.Namespace, format: Chosen | None) -> None:
    """Raise InputError if a map is asked for without a file, and the picture's file cannot hold it."""
    for text in options.map or ():
        name, path = map_and_file(text)
        if name is not None and path is None and (format is None or format.format not in (EXR, NPZ)):
            raise InputError(f"--map: expected {text}=FILE, or --output to .exr or .npz, which hold maps, got '{text}'")


def _having_maps(options: argparse.Namespace) -> Sequence[str]:
    """Return the names of the maps that a picture by the technique may have, its own first."""
    from clpeel.rendering.request import maps_of

    return maps_of(options.technique, options.max_error is not None)


def given_options(options: argparse.Namespace, scene: Scene | None = None) -> dict[str, Any]:
    """Return the given options of `clpeel.render`, without those of the camera and the device.

    scene: None if it is not known yet.
    """
    names = (*technique_options(), *METHOD, *MARKS, *EDGES, "samples", "memory", "light_intensity", "highlights")
    given = {name: value for name in names if (value := getattr(options, name)) is not None}
    return {
        **given,
        "size": options.resolution,
        "background": None if options.no_background else options.background_color,
        "lighting": lighting_for(options, scene),
    }


def given_marks(options: argparse.Namespace) -> dict[str, Any]:
    """Return the given options of how lines and points are drawn."""
    return {name: value for name in MARKS if (value := getattr(options, name)) is not None}


def lighting_for(options: argparse.Namespace, scene: Scene | None) -> Lighting:
    """Return the lighting that is asked for; by default the scene's own lights, if it has some, else the kit.

    scene: None if it is not known yet. Raises InputError if two are asked for, or lights that the scene has not.
    """
    if options.unlit and options.lighting not in (None, "none"):
        raise InputError(f"--unlit: expected no --lighting with it, got '{options.lighting}'")
    if options.unlit:
        return "none"
    if options.lighting == "scene" and scene is not None and not scene.lights:
        raise InputError("--lighting: expected lights in the file with 'scene', got none; 'kit' has lights of its own")
    from clpeel.rendering.options import default_lighting

    chosen: Lighting = options.lighting or default_lighting(scene is not None and bool(scene.lights))
    return chosen


def _given(options: argparse.Namespace, layers: bool, scene: Scene | None = None) -> dict[str, Any]:
    """Return the options of `given_options`, and what the command needs of the result."""
    maps = [name for text in options.map or () if (name := map_and_file(text)[0]) is not None]
    # A scale bar is drawn where the picture has no colour.
    keep = getattr(options, "bar", False) or (not layers and _needs_color(options)) or "transmittance" in maps
    found = {**given_options(options, scene), "keep_color": keep, "maps": maps}
    return {**found, "layers": True} if layers else found


def _needs_color(options: argparse.Namespace) -> bool:
    """Whether the picture's file has more than 8 bits a channel."""
    return chosen(options.output, options.bit_depth).bits > 8


def _check_request(options: argparse.Namespace, layers: bool) -> None:
    """Raise InputError if the options are wrong, or NoDeviceError if there is no such device."""
    from clpeel.device.devices import find_device
    from clpeel.rendering.request import checked_options

    checked_options(options.technique, _given(options, layers))
    find_device(options.device)


def _say_what_was_read(options: argparse.Namespace, scene: Scene, name: str, seconds: float, layers: bool) -> None:
    if not options.quiet:
        say_notes(scene.notes)
        if layers and scene.surfaces == "opaque" and options.opaque in (None, "first"):
            say("note: all is opaque, so there is one layer; --opacity 0.5 or --opaque blend peels what lies behind it")
    if options.verbose:
        say(f"{name}: {scene.described}, read in {seconds:.2f} s")


def _result(
    options: argparse.Namespace, scene: Scene, additions: Additions, layers: bool, progress: Progress
) -> Result:
    """Render the picture."""
    import clpeel

    camera = make_camera(options, scene)
    if options.verbose:
        say(f"{camera}")
    result = clpeel.render(
        additions.around(scene),
        camera,
        technique=options.technique,
        device=options.device,
        lanes=options.lanes,
        progress=progress if progress.enabled else None,
        **_given(options, layers, scene),
    )
    return additions.over(result, scene, camera, options)


def _write_result(
    options: argparse.Namespace, outputs: _Outputs, result: Result, layers: bool, progress: Progress
) -> str:
    """Write the picture or the layers, and the maps. Returns a text of what was written."""
    provenance = None if options.no_provenance else command_words(result.provenance, options.line)
    wrote: str = options.output
    if layers and outputs.format is None:
        wrote = write_layers(outputs.picture, result.layers, options, progress, provenance)
    elif layers:
        assert outputs.format is not None
        write(outputs.picture, result.layers.encoded(outputs.format, provenance))
        wrote = f"{options.output}, {counted(result.layers)}"
    else:
        assert outputs.format is not None
        write(outputs.picture, result.encoded(outputs.format, provenance))
    for each in outputs.maps:
        _write_map(each, result, provenance, options.quiet)
    return wrote


def _write_map(output: MapOutput, result: Result, provenance: dict[str, str] | None, quiet: bool) -> None:
    """Write a map, and say what its numbers stand for where the file holds others."""
    from clpeel.pictures.map_files import encode_map

    words = None if provenance is None else {**provenance, "map": output.name}
    data, note = encode_map(output.name, result.map(output.name), output.found, words)
    write(output.path, data)
    if note is not None and not quiet:
        say_notes([f"'{output.given}' has levels of {note}"])
