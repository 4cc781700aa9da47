"""The renderer: keeps a scene on a device, and makes pictures of requests."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from threading import Lock, get_ident
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from clpeel.checks import GivenBackground
from clpeel.device.building import at_work, keep
from clpeel.device.cache import take_notes
from clpeel.device.devices import check_process, open_device
from clpeel.device.layout import ALL_LAYERS
from clpeel.device.memory import Budget
from clpeel.device.workspace import Workspace
from clpeel.errors import InputError
from clpeel.rendering import checking
from clpeel.rendering.auto import Choice, capacity_of, chosen_for
from clpeel.rendering.blank import why_blank
from clpeel.rendering.made import Made
from clpeel.rendering.maps import layers_for, view_maps
from clpeel.rendering.options import BACKGROUND, Lighting, Size
from clpeel.rendering.request import Progress, Request
from clpeel.rendering.result import Clock, Result, Stats, stats_of
from clpeel.rendering.shown_errors import error_of, rounding_of
from clpeel.scene.arrays import checked_opacity
from clpeel.scene.camera import GivenCamera
from clpeel.scene.normals import with_normals
from clpeel.scene.scene import Scene, faces_alone, recolored
from clpeel.stages.binning import Batch, Tiles, bin_triangles
from clpeel.stages.composite import Finished, Map, Picture
from clpeel.stages.frame import Frame
from clpeel.stages.outlines import SQUARE, Shape, shape_of
from clpeel.stages.projection import Triangles, project
from clpeel.stages.shading import readable
from clpeel.stages.tiles import AtTile, Drawn
from clpeel.stages.upload import DeviceScene, in_linear_light, upload, with_colors
from clpeel.techniques import ERROR_BOUND
from clpeel.techniques.precision import blending_bound

if TYPE_CHECKING:
    from typing import Unpack

    from clpeel.pictures.layers import Layers
    from clpeel.rendering.keywords import Keywords
    from clpeel.stages.wires import DeviceEdges, Wired

_Method = TypeVar("_Method", bound=Callable[..., Result])


def _in_turn(method: _Method) -> _Method:
    """Decorates a method of Renderer so that one thread runs it at a time.

    The notes that compiling left meanwhile (cache.py) go to the result's stats.
    """

    @wraps(method)
    def taken_in_turn(self: Renderer, *arguments: Any, **options: Any) -> Result:
        with self.working():
            result = method(self, *arguments, **options)
        result.stats.notes.extend(take_notes())
        return result

    return cast(_Method, taken_in_turn)


_Kind = tuple[str, Shape | None]
"""What a scene is uploaded for: see _needs; and the outline of points, or None without lines and points."""


class Renderer:
    """Keeps a scene on a device and renders it from any camera. Nothing is uploaded, built or allocated twice."""

    def __init__(self, scene: Scene, device: int | str | None = None, lanes: int | None = None):
        """device: a number or part of a name (`clpeel devices`). lanes: work-items that share a tile (advanced).

        Raises InputError if the scene is no Scene or the lanes are wrong, and NoDeviceError if no device fits.
        """
        if not isinstance(scene, Scene):
            raise InputError(f"scene: expected a clpeel.Scene, got {type(scene).__name__}; see clpeel.load")
        self.scene = scene
        self.gpu: Workspace = open_device(device, lanes)
        self._lit: Scene | None = None  # with normals
        self._unread: list[str] = []  # notes of maps that cannot be decoded
        self._uploaded: dict[_Kind, DeviceScene] = {}
        self._opacity: float | None = None
        self._faded: dict[_Kind, DeviceScene] = {}  # those of `_uploaded` with `_opacity`
        self._edges: dict[_Kind, DeviceEdges] = {}  # those of `_uploaded` that were wanted last
        self._linear: dict[_Kind, DeviceScene] = {}  # those of either with linear colours
        self._pictures: list[Picture] = []
        self._at_work: int | None = None  # the thread that is making a picture
        self._turn = Lock()
        self._tests = True  # whether kernels are tested before they draw
        self.tests_again = False  # even if a verdict on them is known

    def beside(self, scene: Scene) -> Renderer:
        """A renderer of another scene on the same device, with buffers of its own. It serves a test, and makes none."""
        other = copy.copy(self)
        other.scene, other.gpu = scene, self.gpu.beside()
        other._uploaded, other._pictures, other._at_work, other._turn = {}, [], None, Lock()
        other._lit, other._opacity, other._faded, other._edges, other._linear = None, None, {}, {}, {}
        other._tests = False
        return other

    def set_opacity(self, opacity: float | None) -> None:
        """Replaces the alpha of every colour, 0..1, from the next picture on. None returns to the scene's own alphas.

        Only colours are uploaded again. Raises InputError for anything else.
        """
        opacity = None if opacity is None else checked_opacity(opacity)
        with self.working():
            if opacity != self._opacity:
                self._opacity, self._faded, self._linear = opacity, {}, {}

    @contextmanager
    def working(self) -> Iterator[None]:
        """Wraps work on the device. A renderer's buffers serve one picture at a time, so other threads wait.

        Raises DeviceError in a process that was forked from one that has used OpenCL. Raises InputError if this thread
        is already within: for example, if a `progress` function renders with the same Renderer.
        """
        check_process()  # before the lock: in a fork, it may belong to a thread that does not exist there
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

    @_in_turn
    def render(
        self,
        camera: GivenCamera | None = None,
        size: Size = (1024, 1024),
        technique: str = "sort",
        background: GivenBackground = BACKGROUND,
        lighting: Lighting | None = None,
        *,
        progress: Progress | None = None,
        **options: Unpack[Keywords],
    ) -> Result:
        """Renders the scene.

        camera: also the name of a view, such as "iso" or "xy", or (position, focal point, view up) as PyVista has them;
        by default `Camera.frame(scene)`. size: (width, height) in pixels. technique: a name in
        `clpeel.techniques.TECHNIQUES`, or "auto". background: 3 numbers 0..1, text such as "white", a pair of these for
        a gradient from top to bottom, or None for straight alpha. lighting: "none" (colours as given), "headlight",
        "kit" or "scene" (Scene.lights); by default the scene's lights, if it has some, else the kit. progress: called
        with the share done (0..1) and a text. options: those of all pictures (rendering.options.PictureOptions) and
        those of the technique (its `options`). Editors complete them from rendering/keywords.py.

        Threads may share a Renderer: they take turns. Raises InputError if an option is wrong, if memory is too small
        for one pixel's fragments, or if the scene has too many triangles. Raises DeviceError in a process that was
        forked from one that has used OpenCL, or if there is no room to compile kernels in.
        """
        clock = Clock(self.gpu)
        given = {"size": size, "background": background, "lighting": lighting, **options}
        request = Request.of(self.scene, camera, technique, given, progress)
        scene = self._on_device(request)
        triangles = self._projected(scene, request)
        budget = Budget.of(self.gpu, request.picture.memory_limit, scene.nbytes + triangles.nbytes)
        tiles = bin_triangles(self.gpu, triangles, budget.lists)
        request, batches, choice = chosen_for(request, tiles, budget)
        tested = self._tested(request, triangles, len(tiles.tile_pairs)) if self._tests else []
        picture = self._picture(request)
        frame = Frame(
            self.gpu,
            triangles,
            picture.begin(request.picture.pattern, request.picture.over, request.linear),
            capacity_of(request.technique, triangles.features, budget),
            budget,
            watcher(request, tiles),
            request.targets,
        )
        drawn = [draw(frame, batch, request) for batch in batches]
        clamped_pixels = picture.fetch()
        finished = finish(request, picture, triangles, choice)
        if triangles.seen is not None:
            from clpeel.rendering.hidden_edges import with_hidden_edges  # few pictures have edges

            finished = with_hidden_edges(self.gpu, request, triangles, budget, finished)
        stats = stats_of(request, triangles, drawn, finished, clamped_pixels, picture, clock)
        stats = explained(stats, request, triangles, finished, choice)
        stats.notes.extend((*tested, *self._notes(request)))
        layers, maps = self._layers_and_maps(scene, request, budget, stats, finished)
        request.report(1.0, "done")
        rounding = blending_bound(stats.layers_max + 1, request.blending.precision)  # + 1 for an opaque layer
        rounding = rounding_of(rounding, request.linear)
        made = Made(request, self.scene, self._opacity)
        return Result(finished.image, stats, finished.color, maps, layers, rounding, _made=made)

    def _tested(self, request: Request, triangles: Triangles, tiles: int) -> list[str]:
        """Tests the kernels of the picture, and those of its maps. Returns notes. tiles: of the picture."""
        notes = checking.check(self, request, triangles, tiles)
        if layers_for(request.picture.maps):
            notes += checking.check(self, request.of_layers, triangles, tiles)
        return list(dict.fromkeys(notes))

    def _on_device(self, request: Request) -> DeviceScene:
        """The scene on the device, with normals if it is lit. The first request for it uploads it."""
        request.report(0.0, "uploading")
        kind = self._kind(request)
        if kind not in self._uploaded:
            lights = request.lit is not None
            others = [held for held in self._uploaded.values() if held.packed is not None]
            like = next((held for held in others if held.packed is not None and held.packed.lights == lights), None)
            # Of outlines, which are most of a large cloud of points, those of one shape are kept.
            self._uploaded = {each: held for each, held in self._uploaded.items() if each[1] in (None, kind[1])}
            self._faded = {each: held for each, held in self._faded.items() if each in self._uploaded}
            self._linear = {each: held for each, held in self._linear.items() if each in self._uploaded}
            scene = self._for(request)
            lit = request.lighting != "none"
            self._uploaded[kind] = upload(self.gpu, scene, lit, like, lights, kind[1] or SQUARE)
        held = self._uploaded[kind]
        if self._opacity is not None:
            if kind not in self._faded:
                scene = recolored(held.scene, None, self._opacity)
                self._faded[kind] = with_colors(self.gpu, held, scene)
            held = self._faded[kind]
        if not request.linear or request.lighting != "none" or held.varies or request.wires is not None:
            return held
        if kind not in self._linear:
            self._linear[kind] = in_linear_light(self.gpu, held)
        return self._linear[kind]

    def _kind(self, request: Request) -> _Kind:
        """What the scene is uploaded for."""
        return _needs(request), self._shape(request)

    def _shape(self, request: Request) -> Shape | None:
        """The outline of the scene's points in this picture; None if no lines and points are drawn."""
        if not len(self.scene.mark_vertices) or request.technique.measures_solids:
            return None
        lit = request.lighting != "none"
        return shape_of(self.scene, request.marks, request.camera, request.sampled[1], lit)

    def _for(self, request: Request) -> Scene:
        """What the technique draws of the scene, with normals if it is lit, and with the maps that can be decoded."""
        scene = self.scene
        if request.lighting != "none":
            self._lit = scene = self._lit or with_normals(self.scene)
        if request.lit is not None:
            scene, self._unread = readable(scene)
        return faces_alone(scene) if request.technique.measures_solids else scene

    def _notes(self, request: Request) -> Iterator[str]:
        """What the picture lacks of maps, of lines and points, and of edges, one line each."""
        yield from self._unread if request.lit is not None else ()
        _, lines, points = self.scene.counts
        shape = self._shape(request)
        if request.technique.measures_solids and lines + points:
            counted = " and ".join(f"{n:,} {word}" for n, word in ((lines, "line(s)"), (points, "point(s)")) if n)
            yield f"{counted} left out: they have no inside, which {request.technique.name} measures"
        if request.technique.measures_solids and request.wants_edges:
            yield f"edges left out: they have no inside, which {request.technique.name} measures"
        if shape is not None and shape.simplified:
            wanted = request.marks.point_type
            yield f"{points:,} points are drawn as squares: they are too many for --point-type {wanted}"

    def _projected(self, scene: DeviceScene, request: Request) -> Triangles:
        request.report(0.0, "projecting")
        return project(
            self.gpu,
            scene,
            request.camera,
            request.sampled,
            request.lighting == "headlight",
            request.opaque_first,
            request.picture.depth_format,
            backfaces=request.backfaces,
            probes=request.picture.anisotropy,
            marks=request.marks,
            lit=request.lit,
            pattern=request.picture.pattern,
            wired=self._wired(scene, request),
            linear=request.linear,
        )

    def _wired(self, scene: DeviceScene, request: Request) -> Wired | None:
        """The edges that are drawn, if any are. The first request for them finds them, and puts them on the device."""
        wires = request.wires
        if wires is None:
            return None
        from clpeel.stages.wires import Wired, edges_on_device  # few pictures have edges

        kind = self._kind(request)
        held = self._edges.get(kind)
        if held is not None and len(held.found.places) != len(scene.scene.vertices):
            held = None  # another opacity may give faces vertices of their own
        if held is None or held.wanted != wires.wanted:
            request.report(0.0, "finding edges")
            self._edges = {each: old for each, old in self._edges.items() if each in self._uploaded}
            self._edges[kind] = held = edges_on_device(self.gpu, scene.scene, wires.wanted, held)
        return Wired(held, wires)

    def _picture(self, request: Request) -> Picture:
        """A picture to draw in. It is one of the last two, if nobody uses that one's arrays any more, or a new one."""
        shines_through = request.wires is not None and request.wires.hidden > 0
        wanted = request.picture.size, request.picture.keep_color or shines_through, request.values
        self._pictures = [held for held in self._pictures if held.fits(*wanted)][-2:]
        for held in self._pictures:
            if held.is_free():
                return held
        self._pictures.append(Picture(self.gpu, *wanted))
        return self._pictures[-1]

    def _layers_and_maps(
        self, scene: DeviceScene, request: Request, budget: Budget, stats: Stats, finished: Finished
    ) -> tuple[Layers | None, dict[str, Map]]:
        """The layers that the technique peels, if they are asked for, and all maps."""
        own, layers = (0, 0), None
        if request.picture.layers:
            own = request.technique.peeled(request.options) or own
            layers = self._peeled(scene, request, budget, stats, own)
        names = [name for name in request.picture.maps if name not in (*finished.maps, *request.technique.maps)]
        needed = layers_for(names)
        of_maps = layers if own == (ALL_LAYERS, 0) and request.keep_coincident else None
        if needed and of_maps is None:
            of_maps = self._peeled(scene, request, budget, stats, (needed, 0), request.of_layers)
        return layers, {**finished.maps, **view_maps(names, of_maps, finished.color, scene.scene, request.camera)}

    def _peeled(
        self,
        scene: DeviceScene,
        request: Request,
        budget: Budget,
        stats: Stats,
        ends: tuple[int, int],
        seen: Request | None = None,
    ) -> Layers:
        """So many layers from the front and from the back. Their time is added to the stats.

        seen: says which surfaces count, where that is not the request. They are lit as the request says.
        """
        begun = time.perf_counter()
        front, back = ends
        seen = seen or request
        from clpeel.stages.find_layers import STAGE, Peeled, find_layers  # few pictures need them

        peeled = Peeled(
            camera=request.camera,
            size=request.picture.size,
            headlight=request.lighting == "headlight",
            lit=request.lit,
            front=front,
            back=back,
            keep_coincident=seen.keep_coincident,
            opaque_first=seen.opaque_first,
            depth_format=request.picture.depth_format,
            backfaces=seen.backfaces,
            probes=request.picture.anisotropy,
            marks=request.marks,
            wired=self._wired(scene, request),
        )
        layers = find_layers(self.gpu, scene, peeled, budget, request.report)
        seconds = stats.seconds
        took = time.perf_counter() - begun
        seconds[STAGE] = seconds.get(STAGE, 0.0) + took
        seconds["total"] = seconds.pop("total") + took
        return layers


