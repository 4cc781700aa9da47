"""The command `clpeel`: arguments in, a picture or a table out.

NumPy, OpenCL and trimesh are imported only inside the commands that need them.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import io
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from clpeel.command.parser import AXES, Vector, parse
from clpeel.command.terminal import Progress, format_stats
from clpeel.errors import ClpeelError, InputError
from clpeel.files import checked_file, checked_folder, whole_folder, write_whole

if TYPE_CHECKING:
    from clpeel.scene.camera import Camera
    from clpeel.scene.scene import Scene
    from clpeel.stages.find_layers import Layers

EXIT_FAILURE, EXIT_INTERRUPTED, EXIT_BROKEN_PIPE, EXIT_TERMINATED = 1, 130, 141, 143

LAYER_FILES = r"layer-\d+\.png|layers\.npz"
"""What `clpeel layers` writes into its folder, and replaces there."""


# --- what is said -----------------------------------------------------------------------------------------------------


def _print(text: str, aside: bool = False) -> None:
    """To standard output; aside, as a picture goes there, to standard error. Raises OSError where the former fails."""
    if not aside:
        with _standard_output():
            print(text, flush=True)
        return
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:  # there is nowhere left to say so
        _silence(sys.stderr)


def _say(text: str) -> None:
    _print(f"clpeel: {text}", aside=True)


@contextlib.contextmanager
def _standard_output() -> Iterator[None]:
    """Where standard output cannot be written, the OSError says so."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        _silence(sys.stdout)
        reason = "it is closed" if error.errno == errno.EBADF else error.strerror
        raise OSError(error.errno, f"cannot write to standard output: {reason}") from None


def _silence(stream: TextIO) -> None:
    """Nothing reads the stream any more: let the interpreter's last flush go nowhere."""
    with contextlib.suppress(io.UnsupportedOperation):  # what stands in for a stream need not be a file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _quiet_libraries() -> None:
    """Keep the libraries' warnings out of a command's output; `--verbose` leaves them in."""
    import warnings

    warnings.simplefilter("ignore")


# --- the camera -------------------------------------------------------------------------------------------------------


def _view_up(options: argparse.Namespace, view: Sequence[float]) -> Vector:
    """`--camera-view-up`, else `--up`; where neither was given and the camera looks along it, a side that is not."""
    up: Vector = options.camera_view_up or options.up or AXES["Y"]
    if options.camera_view_up or options.up:
        return up
    x, y, z = view
    if max(abs(x), abs(z)) > 1e-6 * abs(y):
        return up
    return (0.0, 0.0, -1.0) if y < 0 else (0.0, 0.0, 1.0)


def make_camera(options: argparse.Namespace, scene: Scene) -> Camera:
    """The camera that the options ask for: position and focal point, or all in view, then azimuth, elevation, zoom."""
    from dataclasses import replace

    from clpeel.scene.camera import Camera

    width, height = options.resolution
    orthographic = options.camera_orthographic
    if options.camera_position:
        low, high = scene.bounds
        focal_point = options.camera_focal_point or tuple(float(value) for value in low / 2 + high / 2)
        view: Sequence[float] = [to - at for at, to in zip(options.camera_position, focal_point, strict=True)]
        camera = Camera(
            options.camera_position,
            focal_point,
            _view_up(options, view),
            options.camera_view_angle,
            orthographic=orthographic,
        )
    else:
        direction = options.camera_direction
        camera = Camera.frame(
            scene,
            direction,
            _view_up(options, direction) if direction else options.up or AXES["Y"],
            options.camera_view_angle,
            aspect=width / height,
            orthographic=orthographic,
        )
        if options.camera_view_up:
            camera = replace(camera, view_up=options.camera_view_up)
        if options.camera_focal_point:
            x, y, z = (
                float(point + at - to)
                for point, at, to in zip(options.camera_focal_point, camera.position, camera.focal_point, strict=True)
            )
            camera = replace(camera, position=(x, y, z), focal_point=options.camera_focal_point)
    if options.clipping_range:
        camera = replace(camera, clipping_range=options.clipping_range)
    if options.camera_azimuth_angle:
        camera = camera.azimuth(options.camera_azimuth_angle)
    if options.camera_elevation_angle:
        camera = camera.elevation(options.camera_elevation_angle)
    if options.camera_zoom_factor:
        camera = camera.zoom(options.camera_zoom_factor)
    return camera


# --- render, layers and demo ------------------------------------------------------------------------------------------


