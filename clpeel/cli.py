"""The command `clpeel`: arguments in, a picture or a table out.

NumPy, OpenCL and trimesh are imported only inside the commands that need them, so that `--help` answers at once.
Options carry f3d's names; what a picture needs is in `_render`, which `render` and `demo` share.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from clpeel.errors import ClpeelError, InputError

if TYPE_CHECKING:
    from clpeel.camera import Camera
    from clpeel.scene import Scene

Vector = tuple[float, float, float]

MAX_SIDE = 65536  # pixels
AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
EXIT_FAILURE, EXIT_INTERRUPTED, EXIT_BROKEN_PIPE = 1, 130, 141

EXAMPLES = """\
examples:
  clpeel render part.stl -o part.png
  clpeel render body.glb lung.ply --opacity 0.4 --resolution 1920,1080 --camera-direction -1,-0.5,-1 -o scan.png
  clpeel render dragon.ply.gz --unlit --no-background --stats -o dragon.png
"""


# --- values of options ------------------------------------------------------------------------------------------------


def _floats(text: str) -> list[float]:
    """Comma-separated finite numbers; raises ValueError."""
    values = [float(part) for part in text.split(",")]
    if not all(abs(value) < float("inf") for value in values):
        raise ValueError(text)
    return values


def _number(text: str) -> float:
    try:
        (value,) = _floats(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got '{text}'") from None
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got '{text}'")
    return value


def _opacity(text: str) -> float:
    try:
        (value,) = _floats(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"expected a number in 0..1, got '{text}'")
    return value


def _vector(text: str) -> Vector:
    try:
        x, y, z = _floats(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected X,Y,Z (three numbers), got '{text}'") from None
    return x, y, z


def _direction(text: str) -> Vector:
    """An axis such as `-Z`, or three numbers that are not all zero."""
    axis = re.fullmatch(r"([+-]?)([XYZxyz])", text)
    if axis:
        sign = -1.0 if axis[1] == "-" else 1.0
        x, y, z = AXES[axis[2].upper()]
        return sign * x, sign * y, sign * z
    try:
        x, y, z = _floats(text)
        if x == y == z == 0:
            raise ValueError(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected an axis such as +Y or -Z, or X,Y,Z not all zero, got '{text}'"
        ) from None
    return x, y, z


def _range(text: str) -> tuple[float, float]:
    try:
        near, far = _floats(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected NEAR,FAR (two numbers), got '{text}'") from None
    return near, far


def _resolution(text: str) -> tuple[int, int]:
    """Width and height in pixels."""
    try:
        width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected W,H (two whole numbers), got '{text}'") from None
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise argparse.ArgumentTypeError(f"expected W,H with each in 1..{MAX_SIDE}, got '{text}'")
    return width, height


def _color(text: str) -> Vector:
    """`R,G,B` in 0..1, `#rrggbb`, or a name such as `steelblue`; floats in 0..1 come back."""
    known = "expected R,G,B in 0..1, #rrggbb or a colour name"
    if "," in text and "(" not in text:
        try:
            r, g, b = _floats(text)
        except ValueError:
            r = -1.0
        if r < 0 or not all(0 <= value <= 1 for value in (r, g, b)):
            raise argparse.ArgumentTypeError(f"{known}, got '{text}'")
        return r, g, b
    from PIL import ImageColor

    try:
        rgb = ImageColor.getrgb(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{known}, got '{text}'") from None
    if len(rgb) != 3:
        raise argparse.ArgumentTypeError(f"{known}, got '{text}' (give the alpha with --opacity)")
    return rgb[0] / 255, rgb[1] / 255, rgb[2] / 255


def _lanes(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of 1 or more, got '{text}'")
    return value


# --- the parser -------------------------------------------------------------------------------------------------------


class _Help(argparse.HelpFormatter):
    """One line an option: `-o, --output OUT.png`."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=36, width=112)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if action.dest == "stats":
            return "--stats[=FILE.json]"
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        return f"{', '.join(action.option_strings)} {action.metavar}"

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "".join(indent + line for line in text.splitlines(keepends=True))


