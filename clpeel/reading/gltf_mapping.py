"""Mappings of glTF: where textures lie on a surface, by which coordinates, and by KHR_texture_transform."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from clpeel.reading.gltf_document import TRANSFORM, Json, extension, number, numbers, whole
from clpeel.scene.arrays import AnyArray


@dataclass(frozen=True)
class Mapping:
    """Where textures lie on a surface. coordinates: the name of their attribute. transform: see at."""

    coordinates: str
    transform: tuple[float, float, float, float, float]

    def at(self, uv: AnyArray) -> AnyArray:
        """Return where coordinates [n, 2] lie in the image, by KHR_texture_transform: scaled, turned, then shifted.

        Angles are radians, counterclockwise as the image is seen, where v points down.
        """
        across, down, angle, wide, high = self.transform
        if (across, down, angle, wide, high) == (0, 0, 0, 1, 1):
            return uv
        u, v = uv[:, 0].astype(np.float64) * wide, uv[:, 1].astype(np.float64) * high
        cosine, sine = math.cos(angle), math.sin(angle)
        return np.stack([cosine * u + sine * v + across, cosine * v - sine * u + down], axis=1)


@dataclass(frozen=True)
class Mapped:
    """A texture on a surface. index: of the texture."""

    index: Any
    mapping: Mapping


def mapped(info: Json) -> Mapped:
    """Return the texture that a textureInfo object describes. Raises InputError."""
    shift = extension(info, TRANSFORM) or {}
    number_of_set = whole("texCoord", shift.get("texCoord", info.get("texCoord", 0)))
    across, down = numbers("offset", shift.get("offset", [0, 0]), 2)
    wide, high = numbers("scale", shift.get("scale", [1, 1]), 2)
    angle = number("rotation", shift.get("rotation", 0))
    return Mapped(info.get("index"), Mapping(f"TEXCOORD_{number_of_set}", (across, down, angle, wide, high)))
