"""Known lights: how surfaces look under lights, in float64, by the formulas of kernels/shading/lights.h."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.device.layout import ALBEDO_SIDE, DIELECTRIC, LEAST_FACING, LEAST_ROUGHNESS
from clpeel.scene.lights import AmbientLight, DirectionalLight, Lamp, PointLight, SpotLight
from clpeel.scene.materials import Finish
from clpeel.stages.albedo import albedo_tables

Floats = NDArray[np.float64]

KNOWN_LIGHTS: tuple[Lamp, ...] = (
    AmbientLight(sky=(0.3, 0.35, 0.4), ground=(0.2, 0.15, 0.1), up=(0.0, 0.0, 1.0)),
    DirectionalLight(direction=(1.0, -2.0, -3.0), color=(1.0, 0.9, 0.8), intensity=0.8),
    SpotLight(position=(-2.0, 1.5, 1.0), direction=(1.0, -0.5, -3.0), intensity=8.0, outer_angle=60.0, range=20.0),
)
"""Lights of a scene that has its own, some of which have places."""


def under_lights(
    color: ArrayLike,
    normal: ArrayLike,
    place: ArrayLike,
    lights: Sequence[Lamp],
    finish: Finish,
    perspective: bool,
) -> tuple[Floats, Floats]:
    """Return the light from a surface without its highlights, and that of the highlights: [..., 3] each, linear.

    The camera is at the origin, with x to the right, y up, and z against the view. color: linear, [..., 3]. normal: of
    length 1, on the side that is seen, [..., 3]. place: of the surface, in scene units, [..., 3].
    """
    base, n, at = (np.asarray(given, np.float64) for given in (color, normal, place))
    v = _unit(-at) if perspective else np.array([0.0, 0.0, 1.0])
    facing = np.clip((n * v).sum(axis=-1, keepdims=True), LEAST_FACING, 1.0)
    rough = max(finish.roughness, LEAST_ROUGHNESS)
    a = rough**2
    any_f0, whole = albedo(facing, rough)
    dielectric, metal = 1 + DIELECTRIC * (1 / whole - 1), 1 + base * (1 / whole - 1)
    given_back = dielectric + finish.metallic * (metal - dielectric)
    f0 = (1 - finish.metallic) * DIELECTRIC * dielectric + finish.metallic * base * metal
    even, highlight = np.zeros(base.shape), np.zeros(base.shape)
    for light in lights:
        tint = np.array(light.color if not isinstance(light, AmbientLight) else (1, 1, 1)) * light.intensity
        if isinstance(light, AmbientLight):
            up = (0.0, 1.0, 0.0) if light.up is None else light.up
            sky, ground = np.array(light.sky) * tint, np.array(light.ground) * tint
            above = (n * _unit(up)).sum(axis=-1, keepdims=True)
            mirrored = ((2 * facing * n - v) * _unit(up)).sum(axis=-1, keepdims=True)
            even += ground + (sky - ground) * (0.5 + above / 3)
            seen = ground + (sky - ground) * np.clip(0.5 + 0.5 * mirrored * (1 - a / 3), 0, 1)
            highlight += seen * (f0 * any_f0 + given_back * (whole - any_f0))
            continue
        power, toward = _reaching(light, at)
        met = np.maximum((n * toward).sum(axis=-1, keepdims=True), 0.0)
        even += power * met * tint / math.pi
        if isinstance(light, DirectionalLight) and not light.highlights:
            continue
        h = _unit(toward + v)
        cosine, towards = ((n * h).sum(axis=-1, keepdims=True), (v * h).sum(axis=-1, keepdims=True))
        spread = a**2 / (math.pi * (1 - cosine**2 + a**2 * cosine**2) ** 2)
        shadow = met * np.sqrt(facing**2 * (1 - a**2) + a**2) + facing * np.sqrt(met**2 * (1 - a**2) + a**2)
        edge = np.maximum(1 - towards, 0.0) ** 5
        highlight += (f0 * (1 - edge) + given_back * edge) * spread * 0.5 / shadow * met * power * tint
    taken = (DIELECTRIC * any_f0 + whole - any_f0) * dielectric
    return base * (1 - finish.metallic) * (1 - taken) * even + np.array(finish.emissive), highlight


def covering(with_highlight: Floats, without: Floats, alpha: Floats) -> tuple[Floats, Floats]:
    """Return colours, straight, and alphas [..., 1] of surfaces whose highlights cover what they lie on (shade.h).

    with_highlight, without: what they would be if they were opaque, as it is blended, 0..1, [..., 3].
    """
    share = (with_highlight - without) / np.maximum(1 - without, 0.25)
    cover = np.clip(share.max(axis=-1, keepdims=True), 0.0, 1.0)
    through = (1 - alpha) * (1 - cover)
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = (with_highlight - through * without) / (1 - through)
    return np.where(through < 1, np.minimum(straight, 1), without), 1 - through


def albedo(facing: Floats, rough: float) -> tuple[Floats, Floats]:
    """Return what one reflection gives back of light that f0 is multiplied with, and of all if f0 is 1: as `facing`."""
    last = ALBEDO_SIDE - 1
    row, column = rough * last, np.sqrt(facing) * last
    i, j = min(int(row), last - 1), np.minimum(column.astype(np.int64), last - 1)
    down, across = row - i, column - j
    table = albedo_tables().astype(np.float64)
    above, below = (table[:, k, j] * (1 - across) + table[:, k, j + 1] * across for k in (i, i + 1))
    return tuple(above * (1 - down) + below * down)


def _reaching(light: DirectionalLight | PointLight, at: Floats) -> tuple[Floats | float, Floats]:
    """Return how much of a light reaches these places, and where it comes from, of length 1."""
    if isinstance(light, DirectionalLight):
        return 1.0, -_unit(light.direction)
    way = np.asarray(light.position) - at
    distance = np.sqrt((way**2).sum(axis=-1, keepdims=True))
    power = 1 / distance**2
    if light.range is not None:
        power = power * np.maximum(1 - (distance / light.range) ** 4, 0.0)
    if isinstance(light, SpotLight):
        inner, outer = (math.cos(math.radians(angle)) for angle in (light.inner_angle, light.outer_angle))
        beam = -(way / distance * _unit(light.direction)).sum(axis=-1, keepdims=True)
        power = power * np.clip((beam - outer) / (inner - outer), 0.0, 1.0) ** 2
    return power, way / distance


def _unit(vectors: ArrayLike) -> Floats:
    """Return vectors [..., 3] at length 1."""
    given = np.asarray(vectors, np.float64)
    return np.asarray(given / np.sqrt((given**2).sum(axis=-1, keepdims=True)))
