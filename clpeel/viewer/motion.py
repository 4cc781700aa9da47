"""Motions: how dragging and turning the wheel move a camera. Each returns the camera moved.

Screen places are in logical pixels, from the top left. `size` is the (width, height) of the screen in the same pixels.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.camera import Camera, Degrees

Place = tuple[float, float]

ACROSS = 200.0
"""Degrees that dragging across the whole screen rotates by, as VTK's trackball does."""

DOLLY = 4.0
"""Dollying over half the screen's height multiplies the distance by this, or divides it."""

WHEEL = 1.0015
"""What a pixel of the wheel multiplies the distance by. A notch of most wheels is 100 pixels."""

NEAREST, FARTHEST = 1e-6, 1e6
"""The least and the greatest distance to the focal point, in radii of the scene."""


def rotated(camera: Camera, by: Place, size: Place) -> Camera:
    """Return the camera after a drag by so many pixels: the scene follows the hand, as if it were a ball."""
    width, height = size
    turned = camera.azimuth(Degrees(-ACROSS * by[0] / width)).elevation(Degrees(ACROSS * by[1] / height))
    return replace(turned, view_up=tuple(turned.axes()[1]))


def pixel(camera: Camera, size: Place) -> float:
    """Return the size of a pixel at the focal point, in world units."""
    return 2 * math.tan(math.radians(camera.view_angle) / 2) * camera.distance / size[1]


def panned(camera: Camera, by: Place, size: Place) -> Camera:
    """Return the camera after a drag by so many pixels: what is at the focal point's distance follows the hand."""
    right, up, _ = camera.axes()
    return _shifted(camera, (up * by[1] - right * by[0]) * pixel(camera, size))


def _shifted(camera: Camera, by: NDArray[np.float64]) -> Camera:
    return replace(camera, position=np.add(camera.position, by), focal_point=np.add(camera.focal_point, by))


def dollied(camera: Camera, by: Place, size: Place, radius: float) -> Camera:
    """Return the camera after a drag by so many pixels: down moves it towards the focal point, up away from it.

    radius: of the scene, in world units; it bounds the distance.
    """
    factor = DOLLY ** (-by[1] / (size[1] / 2))
    away = np.subtract(camera.position, camera.focal_point)
    return replace(camera, position=np.add(camera.focal_point, away * _bounded(camera, factor, radius)))


def zoomed(camera: Camera, wheel: float, at: Place, size: Place, radius: float) -> Camera:
    """Return the camera after the wheel was turned by so many pixels; away from the user, which is negative, is nearer.

    What is at the place `at` of the screen, at the focal point's distance, stays there.
    """
    factor = _bounded(camera, WHEEL**wheel, radius)
    under = point_under(camera, at, size)
    position = under + np.subtract(camera.position, under) * factor
    focal_point = under + np.subtract(camera.focal_point, under) * factor
    return replace(camera, position=position, focal_point=focal_point)


def _bounded(camera: Camera, factor: float, radius: float) -> float:
    """Return the factor, or the one that brings the distance to its bound."""
    return min(max(camera.distance * factor, NEAREST * radius), FARTHEST * radius) / camera.distance


def point_under(camera: Camera, at: Place, size: Place) -> NDArray[np.float64]:
    """Return the point under a place of the screen, at the focal point's distance from the camera."""
    right, up, _ = camera.axes()
    x, y = at[0] - size[0] / 2, size[1] / 2 - at[1]
    return np.asarray(camera.focal_point, np.float64) + (right * x + up * y) * pixel(camera, size)


def through(camera: Camera, at: Place, size: Place) -> Camera:
    """Return a camera whose picture of one pixel is the pixel at this place."""
    seen = pixel(camera, size)
    to = point_under(camera, at, size)
    if camera.orthographic:
        moved = _shifted(camera, to - np.asarray(camera.focal_point, np.float64))
    else:
        moved = replace(camera, focal_point=to)
    angle = 2 * math.degrees(math.atan(seen / 2 / moved.distance))
    return replace(moved, view_angle=Degrees(angle))


def focused(camera: Camera, depth: float, at: Place, size: Place) -> Camera:
    """Return the camera moved so that what lies under a place, so far from the camera, is in the middle of the picture.

    depth: the distance along the ray through that place, in world units. The direction of the view, and the distance to
    the focal point along it, stay as they are.
    """
    ray = through(camera, at, size)
    point = np.asarray(ray.position, np.float64) + ray.axes()[2] * depth
    away = np.subtract(camera.position, camera.focal_point)
    return replace(camera, position=point + away, focal_point=point)
