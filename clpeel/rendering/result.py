"""The result: a picture, its maps and layers, and the stats of making it."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from clpeel.device.program import device_seconds
from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.files import checked_file, write_whole
from clpeel.pictures.formats import MAPS, Chosen, chosen
from clpeel.pictures.lengths import Lengths
from clpeel.pictures.png import encode_png
from clpeel.rendering.made import SOFTWARE
from clpeel.rendering.options import VIEW_MAPS
from clpeel.rendering.shown_errors import error_of
from clpeel.stages.composite import Finished, Map, Picture
from clpeel.stages.tiles import Drawn
from clpeel.techniques import ERROR_BOUND, TECHNIQUES, with_map
from clpeel.techniques.technique import opaque_bytes

if TYPE_CHECKING:
    from clpeel.pictures.colormaps import ColorMap
    from clpeel.pictures.layers import Layers
    from clpeel.pictures.provenance import Provenance
    from clpeel.pictures.scale_bar import Box
    from clpeel.pictures.shown import Shown
    from clpeel.rendering.made import Made
    from clpeel.rendering.request import Request
    from clpeel.scene.camera import Camera
    from clpeel.stages.projection import Triangles

N = TypeVar("N", int, float)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stats(Mapping[str, Any]):
    """What a picture took, by attribute and by name: `stats.passes` is `stats["passes"]`.

    By name, each of `technique_stats` has its own: `stats["thickness_max"]`. Names whose value is None are missing.
    """

    technique: str
    execution: str
    """By "tiles" or by "passes"."""
    depth_format: str
    passes: int
    """Geometry passes, as the papers count them."""
    passes_issued: int
    """Geometry passes, with the empty one that ends them."""
    samples_passed: list[int]
    """How many samples passed in each geometry pass."""
    size: list[int]
    """Width and height in pixels."""
    samples: int
    """Samples of a pixel."""
    triangles: int
    """Triangles of the scene."""
    lines: int
    """Line segments of the scene."""
    points: int
    """Points of the scene."""
    clipped: int
    """Triangles that a clipping plane cuts."""
    discarded: int
    """Triangles, lines and points with corners that are NaN or infinite."""
    fragments: int
    """Fragments of transparent surfaces in front of opaque ones."""
    layers_max: int
    """The most such fragments of one sample."""
    opaque_samples: int
    """Samples with an opaque surface."""
    truncated_pixels: int
    """Samples with layers that no pass reached. With `max_error` or auto: pixels in which layers were skipped."""
    truncation_bound: float
    """The most that such layers could have changed any channel, 0..1."""
    clamped_pixels: int
    """Pixels whose alphas add up to more than 1, or whose value lies outside the range of a map's colours."""
    batches: int
    """How many parts the picture was drawn in."""
    seconds: dict[str, float]
    """Seconds of each stage by the device's clock, of the host, and in total."""
    seconds_per_pass: list[float]
    """Seconds of each geometry pass. They are equal shares if the device's kernels have no clock."""
    kernel_seconds: dict[str, float]
    """Seconds of each kernel by the device's clock."""
    bytes: dict[str, int]
    """Bytes of each buffer on the device, and of the scene."""
    bytes_per_pixel: float
    """The sum of `bytes`, divided by the number of pixels."""
    buffer_bytes_per_pixel: int
    """Bytes that the technique stores for a sample."""
    device: str
    lanes: int
    """Work-items that share a tile."""
    notes: list[str]
    """What the picture lacks, and why. Each is one line."""
    technique_stats: dict[str, object] = field(default_factory=dict)
    auto: dict[str, object] | None = None
    """What auto chose: max_error, explanation, alternatives."""

    def _named(self) -> dict[str, Any]:
        own = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "technique_stats"}
        return {name: value for name, value in {**own, **self.technique_stats}.items() if value is not None}

    def __getitem__(self, name: str) -> Any:
        return self._named()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._named())

    def __len__(self) -> int:
        return len(self._named())


def left_out(stats: Mapping[str, Any], bounded: bool) -> Iterator[str]:
    """What the picture could not show, one line each. bounded: whether layers were skipped on purpose (`max_error`)."""
    if stats.get("discarded"):
        kinds = "triangles, lines and points" if stats.get("lines") or stats.get("points") else "triangles"
        yield f"{stats['discarded']:,} {kinds} with NaN or infinite vertices were left out"
    if stats.get("unpaired_pixels"):
        yield (
            f"{stats['unpaired_pixels']:,} pixels have crossings that do not pair up: "
            "the mesh is not watertight there, or is clipped"
        )
    if stats.get("truncated_pixels") and not bounded and "auto" not in stats:
        unit = "samples" if stats["samples"] > 1 else "pixels"
        yield (
            f"{stats['truncated_pixels']:,} {unit} have more layers than were drawn; "
            f"those change no channel by more than {stats['truncation_bound']:.3g} of 1"
        )


