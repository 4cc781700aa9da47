"""Shading: packs a scene's materials and textures for the kernels (kernels/shading)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from clpeel.device import layout
from clpeel.device.records import MATERIAL
from clpeel.errors import InputError
from clpeel.scene.arrays import AnyArray
from clpeel.scene.materials import Finish, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Texture, linear_of_bytes, srgb
from clpeel.stages.albedo import albedo_of, albedo_tables

MOST_FLOAT_BYTES = 1 << 28
"""Texels are stored as four floats if all of them take no more bytes than this: then kernels need not decode them. The
picture has the same bits either way."""

_STRIP = 1 << 15
"""Texels that are worked on at a time."""

_FULL = 65535
"""Full linear light, where it is counted in whole numbers."""


@dataclass(frozen=True)
class Shading:
    """What kernels are compiled for, besides the scene's colours: see Features."""

    materials: bool
    routed: bool
    hiding: bool
    levels: bool
    maps: bool


MATT = Finish(metallic=0.0, roughness=0.5)
"""How surfaces take light that nothing is known of: with a mild highlight."""


def shading_of(scene: Scene, lights: bool) -> Shading:
    """Return what the scene's materials need of kernels. lights: whether lights fall on them."""
    used = used_materials(scene, lights)
    maps = any(lights and material.has_maps for material in used)
    levels = any(t.mipmapped or t.magnify != t.minify for m in used for t, _ in _textures(m, lights))
    kinds = scene.kinds
    return Shading(bool(used), bool(kinds.routed.any()), bool(kinds.hiding.any()), levels, maps)


def used_materials(scene: Scene, lights: bool) -> tuple[Material, ...]:
    """Return the materials that matter: without lights, those that are plain do not."""
    return scene.materials if lights or not all(m.plain for m in scene.materials) else ()


def readable(scene: Scene) -> tuple[Scene, list[str]]:
    """Return the scene without the maps whose images cannot be decoded, and a note of each.

    Readers decode images of maps late, when lights first fall on them. The surface is seen without them.
    """
    notes, materials = list[str](), list[Material]()
    for material in scene.materials:
        finish = material.finish
        for name in MAPS if finish is not None and not material.unlit else ():
            texture = getattr(finish, f"{name}_texture")
            try:
                if texture is not None:
                    _ = texture.image
            except InputError as error:
                finish = replace(finish, **{f"{name}_texture": None})  # type: ignore[type-var]
                notes.append(f"{name.replace('_', '-')} texture of material {material.name!r} left out: {error}")
        materials.append(material if finish is material.finish else replace(material, finish=finish))
    return (replace(scene, materials=tuple(materials)), notes) if notes else (scene, notes)


def _textures(material: Material, lights: bool) -> Iterator[tuple[Texture, bool]]:
    """Yield the textures that matter, and whether their texels are numbers instead of colours."""
    if material.texture is not None:
        yield material.texture, False
    if lights and material.finish is not None and not material.unlit:
        for name, numbers in MAPS.items():
            texture = getattr(material.finish, f"{name}_texture")
            if texture is not None:
                yield texture, numbers


MAPS = {"metallic_roughness": True, "normal": True, "occlusion": True, "emissive": False}
"""The maps of a Finish, and whether their texels are numbers."""

# --- materials --------------------------------------------------------------------------------------------------------


def material_table(scene: Scene, packed: Packed, vertex_count: int) -> NDArray[np.void]:
    """Return MATERIAL [1 + k]: that of faces without a material, and the scene's.

    packed: their textures. vertex_count: of vertices on the device, with the corners of lines and points.
    """
    used = used_materials(scene, packed.lights)
    table = np.zeros(1 + len(used), MATERIAL)
    plain = Material(plain=True)
    kinds, of_faces = scene.kinds, scene.face_materials
    routed, hiding = (
        set(np.unique(of_faces[kind])) if of_faces is not None else set() for kind in (kinds.routed, kinds.hiding)
    )
    for place, (row, material) in enumerate(zip(table, (plain, *used), strict=True), -1):
        row["base_color"] = material.base_color
        row["opacity"], row["alpha_cutoff"] = material.opacity, material.alpha_cutoff
        row["flags"] = _flags(material)
        row["flags"] |= layout.ROUTED_BY_TEXELS if place in routed else 0
        row["flags"] |= layout.HIDES if place in hiding else 0
        if material.texture is not None:
            _put_mapping(row["base"], material.texture, False, packed)
        if packed.lights:
            _put_finish(row, material, packed, vertex_count)
    return table


def _put_finish(row: np.void, material: Material, packed: Packed, vertex_count: int) -> None:
    """Fill in what lights need of a material."""
    finish = material.finish or MATT
    roughness = max(finish.roughness, layout.LEAST_ROUGHNESS)
    row["metallic"], row["roughness"], row["emissive"] = finish.metallic, roughness, finish.emissive
    row["normal_scale"], row["occlusion_strength"] = finish.normal_scale, finish.occlusion_strength
    row["albedo"] = albedo_of(roughness).reshape(-1)
    row["mapped"] = material.has_maps
    for name, numbers in MAPS.items() if material.has_maps else ():
        texture = getattr(finish, f"{name}_texture")
        if texture is not None:
            _put_mapping(row[f"{name}_map"], texture, numbers, packed)
            row[f"{name}_map"]["uv"] = getattr(finish, f"{name}_uv") * vertex_count
            row[f"{name}_map"]["tangents"] = vertex_count


