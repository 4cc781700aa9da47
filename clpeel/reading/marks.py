"""Marks: scenes of the lines and points in a file, beside that of its faces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.scene import Scene, joined


def marks(
    vertices: AnyArray,
    lines: AnyArray | None = None,
    points: AnyArray | None = None,
    vertex_colors: Colors | None = None,
    vertex_normals: AnyArray | None = None,
    color: Colors | None = None,
    arrays: Mapping[str, AnyArray] | None = None,
) -> Scene | None:
    """Return a scene of these lines [k, 2] and points [p] with the vertices that they use, or None if there are none.

    arrays: by name, of the vertices. The others are as in Scene.from_arrays, which checks them. Raises InputError.
    """
    given = [np.asarray(each) for each in (lines, points) if each is not None and len(each)]
    if not given:
        return None
    scene = Scene.from_arrays(
        vertices,
        lines=lines,
        points=points,
        vertex_colors=vertex_colors,
        vertex_normals=vertex_normals,
        color=color,
    )
    scene = replace(scene, vertex_arrays=dict(arrays or {}))
    used = scene.used
    if used.all():
        return scene
    number = (np.cumsum(used) - 1).astype(np.int32)
    return Scene(
        scene.vertices[used],
        scene.faces,
        vertex_colors=None if scene.vertex_colors is None else scene.vertex_colors[used],
        color=scene.color,
        vertex_normals=None if scene.vertex_normals is None else scene.vertex_normals[used],
        lines=None if scene.lines is None else number[scene.lines],
        points=None if scene.points is None else number[scene.points],
        vertex_arrays={name: array[used] for name, array in scene.vertex_arrays.items()},
    )


def together(scenes: Iterable[Scene | None]) -> Scene | None:
    """Return the scenes that there are as one, or None if there are none."""
    there = [scene for scene in scenes if scene is not None]
    return joined(there) if there else None


def chain(count: int, closed: bool = False) -> AnyArray:
    """Return the segments of a polyline with so many corners, by their places, int64 [k, 2]."""
    at = np.arange(count)
    segments = np.stack([at[:-1], at[1:]], axis=1)
    return np.concatenate([segments, [[count - 1, 0]]]) if closed and count > 1 else segments


def chains(counts: AnyArray) -> AnyArray:
    """Return the segments of polylines with these numbers of corners, which lie one after another, int64 [k, 2]."""
    starts = np.arange(int(counts.sum()))
    last = np.cumsum(counts)[counts > 0] - 1
    begin = np.delete(starts, last)
    return np.stack([begin, begin + 1], axis=1)
