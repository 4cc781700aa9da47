"""The frame: what a technique is handed, to draw a picture's batches with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from clpeel.stages.binning import Batch
from clpeel.stages.many_passes import PassRules, peel
from clpeel.stages.one_pass import draw_once
from clpeel.stages.opaque import draw_opaque
from clpeel.stages.tiles import Canvas, Drawn


class Peeled(PassRules, Protocol):
    """As PassRules, and how colours are blended (techniques/peeling.py)."""

    @property
    def max_error(self) -> float | None: ...
    @property
    def constants(self) -> dict[str, int]: ...


class Frame(Canvas):
    """A canvas, and the ways to draw on it."""

    def built_for(self, **features: object) -> Frame:
        """The frame with kernels compiled for other features, such as headlight=False where colours play no part."""
        changed = replace(self.triangles.features, **features)  # type: ignore[arg-type]
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
        """Goes over the batch's geometry once, and through each pixel's fragments once (draw_once).

        max_error: skips layers that can change no channel by more; None draws all. parameters: of kernels that skip
        none.
        """
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
        """Goes over the batch's geometry pass by pass (many_passes.peel)."""
        bounds, numbers = _bounded(options.max_error, parameters)
        defines = {**(constants or {}), **bounds, **options.constants}
        return peel(self, batch, kernel, options, defines, first_passes, layers_a_pass, numbers)

    def opaque(self, batch: Batch, constants: Mapping[str, int]) -> Drawn:
        """Draws a batch of a scene with nothing transparent."""
        return draw_opaque(self, batch, constants)


def float32_below(error: float) -> float:
    """The greatest float32 that is not more than the error."""
    nearest = np.float32(error)
    return float(nearest if float(nearest) <= error else np.nextafter(nearest, np.float32(0)))


def _bounded(max_error: float | None, parameters: Sequence[float]) -> tuple[dict[str, int], Sequence[float]]:
    """The constants and the parameters of a kernel that skips layers, where it is to."""
    return ({}, parameters) if max_error is None else ({"BOUNDED": 1}, (float32_below(max_error),))
