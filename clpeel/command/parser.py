"""The command line of `clpeel`: its options under f3d's names, what their values may be, and the help.

Imports nothing heavy, so that `--help` and a mistyped option are answered at once.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from typing import Any, NoReturn

from clpeel.errors import InputError
from clpeel.scene.color import parse_color

Vector = tuple[float, float, float]

MAX_SIDE = 65536  # pixels
AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}

FOR_EACH = ("opacity", "color")
"""Options that may be given once for each file."""

EXAMPLES = """\
examples:
  clpeel render part.stl -o part.png
  clpeel render body.glb lung.ply --opacity 0.4 --resolution 1920,1080 --camera-direction -1,-0.5,-1 -o scan.png
  clpeel render dragon.ply.gz --unlit --no-background --stats -o dragon.png
"""

LAYERS = """\
Peel mesh files, front to back: a numbered PNG for each layer, each alone over the background, and layers.npz with
the colours, depths and triangles of all, which clpeel.load_layers reads. PNGs of an earlier run are replaced.
"""

COMPLEXITY = """\
Count the layers of every pixel before paying for a picture: a heat map with its scale, figures, a histogram, and what
each technique would need: geometry passes, bytes a pixel and, roughly, seconds. Nothing is sorted, shaded or kept.
"""

COMPARE = """\
Draw mesh files by every technique and set the pictures beside what blending the same fragments in float64 gives, and
the times beside each other. Ctrl-C ends it with the rows that are finished.
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


