"""Corners: what faces of many corners become: triangles, and vertices that are split where their corners differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.arrays import AnyArray

Places = NDArray[np.int64]


def fans(counts: AnyArray) -> tuple[Places, Places]:
    """Return the triangles of faces that lie one after another and have so many corners each.

    Returns the places of the triangles' corners among all corners, [m, 3], and the face of each triangle, [m]. A face
    becomes a fan around its first corner. One of fewer than three corners becomes nothing.
    """
    counts = np.asarray(counts, np.int64)
    if (counts == 3).all():
        return np.arange(3 * len(counts)).reshape(-1, 3), np.arange(len(counts))
    sizes = np.maximum(counts - 2, 0)
    of_face = np.repeat(np.arange(len(counts)), sizes)
    first = (np.cumsum(counts) - counts)[of_face]
    step = np.arange(len(of_face)) - (np.cumsum(sizes) - sizes)[of_face]
    return np.stack([first, first + step + 1, first + step + 2], axis=1), of_face


def split(vertices: Places, count: int, *columns: Places) -> tuple[Places, list[Places], Places]:
    """Return the vertices that corners need which differ in more than their vertex.

    vertices: the vertex of each corner, 0..count-1, [c]. columns: further numbers of each corner, -1 or more, [c].
    Returns the old vertex of each new one [n], the columns for each new vertex [n] (-1 where no corner says it), and
    the new vertex of each corner [c]. Where no vertex needs to be split, the vertices stay as they are, unused ones
    too. Otherwise they are in the order of the old ones.
    """
    tables, key = list[Places](), vertices
    for column in columns:
        table = np.full(count, -1, np.int64)
        table[vertices] = column
        tables.append(table)
        if not np.array_equal(table[vertices], column):
            # Small again each time, so that no product can leave 64 bits.
            key = np.unique(key * (column.max() + 2) + column + 1, return_inverse=True)[1].reshape(-1)
    if key is vertices:
        return np.arange(count), tables, vertices
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    return vertices[first], [column[first] for column in columns], index.reshape(-1)
