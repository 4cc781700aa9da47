"""The workspace: a device with its queue, programs, buffers and events. All state on the device is here."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import DTypeLike, NDArray

LONG_ATOMICS = {"cl_khr_int64_base_atomics", "cl_khr_int64_extended_atomics"}


@dataclass(eq=False)
class Workspace:
    """A device, and everything that is kept on it from one picture to the next.

    lanes: work-items that share a tile. builds: compiled programs, shared by all workspaces of the device. programs:
    kernels, by what they were compiled for. buffers: by name. events: the launches of the picture, as (stage, kernel,
    event). sent: copies that may still be on the way to the device; each event keeps its source array alive. launched:
    how many work-items each kernel was last launched with, for those that may have any number. least: how many such
    kernels are launched with at least, by name. PoCL compiles a kernel again for launches of another size.
    """

    device: cl.Device
    context: cl.Context
    queue: cl.CommandQueue
    lanes: int
    builds: dict[Hashable, cl.Program] = field(default_factory=dict)
    programs: dict[Hashable, Any] = field(default_factory=dict)
    buffers: dict[str, cl.Buffer] = field(default_factory=dict)
    events: list[tuple[str, str, cl.Event]] = field(default_factory=list)
    sent: list[cl.Event] = field(default_factory=list)
    launched: dict[str, int] = field(default_factory=dict)
    least: dict[str, int] = field(default_factory=dict)

    def beside(self) -> Workspace:
        """A workspace on the same queue with the same programs, but with buffers of its own.

        It launches kernels with as many work-items as they had here.
        """
        return Workspace(
            self.device, self.context, self.queue, self.lanes, self.builds, self.programs, least=dict(self.launched)
        )

    @property
    def vector_width(self) -> int:
        """How many float32 values a vector of the device has: 8 with AVX2, 16 with AVX-512, 1 on most GPUs."""
        return int(self.device.native_vector_width_float)

    @property
    def long_atomics(self) -> bool:
        """Whether the device compares and exchanges integers of 64 bits atomically."""
        return LONG_ATOMICS <= set(self.device.extensions.split())

    def buffer(self, name: str, nbytes: int) -> cl.Buffer:
        """The buffer of that name, with at least nbytes. It is kept and only grows: later pictures allocate nothing."""
        held = self.buffers.get(name)
        if held is None or held.size < nbytes:
            self.buffers.pop(name, None)
            if held is not None:
                held.release()
            self.buffers[name] = held = cl.Buffer(self.context, cl.mem_flags.READ_WRITE, max(nbytes, 16))
        return held

    def release(self, *names: str) -> None:
        """Frees these buffers, if they exist. No kernel may be using them any more."""
        for name in names:
            if name in self.buffers:
                self.buffers.pop(name).release()

    def put(self, name: str, array: NDArray[Any]) -> cl.Buffer:
        """Copies the array to the buffer of that name. Does not wait; what is enqueued later sees the copy."""
        held = self.buffer(name, array.nbytes)
        if array.nbytes:
            self.sent.append(cl.enqueue_copy(self.queue, held, np.array(array, order="C"), is_blocking=False))
        return held

    def get(self, held: cl.Buffer, shape: int | tuple[int, ...], dtype: DTypeLike, offset: int = 0) -> NDArray[Any]:
        """Copies the buffer's elements from `offset` bytes on to a new array. Waits for the device."""
        array = np.empty(shape, dtype)
        cl.enqueue_copy(self.queue, array, held, src_offset=offset, is_blocking=True)
        self.sent.clear()  # the queue is in order: all earlier copies have arrived
        return array