def _thickness_range(text: str) -> tuple[float, float]:
    try:
        low, high = _floats(text)
        if not 0 <= low < high:
            raise ValueError(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected LOW,HIGH (two numbers, 0 <= LOW < HIGH), got '{text}'") from None
    return low, high


def _not_negative(text: str) -> float:
    value = _number(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"expected a number of 0 or more, got '{text}'")
    return value


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
    try:
        red, green, blue = parse_color(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return red, green, blue


def _surface_color(text: str) -> Vector:
    """As _color, of what has an opacity too."""
    try:
        return _color(text)
    except argparse.ArgumentTypeError as error:
        hint = "; give it with --opacity" if "alpha" in str(error) else ""
        raise argparse.ArgumentTypeError(f"{error}{hint}") from None


def _count(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of 1 or more, got '{text}'")
    return value


def _counts(text: str) -> tuple[int, ...]:
    try:
        return tuple(_count(part) for part in text.split(","))
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"expected whole numbers of 1 or more, such as 1,2,4, got '{text}'") from None


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(","))


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


class _Once(argparse.Action):
    """Stores a value. Another one for the same option is refused: of two, one would be dropped without a word."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, *_: Any) -> None:
        given = vars(namespace).setdefault("given", {})
        if given.setdefault(self.dest, values) != values:
            raise argparse.ArgumentError(self, "expected once, got two that differ")
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are InputErrors of one line."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=_Help, allow_abbrev=False, **options)
        self.register("action", None, _Once)
        self.known: set[str] = set()  # the options of all commands
        self.valued: dict[str, str] = {}  # the long name of each that takes a value
        self.commands: dict[str, Parser] = {}

    def print_help(self, file: Any = None) -> None:
        print(self.format_help(), end="", file=file)  # argparse's own says nothing where that fails

    def error(self, message: str) -> NoReturn:
        wrong = re.match(r"argument (?:COMMAND|command): invalid choice: '([^']*)'", message)
        if wrong:
            message = "expected a command (render, layers, compare, complexity, demo, techniques, devices or report)"
            message += f", got '{wrong[1]}'"
            if "." in wrong[1]:
                message += f"; to make a picture of a file: clpeel render {wrong[1]}"
        message = re.sub(r"^argument (--[\w-]+)(?:/-\w)?", r"\1", message)
        unknown = re.match(r"unrecognized arguments: (-[\w-]+)", message)
        if unknown:
            import difflib

            close = difflib.get_close_matches(unknown[1], sorted(self.known), n=1)
            message = f"unknown option {unknown[1]}" + (f"; did you mean {close[0]}?" if close else "")
            if unknown[1] in self.known:
                message = f"this command has no option {unknown[1]}"
        raise InputError(f"{message} (see {self.prog} --help)")


class _Version(argparse.Action):
    """`--version`, which reads the package's metadata only when asked."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from clpeel.command.report import version

        print(f"clpeel {version('clpeel')}")
        parser.exit()


def _add_files(parser: argparse.ArgumentParser, done: str) -> None:
    """What all commands that read files read."""
    group = parser.add_argument_group("files")
    group.add_argument("files", nargs="+", metavar="FILE", help=f"mesh file; several are {done} together")
    text = "leave out faces whose corners are those of an earlier face"
    group.add_argument("--drop-duplicates", action="store_true", help=text)


def _add_output(group: argparse._ArgumentGroup, output: str, metavar: str, text: str) -> None:
    group.add_argument("--output", "-o", default=output, metavar=metavar, help=f"{text} (default: {output})")


def _add_picture_options(parser: argparse.ArgumentParser, output: str, resolution: str, samples: int) -> None:
    """The options that `render` and `demo` share."""
    group = parser.add_argument_group("picture")
    _add_output(group, output, "OUT.png", "PNG file to write, or - for standard output")
    _add_view_options(parser, group, resolution, samples)


def _add_layers_options(parser: argparse.ArgumentParser) -> None:
    """The options of `layers`: those of `render`, and how a layer is shown."""
    group = parser.add_argument_group("pictures")
    _add_output(group, "layers", "DIR", "folder for layer-01.png, layer-02.png, ... and layers.npz")
    group.add_argument(
        "--keep-alpha",
        action="store_true",
        help="show each layer with its own alpha (default: opaque, as papers do: alone, a thin layer is hard to see)",
    )
    _add_view_options(parser, group, "1024,1024", samples=1)


def _add_view_options(
    parser: argparse.ArgumentParser, group: argparse._ArgumentGroup, resolution: str, samples: int
) -> None:
    """What all commands that render one picture share; `group` gets those of the picture."""
    _add_scene_options(group, resolution)
    group.add_argument("--no-background", action="store_true", help="write a transparent background (straight alpha)")
    _add_camera_options(parser)
    _add_method_options(parser, samples)
    group = parser.add_argument_group("messages")
    group.add_argument(
        "--stats", metavar="FILE.json", help="print times, passes, fragments and bytes, or write them to a file"
    )
    _add_messages_options(group)


def _add_scene_options(group: argparse._ArgumentGroup, resolution: str) -> None:
    """How large the picture is, and what it is of."""
    add = group.add_argument
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
    text = "{} of every surface, in place of the file's; once for all files, or once for each, in order"
    add("--opacity", action="append", type=_opacity, metavar="0..1", help=text.format("opacity"))
    add("--color", action="append", type=_surface_color, metavar="COLOR", help=text.format("colour"))
    add("--unlit", action="store_true", help="the colours as given (default: a light at the camera)")


def _add_camera_options(parser: argparse.ArgumentParser) -> None:
    """Where all commands that look at a scene look from."""
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
        help="where it looks, also as an axis: +X, -Z (default: -Z; a flat scene at its face)",
    )
    add("--camera-azimuth-angle", type=_number, default=0.0, metavar="DEGREES", help="then turn about the up axis")
    add("--camera-elevation-angle", type=_number, default=0.0, metavar="DEGREES", help="then rise")
    add("--camera-zoom-factor", type=_positive, metavar="FACTOR", help="last, above 1 shows less, larger")
    add("--camera-orthographic", action="store_true", help="parallel projection")
    add("--up", type=_direction, metavar="AXIS", help="the scene's up, an axis or X,Y,Z (default: +Y)")
    add("--clipping-range", type=_range, metavar="NEAR,FAR", help="distances that are drawn (default: all)")


