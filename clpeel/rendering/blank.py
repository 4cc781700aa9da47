"""Blank pictures: tells whether a picture is blank and why, in words that say what to do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import Background
from clpeel.pictures.background import levels_of
from clpeel.scene.camera import FLAT, Camera, flat_normal
from clpeel.scene.scene import Scene

SEEN = 2
"""Steps of 1/255 that nobody sees. A picture that differs from its background by no more is blank."""


def why_blank(
    image: NDArray[np.uint8],
    background: Background | None,
    scene: Scene,
    camera: Camera,
    covered: int,
    discarded: int,
) -> str | None:
    """Why nothing shows in a picture, in one line; None if something does.

    image: uint8 [height, width, 4]. background: as checked, or None for straight alpha. covered: 0 if no sample
    has a surface. discarded: how many triangles, lines and points are NaN or infinite.
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


def _is_blank(image: NDArray[np.uint8], background: Background | None) -> bool:
    """Whether to the eye all pixels are the background.

    The middle row is examined first: in most pictures that are not blank it already differs.
    """
    if background is None:
        return bool((image[len(image) // 2, :, 3] <= SEEN).all() and (image[..., 3] <= SEEN).all())
    levels = levels_of(background, len(image)).astype(np.int16)
    low, high = (np.clip(levels + step, 0, 255).astype(np.uint8) for step in (-SEEN, SEEN))

    def alike(row: int) -> bool:
        return bool(((image[row] >= low[row]) & (image[row] <= high[row])).all())

    return alike(len(image) // 2) and all(alike(row) for row in range(len(image)))


def _is_wholly_transparent(scene: Scene) -> bool:
    """Whether every alpha is 0, whatever textures have."""
    alpha = scene.colors[..., 3]
    if scene.face_materials is not None:
        plain = scene.plain_faces
        used = {scene.materials[place] for place in np.unique(scene.face_materials[~plain])}
        if any(m.opacity > 0 and (m.alpha_mode != "BLEND" or m.base_color[3] > 0) for m in used):
            return False
        if scene.vertex_colors is None:
            rows = np.append(plain, np.ones(sum(scene.counts[1:]), bool))
            alpha = np.broadcast_to(alpha, rows.shape)[rows]
        else:
            alpha = alpha[np.append(scene.faces[plain].reshape(-1), scene.mark_vertices)]
    elif scene.vertex_colors is not None:
        alpha = alpha[np.append(scene.faces.reshape(-1), scene.mark_vertices)]
    return not alpha.any()


def _why_nothing_is_covered(scene: Scene, camera: Camera, discarded: int) -> str:
    faces, lines, points = scene.counts
    marks = lines + points
    if discarded == faces + marks:
        return f"all {scene.described if marks else f'{faces:,} triangles'} have corners that are NaN or infinite"
    if not marks and _is_edge_on(scene, camera):
        return "its mesh is flat and seen edge-on; look at its face, by another --camera-direction or --camera-position"
    nearest, farthest = camera.view_distances(scene)
    if farthest <= 0 and not camera.orthographic:
        return "all surfaces are behind the camera; give another --camera-position or --camera-focal-point"
    if camera.clipping_range is not None:
        near, far = camera.clipping_range
        if farthest < near or nearest > far:
            return f"all surfaces lie {nearest:.6g} to {farthest:.6g} away, outside --clipping-range {near:g},{far:g}"
    if not marks and scene.single_sided is not None and _is_seen_from_behind(scene, camera):
        return (
            "all faces are seen from behind, and the file says they have one side; --backface-type visible shows them"
        )
    if not marks and scene.kinds.routed.any():
        return "its textures are holes wherever they are seen: their alpha is 0, or below the cut-off of the material"
    if marks:
        return (
            "no triangle, line or point covers a sample: all of them lie beside the view, or are thinner than a pixel; "
            "give another --camera-direction, --line-width or --point-size"
        )
    return (
        "no triangle covers a sample: all surfaces lie beside the view, or are thinner than a pixel; give another "
        "--camera-direction, --camera-position or --resolution"
    )


def _is_seen_from_behind(scene: Scene, camera: Camera) -> bool:
    """Whether all faces have one side alone, and are seen from the other."""
    if scene.single_sided is None or not scene.single_sided.all():
        return False
    with np.errstate(all="ignore"):
        a, b, c = (scene.vertices[scene.faces[:, corner]] for corner in range(3))
        views = camera.axes()[2] if camera.orthographic else a - np.asarray(camera.position)
        facing = (np.cross(b - a, c - a) * views).sum(axis=1)
    return bool((facing[np.isfinite(facing)] >= 0).all())


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
