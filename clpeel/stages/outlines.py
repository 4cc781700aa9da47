"""Outlines: the triangles that lines and points are drawn as. Their corners follow the view (stages/expand.cl)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import MOST_WIDTH, SUBPIXELS, PointType
from clpeel.scene.arrays import AnyArray
from clpeel.scene.camera import Camera
from clpeel.scene.normals import distinct
from clpeel.scene.scene import Scene

TOLERANCE = 1 / 8
"""How far the outline of a disc may be off a circle, in samples."""

MOST_SIDES = 128
"""The most sides of a disc. From a radius of 830 samples on its outline is off by more than TOLERANCE."""

MOST_CORNERS = 1 << 25
"""The most corners of discs of a scene. They take less than a GiB. With more, points are squares."""

RIM = 0.35
"""How far the normal at the rim of a ball comes towards the eye, before it is made of length 1.

Between the middle and the rim normals are interpolated. With 0 a ball would look like a cone, as this falls off faster.
"""

SEGMENT_FACES = np.array([[0, 1, 3], [0, 3, 2]])
JOINED_FACES = np.array([[2, 0, 5], [2, 5, 7], [2, 7, 6], [2, 6, 1], [2, 3, 4], [7, 8, 9]])
"""The triangles of a segment without and with joints, by its corners: those of one end, and then those of the other."""


class Length(NamedTuple):
    """A width or size: in samples of a pixel's height, or in scene units."""

    value: float
    in_scene: bool = False

    def half(self, camera: Camera, height: int, near: float) -> tuple[float, float]:
        """Return half of it in subpixels, as a + b * depth.

        height: of the picture in samples. near: the view distance of the plane whose depth is 1, in scene units.
        """
        if not self.in_scene:
            return self.value / 2 * SUBPIXELS, 0.0
        half = self.value / 2 * SUBPIXELS * height / 2 / math.tan(math.radians(camera.view_angle) / 2)
        return (half / camera.distance, 0.0) if camera.orthographic else (0.0, half / near)


class Marks(NamedTuple):
    """How lines and points are drawn."""

    line_width: Length = Length(1.0)
    point_size: Length = Length(1.0)
    point_type: PointType = "square"


PLAIN_MARKS = Marks()
"""Lines a sample wide, and points that are squares of one sample."""


class Shape(NamedTuple):
    """What a point's outline is: a polygon with so many sides.

    ball: it has a corner in the middle, too, and normals of a ball. simplified: whether it is a square because there
    are too many points for what was asked for.
    """

    sides: int = 4
    square: bool = True
    ball: bool = False
    simplified: bool = False

    @property
    def corners(self) -> int:
        """How many corners an outline has."""
        return self.sides + self.ball

    @property
    def faces(self) -> NDArray[np.int64]:
        """The triangles of an outline, by its corners, [t, 3]."""
        if not self.ball:
            at = np.arange(1, self.sides - 1)
            return np.stack([np.zeros_like(at), at, at + 1], axis=1)
        at = np.arange(self.sides)
        return np.stack([np.full_like(at, self.sides), (at + 1) % self.sides, at], axis=1)  # seen from the front

    @property
    def outline(self) -> NDArray[np.float32]:
        """The corners, in radii: x, y down, how much the normal comes towards the eye, and 0. float32 [corners, 4]."""
        found = np.zeros((self.corners, 4))
        if self.square:
            found[:, :2] = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
        else:
            angle = (np.arange(self.sides) + 0.5) * (2 * np.pi / self.sides)
            # The circle lies midway between the corners and the middles of the sides.
            reach = 2 / (1 + math.cos(math.pi / self.sides))
            found[: self.sides, 0], found[: self.sides, 1] = reach * np.cos(angle), reach * np.sin(angle)
        found[: self.sides, 2], found[self.sides :, 2] = RIM, 1
        return found.astype(np.float32)


SQUARE = Shape()


def shape_of(scene: Scene, marks: Marks, camera: Camera, height: int, lit: bool) -> Shape:
    """Return the outline of the scene's points in a picture of so many rows of samples.

    lit: whether there is a light.
    """
    if marks.point_type == "square" or scene.points is None:
        return SQUARE
    sides = _sides(_largest_radius(scene, scene.points, marks.point_size, camera, height))
    shape = Shape(sides, square=False, ball=marks.point_type == "sphere" and lit)
    return shape if shape.corners * len(scene.points) <= MOST_CORNERS else Shape(simplified=True)


def _sides(radius: float) -> int:
    """Return how many sides keep a polygon within TOLERANCE of a circle of this radius, in samples: an even number.

    The polygon is off by radius * tan^2(pi / (2 sides)), see Shape.outline.
    """
    if not radius > TOLERANCE:
        return 4
    sides = math.pi / (2 * math.atan(math.sqrt(TOLERANCE / radius)))
    return min(max(2 * math.ceil(sides / 2), 4), MOST_SIDES)


