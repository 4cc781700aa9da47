"""Execution by passes: the same picture and the same counts as by tiles, with the launches that the papers have."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import soups
from twins.soups import AHEAD, BENCH

import clpeel
import clpeel.stages.passes
import clpeel.stages.stream
from clpeel.device.workspace import Workspace
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

PEELING = ("depth-peeling", "dual-depth-peeling", "multi-layer-peeling")
ALL: list[tuple[str, dict[str, Any]]] = [
    ("depth-peeling", {}),
    ("dual-depth-peeling", {}),
    ("multi-layer-peeling", {}),
    ("glowscript", {}),
    ("thickness", {"variant": "total"}),
    ("thickness", {"variant": "first-solid"}),
    ("weighted-average", {}),
    ("weighted-sum", {}),
]
ONE_OF_EACH = pytest.mark.parametrize(("technique", "options"), ALL)
SAME = (
    "passes",
    "passes_issued",
    "samples_passed",
    "layers_max",
    "fragments",
    "opaque_samples",
    "truncated_pixels",
    "truncation_bound",
    "clamped_pixels",
)
"""The stats that do not depend on the execution."""


@pytest.fixture(params=[64, 32], ids=lambda bits: f"atomics{bits}")
def atomics(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Both ways to blend depths: a fragment in one go, or its depth first. Skips what the device does not have."""
    if request.param == 32:
        monkeypatch.setattr(Workspace, "long_atomics", False)
    elif not plainly.Renderer(soups.stack([1.0], np.ones(4)).scene()).gpu.long_atomics:
        pytest.skip("needs a device with cl_khr_int64_extended_atomics")
    return int(request.param)


def same(got: clpeel.Result, want: clpeel.Result, judge: Judge, reason: str) -> None:
    judge.same_bits(got, want, reason)
    for name, values in want.maps.items():
        np.testing.assert_array_equal(got.maps[name], values, err_msg=f"{reason}: {name}")
    assert {name: got.stats[name] for name in SAME} == {name: want.stats[name] for name in SAME}, reason
    assert (got.stats.execution, want.stats.execution) == ("passes", "tiles")


def both(renderer: clpeel.Renderer, *arguments: Any, **options: Any) -> tuple[clpeel.Result, clpeel.Result]:
    """The picture by passes, and the one by tiles."""
    one, other = (renderer.render(*arguments, execution=execution, **options) for execution in ("passes", "tiles"))
    return one, other


def coincident(seed: int, count: int, colors: str = "flat8") -> soups.Soup:
    """Triangles, some of them twice, some of them opaque, at few depths, so that many fragments coincide."""
    soup = soups.random(seed, count, "mixed", colors)
    vertices = soup.vertices.copy()
    vertices[:, 2] = np.round(vertices[:, 2] * 3) / 3
    twice = soup.take(np.r_[np.arange(count), np.arange(0, count, 3)])
    if twice.face_colors is not None:
        twice.face_colors[::25, 3] = 255 if colors.endswith("8") else 1
    return dataclasses.replace(twice, vertices=vertices)


def test_the_registry_says_which_techniques_have_it() -> None:
    assert {technique for technique, _ in ALL} == {name for name, each in TECHNIQUES.items() if each.has_passes}


@ONE_OF_EACH
@pytest.mark.parametrize("kind", ["faces, some opaque", "vertices, lit"])
def test_the_picture_and_the_counts_of_tiles(
    technique: str, options: dict[str, Any], kind: str, lanes: int, atomics: int, judge: Judge
) -> None:
    lit = kind == "vertices, lit"
    soup = coincident(81, 220, "vertex" if lit else "flat8")
    renderer = plainly.Renderer(soup.scene(), lanes=lanes)
    lighting = "headlight" if lit else "none"
    got, want = both(renderer, BENCH.camera(), (75, 52), technique, lighting=lighting, **options)
    same(got, want, judge, technique)
    assert want.stats.layers_max > (1 if technique == "thickness" else 3) and want.stats.fragments > 1500


OPTIONS: list[dict[str, Any]] = [
    {"precision": "half"},
    {"precision": "unorm8"},
    {"depth_format": "float32"},
    {"depth_format": "unorm24"},
    {"depth_format": "rgba8"},
    {"coincident": "paper"},
    {"coincident": "paper", "depth_format": "unorm24", "opaque": "blend"},
    {"max_error": 0.03},
    {"passes": 2},
    {"passes": 3, "occlusion_query": False},
    {"samples": 4, "background": None},
    {"samples": 4, "background": ((0.9, 0.5, 0.7), (0.2, 0.3, 0.8))},
    {"layers_per_pass": 1},
    {"layers_per_pass": 3},
    {"layers_per_pass": 64},
    {"projected": True},
]
COMMON = {"depth_format", "opaque", "samples", "background"}


