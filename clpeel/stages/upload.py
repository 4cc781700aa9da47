"""Upload: copies a scene's arrays to the device."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.materials import NO_MATERIAL
from clpeel.scene.scene import Positions, Scene
from clpeel.scene.tangents import tangents_of
from clpeel.scene.textures import linear
from clpeel.stages.outlines import SQUARE, Outlines, Shape, outlines_of
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
    opaque; None if the palette says so. outlines: of its lines and points, or None; their corners and triangles follow
    the scene's own in all these arrays but the positions. lines: int32 [k, 4]; points: uint32 [p]; outline: float32
    [corners, 4] of a point; of_faces: uint8, 1 for each of the scene's faces, 0 behind. None without outlines. nbytes:
    of all arrays.
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
    outlines: Outlines | None
    lines: cl.Buffer | None
    points: cl.Buffer | None
    outline: cl.Buffer | None
    of_faces: cl.Buffer | None
    nbytes: int

    @property
    def varies(self) -> bool:
        """Whether colours vary over a face, without lights: then it is fragments that have colours."""
        return self.color_rate == "vertex" or self.shading.materials

    @property
    def vertex_count(self) -> int:
        """How many vertices there are, with the corners of lines and points."""
        return len(self.scene.vertices) + (0 if self.outlines is None else len(self.outlines.vertex_of))

    @property
    def face_count(self) -> int:
        """How many triangles there are, with those of lines and points."""
        return len(self.scene.faces) + (0 if self.outlines is None else len(self.outlines.faces))


def upload(
    gpu: Workspace,
    scene: Scene,
    normals: bool = False,
    like: DeviceScene | None = None,
    lights: bool = False,
    shape: Shape = SQUARE,
) -> DeviceScene:
    """Puts a scene on the device. normals: with its vertex normals, if it has some. lights: with what lights need.

    like: a scene on the device that has the same textures. They are not copied again if they suffice. shape: of its
    points.
    Raises InputError when the scene has more vertices or triangles than the kernels can number (MOST_ITEMS).
    """
    grid = scene.positions()
    outlines = outlines_of(scene, shape, np.asarray(np.isfinite(grid.hi).all(axis=1)))
    behind = (0, 0) if outlines is None else (len(outlines.vertex_of), len(outlines.faces))
    most = max(len(scene.vertices) + behind[0], len(scene.faces) + behind[1])
    if most > MOST_ITEMS:
        raise InputError(
            f"scene: expected at most {MOST_ITEMS:,} vertices and triangles, got {most:,}; render its parts"
        )
    rate, colors = _palette(scene, outlines)
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
        arrays |= _of_materials(scene, packed, len(scene.vertices) + behind[0])
    if outlines is not None:
        arrays |= _of_outlines(scene, outlines, arrays)
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
        outlines=outlines,
        lines=held.get("lines"),
        points=held.get("points"),
        outline=held.get("outline"),
        of_faces=held.get("of_faces"),
        nbytes=sum(array.nbytes for array in arrays.values()) + (0 if packed is None else packed.words.nbytes),
    )


def _coordinates(scene: Scene, lights: bool) -> NDArray[np.float32]:
    """The texture coordinates of all sets that matter, float32 [sets, n, 2]."""
    if scene.uv is None:
        return np.zeros((1, len(scene.vertices), 2), np.float32)
    return np.stack([scene.uv, *scene.more_uv]) if lights and scene.more_uv else scene.uv[None]


def _of_outlines(scene: Scene, outlines: Outlines, arrays: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """The arrays of lines and points, and those of vertices and faces with what follows for outlines."""
    faces = len(outlines.faces)
    own: dict[str, AnyArray] = {
        "faces": outlines.faces,
        "material_of": np.full(faces, NO_MATERIAL, np.int32),
        "single_sided": np.zeros(faces, np.uint8),
        "opaque_faces": _opaque_bytes(outlines.opaque),
    }
    found = {name: np.concatenate([arrays[name], array]) for name, array in own.items() if name in arrays}
    for name in ("normals", "uv"):  # [n, 3] or [sets, n, 2 or 3]
        if name in arrays:
            found[name] = np.concatenate([arrays[name], arrays[name][..., outlines.vertex_of, :]], axis=-2)
    found["of_faces"] = np.repeat(np.array([1, 0], np.uint8), [len(scene.faces), faces])
    found |= {"lines": outlines.lines, "outline": outlines.shape.outline}
    return found if scene.points is None else {**found, "points": scene.points}


def _opaque_bytes(opaque: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Colours, bytes, whose alpha is 255 where something is opaque."""
    return np.where(opaque, np.uint32(0xFF000000), np.uint32(0))


