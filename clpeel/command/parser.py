"""The command line of `clpeel`: its options, named as in f3d, their possible values, and the help.

This imports nothing heavy, so that `--help` and a mistyped option are answered at once.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, cast

from clpeel.command.everyday import EVERYDAY
from clpeel.errors import InputError

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

EXAMPLES = """\
examples:
  clpeel render part.stl -o part.png
  clpeel render body.glb lung.ply --opacity 0.4 --resolution 1920,1080 --camera-direction -1,-0.5,-1 -o scan.png
  clpeel render dragon.ply.gz --unlit --no-background --stats -o dragon.png
"""

MORE = """\
'clpeel help render' shows the options of render: --opacity, --camera-direction, --resolution, ...

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
the times beside each other. Ctrl-C ends it with the rows that are finished. --suite takes a standard set of scenes.
"""

VIEW = """\
Look at mesh files. Drag to rotate, turn the wheel to zoom, press H for all keys. While the hand moves, frames are as
fine as time allows; once it rests, the picture is the one that 'clpeel render' makes. Needs: pip install 'clpeel[view]'
"""

TURNTABLE = """\
Turn the camera around mesh files: an animated GIF or WebP, an MP4 (pip install 'clpeel[video]'), or numbered PNGs, as
frames/####.png. After Ctrl-C, the same command continues with the frames that are finished.
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

COMPLETION = """\
Print a script by which bash, zsh, tcsh or fish complete commands, options, files and the names that options take.
For bash:  clpeel completion bash > ~/.local/share/bash-completion/completions/clpeel
Needs: pip install 'clpeel[completion]'
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
        "FILE...|--suite [--html FILE] [options]",
        COMPARE,
        None,
    ),
    "view": (
        "look at mesh files, live: in a window, or in a browser",
        "FILE... [options]",
        VIEW,
        None,
    ),
    "turntable": (
        "turn the camera around mesh files: an animated GIF, WebP, MP4 or numbered PNGs",
        "FILE... -o OUT.gif|OUT.webp|OUT.mp4|DIR/####.png [options]",
        TURNTABLE,
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
    "completion": ("print what makes a shell complete clpeel's commands and options", "SHELL", COMPLETION, None),
    "techniques": ("list the techniques and their options", "", "", None),
    "devices": ("list the OpenCL devices, the default one marked; or check them", "[options]", DEVICES, None),
    "report": ("print versions and devices, for a bug report; or how a picture was made", "[PICTURE]", REPORT, None),
}
"""Each command's line of help, usage, description (by default that line), and what its help ends with."""

LATER = ("colours that stand for numbers", "camera", "method", "messages")
"""The groups of options that come last in the help of a command."""

TABLES = ("techniques", "devices", "report")
"""The commands that print a table."""


