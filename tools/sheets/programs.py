"""The columns of a sheet: clpeel, and the peers, which run in processes of their own by a Python that has them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from benchmark.runs import Failed, run
from PIL import Image

import clpeel
from clpeel.rendering.keywords import Keywords
from clpeel.rendering.options import Lighting
from sheets.views import BACKGROUND, SIDE, View

HERE = Path(__file__).parent
PEERS = {"PyVista": HERE / "draw_pyvista.py", "f3d": HERE / "draw_f3d.py"}
"""The other programs, and their scripts."""

INSTALL = "pip install pyvista f3d, and name that Python with --peer-python"


@dataclass(frozen=True)
class Cell:
    """A picture with its label. If there is no picture, `why` says so."""

    label: str
    picture: Image.Image | None
    why: str = ""


def sheet(
    view: View, scratch: Path, peer_python: str, environment: dict[str, str], say: Callable[[str], None]
) -> list[Cell]:
    """Return the cells of a view: clpeel's, then the peers'. scratch: a folder for their pictures.

    say: gets a line for each note of clpeel's and each cell that has no picture. Raises InputError if clpeel cannot
    read the model, as there is no camera then.
    """
    scene = clpeel.load(view.model, opacity=view.opacity)
    for note in scene.notes:
        say(f"{view.name}: clpeel: {note}")
    camera = view.camera(scene)
    cells = [Cell(f"clpeel {clpeel.__version__}", drawn(scene, camera, view))]
    for name, script in PEERS.items():
        out = scratch / f"{view.name}-{name}.png"
        command = [peer_python, "-P", str(script), json.dumps(view.job(camera, out))]
        cell = peer(name, command, environment, out)
        cells.append(replace(cell, why=cell.why.replace(str(view.model.resolve()), view.model.name)))
        if cells[-1].why:
            say(f"{view.name}: {name}: {cells[-1].why}")
    return cells


def drawn(scene: clpeel.Scene, camera: clpeel.Camera, view: View) -> Image.Image:
    """Return clpeel's picture, with as many samples a pixel as all others."""
    lighting: Lighting = "headlight" if view.lit else "none"
    if view.own:
        lighting = "scene" if scene.lights else "kit"
    options: Keywords = {"samples": 4 if view.own else 1}
    result = clpeel.render(scene, camera, (SIDE, SIDE), background=BACKGROUND, lighting=lighting, **options)
    return Image.fromarray(result.image)


def peer(name: str, command: list[str], environment: dict[str, str], out: Path) -> Cell:
    """Return the picture of a peer, whose command prints its name with its version, or why there is none."""
    try:
        label = run(command, environment).splitlines()[-1]
        with Image.open(out) as picture:
            return Cell(label, picture.convert("RGB"))
    except Failed as failure:
        why = str(failure)
        return Cell(name, None, f"{why} ({INSTALL})" if why.startswith("ModuleNotFoundError") else why)
    except (OSError, IndexError) as error:
        return Cell(name, None, f"it wrote no picture: {error}")
