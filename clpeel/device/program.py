"""Programs: kernel sources to launchable kernels, by argument name; the one place that launches and times."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl

from clpeel.device.building import BUILDING, build
from clpeel.device.devices import Gpu
from clpeel.device.layout import Features
from clpeel.device.records import declarations

_INCLUDE = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)
_KERNEL = re.compile(r"^kernel void (\w+)\(([^)]*)\)", re.MULTILINE)
_SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32}

GROUP = 64
"""Work-items a group where the kernel does not care: a fixed size lets the compiler run them side by side."""

CHUNKS_A_UNIT = 8
"""Chunks for each compute unit where a work-item goes through many items in order: enough for an even load."""

CORRECTLY_ROUNDED = "-cl-fp32-correctly-rounded-divide-sqrt"


@dataclass(frozen=True)
class Kernel:
    """A compiled kernel and its arguments' names, in order."""

    kernel: cl.Kernel
    names: tuple[str, ...]


def kernel_folder() -> Traversable:
    """Where the kernel files are: in the installed package, or beside it in a copy of the repository."""
    try:
        return resources.files("clpeel.kernels")
    except ModuleNotFoundError:
        return Path(__file__).resolve().parents[2] / "kernels"


@cache
def source(path: str) -> str:
    """The text of a kernel file, its includes put in once each where they are first asked for."""
    seen: set[str] = set()

    def expand(name: str) -> str:
        if name in seen:
            return ""
        seen.add(name)
        text = kernel_folder().joinpath(*name.split("/")).read_text(encoding="utf-8")
        return _INCLUDE.sub(lambda match: expand(match[1]), text)

    return declarations() + expand(path)


def program(gpu: Gpu, path: str, features: Features, **defines: int) -> dict[str, Kernel]:
    """The kernels of a file, compiled for these features and other constants; compiled once for each `gpu`."""
    key = path, features, *sorted(defines.items())
    if key not in gpu.programs:
        text = source(path)
        with BUILDING:
            if key not in gpu.builds:
                gpu.builds[key] = build(gpu.context, gpu.device, text, build_options(gpu, features, defines))
        built = gpu.builds[key]
        kernels = {}
        compiled = set(built.get_info(cl.program_info.KERNEL_NAMES).split(";"))  # #if may leave some of the text out
        for name, parameters in _KERNEL.findall(text):
            if name not in compiled:
                continue
            words = [re.sub(r"\s+", " ", parameter).strip() for parameter in parameters.split(",")]
            names = tuple(re.split(r"[ *]", word)[-1] for word in words)
            scalars = tuple(None if "*" in word else _SCALARS[word.split(" ")[0]] for word in words)
            kernel = cl.Kernel(built, name)
            kernel.set_scalar_arg_dtypes(scalars)  # all arguments in one call, at a microsecond or two
            kernels[name] = Kernel(kernel, names)
        gpu.programs[key] = kernels
    found: dict[str, Kernel] = gpu.programs[key]
    return found


def build_options(gpu: Gpu, features: Features, defines: dict[str, int]) -> list[str]:
    """What the compiler is told besides the source."""
    options = ["-cl-std=CL1.2", "-w", *features.options(), *(f"-D{name}={value}" for name, value in defines.items())]
    if gpu.device.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT:
        options.append(CORRECTLY_ROUNDED)
    return options


def cut(gpu: Gpu, items: int, most: int | None = None) -> tuple[int, int]:
    """Chunks of consecutive items, a work-item each: how many items in one, and how many chunks (`most` at most)."""
    chunks = CHUNKS_A_UNIT * int(gpu.device.max_compute_units)
    size = -(-max(items, 1) // max(min(chunks, items, chunks if most is None else most), 1))
    return size, -(-max(items, 1) // size)


def launch(gpu: Gpu, stage: str, kernel: Kernel, groups: int, lanes: int | None = None, **arguments: Any) -> None:
    """Enqueues `groups` work-groups of `lanes` work-items, or `groups` work-items where the driver may group them.

    stage: what the time is booked on. arguments: by the kernel's own names, each exactly once.
    """
    if groups == 0:
        return
    if arguments.keys() != set(kernel.names):
        raise TypeError(f"{kernel.kernel.function_name}: arguments {sorted(set(kernel.names) ^ arguments.keys())}")
    kernel.kernel.set_args(*(arguments[name] for name in kernel.names))
    if lanes is None:
        lanes = GROUP
        groups = -(-groups // lanes)
    event = cl.enqueue_nd_range_kernel(gpu.queue, kernel.kernel, (groups * lanes,), (lanes,))
    gpu.events.append((stage, kernel.kernel.function_name, event))


def device_seconds(gpu: Gpu) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds of each stage and of each kernel since the last call, by the events' own clocks; waits for the queue."""
    gpu.queue.finish()
    stages: dict[str, float] = {}
    kernels: dict[str, float] = {}
    for stage, kernel, event in gpu.events:
        seconds = (event.profile.end - event.profile.start) * 1e-9
        stages[stage] = stages.get(stage, 0.0) + seconds
        kernels[kernel] = kernels.get(kernel, 0.0) + seconds
    gpu.events.clear()
    return stages, kernels
