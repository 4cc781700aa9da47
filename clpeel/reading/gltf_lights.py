"""Lights of a glTF file (KHR_lights_punctual): those of the nodes that are shown."""

from __future__ import annotations

import math

from clpeel.errors import InputError
from clpeel.reading import gltf_nodes
from clpeel.reading.companions import named
from clpeel.reading.gltf_document import (
    LIGHTS,
    Document,
    Json,
    damaged,
    extension,
    fields,
    number,
    numbers,
    objects,
    place,
    title,
)
from clpeel.reading.transforms import Reals
from clpeel.scene.lights import DirectionalLight, Lamp, PointLight, SpotLight, Vector

_STRAIGHT = 1e-6
"""How much wider than the inner cone of a spot the outer one is at least, in radians. Files may have them alike."""


def lights_of(document: Document, worlds: Reals) -> tuple[Lamp, ...]:
    """Return the lights of the nodes that are shown, in scene units. Notes those that are damaged.

    worlds: of all nodes, float64 [n, 4, 4]. A light points along its node's -z.
    """
    found = list[Lamp]()
    for index in gltf_nodes.shown(document):
        node = document.entry("nodes", index)
        try:
            light = _named_light(document, node)
            if light is not None:
                found.append(_light(light, worlds[index]))
        except InputError as error:
            document.note(f"light of node {title(node, index)} left out: {error}")
    return tuple(found)


def _named_light(document: Document, node: Json) -> Json | None:
    """Return the light that a node names, or None if it names none. Raises InputError."""
    named_by = extension(node, LIGHTS)
    if named_by is None:
        return None
    known = objects(extension(document.tree, LIGHTS) or {}, "lights")
    return known[place("lights", named_by.get("light"), len(known))]


def _light(light: Json, world: Reals) -> Lamp:
    """Return a light at its node's place. Raises InputError."""
    red, green, blue = numbers("color", light.get("color", [1, 1, 1]), 3)
    strength = number("intensity", light.get("intensity", 1))
    ahead, there = _vector(-world[:3, 2]), _vector(world[:3, 3])
    color = (red, green, blue)
    kind = light.get("type")
    if kind == "directional":
        return DirectionalLight(direction=ahead, color=color, intensity=strength)
    reach = number("range", light["range"]) if "range" in light else None
    if kind == "point":
        return PointLight(position=there, color=color, intensity=strength, range=reach)
    if kind != "spot":
        damaged(f"type of a light: expected directional, point or spot, got {named(str(kind))}")
    spot = fields(light, "spot")
    outer = min(number("outerConeAngle", spot.get("outerConeAngle", math.pi / 4)), math.pi / 2)
    inner = min(number("innerConeAngle", spot.get("innerConeAngle", 0)), outer - _STRAIGHT)
    return SpotLight(
        position=there,
        color=color,
        intensity=strength,
        range=reach,
        direction=ahead,
        inner_angle=math.degrees(inner),
        outer_angle=math.degrees(outer),
    )


def _vector(values: Reals) -> Vector:
    """Return three numbers of an array."""
    x, y, z = (float(value) for value in values)
    return x, y, z
