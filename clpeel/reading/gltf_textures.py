"""Textures of a glTF file: images of base colours are decoded at once, several side by side, and those of lights late.

Each is decoded once, and only if a drawn face uses it.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import named
from clpeel.reading.gltf_accessors import Accessors
from clpeel.reading.gltf_document import BASISU, WEBP, extension
from clpeel.reading.images import check_picture, texels
from clpeel.scene.arrays import AnyArray
from clpeel.scene.images import LateImage
from clpeel.scene.textures import Magnify, Minify, Texture, Wrap

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_MAGNIFY: dict[int, Magnify] = {9728: "nearest", 9729: "linear"}
_MINIFY: dict[int, Minify] = {
    9728: "nearest",
    9729: "linear",
    9984: "nearest-mipmap-nearest",
    9985: "linear-mipmap-nearest",
    9986: "nearest-mipmap-linear",
    9987: "linear-mipmap-linear",
}
"""The numbers are those of OpenGL (glTF 2.0, section 5.26)."""

_Sources = tuple[int, ...]
"""The images that a texture may have, the best one first: files may hold one of an extension, and a plain one."""


_Image = AnyArray | LateImage

_Held = tuple[str, bytes | str]
"""An image's name for notes, and its bytes, or the reason why there are none."""

_Reasons = list[tuple[str, str]]
"""For each image that is not read, its name and why."""


class Textures:
    """The textures of a document. Say which are wanted, have them decoded, then take them. Late ones need no asking."""

    def __init__(self, accessors: Accessors) -> None:
        self.document, self._accessors = accessors.document, accessors
        self._images: dict[_Sources, AnyArray | None] = {}
        self._late: dict[tuple[_Sources, bool], _Image | None] = {}
        self._made: dict[tuple[int, object], Texture] = {}

    def want(self, index: Any) -> None:
        """Ask for a texture. Raises InputError if there is none with this index."""
        self._images[self._sources(index)] = None

    def decode(self) -> None:
        """Decode the images of all textures that are wanted, with notes of those that cannot be."""
        held = {sources: [self._bytes(source) for source in sources] for sources in self._images}
        with ThreadPoolExecutor() as pool:
            for sources, (image, reasons) in zip(held, pool.map(_decoded, held.values()), strict=True):
                self._images[sources] = image
                self._note(reasons)

    def get(self, index: Any) -> Texture | None:
        """Return a texture that was decoded, or None if its image could not be."""
        return self._sampled(self._images[self._sources(index)], index)

    def late(self, index: Any, colors: bool) -> Texture | None:
        """Return a texture whose image is decoded when it is first asked for, or None, with a note, if it is missing.

        colors: whether its texels are colours, or numbers. Raises InputError if the file breaks the format.
        """
        sources = self._sources(index)
        if (sources, colors) not in self._late:
            self._late[sources, colors] = self._late_image(sources, colors)
        return self._sampled(self._late[sources, colors], index)

    def _late_image(self, sources: _Sources, colors: bool) -> _Image | None:
        """Return the image of a texture for lights, or None, with a note, if none of its images can be read.

        It keeps the bytes of a file beside the glTF file, too, as that one may be gone, or be another one, later.
        """
        if sources in self._images:
            image = self._images[sources]
            if image is None or colors or image.dtype == np.uint8:
                return image
        held = [self._bytes(source) for source in sources]
        found, reasons = list[_Held](), _Reasons()
        for name, data in held:
            try:
                check_picture(_whole(data))
                found.append((name, data))
            except ValueError as error:
                reasons.append((name, str(error)))
        if not found:
            self._note(reasons)
            return None
        return LateImage(partial(_decoded_late, found, colors))

    def _note(self, reasons: _Reasons) -> None:
        """Note why the images of a texture are not read."""
        for name, reason in reasons:
            self.document.note(f"texture {name} left out: {reason}")

    def _sources(self, index: Any) -> _Sources:
        """Return the images that a texture may have, with a note if there are none. Raises InputError."""
        texture = self.document.entry("textures", index)
        own = [(extension(texture, name) or {}).get("source") for name in (WEBP, BASISU)]
        found = [source for source in (*own, texture.get("source")) if source is not None]
        for source in found:
            self.document.entry("images", source)
        if not found:
            self.document.note(f"texture {index} left out: it has no image of a kind that is read")
        return tuple(dict.fromkeys(found))

    def _bytes(self, source: int) -> _Held:
        """Return an image's name and bytes. Raises InputError if they lie beyond the file's end."""
        image = self.document.entry("images", source)
        uri = str(image.get("uri", ""))
        shown = str(image.get("name") or (uri if uri and not uri.startswith("data:") else f"image {source}"))
        if "bufferView" in image:
            return named(shown), bytes(self._accessors.view(image["bufferView"]))
        try:
            return named(shown), self.document.companions.get(uri)
        except FileNotFoundError:
            return named(shown), self.document.companions.lost[uri]

    def _sampled(self, image: _Image | None, index: Any) -> Texture | None:
        """Return an image as the texture with this index samples it, or None if there is no image.

        Notes the values that are not known. Raises InputError if there is no such sampler.
        """
        sampler = self.document.entry("textures", index).get("sampler")
        held = {} if sampler is None else self.document.entry("samplers", sampler)
        if image is None:
            return None

        def word(name: str, words: dict[int, Any], default: Any) -> Any:
            value = held.get(name)
            if isinstance(value, int) and value in words:
                return words[value]
            if value is not None:
                self.document.note(f"{name} {named(str(value))} of sampler {sampler} left out: it is not known")
            return default

        key = (id(image), sampler)
        if key not in self._made:
            self._made[key] = Texture(
                image,
                (word("wrapS", _WRAPS, "repeat"), word("wrapT", _WRAPS, "repeat")),
                word("magFilter", _MAGNIFY, "linear"),
                word("minFilter", _MINIFY, "linear-mipmap-linear"),
            )
        return self._made[key]


def _decoded(images: list[_Held], colors: bool = True) -> tuple[AnyArray | None, _Reasons]:
    """Return the texels of the first image that can be decoded, or None and reasons why none of them can be."""
    reasons = _Reasons()
    for name, data in images:
        try:
            return texels(_whole(data), colors), []
        except ValueError as error:
            reasons.append((name, str(error)))
    return None, reasons


def _decoded_late(images: list[_Held], colors: bool) -> AnyArray:
    """Return the texels of the first image that can be decoded. Raises InputError if none of them can be."""
    image, reasons = _decoded(images, colors)
    if image is None:
        told = "; ".join(f"texture {name} cannot be decoded: {reason}" for name, reason in reasons)
        raise InputError(f"{told}; save it again, and load the mesh again")
    return image


def _whole(data: bytes | str) -> bytes:
    """Return the bytes of an image, or raise ValueError with the reason why there are none."""
    if isinstance(data, str):
        raise ValueError(data)
    return data