class Clock:
    """Measures the seconds of a picture, from its request on."""

    def __init__(self, gpu: Workspace) -> None:
        self.gpu = gpu
        self.started = time.perf_counter()
        gpu.events.clear()

    def stop(self) -> tuple[dict[str, float], dict[str, float]]:
        """Seconds of each stage and of each kernel, by the device's clock. Waits for the device.

        The stages include "total" and "host". "host" is the time that no kernel took: compiling kernels the first time,
        uploading the scene, the host's own work, and waiting.
        """
        stages, kernels = device_seconds(self.gpu)
        total = time.perf_counter() - self.started
        stages["host"] = total - sum(stages.values())
        stages["total"] = total
        return stages, kernels


NO_BAR = "no scale bar {}in the picture: no place beside the model is free; a lower zoom or more pixels make room"


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A picture and what it took.

    image: uint8 [height, width, 4], row 0 on top; over the background, or straight alpha if there is none. stats: see
    Stats. maps: by name, of techniques that make some. Each map is also an attribute: `result.thickness`.
    """

    image: NDArray[np.uint8]
    stats: Stats
    _color: NDArray[np.float32] | None
    maps: dict[str, Map] = field(default_factory=dict)
    _layers: Layers | None = None
    _rounding: float = 0.0
    _over: tuple[Box, ...] = ()
    _made: Made | None = None

    if TYPE_CHECKING:

        @property
        def thickness(self) -> Lengths:
            """[height, width], in scene units, or window depths with `projected`.

            It is the mean over a pixel's samples, where empty ones count as 0. The dtype is float32, or float64 if a
            scene is so large or small that float32 cannot hold its lengths.
            """

        @property
        def unpaired(self) -> NDArray[np.bool_]:
            """bool [height, width], where a ray's entries and exits do not pair up.

            The mesh is open there, or cut by a clipping plane.
            """

    def __getattr__(self, name: str) -> Map:
        """The map of that name. Raises InputError if only other techniques make it."""
        if name in VIEW_MAPS or any(name in technique.maps for technique in TECHNIQUES.values()):
            return self.map(name)
        raise AttributeError(f"'Result' object has no attribute {name!r}")

    @property
    def rounding(self) -> float:
        """How far off a channel may be through rounding alone, 0..1 (techniques.precision.blending_bound)."""
        return self._rounding

    @property
    def layers(self) -> Layers:
        """The layers that the technique peels of every pixel, front to back.

        Raises InputError if the result was rendered without layers=True.
        """
        if self._layers is None:
            raise InputError("layers: expected a result rendered with layers=True, got layers=False")
        return self._layers

    @property
    def color(self) -> NDArray[np.float32]:
        """float32 [height, width, 4], premultiplied, without the background.

        What was blended as linear light is sRGB here, too: alpha times the sRGB of the straight colour.
        Raises InputError if the result was rendered with keep_color=False.
        """
        if self._color is None:
            raise InputError("color: expected a result rendered with keep_color=True, got keep_color=False")
        return self._color

    def map(self, name: str) -> Map:
        """The map of that name, [height, width]. Raises InputError if the technique does not make it."""
        if name == ERROR_BOUND:
            return self.error_bound
        if name in VIEW_MAPS and name not in self.maps:
            raise InputError(f"{name}: expected a result rendered with maps=({name!r},), got one without it")
        if name not in self.maps:
            raise InputError(
                f"{name}: expected a result of a technique that makes this map ({', '.join(with_map(name))}), "
                f"got {self.stats.technique!r}"
            )
        return self.maps[name]

    @property
    def error_bound(self) -> NDArray[np.float32]:
        """float32 [height, width]: how far a channel may be off, 0..1, in `color` or over any background.

        Only results rendered with `max_error` or by auto have it; others raise InputError. Skipped layers cannot change
        a channel by more than the transmittance in front of them: the mean over a pixel's samples, 0 where none were
        skipped. Rounding adds blending_bound (techniques.precision) of N layers, which are those of the deepest sample
        and one for an opaque surface: 3 N + 4 roundings of 2^-24, and more if `precision` is coarser. What is blended
        as linear light has bounds as it is shown, in sRGB (rendering.shown_errors).
        """
        if ERROR_BOUND not in self.maps:
            having = with_map(ERROR_BOUND)
            wanted, came = f"a technique that has it ({', '.join(having)})", self.stats.technique
            if came in having:
                wanted, came = "max_error=...", "none"
            raise InputError(f"error_bound: expected a result rendered with {wanted}, got {came}")
        return np.minimum(self.maps[ERROR_BOUND] + np.float32(self._rounding), np.float32(1))

    def with_axis(self, camera: Camera, device: int | str | None = None, lanes: int | None = None) -> Result:
        """The result with the axes in the lower right corner of its image, turned as this camera is.

        Nothing else changes. A picture with less than 96 pixels on a side is left as it is, and a note says so. device,
        lanes: as for `Renderer`.
        """
        from clpeel.rendering.axis import box_of, with_axes  # it makes a picture, whose result this module has

        found = with_axes(self.image, camera, device, lanes)
        if isinstance(found, str):
            return self._noted(found)
        height, width = found.shape[:2]
        return replace(self, image=found, _over=(*self._over, box_of(width, height)))

    def with_bar(self, *colors: ColorMap) -> Result:
        """The result with a scale bar of each of these colour maps in its image, such as those of `scene.color_maps`.

        Bars lie where the image shows nothing but the background, in a corner if one is free. For that they get
        smaller. Where no place is free a bar is left out, and a note says so. Nothing else changes.
        Raises InputError if the result was rendered with keep_color=False.
        """
        from clpeel.pictures.scale_bar import draw_beside, scale_of

        found, image = self, self.image.copy()
        occupied = np.asarray(self.color[..., 3] > 0)
        for part in self._over:
            occupied[part.rows_and_columns] = True
        for each in colors:
            box = draw_beside(image, scale_of(each), occupied)
            if box is None:
                found = found._noted(NO_BAR.format(f"of {each.label!r} " if each.label else ""))
                continue
            occupied[box.rows_and_columns] = True
            found = replace(found, _over=(*found._over, box))
        return replace(found, image=image)

    def _noted(self, note: str) -> Result:
        """The result with one more note."""
        return replace(self, stats=replace(self.stats, notes=[*self.stats.notes, note]))

    @property
    def provenance(self) -> dict[str, str]:
        """How the picture was made: software, options, camera, technique, the scene's SHA-256 and the device."""
        if self._made is None:
            return {"software": SOFTWARE}
        return self._made.words(self.stats.technique, self.stats.device)

    def save(self, path: str | os.PathLike[str], bits: int | None = None, provenance: bool = True) -> None:
        """Writes the picture, whole or not at all. If path is a link, the file it points to is written.

        The name's suffix says how: .png, .jpg, .webp (lossless), .tif, .exr (linear light, premultiplied, with the
        result's maps) or .npz (image, color and maps); none stands for .png. docs/outputs.md has the details.
        bits: of a channel, 16 for .png and .tif, 32 for .tif and .exr; None for the least. provenance: whether the file
        says how the picture was made (`provenance`). Raises InputError if the place cannot be written, or if the format
        is unknown, cannot hold the picture, or needs a package that is missing.
        """
        found = chosen(path, bits)
        checked_file(path)  # before any work
        write_whole(path, self.encoded(found, self.provenance if provenance else None))

    def encoded(self, found: Chosen, provenance: Provenance | None) -> bytes:
        """The picture as the bytes of a file of that format. provenance: what the file says, or None for nothing."""
        from clpeel.pictures.encode import encode

        return encode(self._shown(), found, provenance)

    def _shown(self) -> Shown:
        from clpeel.pictures.shown import Shown

        """The picture and what is needed to compute it in more than 8 bits."""
        maps = {name: self.map(name) for name in self.maps}
        if self._made is None:
            return Shown(self.image, self._color, maps=maps)
        request = self._made.request
        return Shown(self.image, self._color, request.picture.over, request.linear, maps)

    def save_map(self, name: str, path: str | os.PathLike[str], provenance: bool = True) -> str | None:
        """Writes a map, such as "depth", whole or not at all, and returns a line on what its numbers stand for, if any.

        The file's suffix says how: .npy, .npz, .exr, .tif, or .png, whose 16 bits hold numbers in steps that the line
        tells. Raises InputError as `save` does, and if the result has no such map.
        """
        from clpeel.pictures.map_files import encode_map

        found = chosen(path, among=MAPS)
        checked_file(path)
        words = {**self.provenance, "map": name} if provenance else None
        data, note = encode_map(name, self.map(name), found, words)
        write_whole(path, data)
        return note

    def __repr__(self) -> str:
        """Return what matters of the picture on one line: its size, its technique, what it shows, and its time."""
        width, height = self.stats.size
        parts = [f"{width} x {height}", self.stats.technique, f"{self.stats.seconds['total']:.3g} s"]
        parts += [f"at most {self.stats.layers_max:,} layers"] if self.stats.layers_max else []
        parts += [f"maps {', '.join(self.maps)}"] if self.maps else []
        parts += [f"{len(self.stats.notes)} note{'s' * (len(self.stats.notes) != 1)}"] if self.stats.notes else []
        return f"<Result: {', '.join(parts)}>"

    def _repr_png_(self) -> bytes:
        """Return the image as a PNG, which is what a notebook shows of the result."""
        return encode_png(self.image)


