"""What a bug report needs: versions, the machine, and OpenCL platforms and devices."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterable

PACKAGES = ("clpeel", "pyopencl", "pocl-binary-distribution", "numpy", "trimesh", "Pillow")
ICD_VARIABLES = (
    "CLPEEL_DEVICE",
    "CLPEEL_SKIP_CHECK",
    "RUSTICL_ENABLE",
    "OCL_ICD_VENDORS",
    "OCL_ICD_FILENAMES",
    "OPENCL_VENDOR_PATH",
    "PYOPENCL_CTX",
    "POCL_DEVICES",
)


def version(package: str) -> str:
    """Return the installed version of a package, without importing it."""
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def table(rows: Iterable[Iterable[object]]) -> list[str]:
    """Return rows of cells as lines with aligned columns. The first row is the heading."""
    cells = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]


def technique_table() -> list[str]:
    """Return one line for each technique, and below it the options of `render` that only some techniques have."""
    from clpeel.options import options_of
    from clpeel.techniques import AUTO, AUTO_SUMMARY, TECHNIQUES, options_class

    width = max(map(len, TECHNIQUES))
    lines = []
    summaries = {name: technique.summary for name, technique in TECHNIQUES.items()} | {AUTO: AUTO_SUMMARY}
    for name, summary in summaries.items():
        lines.append(f"{name:<{width}}  {summary}")
        if flags := [each.flag for each in options_of(options_class(name))]:
            lines.append(f"{'':<{width}}  options: {' '.join(flags)}")
        if name != AUTO and TECHNIQUES[name].has_passes:
            lines.append(f"{'':<{width}}  executions: tiles, passes")
    return lines


def device_table() -> list[str]:
    """Return the numbered devices, one line each, under a heading. Below them: the default, and drivers that fail.

    Raises NoDeviceError if there are no devices.
    """
    from clpeel.device.devices import CHOICE, all_devices, why_default
    from clpeel.device.drivers import silent_drivers

    devices = all_devices()
    default, reason = why_default(devices)
    heading = ("number", "kind", "units", "memory", "OpenCL", "self-test", "platform", "name")
    rows: list[tuple[object, ...]] = [heading]
    for device in devices:
        memory = f"{device.memory / 2**30:.1f} GiB"
        # The version reads like "OpenCL 3.0 PoCL HSTR: …". The words after the number repeat the platform, so they are
        # dropped.
        opencl = " ".join(device.version.split()[1:2]) or device.version
        rows.append(
            (
                f"{device.number}{' *' if device == default else ''}",
                device.kind.split(" | ")[-1],
                device.compute_units,
                memory,
                opencl,
                device.tested,
                device.platform.strip(),
                device.name,
            )
        )
    lines = [*table(rows), f"* default: {reason}; choose another by --device or {CHOICE}"]
    silent = silent_drivers(device.library for device in devices)
    return [*lines, *(f"driver '{driver.icd}': {driver.library} {driver.problem}" for driver in silent)]


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _system() -> str:
    try:
        return f"{platform.freedesktop_os_release()['PRETTY_NAME']}, {platform.system()} {platform.release()}"
    except (OSError, KeyError, AttributeError):
        return platform.platform()


def _kernels() -> str:
    from importlib import resources

    try:
        folder = resources.files("clpeel.kernels")
        names = [item.name for part in folder.iterdir() if part.is_dir() for item in part.iterdir()]
        return f"{sum(name.endswith(('.cl', '.h')) for name in names)} files"
    except (ModuleNotFoundError, FileNotFoundError):
        return "not installed (running from the source tree?)"


def _drivers() -> list[str]:
    """Return where an OpenCL loader looks for drivers on this machine."""
    lines = [f"{name}={os.environ[name]}" for name in ICD_VARIABLES if name in os.environ]
    try:
        from clpeel.device.drivers import icd_files

        return lines + ([str(file) for file in icd_files()] or ["no .icd file"])
    except Exception as error:  # pyopencl may be missing or fail, and the report must show how
        return [*lines, f"{type(error).__name__}: {error}"]


def report() -> list[str]:
    """Return the lines of a bug report. It needs no device: it reports what is missing or fails, and raises nothing."""
    from clpeel.command.config import users_file
    from clpeel.device.cache import root

    rows = [("python", f"{platform.python_version()} ({platform.python_implementation()}, {sys.platform})")]
    rows += [(name, version(name)) for name in PACKAGES]
    rows += [("kernels", _kernels()), ("system", f"{_system()}, {platform.machine()}")]
    rows.append(("kernels kept in", str(root())))
    rows.append(("own defaults", users_file() or "none"))
    rows.append(("processor", f"{_processor()} ({os.cpu_count()} threads)"))
    rows += [("drivers", line) for line in _drivers()]
    lines = table(rows)
    lines.append("")
    try:
        from clpeel.device.devices import all_devices

        lines += device_table()
        lines += [
            f"driver of {device.number}: {device.driver} | {device.version} | {device.library or 'unknown library'}"
            for device in all_devices()
        ]
    except Exception as error:  # a driver may fail in any way, and the report must show how
        lines.append(f"devices: {type(error).__name__}: {error}")
    return lines
