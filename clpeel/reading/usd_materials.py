"""USD's materials: UsdPreviewSurface as Materials, by what it is bound to. Other shaders are noted by name."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from clpeel.reading.companions import Companions, named
from clpeel.reading.corners import Places
from clpeel.reading.images import check_picture, texels
from clpeel.reading.losses import listed
from clpeel.reading.paints import fitted, with_opacities
from clpeel.scene.arrays import AnyArray
from clpeel.scene.images import LateImage
from clpeel.scene.materials import NO_MATERIAL, AlphaMode, Finish, Material
from clpeel.scene.textures import Texture, Wrap, linear

_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp"}

_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}

_OTHERS = ("clearcoat", "displacement")
"""Inputs of UsdPreviewSurface that are not drawn, and matter if they are not 0."""

_MOST_STEPS = 16
"""The most shaders that stand between a texture and its coordinates."""


@dataclass(frozen=True)
class Placing:
    """How a texture lies: by which coordinates, and by UsdTransform2d: scaled, turned, then moved, v pointing up.

    angle: degrees, counterclockwise.
    """

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    angle: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)

    def at(self, uv: AnyArray) -> AnyArray:
        """Return where coordinates [n, 2] lie in an image whose v points down."""
        u, v = uv[:, 0] * self.scale[0], uv[:, 1] * self.scale[1]
        cosine, sine = math.cos(math.radians(self.angle)), math.sin(math.radians(self.angle))
        across, up = cosine * u - sine * v + self.offset[0], sine * u + cosine * v + self.offset[1]
        return np.stack([across, 1 - up], axis=1)


@dataclass(frozen=True, eq=False)
class Look:
    """A Material, and where its textures lie: its numbers of texture coordinates are places in placings.

    colors: the primvar that the base colour is multiplied with, or None.
    """

    material: Material
    placings: tuple[Placing, ...] = ()
    colors: str | None = None


@dataclass(frozen=True, eq=False)
class _Source:
    """A UsdUVTexture that feeds an input. channel: of the output, such as rgb or r. encoded: whether it is sRGB."""

    file: str
    data: bytes
    channel: str
    placing: Placing
    wrap: tuple[Wrap, Wrap]
    scale: AnyArray
    bias: AnyArray
    encoded: bool | None


class Materials:
    """The looks of materials, each made once. notes say what is not drawn of them."""

    def __init__(self, moment: Any, companions: Companions) -> None:
        self._moment, self._companions = moment, companions
        self._made: dict[Any, Look | None] = {}
        self._notes: dict[str, None] = {}
        self._files: dict[str, bytes | None] = {}

    def notes(self) -> list[str]:
        """Return what is not drawn of the materials so far."""
        return list(self._notes)

    def of(self, prim: Any, count: int) -> tuple[list[Look], Places]:
        """Return the looks that a prim's faces have, and the place among them of each of `count` faces, or -1.

        Faces that a GeomSubset of the family materialBind has are those of its material.
        """
        from pxr import UsdShade

        binding = UsdShade.MaterialBindingAPI(prim)
        looks: dict[Look, int] = {}

        def place(api: Any) -> int:
            look = self._look(api.ComputeBoundMaterial()[0])
            return NO_MATERIAL if look is None else looks.setdefault(look, len(looks))

        of_faces = np.full(count, place(binding), np.int64)
        for subset in binding.GetMaterialBindSubsets():
            faces = np.asarray(subset.GetIndicesAttr().Get(self._moment) or (), np.int64)
            inside = faces[(faces >= 0) & (faces < count)]
            if len(inside) < len(faces):
                self._note(
                    f"faces of {named(str(subset.GetPath()))} left out: the mesh lacks {len(faces) - len(inside)}"
                )
            of_faces[inside] = place(UsdShade.MaterialBindingAPI(subset.GetPrim()))
        return list(looks), of_faces

    def _note(self, text: str) -> None:
        self._notes[text] = None

    def _look(self, material: Any) -> Look | None:
        """Return the look of a material, or None, after a note, if it is not one that is drawn."""
        if not material:
            return None
        key = material.GetPath()
        if key not in self._made:
            shader = material.ComputeSurfaceSource()[0]
            if shader and shader.GetIdAttr().Get() == "UsdPreviewSurface":
                self._made[key] = _Surface(shader, material.GetPrim().GetName(), self._inputs(shader)).look()
            else:
                kind = shader.GetIdAttr().Get() if shader else None
                what = f"its shader is {named(str(kind))}" if kind else "it has no shader for all renderers"
                self._note(f"material {named(str(key))} left out: {what}, not UsdPreviewSurface")
                self._made[key] = None
        return self._made[key]

    # --- what feeds an input ------------------------------------------------------------------------------------------

    def _inputs(self, shader: Any) -> _Inputs:
        return _Inputs(self, shader)

    def fed(self, shader: Any, name: str) -> Any:
        """Return what an input has: a number or tuple, a _Source, a primvar's name as "primvar NAME", or None."""
        attribute = _producer(shader, name)
        if attribute is None:
            return None
        from pxr import UsdShade

        node = UsdShade.Shader(attribute.GetPrim())
        kind = node.GetIdAttr().Get() if node else None
        base, type_of = UsdShade.Utils.GetBaseNameAndType(attribute.GetName())
        if type_of != UsdShade.AttributeType.Output or kind is None:
            return attribute.Get(self._moment)
        if kind == "UsdUVTexture":
            return self._texture(node, base)
        if kind.startswith("UsdPrimvarReader"):
            return f"primvar {self.value(node, 'varname', '')}"
        self._note(f"{name} of {named(str(shader.GetPath()))} left out: {named(kind)} is not known")
        return None

    def value(self, shader: Any, name: str, default: Any) -> Any:
        """Return the value of an input, which may come from further up, or the default."""
        attribute = _producer(shader, name)
        value = None if attribute is None else attribute.Get(self._moment)
        return default if value is None else value

    def _texture(self, node: Any, channel: str) -> _Source | None:
        """Return a UsdUVTexture, or None, after a note, if its picture cannot be read."""
        asset = self.value(node, "file", None)
        path = "" if asset is None else str(asset.resolvedPath or asset.path)
        data = self._bytes(path, "" if asset is None else str(asset.path))
        if data is None:
            return None
        placing = self._placing(node)
        wraps = [str(self.value(node, name, "useMetadata")) for name in ("wrapS", "wrapT")]
        black = [wrap for wrap in wraps if wrap == "black"]
        if black:
            self._note("wrap mode black is drawn as clamp")
        found = [_WRAPS.get(wrap, "clamp" if black else "repeat") for wrap in wraps]
        space = str(self.value(node, "sourceColorSpace", "auto"))
        return _Source(
            path,
            data,
            channel,
            placing,
            (found[0], found[1]),
            np.array(self.value(node, "scale", (1, 1, 1, 1)), np.float64),
            np.array(self.value(node, "bias", (0, 0, 0, 0)), np.float64),
            {"sRGB": True, "raw": False}.get(space),
        )

    def _placing(self, node: Any) -> Placing:
        """Return how a texture lies. Of several transforms, those that stand nearest to the coordinates count first."""
        from pxr import UsdShade

        attribute, transforms = _producer(node, "st"), list[Any]()
        for _ in range(_MOST_STEPS):
            shader = None if attribute is None else UsdShade.Shader(attribute.GetPrim())
            kind = shader.GetIdAttr().Get() if shader else None
            if kind == "UsdTransform2d":
                transforms.append(shader)
                attribute = _producer(shader, "in")
                continue
            name = str(self.value(shader, "varname", "st")) if str(kind).startswith("UsdPrimvarReader") else "st"
            break
        else:
            name = "st"
        if len(transforms) > 1:
            self._note(f"all but one of the transforms of {named(str(node.GetPath()))} left out")
        if not transforms:
            return Placing(name)
        last = transforms[-1]
        scale, offset = self.value(last, "scale", (1, 1)), self.value(last, "translation", (0, 0))
        angle = float(self.value(last, "rotation", 0))
        return Placing(name, (float(scale[0]), float(scale[1])), angle, (float(offset[0]), float(offset[1])))

    def _bytes(self, path: str, name: str) -> bytes | None:
        """Return the bytes of a picture, or None, after a note. It may lie within a package, such as a .usdz file."""
        if path not in self._files:
            self._files[path] = None
            try:
                data = _packed(path) if path.endswith("]") else self._companions.get(path or name)
                check_picture(data)
                self._files[path] = data
            except FileNotFoundError:
                lost = self._companions.lost[path or name]
                many = "; one of many tiles (UDIM) is not read" if "<UDIM>" in name else ""
                self._note(f"texture {named(name)} left out: {lost}{many}")
            except ValueError as error:
                self._note(f"texture {named(name)} left out: {error}")
        return self._files[path]