def _flags(material: Material) -> int:
    """Return the flags that do not depend on the scene."""
    flags = {"OPAQUE": 0, "MASK": layout.CUT, "BLEND": layout.BLENDED}[material.alpha_mode]
    flags |= layout.UNLIT if material.unlit else 0
    flags |= layout.RGB_OF_SCENE if material.rgb_of_scene else 0
    flags |= layout.ALPHA_OF_SCENE if material.alpha_of_scene else 0
    flags |= layout.PLAIN if material.plain else 0
    flags |= layout.TEXTURED if material.texture is not None else 0
    return flags


def _put_mapping(row: np.void, texture: Texture, numbers: bool, packed: Packed) -> None:
    """Fill in a MAPPING. numbers: whether the texels are numbers instead of colours."""
    flags = layout.NUMBERS if numbers else 0
    flags |= layout.FLOAT_TEXELS if packed.floats or texture.image.dtype != np.uint8 else 0
    for wrap, mirror, clamp in zip(
        texture.wrap, (layout.MIRROR_U, layout.MIRROR_V), (layout.CLAMP_U, layout.CLAMP_V), strict=True
    ):
        flags |= {"repeat": 0, "mirror": mirror, "clamp": clamp}[wrap]
    flags |= layout.MAGNIFY_LINEAR if texture.magnify == "linear" else 0
    flags |= layout.MINIFY_LINEAR if texture.minify.startswith("linear") else 0
    flags |= layout.BETWEEN_LEVELS if texture.minify.endswith("mipmap-linear") else 0
    row["flags"], row["used"], row["texture"] = flags, True, packed.starts[_key(texture, numbers)]
    row["width"], row["height"] = texture.size
    row["last_level"] = len(level_sizes(texture)) - 1


# --- textures ---------------------------------------------------------------------------------------------------------

_Key = tuple[int, bool, bool, bool]


def _key(texture: Texture, numbers: bool) -> _Key:
    """Return what tells apart textures with different texels.

    Samplers of one image share these if they have the same beyond its right edge.
    """
    return id(texture.image), texture.mipmapped, texture.wrap[0] == "repeat", numbers


@dataclass(frozen=True, eq=False)
class Packed:
    """The textures of some materials in one array of words, uint32, and where each begins in it, by its key.

    floats: whether all texels are floats. images: kept alive, as their identities are keys. lights: whether there are
    those that only lights need.
    """

    words: NDArray[np.uint32]
    starts: dict[_Key, int]
    floats: bool
    images: list[AnyArray]
    lights: bool


def packed_textures(materials: Sequence[Material], lights: bool = False) -> Packed:
    """Return the textures of these materials, each image once. lights: with those that only lights need."""
    albedo = albedo_tables().reshape(-1) if lights else np.zeros(0, np.float32)
    tables = np.concatenate([linear_of_bytes(), srgb_scales(), albedo]).view(np.uint32)
    distinct = {_key(texture, numbers): texture for m in materials for texture, numbers in _textures(m, lights)}
    floats = 16 * sum(_level_starts(texture)[-1] for texture in distinct.values()) <= MOST_FLOAT_BYTES
    starts: dict[_Key, int] = {}
    end = len(tables)
    for key, texture in distinct.items():
        starts[key] = end
        words = _level_starts(texture)[-1] * (4 if floats or texture.image.dtype != np.uint8 else 1)
        end += layout.LEVEL_STARTS + words + -words % 4  # so that the next texture may be of vectors of four floats
    packed = np.zeros(end, np.uint32)
    packed[: len(tables)] = tables
    with ThreadPoolExecutor() as pool:  # NumPy lets other threads work meanwhile
        list(pool.map(lambda key: _fill(packed[starts[key] :], distinct[key], floats, key[3]), distinct))
    return Packed(packed, starts, floats, [texture.image for texture in distinct.values()], lights)


def srgb_scales() -> NDArray[np.float32]:
    """Return 1.055 times 2^(5/12 e) for e = -15 .. 0, by which kernels make sRGB (kernels/shading/reals.h)."""
    return (1.055 * 2.0 ** (np.arange(-15, 1) * 5 / 12)).astype(np.float32)


def _level_starts(texture: Texture) -> list[int]:
    """Return where each level begins, in texels, and where the last one ends. Rows have one texel more than shown."""
    return [0, *accumulate((width + 1) * height for width, height in level_sizes(texture))]


