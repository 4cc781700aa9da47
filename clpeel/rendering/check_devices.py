"""Checking devices: makes the self-test of common kinds of pictures on each device, in processes of their own.

A driver may hang, take minutes to compile, or end the process. So the tests of a device are made in a process of its
own. If one takes too long, that process is killed, and another one goes on with the next test.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Literal

from clpeel.device.devices import DeviceInfo, list_devices
from clpeel.device.program import DriverError
from clpeel.errors import DeviceError
from clpeel.rendering.checking import SKIP, WrongPictureError
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.warm_up import CAMERA, SIZE, Kind
from clpeel.techniques import TECHNIQUES

TIMEOUT = 60.0
"""Seconds that a test may take, with compiling its kernels. PoCL takes about one."""

PATIENCE = 2
"""After so many tests in a row that took too long, the others of that device are not tried."""

Outcome = Literal["right", "wrong", "not compiled", "took too long", "ended the process", "not tried"]


@dataclass(frozen=True)
class Checked:
    """A test and its outcome. reason: one line; empty if all is right."""

    device: DeviceInfo
    kind: Kind
    outcome: Outcome
    reason: str = ""


def kinds_to_check(techniques: Sequence[str] = ()) -> list[Kind]:
    """The kinds of pictures that are tested: two for each technique, by default all, so that every kernel is in one."""
    kinds: list[Kind] = []
    for technique in techniques or TECHNIQUES:
        kinds.append(Kind(technique, "face", "transparent", "none"))
        kinds.append(Kind(technique, "vertex", "mixed", "kit"))
    first = kinds[0].technique
    kinds.append(Kind(first, "face", "opaque", "kit"))
    if TECHNIQUES[first].sorts:
        kinds.append(Kind(first, "face", "transparent", "kit", layers=True))
    return kinds


def check_devices(
    devices: Sequence[DeviceInfo], kinds: Sequence[Kind], timeout: float = TIMEOUT
) -> Iterator[Checked | tuple[DeviceInfo, Kind]]:
    """Makes the tests, whatever verdicts are known. Yields device and kind before each, and what has come of it.

    timeout: seconds that a test may take.
    """
    for device in devices:
        child: _Child | None = None
        in_a_row = 0
        try:
            for kind in kinds:
                yield device, kind
                if in_a_row >= PATIENCE:
                    yield Checked(device, kind, "not tried", f"{PATIENCE} in a row took too long")
                    continue
                child = child or _Child(_identity(device))
                outcome, reason = child.outcome(kind, timeout)
                in_a_row = in_a_row + 1 if outcome == "took too long" else 0
                if outcome in ("took too long", "ended the process"):
                    child.end()
                    child = None
                yield Checked(device, kind, outcome, reason)
        finally:
            if child is not None:
                child.end()


_Identity = tuple[str, str, str, str, int]


def _identity(device: DeviceInfo) -> _Identity:
    """What a device is recognized by in another process. Its number may change when a verdict is made."""
    names = (device.platform, device.device.platform.version, device.name, device.driver)
    return (*names, int(device.device.platform.get_devices().index(device.device)))


class _Child:
    """A process that makes tests on one device."""

    def __init__(self, identity: _Identity) -> None:
        context = get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other, identity), daemon=True)
        self.process.start()
        other.close()

    def outcome(self, kind: Kind, timeout: float) -> tuple[Outcome, str]:
        """Makes a test, and returns its outcome and the reason."""
        try:
            self.connection.send(kind)
            if self.connection.poll(timeout):
                found: tuple[Outcome, str] = self.connection.recv()
                return found
        except (EOFError, OSError):
            self.process.join(5)
            code = self.process.exitcode
            ended = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
            return "ended the process", ended
        return "took too long", f"more than {timeout:g} s"

    def end(self) -> None:
        """Ends the process and the compilers that it has started, whatever they are at."""
        self.connection.close()
        if self.process.pid is not None and hasattr(os, "killpg"):
            with suppress(OSError):  # it has ended, or has not made a group of its own yet
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()
        self.process.join()


def _serve(connection: Connection, identity: _Identity) -> None:
    """What the process does: a test for each kind that it is sent."""
    if hasattr(os, "setsid"):
        os.setsid()  # so that it can be killed together with the compilers that a driver starts
    os.environ.pop(SKIP, None)
    while True:
        try:
            kind: Kind = connection.recv()
        except (EOFError, OSError):
            return
        connection.send(_tried(kind, identity))


def _tried(kind: Kind, identity: _Identity) -> tuple[Outcome, str]:
    """The outcome of a test in this process."""
    number = next((each.number for each in list_devices() if _identity(each) == identity), None)
    if number is None:
        return "not tried", "the device is not there any more"
    try:
        renderer = Renderer(kind.scene(), number)
        renderer.tests_again = True
        if kind.layers:
            renderer.render(CAMERA, SIZE, kind.technique, lighting=kind.lighting, layers=True)
        else:
            renderer.render(CAMERA, SIZE, kind.technique, lighting=kind.lighting)
    except WrongPictureError as error:
        return "wrong", error.reason
    except (DeviceError, DriverError) as error:
        return "not compiled", next(iter(str(error).splitlines()), "")
    return "right", ""
