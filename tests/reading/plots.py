"""PyVista plotters that tests draw twice: here, and as `python plots.py NAME FILE.npy` by PyVista's own renderer."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

SIZE = (300, 200)


def plotter(**options: Any) -> Any:
    """An off-screen plotter with one sample a pixel, before a colour that no mesh has."""
    import pyvista as pv

    made = pv.Plotter(off_screen=True, window_size=SIZE, **options)
    made.disable_anti_aliasing()
    made.set_background((0.0, 0.25, 0.0))
    return made


def nested() -> Any:
    """Translucent meshes, one of them with scalars, before PyVista's default camera."""
    import pyvista as pv

    plot, ball = plotter(), pv.Sphere()
    ball["height"] = ball.points[:, 2]
    plot.add_mesh(ball, scalars="height", opacity=0.5, show_scalar_bar=False)
    plot.add_mesh(pv.Cube(), color="tomato", opacity=0.4)
    return plot


def moved() -> Any:
    """A mesh with a transform of every kind, and one with a matrix that mirrors and shears it, in perspective."""
    import pyvista as pv

    plot = plotter()
    cone = plot.add_mesh(pv.Cone(resolution=7), color="gold", smooth_shading=True)
    cone.position, cone.origin, cone.scale = (0.5, 0.2, -0.3), (0.1, 0.1, 0.2), (1, 2, 0.5)
    cone.orientation = (20, 50, 70)
    box = plot.add_mesh(pv.Cube(), color="white", opacity=0.3)
    box.user_matrix = np.array([[-1, 0.3, 0, -1], [0, 1, 0.2, 0.5], [0.1, 0, 1, 0], [0, 0, 0, 1.0]])
    plot.camera_position = [(3, 4, 5), (0.2, 0.1, 0), (0.1, 0, 1)]
    plot.camera.view_angle = 42
    return plot


def parallel() -> Any:
    """Blocks of a MultiBlock, and a grid of cells with a volume, in parallel projection."""
    import pyvista as pv

    plot = plotter()
    blocks = pv.MultiBlock([pv.Sphere(center=(0, 1.3, 0)), None, pv.MultiBlock([pv.Cube(center=(1.4, 0, 0))])])
    plot.add_mesh(blocks, color="lightblue")
    plot.add_mesh(pv.ImageData(dimensions=(3, 4, 2), spacing=(0.4, 0.3, 0.9)).cast_to_unstructured_grid(), opacity=0.5)
    plot.camera.parallel_projection = True
    plot.camera_position = [(4, 5, 6), (0.5, 0.5, 0.2), (0, 0, 1)]
    plot.camera.parallel_scale = 1.7
    return plot


def culled() -> Any:
    """Boxes whose front or back is left out, in a scene that the camera stretches along z."""
    import pyvista as pv

    plot = plotter()
    plot.add_mesh(pv.Cylinder(capping=False, center=(0, 0, 0)), culling="back", color="white", lighting=False)
    plot.add_mesh(pv.Disc(center=(0, 0.7, 0), normal=(0, 1, 0)), culling="front", color="red", lighting=False)
    plot.camera.model_transform_matrix = np.diag([1.0, 1, 1.5, 1])
    plot.camera_position = [(1.5, 2, 3.3), (0, 0.2, 0), (0, 1, 0)]
    return plot


MADE = {each.__name__: each for each in (nested, moved, parallel, culled)}


def by_pyvista(name: str, folder: Path) -> NDArray[np.uint8]:
    """The picture that PyVista draws of a plotter, [height, width, 3]. Skips the test where it cannot draw any."""
    target = folder / f"{name}.npy"
    given = {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow", **os.environ}
    command = [sys.executable, __file__, name, str(target)]
    run = subprocess.run(command, env=given, capture_output=True, text=True, timeout=120)
    if run.returncode or not target.exists():
        pytest.skip(f"PyVista cannot draw off-screen here: {(run.stderr.splitlines() or ['no reason given'])[-1]}")
    found: NDArray[np.uint8] = np.load(target)
    return found


if __name__ == "__main__":
    np.save(sys.argv[2], MADE[sys.argv[1]]().screenshot(return_img=True)[..., :3])
