"""Errors of pictures at the extremes: real renders compared with float64, and the bounds that are known beforehand."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from benchmark.measure import PLAIN
from benchmark.runs import SHARED, TOOLS
from numpy.typing import NDArray

import clpeel
from clpeel.device.layout import DEPTH_FORMATS, DepthFormat
from clpeel.study.compare import true_colors
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.precision import DEFAULT_PRECISION, PrecisionName

Floats = NDArray[np.float64]
Points = dict[float, float]
"""The measured value at each place of the horizontal axis."""
Series = dict[str, Points]
"""By name: a technique with its precision, a depth format, or a kind of positions."""
Report = Callable[[str], None]

UNIT = 2.0**-24
STEPS = 255
VIEW = clpeel.Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(0.5, 8.0))
RGB = (1.0, 0.7, 0.3)
PEELS = 4  # of glowscript
MOST = {"depth-peeling": 4096, "dual-depth-peeling": 4096, "multi-layer-peeling": 16_384}
"""The most layers that a technique can draw in reasonable time. Each of its passes visits all N layers, so it takes N^2
steps."""


def own_precisions(name: str) -> list[PrecisionName]:
    """Return float32 and the precision of the technique's paper."""
    return list(dict.fromkeys((DEFAULT_PRECISION, TECHNIQUES[name].paper_precision)))


BY_FORMULA = ("glowscript", "weighted-average", "weighted-sum")
"""Techniques that are not exact, and whose picture follows from the colours of the layers alone (own_truth)."""


def blending() -> list[str]:
    """Return the techniques that blend the layers of a pixel to a colour, as own_truth knows it."""
    return [name for name, made in TECHNIQUES.items() if made.exact or name in BY_FORMULA]


def series_name(technique: str, precision: str) -> str:
    """Return the name that tables and plots use."""
    return f"{technique}, {precision}"


# --- the bounds that are drawn in -------------------------------------------------------------------------------------


def float32_bound(layers: float) -> float:
    """Return 3 N 2^-24: the bound of the float32 error of blending N layers."""
    return 3 * layers * UNIT


def over_bound(alpha: float) -> float:
    """Return 0.5 / a steps of 8 bits, as a share of 1, for any number of layers.

    Each blend is off by half a step, and passes on 1 - a of the error that it received.
    """
    return min(0.5 / alpha / STEPS, 1.0)


def half_bound(layers: float) -> float:
    """Return (N - 1) 2^-11: the bound of the error of a sum of N numbers in 16-bit floats."""
    return (layers - 1) * 2.0**-11


def reversed_resolution() -> float:
    """Return 2^-23, the resolution of reversed depth, as a share of the distance Z.

    It is half of the gap that float32 leaves between near / Z and the next number, on either side.
    """
    return 2.0**-23


def window_resolution(distance: float, near: float) -> float:
    """Return Z^2 2^-24 / near, the resolution of standard window depth, as a share of the distance Z."""
    return distance * 2.0**-24 / near


# --- layers -----------------------------------------------------------------------------------------------------------


def stack(colors: Floats, away: Sequence[float] | Floats) -> clpeel.Scene:
    """Return a triangle for each layer, which fills VIEW, at these distances."""
    away = np.asarray(away, np.float64)
    corners = np.empty((len(away), 3, 3))
    corners[..., :2] = np.array([[-4.0, -4.0], [12.0, -4.0], [-4.0, 12.0]]) * away[:, None, None]
    corners[..., 2] = -away[:, None]
    faces = np.arange(3 * len(away)).reshape(-1, 3)
    return clpeel.Scene.from_arrays(corners.reshape(-1, 3), faces, face_colors=colors.astype(np.float32))


def own_truth(technique: str, colors: Floats) -> Floats:
    """Return the technique's own equation for layers [n, 4], front to back, in float64: premultiplied RGBA.

    So what the technique ignores or assumes by design is not counted as an error here. docs/compare.md measures that.
    """
    colors = colors.astype(np.float32).astype(np.float64)
    rgb, alpha = colors[:, :3], colors[:, 3]
    sums: Floats = np.append(alpha @ rgb, alpha.sum())
    if technique == "weighted-sum":
        return sums
    if technique == "weighted-average":
        average = sums[3] / len(alpha)
        cover = -math.expm1(len(alpha) * math.log1p(-average)) if average < 1 else 1.0
        return np.append(sums[:3] * (cover / sums[3] if sums[3] else 0.0), cover)
    if technique == "glowscript":
        rgb, alpha = rgb[:PEELS], alpha[:PEELS]
    clear = np.cumprod(np.append(1.0, 1 - alpha))
    return np.append((alpha * clear[:-1]) @ rgb, 1 - clear[-1])


