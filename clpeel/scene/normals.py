"""Vertex normals: smooth where the surface is, split where it has a crease, the file's own where it brings them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.scene.scene import Scene

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_TOLERANCE = 1e-5  # of a cosine, so that 30 degrees stay 30 degrees after a model's coordinates were rounded
_PAIRS = 1 << 19  # pairs of corners compared at a time: they stay in cache
_CROWD = 256  # corners at one creased point beyond which they are grouped, not compared in pairs


def with_normals(scene: Scene, crease_angle: float = 30.0) -> Scene:
    """The scene with a unit vector, float32 [n, 3], at every vertex; vertices are split where the surface has a crease.

    Normals that the scene has are kept where finite and not zero. A corner without one gets the mean of the normals,
    weighted by area, of those faces at its position that lie within crease_angle degrees of its own face (above 90 is
    as 90). Faces meet where positions are equal, whatever the indices. Winding does not matter: two faces compare as if
    wound alike, and a normal lies on the side of its own face, so that it interpolates well over that face.
    At a crease where more than 256 corners meet, faces are grouped by direction, with the same bound on the angle.
    Faces keep their count and order; vertices without a face that has an area get +Z.

    Raises InputError unless crease_angle is in 0..180.
    """
    if not 0 <= crease_angle <= 180:
        raise InputError(f"crease_angle: expected 0..180 degrees, got {crease_angle}")
    crease = math.radians(min(crease_angle, 90.0))
    normals, known = _given(scene)
    if known.all() or known[scene.faces].all():
        return replace(scene, vertex_normals=_filled(normals))

    points = _scaled(scene)
    areas = _area_normals(points, scene.faces)
    units = _unit(areas)
    usable = np.asarray(units.any(axis=0))
    first, place = _distinct(points)
    place_of_corner = place[scene.faces]
    axes, side, creased = _smooth(units, areas, place_of_corner, len(first), crease)

    # plain corners take the one normal of their place; the others have normals of their own
    normals = np.where(known[:, None], normals, axes.T[place].astype(np.float32))
    computed = ~known[scene.faces] & usable[:, None]
    own = computed & (creased[place_of_corner] | (side < 0))
    if not own.any():
        return replace(scene, vertex_normals=_filled(normals))
    corner_normals = -axes.T[place_of_corner[own]]
    at_crease = creased[place_of_corner[own]]
    sharp = np.flatnonzero(creased[place_of_corner] & usable[:, None])
    sharp_normals = _unit(_creased(units, areas, sharp, place_of_corner.reshape(-1)[sharp], crease))
    corner_normals[at_crease] = sharp_normals.T[computed.reshape(-1)[sharp]]
    return _split(scene, normals, own, corner_normals.astype(np.float32))


def _given(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The scene's own normals as unit vectors [n, 3], zero where none is valid, and where one is [n]."""
    if scene.vertex_normals is None:
        return np.zeros(scene.vertices.shape, np.float32), np.zeros(len(scene.vertices), bool)
    normals = _unit(np.ascontiguousarray(scene.vertex_normals.T, dtype=np.float64)).T
    return normals.astype(np.float32), np.asarray(normals.any(axis=1))