class _Help(argparse.HelpFormatter):
    """Shows one option per line: `-o, --output OUT.png`."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=36, width=112)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if action.dest == "stats":
            return "--stats[=FILE.json]"
        if isinstance(action, _Switch):
            first, *others = action.option_strings
            return ", ".join([first, *(flag for flag in others if flag != action.undo)])
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        return f"{', '.join(action.option_strings)} {action.metavar}"

    def add_argument(self, action: argparse.Action) -> None:
        super().add_argument(action)
        if isinstance(action, argparse._SubParsersAction):  # argparse forgets that commands are indented once more
            self._action_max_length += self._indent_increment

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "".join(indent + line for line in text.splitlines(keepends=True))


class _Once(argparse.Action):
    """Stores a value, and refuses a different second value for the same option, which would be silently dropped.

    Of an option that each file may have a value of its own of, it stores a list of all values.
    """

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, *_: object
    ) -> None:
        keep(self, namespace, values)


class _Switch(argparse.Action):
    """Stores `const` where its flag is given, and its default where `undo` is given: --no-grid undoes --grid."""

    def __init__(self, option_strings: Sequence[str], dest: str, **given: Any) -> None:
        flag = option_strings[0]
        self.undo = f"--{flag[5:]}" if flag.startswith("--no-") else f"--no-{flag[2:]}"
        if self.undo in ("--background", "--config"):  # the first means --background-color, the second is an option
            self.undo = flag
        super().__init__([*dict.fromkeys((*option_strings, self.undo))], dest, nargs=0, **{"const": True, **given})

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        flag: str | None = None,
    ) -> None:
        keep(self, namespace, self.default if flag == self.undo != self.option_strings[0] else self.const)


class _StoreTrue(_Switch):
    """A switch that is False where it is not given."""

    def __init__(self, option_strings: Sequence[str], dest: str, **given: Any) -> None:
        super().__init__(option_strings, dest, **{"default": False, **given})


def keep(action: argparse.Action, namespace: argparse.Namespace, value: object) -> None:
    """Store a value of an option. Raises ArgumentError if it differs from an earlier one."""
    from clpeel.command.order import EACH

    given: dict[str, list[object]] = vars(namespace).setdefault("given", {})
    values = given.setdefault(action.dest, [])
    if values and action.dest not in EACH and values[0] != value:
        raise argparse.ArgumentError(action, "expected once, got two that differ")
    values.append(value)
    setattr(namespace, action.dest, value)


def _place(group: argparse._ArgumentGroup) -> int:
    """Return the place of a group in the help; that of equals is the order in which they were added."""
    return LATER.index(group.title) + 1 if group.title in LATER else 0


class _HelpAll(argparse.Action):
    """`--help-all`: the help with all options."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(cast(Parser, parser).format_help(full=True), end="")
        parser.exit()


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are InputErrors of one line."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=_Help, allow_abbrev=False, **options)
        self.register("action", None, _Once)
        self.register("action", "store_true", _StoreTrue)
        self.register("action", "store_const", _Switch)
        self.known: set[str] = set()  # the options of all commands
        self.common: frozenset[str] = frozenset()  # the names of the options of `render`
        self.commands: dict[str, Parser] = {}

    def options(self) -> Iterator[argparse.Action]:
        """Yield the options of the parser and of its commands."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                for command in action.choices.values():
                    yield from command.options()
            elif action.option_strings:
                yield action

    def format_help(self, full: bool = False) -> str:
        """Return the help. Of a command it has the everyday options, or with `full` all."""
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        positional, own, *others = self._action_groups
        hidden = 0
        positional.title = "arguments"
        for group in (positional, *sorted(others, key=_place), own):
            shown = [
                each for each in group._group_actions if full or each.dest in EVERYDAY or each.dest not in self.common
            ]
            hidden += len(group._group_actions) - len(shown)
            formatter.start_section(group.title)
            formatter.add_arguments(shown)
            formatter.end_section()
        if hidden:
            formatter.add_text(f"{hidden} more option{'s' * (hidden > 1)}: {self.prog} --help-all")
        formatter.add_text(self.epilog)
        return formatter.format_help()

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
        message = re.sub(r"^argument (-[\w-]+)(?:/-[\w-]+)*", r"\1", message)
        message = re.sub(r"ignored explicit argument (.*)", r"expected no value, got \1", message)
        message = re.sub(r"the following arguments are required: (\w+)", r"expected \1, got none", message)
        unknown = re.match(r"unrecognized arguments: (-[\w-]+)", message)
        if unknown:
            import difflib

            close = difflib.get_close_matches(unknown[1], sorted(self.known), n=1)
            message = f"unknown option {unknown[1]}" + (f"; did you mean {close[0]}?" if close else "")
            if unknown[1] in self.known:
                message = f"this command has no option {unknown[1]}"
        message = re.sub(r"^unrecognized arguments: (.*)", r"expected no file, got \1", message)
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
        epilog=MORE + EXAMPLES,
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
    from clpeel.command.order import EACH, or_file

    of = parser.commands
    for name, done in (("render", "drawn"), ("layers", "peeled"), ("complexity", "counted")):
        options.add_files(of[name], done)
    options.add_files(of["compare"], "drawn", none="*")
    options.add_picture_options(of["render"], output="clpeel.png", resolution="1024,1024")
    options.add_layers_options(of["layers"])
    options.add_complexity_options(of["complexity"])
    options.add_compare_options(of["compare"])
    options.add_live_options(of["view"])
    options.add_turntable_options(of["turntable"])
    options.add_picture_options(of["demo"], output="demo.png", resolution="1200,900", samples=16)
    options.add_boxes_options(of["demo"])
    options.add_warm_up_options(of["warm-up"])
    options.add_check_options(of["devices"])
    of["completion"].add_argument("shell", metavar="SHELL", help="bash, zsh, tcsh or fish")
    text = "a picture that clpeel wrote (PNG, JPEG, WebP, TIFF, OpenEXR, .npz): print how it was made"
    of["report"].add_argument("picture", nargs="?", metavar="PICTURE", help=text)
    for name in TABLES:
        of[name].add_argument("--verbose", action="store_true", help="on an error, show the whole trace")
    for name, command in of.items():
        options.add_settings_options(command, scene=name == "render")
        command.add_argument("--help-all", action=_HelpAll, nargs=0, help="show the help with all options, and exit")
    for action in parser.options():
        undo = {action.undo} - {*action.option_strings[:1]} if isinstance(action, _Switch) else set()
        parser.known.update({*action.option_strings} - undo)
        if action.dest in EACH and not isinstance(action, _Switch):
            action.type = or_file(cast(Any, action.type))
    common = frozenset(action.dest for action in of["render"]._actions)
    for command in of.values():
        command.known, command.common = parser.known, common


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options that the arguments, the user's settings and scene files give.

    Raises SystemExit after --help and --version, and InputError if the arguments or the files are wrong.
    """
    if arguments[:1] == ["help"]:
        arguments = [*arguments[1:], "--help"]
    bare = all(argument in ("-h", "--help") for argument in arguments)
    parser = make_parser(bare)
    if bare:
        parser.print_help()
        parser.exit()
    from clpeel.command.words import tidied

    words = tidied(arguments, list(parser.options()))
    options, unknown = parser.parse_known_args(words.arguments)
    if options.command is None and not unknown:
        parser.print_help()
        parser.exit()
    command = parser.commands.get(options.command, parser)  # errors name this command's help
    if unknown:
        command.error(f"unrecognized arguments: {' '.join(unknown)}")
    from clpeel.command.given import complete

    try:
        return complete(options, words, parser)
    except InputError as error:
        raise InputError(
            f"{error} (see {command.prog} --help)" if str(error).startswith("--") else str(error)
        ) from None