def _packed(path: str) -> bytes:
    """Return the bytes of a file within a package. Raises ValueError if there is none."""
    from pxr import Ar

    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise ValueError("the package lacks it")
    return bytes(asset.GetBuffer())


def _producer(shader: Any, name: str) -> Any:
    """Return the attribute that an input of a shader takes its value from, or None."""
    given = shader.GetInput(name)
    found = given.GetValueProducingAttributes() if given else []
    return found[0] if found else None


class _Inputs:
    """The inputs of one shader."""

    def __init__(self, materials: Materials, shader: Any) -> None:
        self._materials, self._shader = materials, shader

    def fed(self, name: str) -> Any:
        return self._materials.fed(self._shader, name)

    def note(self, text: str) -> None:
        self._materials._note(text)


class _Surface:
    """One UsdPreviewSurface, as it becomes a look."""

    def __init__(self, shader: Any, name: str, inputs: _Inputs) -> None:
        self._name, self._inputs = name, inputs
        self._fed = {
            each: inputs.fed(each)
            for each in (
                "diffuseColor opacity opacityThreshold metallic roughness emissiveColor normal occlusion "
                "useSpecularWorkflow clearcoat displacement".split()
            )
        }
        self._placings: list[Placing] = []

    def look(self) -> Look:
        """Return the look. Glass is what opacity says."""
        color, alpha = self._fed["diffuseColor"], self._fed["opacity"]
        base, rgb = self._base(color, alpha)
        colors = color.removeprefix("primvar ") if isinstance(color, str) else None
        opacity = float(np.clip(alpha, 0, 1)) if isinstance(alpha, (int, float)) else 1.0
        threshold = self._number("opacityThreshold", 0.0)
        mode: AlphaMode = "OPAQUE"
        if isinstance(alpha, _Source) and base is not None:
            mode, opacity = ("MASK" if threshold > 0 else "BLEND"), 1.0
        elif threshold > 0:
            opacity = 1.0 if opacity >= threshold else 0.0
        material = Material(
            self._name,
            (float(rgb[0]), float(rgb[1]), float(rgb[2]), 1.0),
            base,
            mode,
            max(threshold, 0.0),
            opacity,
            rgb_of_scene=colors is not None,
            alpha_of_scene=False,
            finish=self._finish(),
        )
        self._note_losses(alpha)
        return Look(material, tuple(self._placings), colors)

    def _note_losses(self, alpha: Any) -> None:
        """Note what is not drawn of the inputs."""
        others = [name for name in _OTHERS if isinstance(self._fed[name], _Source) or self._number(name, 0.0) > 0]
        if self._number("useSpecularWorkflow", 0.0):
            others.append("specularColor")
        if isinstance(alpha, str):
            others.append("opacity by a primvar")
        if others:
            self._inputs.note(f"{listed(others)} of material {named(self._name)} left out")

    def _number(self, name: str, default: float) -> float:
        """Return the number of an input, or the default if it has none or a texture."""
        value = self._fed[name]
        return float(value) if isinstance(value, (int, float)) else default

    def _rgb(self, name: str, default: float) -> AnyArray:
        """Return the colour of an input, linear, or the default if it has none."""
        value = self._fed[name]
        plain = value is None or isinstance(value, (str, _Source))
        return np.full(3, default) if plain else np.clip(np.nan_to_num(np.array(value, np.float64)), 0, None)

    # --- base colour --------------------------------------------------------------------------------------------------

    def _base(self, color: Any, alpha: Any) -> tuple[Texture | None, AnyArray]:
        """Return the texture of diffuseColor and opacity, or None without any, and the colour, linear, 0..1."""
        rgb = np.clip(self._rgb("diffuseColor", 0.18), 0, 1)
        if isinstance(color, str):
            rgb = np.ones(3)
        sources = [each if isinstance(each, _Source) else None for each in (color, alpha)]
        shown, mask = sources
        lies = shown or mask
        if lies is None:
            return None, rgb
        image = None if shown is None else self._color_image(shown)
        if shown is not None and image is not None:
            rgb = np.clip(shown.scale[:3], 0, 1) if not shown.bias[:3].any() else np.ones(3)
        if mask is not None:
            if shown is not None and (shown.placing, shown.wrap) != (mask.placing, mask.wrap):
                self._inputs.note(
                    f"how the opacity of material {named(self._name)} lies is left out: as its colour does"
                )
            numbers = self._channel(mask)
            image = image if numbers is None else with_opacities(image, _grey(numbers))
        if image is None:
            return None, rgb
        self._slot(lies.placing)
        return Texture(image, lies.wrap), rgb

    def _color_image(self, source: _Source) -> AnyArray | None:
        """Return the texels of a colour, with alpha 1, or None, after a note."""
        image = self._texels(source, source.encoded is not False)
        if image is None:
            return None
        image = image.copy()
        if source.encoded is False and image.dtype == np.uint8:
            image = (image / 255).astype(np.float32)
        if len(source.channel) == 1:
            image[..., :3] = image[..., _CHANNELS[source.channel]][..., None]
        image[..., 3] = 255 if image.dtype == np.uint8 else 1
        if source.bias[:3].any():
            lights = linear(image[..., :3] / 255) if image.dtype == np.uint8 else image[..., :3]
            image = np.ones(image.shape, np.float32)
            image[..., :3] = np.clip(lights * source.scale[:3] + source.bias[:3], 0, 1)
        return image

    def _texels(self, source: _Source, colors: bool) -> AnyArray | None:
        """Return the texels of a source's picture, or None, after a note."""
        try:
            return texels(source.data, colors)
        except ValueError as error:
            self._inputs.note(f"texture {named(source.file)} left out: {error}")
            return None

    def _channel(self, source: _Source) -> AnyArray | None:
        """Return the numbers of a source's channel, 0..1, [height, width], or None, after a note."""
        image = self._texels(source, False)
        return None if image is None else _numbers(image, source)

    def _slot(self, placing: Placing) -> int:
        """Return the number of the texture coordinates that lie like this."""
        if placing not in self._placings:
            self._placings.append(placing)
        return self._placings.index(placing)

    # --- lights -------------------------------------------------------------------------------------------------------

    def _finish(self) -> Finish:
        """Return how the surface takes light, with its textures."""
        metallic, rough = self._fed["metallic"], self._fed["roughness"]
        emissive = self._fed["emissiveColor"]
        light = emissive.scale[:3] if isinstance(emissive, _Source) else self._rgb("emissiveColor", 0.0)
        finish = Finish(
            float(np.clip(self._number("metallic", 0.0), 0, 1)),
            float(np.clip(self._number("roughness", 0.5), 0, 1)),
            (float(light[0]), float(light[1]), float(light[2])),
        )
        packed = [each if isinstance(each, _Source) else None for each in (None, rough, metallic)]
        if any(packed):
            lies = next(each for each in packed if each is not None)
            image = LateImage(partial(_packed_image, [None, *packed[1:]], (1.0, finish.roughness, finish.metallic)))
            finish = replace(
                finish,
                metallic=1.0,
                roughness=1.0,
                metallic_roughness_texture=Texture(image, lies.wrap),
                metallic_roughness_uv=self._slot(lies.placing),
            )
        if isinstance(emissive, _Source):
            late = LateImage(partial(texels, emissive.data, True))
            finish = replace(
                finish, emissive_texture=Texture(late, emissive.wrap), emissive_uv=self._slot(emissive.placing)
            )
        normal = self._fed["normal"]
        if isinstance(normal, _Source):
            late = LateImage(partial(texels, normal.data, False))
            finish = replace(finish, normal_texture=Texture(late, normal.wrap), normal_uv=self._slot(normal.placing))
        shade = self._fed["occlusion"]
        if isinstance(shade, _Source):
            late = LateImage(partial(_packed_image, [shade, None, None], (1.0, 1.0, 1.0)))
            finish = replace(
                finish, occlusion_texture=Texture(late, shade.wrap), occlusion_uv=self._slot(shade.placing)
            )
        return finish


