"""Polygons: meshes whose corners have values of their own, as FBX and USD keep them, as fields of a Scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.corners import Places, fans, split
from clpeel.scene.arrays import AnyArray
from clpeel.scene.normals import distinct


@dataclass(frozen=True, eq=False)
class Varying:
    """What corners have: values [k, w], and which of these each corner has, int64 [c]."""

    values: AnyArray
    index: Places

    @staticmethod
    def of_corners(values: AnyArray) -> Varying:
        """Return the values of corners, [c, w]. Equal ones become one, so that no vertex is split without need."""
        first, kind = distinct(np.ascontiguousarray(np.asarray(values, np.float64).T) + 0.0)
        return Varying(values[first], kind)


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons of points [n, 3]: how many corners each has [f], and the point of each corner [c], int64 both.

    Raises InputError if these do not fit together.
    """

    points: AnyArray
    counts: Places
    corners: Places

    def __post_init__(self) -> None:
        if len(self.counts) and self.counts.min() < 0:
            raise InputError(f"faces: expected numbers of corners, got {self.counts.min()}; the mesh is damaged")
        if self.counts.sum() != len(self.corners):
            raise InputError(
                f"faces: expected {self.counts.sum()} corners, got {len(self.corners)}; the mesh is damaged"
            )
        if len(self.corners) and not (self.corners.min() >= 0 and self.corners.max() < len(self.points)):
            wrong = self.corners.min() if self.corners.min() < 0 else self.corners.max()
            raise InputError(f"faces: expected indices 0..{len(self.points) - 1}, got {wrong}; the mesh is damaged")

    @property
    def face_of_corner(self) -> Places:
        """The polygon of each corner, int64 [c]."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def fields(
        self, varying: dict[str, Varying], kept: AnyArray | None = None, turned: bool = False
    ) -> tuple[dict[str, Any], Places]:
        """Return vertices, faces, polygons and the varying values by name, and the polygon of each triangle [m].

        kept: bool [f], the polygons that are drawn. turned: whether corners run clockwise as their front is seen.
        """
        place, polygon = fans(self.counts)
        if kept is not None and not kept.all():
            place, polygon = place[kept[polygon]], polygon[kept[polygon]]
        at = (place[:, ::-1] if turned else place).reshape(-1)
        source, kinds, index = split(self.corners[at], len(self.points), *(each.index[at] for each in varying.values()))
        own = {name: each.values[kind] for (name, each), kind in zip(varying.items(), kinds, strict=True)}
        return {
            "vertices": self.points[source],
            "faces": index.reshape(-1, 3),
            "polygons": polygon,
            **own,
        }, polygon
