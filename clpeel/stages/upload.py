"""Upload: copies a scene's arrays to the device."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.scene import Positions, Scene
from clpeel.scene.tangents import tangents_of
from clpeel.stages.shading import Packed, Shading, material_table, packed_textures, shading_of, used_materials

MOST_ITEMS = 2**31 // 3
"""The most vertices or faces of a scene. Each has three numbers, and kernels gather them by signed 32-bit places."""


@dataclass(frozen=True)
class DeviceScene:
    """A scene's arrays on the device.

    grid: positions are (vertex - grid.origin) * grid.scale. positions, low_positions: float32 [n, 3], high and low
    parts; low_positions is None if all low parts are 0. faces: uint32 [m, 3]. palette: straight RGBA as given, uint8 or
    float32 [k, 4]; k is 1, n or m. normals: float32 [n, 3] or None; behind
    them tangents, [n, 3], if maps of normals need them. color_rate: "scene", "face" or "vertex".
    packed_color: whether the palette is uint8. surfaces: "opaque", "transparent" or "mixed".
    shading: what its materials need of kernels. uv: float32 [sets, n, 2]; material_of: int32 [m]; materials: MATERIAL
    [1 + j]; textures: uint32; packed: the same textures on the host. All of them are None if there are no materials,
    but for the last three where lights fall on the scene.
    single_sided: uint8 [m] or None. opaque_faces: uint32 [m], bytes of a colour whose alpha is 255 where a face is
    opaque; None if the palette says so. nbytes: of all arrays.
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
    shading: Shading
    uv: cl.Buffer | None
    material_of: cl.Buffer | None
    materials: cl.Buffer | None
    textures: cl.Buffer | None
    packed: Packed | None
    single_sided: cl.Buffer | None
    opaque_faces: cl.Buffer | None
    nbytes: int


def upload(
    gpu: Workspace, scene: Scene, normals: bool = False, like: DeviceScene | None = None, lights: bool = False
) -> DeviceScene:
    """Puts a scene on the device. normals: with its vertex normals, if it has some. lights: with what lights need.

    like: a scene on the device that has the same textures. They are not copied again if they suffice.
    Raises InputError when the scene has more vertices or triangles than the kernels can number (MOST_ITEMS).
    """
    most = max(len(scene.vertices), len(scene.faces))
    if most > MOST_ITEMS:
        raise InputError(
            f"scene: expected at most {MOST_ITEMS:,} vertices and triangles, got {most:,}; render its parts"
        )
    grid = scene.positions()
    rate, colors = _palette(scene)
    arrays: dict[str, AnyArray] = {"positions": grid.hi, "faces": scene.faces, "palette": colors}
    if grid.lo is not None:
        arrays["low_positions"] = grid.lo
    if normals and scene.vertex_normals is not None:
        arrays["normals"] = scene.vertex_normals
        if lights and any(m.finish is not None and m.finish.normal_texture is not None for m in scene.materials):
            arrays["normals"] = np.stack([scene.vertex_normals, tangents_of(scene)])
    if scene.single_sided is not None:
        arrays["single_sided"] = scene.single_sided.view(np.uint8)
    packed, textures = None, None
    used = used_materials(scene, lights)
    if used or lights:
        if like is None or like.packed is None or like.packed.lights < lights:
            packed = packed_textures(used, lights)
            textures = _buffers(gpu, {"textures": packed.words})["textures"]
        else:
            packed, textures = like.packed, like.textures
        if scene.face_materials is not None and used:
            arrays["material_of"] = scene.face_materials
            arrays["uv"] = _coordinates(scene, lights)
        arrays |= _of_materials(scene, packed)
    held = _buffers(gpu, arrays)
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
        shading=shading_of(scene, lights),
        uv=held.get("uv"),
        material_of=held.get("material_of"),
        materials=held.get("materials"),
        textures=textures,
        packed=packed,
        single_sided=held.get("single_sided"),
        opaque_faces=held.get("opaque_faces"),
        nbytes=sum(array.nbytes for array in arrays.values()) + (0 if packed is None else packed.words.nbytes),
    )


def _coordinates(scene: Scene, lights: bool) -> NDArray[np.float32]:
    """The texture coordinates of all sets that matter, float32 [sets, n, 2]."""
    if scene.uv is None:
        return np.zeros((1, len(scene.vertices), 2), np.float32)
    return np.stack([scene.uv, *scene.more_uv]) if lights and scene.more_uv else scene.uv[None]


def _of_materials(scene: Scene, packed: Packed) -> dict[str, AnyArray]:
    """The arrays that depend on the materials' numbers, but not on their textures."""
    found: dict[str, AnyArray] = {"materials": material_table(scene, packed)}
    if used_materials(scene, packed.lights):
        found["opaque_faces"] = np.where(scene.kinds.opaque, np.uint32(0xFF000000), np.uint32(0))
    return found


def _buffers(gpu: Workspace, arrays: dict[str, AnyArray]) -> dict[str, cl.Buffer]:
    """Copies the arrays to the device. Raises InputError if one is larger than the device's memory allows."""
    most = int(gpu.device.max_mem_alloc_size)
    for name, array in arrays.items():
        if array.nbytes > most:
            raise InputError(
                f"scene: expected {name} of at most {most / 2**20:,.0f} MiB, as the device allocates no more at once, "
                f"got {array.nbytes / 2**20:,.0f} MiB"
            )
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    return {name: cl.Buffer(gpu.context, flags, hostbuf=np.ascontiguousarray(array)) for name, array in arrays.items()}


def with_colors(gpu: Workspace, held: DeviceScene, scene: Scene) -> DeviceScene:
    """Puts a scene on the device that differs from the one there in its colours and opacities alone.

    Only these are copied. A scene that got vertices of its own for its faces is uploaded as a whole.
    """
    if len(scene.vertices) != len(held.scene.vertices):
        lights = held.packed is not None and held.packed.lights
        return upload(gpu, scene, held.normals is not None, like=held, lights=lights)
    rate, colors = _palette(scene)
    arrays: dict[str, AnyArray] = {"palette": colors}
    if held.packed is not None:
        arrays |= _of_materials(scene, held.packed)
    buffers = _buffers(gpu, arrays)
    return replace(
        held,
        scene=scene,
        palette=buffers["palette"],
        materials=buffers.get("materials"),
        opaque_faces=buffers.get("opaque_faces"),
        color_rate=rate,
        packed_color=colors.dtype == np.uint8,
        surfaces=scene.surfaces,
        shading=shading_of(scene, held.packed is not None and held.packed.lights),
        nbytes=held.nbytes - int(held.palette.size) + colors.nbytes,
    )


def _palette(scene: Scene) -> tuple[str, Colors]:
    """What has a colour of its own ("scene", "face" or "vertex"), and the colours [k, 4]."""
    if scene.vertex_colors is not None:
        return "vertex", scene.vertex_colors
    if scene.face_colors is not None:
        return "face", scene.face_colors
    return "scene", np.atleast_2d(np.asarray(scene.color))
