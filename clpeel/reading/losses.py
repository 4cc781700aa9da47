"""Losses: finds what a mesh file holds that its picture will lack, one note each, without reading the mesh itself."""

from __future__ import annotations

import io
import logging
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named


def found(extension: str, data: bytes, companions: Companions) -> list[str]:
    """Return notes of what a file with this extension holds and the picture lacks."""
    return _SCANS[extension](data, companions) if extension in _SCANS else []


def listed(words: Iterable[str], most: int = 5) -> str:
    """Return the words, each once. Beyond the first `most`, only their count is given."""
    words = list(dict.fromkeys(words))
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


# --- the reader's log and the files it could not have -----------------------------------------------------------------

_TELLS = re.compile(
    r"fail|unable|skip|unsupported|not loaded|didn't|could not|missing|no materials|weird", re.IGNORECASE
)
_TOLD = re.compile(
    r"specified material|textures are unsupported|unable to store texture|slow fallback|face_normals|^loaded "
)
"""Log messages that need no note: either a scan has already reported the loss by name, or nothing is lost."""


def logged(records: Iterable[logging.LogRecord], told: bool) -> list[str]:
    """Return notes of the log records that report a loss. told: the scans have already examined materials and textures.

    Raises InputError if the reader says that it invented the numbers.
    """
    counts = Counter[str]()
    for record in records:
        text = " ".join(record.getMessage().split())
        if "placeholder zeros" in text:
            raise InputError(f"not a readable mesh: {text}")
        cause = record.exc_info[1] if record.exc_info else None
        lost = isinstance(cause, FileNotFoundError) or (told and re.search(r"(image|materials)\b", text) and not cause)
        image = told and "image" in text
        if lost or image or _TOLD.search(text) or not (record.levelno >= logging.WARNING or _TELLS.search(text)):
            continue
        why = f" ({type(cause).__name__})" if cause else ""
        counts[f"the reader reports: {text[:160]}{why}"] += 1
    return [f"{text}, {count} times" if count > 1 else text for text, count in counts.items()]


def missing(companions: Companions, notes: Iterable[str]) -> list[str]:
    """Return a note for each file that could not be read, unless another note already names it."""
    said = "\n".join(notes)
    lost = companions.lost.items()
    return [f"file {named(name)} left out: {reason}" for name, reason in lost if named(name) not in said]


# --- 3MF --------------------------------------------------------------------------------------------------------------

_MODEL_PARTS = re.compile(
    rb"<(?:\w+:)?(basematerials|colorgroup|texture2dgroup|compositematerials|multiproperties|beamlattice)\b"
)
_COMPONENT = re.compile(rb"<(?:\w+:)?component\b[^<>]*>")
_WORDS = {
    "basematerials": "base materials",
    "colorgroup": "colour groups",
    "texture2dgroup": "textures",
    "compositematerials": "composite materials",
    "multiproperties": "multi-properties",
    "beamlattice": "beam lattices",
}
_MOST_XML = 2**30
"""The most bytes of models that are searched."""


def _3mf(data: bytes, _: Companions) -> list[str]:
    """Return the notes of a 3MF package: its colours, and the components in other files that trimesh places wrongly.

    Raises InputError if the archive holds no 3D/3dmodel.model.
    """
    kinds, parts, local, holds = Counter[str](), list[tuple[str, str]](), set[str](), dict[str, int]()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        left = _MOST_XML
        for info in archive.infolist():
            left -= info.file_size
            if not info.filename.lower().endswith(".model") or left < 0:
                continue
            xml = archive.read(info)
            kinds.update(match[1].decode() for match in _MODEL_PARTS.finditer(xml))
            name, main = info.filename.strip("/"), "3d/3dmodel.model" in info.filename.lower()
            holds[name] = len(re.findall(rb"<(?:\w+:)?mesh[\s>]", xml))
            inside = [_component(match[0]) for match in _COMPONENT.finditer(xml)]
            if main:
                parts = [(path, index) for path, index in inside if path]
                local = {m.decode() for m in re.findall(rb"<(?:\w+:)?object\b[^<>]*?\bid\s*=\s*[\"']([^\"']*)", xml)}
            elif inside:
                kinds["nested"] += len(inside)
    if not any("3d/3dmodel.model" in name.lower() for name in holds):
        raise InputError(
            "not a readable mesh: expected a 3MF package with 3D/3dmodel.model in it, got another zip archive"
        )
    notes = []
    colors = [words for kind, words in _WORDS.items() if kind in kinds]
    if colors:
        notes.append(f"colours and properties of the 3MF file left out: {', '.join(colors)}")
    files = Counter(index for _, index in set(parts))
    wrong = [
        (path, index)
        for path, index in parts
        if files[index] > 1 or index in local or holds.get(path, 0) != 1 or parts.count((path, index)) > 1
    ]
    if wrong:
        shown = listed(named(path) for path, _ in wrong)
        notes.append(f"components in other files of the 3MF package may be drawn wrongly, in place or number: {shown}")
    if kinds["nested"]:
        notes.append(f"{kinds['nested']} component(s) of components in other files of the 3MF package left out")
    return notes


def _component(tag: bytes) -> tuple[str, str]:
    """Return the path (empty if there is none) and the object's id in a 3MF component's tag."""
    values = {m[1].rpartition(b":")[2]: m[2].decode("utf-8", "replace") for m in _ATTRIBUTE.finditer(tag)}
    return values.get(b"path", "").strip("/"), values.get(b"objectid", "")


_ATTRIBUTE = re.compile(rb"([\w:]+)\s*=\s*[\"']([^\"']*)[\"']")

_SCANS: dict[str, Callable[[bytes, Companions], list[str]]] = {"3mf": _3mf}
