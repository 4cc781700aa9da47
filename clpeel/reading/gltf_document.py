"""A glTF file's JSON: its parts by their index, checked, and what of it is not read."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named

Json = dict[str, Any]
"""A JSON object. Its contents are checked where they are read."""

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
GLOSS = "KHR_materials_pbrSpecularGlossiness"
UNLIT = "KHR_materials_unlit"
TRANSMISSION = "KHR_materials_transmission"
STRENGTH = "KHR_materials_emissive_strength"
TRANSFORM = "KHR_texture_transform"
LIGHTS = "KHR_lights_punctual"
INSTANCING = "EXT_mesh_gpu_instancing"
BASISU, WEBP = "KHR_texture_basisu", "EXT_texture_webp"

_MATERIALS = {GLOSS, UNLIT, TRANSMISSION, STRENGTH}
_READ = {DRACO, *MESHOPT, *_MATERIALS, TRANSFORM, LIGHTS, INSTANCING, BASISU, WEBP, "KHR_mesh_quantization"}
_UNSEEN = {"KHR_xmp", "KHR_xmp_json_ld"}
"""Extensions that do not show in a picture."""

_APPEARANCE = ("KHR_materials_", "EXT_materials_", "KHR_lights_", "EXT_lights_")
"""How names of extensions begin that change the appearance only, never the shape."""

_APPEARANCES = {"EXT_texture_avif", "MSFT_texture_dds", "KHR_animation_pointer"}


class Document:
    """The JSON of a glTF file, its binary chunk and its companions. notes: what the picture will lack, one line each.

    Raises InputError if the file is cut, is no glTF 2, or requires an extension that is not read.
    """

    def __init__(self, data: bytes, extension: str, companions: Companions) -> None:
        text, self.binary = _chunks(data) if extension == "glb" else (data, None)
        self.tree = _tree(text)
        self.companions = companions
        self.notes: list[str] = []
        self._entries: dict[str, list[Json]] = {}
        self._check_extensions()

    def note(self, text: str) -> None:
        """Keep a note of what the picture will lack, once."""
        if text not in self.notes:
            self.notes.append(text)

    def entries(self, kind: str) -> list[Json]:
        """Return the objects of one kind, such as "nodes"; none if the file has none. Raises InputError."""
        if kind not in self._entries:
            self._entries[kind] = objects(self.tree, kind)
        return self._entries[kind]

    def entry(self, kind: str, index: object) -> Json:
        """Return one of the objects of one kind, or raise InputError."""
        held = self.entries(kind)
        return held[place(kind, index, len(held))]

    def _check_extensions(self) -> None:
        """Note the extensions that are ignored. Raises InputError if the file requires one that changes the shape."""
        required, used = ([*map(str, items(self.tree, f"extensions{how}"))] for how in ("Required", "Used"))
        known = _READ | _UNSEEN
        for name in required:
            if name not in known | _APPEARANCES and not name.startswith(_APPEARANCE):
                raise InputError(f"the file requires the glTF extension {named(name)}, which is not read")
        lacking = sorted({*required, *used} - known)
        if lacking:
            shown = ", ".join(name if name.isidentifier() else named(name) for name in lacking[:20])
            more = f" and {len(lacking) - 20} more" if len(lacking) > 20 else ""
            self.note(f"glTF extensions left out: {shown}{more}")


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON of a .glb file and its binary chunk.

    Raises InputError if the file is cut or of another version.
    """
    if len(data) < 20:
        raise InputError(f"the file is cut: expected 20 bytes or more, got {len(data)}")
    version, length = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
    if version != 2:
        raise InputError(f"expected glTF 2, got version {version}; convert it to glTF 2")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= min(length, len(data)):
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > len(data):
            raise InputError(f"the file is cut: expected a chunk of {size:,} bytes, got {len(data) - at - 8:,}")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in found:
        raise InputError(
            "not a readable mesh: expected a chunk of JSON in the .glb file, got none; the file is damaged"
        )
    return found[b"JSON"], found.get(b"BIN\0")


