"""Draws a view with PyVista, run by a Python that has it: `python draw_pyvista.py JOB`; JOB is JSON (views.py)."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import pyvista as pv

PEELS = 1000
"""The most peels. They end earlier, when nothing is left to be peeled."""


def add(plotter: Any, model: str) -> None:
    """Add a file with its materials, where it has some and PyVista has an importer for them; else its mesh alone."""
    kind = Path(model).suffix.lower()
    if kind in (".glb", ".gltf"):
        plotter.import_gltf(model)
    elif kind == ".obj" and (materials := material_file(model)):
        plotter.import_obj(model, materials)
    else:
        plotter.add_mesh(pv.read(model))


def material_file(model: str) -> Path | None:
    """Return the material file that an OBJ file names, if it is there. PyVista looks for one of the model's name."""
    with open(model, encoding="utf-8", errors="replace") as file:
        named = next((line.split(maxsplit=1)[1].strip() for line in file if line.startswith("mtllib ")), None)
    path = Path(model).with_name(named) if named else None
    return path if path and path.is_file() else None


def draw(job: dict[str, Any]) -> None:
    """Draw the view into its file. Transparent surfaces are peeled."""
    side = job["side"]
    own, peels = job["own"], job["opacity"] is not None
    plotter = pv.Plotter(off_screen=True, window_size=(side, side), lighting="light kit" if own else "none")
    plotter.disable_anti_aliasing()  # with samples, llvmpipe shows an empty picture; and all take one sample
    if own and not peels:
        plotter.enable_anti_aliasing("ssaa")
    plotter.set_background(job["background"])
    with pv.VtkErrorCatcher(send_to_logging=False) as errors:
        try:
            add(plotter, job["model"])
        except OSError as error:
            raise SystemExit(" ".join(str(error).split())) from None
    actors = plotter.renderer.GetActors()
    if not actors.GetNumberOfItems():
        why = "; ".join(error.alert.strip() for error in errors.error_events[:1])
        raise SystemExit(f"nothing was read{f': {why}' if why else ''}")
    for place in range(actors.GetNumberOfItems()):
        actor = actors.GetItemAsObject(place)
        if not own:
            actor.GetProperty().SetLighting(job["lit"])
        if job["opacity"] is not None:
            actor.GetProperty().SetOpacity(job["opacity"])
            actor.ForceOpaqueOff()
            actor.ForceTranslucentOn()
    if not own:
        plotter.remove_all_lights()  # those of the file
        plotter.add_light(pv.Light(light_type="headlight"))
    if peels or not own:
        plotter.enable_depth_peeling(number_of_peels=PEELS, occlusion_ratio=0.0)
    plotter.camera_position = [job["position"], job["focal_point"], job["view_up"]]
    plotter.camera.view_angle = job["view_angle"]
    plotter.reset_camera_clipping_range()
    plotter.screenshot(job["out"])


if __name__ == "__main__":
    draw(json.loads(sys.argv[1]))
    print(f"PyVista {pv.__version__}")
