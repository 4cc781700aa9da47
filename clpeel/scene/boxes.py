"""A grid of boxes, some of them transparent: the scene of GlowScript's demonstration of transparency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clpeel.checks import whole_number

if TYPE_CHECKING:
    from clpeel.scene.scene import Scene

SIDE = 10
"""Boxes along each side of the grid."""

FILLED = 0.6
"""A box's side, as a share of the distance between two boxes."""

ALPHA = 77
"""Of a transparent box, of 255."""

MOST_EVERY = SIDE**3


def boxes_scene(transparent_every: int = 2) -> Scene:
    """Return 10 x 10 x 10 boxes in the cube -1..1: 12,000 triangles, with colours that follow their places.

    transparent_every: of the boxes, in the order of their places, each so-many-th is transparent; 1 makes all of them
    so. Raises InputError unless it is 1..1000.
    """
    from clpeel.scene.scene import Scene

    every = whole_number("transparent_every", transparent_every, MOST_EVERY)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    box = np.array([three for a, b, c, d in sides for three in ((a, b, c), (a, c, d))])
    places = np.stack(np.meshgrid(*3 * [np.arange(SIDE)], indexing="ij"), axis=-1).reshape(-1, 3)
    centers = (2 * places + 1) / SIDE - 1
    colors = np.empty((len(places), 4), np.uint8)
    colors[:, :3] = 40 + np.round(215 * places / (SIDE - 1))
    colors[:, 3] = np.where(np.arange(len(places)) % every == every - 1, ALPHA, 255)
    vertices = centers[:, None] + corners * FILLED / SIDE
    faces = box[None] + len(corners) * np.arange(len(places))[:, None, None]
    return Scene.from_arrays(vertices.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(colors, len(box), axis=0))
