"""Tangents: along which u grows on a surface. Maps of normals need them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.scene import Scene


def tangents_of(scene: Scene) -> NDArray[np.float32]:
    """Return a vector of length 1 at every vertex, float32 [n, 3], along which u grows; +X where nothing tells.

    It is the mean over the faces at the vertex, weighted by their area on the surface. Of each face, u is that of the
    set of coordinates by which its material's normal texture lies.
    """
    assert scene.face_materials is not None
    sums = np.zeros(scene.vertices.shape)
    sets = (scene.uv, *scene.more_uv)
    for number, material in enumerate(scene.materials):
        if material.finish is None or material.finish.normal_texture is None:
            continue
        faces = scene.faces[scene.face_materials == number]
        uv = sets[material.finish.normal_uv]
        assert uv is not None
        corners, places = scene.vertices[faces], uv[faces].astype(np.float64)
        with np.errstate(all="ignore"):
            along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
            first, second = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
            grown = first[:, :1] * second[:, 1:] - first[:, 1:] * second[:, :1]
            tangent = np.sign(grown) * (along * second[:, 1:] - across * first[:, 1:])
            area = np.sqrt((np.cross(along, across) ** 2).sum(axis=1, keepdims=True))
            tangent *= area / np.sqrt((tangent**2).sum(axis=1, keepdims=True))
        tangent[~np.isfinite(tangent).all(axis=1)] = 0
        for corner in range(3):
            for axis in range(3):
                sums[:, axis] += np.bincount(faces[:, corner], tangent[:, axis], len(sums))
    with np.errstate(all="ignore"):
        found = sums / np.sqrt((sums**2).sum(axis=1, keepdims=True))
    found[~np.isfinite(found).all(axis=1)] = (1, 0, 0)
    return found.astype(np.float32)
