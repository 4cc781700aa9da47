"""Transforms of points and normals, in float64.

Sums have a fixed order, which a BLAS would not promise: so the bits are the same on every machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.arrays import AnyArray

Reals = NDArray[np.float64]


def moved(points: AnyArray, matrix: Reals) -> Reals:
    """Return points [..., n, 3] moved by an affine matrix [..., 3 or 4, 4]: one for all points, or one for each."""
    return turned(points, matrix) + matrix[..., :3, 3]


def turned(vectors: AnyArray, matrix: Reals) -> Reals:
    """Return matrix [..., 3, 3] times vectors [..., n, 3]: one matrix for all vectors, or one for each."""
    x, y, z = vectors[..., 0:1], vectors[..., 1:2], vectors[..., 2:3]
    return x * matrix[..., :3, 0] + y * matrix[..., :3, 1] + z * matrix[..., :3, 2]


def cofactors(matrix: Reals) -> tuple[Reals, Reals]:
    """Return the cofactors [..., 3, 3] of matrices, which are the inverse transposes times the determinants [...].

    Both are of the matrices divided by their greatest elements, so that no product leaves the range of float64.
    """
    turn = matrix[..., :3, :3]
    turn = turn / np.abs(turn).max(axis=(-2, -1), keepdims=True)
    found = np.cross(turn[..., [1, 2, 0], :], turn[..., [2, 0, 1], :])
    first = turn[..., 0, :] * found[..., 0, :]
    return found, first[..., 0] + first[..., 1] + first[..., 2]


def product(left: Reals, right: Reals) -> Reals:
    """Return the products [..., 4, 4] of matrices."""
    return (left[..., :, :, None] * right[..., None, :, :]).sum(axis=-2)
