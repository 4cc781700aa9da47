"""Rasterization against exact integers: coverage, order, depth, windows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import screen as twins

import clpeel
from clpeel.device.devices import open_device
from clpeel.device.layout import BLOCK, TILE, TILE_PIXELS
from clpeel.device.records import VERTEX
from clpeel.errors import InputError
from clpeel.stages.binning import bin_triangles
from clpeel.stages.projection import project
from clpeel.stages.upload import upload
from clpeel.stages.windows import rasterize


def fragments_of(vertices, size, lanes=1, capacity=1 << 24, camera=None):
    """{(row, column): [(depth key, payload), ...]} in the order emitted; the snapped corners; the number of windows."""
    gpu = open_device(lanes=lanes)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    colors = np.zeros((len(faces), 4), np.uint8)
    colors[:, :3] = np.arange(len(faces))[:, None] >> [0, 8, 16] & 255  # the payload tells the face
    scene = clpeel.Scene.from_arrays(vertices, faces, face_colors=colors)
    camera = camera or clpeel.Camera((0, 0, 4), (0, 0, 0), clipping_range=(1.0, 10.0))
    triangles = project(gpu, upload(gpu, scene), camera, size, False)
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    windows = 0
    columns = -(-size[0] // TILE)
    for batch in bin_triangles(gpu, triangles, 1 << 26).batches(1 << 26):
        for window in rasterize(gpu, triangles, batch, capacity):
            windows += 1
            assert window.count <= capacity
            if not window.count:
                continue
            stored = gpu.get(window.fragments, window.count, np.uint64)
            ends = gpu.get(window.pixel_end, (batch.tiles, TILE_PIXELS), np.uint32).astype(np.int64)
            starts = (
                gpu.get(window.tile_start, batch.tiles, np.uint32)[window.window_tile :].astype(np.int64) - window.start
            )
            for t in range(window.tiles):
                tile = batch.first_tile + window.window_tile + t
                for p in range(window.first_pixel, window.last_pixel + 1):
                    first = ends[window.window_tile + t, p - 1] if p else 0
                    run = stored[starts[t] + first : starts[t] + ends[window.window_tile + t, p]]
                    if len(run):
                        block, row, column = p // BLOCK**2, p % BLOCK**2 // BLOCK, p % BLOCK
                        row, column = row + block // (TILE // BLOCK) * BLOCK, column + block % (TILE // BLOCK) * BLOCK
                        place = tile // columns * TILE + row, tile % columns * TILE + column
                        assert place not in found
                        found[place] = [(int(f >> np.uint64(32)), int(f & np.uint64(0xFFFFFFFF))) for f in run]
    projected = gpu.get(gpu.buffers["vertices"], len(vertices), VERTEX)
    return found, corners_of(vertices, camera, size, projected), windows


def corners_of(vertices, camera, size, projected):
    """Snapped corners int64 [m, 2, 3]: by float64, and as projected where a rounding could go either way."""
    exact = twins.screen(vertices, camera, size)[:, :2]
    corners = np.rint(exact).astype(np.int64)
    either = (np.abs(np.abs(exact - corners) - 0.5) < 1e-3).any(axis=1) & (projected["outcode"] == 0)
    corners[either] = np.stack([projected["x"], projected["y"]], axis=1)[either]
    return corners.reshape(-1, 3, 2).transpose(0, 2, 1)


@pytest.mark.parametrize("lanes", [1, 64])
@given(seed=st.integers(0, 10**6), extent=st.floats(0.01, 30), size=st.tuples(st.integers(1, 60), st.integers(1, 60)))
def test_fragments_are_the_covered_samples_in_submission_order(lanes, seed, extent, size):
    # Extents to 30 units are thousands of pixels: the 64-bit walk as well as the 32-bit one.
    rng = np.random.default_rng(seed)
    vertices = (rng.uniform(-1, 1, (12, 1, 3)) + rng.uniform(-extent, extent, (12, 3, 3)) * [1, 1, 0]).reshape(-1, 3)
    found, corners, _ = fragments_of(vertices, size, lanes)
    expected: dict[tuple[int, int], list[int]] = {}
    for face, (x, y) in enumerate(corners):
        for place in np.argwhere(twins.coverage(x, y, size)):
            expected.setdefault((int(place[0]), int(place[1])), []).append(face)
    assert {place: [payload for _, payload in run] for place, run in found.items()} == expected


def depth_of(key: int) -> float:
    """The inverse of the kernels' depth_key."""
    bits = key if key & 0x80000000 else ~key & 0x7FFFFFFF
    return float(np.uint32(bits).view(np.float32))


@pytest.mark.parametrize("lanes", [1, 64])
def test_depth_has_even_relative_precision_from_near_to_far(lanes):
    # One triangle from 1 to 10**6: the key at each pixel against the plane in float64.
    vertices = np.array([[-2.0, -1.0, -1.0], [2.0, -1.0, -1.0], [1e5, 4e5, -1e6]])
    camera = clpeel.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 90.0, (0.5, 1e7))
    size = (64, 64)
    found, _, _ = fragments_of(vertices, size, lanes, camera=camera)
    assert len(found) > 500
    normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    x, y = (s / 256 / 32 for s in twins.samples(size))  # at distance 1, half the height is 1
    for (row, column), run in found.items():
        ray = np.array([x[column], -y[row], -1.0])
        distance = normal @ vertices[0] / (normal @ ray)
        # Vertex depths 2, barycentric weights 3, area 2, sums 3 roundings of 2^-24, and the plane's shift: 16 in all.
        assert depth_of(run[0][0]) == pytest.approx(0.5 / distance, rel=16 * 2.0**-24)


@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_keys_order_depths_front_to_back():
    values = [np.inf, 1.0, 0.5, 1e-30, 1e-45, 0.0, -0.0, -1e-45, -0.5, -np.inf]
    import pyopencl as cl

    from clpeel.device.layout import Features
    from clpeel.device.program import source

    gpu = open_device()
    features = Features(1)
    text = source("stages/windows.cl") + (
        "kernel void keys(global const float *depths, global uint *out)"
        "{ int i = get_global_id(0); VECTOR(uint) key = depth_key((VECTOR(float))(depths[i]), 1.0f);"
        "out[i] = ((const uint *)&key)[0]; }"
    )
    built = cl.Program(gpu.context, text).build(options=features.options())
    depths = gpu.put("depths", np.array(values, np.float32))
    keys = gpu.buffer("keys", 4 * len(values))
    cl.Kernel(built, "keys")(gpu.queue, (len(values),), None, depths, keys)
    found = gpu.get(keys, len(values), np.uint32).tolist()
    assert found == sorted(set(found))
    assert [depth_of(key) for key in found] == [float(np.float32(value)) for value in values]


@pytest.mark.parametrize("lanes", [1, 64])
def test_windows_hold_the_same_fragments(lanes):
    vertices = np.random.default_rng(4).uniform(-1, 1, (300, 3))
    whole, _, one = fragments_of(vertices, (70, 50), lanes)
    deepest = max(map(len, whole.values()))
    # Room for little more than one pixel: tiles are split among windows.
    parts, _, many = fragments_of(vertices, (70, 50), lanes, capacity=deepest + 3)
    assert one == 1 and many > 20 * 2
    assert parts == whole


def test_a_pixel_deeper_than_the_memory_is_refused():
    vertices = np.tile([[-9.0, -9, 0], [9, -9, 0], [0, 9, 0]], (20, 1))
    with pytest.raises(InputError, match="expected room for the 20 fragments of one pixel, got room for 19"):
        fragments_of(vertices, (8, 8), capacity=19)