def _tree(text: bytes) -> Json:
    """Return the JSON object of a glTF 2 file, or raise InputError."""
    try:
        tree = json.loads(text.decode("utf-8-sig", "replace"), parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"not a readable mesh: expected JSON, got what is not: {error}") from None
    if not isinstance(tree, dict):
        raise InputError("not a readable mesh: expected a JSON object { }, got another value")
    asset = tree.get("asset", {})
    version = str(asset.get("version", "2.0") if isinstance(asset, dict) else asset)
    if version.split(".")[0] != "2":
        raise InputError(f"expected glTF 2, got version {named(version)}; convert it to glTF 2")
    return tree


def _no_number(name: str) -> NoReturn:
    raise InputError(f"not a readable mesh: expected JSON, got what is not: {name}")


# --- values of JSON ---------------------------------------------------------------------------------------------------


def damaged(what: str) -> NoReturn:
    """Raise the InputError of a file that breaks the format."""
    raise InputError(f"the file is damaged: {what}")


def place(kind: str, index: object, count: int) -> int:
    """Return an index into so many objects of one kind, or raise InputError."""
    if type(index) is not int or not 0 <= index < count:
        damaged(
            f"{kind}: expected an index 0..{count - 1}, got {_shown(index)}" if count else f"{kind}: there are none"
        )
    return index


def whole(name: str, value: object, least: int = 0) -> int:
    """Return a whole number of at least `least`, or raise InputError."""
    if type(value) is not int or value < least:
        damaged(f"{name}: expected a whole number of {least} or more, got {_shown(value)}")
    return value


def numbers(name: str, value: object, count: int) -> list[float]:
    """Return so many finite numbers, or raise InputError."""
    if not isinstance(value, list) or len(value) != count:
        damaged(f"{name}: expected {count} numbers, got {_shown(value)}")
    return [number(name, each) for each in value]


def number(name: str, value: object) -> float:
    """Return a finite number, or raise InputError."""
    if not isinstance(value, (int, float)) or isinstance(value, bool) or abs(value) > 1e300 or not math.isfinite(value):
        damaged(f"{name}: expected a finite number, got {_shown(value)}")
    return float(value)


def unit_numbers(name: str, value: object, count: int) -> tuple[float, ...]:
    """Return so many numbers held to 0..1, or raise InputError."""
    return tuple(min(max(each, 0.0), 1.0) for each in numbers(name, value, count))


def fields(holder: Json, name: str) -> Json:
    """Return the object that an object has under a name; an empty one if it has none. Raises InputError."""
    held = holder.get(name)
    if held is not None and not isinstance(held, dict):
        damaged(f"{name}: expected an object, got {_shown(held)}")
    return held or {}


def items(holder: Json, name: str) -> list[Any]:
    """Return the list that an object has under a name; an empty one if it has none. Raises InputError."""
    held = holder.get(name)
    if held is not None and not isinstance(held, list):
        damaged(f"{name}: expected a list, got {_shown(held)}")
    return held or []


def objects(holder: Json, name: str) -> list[Json]:
    """Return the list of objects that an object has under a name; an empty one if it has none. Raises InputError."""
    held = items(holder, name)
    if not all(isinstance(each, dict) for each in held):
        damaged(f"{name}: expected a list of objects, got other values")
    return held


def extension(holder: Json, name: str) -> Json | None:
    """Return what an object has of an extension, or None. Raises InputError if that is no object."""
    held = fields(holder, "extensions")
    return fields(held, name) if held.get(name) is not None else None


def title(holder: Json, index: int) -> str:
    """Return an object's name, or its index where it has none, for a note or an error."""
    return named(str(holder.get("name") or index))


def _shown(value: object) -> str:
    return named(str(value))
