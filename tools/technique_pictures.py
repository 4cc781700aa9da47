"""Draws the demo's scene with every technique, as docs/techniques.md shows: python tools/technique_pictures.py.

It writes a picture for each technique of the registry, docs/techniques/NAME.png, and those of FURTHER, which peel fewer
layers than there are, or have fewer samples. It also writes docs/complexity/demo.png, which shows how many layers the
scene has.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Literal

import clpeel
from clpeel.scene.demo import DIRECTION, ZOOM, demo_scene
from clpeel.techniques import TECHNIQUES

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "techniques"
SIZE = (400, 300)
SAMPLES: Literal[16] = 16
FURTHER: dict[str, tuple[str, dict[str, Any]]] = {
    "depth-peeling-2": ("depth-peeling", {"passes": 2}),
    "dual-depth-peeling-1": ("dual-depth-peeling", {"passes": 1}),
    "stochastic-1": ("stochastic", {"samples": 1}),
}


def main() -> None:
    """Draw and write all of them."""
    renderer = clpeel.Renderer(demo_scene())
    camera = clpeel.Camera.frame(renderer.scene, DIRECTION, aspect=SIZE[0] / SIZE[1]).zoom(ZOOM)
    wanted: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in TECHNIQUES} | FURTHER
    for done, (name, (technique, options)) in enumerate(wanted.items(), 1):
        settings: dict[str, Any] = {"samples": SAMPLES, **options}
        result = renderer.render(camera, SIZE, technique, "white", "headlight", **settings)
        result.save(FOLDER / f"{name}.png")
        print(f"{done}/{len(wanted)} {name}", file=sys.stderr)
    found = clpeel.complexity(renderer.scene, camera, SIZE)
    found.save(FOLDER.parent / "complexity" / "demo.png")


if __name__ == "__main__":
    main()
