"""The command `clpeel`: takes arguments, and gives a picture or a table.

NumPy, OpenCL and trimesh are imported only inside the commands that need them.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module

from clpeel.command.parser import parse
from clpeel.command.streams import (
    fill_standard_streams,
    print_text,
    quiet_libraries,
    say,
    say_notes,
    silence,
    standard_output,
)
from clpeel.command.terminal import EXIT_BROKEN_PIPE, EXIT_FAILURE, EXIT_INTERRUPTED, EXIT_TERMINATED
from clpeel.errors import ClpeelError, InputError, NoDeviceError


def run_table(options: argparse.Namespace) -> int:
    """Run `clpeel techniques`, `devices` or `report`. Each prints a table, which report.py makes."""
    if not options.verbose:
        quiet_libraries()
    from clpeel.command import report

    tables = {"techniques": report.technique_table, "devices": report.device_table, "report": report.report}
    print_text("\n".join(tables[options.command]()))
    return 0


def run_report(options: argparse.Namespace) -> int:
    """Run `clpeel report`: what a bug report needs or, of a picture, how it was made."""
    if options.picture is None:
        return run_table(options)
    if not options.verbose:
        quiet_libraries()
    from clpeel.command.provenance import provenance_table

    print_text("\n".join(provenance_table(options.picture)))
    return 0


def run_devices(options: argparse.Namespace) -> int:
    """Run `clpeel devices`: a table of them or, with `--check`, of their self-tests."""
    if not options.check:
        return run_table(options)
    from clpeel.command.check import run_check

    return run_check(options)


def _in(module: str, name: str) -> Callable[[argparse.Namespace], int]:
    """Return a function of a module of this package. The module is imported only when the function is called."""

    def run(options: argparse.Namespace) -> int:
        found: Callable[[argparse.Namespace], int] = getattr(import_module(f"clpeel.command.{module}"), name)
        return found(options)

    return run


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "render": _in("render", "run_render"),
    "layers": _in("render", "run_layers"),
    "demo": _in("render", "run_demo"),
    "view": _in("view", "run_view"),
    "compare": _in("study", "run_compare"),
    "complexity": _in("study", "run_complexity"),
    "turntable": _in("turntable", "run_turntable"),
    "warm-up": _in("warm_up", "run_warm_up"),
    "completion": _in("completion", "run_completion"),
    "techniques": run_table,
    "devices": run_devices,
    "report": run_report,
}


# --- the command ------------------------------------------------------------------------------------------------------


def _explain(error: Exception) -> tuple[str, int]:
    """Return one line that says what went wrong and what to do, and the exit code."""
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
    """SIGTERM. The command then ends as it does after Ctrl-C, so that no half-written file stays."""


@contextlib.contextmanager
def _orderly_end() -> Iterator[None]:
    """Make SIGTERM raise _Terminated inside the block, unless someone else already handles that signal."""

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


def _run(arguments: Sequence[str]) -> int:
    try:
        with standard_output():
            options = parse(arguments)
    except SystemExit as end:  # after --help and --version
        return int(end.code or 0)
    _say_where_from(options)
    write_scene = None
    if getattr(options, "write_scene", None) is not None:
        from clpeel.command.write_scene import prepared

        write_scene = prepared(options)
    try:
        code = COMMANDS[options.command](options)
    except (InputError, NoDeviceError) as error:
        from clpeel.command.wording import in_words_of_the_command

        raise type(error)(in_words_of_the_command(str(error), options)) from error
    if write_scene is not None and code == 0:
        write_scene()
    return code


def _say_where_from(options: argparse.Namespace) -> None:
    """Say which options a file gives that the command does not have, and with --verbose where each value comes from."""
    if not getattr(options, "quiet", False):
        say_notes(options.notes)
    if getattr(options, "verbose", False):
        for name, where in options.origins.items():
            say(f"{name.replace('_', '-')} from {where}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    The codes are: 0 done, 1 failed, 2 bad input, 3 no device, 130 interrupted, 141 nobody reads standard output, 143
    terminated.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    fill_standard_streams()
    try:
        with _orderly_end():
            code = _run(arguments)
            with standard_output():
                sys.stdout.flush()
            return code
    except BrokenPipeError:
        silence(sys.stdout)
        return EXIT_BROKEN_PIPE
    except KeyboardInterrupt:
        say("interrupted")
        return EXIT_INTERRUPTED
    except _Terminated:
        say("terminated")
        return EXIT_TERMINATED
    except Exception as error:
        if "--verbose" in arguments:
            import traceback

            traceback.print_exc()
        message, code = _explain(error)
        say(f"error: {message}")
        return code
