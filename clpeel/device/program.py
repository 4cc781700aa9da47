"""Programs: makes kernels of kernel sources, launches them by argument name, and times them. Only it launches any."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.building import BUILDING, build
from clpeel.device.layout import Features
from clpeel.device.records import STRUCTS, declarations
from clpeel.device.workspace import Workspace

_INCLUDE = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)
_KERNEL = re.compile(r"^kernel void (\w+)\(([^)]*)\)", re.MULTILINE)
_SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32, **dict.fromkeys(STRUCTS)}  # structs go as bytes

DriverError = cl.Error
"""What a driver raises, for code that does not use pyopencl itself."""

Arguments = dict[str, cl.Buffer | NDArray[Any] | float | None]
"""Arguments of a kernel, by the kernel's names for them: buffers, structs (records.py), numbers, NULL."""

GROUP = 64
"""Work-items of a group where the kernel does not care. With a fixed size the compiler can run them side by side."""

CHUNKS_A_UNIT = 8
"""Chunks for each compute unit, where a work-item goes through a chunk of items in order. 8 balance the load."""

CORRECTLY_ROUNDED = "-cl-fp32-correctly-rounded-divide-sqrt"


@dataclass(frozen=True)
class Kernel:
    """A compiled kernel, and the names of its arguments in order."""

    kernel: cl.Kernel
    names: tuple[str, ...]


def kernel_folder() -> Traversable:
    """The folder of the kernel files: in the installed package, or beside it in a copy of the repository."""
    try:
        return resources.files("clpeel.kernels")
    except ModuleNotFoundError:
        return Path(__file__).resolve().parents[2] / "kernels"


@cache
def source(path: str) -> str:
    """The text of a kernel file, after the shared declarations. Each include is put in once, where it first appears."""
    seen: set[str] = set()

    def expand(name: str) -> str:
        if name in seen:
            return ""
        seen.add(name)
        text = kernel_folder().joinpath(*name.split("/")).read_text(encoding="utf-8")
        return _INCLUDE.sub(lambda match: expand(match[1]), text)

    return declarations() + expand(path)


def program(gpu: Workspace, path: str, features: Features, **defines: int) -> dict[str, Kernel]:
    """The kernels of a file by name, compiled for these features and further constants (`defines`).

    They are compiled once for each device and process. Raises DeviceError if there is no room to compile in (build).
    """
    key = path, features, *sorted(defines.items())
    if key not in gpu.programs:
        text = source(path)
        with BUILDING:
            if key not in gpu.builds:
                gpu.builds[key] = build(gpu.context, gpu.device, text, build_options(gpu, features, defines))
        built = gpu.builds[key]
        kernels = {}
        compiled = set(built.get_info(cl.program_info.KERNEL_NAMES).split(";"))  # #if may have removed some
        for name, parameters in _KERNEL.findall(text):
            if name not in compiled:
                continue
            words = [re.sub(r"\s+", " ", parameter).strip() for parameter in parameters.split(",")]
            names = tuple(re.split(r"[ *]", word)[-1] for word in words)
            scalars = tuple(None if "*" in word else _SCALARS[word.split(" ")[0]] for word in words)
            kernel = cl.Kernel(built, name)
            kernel.set_scalar_arg_dtypes(scalars)  # set_args then takes a microsecond or two for all
            kernels[name] = Kernel(kernel, names)
        gpu.programs[key] = kernels
    found: dict[str, Kernel] = gpu.programs[key]
    return found


def build_options(gpu: Workspace, features: Features, defines: dict[str, int]) -> list[str]:
    """The options of the compiler."""
    options = ["-cl-std=CL1.2", "-w", *features.options(), *(f"-D{name}={value}" for name, value in defines.items())]
    if gpu.device.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT:
        options.append(CORRECTLY_ROUNDED)
    return options


def lacks(gpu: Workspace) -> str:
    """Which roundings of floats the device does not make correctly, as words that follow its name; empty if none."""
    config, flags = gpu.device.single_fp_config, cl.device_fp_config
    missing = [
        *([] if config & flags.CORRECTLY_ROUNDED_DIVIDE_SQRT else ["does not round quotients and roots correctly"]),
        *([] if config & flags.DENORM else ["takes the least numbers for 0"]),
    ]
    return " and ".join(missing)


def cut(gpu: Workspace, items: int, most: int | None = None) -> tuple[int, int]:
    """Cuts items into chunks of consecutive ones, a work-item for each chunk.

    most: the most chunks, at least 1. Returns how many items a chunk has, and how many chunks there are.
    """
    chunks = CHUNKS_A_UNIT * int(gpu.device.max_compute_units)
    size = -(-max(items, 1) // max(min(chunks, items, chunks if most is None else most), 1))
    return size, -(-max(items, 1) // size)


def launch(
    gpu: Workspace, stage: str, kernel: Kernel, groups: int, lanes: int | None = None, **arguments: Any
) -> cl.Event | None:
    """Enqueues a kernel: `groups` work-groups of `lanes` work-items or, if lanes is None, `groups` work-items.

    The number of work-items is then rounded up to a multiple of GROUP, and is at least what `gpu.least` says. stage:
    the stage that the time counts for. arguments: by the kernel's own names, each exactly once. Returns the launch's
    event, or None if there are no groups. Raises TypeError if an argument is missing or unknown.
    """
    if groups == 0:
        return None
    if arguments.keys() != set(kernel.names):
        raise TypeError(f"{kernel.kernel.function_name}: arguments {sorted(set(kernel.names) ^ arguments.keys())}")
    kernel.kernel.set_args(*(arguments[name] for name in kernel.names))
    if lanes is None:
        lanes, name = GROUP, kernel.kernel.function_name
        groups = -(-max(groups, gpu.least.get(name, 0)) // lanes)
        gpu.launched[name] = groups * lanes
    event = cl.enqueue_nd_range_kernel(gpu.queue, kernel.kernel, (groups * lanes,), (lanes,))
    gpu.events.append((stage, kernel.kernel.function_name, event))
    return event


def seconds_of(events: Iterable[cl.Event]) -> float:
    """The seconds that these launches took, by the device's clock. They must be done."""
    return sum(event.profile.end - event.profile.start for event in events) * 1e-9


def device_seconds(gpu: Workspace) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds of each stage and of each kernel since the last call, by the device's clock. Waits for the queue."""
    gpu.queue.finish()
    stages: dict[str, float] = {}
    kernels: dict[str, float] = {}
    for stage, kernel, event in gpu.events:
        seconds = seconds_of([event])
        stages[stage] = stages.get(stage, 0.0) + seconds
        kernels[kernel] = kernels.get(kernel, 0.0) + seconds
    gpu.events.clear()
    return stages, kernels
