"""Vertex normals: the file's own if it has them, else smooth ones, which are split where the surface has a crease."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.scene.scene import Scene

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_TOLERANCE = 1e-5  # added to a cosine, so that 30 degrees stay 30 degrees after a model's coordinates were rounded
_PAIRS = 1 << 19  # the number of pairs of corners that are compared at a time, so that they stay in the cache
_CROWD = 256  # with more corners than this at one creased point, they are grouped and not compared in pairs


def with_normals(scene: Scene, crease_angle: float = 30.0) -> Scene:
    """Return the scene with a unit vector, float32 [n, 3], at every vertex. Vertices are split where there is a crease.

    The scene's own normals are kept if they are finite and not zero. Any other corner gets the mean of face normals,
    weighted by area: those of the faces at its position that lie within crease_angle degrees of its own face. Angles
    above 90 count as 90. Faces meet where their positions are equal, whatever their indices are. Winding does not
    matter: two faces are compared as if they were wound alike.

    A normal lies on the front of its own face, so that it interpolates well over that face, and lights know its sides.
    Where the scene's own normal lies on the back of a face, that corner gets it turned.

    At a crease where more than 256 corners meet, faces are grouped by direction, with the same limit on the angle.
    Faces keep their count and order. A vertex gets +Z if none of its faces has an area. It gets zeros, which are lit
    as if there were no light, if only lines and points use it and it has no normal of its own.

    Raises InputError unless crease_angle is in 0..180.
    """
    if not 0 <= crease_angle <= 180:
        raise InputError(f"crease_angle: expected 0..180 degrees, got {crease_angle}")
    crease = math.radians(min(crease_angle, 90.0))
    normals, known = _given(scene)
    return _without_light(_with_computed(scene, normals, known, crease), known)


def _without_light(scene: Scene, known: NDArray[np.bool_]) -> Scene:
    """Return the scene with zero normals at vertices that lines and points use, and no face, if they are not known.

    known: of the first vertices, bool [n]. Those that follow belong to faces.
    """
    if not len(scene.mark_vertices):
        return scene
    alone = np.zeros(len(known), bool)
    alone[scene.mark_vertices] = True
    alone &= ~known
    faces = scene.faces.reshape(-1)
    alone[faces[faces < len(known)]] = False
    assert scene.vertex_normals is not None
    scene.vertex_normals[: len(known)][alone] = 0
    return scene


def _with_computed(scene: Scene, normals: NDArray[np.float32], known: NDArray[np.bool_], crease: float) -> Scene:
    """Return the scene with normals [n, 3] where they are known, and computed ones elsewhere. crease: radians."""
    points = _scaled(scene)
    areas = _area_normals(points, scene.faces)
    of_file = known[scene.faces]
    if of_file.all():
        return _turned(replace(scene, vertex_normals=_filled(normals)), areas, of_file)
    units = _unit(areas)
    usable = np.asarray(units.any(axis=0))
    first, place = distinct(points)
    place_of_corner = place[scene.faces]
    axes, side, creased = _smooth(units, areas, place_of_corner, len(first), crease)

    # Smooth corners share the one normal of their place. All other corners get normals of their own.
    normals = np.where(known[:, None], normals, axes.T[place].astype(np.float32))
    computed = ~of_file & usable[:, None]
    own = computed & (creased[place_of_corner] | (side < 0))
    if not own.any():
        return _turned(replace(scene, vertex_normals=_filled(normals)), areas, of_file)
    corner_normals = -axes.T[place_of_corner[own]]
    at_crease = creased[place_of_corner[own]]
    sharp = np.flatnonzero(creased[place_of_corner] & usable[:, None])
    sharp_normals = _unit(_creased(units, areas, sharp, place_of_corner.reshape(-1)[sharp], crease))
    corner_normals[at_crease] = sharp_normals.T[computed.reshape(-1)[sharp]]
    return _turned(_split(scene, normals, own, corner_normals.astype(np.float32)), areas, of_file)


def _turned(scene: Scene, areas: Floats, of_file: NDArray[np.bool_]) -> Scene:
    """Return the scene with its own normals turned where they lie on the back of a face.

    areas: face normals [3, m]. of_file: the corners that have such normals, bool [m, 3]. Computed ones are right.
    """
    if not of_file.any():
        return scene
    normals = scene.vertex_normals
    assert normals is not None
    wrong = np.empty(scene.faces.shape, bool)
    for corner in range(3):
        wrong[:, corner] = _dot(normals[scene.faces[:, corner]].T.astype(np.float64), areas) < 0
    wrong &= of_file
    if not wrong.any():
        return scene
    return _split(scene, normals.copy(), wrong, -normals[scene.faces[wrong]])


def _given(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the scene's own normals as unit vectors [n, 3], zero where invalid, and where they are valid, bool [n]."""
    if scene.vertex_normals is None:
        return np.zeros(scene.vertices.shape, np.float32), np.zeros(len(scene.vertices), bool)
    normals = _unit(np.ascontiguousarray(scene.vertex_normals.T, dtype=np.float64)).T
    return normals.astype(np.float32), np.asarray(normals.any(axis=1))


