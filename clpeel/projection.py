"""Projection: the scene on the device to clipped, snapped screen triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from clpeel.camera import Camera
from clpeel.device import Gpu
from clpeel.layout import CLIP_TRIANGLES, COUNTERS, TRIANGLE, VERTEX, Features
from clpeel.program import GROUP, launch, program
from clpeel.scene import Positions, Scene

STAGE = "projection"
BOUNDS_BYTES = 8
WEIGHTS_BYTES = 36


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
    nbytes: int


@dataclass(frozen=True)
class Triangles:
    """Screen triangles, a record a face in submission order and CLIP_TRIANGLES more for each clipped face.

    records: TRIANGLE [count]; bounds: uint16 [count, 4], the first and last pixel column and row (first > last: nothing
    to draw); weights: float32 [count, 3, 3] for colours that vary over a face, else None.
    """

    scene: DeviceScene
    features: Features
    size: tuple[int, int]  # width, height in pixels
    view: tuple[float, float, float]  # view direction, unit length
    faces: int
    records: cl.Buffer
    bounds: cl.Buffer
    weights: cl.Buffer | None
    clipped: int
    discarded: int

    @property
    def nbytes(self) -> int:
        """Bytes of vertices and records on the device."""
        record = TRIANGLE.itemsize + BOUNDS_BYTES + (WEIGHTS_BYTES if self.weights is not None else 0)
        return VERTEX.itemsize * len(self.scene.scene.vertices) + record * (self.faces + CLIP_TRIANGLES * self.clipped)


def upload(gpu: Gpu, scene: Scene, normals: bool = False) -> DeviceScene:
    """Puts a scene on the device, with its vertex normals where they are asked for."""
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
        nbytes=sum(array.nbytes for array in arrays.values()),
    )


def project(gpu: Gpu, scene: DeviceScene, camera: Camera, size: tuple[int, int], headlight: bool) -> Triangles:
    """Transforms, clips and snaps the scene's triangles for an image of `size` (width, height)."""
    features = Features(
        lanes=gpu.lanes,
        perspective=not camera.orthographic,
        low_positions=scene.low_positions is not None,
        color_rate=scene.color_rate,
        packed_color=scene.packed_color,
        headlight=headlight,
    )
    kernels = program(gpu, "projection.cl", features)
    host = scene.scene
    vertex_count, face_count = len(host.vertices), len(host.faces)
    clipping = camera.fitted_range(host)
    matrix, depth_near, depth_far = camera.projection(scene.grid.origin, scene.grid.scale, clipping, size)
    vertices = gpu.buffer("vertices", (vertex_count + GROUP) * VERTEX.itemsize)
    matrix_buffer = gpu.put("matrix", matrix)
    view = {"width": size[0], "height": size[1]}
    points = {
        "positions": scene.positions,
        "low_positions": scene.low_positions,
        "matrix": matrix_buffer,
        "depth_near": depth_near,
        "depth_far": depth_far,
    }
    launch(
        gpu,
        STAGE,
        kernels["project_vertices"],
        vertex_count,
        vertex_count=vertex_count,
        vertices=vertices,
        **points,
    )

    faces = {"faces": scene.faces, "face_count": face_count}
    records, outputs = face_count, dict[str, cl.Buffer | None]()
    while True:  # a second round only where clipping needs more room than the buffers had
        held = outputs
        outputs = {
            "triangles": gpu.buffer("triangles", records * TRIANGLE.itemsize),
            "bounds": gpu.buffer("bounds", records * BOUNDS_BYTES),
            "weights": gpu.buffer("weights", records * WEIGHTS_BYTES) if features.fragment_color else None,
        }
        if held and all(outputs[name] is held[name] for name in outputs):
            break
        counters = gpu.put("counters", np.zeros(1, COUNTERS))
        indexed = {**faces, "vertex_count": vertex_count, "vertices": vertices, "counters": counters}
        launch(gpu, STAGE, kernels["setup_triangles"], face_count, **indexed, **view, **outputs)
        counted = gpu.get(counters, 1, COUNTERS)[0]
        clipped = int(counted["clipped"])
        records = face_count + CLIP_TRIANGLES * clipped
    if clipped:
        kernels = program(gpu, "clipping.cl", features)
        listed = gpu.buffer("clipped", clipped * 4)
        launch(gpu, STAGE, kernels["collect_clipped"], face_count, **indexed, clipped=listed)
        ordered = np.sort(gpu.get(listed, clipped, np.uint32))
        launch(
            gpu,
            STAGE,
            kernels["clip_triangles"],
            clipped,
            clipped=gpu.put("clipped", ordered),
            clipped_count=clipped,
            **faces,
            **points,
            **view,
            **outputs,
        )
    direction = camera.axes()[2]
    return Triangles(
        scene=scene,
        features=features,
        size=size,
        view=(float(direction[0]), float(direction[1]), float(direction[2])),
        faces=face_count,
        records=outputs["triangles"],
        bounds=outputs["bounds"],
        weights=outputs["weights"],
        clipped=clipped,
        discarded=int(counted["discarded"]),
    )