CHANGED = ("truncated_pixels", "truncation_bound", "clamped_pixels")
"""Stats that a technique may set by itself (Finished.stats), in place of what the batches found."""


def stats_of(
    request: Request,
    triangles: Triangles,
    drawn: Sequence[Drawn],
    finished: Finished,
    clamped_pixels: int,
    picture: Picture,
    clock: Clock,
) -> Stats:
    """The stats of a picture, for all its batches together. Stops the clock."""
    seconds, kernel_seconds = clock.stop()
    technique, gpu = request.technique, clock.gpu
    layers_max = max(part.layers_max for part in drawn)
    samples_passed = sums((part.keys, part.samples_passed) for part in drawn)
    passed = sum(count > 0 for count in samples_passed)
    buffers = {"scene": triangles.scene.nbytes, **{name: int(held.size) for name, held in gpu.buffers.items()}}
    if triangles.seen is not None:
        buffers["edges"] = triangles.seen.edges.nbytes
    if picture.values is not None:
        buffers["values"] = picture.values.nbytes
    width, height = request.picture.size
    faces, lines, points = triangles.scene.scene.counts
    own = dict(finished.stats)
    if any(repeat for part in drawn for _, repeat in part.pass_keys):
        own["inner_passes"] = inner_passes(drawn)
    changed: dict[str, Any] = {name: own.pop(name) for name in CHANGED if name in own}
    return Stats(
        technique=technique.name,
        execution=request.picture.execution,
        depth_format=request.picture.depth_format,
        passes=max(min(technique.least_passes, len(samples_passed)), passed),
        passes_issued=len(samples_passed),
        samples_passed=samples_passed,
        size=[width, height],
        samples=request.picture.samples or 1,
        triangles=faces,
        lines=lines,
        points=points,
        clipped=triangles.clipped,
        discarded=triangles.discarded,
        fragments=sum(part.fragments for part in drawn),
        layers_max=layers_max,
        opaque_samples=sum(part.opaque_samples for part in drawn),
        truncated_pixels=changed.get("truncated_pixels", sum(part.truncated_pixels for part in drawn)),
        truncation_bound=changed.get("truncation_bound", error_of(max(part.hidden for part in drawn), request.linear)),
        clamped_pixels=changed.get("clamped_pixels", clamped_pixels),
        batches=len(drawn),
        seconds=seconds,
        seconds_per_pass=seconds_per_pass(seconds.get(technique.name, 0.0), drawn),
        kernel_seconds=kernel_seconds,
        bytes=buffers,
        bytes_per_pixel=sum(buffers.values()) / (width * height),
        buffer_bytes_per_pixel=technique_bytes(request, layers_max)
        + (opaque_bytes(request.options) if triangles.features.surfaces == "mixed" else 0),
        device=gpu.device.name.strip(),
        lanes=gpu.lanes,
        notes=list(triangles.scene.scene.notes),
        technique_stats=own,
    )