class _Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=_Help, allow_abbrev=False, **options)
        self.known: set[str] = set()  # the options of all commands
        self.valued: dict[str, str] = {}  # the long name of each that takes a value

    def error(self, message: str) -> NoReturn:
        wrong = re.match(r"argument (?:COMMAND|command): invalid choice: '([^']*)'", message)
        if wrong:
            message = f"expected a command (render, demo, devices or report), got '{wrong[1]}'"
            if "." in wrong[1]:
                message += f"; to make a picture of a file: clpeel render {wrong[1]}"
        message = re.sub(r"^argument (--[\w-]+)(?:/-\w)?", r"\1", message)
        unknown = re.match(r"unrecognized arguments: (--[\w-]+)", message)
        if unknown:
            import difflib

            close = difflib.get_close_matches(unknown[1], sorted(self.known), n=1)
            message = f"unknown option {unknown[1]}" + (f"; did you mean {close[0]}?" if close else "")
        print(f"clpeel: error: {message} (see {self.prog} --help)", file=sys.stderr)
        raise SystemExit(InputError.exit_code)


class _Version(argparse.Action):
    """`--version`, which reads the package's metadata only when asked."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from clpeel.report import version

        print(f"clpeel {version('clpeel')}")
        parser.exit()


def _add_picture_options(parser: argparse.ArgumentParser, output: str, resolution: str) -> None:
    """The options that `render` and `demo` share."""
    group = parser.add_argument_group("picture")
    add = group.add_argument
    add(
        "--output",
        "-o",
        default=output,
        metavar="OUT.png",
        help=f"PNG file to write, or - for standard output (default: {output})",
    )
    add(
        "--resolution",
        type=_resolution,
        default=resolution,
        metavar="W,H",
        help=f"width and height in pixels (default: {resolution})",
    )
    add(
        "--background-color",
        type=_color,
        default=(1.0, 1.0, 1.0),
        metavar="COLOR",
        help="R,G,B in 0..1, #rrggbb or a name (default: white)",
    )
    add("--no-background", action="store_true", help="write a transparent background (straight alpha)")
    add("--opacity", type=_opacity, metavar="0..1", help="opacity of every surface, in place of the file's")
    add("--color", type=_color, metavar="COLOR", help="colour of every surface, in place of the file's")
    add("--unlit", action="store_true", help="the colours as given (default: a light at the camera)")

    group = parser.add_argument_group("camera")
    add = group.add_argument
    add("--camera-position", type=_vector, metavar="X,Y,Z", help="where the camera stands (default: all in view)")
    add("--camera-focal-point", type=_vector, metavar="X,Y,Z", help="what it looks at (default: the scene's centre)")
    add("--camera-view-up", type=_direction, metavar="X,Y,Z", help="what is up in the picture (default: --up)")
    add("--camera-view-angle", type=_number, default=30.0, metavar="DEGREES", help="vertical (default: 30)")
    add(
        "--camera-direction",
        type=_direction,
        metavar="X,Y,Z",
        help="where it looks, also as an axis: +X, -Z (default: -Z)",
    )
    add("--camera-azimuth-angle", type=_number, default=0.0, metavar="DEGREES", help="then turn about the up axis")
    add("--camera-elevation-angle", type=_number, default=0.0, metavar="DEGREES", help="then rise")
    add("--camera-zoom-factor", type=_positive, metavar="FACTOR", help="last, above 1 shows less, larger")
    add("--camera-orthographic", action="store_true", help="parallel projection")
    add("--up", type=_direction, metavar="AXIS", help="the scene's up, an axis or X,Y,Z (default: +Y)")
    add("--clipping-range", type=_range, metavar="NEAR,FAR", help="distances that are drawn (default: all)")

    group = parser.add_argument_group("method")
    add = group.add_argument
    add("--technique", default="sort", metavar="NAME", help="default: sort, exact; 'help' lists them")
    add("--memory", metavar="SIZE", help="device memory to use, such as 512M or 2G (default: a share of the device's)")
    add("--device", metavar="DEVICE", help="number, or part of a name, as 'clpeel devices' shows them")
    add(
        "--lanes",
        type=_lanes,
        metavar="N",
        help="work-items a tile: 1, 16, 32, 64 or 128 (default: 1 on a CPU, else 64)",
    )

    group = parser.add_argument_group("messages")
    add = group.add_argument
    add("--stats", metavar="FILE.json", help="print times, passes, fragments and bytes, or write them to a file")
    add("--no-progress", action="store_true", help="no progress bar (it shows on a terminal, on long work)")
    add("--quiet", action="store_true", help="print errors only")
    add("--verbose", action="store_true", help="say what is done; on an error, show the whole trace")


def make_parser() -> _Parser:
    """The whole command line, without importing anything heavy."""
    parser = _Parser(
        prog="clpeel",
        usage="clpeel COMMAND [options]",
        description="Exact pictures of transparent meshes on any OpenCL device: no GPU, no display needed.",
        epilog=EXAMPLES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", parser_class=_Parser, prog="clpeel"
    )

    render = commands.add_parser(
        "render",
        help="render mesh files to a PNG",
        usage="clpeel render FILE... [-o OUT.png] [options]",
        description="Render mesh files (PLY, STL, OBJ, OFF, GLB, glTF, 3MF, or .gz of them) to one PNG.",
        epilog=EXAMPLES,
    )
    render.add_argument("files", nargs="+", metavar="FILE", help="mesh file; several are drawn together")
    _add_picture_options(render, output="clpeel.png", resolution="1024,1024")
    render.set_defaults(run=_run_render)

    demo = commands.add_parser(
        "demo",
        help="render a built-in scene to demo.png",
        usage="clpeel demo [-o OUT.png] [options]",
        description="Render a built-in scene of nested, intersecting, translucent surfaces.",
    )
    _add_picture_options(demo, output="demo.png", resolution="1200,900")
    demo.set_defaults(run=_run_demo)

    for name, run, text in (
        ("devices", _run_devices, "list the OpenCL devices"),
        ("report", _run_report, "print versions and devices, for a bug report"),
    ):
        command = commands.add_parser(name, help=text, description=text.capitalize() + ".", usage=f"clpeel {name}")
        command.add_argument("--verbose", action="store_true", help="on an error, show the whole trace")
        command.set_defaults(run=run)

    for action in _options(parser):
        parser.known.update(action.option_strings)
        if action.nargs is None:
            parser.valued.update(dict.fromkeys(action.option_strings, action.option_strings[0]))
    return parser


def tidy(arguments: Sequence[str], known: Container[str], valued: Mapping[str, str]) -> list[str]:
    """Bring a command's arguments into the order and form that argparse understands: options first, as `--opt=value`.

    argparse takes a value that begins with a minus for an option (`--camera-position -1,0,2`), an optional value for
    whatever comes next (`--stats FILE`), and refuses files on both sides of an option.
    `known` holds all options, `valued` the long names of those that take a value.
    """
    options: list[str] = []
    files: list[str] = []
    left = list(arguments)
    while left:
        argument = left.pop(0)
        if argument == "--":
            files += left
            break
        if argument == "--stats":
            options.append("--stats=-")
        elif argument in valued:
            if not left or left[0] in known or left[0].startswith("--"):
                return [*files[:1], argument]  # its value is missing: all that is left to say
            value = left.pop(0)
            options.append(f"{valued[argument]}={value}")
        elif argument.startswith("-") and argument != "-":
            options.append(argument)
        else:
            files.append(argument)
    command = files[:1]
    return [*command, *options, *(["--"] if any(name.startswith("-") for name in files) else []), *files[1:]]


def _options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The options of the parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _options(command)
        elif action.option_strings:
            yield action


# --- standard error: progress and notes -------------------------------------------------------------------------------


class Progress:
    """A one-line bar on standard error, on a terminal only, once the work has lasted `delay` seconds."""

    WIDTH = 30

    def __init__(self, enabled: bool = True, delay: float = 1.5) -> None:
        self.enabled = enabled and sys.stderr is not None and sys.stderr.isatty()
        self.next_time = time.monotonic() + delay
        self.shown = False

    def __call__(self, done: float, text: str = "") -> None:
        """Show that `done` (0..1) of the work is done, at most ten times a second."""
        now = time.monotonic()
        if not self.enabled or now < self.next_time:
            return
        self.next_time = now + 0.1
        self.shown = True
        done = min(max(done, 0.0), 1.0)
        filled = round(done * self.WIDTH)
        bar = "#" * filled + "-" * (self.WIDTH - filled)
        print(f"\r[{bar}] {done:4.0%} {text[:40]}\x1b[K", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self.shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self.shown = False


def _say(text: str) -> None:
    print(f"clpeel: {text}", file=sys.stderr)


def _quiet_libraries() -> None:
    """Keep the libraries' warnings out of a command's output; `--verbose` leaves them in."""
    import warnings

    warnings.simplefilter("ignore")


# --- render and demo --------------------------------------------------------------------------------------------------


def check_writable(path: str, option: str) -> str:
    """The file to write, links resolved; refuses, before any work, one that could not be. `-` is standard output.

    Raises InputError.
    """
    if path == "-" or (os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)):
        return path  # a pipe or a device
    target = os.path.realpath(path)
    folder = os.path.dirname(target)
    problem = ""
    if not path:
        problem = "expected a file name, got ''"
    elif os.path.isdir(target):
        problem = f"expected a file, got the folder '{path}'"
    elif not os.path.isdir(folder):
        problem = f"the folder '{folder}' does not exist; create it first"
    elif os.path.isfile(target) and not os.access(target, os.W_OK):
        problem = f"'{path}' is read-only"
    elif not os.access(folder, os.W_OK | os.X_OK):
        problem = f"the folder '{folder}' is not writable"
    else:
        try:
            os.lstat(target)
        except FileNotFoundError:
            pass
        except OSError as error:
            problem = f"cannot write '{path}': {error.strerror}"
    if problem:
        raise InputError(f"{option}: {problem}")
    return target


def _check_picture(path: str) -> str:
    """As check_writable, for the picture."""
    suffix = os.path.splitext(path)[1]
    if suffix and suffix.lower() != ".png":
        raise InputError(f"--output: only PNG is written; expected a name ending in .png, got '{path}'")
    if path == "-" and sys.stdout.isatty():
        raise InputError("--output: will not write a PNG to a terminal; name a file, or send it on: -o - > out.png")
    return check_writable(path, "--output")


def _write(path: str, data: bytes) -> None:
    """To standard output, or to a file, whole or not at all."""
    if path == "-":
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    from clpeel.image import write_whole

    write_whole(path, data)


def _front(up: Vector) -> Vector:
    """Where a camera looks by default, f3d's rule: along -Z when up is +Y, along +Y when up is +Z."""
    x, y, z = up
    right = (1.0, 0.0, 0.0) if abs(x) < max(abs(y), abs(z)) else (0.0, -1.0 if x > 0 else 1.0, 0.0)
    return (
        up[1] * right[2] - up[2] * right[1],
        up[2] * right[0] - up[0] * right[2],
        up[0] * right[1] - up[1] * right[0],
    )


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

    from clpeel.camera import Camera

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
        view = options.camera_direction or _front(options.up or AXES["Y"])
        camera = Camera.frame(
            scene,
            view,
            _view_up(options, view),
            options.camera_view_angle,
            aspect=width / height,
            orthographic=orthographic,
        )
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


