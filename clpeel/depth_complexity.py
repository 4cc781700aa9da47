"""Depth complexity: how many layers each pixel has, and what a picture of them would take, before it is drawn."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from clpeel import costs
from clpeel.binning import BATCH_SHARE, PAIR_BYTES, bin_triangles
from clpeel.camera import Camera
from clpeel.colormap import colors_at
from clpeel.costs import Cost
from clpeel.device import Gpu
from clpeel.draw import draw_tiles, groups_for
from clpeel.errors import InputError
from clpeel.image import save_png
from clpeel.layout import ALL_LAYERS, COMPLEXITY_TOTALS, IS_OPAQUE, OPAQUE_BYTES, Features
from clpeel.program import device_seconds, program
from clpeel.projection import DeviceScene, project, upload
from clpeel.raster import walk_arguments
from clpeel.renderer import (
    LIGHTINGS,
    MIN_MEMORY,
    MOST_LISTED,
    Progress,
    Renderer,
    check_picture_fits,
    checked_size,
    parse_memory,
)
from clpeel.renderer import OPAQUE as OPAQUE_CHOICES
from clpeel.scale_bar import draw_scale_bar
from clpeel.scene import Scene, checked_background
from clpeel.techniques import TECHNIQUES, Technique

STAGE = "counting"

TILE_BYTES = 4 + 4 * COMPLEXITY_TOTALS
"""Of a tile in a batch: where its list begins, and what is counted of it."""

PIXEL_BYTES = 4 + 4 + 4 + 1
"""Of the host's memory: the counts as they come, the two maps, and a heat map."""

SOON = 0.3
"""Seconds: what is done sooner is done once more, as the first time also pays for memory that is new."""

STRIP_PIXELS = 1 << 20
"""Pixels that are gone through at once, which bounds what that takes besides the maps."""


@dataclass(frozen=True)
class Need:
    """What a technique would need for the picture, with its own options left as they are.

    passes: geometry passes, as its paper counts them; peeling takes fewer where nothing more can be seen, as alphas
    leave nothing through that float32 holds. bytes_per_pixel: what it keeps of a pixel, with what opaque
    surfaces take where they come first. exact: whether it blends every layer in order. left_out: fragments that it
    would not show, being behind all that it peels; None where it shows all or does not tell layers apart. seconds: of
    the device, for one picture of a scene that it holds, kernels built: an estimate; None where its cost has not been
    measured.
    """

    technique: str
    passes: int
    bytes_per_pixel: int
    exact: bool
    left_out: int | None
    seconds: float | None


