"""Duplicate faces: their three corners lie where those of another face do, so their surface is drawn more than once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.arrays import AnyArray

_ODD = [np.uint64(n) for n in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xFF51AFD7ED558CCD)]
"""Odd multipliers, which spread every bit of a coordinate to the higher bits."""


def duplicates(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], single_sided: NDArray[np.bool_] | None = None
) -> NDArray[np.intp]:
    """Return the sorted indices of the faces whose corners lie exactly where those of an earlier face do.

    The corners may be in any order. But of two single-sided faces, back to back, each is seen from its own side alone:
    they are no duplicates, nor are a single-sided face and one that is not.

    vertices: float64 [n, 3]; -0.0 equals 0.0, and NaN equals nothing. faces: int32 [m, 3]. single_sided: bool [m].
    """
    found = _coincident(vertices, faces)
    if single_sided is None or not len(found):
        return found
    side = np.where(single_sided, 1 + _turns_right(vertices, faces), 0)
    groups = [np.flatnonzero(side == each) for each in range(3)]
    return np.sort(np.concatenate([group[_coincident(vertices, faces[group])] for group in groups]))


def _coincident(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.intp]:
    """Return the same as duplicates, where all faces are seen from both sides."""
    points = vertices + 0.0  # turns -0.0 into 0.0, as their bits differ
    corners = _hashes(points)
    candidates = _alike(_sums((corners >> np.uint64(32)).astype(np.uint32), faces))
    keys = _sums(corners, faces[candidates])
    order = np.argsort(keys, kind="stable")  # stable, so that the first of equal faces stays the first
    candidates, keys = candidates[order], keys[order]
    same = _equal_next(keys)
    grouped = np.append(same, False) | np.append(False, same) if len(keys) else np.zeros(0, bool)
    candidates, keys = candidates[grouped], keys[grouped]
    return np.sort(candidates[_repeats(points, corners, faces[candidates], keys)])


def _turns_right(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return of each face which way round its corners run, from the least one, by x, y and z, to the next: bool [m].

    It is the same for faces with the same corners in the same order, whichever of them is first, and else differs.
    """
    a, b, c = vertices[faces].transpose(1, 2, 0)

    def less(p: AnyArray, q: AnyArray) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = p[2] < q[2]
        for axis in (1, 0):
            found = (p[axis] < q[axis]) | ((p[axis] == q[axis]) & found)
        return found

    rises = less(a, b).astype(np.int8) + less(b, c) + less(c, a)
    return rises == 2


def _hashes(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Return a hash of each point. Equal points have equal hashes.

    Different points have different hashes, except by chance. The same holds for the sums of three hashes.
    """
    x, y, z = np.ascontiguousarray(points).view(np.uint64).T
    mixed = x * _ODD[0]
    # The bits must be mixed before the next coordinate is added. Signs are the highest bits, so without mixing two
    # changed signs would cancel out.
    for part, odd in ((y, _ODD[1]), (z, _ODD[2])):
        mixed ^= mixed >> np.uint64(32)
        mixed += part
        mixed *= odd
    mixed ^= mixed >> np.uint64(32)
    mixed *= _ODD[3]
    mixed ^= mixed >> np.uint64(32)
    return mixed


def _sums(corners: AnyArray, faces: NDArray[np.int32]) -> AnyArray:
    """Return the sum of the hashes of each face's three corners. A sum does not depend on their order."""
    first, second, third = corners.take(faces.reshape(-1)).reshape(-1, 3).T
    return first + second + third


def _alike(keys: NDArray[np.uint32]) -> NDArray[np.intp]:
    """Return the indices of all keys that occur more than once, and of a few others.

    The keys have 32 bits, because such keys sort in a third of the time.
    """
    ordered = np.sort(keys)
    marked = np.zeros(2**20, dtype=bool)
    marked[ordered[1:][_equal_next(ordered)] >> np.uint32(12)] = True
    return np.flatnonzero(marked[keys >> np.uint32(12)])


def _equal_next(keys: AnyArray) -> NDArray[np.bool_]:
    """Return whether each key but the last equals the next one."""
    same: NDArray[np.bool_] = keys[1:] == keys[:-1]
    return same


def _repeats(
    points: NDArray[np.float64], corners: NDArray[np.uint64], faces: NDArray[np.int32], keys: NDArray[np.uint64]
) -> NDArray[np.bool_]:
    """Return which faces repeat an earlier face exactly. Faces with equal keys are next to each other."""
    turned = np.take_along_axis(faces, np.argsort(corners[faces], axis=1), axis=1)
    rows = points[turned].reshape(-1, 9)
    repeats: NDArray[np.bool_] = np.zeros(len(rows), dtype=bool)
    repeats[1:] = np.all(rows[1:] == rows[:-1], axis=1)
    whole = ~np.any(np.isnan(rows), axis=1)
    if np.any(_equal_next(keys) & ~repeats[1:] & whole[1:]):  # different faces share a key, so compare all with all
        _, first, group = np.unique(rows.view("V72").reshape(-1), return_index=True, return_inverse=True)
        repeats = (first[group] != np.arange(len(rows))) & whole
    return repeats
