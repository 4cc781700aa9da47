"""Maps that pictures of any technique may have: what is seen first at a pixel's centre, and how much lies there."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import ALL_LAYERS
from clpeel.rendering.options import FOREMOST_MAPS
from clpeel.scene.camera import Camera
from clpeel.scene.scene import Scene
from clpeel.stages.composite import Map

if TYPE_CHECKING:
    from clpeel.pictures.layers import Layers

LAYER_COUNT, TRANSMITTANCE = "layer_count", "transmittance"


def layers_for(names: Iterable[str]) -> int:
    """Return how many layers of a pixel these maps need, from the front; 0 for none."""
    wanted = set(names)
    if LAYER_COUNT in wanted:
        return ALL_LAYERS
    return int(bool(wanted & set(FOREMOST_MAPS)))


def view_maps(
    names: Collection[str],
    layers: Layers | None,
    color: NDArray[np.float32] | None,
    scene: Scene,
    camera: Camera,
) -> dict[str, Map]:
    """Return the maps of these names, [height, width], row 0 on top.

    depth: float32 (or float64, as Layers.depth), the distance from the camera along its view axis in scene units, or
    infinite where nothing is. normal: float32 [height, width, 3], the unit normal of the face, as the scene has its
    axes, on the side that is seen; zeros where nothing, a line or a point is. triangle: int32, the index of the scene's
    face, or -1. layer_count: float32, how many layers there are, the first opaque one included. All of these are taken
    at the pixel's centre, however many samples the picture has. transmittance: float32, how much of the background is
    seen, 0..1, the mean of the samples.
    layers: as many as `layers_for` says. color: the picture's, for the transmittance.
    """
    found: dict[str, Map] = {}
    if layers is not None:
        width, height = layers.size
        found["depth"], found["triangle"] = _foremost(layers)
        found[LAYER_COUNT] = np.diff(layers.start).reshape(height, width).astype(np.float32)
        if "normal" in names:
            found["normal"] = face_normals(found["triangle"], scene, camera)
    if color is not None:
        found[TRANSMITTANCE] = np.clip(np.float32(1) - color[..., 3], np.float32(0), np.float32(1))
    return {name: found[name] for name in names}


def _foremost(layers: Layers) -> tuple[Map, Map]:
    """Return the depths and triangles of the foremost layer."""
    width, height = layers.size
    if layers.count:
        _, depth, triangle = layers.layer(0)
    else:
        depth = np.full((height, width), np.inf, layers.depth.dtype)
        triangle = np.full((height, width), -1, np.int32)
    return depth, triangle


def face_normals(triangle: NDArray[np.int32], scene: Scene, camera: Camera) -> NDArray[np.float32]:
    """Return the unit normals of faces, on the side that the camera sees: float32 [..., 3], zeros for no face."""
    found = np.zeros((*triangle.shape, 3), np.float32)
    seen, place = np.unique(triangle, return_inverse=True)
    faces = (seen >= 0) & (seen < len(scene.faces))
    corners = scene.vertices[scene.faces[seen[faces]]]
    sides = corners[:, 1:] - corners[:, :1]
    sides /= np.maximum(np.abs(sides).max(axis=(1, 2), keepdims=True), np.finfo(np.float64).tiny)  # of any size
    normal = np.cross(sides[:, 0], sides[:, 1])
    away = camera.axes()[2] if camera.orthographic else corners[:, 0] - np.asarray(camera.position)
    normal *= np.where((normal * away).sum(axis=1) > 0, -1.0, 1.0)[:, None]
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    of_seen = np.zeros((len(seen), 3), np.float32)
    of_seen[faces] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    found[...] = of_seen[place.reshape(triangle.shape)]
    return found
