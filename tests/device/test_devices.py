"""Devices: the list, the choice, and one line where there is none."""

from __future__ import annotations

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import plainly
import pyopencl as cl
import pytest

import clpeel
from clpeel.device import devices as device
from clpeel.device import drivers
from clpeel.device.devices import DeviceInfo, list_devices, open_device, own_lanes, why_default
from clpeel.device.drivers import packages, silent_drivers


def test_devices_are_numbered():
    devices = list_devices()
    assert [d.number for d in devices] == list(range(len(devices))) and devices
    assert all(d.memory > 0 and d.compute_units > 0 and d.name for d in devices)


def test_by_number_and_by_part_of_a_name():
    first = list_devices()[0]
    assert open_device(0).device == first.device
    assert open_device("0").device == first.device
    assert open_device(first.name[2:7].lower()).device == first.device
    assert open_device(first.platform.upper()).device == first.device


def test_the_environment_stands_in(monkeypatch):
    monkeypatch.setenv("CLPEEL_DEVICE", "no such thing")
    with pytest.raises(clpeel.NoDeviceError):
        open_device()
    assert open_device(0).device


def test_one_lane_on_a_cpu():
    gpu = open_device()
    assert gpu.lanes == (1 if device.find_device(None).kind == "cpu" else 64)


@pytest.mark.parametrize(
    ("platform", "kind", "lanes"),
    [
        ("Portable Computing Language", cl.device_type.CPU, 1),
        ("Oclgrind", cl.device_type.CPU, 64),
        ("rusticl", cl.device_type.CPU, 64),
        ("rusticl", cl.device_type.GPU, 64),
        ("NVIDIA CUDA", cl.device_type.GPU, 64),
    ],
)
def test_one_lane_only_where_a_cpu_has_vectors(platform: str, kind: int, lanes: int) -> None:
    device: Any = SimpleNamespace(type=kind, platform=SimpleNamespace(name=platform))
    assert own_lanes(device) == lanes


@pytest.mark.parametrize("selector", [99, "99", "nothing like it"])
def test_no_such_device_lists_those_there_are(selector):
    with pytest.raises(clpeel.NoDeviceError) as error:
        open_device(selector)
    assert list_devices()[0].name in str(error.value) and error.value.exit_code == 3


def test_no_device_at_all_names_the_command(monkeypatch):
    def none():
        raise device.cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    monkeypatch.setattr(device.cl, "get_platforms", none)
    with pytest.raises(clpeel.NoDeviceError, match="pip install pocl-binary-distribution") as error:
        open_device()
    assert "\n" not in str(error.value)


def test_buffers_are_kept_and_only_grow():
    gpu = open_device()
    first = gpu.buffer("a", 100)
    assert gpu.buffer("a", 50) is first
    second = gpu.buffer("a", 200)
    assert second.size >= 200 and gpu.buffer("a", 100) is second
    values = np.arange(10, dtype=np.uint32)
    gpu.put("a", values)
    assert (gpu.get(second, 10, np.uint32) == values).all()
    assert (gpu.get(second, 4, np.uint32, offset=8) == [2, 3, 4, 5]).all()


def test_what_was_built_is_kept_for_the_process():
    one, other = open_device(), open_device()
    assert one.context == other.context and one.builds is other.builds
    assert one.queue != other.queue and one.buffers is not other.buffers and one.programs is not other.programs


def test_threads_do_not_disturb_each_other():
    corners = np.random.default_rng(0).uniform(-1, 1, (90, 3))
    scene = clpeel.Scene.from_arrays(corners, np.arange(90).reshape(-1, 3), color=(255, 0, 0, 100))
    alone = plainly.render(scene, size=(64, 64)).color
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda _: plainly.render(scene, size=(64, 64)).color, range(40)))
    assert all((color == alone).all() for color in together)


# --- which one is the default -----------------------------------------------------------------------------------------


def info(name: str, platform: str, version: str, kind: str = "cpu", library: str = "", tested: str = "right") -> Any:
    """A device as a driver might list it."""
    fake: Any = SimpleNamespace(platform=SimpleNamespace(version=version))
    return DeviceInfo(0, name, platform, version, kind, 2, 1 << 30, "1.0", library, tested, fake)


OURS = info(
    "pthread", "Portable Computing Language", "OpenCL 3.0 PoCL 3.0", library=f"{packages()}/pyopencl/libpocl.so"
)
DEBIANS = info("pthread-x", "Portable Computing Language", "OpenCL 3.0 PoCL 3.1", library="/usr/lib/libpocl.so.2")
INTELS = info("EPYC", "Intel(R) OpenCL", "OpenCL 3.1 LINUX", library="/opt/libintelocl.so")
RUSTICL = info("llvmpipe", "rusticl", "OpenCL 3.0 ", library="/usr/lib/libRusticlOpenCL.so.1.0.0")
OCLGRIND = info("Oclgrind Simulator", "Oclgrind", "OpenCL 1.2", library="/usr/lib/liboclgrind-rt-icd.so")
GPU = info("H100", "NVIDIA CUDA", "OpenCL 3.0 CUDA 12.4", "gpu", "/usr/lib/libnvidia-opencl.so.1")


def in_order(*found: Any) -> list[str]:
    return [each.platform + each.name for each in sorted(found, key=lambda each: each.place)]


