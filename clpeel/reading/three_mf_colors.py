"""Colours of a 3MF package: its property groups as one table of colours, texture coordinates and materials.

As the materials extension says, colours are display-referred (sRGB), and are interpolated so, but are mixed as light.
Alpha counts wherever a file writes it, though the extension takes surfaces as opaque.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clpeel.reading.companions import named
from clpeel.reading.images import texels
from clpeel.reading.three_mf_parts import Group, Model, Package
from clpeel.scene.arrays import DEFAULT_COLOR, AnyArray, Colors, alike, as_float
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.textures import Magnify, Minify, Texture, Wrap, linear, linear_of_bytes, srgb

_WRAPS: dict[str, Wrap] = {"wrap": "repeat", "mirror": "mirror", "clamp": "clamp", "none": "clamp"}
_FILTERS: dict[str, tuple[Magnify, Minify]] = {"nearest": ("nearest", "nearest")}
_COLOR = re.compile(r"\s*#([0-9a-fA-F]{6})([0-9a-fA-F]{2})?\s*")

_SOLID = ("basematerials", "compositematerials")
"""Groups of what an object is made of, below other layers."""

_MOST_BLENDS = 16
"""The most images that are made of one texture, by blending it with a colour above or below."""


@dataclass(frozen=True)
class Rows:
    """Properties: of one group, or of all of them.

    colors: [k, 4], linear where there is a material, else display-referred. uv: float64 [k, 2], texture coordinates.
    material_of: int64 [k], places in materials, or NO_MATERIAL.
    """

    colors: Colors
    uv: NDArray[np.float64]
    material_of: NDArray[np.int64]
    materials: tuple[Material, ...] = ()

    @staticmethod
    def of(colors: Colors) -> Rows:
        """Return properties that are colours alone."""
        return Rows(colors, np.zeros((len(colors), 2)), np.full(len(colors), NO_MATERIAL, np.int64))


class Palette:
    """The properties of all groups that were asked for, in one table. Entry 0 is that of what has no property.

    notes: what could not be read.
    """

    def __init__(self, package: Package) -> None:
        self.package = package
        self.notes: list[str] = []
        self._rows: list[Rows] = [Rows.of(np.array([DEFAULT_COLOR], np.uint8))]
        self._made: dict[tuple[int, int], tuple[int, Rows]] = {}
        self._pictures: dict[tuple[int, int], Material | None] = {}
        self._table: Rows | None = None

    # --- entries ------------------------------------------------------------------------------------------------------

    def entry(self, model: Model, group: int, index: int) -> int:
        """Return the entry of one property of a group, or 0, after a note, if there is none."""
        return int(self.entries(model, group, np.array([[index]]), 0)[0, 0])

    def entries(self, model: Model, group: int, indices: NDArray[np.int64], default: int) -> NDArray[np.int64]:
        """Return the entries of a group's properties. What is not there is the default, after a note.

        Base materials do not blend into one another, so the first corner's is that of all.
        """
        start, rows = self._of(model, group)
        if group in model.groups and model.groups[group].kind == "basematerials":
            indices = np.broadcast_to(indices[:, :1], indices.shape)
        there = (indices >= 0) & (indices < len(rows.colors))
        if not there.all():
            self._note(f"properties left out, as group {group} of the 3MF package lacks them: {(~there).sum():,}")
        return np.where(there, start + indices, default)

    def _of(self, model: Model, group: int) -> tuple[int, Rows]:
        """Return a group's first entry and its rows."""
        key = id(model), group
        if key not in self._made:
            rows = self._read(model, group)
            self._made[key] = sum(len(each.colors) for each in self._rows), rows
            self._rows.append(rows)
            self._table = None
        return self._made[key]

    def _note(self, text: str) -> None:
        """Add a note, once."""
        if text not in self.notes:
            self.notes.append(text)

    # --- the table ----------------------------------------------------------------------------------------------------

    @property
    def table(self) -> Rows:
        """All rows one after another."""
        if self._table is None:
            starts = np.cumsum([0, *(len(rows.materials) for rows in self._rows)])
            places = [
                np.where(rows.material_of >= 0, rows.material_of + start, NO_MATERIAL)
                for rows, start in zip(self._rows, starts, strict=False)
            ]
            self._table = Rows(
                np.concatenate(alike([rows.colors for rows in self._rows])),
                np.concatenate([rows.uv for rows in self._rows]),
                np.concatenate(places),
                tuple(material for rows in self._rows for material in rows.materials),
            )
        return self._table

    # --- groups -------------------------------------------------------------------------------------------------------

    def _read(self, model: Model, number: int) -> Rows:
        """Return the properties of a group. There are none if the model has no such group."""
        group = model.groups.get(number)
        if group is None:
            return Rows.of(np.zeros((0, 4), np.uint8))
        if group.kind == "texture2dgroup":
            return self._textured(model, group)
        if group.kind == "compositematerials":
            return self._mixed(model, group)
        if group.kind == "multiproperties":
            return self._layered(model, group)
        return Rows.of(self._plain(group.texts))

    def _plain(self, texts: list[str]) -> NDArray[np.uint8]:
        """Return colours that are written as #RRGGBB or #RRGGBBAA. A note says which are not."""
        known = {text: _COLOR.fullmatch(text) for text in dict.fromkeys(texts)}
        wrong = [text for text, match in known.items() if match is None]
        if wrong:
            self._note(f"colours of the 3MF package left out, as they are none: {named(', '.join(wrong[:5]))}")
        bytes_of = {
            text: bytes(DEFAULT_COLOR) if match is None else bytes.fromhex(match[1] + (match[2] or "ff"))
            for text, match in known.items()
        }
        return np.frombuffer(b"".join(bytes_of[text] for text in texts), np.uint8).reshape(-1, 4)

    def _mixed(self, model: Model, group: Group) -> Rows:
        """Return composite materials: base materials mixed by their shares, as light is (materials extension, 4.1)."""
        _, base = self._of(model, int(group.attributes["matid"]))
        indices = np.array(group.attributes["matindices"].split(), np.int64)
        shares = np.zeros((len(group.texts), len(indices)))
        for row, text in zip(shares, group.texts, strict=True):
            values = np.array(text.split()[: len(indices)], np.float64)
            row[: len(values)] = values
        sums = shares.sum(axis=1, keepdims=True)
        shares = np.where(sums > 0, shares / np.where(sums > 0, sums, 1), 1 / max(len(indices), 1))
        return Rows.of(_displayed((shares[:, :, None] * _light(base.colors[indices])).sum(axis=1)))

    # --- textures -----------------------------------------------------------------------------------------------------

    def _textured(self, model: Model, group: Group) -> Rows:
        """Return a group of texture coordinates. In files, v points up."""
        given = np.array([text.split() for text in group.texts], np.float64).reshape(-1, 2)
        number = int(group.attributes["texid"])
        material = self._picture(model, number)
        if material is None:
            return Rows.of(np.tile(np.array(DEFAULT_COLOR, np.uint8), (len(given), 1)))
        styles = [model.textures[number].get(name) for name in ("tilestyleu", "tilestylev")]
        beyond = ((column < 0).any() or (column > 1).any() for column in given.T)
        if any(style == "none" and out for style, out in zip(styles, beyond, strict=True)):
            self._note(f"texture {named(material.name)} is drawn beyond its edges, though its tile style is none")
        uv = np.stack([given[:, 0], 1 - given[:, 1]], axis=1)
        return Rows(np.full((len(uv), 4), 255, np.uint8), uv, np.zeros(len(uv), np.int64), (material,))

    def _picture(self, model: Model, number: int) -> Material | None:
        """Return the material of a texture, or None, after a note, if its image cannot be read."""
        key = id(model), number
        if key not in self._pictures:
            self._pictures[key] = self._loaded(model, number)
        return self._pictures[key]

    def _loaded(self, model: Model, number: int) -> Material | None:
        """Read the material of a texture, or return None after a note."""
        attributes = model.textures.get(number)
        if attributes is None:
            self._note(f"texture {number} left out: the 3MF package lacks it")
            return None
        path = attributes.get("path", "")
        try:
            with self.package.open(path) as file:
                image = texels(file.read())
        except KeyError:
            self._note(f"texture {named(path)} left out: the 3MF package lacks it")
            return None
        except Exception as error:  # the archive may be damaged there, too
            self._note(f"texture {named(path)} left out: {error}")
            return None
        wraps = [_WRAPS.get(attributes.get(name, "wrap"), "repeat") for name in ("tilestyleu", "tilestylev")]
        magnify, minify = _FILTERS.get(attributes.get("filter", "auto"), ("linear", "linear-mipmap-linear"))
        return _material(path, Texture(image, (wraps[0], wraps[1]), magnify, minify))

    # --- multi-properties ---------------------------------------------------------------------------------------------

    def _layered(self, model: Model, group: Group) -> Rows:
        """Return multi-properties: layers of properties, one above another (materials extension, 5).

        Without a texture, they are blended at corners. A texture is blended with each colour that lies above or below.
        """
        numbers = [int(number) for number in group.attributes["pids"].split()]
        methods = group.attributes.get("blendmethods", "").split()[: len(numbers) - 1]
        methods += ["mix"] * (len(numbers) - 1 - len(methods))
        kinds = [model.groups[number].kind if number in model.groups else "" for number in numbers]
        if "multiproperties" in kinds or not all(kinds):
            self._note("multi-properties of the 3MF package left out: they name what is not a property")
            return Rows.of(np.tile(np.array(DEFAULT_COLOR, np.uint8), (len(group.texts), 1)))
        layers = [self._of(model, number)[1] for number in numbers]
        indices = np.zeros((len(group.texts), len(numbers)), np.int64)
        for row, text in zip(indices, group.texts, strict=True):
            values = np.array(text.split()[: len(numbers)], np.int64)
            row[: len(values)] = values
        solid = kinds[0] in _SOLID and len(numbers) > 1
        lights = [_light(rows.colors[indices[:, place]]) for place, rows in enumerate(layers)]
        textures = [place for place, rows in enumerate(layers) if rows.materials]
        if not textures:
            return Rows.of(_displayed(_blended(lights, methods, solid)))
        place = textures[-1]
        rows = layers[place]
        uv, (material,) = rows.uv[indices[:, place]], rows.materials
        materials: tuple[Material, ...] = (material,)
        of_row = np.zeros(len(uv), np.int64)
        covers = place == len(layers) - 1 > 0 and methods[-1] == "mix" and material.texel_alphas[0] == 1
        if not covers:
            others = [each for other, each in enumerate(lights) if other != place]
            blends, of_row = _distinct(others, len(uv))
            if len(textures) > 1 or len(blends) > _MOST_BLENDS:
                beyond = f"of several textures, or of one and more than {_MOST_BLENDS} colours"
                self._note(f"multi-properties {beyond}: the last texture alone is drawn")
                of_row = np.zeros_like(of_row)
            else:
                materials = tuple(_repainted(material, colors, place, methods, solid) for colors in blends)
        return Rows(np.full((len(uv), 4), 255, np.uint8), uv, of_row, materials)