@dataclass(frozen=True, eq=False)
class Complexity:
    """The layers of every pixel and what they would take.

    layers: int32 [height, width], row 0 on top: the transparent fragments in front of the opaque surface, or all where
    opaque="blend". opaque: bool [height, width], where there is an opaque surface. needs: a row for each technique.
    triangles: of the scene. seconds: what counting took, by the device's clock.

    Covered pixels are those with a layer or an opaque surface; figures are of these.
    """

    layers: NDArray[np.int32]
    opaque: NDArray[np.bool_]
    needs: tuple[Need, ...]
    triangles: int
    seconds: float

    @cached_property
    def histogram(self) -> NDArray[np.int64]:
        """How many pixels, covered or not, have 0, 1, ... layers: int64 [max + 1]."""
        flat, most = self.layers.reshape(-1), int(self.layers.max())
        parts = (flat[at : at + STRIP_PIXELS] for at in range(0, len(flat), STRIP_PIXELS))
        return sum((np.bincount(part, minlength=most + 1) for part in parts), np.zeros(most + 1, np.int64))

    @cached_property
    def covered_histogram(self) -> NDArray[np.int64]:
        """The same of covered pixels alone: int64 [max + 1]."""
        histogram = self.histogram.copy()
        histogram[0] = np.count_nonzero(self.opaque & (self.layers == 0))
        return histogram

    @property
    def fragments(self) -> int:
        """All layers of all pixels."""
        return int(self.histogram @ np.arange(len(self.histogram)))

    @property
    def covered(self) -> int:
        """Pixels with a layer or an opaque surface."""
        return int(self.covered_histogram.sum())

    @property
    def covered_share(self) -> float:
        """Those, 0..1 of all."""
        return self.covered / self.layers.size

    @property
    def max(self) -> int:
        """The most layers that a pixel has."""
        return len(self.histogram) - 1

    @property
    def mean(self) -> float:
        """Layers of a covered pixel; 0 where there is none."""
        return self.fragments / self.covered if self.covered else 0.0

    @property
    def median(self) -> int:
        """The least number that at least half of the covered pixels do not exceed; 0 where there is none."""
        return self.percentile(50)

    def percentile(self, percent: float) -> int:
        """The least number of layers that at least so many percent of the covered pixels do not exceed.

        Raises InputError for percents not in 0..100.
        """
        if not 0 <= percent <= 100:
            raise InputError(f"percent: expected 0..100, got {percent!r}")
        if not self.covered:
            return 0
        up_to = np.cumsum(self.covered_histogram)
        return int(np.searchsorted(up_to, max(math.ceil(percent * self.covered / 100), 1)))

    def figures(self) -> dict[str, Any]:
        """All but the maps, as numbers, lists and texts, such as JSON takes."""
        height, width = self.layers.shape
        return {
            "size": [width, height],
            "triangles": self.triangles,
            "fragments": self.fragments,
            "covered_pixels": self.covered,
            "covered_share": self.covered_share,
            "opaque_pixels": int(np.count_nonzero(self.opaque)),
            "layers_max": self.max,
            "layers_mean": self.mean,
            "layers_median": self.median,
            "layers_99th_percentile": self.percentile(99),
            "histogram": self.histogram.tolist(),
            "counting_seconds": self.seconds,
            "techniques": [asdict(need) for need in self.needs],
        }

    def image(self, background: Sequence[float] | None = (1, 1, 1), scale_bar: bool = True) -> NDArray[np.uint8]:
        """The layers in colours, 0 to the most (at least 1), where a pixel is covered: uint8 [height, width, 4].

        background: 3 numbers 0..1, or None for a transparent one, else InputError. scale_bar: in the emptiest corner,
        where there is room.
        """
        over = checked_background(background)
        most = max(self.max, 1)
        colors = np.concatenate([colors_at(np.arange(most + 1) / most), np.ones((most + 1, 1))], axis=-1)
        palette = (colors * 255 + 0.5).astype(np.uint8)
        image = np.empty((*self.layers.shape, 4), np.uint8)
        rows = max(STRIP_PIXELS // self.layers.shape[1], 1)
        for top in range(0, len(image), rows):
            strip = slice(top, top + rows)
            image[strip] = palette[self.layers[strip]]
            empty = ~((self.layers[strip] > 0) | self.opaque[strip])
            image[strip][empty] = (0, 0, 0, 0) if over is None else (np.array([*over, 1]) * 255 + 0.5).astype(np.uint8)
        if scale_bar:
            draw_scale_bar(image, 0, most, "layers", (self.layers > 0) | self.opaque, False, whole=True)
        return image

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the heat map over white as a PNG, whole or not at all. Raises InputError where it cannot."""
        save_png(path, self.image())


def complexity(
    scene: Scene,
    camera: Camera | None = None,
    size: tuple[int, int] = (1024, 1024),
    lighting: str = "none",
    *,
    opaque: str = "first",
    memory: int | str | None = None,
    device: int | str | None = None,
    lanes: int | None = None,
    progress: Progress | None = None,
) -> Complexity:
    """Counts the layers of every pixel, of one sample each, and says what each technique would need.

    All are as for `render`: camera, by default `Camera.frame(scene)`; size: (width, height) in pixels; lighting, which
    only makes estimates longer; opaque: "first" counts transparent fragments in front of opaque surfaces alone, "blend"
    all; memory: bytes, or text such as "512M"; device, lanes; progress: called with the share done (0..1) and a text.
    Raises InputError on any of these that cannot be.
    """
    gpu = Renderer(scene, device, lanes).gpu
    size = checked_size(size)
    if lighting not in LIGHTINGS:
        raise InputError(f"lighting: expected one of {', '.join(LIGHTINGS)}; got {lighting!r}")
    if opaque not in OPAQUE_CHOICES:
        raise InputError(f"opaque: expected one of {', '.join(OPAQUE_CHOICES)}; got {opaque!r}")
    check_picture_fits(size, PIXEL_BYTES)
    limit = None if memory is None else parse_memory(memory)
    if camera is None:
        camera = Camera.frame(scene, aspect=size[0] / size[1])
    report = progress or (lambda done, text: None)
    report(0.0, "uploading")
    on_device = upload(gpu, scene)
    told = None if progress is None else report
    counted = count_layers(gpu, on_device, camera, size, opaque == "first", limit, told)
    if counted.seconds < SOON:
        again = count_layers(gpu, on_device, camera, size, opaque == "first", limit, told)
        counted = replace(
            counted,
            setup_seconds=min(counted.setup_seconds, again.setup_seconds),
            walk_seconds=min(counted.walk_seconds, again.walk_seconds),
        )
    report(1.0, "done")
    shaded = replace(counted.features, headlight=lighting != "none").fragment_color
    needs = tuple(need_of(name, counted, shaded) for name in TECHNIQUES)
    return Complexity(counted.layers, counted.opaque, needs, len(scene.faces), counted.seconds)


# --- counting ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Counted:
    """What counting found.

    layers, opaque: as of Complexity. tiles: int64 [tiles, COMPLEXITY_TOTALS] (depth_complexity.cl); records: int64
    [tiles], how long their lists are. features: of the scene. setup_seconds, walk_seconds: of the stages before, and
    of counting.
    """

    layers: NDArray[np.int32]
    opaque: NDArray[np.bool_]
    tiles: NDArray[np.int64]
    records: NDArray[np.int64]
    features: Features
    setup_seconds: float
    walk_seconds: float

    @property
    def seconds(self) -> float:
        """Of all stages."""
        return self.setup_seconds + self.walk_seconds


def count_layers(
    gpu: Gpu,
    scene: DeviceScene,
    camera: Camera,
    size: tuple[int, int],
    opaque_first: bool,
    limit: int | None = None,
    report: Progress | None = None,
) -> Counted:
    """Counts the layers of a view, tiles in batches whose lists fit `limit` bytes with the scene."""
    gpu.events.clear()
    triangles = project(gpu, scene, camera, size, False, opaque_first)
    features = triangles.features
    held = scene.nbytes + triangles.nbytes
    budget = max(gpu.default_budget(held) if limit is None else limit - held, MIN_MEMORY)
    largest = int(gpu.device.max_mem_alloc_size)
    tiles = bin_triangles(gpu, triangles, budget // BATCH_SHARE)
    # Neither colours nor what depths were computed from plays a part any more: fewer builds.
    plain = replace(features, perspective=True, low_positions=False, color_rate="scene", packed_color=True)
    kernel = program(gpu, "depth_complexity.cl", plain, ALL_OPAQUE=int(features.surfaces == "opaque"))["count_layers"]
    width, height = size
    counts = np.empty((height, width), np.uint32)
    on_device = cl.Buffer(gpu.context, cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR, hostbuf=counts)
    done_pairs = np.cumsum(tiles.tile_pairs) / max(int(tiles.tile_pairs.sum()), 1)

    def at_tile(tile: int) -> None:
        if report is not None:
            report(float(done_pairs[tile - 1]), "counting")

    found: list[NDArray[np.uint32]] = []
    for batch in tiles.batches(min(budget // BATCH_SHARE, largest, MOST_LISTED), TILE_BYTES + PAIR_BYTES):
        totals = gpu.buffer("tile_totals", 4 * COMPLEXITY_TOTALS * batch.tiles)
        draw_tiles(
            gpu,
            STAGE,
            kernel,
            groups_for(gpu, batch),
            batch,
            None if report is None else at_tile,
            **walk_arguments(triangles, batch),
            layers=on_device,
            tile_totals=totals,
        )
        found.append(gpu.get(totals, (batch.tiles, COMPLEXITY_TOTALS), np.uint32))
    mapped, _ = cl.enqueue_map_buffer(
        gpu.queue, on_device, cl.map_flags.READ, 0, counts.shape, counts.dtype, is_blocking=True
    )
    mapped.base.release(gpu.queue)
    stages, _ = device_seconds(gpu)
    on_device.release()
    return Counted(
        layers=(counts & np.uint32(IS_OPAQUE - 1)).view(np.int32),
        opaque=counts >= np.uint32(IS_OPAQUE),
        tiles=np.concatenate(found).astype(np.int64),
        records=tiles.tile_pairs,
        features=features,
        setup_seconds=sum(seconds for stage, seconds in stages.items() if stage != STAGE),
        walk_seconds=stages.get(STAGE, 0.0),
    )


# --- what it would take -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Work:
    """How often the things are done that have a cost (costs.py); walk: nanoseconds that counting would take for it."""

    walk: float
    fragment: float
    shaded: float
    pixel: float

    def nanoseconds(self, cost: Cost) -> float:
        """What it takes where the costs were measured."""
        return sum(count * each for count, each in zip(astuple(self), astuple(cost), strict=True))


def counting_nanoseconds(records: Any, visits: Any) -> Any:
    """Of a walk over so many records that visits so many strips, but for what counting stores of each pixel."""
    return costs.RECORD * records + costs.VISIT * visits


def work_of(technique: Technique, counted: Counted, shaded: bool) -> Work:
    """What drawing takes: all of a tile's transparent records once in each pass that the tile needs.

    A tile makes as many passes as its own deepest pixel needs, and one to find that there is none (peel.h).
    """
    fragments, deepest, solid, all_fragments, all_deepest, visits, opaque_visits, opaque_records = counted.tiles.T
    records, pixels = counted.records, counted.layers.size
    if technique.maps:  # of all surfaces, whatever their alphas
        fragments, deepest, visits = all_fragments, all_deepest, visits + opaque_visits
        opaque_visits = opaque_records = np.zeros_like(records)
    elif counted.features.surfaces == "opaque":
        drawn = float(solid.sum())
        return Work(
            counting_nanoseconds(float(records.sum()), float(opaque_visits.sum())), drawn, drawn * shaded, pixels
        )
    records = records - opaque_records
    different, which = np.unique(deepest, return_inverse=True)
    passes = np.array([max(technique.passes_for(int(layers), {}), 1) for layers in different], np.float64)[which]
    drawn = float(fragments.sum()) - (left_out_by(technique, counted) or 0)
    walks = passes * counting_nanoseconds(records, visits) + counting_nanoseconds(opaque_records, opaque_visits)
    return Work(
        walk=float(walks.sum()),
        fragment=drawn,
        shaded=drawn * shaded,
        pixel=pixels,
    )


def left_out_by(technique: Technique, counted: Counted) -> int | None:
    """Fragments behind all that it peels of their pixel; None where it does not tell layers apart."""
    if technique.peeled is None:
        return None
    peeled = sum(technique.peeled())
    return int(np.maximum(counted.layers - peeled, 0).sum(dtype=np.int64)) if peeled < ALL_LAYERS else 0


def scale_of(counted: Counted) -> float:
    """How many times as long counting took as it does where the costs were measured."""
    expected = counting_nanoseconds(float(counted.records.sum()), float(counted.tiles[:, 5:7].sum()))
    expected += costs.PIXEL * counted.layers.size
    return counted.walk_seconds * 1e9 / expected


def estimated_seconds(name: str, counted: Counted, shaded: bool) -> float | None:
    """Of the stages before, as measured, and of drawing by the table, scaled as counting was beside the table."""
    technique = TECHNIQUES[name]
    all_opaque = counted.features.surfaces == "opaque" and not technique.maps
    cost = costs.OPAQUE if all_opaque else costs.COSTS.get(name)
    if cost is None:
        return None
    return counted.setup_seconds + 1e-9 * scale_of(counted) * work_of(technique, counted, shaded).nanoseconds(cost)


def need_of(name: str, counted: Counted, shaded: bool) -> Need:
    """What the technique of that name would need."""
    technique = TECHNIQUES[name]
    surfaces = counted.features.surfaces
    # Maps are of all surfaces, whatever their alphas; all others have nothing left to do where all is opaque.
    deepest = int(counted.tiles[:, 4 if technique.maps else 1].max())
    nothing = surfaces == "opaque" and not technique.maps
    kept = technique.buffer_bytes(deepest, {})
    return Need(
        technique=name,
        passes=0 if nothing else technique.passes_for(deepest, {}),
        bytes_per_pixel=kept + (OPAQUE_BYTES if surfaces == "mixed" and not technique.maps else 0),
        exact=technique.exact,
        left_out=left_out_by(technique, counted),
        seconds=estimated_seconds(name, counted, shaded),
    )
