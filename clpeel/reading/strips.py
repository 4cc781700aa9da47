"""Converts triangle strips and fans to triangles."""

from __future__ import annotations

import numpy as np

from clpeel.scene.arrays import AnyArray


def strip(indices: AnyArray) -> AnyArray:
    """Return the triangles [m, 3] of a strip of indices [n]. Every second one is reversed, so that all wind alike.

    Triangles without area are dropped.
    """
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    faces[1::2] = faces[1::2, [0, 2, 1]]
    return _with_area(faces)


def fan(indices: AnyArray) -> AnyArray:
    """Return the triangles [m, 3] of a fan around the first of indices [n]. Triangles without area are dropped."""
    center = np.broadcast_to(indices[:1], indices[:-2].shape)
    return _with_area(np.stack([center, indices[1:-1], indices[2:]], axis=1))


def _with_area(faces: AnyArray) -> AnyArray:
    """Return the faces whose three indices all differ."""
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]