def _run_render(options: argparse.Namespace) -> int:
    def load() -> Scene:
        import clpeel

        return clpeel.load(*options.files, opacity=options.opacity, color=options.color)

    return _render(options, load, ", ".join(os.path.basename(name) for name in options.files))


def _run_demo(options: argparse.Namespace) -> int:
    def load() -> Scene:
        from clpeel.demo import demo_scene

        scene = demo_scene()
        if options.opacity is None and options.color is None:
            return scene
        import clpeel

        return clpeel.load(scene, opacity=options.opacity, color=options.color)

    from clpeel.demo import DIRECTION, ZOOM

    if not (options.camera_position or options.camera_direction or options.up):
        options.camera_direction = DIRECTION
        options.camera_zoom_factor = options.camera_zoom_factor or ZOOM
    return _render(options, load, "the demo")


def _render(options: argparse.Namespace, load: Callable[[], Scene], name: str) -> int:
    """Load, render, write. Nothing slow is begun before what was asked is known to be possible."""
    if not options.verbose:
        _quiet_libraries()
    output = _check_picture(options.output)
    stats_output = None if options.stats in (None, "-") else check_writable(options.stats, "--stats")

    import clpeel
    from clpeel.device import choose
    from clpeel.image import encode_png
    from clpeel.renderer import parse_memory
    from clpeel.techniques import technique

    technique(options.technique)
    if options.memory is not None:
        parse_memory(options.memory)
    choose(options.device)

    started = time.perf_counter()
    scene = load()
    loaded = time.perf_counter()
    if not options.quiet:
        for note in scene.notes:
            _say(f"note: {note}")
    camera = make_camera(options, scene)
    if options.verbose:
        _say(f"{name}: {len(scene.faces):,} triangles, read in {loaded - started:.2f} s")
        _say(f"{camera}")

    progress = Progress(enabled=not (options.quiet or options.no_progress))
    try:
        result = clpeel.render(
            scene,
            camera,
            size=options.resolution,
            technique=options.technique,
            background=None if options.no_background else options.background_color,
            lighting="none" if options.unlit else "headlight",
            memory=options.memory,
            device=options.device,
            lanes=options.lanes,
            keep_color=False,
            progress=progress if progress.enabled else None,
        )
    finally:
        progress.clear()
    rendered = time.perf_counter()
    _write(output, encode_png(result.image))
    written = time.perf_counter()

    seconds = {"load": loaded - started, **result.stats["seconds"], "save": written - rendered}
    stats = {**result.stats, "seconds": seconds}
    _warn(options, stats)
    if stats_output is not None:
        import json

        _write(stats_output, (json.dumps(stats, indent=2, default=_plain) + "\n").encode())
    elif options.stats is not None:
        print(format_stats(stats), file=sys.stderr if options.output == "-" else sys.stdout)
    if not options.quiet and options.output != "-":
        width, height = options.resolution
        _say(f"wrote {options.output} ({width} x {height}, {len(scene.faces):,} triangles, {written - started:.2f} s)")
    return 0


