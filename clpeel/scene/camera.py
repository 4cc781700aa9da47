"""The camera: where the picture is taken from, and its matrix for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import AXES, VIEWS, named_view, whole_number
from clpeel.errors import InputError
from clpeel.scene.scene import Scene

Vector = Sequence[float] | NDArray[np.float64]


NEAREST_SHARE = 1e-6
"""The nearest near plane of a fitted range, as a share of the far plane's distance, if the eye is inside the scene.

Reversed depth has the same relative precision at every distance. So a near plane this close costs no precision."""


NEAREST_DEPTH = 2.0**-64
"""The nearest near plane of a range that the user gives, as a share of the scene's farthest distance.

Positions have 48 bits, so nothing closer to the eye has a place of its own. Depths down to this share also keep their
full precision in float32."""

LEAST_SHARE = 2.0**-12
"""The least share of a given orthographic range that the scene may take up. A longer range is cut to the scene.

At this share, half of the depths' bits are left for the scene."""


THINNEST_SLICE = 2.0**-40
"""The thinnest orthographic range, as a share of the scene's extent. Positions of 48 bits hardly allow less."""


FLAT = 1e-6
"""A scene is flat if it is no thicker than this share of its extent."""

ABOVE = 0.1
"""A view counts as looking straight down or up if the sine of its angle to the vertical is at most this."""

SAMPLE_FACES = 1000
"""The number of faces to sample first. In most scenes, however large, they already show that the scene is not flat."""


class Degrees(float):
    """An angle in degrees that has already been checked, or was computed from one.

    It is not checked again, so that a computed angle is never refused.
    """


def checked_degrees(name: str, value: float) -> Degrees:
    """Return value, in degrees, as a number. Raises InputError if it is none, or if it seems to be in radians.

    It seems to be in radians if it equals a multiple of half a degree, in radians, to nine digits, for up to one turn
    either way. Nobody means pi / 6 degrees, for example.
    """
    if isinstance(value, Degrees):
        return value
    try:
        angle = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected degrees, got {value!r}") from None
    halves = abs(angle) / math.radians(0.5)
    if 0.5 < halves < 720.5 and abs(halves - round(halves)) <= 1e-9 * halves:
        meant = math.copysign(round(halves) / 2, angle)
        raise InputError(
            f"{name}: expected degrees, got {angle:.4g}, which is {meant:g} degrees in radians; use math.degrees(...)"
        )
    return Degrees(angle)


def checked_view_angle(value: float) -> Degrees:
    """Return value as checked_degrees does. Raises InputError also unless it is between 0 and 180."""
    angle = checked_degrees("camera view_angle", value)
    if not 0 < angle < 180:
        raise InputError(f"camera view_angle: expected degrees between 0 and 180, got {angle:g}")
    return angle


