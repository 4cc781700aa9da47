"""The float64 twin of materials: the colours of fragments, which of them are there, and how far float32 may be off.

colour = sRGB(base_color * texel * C) and alpha = base_color's * texel's * C's, as glTF 2.0 has it (section 3.9.2),
where C is the scene's linear colour. A face without a material has the scene's colours as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twins import textures
from twins.textures import Footprint

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True)
class Places:
    """Where hits lie on a scene's faces. n hits."""

    face: Integers  # [n] in the scene
    color: Floats  # [n, 4] straight RGBA that the scene has there
    at: Footprint  # [n, 2] texture coordinates, and how they change from pixel to pixel

    def of(self, rows: Integers) -> Places:
        """Only these hits."""
        at = Footprint(self.at.uv[rows], self.at.along_x[rows], self.at.along_y[rows])
        return Places(self.face[rows], self.color[rows], at)


@dataclass(frozen=True)
class Painted:
    """What materials make of hits."""

    color: Floats  # [n, 4] straight RGBA, as it is shown
    there: Booleans  # [n] whether the hit is there at all


@dataclass(frozen=True)
class Range:
    """Between what hits may lie."""

    low: Floats  # [n, 4] straight RGBA
    high: Floats  # [n, 4]
    doubtful: Booleans  # [n] those that may or may not be there


def paint(scene: Any, places: Places, anisotropy: int = 1) -> Painted:
    """The colours of hits, and which of them are there."""
    color, there = places.color.copy(), np.ones(len(places.face), bool)
    for material, rows in _by_material(scene, places):
        own = places.of(rows)
        white = np.ones((len(rows), 4))
        texel = white if material.texture is None else textures.texels(material.texture, own.at, anisotropy)
        product = np.array(material.base_color) * texel * _scene_color(material, own.color)
        color[rows, :3] = textures.to_srgb(product[:, :3])
        color[rows, 3] = _alpha(material, product[:, 3])
        if material.alpha_mode == "MASK":
            there[rows] = product[:, 3] >= material.alpha_cutoff
        elif _may_be_nothing(material):
            there[rows] = product[:, 3] > 0
    return Painted(color, there)


@dataclass(frozen=True)
class Roundings:
    """How far off float32 is, in what the device does with a fragment."""

    uv: float  # of a coordinate that was brought into 0..1
    texel: float  # of a texel that was filtered, 0..1
    product: float  # of a product of colours, relative
    srgb: float  # of a colour that was converted to sRGB, 0..1
    lod: float  # of a level of detail


def paint_range(scene: Any, places: Places, off: Places, roundings: Roundings, anisotropy: int = 1) -> Range:
    """Between what the colours of hits lie, if their places are known to within `off`.

    Colours only rise with texels and the scene's colours: so the least of these make the least, and the greatest make
    the greatest.
    """
    low, high = np.clip(places.color - off.color, 0, 1), np.clip(places.color + off.color, 0, 1)
    doubtful = np.zeros(len(places.face), bool)
    for material, rows in _by_material(scene, places):
        own, around = places.of(rows), off.of(rows)
        ends = [low[rows], high[rows]]
        texel = [np.ones((len(rows), 4))] * 2
        if material.texture is not None:
            given = textures.texel_range(material.texture, own.at, around.at, roundings.uv, roundings.lod, anisotropy)
            texel = [np.clip(given[0] - roundings.texel, 0, 1), np.clip(given[1] + roundings.texel, 0, 1)]
        product = [
            np.clip(np.array(material.base_color) * t * _scene_color(material, end) * (1 + s * roundings.product), 0, 1)
            for t, end, s in zip(texel, ends, (-1, 1), strict=True)
        ]
        for end, value, s in zip((low, high), product, (-1, 1), strict=True):
            end[rows, :3] = np.clip(textures.to_srgb(value[:, :3]) + s * roundings.srgb, 0, 1)
            end[rows, 3] = _alpha(material, value[:, 3])
        if material.alpha_mode == "MASK":
            doubtful[rows] = (product[0][:, 3] < material.alpha_cutoff) & (product[1][:, 3] >= material.alpha_cutoff)
    return Range(low, high, doubtful)


def _by_material(scene: Any, places: Places) -> Iterator[tuple[Any, Integers]]:
    """Each material, and the hits on faces that have it."""
    number = np.asarray(scene.face_materials, np.int64)[places.face]
    for place, material in enumerate(scene.materials):
        rows = np.flatnonzero(number == place)
        if len(rows):
            yield material, rows


def _scene_color(material: Any, color: Floats) -> Floats:
    """What the scene's colours contribute: float64 [n, 4]."""
    counts = np.array([material.rgb_of_scene] * 3 + [material.alpha_of_scene])
    return np.where(counts, color, 1.0)


def _alpha(material: Any, alpha: Floats) -> Floats:
    """The alpha that is blended, of the product of alphas."""
    return material.opacity * (alpha if material.alpha_mode == "BLEND" else np.ones_like(alpha))


def _may_be_nothing(material: Any) -> bool:
    """Whether fragments of alpha 0 are not there: where the texture has texels that are nothing."""
    if material.alpha_mode != "BLEND" or material.texture is None:
        return False
    return bool((np.asarray(material.texture.image)[..., 3] == 0).any())
