"""Closed surfaces for tests, and the float64 twin of their thickness along the rays of tests/reference.py."""

from __future__ import annotations

from typing import Any

import numpy as np
from conftest import EDGE_RELATIVE, EDGE_ROUNDING, INTERPOLATION_SHIFT
from numpy.typing import NDArray

from twins import reference, soups
from twins.reference import UNIT
from twins.soups import Eye, Soup

GRAY = (0.5, 0.5, 0.5, 0.5)
DEPTH_ROUNDINGS = 12 * UNIT
"""Of a depth: relative in perspective, of the clipping range otherwise; counted in conftest.py, TIE."""


def box(low: Any, high: Any, rgba: Any = GRAY) -> Soup:
    """An axis-parallel box, counterclockwise from outside."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(q[a], q[b], q[c]) for q in quads for a, b, c in ((0, 1, 2), (0, 2, 3))]
    return soups.paint(np.add(low, corner * np.subtract(high, low)), faces, rgba)


def ball(centre: Any = (0, 0, 0), radius: float = 1.0, subdivisions: int = 3, rgba: Any = GRAY) -> Soup:
    """A sphere of flat faces, with its corners on it."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return soups.paint(mesh.vertices * radius + np.asarray(centre, float), mesh.faces, rgba)


def turned_inside_out(soup: Soup) -> Soup:
    """The same with every face's corners the other way round."""
    return soups.Soup(soup.vertices, soup.faces[:, ::-1], soup.face_colors)


def random_solids(seed: int, count: int) -> Soup:
    """Closed meshes, some dented so that they cross themselves, some inside out, that may nest and overlap."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        solid = ball(rng.uniform(-0.5, 0.5, 3), rng.uniform(0.2, 0.8), int(rng.integers(0, 3)), rng.random(4))
        dents = rng.normal(1, rng.choice([0, 0.1, 0.4]), (len(solid.vertices), 1))
        middle = solid.vertices.mean(axis=0)
        solid = soups.Soup(middle + (solid.vertices - middle) * dents, solid.faces, solid.face_colors)
        made.append(turned_inside_out(solid) if rng.random() < 0.3 else solid)
    return soups.merge(*made)


class Rays:
    """The crossings of every pixel's ray with a scene, and what they make.

    thickness[variant], bound[variant]: float64 [h, w], how far clpeel may be off; unpaired[variant]: bool; edge: bool,
    pixels whose coverage rounding may change; tie: where rounding may say otherwise which crossing is nearer.

    The length where the count is not zero changes by at most what a crossing moves, and so do the difference of the
    farthest and the nearest one and that of the nearest two of each kind: so each bound is the sum of how far each of
    the crossings may be off, whichever order rounding puts them in. Each length then takes a difference (exact, or one
    rounding), two quotients and the unit (itself rounded), and is added up: n + 5 roundings of the whole.
    """

    def __init__(self, soup: Soup, view: Eye, size: tuple[int, int], projected: bool = False) -> None:
        twin = reference.render(soup, view, size)
        width, height = size
        count = width * height
        self.twin, self.size = twin, size
        x, y = reference.samples(twin.pixel, size)
        normal = twin.projected.edges[twin.triangle].sum(axis=1)
        # Counterclockwise is front-facing; y is down here, hence the sign.
        front = normal[:, 0] * x + normal[:, 1] * y + normal[:, 2] < 0
        near, far = twin.projected.clipping
        low, high, _, _ = reference.shifted(twin, INTERPOLATION_SHIFT)
        at = twin.distance
        off = np.maximum(high - at, at - low) + DEPTH_ROUNDINGS * (far - near if view.orthographic else at)
        if projected and view.orthographic:
            at, off = (at - near) / (far - near), off / (far - near)
        elif projected:
            off = off * far / (far - near) * near / at**2 * 1.001
            at = far / (far - near) * (1 - near / at)
        winding, length, reach = np.zeros(count, int), np.zeros(count), np.zeros(count)
        before = np.zeros(count)
        nearest, farthest = np.full(count, np.inf), np.full(count, -np.inf)
        entry, leave = np.full(count, np.inf), np.full(count, np.inf)
        for hit, pixel in reference.ranks(twin.pixel, count):
            length[pixel] += np.where(winding[pixel] != 0, at[hit] - before[pixel], 0)
            winding[pixel] += np.where(front[hit], 1, -1)
            before[pixel] = at[hit]
            reach[pixel] += off[hit]
            nearest[pixel] = np.minimum(nearest[pixel], at[hit])
            farthest[pixel] = np.maximum(farthest[pixel], at[hit])
            entry[pixel] = np.where(front[hit], np.minimum(entry[pixel], at[hit]), entry[pixel])
            leave[pixel] = np.where(front[hit], leave[pixel], np.minimum(leave[pixel], at[hit]))
        with np.errstate(invalid="ignore"):
            paired = (entry <= leave) & np.isfinite(leave)
            thickness = {
                "exact": length,
                "total": np.where(nearest <= farthest, farthest - nearest, 0),
                "first-solid": np.where(paired, leave - entry, 0),
            }
            tie = np.abs(leave - entry) <= reach
        layers = twin.layers
        self.covered = layers > 0
        self.thickness = {name: found.reshape(height, width) for name, found in thickness.items()}
        self.bound = {
            name: reach.reshape(height, width) + (layers + 5) * UNIT * found for name, found in self.thickness.items()
        }
        unpaired = {"exact": winding != 0, "total": winding > count, "first-solid": (nearest < np.inf) & ~paired}
        self.unpaired = {name: found.reshape(height, width) for name, found in unpaired.items()}
        distance = reference.edge_distance(soup, view, size, relative=EDGE_RELATIVE)
        self.edge = distance <= reference.SNAP + EDGE_ROUNDING
        self.tie = tie.reshape(height, width)

    def excused(self, variant: str) -> NDArray[np.bool_]:
        """Pixels of which nothing is promised."""
        return self.edge | self.tie if variant == "first-solid" else self.edge
