"""Wires: edges of faces that are drawn, as they lie on the device (kernels/shading/wires.h)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.checks import Rgb
from clpeel.device.layout import (
    ALIKE,
    BAND_CORNERS,
    BAND_TRIANGLES,
    FIRST_ONE_SIDED,
    FOREIGN,
    MOST_AROUND,
    PADDING,
    SECOND_ONE_SIDED,
    WIRED,
)
from clpeel.device.program import Arguments, Kernel, launch
from clpeel.device.records import VERTEX, WIRE, WIRING
from clpeel.device.workspace import Workspace
from clpeel.scene.edges import Edges, edges_of
from clpeel.scene.scene import Scene
from clpeel.stages.outlines import Length


@dataclass(frozen=True)
class Wanted:
    """Which edges are drawn: all; features, which bend by more than an angle in degrees; and outlines."""

    all: bool = False
    angle: float | None = None
    outlines: bool = False


@dataclass(frozen=True)
class Wires:
    """How edges are drawn.

    color: as the fragments have theirs, sRGB or linear, 0..1. opacity: 0..1. width: of their strokes. hidden: the
    opacity of those behind opaque surfaces.
    """

    wanted: Wanted
    color: Rgb
    opacity: float
    width: Length
    hidden: float = 0.0


@dataclass(frozen=True, eq=False)
class DeviceEdges:
    """The edges of a scene that may be drawn, on the device.

    edges: int32 [e, 4], vertices at the ends and across (Edges). kinds: uint8 [e], WIRED | ... (layout.py). lists:
    uint32, for each face where its edges begin behind these m + 1 numbers, and then the edges, some of them FOREIGN.
    faces_of: int32 [e], a face of each; first_faces: the same, on the host. places: uint32 [n]. around_starts, around:
    uint32, the edges that end at each place. nbytes: of all on the device. found, wanted: all edges of the scene, and
    which of them these are.
    """

    found: Edges
    wanted: Wanted
    count: int
    faces: int
    edges: cl.Buffer
    kinds: cl.Buffer
    lists: cl.Buffer
    faces_of: cl.Buffer
    places: cl.Buffer
    around_starts: cl.Buffer
    around: cl.Buffer
    first_faces: NDArray[np.int32]
    nbytes: int


def edges_on_device(gpu: Workspace, scene: Scene, wanted: Wanted, before: DeviceEdges | None) -> DeviceEdges:
    """Puts the edges of a scene on the device that are wanted.

    before: those that were wanted last of a scene with the same faces, if any were. All edges are found once.
    """
    found = edges_of(scene) if before is None else before.found
    wired = ~found.inner if wanted.all else np.zeros(len(found.ends), np.bool_)
    if wanted.angle is not None:
        wired |= found.features(wanted.angle)
    lists = _lists(found, wired, scene.faces)
    struck = np.append(lists[1 : len(scene.faces) + 1] > lists[: len(scene.faces)], False)  # faces with strokes on them
    kept = np.flatnonzero(wired | wanted.outlines | struck[found.faces].any(axis=1))
    number = np.full(len(found.ends), -1, np.int32)
    number[kept] = np.arange(len(kept))
    listed = lists[len(scene.faces) + 1 :]
    listed[:] = number[listed & ~np.uint32(FOREIGN)].astype(np.uint32) | listed & np.uint32(FOREIGN)
    arrays = {
        "edges": np.concatenate([found.ends, found.apexes], axis=1)[kept],
        "kinds": _kinds(scene, found, wired)[kept],
        "lists": lists,
        "faces_of": found.faces[kept, 0],
        "places": found.places.astype(np.uint32),
    }
    arrays["around_starts"], arrays["around"] = _around(found.places[found.ends[kept]], len(found.places))
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    spare = np.zeros(4, np.uint32)  # as no buffer may be empty
    held = {
        name: cl.Buffer(gpu.context, flags, hostbuf=np.ascontiguousarray(array) if array.size else spare)
        for name, array in arrays.items()
    }
    nbytes = sum(array.nbytes for array in arrays.values())
    first_faces = found.faces[kept, 0]
    return DeviceEdges(found, wanted, len(kept), len(scene.faces), **held, first_faces=first_faces, nbytes=nbytes)


def _kinds(scene: Scene, edges: Edges, wired: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return what is known of each edge before it is seen: WIRED | ..."""
    kinds = np.where(wired, WIRED, 0) | np.where(edges.alike, ALIKE, 0)
    if scene.single_sided is not None:
        one_sided = np.append(scene.single_sided, False)[edges.faces]  # -1 stands for no face
        kinds |= np.where(one_sided[:, 0], FIRST_ONE_SIDED, 0) | np.where(one_sided[:, 1], SECOND_ONE_SIDED, 0)
    return kinds.astype(np.uint8)