@pytest.mark.parametrize(
    ("technique", "option"),
    [
        pytest.param(technique, own | option, id=f"{technique} {own | option}")
        for technique, own in ALL
        for option in OPTIONS
        if option.keys() <= {*TECHNIQUES[technique].option_names, *COMMON}
    ],
)
def test_every_option(technique: str, option: dict[str, Any], judge: Judge, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = coincident(82, 110).scene()
    if len(technique) % 2:  # one half of the techniques in each of the two ways: both are compared above
        monkeypatch.setattr(Workspace, "long_atomics", False)
    renderer = plainly.Renderer(scene, lanes=1)
    got, want = both(renderer, BENCH.camera(), (61, 47), technique, **option)
    same(got, want, judge, f"{technique} {option}")


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    technique=st.sampled_from(ALL),
    lanes_drawn=st.sampled_from([1, 64]),
)
def test_any_scene(
    seed: int,
    count: int,
    size: tuple[int, int],
    technique: tuple[str, dict[str, Any]],
    lanes_drawn: int,
    judge: Judge,
) -> None:
    soup = soups.with_opaque(coincident(seed, count, "flat"))
    renderer = plainly.Renderer(soup.scene(), lanes=lanes_drawn)
    got, want = both(renderer, BENCH.camera(), size, technique[0], **technique[1])
    same(got, want, judge, str(technique))


@pytest.mark.parametrize("name", ["dragon", "boxes", "grass"])
@ONE_OF_EACH
def test_real_scenes(name: str, technique: str, options: dict[str, Any], judge: Judge, model: Any, bench: Any) -> None:
    scene = clpeel.load(model("dragon_vrip_res3.ply.gz"), opacity=0.4) if name == "dragon" else bench(name).scene()
    camera = clpeel.Camera.frame(scene) if name == "dragon" else BENCH.camera()
    got, want = both(plainly.Renderer(scene), camera, (300, 260), technique, **options)
    same(got, want, judge, f"{name} by {technique}")


@pytest.mark.parametrize(("technique", "options"), [*ALL, ("multi-layer-peeling", {"layers_per_pass": 64})])
def test_any_memory(
    technique: str, options: dict[str, Any], lanes: int, judge: Judge, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tile of this scene has more fragments than there is room for: its pixels are drawn in several runs."""
    rng = np.random.default_rng(5)
    pile = soups.stack(rng.permutation(np.linspace(1, 7, 400)), rng.random((400, 4)) * [1, 1, 1, 0.02])
    cuts: list[int] = []
    runs = clpeel.stages.stream.Stream.runs

    def counted(stream: Any, window: Any) -> Any:
        cuts.append(len(window.cuts))
        return runs(stream, window)

    monkeypatch.setattr(clpeel.stages.stream.Stream, "runs", counted)
    scene = soups.with_opaque(pile).scene()  # the face behind is hidden, but memory has to hold z-far
    renderer = plainly.Renderer(scene, lanes=lanes)
    got, want = both(renderer, AHEAD.camera(), (40, 24), technique, memory="1M", **options)
    same(got, want, judge, technique)
    assert len(cuts) > 1 and max(cuts) > 1


def test_a_pixel_that_does_not_fit_the_memory_is_refused() -> None:
    deep = soups.stack(np.linspace(1, 7, 200_000), np.array([1, 1, 1, 1e-4]))
    with pytest.raises(clpeel.InputError, match="expected room for the 200,000 fragments of one pixel, got room for"):
        plainly.render(deep.scene(), AHEAD.camera(), (2, 2), "weighted-sum", memory="1M", execution="passes")


@pytest.mark.parametrize("technique", PEELING)
def test_what_passes_is_what_lies_behind_the_layers_before(technique: str, lanes: int) -> None:
    """It does not depend on the order of submission. So it is known in advance, whatever a depth test would reject."""
    scene = soups.random(83, 140, "mixed", alpha=(0.05, 0.2)).scene()
    layers = plainly.render(scene, BENCH.camera(), (50, 40), "layer-count").layer_count.astype(int)
    most = int(layers.max())
    a_pass = {"depth-peeling": 1, "dual-depth-peeling": 2, "multi-layer-peeling": 8}[technique]
    want = [int(np.maximum(layers - done, 0).sum()) for done in range(0, most + a_pass, a_pass)]
    if technique == "dual-depth-peeling":  # the first pass passes all; each later one the two layers it peels as well
        want = [want[0], *(int(np.maximum(layers - done, 0).sum()) for done in range(0, most, 2)), 0]
    for execution in ("tiles", "passes"):
        got = plainly.render(scene, BENCH.camera(), (50, 40), technique, lanes=lanes, execution=execution)
        assert got.stats.samples_passed == want, execution


class Launches:
    """The kernels that were launched by passes.py and stream.py, in order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch):
        self.names: list[str] = []
        monkeypatch.setenv("CLPEEL_SKIP_CHECK", "1")  # the self-test has launches of its own
        for module in (clpeel.stages.passes, clpeel.stages.stream):
            monkeypatch.setattr(module, "launch", self._recorded(module.launch))

    def _recorded(self, launch: Callable[..., Any]) -> Callable[..., Any]:
        def recorded(gpu: Any, stage: str, kernel: Any, *rest: Any, **arguments: Any) -> Any:
            self.names.append(kernel.kernel.function_name)
            return launch(gpu, stage, kernel, *rest, **arguments)

        return recorded


