"""Checking: whether the kernels that a picture needs have drawn known layers rightly, before they draw it.

The verdict on each set of kernels is kept (device/verdicts.py), so a set is tested once for each device, driver and
version of clpeel. The test itself (self_test.py) is imported only if a verdict is missing, as pictures seldom need it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache as remembered
from typing import TYPE_CHECKING, Literal

from clpeel.device.cache import key_of
from clpeel.device.layout import Features
from clpeel.device.program import source
from clpeel.device.verdicts import Parts, Verdict, verdicts_of
from clpeel.device.workspace import Workspace
from clpeel.errors import DeviceError
from clpeel.rendering.request import Request
from clpeel.rendering.shown_errors import error_of

if TYPE_CHECKING:
    from clpeel.rendering.renderer import Renderer
    from clpeel.stages.projection import Triangles
    from clpeel.stages.upload import DeviceScene

Behind = Literal["colour", "gradient", "none"]
"""What is behind the layers."""

SKIP = "CLPEEL_SKIP_CHECK"
"""The environment variable that lets pictures be made without a test. Empty or 0 means that they are tested."""

MAX_ERROR = 0.125
"""Which layers are skipped, if the picture skips any."""

LAYERS = 6
"""No sample of the known layers has more. More passes than these are one case."""

NO_MATTER = ("scale_bar", "thickness_range", "sigma", "light_color")
"""Options of techniques that kernels do not see, or only as a number."""

MARKS = ("line_width", "point_size", "point_type")
EDGES = ("edges", "feature_edges", "silhouettes", "edge_color", "edge_opacity", "hidden_edges")
"""Options of all pictures that say how lines, points and edges are drawn. The known layers have none."""

NO_EDGES = 180.0
"""No two faces bend by more degrees than this. So kernels for edges draw none of the known layers."""

NOT_IN_TESTS = (
    "size",
    "background",
    "memory",
    "keep_color",
    "backface_type",
    "light_intensity",
    "lighting",
    "maps",
    *MARKS,
    *EDGES,
)
"""Options of all pictures that the test's picture has values of its own for."""

IN_FEATURES = ("lighting", "highlights", "opaque", "depth_format", "layers", "anisotropy", "blending_space")
"""Options of all pictures that change nothing but what kernels are compiled for (Features), or which are launched."""


class WrongPictureError(DeviceError):
    """The device's kernels draw known layers wrongly. reason: what was wrong, and which kernels drew it."""

    def __init__(self, message: str, reason: str = "") -> None:
        super().__init__(message)
        self.reason = reason


def check(renderer: Renderer, request: Request, triangles: Triangles, tiles: int) -> list[str]:
    """Tests the kernels of a picture that is about to be drawn, unless a verdict is known. Returns notes for its stats.

    request: with its final technique. tiles: of the picture. Raises WrongPictureError if the kernels draw wrongly.
    """
    if getattr(request.options, "torn_writes", False):
        return []  # they lose layers on purpose, so nobody knows the picture
    parts = parts_of(request, triangles, renderer.gpu)

    def tested() -> tuple[Verdict, list[str]]:
        from clpeel.rendering import self_test

        return self_test.tested(renderer, request, triangles, parts, tiles)

    return _checked(renderer, parts, tested)


def check_counting(renderer: Renderer, scene: DeviceScene, features: Features, perspective: bool) -> None:
    """Tests the kernels that have counted layers, unless a verdict is known. Raises WrongPictureError as `check` does.

    features: those that the scene was counted for.
    """
    lanes, pairs = renderer.gpu.lanes, scene.low_positions is not None
    kernels = features if features.routed else Features(lanes, "face")
    words = [f"lanes {lanes}", features.surfaces, *_of_materials(kernels)]
    parts = frozenset(
        {
            _part("counting", words, "stages/counting.cl"),
            _part("projection", [f"lanes {lanes}", _view(perspective, pairs)], "stages/setup.cl"),
        }
    )

    def tested() -> tuple[Verdict, list[str]]:
        from clpeel.rendering import self_test
        from clpeel.rendering.known_layers import Wanted

        wanted = Wanted(kernels, features.surfaces, perspective, pairs, cut=False)
        return self_test.counting_tested(renderer, wanted, parts)

    _checked(renderer, parts, tested)


