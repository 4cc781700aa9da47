"""Devices: lists them in the order of preference, finds one by number or name, and opens it."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock

import pyopencl as cl

from clpeel.device import workshop
from clpeel.device.drivers import library_of, packages, silent_drivers
from clpeel.device.verdicts import verdicts_of
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

WITHOUT_VECTORS = ("rusticl",)
"""Platforms on a CPU whose compilers make scalars of vectors. The kernels of one lane then take minutes to compile."""

ALLOWED_LANES = (1, 16, 32, 64, 128)


CHOICE = "CLPEEL_DEVICE"
"""The environment variable that names a device where no argument does."""


@dataclass(frozen=True)
class DeviceInfo:
    """One OpenCL device as `clpeel devices` lists it.

    memory: bytes. library: the file of its driver, or empty if that is unknown. tested: whether known layers were drawn
    rightly by all kernels that have drawn there, with the device's own number of lanes: "right", "wrong" or "not yet".
    """

    number: int
    name: str
    platform: str
    version: str
    kind: str
    compute_units: int
    memory: int
    driver: str
    library: str
    tested: str
    device: cl.Device = field(repr=False, compare=False)

    @property
    def words(self) -> str:
        """What a device may be chosen by."""
        return f"{self.name} {self.platform} {self.device.platform.version} {self.driver}"

    @property
    def is_pocl(self) -> bool:
        """Whether its driver is PoCL."""
        return "pocl" in self.device.platform.version.lower()

    @property
    def came_along(self) -> bool:
        """Whether its driver was installed as a package of this Python, as clpeel's own dependency is."""
        return bool(self.library) and Path(self.library).is_relative_to(packages())

    @property
    def place(self) -> tuple[int, ...]:
        """What the list is sorted by: its first device is the default. Equal ones stay as the drivers list them.

        Drivers that have drawn wrongly come last. CPUs come before all else. Among them PoCL is first, and of several
        the one that came along with clpeel. So installing a driver does not change anybody's pictures. Interpreters of
        kernels are behind drivers that compile them.
        """
        order = 0 if self.is_pocl and self.came_along else 1 if self.is_pocl else 2
        return self.tested == "wrong", self.kind != "cpu", self.platform in INTERPRETERS, order


def list_devices() -> list[DeviceInfo]:
    """All OpenCL devices in the order of preference (DeviceInfo.place), numbered from 0. Empty if there are none.

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
                library=library_of(device.platform),
                tested=verdicts_of(device).summary(own_lanes(device)),
                device=device,
            )
        )
    found.sort(key=lambda info: info.place)
    return [replace(info, number=number) for number, info in enumerate(found)]


def own_lanes(device: cl.Device) -> int:
    """How many work-items share a tile by default: one on a CPU whose driver has vectors, else many."""
    scalar = device.platform.name.strip() in (*INTERPRETERS, *WITHOUT_VECTORS)
    return CPU_LANES if device.type & cl.device_type.CPU and not scalar else GPU_LANES


def all_devices() -> list[DeviceInfo]:
    """`list_devices`, but raises NoDeviceError if there are none. The error names drivers that offer no device."""
    devices = list_devices()
    if not devices:
        silent = [f"'{driver.icd}' {driver.problem}" for driver in silent_drivers(())]
        raise NoDeviceError("; ".join([INSTALL_HINT, *silent]))
    return devices


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
    """The device with that number, or the first one whose name, platform or version contains that text.

    By default it is the first of list_devices. Raises NoDeviceError when there is no device at all or none fits, and
    DeviceError as list_devices does.
    """
    devices = all_devices()
    if selector is None or selector == "":
        return devices[0]
    text = str(selector)
    if text.isdigit():
        fitting = [d for d in devices if d.number == int(text)]
    else:
        fitting = [d for d in devices if text.lower() in d.words.lower()]
    if not fitting:
        names = "; ".join(f"{d.number}: {d.name} ({d.platform})" for d in devices)
        raise NoDeviceError(f"device: expected a number or part of a name of {names}; got {text!r}")
    return fitting[0]


def why_default(devices: Sequence[DeviceInfo]) -> tuple[DeviceInfo | None, str]:
    """The device that is used where no argument names one, and why: a clause. devices: of list_devices, not empty.

    The device is None if CLPEEL_DEVICE names none of them.
    """
    chosen = os.environ.get(CHOICE)
    if chosen:
        try:
            return find_device(chosen), f"{CHOICE} is {chosen!r}"
        except NoDeviceError:
            return None, f"{CHOICE} is {chosen!r}, which is no device here"
    first = devices[0]
    if len(devices) == 1:
        return first, "it is the only device"
    if first.tested == "wrong":
        return first, "all devices have drawn known layers wrongly"
    others = [f"{info.name} has drawn known layers wrongly" for info in devices if info.tested == "wrong"]
    if first.is_pocl and first.kind == "cpu":
        reason = "PoCL comes with clpeel" if first.came_along else "PoCL comes before other drivers"
    else:
        reason = "CPUs come first" if first.kind == "cpu" else "there is no CPU device"
    return first, "; ".join([reason, *others])


def open_device(selector: int | str | None = None, lanes: int | None = None) -> Workspace:
    """A workspace with a queue on the chosen device.

    selector: as for find_device; by default the value of the environment variable CLPEEL_DEVICE. lanes: work-items that
    share a tile, one of ALLOWED_LANES; by default own_lanes. Raises InputError if the device cannot
    have so many lanes, and the errors of find_device.
    """
    info = find_device(os.environ.get(CHOICE) if selector is None else selector)
    device = info.device
    if lanes is None:
        lanes = own_lanes(device)
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
