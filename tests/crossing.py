"""A small scene whose layers cross, for tests of files."""

from __future__ import annotations

import numpy as np

import clpeel

SIZE = (60, 40)
"""Of its pictures, in pixels."""


def scene() -> clpeel.Scene:
    """Three crossing squares of different colours and opacities, the last one opaque."""
    square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    turned = [square, square @ [(0.6, 0, 0.8), (0, 1, 0), (-0.8, 0, 0.6)] * 0.8, square * 0.5 - (0, 0, 0.7)]
    faces = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * k for k in range(3)])
    colors = np.repeat([(230, 80, 50, 100), (40, 110, 220, 51), (250, 240, 3, 255)], 2, axis=0).astype(np.uint8)
    return clpeel.Scene.from_arrays(np.concatenate(turned), faces, face_colors=colors)