def _add_method_options(parser: argparse.ArgumentParser, samples: int) -> None:
    """How all commands that render do it, and what they say."""
    group = parser.add_argument_group("method")
    add = group.add_argument
    text = "default: sort, exact; auto: what this picture needs; 'clpeel techniques' lists them"
    add("--technique", default="sort", metavar="NAME", help=text)
    add("--explain", action="store_true", help="with auto: what it chose, why, and what others would have cost")
    add("--passes", type=_count, metavar="N", help="peel so many times and stop, where the technique peels")
    add("--no-occlusion-query", action="store_true", help="make all --passes, whether they find anything or not")
    add("--coincident", metavar="keep|paper", help="of equal depths keep all fragments, or the first alone")
    add(
        "--max-error",
        type=_opacity,
        metavar="0..1",
        help="leave out layers that cannot change a channel by more; 0 is exact",
    )
    _add_opaque_option(group)
    add("--hazard-window", type=_count, metavar="N", help="multi-layer-peeling: so many concurrent writes, simulated")
    add("--hazard-order", metavar="nearest-last|arrival", help="multi-layer-peeling: in which these writes land")
    add("--torn-writes", action="store_true", help="multi-layer-peeling: of two that meet each commits half")
    add(
        "--precision",
        metavar="float32|half|unorm8",
        help="of the buffers that colours are blended into, each blend rounded as hardware does (default: float32)",
    )
    add(
        "--depth-format",
        metavar="FORMAT",
        help="what is kept of depths: float32-reversed, float32, unorm24 or rgba8 (default: float32-reversed)",
    )
    add("--layers", type=_count, metavar="N", help="layers a pass, where the technique peels several")
    add(
        "--variant",
        metavar="exact|total|first-solid",
        help="of thickness: what lies within surfaces, from first to last, or the first solid (default: exact)",
    )
    add("--projected", action="store_true", help="thickness in window depths, 0..1, in place of scene units")
    add(
        "--thickness-range",
        type=_thickness_range,
        metavar="LOW,HIGH",
        help="thickness that the first and the last colour stand for (default: 0 to the greatest)",
    )
    add("--no-scale-bar", action="store_true", help="no scale bar in the picture of thickness")
    add(
        "--map",
        metavar="FILE.npy",
        help="write the thickness too, as float32 numbers of NumPy, a row for each of pixels",
    )
    add("--sigma", type=_not_negative, metavar="NUMBER", help="extinction a scene unit (default: by the scene's size)")
    add("--light-color", type=_color, metavar="COLOR", help="of the light behind the scene (default: a warm white)")
    add(
        "--samples",
        type=_count,
        default=samples,
        metavar="N",
        help=f"samples a pixel, averaged for smooth edges: 1, 4, 16, 64 or 256 (default: {samples})",
    )
    _add_device_options(group)


def _add_opaque_option(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--opaque", metavar="first|blend", help="draw opaque surfaces first (default), or blend them as any other"
    )


def _add_device_options(group: argparse._ArgumentGroup) -> None:
    """What all commands that compute compute on."""
    add = group.add_argument
    add("--memory", metavar="SIZE", help="device memory to use, such as 512M or 2G (default: a share of the device's)")
    add("--device", metavar="DEVICE", help="number, or part of a name, as 'clpeel devices' shows them")
    add(
        "--lanes",
        type=_count,
        metavar="N",
        help="work-items a tile: 1, 16, 32, 64 or 128 (default: 1 on a CPU, else 64)",
    )


def _add_messages_options(group: argparse._ArgumentGroup) -> None:
    """What all commands that compute say."""
    add = group.add_argument
    add("--no-progress", action="store_true", help="no progress bar (it shows on a terminal, on long work)")
    add("--quiet", action="store_true", help="print errors only")
    add("--verbose", action="store_true", help="say what is done; on an error, show the whole trace")


def _add_complexity_options(parser: argparse.ArgumentParser) -> None:
    """The options of `complexity`: those of `render` that a count knows."""
    group = parser.add_argument_group("picture")
    _add_output(group, "complexity.png", "OUT.png", "PNG file of the heat map, or - for standard output")
    group.add_argument("--json", metavar="FILE", help="write the figures, too")
    group.add_argument("--no-scale-bar", action="store_true", help="no scale bar in the heat map")
    _add_scene_options(group, "1024,1024")
    group.add_argument("--no-background", action="store_true", help="write a transparent background (straight alpha)")
    _add_camera_options(parser)
    group = parser.add_argument_group("method")
    text = "count what is in front of opaque surfaces alone (default), or all"
    group.add_argument("--opaque", metavar="first|blend", default="first", help=text)
    _add_device_options(group)
    _add_messages_options(parser.add_argument_group("messages"))