def _numbers(image: AnyArray, source: _Source) -> AnyArray:
    """Return a channel of texels as numbers, 0..1, float64 [height, width], with a source's scale and bias."""
    one = 255 if image.dtype == np.uint8 else 1
    channel = _CHANNELS.get(source.channel, 0)
    return np.clip(image[..., channel] / one * source.scale[channel] + source.bias[channel], 0, 1)


def _grey(numbers: AnyArray) -> AnyArray:
    """Return numbers as the alphas of a white image, uint8 [height, width, 4]."""
    image = np.full((*numbers.shape, 4), 255, np.uint8)
    image[..., 3] = np.rint(numbers * 255)
    return image


def _packed_image(sources: list[_Source | None], else_: tuple[float, float, float]) -> AnyArray:
    """Return an image whose red, green and blue are channels of several, or a number where there is none.

    Raises ValueError if one cannot be decoded.
    """
    planes = [None if each is None else _numbers(texels(each.data, False), each) for each in sources]
    there = [plane.shape for plane in planes if plane is not None]
    height, width = max(shape[0] for shape in there), max(shape[1] for shape in there)
    image = np.ones((height, width, 4), np.float32)
    for channel, (plane, number) in enumerate(zip(planes, else_, strict=True)):
        image[..., channel] = number if plane is None else fitted(plane, width, height)
    return image
