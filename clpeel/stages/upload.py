"""Upload: a scene's arrays to the device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.scene.scene import Positions, Scene

MOST_ITEMS = 2**31 // 3
"""Vertices or faces of a scene: three numbers each, at places that are signed where they are gathered (wide.h)."""


@dataclass(frozen=True)
class DeviceScene:
    """A scene's arrays on the device.

    positions, low_positions: float32 [n, 3] (low ones None where not needed); faces: uint32 [m, 3];
    palette: colours as given, uint8 [k, 4] or float32 [k, 4]; normals: float32 [n, 3] or None.
    """

    scene: Scene
    grid: Positions
    positions: cl.Buffer
    low_positions: cl.Buffer | None
    faces: cl.Buffer
    palette: cl.Buffer
    normals: cl.Buffer | None
    color_rate: str
    packed_color: bool
    surfaces: str
    nbytes: int


def upload(gpu: Workspace, scene: Scene, normals: bool = False) -> DeviceScene:
    """Puts a scene on the device, with its vertex normals where they are asked for.

    Raises InputError when it has more vertices or triangles than the kernels can number.
    """
    most = max(len(scene.vertices), len(scene.faces))
    if most > MOST_ITEMS:
        raise InputError(
            f"scene: expected at most {MOST_ITEMS:,} vertices and triangles, got {most:,}; render its parts"
        )
    grid = scene.positions()
    if scene.vertex_colors is not None:
        rate, colors = "vertex", scene.vertex_colors
    elif scene.face_colors is not None:
        rate, colors = "face", scene.face_colors
    else:
        rate, colors = "scene", np.atleast_2d(np.asarray(scene.color))
    arrays = {"positions": grid.hi, "faces": scene.faces, "palette": colors}
    if grid.lo is not None:
        arrays["low_positions"] = grid.lo
    if normals and scene.vertex_normals is not None:
        arrays["normals"] = scene.vertex_normals
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    held = {name: cl.Buffer(gpu.context, flags, hostbuf=np.ascontiguousarray(array)) for name, array in arrays.items()}
    return DeviceScene(
        scene=scene,
        grid=grid,
        positions=held["positions"],
        low_positions=held.get("low_positions"),
        faces=held["faces"],
        palette=held["palette"],
        normals=held.get("normals"),
        color_rate=rate,
        packed_color=colors.dtype == np.uint8,
        surfaces=scene.surfaces,
        nbytes=sum(array.nbytes for array in arrays.values()),
    )
