"""Programs: includes, launches by name, the kernels' manners."""

from __future__ import annotations

import re

import pytest

from clpeel.device.devices import open_device
from clpeel.device.layout import Features, Targets
from clpeel.device.program import GROUP, device_seconds, kernel_folder, launch, program, source

FEATURES = Features(1, "face")
FILES = sorted(
    f"{folder.name}/{entry.name}"
    for folder in kernel_folder().iterdir()
    if folder.is_dir()
    for entry in folder.iterdir()
    if entry.name.endswith(".cl")
)


def test_the_kernels_are_installed():
    assert {
        "stages/projection.cl",
        "stages/clipping.cl",
        "stages/expand.cl",
        "stages/binning.cl",
        "stages/windows.cl",
        "stages/setup.cl",
        "techniques/sort.cl",
    } <= set(FILES)


@pytest.mark.parametrize("path", FILES)
def test_sources_are_whole_and_keep_the_rules(path):
    text = source(path)
    assert "#include" not in text
    assert text.count("#pragma OPENCL FP_CONTRACT OFF") == 1
    code = re.sub(r"//.*", "", text)
    # Exact images: nothing whose rounding a device may choose.
    assert not re.search(r"\b(mix|pow|exp|log|native_\w+|half_\w+|mad|rsqrt|dot|normalize|length)\(", code)


EVERYTHING = {"materials": True, "routed": True, "hiding": True, "levels": True, "probes": 8}
LIT = {**EVERYTHING, "lights": True, "positioned": True, "maps": True}

# Lanes, packed colours or not, colours of what, opaque surfaces among others or not: each value with each of another.
# Then materials: all that they need, and some of it.
BUILDS = [
    (1, True, "face", "mixed"),
    (1, False, "face", "transparent"),
    (1, True, "vertex", "transparent"),
    (1, False, "vertex", "mixed"),
    (1, True, "scene", "transparent"),
    (64, False, "face", "mixed"),
    (64, True, "vertex", "mixed"),
    (64, True, "face", "transparent"),
    (64, False, "scene", "transparent"),
    *((lanes, True, "face", "mixed") for lanes in (16, 32, 128)),
]
BUILDS = [
    *((*build, {}) for build in BUILDS),
    (1, False, "vertex", "mixed", EVERYTHING),
    (1, True, "face", "mixed", LIT),
    (64, True, "face", "mixed", {**LIT, "full_highlights": True}),
    (1, True, "face", "transparent", {"lights": True}),
    (64, False, "face", "transparent", {"lights": True, "positioned": True}),
    (64, False, "face", "mixed", EVERYTHING),
    (1, True, "scene", "transparent", {"materials": True, "routed": True}),
    (64, True, "scene", "mixed", {"materials": True, "levels": True}),
    (1, False, "face", "mixed", {**LIT, "linear": True}),
    (64, True, "vertex", "transparent", {"linear": True}),
    (1, True, "scene", "transparent", {"wires": True}),
    (1, True, "face", "mixed", {**LIT, "wires": True}),
    (64, False, "vertex", "mixed", {**EVERYTHING, "wires": True}),
]


# Techniques by passes, with atomics of 64 bits, of 32 bits, and without any.
BY_PASSES = [
    ("depth-peeling", Targets(1, 1, 1), {"ATOMICS_64": 1}),
    ("dual-depth-peeling", Targets(2, 2, 2), {"ATOMICS_64": 1}),
    ("dual-depth-peeling", Targets(2, 2, 2), {"ATOMICS_64": 0, "BY_DEPTH": 1}),
    ("multi-layer-peeling", Targets(8, 1, 1), {"ATOMICS_64": 0}),
    ("multi-layer-peeling", Targets(8, 1, 1, racing=True), {"ATOMICS_64": 0}),
    ("glowscript", Targets(1, 1, 4), {"ATOMICS_64": 1}),
    ("thickness", Targets(2, 0, 1, facing=True), {"ATOMICS_64": 1, "VARIANT": 2}),
    ("weighted-average", Targets(0, 0, 1), {}),
]

