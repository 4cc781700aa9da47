"""Drivers: the libraries that OpenCL's loader finds by .icd files, and why some of them offer no device."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache as remembered
from pathlib import Path

import pyopencl as cl

from clpeel.files import open_at_once

VENDORS = Path("/etc/OpenCL/vendors")
VARIABLES = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH")
"""Environment variables that name another folder, or a single .icd file. The first that is set counts."""

PATIENCE = 20
"""Seconds that loading a library may take. A driver that takes longer is reported so."""

SWITCHES = {"rusticl": "RUSTICL_ENABLE"}
"""Environment variables without which a driver offers nothing, by a part of the library's name."""

_MOST_BYTES = 1 << 12  # of an .icd file: it holds a name


@dataclass(frozen=True)
class Driver:
    """A driver by its .icd file. library: what the file names. problem: why it offers no device; empty if it does."""

    icd: Path
    library: str
    problem: str


def packages() -> Path:
    """The folder that Python's packages are installed in, pyopencl among them, and the driver that came with it."""
    return Path(cl.__file__).resolve().parents[1]


def icd_files() -> list[Path]:
    """The .icd files that the loader reads: those in the system's folder or another, and those beside pyopencl."""
    given = next((os.environ[name] for name in VARIABLES if os.environ.get(name)), None)
    place = VENDORS if given is None else Path(given)
    files = [place] if place.suffix == ".icd" else []
    for folder in (place, packages() / "pyopencl" / ".libs"):
        try:
            files += sorted(path for path in folder.iterdir() if path.suffix == ".icd")
        except OSError:
            continue
    return files


@remembered
def library_of(platform: cl.Platform) -> str:
    """The path of the library that a platform comes from; empty where that cannot be found out.

    A platform begins with a pointer to the driver's table of functions, as OpenCL's loader requires. Linux says which
    library an address lies in. An address is read only if Linux says that it can be.
    """
    areas = list(_areas())
    address: int | None = int(platform.int_ptr)
    for _ in range(2):
        if address is None or _library_at(areas, address) is None:
            return ""
        address = ctypes.c_void_p.from_address(address).value
    found = None if address is None else _library_at(areas, address)
    return found if found and found.startswith("/") else ""


def _areas() -> Iterator[tuple[int, int, str]]:
    """The areas of this process's memory that can be read: first address, the address behind the last, and the file."""
    try:
        with open("/proc/self/maps", encoding="utf-8", errors="replace") as file:
            for line in file:
                words = line.rstrip("\n").split(maxsplit=5)
                first, _, behind = words[0].partition("-")
                if words[1].startswith("r"):
                    yield int(first, 16), int(behind, 16), words[5] if len(words) > 5 else ""
    except OSError:
        return


def _library_at(areas: Iterable[tuple[int, int, str]], address: int) -> str | None:
    """The file of the area that holds the eight bytes from the address on; None if there is no such area."""
    return next((path for first, behind, path in areas if first <= address <= behind - 8), None)


def silent_drivers(offering: Iterable[str]) -> list[Driver]:
    """The drivers that offer no device, with the reason. offering: the libraries of all devices (library_of).

    Libraries are loaded in a process of their own, since a driver may end the process that it is loaded in.
    """
    loaded = [path for library in offering if library for path in (library, os.path.realpath(library))]
    found = []
    for icd in icd_files():
        try:
            with open(icd, "rb", opener=open_at_once) as file:
                library = file.read(_MOST_BYTES).decode("utf-8", "replace").strip()
        except OSError as error:
            found.append(Driver(icd, "", f"cannot be read: {error.strerror}"))
            continue
        # A name such as libx.so.1 is a link to libx.so.1.0.0, in a folder that only the loader knows.
        if library and any(os.path.basename(path).startswith(os.path.basename(library)) for path in loaded):
            continue
        if not sys.platform.startswith("linux"):
            continue  # which libraries offer devices is known on Linux alone
        found.append(Driver(icd, library, _problem(library)))
    return found


def _problem(library: str) -> str:
    """Why a library offers no device."""
    if not library:
        return "names no library"
    script = (
        "import ctypes, sys\ntry:\n    ctypes.CDLL(sys.argv[1])\nexcept OSError as error:\n    sys.exit(str(error))"
    )
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", script, library],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"does not load within {PATIENCE} s"
    except OSError as error:
        return f"could not be tried: {error.strerror}"
    if done.returncode < 0:
        return f"ends the process that loads it, by signal {-done.returncode}"
    if done.returncode:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        return f"does not load: {lines[-1] if lines else 'no reason given'}"
    switch = next((name for part, name in SWITCHES.items() if part in library.lower()), None)
    if switch is not None and not os.environ.get(switch):
        return f"loads, but offers no device: {switch} is not set"
    return "loads, but offers no device"
