"""Depth complexity: counts the layers of each pixel, and estimates the cost of a picture before it is drawn."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import GivenBackground, checked_background
from clpeel.device.layout import ALL_LAYERS, PointType
from clpeel.errors import InputError
from clpeel.files import write_whole
from clpeel.pictures.background import levels_of
from clpeel.pictures.colormap import colors_at
from clpeel.pictures.encode import encode
from clpeel.pictures.formats import EIGHT_BITS, chosen
from clpeel.pictures.scale_bar import draw_scale_bar
from clpeel.pictures.shown import Shown
from clpeel.rendering.checking import check_counting
from clpeel.rendering.estimates import estimated_seconds
from clpeel.rendering.options import Lighting, Opaque, PictureOptions, Size
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.request import Progress, check_picture_fits, marks_of
from clpeel.scene.camera import Camera, GivenCamera, checked_camera
from clpeel.scene.scene import Scene
from clpeel.stages.counting import Counted, count_layers
from clpeel.stages.outlines import shape_of
from clpeel.stages.upload import upload
from clpeel.techniques import TECHNIQUES, AnyTechnique
from clpeel.techniques.technique import opaque_bytes

PIXEL_BYTES = 4 + 4 + 4 + 1
"""Host memory of a pixel, in bytes: the counts as they come, the two maps, and a heat map."""

SOON = 0.3
"""A count that takes fewer seconds than this is repeated, because the first one also pays for new memory."""

STRIP_PIXELS = 1 << 20
"""The number of pixels that are processed at once. This bounds the memory that is needed besides the maps."""


@dataclass(frozen=True)
class Need:
    """What a technique would need for the picture, with its own options at their defaults.

    passes: geometry passes, as its paper counts them. Peeling may take fewer: it stops once the layers in front let no
    light through that float32 can hold.
    bytes_per_pixel: what it keeps per pixel, including what opaque surfaces take if they come first. exact: whether it
    blends every layer in order.
    left_out: how many fragments it would not show because they are behind all layers that it peels. None if it does not
    sort layers.
    seconds: estimated device time of one picture, once the scene is on the device and the kernels are built. None if
    its cost has not been measured.
    """

    technique: str
    passes: int
    bytes_per_pixel: int
    exact: bool
    left_out: int | None
    seconds: float | None


@dataclass(frozen=True, eq=False)
class Complexity:
    """The layers of every pixel, and what each technique would need.

    layers: int32 [height, width], row 0 on top. These are the transparent fragments in front of the opaque surface, or
    all fragments if opaque="blend". opaque: bool [height, width], whether there is an opaque surface. needs: one entry
    for each technique. triangles, lines, points: of the scene. seconds: what counting took, by the device's clock.

    A pixel is covered if it has a layer or an opaque surface. The mean, the median and the percentiles are those of the
    covered pixels.
    """

    layers: NDArray[np.int32]
    opaque: NDArray[np.bool_]
    needs: tuple[Need, ...]
    triangles: int
    seconds: float
    lines: int = 0
    points: int = 0

    @cached_property
    def histogram(self) -> NDArray[np.int64]:
        """The number of pixels, covered or not, with 0, 1, ... layers: int64 [max + 1]."""
        flat, most = self.layers.reshape(-1), int(self.layers.max())
        parts = (flat[at : at + STRIP_PIXELS] for at in range(0, len(flat), STRIP_PIXELS))
        return sum((np.bincount(part, minlength=most + 1) for part in parts), np.zeros(most + 1, np.int64))

    @cached_property
    def covered_histogram(self) -> NDArray[np.int64]:
        """The number of covered pixels with 0, 1, ... layers: int64 [max + 1]."""
        histogram = self.histogram.copy()
        histogram[0] = np.count_nonzero(self.opaque & (self.layers == 0))
        return histogram

    @property
    def fragments(self) -> int:
        """The number of layers of all pixels together."""
        return int(self.histogram @ np.arange(len(self.histogram)))

    @property
    def covered(self) -> int:
        """The number of pixels with a layer or an opaque surface."""
        return int(self.covered_histogram.sum())

    @property
    def covered_share(self) -> float:
        """The share of the pixels that are covered, 0..1."""
        return self.covered / self.layers.size

    @property
    def max(self) -> int:
        """The most layers that a pixel has."""
        return len(self.histogram) - 1

    @property
    def mean(self) -> float:
        """The mean number of layers of a covered pixel, or 0 if there is none."""
        return self.fragments / self.covered if self.covered else 0.0

    @property
    def median(self) -> int:
        """The least number of layers that at least half of the covered pixels do not exceed, or 0 if there is none."""
        return self.percentile(50)

    def percentile(self, percent: float) -> int:
        """Return the least number of layers that at least so many percent of the covered pixels do not exceed.

        Returns 0 if no pixel is covered. Raises InputError for percents outside 0..100.
        """
        if not 0 <= percent <= 100:
            raise InputError(f"percent: expected 0..100, got {percent!r}")
        if not self.covered:
            return 0
        up_to = np.cumsum(self.covered_histogram)
        return int(np.searchsorted(up_to, max(math.ceil(percent * self.covered / 100), 1)))

    def figures(self) -> dict[str, Any]:
        """Return everything except the maps as numbers, lists and texts, ready for JSON."""
        height, width = self.layers.shape
        return {
            "size": [width, height],
            "triangles": self.triangles,
            "lines": self.lines,
            "points": self.points,
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

    def image(self, background: GivenBackground = (1, 1, 1), scale_bar: bool = True) -> NDArray[np.uint8]:
        """Return a heat map: uint8 [height, width, 4]. Covered pixels have the colour of their number of layers.

        The colours range from 0 layers to the most layers (at least 1). background: a colour, a pair (top, bottom), or
        None for a transparent one; else raises InputError. scale_bar: whether to draw one into the emptiest corner, if
        there is room.
        """
        over = checked_background(background)
        most = max(self.max, 1)
        colors = np.concatenate([colors_at(np.arange(most + 1) / most), np.ones((most + 1, 1))], axis=-1)
        palette = (colors * 255 + 0.5).astype(np.uint8)
        image = np.empty((*self.layers.shape, 4), np.uint8)
        height, width = self.layers.shape
        behind = np.zeros((height, 1, 4), np.uint8) if over is None else levels_of(over, height)
        rows = max(STRIP_PIXELS // width, 1)
        for top in range(0, len(image), rows):
            strip = slice(top, top + rows)
            image[strip] = palette[self.layers[strip]]
            empty = ~((self.layers[strip] > 0) | self.opaque[strip])
            image[strip][empty] = np.broadcast_to(behind[strip], image[strip].shape)[empty]
        if scale_bar:
            draw_scale_bar(image, 0, most, "layers", (self.layers > 0) | self.opaque, False, whole=True)
        return image

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the heat map over white as .png, .jpg, .webp or .tif, whole or not at all.

        Raises InputError if it cannot be written.
        """
        found = chosen(path, among=EIGHT_BITS)
        write_whole(path, encode(Shown(self.image(), None), found))


