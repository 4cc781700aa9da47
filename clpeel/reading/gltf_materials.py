"""Materials of a glTF file (glTF 2.0, section 3.9): the material or the plain colour that a primitive's faces get."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.reading.companions import named
from clpeel.reading.gltf_document import (
    GLOSS,
    TRANSFORM,
    TRANSMISSION,
    UNLIT,
    Document,
    Json,
    damaged,
    extension,
    fields,
    number,
    numbers,
    title,
    unit_numbers,
    whole,
)
from clpeel.reading.gltf_primitives import Primitive
from clpeel.reading.gltf_textures import Textures
from clpeel.reading.losses import listed
from clpeel.scene.arrays import AnyArray, Colors
from clpeel.scene.materials import ALPHA_MODES, AlphaMode, Light, Material
from clpeel.scene.textures import srgb

_LEAST_GLASS = 0.1
"""The least alpha that transmission leaves, so that glass is still seen."""

_WHOLE = 1e-6
"""A colour is stored in bytes if no channel, 0..1, is farther than this from a whole one."""

_KINDS = {
    "normalTexture": "normal",
    "occlusionTexture": "occlusion",
    "emissiveTexture": "emissive",
    "metallicRoughnessTexture": "metallic-roughness",
    "specularGlossinessTexture": "specular-glossiness",
    "transmissionTexture": "transmission",
}


@dataclass(frozen=True)
class Mapped:
    """A texture on a surface. index: of the texture. coordinates: the name of their attribute. transform: see at."""

    index: Any
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
class _Recipe:
    """What a glTF material says."""

    name: str = ""
    base_color: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    mapped: Mapped | None = None
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    opacity: float = 1.0
    unlit: bool = False
    single_sided: bool = True
    light: Light | None = None


@dataclass(frozen=True, eq=False)
class Look:
    """How faces look: a material, or a plain colour [4]. mapped: the material's texture, if it has any."""

    single_sided: bool
    material: Material | None = None
    color: Colors | None = None
    mapped: Mapped | None = None