def check_writable(path: str, option: str, suffix: str = "") -> str:
    """As checked_file; `-` is standard output. Raises OSError where that is closed."""
    if path != "-":
        return checked_file(path, option, suffix)
    _check_standard_output()
    return path


def _check_standard_output() -> None:
    """Raises OSError where it is closed."""
    with _standard_output(), contextlib.suppress(io.UnsupportedOperation):  # what stands in for it need not be a file
        os.write(sys.stdout.fileno(), b"")


def _check_apart(outputs: Mapping[str, str | None], files: Sequence[str]) -> None:
    """Refuses, before any work, an output that would replace an input or another output. Raises InputError.

    outputs: by what errors call them; None where there is none.
    """
    taken = {_identity(path): f"the input '{path}'" for path in files}
    for option, path in outputs.items():
        if path in (None, "-") or (os.path.exists(path) and not os.path.isfile(path)):
            continue
        other = taken.setdefault(_identity(path), option)
        if other != option:
            raise InputError(f"{option}: expected a file of its own, got '{path}', which is that of {other}")


def _identity(path: str) -> tuple[object, ...]:
    """The same for all names of a file."""
    with contextlib.suppress(OSError):
        found = os.stat(path)
        return found.st_dev, found.st_ino
    return (os.path.realpath(path),)


def _check_picture(path: str) -> str:
    """As check_writable, for the picture."""
    if path == "-" and sys.stdout.isatty():
        raise InputError("--output: will not write a PNG to a terminal; name a file, or send it on: -o - > out.png")
    return check_writable(path, "--output", ".png")


def _check_map(path: str, maps: Sequence[str]) -> str:
    """As check_writable, for the map of a technique that makes one."""
    if not maps:
        from clpeel.techniques import TECHNIQUES

        having = ", ".join(name for name, technique in TECHNIQUES.items() if technique.maps)
        raise InputError(f"--map: expected a technique that makes a map ({having})")
    suffix = os.path.splitext(path)[1]
    if suffix.lower() != ".npy":
        raise InputError(f"--map: expected a name ending in .npy, got '{path}'")
    return check_writable(path, "--map")


def _write(path: str, data: bytes) -> None:
    """To standard output, or to a file, whole or not at all."""
    if path == "-":
        with _standard_output():
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
    else:
        write_whole(path, data)


def _write_layers(folder: str, layers: Layers, options: argparse.Namespace, progress: Progress) -> str:
    """A picture for each layer and a file of all: all of them or none. Returns what was written."""
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


def _load_files(options: argparse.Namespace) -> tuple[Callable[[], Scene], str]:
    """What reads the files named, and what to call them."""

    def load() -> Scene:
        import clpeel

        extra = {"drop_duplicates": True} if options.drop_duplicates else {}
        opacities, colors = options.opacity or [None], options.color or [None]
        if len(opacities) == len(colors) == 1:
            return clpeel.load(*options.files, opacity=opacities[0], color=colors[0], **extra)
        count = len(options.files)
        each = zip(options.files, _for_each(opacities, count), _for_each(colors, count), strict=True)
        return clpeel.load(*(clpeel.load(file, opacity=opacity, color=color) for file, opacity, color in each), **extra)

    return load, ", ".join(os.path.basename(name) for name in options.files)


def _for_each(given: list[Any], count: int) -> list[Any]:
    """What was given once for all files, for each; what was given for each as it is."""
    return given * count if len(given) == 1 else given


def _run_render(options: argparse.Namespace) -> int:
    return _render(options, *_load_files(options))


def _run_layers(options: argparse.Namespace) -> int:
    return _render(options, *_load_files(options), layers=True)


def _run_demo(options: argparse.Namespace) -> int:
    def load() -> Scene:
        from clpeel.scene.demo import demo_scene

        scene = demo_scene()
        if options.opacity is None and options.color is None:
            return scene
        import clpeel

        (opacity,), (color,) = options.opacity or [None], options.color or [None]
        return clpeel.load(scene, opacity=opacity, color=color)

    from clpeel.scene.demo import DIRECTION, ZOOM

    if not (options.camera_position or options.camera_direction or options.up):
        options.camera_direction = DIRECTION
        options.camera_zoom_factor = options.camera_zoom_factor or ZOOM
    return _render(options, load, "the demo")


