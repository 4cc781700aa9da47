"""Materials of a glTF file (glTF 2.0, section 3.9): the material or the plain colour that a primitive's faces get."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import named
from clpeel.reading.gltf_document import (
    GLOSS,
    STRENGTH,
    TRANSMISSION,
    UNLIT,
    Document,
    Json,
    damaged,
    extension,
    fields,
    number,
    unit_numbers,
)
from clpeel.reading.gltf_mapping import Mapped, Mapping, mapped
from clpeel.reading.gltf_primitives import Primitive
from clpeel.reading.gltf_textures import Textures
from clpeel.reading.losses import listed
from clpeel.scene.arrays import Colors
from clpeel.scene.materials import ALPHA_MODES, AlphaMode, Finish, Material
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

_FOR_LIGHTS = ("metallicRoughnessTexture", "normalTexture", "occlusionTexture", "emissiveTexture")
_NO_COORDINATES = "textures left out, as meshes lack the coordinates for those of materials"


@dataclass(frozen=True)
class _Recipe:
    """What a glTF material says. for_lights: the keys of its textures for lights, each with the object that has it."""

    name: str = ""
    base_color: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    mapped: Mapped | None = None
    for_lights: tuple[tuple[str, Json], ...] = ()
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    opacity: float = 1.0
    unlit: bool = False
    single_sided: bool = True
    finish: Finish = Finish()


@dataclass(frozen=True, eq=False)
class Look:
    """How faces look: their material, and a colour [4] if that is plain. mappings: of the material's textures, each
    once.

    Their places are the numbers by which the material names texture coordinates.
    """

    single_sided: bool
    material: Material
    color: Colors | None = None
    mappings: tuple[Mapping, ...] = ()


class Materials:
    """The looks of primitives. Ask for the textures of all of them first, then take their looks."""

    def __init__(self, document: Document, textures: Textures) -> None:
        self.document, self.textures = document, textures
        self._recipes: dict[int, _Recipe] = {}
        self._made: dict[tuple[object, bool, AlphaMode, tuple[Mapping, ...]], Material] = {}
        self._plain: dict[tuple[object, ...], Material] = {}
        self._looks: dict[Primitive, Look | None] = {}
        self._kinds = set[str]()
        self._losses: dict[str, list[str]] = {}

    def want(self, primitive: Primitive) -> None:
        """Ask for the texture of a primitive. Raises InputError."""
        base = self._mapped(primitive)
        if base is not None:
            self.textures.want(base.index)

    def look(self, primitive: Primitive) -> Look | None:
        """Return how a primitive's faces look, or None, with a note, if they are cut away. Raises InputError."""
        if primitive not in self._looks:
            self._looks[primitive] = self._look(primitive)
        return self._looks[primitive]

    def shown(self, primitive: Primitive, colors: NDArray[np.float64]) -> tuple[Colors, bool]:
        """Return the colours of lines or points as they are shown, [n, 4], and whether lights change them.

        colors: of their vertices, linear, [n, 3 or 4]. Raises InputError.
        """
        recipe = self._recipe(primitive.material)
        if recipe.mapped is not None:
            self._lose("textures left out, of lines and points", recipe.name)
        found = np.ones((len(colors), 4))
        found[:, : colors.shape[1]] = colors
        found *= recipe.base_color
        if recipe.alpha_mode == "MASK":
            found[:, 3] = np.where(found[:, 3] < recipe.alpha_cutoff, 0.0, recipe.opacity)
        else:
            found[:, 3] = recipe.opacity * (found[:, 3] if recipe.alpha_mode == "BLEND" else 1.0)
        return _shown(found[:, :3], found[:, 3:]), not recipe.unlit

    def _look(self, primitive: Primitive) -> Look | None:
        recipe, base = self._recipe(primitive.material), self._mapped(primitive)
        texture = None if base is None else self.textures.get(base.index)
        mode, colored = recipe.alpha_mode, primitive.has("COLOR_0")
        if mode == "MASK" and texture is None and not colored:
            if recipe.base_color[3] < recipe.alpha_cutoff:
                self._lose("faces left out, as their materials cut all of them away", recipe.name)
                return None
            mode = "OPAQUE"
        finish, mappings = self._finished(primitive, None if texture is None else base)
        if not mappings and not colored and mode != "MASK" and not recipe.unlit:
            alpha = recipe.base_color[3] if mode == "BLEND" else recipe.opacity
            numbers = finish.metallic, finish.roughness, finish.emissive  # which are all that it has without textures
            material = self._plain.setdefault(numbers, Material(plain=True, finish=finish))
            return Look(recipe.single_sided, material, _shown(recipe.base_color[:3], [alpha]))
        key = (primitive.material, texture is not None, mode, mappings)
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
                finish=finish,
            )
        return Look(recipe.single_sided, self._made[key], mappings=mappings)

    def _finished(self, primitive: Primitive, base: Mapped | None) -> tuple[Finish, tuple[Mapping, ...]]:
        """Return the finish of a primitive's material with its textures, and the mappings of all textures, each once.

        base: the texture of the base colour, if there is one.
        """
        recipe = self._recipe(primitive.material)
        mappings, finish = [] if base is None else [base.mapping], recipe.finish
        for key, holder in recipe.for_lights:
            late = self._late(primitive, recipe.name, key, holder)
            if late is None:
                continue
            mapping, found = late
            if mapping not in mappings:
                mappings.append(mapping)
            found[f"{_word(key)}_uv"] = mappings.index(mapping)
            finish = replace(finish, **found)
        return finish, tuple(mappings)

    def _late(self, primitive: Primitive, name: str, key: str, holder: Json) -> tuple[Mapping, dict[str, Any]] | None:
        """Return where a texture for lights lies, and the fields of Finish that it gives. None, after a note, if none.

        The surface is seen without it, so damage here is no reason to refuse the file.
        """
        try:
            info = fields(holder, key)
            lies, found = mapped(info), _factor(key, info)
            if not primitive.has(lies.mapping.coordinates):
                self._lose(_NO_COORDINATES, name)
                return None
            texture = self.textures.late(lies.index, colors=key == "emissiveTexture")
        except InputError as error:
            self.document.note(f"{_KINDS[key]} texture of material {named(name)} left out: {error}")
            return None
        return None if texture is None else (lies.mapping, {f"{_word(key)}_texture": texture, **found})

    def note_losses(self) -> None:
        """Note what the picture lacks of the materials that were used."""
        for text, names in self._losses.items():
            self.document.note(f"{text}: {listed(names)}")
        kinds = [kind for key, kind in _KINDS.items() if kind in self._kinds and key not in _FOR_LIGHTS]
        if kinds:
            self.document.note(f"textures left out: {', '.join(kinds)}")

    def _lose(self, text: str, name: str) -> None:
        """Keep what a material loses for a note."""
        self._losses.setdefault(text, []).append(named(name))

    def _mapped(self, primitive: Primitive) -> Mapped | None:
        """Return the texture of a primitive, or None if its material has none, or it has no coordinates for it."""
        recipe = self._recipe(primitive.material)
        if recipe.mapped is None or primitive.has(recipe.mapped.mapping.coordinates):
            return recipe.mapped
        self._lose(_NO_COORDINATES, recipe.name)
        return None

    def _recipe(self, index: Any) -> _Recipe:
        if index is None:
            return _Recipe()
        material = self.document.entry("materials", index)
        if index not in self._recipes:
            self._recipes[index] = self._read(material, str(material.get("name") or index))
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
        finish = _finish(material, metal, gloss)
        unlit, opacity = extension(material, UNLIT) is not None, 1.0
        if transmitted:
            self._lose(f"glass drawn as transparency ({TRANSMISSION})", name)
            if mode == "BLEND":
                alpha = max(alpha * (1 - transmitted), min(alpha, _LEAST_GLASS))
            else:
                opacity = max(1 - transmitted, _LEAST_GLASS)
        return _Recipe(
            name,
            (red, green, blue, alpha),
            None if texture not in base else mapped(fields(base, texture)),
            () if unlit else _for_lights(material, metal if gloss is None else {}),
            mode,
            number("alphaCutoff", material.get("alphaCutoff", 0.5)),
            opacity,
            unlit,
            not material.get("doubleSided", False),
            finish,
        )


