"""Warm-up: compiles the kernels of common kinds of pictures ahead, so that no first picture waits for them.

A kind is what kernels are compiled for: a technique, how colours are given, whether surfaces are opaque, and whether
there is a light. Each kind is compiled by making a picture of its own, of a few pixels.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from typing import Any

import numpy as np

from clpeel.checks import one_of, whole_number
from clpeel.device.building import cache_of
from clpeel.device.cache import times_lost
from clpeel.device.devices import open_device
from clpeel.errors import InputError
from clpeel.rendering.options import Lighting
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.request import Progress
from clpeel.scene.camera import Camera
from clpeel.scene.materials import Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Texture
from clpeel.techniques import TECHNIQUES

SIZE = (32, 32)
CAMERA = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), clipping_range=(1.0, 9.0))
"""Sees the scenes below. Its near plane cuts one of their faces, so that clipping is compiled, too."""

CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0], [-1, 1, 0.5], [1, 1, 0.5], [0, -1, 2.5]], np.float64)
FACES = np.array([[0, 1, 2], [3, 4, 5]])
GLASS, OPAQUE = (200, 120, 40, 128), (40, 120, 200, 255)

RATES = {"scene": 1, "face": len(FACES), "vertex": len(CORNERS)}
"""How colours may be given, and how many a scene has then."""

MOST_JOBS = 64
"""Processes side by side at most: each takes the memory of a driver of its own."""

SURFACES = ("transparent", "mixed", "opaque")


@dataclass(frozen=True)
class Kind:
    """A kind of picture: see the module.

    floats: colours are floats rather than bytes, as they are where `--opacity` is given. pairs: positions need more
    than float32, as those of many a file do. layers: with the layers of every pixel, too. textured: with a texture,
    which has holes unless surfaces are opaque.
    """

    technique: str
    rate: str
    surfaces: str
    lighting: Lighting
    floats: bool = False
    pairs: bool = False
    layers: bool = False
    textured: bool = False

    @property
    def name(self) -> str:
        """In words, for progress."""
        parts = [
            f"{self.technique}{' with layers' if self.layers else ''}",
            self.surfaces,
            "lit" if self.lighting != "none" else "unlit",
            f"colours: {self.rate}{', floats' if self.floats else ''}",
            *(["exact positions"] if self.pairs else []),
            *(["textures"] if self.textured else []),
        ]
        return ", ".join(parts)

    def scene(self) -> Scene:
        """The smallest scene of this kind."""
        count = RATES[self.rate]
        colors = np.array([OPAQUE if self.surfaces == "opaque" else GLASS] * count, np.uint8)
        if self.surfaces == "mixed":
            colors[count // 2 :] = OPAQUE
        given = (colors / 255).astype(np.float32) if self.floats else colors
        corners = CORNERS / 3 if self.pairs else CORNERS
        named: dict[str, Any] = {f"{self.rate}_colors": given} if self.rate != "scene" else {"color": given[0]}
        if self.textured:
            image = np.full((2, 2, 4), 255, np.uint8)
            image[0, 0, 3] = 255 if self.surfaces == "opaque" else 0
            named |= {"materials": [Material(texture=Texture(image), alpha_mode="BLEND")], "uv": corners[:, :2]}
        return Scene.from_arrays(corners, FACES, **named)


@dataclass(frozen=True)
class Warmed:
    """What was compiled: how many kinds, and the seconds that it took.

    folder: where it is kept. kept: whether all of it is. notes: about that, a line each.
    """

    kinds: int
    seconds: float
    folder: str
    kept: bool
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Made:
    """What making the picture of a kind has shown of the cache: whether all was kept, and notes."""

    kept: bool
    notes: tuple[str, ...]


def kinds_of(techniques: Sequence[str]) -> Iterator[Kind]:
    """The kinds to compile for these techniques: what the command draws of mesh files, and what a script may add.

    Scenes with nothing transparent are drawn alike by all techniques, so the first technique stands for them.
    """
    lights: tuple[Lighting, ...] = ("kit", "none")
    first = techniques[0]
    for technique in techniques:
        for lighting, rate, surfaces in product(lights, RATES, SURFACES):
            one_color = rate == "scene" and surfaces == "mixed"  # there is no such scene
            if one_color or (surfaces == "opaque" and technique != first):
                continue
            yield Kind(technique, rate, surfaces, lighting)
            if lighting != "none" and surfaces != "opaque":
                yield Kind(technique, rate, surfaces, lighting, floats=True)
    yield Kind(first, "scene", "transparent", "kit", pairs=True)
    yield Kind(first, "scene", "opaque", "kit", textured=True)  # most glTF files are one of these two
    yield Kind(first, "face", "mixed", "kit", floats=True, textured=True)
    if TECHNIQUES[first].sorts:
        yield Kind(first, "face", "transparent", "kit", layers=True)


def warm_up(
    techniques: Sequence[str] | None = None,
    device: int | str | None = None,
    lanes: int | None = None,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Warmed:
    """Compiles the kernels of common kinds of pictures, and keeps them for later processes.

    techniques: names in `clpeel.techniques.TECHNIQUES`; by default all. device, lanes: as of `Renderer`, which kernels
    are compiled for. jobs: how many processes compile side by side. (Threads of one process do not: PoCL's compiler
    lets one in at a time.) More than 1 needs a main module that may be imported again, as multiprocessing does.
    progress: called with the share done (0..1) and a text. Raises InputError on any of these that cannot be, and
    NoDeviceError where there is no such device.
    """
    names = list(dict.fromkeys(TECHNIQUES if techniques is None else techniques))
    if not names:
        raise InputError("techniques: expected at least one, got none")
    for name in names:
        one_of("techniques", name, TECHNIQUES)
    jobs = whole_number("jobs", jobs, MOST_JOBS)
    kinds = list(kinds_of(names))
    report = progress or (lambda done, text: None)
    begun = time.perf_counter()
    report(0.0, kinds[0].name)
    made = [_picture_of(kinds[0], device, lanes)]  # the first also compiles what all have in common
    for kind, found in _side_by_side(kinds[1:], device, lanes, jobs):
        made.append(found)
        report(len(made) / len(kinds), kind.name)
    folder = cache_of(open_device(device, lanes).device).folder
    notes = dict.fromkeys(note for each in made for note in each.notes)
    seconds = time.perf_counter() - begun
    return Warmed(len(kinds), seconds, str(folder), all(each.kept for each in made), tuple(notes))


def _picture_of(kind: Kind, device: int | str | None, lanes: int | None) -> _Made:
    """Makes a picture of this kind."""
    scene, before = kind.scene(), times_lost()
    options: dict[str, Any] = {"layers": True} if kind.layers else {}
    result = Renderer(scene, device, lanes).render(CAMERA, SIZE, kind.technique, lighting=kind.lighting, **options)
    return _Made(times_lost() == before, tuple(note for note in result.stats.notes if note not in scene.notes))


def _side_by_side(
    kinds: Sequence[Kind], device: int | str | None, lanes: int | None, jobs: int
) -> Iterator[tuple[Kind, _Made]]:
    """Makes the pictures, in `jobs` processes. Yields each kind that is finished."""
    if jobs == 1:
        for kind in kinds:
            yield kind, _picture_of(kind, device, lanes)
        return
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_ignore_interrupts)
    try:
        waiting = {pool.submit(_picture_of, kind, device, lanes): kind for kind in kinds}
        for finished in as_completed(waiting):
            yield waiting[finished], finished.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _ignore_interrupts() -> None:
    """Ctrl-C is for the process that waits for the others: it lets them finish what they are at."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
