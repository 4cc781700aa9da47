"""Lights: what falls on a scene. A renderer has a kit of them, and a scene may have its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from clpeel.errors import InputError
from clpeel.scene.textures import linear_color

Rgb = tuple[float, float, float]
Vector = tuple[float, float, float]

WHITE: Rgb = (1.0, 1.0, 1.0)


def _check_colors(light: object, *names: str) -> None:
    """Raise InputError unless these fields of a light are linear RGB, 0 or more. Text, such as "gold", becomes that."""
    for name in names:
        color = getattr(light, name)
        if isinstance(color, str):
            color = linear_color(name, color)[:3]
            object.__setattr__(light, name, color)
        if len(color) != 3 or not all(0 <= value < math.inf for value in color):
            raise InputError(f"color: expected R,G,B of 0 or more, got {color}")


def _check_intensity(value: float) -> None:
    if not 0 <= value < math.inf:
        raise InputError(f"intensity: expected a number of 0 or more, got {value}")


def _check_vector(name: str, vector: Vector, zero: bool = False) -> None:
    """Raise InputError unless this is a finite vector. zero: whether it may be of length 0."""
    if len(vector) != 3 or not all(math.isfinite(value) for value in vector) or not (zero or any(vector)):
        raise InputError(f"{name}: expected X,Y,Z{'' if zero else ', not all of them 0'}, got {vector}")


@dataclass(frozen=True, kw_only=True)
class AmbientLight:
    """Light from all around: `sky` from above, `ground` from below, linear RGB or text, and evenly between them.

    A white matt surface in light of 1 from everywhere is white. up: where the sky is; None for the camera's up.
    Raises InputError if a number is wrong.
    """

    sky: Rgb = WHITE
    ground: Rgb = WHITE
    intensity: float = 1.0
    up: Vector | None = None

    def __post_init__(self) -> None:
        _check_colors(self, "sky", "ground")
        _check_intensity(self.intensity)
        if self.up is not None:
            _check_vector("up", self.up)


@dataclass(frozen=True, kw_only=True)
class DirectionalLight:
    """Light from far away, as of the sun (KHR_lights_punctual).

    direction: where it goes. intensity: in lux, so that a white matt surface that faces a light of pi is white. color:
    linear RGB, or text such as "gold". follows_camera: whether the direction is in the camera's space: x to the right,
    y up, z towards the camera. highlights: whether it is mirrored. Raises InputError if a number is wrong.
    """

    direction: Vector
    color: Rgb = WHITE
    intensity: float = 1.0
    follows_camera: bool = False
    highlights: bool = True

    def __post_init__(self) -> None:
        _check_colors(self, "color")
        _check_intensity(self.intensity)
        _check_vector("direction", self.direction)


@dataclass(frozen=True, kw_only=True)
class PointLight:
    """Light from a place to all sides (KHR_lights_punctual).

    position: in scene units. intensity: in candela, of which light / distance^2 is left at a distance, counted in scene
    units. color: linear RGB, or text. range: the distance that it does not reach beyond; None if there is none. Raises
    InputError if a number is wrong.
    """

    position: Vector
    color: Rgb = WHITE
    intensity: float = 1.0
    range: float | None = None

    def __post_init__(self) -> None:
        _check_colors(self, "color")
        _check_intensity(self.intensity)
        _check_vector("position", self.position, zero=True)
        if self.range is not None and not 0 < self.range < math.inf:
            raise InputError(f"range: expected a distance above 0, got {self.range}")


@dataclass(frozen=True, kw_only=True)
class SpotLight(PointLight):
    """Light from a place in a cone (KHR_lights_punctual).

    direction: of its middle. inner_angle, outer_angle: in degrees from there: up to the first it is as bright as a
    PointLight, and from the second on it is dark. Raises InputError if a number is wrong.
    """

    direction: Vector
    inner_angle: float = 0.0
    outer_angle: float = 45.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_vector("direction", self.direction)
        if not 0 <= self.inner_angle < self.outer_angle <= 90:
            raise InputError(
                f"inner_angle, outer_angle: expected 0 <= inner < outer <= 90 degrees, "
                f"got {self.inner_angle} and {self.outer_angle}"
            )


Lamp = AmbientLight | DirectionalLight | PointLight


def checked_lights(lights: Sequence[Lamp]) -> tuple[Lamp, ...]:
    """Return the lights as a tuple, or raise InputError."""
    for light in lights:
        if not isinstance(light, Lamp):
            raise InputError(f"lights: expected lights, such as DirectionalLight, got {type(light).__name__}")
    return tuple(lights)


def _from_camera(elevation: float, azimuth: float, intensity: float, highlights: bool) -> DirectionalLight:
    """Return a light that comes from an angle above the camera, and from one to its right, in degrees."""
    up, right = math.radians(elevation), math.radians(azimuth)
    toward = (math.cos(up) * math.sin(right), math.sin(up), math.cos(up) * math.cos(right))
    direction = (-toward[0], -toward[1], -toward[2])
    return DirectionalLight(
        direction=direction, intensity=intensity * math.pi, follows_camera=True, highlights=highlights
    )


KIT: tuple[Lamp, ...] = (
    AmbientLight(sky=(0.26, 0.27, 0.28), ground=(0.1, 0.095, 0.09)),
    _from_camera(35, -20, 0.78, True),
    _from_camera(-20, 40, 0.08, False),
    _from_camera(15, 125, 0.22, False),
    _from_camera(15, -125, 0.22, False),
)
"""The default lights, which move with the camera: soft light from above; a key light from the upper left; a fill light
from the lower right, which makes no highlights; and two back lights, which trace outlines.
"""