def render(
    scene: Scene,
    camera: GivenCamera | None = None,
    size: Size = (1024, 1024),
    technique: str = "sort",
    background: GivenBackground = BACKGROUND,
    lighting: Lighting | None = None,
    *,
    device: int | str | None = None,
    lanes: int | None = None,
    progress: Progress | None = None,
    **options: Unpack[Keywords],
) -> Result:
    """Renders one picture. The options and the errors are those of `Renderer` and `Renderer.render`."""
    renderer = Renderer(scene, device, lanes)
    return renderer.render(camera, size, technique, background, lighting, progress=progress, **options)


def _needs(request: Request) -> str:
    """What a picture needs of an uploaded scene besides colours: "none", "headlight" (normals) or "lights"."""
    return "lights" if request.lit is not None else request.lighting


def draw(frame: Frame, batch: Batch, request: Request) -> Drawn:
    """Draws a batch by the technique, or by Frame.opaque if all surfaces are opaque and are drawn first."""
    if frame.triangles.features.surfaces == "opaque":
        return frame.opaque(batch, request.blending.constants)
    return request.technique.draw(frame, batch, request.drawn_options)


def finish(request: Request, picture: Picture, triangles: Triangles, choice: Choice | None) -> Finished:
    """Lets the technique make its maps, and adds the bound of the error that skipping layers has made.

    choice: what auto chose, or None.
    """
    finished = request.technique.finish(picture, triangles, request.picture.over, request.options)
    if picture.values is None or request.technique.maps:
        return finished
    if triangles.features.surfaces == "opaque":
        picture.values[...] = 0  # drawing opaque scenes skips nothing
    if choice is not None and not request.technique.exact:
        picture.values[...] = choice.max_error  # its kernel finds no bound, but auto knew one when it chose
        return picture.finished({ERROR_BOUND: picture.values[..., 0]})
    if request.linear:
        picture.values[...] = error_of(picture.values, True)
    hidden = picture.values[..., 0]
    stats: dict[str, object] = {
        "truncated_pixels": int(np.count_nonzero(hidden)),
        "truncation_bound": float(hidden.max()),
    }
    return picture.finished({ERROR_BOUND: hidden}, stats)


