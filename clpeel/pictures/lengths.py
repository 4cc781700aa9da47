"""Lengths in scene units: float32, or float64 if a scene is too large or too small for float32."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Lengths = NDArray[np.float32] | NDArray[np.float64]


def scaled(lengths: NDArray[np.float32], unit: float) -> Lengths:
    """Return a copy of the lengths times a power of two. Unless that is 1, the copy is narrowed."""
    return lengths.copy() if unit == 1 else narrowed(lengths * np.float64(unit))


def narrowed(lengths: NDArray[np.float64]) -> Lengths:
    """Return the lengths as float32 if it can hold all of them in its full precision, else as they are.

    Only finite lengths other than 0 are tested.
    """
    limits = np.finfo(np.float32)
    sizes = np.abs(lengths)
    counted = np.isfinite(sizes) & (sizes > 0)
    least = sizes.min(initial=np.inf, where=counted)
    most = sizes.max(initial=0, where=counted)
    fits = least >= limits.smallest_normal and most <= limits.max
    return lengths.astype(np.float32) if fits else lengths
