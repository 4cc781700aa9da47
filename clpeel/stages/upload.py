"""Upload: copies a scene's arrays to the device."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyopencl as cl

from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.scene.arrays import Colors
from clpeel.scene.scene import Positions, Scene

MOST_ITEMS = 2**31 // 3
"""The most vertices or faces of a scene. Each has three numbers, and kernels gather them by signed 32-bit places."""


@dataclass(frozen=True)
class DeviceScene:
    """A scene's arrays on the device.

    grid: positions are (vertex - grid.origin) * grid.scale. positions, low_positions: float32 [n, 3], high and low
    parts; low_positions is None if all low parts are 0. faces: uint32 [m, 3]. palette: straight RGBA as given, uint8 or
    float32 [k, 4]; k is 1, n or m. normals: float32 [n, 3] or None. color_rate: "scene", "face" or "vertex".
    packed_color: whether the palette is uint8. surfaces: "opaque", "transparent" or "mixed". nbytes: of all arrays.
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
    """Puts a scene on the device. normals: with its vertex normals, if it has some.

    Raises InputError when the scene has more vertices or triangles than the kernels can number (MOST_ITEMS).
    """
    most = max(len(scene.vertices), len(scene.faces))
    if most > MOST_ITEMS:
        raise InputError(
            f"scene: expected at most {MOST_ITEMS:,} vertices and triangles, got {most:,}; render its parts"
        )
    grid = scene.positions()
    rate, colors = _palette(scene)
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


def with_colors(gpu: Workspace, held: DeviceScene, scene: Scene) -> DeviceScene:
    """Puts a scene on the device that differs from the one there in its colours alone. Only these are copied."""
    rate, colors = _palette(scene)
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    return replace(
        held,
        scene=scene,
        palette=cl.Buffer(gpu.context, flags, hostbuf=np.ascontiguousarray(colors)),
        color_rate=rate,
        packed_color=colors.dtype == np.uint8,
        surfaces=scene.surfaces,
        nbytes=held.nbytes - int(held.palette.size) + colors.nbytes,
    )


def _palette(scene: Scene) -> tuple[str, Colors]:
    """What has a colour of its own ("scene", "face" or "vertex"), and the colours [k, 4]."""
    if scene.vertex_colors is not None:
        return "vertex", scene.vertex_colors
    if scene.face_colors is not None:
        return "face", scene.face_colors
    return "scene", np.atleast_2d(np.asarray(scene.color))