def _filled(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """The normals [n, 3] with +Z for zero."""
    normals[~normals.any(axis=1)] = (0, 0, 1)
    return normals


def _scaled(scene: Scene) -> Floats:
    """The vertices as [3, n] times the power of two that brings faces to about 1: areas neither overflow nor vanish."""
    size = float(np.abs(scene.bounds).max())
    exponent = max(-1000, min(1000, -math.frexp(size)[1]))
    with np.errstate(all="ignore"):
        return np.ascontiguousarray(scene.vertices.T) * math.ldexp(1.0, exponent) + 0.0  # + 0.0: -0.0 becomes 0.0


def _area_normals(points: Floats, faces: NDArray[np.int32]) -> Floats:
    """Each face's normal times twice its area, [3, m], from points [3, n]; zero where it is not finite."""
    with np.errstate(all="ignore"):
        a = points.take(faces[:, 0], axis=1)
        b = points.take(faces[:, 1], axis=1) - a
        c = points.take(faces[:, 2], axis=1) - a
        normals = np.stack([b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
    normals[:, ~np.isfinite(normals).all(axis=0)] = 0
    return normals


def _unit(vectors: Floats) -> Floats:
    """The vectors [3, k] at length 1; zero where they are zero or not finite."""
    with np.errstate(all="ignore"):
        vectors = vectors / np.abs(vectors).max(axis=0)  # no square of it overflows or vanishes
        vectors /= np.sqrt(_dot(vectors, vectors))
    vectors[:, ~np.isfinite(vectors).all(axis=0)] = 0
    return vectors


def _dot(a: Floats, b: Floats) -> Floats:
    """The scalar products of vectors [3, ...]; in this order of sums everywhere, which a BLAS would not promise."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _distinct(columns: Floats) -> tuple[Indices, Indices]:
    """Which columns of [d, k] are bitwise equal: the first of each kind [kinds], and the kind of each [k]."""
    bits = columns.view(np.uint64)
    key = np.zeros(columns.shape[1], np.uint64)
    for row in bits:
        key = (key ^ row) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(32)
    _, first, kind = np.unique(key, return_index=True, return_inverse=True)
    if (bits != bits[:, first[kind]]).any():  # different columns with one key: rare, so the slow way may do
        _, first, kind = np.unique(bits, axis=1, return_index=True, return_inverse=True)
    return first, kind.reshape(-1)


def _smooth(
    units: Floats, areas: Floats, places: Indices, count: int, crease: float
) -> tuple[Floats, NDArray[np.int8], NDArray[np.bool_]]:
    """The normal of each place as if all were smooth [3, count], the side of it that each corner is on [m, 3], ±1,
    and whether its place is creased [count].

    units, areas: face normals [3, m]; places: of each corner [m, 3]; count: of all places, as vertices that no face
    uses have places too; crease: radians.
    A place is smooth if its faces lie within half the crease angle of their mean: any two then lie within all of it.
    """
    usable = units.any(axis=0)
    reference = np.zeros((3, count))
    for corner in range(3):
        reference[:, places[usable, corner]] = units[:, usable]
    sums = np.zeros((3, count))
    for corner in range(3):
        place = places[:, corner]
        facing = np.where(_dot(reference.take(place, axis=1), units) < 0, -1.0, 1.0)
        for axis in range(3):
            sums[axis] += np.bincount(place, areas[axis] * facing, count)
    axes = _unit(sums)
    side = np.empty(places.shape, np.int8)
    creased = np.zeros(count, bool)
    for corner in range(3):
        place = places[:, corner]
        cosine = _dot(axes.take(place, axis=1), units)
        side[:, corner] = np.where(cosine < 0, -1, 1)
        creased[place[usable & (np.abs(cosine) < math.cos(crease / 2))]] = True
    return axes, side, creased


def _creased(units: Floats, areas: Floats, corners: Indices, places: Indices, crease: float) -> Floats:
    """For each of the corners (3 * face + its number) the summed area normals of the faces at its place within crease.

    units, areas: face normals [3, m]; places: of each corner [k]; crease: radians. Returns [3, k].
    """
    order = np.argsort(places, kind="stable")
    unit, area = units.take(corners[order] // 3, axis=1), areas.take(corners[order] // 3, axis=1)
    starts = np.flatnonzero(np.diff(places[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    sums = np.empty_like(area)
    for size in np.unique(sizes):
        groups = starts[sizes == size]
        solve, step = (_in_pairs, max(1, _PAIRS // int(size) ** 2)) if size <= _CROWD else (_in_groups, 1)
        for begin in range(0, len(groups), step):
            members = groups[begin : begin + step, None] + np.arange(size)  # [groups, size]
            sums[:, members] = solve(unit[:, members], area[:, members], crease)
    result = np.empty_like(sums)
    result[:, order] = sums
    return result


def _in_pairs(unit: Floats, area: Floats, crease: float) -> Floats:
    """For each face of each group, [3, groups, size], the sum of its group's areas within crease, all to its side."""
    cosine = _dot(unit[:, :, :, None], unit[:, :, None, :])
    weight = np.where(np.abs(cosine) >= math.cos(crease) - _TOLERANCE, np.where(cosine < 0, -1.0, 1.0), 0.0)
    return np.stack([(weight * component[:, None, :]).sum(axis=2) for component in area])


def _in_groups(unit: Floats, area: Floats, crease: float) -> Floats:
    """As _in_pairs for one large group, [3, 1, size]: faces within crease / 2 of one of them share a sum, in turn."""
    sums = np.empty_like(area)
    left = np.arange(unit.shape[2])
    while left.size:
        cosine = _dot(unit[:, 0, left], unit[:, 0, left[:1]])
        near = np.abs(cosine) >= math.cos(crease / 2) - _TOLERANCE
        members, facing = left[near], np.where(cosine[near] < 0, -1.0, 1.0)
        sums[:, 0, members] = (area[:, 0, members] * facing).sum(axis=1)[:, None] * facing
        left = left[~near]
    return sums


def _split(
    scene: Scene, normals: NDArray[np.float32], own: NDArray[np.bool_], corner_normals: NDArray[np.float32]
) -> Scene:
    """The scene with vertex normals [n, 3], but for the corners where own [m, 3], which have corner_normals [k, 3].

    A vertex is repeated for each further normal that its corners ask for; colours follow.
    """
    asking = scene.faces[own].astype(np.int64)
    first, variant = _distinct(np.ascontiguousarray(np.column_stack([asking, corner_normals]).T, dtype=np.float64))
    source = asking[first]  # the vertex of each variant
    free = np.ones(len(scene.vertices), bool)
    free[scene.faces[~own]] = False
    claims, claimant = np.unique(source, return_index=True)
    settled = claimant[free[claims]]  # a vertex that no other corner uses goes to its first variant
    slot = np.full(len(source), -1)
    slot[settled] = source[settled]
    added = np.flatnonzero(slot < 0)
    slot[added] = len(scene.vertices) + np.arange(len(added))

    normals[source[settled]] = corner_normals[first[settled]]
    faces = scene.faces.copy()
    faces[own] = slot[variant]
    colors = scene.vertex_colors
    return replace(
        scene,
        vertices=np.concatenate([scene.vertices, scene.vertices[source[added]]]),
        faces=faces,
        vertex_colors=None if colors is None else np.concatenate([colors, colors[source[added]]]),
        vertex_normals=_filled(np.concatenate([normals, corner_normals[first[added]]])),
    )
