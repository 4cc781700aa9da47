"""Lights, obviously right: one fragment at a time, in float64, by the formulas of glTF 2.0, appendix B.

What one reflection of a rough surface returns of even light is integrated here, not looked up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from clpeel.scene.lights import AmbientLight, DirectionalLight, Lamp, PointLight, SpotLight
from clpeel.scene.materials import Finish

Vector = np.ndarray

STEPS = 300
"""Half vectors along each axis of the integral. It is right to 1e-4 for what is tested."""


def unit(vector: Sequence[float] | Vector) -> Vector:
    """The vector at length 1."""
    return np.asarray(vector, float) / math.sqrt(sum(float(x) ** 2 for x in vector))


@cache
def returned(facing: float, rough: float) -> tuple[float, float]:
    """What a reflection returns of even light: the part that f0 is multiplied with, and the part that it is not.

    The integral over the hemisphere of directions of light, in equal steps of angles around the normal, of
    D V F (n.l). For a smooth surface its peak is narrow, so the steps are those of half vectors.
    """
    a2 = rough**4
    v = np.array([math.sqrt(1 - facing**2), 0.0, facing])
    # Half vectors by shares u of D (n.h): cos^2 = (1 - u) / (1 + (a2 - 1) u). There is a pole where n.h is 0, so
    # where u is 1. With u = 1 - s^2 and du = 2 s ds it has none.
    s, turn = np.meshgrid((np.arange(STEPS) + 0.5) / STEPS, (np.arange(STEPS) + 0.5) / STEPS * 2 * np.pi)
    u = 1 - s**2
    cosine = np.sqrt((1 - u) / (1 + (a2 - 1) * u))
    sine = np.sqrt(1 - cosine**2)
    h = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1)
    towards = h @ v
    light = 2 * towards[..., None] * h - v
    met = np.maximum(light[..., 2], 0)
    there = (met > 0) & (towards > 0)
    shadow = met * math.sqrt(facing**2 * (1 - a2) + a2) + facing * np.sqrt(met**2 * (1 - a2) + a2)
    # D V (n.l) over the density D (n.h) / (4 v.h) of such directions.
    weight = np.where(there, 0.5 / shadow * met * 4 * towards / cosine, 0) * 2 * s
    edge = np.where(there, (1 - np.clip(towards, 0, 1)) ** 5, 0)
    return float((weight * (1 - edge)).mean()), float((weight * edge).mean())


def seen(
    color: Sequence[float], normal: Vector, place: Vector, toward_eye: Vector, lights: Sequence[Lamp], finish: Finish
) -> tuple[Vector, Vector]:
    """The light of one fragment without its highlights, and of its highlights: linear RGB each.

    color: linear. normal: of length 1. place: in the space of the lights. toward_eye: of length 1.
    """
    base = np.asarray(color, float)
    a = finish.roughness**2
    facing = max(float(normal @ toward_eye), 1e-3)
    scaled, fixed = returned(facing, finish.roughness)
    lost = 1 / (scaled + fixed) - 1
    diffuse = base * (1 - finish.metallic) * (1 - (0.04 * scaled + fixed) * (1 + 0.04 * lost))

    def mirrored(part: float, rest: float) -> Vector:
        """What both kinds of surfaces mirror, mixed: f0 times a part, and the rest, with what is given back."""
        kinds = [(f0 * part + rest) * (1 + f0 * lost) for f0 in (np.full(3, 0.04), base)]
        return kinds[0] * (1 - finish.metallic) + kinds[1] * finish.metallic

    plain, shine = np.array(finish.emissive, float), np.zeros(3)
    for light in lights:
        if isinstance(light, AmbientLight):
            up = unit((0, 1, 0) if light.up is None else light.up)
            sky, ground = np.array(light.sky) * light.intensity, np.array(light.ground) * light.intensity
            share = 0.5 + float(normal @ up) / 3
            plain = plain + diffuse * (ground + (sky - ground) * share)
            mirror = 2 * facing * normal - toward_eye
            share = min(max(0.5 + 0.5 * float(mirror @ up) * (1 - a / 3), 0), 1)
            shine = shine + (ground + (sky - ground) * share) * mirrored(scaled, fixed)
            continue
        power = np.array(light.color) * light.intensity
        if isinstance(light, DirectionalLight):
            l = -unit(light.direction)  # noqa: E741
        else:
            assert isinstance(light, PointLight)
            way = np.array(light.position) - place
            distance = math.sqrt(float(way @ way))
            l = way / distance  # noqa: E741
            power = power / distance**2
            if light.range is not None:
                power = power * max(min(1 - (distance / light.range) ** 4, 1), 0)
            if isinstance(light, SpotLight):
                outer, inner = math.cos(math.radians(light.outer_angle)), math.cos(math.radians(light.inner_angle))
                power = power * min(max((float(-l @ unit(light.direction)) - outer) / (inner - outer), 0), 1) ** 2
        met = max(float(normal @ l), 0.0)
        plain = plain + diffuse / math.pi * power * met
        if met == 0 or (isinstance(light, DirectionalLight) and not light.highlights):
            continue
        h = unit(l + toward_eye)
        cosine, towards = float(normal @ h), float(toward_eye @ h)
        spread = a**2 / (math.pi * ((a**2 - 1) * cosine**2 + 1) ** 2)
        shadow = met * math.sqrt(facing**2 * (1 - a**2) + a**2) + facing * math.sqrt(met**2 * (1 - a**2) + a**2)
        edge = (1 - towards) ** 5  # Schlick's f0 + (1 - f0) edge = f0 (1 - edge) + edge
        shine = shine + mirrored(1 - edge, edge) * spread * 0.5 / shadow * power * met
    return plain, shine
