"""Streams: what the command says on standard output and standard error, whatever these are."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from collections.abc import Iterable, Iterator
from typing import TextIO


def print_text(text: str, aside: bool = False) -> None:
    """To standard output; aside, as a picture goes there, to standard error. Raises OSError where the former fails."""
    if not aside:
        with standard_output():
            print(text, flush=True)
        return
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:  # there is nowhere left to say so
        silence(sys.stderr)


def say(text: str) -> None:
    """A line of the command's own, to standard error."""
    print_text(f"clpeel: {text}", aside=True)


@contextlib.contextmanager
def standard_output() -> Iterator[None]:
    """Where standard output cannot be written, the OSError says so."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        silence(sys.stdout)
        reason = "it is closed" if error.errno == errno.EBADF else error.strerror
        raise OSError(error.errno, f"cannot write to standard output: {reason}") from None


def silence(stream: TextIO) -> None:
    """Nothing reads the stream any more: let the interpreter's last flush go nowhere."""
    with contextlib.suppress(io.UnsupportedOperation):  # what stands in for a stream need not be a file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def quiet_libraries() -> None:
    """Keep the libraries' warnings out of a command's output; `--verbose` leaves them in."""
    import warnings

    warnings.simplefilter("ignore")


def say_notes(notes: Iterable[str]) -> None:
    """A line for each note."""
    for note in notes:
        say(f"note: {note}")


def check_standard_output() -> None:
    """Raises OSError where it is closed."""
    with standard_output(), contextlib.suppress(io.UnsupportedOperation):  # what stands in for it need not be a file
        os.write(sys.stdout.fileno(), b"")


def fill_standard_streams() -> None:
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