def _warn(options: argparse.Namespace, stats: dict[str, Any]) -> None:
    """Say what the picture could not show."""
    if options.quiet:
        return
    if stats.get("discarded"):
        _say(f"note: {stats['discarded']:,} triangles with NaN or infinite vertices were left out")
    if stats.get("truncated_pixels"):
        _say(f"note: {stats['truncated_pixels']:,} pixels have more layers than the passes could show")


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays for json."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _bytes(count: float) -> str:
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024 or unit == "GiB":
            break
        count /= 1024
    return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"


STATS_ROWS = {
    "device": "device",
    "lanes": "lanes",
    "technique": "technique",
    "size": "pixels",
    "triangles": "triangles",
    "clipped": "clipped triangles",
    "discarded": "discarded triangles",
    "passes": "passes",
    "passes_issued": "passes issued",
    "fragments": "fragments",
    "layers_max": "most layers in a pixel",
    "truncated_pixels": "truncated pixels",
    "batches": "batches",
    "bytes_per_pixel": "bytes per pixel",
}


def format_stats(stats: dict[str, Any]) -> str:
    """A render's stats as a readable table: what was done, the seconds of each stage, the bytes of each buffer."""

    def show(value: Any) -> str:
        if isinstance(value, list | tuple):
            return " x ".join(show(part) for part in value)
        if isinstance(value, str):
            return value
        return f"{value:,.1f}" if isinstance(value, float) else f"{value:,}"

    lines = [f"{label:<24} {show(stats[key])}" for key, label in STATS_ROWS.items() if stats.get(key) is not None]
    lines.append("seconds")
    lines += [f"  {stage:<22} {value:.4f}" for stage, value in stats.get("seconds", {}).items()]
    lines.append("bytes")
    lines += [f"  {name:<22} {_bytes(value)}" for name, value in stats.get("bytes", {}).items()]
    return "\n".join(lines)


