"""Losses: finds what a mesh file holds that its picture will lack, one note each, without reading the mesh itself."""

from __future__ import annotations

import io
import logging
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named


def found(extension: str, data: bytes, companions: Companions) -> list[str]:
    """Return notes of what a file with this extension holds and the picture lacks.

    Also prepares an OBJ's material files.
    """
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
        short = re.match(r"face needs more values", text)
        lost = isinstance(cause, FileNotFoundError) or (told and re.search(r"(image|materials)\b", text) and not cause)
        image = told and "image" in text
        if short:
            counts["face of fewer than 3 corners left out"] += 1
        elif lost or image or _TOLD.search(text) or not (record.levelno >= logging.WARNING or _TELLS.search(text)):
            continue
        else:
            why = f" ({type(cause).__name__})" if cause else ""
            counts[f"the reader reports: {text[:160]}{why}"] += 1
    return [f"{text}, {count} times" if count > 1 else text for text, count in counts.items()]


def missing(companions: Companions, notes: Iterable[str]) -> list[str]:
    """Return a note for each file that could not be read, unless another note already names it."""
    said = "\n".join(notes)
    lost = companions.lost.items()
    return [f"file {named(name)} left out: {reason}" for name, reason in lost if named(name) not in said]


# --- OBJ --------------------------------------------------------------------------------------------------------------

_OBJ_WORDS = (b"mtllib", b"usemtl", b"curv", b"curv2", b"surf", b"call", b"csh", b"bzp", b"bsp", b"cdc", b"cdp")
_OBJ_PARTS = re.compile(rb"^[ \t]*([lp])[ \t]+[-\d]", re.MULTILINE)
_MAPS = re.compile(r"(map_\w+|bump|disp|decal|refl|norm)$", re.IGNORECASE)


def _obj(data: bytes, companions: Companions) -> list[str]:
    """Return the notes of an OBJ file.

    Its material files are joined under the first one's name, where trimesh looks.
    """
    words = [found for word in _OBJ_WORDS for found in _statements(data, word)]
    libraries = [value for word, value in words if word == "mtllib"]
    used = list(dict.fromkeys(value for word, value in words if word == "usemtl"))
    notes, texts = list[str](), list[bytes]()
    for library in dict.fromkeys(libraries):
        parts, lost = _library(library, companions)
        texts += parts
        notes += [f"material file {named(name)} left out: {companions.lost[name]}" for name in lost]
    if texts:
        companions.given[libraries[0]] = b"\n".join(texts)
    materials = _materials(b"\n".join(texts).decode("utf-8", "replace"))
    unknown = [named(name) for name in used if name not in materials]
    if unknown and (texts or not libraries):
        where = "the material files lack them" if libraries else "the file names no material file"
        notes.append(f"materials left out: {listed(unknown)}; {where}")
    kinds = list[str]()
    for material in (materials[name] for name in used if name in materials):
        for key, value in material.items():
            if key == "map_kd":
                problem = companions.picture(value)
                if problem:
                    notes.append(f"texture {named(value)} left out: {problem}")
            elif _MAPS.match(key):
                kinds.append(key)
    if kinds:
        notes.append(f"textures left out, as only map_Kd is drawn: {listed(kinds, 9)}")
    shapes = Counter(word for word, _ in words if word not in ("mtllib", "usemtl"))
    if shapes:
        notes.append("curves and surfaces left out: " + ", ".join(f"{count} {word}" for word, count in shapes.items()))
    # Ten times as fast as the regular expression.
    likely = any(begin in data for begin in (b"\nl", b"\np", b"\n ", b"\n\t"))
    lines = _OBJ_PARTS.finditer(data) if likely else ()
    parts_left = Counter({b"l": "line(s)", b"p": "point(s)"}[m[1]] for m in lines)
    if parts_left:
        notes.append("left out, not triangles: " + ", ".join(f"{count} {word}" for word, count in parts_left.items()))
    return list(dict.fromkeys(notes))


def _statements(data: bytes, word: bytes) -> Iterator[tuple[str, str]]:
    """Yield the lines of an OBJ file that begin with the word: the word, then the rest of the line.

    The file may be large and has few such lines, so this searches for the word instead of splitting the file into
    lines.
    """
    at = -1
    while (at := data.find(word, at + 1)) >= 0:
        begin, after = data.rfind(b"\n", 0, at) + 1, data[at + len(word) : at + len(word) + 1]
        if after in (b" ", b"\t") and not data[begin:at].strip():
            end = data.find(b"\n", at)
            rest = data[at + len(word) : end if end >= 0 else None]
            yield word.decode(), rest.decode("utf-8", "replace").strip()


