"""Makes scenes: the tool's own, which need no files, and those of a folder that has a `scenes.py`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

import clpeel
from clpeel.scene.textures import Minify

CAMERA = clpeel.Camera((0, 0, 4), (0, 0, 0), view_angle=30, clipping_range=(2, 6))
HALF_ANGLE = math.radians(15)
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))])


def boxes(count: int = 10) -> clpeel.Scene:
    """Return count x count x count rotated boxes with one alpha: large triangles, tens of layers."""
    rng = np.random.default_rng(1)
    vertices, colors = [], []
    for place in np.ndindex(count, count, count):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        vertices.append(CUBE @ turn.T * (0.56 / count) + (np.array(place) + 0.5) / count * 1.2 - 0.6)
        colors.append([*rng.integers(40, 256, 3), 77])
    faces = np.concatenate([CUBE_FACES + 8 * box for box in range(count**3)])
    rgba = np.repeat(np.array(colors, np.uint8), len(CUBE_FACES), axis=0)
    return clpeel.Scene.from_arrays(np.concatenate(vertices).astype(np.float32), faces, face_colors=rgba)


def stack(layers: int) -> clpeel.Scene:
    """Return a picture-filling triangle for each layer, in random order. Alpha is so small that no layer is hidden."""
    rng = np.random.default_rng(2)
    away = rng.permutation(np.linspace(2.5, 5.5, layers))
    reach = 2 * math.tan(HALF_ANGLE) * away
    corners = np.empty((layers, 3, 3))
    corners[..., :2] = np.array([[-1, -1], [3, -1], [-1, 3]]) * reach[:, None, None]
    corners[..., 2] = (4 - away)[:, None]
    colors = rng.random((layers, 4), np.float32)
    colors[:, 3] = 1e-3
    faces = np.arange(3 * layers).reshape(layers, 3)
    return clpeel.Scene.from_arrays(corners.reshape(-1, 3), faces, face_colors=colors)


def soup(count: int, size: int) -> clpeel.Scene:
    """Return random triangles that share no vertex. Each is smaller than a pixel in a picture of `size` pixels."""
    rng = np.random.default_rng(3)
    leg = np.float32(0.68 * 8 * math.tan(HALF_ANGLE) / size)
    corners = np.empty((count, 3, 3), np.float32)
    corners[:] = rng.uniform(-0.9, 0.9, (count, 1, 3)).astype(np.float32)
    corners[..., 2] /= 9
    angle = rng.random(count, np.float32) * np.float32(2 * math.pi)
    side = np.stack([np.cos(angle), np.sin(angle)], -1) * leg
    corners[:, 1, :2] += side
    corners[:, 2, 0] -= side[:, 1]
    corners[:, 2, 1] += side[:, 0]
    colors = rng.integers(0, 256, (count, 4), np.uint8)
    return clpeel.Scene.from_arrays(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), face_colors=colors)


def vertex_colors(*scene: Any) -> clpeel.Scene:
    """Return a scene with the face's colour stored at each corner of each face."""
    made = make(*scene)
    corners = made.faces.reshape(-1)
    rgba = np.repeat(np.broadcast_to(made.colors, (len(made.faces), 4)), 3, axis=0)
    return clpeel.Scene.from_arrays(
        made.vertices[corners], np.arange(len(corners)).reshape(-1, 3), vertex_colors=np.ascontiguousarray(rgba)
    )


def some_opaque(apart: int, *scene: Any) -> clpeel.Scene:
    """Return a scene in which one of every `apart` triangles is opaque."""
    made = make(*scene)
    rgba = np.broadcast_to(made.colors, (len(made.faces), 4)).copy()
    rgba[::apart, 3] = 255 if rgba.dtype == np.uint8 else 1
    return clpeel.Scene.from_arrays(made.vertices, made.faces, face_colors=rgba)


TEXELS = 512
"""On a side of the texture of `textured`."""

QUADS = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float32)
"""Texture coordinates of two triangles that make a quad."""


def textured(around: bool, minify: Minify, *scene: Any) -> clpeel.Scene:
    """Return a scene with a texture on it, times the face's colour. Its texels are opaque, so alphas stay as they are.

    around: whether the texture is put around the origin, once. Else each two triangles get all of it.
    minify: the filter; the one for larger texels is linear if this one is, within a level.
    """
    made = make(*scene)
    corners = made.faces.reshape(-1)
    uv = uv_around(made.vertices[corners]) if around else np.resize(QUADS.reshape(-1, 2), (len(corners), 2))
    # Corners with the same texture coordinates share a vertex, as in files.
    rows = np.rec.fromarrays([corners, *uv.T.astype(np.float32)])
    _, first, of_corners = np.unique(rows, return_index=True, return_inverse=True)
    image = np.random.default_rng(4).integers(0, 256, (TEXELS, TEXELS, 4), np.uint8)
    image[..., 3] = 255
    texture = clpeel.Texture(image, magnify="nearest" if minify.startswith("nearest") else "linear", minify=minify)
    return clpeel.Scene.from_arrays(
        made.vertices[corners[first]],
        of_corners.reshape(-1, 3),
        face_colors=np.broadcast_to(made.colors, (len(made.faces), 4)),
        materials=[clpeel.Material(texture=texture, alpha_mode="BLEND")],
        uv=uv[first],
    )


def uv_around(corners: NDArray[Any]) -> NDArray[np.float64]:
    """Return longitude and latitude of corners [3 m, 3] as texture coordinates. No triangle turns back at the seam."""
    x, y, z = corners.T.astype(np.float64)
    u = (np.arctan2(y, x) / (2 * math.pi)).reshape(-1, 3)
    u -= np.round(u - u[:, :1])
    v = np.arccos(z / np.maximum(np.linalg.norm(corners, axis=1), 1e-30)) / math.pi
    return np.stack([u.reshape(-1), v], -1)


OWN: dict[str, Any] = {
    "boxes": boxes,
    "stack": stack,
    "soup": soup,
    "vertex colors": vertex_colors,
    "some opaque": some_opaque,
    "textured": textured,
}


def make(name: str, *numbers: Any) -> clpeel.Scene:
    """Return one of the tool's own scenes, or the scene of that name from the module `scenes` of the scenes' folder.

    A dict of options after the name is passed to the module's function of that name.
    """
    if numbers and isinstance(numbers[0], dict):
        import scenes  # type: ignore[import-not-found]

        vertices, faces, colors = getattr(scenes, name)(**numbers[0])
        return clpeel.Scene.from_arrays(vertices, faces, face_colors=colors)
    if name in OWN:
        scene: clpeel.Scene = OWN[name](*numbers)
        return scene
    import scenes

    vertices, faces, colors = scenes.named(name)
    return clpeel.Scene.from_arrays(vertices, faces, face_colors=colors)


def write_ply(path: str, vertices: Any, faces: Any) -> None:
    """Write a binary PLY, which any program reads quickly."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), [("corners", "u1"), ("faces", "<i4", 3)])
    rows["corners"], rows["faces"] = 3, faces
    with open(path, "wb") as file:
        file.write(header.encode() + np.asarray(vertices, "<f4").tobytes() + rows.tobytes())
