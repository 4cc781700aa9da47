"""Other drivers: each technique, precision and lane count gives the bits that PoCL of PyPI gives, or is refused.

CLPEEL_DRIVERS names folders, with colons between them. Each of them, or each folder in them, has .icd files of a
driver. Without it, each .icd file of the system is a driver. Each driver is used in a process of its own, in which
OCL_ICD_VENDORS names it. So it is the default of no other test.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from clpeel.device.devices import list_devices
from clpeel.device.drivers import VENDORS
from clpeel.techniques import TECHNIQUES, options_class
from clpeel.techniques.precision import PRECISIONS, Blending
from clpeel.techniques.thickness import VARIANTS, Variant

LANES = (1, 64)

SECONDS, SLOW_SECONDS = 1500, 120
"""The most that a driver's pictures may take, and those of one that takes minutes to compile kernels of one lane."""

SLOW = "rusticl"

Case = tuple[str, dict[str, Any], int]
"""A technique, its options, and lanes."""


def cases() -> list[Case]:
    """Each technique with each precision or variant that it has, by passes too if it can, and each number of lanes.

    Those that are not exact have one precision here: all round by the same few lines (fragments/blending.h).
    """
    found: list[Case] = []
    for name, technique in TECHNIQUES.items():
        options, choices = options_class(name), [{}]
        if issubclass(options, Variant):
            choices = [{"variant": variant} for variant in VARIANTS]
        elif issubclass(options, Blending) and technique.exact:
            choices = [{"precision": precision} for precision in PRECISIONS]
        choices += [by_passes(name)] if technique.has_passes else []
        found += [(name, choice, lanes) for choice in choices for lanes in LANES]
    return found


def by_passes(name: str) -> dict[str, Any]:
    """The options with which a technique is executed by passes."""
    return {"execution": "passes", **({"variant": "total"} if issubclass(options_class(name), Variant) else {})}


def short_cases() -> list[Case]:
    """What a slow driver draws, as far as it gets: each technique with 64 lanes, and by passes if it can."""
    able = [name for name, technique in TECHNIQUES.items() if technique.has_passes]
    return [(name, {}, 64) for name in TECHNIQUES] + [(name, by_passes(name), 64) for name in able]


