"""Opaque surfaces with every technique: colour and z-far first, and nothing transparent is emitted behind them."""

from __future__ import annotations

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

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

BLENDING = [name for name, technique in TECHNIQUES.items() if not technique.maps]
EXACT = [name for name in BLENDING if TECHNIQUES[name].exact]


def mixed(seed: int, count: int, colors: str, share: float = 0.2) -> clpeel.Scene:
    """A soup of which about this share of the faces is opaque, some of them coincident with others."""
    rng = np.random.default_rng(seed)
    soup = soups.random(seed, count, "mixed", colors, alpha=(0.1, 0.9))
    vertices, faces = soup.vertices.copy(), np.concatenate([soup.faces, soup.faces[: count // 4]])
    solid = rng.random(len(faces)) < share
    solid[0] = True
    if soup.vertex_colors is not None:
        rgba = soup.vertex_colors.copy()
        rgba[soup.faces[solid[:count]].reshape(-1), 3] = 255 if rgba.dtype == np.uint8 else 1
        return clpeel.Scene.from_arrays(vertices, faces, vertex_colors=rgba)
    assert soup.face_colors is not None
    rgba = np.concatenate([soup.face_colors, soup.face_colors[: count // 4][::-1]])
    rgba[solid, 3] = 255 if rgba.dtype == np.uint8 else 1
    return clpeel.Scene.from_arrays(vertices, faces, face_colors=rgba)


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    colors=st.sampled_from(soups.COLORS),
    share=st.sampled_from([0.0, 0.2, 0.9]),
    lit=st.booleans(),
    turn=st.integers(0, 1),
)
def test_first_or_as_any_other_is_one_picture(
    seed: int, count: int, size: tuple[int, int], colors: str, share: float, lit: bool, turn: int, judge: Judge
) -> None:
    """What is exact does not depend on when opaque surfaces are drawn: to the bit, but for dual peeling's own bound.

    (Where alphas are those of vertices, an opaque face's is interpolated to one but for the rounding of three weights,
    their sum and its reciprocal, and it takes part in the blending as that: 8 roundings.)
    """
    scene = mixed(seed, count, colors, share)
    assert scene.surfaces != "transparent"
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "lighting": "headlight" if lit else "none"}
    for lanes in (1, 64):
        want = plainly.render(scene, opaque="blend", lanes=lanes, **call)
        layers = want.stats["layers_max"]
        for technique in EXACT[turn::2] if lanes == 1 else EXACT[1 - turn :: 2]:  # they take turns
            got = plainly.render(scene, technique=technique, lanes=lanes, **call)
            if technique == "dual-depth-peeling" or scene.vertex_colors is not None:
                judge.color(got, want.color, (3 * layers + 8) * UNIT, technique)
            else:
                judge.same_bits(got, want, technique)
            assert got.stats["fragments"] + got.stats["opaque_samples"] <= want.stats["fragments"]


@pytest.mark.parametrize("technique", BLENDING)
@pytest.mark.parametrize("colors", soups.COLORS)
def test_an_opaque_scene_is_one_pass(technique: str, colors: str, lanes: int, judge: Judge) -> None:
    """Nothing to peel, sort or add up: the nearest surface, whatever the technique."""
    scene, size = mixed(3, 80, colors, 1.0), (50, 37)
    if scene.vertex_colors is not None:
        rgba = scene.vertex_colors.copy()
        rgba[:, 3] = 255 if rgba.dtype == np.uint8 else 1
        scene = clpeel.Scene.from_arrays(scene.vertices, scene.faces, vertex_colors=rgba)
    assert scene.surfaces == "opaque"
    got = plainly.render(scene, BENCH.camera(), size, technique, lanes=lanes)
    want = plainly.render(scene, BENCH.camera(), size, lanes=lanes, opaque="blend")
    judge.color(got, want.color, (0 if scene.vertex_colors is None else 8) * UNIT)
    assert set(np.unique(got.color[..., 3])) == {0.0, 1.0}
    stats = got.stats
    assert stats["passes"] == stats["passes_issued"] == stats["fragments"] == stats["layers_max"] == 0
    assert stats["samples_passed"] == stats["seconds_per_pass"] == []
    assert stats["opaque_samples"] == (got.color[..., 3] == 1).sum()
    assert technique not in stats["kernel_seconds"] and technique not in stats["seconds"]


@pytest.mark.parametrize("technique", BLENDING)
def test_what_lies_behind_is_never_emitted(technique: str, lanes: int) -> None:
    """Three layers in front of an opaque one, and ten behind it: those are not even fragments (seeds 001 and 004)."""
    front = [(1.0, 0.0, 0.0, 0.25), (0.0, 1.0, 0.0, 0.5), (0.0, 0.0, 1.0, 0.25)]
    colors = [*front, (0.5, 0.25, 0.125, 1.0), *[(1.0, 1.0, 1.0, 0.75)] * 10]
    order = np.random.default_rng(1).permutation(len(colors))
    away = np.linspace(1, 7, len(colors))
    scene = soups.stack(away[order], np.array(colors)[order]).scene()
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (21, 5), "technique": technique, "lanes": lanes}
    result = plainly.render(scene, **call)
    assert result.stats["fragments"] == 3 * 105 and result.stats["layers_max"] == 3
    assert result.stats["opaque_samples"] == 105 and result.stats["truncated_pixels"] == 0
    # The same as in front of a background of that colour, and the background itself is not seen.
    alone = soups.stack(away[:3], np.array(front)).scene()
    over = plainly.render(alone, AHEAD.camera(), (21, 5), technique).color
    want = over[..., :3] + (1 - over[..., 3:]) * np.array([0.5, 0.25, 0.125])
    # Both have float32 errors of 3 N roundings, N = 4, of sums that weighted-sum does not keep below one.
    assert np.abs(result.color[..., :3] - want).max() <= 2 * 3 * 4 * UNIT * max(1, np.abs(over).max())
    assert (result.color[..., 3] == 1).all()


@pytest.mark.parametrize("technique", EXACT)
def test_coincident_with_an_opaque_surface(technique: str, lanes: int) -> None:
    """Of equal depths the first submitted is in front, whether it is opaque or not; by depth alone the opaque one."""
    glass, wall = (0.0, 1.0, 0.0, 0.5), (1.0, 0.0, 0.0, 1.0)
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (5, 5), "technique": technique, "lanes": lanes}
    for colors, want in (([glass, wall], [0.5, 0.5, 0, 1]), ([wall, glass], [1, 0, 0, 1])):
        scene = soups.stack([2.0, 2.0], np.array(colors)).scene()
        assert (plainly.render(scene, **call).color == want).all()
        if "coincident" in TECHNIQUES[technique].option_names:
            assert (plainly.render(scene, coincident="paper", **call).color == [1, 0, 0, 1]).all()


def test_clipped_opaque_and_transparent_faces(lanes: int, judge: Judge) -> None:
    """Fans of clipped faces (EXTREMES 5): opaque ones come first in the lists, too, and each kind keeps its order."""
    soup = soups.random(8, 80, "large", "flat8")
    vertices = soup.vertices * [1, 1, 3] + [0, 0, 1.5]  # across the near plane and the eye
    assert soup.face_colors is not None
    rgba = soup.face_colors.copy()
    rgba[::3, 3] = 255
    scene = clpeel.Scene.from_arrays(vertices, soup.faces, face_colors=rgba)
    want = plainly.render(scene, BENCH.camera(), (60, 40), lanes=lanes, opaque="blend")
    assert want.stats["clipped"] > 20
    for technique in ("sort", "depth-peeling"):
        got = plainly.render(scene, BENCH.camera(), (60, 40), technique, lanes=lanes)
        assert 0 < got.stats["opaque_samples"]
        judge.same_bits(got, want, technique)


def test_weighted_sums_that_exceed_one_are_still_counted(lanes: int) -> None:
    """Over an opaque surface, too, where nothing of the background is left to tell."""
    scene = soups.stack([1.0, 2.0, 3.0], [(1, 1, 1, 0.75), (1, 1, 1, 0.75), (0, 0, 1, 1)]).scene()
    result = plainly.render(scene, AHEAD.camera(), (6, 3), "weighted-sum", lanes=lanes)
    assert result.stats["clamped_pixels"] == 18
    assert (result.color == [1.5, 1.5, 1.5 - 0.5, 1]).all()


@pytest.mark.parametrize("memory", ["1M", None])
def test_memory_samples_and_batches(memory: str | None, lanes: int, judge: Judge) -> None:
    scene = mixed(5, 400, "vertex")
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (32, 32), "samples": 64, "memory": memory, "lanes": lanes}
    want = plainly.render(scene, BENCH.camera(), (256, 256), lanes=lanes)
    mean = want.color.astype(float).reshape(32, 8, 32, 8, 4).mean(axis=(1, 3))
    bound = 34 * UNIT  # (n + 1) / 2 for a sum of n, and 1
    for technique in ("sort", "multi-layer-peeling"):
        judge.color(plainly.render(scene, technique=technique, **call), mean, bound)


def test_surfaces_of_a_scene() -> None:
    vertices, faces = np.eye(3), [[0, 1, 2]]

    def surfaces(**colors: Any) -> str:
        return clpeel.Scene.from_arrays(vertices, faces, **colors).surfaces

    assert surfaces() == surfaces(color=(1.0, 1.0, 1.0)) == "opaque"
    assert surfaces(color=(1.0, 1.0, 1.0, np.nextafter(np.float32(1), np.float32(0)))) == "transparent"
    assert surfaces(vertex_colors=np.full((3, 4), 255, np.uint8)) == "opaque"
    assert surfaces(vertex_colors=np.array([[0, 0, 0, 255], [0, 0, 0, 255], [0, 0, 0, 254]], np.uint8)) == "transparent"


def test_there_is_no_other_way() -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match="opaque: expected one of first, blend; got 'last'"):
        plainly.render(scene, AHEAD.camera(), (2, 2), opaque="last")


