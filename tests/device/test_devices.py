"""Devices: the list, the choice, and one line where there is none."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import clpeel
from clpeel.device import devices as device
from clpeel.device.devices import list_devices, open_device


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
    alone = clpeel.render(scene, size=(64, 64)).color
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda _: clpeel.render(scene, size=(64, 64)).color, range(40)))
    assert all((color == alone).all() for color in together)