# Prints a line for each picture: the number of the case, and whether both devices give the same bits. Pictures with so
# many lanes take turns: flat colours; lit, with opaque surfaces and colours that vary over faces; with textures; by
# the kit, with four samples, edges and outlines; with lights and maps of its own.
# Kernels with textures take drivers a while to compile. So each technique has textures in one precision and variant.
SCRIPT = """
import json, sys
from dataclasses import replace
import numpy as np
import clpeel
from clpeel.scene.lights import AmbientLight, DirectionalLight, SpotLight
from clpeel.scene.materials import Finish
from clpeel.device.devices import list_devices
from clpeel.device.drivers import silent_drivers
from clpeel.device.program import DriverError

devices = list_devices()
ours = [each for each in devices if each.came_along]
others = [each for each in devices if not each.came_along]
if not others:
    silent = silent_drivers(each.library for each in devices)
    print(json.dumps(["none", "; ".join(f"{each.library} {each.problem}" for each in silent) or "no device"]))
    sys.exit()
other = others[0]
print(json.dumps(["default", devices[0].library]), flush=True)
print(json.dumps(["device", f"{other.platform}, {other.name}, {other.driver}"]), flush=True)
rng = np.random.default_rng(3)
corners, faces = rng.normal(size=(60, 3)), np.arange(60).reshape(-1, 3)
plain = clpeel.Scene.from_arrays(corners, faces, face_colors=rng.integers(0, 255, (20, 4), dtype=np.uint8))
colors = rng.random((60, 4)).astype(np.float32)
colors[:12, 3] = 1
mixed = clpeel.Scene.from_arrays(corners, faces, vertex_colors=colors)
image = rng.integers(0, 256, (32, 32, 4), dtype=np.uint8)
image[..., 3] = rng.choice([0, 100, 255], (32, 32))
textures = [clpeel.Texture(image), clpeel.Texture(image, ("mirror", "clamp"), "nearest", "linear-mipmap-nearest")]
modes = ["BLEND", "MASK", "OPAQUE"]
materials = [clpeel.Material(texture=textures[k % 2], alpha_mode=mode) for k, mode in enumerate(modes)]
textured = clpeel.Scene.from_arrays(
    corners, faces, vertex_colors=colors, materials=materials, face_materials=np.arange(20) % 4 - 1,
    uv=rng.normal(size=(60, 2)) * 3)
lamps = [
    AmbientLight(intensity=0.3), DirectionalLight(direction=(1, -1, -2), intensity=2.0),
    SpotLight(position=(1, 2, 3), direction=(-1, -2, -3), intensity=20.0, range=9.0)]
maps = {f"{name}_texture": clpeel.Texture(rng.integers(0, 256, (8, 8, 4), dtype=np.uint8)) for name in
        ("metallic_roughness", "normal", "occlusion", "emissive")}
finish = Finish(0.7, 0.8, (0.1, 0.2, 0.1), 0.5, 0.6, **maps)
shiny = clpeel.Scene.from_arrays(
    corners, faces, vertex_colors=colors, materials=[replace(each, finish=finish) for each in materials],
    face_materials=np.arange(20) % 4 - 1, uv=rng.normal(size=(60, 2)) * 3, lights=lamps)
scenes = (
    (plain, "none"), (mixed, "headlight"), (textured, "headlight"), (textured, "none"), (mixed, "kit"),
    (shiny, "scene"))

def drawn(device, number, technique, options, lanes):
    # A verdict may change numbers, so the device is found by what does not change.
    place = next(each.number for each in list_devices() if each.device == device.device)
    few = {"half", "unorm8", "exact"} & {str(value) for value in options.values()}
    scene, lighting = scenes[(number + number // 2 + 2) % (2 if few else len(scenes))]
    kit = {"samples": 4, "edges": True, "silhouettes": True, "edge_opacity": 0.7}
    kit = kit if lighting == "kit" else {"samples": 1}
    return clpeel.Renderer(scene, place, lanes).render(
        size=(70, 50), technique=technique, lighting=lighting, background=(0.2, 0.4, 0.8), **kit, **options)

def arrays(result):
    return [result.image, result.color, *(result.map(name) for name in sorted(result.maps))]

for number, technique, options, lanes in json.loads(sys.argv[1]):
    want = drawn(ours[0], number, technique, options, lanes)
    try:
        got = drawn(other, number, technique, options, lanes)
    except (clpeel.errors.DeviceError, DriverError) as error:
        print(json.dumps([number, f"refused: {error}".splitlines()[0]]), flush=True)
        continue
    pairs = list(zip(arrays(got), arrays(want), strict=True))
    same = all(a.tobytes() == b.tobytes() for a, b in pairs)
    off = max(float(np.abs(a.astype(float) - b.astype(float)).max()) for a, b in pairs[1:])
    lack = any("last bits may differ" in note for note in got.stats.notes)
    print(json.dumps([number, "same" if same else f"differs by {off:.3g}{', as it says' if lack else ''}"]), flush=True)
"""


@dataclass(frozen=True)
class Vendor:
    """A driver. icd: its .icd file, or a folder of them."""

    name: str
    icd: Path

    @property
    def slow(self) -> bool:
        """Whether it takes minutes to compile kernels of one lane."""
        files = [self.icd] if self.icd.suffix == ".icd" else list(self.icd.glob("*.icd"))
        return any(SLOW in file.read_text(encoding="utf-8", errors="replace").lower() for file in files)


def vendors() -> list[Vendor]:
    """The drivers that are at hand, besides the one that came along."""
    given = os.environ.get("CLPEEL_DRIVERS")
    if given is None:
        return [Vendor(file.stem, file) for file in sorted(VENDORS.glob("*.icd"))]
    found = []
    for place in map(Path, given.split(os.pathsep)):
        folders = [place] if any(place.glob("*.icd")) else sorted(each for each in place.glob("*") if each.is_dir())
        found += [Vendor(folder.name, folder) for folder in folders if any(folder.glob("*.icd"))]
    return found


