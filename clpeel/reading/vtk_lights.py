"""VTK's lights: as lights of a scene, as bright as they are there on a white surface that faces the camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.camera import Camera
from clpeel.scene.lights import AmbientLight, DirectionalLight, Lamp, PointLight, SpotLight
from clpeel.scene.textures import linear

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Light:
    """A light as VTK has it.

    color: display-referred, times its intensity. direction: where it goes, in the scene, or in the camera's space if it
    follows the camera. facing: the cosine at a surface in the scene's centre that faces the camera. position, distance:
    its place, and how far the centre is from there; None if it is far away. cone: half its angle, in degrees.
    """

    color: Reals
    direction: Reals
    follows_camera: bool
    facing: float
    position: Reals | None = None
    distance: float = 1.0
    cone: float = 90.0


def lamps(lights: Sequence[Any], camera: Camera, center: Reals, shiny: bool) -> tuple[Lamp, ...]:
    """Return VTK's lights that are on as lights of a scene.

    center: of what is drawn, scene units. shiny: whether any surface has highlights.

    VTK adds light and multiplies it with colours that are display-referred, and clpeel does so with linear ones. So no
    light can look alike at all angles. All of them are multiplied by what makes a white surface that faces the camera
    as bright as VTK draws it. A light with a place has inverse squares, and is as bright as VTK's at the centre.
    """
    found = [_light(light, camera, center) for light in lights if light.GetSwitch()]
    if not found:
        return (AmbientLight(intensity=0.0),)
    shown: Reals = np.sum([light.color * max(light.facing, 0.0) for light in found], axis=0)
    share = np.where(shown > 0, linear(shown) / np.maximum(shown, 1e-30), 1.0)
    return tuple(_lamp(light, share, shiny) for light in found)


def is_headlight(lights: Sequence[Any]) -> bool:
    """Return whether the only light is a white one at the camera."""
    on = [light for light in lights if light.GetSwitch()]
    return len(on) == 1 and bool(on[0].LightTypeIsHeadlight()) and (_color(on[0]) == 1).all()


def _color(light: Any) -> Reals:
    return np.asarray(light.GetDiffuseColor(), np.float64) * light.GetIntensity()


def _light(light: Any, camera: Camera, center: Reals) -> _Light:
    color = np.clip(_color(light), 0, None)
    if light.LightTypeIsHeadlight():
        return _Light(color, np.array([0.0, 0.0, -1.0]), True, 1.0)
    along = np.subtract(light.GetFocalPoint(), light.GetPosition())
    if light.LightTypeIsCameraLight():  # VTK's camera is at (0, 0, 1) there, and looks at the origin
        return _Light(color, along, True, float(-along[2] / np.linalg.norm(along)))
    along = np.subtract(light.GetTransformedFocalPoint(), light.GetTransformedPosition())
    forward = camera.axes()[2]
    if not light.GetPositional():
        return _Light(color, along, False, float(along @ forward / np.linalg.norm(along)))
    place = np.asarray(light.GetTransformedPosition(), np.float64)
    reach = center - place
    distance = float(np.linalg.norm(reach)) or 1.0
    return _Light(color, along, False, float(reach @ forward / distance), place, distance, float(light.GetConeAngle()))


def _lamp(light: _Light, share: Reals, shiny: bool) -> Lamp:
    red, green, blue = (float(value) for value in light.color * share)
    x, y, z = (float(value) for value in light.direction)
    color, direction = (red, green, blue), (x, y, z)
    if light.position is None:
        return DirectionalLight(
            direction=direction,
            color=color,
            intensity=math.pi,
            follows_camera=light.follows_camera,
            highlights=shiny,
        )
    px, py, pz = (float(value) for value in light.position)
    intensity = math.pi * light.distance**2
    if light.cone >= 90:
        return PointLight(position=(px, py, pz), color=color, intensity=intensity)
    inner = max(light.cone - 1.0, light.cone / 2)
    return SpotLight(
        position=(px, py, pz),
        color=color,
        intensity=intensity,
        direction=direction,
        inner_angle=inner,
        outer_angle=light.cone,
    )
