"""Dice: numbers that look random, and are the same bits everywhere: whole-number hashes of a count, nothing else.

NumPy's generators may change from version to version, and functions such as sin from machine to machine. Here are only
operations that IEEE 754 rounds correctly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# SplitMix64 (Steele, Lea and Flood 2014): the step of its count, and the factors of its mixing.
_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


class Dice:
    """A sequence of numbers. Each call goes on where the last one ended."""

    def __init__(self, seed: int) -> None:
        self._seed, self._done = seed, 0

    def words(self, count: int) -> NDArray[np.uint64]:
        """Return the next words of SplitMix64: uint64 [count]."""
        states = np.uint64(self._seed) + _STEP * np.arange(self._done + 1, self._done + count + 1, dtype=np.uint64)
        self._done += count
        mixed = (states ^ (states >> np.uint64(30))) * _FIRST
        mixed = (mixed ^ (mixed >> np.uint64(27))) * _SECOND
        return mixed ^ (mixed >> np.uint64(31))

    def __call__(self, *shape: int, low: float = 0.0, high: float = 1.0) -> Floats:
        """Return numbers low..high: float64 of this shape."""
        unit = (self.words(int(np.prod(shape))) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        return low + (high - low) * unit.reshape(shape)

    def directions(self, count: int) -> Floats:
        """Return unit vectors: float64 [count, 3]. Those towards the corners of a cube are more frequent."""
        return unit(self(count, 3, low=-1.0, high=1.0))

    def order(self, count: int) -> NDArray[np.int64]:
        """Return 0..count - 1 in some order."""
        return np.argsort(self.words(count), kind="stable")


def dot(a: Floats, b: Floats) -> Floats:
    """Return the inner products [..., 1] of vectors [..., 3], added in this order."""
    products = a * b
    return (products[..., :1] + products[..., 1:2]) + products[..., 2:]


def unit(vectors: Floats) -> Floats:
    """Return vectors [..., 3] of length 1. A vector of length 0 stays as it is."""
    lengths = np.sqrt(dot(vectors, vectors))
    return vectors / np.where(lengths > 0, lengths, 1.0)


def smooth(values: Floats) -> Floats:
    """Return the cubic step 3 v^2 - 2 v^3 of values, which are clamped to 0..1."""
    within = np.clip(values, 0.0, 1.0)
    return within * within * (3.0 - 2.0 * within)


def noise(dice: Dice, size: int, cells: int) -> Floats:
    """Return values 0..1 on a grid of so many cells a side, smoothly interpolated: float64 [size, size]. It repeats."""
    corners = dice(cells, cells)
    at = (np.arange(size) + 0.5) * cells / size
    first = at.astype(int) % cells
    part = smooth(at - np.floor(at))
    after = (first + 1) % cells
    rows = corners[first] + (corners[after] - corners[first]) * part[:, None]
    return rows[:, first] + (rows[:, after] - rows[:, first]) * part[None, :]