def _library(line: str, companions: Companions) -> tuple[list[bytes], list[str]]:
    """Return the material files that an mtllib line names, and the names without a file.

    The line may be one name with spaces, or several names without spaces.
    """
    try:
        return [companions.get(line)], []
    except FileNotFoundError:
        names = line.split()
    if len(names) < 2 or line.startswith('"'):
        return [], [line]
    texts, lost = list[bytes](), list[str]()
    for name in names:
        try:
            texts.append(companions.get(name))
        except FileNotFoundError:
            lost.append(name)
    if not texts:
        return [], [line]
    companions.lost.pop(line, None)
    return texts, lost


def _materials(text: str) -> dict[str, dict[str, str]]:
    """Return the statements of each material. The keywords are in lower case."""
    materials: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for line in text.splitlines():
        key, _, value = line.strip().replace("\t", " ").partition(" ")
        if key.lower() == "newmtl":
            current = materials.setdefault(" ".join(value.split()), {})
        elif value and not key.startswith("#"):
            current[key.lower()] = value.strip()
    return materials


# --- PLY, OFF and 3MF -------------------------------------------------------------------------------------------------


def _ply(data: bytes, companions: Companions) -> list[str]:
    """Return the notes of a PLY file's header: its textures, and face colours that vertex colours replace."""
    header = data[: max(data.find(b"end_header"), 0)].decode("utf-8", "replace")
    names = re.findall(r"(?im)^[ \t]*(?:comment|obj_info)[ \t]+texturefile[ \t]+([^\r\n]*?)[ \t]*$", header)
    notes = [f"texture {named(name)} left out: only the last of several is drawn" for name in names[:-1]]
    colored = [part.split()[0] for part in header.split("element ")[1:] if re.search(r"(?m)^property \w+ red\b", part)]
    if {"vertex", "face"} <= set(colored):
        notes.append("face colours left out: the vertices have their own")
    for name in names[-1:]:
        problem = companions.picture(name)
        if problem:
            notes.append(f"texture {named(name)} left out: {problem}")
    return notes


def _off(data: bytes, _: Companions) -> list[str]:
    """Return the notes of an OFF file: its colours, and faces of fewer than 3 corners.

    Raises InputError if the file is binary, is cut, or has other than three coordinates.
    """
    lines = [line.split(b"#")[0].split() for line in data.splitlines()]
    words = [line for line in lines if line]
    head = words[0][0].decode("latin-1") if words else ""
    kind = re.match(r"(ST)?(C)?(N)?(4)?(n)?OFF", head)
    if kind and (kind[4] or kind[5]):
        raise InputError(f"expected an .off file of three coordinates, got {named(head)}")
    if b"BINARY" in words[0]:
        raise InputError("expected a text .off file, got a binary one; convert it to text or PLY")
    rows = words[1:] if len(words[0]) < 3 else [words[0][1:], *words[1:]]
    counts = [int(word) for word in rows[0][:2]] if rows and all(word.isdigit() for word in rows[0][:2]) else []
    if len(counts) < 2:
        return []
    points, faces = rows[1 : 1 + counts[0]], rows[1 + counts[0] : 1 + sum(counts)]
    notes = []
    if kind and kind[2] and points:
        notes.append(f"colours of {len(points):,} vertices left out: those of .off files are not read")
    sizes = [(int(row[0]) if row[0].isdigit() else 0, len(row)) for row in faces]
    colored = sum(length > size + 1 for size, length in sizes)
    short = sum(size < 3 for size, _ in sizes)
    if len(points) + len(faces) < sum(counts):
        raise InputError(
            f"the file is cut: its header promises {sum(counts):,} vertices and faces, "
            f"it holds {len(points) + len(faces):,}"
        )
    if colored:
        notes.append(f"colours of {colored:,} face(s) left out: those of .off files are not read")
    if short:
        notes.append(f"{short:,} face(s) of fewer than 3 corners left out")
    return notes


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

_SCANS: dict[str, Callable[[bytes, Companions], list[str]]] = {"obj": _obj, "ply": _ply, "off": _off, "3mf": _3mf}
