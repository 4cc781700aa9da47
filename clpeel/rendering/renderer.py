"""Rendering: the way of the data, from a scene on the device to a picture."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from itertools import chain
from threading import Lock, get_ident
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from clpeel.device.building import at_work, keep
from clpeel.device.cache import take_notes
from clpeel.device.devices import Gpu, check_process, open_device
from clpeel.device.layout import COLOR_BYTES, DEPTH_FORMATS, FLOAT32_REVERSED, FRAGMENT_BYTES, MAX_SIDE
from clpeel.device.memory import MIN_MEMORY, MOST_LISTED, parse_memory
from clpeel.device.program import device_seconds
from clpeel.errors import InputError
from clpeel.pictures.lengths import Lengths
from clpeel.pictures.png import save_png
from clpeel.rendering.auto import choose
from clpeel.rendering.blank import why_blank
from clpeel.scene.camera import Camera
from clpeel.scene.normals import with_normals
from clpeel.scene.scene import Scene, checked_background
from clpeel.stages.binning import BATCH_SHARE, Batch, bin_triangles
from clpeel.stages.composite import Finished, Picture
from clpeel.stages.find_layers import STAGE as LAYERS_STAGE
from clpeel.stages.find_layers import Layers, find_layers
from clpeel.stages.one_pass import Drawn
from clpeel.stages.opaque import draw_opaque, opaque_bytes
from clpeel.stages.projection import DeviceScene, project, upload
from clpeel.techniques import AUTO, ERROR_BOUND, LAYERS, MAX_ERROR, Technique, options_of, with_map
from clpeel.techniques import technique as technique_named
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISION, blending_bound

LIGHTINGS = ("none", "headlight")
OPAQUE = ("first", "blend")
"""How surfaces whose alpha is 1 are drawn: before all others, which are then not drawn behind them, or as any other."""

COMMON_OPTIONS = tuple(
    "camera size technique background lighting samples memory keep_color opaque depth_format progress".split()
)
AUTO_EXACT = "sort"
"""What stands for auto until it has chosen: it has auto's options, and they mean the same."""

SAMPLES = {1: 1, 4: 2, 16: 4, 64: 8, 256: 16}
"""Samples a pixel to samples a side; a side divides a tile's, so that a pixel's samples share a tile."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class Result:
    """A picture and what it took.

    image: uint8 [height, width, 4], row 0 on top: over the background, or straight alpha where there is none.
    color: float32 [height, width, 4], premultiplied, before the background.
    stats: technique, passes (geometry passes as the papers count them), passes_issued (with the empty one that ends
    them), samples_passed [of each], fragments (of transparent surfaces, in front of opaque ones), layers_max (most of
    those in a sample), opaque_samples (with an opaque surface), triangles, clipped, discarded, truncated_pixels (with
    layers that no pass reached; samples, where a pixel has several), truncation_bound (what those could have changed
    in any channel, at most), clamped_pixels (alphas that add up to more than 1), batches, seconds {stage: s} and
    kernel_seconds {kernel: s} by the device's clock, seconds_per_pass [of each; equal shares where the device cannot
    tell], bytes {buffer: n}, bytes_per_pixel (those), buffer_bytes_per_pixel (what the technique keeps of a sample),
    device; and what the technique adds.
    thickness, unpaired: maps, of techniques that make them (`Technique.maps`). error_bound: with `max_error`.
    """

    image: NDArray[np.uint8]
    stats: dict[str, Any]
    _color: NDArray[np.float32] | None
    maps: dict[str, NDArray[Any]] = field(default_factory=dict)
    _layers: Layers | None = None
    _rounding: float = 0.0

    @property
    def layers(self) -> Layers:
        """The layers that the technique peels of every pixel, front to back."""
        if self._layers is None:
            raise InputError("layers: expected a result rendered with layers=True, got layers=False")
        return self._layers

    @property
    def color(self) -> NDArray[np.float32]:
        """float32 [height, width, 4], premultiplied, before the background."""
        if self._color is None:
            raise InputError("color: expected a result rendered with keep_color=True, got keep_color=False")
        return self._color

    def map(self, name: str) -> NDArray[Any]:
        """The map of that name, [height, width]. Raises InputError where the technique makes none."""
        if name == ERROR_BOUND:
            return self.error_bound
        if name not in self.maps:
            raise InputError(
                f"{name}: expected a result of a technique that makes this map ({', '.join(with_map(name))}), "
                f"got {self.stats['technique']!r}"
            )
        return self.maps[name]

    @property
    def thickness(self) -> Lengths:
        """float32 [height, width], scene units unless `projected`: the mean of a pixel's samples, 0 for empty ones.

        float64 where a scene is so large or small that float32 cannot hold them.
        """
        return self.map("thickness")

    @property
    def unpaired(self) -> NDArray[np.bool_]:
        """bool [height, width], where crossings do not pair up: the mesh is open there, or cut by a clipping plane."""
        return self.map("unpaired")

    @property
    def error_bound(self) -> NDArray[np.float32]:
        """float32 [height, width], with `max_error`: how far a channel of `color`, or over any background, may be off.

        What was left out cannot change a channel by more than the transmittance in front of it: the mean over a pixel's
        samples, 0 where nothing was. Rounding adds what techniques.precision.blending_bound says of the most layers
        of a sample, with an opaque one: 3 N + 4 roundings of 2^-24, and more where `precision` is coarser.
        """
        if ERROR_BOUND not in self.maps:
            having = with_map(ERROR_BOUND)
            wanted, came = f"a technique that has it ({', '.join(having)})", self.stats["technique"]
            if came in having:
                wanted, came = "max_error=...", "none"
            raise InputError(f"error_bound: expected a result rendered with {wanted}, got {came}")
        return np.minimum(self.maps[ERROR_BOUND] + np.float32(self._rounding), np.float32(1))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the image as a PNG, whole or not at all; through a link, if path is one.

        Raises InputError when the place cannot be written, or its name ends in what is not .png.
        """
        save_png(path, self.image)


