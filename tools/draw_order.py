"""Draws the pictures of docs/why_order_matters.md, right and wrong ones of one scene: python tools/draw_order.py

clpeel finds the fragments of each pixel, and draws the exact picture, the peels and the weighted ones. The wrong orders
are the same fragments, blended by NumPy in the order that a program uses which sorts nothing, objects, or triangles.
Everything is drawn with one sample a pixel, SCALE times as large, and made smaller by the mean.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

import clpeel

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "order"
SIZE, SCALE = (400, 300), 3
PEELS = (1, 2, 4)
Floats = NDArray[np.float64]


def ball(place: tuple[float, float, float], radius: float, color: tuple[int, int, int, int]) -> clpeel.Scene:
    """Return a ball."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return clpeel.load(mesh.apply_translation(place), color=color)


def pane(degrees: float, color: tuple[int, int, int, int]) -> clpeel.Scene:
    """Return an upright pane of two triangles, turned about its middle line."""
    corners = [[-1.2, -0.9, 0.0], [1.2, -0.9, 0.0], [1.2, 0.9, 0.0], [-1.2, 0.9, 0.0]]
    turn = trimesh.transformations.rotation_matrix(np.radians(degrees), (0, 1, 0))[:3, :3]
    return clpeel.Scene.from_arrays(np.dot(corners, turn.T), [[0, 1, 2], [0, 2, 3]], color=color)


def parts() -> list[clpeel.Scene]:
    """Return the objects, in the order of the file: panes that cross, a ring and a ball in them, small balls around."""
    ring = trimesh.creation.torus(0.85, 0.13, major_sections=72, minor_sections=28)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.radians(72), (1, 0.2, 0)))
    return [
        ball((-0.62, -0.52, 0.95), 0.22, (225, 30, 40, 170)),
        pane(-40, (250, 160, 20, 140)),
        clpeel.load(ring, color=(200, 30, 170, 140)),
        ball((0.0, 0.0, -0.02), 0.5, (20, 175, 90, 150)),
        pane(35, (40, 110, 235, 140)),
        ball((0.55, 0.5, -1.0), 0.24, (250, 215, 30, 190)),
    ]


def ordered(layers: clpeel.Layers, distance: Floats) -> clpeel.Layers:
    """Return the same fragments in another order, each pixel's front to back by the distances of their triangles.

    distance: float64 [triangles]. The lesser is in front. Of equals, the one that was drawn later is in front, as where
    each is put over what was drawn before.
    """
    pixel = np.repeat(np.arange(len(layers.start) - 1), np.diff(layers.start))
    order = np.lexsort((-layers.triangle, distance[layers.triangle], pixel))
    rank = np.arange(len(order), dtype=np.float32) - layers.start[pixel].astype(np.float32)
    return replace(layers, color=layers.color[order], triangle=layers.triangle[order], depth=rank)


def wrong_orders(objects: list[clpeel.Scene], scene: clpeel.Scene, camera: clpeel.Camera) -> dict[str, Floats]:
    """Return the distances, one for each triangle, by which each wrong way sorts."""
    along = np.subtract(camera.focal_point, camera.position) / camera.distance

    def away(points: NDArray[Any]) -> Floats:
        return np.asarray((points - camera.position) @ along, np.float64)

    corners = scene.vertices[scene.faces]
    middles = np.array([each.bounds.mean(axis=0) for each in objects])
    return {
        "unsorted": np.zeros(len(scene.faces)),
        "by-object": np.repeat(away(middles), [len(each.faces) for each in objects]),
        "by-triangle": away(corners.mean(axis=1)),
    }


def pictures() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield each picture with its name, SCALE times as large as it is shown."""
    objects = parts()
    renderer = clpeel.Renderer(clpeel.load(*objects))
    camera = clpeel.Camera.frame(renderer.scene, (-0.15, -0.35, -1), aspect=SIZE[0] / SIZE[1]).zoom(1.4)
    options: dict[str, Any] = {
        "size": (SCALE * SIZE[0], SCALE * SIZE[1]),
        "background": "white",
        "lighting": "headlight",
        "samples": 1,
    }
    exact = renderer.render(camera, layers=True, **options)
    yield "exact", exact.image
    for name, distance in wrong_orders(objects, renderer.scene, camera).items():
        yield name, ordered(exact.layers, distance).composite("white")
    for name in ("weighted-average", "weighted-sum"):
        yield name, renderer.render(camera, technique=name, **options).image
    for peels in PEELS:
        yield f"peels-{peels}", renderer.render(camera, technique="depth-peeling", passes=peels, **options).image


def smaller(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the mean of each SCALE x SCALE pixels, without alpha: uint8 [height, width, 3]."""
    width, height = SIZE
    mean = image[..., :3].reshape(height, SCALE, width, SCALE, 3).mean(axis=(1, 3))
    return np.floor(mean + 0.5).astype(np.uint8)


def main() -> None:
    """Draw and write all of them."""
    FOLDER.mkdir(exist_ok=True)
    for name, image in pictures():
        Image.fromarray(smaller(image)).save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
