"""The camera: where the picture is taken from, and its matrix for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.layout import SUBPIXELS
from clpeel.scene import Scene

Vector = Sequence[float] | NDArray[np.float64]

AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}

NEAREST_SHARE = 1e-6
"""Near plane of a fitted clipping range, as a share of the far one, where the eye is within the scene. Reversed depth
has the same relative precision at every distance, so a near plane this close costs nothing."""


PLANE_SLACK = 2.0**-22
"""How far the clipping planes reach beyond their depths, relatively (orthographic: of the range). Three roundings to
float32 lie between a point exactly on a plane and its depth: this much keeps it inside."""


@dataclass(frozen=True)
class Camera:
    """A camera in world units, as VTK's.

    position, focal_point, view_up: 3 numbers each. view_angle: degrees, vertical, in (0, 180).
    clipping_range: (near, far) view distances in world units, or None to fit the scene. Orthographic views are
    |position - focal_point| * tan(view_angle / 2) high from the centre up, so that switching keeps the framing.

    Raises InputError when a value is not finite, the position is the focal point, view_up is parallel to the view,
    view_angle is out of range, or near >= far (or near <= 0 in perspective).
    """

    position: Vector
    focal_point: Vector
    view_up: Vector = (0.0, 1.0, 0.0)
    view_angle: float = 30.0
    clipping_range: tuple[float, float] | None = None
    orthographic: bool = False

    def __post_init__(self) -> None:
        for name in ("position", "focal_point", "view_up"):
            object.__setattr__(self, name, tuple(vector3(f"camera {name}", getattr(self, name)).tolist()))
        try:
            angle = float(self.view_angle)
        except (TypeError, ValueError):
            raise InputError(f"camera view_angle: expected degrees, got {self.view_angle!r}") from None
        if not 0 < angle < 180:
            raise InputError(f"camera view_angle: expected degrees between 0 and 180, got {angle:g}")
        object.__setattr__(self, "view_angle", angle)
        if self.clipping_range is not None:
            object.__setattr__(self, "clipping_range", self._checked_range(self.clipping_range))
        self.axes()

    def _checked_range(self, given: Sequence[float]) -> tuple[float, float]:
        try:
            near, far = (float(value) for value in given)
        except (TypeError, ValueError):
            raise InputError(f"camera clipping_range: expected (near, far), got {given!r}") from None
        if not (math.isfinite(near) and math.isfinite(far) and near < far):
            raise InputError(f"camera clipping_range: expected near < far, got {near:g}, {far:g}")
        if near <= 0 and not self.orthographic:
            raise InputError(f"camera clipping_range: expected near > 0 in perspective, got {near:g}")
        return near, far

    @property
    def distance(self) -> float:
        """From the position to the focal point, in world units."""
        return float(np.linalg.norm(np.subtract(self.focal_point, self.position)))

    def axes(self) -> NDArray[np.float64]:
        """Unit vectors right, up and forward: float64 [3, 3], a row each."""
        forward = np.subtract(self.focal_point, self.position)
        length = np.linalg.norm(forward)
        if not (math.isfinite(length) and length > 0):
            raise InputError(f"camera: expected a position away from the focal point, got {self.position} for both")
        forward = forward / length
        up = np.asarray(self.view_up, np.float64)
        up_length = np.linalg.norm(up)
        right = np.cross(forward, up / up_length) if up_length > 0 else np.zeros(3)
        right_length = np.linalg.norm(right)
        if right_length < 1e-9:
            raise InputError(
                f"camera view_up: expected a direction across the view, got {self.view_up}, parallel to the view"
            )
        right = right / right_length
        return np.array([right, np.cross(right, forward), forward])

    @classmethod
    def frame(
        cls,
        scene: Scene,
        direction: str | Vector = "-Z",
        up: str | Vector = "+Y",
        view_angle: float = 30.0,
        *,
        aspect: float = 1.0,
        orthographic: bool = False,
    ) -> Camera:
        """The camera that looks along `direction` and just holds the scene's bounding sphere.

        direction, up: 3 numbers, or an axis such as "-Z". aspect: width / height of the picture; a picture taller than
        wide is framed by its width.
        """
        low, high = scene.bounds
        centre = low + (high - low) / 2
        radius = float(np.linalg.norm((high - low) / 2)) or 1.0
        looking = axis(direction, "camera direction")
        length = np.linalg.norm(looking)
        if not length > 0:
            raise InputError(f"camera direction: expected a direction, got {direction!r}")
        if not 0 < view_angle < 180:
            raise InputError(f"camera view_angle: expected degrees between 0 and 180, got {view_angle:g}")
        half = math.tan(math.radians(view_angle) / 2) * min(aspect, 1.0)
        distance = radius / half if orthographic else radius / math.sin(math.atan(half))
        position = centre - looking / length * distance
        return cls(position, centre, axis(up, "camera up"), view_angle, orthographic=orthographic)

    def azimuth(self, degrees: float) -> Camera:
        """Turned about view_up through the focal point, as VTK's Azimuth."""
        return self._turned(np.asarray(self.view_up, np.float64), degrees, turn_up=False)

    def elevation(self, degrees: float) -> Camera:
        """Turned about the axis to the left through the focal point, as VTK's Elevation: positive looks from above."""
        return self._turned(-self.axes()[0], degrees, turn_up=True)

    def _turned(self, about: NDArray[np.float64], degrees: float, turn_up: bool) -> Camera:
        if not math.isfinite(degrees):
            raise InputError(f"camera angle: expected degrees, got {degrees!r}")
        k = about / np.linalg.norm(about)
        angle = math.radians(degrees)

        def turn(v: NDArray[np.float64]) -> NDArray[np.float64]:  # Rodrigues
            return v * math.cos(angle) + np.cross(k, v) * math.sin(angle) + k * np.dot(k, v) * (1 - math.cos(angle))

        focal = np.asarray(self.focal_point, np.float64)
        arm = np.asarray(self.position, np.float64) - focal
        up = turn(self.axes()[1]) if turn_up else np.asarray(self.view_up, np.float64)
        return replace(self, position=focal + turn(arm), view_up=up)

    def zoom(self, factor: float) -> Camera:
        """Narrower by `factor`, as VTK's Zoom: the view angle is divided by it (orthographic: the view's height)."""
        if not (math.isfinite(factor) and factor > 0):
            raise InputError(f"camera zoom: expected a factor > 0, got {factor!r}")
        if self.orthographic:
            half = math.tan(math.radians(self.view_angle) / 2) / factor
            return replace(self, view_angle=math.degrees(2 * math.atan(half)))
        return replace(self, view_angle=min(self.view_angle / factor, 179.9))

    def fitted_range(self, scene: Scene) -> tuple[float, float]:
        """The clipping range given, or one that holds the scene: (near, far) in world units."""
        if self.clipping_range is not None:
            return self.clipping_range
        corners = np.array(np.meshgrid(*scene.bounds.T, indexing="ij")).reshape(3, -1).T
        distances = (corners - np.asarray(self.position, np.float64)) @ self.axes()[2]
        near, far = float(distances.min()), float(distances.max())
        margin = max((far - near) * 1e-3, abs(far) * 1e-6, self.distance * 1e-9)
        near, far = near - margin, far + margin
        if self.orthographic:
            return near, far
        if far <= 0:  # the whole scene lies behind the eye: nothing to see
            return self.distance * 0.5, self.distance
        return max(near, far * NEAREST_SHARE), far

    def projection(
        self, scene_origin: NDArray[np.float64], scale: float, clipping: tuple[float, float], size: tuple[int, int]
    ) -> tuple[NDArray[np.float32], float, float]:
        """The kernels' matrix for positions (v - scene_origin) * scale, and the depths of the near and far planes.

        Returns float32 [4, 2, 4]: rows x, y, z, w of clip space (projection.cl), each as high and low parts; x and y
        are in subpixels times w from the image's centre, y down; z / w is the reversed depth, 1 at the near plane.
        """
        _, height = size
        near, far = (value * scale for value in clipping)
        eye = (np.asarray(self.position, np.float64) - scene_origin) * scale
        right, up, forward = self.axes()
        half = math.tan(math.radians(self.view_angle) / 2)

        def row(vector: NDArray[np.float64], factor: float = 1.0, offset: float = 0.0) -> list[float]:
            return [*(vector * factor), offset - float(np.dot(vector, eye)) * factor]

        if self.orthographic:
            per_unit = SUBPIXELS * height / 2 / (half * self.distance * scale)
            depth = row(forward, -1 / (far - near), far / (far - near))
            matrix = [row(right, per_unit), row(up, -per_unit), depth, [0.0, 0.0, 0.0, 1.0]]
            depth_far = -PLANE_SLACK
        else:
            per_unit = SUBPIXELS * height / 2 / half
            matrix = [row(right, per_unit), row(up, -per_unit), [0.0, 0.0, 0.0, near], row(forward)]
            depth_far = near / far * (1 - PLANE_SLACK)
        exact = np.array(matrix, np.float64)
        high = exact.astype(np.float32)
        low = (exact - high).astype(np.float32)
        return np.stack([high, low], axis=1), 1 + PLANE_SLACK, float(np.float32(depth_far))


def vector3(name: str, value: Vector) -> NDArray[np.float64]:
    """Three finite numbers, or InputError."""
    try:
        vector = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected 3 numbers, got {value!r}") from None
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name}: expected 3 finite numbers, got {value!r}")
    return vector


def axis(value: str | Vector, name: str) -> NDArray[np.float64]:
    """A direction given as an axis ("-Z", "+Y", "X") or as three numbers."""
    if not isinstance(value, str):
        return vector3(name, value)
    letter = value[-1:].upper()
    if letter not in AXES or value[:-1] not in ("", "+", "-"):
        raise InputError(f"{name}: expected an axis such as -Z or +Y, or 3 numbers, got {value!r}")
    return np.array(AXES[letter]) * (-1.0 if value[0] == "-" else 1.0)