_Method = TypeVar("_Method", bound=Callable[..., Result])


def _in_turn(method: _Method) -> _Method:
    """A Renderer's method that one thread runs at a time; its result has the notes of what was compiled meanwhile."""

    @wraps(method)
    def taken_in_turn(self: Renderer, *arguments: Any, **options: Any) -> Result:
        with self.working():
            result = method(self, *arguments, **options)
        result.stats["notes"] += take_notes()
        return result

    return cast(_Method, taken_in_turn)


class Renderer:
    """Keeps a scene on a device and renders it from any camera; nothing is uploaded, built or allocated twice."""

    def __init__(self, scene: Scene, device: int | str | None = None, lanes: int | None = None):
        """device: a number or part of a name (`clpeel devices`); lanes: work-items that share a tile (advanced)."""
        if not isinstance(scene, Scene):
            raise InputError(f"scene: expected a clpeel.Scene, got {type(scene).__name__}; see clpeel.load")
        self.scene = scene
        self.gpu: Gpu = open_device(device, lanes)
        self._uploaded: dict[str, DeviceScene] = {}
        self._pictures: list[Picture] = []
        self._at_work: int | None = None  # the thread that is making a picture
        self._turn = Lock()

    @contextmanager
    def working(self) -> Iterator[None]:
        """While something is made on the device: a renderer's buffers hold one picture at a time.

        Other threads wait for their turn. Raises DeviceError in a process forked from one that has used OpenCL, and
        InputError in a thread that is within already, as a `progress` would be that renders.
        """
        check_process()  # before the lock, which a thread may have held that a fork has left behind
        if self._at_work == get_ident():
            raise InputError(
                "render: expected no picture of this Renderer under way in this thread; make another Renderer"
            )
        with self._turn, at_work(self.gpu.queue):
            self._at_work = get_ident()
            try:
                yield
            finally:
                self._at_work = None
        keep()

    def _on_device(self, lighting: str) -> DeviceScene:
        if lighting not in LIGHTINGS:
            raise InputError(f"lighting: expected one of {', '.join(LIGHTINGS)}; got {lighting!r}")
        if lighting not in self._uploaded:
            lit = lighting != "none"
            self._uploaded[lighting] = upload(self.gpu, with_normals(self.scene) if lit else self.scene, lit)
        return self._uploaded[lighting]

    def _picture(self, size: tuple[int, int], keep_color: bool, numbers: int) -> Picture:
        """A picture to draw in: one of the last two, if nobody holds its result any more, or a new one."""
        self._pictures = [held for held in self._pictures if held.fits(size, keep_color, numbers)][-2:]
        for held in self._pictures:
            if held.is_free():
                return held
        self._pictures.append(Picture(self.gpu, size, keep_color, numbers))
        return self._pictures[-1]

    @_in_turn
    def render(
        self,
        camera: Camera | None = None,
        size: tuple[int, int] = (1024, 1024),
        technique: str = "sort",
        background: Sequence[float] | str | None = (1, 1, 1),
        lighting: str = "none",
        *,
        samples: int = 1,
        memory: int | str | None = None,
        keep_color: bool = True,
        layers: bool = False,
        opaque: str = "first",
        depth_format: str = DEPTH_FORMATS[FLOAT32_REVERSED],
        progress: Progress | None = None,
        **options: Any,
    ) -> Result:
        """Renders the scene.

        camera: by default `Camera.frame(scene)`. size: (width, height) in pixels. technique: a name in
        `clpeel.techniques.TECHNIQUES`. background: 3 numbers 0..1, text such as "white", or None for straight alpha.
        lighting: "none" (colours as given) or "headlight". samples: 1, 4, 16, 64 or 256 a pixel, averaged, for smooth
        edges. memory: bytes, or text such as "512M", that the scene and all buffers but the picture may take on the
        device; by default the scene and a quarter of what it leaves. keep_color: whether the result has `color`.
        layers: whether it has `layers`, those that the technique peels; of one sample a pixel, and not of techniques
        that do not sort. opaque: "first" fills colour and depth with the surfaces whose alpha is 1 and draws the others
        in front of them alone; "blend" takes them as any other. depth_format: what is kept of depths:
        "float32-reversed", or window depths as "float32", in 24 bits, "unorm24", or four bytes, "rgba8"; surfaces
        closer than it can tell are coincident then.
        progress: called with the share done (0..1) and a text. options: those that the technique has besides (its
        `options`), of which all that blend have precision: of the buffers that they blend into, "float32", "half" or
        "unorm8" (techniques/precision.py). Threads may share a Renderer: they take turns. Raises InputError on any of
        these that cannot be, and DeviceError in a process that was forked from one that has used OpenCL.
        """
        started = time.perf_counter()
        gpu = self.gpu
        check_options(technique, options)
        # What auto may choose has no maps, and the options that are left to be told apart.
        chosen = technique_named(AUTO_EXACT if technique == AUTO else technique)
        chosen.check(**options)
        check_layers(technique, layers, samples)
        size = checked_size(size)
        over = checked_background(background)
        side = checked_samples(samples, size)
        if opaque not in OPAQUE:
            raise InputError(f"opaque: expected one of {', '.join(OPAQUE)}; got {opaque!r}")
        if depth_format not in DEPTH_FORMATS:
            raise InputError(f"depth_format: expected one of {', '.join(DEPTH_FORMATS)}; got {depth_format!r}")
        bounded = technique == AUTO or options.get(MAX_ERROR) is not None
        numbers = 4 if chosen.maps else int(bounded)
        precision = options.get(PRECISION, DEFAULT_PRECISION)
        check_picture_fits(size, 4 + 16 * keep_color + 4 * numbers)
        limit = None if memory is None else parse_memory(memory)
        if camera is None:
            camera = Camera.frame(self.scene, aspect=size[0] / size[1])
        report = progress or (lambda done, text: None)
        report(0.0, "uploading")
        on_device = self._on_device(lighting)
        gpu.events.clear()

        report(0.0, "projecting")
        sampled = (size[0] * side, size[1] * side)
        opaque_first = opaque == "first" and not chosen.maps  # maps are of all surfaces, whatever their alphas
        triangles = project(gpu, on_device, camera, sampled, lighting != "none", opaque_first, depth_format)
        held = on_device.nbytes + triangles.nbytes
        budget = max(gpu.default_budget(held) if limit is None else limit - held, MIN_MEMORY)
        batch_budget = budget // BATCH_SHARE
        largest = int(gpu.device.max_mem_alloc_size)
        tiles = bin_triangles(gpu, triangles, batch_budget)

        def capacity_of(technique: Technique) -> int:
            return min(
                (budget - batch_budget) // (triangles.features.fragment_bytes + technique.fragment_bytes),
                largest // (COLOR_BYTES if triangles.features.fragment_color else FRAGMENT_BYTES),
                2**31 - 1,  # places are signed where vectors are scattered (common.h)
            )

        list_budget = min(batch_budget, largest, MOST_LISTED)
        batches, choice = tiles.batches(list_budget, middle_first=technique == AUTO), None
        if technique == AUTO:
            report(0.0, "looking")
            looked_at = next(batches)
            batches = chain((looked_at,), batches)
            most_layers = int(tiles.tile_pairs.max())
            choice = choose(gpu, triangles, looked_at, most_layers, capacity_of, options.get(MAX_ERROR), layers)
            technique, options = choice.chosen.technique, choice.chosen.options
            chosen = technique_named(technique)
        capacity = capacity_of(chosen)
        picture = self._picture(size, keep_color, numbers)
        target = picture.begin(side, over)
        found: list[Drawn] = []
        done, all_pairs = 0, max(int(tiles.tile_pairs.sum()), 1)
        for batch in batches:
            at_tile = None if progress is None else reporter(report, batch, done, all_pairs)
            done += int(batch.tile_pairs.sum())
            if triangles.features.surfaces == "opaque":
                found.append(draw_opaque(gpu, triangles, batch, target, at_tile, precision))
            else:
                found.append(chosen.draw(gpu, triangles, batch, target, capacity, at_tile, **options))
        clamped_pixels = picture.finish()
        finished = Finished(picture.image, picture.color, {}, {})
        if chosen.finish is not None:
            finished = chosen.finish(picture, triangles, over, **options)
        layers_max = max(drawn.layers_max for drawn in found)
        if bounded and picture.values is not None:
            if triangles.features.surfaces == "opaque":
                picture.values[...] = 0  # its one pass finds none
            finished = with_error_bound(picture)
            if choice is not None and not chosen.exact:  # whose kernel finds no bound, but that was seen to before
                picture.values[...] = choice.max_error
                finished.stats.clear()
        seconds, kernel_seconds = device_seconds(gpu)
        report(1.0, "done")
        # What no kernel took: compiling them the first time, the scene's upload, the host's own work and waiting.
        total = time.perf_counter() - started
        seconds["host"] = total - sum(seconds.values())
        seconds["total"] = total
        buffers = {name: int(held.size) for name, held in gpu.buffers.items()}
        if picture.values is not None:
            buffers["values"] = picture.values.nbytes
        pixels = size[0] * size[1]
        samples_passed = sums((drawn.keys, drawn.samples_passed) for drawn in found)
        mixed = triangles.features.surfaces == "mixed"
        stats: dict[str, Any] = {
            "technique": technique,
            "depth_format": depth_format,
            "passes": max(min(chosen.passes, len(samples_passed)), sum(passed > 0 for passed in samples_passed)),
            "passes_issued": len(samples_passed),
            "samples_passed": samples_passed,
            "size": list(size),
            "samples": samples,
            "triangles": triangles.faces,
            "clipped": triangles.clipped,
            "discarded": triangles.discarded,
            "fragments": sum(drawn.fragments for drawn in found),
            "layers_max": layers_max,
            "opaque_samples": sum(drawn.opaque_samples for drawn in found),
            "truncated_pixels": sum(drawn.truncated_pixels for drawn in found),
            "truncation_bound": max(drawn.hidden for drawn in found),
            "clamped_pixels": clamped_pixels,
            "batches": len(found),
            "seconds": seconds,
            "seconds_per_pass": seconds_per_pass(seconds.get(technique, 0.0), found),
            "kernel_seconds": kernel_seconds,
            "bytes": {"scene": on_device.nbytes, **buffers},
            "bytes_per_pixel": (on_device.nbytes + sum(buffers.values())) / pixels,
            "buffer_bytes_per_pixel": chosen.buffer_bytes(layers_max, options)
            + (opaque_bytes(options) if mixed else 0),
            "device": gpu.device.name.strip(),
            "lanes": gpu.lanes,
            "notes": list(self.scene.notes),
            **finished.stats,
        }
        covered = stats["fragments"] + stats["opaque_samples"]
        blank = why_blank(finished.image, over, self.scene, camera, covered, triangles.discarded)
        if blank is not None:
            stats["notes"].append(blank)
        if choice is not None:
            stats["auto"] = {
                "max_error": choice.max_error,
                "explanation": choice.explanation(seconds),
                "alternatives": [other.name for other in choice.others],
            }
        found_layers = None
        if layers and chosen.peeled is not None:
            begun = time.perf_counter()
            keep = options.get("coincident", "keep") == "keep"
            peeled = chosen.peeled(**options)
            found_layers = find_layers(
                gpu,
                on_device,
                camera,
                size,
                lighting != "none",
                budget,
                peeled,
                keep,
                opaque == "first",
                depth_format,
                report,
            )
            seconds[LAYERS_STAGE] = time.perf_counter() - begun
            seconds["total"] = seconds.pop("total") + seconds[LAYERS_STAGE]
            report(1.0, "done")
        rounding = blending_bound(layers_max + 1, precision)  # one more for what is opaque
        return Result(finished.image, stats, finished.color, finished.maps, found_layers, rounding)


