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
)
from clpeel.reading.transforms import Reals
from clpeel.scene.lights import DirectionalLight, Lamp, PointLight, SpotLight, Vector

_STRAIGHT = 1e-6
"""How much wider than the inner cone of a spot the outer one is at least, in radians. Files may have them alike."""


def lights_of(document: Document, worlds: Reals) -> tuple[Lamp, ...]:
    """Return the lights of the nodes that are shown, in scene units. Notes those that are damaged.

    worlds: of all nodes, float64 [n, 4, 4]. A light points along its node's -z.
    """
    held = extension(document.tree, LIGHTS)
    known = [] if held is None else objects(held, "lights")
    found = list[Lamp]()
    for index in gltf_nodes.shown(document):
        node = extension(document.entry("nodes", index), LIGHTS)
        if node is None:
            continue
        try:
            found.append(_light(known[place("lights", node.get("light"), len(known))], worlds[index]))
        except InputError as error:
            document.note(f"a light left out: {error}")
    return tuple(found)


def _light(light: Json, world: Reals) -> Lamp:
    """Return a light at its node's place. Raises InputError."""
    red, green, blue = numbers("color", light.get("color", [1, 1, 1]), 3)
    strength = number("intensity", light.get("intensity", 1))
    ahead: Vector = tuple(-world[:3, 2])
    there: Vector = tuple(world[:3, 3])
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
