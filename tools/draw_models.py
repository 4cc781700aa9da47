"""Draws the pictures of the documentation that show models: python tools/draw_models.py [NAME...]

The models are in the folder `models` in the folder that CLPEEL_SHARED names. Exit codes: 0 done, 2 bad input.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from benchmark.runs import SHARED

import clpeel
from clpeel.errors import ClpeelError

DOCS = Path(__file__).resolve().parent.parent / "docs"
MODELS = SHARED / "models"
Variant = Literal["exact", "total", "first-solid"]
VARIANTS: tuple[Variant, ...] = ("exact", "total", "first-solid")


def dragon(variant: Variant) -> clpeel.Result:
    """The thickness of the dragon, whose mesh is closed."""
    scene = clpeel.load(MODELS / "dragon_vrip_res3.ply.gz")
    camera = clpeel.Camera.frame(scene, aspect=400 / 290).zoom(1.3)
    return clpeel.render(scene, camera, (400, 290), "thickness", "white", samples=16, variant=variant)


def bunny() -> clpeel.Result:
    """The thickness of the bunny, with the pixels where it is open."""
    scene = clpeel.load(MODELS / "bunny.ply")
    camera = clpeel.Camera.frame(scene, (0, 0.25, -1), aspect=400 / 360).zoom(1.15)
    return clpeel.render(scene, camera, (400, 360), "thickness", "white", samples=1)


def leaves() -> clpeel.Scene:
    """Leaves on the ground behind the bunny: flat ellipsoids, in scene units of its file."""
    leaf = trimesh.creation.icosphere(subdivisions=3)
    placed = []
    for number, place in enumerate(np.linspace(-0.105, 0.08, 10)):
        turned = trimesh.transformations.rotation_matrix(0.5 * np.sin(5 * number) - 1.2 + 0.4 * number, (0, 0, 1))
        moved = trimesh.transformations.translation_matrix((place, 0.047 + 0.006 * (number % 3), 0.09))
        placed.append(leaf.copy().apply_scale((0.022, 0.009, 0.001)).apply_transform(moved @ turned))
    return clpeel.load(*placed, color="#9cd35f")


def behind(variant: Variant) -> clpeel.Result:
    """The bunny lit from behind, before leaves."""
    scene = clpeel.load(clpeel.load(MODELS / "bunny.ply", color="#f3d9c4"), leaves())
    camera = clpeel.Camera.frame(clpeel.load(MODELS / "bunny.ply"), (0, -0.08, 1)).zoom(1.15)
    return clpeel.render(scene, camera, (300, 300), "translucency", "#0d0d12", "headlight", samples=16, variant=variant)


def confidence(cmap: str, opacity: str | None) -> clpeel.Result:
    """The bunny in the colours of its scanner's confidence, with a scale bar."""
    scene = clpeel.load(MODELS / "bunny.ply", scalars="confidence", cmap=cmap, opacity=opacity)
    camera = clpeel.Camera.frame(scene, aspect=640 / 480).zoom(1.2)
    result = clpeel.render(scene, camera, (640, 480), background="white", samples=16)
    return result.with_bar(*scene.color_maps)


def ground() -> clpeel.Result:
    """A translucent duck on a grid, as the command in docs/looks.md draws it."""
    duck = clpeel.load(MODELS / "Duck.glb", opacity=0.6)
    camera = clpeel.Camera.frame(duck, (-1, -0.6, -1.4), aspect=1.5)
    scene = clpeel.load(duck, clpeel.grid(duck))
    return clpeel.render(scene, camera, (600, 400), samples=16).with_axis(camera)


PICTURES: dict[str, Callable[[], clpeel.Result]] = {
    **{f"techniques/thickness-{name}": partial(dragon, name) for name in VARIANTS},
    "techniques/thickness-unpaired": bunny,
    **{f"techniques/translucency-{name}": partial(behind, name) for name in VARIANTS},
    "scalars/confidence": lambda: confidence("viridis", None),
    "scalars/confidence-linear": lambda: confidence("plasma", "linear"),
    "looks/ground": ground,
}


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    parser = argparse.ArgumentParser(prog="draw_models.py", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"these alone: {', '.join(PICTURES)}")
    options = parser.parse_args(arguments)
    for name in options.names:
        if name not in PICTURES:
            parser.error(f"name: expected some of {', '.join(PICTURES)}; got {name!r}")
    try:
        for name in options.names or PICTURES:
            PICTURES[name]().save(DOCS / f"{name}.png")
    except ClpeelError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
