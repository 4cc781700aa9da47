"""Materials: what the colours of faces are made of, beyond one colour for a face or a vertex.

A face without a material has the scene's colours as they are. They are display-referred. A face with a material has

    colour = sRGB(base_color * texel * C),    alpha = base_color's * texel's * C's      (glTF 2.0, section 3.9.2)

where C is the scene's colour there, which is *linear* (COLOR_0 in glTF), and the texel is linear, too. The product is
converted to sRGB, and is then blended like all other colours. Where lights fall on it, that product is what they fall
on. A plain material leaves the scene's colours as they are, and only says how they take light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.checks import one_of
from clpeel.errors import InputError
from clpeel.scene.arrays import counted_alphas
from clpeel.scene.textures import Texture, linear_color

if TYPE_CHECKING:
    from clpeel.pictures.colormaps import ColorMap

AlphaMode = Literal["OPAQUE", "MASK", "BLEND"]
ALPHA_MODES: tuple[AlphaMode, ...] = get_args(AlphaMode)
"""What alpha means (glTF 2.0, section 3.9.4): nothing; whether a fragment is there; how much it covers."""

NO_MATERIAL = -1
"""The material of faces that have none."""


@dataclass(frozen=True, eq=False)
class Finish:
    """How a surface takes light (glTF 2.0, section 3.9). It matters where lights fall on it: render(lighting="kit").

    metallic, roughness: 0..1. emissive: linear RGB, which may exceed 1, or text. normal_scale: how much red and green
    of the normal texture count. occlusion_strength: 0..1, how much the occlusion texture counts.
    The texels of the emissive texture are colours, as those of Material.texture are. The texels of the others are
    numbers, never sRGB: bytes are 0..255 for 0..1, and floats are as they are. Readers keep these textures without
    decoding their images, which the first one who asks for an image does.
    metallic_roughness_uv, ...: the number of each texture's coordinates: 0 for Scene.uv, k for Scene.more_uv[k - 1].

    Raises InputError if such a number is below 0.
    """

    metallic: float = 1.0
    roughness: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    metallic_roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    occlusion_texture: Texture | None = None
    emissive_texture: Texture | None = None
    metallic_roughness_uv: int = 0
    normal_uv: int = 0
    occlusion_uv: int = 0
    emissive_uv: int = 0

    def __post_init__(self) -> None:
        light: object = self.emissive
        if isinstance(light, str):
            object.__setattr__(self, "emissive", linear_color("emissive", light)[:3])
        least = min(self.metallic_roughness_uv, self.normal_uv, self.occlusion_uv, self.emissive_uv)
        if least < 0:
            raise InputError(f"finish: expected numbers of texture coordinates of 0 or more, got {least}")

    @property
    def uv_sets(self) -> int:
        """How many sets of texture coordinates its textures need: one more than the greatest number."""
        placed = (
            (self.metallic_roughness_texture, self.metallic_roughness_uv),
            (self.normal_texture, self.normal_uv),
            (self.occlusion_texture, self.occlusion_uv),
            (self.emissive_texture, self.emissive_uv),
        )
        return max((number + 1 for texture, number in placed if texture is not None), default=0)


@dataclass(frozen=True, eq=False)
class Material:
    """What the colours of faces are made of: see the module.

    base_color: RGBA 0..1, linear, or text such as "gold". texture: sRGB, sampled at the scene's texture coordinates;
    None for white.
    alpha_mode: OPAQUE ignores alpha. MASK cuts away fragments whose alpha is below alpha_cutoff. BLEND blends.
    opacity: the alpha of what is left by OPAQUE and MASK; it multiplies the alpha of BLEND. unlit: whether lights leave
    the material as it is. rgb_of_scene, alpha_of_scene: whether red, green and blue of the scene's colours count, and
    their alpha. plain: the scene's colours are shown as they are, sRGB, and nothing but the finish counts. finish: how
    the surface takes light; None for a matt one with a mild highlight. color_map: where its colours come from, if they
    stand for numbers (scalars.py): scale bars show it.

    Raises InputError if a number or a word is none of these.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: Texture | None = None
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    opacity: float = 1.0
    unlit: bool = False
    rgb_of_scene: bool = True
    alpha_of_scene: bool = True
    plain: bool = False
    finish: Finish | None = None
    color_map: ColorMap | None = None

    def __post_init__(self) -> None:
        one_of("alpha_mode", self.alpha_mode, ALPHA_MODES)
        color: object = self.base_color
        if isinstance(color, str):
            object.__setattr__(self, "base_color", linear_color("base_color", color))
        if len(self.base_color) != 4 or not all(0 <= value <= 1 for value in self.base_color):
            raise InputError(f"base_color: expected R,G,B,A in 0..1, got {self.base_color}")
        if not 0 <= self.opacity <= 1:
            raise InputError(f"opacity: expected a number 0..1, got {self.opacity}")
        if not self.alpha_cutoff >= 0:
            raise InputError(f"alpha_cutoff: expected a number of 0 or more, got {self.alpha_cutoff}")
        if self.plain and (self.texture is not None or self.has_maps or self.unlit):
            raise InputError("plain: expected no texture, and no unlit, with it")

    @property
    def has_maps(self) -> bool:
        """Whether textures say how it takes light."""
        return self.finish is not None and self.finish.uv_sets > 0 and not self.unlit

    @property
    def uv_sets(self) -> int:
        """How many sets of texture coordinates its textures need: 0, 1 for Scene.uv alone, or more."""
        return max(int(self.texture is not None), 0 if self.finish is None else self.finish.uv_sets)

    @cached_property
    def texel_alphas(self) -> tuple[float, float]:
        """The least and the greatest alpha of the texture's texels, 0..1."""
        if self.texture is None:
            return 1.0, 1.0
        alpha = self.texture.image[..., 3]
        one = 255.0 if alpha.dtype == np.uint8 else 1.0
        return float(alpha.min() / one), float(alpha.max() / one)

    def transparent_alphas(self, most: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the alphas below 1 that fragments may have, 0..1, and the share of each. Texels count alike.

        most: the greatest alpha of the scene's colours.
        """
        if self.plain:
            raise ValueError("a plain material has the scene's alphas")
        if self.alpha_mode != "BLEND":
            count = int(self.opacity < 1)
            return np.full(count, self.opacity), np.ones(count)
        tint = self.opacity * self.base_color[3] * (most if self.alpha_of_scene else 1.0)
        texels = np.ones(1, np.float32) if self.texture is None else self.texture.image[..., 3]
        levels, counts = counted_alphas(texels, below=1.0 if tint == 1 else 1.1)
        low, high = self.texel_alphas
        # Between texels there is any alpha up to the greatest one, even if no texel has it. Its share is next to none.
        between = float(low < 1 or tint < 1) * 1e-9 / texels.size
        values = np.append(levels * tint, min(tint * high, 1 - 2.0**-24))
        return values, np.append(counts / texels.size, between)

    def kinds(self, alpha: NDArray[Any]) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return whether faces with this material are opaque, routed and hiding, as in Surfaces: bool [k] each.

        alpha: of the scene's colours at the faces' corners, 0..1, [k] or [k, 3].
        """
        if self.plain:
            raise ValueError("faces with a plain material are what the scene's alphas say")
        corners = alpha.reshape(len(alpha), -1) if self.alpha_of_scene else np.ones((len(alpha), 1))
        least, most = corners.min(axis=1), corners.max(axis=1)
        low, high = self.texel_alphas
        none, every = np.zeros(len(alpha), bool), np.full(len(alpha), self.opacity == 1)
        if self.alpha_mode == "OPAQUE":
            return every, none, none
        base = float(np.float32(self.base_color[3]))
        if self.alpha_mode == "MASK":
            # Within a rounding of the cut-off the kernel decides.
            return every, base * least * low <= self.alpha_cutoff * (1 + 1e-5), none
        whole = base * self.opacity == 1
        if low == 1:
            return whole & (least == 1), none, none
        hiding = whole & (high == 1) & (most == 1)
        return none, hiding | (low == 0), hiding


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What kind each of a scene's faces is, bool [m] each.

    opaque: no fragment of it is transparent, so that it is drawn first. Cut-outs are, if what is
    left of them is opaque.
    routed: its texels say of each fragment whether it is there at all, and whether it is opaque.
    hiding: it is routed and not opaque, and some of its fragments may be opaque.
    """

    opaque: NDArray[np.bool_]
    routed: NDArray[np.bool_]
    hiding: NDArray[np.bool_]


def checked_materials(
    materials: Sequence[Material], of_faces: ArrayLike | None, count: int
) -> NDArray[np.int32] | None:
    """Return the material of each of so many faces, int32 [count], or None if there are none. Raises InputError."""
    for material in materials:
        if not isinstance(material, Material):
            raise InputError(f"materials: expected Materials, got {type(material).__name__}")
    if not materials:
        if of_faces is not None:
            raise InputError("face_materials: expected materials with them, got none")
        return None
    places = np.zeros(count, np.int32) if of_faces is None else np.asarray(of_faces)
    if places.shape != (count,) or places.dtype.kind not in "iu":
        raise InputError(f"face_materials: expected [{count}] integers, got {list(places.shape)} {places.dtype}")
    if places.size and not (places.min() >= NO_MATERIAL and places.max() < len(materials)):
        wrong = places.min() if places.min() < NO_MATERIAL else places.max()
        raise InputError(f"face_materials: expected -1..{len(materials) - 1}, got {wrong}")
    return np.ascontiguousarray(places, dtype=np.int32)


def recolored_material(material: Material, rgb: tuple[float, ...] | None, opacity: float | None) -> Material:
    """Return the material with red, green and blue replaced by rgb, and alpha by opacity; None keeps what there is.

    rgb: linear, 0..1. Holes and soft edges of a texture stay, as they are the shape of what is drawn. A plain material
    stays as it is.
    """
    if material.plain:
        return material
    if rgb is not None:
        texture = material.texture
        if texture is not None:
            image = texture.image.copy()
            image[..., :3] = 255 if image.dtype == np.uint8 else 1.0
            texture = replace(texture, image=image)
        if material.alpha_mode == "OPAQUE" or material.texel_alphas == (1.0, 1.0):
            texture = None
        red, green, blue = rgb
        color = (red, green, blue, material.base_color[3])
        material = replace(material, base_color=color, texture=texture, rgb_of_scene=False, color_map=None)
    if opacity is not None:
        material = replace(material, opacity=opacity)
        if material.alpha_mode == "BLEND":
            material = replace(material, base_color=(*material.base_color[:3], 1.0), alpha_of_scene=False)
    return material
