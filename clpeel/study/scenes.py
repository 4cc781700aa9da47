"""The suite's scenes: eight by name, each with its view. All are made here but for the dragon, which is a file."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from clpeel.errors import InputError
from clpeel.scene.boxes import boxes_scene
from clpeel.scene.camera import Camera
from clpeel.scene.scene import Scene
from clpeel.study import shapes

DRAGON = "dragon_vrip.ply.gz"
"""The file of the dragon, of the Stanford 3D Scanning Repository, in a folder of models."""

DRAGON_COLOR, DRAGON_OPACITY = (0.9, 0.3, 0.2), 0.6

AHEAD = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
ABOVE = Camera((1.9, 1.8, 4.3), (0.0, -0.05, 0.0))
ASLANT = Camera((2.25, 2.1, 5.2), (0.0, -0.08, 0.0))


@dataclass(frozen=True)
class StandardScene:
    """A scene of the suite.

    about: what it is, in a line. make: makes it. camera: its view, or None for one that has all of it in view.
    lighting: as of `render`.
    """

    name: str
    about: str
    make: Callable[[], Scene]
    camera: Camera | None = AHEAD
    lighting: Literal["none", "headlight"] = "none"


def models_folder(given: str | os.PathLike[str] | None) -> Path | None:
    """Return the folder of models: the given one, or `models` in the one that CLPEEL_SHARED names, or None."""
    if given is not None:
        return Path(given)
    shared = os.environ.get("CLPEEL_SHARED")
    return Path(shared) / "models" if shared else None


def dragon_file(folder: Path | None) -> Path:
    """Return the path of the dragon's file. Raises InputError if it is not there."""
    if folder is None:
        raise InputError(f"dragon: expected a folder that has {DRAGON}, by --models or models=, got none")
    path = folder / DRAGON
    if not path.is_file():
        raise InputError(f"dragon: expected {DRAGON} in the folder of models, got none in '{folder}'")
    return path


def dragon_scene(folder: Path | None) -> Scene:
    """Return the dragon. Raises InputError if its file is not there, or damaged."""
    from clpeel.reading.load import load

    return load(dragon_file(folder), color=DRAGON_COLOR, opacity=DRAGON_OPACITY)


def standard_scenes(folder: Path | None) -> dict[str, StandardScene]:
    """Return all scenes by name. folder: that of the dragon."""
    scenes = (
        StandardScene(
            "dragon",
            "the Stanford dragon, 871,414 small triangles",
            lambda: dragon_scene(folder),
            None,
            "headlight",
        ),
        StandardScene("spheres", "ten spheres within one another", shapes.spheres_scene, lighting="headlight"),
        StandardScene("boxes", "GlowScript's grid of a thousand boxes", lambda: boxes_scene(1), ASLANT),
        StandardScene("grass", "192 large blades, one behind the other", shapes.grass_scene),
        StandardScene("hair", "100,000 thin ribbons that hang from a head", shapes.hair_scene),
        StandardScene("smoke", "64 parallel sheets with a soft puff on each", shapes.smoke_scene),
        StandardScene(
            "shells", "a machine: closed parts within one another, some touching", shapes.shells_scene, ABOVE
        ),
        StandardScene("foliage", "a tree of 6,000 leaves, each a texture on a card", shapes.foliage_scene),
    )
    return {scene.name: scene for scene in scenes}


NAMES = tuple(standard_scenes(None))