def error_of(technique: str, precision: PrecisionName, colors: Floats, device: str | None = None) -> float:
    """Return the greatest error of a channel, including alpha.

    If numbers exceed 1, it is a share of the greatest number.
    """
    away = np.linspace(1, 7, len(colors))
    result = clpeel.render(
        stack(colors, away), VIEW, (1, 1), technique, device=device, precision=precision, opaque="blend", **PLAIN
    )
    want = own_truth(technique, colors)
    off = np.abs(result.color[0, 0].astype(np.float64) - want).max() / max(1.0, float(np.abs(want).max()))
    return float(off)


def layers_of(count: int, alpha: float | None, seed: int = 0) -> Floats:
    """Return N equal layers, or N random ones. Random alphas are log-uniform from 10^-4 to 1."""
    if alpha is not None:
        return np.tile([*RGB, alpha], (count, 1))
    rng = np.random.default_rng([count, seed])
    return np.column_stack([rng.random((count, 3)), 10 ** rng.uniform(-4, 0, count)])


def against_layers(
    counts: Iterable[int], alpha: float | None, say: Report, device: str | None = None, seeds: int = 4
) -> Series:
    """Return errors against the number of layers. For random layers, the greatest of several seeds counts."""
    found: Series = {}
    counts = list(counts)
    for technique in blending():
        for precision in own_precisions(technique):
            name = series_name(technique, precision)
            say(name)
            tries = range(1 if alpha is not None else seeds)
            found[name] = {
                count: max(error_of(technique, precision, layers_of(count, alpha, seed), device) for seed in tries)
                for count in counts
                if count <= MOST.get(technique, count)
            }
    return found


def against_alpha(alphas: Iterable[float], count: int, say: Report, device: str | None = None) -> Series:
    """Return errors of N equal layers against their alpha."""
    alphas = list(alphas)
    found: Series = {}
    for technique in blending():
        for precision in own_precisions(technique):
            name = series_name(technique, precision)
            say(name)
            found[name] = {
                alpha: error_of(technique, precision, layers_of(count, alpha), device)
                for alpha in alphas
                if count <= MOST.get(technique, count)
            }
    return found


def sums_of(alphas: Iterable[float], counts: Iterable[int], say: Report, device: str | None = None) -> Series:
    """Return the sums of white layers in 16-bit floats, by weighted-sum, against the number of layers."""
    counts = list(counts)
    found: Series = {}
    for alpha in alphas:
        say(f"sums of {alpha:g}")
        found[f"{alpha:g}"] = {}
        for count in counts:
            scene = stack(np.tile([1.0, 1.0, 1.0, alpha], (count, 1)), np.linspace(1, 7, count))
            result = clpeel.render(
                scene, VIEW, (1, 1), "weighted-sum", device=device, precision="half", opaque="blend", **PLAIN
            )
            found[f"{alpha:g}"][count] = float(result.color[0, 0, 0])
    return found


# --- depth ------------------------------------------------------------------------------------------------------------

SHARE = 0.5
"""The distance of the two surfaces, as a share of the far plane's distance."""
NEAR = 1.0
SLANT = 0.05
"""The slope of their distance across the picture, so that depths round differently in different pixels."""


def tells_apart(separation: float, far: float, depth_format: DepthFormat, device: str | None = None) -> bool:
    """Return whether the nearer of two parallel surfaces is in front everywhere, though it is submitted last."""
    distance = SHARE * far
    corners = []
    for away in (distance * (1 + separation), distance):
        for x, y in ((-3, -3), (3, -3), (3, 3), (-3, 3)):
            corners.append((x * distance, y * distance, -away - SLANT * x * distance))
    faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    rgba = np.repeat(np.array([[1, 0, 0, 0.5], [0, 1, 0, 0.5]], np.float32), 2, axis=0)
    scene = clpeel.Scene.from_arrays(corners, faces, face_colors=rgba)
    view = clpeel.Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(NEAR, far))
    result = clpeel.render(scene, view, (48, 32), device=device, depth_format=depth_format, **PLAIN)
    if result.stats["fragments"] != 2 * 48 * 32:
        raise RuntimeError(f"expected two surfaces in every pixel, got {result.stats['fragments']} fragments")
    return bool((result.color[..., 1] == 0.5).all())


