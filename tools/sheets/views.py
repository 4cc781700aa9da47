"""What is drawn: a model, how it is seen, and how it is lit. Each program gets the same view as JSON."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import clpeel

SIDE = 480
"""Pixels of a picture on each side."""

BACKGROUND = (0.70, 0.76, 0.68)
"""Neither white nor black, so that white surfaces without light are seen, and so is what shows through them."""


@dataclass(frozen=True)
class View:
    """A view of a model.

    name: of the sheet's file. model: its path. direction: where the camera looks. up: the scene's up. at: what it looks
    at, or None for the centre. zoom: above 1 shows less, larger. lit: whether there is a light at the camera; else
    colours are as the file has them. own: each program uses the light and the smooth edges that it has by default,
    where it can. opacity: of every surface, or None for the file's.
    """

    name: str
    model: Path
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    at: tuple[float, float, float] | None = None
    zoom: float = 1.0
    lit: bool = False
    own: bool = False
    opacity: float | None = None

    @property
    def title(self) -> str:
        """What the sheet shows, in one line."""
        light = "a light at the camera" if self.lit else "colours as they are"
        light = "the light that each program has by default" if self.own else light
        return ", ".join([self.model.name, light, *([f"opacity {self.opacity:g}"] if self.opacity is not None else [])])

    def camera(self, scene: clpeel.Scene) -> clpeel.Camera:
        """Return the camera that has all of the scene in view, or the part of it that the view is of."""
        camera = clpeel.Camera.frame(scene, self.direction, self.up).zoom(self.zoom)
        if self.at is None:
            return camera
        position = np.add(self.at, np.subtract(camera.position, camera.focal_point))
        return replace(camera, position=position, focal_point=self.at)

    def job(self, camera: clpeel.Camera, out: Path) -> dict[str, Any]:
        """Return what a program without clpeel needs to know, for JSON. out: the picture that it writes."""
        seen = {name: getattr(camera, name) for name in ("position", "focal_point", "view_up", "view_angle")}
        told = {"background": BACKGROUND, "side": SIDE, "lit": self.lit, "own": self.own, "opacity": self.opacity}
        return {**seen, **told, "model": str(self.model.resolve()), "out": str(out)}


ASLANT = (-1.0, -0.6, -1.4)

DEFAULTS: dict[str, tuple[str, dict[str, Any]]] = {
    "alpha-modes": ("AlphaBlendModeTest.glb", {"lit": True, "zoom": 2.4, "at": (-2.0, 1.2, 0.0)}),
    "alpha-cutoffs": ("AlphaBlendModeTest.glb", {"lit": True, "zoom": 2.4, "at": (2.6, 1.2, 0.0)}),
    "truck": ("CesiumMilkTruck.glb", {"direction": ASLANT}),
    "truck-translucent": ("CesiumMilkTruck.glb", {"direction": ASLANT, "opacity": 0.4}),
    "duck": ("Duck.glb", {"direction": ASLANT}),
    "texture-transform": ("TextureTransformTest/TextureTransformTest.gltf", {}),
    "morph": ("MorphStressTest/MorphStressTest.gltf", {"lit": True, "direction": ASLANT}),
    "skin": ("skin/simple_skin.gltf", {"lit": True, "direction": ASLANT}),
    "engine": ("draco-engine/2CylinderEngine.gltf", {"lit": True, "direction": ASLANT}),
    "fuze": ("fuze/fuze.obj", {"direction": ASLANT, "up": (0.0, 0.0, 1.0)}),
    "fuze-translucent": ("fuze/fuze.obj", {"direction": ASLANT, "up": (0.0, 0.0, 1.0), "opacity": 0.4}),
    "chair": ("chair_model.obj", {"lit": True, "direction": ASLANT}),
    "counter": ("3mf/counterXP.3MF", {"lit": True, "direction": ASLANT, "up": (0.0, 0.0, 1.0)}),
}
"""The sheets of docs/materials.md, by name: a file in the folder of models, and how it is seen."""

_LOOKS: dict[str, tuple[str, dict[str, Any]]] = {
    "morph": ("MorphStressTest/MorphStressTest.gltf", {"direction": ASLANT}),
    "bunny": ("bunny.ply", {"direction": (0.3, -0.3, -1.0)}),
    "suzanne": ("suzanne.ply", {"direction": (-0.5, -0.3, -1.0)}),
    "sensor": ("ADIS16480.STL", {"direction": ASLANT, "up": (0.0, 0.0, 1.0)}),
    "chair": ("chair_model.obj", {"direction": ASLANT}),
    "fuze": ("fuze/fuze.obj", {"direction": ASLANT, "up": (0.0, 0.0, 1.0)}),
    "truck": ("CesiumMilkTruck.glb", {"direction": ASLANT}),
    "duck": ("Duck.glb", {"direction": ASLANT}),
    "board": ("AlphaBlendModeTest.glb", {"direction": (-0.3, -0.2, -1.0)}),
    "engine": ("draco-engine/2CylinderEngine.gltf", {"direction": ASLANT}),
}

LOOKS: dict[str, tuple[str, dict[str, Any]]] = {
    f"{name}{kind}": (file, {**seen, "own": True, "opacity": opacity})
    for name, (file, seen) in _LOOKS.items()
    for kind, opacity in (("", None), ("-translucent", 0.4))
}
"""The sheets of docs/looks.md."""
