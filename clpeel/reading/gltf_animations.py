"""Animations of a glTF file: what their channels set at one moment (glTF 2.0, section 3.11 and appendix C)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import named
from clpeel.reading.gltf_accessors import Accessors
from clpeel.reading.gltf_document import Document, Json, damaged, fields, objects, place, title
from clpeel.reading.gltf_nodes import Moved
from clpeel.reading.losses import listed
from clpeel.reading.transforms import Reals

_WAYS = ("LINEAR", "STEP", "CUBICSPLINE")
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}


@dataclass(frozen=True)
class Moment:
    """A moment of an animation. index: of the animation, from 0. time: in seconds; beyond its ends, the end counts."""

    index: int = 0
    time: float = 0.0


def moved(document: Document, accessors: Accessors, moment: Moment | None) -> Moved:
    """Return what an animation sets at a moment; nothing if there is no moment, with a note of the animations left out.

    Raises InputError if there is no such animation, or if it is damaged.
    """
    animations = document.entries("animations")
    if moment is None:
        if animations:
            names = listed(title(each, index) for index, each in enumerate(animations))
            how = "--animation-index and --animation-time show a moment of one"
            document.note(f"animations left out: {len(animations)} ({names}); {how}")
        return {}
    count = len(animations)
    if not count:
        raise InputError("animation_index, animation_time: expected a file with animations, got one that has none")
    if not 0 <= moment.index < count:
        raise InputError(f"animation_index: expected 0..{count - 1}, as the file has {count}, got {moment.index}")
    animation, found = animations[moment.index], dict[tuple[int, str], Reals]()
    samplers = objects(animation, "samplers")
    for channel in objects(animation, "channels"):
        target = fields(channel, "target")
        if "node" not in target:
            continue  # an extension says what it sets; that is noted by the extension's name
        node, path = place("node", target["node"], len(document.entries("nodes"))), str(target.get("path"))
        sampler = samplers[place("sampler", channel.get("sampler"), len(samplers))]
        found[node, path] = _sampled(accessors, sampler, path, moment.time)
    return found


def _sampled(accessors: Accessors, sampler: Json, path: str, time: float) -> Reals:
    """Return a sampler's value at a time, [width]. Raises InputError."""
    times = accessors.floats(sampler.get("input"), "times of an animation", "SCALAR")[:, 0].astype(np.float64)
    if not (np.diff(times) >= 0).all() or not np.isfinite(times).all():
        damaged("times of an animation: expected rising ones, got others")
    how, steps = sampler.get("interpolation", "LINEAR"), len(times)
    if how not in _WAYS:
        damaged(f"interpolation: expected {', '.join(_WAYS)}, got {named(str(how))}")
    rows = accessors.floats(sampler.get("output"), f"{path} of an animation", "SCALAR", "VEC3", "VEC4")
    parts = 3 if how == "CUBICSPLINE" else 1
    width = _WIDTHS.get(path, rows.size // (parts * steps))
    if rows.size != parts * steps * width:
        damaged(f"{path} of an animation: expected {parts * steps} times {width} numbers, got {rows.size}")
    keys = rows.reshape(steps, parts, width)
    at = int(np.searchsorted(times, time, side="right")) - 1
    if at < 0 or at == steps - 1 or how == "STEP":
        return keys[max(at, 0), parts // 2].astype(np.float64)
    gap = float(times[at + 1] - times[at])
    share = (time - float(times[at])) / gap
    before, after = keys[at].astype(np.float64), keys[at + 1].astype(np.float64)
    if how == "CUBICSPLINE":
        return _spline(before, after, share, gap)
    return _turned(before[0], after[0], share) if path == "rotation" else (1 - share) * before[0] + share * after[0]


def _spline(before: Reals, after: Reals, share: float, gap: float) -> Reals:
    """Return the cubic between two keys, each an in-tangent, a value and an out-tangent. gap: seconds between them."""
    square, cube = share**2, share**3
    return (
        (2 * cube - 3 * square + 1) * before[1]
        + gap * (cube - 2 * square + share) * before[2]
        + (3 * square - 2 * cube) * after[1]
        + gap * (cube - square) * after[0]
    )


def _turned(before: Reals, after: Reals, share: float) -> Reals:
    """Return the rotation between two, along the shorter way, at an even speed."""
    cosine = float((before * after).sum())
    angle = np.arccos(min(abs(cosine), 1.0))
    if angle < 1e-6:
        return (1 - share) * before + share * after * (-1 if cosine < 0 else 1)
    there = np.sin(share * angle) * (-1 if cosine < 0 else 1)
    found: Reals = (np.sin((1 - share) * angle) * before + there * after) / np.sin(angle)
    return found
