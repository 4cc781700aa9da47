"""Streams: writes the command's texts to standard output and standard error, even if these are closed."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from collections.abc import Iterable, Iterator
from typing import TextIO


def print_text(text: str, aside: bool = False) -> None:
    """Print to standard output, or with `aside` to standard error. Raises OSError if standard output fails.

    aside: for when the picture goes to standard output.
    """
    if not aside:
        with standard_output():
            print(text, flush=True)
        return
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:  # there is nowhere left to report this
        silence(sys.stderr)


def say(text: str) -> None:
    """Print a line of the command's own to standard error."""
    print_text(f"clpeel: {text}", aside=True)


@contextlib.contextmanager
def standard_output() -> Iterator[None]:
    """Turn an OSError into one that says that standard output could not be written.

    BrokenPipeError passes unchanged.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        silence(sys.stdout)
        reason = "it is closed" if error.errno == errno.EBADF else error.strerror
        raise OSError(error.errno, f"cannot write to standard output: {reason}") from None


def silence(stream: TextIO) -> None:
    """Redirect a stream that nobody reads any more, so that the interpreter's last flush does not fail."""
    with contextlib.suppress(io.UnsupportedOperation):  # the stream may have been replaced by an object that is no file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def quiet_libraries() -> None:
    """Keep the libraries' warnings out of a command's output. `--verbose` does not call this."""
    import warnings

    warnings.simplefilter("ignore")


def say_notes(notes: Iterable[str]) -> None:
    """Print a line for each note."""
    for note in notes:
        say(f"note: {note}")


def check_standard_output() -> None:
    """Raise OSError if standard output is closed."""
    # It may be replaced by an object that is no file.
    with standard_output(), contextlib.suppress(io.UnsupportedOperation):
        os.write(sys.stdout.fileno(), b"")


def fill_standard_streams() -> None:
    """Open whichever of standard input, output and error are closed, so that no output file takes their place.

    Writing to standard output then still fails, as it must. Messages to standard error are lost.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # gets the lowest free number, which is this one
    if sys.stdout is None:
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w")
    if sys.stderr is None:
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
