"""The command line of `clpeel`: its options, named as in f3d, their possible values, and the help.

This imports nothing heavy, so that `--help` and a mistyped option are answered at once.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from clpeel.errors import InputError

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

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

VIEW = """\
Look at mesh files. Drag to rotate, turn the wheel to zoom, press H for all keys. While the hand moves, frames are as
fine as time allows; once it rests, the picture is the one that 'clpeel render' makes. Needs: pip install 'clpeel[view]'
"""

DEVICES = """\
List the OpenCL devices in the order of preference, with a star at the one that is used by default, and the drivers that
offer no device. Before its first picture each set of kernels draws known layers. --check makes this test on each device
for common kinds of pictures, in processes of their own, and fails if any is not right on the default device.
"""

WARM_UP = """\
Compile the kernels of common kinds of pictures ahead, and keep them: after an installation, or while an image is built.
Each kind takes a second or less, which the first picture of that kind then need not wait for.
"""

REPORT = """\
Print versions and devices, for a bug report. With a picture that clpeel wrote: print how it was made.
"""

FILES = "FILE... [-o OUT.png] [options]"
TEXTS: dict[str, tuple[str, str, str, str | None]] = {
    "render": (
        "render mesh files to a picture: PNG, JPEG, WebP, TIFF, OpenEXR or .npz",
        FILES,
        "Render mesh files (PLY, STL, OBJ, OFF, GLB, glTF, 3MF, or .gz of them) to one picture.",
        EXAMPLES,
    ),
    "layers": (
        "peel mesh files: a PNG for each layer, front to back, and one .npz with all",
        "FILE... [-o DIR] [options]",
        LAYERS,
        None,
    ),
    "complexity": (
        "count layers: a heat map, a histogram, and what each technique would need",
        FILES,
        COMPLEXITY,
        None,
    ),
    "compare": (
        "compare the techniques: time, memory, and error against float64",
        "FILE... [--html FILE] [options]",
        COMPARE,
        None,
    ),
    "view": (
        "look at mesh files, live: in a window, or in a browser",
        "FILE... [options]",
        VIEW,
        None,
    ),
    "demo": (
        "render a built-in scene to demo.png",
        "[-o OUT.png] [options]",
        "Render a built-in scene of nested, intersecting, translucent surfaces.",
        None,
    ),
    "warm-up": (
        "compile the common kernels ahead, so that no first picture waits for them",
        "[options]",
        WARM_UP,
        None,
    ),
    "techniques": ("list the techniques and their options", "", "", None),
    "devices": ("list the OpenCL devices, the default one marked; or check them", "[options]", DEVICES, None),
    "report": ("print versions and devices, for a bug report; or how a picture was made", "[PICTURE]", REPORT, None),
}
"""Each command's line of help, usage, description (by default that line), and what its help ends with."""

TABLES = ("techniques", "devices", "report")
"""The commands that print a table."""


class _Help(argparse.HelpFormatter):
    """Shows one option per line: `-o, --output OUT.png`."""

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
    """Stores a value, and refuses a different second value for the same option.

    Otherwise one would be silently dropped.
    """

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, *_: object
    ) -> None:
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
        self.valued: dict[str, str] = {}  # for each option that takes a value, its long name
        self.commands: dict[str, Parser] = {}

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        print(self.format_help(), end="", file=file)  # argparse's own method hides a failure to print

    def error(self, message: str) -> NoReturn:
        wrong = re.match(r"argument (?:COMMAND|command): invalid choice: '([^']*)'", message)
        if wrong:
            *most, last = self.commands
            message = f"expected a command ({', '.join(most)} or {last})"
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
    """`--version`. It reads the package's metadata only when it is used."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from clpeel.command.report import version

        print(f"clpeel {version('clpeel')}")
        parser.exit()


def make_parser(bare: bool = False) -> Parser:
    """Return the whole command line. This imports nothing heavy.

    bare: without the options of the commands, which take longer to make than all the rest. It is enough for the help of
    `clpeel` itself.
    """
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
    for name, (text, usage, description, epilog) in TEXTS.items():
        usage = f"clpeel {name} {usage}".rstrip()
        commands.add_parser(
            name, help=text, usage=usage, description=description or f"{text.capitalize()}.", epilog=epilog
        )
    parser.commands = commands.choices
    if not bare:
        _add_options(parser)
    return parser


def _add_options(parser: Parser) -> None:
    """Add the options of all commands."""
    from clpeel.command import options

    of = parser.commands
    for name, done in (("render", "drawn"), ("layers", "peeled"), ("complexity", "counted"), ("compare", "drawn")):
        options.add_files(of[name], done)
    options.add_picture_options(of["render"], output="clpeel.png", resolution="1024,1024")
    options.add_layers_options(of["layers"])
    options.add_complexity_options(of["complexity"])
    options.add_compare_options(of["compare"])
    options.add_live_options(of["view"])
    options.add_picture_options(of["demo"], output="demo.png", resolution="1200,900", samples=16)
    options.add_boxes_options(of["demo"])
    options.add_warm_up_options(of["warm-up"])
    options.add_check_options(of["devices"])
    text = "a picture that clpeel wrote (PNG, JPEG, WebP, TIFF, OpenEXR, .npz): print how it was made"
    of["report"].add_argument("picture", nargs="?", metavar="PICTURE", help=text)
    for name in TABLES:
        of[name].add_argument("--verbose", action="store_true", help="on an error, show the whole trace")
    for action in _options(parser):
        parser.known.update(action.option_strings)
        if action.nargs is None:
            parser.valued.update(dict.fromkeys(action.option_strings, action.option_strings[0]))
    for command in parser.commands.values():
        command.known = parser.known


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options that the arguments give.

    Raises SystemExit after --help and --version, and InputError if the arguments are wrong.
    """
    parser = make_parser(bare=all(argument in ("-h", "--help") for argument in arguments))
    words = tidy(arguments, parser.known, parser.valued)
    options, unknown = parser.parse_known_args(words)
    options.words = tuple(words)
    if options.command is None and not unknown:
        parser.print_help()
        parser.exit()
    command = parser.commands.get(options.command, parser)  # errors name this command's help
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

    Otherwise argparse would take a value that begins with a minus for an option (`--camera-position -1,0,2`). It would
    take whatever comes next for an optional value (`--stats FILE`). And it would refuse files on both sides of an
    option.
    known: all options. valued: the long names of the options that take a value.
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
                return [*files[:1], argument]  # its value is missing, and that is the only error to report
            value = left.pop(0)
            options.append(f"{valued[argument]}={value}")
        elif argument.startswith("-") and argument != "-":
            options.append(argument)
        else:
            files.append(argument)
    command = files[:1]
    return [*command, *options, *(["--"] if any(name.startswith("-") for name in files) else []), *files[1:]]


def _options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the options of the parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _options(command)
        elif action.option_strings:
            yield action
