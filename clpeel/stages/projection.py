"""Projection: the scene on the device to clipped, snapped screen triangles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyopencl as cl

from clpeel.device.devices import Gpu
from clpeel.device.layout import (
    CLIP_TRIANGLES,
    DEPTH_FORMATS,
    FLOAT32_REVERSED,
    OPAQUE,
    PADDING,
    TRIANGLE,
    VERTEX,
    Features,
)
from clpeel.device.program import cut, launch, program
from clpeel.errors import InputError
from clpeel.scene.camera import Camera
from clpeel.scene.scene import Positions, Scene

STAGE = "projection"
BOUNDS_BYTES = 8
WEIGHTS_BYTES = 36
STATE_BYTES = 1
LISTED_BYTES = 4

LEAST_WINDOW_SHARE = 2.0**-40
"""As LEAST_SHARE (camera.py), of window depths: those of the scene are all equal then, in any format."""

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


@dataclass(frozen=True)
class Triangles:
    """Screen triangles: a record for each face that may cover a sample, and CLIP_TRIANGLES more behind them for each
    clipped one. Opaque faces come first where there are others; each kind is in submission order.

    records: TRIANGLE [count]; bounds: uint16 [count, 4], the first and last pixel column and row (first > last: nothing
    to draw); weights: float32 [count, 3, 3] for colours that vary over a face, else None.
    """

    scene: DeviceScene
    features: Features
    size: tuple[int, int]  # width, height in pixels
    view: tuple[float, float, float]  # view direction, unit length
    clipping: tuple[float, float]  # view distances of the near and the far plane of depths, in world units
    window: tuple[float, float]  # the same of window depths: as given
    depth_scale: float  # what window depths are multiplied with (depth.h); of the view, whatever kernels are built for
    faces: int
    listed: int
    clipped: int
    discarded: int
    records: cl.Buffer
    bounds: cl.Buffer
    weights: cl.Buffer | None

    @property
    def count(self) -> int:
        """How many records there are."""
        return self.listed + CLIP_TRIANGLES * self.clipped

    @property
    def setup_features(self) -> Features:
        """What the stages before fragments are compiled for: they know no depth format."""
        return replace(self.features, depth_format=DEPTH_FORMATS[FLOAT32_REVERSED])

    @property
    def shading(self) -> dict[str, Any]:
        """The kernel arguments that say what colour a fragment has."""
        return {
            "faces": self.scene.faces,
            "palette": self.scene.palette,
            "normals": self.scene.normals,
            "weights": self.weights,
            "view_x": self.view[0],
            "view_y": self.view[1],
            "view_z": self.view[2],
        }

    @property
    def nbytes(self) -> int:
        """Bytes of vertices, lists and records on the device."""
        record = TRIANGLE.itemsize + BOUNDS_BYTES + (WEIGHTS_BYTES if self.weights is not None else 0)
        lists = STATE_BYTES * self.faces + LISTED_BYTES * (self.listed + self.clipped)
        return VERTEX.itemsize * len(self.scene.scene.vertices) + lists + record * self.count


def upload(gpu: Gpu, scene: Scene, normals: bool = False) -> DeviceScene:
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


def project(
    gpu: Gpu,
    scene: DeviceScene,
    camera: Camera,
    size: tuple[int, int],
    headlight: bool,
    opaque_first: bool = False,
    depth_format: str = DEPTH_FORMATS[FLOAT32_REVERSED],
) -> Triangles:
    """Transforms, clips and snaps the scene's triangles for an image of `size` (width, height).

    opaque_first: tells opaque faces from others; without, all are taken as transparent. depth_format: one of
    DEPTH_FORMATS, what is kept of their fragments' depths.
    """
    features = Features(
        lanes=gpu.lanes,
        perspective=not camera.orthographic,
        low_positions=scene.low_positions is not None,
        color_rate=scene.color_rate,
        packed_color=scene.packed_color,
        headlight=headlight,
        surfaces=scene.surfaces if opaque_first else "transparent",
    )
    kernels = program(gpu, "stages/setup.cl", features)
    host = scene.scene
    vertex_count, face_count = len(host.vertices), len(host.faces)
    # Formats of window depths keep what the range given leaves of them, as far as it leaves anything.
    reversed_depths = depth_format == DEPTH_FORMATS[FLOAT32_REVERSED]
    clipping = camera.depth_range(host) if reversed_depths else camera.depth_range(host, LEAST_WINDOW_SHARE)
    matrix, depth_near, depth_far = camera.projection(scene.grid.origin, scene.grid.scale, clipping, size)
    vertices = gpu.buffer("vertices", (vertex_count + PADDING) * VERTEX.itemsize)
    view = {"width": size[0], "height": size[1]}
    points = {
        "positions": scene.positions,
        "low_positions": scene.low_positions,
        "matrix": gpu.put("matrix", matrix),
        "depth_near": depth_near,
        "depth_far": depth_far,
    }
    wide = features.wide
    launch(
        gpu,
        STAGE,
        kernels["project_vertices"],
        -(-vertex_count // wide),
        vertex_count=vertex_count,
        vertices=vertices,
        **points,
    )
    states = gpu.buffer("states", face_count + PADDING)
    corners = {"faces": scene.faces, "vertex_count": vertex_count, "vertices": vertices}
    launch(
        gpu,
        STAGE,
        kernels["cull_triangles"],
        -(-face_count // wide),
        face_count=face_count,
        palette=scene.palette,
        states=states,
        **corners,
        **view,
    )
    chunk_faces, chunks = cut(gpu, face_count)
    sifted = {"states": states, "face_count": face_count, "chunk_faces": chunk_faces}
    chunk_counts = gpu.buffer("chunk_counts", 20 * chunks)
    launch(gpu, STAGE, kernels["count_states"], chunks, 1, **sifted, chunk_counts=chunk_counts)
    counts = gpu.get(chunk_counts, (chunks, 5), np.uint32)
    discarded = int(counts[:, 4].sum())
    # [opaque or transparent, chunk, listed or clipped]: all that is opaque comes first.
    kinds = counts[:, :4].reshape(chunks, 2, 2).swapaxes(0, 1)
    ends = np.cumsum(kinds.reshape(-1, 2), axis=0, dtype=np.uint32).reshape(kinds.shape)
    starts = ends - kinds
    opaque_count = int(ends[0, -1, 0])
    listed_count, clipped_count = (int(total) for total in ends[1, -1])
    count = listed_count + CLIP_TRIANGLES * clipped_count
    listed = gpu.buffer("listed", LISTED_BYTES * listed_count)
    clipped = gpu.buffer("clipped", LISTED_BYTES * clipped_count)
    for kind, chunk_starts in ((OPAQUE, starts[0]), (0, starts[1])):
        if kind == 0 or features.surfaces == "mixed":
            launch(
                gpu,
                STAGE,
                kernels["list_triangles"],
                chunks,
                1,
                **sifted,
                kind=kind,
                chunk_starts=gpu.put(f"chunk_starts_{kind}", chunk_starts),
                listed=listed,
                clipped=clipped,
            )
    outputs = {
        "triangles": gpu.buffer("triangles", (count + PADDING) * TRIANGLE.itemsize),
        "bounds": gpu.buffer("bounds", (count + PADDING) * BOUNDS_BYTES),
        "weights": gpu.buffer("weights", (count + PADDING) * WEIGHTS_BYTES) if features.fragment_color else None,
    }
    lists = {"listed": listed, "listed_count": listed_count, "opaque_count": opaque_count}
    launch(gpu, STAGE, kernels["setup_triangles"], -(-listed_count // wide), **corners, **lists, **view, **outputs)
    if clipped_count:
        launch(
            gpu,
            STAGE,
            program(gpu, "stages/clipping.cl", features)["clip_triangles"],
            clipped_count,
            clipped=clipped,
            clipped_count=clipped_count,
            faces=scene.faces,
            **lists,
            **points,
            **view,
            **outputs,
        )
    direction = camera.axes()[2]
    return Triangles(
        scene=scene,
        features=replace(features, depth_format=depth_format),  # fragments' alone
        size=size,
        view=(float(direction[0]), float(direction[1]), float(direction[2])),
        clipping=clipping,
        window=camera.fitted_range(host),
        depth_scale=1.0 if camera.orthographic else 1 / (1 - clipping[0] / clipping[1]),
        faces=face_count,
        listed=listed_count,
        clipped=clipped_count,
        discarded=discarded,
        records=outputs["triangles"],
        bounds=outputs["bounds"],
        weights=outputs["weights"],
    )
