"""Projection: transforms, clips and snaps the scene's triangles. What is left of them are records."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.layout import (
    BAND_CORNERS,
    BAND_TRIANGLES,
    CLIP_TRIANGLES,
    DEPTH_FORMATS,
    FLOAT32_REVERSED,
    OPAQUE,
    PADDING,
    SUBPIXELS,
    DepthFormat,
    Features,
)
from clpeel.device.program import Arguments, Kernel, cut, launch, program
from clpeel.device.records import TRIANGLE, VERTEX
from clpeel.device.samples import PATTERNS, Pattern
from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.scene.camera import Camera
from clpeel.scene.lights import Lamp
from clpeel.stages.lighting import packed_lights, positioned
from clpeel.stages.outlines import PLAIN_MARKS, Length, Marks
from clpeel.stages.upload import DeviceScene

if TYPE_CHECKING:
    from clpeel.stages.wires import Seen, Wired

STAGE = "projection"
BOUNDS_BYTES = 8
WEIGHTS_BYTES = 36
STATE_BYTES = 1
LISTED_BYTES = 4

LEAST_WINDOW_SHARE = 2.0**-40
"""Replaces LEAST_SHARE (camera.py) for formats of window depths.

If the scene takes no larger share of the given range, its window depths are all equal in any format.
"""

NO_EDGES: Arguments = {"wiring": None, "wire_lists": None, "wires": None}
"""The kernel arguments where no edges are drawn."""

PLANE_SLACK = 2.0**-22
"""How far the clipping planes lie outside their depths: relative to the depth, or to the range in parallel projection.

A point exactly on a plane is rounded to float32 three times until its depth is known. This much keeps it inside.
"""


@dataclass(frozen=True)
class Triangles:
    """Screen triangles. Each face that may cover a sample has a record.

    Behind these records lie CLIP_TRIANGLES more for each clipped face. Records of opaque faces come first, if the scene
    has both kinds. Each kind is in submission order.

    faces, listed, clipped, discarded: how many faces there are, with those of lines, points and bands; how many have a
    record; how many are clipped; and how many faces, lines and points are not finite. records: TRIANGLE [count].
    bounds: uint16 [count, 4], first and last pixel column, first and last row; where first > last there is nothing to
    draw. weights: float32 [count, 3, 3] where colours vary over a face, else None.
    """

    scene: DeviceScene
    features: Features
    perspective: bool  # or parallel projection
    size: tuple[int, int]  # width, height in samples
    view: tuple[float, float, float]  # view direction, unit length
    clipping: tuple[float, float]  # view distances of the near and the far plane of depths, in world units
    window: tuple[float, float]  # the same of window depths: the clipping range as given
    depth_scale: float  # factor of window depths (depth.h); it depends on the view, not on what kernels are built for
    faces: int
    listed: int
    clipped: int
    discarded: int
    records: cl.Buffer
    bounds: cl.Buffer
    weights: cl.Buffer | None
    lighting: cl.Buffer | None  # LIGHTING and LAMPs where lights fall on the scene
    seen: Seen | None = None  # the edges that are drawn

    @property
    def count(self) -> int:
        """The number of records."""
        return self.listed + CLIP_TRIANGLES * self.clipped

    @property
    def shading(self) -> Arguments:
        """The kernel arguments that determine the colour of a fragment."""
        return {
            "faces": self.face_corners,
            "palette": self.scene.palette,
            "normals": self.scene.normals,
            "weights": self.weights,
            "uv": self.scene.uv,
            "material_of": self.scene.material_of,
            "materials": self.scene.materials,
            "textures": self.scene.textures,
            "lighting": self.lighting,
            **(NO_EDGES if self.seen is None else self.seen.shading),
        }

    @property
    def face_corners(self) -> cl.Buffer:
        """The vertices of all faces, uint32 [faces, 3]."""
        return self.scene.faces if self.seen is None else self.seen.faces

    @property
    def nbytes(self) -> int:
        """Bytes of the vertices, lists and records on the device."""
        record = TRIANGLE.itemsize + BOUNDS_BYTES + (WEIGHTS_BYTES if self.weights is not None else 0)
        lists = STATE_BYTES * self.faces + LISTED_BYTES * (self.listed + self.clipped)
        edges = 0 if self.seen is None else self.seen.nbytes
        return VERTEX.itemsize * self.scene.vertex_count + lists + record * self.count + edges


@dataclass(frozen=True)
class Lit:
    """What lights fall on a scene (scene/lights.py). intensity: what all of them are multiplied with.

    full_highlights: whether highlights stay as bright where the surface is transparent (shade.h).
    """

    lights: tuple[Lamp, ...]
    intensity: float = 1.0
    full_highlights: bool = False


@dataclass(frozen=True)
class View:
    """A camera as kernel arguments.

    points: arguments of kernels that project points. grid: arguments of kernels that use the picture's size and where
    samples lie. clipping, window: as in Triangles. height: of the picture, in samples. across: samples in a pixel's
    width for each in its height.
    """

    points: Arguments
    grid: Arguments
    perspective: bool
    clipping: tuple[float, float]
    window: tuple[float, float]
    height: int
    across: float


def view_of(
    gpu: Workspace,
    scene: DeviceScene,
    camera: Camera,
    size: tuple[int, int],
    depth_format: DepthFormat,
    pattern: Pattern,
) -> View:
    """Puts the camera's matrix on the device, with the depths of its near and far planes."""
    # Window depths depend on the range that the user gave. So for these formats the range is drawn in to the scene only
    # where it would leave no two depths apart.
    reversed_depths = depth_format == DEPTH_FORMATS[FLOAT32_REVERSED]
    host = scene.scene
    clipping = camera.depth_range(host) if reversed_depths else camera.depth_range(host, LEAST_WINDOW_SHARE)
    matrix, depth_near, depth_far = matrix_of(camera, scene.grid.origin, scene.grid.scale, clipping, size, pattern)
    points = {
        "positions": scene.positions,
        "low_positions": scene.low_positions,
        "matrix": gpu.put("matrix", matrix),
        "depth_near": depth_near,
        "depth_far": depth_far,
    }
    grid: Arguments = {"width": size[0], "height": size[1], "pattern": pattern.word}
    window = camera.fitted_range(host)
    return View(points, grid, not camera.orthographic, clipping, window, size[1], pattern.across)