def least_separation(far: float, depth_format: DepthFormat, device: str | None = None, steps: int = 24) -> float:
    """Return the least separation at which they are told apart, as a share of their distance, found by bisection.

    It is infinite if even the widest separation is not told apart.
    """
    low, high = 2.0**-40, 0.2
    if not tells_apart(high, far, depth_format, device):
        return math.inf
    for _ in range(steps):
        middle = math.sqrt(low * high)
        if tells_apart(middle, far, depth_format, device):
            high = middle
        else:
            low = middle
    return high


def against_range(ratios: Iterable[float], say: Report, device: str | None = None, steps: int = 24) -> Series:
    """Return the least separation of each depth format against far / near."""
    ratios = list(ratios)
    found: Series = {}
    for depth_format in DEPTH_FORMATS:
        say(depth_format)
        points = {ratio: least_separation(ratio * NEAR, depth_format, device, steps) for ratio in ratios}
        found[depth_format] = {ratio: least for ratio, least in points.items() if math.isfinite(least)}
    return found


# --- distance from the origin -----------------------------------------------------------------------------------------

DETAIL = 1e-3
"""The size of what is drawn, in scene units."""
AS_GIVEN, ROUNDED = "clpeel", "positions rounded to float32 first"


def star(seed: int = 5) -> tuple[Floats, list[list[int]]]:
    """Return six triangles of size DETAIL around a common centre, at random angles: corners [n, 3], and faces."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 2 * np.pi, 6)
    corners = []
    for k, angle in enumerate(angles):
        for reach, turn in ((0.1, np.pi), (0.45, -0.12), (0.45, 0.12)):
            corners.append((reach * np.cos(angle + turn), reach * np.sin(angle + turn), 0.02 * k))
    return np.array(corners) * DETAIL, np.arange(18).reshape(6, 3).tolist()


def edges_moved(
    distance: float, size: int, positions: str = AS_GIVEN, device: str | None = None
) -> tuple[float, float]:
    """Return how far edges are on average from where they are at the origin, in DETAIL, and the least visible distance.

    This is the area that changes if the scene is moved by `distance` along each axis, divided by the length of its
    edges.
    """
    corners, faces = star()
    offset = np.array([1.0, -1.0, 1.0]) * distance
    pixel = 1.0 / size  # in DETAIL, as the view is DETAIL wide
    rgba = np.tile([0.2, 0.4, 0.6, 0.5], (len(faces), 1)).astype(np.float32)
    pictures = []
    for at in (np.zeros(3), offset):
        vertices = corners + at
        if at.any() and positions == ROUNDED:
            vertices = vertices.astype(np.float32).astype(np.float64)
        scene = clpeel.Scene.from_arrays(vertices, faces, face_colors=rgba)
        view = clpeel.Camera(
            at + np.array([0.0, 0.0, 2 * DETAIL]),
            at,
            view_angle=math.degrees(2 * math.atan(0.25)),
            clipping_range=(DETAIL, 3 * DETAIL),
        )
        pictures.append(clpeel.render(scene, view, (size, size), device=device, **PLAIN).color[..., 3])
    around = corners.reshape(6, 3, 3)
    length = float(np.linalg.norm(around - np.roll(around, 1, axis=1), axis=2).sum()) / DETAIL
    least = pixel * pixel / length
    return int((pictures[0] != pictures[1]).sum()) * least, least


def against_distance(distances: Iterable[float], say: Report, device: str | None = None, size: int = 512) -> Series:
    """Return how far edges move against the distance from the origin, for given positions and for rounded ones."""
    distances = list(distances)
    found: Series = {}
    for positions in (AS_GIVEN, ROUNDED):
        say(positions)
        found[positions] = {distance: edges_moved(distance, size, positions, device)[0] for distance in distances}
    return found


# --- pictures of 8 bits -----------------------------------------------------------------------------------------------

PEER = "VTK, dual depth peeling"
Figures = dict[str, float]
COUNTED = (0, 1, 2, 3, 4, 6, 8)
"""The limits, in steps, of the shares of pixels that are counted."""


def steps_off(image: NDArray[np.uint8], truth: NDArray[np.uint8], covered: NDArray[np.bool_]) -> Figures:
    """Return the shares of pixels with a channel that is off by more than so many steps; also the RMS and the greatest.

    RMS and greatest are in steps. covered: the pixels that any surface covers, which also get a share of their own.
    """
    off = np.abs(image[..., :3].astype(int) - truth[..., :3])
    worst = off.max(axis=-1)
    return {
        **{f"> {steps}": float((worst > steps).mean()) for steps in COUNTED},
        "> 2, of covered pixels": float((worst[covered] > 2).mean()),
        "values alike": float((off == 0).mean()),
        "rms": float(np.sqrt((off.astype(float) ** 2).mean())),
        "greatest": float(off.max()),
    }


def peers_picture(folder: Path, name: str, size: int) -> NDArray[np.uint8] | str:
    """Return VTK's picture of a scene of the benchmark, or why there is none."""
    if not (folder / "vtk_peer.py").is_file():
        return f"no vtk_peer.py in {folder.name!r} (--scenes, or CLPEEL_SHARED)"
    if find_spec("vtk") is None:
        return "vtk is not installed (pip install vtk)"
    with tempfile.TemporaryDirectory(prefix="clpeel-extremes-") as scratch:
        out = Path(scratch) / "peer.npy"
        command = [sys.executable, str(folder / "vtk_peer.py"), name, str(size), "dual", str(out)]
        environment = {**os.environ, "FRAMES": "1", "MODELS": str(folder.parent / "models")}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode or not out.is_file():
            return f"VTK cannot render here: {(done.stderr.strip().splitlines() or ['no message'])[-1]}"
        picture: NDArray[np.uint8] = np.load(out)
        return picture


