"""Building: makes programs of kernel sources. They are compiled by the driver, or come from the cache (cache.py)."""

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
    """Keeps pyopencl from opening its databases.

    They hold Python code that pyopencl wrote before and runs unchecked, so a damaged database crashes the process.
    Without them pyopencl writes the code again in each process, which takes a millisecond for each kernel.
    """
    cl._PYOPENCL_NO_CACHE = True
    from pyopencl import invoker  # it opens a database unless it is replaced below

    written = invoker._generate_enqueue_and_set_args_module
    if not hasattr(written, "cache_info"):
        invoker._generate_enqueue_and_set_args_module = remembered(written)


_forget_databases()

BUILDING = Lock()
"""The caller of `build` must hold this lock. New folders in the workshop then belong to the program being built."""

_keeping = Lock()


@dataclass
class _Built:
    """A program that PoCL has built in the workshop.

    folders: its folders there. kept: the files that the cache already has.
    """

    cache: Cache
    key: str
    folders: frozenset[str]
    kept: frozenset[str]

    def keep(self) -> None:
        """Writes the program to the cache again if it has new files. PoCL compiles a kernel when it first runs."""
        files = frozenset[str]().union(*(workshop.files_of(folder) for folder in self.folders))
        if files != self.kept:
            self.cache.write(self.key, workshop.packed(files))
            self.kept = files


_built: list[_Built] = []
_new: list[_Built] = []  # programs that have not been written to the cache yet
_at_work = 0  # how many pictures are being made: meanwhile PoCL may compile, and its files may be incomplete


def cache_of(device: cl.Device) -> Cache:
    """Where the kernels that are compiled for the device are kept."""
    platform = device.platform
    return Cache((platform.name, device.name, platform.version, device.version, device.driver_version))


def build(context: cl.Context, device: cl.Device, text: str, options: Sequence[str]) -> cl.Program:
    """The program of a kernel source, built for the device. One thread at a time may call it (BUILDING).

    Raises DeviceError if PoCL is to compile and has no room for its files.
    """
    cache = cache_of(device)
    key = key_of(text, *options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        if "pocl" in device.platform.version.lower():
            return _build_in_workshop(context, text, options, cache, key)
        kept = cache.read(key)
        if kept is not None:
            try:
                return cl.Program(context, [device], [kept]).build(options)
            except cl.Error:  # a driver may refuse a binary that it made itself
                pass
        program = _compile(context, text, options)
        binaries = program.get_info(cl.program_info.BINARIES)
        if binaries and binaries[0]:
            cache.write(key, binaries[0])
        return program


def _build_in_workshop(context: cl.Context, text: str, options: Sequence[str], cache: Cache, key: str) -> cl.Program:
    """`build` for PoCL. It finds kept files in the workshop, where they are unpacked, and compiles the rest there."""
    workshop.check_room()
    before = workshop.programs()
    data = cache.read(key)
    kept = frozenset[str]() if data is None else workshop.unpack(data)
    program = _compile(context, text, options)
    folders = workshop.programs() - before
    if not _built:
        workshop.at_exit(_keep_all)  # runs before the workshop is removed, as that was registered first
    _built.append(_Built(cache, key, folders, kept))
    _new.append(_built[-1])
    return program


def _compile(context: cl.Context, text: str, options: Sequence[str]) -> cl.Program:
    """Builds from source. pyopencl's own cache is off, because it trusts whatever it finds."""
    return cl.Program(context, text).build(options, cache_dir=False)


@contextmanager
def at_work(queue: cl.CommandQueue) -> Iterator[None]:
    """Wraps the making of a picture on the queue. Nothing is written to the cache before all such work is done."""
    global _at_work
    with _keeping:
        _at_work += 1
    try:
        yield
    except BaseException:
        with suppress(cl.Error):
            queue.finish()  # kernels that still run may be compiling
        raise
    finally:
        with _keeping:
            _at_work -= 1


def keep() -> None:
    """Writes the programs built since the last call to the cache. While a picture is being made it does nothing.

    The next call after that picture writes them.
    """
    if not _new:
        return
    with BUILDING, _keeping:
        while _new and _at_work == 0:
            _new.pop().keep()


def _keep_all() -> None:
    """Keeps all programs once more: kernels may have run in other ways since, and PoCL compiled them again for that."""
    with BUILDING, _keeping:
        for built in _built if _at_work == 0 else ():
            built.keep()