def project(
    gpu: Workspace,
    scene: DeviceScene,
    camera: Camera,
    size: tuple[int, int],
    headlight: bool,
    opaque_first: bool = False,
    depth_format: DepthFormat = DEPTH_FORMATS[FLOAT32_REVERSED],
    *,
    backfaces: str = "default",
    probes: int = 1,
    marks: Marks = PLAIN_MARKS,
    lit: Lit | None = None,
    pattern: Pattern = PATTERNS[1],
    wired: Wired | None = None,
    linear: bool = False,
) -> Triangles:
    """Transforms, clips and snaps the scene's triangles for an image of `size` (width, height), in samples.

    headlight: whether a light at the camera shades the colours. opaque_first: list opaque faces before the others;
    without it all faces count as transparent. depth_format: one of DEPTH_FORMATS, how fragments keep their depths.
    backfaces: whether faces seen from behind are drawn: "visible", "hidden", or "default", which draws all that are
    not single-sided. probes: the most samples of a texture along a pixel's longer side. marks: how lines and points are
    drawn. lit: by what lights, if the scene was uploaded for lights. pattern: where a pixel's samples lie. wired: which
    edges of faces are drawn, if any. linear: whether colours are blended as linear light.
    """
    surfaces = scene.surfaces if opaque_first else "transparent"
    view = view_of(gpu, scene, camera, size, depth_format, pattern)
    shared = Features(gpu.lanes)
    vertices = _project_vertices(gpu, scene, view, shared)
    places = _expand(gpu, scene, view, camera, marks, vertices)
    seen = None
    if wired is not None:
        seen = _see_edges(gpu, scene, view, camera, wired, pattern, backfaces == "hidden", vertices)
        vertices = seen.vertices
        if surfaces == "opaque" and (seen.bands or seen.behind is not None):
            surfaces = "mixed"  # bands are not opaque at their rims
    bands = 0 if seen is None else seen.bands
    features = Features(
        lanes=gpu.lanes,
        color_rate=scene.color_rate,
        packed_color=scene.packed_color,
        headlight=headlight,
        lights=lit is not None,
        positioned=lit is not None and positioned(lit.lights),
        maps=lit is not None and scene.shading.maps,
        full_highlights=lit is not None and lit.full_highlights,
        surfaces=surfaces,
        depth_format=depth_format,
        materials=scene.shading.materials,
        routed=scene.shading.routed,
        hiding=scene.shading.hiding and surfaces == "mixed",
        levels=scene.shading.levels,
        probes=probes if scene.shading.levels else 1,
        pattern=pattern.word,
        wires=wired is not None,
        linear=linear,
    )
    corners: Arguments = {
        "faces": scene.faces if seen is None else seen.faces,
        "vertex_count": scene.vertex_count + BAND_CORNERS * bands,
        "vertices": vertices,
    }
    sides: Arguments = {
        "single_sided": {"default": scene.single_sided, "hidden": scene.of_faces}.get(backfaces),
        "all_single_sided": backfaces == "hidden" and scene.outlines is None,
    }
    face_count = scene.face_count + BAND_TRIANGLES * bands
    lists = _list_triangles(gpu, scene, view, features, face_count, {**corners, **sides})
    outputs = _set_up(gpu, scene, view, features, corners, lists, sides, _places_of_lines(scene, places))
    direction = camera.axes()[2]
    lighting = None
    if lit is not None:
        packed = packed_lights(lit.lights, lit.intensity, camera, scene.grid, view.clipping, size[1], pattern)
        lighting = gpu.put("lighting", packed)
    return Triangles(
        scene=scene,
        features=features,
        perspective=view.perspective,
        size=size,
        view=(float(direction[0]), float(direction[1]), float(direction[2])),
        clipping=view.clipping,
        window=view.window,
        depth_scale=1.0 if camera.orthographic else 1 / (1 - view.clipping[0] / view.clipping[1]),
        faces=face_count,
        listed=lists.listed_count,
        clipped=lists.clipped_count,
        discarded=lists.discarded + (0 if scene.outlines is None else scene.outlines.not_finite),
        records=outputs["triangles"],
        bounds=outputs["bounds"],
        weights=outputs["weights"],
        lighting=lighting,
        seen=seen,
    )


