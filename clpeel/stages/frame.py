"""The frame: what a technique receives to draw a picture's batches with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from clpeel.device.layout import Targets
from clpeel.stages.binning import Batch
from clpeel.stages.many_passes import PassRules, peel
from clpeel.stages.one_pass import draw_once
from clpeel.stages.opaque import draw_opaque
from clpeel.stages.tiles import Canvas, Drawn


class Peeled(PassRules, Protocol):
    """PassRules, and how colours are blended. The options class Peeling (techniques/peeling.py) fits it.

    max_error: see Frame.once. constants: those of the kernel, such as the precision of its buffers.
    """

    @property
    def max_error(self) -> float | None: ...
    @property
    def constants(self) -> dict[str, int]: ...


@dataclass(frozen=True)
class Frame(Canvas):
    """A canvas, and the ways to draw a batch on it.

    targets: the technique's render targets if it is executed by passes (passes.py), or None if it is by tiles.
    """

    targets: Targets | None = None

    def without_colors(self) -> Frame:
        """The same frame for kernels of a technique that uses no colours, nor a light.

        Where texels route fragments, the scene's colours are kept, as their alphas are factors of what is cut away.
        """
        features = self.triangles.features
        changed = replace(features, headlight=False, lights=False, positioned=False, maps=False, full_highlights=False)
        changed = replace(changed, linear=False)
        if not features.routed:
            changed = replace(changed, color_rate="scene", materials=False, levels=False, probes=1)
        return replace(self, triangles=replace(self.triangles, features=changed))

    def once(
        self,
        batch: Batch,
        kernel: str,
        constants: Mapping[str, int],
        *,
        scratch_bytes: int = 0,
        max_error: float | None = None,
        parameters: Sequence[float] = (),
    ) -> Drawn:
        """Draws the batch in one geometry pass, which goes through each pixel's fragments once (draw_once).

        kernel: a file below kernels/. constants: of the kernel. scratch_bytes: see draw_once. max_error: skip layers
        that cannot change any channel by more, 0..1; None draws all. parameters: the kernel's own numbers; a max_error
        takes their place.
        """
        if self.targets is not None:
            from clpeel.stages.passes import add_up  # few pictures are drawn by passes

            return add_up(self, batch, kernel, constants, self.targets)
        bounds, numbers = _bounded(max_error, parameters)
        return draw_once(self, batch, kernel, {**constants, **bounds}, scratch_bytes, numbers)

    def peel(
        self,
        batch: Batch,
        kernel: str,
        options: Peeled,
        constants: Mapping[str, int] | None = None,
        *,
        first_passes: int = 0,
        layers_a_pass: int | None = None,
        parameters: Sequence[float] = (),
    ) -> Drawn:
        """Draws the batch in as many geometry passes as it needs (many_passes.peel).

        The options' max_error takes the place of `parameters`, if it is not None.
        """
        bounds, numbers = _bounded(options.max_error, parameters)
        defines = {**(constants or {}), **bounds, **options.constants}
        if self.targets is not None:
            from clpeel.stages.passes import Peeler

            peeler = Peeler(self, kernel, options, defines, self.targets, first_passes, numbers)
            return peeler.draw(batch)
        return peel(self, batch, kernel, options, defines, first_passes, layers_a_pass, numbers)

    def opaque(self, batch: Batch, constants: Mapping[str, int]) -> Drawn:
        """Draws a batch of a scene in which nothing is transparent."""
        return draw_opaque(self, batch, constants)


def float32_below(error: float) -> float:
    """The greatest float32 that does not exceed the error."""
    nearest = np.float32(error)
    return float(nearest if float(nearest) <= error else np.nextafter(nearest, np.float32(0)))


def _bounded(max_error: float | None, parameters: Sequence[float]) -> tuple[dict[str, int], Sequence[float]]:
    """The constants and parameters to add for `max_error`: a kernel that skips layers needs it as its parameter."""
    return ({}, parameters) if max_error is None else ({"BOUNDED": 1}, (float32_below(max_error),))
