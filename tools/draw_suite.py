"""Draws the scenes of `clpeel compare --suite` beside each other: docs/compare/scenes.png.

    python tools/draw_suite.py [--models DIR] [--output FILE.png]

The dragon is left white where its file is missing; see `clpeel compare --help`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import clpeel
from clpeel.files import write_whole
from clpeel.pictures.png import encode_png
from clpeel.study.scenes import StandardScene, models_folder, standard_scenes

OUTPUT = Path(__file__).resolve().parent.parent / "docs" / "compare" / "scenes.png"
SIDE, COLUMNS = 320, 4


def drawn(scene: StandardScene) -> NDArray[np.uint8]:
    """Return a scene over white: uint8 [SIDE, SIDE, 4]. It is white alone if it cannot be made."""
    try:
        made = scene.make()
    except clpeel.InputError as error:
        print(f"draw_suite: {error}", file=sys.stderr)
        return np.full((SIDE, SIDE, 4), 255, np.uint8)
    size = (SIDE, SIDE)
    return clpeel.render(made, scene.camera, size, background="white", lighting=scene.lighting, samples=16).image


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--models", metavar="DIR", help="folder that has the dragon")
    parser.add_argument("--output", type=Path, default=OUTPUT, metavar="FILE.png")
    options = parser.parse_args(arguments)
    pictures = [drawn(scene) for scene in standard_scenes(models_folder(options.models)).values()]
    rows = [np.concatenate(pictures[at : at + COLUMNS], axis=1) for at in range(0, len(pictures), COLUMNS)]
    write_whole(options.output, encode_png(np.concatenate(rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