@dataclass(frozen=True)
class Camera:
    """A camera in world units, with the same meaning as VTK's.

    position, focal_point, view_up: 3 numbers each. view_angle: degrees, vertical, in (0, 180). clipping_range: view
    distances (near, far) in world units, or None to fit the scene. From its centre up, an orthographic view reaches
    |position - focal_point| * tan(view_angle / 2), so that the framing stays the same in both modes.

    Raises InputError if a value is not finite, the position is the focal point, view_up is parallel to the view,
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
        object.__setattr__(self, "view_angle", checked_view_angle(self.view_angle))
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
        """The distance from the position to the focal point, in world units."""
        return length_of(np.subtract(self.focal_point, self.position))

    def axes(self) -> NDArray[np.float64]:
        """Return the unit vectors right, up and forward: float64 [3, 3], one per row."""
        forward = np.subtract(self.focal_point, self.position)
        length = length_of(forward)
        if not (math.isfinite(length) and length > 0):
            raise InputError(f"camera: expected a position away from the focal point, got {self.position} for both")
        forward = forward / length
        up = np.asarray(self.view_up, np.float64)
        up_length = length_of(up)
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
        direction: str | Vector | None = None,
        up: str | Vector | None = None,
        view_angle: float = 30.0,
        *,
        aspect: float = 1.0,
        orthographic: bool = False,
    ) -> Camera:
        """Return the camera that looks along `direction` and just holds the bounding sphere of the scene's box.

        direction, up: 3 numbers, or an axis such as "-Z"; by default +Y is up. direction may also name a view as
        PyVista does: "iso", "xy", "xz", "yz", "yx", "zx" or "zy", or with a minus from the other side, such as "-xy".
        Unless up is given, the name says what is up, too. view_angle: degrees. aspect: width / height of the picture; a
        picture that is taller than wide is framed by its width. Without a direction, the camera looks where `front`
        says, which is along -Z for up +Y. A flat scene is the exception: the camera then looks straight at its face,
        from the side that is nearest to the front. Raises InputError if any of these is invalid.
        """
        low, high = scene.bounds
        centre = low + (high - low) / 2
        radius = length_of((high - low) / 2) or 1.0
        named = named_view(direction) if isinstance(direction, str) else None
        if named is not None:
            direction = named[0]
            up = named[1] if up is None else up
        view_up = axis("+Y" if up is None else up, "camera up")
        if direction is None:
            looking, view_up = default_view(scene, view_up)
        else:
            looking = axis(direction, "camera direction")
        length = length_of(looking)
        if not length > 0:
            raise InputError(f"camera direction: expected a direction, got {direction!r}")
        view_angle = checked_view_angle(view_angle)
        half = math.tan(math.radians(view_angle) / 2) * min(aspect, 1.0)
        distance = radius / half if orthographic else radius / math.sin(math.atan(half))
        position = centre - looking / length * distance
        return cls(position, centre, view_up, view_angle, orthographic=orthographic)

    def azimuth(self, degrees: float) -> Camera:
        """Return the camera turned about view_up through the focal point, as VTK's Azimuth does. Raises InputError."""
        angle = checked_degrees("camera azimuth", degrees)
        return self._turned(np.asarray(self.view_up, np.float64), angle, turn_up=False)

    def elevation(self, degrees: float) -> Camera:
        """Return the camera turned about its left axis through the focal point, as VTK's Elevation does.

        A positive angle looks from above. Raises InputError.
        """
        return self._turned(-self.axes()[0], checked_degrees("camera elevation", degrees), turn_up=True)

    def orbit(self, count: int, degrees: float = 360.0, about: str | Vector | None = None) -> list[Camera]:
        """Return `count` cameras that go around the focal point, evenly, from this one on.

        about: what they turn about, an axis such as "+Z" or 3 numbers; by default view_up. Then they are those of
        `azimuth`. degrees: of all of them together. Whole turns end one step before this camera, so that they can be
        repeated; others end at `degrees`. Below 0 they go the other way round. Raises InputError.
        """
        count = whole_number("camera orbit", count, 1 << 31)
        total = checked_degrees("camera orbit", degrees)
        about = axis(self.view_up if about is None else about, "camera orbit")
        if not length_of(about) > 0:
            raise InputError(f"camera orbit: expected an axis to turn about, got {about.tolist()}")
        steps = count if total % 360 == 0 else max(count - 1, 1)
        turn_up = bool(np.cross(about, self.view_up).any())
        angles = (Degrees(total * k / steps) for k in range(count))
        return [self._turned(about, angle, turn_up) if angle else self for angle in angles]

    def _turned(self, about: NDArray[np.float64], degrees: float, turn_up: bool) -> Camera:
        if not math.isfinite(degrees):
            raise InputError(f"camera angle: expected degrees, got {degrees!r}")
        k = about / length_of(about)
        angle = math.radians(degrees)

        def turn(v: NDArray[np.float64]) -> NDArray[np.float64]:  # Rodrigues' rotation formula
            return v * math.cos(angle) + np.cross(k, v) * math.sin(angle) + k * np.dot(k, v) * (1 - math.cos(angle))

        focal = np.asarray(self.focal_point, np.float64)
        arm = np.asarray(self.position, np.float64) - focal
        up = turn(self.axes()[1]) if turn_up else np.asarray(self.view_up, np.float64)
        return replace(self, position=focal + turn(arm), view_up=up)

    def zoom(self, factor: float) -> Camera:
        """Return the camera with its view angle divided by `factor`, as VTK's Zoom does. Raises InputError.

        In an orthographic view, the height of the view is divided instead.
        """
        if not (math.isfinite(factor) and factor > 0):
            raise InputError(f"camera zoom: expected a factor > 0, got {factor!r}")
        if self.orthographic:
            half = math.tan(math.radians(self.view_angle) / 2) / factor
            return replace(self, view_angle=Degrees(math.degrees(2 * math.atan(half))))
        return replace(self, view_angle=Degrees(min(self.view_angle / factor, 179.9)))

    def depth_range(self, scene: Scene, least_share: float = LEAST_SHARE) -> tuple[float, float]:
        """Return the view distances between which depths are resolved: (near, far) in world units.

        This is the fitted range, or the one that was given. A given range may begin or end so far beyond the scene that
        float32 cannot resolve the scene within it: all depths would be equal, or the near plane would be zero. The
        range is then cut to the scene, which changes nothing visible. least_share: the least share of a given range
        that the scene must take up before the range is cut. It matters in orthographic views only, because their depths
        are spaced evenly.
        """
        near, far = self.fitted_range(scene)
        if self.clipping_range is None:
            return near, far
        nearest, farthest = replace(self, clipping_range=None).fitted_range(scene)
        extent = farthest - nearest
        if not self.orthographic:
            near = max(min(near, 2 * farthest), farthest * NEAREST_DEPTH)
            return near, far if far > near else 2 * near
        if extent / least_share >= far - near:
            return near, max(far, near + extent * THINNEST_SLICE)
        if near > farthest:  # nothing is visible, so any range behind the scene will do if float32 can hold it
            near = min(near, farthest + extent)
            return near, near + extent
        if far < nearest:
            far = max(far, nearest - extent)
            return far - extent, far
        return max(near, nearest), min(far, farthest)

    def fitted_range(self, scene: Scene) -> tuple[float, float]:
        """Return the given clipping range, or else one that holds the scene: (near, far) in world units."""
        if self.clipping_range is not None:
            return self.clipping_range
        near, far = self.view_distances(scene)
        margin = max((far - near) * 1e-3, abs(far) * 1e-6, self.distance * 1e-9)
        near, far = near - margin, far + margin
        if self.orthographic:
            return near, far
        if far <= 0:  # the whole scene is behind the eye, so nothing is visible
            return self.distance * 0.5, self.distance
        return max(near, far * NEAREST_SHARE), far

    def view_distances(self, scene: Scene) -> tuple[float, float]:
        """Return the least and the greatest distance, along the view axis, of the corners of the scene's bounds."""
        corners = np.array(np.meshgrid(*scene.bounds.T, indexing="ij")).reshape(3, -1).T
        distances = (corners - np.asarray(self.position, np.float64)) @ self.axes()[2]
        return float(distances.min()), float(distances.max())