def _checked(renderer: Renderer, parts: Parts, test: Callable[[], tuple[Verdict, list[str]]]) -> list[str]:
    """Makes the test, unless its verdict is known or nobody wants it. Returns notes, and raises WrongPictureError."""
    if os.environ.get(SKIP, "0") not in ("", "0"):
        return []
    device = renderer.gpu.device
    verdicts = verdicts_of(device)
    verdict = None if renderer.tests_again else verdicts.of(parts)
    notes: list[str] = []
    if verdict is None:
        verdict, notes = test()
        verdicts.keep(verdict)
    if verdict.kind == "right":
        return notes
    name = f"{device.name.strip()} ({device.platform.name.strip()}, driver {device.driver_version.strip()})"
    if verdict.kind == "wrong":
        raise WrongPictureError(
            f"device: expected {name} to draw known layers as they are, got {verdict.reason}; choose another --device "
            f"('clpeel devices' lists them); {SKIP}=1 draws all the same, and without '{verdicts.file}' it is tested "
            "again",
            verdict.reason,
        )
    return [*notes, f"{name} {verdict.reason}, so the last bits may differ from those of other devices"]


# --- what is tested ---------------------------------------------------------------------------------------------------


def own_ways(request: Request) -> dict[str, object]:
    """The technique's options that differ from their defaults, and that kernels see.

    Numbers that kernels only compute with have a value that suits the known layers.
    """
    ways: dict[str, object] = {}
    for name, value in request.options.given():
        if name in NO_MATTER:
            continue
        if name == "max_error":
            value = error_of(MAX_ERROR, request.linear)
        elif name == "passes" and isinstance(value, int):
            value = min(value, LAYERS)
        ways[name] = value
    return ways


def shared_ways(request: Request) -> dict[str, object]:
    """The options of all pictures that differ from their defaults, and that the test's picture has too."""
    return {name: value for name, value in request.picture.given() if name not in NOT_IN_TESTS}


def behind(request: Request) -> Behind:
    """The kind of the picture's background."""
    over = request.picture.over
    return "none" if over is None else "colour" if len(over) == 3 else "gradient"


def _view(perspective: bool, pairs: bool) -> str:
    """How positions are projected, in words. pairs: they need more than float32."""
    return f"{'perspective' if perspective else 'parallel'}{', exact positions' if pairs else ''}"


def parts_of(request: Request, triangles: Triangles, gpu: Workspace) -> Parts:
    """The sets of kernels that the picture needs, as texts. Each ends with a digest of the kernels' sources."""
    features, technique = triangles.features, request.technique
    view = _view(triangles.perspective, triangles.scene.low_positions is not None)
    ways = own_ways(request) | shared_ways(request)
    ways |= {} if behind(request) == "colour" else {"background": behind(request)}
    with_lanes = f"lanes {gpu.lanes}"
    words = [with_lanes, f"{features.color_rate} colours{'' if features.packed_color else ' as floats'}"]
    words += [
        features.surfaces,
        *(["lit"] if features.headlight else []),
        *_of_lights(features),
        *_of_materials(features),
        features.depth_format,
    ]
    name, path = technique.name, technique.kernel
    if features.surfaces == "opaque":
        name, path = "opaque", "stages/opaque.cl"  # all techniques draw these alike
        ways = {way: value for way, value in ways.items() if way in ("precision", "samples", "background")}
    words += [f"{way} {value}" for way, value in ways.items() if way not in IN_FEATURES]
    words += [view.partition(",")[0]] if technique.maps else []  # lengths depend on it
    paths = [path]
    if request.targets is not None and name == technique.name:
        words.append(f"atomics of {64 if gpu.long_atomics else 32} bits")
        paths.append("stages/stream.cl")
    parts = [
        _part(name, words, *paths),
        _part("projection", [with_lanes, view], "stages/setup.cl"),
        *([_part("clipping", [with_lanes, view], "stages/clipping.cl")] if triangles.clipped > 0 else []),
        *([_part("layers", words, "stages/find_layers.cl", "stages/windows.cl")] if request.picture.layers else []),
    ]
    return frozenset(parts)


def _of_lights(features: Features) -> list[str]:
    """What kernels do with lights, in words."""
    words = {
        "lights": features.lights,
        "lights with places": features.positioned,
        "maps": features.maps,
        "full highlights": features.full_highlights,
        "linear blending": features.linear,
    }
    return [word for word, wanted in words.items() if wanted]


def _of_materials(features: Features) -> list[str]:
    """What kernels do with materials, in words."""
    words = {
        "materials": features.materials,
        "routed": features.routed,
        "hiding": features.hiding,
        "mip maps": features.levels,
        f"{features.probes} probes": features.probes > 1,
        "edges": features.wires,
    }
    return [word for word, wanted in words.items() if wanted]


def _part(name: str, words: list[str], *paths: str) -> str:
    return f"{name}: {', '.join(words)} [{_digest(*map(source, paths))}]"


@remembered
def _digest(*texts: str) -> str:
    return key_of(*texts)[:16]
