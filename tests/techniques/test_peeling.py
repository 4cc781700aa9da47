"""All techniques that peel: against `sort`, the passes the papers count, ties, and what stopping early hides."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.multi_layer_peeling import MOST_LAYERS

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

FRONT_TO_BACK = [("depth-peeling", {}), *(("multi-layer-peeling", {"layers_per_pass": m}) for m in (1, 2, 3, 4, 8, 16))]
ALL = [*FRONT_TO_BACK, ("dual-depth-peeling", {})]
EACH = [ALL[0], ("multi-layer-peeling", {}), ALL[-1]]


def passes_of(technique: str, layers: int, options: dict[str, Any]) -> int:
    """Geometry passes that the papers count for so many layers."""
    if technique == "dual-depth-peeling":
        return layers // 2 + 1 if layers % 2 == 0 else (layers + 1) // 2 + 1
    return -(-layers // options.get("layers_per_pass", 1))


def against_sort(got: Any, want: Any, judge: Judge, reason: str) -> None:
    """The same bits, or within 3 N 2^-24 where layers are blended from both ends."""
    if got.stats["technique"] == "dual-depth-peeling":
        judge.color(got, want.color, 3 * max(want.stats["layers_max"], 1) * UNIT, reason)
    else:
        judge.same_bits(got, want, reason)
    for name in ("fragments", "layers_max"):
        assert got.stats[name] == want.stats[name]
    assert got.stats["truncated_pixels"] == got.stats["truncation_bound"] == 0


@pytest.mark.parametrize(("technique", "options"), EACH)
@pytest.mark.parametrize("colors", soups.COLORS)
def test_as_sort(technique: str, options: dict[str, Any], colors: str, lanes: int, judge: Judge) -> None:
    soup, size = soups.random(61, 150, "mixed", colors, alpha=(0.05, 0.9)), (70, 50)
    scene, camera = soup.scene(), BENCH.camera()
    for lighting in ("none", "headlight"):
        want = plainly.render(scene, camera, size, lanes=lanes, lighting=lighting)
        got = plainly.render(scene, camera, size, technique, lanes=lanes, lighting=lighting, **options)
        assert want.stats["layers_max"] >= 8
        against_sort(got, want, judge, f"{technique} {options} {lighting}")


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    places=st.integers(1, 9),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    m=st.sampled_from([2, 3, 16]),
)
def test_any_scene_as_sort(seed: int, count: int, places: int, size: tuple[int, int], m: int, judge: Judge) -> None:
    """Random triangles, some of them one in the plane of another: every tie is kept, in the order of submission."""
    soup = soups.random(seed, count, "mixed", "flat8")
    vertices = soup.vertices.copy()
    vertices[:, 2] = np.round(vertices[:, 2] * places) / places
    faces = np.concatenate([soup.faces, soup.faces[: count // 3]])
    rgba = np.random.default_rng(seed).integers(0, 256, (len(faces), 4), dtype=np.uint8)
    scene = clpeel.Scene.from_arrays(vertices, faces, face_colors=rgba)
    want = plainly.render(scene, BENCH.camera(), size, lanes=1)
    for lanes in (1, 64):
        for technique, options in (*EACH, ("multi-layer-peeling", {"layers_per_pass": m})):
            got = plainly.render(scene, BENCH.camera(), size, technique, lanes=lanes, **options)
            if (rgba[:, 3] == 255).any():  # behind an opaque layer nothing is peeled
                got = dataclasses.replace(got, stats=dataclasses.replace(got.stats, layers_max=want.stats.layers_max))
            against_sort(got, want, judge, f"{technique} {options} on {lanes} lanes")


@pytest.mark.parametrize(("technique", "options"), ALL)
def test_the_passes_that_the_papers_count(technique: str, options: dict[str, Any], lanes: int, judge: Judge) -> None:
    rng = np.random.default_rng(5)
    for layers in (*range(1, 65), 100, 300):
        soup = soups.stack(rng.permutation(np.linspace(1, 7, layers)), rng.random((layers, 4)) * [1, 1, 1, 0.05])
        got = plainly.render(soup.scene(), AHEAD.camera(), (3, 2), technique, lanes=lanes, **options)
        assert got.stats["passes"] == passes_of(technique, layers, options), layers
        assert got.stats["passes_issued"] == len(got.stats["samples_passed"]) == got.stats["passes"] + 1
        assert got.stats["samples_passed"][-1] == 0 < got.stats["samples_passed"][-2]
        against_sort(got, plainly.render(soup.scene(), AHEAD.camera(), (3, 2), lanes=lanes), judge, f"{layers} layers")


@pytest.mark.parametrize(("technique", "options"), ALL)
def test_nothing_to_peel(technique: str, options: dict[str, Any], lanes: int) -> None:
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    soup = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5))
    result = plainly.render(soup.scene(), away, (20, 20), technique, lanes=lanes, **options)
    assert not result.color.any() and (result.image == 255).all()
    assert result.stats["passes"] == passes_of(technique, 0, options) and result.stats["passes_issued"] == 1
    assert result.stats["layers_max"] == result.stats["fragments"] == 0


@pytest.mark.parametrize(("technique", "options"), ALL)
def test_coincident_fragments(technique: str, options: dict[str, Any], lanes: int) -> None:
    # EXTREMES 7: the same triangle k times. Kept: c (1 - (1 - a)^k); by depth alone: a c.
    k, alpha, rgb = 5, 0.25, np.array([0.5, 1.0, 0.25])
    soup = soups.stack([2.0] * k, (*rgb, alpha))
    kept = plainly.render(soup.scene(), AHEAD.camera(), (9, 7), technique, lanes=lanes, **options)
    paper = plainly.render(soup.scene(), AHEAD.camera(), (9, 7), technique, lanes=lanes, coincident="paper", **options)
    assert np.abs(kept.color - np.r_[rgb, 1] * (1 - (1 - alpha) ** k)).max() <= 3 * k * UNIT
    assert (paper.color == np.r_[rgb, 1].astype(np.float32) * np.float32(alpha)).all()
    assert kept.stats["passes"] == passes_of(technique, k, options)
    assert paper.stats["passes"] == passes_of(technique, 1, options)
    # EXTREMES 8: of different colours the first submitted is in front, and alone with the papers' comparison.
    two = soups.stack([2.0, 2.0, 3.0], [(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.5)]).scene()
    kept = plainly.render(two, AHEAD.camera(), (9, 7), technique, lanes=lanes, **options)
    paper = plainly.render(two, AHEAD.camera(), (9, 7), technique, lanes=lanes, coincident="paper", **options)
    assert (kept.color == [0.5, 0.25, 0.125, 0.875]).all()
    assert (paper.color == [0.5, 0, 0.25, 0.75]).all()


@pytest.mark.parametrize(("technique", "options"), ALL)
@pytest.mark.parametrize("limit", [1, 2, 3])
def test_stopping_early(technique: str, options: dict[str, Any], limit: int, lanes: int, judge: Judge) -> None:
    """What is hidden is counted, bounded, and not the foremost layer."""
    soup, size = soups.random(67, 120, "large", alpha=(0.2, 0.7)), (60, 40)
    scene, camera = soup.scene(), BENCH.camera()
    whole = plainly.render(scene, camera, size, lanes=lanes)
    got = plainly.render(scene, camera, size, technique, lanes=lanes, passes=limit, **options)
    twin, excused, _ = judge.weigh(soup, BENCH, size)
    peeled = limit * (2 if technique == "dual-depth-peeling" else options.get("layers_per_pass", 1))
    deepest = whole.stats["layers_max"]
    assert got.stats["layers_max"] == min(peeled, deepest)
    if peeled < deepest:
        assert got.stats["passes_issued"] == got.stats["passes"] == limit + TECHNIQUES[technique].least_passes
    assert abs(got.stats["truncated_pixels"] - (twin.layers > peeled).sum()) <= excused.sum()
    error = np.abs(got.color.astype(float) - whole.color).max(axis=2)
    off = 3 * (deepest + 1) * UNIT
    assert (got.stats["truncation_bound"] > 0) == (got.stats["truncated_pixels"] > 0) == (peeled < deepest)
    assert error.max() <= got.stats["truncation_bound"] + off
    assert (error <= off)[(twin.layers <= peeled) & ~excused].all()
    # The foremost layer: nothing is left of it where all others are made invisible.
    first = plainly.render(scene, camera, size, "depth-peeling", lanes=lanes, passes=1)
    assert (got.color[..., 3] >= first.color[..., 3] - off).all()


@pytest.mark.parametrize(("technique", "options"), ALL)
def test_without_occlusion_queries_all_passes_are_made(technique: str, options: dict[str, Any], lanes: int) -> None:
    scene = soups.stack([1.0, 2.0, 3.0], (1.0, 0.5, 0.25, 0.5)).scene()
    call = {"camera": AHEAD.camera(), "size": (5, 5), "technique": technique, "lanes": lanes, **options}
    want = plainly.render(scene, **call)
    got = plainly.render(scene, occlusion_query=False, passes=9, **call)
    first = TECHNIQUES[technique].least_passes
    assert (got.color == want.color).all()
    assert got.stats["passes_issued"] == 9 + first and got.stats["passes"] == want.stats["passes"]
    assert got.stats["samples_passed"] == [*want.stats["samples_passed"], *[0] * 9][: 9 + first]


@pytest.mark.parametrize(("technique", "options"), ALL)
def test_peeling_stops_behind_an_opaque_layer(technique: str, options: dict[str, Any], lanes: int) -> None:
    # EXTREMES 19: an opaque fragment in front is the picture, and 60 layers behind it are not gone through: as they are
    # never emitted, or, taken as any other, as nothing behind it can be seen.
    colors = np.r_[[[0.25, 0.5, 1.0, 1.0]], np.random.default_rng(0).random((60, 4)) * [1, 1, 1, 0.5]]
    scene = soups.stack(np.linspace(1, 7, 61), colors).scene()
    call = {"camera": AHEAD.camera(), "size": (4, 4), "technique": technique, "lanes": lanes, **options}
    first, blend = (plainly.render(scene, opaque=opaque, **call) for opaque in ("first", "blend"))
    dual = technique == "dual-depth-peeling"
    assert first.stats["passes"] == (1 if dual else 0) and blend.stats["passes"] == (2 if dual else 1)
    assert first.stats["fragments"] == 0 and blend.stats["fragments"] == 61 * 16
    for result in (first, blend):
        assert (result.color == [0.25, 0.5, 1.0, 1.0]).all()
        assert result.stats["truncated_pixels"] == 0


@pytest.mark.parametrize(
    ("technique", "options", "message"),
    [
        ("depth-peeling", {"passes": 0}, "passes: expected 1"),
        ("depth-peeling", {"passes": 1.5}, "passes: expected 1"),
        ("depth-peeling", {"passes": "many"}, "passes: expected 1.*, got 'many'"),
        ("depth-peeling", {"passes": float("nan")}, "passes: expected 1.*, got nan"),
        ("multi-layer-peeling", {"layers_per_pass": float("inf")}, "layers_per_pass: expected 1.*, got inf"),
        ("dual-depth-peeling", {"occlusion_query": False}, "passes: expected a number with occlusion_query=False"),
        ("dual-depth-peeling", {"coincident": "drop"}, "coincident: expected one of keep, paper; got 'drop'"),
        ("multi-layer-peeling", {"layers_per_pass": 0}, f"layers_per_pass: expected 1..{MOST_LAYERS}, got 0"),
        ("multi-layer-peeling", {"layers_per_pass": MOST_LAYERS + 1}, "layers_per_pass: expected 1"),
        ("depth-peeling", {"layers_per_pass": 8}, "layers_per_pass: the technique 'depth-peeling' has no such option"),
        ("sort", {"passes": 3}, "passes: the technique 'sort' has no such option"),
    ],
)
def test_what_cannot_be_is_refused(technique: str, options: dict[str, Any], message: str) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match=message):
        plainly.render(scene, AHEAD.camera(), (4, 4), technique, **options)


@pytest.mark.parametrize("name", ["dragon", "boxes", "grass"])
@pytest.mark.parametrize(("technique", "options"), EACH)
def test_real_scenes(
    name: str, technique: str, options: dict[str, Any], lanes: int, bench: Any, model: Any, judge: Judge
) -> None:
    """Their triangles shuffled, too: of what does not lie at one depth the picture has the same bits."""
    scene = clpeel.load(model("dragon_vrip_res3.ply.gz"), opacity=0.4) if name == "dragon" else bench(name).scene()
    camera = clpeel.Camera.frame(scene) if name == "dragon" else BENCH.camera()
    order = np.random.default_rng(7).permutation(len(scene.faces))
    colors = None if scene.face_colors is None else scene.face_colors[order]
    shuffled = dataclasses.replace(scene, faces=scene.faces[order], face_colors=colors)
    want = plainly.render(scene, camera, (200, 160))
    for some in (scene, shuffled):
        got = plainly.render(some, camera, (200, 160), technique, lanes=lanes, **options)
        against_sort(got, want, judge, f"{technique} {options}")