GivenCamera = Camera | str | Sequence[Vector]
"""What may stand for a camera: one, the name of a view, or (position, focal point, view up) as PyVista has them."""


def checked_camera(scene: Scene, given: GivenCamera | None, aspect: float) -> Camera:
    """Return the camera that was given, or the one that has all of the scene in view. Raises InputError.

    given: see GivenCamera; None for the default view. aspect: width / height of the picture.
    """
    if given is None or isinstance(given, str):
        return Camera.frame(scene, given, aspect=aspect)
    if isinstance(given, Camera):
        return given
    try:
        position, focal_point, view_up = given
    except (TypeError, ValueError):
        raise InputError(
            "camera: expected a clpeel.Camera, a view such as 'iso' or 'xy', or (position, focal point, view up), "
            f"got {type(given).__name__}"
        ) from None
    return Camera(position, focal_point, view_up)


# --- where to look by default -----------------------------------------------------------------------------------------


def front(up: Vector) -> NDArray[np.float64]:
    """Return where a camera looks by default. This is f3d's rule: along -Z if up is +Y, along +Y if up is +Z."""
    x, y, z = up
    right = (1.0, 0.0, 0.0) if abs(x) < max(abs(y), abs(z)) else (0.0, -1.0 if x > 0 else 1.0, 0.0)
    return np.cross(up, right)