# --- devices and report -----------------------------------------------------------------------------------------------


def _run_devices(options: argparse.Namespace) -> int:
    if not options.verbose:
        _quiet_libraries()
    from clpeel.report import device_table

    print("\n".join(device_table()))
    return 0


def _run_report(options: argparse.Namespace) -> int:
    if not options.verbose:
        _quiet_libraries()
    from clpeel.report import report

    print("\n".join(report()))
    return 0


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


def _silence_stdout() -> None:
    """Nobody reads standard output any more: let the interpreter's last flush go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(arguments: Sequence[str]) -> int:
    parser = make_parser()
    try:
        options = parser.parse_args(tidy(arguments, parser.known, parser.valued))
    except SystemExit as end:  # after --help, --version and errors
        return int(end.code or 0)
    if options.command is None:
        parser.print_help()
        return 0
    from clpeel.cache import ensure_cache

    ensure_cache()
    return int(options.run(options))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 1 failed, 2 bad input, 3 no device, 130 interrupted."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _run(arguments)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        _silence_stdout()
        return EXIT_BROKEN_PIPE
    except KeyboardInterrupt:
        _say("interrupted")
        return EXIT_INTERRUPTED
    except Exception as error:
        if "--verbose" in arguments:
            import traceback

            traceback.print_exc()
        message, code = _explain(error)
        _say(f"error: {message}")
        return code
