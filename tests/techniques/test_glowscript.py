"""glowscript: the article's merge of opaque colour and at most four peels, in float64, and what it leaves out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")


def merge(layers: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """C1.rgb C1.a + (1 - C1.a) (C2.rgb C2.a + ... C0), in float64."""
    color = opaque
    for layer in layers[::-1]:
        color = layer[:3] * layer[3] + (1 - layer[3]) * color
    return color


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 9])
@pytest.mark.parametrize("passes", [None, 1, 2, 3, 4])
def test_the_merge_of_the_article(count: int, passes: int | None, lanes: int) -> None:
    rng = np.random.default_rng(count)
    layers = rng.random((count, 4)).astype(np.float32)
    opaque = np.array([0.25, 0.5, 0.75], np.float32)
    away = np.linspace(1, 7, count + 1)
    colors = np.r_[layers, [[*opaque, 1.0]]]
    order = rng.permutation(count + 1)
    scene = soups.stack(away[order], colors[order]).scene()
    options: dict[str, Any] = {} if passes is None else {"passes": passes}
    result = plainly.render(scene, AHEAD.camera(), (7, 3), "glowscript", lanes=lanes, **options)
    peels = passes or 4
    want = merge(layers[:peels].astype(float), opaque.astype(float))
    # Two products, a sum and 1 - a for each of at most four layers.
    assert np.abs(result.color[..., :3] - want).max() <= 4 * 4 * UNIT
    assert (result.color[..., 3] == 1).all()
    stats = result.stats
    if count == 0:  # "if there are no transparent objects a simple C0 render is all that is needed"
        assert stats["passes_issued"] == 0
        return
    # "no obvious inexpensive way to get the information needed to avoid scheduling those extra renders"
    assert stats["passes_issued"] == len(stats["samples_passed"]) == peels
    assert stats["passes"] == stats["layers_max"] == min(count, peels)
    assert stats["truncated_pixels"] == (21 if count > peels else 0)
    hidden = float(np.prod(1 - layers[:peels, 3].astype(float))) if count > peels else 0.0
    assert stats["truncation_bound"] == pytest.approx(hidden, abs=4 * UNIT)


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
@pytest.mark.parametrize("passes", [1, 3, 4])
def test_as_depth_peeling_stopped_there(colors: str, passes: int, lanes: int, judge: Judge) -> None:
    """The same layers, and the same left out: only the order of the products differs."""
    scene, size = soups.random(67, 120, "large", colors, alpha=(0.2, 0.7)).scene(), (60, 40)
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "passes": passes, "lanes": lanes}
    got = plainly.render(scene, technique="glowscript", **call)
    want = plainly.render(scene, technique="depth-peeling", **call)
    judge.color(got, want.color, 2 * 3 * passes * UNIT)
    for name in ("fragments", "layers_max", "truncated_pixels", "passes"):
        assert got.stats[name] == want.stats[name], name
    assert got.stats["truncation_bound"] == pytest.approx(want.stats["truncation_bound"], rel=passes * 4 * UNIT)


def test_coincident_fragments(lanes: int) -> None:
    scene = soups.stack([2.0] * 6, (1.0, 0.5, 0.25, 0.5)).scene()
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (4, 4), "technique": "glowscript", "lanes": lanes}
    kept, paper = plainly.render(scene, **call), plainly.render(scene, coincident="paper", **call)
    assert (kept.color[..., 3] == 1 - 0.5**4).all() and kept.stats["truncated_pixels"] == 16
    assert (paper.color[..., 3] == 0.5).all() and paper.stats["truncated_pixels"] == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"passes": 5}, "passes: expected 1..4, got 5"),
        ({"passes": 0}, "passes: expected 1..4, got 0"),
        ({"occlusion_query": True}, "occlusion_query: the technique 'glowscript' has no such option"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    with pytest.raises(clpeel.InputError, match=message):
        plainly.render(scene, AHEAD.camera(), (4, 4), "glowscript", **options)