def _material(name: str, texture: Texture) -> Material:
    """Return the material of a texture. It blends if any of its texels is transparent."""
    material = Material(name, texture=texture)
    return material if material.texel_alphas[0] == 1 else Material(name, texture=texture, alpha_mode="BLEND")


def _light(colors: Colors) -> NDArray[np.float64]:
    """Return display-referred colours [..., 4] as linear ones."""
    unit = as_float(colors).astype(np.float64)
    unit[..., :3] = linear(unit[..., :3])
    return unit


def _displayed(colors: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return linear colours [..., 4] as display-referred ones."""
    found = np.concatenate([srgb(colors[..., :3]), colors[..., 3:]], axis=-1)
    return np.clip(found, 0, 1).astype(np.float32)


def _blended(layers: list[AnyArray], methods: list[str], solid: bool) -> AnyArray:
    """Return the colours of layers [..., 4], all of them linear, from the lowest to the highest.

    methods: how each but the lowest lies on those below. solid: whether the lowest is a material: then the others are
    blended first, and the result lies on the material.
    """
    above = layers[1:] if solid else layers
    rgb = above[0][..., :3]
    alpha = above[0][..., 3:] if solid and methods[0] == "mix" else np.ones_like(above[0][..., 3:])
    for layer, method in zip(above[1:], methods[int(solid) :], strict=True):
        own, cover = layer[..., :3], layer[..., 3:]
        if method == "multiply":
            rgb, alpha = own * rgb, cover * alpha
        else:
            rgb, alpha = own * cover + rgb * (1 - cover), cover + alpha * (1 - cover)
    if solid:
        below = layers[0]
        rgb, alpha = rgb * alpha + below[..., :3] * (1 - alpha), alpha + below[..., 3:] * (1 - alpha)
    shape = np.broadcast_shapes(rgb.shape[:-1], alpha.shape[:-1])
    return np.concatenate([np.broadcast_to(rgb, (*shape, 3)), np.broadcast_to(alpha, (*shape, 1))], axis=-1)


def _distinct(lights: list[NDArray[np.float64]], count: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the combinations of colours that occur, [k, layers, 4], and which one each of so many rows has."""
    table = np.stack(lights, axis=1) if lights else np.zeros((count, 0, 4))
    found, of_row = np.unique(table.reshape(count, -1), axis=0, return_inverse=True)
    return found.reshape(-1, len(lights), 4), of_row.reshape(-1)


def _repainted(material: Material, colors: AnyArray, place: int, methods: list[str], solid: bool) -> Material:
    """Return a textured material whose texels were blended with colours [layers, 4], as the layer at this place."""
    texture = material.texture
    assert texture is not None
    image = texture.image
    if image.dtype == np.uint8:
        image = np.concatenate([linear_of_bytes()[image[..., :3]], image[..., 3:] / np.float32(255)], axis=2)
    layers: list[AnyArray] = [color.astype(np.float32) for color in colors]
    layers.insert(place, image)
    mixed = np.clip(_blended(layers, methods, solid), 0, 1).astype(np.float32)
    return _material(material.name, Texture(mixed, texture.wrap, texture.magnify, texture.minify))
