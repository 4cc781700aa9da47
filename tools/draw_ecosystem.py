"""Draws docs/ecosystem/NAME.png: plotters of PyVista, drawn by itself with depth peeling and, beside that, by clpeel.

`python tools/draw_ecosystem.py` needs pyvista, and a driver for OpenGL without a display (EGL).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import pyvista as pv
from pyvista import examples

import clpeel

SIZE = (420, 300)
FOLDER = Path(__file__).resolve().parents[1] / "docs" / "ecosystem"


def contours(plotter: Any) -> None:
    """Ten nested surfaces of a field, in its colours, within the edges of its box."""
    grid = examples.load_uniform()
    plotter.add_mesh(grid.contour(10, scalars="Spatial Point Data"), opacity=0.4, smooth_shading=True)
    plotter.add_mesh(grid.outline(), color="black", line_width=2)
    plotter.camera_position = "iso"


def beam(plotter: Any) -> None:
    """A bent beam of finite elements with their edges, before and after."""
    grid = examples.load_hexbeam()
    bent = grid.copy()
    bent.points[:, 1] -= 0.06 * bent.points[:, 2] ** 2
    bent["bending"] = bent.points[:, 1]
    plotter.add_mesh(bent, scalars="bending", cmap="plasma", opacity=0.6, show_edges=True)
    plotter.add_mesh(grid, color="white", opacity=0.6, show_edges=True)
    plotter.camera_position = [(7, 3.5, 8.5), (0.5, 0, 2.5), (0, 1, 0)]


def plane(plotter: Any) -> None:
    """An aeroplane of glass, the points of its mesh, and slices through it."""
    mesh = examples.load_airplane()
    mesh["height"] = mesh.points[:, 2]
    plotter.add_mesh(mesh, color="lightsteelblue", opacity=0.35, smooth_shading=True)
    plotter.add_mesh(mesh.slice_along_axis(n=14, axis="x"), scalars="height", cmap="viridis", line_width=3)
    plotter.camera_position = [(-900, -900, 900), (880, 700, 110), (0, 0, 1)]
    plotter.camera.view_angle = 28


def hills(plotter: Any) -> None:
    """Hills, whose opacity and colour follow their height, under water."""
    mesh = examples.load_random_hills()
    plotter.add_mesh(mesh, scalars="Elevation", cmap="gist_earth", opacity="linear", smooth_shading=True)
    plotter.add_mesh(mesh.outline(), color="dimgray", line_width=2)
    west, east, south, north, low, high = mesh.bounds
    water = pv.Plane(center=((west + east) / 2, (south + north) / 2, low + 0.2 * (high - low)), i_size=20, j_size=20)
    plotter.add_mesh(water, color="steelblue", opacity=0.4)
    plotter.camera_position = "iso"


def stream(plotter: Any) -> None:
    """Streamlines as tubes within a translucent surface of constant speed."""
    grid = pv.ImageData(dimensions=(31, 31, 31), spacing=(0.2, 0.2, 0.2), origin=(-3, -3, -3))
    x, y, z = grid.points.T
    grid["flow"] = np.stack([-y - 0.2 * x, x - 0.2 * y, 0.35 * np.cos(x) - 0.1 * z], axis=1)
    grid["speed"] = np.linalg.norm(grid["flow"], axis=1)
    lines = grid.streamlines("flow", n_points=40, source_radius=1.6, max_length=40.0)
    plotter.add_mesh(lines.tube(radius=0.05), scalars="speed", cmap="plasma", smooth_shading=True)
    plotter.add_mesh(grid.contour([2.0], scalars="speed"), color="lightblue", opacity=0.3, smooth_shading=True)
    plotter.add_mesh(grid.outline(), color="black", line_width=2)
    plotter.camera_position = "iso"


def clip(plotter: Any) -> None:
    """A field, cut in two: one half with its values, the other as glass."""
    whole = examples.load_uniform()
    plotter.add_mesh(whole.clip("x"), scalars="Spatial Point Data", cmap="coolwarm")
    plotter.add_mesh(whole.clip("x", invert=False), color="white", opacity=0.25)
    plotter.add_mesh(whole.outline(), color="black", line_width=2)
    plotter.camera_position = "iso"


PLOTS: dict[str, Callable[[Any], None]] = {
    "contours": contours,
    "beam": beam,
    "plane": plane,
    "hills": hills,
    "stream": stream,
    "clip": clip,
}


def draw(fill: Callable[[Any], None]) -> np.ndarray:
    """Return PyVista's picture of a plotter, and clpeel's on its right: uint8 [height, 2 width, 3]."""
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.disable_anti_aliasing()  # with several samples and peeling, llvmpipe shows an empty picture
    plotter.set_background("white")
    fill(plotter)
    plotter.remove_scalar_bar() if plotter.scalar_bars else None
    plotter.enable_depth_peeling(number_of_peels=100, occlusion_ratio=0)
    scene, camera, options = clpeel.from_pyvista(plotter)
    for note in scene.notes:
        print(f"  note: {note}")
    ours = clpeel.render(scene, camera, **{**options, "samples": 16}).image
    theirs = plotter.screenshot(return_img=True)
    print(scene)
    return np.concatenate([theirs[..., :3], ours[..., :3]], axis=1)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, fill in PLOTS.items():
        Image.fromarray(draw(fill)).save(FOLDER / f"{name}.png", optimize=True)
