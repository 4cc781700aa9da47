"""thickness: how far the ray of each pixel runs through the scene, as a map and its picture (techniques/thickness.cl).

Oat and Scheuermann 2008, "Computing Per-Pixel Object Thickness in a Single Render Pass" (ShaderX6), as told and amended
in "Dual depth buffering for translucency rendering": MIN blending of (depth, 1 - depth). `exact` is clpeel's own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.errors import InputError
from clpeel.pictures.colormap import OUTSIDE, colors_at
from clpeel.pictures.lengths import scaled
from clpeel.pictures.scale_bar import draw_scale_bar
from clpeel.stages.composite import Finished, Picture
from clpeel.stages.many_passes import peel
from clpeel.stages.one_pass import Drawn, draw_once
from clpeel.stages.projection import Triangles

SUMMARY = "how far rays run through closed surfaces: a map in scene units, and its picture in colours with a scale bar"
SCRATCH_BYTES = FRAGMENT_BYTES
OPTIONS = ("variant", "projected", "thickness_range", "scale_bar")
MAPS = ("thickness", "unpaired")

VARIANTS = ("exact", "total", "first-solid")
"""Lengths within the surfaces, by all fragments sorted; from the nearest crossing to the farthest; from the first entry
to the first exit. In the order of the kernels' numbers (thickness.h)."""

STRIP_PIXELS = 1 << 20
"""Pixels that are coloured at once, which bounds what that takes besides the picture."""


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """All fragments of a sample, or the two that MIN blending keeps."""
    return FRAGMENT_BYTES * (layers if options.get("variant", "exact") == "exact" else 2)


def measure(
    path: str,
    variant: str,
    projected: bool,
    parameters: Sequence[float],
    gpu: Any,
    triangles: Triangles,
    batch: Any,
    target: dict[str, Any],
    capacity: int,
    report: Any = None,
    **constants: int,
) -> Drawn:
    """Draws a batch with the kernel file `path`, and finds its thickness (picture.values: thickness.h).

    variant: one of VARIANTS, else InputError. projected: in window depths rather than scene units. parameters: the
    technique's own. constants: of its kernel.
    """
    if variant not in VARIANTS:
        raise InputError(f"variant: expected one of {', '.join(VARIANTS)}; got {variant!r}")
    if projected not in (False, True):
        raise InputError(f"projected: expected True or False, got {projected!r}")
    numbers = np.array([length_unit(triangles, projected), triangles.depth_scale, *parameters])
    target = {**target, "parameters": gpu.put("parameters", numbers.astype(np.float32))}
    defines = {"VARIANT": VARIANTS.index(variant), **constants}
    features = triangles.features
    linear = projected or not features.perspective  # thickness.h, length_between
    # Where positions are pairs has been seen to: one build less.
    triangles = replace(triangles, features=replace(features, perspective=not linear, low_positions=False))
    if variant == "exact":
        return draw_once(path, SCRATCH_BYTES, gpu, triangles, batch, target, capacity, report, **defines)
    return peel(path, 0, gpu, triangles, batch, target, capacity, report, passes=1, defines=defines)


def length_unit(triangles: Triangles, projected: bool) -> float:
    """What the kernels' lengths are multiplied with (thickness.h, length_between).

    Scene units: near in perspective, as depth is near / distance, and far - near else; times device_scale, so that
    float32 holds them. Projected, OpenGL's window depth f / (f - n) (1 - n / distance) in perspective: f / (f - n), and
    else 1. Where depths begin and end elsewhere than window depths, their ratio comes in (Camera.depth_range).
    """
    near, far = triangles.clipping
    window_near, window_far = triangles.window
    if triangles.features.perspective:
        projection = window_near / near * window_far / (window_far - window_near)
        return projection if projected else near * device_scale(triangles)
    return (far - near) / (window_far - window_near) if projected else (far - near) * device_scale(triangles)


def device_scale(triangles: Triangles) -> float:
    """A scene unit, in those of the device: a power of two, 1 but for scenes of extreme sizes."""
    return triangles.scene.grid.scale


