"""MTL: turns the materials of OBJ files into Materials, as viewers show them."""

from __future__ import annotations

import math
import posixpath
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from clpeel.reading.companions import Companions, named
from clpeel.reading.images import texels
from clpeel.reading.losses import listed
from clpeel.reading.paints import painted, with_opacities
from clpeel.scene.arrays import DEFAULT_COLOR, AnyArray
from clpeel.scene.materials import Finish, Material
from clpeel.scene.textures import Texture, Wrap, linear

Rgb = tuple[float, float, float]

Statements = Mapping[str, str]
"""What a material says, by keyword in lower case."""


@dataclass(frozen=True)
class Placing:
    """How a texture lies on the coordinates (u, v) of a file: at (u, v) * scale + offset."""

    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


# --- colours ----------------------------------------------------------------------------------------------------------


def opacity(says: Statements) -> float:
    """Return a material's alpha, 0..1, from its d and its Tr.

    d is the opacity in the format's definition, so it wins. Tr is no part of that. To most programs it is 1 - d, but
    to older versions of MeshLab and to programs that are built on its library it is d: they write `Tr 1.000000` for
    what is opaque. Nobody means a material that cannot be seen at all, so a Tr of 1 is opaque. Any other Tr is 1 - d.
    """
    dissolve, transparency = _number(says.get("d")), _number(says.get("tr"))
    if dissolve is not None:
        return min(max(dissolve, 0.0), 1.0)
    if transparency is None or transparency >= 1:
        return 1.0
    return 1.0 - max(transparency, 0.0)


def _number(text: str | None) -> float | None:
    """Return the last number of a statement (d may have an option before it), or None if there is none."""
    try:
        value = float((text or "").split("#")[0].split()[-1])
    except (ValueError, IndexError):
        return None
    return value if math.isfinite(value) else None


def diffuse(says: Statements) -> Rgb | None:
    """Return a material's Kd, of any size, or None if it has none in numbers. One number counts for all three."""
    return _rgb(says, "kd")


def finish(says: Statements) -> Finish | None:
    """Return how a material takes light, or None if it says nothing of that.

    Pr and Pm are roughness and metallic. Otherwise a highlight of Phong's exponent Ns is as wide as one of roughness
    (2 / (Ns + 2))^(1/4), and where Ks is black there is none. Ke is light of its own.
    """
    rough, shine = _number(says.get("pr")), _number(says.get("ns"))
    metallic, mirrored, emissive = _number(says.get("pm")), _rgb(says, "ks"), _rgb(says, "ke")
    if rough is None and mirrored is not None and not any(mirrored):
        rough = 1.0
    if rough is None and shine is not None:
        rough = (2 / (max(shine, 0.0) + 2)) ** 0.25
    if rough is None and metallic is None and not any(emissive or ()):
        return None
    red, green, blue = (float(value) for value in linear(np.clip(emissive or (0, 0, 0), 0, 1)))
    least, most = 0.0, 1.0
    return Finish(
        metallic=min(max(metallic or 0.0, least), most),
        roughness=0.5 if rough is None else min(max(rough, least), most),
        emissive=(red, green, blue),
    )


def _rgb(says: Statements, keyword: str) -> Rgb | None:
    """Return the colour of a statement, of any size, or None if it has none in numbers."""
    values = list[float]()
    for word in says.get(keyword, "").split()[:3]:
        try:
            values.append(float(word))
        except ValueError:
            break
    if not values or not all(map(math.isfinite, values)):
        return None
    red, green, blue = (*values, *values[-1:] * (3 - len(values)))
    return red, green, blue


def finished(name: str, says: Statements, texture: Texture | None) -> Material:
    """Return the Material of what an MTL file says, with a texture that is made already.

    MTL colours are display-referred, as viewers show them. Kd and texels are multiplied in linear light, as by
    three.js. If there is a map_Kd, then a Kd that is missing, or that is black, as Maya writes it, is white: with it,
    nothing would be seen of the texture. illum is ignored, as by three.js, Blender and VTK: exporters write any number
    there. What has texels or an alpha below 1 is blended.
    """
    rgb = diffuse(says)
    if rgb is None or ("map_kd" in says and not any(rgb)):
        red, green, blue = (value / 255 for value in DEFAULT_COLOR[:3])
        rgb = (red, green, blue) if texture is None else (1.0, 1.0, 1.0)
    return painted(name, rgb, opacity(says), texture, finish(says))


# --- textures ---------------------------------------------------------------------------------------------------------

_MAPS = re.compile(r"(map_\w+|bump|disp|decal|refl|norm)$")
_ARGUMENTS = {
    **dict.fromkeys("-blendu -blendv -boost -cc -clamp -texres -imfchan -type -bm -colorspace".split(), 1),
    "-mm": 2,
    **dict.fromkeys(("-o", "-s", "-t"), 3),
}
"""How many words follow each option of a texture. Of -o, -s and -t, which have numbers alone, the last may be missing.
"""