class Materials:
    """The looks of primitives. Ask for the textures of all of them first, then take their looks."""

    def __init__(self, document: Document, textures: Textures) -> None:
        self.document, self.textures = document, textures
        self._recipes: dict[int, _Recipe] = {}
        self._made: dict[tuple[object, bool, AlphaMode], Material] = {}
        self._looks: dict[Primitive, Look | None] = {}
        self._kinds = set[str]()
        self._losses: dict[str, list[str]] = {}

    def want(self, primitive: Primitive) -> None:
        """Ask for the texture of a primitive. Raises InputError."""
        mapped = self._mapped(primitive)
        if mapped is not None:
            self.textures.want(mapped.index)

    def look(self, primitive: Primitive) -> Look | None:
        """Return how a primitive's faces look, or None, with a note, if they are cut away. Raises InputError."""
        if primitive not in self._looks:
            self._looks[primitive] = self._look(primitive)
        return self._looks[primitive]

    def _look(self, primitive: Primitive) -> Look | None:
        recipe, mapped = self._recipe(primitive.material), self._mapped(primitive)
        texture = None if mapped is None else self.textures.get(mapped.index)
        mode, colored = recipe.alpha_mode, primitive.has("COLOR_0")
        if mode == "MASK" and texture is None and not colored:
            if recipe.base_color[3] < recipe.alpha_cutoff:
                self._lose("faces left out, as their materials cut all of them away", recipe.name)
                return None
            mode = "OPAQUE"
        if texture is None and not colored and mode != "MASK" and not recipe.unlit:
            alpha = recipe.base_color[3] if mode == "BLEND" else recipe.opacity
            return Look(recipe.single_sided, color=_shown(recipe.base_color[:3], alpha))
        key = (primitive.material, texture is not None, mode)
        if key not in self._made:
            red, green, blue, alpha = recipe.base_color
            self._made[key] = Material(
                recipe.name,
                (red, green, blue, alpha),
                texture,
                mode,
                recipe.alpha_cutoff,
                recipe.opacity,
                recipe.unlit,
                light=recipe.light,
            )
        return Look(recipe.single_sided, self._made[key], mapped=None if texture is None else mapped)

    def note_losses(self) -> None:
        """Note what the picture lacks of the materials that were used."""
        for text, names in self._losses.items():
            self.document.note(f"{text}: {listed(names)}")
        kinds = [kind for kind in _KINDS.values() if kind in self._kinds]
        if kinds:
            self.document.note(f"textures left out, as only base colours are drawn: {', '.join(kinds)}")

    def _lose(self, text: str, name: str) -> None:
        """Keep what a material loses for a note."""
        self._losses.setdefault(text, []).append(name)

    def _mapped(self, primitive: Primitive) -> Mapped | None:
        """Return the texture of a primitive, or None if its material has none, or it has no coordinates for it."""
        recipe = self._recipe(primitive.material)
        if recipe.mapped is None or primitive.has(recipe.mapped.coordinates):
            return recipe.mapped
        self._lose("textures left out, as meshes lack the coordinates for those of materials", recipe.name)
        return None

    def _recipe(self, index: Any) -> _Recipe:
        if index is None:
            return _Recipe()
        material = self.document.entry("materials", index)
        if index not in self._recipes:
            self._recipes[index] = self._read(material, title(material, index))
        return self._recipes[index]

    def _read(self, material: Json, name: str) -> _Recipe:
        """Return what a glTF material says. Raises InputError."""
        metal, gloss = fields(material, "pbrMetallicRoughness"), extension(material, GLOSS)
        glass = extension(material, TRANSMISSION) or {}
        for holder in (material, metal, gloss or {}, glass):
            self._kinds.update(_KINDS[key] for key in holder if key in _KINDS)
        base, factor, texture = (
            (metal, "baseColorFactor", "baseColorTexture")
            if gloss is None
            else (gloss, "diffuseFactor", "diffuseTexture")
        )
        mode = material.get("alphaMode", "OPAQUE")
        if mode not in ALPHA_MODES:
            damaged(f"alphaMode: expected {', '.join(ALPHA_MODES)}, got {named(str(mode))}")
        red, green, blue, alpha = unit_numbers(factor, base.get(factor, [1, 1, 1, 1]), 4)
        (transmitted,) = unit_numbers("transmissionFactor", [glass.get("transmissionFactor", 0)], 1)
        light = _light(material, metal, gloss)
        if any(light.emissive) and "emissiveTexture" not in material:
            self._lose("emissive colours left out", name)
        opacity = 1.0
        if transmitted:
            self._lose(f"glass drawn as transparency ({TRANSMISSION})", name)
            if mode == "BLEND":
                alpha = max(alpha * (1 - transmitted), min(alpha, _LEAST_GLASS))
            else:
                opacity = max(1 - transmitted, _LEAST_GLASS)
        return _Recipe(
            name,
            (red, green, blue, alpha),
            None if texture not in base else _mapping(fields(base, texture)),
            mode,
            number("alphaCutoff", material.get("alphaCutoff", 0.5)),
            opacity,
            extension(material, UNLIT) is not None,
            not material.get("doubleSided", False),
            light,
        )


def _mapping(info: Json) -> Mapped:
    """Return the texture that a textureInfo object describes. Raises InputError."""
    shift = extension(info, TRANSFORM) or {}
    number_of_set = whole("texCoord", shift.get("texCoord", info.get("texCoord", 0)))
    across, down = numbers("offset", shift.get("offset", [0, 0]), 2)
    wide, high = numbers("scale", shift.get("scale", [1, 1]), 2)
    angle = number("rotation", shift.get("rotation", 0))
    return Mapped(info.get("index"), f"TEXCOORD_{number_of_set}", (across, down, angle, wide, high))


def _light(material: Json, metal: Json, gloss: Json | None) -> Light:
    """Return what is kept of a material for lights. Raises InputError."""
    if gloss is not None:
        (shine,) = unit_numbers("glossinessFactor", [gloss.get("glossinessFactor", 1)], 1)
        metallic, rough = 0.0, 1 - shine
    else:
        (metallic,) = unit_numbers("metallicFactor", [metal.get("metallicFactor", 1)], 1)
        (rough,) = unit_numbers("roughnessFactor", [metal.get("roughnessFactor", 1)], 1)
    red, green, blue = unit_numbers("emissiveFactor", material.get("emissiveFactor", [0, 0, 0]), 3)
    return Light(metallic, rough, (red, green, blue))


def _shown(rgb: tuple[float, ...], alpha: float) -> Colors:
    """Return linear light and an alpha as a colour that is shown as it is: uint8 where that loses nothing."""
    color: NDArray[np.float64] = np.array([*srgb(rgb), alpha])
    level = np.rint(color * 255)
    return level.astype(np.uint8) if (abs(color - level / 255) < _WHOLE).all() else color.astype(np.float32)
