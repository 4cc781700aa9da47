"""Blank pictures: tells whether a picture is blank and why, in words that say what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clpeel.scene.camera import FLAT, Camera, flat_normal
from clpeel.scene.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

SEEN = 2
"""Steps of 1/255 that nobody sees. A picture that differs from its background by no more is blank."""


def why_blank(
    image: NDArray[np.uint8],
    background: Sequence[float] | None,
    scene: Scene,
    camera: Camera,
    covered: int,
    discarded: int,
) -> str | None:
    """Why nothing shows in a picture, in one line; None if something does.

    image: uint8 [height, width, 4]. background: three numbers 0..1, or None for straight alpha. covered: 0 if no sample
    has a surface. discarded: how many triangles have corners that are NaN or infinite.
    """
    if covered == 0:
        return f"the picture is blank: {_why_nothing_is_covered(scene, camera, discarded)}"
    if not _is_blank(image, background):
        return None
    if _is_wholly_transparent(scene):
        return "the picture is blank: every surface is wholly transparent (its alpha is 0); --opacity 1 shows them"
    if background is None:
        return "the picture is blank: its surfaces are too transparent to be seen; --opacity 1 shows them"
    return (
        "the picture is blank: its surfaces have the background's colour, or are too transparent to be seen; choose "
        "another --background-color, --color or --opacity"
    )


def _is_blank(image: NDArray[np.uint8], background: Sequence[float] | None) -> bool:
    """Whether to the eye all pixels are the background.

    The middle row is examined first: in most pictures that are not blank it already differs.
    """
    if background is None:
        return bool((image[len(image) // 2, :, 3] <= SEEN).all() and (image[..., 3] <= SEEN).all())
    level = (np.array([*background, 1.0]) * 255 + 0.5).astype(np.int16)
    low, high = (np.clip(level + step, 0, 255).astype(np.uint8) for step in (-SEEN, SEEN))

    def alike(part: NDArray[np.uint8]) -> bool:
        return bool(((part >= low) & (part <= high)).all())

    return alike(image[len(image) // 2]) and all(alike(row) for row in image)


def _is_wholly_transparent(scene: Scene) -> bool:
    colors = scene.colors
    if scene.vertex_colors is not None:
        colors = colors[scene.faces.reshape(-1)]
    return not colors[..., 3].any()


def _why_nothing_is_covered(scene: Scene, camera: Camera, discarded: int) -> str:
    faces = len(scene.faces)
    if discarded == faces:
        return f"all {faces:,} triangles have corners that are NaN or infinite"
    if _is_edge_on(scene, camera):
        return "its mesh is flat and seen edge-on; look at its face, by another --camera-direction or --camera-position"
    nearest, farthest = camera.view_distances(scene)
    if farthest <= 0 and not camera.orthographic:
        return "all surfaces are behind the camera; give another --camera-position or --camera-focal-point"
    if camera.clipping_range is not None:
        near, far = camera.clipping_range
        if farthest < near or nearest > far:
            return f"all surfaces lie {nearest:.6g} to {farthest:.6g} away, outside --clipping-range {near:g},{far:g}"
    return (
        "no triangle covers a sample: all surfaces lie beside the view, or are thinner than a pixel; give another "
        "--camera-direction, --camera-position or --resolution"
    )


def _is_edge_on(scene: Scene, camera: Camera) -> bool:
    """Whether the scene lies in a plane that the camera sees as a line."""
    normal = flat_normal(scene)
    if normal is None:
        return False
    if camera.orthographic:
        return bool(abs(normal @ camera.axes()[2]) <= FLAT)
    low, high = scene.bounds
    arm = np.asarray(camera.position) - (low / 2 + high / 2)
    return bool(abs(normal @ arm) <= FLAT * np.abs(arm).max())