def setup_kernels(gpu: Workspace, scene: DeviceScene, path: str = "stages/setup.cl") -> dict[str, Kernel]:
    """The kernels of the stages before fragments. All scenes share one build, but those whose positions are pairs.

    What differs from scene to scene in these stages is an argument, as a build takes longer than any picture.
    """
    return program(gpu, path, Features(gpu.lanes), LOW_POSITIONS=int(scene.low_positions is not None))


def _project_vertices(gpu: Workspace, scene: DeviceScene, view: View, features: Features) -> cl.Buffer:
    count = len(scene.scene.vertices)
    vertices = gpu.buffer("vertices", _checked_bytes(gpu, (scene.vertex_count + PADDING) * VERTEX.itemsize))
    launch(
        gpu,
        STAGE,
        setup_kernels(gpu, scene)["project_vertices"],
        -(-count // features.wide),
        None,
        vertex_count=count,
        vertices=vertices,
        **view.points,
    )
    return vertices


def _checked_bytes(gpu: Workspace, nbytes: int) -> int:
    """The bytes of a buffer. Raises InputError if they are more than the device gives in one."""
    most = int(gpu.device.max_mem_alloc_size)
    if nbytes > most:
        raise InputError(
            f"scene: expected vertices, and corners of lines and points, of at most {most / 2**20:,.0f} MiB, as the "
            f"device allocates no more at once, got {nbytes / 2**20:,.0f} MiB; render its parts"
        )
    return nbytes


def _expand(
    gpu: Workspace, scene: DeviceScene, view: View, camera: Camera, marks: Marks, vertices: cl.Buffer
) -> cl.Buffer | None:
    """Writes the corners of lines and points. Returns how far along the lines theirs are, or None without lines."""
    outlines = scene.outlines
    if outlines is None:
        return None
    kernels = setup_kernels(gpu, scene, "stages/expand.cl")
    first, lines = len(scene.scene.vertices), len(outlines.lines)
    height = view.height

    def size(length: Length) -> Arguments:
        flat, by_depth = length.half(camera, height, view.clipping[0])
        return {"half_width": flat, "half_by_depth": by_depth, "across": view.across, "vertices": vertices}

    places = gpu.buffer("places", 4 * outlines.line_corners) if lines else None
    if lines:
        launch(
            gpu,
            STAGE,
            kernels["expand_lines"],
            lines,
            None,
            lines=scene.lines,
            line_count=lines,
            first_vertex=first,
            ends=outlines.ends,
            perspective=view.perspective,
            places=places,
            **size(marks.line_width),
            **view.points,
        )
    if scene.scene.points is not None:
        right, up, forward = camera.axes()
        launch(
            gpu,
            STAGE,
            kernels["expand_points"],
            len(scene.scene.points),
            None,
            points=scene.points,
            point_count=len(scene.scene.points),
            first_vertex=first + outlines.line_corners,
            outline=scene.outline,
            corners=outlines.shape.corners,
            axes=gpu.put("axes", np.stack([right, -up, -forward]).astype(np.float32)),
            normals=scene.normals if outlines.shape.ball else None,
            **size(marks.point_size),
        )
    return places


def _places_of_lines(scene: DeviceScene, places: cl.Buffer | None) -> Arguments:
    """The arguments of kernels that interpolate along lines, and turn normals of lines and points to the eye."""
    outlines, faces, first = scene.outlines, len(scene.scene.faces), len(scene.scene.vertices)
    first_point = faces + (0 if outlines is None else outlines.line_faces)
    return {
        "first_line": faces,
        "first_point": first_point,
        "first_ball": first_point if outlines is not None and outlines.shape.ball else scene.face_count,
        "line_vertex": first,
        "ends": 1 if outlines is None else outlines.ends,
        "places": places,
    }


@dataclass(frozen=True)
class _Lists:
    """Faces by what they need.

    listed: uint32 [listed_count], the faces that need a record. clipped: uint32 [clipped_count], the places in `listed`
    of the faces that also need clipping. opaque_count: how many listed faces are opaque; they come first. discarded:
    how many faces have corners that are not finite.
    """

    listed: cl.Buffer
    clipped: cl.Buffer
    listed_count: int
    clipped_count: int
    opaque_count: int
    discarded: int

    @property
    def arguments(self) -> Arguments:
        """The arguments of kernels that make records."""
        return {"listed": self.listed, "listed_count": self.listed_count, "opaque_count": self.opaque_count}


def _see_edges(
    gpu: Workspace,
    scene: DeviceScene,
    view: View,
    camera: Camera,
    wired: Wired,
    pattern: Pattern,
    one_sided: bool,
    vertices: cl.Buffer,
) -> Seen:
    """Finds the edges that are drawn. one_sided: whether no face is seen from behind."""
    flat, by_depth = wired.wires.width.half(camera, view.height, view.clipping[0])
    from clpeel.stages.wires import see_edges  # few pictures have edges

    return see_edges(
        gpu,
        setup_kernels(gpu, scene, "stages/wires.cl"),
        wired,
        STAGE,
        widths={"half_width": flat, "half_by_depth": by_depth, "across": view.across},
        margin=SUBPIXELS * pattern.rows / 2,
        one_sided=one_sided,
        points=view.points,
        vertices=vertices,
        faces=scene.faces,
        vertex_count=scene.vertex_count,
        face_count=scene.face_count,
    )


def _list_triangles(
    gpu: Workspace, scene: DeviceScene, view: View, features: Features, face_count: int, corners: Arguments
) -> _Lists:
    """Culls the faces, and lists the remaining ones, which may cover a sample. Opaque faces come first."""
    kernels = setup_kernels(gpu, scene)
    states = gpu.buffer("states", face_count + PADDING)
    launch(
        gpu,
        STAGE,
        kernels["cull_triangles"],
        -(-face_count // features.wide),
        None,
        face_count=face_count,
        first_band=scene.face_count,
        palette=(scene.opaque_faces or scene.palette) if features.surfaces == "mixed" else None,
        colors=1 if scene.opaque_faces is not None else {"scene": 0, "face": 1, "vertex": 3}[scene.color_rate],
        packed=scene.packed_color or scene.opaque_faces is not None,
        states=states,
        **corners,
        **view.grid,
    )
    chunk_faces, chunks = cut(gpu, face_count)
    sifted = {"states": states, "face_count": face_count, "chunk_faces": chunk_faces}
    chunk_counts = gpu.buffer("chunk_counts", 20 * chunks)
    launch(gpu, STAGE, kernels["count_states"], chunks, 1, **sifted, chunk_counts=chunk_counts)
    counts = gpu.get(chunk_counts, (chunks, 5), np.uint32)
    # [opaque or transparent, chunk, listed or clipped]. Prefix sums in this order put all opaque faces first.
    kinds = counts[:, :4].reshape(chunks, 2, 2).swapaxes(0, 1)
    ends = np.cumsum(kinds.reshape(-1, 2), axis=0, dtype=np.uint32).reshape(kinds.shape)
    starts = ends - kinds
    listed_count, clipped_count = (int(total) for total in ends[1, -1])
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
    return _Lists(listed, clipped, listed_count, clipped_count, int(ends[0, -1, 0]), int(counts[:, 4].sum()))


def _set_up(
    gpu: Workspace,
    scene: DeviceScene,
    view: View,
    features: Features,
    corners: Arguments,
    lists: _Lists,
    sides: Arguments,
    lines: Arguments,
) -> dict[str, cl.Buffer]:
    """Makes the records of the listed faces, and of the pieces of clipped faces."""
    count = lists.listed_count + CLIP_TRIANGLES * lists.clipped_count
    outputs = {
        "triangles": gpu.buffer("triangles", (count + PADDING) * TRIANGLE.itemsize),
        "bounds": gpu.buffer("bounds", (count + PADDING) * BOUNDS_BYTES),
        "weights": gpu.buffer("weights", (count + PADDING) * WEIGHTS_BYTES) if features.fragment_color else None,
    }
    launch(
        gpu,
        STAGE,
        setup_kernels(gpu, scene)["setup_triangles"],
        -(-lists.listed_count // features.wide),
        None,
        **corners,
        **lines,
        perspective=view.perspective,
        **lists.arguments,
        **view.grid,
        **outputs,
    )
    if lists.clipped_count:
        launch(
            gpu,
            STAGE,
            setup_kernels(gpu, scene, "stages/clipping.cl")["clip_triangles"],
            lists.clipped_count,
            None,
            clipped=lists.clipped,
            clipped_count=lists.clipped_count,
            faces=corners["faces"],
            perspective=view.perspective,
            **sides,
            **lists.arguments,
            **view.points,
            **view.grid,
            **outputs,
        )
    return outputs


def matrix_of(
    camera: Camera,
    scene_origin: NDArray[np.float64],
    scale: float,
    clipping: tuple[float, float],
    size: tuple[int, int],
    pattern: Pattern = PATTERNS[1],
) -> tuple[NDArray[np.float32], float, float]:
    """The kernels' matrix for positions (v - scene_origin) * scale, and the depths of the near and far planes.

    The matrix is float32 [4, 2, 4]: the rows x, y, z, w of clip space (projection.cl), each as high and low parts. x
    and y are in subpixels times w, from the image's centre, y down. z / w is the reversed depth, 1 at the near plane.
    The depths of the planes include PLANE_SLACK. size: in samples, of which a pixel has `pattern`.
    """
    _, height = size
    near, far = (value * scale for value in clipping)
    eye = (np.asarray(camera.position, np.float64) - scene_origin) * scale
    right, up, forward = camera.axes()
    half = math.tan(math.radians(camera.view_angle) / 2)

    def row(vector: NDArray[np.float64], factor: float = 1.0, offset: float = 0.0) -> list[float]:
        return [*(vector * factor), offset - float(np.dot(vector, eye)) * factor]

    if camera.orthographic:
        per_unit = SUBPIXELS * height / 2 / (half * camera.distance * scale)
        depth = row(forward, -1 / (far - near), far / (far - near))
        matrix = [row(right, per_unit * pattern.across), row(up, -per_unit), depth, [0.0, 0.0, 0.0, 1.0]]
        depth_far = -PLANE_SLACK
    else:
        per_unit = SUBPIXELS * height / 2 / half
        matrix = [row(right, per_unit * pattern.across), row(up, -per_unit), [0.0, 0.0, 0.0, near], row(forward)]
        depth_far = near / far * (1 - PLANE_SLACK)
    exact = np.array(matrix, np.float64)
    high = exact.astype(np.float32)
    low = (exact - high).astype(np.float32)
    return np.stack([high, low], axis=1), 1 + PLANE_SLACK, float(np.float32(depth_far))