def default_view(scene: Scene, up: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the default direction to look in, and what is up in the picture.

    The camera looks to the front, or straight at the face of a flat scene. A flat scene is seen from its side that is
    nearest to the front. If both sides are equally near, it is seen from above, or else from the right.
    """
    if not up.any():
        return np.array([0.0, 0.0, -1.0]), up  # Camera refuses this
    up_length = length_of(up)
    usual = front(up / up_length)
    usual /= np.linalg.norm(usual)
    normal = flat_normal(scene)
    if normal is None:
        return usual, up
    ways = (usual, -up / up_length, np.cross(up / up_length, usual))
    side = next(along for way in ways if abs(along := float(normal @ way)) > FLAT)
    looking = normal * math.copysign(1.0, side)
    if np.linalg.norm(np.cross(looking, up / up_length)) > ABOVE:
        return looking, up
    return looking, usual if looking @ up < 0 else -usual


def flat_normal(scene: Scene) -> NDArray[np.float64] | None:
    """Return the unit normal of the plane that contains the scene. None if there is no such plane, or many (a line)."""
    low, high = scene.bounds
    half = high / 2 - low / 2
    size = float(half.max())
    if not 0 < size < math.inf:
        return None

    def extents(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the extents of points [n, 3] along their principal axes, least first, and these axes as columns."""
        points = (points[np.isfinite(points).all(axis=1)] - (low / 2 + high / 2)) / size
        if not len(points):
            return np.zeros(3), np.eye(3)
        centred = points - points.mean(axis=0)
        _, axes = np.linalg.eigh(centred.T @ centred)
        return np.ptp(centred @ axes, axis=0), axes

    some = scene.faces[:: max(len(scene.faces) // SAMPLE_FACES, 1)]
    if len(some) < len(scene.faces):
        found, _ = extents(scene.vertices[some.reshape(-1)])
        if found[0] > 10 * FLAT:  # with a margin of 10, as the plane of the sample is not exactly the plane of all
            return None
    used = scene.used
    found, axes = extents(scene.vertices if used.all() else scene.vertices[used])
    if found[0] > FLAT * found.max() or found[1] <= FLAT * found.max():
        return None
    normal = axes[:, 0]
    normal = np.where(np.abs(normal) < FLAT, 0.0, normal)
    return normal / np.linalg.norm(normal)


# --- checks -----------------------------------------------------------------------------------------------------------


def length_of(vector: NDArray[np.float64]) -> float:
    """Return the length of a vector, even if its squares are outside the range of float64."""
    with np.errstate(over="ignore", under="ignore"):
        length = float(np.linalg.norm(vector))
    return length if 0 < length < math.inf else math.hypot(*vector)


def vector3(name: str, value: Vector) -> NDArray[np.float64]:
    """Return three finite numbers, or raise InputError."""
    try:
        vector = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected 3 numbers, got {value!r}") from None
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name}: expected 3 finite numbers, got {value!r}")
    return vector


def axis(value: str | Vector, name: str) -> NDArray[np.float64]:
    """Return the direction of an axis ("-Z", "+Y", "X") or of three numbers. Raises InputError."""
    if not isinstance(value, str):
        return vector3(name, value)
    letter = value[-1:].upper()
    if letter not in AXES or value[:-1] not in ("", "+", "-"):
        words = f", {', '.join(VIEWS)}" if name.endswith("direction") else ""
        raise InputError(f"{name}: expected an axis such as -Z or +Y{words}, or 3 numbers, got {value!r}")
    return np.array(AXES[letter]) * (-1.0 if value[0] == "-" else 1.0)