def test_installing_a_driver_changes_no_default() -> None:
    """Whatever is installed beside it, and in whatever order the loader finds them."""
    order = in_order(OURS, DEBIANS, INTELS, OCLGRIND, GPU)
    assert order == in_order(OCLGRIND, GPU, DEBIANS, OURS, INTELS)
    assert order[0] == in_order(OURS)[0]
    assert in_order(RUSTICL, INTELS, DEBIANS)[0] == in_order(DEBIANS)[0]
    assert in_order(GPU, INTELS)[0] == in_order(INTELS)[0]
    assert in_order(INTELS, RUSTICL) == [INTELS.platform + INTELS.name, RUSTICL.platform + RUSTICL.name]


def test_a_driver_that_draws_wrongly_comes_last() -> None:
    wrong = replace(OURS, tested="wrong")
    assert in_order(wrong, GPU, RUSTICL) == [each.platform + each.name for each in (RUSTICL, GPU, wrong)]
    first, reason = why_default([RUSTICL, wrong])
    assert first == RUSTICL and reason == "CPUs come first; pthread has drawn known layers wrongly"


def test_the_default_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CLPEEL_DEVICE", raising=False)
    assert why_default([OURS])[1] == "it is the only device"
    assert why_default([OURS, GPU]) == (OURS, "PoCL comes with clpeel")
    assert why_default([DEBIANS, INTELS]) == (DEBIANS, "PoCL comes before other drivers")
    assert why_default([INTELS, RUSTICL]) == (INTELS, "CPUs come first")
    assert why_default([GPU, replace(GPU, name="A100")]) == (GPU, "there is no CPU device")
    wrong = [replace(each, tested="wrong") for each in (OURS, RUSTICL)]
    assert why_default(wrong) == (wrong[0], "all devices have drawn known layers wrongly")
    monkeypatch.setenv("CLPEEL_DEVICE", "no such thing")
    assert why_default([OURS]) == (None, "CLPEEL_DEVICE is 'no such thing', which is no device here")


def test_the_default_is_the_first() -> None:
    assert device.find_device(None) == list_devices()[0]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="libraries of platforms are known on Linux alone")
def test_each_device_has_the_library_of_its_driver() -> None:
    for each in list_devices():
        assert Path(each.library).is_file(), each.platform
    ours = [each for each in list_devices() if each.is_pocl and each.came_along]
    assert not ours or list_devices()[0] == ours[0]


# --- drivers that offer nothing ---------------------------------------------------------------------------------------


@pytest.fixture
def vendors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for .icd files in place of the system's, and none beside pyopencl."""
    monkeypatch.delenv("OPENCL_VENDOR_PATH", raising=False)
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    monkeypatch.setattr(drivers, "packages", lambda: tmp_path / "no packages")
    return tmp_path


def problems(*offering: str) -> dict[str, str]:
    return {driver.icd.name: driver.problem for driver in silent_drivers(offering)}


needs_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs Linux")


@needs_linux
def test_a_driver_that_offers_nothing_is_named_with_the_reason(vendors: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RUSTICL_ENABLE", raising=False)
    named = vendors / "libRusticlOpenCL.so.1"
    named.symlink_to("/proc/self/exe")
    files = {
        "absent": "/nonexistent/libfoo.so\n",
        "empty": "",
        "no library": str(vendors / "no library.icd"),
        "rusticl": str(named),
        "maths": "libm.so.6",
        "offering": "libpocl.so.2",
    }
    for name, text in files.items():
        (vendors / f"{name}.icd").write_text(text)
    (vendors / "folder.icd").mkdir()
    (vendors / "readme.txt").write_text("no driver")
    found = problems("/usr/lib/x86_64-linux-gnu/libpocl.so.2.10.0")
    assert set(found) == {"absent.icd", "empty.icd", "no library.icd", "rusticl.icd", "maths.icd", "folder.icd"}
    assert found["absent.icd"].startswith("does not load: /nonexistent/libfoo.so: cannot open")
    assert found["empty.icd"] == "names no library" and found["folder.icd"].startswith("cannot be read: ")
    assert found["no library.icd"].startswith("does not load: ") and found["maths.icd"] == "loads, but offers no device"
    assert all("\n" not in problem for problem in found.values())


@needs_linux
def test_a_switch_that_is_off_is_named(vendors: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = vendors / "libRusticlOpenCL.so.1"
    library.symlink_to(next(Path(path).resolve() for path in open_libraries() if "libm." in path or "libc." in path))
    (vendors / "rusticl.icd").write_text(str(library))
    monkeypatch.delenv("RUSTICL_ENABLE", raising=False)
    assert problems() == {"rusticl.icd": "loads, but offers no device: RUSTICL_ENABLE is not set"}
    monkeypatch.setenv("RUSTICL_ENABLE", "llvmpipe")
    assert problems() == {"rusticl.icd": "loads, but offers no device"}


def open_libraries() -> list[str]:
    with open("/proc/self/maps", encoding="utf-8") as file:
        return [line.split()[-1] for line in file if ".so" in line]


@needs_linux
def test_a_driver_that_hangs_or_crashes_harms_nobody(vendors: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(vendors / "pipe.so")  # opening it waits for ever
    (vendors / "pipe.icd").write_text(str(vendors / "pipe.so"))
    monkeypatch.setattr(drivers, "PATIENCE", 1)
    assert problems() == {"pipe.icd": "does not load within 1 s"}


@needs_linux
def test_a_single_file_may_be_named(vendors: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (vendors / "one.icd").write_text("/nonexistent/one.so")
    (vendors / "two.icd").write_text("/nonexistent/two.so")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(vendors / "one.icd"))
    assert set(problems()) == {"one.icd"}