def _fill(words: NDArray[np.uint32], texture: Texture, floats: bool, numbers: bool) -> None:
    """Write a texture as kernels read it: where its levels begin, then their texels. numbers: these are no colours.

    Behind each row is the texel that is to the right of its last one: the first, if the texture repeats, else the last.
    """
    starts = _level_starts(texture)
    words[: len(starts) - 1] = starts[:-1]
    texels = words[layout.LEVEL_STARTS :].view(np.float32 if floats or texture.image.dtype != np.uint8 else np.uint8)
    for start, level in zip(starts, mip_map(texture, numbers), strict=False):
        height, width = level.shape[:2]
        rows = texels[4 * start : 4 * (start + height * (width + 1))].reshape(height, width + 1, 4)
        if level.dtype == rows.dtype:
            rows[:, :-1] = level
        else:
            _to_floats(level, rows[:, :-1], numbers)
        rows[:, -1] = rows[:, 0] if texture.wrap[0] == "repeat" else rows[:, -2]


def _to_floats(level: AnyArray, found: AnyArray, numbers: bool) -> None:
    """Write a level's bytes as float32, linear: what kernels decode bytes to, to the bit."""
    if numbers:
        found[...] = level / np.float32(255)
        return
    for rows in _strips(level):
        found[rows, :, :3] = linear_of_bytes()[level[rows, :, :3]]
        found[rows, :, 3] = level[rows, :, 3] / np.float32(255)


def _strips(image: AnyArray) -> Iterator[slice]:
    """Yield runs of rows, an even number of them but for the last, that fit a cache, and little memory."""
    step = 2 * max(_STRIP // (2 * image.shape[1]), 1)
    yield from (slice(first, first + step) for first in range(0, len(image), step))


def level_sizes(texture: Texture) -> list[tuple[int, int]]:
    """Return width and height of each level: each half of the one before, rounded down, to 1 x 1."""
    width, height = texture.size
    sizes = [(width, height)]
    while texture.mipmapped and max(sizes[-1]) > 1:
        width, height = (max(side // 2, 1) for side in sizes[-1])
        sizes.append((width, height))
    return sizes


def mip_map(texture: Texture, numbers: bool = False) -> list[AnyArray]:
    """Return the texture's levels, [height, width, 4] each, of the image's type.

    A texel is the mean of those that it covers in the level before, in linear light. numbers: the texels are no
    colours.
    """
    levels = [texture.image]
    for _ in level_sizes(texture)[1:]:
        if texture.image.dtype != np.uint8:
            levels.append(_halved_floats(levels[-1]))
        elif numbers:
            levels.append(np.rint(_box(_box(levels[-1].astype(np.float64), 0), 1)).astype(np.uint8))
        else:
            levels.append(_halved_bytes(levels[-1]))
    return levels


def _halved_floats(image: AnyArray) -> AnyArray:
    """Return a float32 image of half the size."""
    return np.asarray(_box(_box(image.astype(np.float64), 0), 1), np.float32)


def _halved_bytes(image: AnyArray) -> AnyArray:
    """Return a uint8 image of half the size: sRGB, to the nearest byte.

    Linear light is added up in whole numbers, so that mip maps have the same bytes everywhere.
    """
    table = np.rint(linear_of_bytes().astype(np.float64) * _FULL).astype(np.uint32)
    height, width = image.shape[:2]
    half = np.empty((max(height // 2, 1), max(width // 2, 1), 4), np.uint8)
    if height % 2 or width % 2:
        both = np.concatenate([table[image[..., :3]], image[..., 3:]], axis=-1).astype(np.float64)
        means = np.rint(_box(_box(both, 0), 1) * (4, 4, 4, 1)).astype(np.uint32)
        half[..., :3], half[..., 3] = _bytes_of_sums()[means[..., :3]], means[..., 3]
        return half
    for rows in _strips(image):
        part = half[rows.start // 2 : rows.stop // 2]
        part[..., :3] = _bytes_of_sums()[_sums_of_four(table[image[rows, :, :3]])]
        part[..., 3] = (_sums_of_four(image[rows, :, 3].astype(np.uint16)) + 2) >> 2
    return half


def _sums_of_four(image: AnyArray) -> AnyArray:
    """Return the sum of every two by two texels."""
    rows = image[0::2] + image[1::2]
    return np.asarray(rows[:, 0::2] + rows[:, 1::2])


@cache
def _bytes_of_sums() -> NDArray[np.uint8]:
    """Return the nearest sRGB byte to the mean of four texels, by their sum: uint8 [4 * _FULL + 1]."""
    return np.rint(srgb(np.arange(4 * _FULL + 1) / (4 * _FULL)) * 255).astype(np.uint8)


def _box(image: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Return the image with half as many texels along an axis.

    Each of n texels of 2 n + 1 is a mean of three, weighted by how much it covers of each.
    """
    side = image.shape[axis]
    if side == 1:
        return image
    moved = np.moveaxis(image, axis, 0)
    half = side // 2
    if side % 2 == 0:
        found = (moved[0::2] + moved[1::2]) / 2
    else:
        place = np.arange(half).reshape(-1, *[1] * (image.ndim - 1))
        found = ((half - place) * moved[0:-1:2] + half * moved[1::2] + (place + 1) * moved[2::2]) / side
    return np.moveaxis(found, 0, axis)
