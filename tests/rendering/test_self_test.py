"""The self-test: right kernels pass in every kind of picture, wrong ones do not, and it costs next to nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import plainly
import pytest

import clpeel
from clpeel.device import program, verdicts
from clpeel.device.devices import open_device
from clpeel.device.layout import Features
from clpeel.device.verdicts import verdicts_of
from clpeel.errors import DeviceError
from clpeel.rendering import checking, self_test
from clpeel.rendering.known_layers import SHOWN, Wanted
from clpeel.techniques import TECHNIQUES

SIZE = (40, 32)


@pytest.fixture(autouse=True)
def nothing_known(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No verdict is known at first. Kernels that were compiled before are at hand."""
    monkeypatch.delenv(checking.SKIP, raising=False)
    monkeypatch.setattr(verdicts, "_known", {})
    kept = verdicts.cache_of

    class Elsewhere:
        def __init__(self, device: Any) -> None:
            self.folder = tmp_path / kept(device).folder.name

    monkeypatch.setattr(verdicts, "cache_of", Elsewhere)


@pytest.fixture
def tested(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The kinds of the verdicts of all tests that are made."""
    kinds: list[str] = []
    made = self_test.tested

    def test(*arguments: Any) -> Any:
        verdict, notes = made(*arguments)
        kinds.append(verdict.kind)
        return verdict, notes

    monkeypatch.setattr(self_test, "tested", test)
    return kinds


def picture(wanted: Wanted, technique: str = "sort", lanes: int | None = None, **options: Any) -> clpeel.Result:
    """A picture of known layers themselves."""
    return plainly.Renderer(wanted.scene(), None, lanes).render(wanted.camera(), SIZE, technique, **options)


def layers(
    rate: str = "face", surfaces: str = "transparent", packed: bool = True, perspective: bool = True, cut: bool = False
) -> Wanted:
    return Wanted(Features(1, rate, packed), surfaces, perspective, False, cut)


GRADIENT = ("white", "steelblue")
LINEAR = {"blending_space": "linear"}

# Each technique with each of its options that kernels are compiled for or launched by, and each feature, once at least.
PICTURES: list[tuple[Wanted, str, dict[str, Any]]] = [
    (layers(), "sort", {}),
    (layers("vertex", "mixed", cut=True), "sort", {"lighting": "headlight", "layers": True}),
    (layers("scene", packed=False), "sort", {"max_error": 0.01, "samples": 4, "background": None}),
    (layers("face", "opaque", perspective=False), "sort", {"precision": "unorm8", "samples": 256}),
    (layers("face", "opaque"), "sort", {"opaque": "blend", "precision": "half", "depth_format": "rgba8"}),
    (layers("face", "mixed", packed=False, cut=True), "depth-peeling", {"passes": 2}),
    (layers(packed=False, perspective=False), "depth-peeling", {"coincident": "paper", "depth_format": "unorm24"}),
    (layers("scene"), "depth-peeling", {"passes": 3, "occlusion_query": False, "precision": "unorm8"}),
    (layers("vertex"), "dual-depth-peeling", {"coincident": "paper", "layers": True}),
    (layers("face", "mixed"), "dual-depth-peeling", {"passes": 1, "lighting": "headlight"}),
    (layers(packed=False), "dual-depth-peeling", {"max_error": 0.01}),
    (layers(packed=False), "dual-depth-peeling", {"max_error": 0.01, "passes": 1}),
    (layers("scene"), "dual-depth-peeling", {"max_error": 0.01, "passes": 2, "lighting": "headlight"}),
    (layers("vertex", "mixed"), "depth-peeling", {"max_error": 0.01, "passes": 2, "samples": 4}),
    (layers(), "multi-layer-peeling", {"max_error": 0.25, "passes": 1, "layers_per_pass": 2}),
    (layers(), "depth-peeling", {"max_error": 0.25, "passes": 1, "coincident": "paper", "execution": "passes"}),
    (layers("vertex", "mixed"), "multi-layer-peeling", {"layers_per_pass": 3, "precision": "half"}),
    (layers(), "multi-layer-peeling", {"layers_per_pass": 2, "passes": 1}),
    (layers(packed=False), "multi-layer-peeling", {"hazard_window": 2, "layers_per_pass": 2}),
    (layers("scene"), "glowscript", {"lighting": "headlight", "background": GRADIENT}),
    (layers("face", "mixed", packed=False), "glowscript", {"passes": 2, "precision": "unorm8"}),
    (layers(), "thickness", {}),
    (layers(perspective=False), "thickness", {"variant": "total", "samples": 4}),
    (layers(cut=True), "thickness", {"variant": "first-solid"}),
    (layers(), "thickness", {"projected": True, "depth_format": "float32"}),
    (layers("vertex", cut=True), "translucency", {"lighting": "headlight", "background": None}),
    (layers("face", packed=False), "translucency", {"variant": "total", "precision": "half"}),
    (layers("face", "mixed", packed=False), "weighted-average", {}),
    (layers("vertex"), "weighted-average", {"precision": "unorm8", "samples": 4, "background": GRADIENT}),
    (layers("scene", packed=False), "weighted-sum", {"precision": "half", "samples": 16}),
    (layers("face", "mixed"), "weighted-sum", {"lighting": "headlight", "background": None}),
    (layers("face", "mixed", packed=False), "k-buffer", {"kept_layers": 2}),
    (layers("vertex"), "k-buffer", {"kept_layers": 1, "kept_by": "arrival", "precision": "unorm8", "samples": 4}),
    (layers(), "k-buffer", {**LINEAR, "kept_layers": 2, "tail": "none"}),
    (layers(packed=False), "wavelet", {}),
    (layers("vertex", "mixed"), "wavelet", {"wavelet_rank": 2, "wavelet_range": "scene", "samples": 4}),
    (layers(perspective=False), "wavelet", {"wavelet_rank": 2, "precision": "half"}),
    (layers("face", "mixed"), "wavelet", {**LINEAR, "precision": "unorm8", "depth_format": "unorm24"}),
    (layers("face", "mixed", packed=False, cut=True), "moments", {}),
    (layers("vertex"), "moments", {"moments": "6", "overestimation": 0.5, "samples": 4, "lighting": "headlight"}),
    (layers(packed=False), "moments", {"moments": "8", "precision": "half", "background": None}),
    (layers(perspective=False), "moments", {"moments": "trigonometric", "precision": "unorm8"}),
    (layers("scene"), "moments", {"moments": "4", "moment_precision": "quantized"}),
    (layers("face", "mixed"), "moments", {"moments": "trigonometric", "moment_precision": "quantized", **LINEAR}),
    (layers(), "layer-count", {"samples": 4}),
    (layers("face", "mixed"), "weighted-blended", {"samples": 4}),
    (layers("vertex", cut=True), "weighted-blended", {"weight": "7", "lighting": "headlight", "background": None}),
    (layers("face", packed=False, perspective=False), "weighted-blended", {"weight": "10", "precision": "half"}),
    (layers("scene", perspective=False), "weighted-blended", {"weight": "8", "depth_format": "unorm24"}),
    (layers("face"), "weighted-blended", {**LINEAR, "weight": "9", "depth_format": "rgba8"}),
    (layers("face", "mixed"), "stochastic", {"samples": 8}),
    (layers("vertex", cut=True), "stochastic", {"stochastic_samples": 64, "lighting": "headlight"}),
    (layers("face", packed=False), "stochastic", {"stochastic_samples": 16, "precision": "unorm8", "background": None}),
    (layers("scene", "mixed"), "stochastic", {"alpha_correction": False, "precision": "half", "background": GRADIENT}),
    (layers("vertex"), "stochastic", {**LINEAR, "samples": 4, "depth_format": "rgba8", "lighting": "kit"}),
    (layers("face", "mixed", packed=False, cut=True), "depth-peeling", {"execution": "passes"}),
    (layers("vertex"), "dual-depth-peeling", {"execution": "passes", "coincident": "paper"}),
    (layers("vertex", "mixed"), "multi-layer-peeling", {"execution": "passes", "layers_per_pass": 3}),
    (layers(packed=False), "multi-layer-peeling", {"execution": "passes", "racing_writes": True}),
    (layers("scene"), "glowscript", {"execution": "passes", "lighting": "headlight"}),
    (layers(), "thickness", {"execution": "passes", "variant": "total"}),
    (layers("face", "mixed", packed=False), "weighted-average", {"execution": "passes", "precision": "half"}),
    (layers(), "auto", {}),
    (layers("face", "mixed"), "sort", {**LINEAR, "background": None, "layers": True}),
    (layers("vertex", packed=False), "sort", {**LINEAR, "max_error": 0.1, "samples": 4}),
    (layers("face", "opaque"), "sort", {**LINEAR, "samples": 4}),
    (layers("face"), "sort", {**LINEAR, "lighting": "kit", "layers": True}),
    (layers("face"), "sort", {**LINEAR, "lighting": "kit", "highlights": "full", "layers": True}),
    (layers("vertex", "mixed"), "dual-depth-peeling", {**LINEAR, "max_error": 0.1, "lighting": "headlight"}),
    (layers("scene"), "glowscript", {**LINEAR, "execution": "passes", "background": GRADIENT}),
    (layers("vertex"), "translucency", {**LINEAR, "lighting": "headlight"}),
    (layers(), "weighted-average", {**LINEAR, "execution": "passes", "background": None}),
    (layers("face", "mixed"), "weighted-sum", {**LINEAR, "precision": "unorm8"}),
    (layers(), "thickness", {**LINEAR}),
    (layers(), "auto", {**LINEAR}),
    (layers("face", "mixed", packed=False, cut=True), "multi-layer-alpha-blending", {}),
    (layers("vertex", cut=True), "multi-layer-alpha-blending", {"slots": 2, "samples": 4, "lighting": "headlight"}),
    (layers("scene", perspective=False), "multi-layer-alpha-blending", {**LINEAR, "slots": 16, "precision": "unorm8"}),
    (layers("face", "mixed", packed=False, cut=True), "adaptive", {}),
    (layers("vertex", cut=True), "adaptive", {"nodes": 4, "samples": 4, "lighting": "headlight"}),
    (layers("face", packed=False, perspective=False), "adaptive", {"nodes": 4}),
    (layers("scene", cut=True), "adaptive", {**LINEAR, "nodes": 4, "precision": "half", "depth_format": "unorm24"}),
]


@pytest.mark.parametrize(("wanted", "technique", "options"), PICTURES, ids=lambda each: str(each)[:40])
def test_right_kernels_are_found_right(
    wanted: Wanted, technique: str, options: dict[str, Any], lanes: int, tested: list[str]
) -> None:
    picture(wanted, technique, lanes, **options)
    picture(wanted, technique, lanes, **options)
    assert tested == ["right"], "tested once, and right"


def test_these_are_all_techniques_and_options() -> None:
    named = {technique for _, technique, _ in PICTURES}
    assert named == {*TECHNIQUES, "auto"}
    assert set(SHOWN) == set(TECHNIQUES)
    given = {name for _, _, options in PICTURES for name in options}
    known = {name for technique in TECHNIQUES.values() for name in technique.option_names}
    assert known - given == {"hazard_order", "torn_writes", *checking.NO_MATTER}


@pytest.fixture
def kernels_with(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """kernels_with(old, new): kernels are compiled from sources that are changed so, as if the driver did it."""
    opened, written = open_device, program.source

    def change(old: str, new: str) -> None:
        def source(path: str) -> str:
            return written(path).replace(old, new)

        def fresh(*arguments: Any) -> Any:
            gpu = opened(*arguments)
            gpu.builds = {}  # those of the other tests are of the sources as they are
            return gpu

        for module in (program, checking):
            monkeypatch.setattr(module, "source", source)
        monkeypatch.setattr("clpeel.rendering.renderer.open_device", fresh)

    return change


UNDER = "destination->red + destination->alpha * (source->alpha"

WRONG: list[tuple[str, str, str, Wanted, dict[str, Any]]] = [
    (UNDER, UNDER.replace(" * (", " + ("), "sort", layers(), {}),
    (UNDER, UNDER.replace(" + ", " - "), "multi-layer-peeling", layers("vertex"), {}),
    ("value = value * 255.0f + 0.5f;", "value = value * 255.0f;", "sort", layers(), {}),
    ("return key > b->key;", "return key >= b->key;", "depth-peeling", layers(), {}),
    ("return key > b->key;", "return key < b->key;", "dual-depth-peeling", layers(), {}),
    ("if (!BY_DEPTH) key -= a->payload > b->payload;", "", "depth-peeling", layers(), {}),
    ("a * f->color[0] + b * f->color[1]", "b * f->color[0] + a * f->color[1]", "sort", layers("vertex"), {}),
    (
        "AMBIENT + (1.0f - AMBIENT) * cosine",
        "AMBIENT + (0.99f - AMBIENT) * cosine",
        "sort",
        layers(),
        {"lighting": "headlight"},
    ),
    ("length += within ? passed", "length -= within ? passed", "thickness", layers(), {}),
    ("resolved->alpha = 1.0f - resolved->alpha;", "resolved->alpha = resolved->alpha;", "weighted-sum", layers(), {}),
    ("weigh(count - kept, &behind)", "weigh(count, &behind)", "k-buffer", layers(), {"kept_layers": 2}),
    ("- (k + 0.5f)", "- (k + 0.25f)", "wavelet", layers(), {}),
    ("sum -= own", "sum += own", "wavelet", layers(), {}),
    ("alpha * (alpha * weight_of(", "alpha * (weight_of(", "weighted-blended", layers(), {}),
    ("parameters[2] / depth", "parameters[2] * depth", "weighted-blended", layers(), {"weight": "8"}),
    ("* 0x846CA68Bu", "* 0x846CA689u", "stochastic", layers(), {}),
    ("to_choose -= taken;", "", "stochastic", layers(), {"stochastic_samples": 64}),
    ("within / side + ", "within % side + ", "stochastic", layers(), {"samples": 4}),
    ("if (tile >= to_tile) break;", "if (tile + 1 >= to_tile) break;", "sort", layers(), {}),
    ("ratio = next;", "ratio = norm;", "moments", layers(), {}),
    ("scale * sum - 0.055f", "scale * sum - 0.05f", "sort", layers(), LINEAR),
    ("* 0x1.e54edcp-1f, root", "* 0x1.d54edcp-1f, root", "sort", layers("vertex"), LINEAR),
    ("if (!background) shown = straight;\n#if LINEAR", "#if LINEAR", "sort", layers(), {**LINEAR, "background": None}),
    ("background[MIN(top + place", "background[MIN(place", "sort", layers(), {"background": GRADIENT}),
]
"""An operator or so that is another one, and a picture whose kernels it is in."""


@pytest.mark.parametrize(("old", "new", "technique", "wanted", "options"), WRONG, ids=[wrong[1] for wrong in WRONG])
def test_wrong_kernels_are_refused(
    old: str,
    new: str,
    technique: str,
    wanted: Wanted,
    options: dict[str, Any],
    kernels_with: Callable[[str, str], None],
    tested: list[str],
) -> None:
    assert any(old in program.source(path) for path in (TECHNIQUES[technique].kernel, "stages/setup.cl"))
    kernels_with(old, new)
    for _ in range(2):  # the second time the verdict is known
        with pytest.raises(DeviceError) as error:
            picture(wanted, technique, **options)
        said = str(error.value)
        assert "\n" not in said and technique in said and "another --device" in said
        # A tile that is left out has anything for the number of its fragments. There may be no room for so many.
        assert " in place of " in said or "got InputError (memory: expected room for " in said
        assert error.value.exit_code == 1 and str(verdicts_of(open_device().device).file) in said
    assert tested == ["wrong"]


def test_who_knows_may_skip_it(kernels_with: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch) -> None:
    kernels_with(UNDER, UNDER.replace(" + ", " - "))
    monkeypatch.setenv(checking.SKIP, "0")
    with pytest.raises(DeviceError):
        picture(layers())
    monkeypatch.setenv(checking.SKIP, "1")
    assert (picture(layers()).color < 0).any()


def test_a_wrong_verdict_is_kept_and_forgotten_with_its_file(kernels_with: Callable[[str, str], None]) -> None:
    kernels_with("value = value * 255.0f + 0.5f;", "value = value * 255.0f;")
    with pytest.raises(DeviceError):
        picture(layers())
    file = verdicts_of(open_device().device).file
    kernels_with("value = value * 255.0f;", "value = value * 255.0f;")  # as they are
    verdicts._known.clear()
    picture(layers())  # the sources are others, so the verdict does not count
    assert [line.split("\t")[1] for line in file.read_text().splitlines() if line] == ["wrong", "right"]


def test_a_known_lack_is_a_note(kernels_with: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch) -> None:
    """Bits that are off by a rounding are wrong, unless the device says that it rounds otherwise."""
    kernels_with("destination->alpha * (1.0f - source->alpha)", "destination->alpha * (0x1.fffffep-1f - source->alpha)")
    wanted = layers(packed=False)
    with pytest.raises(DeviceError):
        picture(wanted)
    verdicts._known.clear()
    verdicts_of(open_device().device).file.unlink()
    verdicts._known.clear()
    monkeypatch.setattr(self_test, "lacks", lambda gpu: "does not round quotients and roots correctly")
    for _ in range(2):
        (note,) = picture(wanted).stats.notes
        assert "does not round quotients and roots correctly, so the last bits may differ" in note


def test_numbers_that_kernels_make_up_are_a_wrong_picture(kernels_with: Callable[[str, str], None]) -> None:
    """A pixel with more fragments than there are is an error that the picture is not to blame for."""
    kernels_with("(uint4)(total, deepest, solid, cut)", "(uint4)(total, ~0u, solid, cut)")
    assert "~0u, solid" in program.source("techniques/sort.cl")
    with pytest.raises(DeviceError, match="got InputError .memory: expected room for the 4,294,967,295 fragments"):
        picture(layers())


@pytest.mark.parametrize("surfaces", ["transparent", "mixed", "opaque"])
def test_wrong_counts_are_refused(surfaces: str, kernels_with: Callable[[str, str], None], tested: list[str]) -> None:
    wanted = layers("face", surfaces)
    clpeel.complexity(wanted.scene(), wanted.camera(), SIZE)
    right = verdicts_of(open_device().device).good
    assert any(part.startswith(f"counting: lanes 1, {surfaces} ") for part in right) and tested == []
    kernels_with("column] = count | (opaque", "column] = (count + 1) | (opaque")
    assert "(count + 1) |" in program.source("stages/counting.cl")
    with pytest.raises(
        DeviceError, match=f"got layers .* in place of .*, by counting: lanes 1, {surfaces}; projection"
    ):
        clpeel.complexity(wanted.scene(), wanted.camera(), SIZE)


def test_torn_writes_are_not_tested(tested: list[str]) -> None:
    scene = clpeel.Scene.from_arrays([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, 1, 2]], color=(0.2, 0.5, 0.9, 0.4))
    plainly.render(scene, size=SIZE, technique="multi-layer-peeling", torn_writes=True)
    assert tested == []


# --- what it costs, in processes of their own -------------------------------------------------------------------------

COSTS = """
import json, os, sys, time
import numpy as np
import clpeel
from clpeel.device import workshop
from clpeel.rendering import self_test

def compiled():
    return {os.path.relpath(os.path.join(at, name), workshop.folder()) for at, _, names in os.walk(workshop.folder())
            for name in names if name.endswith(".so")}

faces, options, size = json.loads(sys.argv[1])
count = np.arange(300)
corners = np.stack([np.cos(count), np.sin(count), count / 300], axis=1)
numbers = np.zeros((faces, 3), int)  # all but the first hundred have no area
numbers[:100] = count.reshape(-1, 3)
scene = clpeel.Scene.from_arrays(corners, numbers, color=(0.2, 0.5, 0.9, 0.4))
seconds, made = [], self_test.tested
def test(*arguments):
    begun = time.perf_counter()
    found = made(*arguments)
    seconds.append(time.perf_counter() - begun)
    return found
self_test.tested = test
renderer = clpeel.Renderer(scene)
renderer.render(size=size, **{"background": "white", "lighting": "none", "samples": 1, **options})
print(json.dumps([sorted(compiled()), seconds]))
"""


def costs(faces: int, options: dict[str, Any], cache: Path, **environment: str) -> tuple[set[str], list]:
    """The kernels that PoCL has compiled for a picture, and the seconds of the tests."""
    command = [sys.executable, "-P", "-c", COSTS, json.dumps([faces, options, [200, 150]])]
    inherited = {**os.environ, "XDG_CACHE_HOME": str(cache), **environment}
    inherited.pop("POCL_CACHE_DIR", None)
    done = subprocess.run(command, env=inherited, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    files, seconds = json.loads(done.stdout.splitlines()[-1])
    return set(files), seconds


needs_pocl = pytest.mark.skipif(
    "pocl" not in open_device().device.platform.version.lower(), reason="knows where PoCL keeps what it has compiled"
)


@needs_pocl
@pytest.mark.parametrize(
    ("faces", "options"),
    [(100, {"layers": True}), (1_100_000, {"technique": "weighted-sum"})],
    ids=["layers", "many"],
)
def test_it_compiles_nothing_of_its_own(faces: int, options: dict[str, Any], tmp_path: Path) -> None:
    """PoCL compiles a kernel again for launches of another size, so the test launches kernels as the picture does."""
    with_test, seconds = costs(faces, options, tmp_path / "with")
    without, none = costs(faces, options, tmp_path / "without", CLPEEL_SKIP_CHECK="1")
    assert len(seconds) == 1 and none == []
    assert with_test == without and with_test


@needs_pocl
def test_it_is_made_once(tmp_path: Path) -> None:
    """With kernels that were compiled before, too. (It takes about 10 ms then; the rest is reading the kernels.)"""
    before, none = costs(100, {}, tmp_path, CLPEEL_SKIP_CHECK="1")  # kernels are compiled and kept, but not tested
    after, tests = costs(100, {}, tmp_path)
    assert (len(none), len(tests)) == (0, 1) and after == before
    _, tests = costs(100, {}, tmp_path)
    assert tests == []


def test_warm_up_leaves_verdicts(tmp_path: Path) -> None:
    """No first picture of a kind that was warmed up is tested, with a triangle that is clipped or without."""
    script = (
        "import sys, clpeel, trimesh\nfrom clpeel.rendering import self_test\n"
        "from clpeel.rendering.warm_up import warm_up\n"
        "warm_up(['layer-count'])\n"
        "self_test.tested = lambda *_: sys.exit('it is tested')\n"
        "for opacity, light in ((0.5, 'kit'), (1.0, 'kit'), (None, 'none')):\n"
        "    scene = clpeel.load(trimesh.creation.icosphere(), opacity=opacity)\n"
        "    clpeel.render(scene, size=(64, 48), technique='layer-count', lighting=light, keep_color=False)\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("POCL_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-P", "-c", script], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