def answers(vendor: Vendor, numbered: list[tuple[int, str, dict[str, Any], int]], seconds: float) -> tuple[dict, bool]:
    """What the process says of each case, and whether it came to an end in time. It is killed if it did not."""
    environment = {**os.environ, "OCL_ICD_VENDORS": str(vendor.icd), "RUSTICL_ENABLE": "llvmpipe"}
    for name in ("CLPEEL_DEVICE", "CLPEEL_SKIP_CHECK", "OPENCL_VENDOR_PATH"):
        environment.pop(name, None)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", SCRIPT, json.dumps(numbered)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        out, error = process.communicate(timeout=seconds)
        ended = True
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        out, error = process.communicate()
        ended = False
    assert not ended or process.returncode == 0, error[-2000:]
    return dict(json.loads(line) for line in out.splitlines() if line.startswith("[")), ended


def both_answers(
    vendor: Vendor, numbered: list[tuple[int, str, dict[str, Any], int]], seconds: float
) -> tuple[dict, bool]:
    """`answers` of two processes side by side, one for each number of lanes, as these have no kernels in common."""
    halves = [[case for case in numbered if case[3] == lanes] for lanes in LANES]
    with ThreadPoolExecutor(len(LANES)) as pool:
        found = list(pool.map(lambda half: answers(vendor, half, seconds), halves))
    return {name: text for each, _ in found for name, text in each.items()}, all(ended for _, ended in found)


def is_expected(text: str, lanes: int, slow: bool) -> bool:
    """Whether a picture is the same, or the device says why it is not, or it was refused where that may be.

    All drivers but the slow ones must draw with a lane a tile, as pictures on CPUs are drawn. With 64 lanes Intel's
    loses the light of some kernels, and the self-test refuses such pictures.
    """
    return text.endswith((": same", ", as it says")) or (": refused: " in text and (slow or lanes != 1))


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs os.killpg")
@pytest.mark.skipif(not any(each.came_along for each in list_devices()), reason="needs PoCL of PyPI to compare with")
@pytest.mark.parametrize("vendor", vendors(), ids=lambda vendor: vendor.name)
def test_other_drivers_give_the_same_bits_or_are_refused(vendor: Vendor) -> None:
    wanted = short_cases() if vendor.slow else cases()
    numbered = [(number, *case) for number, case in enumerate(wanted)]
    found, ended = both_answers(vendor, numbered, SLOW_SECONDS if vendor.slow else SECONDS)
    if "none" in found:
        pytest.skip(f"{vendor.icd}: {found['none']}")
    assert found["default"] == next(each.library for each in list_devices() if each.came_along), (
        "another is the default"
    )
    texts = {number: f"{wanted[number]}: {text}" for number, text in found.items() if isinstance(number, int)}
    said = list(texts.values())
    wrong = [text for number, text in texts.items() if not is_expected(text, wanted[number][2], vendor.slow)]
    assert not wrong, "\n".join([str(found["device"]), *wrong])
    if not ended and vendor.slow:
        pytest.skip(
            f"{found.get('device')}: {len(said)} of {len(wanted)} pictures in {SLOW_SECONDS} s, all as expected"
        )
    assert ended, f"{found.get('device')}: {len(said)} of {len(wanted)} pictures in {SECONDS} s"
    assert len(said) == len(wanted)


def test_what_differs_is_not_expected() -> None:
    for lanes, slow in ((1, True), (1, False), (64, True), (64, False)):
        assert is_expected("case: same", lanes, slow) and is_expected("case: differs by 1e-08, as it says", lanes, slow)
        assert not is_expected("case: differs by 1", lanes, slow)
    refused = "case: refused: because"
    assert not is_expected(refused, 1, slow=False)
    assert is_expected(refused, 64, slow=False) and is_expected(refused, 1, slow=True)


def test_every_technique_and_precision_is_among_the_cases() -> None:
    assert {name for name, _, _ in cases()} == set(TECHNIQUES)
    assert {options.get("precision") for _, options, _ in cases()} >= set(PRECISIONS)
