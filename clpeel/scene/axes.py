"""The axes as a small scene: balls with letters at the ends of three sticks, on a round plate that faces the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.camera import Camera, Degrees
from clpeel.scene.scene import Scene

Floats = NDArray[np.float64]

COLORS = ((0.95, 0.30, 0.24), (0.45, 0.80, 0.30), (0.36, 0.58, 1.00))
"""Of X, Y and Z: so light that black letters stand out, and so strong that they show on white."""

INK = (0.05, 0.05, 0.05, 1.0)
PLATE = (0.30, 0.30, 0.30, 0.55)
"""The colour of the plate. It sets the axes off from whatever the picture shows behind them."""

BALL, BACK_BALL, STICK = 0.28, 0.20, 0.05
"""The radii of balls at the positive and the negative ends, which are 1 away from the centre, and of sticks."""

BACK_ALPHA = 0.35
"""The alpha of balls at negative ends."""

HALF = 1.36
"""The radius of the plate, and half the height of the view: the farthest end of a ball is 1 + BALL away."""

SIDES = 32
"""Of anything round."""

STROKE = 0.035
"""Half the width of a letter's strokes."""

WIDTH, HEIGHT = 0.10, 0.15
"""Half the width and half the height of letters."""

LETTERS = (
    (((-1, -1), (1, 1)), ((-1, 1), (1, -1))),
    (((-1, 1), (0.1, -0.1)), ((1, 1), (-0.1, -0.1)), ((0, 0.1), (0, -1))),
    (((-1.1, 0.85), (1.1, 0.85)), ((1, 0.9), (-1, -0.9)), ((-1.1, -0.85), (1.1, -0.85))),
)
"""X, Y and Z as strokes between two places each, in half widths and half heights. So they need no font."""


def axes_scene(camera: Camera) -> tuple[Scene, Camera]:
    """Return the axes, with letters that face this camera, and a camera that sees all of them from where it looks.

    That camera has no perspective. The centre of the axes is the centre of its picture, HALF from each edge.
    """
    right, up, forward = camera.axes()
    parts = [_plate(right, up, forward)]
    for tip, color, strokes in zip(np.eye(3), COLORS, LETTERS, strict=True):
        parts.append(_stick(tip, (*color, 1.0)))
        parts.append(_ball(tip, BALL, (*color, 1.0)))
        parts.append(_ball(-tip, BACK_BALL, (*color, BACK_ALPHA)))
        front = tip - 1.01 * BALL * forward
        parts += [_stroke(front, right, up, np.array(ends) * (WIDTH, HEIGHT), forward) for ends in strokes]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    scene = Scene.from_arrays(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]),
        np.concatenate([np.tile(part.color, (len(part.faces), 1)) for part in parts]),
        vertex_normals=np.concatenate([part.normals for part in parts]),
    )
    away = 4.0
    angle = Degrees(math.degrees(2 * math.atan(HALF / away)))
    return scene, Camera(-away * forward, (0.0, 0.0, 0.0), up, angle, orthographic=True)


@dataclass(frozen=True, eq=False)
class _Part:
    """vertices, normals: [n, 3]. faces: [m, 3]. color: RGBA 0..1."""

    vertices: Floats
    normals: Floats
    faces: NDArray[np.int64]
    color: tuple[float, ...]


def _plate(right: Floats, up: Floats, forward: Floats) -> _Part:
    """Return the disc behind everything else."""
    angle = np.arange(2 * SIDES) * (np.pi / SIDES)
    rim = HALF * (np.cos(angle)[:, None] * right + np.sin(angle)[:, None] * up)
    return _fan(rim + 2 * forward, forward, PLATE)


def _stroke(centre: Floats, right: Floats, up: Floats, ends: Floats, forward: Floats) -> _Part:
    """Return a stroke of a letter. ends: where it begins and ends, to the right of and above the centre, [2, 2]."""
    way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    aside = STROKE * np.array([-way[1], way[0]])
    corners = np.array([ends[0] - aside, ends[1] - aside, ends[1] + aside, ends[0] + aside])
    return _fan(centre + corners[:, :1] * right + corners[:, 1:] * up, forward, INK)


def _fan(rim: Floats, forward: Floats, color: tuple[float, ...]) -> _Part:
    """Return a flat convex polygon that faces the camera. rim: its corners, [n, 3]."""
    at = np.arange(1, len(rim) - 1)
    return _Part(rim, np.tile(-forward, (len(rim), 1)), np.stack([np.zeros_like(at), at, at + 1], axis=1), color)


def _ball(centre: Floats, radius: float, color: tuple[float, ...]) -> _Part:
    """Return a ball."""
    angle = np.linspace(0, np.pi, SIDES // 2 + 1)
    outline = np.stack([-np.cos(angle), np.sin(angle)], axis=1)
    return _round(centre, np.array([0.0, 0.0, 1.0]), radius * outline, outline, color)


def _stick(tip: Floats, color: tuple[float, ...]) -> _Part:
    """Return the stick from the centre of the axes to the ball at this tip."""
    ends = np.array([[0.0, STICK], [1 - BALL / 2, STICK]])
    return _round(np.zeros(3), tip, ends, np.array([[0.0, 1.0]] * 2), color)


def _round(centre: Floats, axis: Floats, outline: Floats, slopes: Floats, color: tuple[float, ...]) -> _Part:
    """Return what an outline leaves as it turns about an axis, one of X, Y and Z.

    outline: how far along the axis its places are from the centre, and how far from the axis, [k, 2]. slopes: the
    normals there, in the same way.
    """
    angle = np.arange(SIDES) * (2 * np.pi / SIDES)
    aside = np.cos(angle)[:, None] * np.roll(axis, 1) + np.sin(angle)[:, None] * np.roll(axis, 2)

    def turned(places: Floats) -> Floats:
        return (places[:, None, :1] * axis + places[:, None, 1:] * aside).reshape(-1, 3)

    ring, side = (each.reshape(-1) for each in np.mgrid[: len(outline) - 1, :SIDES])
    a, b = ring * SIDES + side, ring * SIDES + (side + 1) % SIDES
    faces = np.concatenate([np.stack([a, b, b + SIDES], axis=1), np.stack([a, b + SIDES, a + SIDES], axis=1)])
    return _Part(centre + turned(outline), turned(slopes), faces, color)
