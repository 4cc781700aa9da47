"""Building: kernel sources to programs, by the driver's compiler or from what it made before (cache.py)."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache as remembered
from threading import Lock

import pyopencl as cl

from clpeel.device import workshop
from clpeel.device.cache import Cache, key_of


def _forget_databases() -> None:
    """pyopencl's databases are not opened: they hold code that it writes and runs unchecked, and a damaged one crashes.

    To write it anew takes a millisecond for each kernel of a process.
    """
    cl._PYOPENCL_NO_CACHE = True
    from pyopencl import invoker  # which else opens one

    written = invoker._generate_enqueue_and_set_args_module
    if not hasattr(written, "cache_info"):
        invoker._generate_enqueue_and_set_args_module = remembered(written)


_forget_databases()

BUILDING = Lock()
"""Held by who calls `build`: what is new in the workshop is then of the program that is being built."""

_keeping = Lock()


@dataclass
class _Built:
    """A program that PoCL has in the workshop, and which of its files have been kept."""

    cache: Cache
    key: str
    folders: frozenset[str]
    kept: frozenset[str]

    def keep(self) -> None:
        """Keeps the program as it is now, where more of it has been compiled: kernels are, when they first run."""
        files = frozenset[str]().union(*(workshop.files_of(folder) for folder in self.folders))
        if files != self.kept:
            self.cache.write(self.key, workshop.packed(files))
            self.kept = files


_built: list[_Built] = []
_new: list[_Built] = []  # those that have not been kept yet
_at_work = 0  # pictures that are being made: kernels may be compiled meanwhile, and their files be in pieces


def build(context: cl.Context, device: cl.Device, text: str, options: Sequence[str]) -> cl.Program:
    """The program of a kernel source, built for the device; by one thread at a time (BUILDING).

    Raises DeviceError where there is no room to build in.
    """
    platform = device.platform
    cache = Cache((platform.name, device.name, platform.version, device.version, device.driver_version))
    key = key_of(text, *options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        if "pocl" in platform.version.lower():
            return _build_in_workshop(context, text, options, cache, key)
        kept = cache.read(key)
        if kept is not None:
            try:
                return cl.Program(context, [device], [kept]).build(options)
            except cl.Error:  # a driver need not take back what it gave
                pass
        program = _compile(context, text, options)
        binaries = program.get_info(cl.program_info.BINARIES)
        if binaries and binaries[0]:
            cache.write(key, binaries[0])
        return program


def _build_in_workshop(context: cl.Context, text: str, options: Sequence[str], cache: Cache, key: str) -> cl.Program:
    """As build, by PoCL, which finds in the workshop what is unpacked there and puts there what it compiles."""
    workshop.check_room()
    before = workshop.programs()
    data = cache.read(key)
    kept = frozenset[str]() if data is None else workshop.unpack(data)
    program = _compile(context, text, options)
    folders = workshop.programs() - before
    if not _built:
        workshop.at_exit(_keep_all)  # before the workshop goes, which was there first
    _built.append(_Built(cache, key, folders, kept))
    _new.append(_built[-1])
    return program


def _compile(context: cl.Context, text: str, options: Sequence[str]) -> cl.Program:
    """Built from source. pyopencl's own cache is not asked: it trusts whatever it finds."""
    return cl.Program(context, text).build(options, cache_dir=False)


@contextmanager
def at_work(queue: cl.CommandQueue) -> Iterator[None]:
    """While a picture is made on the queue: nothing is kept before it is done."""
    global _at_work
    with _keeping:
        _at_work += 1
    try:
        yield
    except BaseException:
        with suppress(cl.Error):
            queue.finish()  # what is still under way may compile, too
        raise
    finally:
        with _keeping:
            _at_work -= 1


def keep() -> None:
    """Keeps the programs that were built since the last time, unless a picture is being made: then that will."""
    if not _new:
        return
    with BUILDING, _keeping:
        while _new and _at_work == 0:
            _new.pop().keep()


def _keep_all() -> None:
    """Keeps all, as kernels may have run in other ways since, for which they were compiled again."""
    with BUILDING, _keeping:
        for built in _built if _at_work == 0 else ():
            built.keep()
