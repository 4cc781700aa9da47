"""How several lanes sort: in place with any step and any number of fragments, and between two arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from clpeel.device.building import BUILDING, build
from clpeel.device.layout import Features
from clpeel.device.program import build_options, source

KERNELS = """
kernel void in_place(global ulong *list, uint step, uint count) { sort_in_place(list, step, count); }
kernel void apart(global ulong *list, global ulong *spare, uint count)
{
    global ulong *sorted = sort_list(list, spare, count);
    for (uint k = 0; k < count; ++k) list[k] = sorted[k];
}
"""

GUARD = np.uint64(0x1234567)


@pytest.fixture(scope="module")
def kernels(opened: Callable[..., Any]) -> tuple[Any, cl.Program]:
    gpu = opened(None, 64)
    with BUILDING:
        text = source("fragments/sorting.h") + KERNELS
        return gpu, build(gpu.context, gpu.device, text, build_options(gpu, Features(64), {}))


def fragments(count: int) -> np.ndarray:
    """Few depths, so that many are equal, and payloads in the order of submission."""
    keys = np.random.default_rng(count).integers(0, max(count // 3, 2), count, dtype=np.uint64) << np.uint64(58)
    return keys | np.arange(count, dtype=np.uint64)


@pytest.mark.parametrize("step", [1, 4])
def test_lists_of_any_length_are_sorted_where_they_lie(kernels: tuple[Any, cl.Program], step: int) -> None:
    gpu, program = kernels
    kernel = cl.Kernel(program, "in_place")
    for count in (*range(1, 35), 63, 64, 65, 100, 127, 200, 255, 256):
        given = np.full(count * step + 8, GUARD)  # what lies between and behind stays as it is
        given[: count * step : step] = fragments(count)
        buffer = cl.Buffer(gpu.context, cl.mem_flags.COPY_HOST_PTR, hostbuf=given)
        kernel(gpu.queue, (1,), (1,), buffer, np.uint32(step), np.uint32(count))
        found = np.empty_like(given)
        cl.enqueue_copy(gpu.queue, found, buffer)
        given[: count * step : step].sort()
        np.testing.assert_array_equal(found, given, err_msg=str(count))


def test_long_lists_are_sorted_between_two_arrays(kernels: tuple[Any, cl.Program]) -> None:
    gpu, program = kernels
    kernel = cl.Kernel(program, "apart")
    for count in (1, 8, 9, 16, 17, 257, 1000, 4097):
        given = fragments(count)
        list_ = cl.Buffer(gpu.context, cl.mem_flags.COPY_HOST_PTR, hostbuf=given)
        spare = cl.Buffer(gpu.context, cl.mem_flags.READ_WRITE, given.nbytes)
        kernel(gpu.queue, (1,), (1,), list_, spare, np.uint32(count))
        found = np.empty_like(given)
        cl.enqueue_copy(gpu.queue, found, list_)
        np.testing.assert_array_equal(found, np.sort(given), err_msg=str(count))
