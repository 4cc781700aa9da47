"""Scenes of textured quads, and images to put on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.textures import Texture
from twins import reference
from twins.soups import Soup

FILL = ((0.0, 0.0), (1.0, 1.0))
"""The image once: from (u, v) in the upper left corner to (u, v) in the lower right one."""


def textured(
    image: Any, *, wrap: Any = "repeat", magnify: Any = "linear", minify: Any = None, **material: Any
) -> Material:
    """A material with a texture. wrap: for both axes, or for each. minify: by default as `magnify`, without mip map."""
    both = (wrap, wrap) if isinstance(wrap, str) else wrap
    texture = Texture(np.asarray(image), both, magnify, magnify if minify is None else minify)
    return Material(texture=texture, **material)


def quads(corners: Any, uv: Any, materials: Sequence[Material], of_quads: Any = 0, **colors: Any) -> Soup:
    """Quads with corners [k, 4, 3], counterclockwise from the front, and their texture coordinates [k, 4, 2].

    of_quads: the material of each. colors: as Soup has them; white by default. Those of faces come two a quad.
    """
    corners = np.asarray(corners, np.float64)
    count = len(corners)
    faces = (4 * np.arange(count)[:, None, None] + [[0, 1, 2], [0, 2, 3]]).reshape(-1, 3)
    places = np.repeat(np.broadcast_to(of_quads, (count,)), 2)
    if not colors:
        colors = {"color": np.full(4, 255, np.uint8)}
    return Soup(
        corners.reshape(-1, 3),
        faces,
        materials=tuple(materials),
        face_materials=places,
        uv=np.broadcast_to(uv, (count, 4, 2)).reshape(-1, 2).astype(np.float32),
        **colors,
    )


def facing(material: Material, size: tuple[int, int], uv: Any = FILL, **colors: Any) -> Soup:
    """A quad that fills soups.pixel_view of a picture of that size."""
    half = np.array([*size, 0.0]) / 2
    (left, top), (right, bottom) = uv
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return quads([corners], [[left, bottom], [right, bottom], [right, top], [left, top]], [material], **colors)


def beside(soup: Soup, materials: Sequence[Material]) -> Soup:
    """The same to be seen, with a face of each of these materials behind all eyes: kernels for all of them are enough.

    The colours of the soup are those of vertices, or one for all.
    """
    count, corners = len(materials), len(soup.vertices)
    triangle = np.array([[0.1, 0.2, 5.1], [0.3, 0.2, 5.1], [0.1, 0.4, 5.1]])
    places = soup.face_materials if soup.face_materials is not None else np.full(len(soup.faces), NO_MATERIAL)
    uv = soup.uv if soup.uv is not None else np.zeros((corners, 2), np.float32)
    colors = soup.vertex_colors
    if colors is not None:
        white = np.full((3 * count, 4), 1.0 if colors.dtype.kind == "f" else 255, colors.dtype)
        colors = np.concatenate([colors, white])
    single = soup.single_sided
    return replace(
        soup,
        vertices=np.concatenate([soup.vertices, np.tile(triangle, (count, 1))]),
        faces=np.concatenate([soup.faces, corners + np.arange(3 * count).reshape(-1, 3)]),
        vertex_colors=colors,
        materials=(*soup.materials, *materials),
        face_materials=np.concatenate([places, len(soup.materials) + np.arange(count)]),
        uv=np.concatenate([uv, np.zeros((3 * count, 2), np.float32)]),
        single_sided=None if single is None else np.concatenate([single, np.zeros(count, bool)]),
    )


def with_vertex_colors(soup: Soup) -> Soup:
    """The same with colours of vertices, float32, if the faces at a vertex have one colour."""
    colors = np.zeros((len(soup.vertices), 4), np.float32)
    colors[soup.faces] = reference.straight_colors(soup)
    return replace(soup, vertex_colors=colors, face_colors=None, color=None)


def floor(material: Material, uv: Any, near: float = 1.0, far: float = 16.0, half: float = 40.0) -> Soup:
    """A floor one below soups.AHEAD, from one distance to another. uv: at its corners, from the near left one on."""
    corners = [[-half, -1, -near], [half, -1, -near], [half, -1, -far], [-half, -1, -far]]
    return quads([corners], [uv], [material])


def noise(seed: int, width: int, height: int, alpha: Any = 255) -> NDArray[np.uint8]:
    """Random bytes. alpha: of all texels, or some to choose from."""
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (height, width, 4), dtype=np.uint8)
    image[..., 3] = rng.choice(np.atleast_1d(alpha), (height, width))
    return image


def checker(width: int, height: int, even: Any = (0, 0, 0, 255), odd: Any = (255, 255, 255, 255)) -> NDArray[np.uint8]:
    """Texels that take turns."""
    turn = np.add.outer(np.arange(height), np.arange(width)) % 2
    return np.where(turn[..., None] == 0, np.array(even), np.array(odd)).astype(np.uint8)


def crossing(seed: int, count: int, materials: Sequence[Material], repeats: float = 2.0, **colors: Any) -> Soup:
    """Quads that cross one another within about 1 of the origin, with a random material each."""
    rng = np.random.default_rng(seed)
    corners = np.empty((count, 4, 3))
    for k in range(count):
        right, up = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * rng.uniform(0.4, 1.0, (2, 1))
        middle = rng.uniform(-0.3, 0.3, 3)
        corners[k] = middle + [-right - up, right - up, right + up, -right + up]
    start = rng.uniform(-1, 1, (count, 1, 2))
    uv = start + np.array([[0, 1], [1, 1], [1, 0], [0, 0]]) * rng.uniform(0.3, repeats, (count, 1, 2))
    return quads(corners, uv, materials, rng.integers(0, len(materials), count), **colors)