def complexity(
    scene: Scene,
    camera: GivenCamera | None = None,
    size: Size = (1024, 1024),
    lighting: Lighting = "none",
    *,
    opaque: Opaque = "first",
    memory: int | str | None = None,
    device: int | str | None = None,
    lanes: int | None = None,
    line_width: float | str = PictureOptions.line_width,
    point_size: float | str = PictureOptions.point_size,
    point_type: PointType = PictureOptions.point_type,
    progress: Progress | None = None,
) -> Complexity:
    """Count the layers of every pixel, with one sample each, and estimate what each technique would need.

    The parameters are those of `render`. camera: by default `Camera.frame(scene)`. size: (width, height) in pixels.
    lighting: affects the estimates of time only. opaque: "first" counts only the transparent fragments in front of
    opaque surfaces, "blend" counts all fragments. memory: bytes, or text such as "512M". device, lanes. line_width,
    point_size, point_type: of lines and points. progress: is
    called with the share that is done (0..1) and a text. Raises InputError if any of these is invalid, and DeviceError
    if the device's kernels count known layers wrongly.
    """
    renderer = Renderer(scene, device, lanes)
    picture = PictureOptions(
        size=size,
        lighting=lighting,
        opaque=opaque,
        memory=memory,
        line_width=line_width,
        point_size=point_size,
        point_type=point_type,
    )
    check_picture_fits(picture.size, PIXEL_BYTES)
    camera = checked_camera(scene, camera, picture.size[0] / picture.size[1])
    report = progress or (lambda done, text: None)
    report(0.0, "uploading")
    with renderer.working():
        counted = _counted(renderer, camera, picture, progress)
    report(1.0, "done")
    shaded = replace(counted.tiles.features, headlight=picture.lighting != "none").fragment_color
    needs = tuple(need_of(technique, counted, shaded) for technique in TECHNIQUES.values())
    return Complexity(counted.layers, counted.opaque, needs, scene.counts[0], counted.seconds, *scene.counts[1:])


def _counted(renderer: Renderer, camera: Camera, picture: PictureOptions, progress: Progress | None) -> Counted:
    """Return the counts of the view. If a count takes less than SOON, it is repeated and the least times are kept."""
    scene, marks = renderer.scene, marks_of(picture)
    shape = shape_of(scene, marks, camera, picture.size[1], False)
    on_device = upload(renderer.gpu, scene, shape=shape)
    told = None if progress is None else lambda done: progress(done, "counting")

    def count() -> Counted:
        opaque_first = picture.opaque == "first"
        return count_layers(
            renderer.gpu,
            on_device,
            camera,
            picture.size,
            opaque_first,
            picture.memory_limit,
            told,
            backfaces=picture.backface_type,
            probes=picture.anisotropy,
            marks=marks,
        )

    counted = count()
    check_counting(renderer, on_device, counted.tiles.features, not camera.orthographic)
    if counted.seconds >= SOON:
        return counted
    again = count()
    return replace(
        counted,
        setup_seconds=min(counted.setup_seconds, again.setup_seconds),
        walk_seconds=min(counted.walk_seconds, again.walk_seconds),
    )


def left_out_by(technique: AnyTechnique, counted: Counted) -> int | None:
    """Return how many fragments lie behind all layers that the technique peels, or None if it does not sort layers."""
    depth = technique.peeled(technique.options())
    if depth is None:
        return None
    peeled = sum(depth)
    return int(np.maximum(counted.layers - peeled, 0).sum(dtype=np.int64)) if peeled < ALL_LAYERS else 0


def need_of(technique: AnyTechnique, counted: Counted, shaded: bool) -> Need:
    """Return what the technique would need, with its own options at their defaults."""
    options = technique.options()
    surfaces = counted.tiles.features.surfaces
    # Some techniques treat opaque surfaces like all others. The rest have nothing to do if everything is opaque.
    deepest = int(counted.tiles.totals["all_layers" if technique.all_surfaces else "layers"].max())
    nothing = surfaces == "opaque" and not technique.all_surfaces
    first = opaque_bytes(options) if surfaces == "mixed" and not technique.all_surfaces else 0
    return Need(
        technique=technique.name,
        passes=0 if nothing else technique.passes_for(deepest, options),
        bytes_per_pixel=technique.buffer_bytes(deepest, options) + first,
        exact=technique.exact,
        left_out=left_out_by(technique, counted),
        seconds=estimated_seconds(technique, counted, shaded, options),
    )