def render(
    scene: Scene,
    camera: Camera | None = None,
    size: tuple[int, int] = (1024, 1024),
    technique: str = "sort",
    background: Sequence[float] | str | None = (1, 1, 1),
    lighting: str = "none",
    *,
    device: int | str | None = None,
    lanes: int | None = None,
    **options: Any,
) -> Result:
    """Renders one picture; the options are those of `Renderer` and `Renderer.render`."""
    return Renderer(scene, device, lanes).render(camera, size, technique, background, lighting, **options)


def reporter(report: Progress, batch: Batch, before: int, all_pairs: int) -> Callable[[int], None]:
    """Of draw_tiles (draw.py): tells the share done of all pairs, `before` of them in batches before this one."""
    done = before + np.cumsum(batch.tile_pairs)
    return lambda tile: report(float(done[tile - 1 - batch.first_tile]) / all_pairs, "rendering")


def check_options(technique: str, options: Iterable[str]) -> None:
    """InputError where the technique lacks one of these options."""
    has = options_of(technique)
    for name in sorted(set(options) - set(has)):
        known = ", ".join((*COMMON_OPTIONS, *has))
        raise InputError(f"{name}: the technique {technique!r} has no such option; it has {known}")


def check_layers(technique: str, layers: bool, samples: int) -> None:
    """InputError where layers are asked for that cannot be given."""
    if not isinstance(layers, bool | np.bool_):
        raise InputError(f"layers: expected True or False, got {layers!r}; layers in each pass are layers_per_pass")
    if layers:
        check_options(technique, [LAYERS])
        if samples != 1:
            raise InputError(f"layers: expected samples=1, got {samples!r}")


