"""Devices: lists them, finds one by number or name, and opens it."""

from __future__ import annotations

import os
from collections.abc import Hashable
from dataclasses import dataclass, field
from threading import Lock

import pyopencl as cl

from clpeel.device import workshop
from clpeel.device.workspace import Workspace
from clpeel.errors import DeviceError, InputError, NoDeviceError

INSTALL_HINT = (
    "no OpenCL device found: install one with 'pip install pocl-binary-distribution' (x86-64 Linux) "
    "or 'apt install pocl-opencl-icd', or a driver for your GPU"
)

KINDS = {"cpu": cl.device_type.CPU, "gpu": cl.device_type.GPU, "accelerator": cl.device_type.ACCELERATOR}

CPU_LANES, GPU_LANES = 1, 64
INTERPRETERS = ("Oclgrind",)
"""Platforms that interpret kernels, even where they call themselves a CPU.

Vectors are no faster there, and Oclgrind rounds some vector operations wrongly.
"""

ALLOWED_LANES = (1, 16, 32, 64, 128)


@dataclass(frozen=True)
class DeviceInfo:
    """One OpenCL device as `clpeel devices` lists it."""

    number: int
    name: str
    platform: str
    version: str
    kind: str
    compute_units: int
    memory: int  # bytes
    driver: str
    device: cl.Device = field(repr=False, compare=False)


def list_devices() -> list[DeviceInfo]:
    """All OpenCL devices, numbered from 0 in the order in which platforms are found. Empty if there are none.

    Raises DeviceError in a process that was forked from one that has used OpenCL (check_process).
    """
    check_process()
    found: list[DeviceInfo] = []
    with workshop.drivers_start():
        devices = [device for platform in _platforms() for device in _devices_of(platform)]
    for device in devices:
        found.append(
            DeviceInfo(
                number=len(found),
                name=device.name.strip(),
                platform=device.platform.name.strip(),
                version=device.version.strip(),
                kind=next((name for name, flag in KINDS.items() if device.type & flag), "other"),
                compute_units=device.max_compute_units,
                memory=device.global_mem_size,
                driver=device.driver_version,
                device=device,
            )
        )
    return found


def _platforms() -> list[cl.Platform]:
    try:
        return list(cl.get_platforms())
    except cl.Error:  # PLATFORM_NOT_FOUND_KHR: no driver at all
        return []


def _devices_of(platform: cl.Platform) -> list[cl.Device]:
    try:
        return list(platform.get_devices())
    except cl.Error:
        return []


_process: int | None = None  # the process that first used the drivers: their threads exist in it alone


def check_process() -> None:
    """Raises DeviceError in a process that was forked from one that has used OpenCL.

    The drivers' threads did not come along with the fork. Whatever is enqueued would wait for them for ever.
    """
    global _process
    if _process is None:
        _process = os.getpid()
    elif _process != os.getpid():
        raise DeviceError(
            "device: expected a process with OpenCL of its own, got one that was forked from a process that has used "
            "it; start processes by multiprocessing.get_context('spawn'), or make the first picture after the fork"
        )


def find_device(selector: int | str | None) -> DeviceInfo:
    """The device with that number, or the first one whose name or platform contains that text.

    By default it is the first CPU device, or the first device if there is no CPU. Raises NoDeviceError when there is no
    device at all or none fits, and DeviceError as list_devices does.
    """
    devices = list_devices()
    if not devices:
        raise NoDeviceError(INSTALL_HINT)
    if selector is None or selector == "":
        return next((d for d in devices if d.device.type & cl.device_type.CPU), devices[0])
    text = str(selector)
    if text.isdigit():
        fitting = [d for d in devices if d.number == int(text)]
    else:
        fitting = [d for d in devices if text.lower() in f"{d.name} {d.platform}".lower()]
    if not fitting:
        names = "; ".join(f"{d.number}: {d.name} ({d.platform})" for d in devices)
        raise NoDeviceError(f"device: expected a number or part of a name of {names}; got {text!r}")
    return fitting[0]


def open_device(selector: int | str | None = None, lanes: int | None = None) -> Workspace:
    """A workspace with a queue on the chosen device.

    selector: as for find_device; by default the value of the environment variable CLPEEL_DEVICE. lanes: work-items that
    share a tile, one of ALLOWED_LANES; by default 1 on a CPU and 64 elsewhere. Raises InputError if the device cannot
    have so many lanes, and the errors of find_device.
    """
    info = find_device(os.environ.get("CLPEEL_DEVICE") if selector is None else selector)
    device = info.device
    if lanes is None:
        has_wide_vectors = device.type & cl.device_type.CPU and info.platform not in INTERPRETERS
        lanes = CPU_LANES if has_wide_vectors else GPU_LANES
    if lanes not in ALLOWED_LANES:
        raise InputError(f"lanes: expected one of {', '.join(map(str, ALLOWED_LANES))}, got {lanes!r}")
    if lanes > device.max_work_group_size:
        raise InputError(f"lanes: expected at most {device.max_work_group_size} on {info.name}, got {lanes}")
    context, builds = _kept(device)
    queue = cl.CommandQueue(context, properties=cl.command_queue_properties.PROFILING_ENABLE)
    return Workspace(device, context, queue, lanes, builds)


_opened: dict[cl.Device, tuple[cl.Context, dict[Hashable, cl.Program]]] = {}
_opening = Lock()


def _kept(device: cl.Device) -> tuple[cl.Context, dict[Hashable, cl.Program]]:
    """A device's context and the programs built in it. They are kept as long as the process lives.

    So only the first workspace of a device waits for compilers.
    """
    with _opening:
        if device not in _opened:
            _opened[device] = cl.Context([device]), {}
        return _opened[device]
