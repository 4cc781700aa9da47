"""Lighting: packs lights for the kernels, as a camera sees them (kernels/shading/lights.h)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import SUBPIXELS
from clpeel.device.records import LAMP, LIGHTING
from clpeel.device.samples import Pattern
from clpeel.scene.camera import Camera
from clpeel.scene.lights import AmbientLight, DirectionalLight, Lamp, PointLight, SpotLight
from clpeel.scene.scene import Positions


def positioned(lights: Sequence[Lamp]) -> bool:
    """Return whether some of the lights have places."""
    return any(isinstance(light, PointLight) for light in lights)


def packed_lights(
    lights: Sequence[Lamp],
    intensity: float,
    camera: Camera,
    grid: Positions,
    clipping: tuple[float, float],
    height: int,
    pattern: Pattern,
) -> NDArray[np.uint8]:
    """Return LIGHTING and, behind it, the LAMPs, as bytes.

    intensity: what all lights are multiplied with. grid: how positions are stored. clipping: view distances of the near
    and the far plane of depths, in scene units. height: of the picture, in samples. pattern: of
    its samples.
    """
    header = np.zeros(1, LIGHTING)
    found = header[0]
    right, up, forward = camera.axes()
    axes = np.stack([right, up, -forward])
    found["right"], found["up"], found["back"] = axes
    half = math.tan(math.radians(camera.view_angle) / 2)
    across = half * camera.distance * grid.scale if camera.orthographic else half
    down = across * 2 / (height * SUBPIXELS)
    found["ray"] = down / pattern.across, down
    near, far = clipping[0] * grid.scale, clipping[1] * grid.scale
    found["near"], found["far"], found["span"], found["perspective"] = near, far, far - near, not camera.orthographic
    around = [light for light in lights if isinstance(light, AmbientLight)]
    zenith, sky, ground = _around(around, axes)
    found["zenith"], found["sky"], found["ground"] = zenith, sky * intensity, ground * intensity
    others = [light for light in lights if not isinstance(light, AmbientLight)]
    found["count"] = len(others)
    lamps = np.zeros(len(others), LAMP)
    for row, light in zip(lamps, others, strict=True):
        row["color"] = np.array(light.color) * (light.intensity * intensity / math.pi)
        if isinstance(light, DirectionalLight):
            own = np.eye(3) if light.follows_camera else axes
            row["toward"], row["shines"] = -(own @ _unit(light.direction)), light.highlights
        else:
            _place(row, light, camera, axes, grid)
    return np.frombuffer(header.tobytes() + lamps.tobytes(), np.uint8)


def _around(
    lights: Sequence[AmbientLight], axes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the zenith in the camera's space, and the light of the sky and of the ground, of all these together.

    Each is a mean light, and a change along its own up. Changes along several ups add up to one along another.
    """
    mean, change = np.zeros(3), np.zeros((3, 3))  # [channel], [channel, axis]
    for light in lights:
        up = np.array([0.0, 1.0, 0.0]) if light.up is None else axes @ _unit(light.up)
        sky, ground = np.array(light.sky) * light.intensity, np.array(light.ground) * light.intensity
        mean += (sky + ground) / 2
        change += np.outer((sky - ground) / 2, up)
    total = change.sum(axis=0)
    zenith = _unit(total) if total.any() else np.array([0.0, 1.0, 0.0])
    along = change @ zenith
    return zenith, mean + along, mean - along


def _place(row: np.void, light: PointLight, camera: Camera, axes: NDArray[np.float64], grid: Positions) -> None:
    """Fill in a LAMP that has a place."""
    row["placed"], row["shines"], row["unit2"] = True, True, grid.scale**2
    row["toward"] = axes @ (np.asarray(light.position) - np.asarray(camera.position)) * grid.scale
    row["inverse_range2"] = 0.0 if light.range is None else 1 / (light.range * grid.scale) ** 2
    row["cone_offset"] = 1.0
    if isinstance(light, SpotLight):
        row["along"] = axes @ _unit(light.direction)
        inner, outer = (math.cos(math.radians(angle)) for angle in (light.inner_angle, light.outer_angle))
        row["cone_scale"] = 1 / (inner - outer)
        row["cone_offset"] = -outer / (inner - outer)


def _unit(vector: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vector at length 1."""
    given = np.asarray(vector, np.float64)
    given = given / np.abs(given).max()
    return np.asarray(given / np.sqrt((given**2).sum()))