def _for_lights(*holders: Json) -> tuple[tuple[str, Json], ...]:
    """Return the keys of the textures for lights that these objects have, each with its object."""
    return tuple((key, holder) for key in _FOR_LIGHTS for holder in holders if key in holder)


def _word(key: str) -> str:
    """Return how the names of a texture's fields in Finish begin."""
    return _KINDS[key].replace("-", "_")


def _factor(key: str, info: Json) -> dict[str, Any]:
    """Return the number that a texture for lights has beside it, by its name in Finish. Raises InputError."""
    if key == "normalTexture":
        return {"normal_scale": number("scale", info.get("scale", 1))}
    if key == "occlusionTexture":
        return {"occlusion_strength": unit_numbers("strength", [info.get("strength", 1)], 1)[0]}
    return {}


def _finish(material: Json, metal: Json, gloss: Json | None) -> Finish:
    """Return what is kept of a material for lights. Raises InputError."""
    if gloss is not None:
        (shine,) = unit_numbers("glossinessFactor", [gloss.get("glossinessFactor", 1)], 1)
        metallic, rough = 0.0, 1 - shine
    else:
        (metallic,) = unit_numbers("metallicFactor", [metal.get("metallicFactor", 1)], 1)
        (rough,) = unit_numbers("roughnessFactor", [metal.get("roughnessFactor", 1)], 1)
    red, green, blue = unit_numbers("emissiveFactor", material.get("emissiveFactor", [0, 0, 0]), 3)
    strength = max(number("emissiveStrength", (extension(material, STRENGTH) or {}).get("emissiveStrength", 1)), 0.0)
    return Finish(metallic, rough, (red * strength, green * strength, blue * strength))


def _shown(rgb: ArrayLike, alpha: ArrayLike) -> Colors:
    """Return linear light [..., 3] and alphas [..., 1] as colours that are shown as they are.

    They are uint8 where that loses nothing.
    """
    color: NDArray[np.float64] = np.concatenate([srgb(rgb), np.asarray(alpha, np.float64)], axis=-1)
    level = np.rint(color * 255)
    return level.astype(np.uint8) if (abs(color - level / 255) < _WHOLE).all() else color.astype(np.float32)
