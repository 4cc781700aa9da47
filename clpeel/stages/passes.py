"""Passes: draws a batch as the papers' hardware does, with kernel launches of its own for each step of each pass.

The rasterizer emits the fragments once (stream.py). Every geometry pass then goes over them, and every full-screen pass
over the pixels, in buffers in the device's memory. Atomics stand in for blending hardware (peel_passes.h,
add_passes.h).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.layout import (
    COLOR_BYTES,
    FRAGMENT_BYTES,
    LEFT_OVER,
    PADDING,
    PASSED,
    QUERY_LINES,
    Targets,
)
from clpeel.device.program import Arguments, launch, program, seconds_of
from clpeel.device.records import PEEL_TOTALS
from clpeel.errors import DeviceError
from clpeel.stages.binning import Batch
from clpeel.stages.many_passes import PassRules, most_passes_of
from clpeel.stages.stream import Run, Stream, Window
from clpeel.stages.tiles import Canvas, Drawn, stage_of

UNREAD_PASSES = 1024
"""How many passes are issued before their counts are fetched, where no occlusion query ends them."""

MOST_REPEATS = 1 << 14
"""How often a peel may repeat its pass where writes race. Any scheduler lets a write through long before."""

PLANE_PADDING = 16
"""Places between two planes of a target. Without them a pixel of all planes would fall on the same line of a cache."""

HELD = (
    "screen",
    "side_bits",
    "background",
    "gradient",
    "scales",
    "clamped",
    "image",
    "color",
    "parameters",
    "values",
)
"""Of the arguments that a Canvas gives, those that kernels over pixels and tiles want."""

Key = tuple[int, int]


@dataclass
class Found:
    """What the passes found: for each pass by its key (Drawn.keys) the samples that passed, and its seconds."""

    samples: dict[Key, int] = field(default_factory=dict)
    seconds: dict[Key, float] = field(default_factory=dict)

    def add(self, key: Key, samples: int, events: Sequence[cl.Event] = ()) -> None:
        """Adds what a run of pixels found in the pass. events: the launches of the pass, which are done."""
        self.samples[key] = self.samples.get(key, 0) + samples
        self.seconds[key] = self.seconds.get(key, 0.0) + seconds_of(events)


class Machine:
    """Launches the kernels of a technique over the fragments, the pixels or the tiles of a window.

    path: the technique's kernel file. constants: of its kernels. targets: its render targets. All arguments that a
    kernel may want are in `held`, by the kernels' names for them. fragments, opaque_samples: of the windows so far.
    """

    def __init__(self, canvas: Canvas, path: str, constants: Mapping[str, int], targets: Targets):
        self.canvas, self.gpu = canvas, canvas.gpu
        self.fragments = self.opaque_samples = 0
        self.stage = stage_of(path)
        self._kernels = program(canvas.gpu, path, canvas.triangles.features, **constants)
        self.stream = Stream(canvas, targets, constants)
        self.held: Arguments = {}

    def has(self, name: str) -> bool:
        """Whether there is a kernel of that name."""
        return name in self._kernels

    def over(self, name: str, items: int, lanes: int | None = None) -> cl.Event:
        """Launches a kernel: see program.launch."""
        kernel = self._kernels[name]
        return launch(self.gpu, self.stage, kernel, items, lanes, **{each: self.held[each] for each in kernel.names})

    def over_pixels(self, name: str) -> cl.Event:
        """Launches a kernel that takes a strip of pixels in each work-item."""
        return self.over(name, int(self.held["strips"]))  # type: ignore[arg-type]

    def over_fragments(self, name: str) -> cl.Event:
        """Launches a kernel that takes so many neighbours of the run's fragments in each work-item as a strip has."""
        return self.over(name, -(-int(self.held["count"]) // self.canvas.triangles.features.strip))  # type: ignore[arg-type]

    def over_tiles(self, name: str, window: Window) -> cl.Event:
        """Launches a kernel that takes a tile in each work-group."""
        return self.over(name, window.tiles, self.gpu.lanes)

    def windows(self, batch: Batch) -> Iterator[Window]:
        """Yields the batch's windows, counts what they have, and reports each that is done."""
        at_tile = self.canvas.watch and self.canvas.watch(batch)
        for window in self.stream.windows(batch):
            self.fragments += window.fragments
            self.opaque_samples += window.part.opaque_samples if window.tile == 0 else 0
            yield window
            if at_tile:
                at_tile(window.part.batch.first_tile + window.tile + window.tiles)

    def begin(self, window: Window, parameters: Sequence[float] = ()) -> None:
        """Holds the arguments of the window: the picture, the technique's parameters, and how many pixels there are."""
        own = self.canvas.arguments(window.part.batch, parameters)
        self.held |= {name: own[name] for name in HELD}
        self.held |= {
            "first_tile": window.tile,
            "behind": window.part.behind,
            "pixel_end": window.part.pixel_end,
            "tile_start": window.part.tile_start,
            "strips": window.pixels // self.canvas.triangles.features.strip,
            "plane": window.pixels + PLANE_PADDING,
        }

    def take(self, run: Run) -> None:
        """Holds the arguments of the run: its fragments."""
        self.held |= {
            "first_pixel": run.first_pixel,
            "last_pixel": run.last_pixel,
            "count": run.count,
            "run_start": run.start % 2**32,
            "fragments": run.fragments,
            "pixels": run.pixels,
            "colors_of_fragments": run.colors,
        }


class Peeler(Machine):
    """Peels a batch.

    targets: the technique's render targets. rules, defines, first_passes, parameters: as for many_passes.peel.
    """

    def __init__(
        self,
        canvas: Canvas,
        path: str,
        rules: PassRules,
        defines: Mapping[str, int],
        targets: Targets,
        first_passes: int,
        parameters: Sequence[float],
    ):
        constants = {**defines, **targets.constants, "BY_DEPTH": int(rules.coincident == "paper")}
        super().__init__(canvas, path, {**constants, "ATOMICS_64": int(canvas.gpu.long_atomics)}, targets)
        self.rules, self.targets, self.first_passes, self.parameters = rules, targets, first_passes, parameters

    def draw(self, batch: Batch) -> Drawn:
        """Draws the batch. Raises DeviceError if racing writes never come to an end."""
        most_passes, _ = most_passes_of(batch, self.rules, self.first_passes, None)
        found, ends = Found(), []
        if not self.targets.racing:
            for number in range(1 if self.rules.occlusion_query else most_passes):
                found.add((number, 0), 0)  # also where there is nothing to peel
        for window in self.windows(batch):
            self._begin(window)
            for number, run in enumerate(self.stream.runs(window)):
                self.take(run)
                if number:
                    self._clear(first_run=False)
                (self._race if self.targets.racing else self._peel)(found, most_passes)
            self.over_tiles("merge_layers", window)
            ends.append(self.gpu.get(self.held["tile_totals"], window.tiles, PEEL_TOTALS))
        totals = np.concatenate(ends)
        keys = sorted(found.samples)
        return Drawn(
            fragments=self.fragments,
            layers_max=int(totals["layers"].max()),
            samples_passed=tuple(found.samples[key] for key in keys),
            truncated_pixels=int(totals["truncated"].sum(dtype=np.int64)),
            hidden=float(totals["hidden"].max()),
            opaque_samples=self.opaque_samples,
            pass_seconds=tuple(found.seconds[key] for key in keys),
            pass_keys=tuple(keys),
        )

    def _begin(self, window: Window) -> None:
        """Holds the window's buffers, and clears those that are kept from pass to pass."""
        self.begin(window, self.parameters)
        gpu, targets, pixels = self.gpu, self.targets, window.pixels
        plane = pixels + PLANE_PADDING
        self.held |= {
            "targets": gpu.buffer("targets", FRAGMENT_BYTES * targets.depths * plane),
            "bounds": gpu.buffer("bounds", FRAGMENT_BYTES * targets.bounds * plane),
            "colors": gpu.buffer("color_targets", COLOR_BYTES * targets.colors * pixels),
            "more": gpu.buffer("more", 4 * pixels),
            "layers": gpu.buffer("layers", 4 * pixels),
            "left": gpu.buffer("left", 4 * pixels),
            "tile_totals": gpu.buffer("window_totals", PEEL_TOTALS.itemsize * window.tiles),
        }
        self._clear(first_run=True)
        if not targets.bounds:
            self.over_pixels("clear_targets")

    def _clear(self, first_run: bool) -> None:
        self.held["first_run"] = first_run
        self.over_pixels("begin_picture")

    def _peel(self, found: Found, most_passes: int) -> None:
        """The passes over a run's fragments: until the query finds nothing left, or most_passes of them."""
        number, samples, left = 0, 0, True
        query = self.rules.occlusion_query
        while number < most_passes and (left or not query):
            some = 1 if query else min(UNREAD_PASSES, most_passes - number)
            self._new_query(some)
            events = [list(self._pass(number + turn, turn)) for turn in range(some)]
            counts = self._read_query(some)
            for turn, launches in enumerate(events):
                samples, left = int(counts[turn, PASSED]), bool(counts[turn, LEFT_OVER])
                found.add((number + turn, 0), samples, launches)
            number += some
        if query and samples and number < most_passes:
            found.add((number, 0), 0)  # nothing is left, so that this pass need not be made

    def _pass(self, number: int, turn: int) -> Iterator[cl.Event]:
        """Launches a pass: clear, peel, blend. turn: its place in the query."""
        if self.targets.bounds:
            yield self.over_pixels("clear_targets")
        yield from self._peel_fragments(turn)
        yield self._blend(number)

    def _peel_fragments(self, turn: int) -> Iterator[cl.Event]:
        self.held["turn"] = turn
        for name in ("peel_fragments", "settle"):
            if self.has(name):
                yield self.over_fragments(name)

    def _blend(self, number: int) -> cl.Event:
        """Launches the full-screen pass. The bounds of the next pass are then in place."""
        turns = self.targets.take_turns
        self.held |= {"pass": number, "next": self.held["targets" if turns else "bounds"]}
        event = self.over_pixels("blend_layers")
        if turns:
            self.held |= {"targets": self.held["bounds"], "bounds": self.held["targets"]}
        return event

    def _race(self, found: Found, most_passes: int) -> None:
        """Both loops of Table 1 (Liu, Wei and Xu 2006): a peel is repeated until nothing is written."""
        for peel in range(most_passes):
            clear = [self.over_pixels("clear_targets")]
            for repeat in range(MOST_REPEATS):
                self._new_query(1)
                launches = [*clear, *self._peel_fragments(0)]
                written = int(self._read_query(1)[0, PASSED])
                found.add((peel, repeat), written, launches)
                clear = []
                if written == 0:
                    break
            else:
                raise DeviceError(
                    f"racing_writes: expected a pass that writes nothing, got none in {MOST_REPEATS:,} on "
                    f"{self.gpu.device.name.strip()}; draw without it"
                )
            if repeat == 0:
                return
            self._new_query(1)
            self._blend(peel)

    def _new_query(self, passes: int) -> None:
        self.held["query"] = self.gpu.put("query", np.zeros((passes, QUERY_LINES, PADDING), np.uint32))

    def _read_query(self, passes: int) -> NDArray[np.int64]:
        """Waits for the device. Returns the counts, int64 [passes, 2]."""
        held = self.gpu.get(self.gpu.buffers["query"], (passes, QUERY_LINES, PADDING), np.uint32)
        counts: NDArray[np.int64] = held.sum(axis=1, dtype=np.int64)
        return counts[:, [PASSED, LEFT_OVER]]


def add_up(canvas: Canvas, batch: Batch, path: str, defines: Mapping[str, int], targets: Targets) -> Drawn:
    """Draws the batch with a technique that adds up all fragments in one geometry pass."""
    machine = Machine(canvas, path, {**defines, **targets.constants}, targets)
    gpu, layers_max, seconds = canvas.gpu, 0, 0.0
    for window in machine.windows(batch):
        machine.begin(window)
        machine.held |= {
            "sums": gpu.buffer("color_targets", COLOR_BYTES * window.pixels),
            "depth": gpu.buffer("layers", 4 * window.pixels),
            "tile_layers": gpu.buffer("window_totals", 4 * window.tiles),
        }
        events = [machine.over_pixels("begin_sums")]
        for run in machine.stream.runs(window):
            machine.take(run)
            events.append(machine.over_fragments("count_depth"))
            events.append(machine.over_tiles("blend_in_order", window))
        machine.over_tiles("merge_sums", window)
        layers_max = max(layers_max, int(gpu.get(machine.held["tile_layers"], window.tiles, np.uint32).max()))
        seconds += seconds_of(events)  # they are done, as the layers have been fetched
    samples, opaque = (machine.fragments,), machine.opaque_samples
    return Drawn(machine.fragments, layers_max, samples, opaque_samples=opaque, pass_seconds=(seconds,))