def with_error_bound(picture: Picture) -> Finished:
    """The picture with what the layers left out can have changed, without rounding, and what its stats say of that."""
    assert picture.values is not None
    hidden = picture.values[..., 0]
    stats = {"truncated_pixels": int(np.count_nonzero(hidden)), "truncation_bound": float(hidden.max())}
    return Finished(picture.image, picture.color, {ERROR_BOUND: hidden}, stats)


def sums(parts: Iterable[tuple[tuple[tuple[int, int], ...], tuple[int, ...]]]) -> list[int]:
    """Sums of the parts' numbers, key by key, in the order of the keys: a part may lack some."""
    found: Counter[tuple[int, int]] = Counter()
    for keys, numbers in parts:
        for key, number in zip(keys, numbers, strict=True):
            found[key] += number
    return [found[key] for key in sorted(found)]


def seconds_per_pass(seconds: float, found: Sequence[Drawn]) -> list[float]:
    """What each geometry pass took of the technique's seconds; the rest is composition, and opaque surfaces."""
    issued = len({key for drawn in found for key in drawn.keys})
    ticks = sum(drawn.ticks for drawn in found)
    if ticks == 0 or issued == 0:
        return [seconds / max(issued, 1)] * issued
    return [seconds * part / ticks for part in sums((drawn.keys, drawn.pass_ticks) for drawn in found)]


