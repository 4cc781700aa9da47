"""Shapes: the scenes of the suite that are made here: spheres, grass, hair, smoke, a machine's shells, and foliage.

They are within the ball of radius 1 around the origin, nearly. Their numbers come from dice.py, so their bits are the
same everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Texture
from clpeel.study.dice import Dice, Floats, dot, noise, smooth, unit

Ints = NDArray[np.int64]
QUAD = np.array([[0, 1, 2], [0, 2, 3]])
"""The faces of a quad whose corners go around."""

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
"""The corners of the unit square, in that order."""


def bytes_of(colors: ArrayLike) -> NDArray[np.uint8]:
    """Return colours 0..1 as uint8 0..255, rounded."""
    return np.floor(np.clip(np.asarray(colors, np.float64), 0, 1) * 255 + 0.5).astype(np.uint8)


# --- spheres ----------------------------------------------------------------------------------------------------------

SPHERES, SPHERE_CELLS, SPHERE_ALPHA = 10, 80, 0.3


def spheres_scene() -> Scene:
    """Return ten closed spheres within one another, off the centre by chance: 768,000 triangles, 20 layers at most."""
    dice = Dice(1)
    ball, one = _ball(SPHERE_CELLS)
    centers, colors = dice(SPHERES, 3, low=-0.06, high=0.06), dice(SPHERES, 4)
    colors[np.arange(SPHERES), np.arange(SPHERES) % 3] = 1.0  # bright, and each unlike the next
    colors[:, 3] = SPHERE_ALPHA
    radii = 0.25 + 0.07 * np.arange(SPHERES)
    vertices = radii[:, None, None] * ball + centers[:, None]
    faces = one + len(ball) * np.arange(SPHERES)[:, None, None]
    return Scene.from_arrays(vertices.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(bytes_of(colors), len(one), 0))


def _ball(cells: int) -> tuple[Floats, Ints]:
    """Return a closed sphere of radius 1: the sides of a cube, each with so many cells a side, blown up.

    Vertices are [6 (cells + 1)^2, 3]. The sides share places, but not vertices.
    """
    along = 2.0 * np.arange(cells + 1) / cells - 1.0
    u, v = np.meshgrid(along, along, indexing="ij")
    length = np.sqrt(1.0 + (u * u + v * v))  # the same bits from both sides of an edge of the cube
    side = np.stack([np.ones_like(u), u, v], -1) / length[..., None]
    i, j = np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij")
    a = i * (cells + 1) + j
    quads = np.stack([a, a + cells + 1, a + cells + 2, a + 1], -1).reshape(-1, 4)
    vertices = np.stack([sign * np.roll(side, turn, -1) for turn in range(3) for sign in (1.0, -1.0)])
    faces = quads[:, QUAD].reshape(-1, 3)
    turned = np.stack([faces if sign else faces[:, ::-1] for _ in range(3) for sign in (True, False)])
    starts = len(along) ** 2 * np.arange(6)[:, None, None]
    return vertices.reshape(-1, 3), (turned + starts).reshape(-1, 3)


# --- grass ------------------------------------------------------------------------------------------------------------

BLADES, BLADE_ALPHA = 192, 0.5


def grass_scene() -> Scene:
    """Return blades one behind the other, each of two large triangles: 384 triangles, some 35 layers."""
    dice = Dice(2)
    x, half = dice(BLADES, low=-0.7, high=0.7), dice(BLADES, low=0.03, high=0.09)
    height, lean = dice(BLADES, low=0.8, high=1.4), dice(BLADES, low=-0.3, high=0.3)
    z = -0.9 + 1.8 * np.arange(BLADES) / BLADES
    bottom, top = np.full(BLADES, -0.7), height - 0.7
    corners = [(x - half, bottom), (x + half, bottom), (x + half + lean, top), (x - half + lean, top)]
    vertices = np.stack([np.stack([across, up, z], -1) for across, up in corners], 1)
    colors = np.array([0.08, 0.47, 0.08, 0.0]) + dice(BLADES, 4) * [0.39, 0.53, 0.27, 0.0]
    colors[:, 3] = BLADE_ALPHA
    return Scene.from_arrays(vertices.reshape(-1, 3), _quads(BLADES), np.repeat(bytes_of(colors), 2, axis=0))


def _quads(count: int) -> Ints:
    """Return the faces of so many quads, whose corners follow one another: int [2 count, 3]."""
    return (QUAD + 4 * np.arange(count)[:, None, None]).reshape(-1, 3)


# --- hair -------------------------------------------------------------------------------------------------------------

STRANDS, PIECES, STRAND_WIDTH, STRAND_ALPHA = 100_000, 3, 0.0012, 0.35
HEAD, HEAD_RADIUS = np.array([0.0, 0.25, 0.0]), 0.5
LIGHT = np.array([0.48, 0.6, 0.64])
"""Where the light of baked colours comes from: a unit vector."""


def hair_scene() -> Scene:
    """Return 100,000 thin ribbons that hang from a head, each of three pieces: 600,000 triangles, some 90 layers."""
    dice = Dice(3)
    root = dice.directions(STRANDS)
    root[:, 1] = np.abs(root[:, 1]) * 1.3 - 0.3
    root = unit(root)
    middle = _strands(dice, root)
    along = unit(np.diff(middle, axis=1, append=2.0 * middle[:, -1:] - middle[:, -2:-1]))
    across = unit(_cross(along, dice.directions(STRANDS)[:, None]))
    taper = 1.0 - 0.8 * np.arange(PIECES + 1)[:, None] / PIECES
    half = 0.5 * STRAND_WIDTH * taper * across
    vertices = np.stack([middle - half, middle + half], 2)  # [strands, PIECES + 1, 2, 3]
    first = 2 * np.arange(PIECES)[:, None] + [0, 1, 3, 2]
    faces = first[:, QUAD].reshape(-1, 3) + 2 * (PIECES + 1) * np.arange(STRANDS)[:, None, None]
    # As much light as falls across the strand (Kajiya and Kay 1989).
    turned = dot(along[:, :-1], LIGHT)
    shine = np.sqrt(np.maximum(1.0 - turned * turned, 0.0))
    dye = np.array([0.45, 0.27, 0.12]) + dice(STRANDS, 1, low=-0.1, high=0.25) * [1.0, 0.8, 0.5]
    colors = np.concatenate([dye[:, None] * (0.35 + 0.9 * shine), np.full(shine.shape, STRAND_ALPHA)], -1)
    return Scene.from_arrays(
        vertices.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(bytes_of(colors).reshape(-1, 4), 2, axis=0)
    )


def _strands(dice: Dice, root: Floats) -> Floats:
    """Return the middle of each strand: float64 [strands, PIECES + 1, 3]. It grows outwards, falls, and curls."""
    t = np.arange(PIECES + 1)[:, None] / PIECES
    length = dice(len(root), 1, 1, low=0.5, high=1.0)
    curl = dice.directions(len(root))[:, None] * dice(len(root), 1, 1, high=0.25)
    down = np.array([0.0, -1.0, 0.0])
    grown = root[:, None] * (HEAD_RADIUS + 0.35 * length * t) + length * (down * t * t + curl * t * (t - 0.4))
    distance = np.sqrt(dot(grown, grown))
    return HEAD + grown * np.maximum(HEAD_RADIUS / distance, 1.0)  # hair lies on the head and does not enter it


def _cross(a: Floats, b: Floats) -> Floats:
    x, y, z = (a[..., k] for k in range(3))
    p, q, r = (b[..., k] for k in range(3))
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], -1)


# --- smoke ------------------------------------------------------------------------------------------------------------

SHEETS, PUFF_TEXELS, PUFF_ALPHA = 64, 256, 0.5


def smoke_scene() -> Scene:
    """Return 64 parallel sheets, evenly spaced and across the view, with a soft puff of smoke on each.

    There are 128 triangles, and at most 64 layers. Sheets are submitted in no order.
    """
    dice = Dice(4)
    center = dice(SHEETS, 1, 2, low=-0.3, high=0.3)
    half = dice(SHEETS, 1, 1, low=0.4, high=0.65)
    depth = (dice.order(SHEETS) + 0.5) * 2.0 / SHEETS - 1.0
    corners = center + half * (2.0 * CORNERS - 1.0)
    vertices = np.concatenate([corners, np.broadcast_to(depth[:, None, None], (SHEETS, 4, 1))], -1)
    uv = np.stack([np.roll(CORNERS[::turn], by, axis=0) for turn, by in _turns(dice, SHEETS)])
    grey = dice(SHEETS, 1, low=0.05, high=0.6) + dice(SHEETS, 3, high=0.15)
    puff = Material("puff", texture=Texture(_puff(dice)), alpha_mode="BLEND")
    return Scene.from_arrays(
        vertices.reshape(-1, 3),
        _quads(SHEETS),
        np.repeat(bytes_of(np.concatenate([grey, np.ones((SHEETS, 1))], -1)), 2, axis=0),
        materials=[puff],
        uv=uv.reshape(-1, 2),
    )


def _turns(dice: Dice, count: int) -> list[tuple[int, int]]:
    """Return for each quad how its texture is put on: mirrored (-1) or not, and by how many quarters it is turned."""
    return [(1 - 2 * int(word & 1), int(word >> 1) & 3) for word in dice.words(count) >> np.uint64(60)]


def _puff(dice: Dice) -> NDArray[np.uint8]:
    """Return a soft cloud on white: uint8 [PUFF_TEXELS, PUFF_TEXELS, 4]. Its alpha is 0 at the rim."""
    at = (np.arange(PUFF_TEXELS) + 0.5) * 2.0 / PUFF_TEXELS - 1.0
    rim = np.maximum(1.0 - (at * at + (at * at)[:, None]), 0.0)
    cloud = np.zeros((PUFF_TEXELS, PUFF_TEXELS))
    for cells, weight in ((4, 8), (8, 4), (16, 2), (32, 1)):
        cloud += noise(dice, PUFF_TEXELS, cells) * weight / 15
    image = np.ones((PUFF_TEXELS, PUFF_TEXELS, 4))
    image[..., 3] = PUFF_ALPHA * rim * smooth(2.0 * cloud - 0.4)
    return bytes_of(image)


# --- a machine's shells -----------------------------------------------------------------------------------------------

AROUND = 96
"""Faces around a part."""

HOUSING = [(0.84, -0.6), (0.9, -0.6), (0.9, 0.5), (0.84, 0.5)]
FLANGE = [(0.0, -0.68), (1.0, -0.68), (1.0, -0.6), (0.0, -0.6)]
COVER = [(0.0, 0.5), (0.9, 0.5), (0.9, 0.58), (0.0, 0.58)]
SHAFT = [(0.0, -0.85), (0.1, -0.85), (0.1, 0.85), (0.0, 0.85)]
BOLT = [(0.0, -0.74), (0.03, -0.74), (0.03, -0.5), (0.0, -0.5)]
SLEEVES = [
    [(radius, -0.6), (radius + 0.05, -0.6), (radius + 0.05, top), (radius, top)]
    for radius, top in ((0.72, 0.5), (0.58, 0.4), (0.44, 0.3), (0.3, 0.2), (0.17, 0.45))
]
"""Outlines of parts, as (radius, height). Flange and housing touch in a plane, and so do flange and sleeves, and cover
and housing."""

SLEEVE_COLORS = ((0.95, 0.6, 0.2), (0.3, 0.75, 0.45), (0.85, 0.3, 0.3), (0.6, 0.4, 0.8), (0.9, 0.8, 0.3))
PARTS: Sequence[tuple[Sequence[tuple[float, float]], tuple[float, ...]]] = (
    (FLANGE, (0.45, 0.5, 0.58, 0.4)),
    (HOUSING, (0.35, 0.55, 0.85, 0.25)),
    *((sleeve, (*color, 0.3)) for sleeve, color in zip(SLEEVES, SLEEVE_COLORS, strict=True)),
    (SHAFT, (0.7, 0.72, 0.75, 0.9)),
    (COVER, (0.4, 0.7, 0.75, 0.25)),
)
BOLTS, BOLT_CIRCLE, BOLT_COLOR = 8, 0.95, (0.3, 0.3, 0.34, 0.8)


def shells_scene() -> Scene:
    """Return a machine as from CAD: nine turned parts within one another and eight bolts, 8,832 triangles.

    Parts are closed shells, and some touch: there, faces of two parts lie in one plane.
    """
    parts = [_turned(outline, color, (0.0, 0.0)) for outline, color in PARTS]
    parts += [_turned(BOLT, BOLT_COLOR, BOLT_CIRCLE * place) for place in _circle(BOLTS)]
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts[:-1])])
    return Scene.from_arrays(
        np.concatenate([vertices for vertices, _, _ in parts]),
        np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts, strict=True)]),
        bytes_of(np.concatenate([colors for _, _, colors in parts])),
    )


def _circle(count: int) -> Floats:
    """Return points on the unit circle, [count, 2], evenly along a square that is then blown up. 4 divides count."""
    along = 8.0 * np.arange(count // 4) / count - 1.0
    side = np.stack([np.ones_like(along), along], -1)
    x, y = side[:, 0], side[:, 1]
    square = np.concatenate([side, np.stack([-y, x], -1), -side, np.stack([y, -x], -1)])
    return square / np.sqrt(square[:, :1] * square[:, :1] + square[:, 1:] * square[:, 1:])


def _turned(
    outline: Sequence[tuple[float, float]], color: Sequence[float], place: ArrayLike
) -> tuple[Floats, Ints, Floats]:
    """Return an outline (radius, height) turned about the Y axis, then moved to a place (x, z): a closed shell.

    Returns vertices [n, 3], faces [m, 3] and the face's colours [m, 4], lighter where they face the light.
    """
    circle = _circle(AROUND)
    x, z = np.asarray(place, np.float64)
    ends = np.array(outline)
    vertices = np.stack(
        [np.stack([circle[:, 0] * r + x, np.full(AROUND, y), circle[:, 1] * r + z], -1) for r, y in ends]
    )
    faces = []
    k = np.arange(AROUND)
    for start in range(len(ends)):
        stop = (start + 1) % len(ends)
        a, b = start * AROUND + k, start * AROUND + (k + 1) % AROUND
        c, d = stop * AROUND + (k + 1) % AROUND, stop * AROUND + k
        if ends[start][0] > 0:  # on the axis, a side has no length
            faces.append(np.stack([a, b, c if ends[stop][0] > 0 else d], -1))
        if ends[stop][0] > 0:
            faces.append(np.stack([a, c, d], -1))
    points, found = vertices.reshape(-1, 3), np.concatenate(faces)
    p, q, r = (points[found[:, corner]] for corner in range(3))
    shade = 0.55 + 0.45 * np.abs(dot(unit(_cross(q - p, r - p)), LIGHT))
    colors = np.tile(np.asarray(color, np.float64), (len(found), 1))
    colors[:, :3] *= shade
    return points, found, colors


# --- foliage ----------------------------------------------------------------------------------------------------------

LEAVES, LEAF_TEXELS, LEAF_ALPHA = 6_000, 128, 0.92
TRUNK = [(0.0, -1.0), (0.09, -1.0), (0.03, 0.3), (0.0, 0.3)]


def foliage_scene() -> Scene:
    """Return a tree: 6,000 square cards with a leaf on each, soft at its edge, and an opaque trunk.

    The leaves are 12,000 triangles. Outside a leaf, its card is no layer.
    """
    dice = Dice(5)
    away = dice(LEAVES, 1, 3).max(axis=-1)  # as often near the rim as a ball has room there
    center = np.array([0.0, 0.25, 0.0]) + dice.directions(LEAVES) * (0.15 + 0.6 * away)
    along = dice.directions(LEAVES)
    across = unit(_cross(along, dice.directions(LEAVES)))
    half = dice(LEAVES, 1, low=0.03, high=0.07)
    corners = [center + half * ((2.0 * u - 1.0) * along + (2.0 * v - 1.0) * across) for u, v in CORNERS]
    vertices = np.stack(corners, 1).reshape(-1, 3)
    green = np.array([0.05, 0.22, 0.02]) + dice(LEAVES, 1) * [0.30, 0.35, 0.05] + dice(LEAVES, 3) * [0.25, 0.1, 0.05]
    light = 0.45 + 0.55 * np.abs(dot(_cross(along, across), LIGHT))
    tint = np.concatenate([green * light, np.ones((LEAVES, 1))], -1)
    trunk, bark, bark_colors = _turned(TRUNK, (0.36, 0.25, 0.16, 1.0), (0.0, 0.0))
    leaf = Material("leaf", texture=Texture(_leaf(), wrap=("clamp", "clamp")), alpha_mode="BLEND")
    return Scene.from_arrays(
        np.concatenate([vertices, trunk]),
        np.concatenate([_quads(LEAVES), bark + len(vertices)]),
        np.concatenate([np.repeat(bytes_of(tint), 2, axis=0), bytes_of(bark_colors)]),
        materials=[leaf],
        face_materials=np.repeat([0, NO_MATERIAL], [2 * LEAVES, len(bark)]),
        uv=np.concatenate([np.tile(CORNERS, (LEAVES, 1)), np.zeros((len(trunk), 2))]),
    )


def _leaf() -> NDArray[np.uint8]:
    """Return a leaf with its veins: uint8 [LEAF_TEXELS, LEAF_TEXELS, 4]. Its alpha falls to 0 over a few texels."""
    at = (np.arange(LEAF_TEXELS) + 0.5) / LEAF_TEXELS
    u, aside = at[None, :], np.abs(2.0 * at[:, None] - 1.0)
    width = 5.0 * u * (1.0 - u) * (1.0 - u)  # widest at a third of its length
    inside = smooth((np.minimum(width, 0.95) - aside) * 12.0)
    rib = smooth(1.5 - aside * 25.0)
    ribs = 8.0 * (u - 0.4 * aside)
    vein = smooth(1.2 - 12.0 * np.abs(ribs - np.floor(ribs) - 0.5)) * 0.5
    image = np.empty((LEAF_TEXELS, LEAF_TEXELS, 4))
    image[..., :3] = (0.75 + 0.25 * np.maximum(rib, vein))[..., None]
    image[..., 3] = LEAF_ALPHA * inside
    return bytes_of(image)