def test_the_launches_are_those_of_the_papers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fragments are emitted once. Then each pass clears, peels and blends, and at last all is merged."""
    made = Launches(monkeypatch)
    scene = soups.stack([2.0, 1.0, 3.0], (1.0, 0.5, 0.25, 0.5)).scene()
    result = plainly.render(scene, AHEAD.camera(), (20, 20), "depth-peeling", execution="passes")
    a_pass = ["clear_targets", "peel_fragments", "blend_layers"]
    if not plainly.Renderer(scene).gpu.long_atomics:
        a_pass.insert(2, "settle")
    assert made.names == ["count_fragments", "begin_picture", "emit_stream", *3 * a_pass, "merge_layers"]
    assert result.stats.passes_issued == 4 and result.stats.samples_passed == [1200, 800, 400, 0]


def test_without_64_bit_atomics_ties_are_settled_by_a_second_launch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Workspace, "long_atomics", False)
    made = Launches(monkeypatch)
    scene = soups.stack([1.0], (1.0, 0.5, 0.25, 0.5)).scene()
    plainly.render(scene, AHEAD.camera(), (20, 20), "dual-depth-peeling", execution="passes")
    assert made.names[3:7] == ["clear_targets", "peel_fragments", "settle", "blend_layers"]


@pytest.mark.parametrize("query", [True, False])
def test_the_occlusion_query_is_read_after_each_pass_or_never(query: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    monkeypatch.setenv("CLPEEL_SKIP_CHECK", "1")  # the self-test has queries of its own
    fetch = clpeel.stages.passes.Peeler._read_query

    def counted(peeler: Any, passes: int) -> Any:
        read.append(passes)
        return fetch(peeler, passes)

    monkeypatch.setattr(clpeel.stages.passes.Peeler, "_read_query", counted)
    scene = soups.stack([1.0, 2.0], (1.0, 0.5, 0.25, 0.5)).scene()
    options: dict[str, Any] = {"passes": 5, "occlusion_query": query, "execution": "passes"}
    result = plainly.render(scene, AHEAD.camera(), (20, 20), "depth-peeling", **options)
    # Without queries the counts are fetched when all passes are done, for the stats alone.
    assert read == ([1, 1] if query else [5])
    assert result.stats.samples_passed == ([800, 400, 0] if query else [800, 400, 0, 0, 0])


def test_seconds_per_pass_are_those_of_the_launches() -> None:
    scene = soups.stack(np.linspace(1, 7, 12), (1.0, 0.5, 0.25, 0.1)).scene()
    stats = plainly.render(scene, AHEAD.camera(), (200, 200), "depth-peeling", execution="passes").stats
    assert len(stats.seconds_per_pass) == stats.passes_issued == 13
    assert min(stats.seconds_per_pass[:12]) > 0 == stats.seconds_per_pass[12]  # the last one need not be made
    parts = ("clear_targets", "peel_fragments", "settle", "blend_layers")
    assert sum(stats.seconds_per_pass) == pytest.approx(sum(stats.kernel_seconds.get(part, 0.0) for part in parts))


# --- the paper's race -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"layers_per_pass": 2}, {"layers_per_pass": 5, "coincident": "paper"}])
def test_racing_writes_end_with_the_right_picture(options: dict[str, Any], lanes: int, judge: Judge) -> None:
    """Many fragments a pixel, and several compute units: whatever writes get lost, in the end all layers are there."""
    rng = np.random.default_rng(6)
    depths = np.round(rng.permutation(np.linspace(1, 7, 300)), 1)  # some of them equal
    scene = soups.stack(depths, rng.random((300, 4)) * [1, 1, 1, 0.03]).scene()
    renderer = plainly.Renderer(scene, lanes=lanes)
    call: tuple[Any, ...] = (AHEAD.camera(), (48, 32), "multi-layer-peeling")
    want = renderer.render(*call, **options)
    got = renderer.render(*call, execution="passes", racing_writes=True, **options)
    judge.same_bits(got, want, "racing writes")
    peels = -(-want.stats.layers_max // options.get("layers_per_pass", 8))
    inner = got.stats["inner_passes"]
    # Each peel has at least a pass that writes and one that does not, and the last peel finds nothing.
    assert len(inner) == peels + 1 and min(inner[:-1]) >= 2 and inner[-1] == 1
    assert got.stats.passes_issued == sum(inner) == len(got.stats.samples_passed)
    assert got.stats.samples_passed[-1] == 0 < got.stats.samples_passed[0]
    assert got.stats.layers_max == want.stats.layers_max


def test_simulated_hazards_report_their_inner_passes_too() -> None:
    scene = soups.stack([3.0, 2.0, 4.0, 1.0], (1.0, 0.5, 0.25, 0.5)).scene()
    options: dict[str, Any] = {"layers_per_pass": 4, "hazard_window": 2}
    stats = plainly.render(scene, AHEAD.camera(), (3, 2), "multi-layer-peeling", **options).stats
    assert stats["inner_passes"] == [3, 1] and stats.samples_passed == [24, 12, 0, 0]


def test_a_race_that_never_ends_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clpeel.stages.passes, "MOST_REPEATS", 1)
    scene = soups.stack([1.0], (1.0, 0.5, 0.25, 0.5)).scene()
    options: dict[str, Any] = {"execution": "passes", "racing_writes": True}
    with pytest.raises(clpeel.errors.DeviceError, match="racing_writes: expected a pass that writes nothing, got none"):
        plainly.render(scene, AHEAD.camera(), (4, 4), "multi-layer-peeling", **options)


# --- what cannot be ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("technique", "options", "message"),
    [
        ("sort", {}, "execution: expected 'tiles' for the technique 'sort', got 'passes', which depth-peeling, dual-"),
        ("translucency", {}, "execution: expected 'tiles' for the technique 'translucency'"),
        ("layer-count", {}, "execution: expected 'tiles' for the technique 'layer-count'"),
        ("auto", {}, "execution: expected 'tiles' for the technique 'auto'"),
        ("thickness", {}, "execution: expected 'tiles' for the variant 'exact', got 'passes'"),
        ("multi-layer-peeling", {"hazard_window": 2}, "execution: expected 'tiles' with hazard_window"),
        (
            "multi-layer-peeling",
            {"torn_writes": True},
            "execution: expected 'tiles' with hazard_window and torn_writes",
        ),
        ("multi-layer-peeling", {"racing_writes": True, "passes": 2}, "passes: expected none with racing_writes"),
        (
            "multi-layer-peeling",
            {"racing_writes": True, "torn_writes": True},
            "racing_writes: expected no hazard_window",
        ),
        (
            "multi-layer-peeling",
            {"racing_writes": True, "execution": "tiles"},
            "racing_writes: expected execution='pass",
        ),
        ("depth-peeling", {"execution": "layers"}, "execution: expected one of tiles, passes; got 'layers'"),
    ],
)
def test_what_cannot_be_is_refused(technique: str, options: dict[str, Any], message: str) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match=message):
        plainly.render(scene, AHEAD.camera(), (4, 4), technique, **{"execution": "passes", **options})


def test_nothing_to_draw_and_nothing_transparent(lanes: int) -> None:
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    glass = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    for technique, options in ALL:
        empty = plainly.render(glass, away, (20, 20), technique, lanes=lanes, execution="passes", **options)
        tiles = plainly.render(glass, away, (20, 20), technique, lanes=lanes, **options)
        assert (empty.image == tiles.image).all()
        assert {name: empty.stats[name] for name in SAME} == {name: tiles.stats[name] for name in SAME}, technique
    solid = soups.stack([1.0], (0.25, 0.5, 1.0, 1.0)).scene()
    got = plainly.render(solid, AHEAD.camera(), (20, 20), "depth-peeling", lanes=lanes, execution="passes")
    assert (got.color == [0.25, 0.5, 1.0, 1.0]).all()