def checked_size(size: Sequence[int]) -> tuple[int, int]:
    """(width, height), each 1..65536, or InputError."""
    try:
        width, height = (int(side) if int(side) == side else -1 for side in size)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"size: expected (width, height) in pixels, got {size!r}") from None
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise InputError(f"size: expected 1..{MAX_SIDE} pixels a side, got {size[0]} x {size[1]}")
    return width, height


def check_picture_fits(size: tuple[int, int], pixel_bytes: int) -> None:
    """InputError where the host's memory cannot hold the picture."""
    needed = size[0] * size[1] * pixel_bytes
    if hasattr(os, "sysconf") and needed > (held := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")):
        raise InputError(
            f"size: expected a picture that fits the memory of {held / 2**30:.1f} GiB, "
            f"got {size[0]} x {size[1]}, which takes {needed / 2**30:.1f} GiB"
        )


def checked_samples(samples: int, size: tuple[int, int]) -> int:
    """Samples a side, or InputError."""
    if samples not in SAMPLES:
        raise InputError(f"samples: expected one of {', '.join(map(str, SAMPLES))}, got {samples!r}")
    side = SAMPLES[samples]
    if max(size) * side > MAX_SIDE:
        raise InputError(
            f"samples: expected at most {MAX_SIDE // side} pixels a side with {samples} samples, got {max(size)}"
        )
    return side