def maps_of(picture: Picture, unit: float = 1.0) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """The maps by name, and their stats. unit: of the device's lengths, a power of two, in those of the map."""
    values = picture.values
    assert values is not None
    maps = {"thickness": scaled(values[..., 0], unit), "unpaired": values[..., 1] > 0}
    stats = {
        "thickness_max": float(maps["thickness"].max()),
        "unpaired_pixels": int(np.count_nonzero(maps["unpaired"])),
    }
    return maps, stats


def checked_range(given: Any) -> tuple[float, float] | None:
    """(low, high), or None, or InputError."""
    if given is None:
        return None
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        raise InputError(f"thickness_range: expected (low, high), got {given!r}") from None
    if not (0 <= low < high < math.inf):
        raise InputError(f"thickness_range: expected 0 <= low < high, got {low:g}, {high:g}")
    return low, high


def draw(
    *arguments: Any,
    variant: str = "exact",
    projected: bool = False,
    thickness_range: Sequence[float] | None = None,
    scale_bar: bool = True,
) -> Drawn:
    """Draws a batch of tiles. Raises InputError where an option cannot be."""
    checked_range(thickness_range)
    gpu, triangles, *rest = arguments
    # Colours play no part, so no fragment needs one of its own.
    plain = replace(triangles, features=replace(triangles.features, color_rate="scene", headlight=False))
    return measure("techniques/thickness.cl", variant, projected, (), gpu, plain, *rest)


def finish(
    picture: Picture,
    triangles: Triangles,
    background: tuple[float, float, float] | None,
    *,
    variant: str = "exact",
    projected: bool = False,
    thickness_range: Sequence[float] | None = None,
    scale_bar: bool = True,
) -> Finished:
    """The maps, and the thickness in colours: of a pixel's samples the mean of those that are covered.

    Unpaired samples are shown in OUTSIDE, a colour that the map has not. `thickness_range` is by default 0 to the
    greatest thickness of any pixel that is not unpaired.
    """
    maps, stats = maps_of(picture, 1.0 if projected else 1 / device_scale(triangles))
    values = picture.values
    assert values is not None
    covered = values[..., 2]
    some = covered > 0
    shown = np.divide(maps["thickness"], covered, out=np.zeros_like(maps["thickness"]), where=some)
    given = checked_range(thickness_range)
    if given is None:
        paired = shown[~maps["unpaired"]]
        given = 0.0, float(paired.max(initial=0.0)) or float(shown.max()) or 1.0
    low, high = given
    stats |= {
        "thickness_range": [low, high],
        "clamped_pixels": int(np.count_nonzero(some & ~maps["unpaired"] & ((shown < low) | (shown > high)))),
        "unit": "projected" if projected else "scene units",
    }
    height, width = shown.shape
    image = np.empty((height, width, 4), np.uint8)
    image[...] = (0, 0, 0, 0) if background is None else (np.array([*background, 1.0]) * 255 + 0.5).astype(np.uint8)
    color = None if picture.color is None else np.zeros((height, width, 4), np.float32)
    rows = max(STRIP_PIXELS // width, 1)
    for top in range(0, height, rows):
        row, column = np.nonzero(some[top : top + rows])
        row += top
        share = covered[row, column][:, None]
        unpaired = values[row, column, 1][:, None] / share
        rgb = colors_at((shown[row, column] - low) / (high - low)) * (1 - unpaired) + OUTSIDE * unpaired
        if color is not None:
            color[row, column] = np.concatenate([rgb * share, share], axis=-1)
        if background is None:
            over = np.concatenate([rgb, share], axis=-1)
        else:
            over = np.concatenate([rgb * share + (1 - share) * np.array(background), np.ones_like(share)], axis=-1)
        image[row, column] = (over * 255 + 0.5).astype(np.uint8)
    if scale_bar:
        label = "thickness, " + ("projected" if projected else "scene units")
        draw_scale_bar(image, low, high, label, some, bool(stats["unpaired_pixels"]))
    return Finished(image, color, maps, stats)
