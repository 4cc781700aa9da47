"""Counting: how many layers pixels have, and how much work their tiles are (counting.cl).

It counts all tiles of a picture, or a sample of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel.device.layout import IS_OPAQUE, Features
from clpeel.device.memory import Budget
from clpeel.device.program import Kernel, device_seconds, launch, program
from clpeel.device.records import COUNT_TOTALS
from clpeel.device.workspace import Workspace
from clpeel.scene.camera import Camera
from clpeel.stages.binning import PAIR_BYTES, Batch, bin_triangles
from clpeel.stages.outlines import PLAIN_MARKS, Marks
from clpeel.stages.projection import Triangles, project
from clpeel.stages.tiles import draw_tiles, groups_for, walk_arguments
from clpeel.stages.upload import DeviceScene

STAGE = "counting"

WIDE_TOTALS = np.dtype([(name, np.int64) for name in COUNT_TOTALS.names or ()])
"""COUNT_TOTALS in 64 bits, so that sums over many tiles fit."""

TILE_BYTES = 4 + COUNT_TOTALS.itemsize
"""Bytes that a tile takes in a batch besides its list: where the list begins, and the tile's totals."""

LOOKED_AT = 96
"""How many tiles look_at_some counts at most: enough to estimate a picture's layers, and a small part of its work."""


@dataclass(frozen=True, eq=False)
class TileCounts:
    """What was counted in n tiles, which are all tiles of a picture or a sample of them.

    totals: WIDE_TOTALS [n]. records: int64 [n], the lengths of the tiles' lists. weights: float64 [n], how many tiles
    each of these stands for. pixels: the number of pixels of the picture. features: those of its triangles.
    vector_width: of the device that counted (Workspace.vector_width).
    """

    totals: NDArray[np.void]
    records: NDArray[np.int64]
    weights: NDArray[np.float64]
    pixels: int
    features: Features
    vector_width: int


@dataclass(frozen=True, eq=False)
class Counted:
    """What counting a whole picture found.

    layers: int32 [height, width], fragments of transparent surfaces in front of the first opaque one. opaque: bool
    [height, width], whether there is an opaque surface. setup_seconds, walk_seconds: seconds by the device's clock of
    the stages before counting, and of counting.
    """

    layers: NDArray[np.int32]
    opaque: NDArray[np.bool_]
    tiles: TileCounts
    setup_seconds: float
    walk_seconds: float

    @property
    def seconds(self) -> float:
        """Seconds of all stages together."""
        return self.setup_seconds + self.walk_seconds


def counting_kernel(gpu: Workspace, features: Features) -> Kernel:
    """The counting kernel. Colours do not affect counts, unless texels route fragments.

    So the features of colours have fixed values here, and fewer kernels are built.
    """
    plain = Features(features.lanes, surfaces=features.surfaces, depth_format=features.depth_format)
    plain = features if features.routed else plain
    return program(gpu, "stages/counting.cl", plain, ALL_OPAQUE=int(features.surfaces == "opaque"))["count_layers"]


def count_layers(
    gpu: Workspace,
    scene: DeviceScene,
    camera: Camera,
    size: tuple[int, int],
    opaque_first: bool,
    limit: int | None = None,
    report: Callable[[float], None] | None = None,
    *,
    backfaces: str = "default",
    probes: int = 1,
    marks: Marks = PLAIN_MARKS,
) -> Counted:
    """Counts the layers of a view, batch by batch. The scene and a batch's lists fit `limit` bytes together.

    size: (width, height) in pixels. opaque_first: leave fragments behind opaque surfaces out of the counts. limit: None
    for a share of the device's memory. report: called now and then with the share done, 0..1. backfaces, probes,
    marks: as for `project`.
    """
    gpu.events.clear()
    triangles = project(gpu, scene, camera, size, False, opaque_first, backfaces=backfaces, probes=probes, marks=marks)
    budget = Budget.of(gpu, limit, scene.nbytes + triangles.nbytes)
    tiles = bin_triangles(gpu, triangles, budget.lists)
    kernel = counting_kernel(gpu, triangles.features)
    width, height = size
    counts = np.empty((height, width), np.uint32)
    on_device = cl.Buffer(gpu.context, cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR, hostbuf=counts)
    done = np.cumsum(tiles.tile_pairs) / max(int(tiles.tile_pairs.sum()), 1)
    at_tile = None if report is None else lambda tile: report(float(done[tile - 1]))
    found: list[NDArray[np.void]] = []
    for batch in tiles.batches(budget.batch, TILE_BYTES + PAIR_BYTES):
        totals = gpu.buffer("tile_totals", COUNT_TOTALS.itemsize * batch.tiles)
        draw_tiles(
            gpu,
            STAGE,
            kernel,
            groups_for(gpu, batch),
            batch,
            at_tile,
            {
                **walk_arguments(triangles, batch),
                **triangles.shading,
                "chosen": None,
                "layers": on_device,
                "tile_totals": totals,
            },
        )
        found.append(gpu.get(totals, batch.tiles, COUNT_TOTALS))
    mapped, _ = cl.enqueue_map_buffer(
        gpu.queue, on_device, cl.map_flags.READ, 0, counts.shape, counts.dtype, is_blocking=True
    )
    mapped.base.release(gpu.queue)
    stages, _ = device_seconds(gpu)
    on_device.release()
    totals = np.concatenate(found).astype(WIDE_TOTALS)
    return Counted(
        layers=(counts & np.uint32(IS_OPAQUE - 1)).view(np.int32),
        opaque=counts >= np.uint32(IS_OPAQUE),
        tiles=TileCounts(
            totals, tiles.tile_pairs, np.ones(len(totals)), width * height, triangles.features, gpu.vector_width
        ),
        setup_seconds=sum(seconds for stage, seconds in stages.items() if stage != STAGE),
        walk_seconds=stages.get(STAGE, 0.0),
    )


def look_at_some(gpu: Workspace, triangles: Triangles, batch: Batch) -> TileCounts:
    """Counts a sample of a batch's tiles, LOOKED_AT at most.

    Samples are taken at even steps through the batch's records. So the chance of a tile is proportional to the length
    of its list, and quantities that grow with the lists are estimated best. The weights undo this: a tile that was hit
    `times` times stands for times * (records / LOOKED_AT) / (its list's length) tiles of the batch.
    """
    ends = np.cumsum(batch.tile_pairs)
    total = int(ends[-1])
    steps = (np.arange(LOOKED_AT) + 0.5) * (total / LOOKED_AT)
    chosen, times = np.unique(np.searchsorted(ends, steps, side="right"), return_counts=True)
    records = batch.tile_pairs[chosen]
    totals = gpu.buffer("looked_at", COUNT_TOTALS.itemsize * len(chosen))
    launch(
        gpu,
        STAGE,
        counting_kernel(gpu, triangles.features),
        min(groups_for(gpu, batch), len(chosen)),
        gpu.lanes,
        **walk_arguments(triangles, batch),
        **triangles.shading,
        next_tile=gpu.put("next_tile", np.zeros(1, np.uint32)),
        to_tile=len(chosen),
        chosen=gpu.put("chosen", chosen.astype(np.uint32)),
        layers=None,
        tile_totals=totals,
    )
    counted = gpu.get(totals, len(chosen), COUNT_TOTALS).astype(WIDE_TOTALS)
    width, height = triangles.size
    weights = times * (total / LOOKED_AT) / records
    return TileCounts(counted, records, weights, width * height, triangles.features, gpu.vector_width)