def _largest_radius(scene: Scene, points: NDArray[np.int32], size: Length, camera: Camera, height: int) -> float:
    """Return the largest radius of a point in front of the camera, in samples, up to MOST_WIDTH / 2."""
    near, _ = camera.depth_range(scene)
    flat, by_depth = size.half(camera, height, near)
    depth = 0.0
    if by_depth:
        forward = camera.axes()[2]
        distance = scene.vertices[points] @ forward - float(np.dot(camera.position, forward))
        nearest = float(np.min(distance, initial=math.inf, where=distance >= near))
        depth = near / nearest
    return min((flat + by_depth * depth) / SUBPIXELS, MOST_WIDTH / 2)


@dataclass(frozen=True, eq=False)
class Outlines:
    """The triangles of a scene's lines and points, as they lie behind its faces and vertices on the device.

    shape: of a point. vertex_of: the scene's vertex that each corner has its colour and normal of, int32 [c]. faces:
    int32 [t, 3], by the numbers that corners have behind the scene's vertices. opaque: bool [t]. lines: int32 [k, 4],
    for each segment the vertex that its neighbour comes from, its own two, and the one that the next one goes to, -1
    where there is none. ends: how many corners an end of a segment has. line_corners, line_faces: how many corners and
    triangles come before those of points. not_finite: how many lines and points are not finite.
    """

    shape: Shape
    vertex_of: NDArray[np.int32]
    faces: NDArray[np.int32]
    opaque: NDArray[np.bool_]
    lines: NDArray[np.int32]
    ends: int
    line_corners: int
    line_faces: int
    not_finite: int

    def marks_of(self, faces: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return which line or point these triangles belong to, counted from the first line on. They count from 0."""
        lines = faces // (len(SEGMENT_FACES) if self.ends == 2 else len(JOINED_FACES))
        points = len(self.lines) + (faces - self.line_faces) // len(self.shape.faces)
        return np.where(faces < self.line_faces, lines, points).astype(np.int32)


def outlines_of(scene: Scene, shape: Shape, finite: NDArray[np.bool_]) -> Outlines | None:
    """Return the outlines of a scene's lines and points, or None if it has none. finite: whether vertices are, [n]."""
    marks = scene.mark_vertices
    if not len(marks):
        return None
    lines = np.zeros((0, 2), np.int32) if scene.lines is None else scene.lines
    points = np.zeros(0, np.int32) if scene.points is None else scene.points
    chained = _chained(scene.vertices, lines)
    joints = bool((chained[:, [0, 3]] >= 0).any())
    ends, of_line = (5, JOINED_FACES) if joints else (2, SEGMENT_FACES)
    line_corners = lines.size * ends
    of_point = shape.faces
    first = len(scene.vertices)
    faces = np.concatenate(
        [
            _repeated(of_line, len(lines), 2 * ends, first),
            _repeated(of_point, len(points), shape.corners, first + line_corners),
        ]
    )
    each = np.repeat([len(of_line), len(of_point)], [len(lines), len(points)])
    return Outlines(
        shape,
        np.concatenate([np.repeat(lines.reshape(-1), ends), np.repeat(points, shape.corners)]),
        faces,
        np.repeat(scene.opaque_marks, each),
        chained,
        ends,
        line_corners,
        len(lines) * len(of_line),
        int(np.count_nonzero(~finite[lines].all(axis=1)) + np.count_nonzero(~finite[points])),
    )


def _repeated(faces: NDArray[np.int64], count: int, apart: int, first: int) -> NDArray[np.int32]:
    """Return so many copies of these triangles, whose corners lie `apart` numbers apart from `first` on, [t, 3]."""
    starts = (first + apart * np.arange(count, dtype=np.int64)).astype(np.int32)
    return (starts[:, None, None] + faces.astype(np.int32)).reshape(-1, 3)


def _chained(vertices: NDArray[np.float64], lines: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the segments with their neighbours, as in Outlines.lines.

    Two segments are neighbours where they have an end at the same place, if no third one has. Segments without length
    are nobody's.
    """
    ends = lines.reshape(-1)
    found = np.full((len(lines), 4), -1, np.int32)
    found[:, 1:3] = lines
    if not len(lines):
        return found
    _, place = distinct(np.ascontiguousarray(vertices[ends].T) + 0.0)  # + 0.0 turns -0.0 into 0.0
    long = np.repeat(place[0::2] != place[1::2], 2)
    several: AnyArray = np.bincount(place[long], minlength=int(place.max()) + 1)
    meeting = np.flatnonzero(long & (several[place] == 2))
    one, other = meeting[np.argsort(place[meeting], kind="stable")].reshape(-1, 2).T
    beyond = found[:, [0, 3]].reshape(-1)
    beyond[one], beyond[other] = ends[other ^ 1], ends[one ^ 1]
    found[:, [0, 3]] = beyond.reshape(-1, 2)
    return found