def _around(places: NDArray[np.int32], count: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Return where the edges that end at each of `count` places begin in a list, and the list.

    places: of their ends, [e, 2].
    """
    at = places.reshape(-1)
    starts = np.zeros(count + 1, np.uint32)
    np.cumsum(np.bincount(at, minlength=count), out=starts[1:])
    return starts, (np.argsort(at, kind="stable") // 2).astype(np.uint32)


def _lists(edges: Edges, wired: NDArray[np.bool_], faces: NDArray[np.int32]) -> NDArray[np.uint32]:
    """Return where the edges of each face begin in this very list, [m + 1], and then the edges.

    A face has its own, and FOREIGN ones: those that end at a corner where not both of its own are drawn. Where both
    are, one of them is nearer than any edge beyond it.
    """
    own = np.append(wired, False)[edges.of_face]  # -1, which is no edge, is not drawn
    face, side = np.nonzero(own)
    owners, listed = [face], [edges.of_face[face, side]]
    drawn = np.flatnonzero(wired)
    starts, around = _around(edges.places[edges.ends[drawn]], len(edges.places))
    corner = edges.places[faces]
    several = (starts[1:] - starts[:-1]).astype(np.int64)
    open_corners = ~(own & own[:, [2, 0, 1]]) & (several[corner] > 0) & (several[corner] <= MOST_AROUND)
    face, side = np.nonzero(open_corners & (edges.of_face >= 0))
    each = several[corner[face, side]]
    first = np.repeat(starts[corner[face, side]].astype(np.int64) - (np.cumsum(each) - each), each)
    touching, face = drawn[around[first + np.arange(int(each.sum()))]], np.repeat(face, each)
    foreign = (edges.of_face[face] != touching[:, None]).all(axis=1)
    owners.append(face[foreign])
    listed.append(touching[foreign] | FOREIGN)
    owner, edge = np.concatenate(owners), np.concatenate(listed)
    order = np.argsort(owner, kind="stable")
    begin = np.zeros(len(faces) + 1, np.int64)
    np.cumsum(np.bincount(owner, minlength=len(faces)), out=begin[1:])
    return np.concatenate([begin + len(begin), edge[order]]).astype(np.uint32)


@dataclass(frozen=True)
class Wired:
    """The edges of a scene on the device, and how they are drawn."""

    edges: DeviceEdges
    wires: Wires


@dataclass(frozen=True)
class Seen:
    """The edges of a view: kernel arguments, and its triangles with those of bands.

    edges: of the scene. shading: WIRING, the lists, and WIRE of all edges and bands. behind: the same for those that
    opaque surfaces hide; None if these do not show. faces: uint32 [m, 3] of the scene with bands behind. vertices:
    VERTEX of the scene with those of bands behind. chosen: the edge of each band, on the host.
    """

    edges: DeviceEdges
    shading: Arguments
    behind: Arguments | None
    faces: cl.Buffer
    vertices: cl.Buffer
    chosen: NDArray[np.uint32]

    @property
    def bands(self) -> int:
        """How many bands there are."""
        return len(self.chosen)

    @property
    def band_faces(self) -> NDArray[np.int32]:
        """A face that each band's edge is of."""
        return self.edges.first_faces[self.chosen]

    @property
    def nbytes(self) -> int:
        """Bytes of the edges, and of what bands add."""
        return self.edges.nbytes + (WIRE.itemsize + VERTEX.itemsize * BAND_CORNERS + 12 * BAND_TRIANGLES) * self.bands


def see_edges(
    gpu: Workspace,
    kernels: dict[str, Kernel],
    wired: Wired,
    stage: str,
    widths: Arguments,
    margin: float,
    one_sided: bool,
    points: Arguments,
    vertices: cl.Buffer,
    faces: cl.Buffer,
    vertex_count: int,
    face_count: int,
) -> Seen:
    """Finds where the edges are in a view, and makes the bands of those with a surface on one side alone.

    widths: half_width, half_by_depth and across of strokes. margin: in subpixels, see expand_bands. points: arguments
    of kernels that project points. vertex_count, face_count: before those of bands.
    """
    edges, wires = wired.edges, wired.wires
    own: Arguments = {"edges": edges.edges, "across": widths["across"], **points}
    sides = gpu.buffer("edge_sides", max(edges.count, 1))
    seen = gpu.buffer("wires", WIRE.itemsize * max(edges.count, 1))
    launch(
        gpu,
        stage,
        kernels["see_edges"],
        edges.count,
        None,
        edge_count=edges.count,
        kinds=edges.kinds,
        one_sided=one_sided,
        half_width=widths["half_width"],
        half_by_depth=widths["half_by_depth"],
        vertices=vertices,
        wires=seen,
        sides=sides,
        **own,
    )
    found = gpu.get(sides, edges.count, np.int8) if edges.count else np.zeros(0, np.int8)
    chosen = np.flatnonzero(found).astype(np.uint32)
    bands = len(chosen)
    if bands:
        seen = _longer(gpu, "banded_wires", seen, WIRE.itemsize * edges.count, WIRE.itemsize * bands)
        faces = _longer(gpu, "banded_faces", faces, 12 * face_count, 12 * BAND_TRIANGLES * bands)
        room = VERTEX.itemsize * (BAND_CORNERS * bands + PADDING)
        vertices = _longer(gpu, "banded_vertices", vertices, VERTEX.itemsize * vertex_count, room)
        launch(
            gpu,
            stage,
            kernels["expand_bands"],
            bands,
            None,
            chosen=gpu.put("banded_edges", chosen),
            band_count=bands,
            sides=sides,
            kinds=edges.kinds,
            outlines=edges.wanted.outlines,
            faces_of=edges.faces_of,
            places=edges.places,
            around_starts=edges.around_starts,
            around=edges.around,
            margin=margin,
            first_vertex=vertex_count,
            first_face=face_count,
            first_wire=edges.count,
            wires=seen,
            faces=faces,
            vertices=vertices,
            **own,
        )
    wiring = np.zeros(1, WIRING)
    wiring["first_band"], wiring["bands"], wiring["faces"] = face_count, edges.count, edges.faces

    def shading(name: str, opacity: float) -> Arguments:
        wiring["color"] = (*wires.color, opacity)
        return {"wiring": gpu.put(name, wiring), "wire_lists": edges.lists, "wires": seen}

    behind = shading("wiring_behind", wires.hidden) if wires.hidden else None
    return Seen(edges, shading("wiring", wires.opacity), behind, faces, vertices, chosen)


def _longer(gpu: Workspace, name: str, held: cl.Buffer, nbytes: int, more: int) -> cl.Buffer:
    """Copies so many bytes of a buffer to the beginning of one that has room for more."""
    found = gpu.buffer(name, nbytes + more)
    if nbytes:
        cl.enqueue_copy(gpu.queue, found, held, byte_count=nbytes)
    return found
