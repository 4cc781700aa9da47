"""Mesa's rusticl: what it gets wrong (docs/drivers.md), which kernels go round, and a picture with the usual bits."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "drivers.md"

PLATFORM = "rusticl"

DEVICES = """
from clpeel.device.devices import list_devices
print([device.platform for device in list_devices()])
"""

KERNELS = """
import sys
import numpy as np
import pyopencl as cl
from clpeel.device.devices import find_device

device = find_device("rusticl").device
context = cl.Context([device])
queue = cl.CommandQueue(context)
given = np.array([-3, 5, 0, -1], np.int32)
for name, text in zip(sys.argv[1::2], sys.argv[2::2]):
    program = cl.Program(context, text).build(["-cl-std=CL1.2"], cache_dir=False)
    found = np.full(4, 77, np.int64 if name == "widened" else np.float32)
    to = cl.Buffer(context, cl.mem_flags.COPY_HOST_PTR, hostbuf=found)
    at = cl.Buffer(context, cl.mem_flags.COPY_HOST_PTR, hostbuf=given)
    arguments = (at, to) if name == "widened" else (to,)
    getattr(program, name)(queue, (len(given) if name == "widened" else 1,), None, *arguments)
    cl.enqueue_copy(queue, found, to)
    queue.finish()
    print(name, *found.tolist())
"""

PICTURE = """
import sys
import numpy as np
import clpeel

device, out, *techniques = sys.argv[1:]
corners = np.random.default_rng(4).normal(size=(18, 3))
faces = np.arange(18).reshape(-1, 3)
colors = np.random.default_rng(5).integers(20, 200, (6, 4), dtype=np.uint8)
scene = clpeel.Scene.from_arrays(corners, faces, face_colors=colors)
renderer = clpeel.Renderer(scene, device=device or None, lanes=64)
found = {name: renderer.render(size=(24, 20), technique=name, lighting="none", samples=1).color for name in techniques}
np.savez(out, **found)
"""

TECHNIQUES = ("sort", "depth-peeling", "dual-depth-peeling", "weighted-sum")


def run(script: str, *arguments: str, usual: bool = False) -> str:
    """What a script prints in a process where rusticl has a device, or where the usual device is used."""
    environment = {name: value for name, value in os.environ.items() if name not in ("CLPEEL_DEVICE", "RUSTICL_ENABLE")}
    if not usual:
        environment["RUSTICL_ENABLE"] = "llvmpipe"
    command = [sys.executable, "-P", "-c", script, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@cache
def has_rusticl() -> bool:
    return PLATFORM in run(DEVICES)


@pytest.fixture(autouse=True)
def rusticl() -> None:
    if not has_rusticl():
        pytest.skip("needs Mesa's rusticl (Debian: apt install mesa-opencl-icd)")


def test_the_two_faults_are_as_the_documentation_says() -> None:
    """Where this fails, Mesa is mended, and the page can say since when."""
    kernels = re.findall(r"```c\n(.*?)```", DOCUMENT.read_text(), re.S)
    names = [re.search(r"kernel void (\w+)", kernel)[1] for kernel in kernels]  # type: ignore[index]
    printed = run(KERNELS, *(part for pair in zip(names, kernels, strict=True) for part in pair)).splitlines()
    assert printed == ["widened 0 0 0 0", "filled 0.0 77.0 77.0 77.0"]


def test_pictures_have_the_usual_bits(tmp_path: Path) -> None:
    run(PICTURE, PLATFORM, str(tmp_path / "rusticl"), *TECHNIQUES)
    run(PICTURE, "", str(tmp_path / "usual"), *TECHNIQUES, usual=True)
    found, usual = np.load(tmp_path / "rusticl.npz"), np.load(tmp_path / "usual.npz")
    for name in TECHNIQUES:
        assert usual[name].any()
        np.testing.assert_array_equal(found[name], usual[name], err_msg=name)