# Files that are another kernel with constants of their own.
OTHERS = [
    ("techniques/multi-layer-peeling.cl", {"HAZARD_WINDOW": 2, "HAZARD_ARRIVAL": 0, "TORN_WRITES": 1}),
    ("techniques/thickness.cl", {"PERSPECTIVE": 0, "VARIANT": 1}),
    ("techniques/moments.cl", {"MOMENTS": 8, "QUANTIZED": 1, "PERSPECTIVE": 0}),
    ("techniques/moments.cl", {"TRIGONOMETRIC": 1, "QUANTIZED": 1}),
    ("stages/setup.cl", {"LOW_POSITIONS": 1}),
    ("stages/expand.cl", {"LOW_POSITIONS": 1}),
    ("stages/wires.cl", {"LOW_POSITIONS": 1}),
    ("techniques/sort.cl", {"BEHIND": 1}),
    ("techniques/k-buffer.cl", {"KEPT_LAYERS": 0, "BY_ARRIVAL": 0, "AVERAGED": 1}),
    ("techniques/k-buffer.cl", {"KEPT_LAYERS": 64, "BY_ARRIVAL": 1, "AVERAGED": 0}),
    ("techniques/wavelet.cl", {"WAVELET_RANK": 2, "PIXEL_RANGE": 0, "PERSPECTIVE": 0}),
    *((f"techniques/{name}.cl", {**targets.constants, **more}) for name, targets, more in BY_PASSES),
]


@pytest.mark.parametrize(("path", "defines"), [*((path, {}) for path in FILES), *OTHERS])
@pytest.mark.parametrize(("lanes", "packed", "rate", "surfaces", "more"), BUILDS)
@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_every_build_is_free_of_warnings(path, defines, lanes, packed, rate, surfaces, more):
    import pyopencl as cl

    gpu = open_device()
    features = Features(lanes, rate, packed, rate != "face", surfaces, **more)
    options = ["-cl-std=CL1.2", "-cl-opt-disable", *features.options()]  # warnings come before optimization
    options += [f"-D{name}={value}" for name, value in defines.items()]
    built = cl.Program(gpu.context, source(path)).build(options=options)
    log = built.get_build_info(gpu.device, cl.program_build_info.LOG).strip().splitlines()
    # What clang says of every vector that is wider than the CPU's: nothing is called from elsewhere.
    assert [line for line in log if "changes the ABI" not in line] == []


def test_launches_are_by_name():
    gpu = open_device()
    kernel = program(gpu, "stages/setup.cl", FEATURES)["bin_offsets"]
    assert kernel.names == ("chunk_count", "columns", "tile_count", "counts", "tile_pairs")
    with pytest.raises(TypeError, match="tile_pairs"):
        launch(gpu, "x", kernel, 1, chunk_count=1, columns=1, tile_count=1, counts=None)
    with pytest.raises(TypeError, match="surplus"):
        launch(gpu, "x", kernel, 1, chunk_count=1, columns=1, tile_count=1, counts=None, tile_pairs=None, surplus=1)
    assert program(gpu, "stages/setup.cl", FEATURES)["bin_offsets"] is kernel


def test_time_is_booked_by_stage_and_kernel():
    gpu = open_device()
    kernel = program(gpu, "stages/setup.cl", FEATURES)["bin_offsets"]
    buffer = gpu.buffer("x", 4 * GROUP)
    for stage in ("one", "two", "two"):
        launch(gpu, stage, kernel, GROUP, chunk_count=0, columns=1, tile_count=0, counts=buffer, tile_pairs=buffer)
    launch(gpu, "nothing", kernel, 0)
    stages, kernels = device_seconds(gpu)
    assert stages.keys() == {"one", "two"} and kernels.keys() == {"bin_offsets"}
    assert kernels["bin_offsets"] == pytest.approx(sum(stages.values())) and kernels["bin_offsets"] > 0
    assert device_seconds(gpu) == ({}, {})