def explained(stats: Stats, request: Request, triangles: Triangles, finished: Finished, choice: Choice | None) -> Stats:
    """Adds to the stats a note that says why the picture is blank, if it is, and what auto chose."""
    covered = stats.fragments + stats.opaque_samples
    scene = triangles.scene.scene
    blank = why_blank(finished.image, request.picture.over, scene, request.camera, covered, triangles.discarded)
    if blank is not None:
        stats.notes.append(blank)
    if request.lit is None and (unseen := unlit_losses(scene)):
        stats.notes.append(f"left out, as {unseen} only shows under lights: lighting 'kit' has some")
    if choice is None:
        return stats
    auto: dict[str, object] = {
        "max_error": choice.max_error,
        "explanation": choice.explanation(stats.seconds),
        "alternatives": [other.name for other in choice.others],
    }
    return replace(stats, auto=auto)


def unlit_losses(scene: Scene) -> str:
    """What the scene's materials have that is only drawn under lights, in words, or nothing."""
    finishes = [material.finish for material in scene.materials if material.finish is not None and not material.unlit]
    words = {
        "emissive light": any(any(finish.emissive) for finish in finishes),
        "what textures say of surfaces": any(finish.uv_sets for finish in finishes),
    }
    return " and ".join(word for word, there in words.items() if there)


def watcher(request: Request, tiles: Tiles) -> Callable[[Batch], AtTile] | None:
    """The `watch` of a Canvas that reports progress to the request, or None if it has no `progress`.

    It reports the share of all records in tiles that are drawn.
    """
    report = request.progress
    if report is None:
        return None
    all_pairs = max(int(tiles.tile_pairs.sum()), 1)
    before = 0

    def watch(batch: Batch) -> AtTile:
        nonlocal before
        done = before + np.cumsum(batch.tile_pairs)
        before = int(done[-1])
        return lambda tile: report(float(done[tile - 1 - batch.first_tile]) / all_pairs, "rendering")

    return watch
