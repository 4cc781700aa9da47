"""Textures of a glTF file: images are decoded once, several side by side, and only those that a drawn face uses."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

from clpeel.reading.companions import named
from clpeel.reading.gltf_accessors import Accessors
from clpeel.reading.gltf_document import BASISU, WEBP, Json, extension
from clpeel.reading.images import texels
from clpeel.scene.arrays import AnyArray
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


class Textures:
    """The textures of a document. Say which are wanted, have them decoded, then take them."""

    def __init__(self, accessors: Accessors) -> None:
        self.document, self._accessors = accessors.document, accessors
        self._images: dict[_Sources, AnyArray | None] = {}
        self._made: dict[tuple[_Sources, object], Texture] = {}

    def want(self, index: Any) -> None:
        """Ask for a texture. Raises InputError if there is none with this index."""
        sources = self._sources(self.document.entry("textures", index))
        if not sources:
            self.document.note(f"texture {index} left out: it has no image of a kind that is read")
        self._images[sources] = None

    def decode(self) -> None:
        """Decode the images of all textures that are wanted, with notes of those that cannot be."""
        held = {sources: [self._bytes(source) for source in sources] for sources in self._images}
        with ThreadPoolExecutor() as pool:
            for sources, (image, notes) in zip(held, pool.map(_decoded, held.values()), strict=True):
                self._images[sources] = image
                for note in notes:
                    self.document.note(note)

    def get(self, index: Any) -> Texture | None:
        """Return a texture that was decoded, or None if its image could not be."""
        texture = self.document.entry("textures", index)
        sources, sampler = self._sources(texture), texture.get("sampler")
        if sampler is not None:
            self.document.entry("samplers", sampler)
        image = self._images[sources]
        if image is None:
            return None
        if (sources, sampler) not in self._made:
            self._made[sources, sampler] = self._sampled(image, sampler)
        return self._made[sources, sampler]

    def _sources(self, texture: Json) -> _Sources:
        """Return the images that a texture may have. Raises InputError if there is none with such an index."""
        own = [(extension(texture, name) or {}).get("source") for name in (WEBP, BASISU)]
        found = [source for source in (*own, texture.get("source")) if source is not None]
        for source in found:
            self.document.entry("images", source)
        return tuple(dict.fromkeys(found))

    def _bytes(self, source: int) -> tuple[str, bytes | str]:
        """Return an image's name for notes, and its bytes, or the reason why there are none."""
        image = self.document.entry("images", source)
        uri = str(image.get("uri", ""))
        shown = str(image.get("name") or (uri if uri and not uri.startswith("data:") else f"image {source}"))
        if "bufferView" in image:
            return named(shown), bytes(self._accessors.view(image["bufferView"]))
        try:
            return named(shown), self.document.companions.get(uri)
        except FileNotFoundError:
            return named(shown), self.document.companions.lost[uri]

    def _sampled(self, image: AnyArray, sampler: Any) -> Texture:
        """Return a texture with a sampler's filters. Notes the values that are not known."""
        held = {} if sampler is None else self.document.entry("samplers", sampler)

        def word(name: str, words: dict[int, Any], default: Any) -> Any:
            value = held.get(name)
            if isinstance(value, int) and value in words:
                return words[value]
            if value is not None:
                self.document.note(f"{name} {named(str(value))} of sampler {sampler} left out: it is not known")
            return default

        return Texture(
            image,
            (word("wrapS", _WRAPS, "repeat"), word("wrapT", _WRAPS, "repeat")),
            word("magFilter", _MAGNIFY, "linear"),
            word("minFilter", _MINIFY, "linear-mipmap-linear"),
        )


def _decoded(images: list[tuple[str, bytes | str]]) -> tuple[AnyArray | None, list[str]]:
    """Return the texels of the first image that can be decoded, or None and notes why none of them can be."""
    notes = []
    for name, data in images:
        try:
            if isinstance(data, str):
                raise ValueError(data)
            return texels(data), []
        except ValueError as error:
            notes.append(f"texture {name} left out: {error}")
    return None, notes