def _render(options: argparse.Namespace, load: Callable[[], Scene], name: str, layers: bool = False) -> int:
    """Load, render, write. Nothing slow is begun before what was asked is known to be possible.

    layers: writes the layers into a folder, not the picture into a file.
    """
    if not options.verbose:
        _quiet_libraries()
    if layers and options.output == "-":
        raise InputError("--output: expected a folder, got '-'")
    output = checked_folder(options.output, "--output") if layers else _check_picture(options.output)
    stats_output = None if options.stats is None else check_writable(options.stats, "--stats")
    if options.explain:
        _check_standard_output()

    import clpeel
    from clpeel.device.devices import choose
    from clpeel.device.memory import parse_memory
    from clpeel.pictures.png import encode_map, encode_png
    from clpeel.rendering.renderer import check_layers
    from clpeel.techniques import AUTO, technique

    if options.explain and options.technique != AUTO:
        raise InputError(f"--explain: expected --technique auto, whose choice it explains, got '{options.technique}'")
    maps = () if options.technique == AUTO else technique(options.technique).maps
    map_output = None if options.map is None else _check_map(options.map, maps)
    outputs = {"--output": output, "--stats": stats_output, "--map": map_output}
    if layers and stats_output and os.path.dirname(stats_output) == output:
        if re.fullmatch(LAYER_FILES, os.path.basename(stats_output)):
            raise InputError(f"--stats: expected a file of its own, got '{options.stats}', which is that of a layer")
    _check_apart(outputs, getattr(options, "files", ()))
    check_layers(options.technique, layers, options.samples)
    if options.memory is not None:
        parse_memory(options.memory)
    choose(options.device)

    started = time.perf_counter()
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")
    try:
        scene = load()
    finally:
        progress.clear()
    loaded = time.perf_counter()
    if not options.quiet:
        _say_notes(scene.notes)
        if layers and scene.surfaces == "opaque" and options.opaque in (None, "first"):
            _say(
                "note: all is opaque, so there is one layer; --opacity 0.5 or --opaque blend peels what lies behind it"
            )
    camera = make_camera(options, scene)
    if options.verbose:
        _say(f"{name}: {len(scene.faces):,} triangles, read in {loaded - started:.2f} s")
        _say(f"{camera}")

    # Options of some techniques only: given to any, which refuses those that it does not have.
    given = {
        "passes": options.passes,
        "layers_per_pass": options.layers,
        "occlusion_query": False if options.no_occlusion_query else None,
        "coincident": options.coincident,
        "opaque": options.opaque,
        "max_error": options.max_error,
        "hazard_window": options.hazard_window,
        "hazard_order": options.hazard_order,
        "torn_writes": options.torn_writes or None,
        "precision": options.precision,
        "depth_format": options.depth_format,
        "variant": options.variant,
        "projected": options.projected or None,
        "thickness_range": options.thickness_range,
        "scale_bar": False if options.no_scale_bar else None,
        "sigma": options.sigma,
        "light_color": options.light_color,
        "layers": layers or None,
    }
    try:
        progress(0.0, "rendering")
        result = clpeel.render(
            scene,
            camera,
            size=options.resolution,
            technique=options.technique,
            background=None if options.no_background else options.background_color,
            lighting="none" if options.unlit else "headlight",
            samples=options.samples,
            memory=options.memory,
            device=options.device,
            lanes=options.lanes,
            keep_color=False,
            progress=progress if progress.enabled else None,
            **{name: value for name, value in given.items() if value is not None},
        )
        rendered = time.perf_counter()
        progress(1.0, "writing")
        wrote = options.output
        if layers:
            wrote = _write_layers(output, result.layers, options, progress)
        else:
            _write(output, encode_png(result.image))
        if map_output is not None:
            _write(map_output, encode_map(result.map(maps[0])))
    finally:
        progress.clear()
    written = time.perf_counter()

    seconds = {"load": loaded - started, **result.stats["seconds"], "save": written - rendered}
    stats = {**result.stats, "seconds": seconds}
    if not options.quiet:
        _say_notes(note for note in stats.get("notes", ()) if note not in scene.notes)
        _warn(options, stats)
    if options.explain:
        _print("\n".join(stats["auto"]["explanation"]), aside=output == "-")
    if stats_output == "-":
        _print(format_stats(stats), aside=output == "-")
    elif stats_output is not None:
        import json

        _write(stats_output, (json.dumps(stats, indent=2, default=_plain) + "\n").encode())
    if not options.quiet and output != "-":
        width, height = options.resolution
        _say(f"wrote {wrote} ({width} x {height}, {len(scene.faces):,} triangles, {written - started:.2f} s)")
    return 0


