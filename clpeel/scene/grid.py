"""The ground grid: lines at round distances, in a plane across the up direction, at the bottom of a scene."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import checked_rgb, number
from clpeel.errors import InputError
from clpeel.scene.camera import Vector, axis, front, length_of
from clpeel.scene.scene import Scene

Floats = NDArray[np.float64]

COLOR = (0.4, 0.4, 0.4)
"""The colour of the lines: a grey that shows on white, on black, and on the command's background."""

FAINT, STRONG = 0.45, 0.9
"""The alpha of most lines, and of every FIFTH one."""

FIFTH = 5

AXIS_COLORS = ((0.80, 0.22, 0.18), (0.20, 0.58, 0.20), (0.22, 0.36, 0.85))
"""The colours of the lines along X, Y and Z that run through zero."""

REACH = 2.0
"""How far the grid reaches, in radii of the sphere around the scene's bounds. From one radius on it fades."""

MOST_CELLS = 20
"""The most cells of the default size across that sphere. There are 8 at least."""

MOST_LINES = 400
"""The most lines each way. So a grid is smaller than most meshes."""

LEAST_PIECES = 40
"""The fewest pieces of a line across the whole grid. Each has one alpha, so lines fade in steps that nobody sees."""

BELOW = 2.0**-12
"""How far below the bottom it lies, in radii. So it shares no depths with a face that the scene stands on."""


def grid(scene: Scene, up: str | Vector = "+Y", unit: float | None = None, color: object = None) -> Scene:
    """Return the ground grid of a scene, as a scene of lines: clpeel.load(scene, clpeel.grid(scene)) has both.

    It lies across `up` at the bottom of the scene's bounds, around their centre. It fades from the radius of the bounds
    on, and ends at twice that. Lines run at multiples of `unit`: by default 1, 2 or 5 times a power of ten, with 8 to
    20 cells across the scene. Every fifth is stronger. If up is an axis, the lines through zero have the colours of the
    axes that they run along: red, green and blue for X, Y and Z.

    up: 3 numbers, or an axis such as "+Z". unit: the side of a cell, in scene units. color: of all other lines, 3
    numbers 0..1 or text. Frame the scene alone, Camera.frame(scene), as the grid is larger.

    Raises InputError if any of these is wrong, if there would be no line or too many, or if the scene is too large.
    """
    grey = COLOR if color is None else checked_rgb("grid color", color)
    above = axis(up, "grid up")
    if not above.any():
        raise InputError(f"grid up: expected a direction, got {up!r}")
    above = above / length_of(above)
    forward = front(above)
    forward = forward / length_of(forward)
    right = np.cross(forward, above)
    low, high = scene.bounds
    centre, half = low / 2 + high / 2, high / 2 - low / 2
    radius = length_of(half) or 1.0
    if not math.isfinite(4 * REACH * radius + float(np.abs(centre).sum())):
        raise InputError(f"grid: expected a scene within the range of numbers, got one of radius {radius:g}")
    step = _default_unit(radius) if unit is None else _checked_unit(unit, radius)
    bottom = (float(centre @ above) - float(half @ np.abs(above)) - BELOW * radius) * above
    ends, colors = list[Floats](), list[Floats]()
    for along, across in ((right, forward), (forward, right)):
        pieces, places, numbers, alpha = _pieces(float(centre @ along), float(centre @ across), radius, step)
        ends.append(pieces[:, :, None] * along + (places[:, None] * across)[:, None] + bottom)
        rgb = np.tile(np.array(grey), (len(places), 1))
        if np.count_nonzero(along) == np.count_nonzero(across) == 1:
            rgb[numbers == 0] = AXIS_COLORS[int(np.flatnonzero(along)[0])]
        colors.append(np.column_stack([rgb, alpha]))
    vertices = np.concatenate(ends).reshape(-1, 3)
    levels = np.rint(np.concatenate(colors) * 255).astype(np.uint8)
    lines = np.arange(len(vertices), dtype=np.int32).reshape(-1, 2)
    return Scene(vertices, np.zeros((0, 3), np.int32), face_colors=levels, lines=lines)


def _default_unit(radius: float) -> float:
    """Return the least of 1, 2 or 5 times a power of ten that makes at most MOST_CELLS across the scene."""
    least = 2 * radius / MOST_CELLS
    power = math.floor(math.log10(least))
    for factor in (1, 2, 5, 10):
        unit = max(float(f"{factor}e{power}"), math.ulp(0.0))
        if unit >= least:
            break
    return unit


def _checked_unit(unit: object, radius: float) -> float:
    """Return the side of a cell, or raise InputError if it is no number or the grid would have too many lines or none.

    The bounds are compared as they are shown, rounded.
    """
    least, most = (f"{bound * REACH * radius:.3g}" for bound in (2 / MOST_LINES, 1))
    found = number(unit)
    if not float(least) <= found <= float(most):
        raise InputError(f"grid unit: expected {least} to {most} for a scene of this size, got {unit!r}")
    return found


def _pieces(
    middle: float, beside: float, radius: float, unit: float
) -> tuple[Floats, Floats, NDArray[np.int64], Floats]:
    """Return the pieces of all lines that run one way, within a circle.

    middle, beside: the circle's centre, along the lines and across them. Returns where each piece begins and ends along
    its line, [k, 2]; where it lies across, [k]; how many units that is from zero; and its alpha.
    """
    reach = REACH * radius
    parts = math.ceil(unit * LEAST_PIECES / (2 * reach))  # of a cell
    found: list[tuple[Floats, Floats, NDArray[np.int64]]] = []
    for k in range(math.ceil((beside - reach) / unit), math.floor((beside + reach) / unit) + 1):
        off = (k * unit - beside) / reach
        chord = reach * math.sqrt(max(1 - off * off, 0.0))
        first, last = math.floor((middle - chord) / unit * parts) + 1, math.ceil((middle + chord) / unit * parts)
        between = np.arange(first, last) / parts * unit
        at = np.concatenate([[middle - chord], between, [middle + chord]])
        pieces = np.stack([at[:-1], at[1:]], axis=1)
        found.append((pieces, np.full(len(pieces), k * unit), np.full(len(pieces), k)))
    pieces, places, numbers = (np.concatenate(each) for each in zip(*found, strict=True))
    away = np.hypot((pieces.mean(axis=1) - middle) / reach, (places - beside) / reach)
    fade = np.clip((1 - away) / (1 - 1 / REACH), 0, 1)
    return pieces, places, numbers, np.where(numbers % FIFTH == 0, STRONG, FAINT) * fade