def test_models_with_both(model: Any, judge: Judge) -> None:
    scene = clpeel.load(model("AlphaBlendModeTest.glb"))
    assert scene.surfaces == "mixed"
    camera = clpeel.Camera.frame(scene)
    want = plainly.render(scene, camera, (300, 200), opaque="blend")
    for technique in EXACT:
        got = plainly.render(scene, camera, (300, 200), technique)
        judge.color(got, want.color, (3 * want.stats["layers_max"] + 8) * UNIT, technique)


@pytest.mark.parametrize(
    ("technique", "options"),
    [
        ("sort", {"max_error": 5}),
        ("depth-peeling", {"passes": 0}),
        ("dual-depth-peeling", {"coincident": "drop"}),
        ("multi-layer-peeling", {"layers_per_pass": 0}),
        ("multi-layer-peeling", {"hazard_window": 0}),
        ("glowscript", {"passes": 9}),
        ("weighted-average", {"precision": "double"}),
        ("weighted-sum", {"precision": "double"}),
    ],
)
def test_what_cannot_be_is_refused_of_opaque_scenes_too(technique: str, options: dict[str, Any]) -> None:
    """Where nothing is peeled or added up the options are not used, and wrong all the same."""
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 1.0)).scene()
    with pytest.raises(clpeel.InputError, match=f"^{next(iter(options))}: expected"):
        plainly.render(scene, AHEAD.camera(), (4, 4), technique, **options)