def _say_notes(notes: Iterable[str]) -> None:
    for note in notes:
        _say(f"note: {note}")


def _warn(options: argparse.Namespace, stats: dict[str, Any]) -> None:
    """Say what the picture could not show."""
    if stats.get("discarded"):
        _say(f"note: {stats['discarded']:,} triangles with NaN or infinite vertices were left out")
    if stats.get("unpaired_pixels"):
        _say(
            f"note: {stats['unpaired_pixels']:,} pixels have crossings that do not pair up: "
            "the mesh is not watertight there, or is clipped"
        )
    if stats.get("truncated_pixels") and options.max_error is None and "auto" not in stats:
        unit = "samples" if stats["samples"] > 1 else "pixels"
        _say(
            f"note: {stats['truncated_pixels']:,} {unit} have more layers than the passes peeled; "
            f"those change no channel by more than {stats['truncation_bound']:.3g} of 1"
        )


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays for json."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


# --- compare ----------------------------------------------------------------------------------------------------------


def _run_compare(options: argparse.Namespace) -> int:
    """Load, compare, print and write; interrupted, what is finished."""
    if not options.verbose:
        _quiet_libraries()
    files = {name: path for name in ("json", "csv", "html") if (path := getattr(options, name)) is not None}
    if list(files.values()).count("-") > 1:
        raise InputError("-: expected one of --json, --csv and --html on standard output, got several")
    files = {name: check_writable(path, f"--{name}") for name, path in files.items()}
    _check_apart({f"--{name}": path for name, path in files.items()}, options.files)
    if "-" not in files.values() and not (options.quiet and files):
        _check_standard_output()  # for the table

    import clpeel
    from clpeel.device.devices import choose
    from clpeel.device.memory import parse_memory
    from clpeel.study.comparison import check_choice

    check_choice(options.techniques, options.precisions)
    if options.memory is not None:
        parse_memory(options.memory)
    choose(options.device)

    load, name = _load_files(options)
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")
    code = 0
    try:
        scene = load()
        progress.clear()
        if not options.quiet:
            _say_notes(scene.notes)
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
            lighting="none" if options.unlit else "headlight",
            opaque=options.opaque or "first",
            memory=options.memory,
            device=options.device,
            lanes=options.lanes,
            pictures="html" in files,
            progress=progress if progress.enabled else None,
        )
    except clpeel.Interrupted as interrupted:
        comparison, code = interrupted.comparison, EXIT_INTERRUPTED
    finally:
        progress.clear()
    if not options.quiet or not files:
        _print(comparison.table(), aside="-" in files.values())
    for kind, path in files.items():
        text = comparison.to_html(name) if kind == "html" else getattr(comparison, f"to_{kind}")()
        _write(path, text.encode())
        if not options.quiet and path != "-":
            _say(f"wrote {getattr(options, kind)}")
    if code:
        _say("interrupted")
    return code


# --- complexity ------------------------------------------------------------------------------------------------------


def _run_complexity(options: argparse.Namespace) -> int:
    """Load, count, write. Nothing slow is begun before what was asked is known to be possible."""
    if not options.verbose:
        _quiet_libraries()
    output = _check_picture(options.output)
    figures_output = None if options.json is None else check_writable(options.json, "--json")
    if figures_output == "-":
        raise InputError("--json: expected a file of its own, got '-'")
    _check_apart({"--output": output, "--json": figures_output}, options.files)
    if output != "-" and not options.quiet:
        _check_standard_output()  # for the figures
    if options.opaque not in ("first", "blend"):
        raise InputError(f"--opaque: expected first or blend, got '{options.opaque}'")

    import clpeel
    from clpeel.command.terminal import format_complexity
    from clpeel.device.cache import take_notes
    from clpeel.device.devices import choose
    from clpeel.device.memory import parse_memory
    from clpeel.pictures.png import encode_png

    if options.memory is not None:
        parse_memory(options.memory)
    choose(options.device)

    load, name = _load_files(options)
    progress = Progress(enabled=not (options.quiet or options.no_progress))
    progress(0.0, f"reading {name}")
    try:
        scene = load()
        camera = make_camera(options, scene)
        progress(0.0, "counting")
        found = clpeel.complexity(
            scene,
            camera,
            options.resolution,
            "none" if options.unlit else "headlight",
            opaque=options.opaque,
            memory=options.memory,
            device=options.device,
            lanes=options.lanes,
            progress=progress if progress.enabled else None,
        )
        progress(1.0, "writing")
        background = None if options.no_background else options.background_color
        _write(output, encode_png(found.image(background, not options.no_scale_bar)))
        if figures_output is not None:
            import json

            _write(figures_output, (json.dumps(found.figures(), indent=2) + "\n").encode())
    finally:
        progress.clear()
    if not options.quiet:
        _say_notes((*scene.notes, *take_notes()))
        _print(format_complexity(found.figures()), aside=output == "-")
        if output != "-":
            width, height = options.resolution
            _say(f"wrote {options.output} ({width} x {height}, {len(scene.faces):,} triangles)")
    return 0