def technique_bytes(request: Request, layers: int) -> int:
    """Bytes that the technique stores for a sample with so many transparent layers."""
    targets = request.targets
    return request.technique.buffer_bytes(layers, request.options) if targets is None else targets.pixel_bytes


def inner_passes(drawn: Sequence[Drawn]) -> list[int]:
    """How many passes each peel took, where passes are repeated until nothing is written."""
    peels = Counter(peel for peel, _ in {key for part in drawn for key in part.pass_keys})
    return [peels[peel] for peel in sorted(peels)]


def sums(parts: Iterable[tuple[tuple[tuple[int, int], ...], tuple[N, ...]]]) -> list[N]:
    """Adds up the parts' numbers key by key, and returns the sums in the order of the keys.

    parts: for each part its keys and its numbers. A part may lack some keys.
    """
    found: dict[tuple[int, int], N] = {}
    for keys, numbers in parts:
        for key, number in zip(keys, numbers, strict=True):
            found[key] = found[key] + number if key in found else number
    return [found[key] for key in sorted(found)]


def seconds_per_pass(seconds: float, found: Sequence[Drawn]) -> list[float]:
    """The seconds of each geometry pass, out of the technique's seconds.

    The rest of them is composition, and drawing opaque surfaces. If each pass has launches of its own, it is what these
    took. Otherwise it follows from the kernel's ticks. Without ticks, all passes get equal shares.
    """
    if any(drawn.pass_seconds for drawn in found):
        return sums((drawn.keys, drawn.pass_seconds) for drawn in found)
    issued = len({key for drawn in found for key in drawn.keys})
    ticks = sum(drawn.ticks for drawn in found)
    if ticks == 0 or issued == 0:
        return [seconds / max(issued, 1)] * issued
    return [seconds * part / ticks for part in sums((drawn.keys, drawn.pass_ticks) for drawn in found)]
