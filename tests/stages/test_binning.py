"""Binning against brute force: every record in each tile it covers, in submission order, whatever the batches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import screen as twins

import clpeel
from clpeel.device.devices import open_device
from clpeel.device.records import TRIANGLE
from clpeel.stages.binning import bin_triangles
from clpeel.stages.projection import project
from clpeel.stages.upload import upload


def lists(vertices: np.ndarray, size: tuple[int, int], lanes: int, budget: int):
    """The records that cover anything, the list of each tile, and how many batches that took."""
    gpu = open_device(lanes=lanes)
    scene = clpeel.Scene.from_arrays(vertices, np.arange(len(vertices)).reshape(-1, 3), color=(1.0, 0, 0, 0.5))
    camera = clpeel.Camera((0, 0, 4), (0, 0, 0), clipping_range=(1.0, 10.0))
    triangles = project(gpu, upload(gpu, scene), camera, size, False)
    tiles = bin_triangles(gpu, triangles, budget)
    found: dict[int, list[int]] = {}
    batches = 0
    for batch in tiles.batches(budget):
        batches += 1
        start = gpu.get(batch.pair_start, batch.tiles + 1, np.uint32)
        pairs = gpu.get(batch.pairs, int(start[-1]), np.uint32) if start[-1] else np.zeros(0, np.uint32)
        for k in range(batch.tiles):
            assert batch.first_tile + k not in found
            found[batch.first_tile + k] = pairs[start[k] : start[k + 1]].tolist()
    assert sum(map(len, found.values())) == tiles.tile_pairs.sum()
    rows = gpu.get(triangles.records, triangles.count, TRIANGLE) if triangles.count else []
    return dict(enumerate(rows)), found, batches


@pytest.mark.parametrize("lanes", [1, 64])
@pytest.mark.parametrize("budget", [1 << 26, 1 << 10])
@given(seed=st.integers(0, 10**6), extent=st.floats(0.01, 3), size=st.tuples(st.integers(1, 90), st.integers(1, 90)))
def test_every_tile_that_a_triangle_covers_lists_it(lanes, budget, seed, extent, size):
    rng = np.random.default_rng(seed)
    vertices = (rng.uniform(-1, 1, (40, 1, 3)) + rng.uniform(-extent, extent, (40, 3, 3)) * [1, 1, 0]).reshape(-1, 3)
    rows, found, _ = lists(vertices, size, lanes, budget)
    for listed in found.values():
        assert listed == sorted(set(listed))  # submission order, each once
    for record, row in rows.items():
        inside = twins.coverage(row["x"].astype(np.int64), row["y"].astype(np.int64), size)
        listed_in = {tile for tile, listed in found.items() if record in listed}
        assert twins.tiles_met(inside) <= listed_in


def test_a_small_budget_means_more_batches_and_the_same_lists():
    vertices = np.random.default_rng(0).uniform(-1, 1, (300, 3))
    _, one, few = lists(vertices, (256, 256), 1, 1 << 26)
    _, other, many = lists(vertices, (256, 256), 1, 1 << 10)
    assert few == 1 and many > 10
    assert {k: v for k, v in one.items() if v} == {k: v for k, v in other.items() if v}


def test_tiles_beside_a_thin_diagonal_are_left_out():
    # Corner to corner: far fewer tiles than its bounding box has.
    vertices = np.array([[-1, -1, 0], [1, 1, 0], [1, 0.999, 0.0]])
    _, found, _ = lists(vertices, (512, 512), 1, 1 << 26)
    assert sum(bool(v) for v in found.values()) < 100