def _filled(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the normals [n, 3] with each zero vector replaced by +Z."""
    normals[~normals.any(axis=1)] = (0, 0, 1)
    return normals


def _scaled(scene: Scene) -> Floats:
    """Return the vertices as [3, n], scaled by a power of two to a size of about 1.

    This keeps the faces' areas from overflowing or vanishing.
    """
    size = float(np.abs(scene.bounds).max())
    exponent = max(-1000, min(1000, -math.frexp(size)[1]))
    with np.errstate(all="ignore"):
        return np.ascontiguousarray(scene.vertices.T) * math.ldexp(1.0, exponent) + 0.0  # + 0.0 turns -0.0 into 0.0


def _area_normals(points: Floats, faces: NDArray[np.int32]) -> Floats:
    """Return each face's normal times twice its area, [3, m], from points [3, n]. It is zero if it is not finite."""
    with np.errstate(all="ignore"):
        a = points.take(faces[:, 0], axis=1)
        b = points.take(faces[:, 1], axis=1) - a
        c = points.take(faces[:, 2], axis=1) - a
        normals = np.stack([b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
    normals[:, ~np.isfinite(normals).all(axis=0)] = 0
    return normals


def _unit(vectors: Floats) -> Floats:
    """Return the vectors [3, k] at length 1, or zero where they are zero or not finite."""
    with np.errstate(all="ignore"):
        vectors = vectors / np.abs(vectors).max(axis=0)  # so that no square overflows or vanishes
        vectors /= np.sqrt(_dot(vectors, vectors))
    vectors[:, ~np.isfinite(vectors).all(axis=0)] = 0
    return vectors


def _dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar products of vectors [3, ...]. The sums have a fixed order, which a BLAS would not promise."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def distinct(columns: Floats) -> tuple[Indices, Indices]:
    """Find the columns of [d, k] float64 that are equal bit by bit.

    Returns the first of each kind, and each column's kind [k].
    """
    bits = columns.view(np.uint64)
    key = np.zeros(columns.shape[1], np.uint64)
    for row in bits:
        key = (key ^ row) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(32)
    _, first, kind = np.unique(key, return_index=True, return_inverse=True)
    # Different columns have the same key: this is rare, so a slow method will do.
    if (bits != bits[:, first[kind]]).any():
        _, first, kind = np.unique(bits, axis=1, return_index=True, return_inverse=True)
    return first, kind.reshape(-1)


def _smooth(
    units: Floats, areas: Floats, places: Indices, count: int, crease: float
) -> tuple[Floats, NDArray[np.int8], NDArray[np.bool_]]:
    """Return the smooth normals of all places, the side of each corner, and which places are creased.

    The results are: the normal of each place as if all were smooth, [3, count]; the side of that normal on which each
    corner's face lies, ±1, [m, 3]; and whether the place is creased, [count].
    units, areas: face normals [3, m]. places: the place of each corner [m, 3]. count: the number of all places, which
    include places of vertices that no face uses. crease: radians.
    A place is smooth if its faces all lie within half the crease angle of their mean. Then any two of them lie within
    the whole angle.
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
    """For each corner, return the sum of the area normals of the faces at its place that lie within crease: [3, k].

    units, areas: face normals [3, m]. corners: 3 * face + the corner's number, [k]. places: the place of each corner
    [k]. crease: radians.
    """
    order = np.argsort(places, kind="stable")
    unit, area = units.take(corners[order] // 3, axis=1), areas.take(corners[order] // 3, axis=1)
    starts = np.flatnonzero(np.diff(places[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    sums = np.empty_like(area)
    for size in np.flatnonzero(np.bincount(sizes)):  # np.unique imports numpy.ma, which takes 20 ms
        groups = starts[sizes == size]
        solve, step = (_in_pairs, max(1, _PAIRS // int(size) ** 2)) if size <= _CROWD else (_in_groups, 1)
        for begin in range(0, len(groups), step):
            members = groups[begin : begin + step, None] + np.arange(size)  # shape [groups, size]
            sums[:, members] = solve(unit[:, members], area[:, members], crease)
    result = np.empty_like(sums)
    result[:, order] = sums
    return result


def _in_pairs(unit: Floats, area: Floats, crease: float) -> Floats:
    """For each face of each group, return the sum of its group's area normals within crease, [3, groups, size].

    All of them are turned to the side of that face first.
    """
    cosine = _dot(unit[:, :, :, None], unit[:, :, None, :])
    weight = np.where(np.abs(cosine) >= math.cos(crease) - _TOLERANCE, np.where(cosine < 0, -1.0, 1.0), 0.0)
    return np.stack([(weight * component[:, None, :]).sum(axis=2) for component in area])


def _in_groups(unit: Floats, area: Floats, crease: float) -> Floats:
    """Do the same as _in_pairs for one large group, [3, 1, size], in less time.

    The first face that is left and all faces within crease / 2 of it share one sum. This repeats until no face is left.
    """
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
    """Return the scene with vertex normals [n, 3], except at the k corners where own [m, 3] is set.

    Those corners get corner_normals [k, 3].

    A vertex is repeated for each further normal that its corners need. Its colours and
    texture coordinates are repeated with it.
    """
    asking = scene.faces[own].astype(np.int64)
    first, variant = distinct(np.ascontiguousarray(np.column_stack([asking, corner_normals]).T, dtype=np.float64))
    source = asking[first]  # the vertex of each variant
    free = np.ones(len(scene.vertices), bool)
    free[scene.faces[~own]] = False
    claims, claimant = np.unique(source, return_index=True)
    settled = claimant[free[claims]]  # if no other corner uses a vertex, the vertex goes to its first variant
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
        uv=None if scene.uv is None else np.concatenate([scene.uv, scene.uv[source[added]]]),
        more_uv=tuple(np.concatenate([uv, uv[source[added]]]) for uv in scene.more_uv),
        vertex_normals=_filled(np.concatenate([normals, corner_normals[first[added]]])),
    )
