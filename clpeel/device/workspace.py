"""The workspace: a device with its queue, programs, buffers and events. All state of computing is here."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import DTypeLike, NDArray


@dataclass(eq=False)
class Workspace:
    """A device, and everything that is kept on it from one picture to the next.

    lanes: work-items that share a tile. builds: compiled programs, shared by all workspaces of the device. programs:
    kernels by what they were compiled for. events: of the picture's launches, as (stage, kernel, event). sent: what is
    on its way to the device, each with the array that it comes from.
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

    def buffer(self, name: str, nbytes: int) -> cl.Buffer:
        """The buffer of that name, of at least nbytes; it is kept and only ever grows, so frames allocate nothing."""
        held = self.buffers.get(name)
        if held is None or held.size < nbytes:
            self.buffers.pop(name, None)
            if held is not None:
                held.release()
            self.buffers[name] = held = cl.Buffer(self.context, cl.mem_flags.READ_WRITE, max(nbytes, 16))
        return held

    def release(self, *names: str) -> None:
        """Gives the memory of these buffers back, if they are there; nothing may be using them any more."""
        for name in names:
            if name in self.buffers:
                self.buffers.pop(name).release()

    def put(self, name: str, array: NDArray[Any]) -> cl.Buffer:
        """The buffer of that name, filled from the array before anything that is enqueued later; does not wait."""
        held = self.buffer(name, array.nbytes)
        if array.nbytes:
            self.sent.append(cl.enqueue_copy(self.queue, held, np.array(array, order="C"), is_blocking=False))
        return held

    def get(self, held: cl.Buffer, shape: int | tuple[int, ...], dtype: DTypeLike, offset: int = 0) -> NDArray[Any]:
        """The buffer's elements from `offset` bytes on; waits for the device."""
        array = np.empty(shape, dtype)
        cl.enqueue_copy(self.queue, array, held, src_offset=offset, is_blocking=True)
        self.sent.clear()  # the queue is in order: what was sent before has arrived
        return array
