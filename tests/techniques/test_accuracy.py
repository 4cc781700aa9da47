"""How close exact techniques are to float64: 3 N 2^-24 for N layers, and 8-bit pictures but where it is a near thing.

The truth is float64's blending of the layers that the technique itself found (study.compare.true_colors); and where
no layer is in doubt, that of the twin, which casts rays and shares nothing with clpeel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import plainly
import pytest
from twins import reference, soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

from clpeel.study.compare import true_colors
from clpeel.techniques import TECHNIQUES

pytestmark = pytest.mark.usefixtures("shared_devices")

EXACT = [name for name, technique in TECHNIQUES.items() if technique.exact]
KINDS = {"low": 0.01, "any": 1.0, "mixed": None}  # how great alphas may be; mixed: of all sizes, evenly
SIZE = (5, 3)


def layers_of(count: int, kind: str) -> np.ndarray:
    """Random straight RGBA [n, 4], float32."""
    rng = np.random.default_rng(count)
    colors = rng.random((count, 4))
    colors[:, 3] = 10 ** rng.uniform(-5, 0, count) if kind == "mixed" else colors[:, 3] * KINDS[kind]
    return colors.astype(np.float32)


def over(colors: np.ndarray, dtype: Any) -> np.ndarray:
    """Back to front, each over what is behind it: premultiplied RGBA. An equation that no kernel here uses."""
    result = np.zeros(4, dtype)
    for *rgb, alpha in colors[::-1].astype(dtype):
        result = alpha * np.array([*rgb, 1], dtype) + (1 - alpha) * result
    return result


@pytest.mark.parametrize("technique", EXACT)
@pytest.mark.parametrize("count", [1, 2, 16, 256, 1024, 4096])
@pytest.mark.parametrize("kind", KINDS)
def test_within_3_n_roundings(technique: str, count: int, kind: str, lanes: int) -> None:
    if count == 4096 and lanes != 1 and TECHNIQUES[technique].passes_for(count, TECHNIQUES[technique].options()) > 1000:
        pytest.skip("one shape is enough: as many passes as that over as many layers")
    colors = layers_of(count, kind)
    order = np.random.default_rng(4).permutation(count)
    soup = soups.stack(np.linspace(1, 7, count)[order], colors[order])
    got = plainly.render(soup.scene(), AHEAD.camera(), SIZE, technique, lanes=lanes, opaque="blend").color
    want = over(colors, np.float64)
    error = np.abs(got - want).max()
    assert error <= 3 * count * UNIT
    # What is seen over any background, too, as it is colour and transmittance of one picture that are off.
    for background in (0.0, 0.3, 1.0):
        seen = got[..., :3].astype(float) + (1 - got[..., 3:].astype(float)) * background
        assert np.abs(seen - (want[:3] + (1 - want[3]) * background)).max() <= 3 * count * UNIT


@pytest.mark.parametrize("technique", EXACT)
@pytest.mark.parametrize("seed", range(2))
def test_within_3_n_roundings_of_the_twin(technique: str, seed: int, lanes: int) -> None:
    soup, size = soups.random(80 + seed, 300, "mixed", "flat"), (60, 50)
    twin = reference.render(soup, BENCH, size)
    edge = reference.edge_distance(soup, BENCH, size) <= reference.SNAP + 1e-9
    excused = edge | reference.near_tie(twin, 24 * UNIT)
    got = plainly.render(soup.scene(), BENCH.camera(), size, technique, lanes=lanes)
    error = np.abs(got.color - twin.color).max(axis=2)
    assert (error <= 3 * np.maximum(twin.layers, 1) * UNIT)[~excused].all()
    assert twin.layers.max() >= 8 and excused.mean() < 0.1


SCENES: dict[str, dict[str, Any]] = {"grass": {}, "boxes": {"n": 6}}


@pytest.fixture(params=["large", "mixed", *SCENES])
def soup(request: pytest.FixtureRequest, bench: Callable[..., soups.Soup]) -> soups.Soup:
    """Random triangles, and scenes of the shared bench."""
    if request.param in SCENES:
        return bench(request.param, **SCENES[request.param])
    return soups.random(90, 250, request.param, "flat8")


@pytest.mark.parametrize("technique", EXACT)
@pytest.mark.parametrize("background", [(1.0, 1.0, 1.0), (0.2, 0.0, 0.7)])
def test_pictures_of_8_bits_are_float64s(technique: str, background: Any, soup: soups.Soup, lanes: int) -> None:
    """At least 99.99 % of the values, and none is off by more than one step."""
    size = (160, 120)
    result = plainly.render(soup.scene(), BENCH.camera(), size, technique, background, lanes=lanes, layers=True)
    off = np.abs(result.image.astype(int) - reference.image(true_colors(result.layers), background))
    assert off.max() <= 1
    assert (off == 0).mean() >= 0.9999
    assert result.stats["layers_max"] >= 8