# --- devices and report -----------------------------------------------------------------------------------------------


def _run_devices(options: argparse.Namespace) -> int:
    if not options.verbose:
        _quiet_libraries()
    from clpeel.command.report import device_table

    _print("\n".join(device_table()))
    return 0


def _run_techniques(options: argparse.Namespace) -> int:
    from clpeel.command.report import technique_table

    _print("\n".join(technique_table()))
    return 0


def _run_report(options: argparse.Namespace) -> int:
    if not options.verbose:
        _quiet_libraries()
    from clpeel.command.report import report

    _print("\n".join(report()))
    return 0


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "render": _run_render,
    "layers": _run_layers,
    "compare": _run_compare,
    "complexity": _run_complexity,
    "demo": _run_demo,
    "techniques": _run_techniques,
    "devices": _run_devices,
    "report": _run_report,
}


# --- the command ------------------------------------------------------------------------------------------------------


def _explain(error: Exception) -> tuple[str, int]:
    """One line that says what went wrong and what to do, and the exit code."""
    first_line = next(iter(str(error).splitlines()), "")
    if isinstance(error, ClpeelError):
        return first_line, error.exit_code
    if isinstance(error, MemoryError):
        return "not enough memory; try a smaller --resolution or fewer triangles", EXIT_FAILURE
    opencl = sys.modules.get("pyopencl")
    if opencl is not None and isinstance(error, opencl.Error):
        if isinstance(error, opencl.MemoryError) or "OUT_OF" in first_line or "ALLOCATION" in first_line:
            return (
                f"the OpenCL device ran out of memory ({first_line}); try a smaller --memory, such as 256M, "
                "or a smaller --resolution",
                EXIT_FAILURE,
            )
        return f"OpenCL failed: {first_line}; try another --device ('clpeel devices' lists them)", EXIT_FAILURE
    if isinstance(error, OSError) and error.strerror:
        where = f" '{error.filename}'" if error.filename else ""
        return f"{error.strerror}{where}", EXIT_FAILURE
    return (
        f"unexpected {type(error).__name__}: {first_line} "
        "(--verbose shows where; please report it with what 'clpeel report' prints)",
        EXIT_FAILURE,
    )


class _Terminated(BaseException):
    """SIGTERM: the command ends as after Ctrl-C, so that nothing half written stays."""


@contextlib.contextmanager
def _orderly_end() -> Iterator[None]:
    """Within it SIGTERM raises _Terminated, where nobody else has seen to that signal."""

    def end(*_: object) -> None:
        raise _Terminated

    ours = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    if ours:
        signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _fill_standard_streams() -> None:
    """Opens what is closed of standard input, output and error, lest a file that is written becomes one of them.

    Writing to standard output then fails, as it must; errors are told to nobody.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the least that is free, which is this one
    if sys.stdout is None:
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w")
    if sys.stderr is None:
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")


def _run(arguments: Sequence[str]) -> int:
    try:
        with _standard_output():
            options = parse(arguments)
    except SystemExit as end:  # after --help and --version
        return int(end.code or 0)
    return COMMANDS[options.command](options)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    0 done, 1 failed, 2 bad input, 3 no device, 130 interrupted, 141 nobody reads standard output, 143 terminated.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    _fill_standard_streams()
    try:
        with _orderly_end():
            code = _run(arguments)
            with _standard_output():
                sys.stdout.flush()
            return code
    except BrokenPipeError:
        _silence(sys.stdout)
        return EXIT_BROKEN_PIPE
    except KeyboardInterrupt:
        _say("interrupted")
        return EXIT_INTERRUPTED
    except _Terminated:
        _say("terminated")
        return EXIT_TERMINATED
    except Exception as error:
        if "--verbose" in arguments:
            import traceback

            traceback.print_exc()
        message, code = _explain(error)
        _say(f"error: {message}")
        return code