def _of_materials(scene: Scene, packed: Packed, vertex_count: int) -> dict[str, AnyArray]:
    """The arrays that depend on the materials' numbers, but not on their textures."""
    found: dict[str, AnyArray] = {"materials": material_table(scene, packed, vertex_count)}
    if used_materials(scene, packed.lights):
        found["opaque_faces"] = _opaque_bytes(scene.kinds.opaque)
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
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR  # the normals of balls are written for each view
    return {
        name: cl.Buffer(gpu.context, flags, hostbuf=np.ascontiguousarray(array))
        for name, array in arrays.items()
        if array.nbytes
    }


def with_colors(gpu: Workspace, held: DeviceScene, scene: Scene) -> DeviceScene:
    """Puts a scene on the device that differs from the one there in its colours and opacities alone.

    Only these are copied. A scene that got vertices of its own for its faces is uploaded as a whole.
    """
    outlines = held.outlines
    if len(scene.vertices) != len(held.scene.vertices):
        lights, shape = held.packed is not None and held.packed.lights, SQUARE if outlines is None else outlines.shape
        return upload(gpu, scene, held.normals is not None, held, lights, shape)
    if outlines is not None:
        outlines = replace(outlines, opaque=_opaque_again(scene, outlines))
    rate, colors = _palette(scene, outlines)
    arrays: dict[str, AnyArray] = {"palette": colors}
    if held.packed is not None:
        arrays |= _of_materials(scene, held.packed, held.vertex_count)
        if outlines is not None and "opaque_faces" in arrays:
            arrays["opaque_faces"] = np.concatenate([arrays["opaque_faces"], _opaque_bytes(outlines.opaque)])
    buffers = _buffers(gpu, arrays)
    return replace(
        held,
        scene=scene,
        palette=buffers["palette"],
        materials=buffers.get("materials"),
        opaque_faces=buffers.get("opaque_faces"),
        outlines=outlines,
        color_rate=rate,
        packed_color=colors.dtype == np.uint8,
        surfaces=scene.surfaces,
        shading=shading_of(scene, held.packed is not None and held.packed.lights),
        nbytes=held.nbytes - int(held.palette.size) + colors.nbytes,
    )


def in_linear_light(gpu: Workspace, held: DeviceScene) -> DeviceScene:
    """Puts the colours of a scene on the device once more, as linear light, four floats each.

    It is for kernels to which a fragment's colour is that of its face. Others make light of what they compute.
    """
    _, colors = _palette(held.scene, held.outlines)
    given = colors / 255.0 if colors.dtype == np.uint8 else colors
    light = np.concatenate([linear(given[:, :3]), given[:, 3:]], axis=1).astype(np.float32)
    palette = _buffers(gpu, {"palette": light})["palette"]
    nbytes = held.nbytes - int(held.palette.size) + light.nbytes
    return replace(held, palette=palette, packed_color=False, nbytes=nbytes)


def _opaque_again(scene: Scene, outlines: Outlines) -> NDArray[np.bool_]:
    """Which triangles of outlines are opaque now that the scene has other colours."""
    return scene.opaque_marks[outlines.marks_of(np.arange(len(outlines.faces), dtype=np.int32))]


def _palette(scene: Scene, outlines: Outlines | None) -> tuple[str, Colors]:
    """What has a colour of its own ("scene", "face" or "vertex"), and the colours [k, 4]."""
    if scene.vertex_colors is not None:
        own = scene.vertex_colors
        return "vertex", own if outlines is None else np.concatenate([own, own[outlines.vertex_of]])
    if scene.face_colors is not None:
        own = scene.face_colors
        if outlines is None:
            return "face", own
        marks = outlines.marks_of(np.arange(len(outlines.faces), dtype=np.int32))
        return "face", np.concatenate([own[: len(scene.faces)], own[len(scene.faces) + marks]])
    return "scene", np.atleast_2d(np.asarray(scene.color))