def bench_scene(folder: Path, name: str) -> tuple[clpeel.Scene, clpeel.Camera] | None:
    """Return a scene of the benchmark and its camera, or None if there is no benchmark."""
    path = folder / "scenes.py"
    if not path.is_file():
        return None
    code = (
        "import json, sys; import numpy as np; import scenes; v, f, c = scenes.named(sys.argv[1]); "
        "np.savez(sys.argv[2], v=v, f=f, c=c); print(json.dumps(scenes.CAMERA))"
    )
    with tempfile.TemporaryDirectory(prefix="clpeel-extremes-") as scratch:
        out = Path(scratch) / "scene.npz"
        done = subprocess.run(
            [sys.executable, "-c", code, name, str(out)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(TOOLS)])},
            capture_output=True,
            text=True,
            check=True,
        )
        given = json.loads(done.stdout)
        with np.load(out) as arrays:
            scene = clpeel.Scene.from_arrays(arrays["v"], arrays["f"], face_colors=arrays["c"])
    near, far = given.pop("near"), given.pop("far")
    return scene, clpeel.Camera(**given, clipping_range=(near, far))


def in_8_bits(
    say: Report, folder: Path = SHARED / "bench", name: str = "grass", size: int = 1024, device: str | None = None
) -> tuple[dict[str, Figures], str]:
    """Return how many steps 8-bit pictures are from float64: ours, ours with 8-bit buffers, and VTK's.

    Also returns what is missing, as text.
    """
    held = bench_scene(folder, name)
    if held is None:
        return {}, f"no scenes.py in {folder.name!r} (--scenes, or CLPEEL_SHARED)"
    scene, camera = held
    renderer = clpeel.Renderer(scene, device)
    exact = [technique for technique, made in TECHNIQUES.items() if made.exact]
    say("float64")
    layers = renderer.render(camera, (size, size), exact[0], **PLAIN, layers=True).layers
    color = true_colors(layers)
    over = np.clip(color[..., :3] + (1 - color[..., 3:]), 0, 1)
    truth = np.floor(over * STEPS + 0.5).astype(np.uint8)
    covered = (np.diff(layers.start) > 0).reshape(size, size)
    found: dict[str, Figures] = {}
    for technique in exact:
        for precision in own_precisions(technique):
            say(series_name(technique, precision))
            image = renderer.render(camera, (size, size), technique, **PLAIN, precision=precision).image
            found[series_name(technique, precision)] = steps_off(image, truth, covered)
    say(PEER)
    theirs = peers_picture(folder, name, size)
    if isinstance(theirs, str):
        return found, theirs
    found[PEER] = steps_off(theirs, truth, covered)
    return found, ""