def _add_compare_options(parser: argparse.ArgumentParser) -> None:
    """The options of `compare`: the scene, the camera and the device as of `render`, and what is compared."""
    group = parser.add_argument_group("comparison")
    add = group.add_argument
    add("--techniques", type=_names, metavar="NAME,...", help="only these (default: all that make this picture)")
    text = "of colour buffers: float32, half, unorm8 (default: float32 and that of the technique's paper)"
    add("--precisions", type=_names, metavar="NAME,...", help=text)
    add(
        "--budgets",
        type=_counts,
        default=(),
        metavar="N,...",
        help="passes to stop after, of those that peel, such as 1,2,4 (default: none, beside no limit)",
    )
    add("--frames", type=_count, default=5, metavar="N", help="timed of each, after one that is not (default: 5)")
    group = parser.add_argument_group("output, besides the table on standard output")
    add = group.add_argument
    add("--json", metavar="FILE", help="write all figures, and each frame's time, or - for standard output")
    add("--csv", metavar="FILE", help="write a line of figures for each row")
    add("--html", metavar="FILE", help="write a page with the pictures, maps of errors, and time against error")
    group = parser.add_argument_group("picture")
    _add_scene_options(group, "1024,1024")
    _add_camera_options(parser)
    group = parser.add_argument_group("method")
    _add_opaque_option(group)
    _add_device_options(group)
    _add_messages_options(parser.add_argument_group("messages"))


def make_parser() -> Parser:
    """The whole command line, without importing anything heavy."""
    parser = Parser(
        prog="clpeel",
        usage="clpeel COMMAND [options]",
        description="Exact pictures of transparent meshes on any OpenCL device: no GPU, no display needed.",
        epilog=EXAMPLES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", parser_class=Parser, prog="clpeel"
    )

    render = commands.add_parser(
        "render",
        help="render mesh files to a PNG",
        usage="clpeel render FILE... [-o OUT.png] [options]",
        description="Render mesh files (PLY, STL, OBJ, OFF, GLB, glTF, 3MF, or .gz of them) to one PNG.",
        epilog=EXAMPLES,
    )
    _add_files(render, "drawn")
    _add_picture_options(render, output="clpeel.png", resolution="1024,1024", samples=1)

    layers = commands.add_parser(
        "layers",
        help="peel mesh files: a PNG for each layer, front to back, and one .npz with all",
        usage="clpeel layers FILE... [-o DIR] [options]",
        description=LAYERS,
    )
    _add_files(layers, "peeled")
    _add_layers_options(layers)

    complexity = commands.add_parser(
        "complexity",
        help="count layers: a heat map, a histogram, and what each technique would need",
        usage="clpeel complexity FILE... [-o OUT.png] [options]",
        description=COMPLEXITY,
    )
    _add_files(complexity, "counted")
    _add_complexity_options(complexity)

    compare = commands.add_parser(
        "compare",
        help="compare the techniques: time, memory, and error against float64",
        usage="clpeel compare FILE... [--html FILE] [options]",
        description=COMPARE,
    )
    _add_files(compare, "drawn")
    _add_compare_options(compare)

    demo = commands.add_parser(
        "demo",
        help="render a built-in scene to demo.png",
        usage="clpeel demo [-o OUT.png] [options]",
        description="Render a built-in scene of nested, intersecting, translucent surfaces.",
    )
    _add_picture_options(demo, output="demo.png", resolution="1200,900", samples=16)

    for name, text in (
        ("techniques", "list the techniques and their options"),
        ("devices", "list the OpenCL devices"),
        ("report", "print versions and devices, for a bug report"),
    ):
        command = commands.add_parser(name, help=text, description=text.capitalize() + ".", usage=f"clpeel {name}")
        command.add_argument("--verbose", action="store_true", help="on an error, show the whole trace")

    for action in _options(parser):
        parser.known.update(action.option_strings)
        if action.nargs is None:
            parser.valued.update(dict.fromkeys(action.option_strings, action.option_strings[0]))
    parser.commands = commands.choices
    for command in parser.commands.values():
        command.known = parser.known
    return parser


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The options that the arguments give. Raises SystemExit after --help and --version, InputError where they err."""
    parser = make_parser()
    options, unknown = parser.parse_known_args(tidy(arguments, parser.known, parser.valued))
    if options.command is None and not unknown:
        parser.print_help()
        parser.exit()
    command = parser.commands.get(options.command, parser)  # whose help errors name
    if unknown:
        command.error(f"unrecognized arguments: {' '.join(unknown)}")
    for name in FOR_EACH:
        given, files = len(getattr(options, name, None) or ()), len(getattr(options, "files", ()))
        if given > 1 and given != files:
            wanted = f"once for all files, or once for each of the {files}" if files > 1 else "once"
            command.error(f"--{name}: expected {wanted}, got {given} of them")
    return options


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
