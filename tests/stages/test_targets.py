"""Depth targets (fragments/targets.h): what many work-items blend into a place at once, against sorting in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from numpy.typing import NDArray

from clpeel.device.devices import open_device
from clpeel.device.layout import Features, Targets
from clpeel.device.program import source

ABSENT = np.uint64(2**64 - 1)

KERNELS = """
kernel void clear_all(uint plane, global Place *targets)
{
    uint p = get_global_id(0) * STRIP;
    Row none;
    for (int i = 0; i < TARGETS; ++i) {
        clear_to(&none, IS_MAX(i) ? NEAREST_KEY : FARTHEST_KEY);
        store_row(targets + p, plane, TARGETS, i, &none);
    }
}

kernel void blend(uint plane, volatile global Place *targets, global const ulong *fragments, global const uint *pixels,
                  global uchar *left_over, int step)
{
    uint k = get_global_id(0), key = (uint)(fragments[k] >> 32), payload = (uint)fragments[k];
    volatile global Place *place = targets + pixels[k];
#if SLOTS
    if (insert_atomically(place, plane, key, payload, step)) left_over[pixels[k]] = 1;
#else
    blend_atomically(place, plane, 0, key, payload, step);
    blend_atomically(place + plane, plane, 1, key, payload, step);
#endif
}

kernel void read_all(uint plane, global const Place *targets, global ulong *found)
{
    uint p = get_global_id(0) * STRIP;
    for (int i = 0; i < TARGETS; ++i) {
        Row row;
        load_row(targets + p, plane, TARGETS, i, &row);
        VECTOR(uint) key = unsigned_key(row.key);
        for (uint k = 0; k < STRIP; ++k)
            found[(size_t)i * plane + p + k] =
                (ulong)((const uint *)&key)[k] << 32 | (uint)((const int *)&row.payload)[k];
    }
}
"""

Blended = tuple[NDArray[np.uint64], NDArray[np.uint8]]


def blended(
    fragments: NDArray[np.uint64],
    pixels: NDArray[np.uint32],
    slots: int,
    long_atomics: bool,
    by_depth: bool,
    lanes: int,
) -> Blended:
    """What the targets keep, uint64 [targets, pixels], and which pixels had a fragment left over behind the slots."""
    gpu = open_device(lanes=lanes)
    targets, plane = slots or 2, 64
    defines = f"#define SLOTS {slots}\n" + ("" if slots else "#define IS_MAX(i) ((i) == 1)\n")
    text = defines + source("fragments/targets.h") + KERNELS
    constants = {**Targets(targets, 1, 1).constants, "ATOMICS_64": int(long_atomics), "BY_DEPTH": int(by_depth)}
    options = [*Features(lanes).options(), *(f"-D{name}={value}" for name, value in constants.items())]
    built = cl.Program(gpu.context, text).build(options=["-cl-std=CL1.2", *options])
    held = gpu.buffer("targets", 8 * targets * plane)
    found = gpu.buffer("found", 8 * targets * plane)
    left_over = gpu.put("left_over", np.zeros(plane, np.uint8))
    some, where = gpu.put("some", fragments), gpu.put("where", pixels)
    strips = plane // Features(lanes).strip
    cl.Kernel(built, "clear_all")(gpu.queue, (strips,), None, np.uint32(plane), held)
    for step in [0] if long_atomics else [1, 2]:
        arguments = (np.uint32(plane), held, some, where, left_over, np.int32(step))
        cl.Kernel(built, "blend")(gpu.queue, (len(fragments),), (64,), *arguments)
    cl.Kernel(built, "read_all")(gpu.queue, (strips,), None, np.uint32(plane), held, found)
    return gpu.get(found, (targets, plane), np.uint64), gpu.get(left_over, plane, np.uint8)


def crowd(seed: int, depths: int) -> tuple[NDArray[np.uint64], NDArray[np.uint32]]:
    """16,384 fragments of 7 pixels in any order, of so many depths, each payload once in its pixel."""
    rng = np.random.default_rng(seed)
    count = 1 << 14
    keys = rng.integers(1, depths + 1, count).astype(np.uint64) << np.uint64(32)
    payloads = rng.permutation(count).astype(np.uint64)
    return keys | payloads, rng.integers(0, 7, count).astype(np.uint32)


def first_of_each_depth(fragments: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Sorted, and of each depth only the one with the least payload."""
    sorted_ = np.sort(fragments)
    return sorted_[np.r_[True, sorted_[1:] >> np.uint64(32) != sorted_[:-1] >> np.uint64(32)]]


EVERY = pytest.mark.parametrize(
    ("long_atomics", "by_depth", "lanes"),
    [(True, False, 1), (True, True, 1), (False, False, 1), (False, True, 1), (True, False, 64), (False, True, 64)],
)


@EVERY
@pytest.mark.parametrize("slots", [1, 3, 8])
@pytest.mark.parametrize("depths", [5, 3000])
@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_slots_keep_the_nearest_in_order(
    slots: int, depths: int, long_atomics: bool, by_depth: bool, lanes: int
) -> None:
    fragments, pixels = crowd(depths, depths)
    found, left_over = blended(fragments, pixels, slots, long_atomics, by_depth, lanes)
    for pixel in range(8):  # one more than there are, which stays empty
        mine = fragments[pixels == pixel]
        want: Any = first_of_each_depth(mine) if by_depth and len(mine) else np.sort(mine)
        kept = np.full(slots, ABSENT)
        kept[: min(slots, len(want))] = want[:slots]
        assert found[:, pixel].tolist() == kept.tolist()
        assert left_over[pixel] == (len(want) > slots)


@EVERY
@pytest.mark.parametrize("depths", [1, 5, 3000])
@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_min_and_max_keep_both_ends(depths: int, long_atomics: bool, by_depth: bool, lanes: int) -> None:
    """Of equal depths the first submitted is nearest and the last farthest. By depth alone the first is both."""
    fragments, pixels = crowd(7 + depths, depths)
    found, _ = blended(fragments, pixels, 0, long_atomics, by_depth, lanes)
    for pixel in range(7):
        want = first_of_each_depth(fragments[pixels == pixel]) if by_depth else np.sort(fragments[pixels == pixel])
        assert found[:, pixel].tolist() == [int(want[0]), int(want[-1])]
    assert found[:, 7].tolist() == [int(ABSENT), 2**32 - 1]  # the farthest key with no payload, and the nearest
