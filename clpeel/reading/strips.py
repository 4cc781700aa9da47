"""Triangle strips and fans as triangles."""

from __future__ import annotations

import numpy as np

from clpeel.scene.arrays import AnyArray


def strip(indices: AnyArray) -> AnyArray:
    """The triangles [m, 3] of a strip of indices [n]: every second one is turned; those without area are dropped."""
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    faces[1::2] = faces[1::2, [0, 2, 1]]
    return _with_area(faces)


def fan(indices: AnyArray) -> AnyArray:
    """The triangles [m, 3] around the first of indices [n]; those without area are dropped."""
    center = np.broadcast_to(indices[:1], indices[:-2].shape)
    return _with_area(np.stack([center, indices[1:-1], indices[2:]], axis=1))


def _with_area(faces: AnyArray) -> AnyArray:
    """The faces whose three indices differ."""
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]