@dataclass(frozen=True)
class _Map:
    """A statement that names a texture. ignored: its options that are not drawn."""

    file: str
    placing: Placing
    wrap: Wrap
    ignored: tuple[str, ...]

    @staticmethod
    def of(text: str) -> _Map:
        """Return what the statement says: options, each with its words, and then a file name with any spaces."""
        given: dict[str, list[str]] = {}
        while True:
            option, _, rest = text.strip().partition(" ")
            if option.lower() not in _ARGUMENTS:
                break
            text = rest
            for _ in range(_ARGUMENTS[option.lower()]):
                word, _, rest = text.strip().partition(" ")
                if option.lower() in ("-o", "-s", "-t", "-mm", "-bm") and _number(word) is None:
                    break
                given.setdefault(option.lower(), []).append(word)
                text = rest
        scale, offset = (
            [*(_number(word) or 0.0 for word in given.get(option, [])), default, default][:2]
            for option, default in (("-s", 1.0), ("-o", 0.0))
        )
        clamped = given.get("-clamp", ["off"])[0].lower() == "on"
        ignored = tuple(option for option in given if option not in ("-s", "-o", "-clamp", "-cc", "-imfchan"))
        placing = Placing((scale[0], scale[1]), (offset[0], offset[1]))
        return _Map(text.strip(), placing, "clamp" if clamped else "repeat", ignored)


@dataclass
class Library:
    """The materials of an OBJ file's material files, and notes of what is not drawn of them.

    An image is decoded once, and only when a material that uses it is asked for.
    """

    companions: Companions
    statements: dict[str, dict[str, str]] = field(default_factory=dict)
    """What each material says, by its name."""
    notes: list[str] = field(default_factory=list)
    _folders: dict[str, str] = field(default_factory=dict)
    _images: dict[tuple[str, str], AnyArray | None] = field(default_factory=dict)
    _textures: dict[tuple[str, ...], Texture | None] = field(default_factory=dict)

    def read(self, line: str) -> bool:
        """Read the material files that an mtllib line names. Returns whether any of them is there.

        The line may be one name with spaces, or several names without spaces.
        """
        words, has = line.split(), self.companions.has
        one = len(words) < 2 or line.startswith('"') or has(line) or not any(map(has, words))
        names = [line] if one else words
        self.companions.forget({line, *words}.difference(names))
        for name in names:
            if has(name):
                self._take(self.companions.get(name).decode("utf-8", "replace"), posixpath.dirname(_usual(name)))
            else:
                self.notes.append(f"material file {named(name)} left out: {self.companions.lost[name]}")
        return any(map(has, names))

    def _take(self, text: str, folder: str) -> None:
        """Add the materials in the text of a file in this folder. The last of several statements counts."""
        current: dict[str, str] = {}
        for line in text.splitlines():
            key, _, value = line.strip().replace("\t", " ").partition(" ")
            if key.lower() == "newmtl":
                name = " ".join(value.split())
                current = self.statements.setdefault(name, {})
                self._folders.setdefault(name, folder)
            elif value.strip() and not key.startswith("#"):
                current[key.lower()] = value.strip()

    def material(self, name: str) -> tuple[Material, Placing]:
        """Return one of the materials in `statements`, and how its texture lies."""
        says, whose = self.statements[name], f"of material {named(name)}"
        rgb = diffuse(says)
        if "kd" in says and rgb is None:
            self.notes.append(f"Kd {whose} left out: expected three numbers, got {named(says['kd'])}")
        elif rgb is not None and max(rgb) > 1:
            self.notes.append(f"Kd {whose} is cut off at 1: {named(says['kd'])}")
        color, mask = (_Map.of(says[key]) if key in says else None for key in ("map_kd", "map_d"))
        if color and mask and (color.placing, color.wrap) != (mask.placing, mask.wrap):
            self.notes.append(f"options of map_d {whose} left out: those of its map_Kd are used")
        ignored = [option for each in (color, mask) if each for option in each.ignored]
        if ignored:
            self.notes.append(f"options of textures {whose} left out: {listed(ignored)}")
        lies = color or mask
        texture = self._texture(self._folders[name], color, mask)
        return finished(name, says, texture), lies.placing if lies and texture is not None else Placing()

    def other_maps(self, names: list[str]) -> list[str]:
        """Return the keywords of the maps of these materials that are not drawn."""
        keys = (key for name in names for key in self.statements[name])
        return list(dict.fromkeys(key for key in keys if _MAPS.match(key) and key not in ("map_kd", "map_d")))

    def _texture(self, folder: str, color: _Map | None, mask: _Map | None) -> Texture | None:
        """Return the texture of map_Kd and map_d, or None if neither can be read.

        A map_d that is the image of map_Kd says no more than that its alpha counts, which it does anyhow.
        """
        lies = color or mask
        if lies is None:
            return None
        if color and mask and _usual(color.file) == _usual(mask.file):
            mask = None
        key = (folder, color.file if color else "", mask.file if mask else "", lies.wrap)
        if key not in self._textures:
            rgba = self._image(folder, color.file) if color else None
            opacities = self._image(folder, mask.file) if mask else None
            image = rgba if opacities is None else with_opacities(rgba, opacities)
            self._textures[key] = None if image is None else Texture(image, (lies.wrap, lies.wrap))
        return self._textures[key]

    def _image(self, folder: str, name: str) -> AnyArray | None:
        """Return the texels of an image beside the material file, else beside the mesh. None, after a note, if there
        are none."""
        if (folder, name) not in self._images:
            self._images[folder, name] = None
            spellings = (posixpath.join(folder, _usual(name)), name)
            there = [spelling for spelling in spellings if self.companions.has(spelling)]
            self.companions.forget({spellings[0]}.difference({name}))
            try:
                self._images[folder, name] = texels(self.companions.get((*there, name)[0]))
            except FileNotFoundError:
                self.notes.append(f"texture {named(name)} left out: {self.companions.lost[name]}")
            except ValueError as error:
                self.notes.append(f"texture {named(name)} left out: {error}")
        return self._images[folder, name]


def _usual(name: str) -> str:
    """Return a file name without quotes, and with the slashes that are usual here."""
    return name.strip().strip('"').replace("\\", "/")
