"""Edges of a scene's faces: which faces meet at them, and which of them are features."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.normals import distinct
from clpeel.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of a scene's faces, each once, whatever the vertices are that lie at the same places.

    ends: int32 [e, 2], a vertex at either end. faces: int32 [e, 2], the first two faces that meet there, -1 where there
    is no second one. apexes: int32 [e, 2], the vertices of these across from it, or -1. alike: bool [e], whether the
    second face runs along the edge in the direction of `ends`, as the first does; not so in meshes that wind one way.
    of_face: int32 [m, 3], the edges from each corner of a face to the next one, -1 in faces without extent, which have
    none. places: int32 [n], the same number for all vertices at one place. inner: bool [e], whether both faces are of
    one polygon (Scene.polygons), so that it is no edge of that. bend: float32 [e], radians, the angle between the
    normals of the two faces that meet there; pi where it is not two that meet; 0 if one has no normal.
    """

    ends: NDArray[np.int32]
    apexes: NDArray[np.int32]
    faces: NDArray[np.int32]
    alike: NDArray[np.bool_]
    of_face: NDArray[np.int32]
    places: NDArray[np.int32]
    inner: NDArray[np.bool_]
    bend: NDArray[np.float32]

    def features(self, angle: float) -> NDArray[np.bool_]:
        """Return which edges are features, bool [e]: their faces bend by more than so many degrees, or are not two."""
        return (self.bend > np.float32(math.radians(angle))) & ~self.inner


def edges_of(scene: Scene) -> Edges:
    """Return the edges of a scene's faces."""
    vertices, faces = scene.vertices, scene.faces
    _, found = distinct(np.ascontiguousarray(vertices.T) + 0.0)  # + 0.0 turns -0.0 into 0.0
    places = found.astype(np.int32)
    corners = places[faces]
    whole = (corners != corners[:, [1, 2, 0]]).all(axis=1)
    used = np.flatnonzero(whole)
    start, end, apex = (faces[used][:, turn].reshape(-1) for turn in ([0, 1, 2], [1, 2, 0], [2, 0, 1]))
    low, high = np.minimum(places[start], places[end]), np.maximum(places[start], places[end])
    kinds, kind = np.unique(low.astype(np.int64) * len(vertices) + high, return_inverse=True)
    of_face = np.full(faces.shape, -1, np.int32)
    of_face[used] = kind.reshape(-1, 3)
    # A side of a face is its number among `used`, times 3, plus the corner that it begins at. Faces that lie where an
    # earlier one lies add no sides to an edge: as a second skin, they are no reason to draw it.
    earliest, _ = distinct(np.ascontiguousarray(np.sort(corners[used], axis=1).T.astype(np.float64)))
    sides = (3 * np.sort(earliest)[:, None] + np.arange(3)).reshape(-1)
    sides = sides[np.argsort(kind.reshape(-1)[sides], kind="stable")]
    count = np.bincount(kind.reshape(-1)[sides], minlength=len(kinds))
    first = np.cumsum(count) - count
    one, other = sides[first], sides[np.minimum(first + 1, max(len(sides) - 1, 0))]
    ends = np.stack([start[one], end[one]], axis=1)
    apexes = np.stack([apex[one], np.where(count > 1, apex[other], -1)], axis=1)
    alike = places[start[one]] == places[start[other]]
    bend = _bend(vertices, faces[used], one // 3, other // 3, alike)  # such faces wind in opposite ways
    bend[count != 2] = math.pi
    two = np.stack([used[one // 3], np.where(count > 1, used[other // 3], -1)], axis=1).astype(np.int32)
    inner = np.zeros(len(ends), np.bool_)
    if scene.polygons is not None:
        inner = (count == 2) & (scene.polygons[two[:, 0]] == scene.polygons[two[:, 1]])
    return Edges(ends, apexes, two, alike, of_face, places, inner, bend)


def _bend(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    one: NDArray[np.int64],
    other: NDArray[np.int64],
    turned: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Return the angles between the normals of pairs of faces, in radians. turned: where the second is turned round."""
    with np.errstate(all="ignore"):
        corner = vertices[faces] - vertices[faces[:, :1]]
        corner /= np.abs(corner).max(axis=(1, 2), keepdims=True)  # so that no product overflows
        normals = np.cross(corner[:, 1], corner[:, 2])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        a, b = normals[one], normals[other]
        b[turned] *= -1
        # The angle between vectors of length 1, right even where it is small (Kahan).
        angle = 2 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    found: NDArray[np.float32] = np.nan_to_num(angle, nan=0.0).astype(np.float32)
    return found
