"""OBJ: reads Wavefront files into Scenes: polygons in the order of the file, each with its material.

trimesh reads OBJ, too, but it orders faces by material, and drops texture coordinates that some faces lack.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.corners import Places, fans, split
from clpeel.reading.lines import Lines, parsed, word_starts
from clpeel.reading.losses import listed, missing
from clpeel.reading.marks import chains, marks, together
from clpeel.reading.mtl import Library, Placing
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import linear, srgb

_SHAPES = ("curv", "curv2", "surf", "call", "csh", "bzp", "bsp", "cdc", "cdp")
_COMMENT_BEHIND = re.compile(rb"^([ \t]*(?:v|vt|vn|f|l|p)[ \t][^#\n]*)#[^\n]*", re.MULTILINE)


def obj(data: bytes, companions: Companions) -> Scene:
    """Return the scene of an OBJ file. companions: the files beside it, for materials and textures.

    Vertices are points if there is nothing else. Raises InputError if there is nothing to draw, or if it is damaged.
    """
    if data.count(b"#") > data.count(b"\n#"):
        data = _COMMENT_BEHIND.sub(rb"\1", data)
    lines = Lines(data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" "))
    notes = list[str]()
    counts = lines.counts[lines.beginning_with(b"f")] - 1
    library = Library(companions)
    faces = None
    if (counts >= 3).any():
        found = _Faces.of(lines, notes)
        faces = _assembled(lines, found, _Surface.of(lines, found, library, notes), notes)
    elif len(counts):
        notes.append(f"{len(counts):,} face(s) of fewer than 3 corners left out")
    _note_other_shapes(lines, notes)
    scene = together([faces, _marks(lines, library, faces is None, notes)])
    if scene is None:
        raise InputError("expected triangles, lines or points, got none; the mesh is empty")
    return replace(scene, notes=tuple(dict.fromkeys((*notes, *missing(companions, notes)))))


def _note_other_shapes(lines: Lines, notes: list[str]) -> None:
    """Add a note of curves and surfaces."""
    counts = {word: len(lines.beginning_with(word.encode())) for word in _SHAPES}
    shapes = [f"{counts[word]} {word}" for word in _SHAPES if counts[word]]
    if shapes:
        notes.append(f"curves and surfaces left out: {', '.join(shapes)}")


# --- faces ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Faces:
    """The triangles of a file, in its order.

    vertex, uv, normal: of each triangle's corner, counted from 0, int64 [3 m]; -1 where it has no uv or normal.
    line: where each triangle stands in the file, int64 [m]. polygon: the face of the file that it is of, int64 [m].
    """

    vertex: Places
    uv: Places
    normal: Places
    line: Places
    polygon: Places

    @staticmethod
    def of(lines: Lines, notes: list[str]) -> _Faces:
        """Return the triangles in the lines. Raises InputError if a corner names no vertex of the file."""
        where = lines.beginning_with(b"f")
        counts = lines.counts[where] - 1
        short = np.count_nonzero(counts < 3)
        if short:
            notes.append(f"{short:,} face(s) of fewer than 3 corners left out")
        given = _indices(lines, where)
        place, face = fans(counts)
        corner, line = place.reshape(-1), where[face]
        found = list[Places]()
        for column, word in enumerate((b"v", b"vt", b"vn")):
            own = lines.beginning_with(word)
            absolute = _absolute(given[:, column], own, where, counts, "faces" if word == b"v" else None)
            found.append(absolute[corner])
        return _Faces(found[0], found[1], found[2], np.asarray(line), face)


def _absolute(index: Places, own: Places, where: Places, counts: Places, name: str | None) -> Places:
    """Return indices as they count from 0, or -1 for those that name nothing. A negative one counts back from its line.

    own: the lines of what is named. where, counts: the lines that the indices stand in, and how many in each. name:
    what an InputError calls them where they name nothing; None if that is no error.
    """
    before = np.repeat(np.searchsorted(own, where), counts)
    absolute = np.where(index < 0, before + index, index - 1)
    wrong = (absolute < 0) | (absolute >= len(own))
    if name is not None and wrong.any():
        bad = int(np.argmax(wrong))
        at = int(np.repeat(where, counts)[bad]) + 1
        raise InputError(f"{name}: expected indices 1..{len(own)}, got {index[bad]} in line {at}; the mesh is damaged")
    absolute[wrong] = -1
    return absolute


def _indices(lines: Lines, where: Places) -> Places:
    """Return the indices of each corner in these lines as they are written: v, vt and vn; 0 for what is not there.

    A corner is v, v/vt, v//vn or v/vt/vn. Raises InputError if it is anything else.
    """
    text = lines.text(where, 1)
    slashes = np.flatnonzero(text == ord("/"))
    corners = word_starts(text)
    text[slashes] = 32
    values = parsed(text.tobytes(), np.int64)
    begin = word_starts(text)
    corner = np.searchsorted(corners, begin, side="right") - 1
    place = np.searchsorted(slashes, begin) - np.searchsorted(slashes, corners)[corner]
    if len(place) and place.max() > 2:
        raise InputError("not a readable mesh: expected corners of faces as v/vt/vn, got more than two slashes")
    table = np.zeros((len(corners), 3), np.int64)
    table[corner, place] = values
    return table


# --- materials --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Surface:
    """The materials of the triangles. of_faces: int64 [m], NO_MATERIAL for none. placings: of each material."""

    materials: tuple[Material, ...]
    placings: tuple[Placing, ...]
    of_faces: Places

    @staticmethod
    def of(lines: Lines, faces: _Faces, library: Library, notes: list[str]) -> _Surface:
        """Return the materials that the triangles use, with notes of those that they cannot have."""
        named_files = [_text(lines, line) for line in lines.beginning_with(b"mtllib")]
        there = [library.read(line) for line in dict.fromkeys(named_files)]
        notes += library.notes
        library.notes.clear()
        uses = lines.beginning_with(b"usemtl")
        names = [" ".join(_text(lines, line).split()) for line in uses]
        use = np.searchsorted(uses, faces.line) - 1  # the last usemtl before each triangle
        places = {name: place for place, name in enumerate(dict.fromkeys(names))}
        numbers = np.array([*(places[name] for name in names), -1], np.int64)[use]  # -1, for none, is the last
        used = [name for name, place in places.items() if (numbers == place).any()]
        unknown = [named(name) for name in used if name and name not in library.statements]
        if unknown and (any(there) or not there):
            where = "the material files lack them" if there else "the file names no material file"
            notes.append(f"materials left out: {listed(unknown)}; {where}")
        known = [name for name in used if name in library.statements]
        made = [library.material(name) for name in known]
        notes += library.notes
        others = library.other_maps(known)
        if others:
            notes.append(f"textures left out, as only map_Kd and map_d are drawn: {listed(others, 9)}")
        new = np.full(len(places) + 1, NO_MATERIAL, np.int64)
        new[[places[name] for name in known]] = np.arange(len(known))
        return _Surface(tuple(m for m, _ in made), tuple(p for _, p in made), new[numbers])


def _text(lines: Lines, line: int) -> str:
    """Return what stands behind a line's first word, as text."""
    return lines.rest(int(line)).decode("utf-8", "replace")


# --- lines and points -------------------------------------------------------------------------------------------------


def _marks(lines: Lines, library: Library, alone: bool, notes: list[str]) -> Scene | None:
    """Return the scene of polylines and points. alone: whether the file has no faces; then its vertices may be points.

    They have the colours of their vertices, or else that of their material, which is Kd and d.
    """
    own = lines.beginning_with(b"v")
    where = {word: lines.beginning_with(word) for word in (b"l", b"p")}
    counts = {word: lines.counts[at] - 1 for word, at in where.items()}
    corners = {
        word: _absolute(_indices(lines, at)[:, 0], own, where[word], counts[word], words)
        for (word, at), words in zip(where.items(), ("lines", "points"), strict=True)
    }
    places, colored = _vertices(lines)
    of_vertices = _colors(places[:, 3:], colored) if colored.any() else None
    ends = chains(counts[b"l"])
    if not len(ends) and not len(corners[b"p"]):
        return marks(places[:, :3], points=np.arange(len(own)), vertex_colors=of_vertices) if alone else None
    # Each corner has a vertex of its own, as one vertex may have several materials.
    vertex = np.concatenate([corners[b"l"], corners[b"p"]])
    at = np.concatenate([np.repeat(where[word], counts[word]) for word in (b"l", b"p")])
    points = np.arange(len(corners[b"l"]), len(vertex))
    colors = _material_colors(lines, library, at, notes) if of_vertices is None else of_vertices[vertex]
    return marks(places[vertex, :3], ends, points, vertex_colors=colors)


def _material_colors(lines: Lines, library: Library, at: Places, notes: list[str]) -> NDArray[Any] | None:
    """Return the colours of what stands in these lines by its material, [n, 4]; None if none has a known one."""
    for line in dict.fromkeys(_text(lines, line) for line in lines.beginning_with(b"mtllib")):
        library.read(line)
    uses = lines.beginning_with(b"usemtl")
    names = [" ".join(_text(lines, line).split()) for line in uses]
    use = np.searchsorted(uses, at) - 1  # the last usemtl before each, or -1
    notes += library.notes
    known = {number for number in np.unique(use) if number >= 0 and names[number] in library.statements}
    if not known:
        return None
    table = np.tile(np.array(DEFAULT_COLOR, np.float64) / 255, (len(names) + 1, 1))  # the last is of none
    textured = list[str]()
    for number in sorted(known):
        material, _ = library.material(names[number])
        red, green, blue, alpha = material.base_color
        table[number] = [*srgb(np.array([red, green, blue])), alpha * material.opacity]
        textured += [named(names[number])] * (material.texture is not None)
    notes += library.notes
    if textured:
        notes.append(f"textures of lines and points left out: {listed(list(dict.fromkeys(textured)))}")
    return table[use].astype(np.float32)


# --- the scene --------------------------------------------------------------------------------------------------------


def _table(lines: Lines, word: bytes, width: int) -> tuple[NDArray[np.float64], Places]:
    """Return the first numbers in each line that begins with the word, [lines, width], and how many each has.

    What a line lacks is 0. Raises InputError if a word is no number.
    """
    where = lines.beginning_with(word)
    counts = lines.counts[where] - 1
    values = lines.numbers(where, len(word))
    if len(counts) and (counts == counts[0]).all() and counts[0] >= width:
        return values.reshape(len(counts), -1)[:, :width], counts
    table = np.zeros((len(counts), width))
    begin = np.cumsum(counts) - counts
    for column in range(width):
        has = counts > column
        table[has, column] = values[begin[has] + column]
    return table, counts


def _vertices(lines: Lines) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return x, y, z, r, g and b of each vertex, [n, 6], and whether it has a colour. Raises InputError."""
    points, counts = _table(lines, b"v", 6)
    if len(counts) and counts.min() < 3:
        raise InputError(f"vertices: expected three coordinates, got {counts.min()}; the mesh is damaged")
    return points, counts >= 6


def _assembled(lines: Lines, faces: _Faces, surface: _Surface, notes: list[str]) -> Scene:
    """Return the scene. A vertex is split where its corners differ in texture coordinates, normal or kind of colour."""
    points, colored = _vertices(lines)
    textured = np.array([*(material.texture is not None for material in surface.materials), False])[surface.of_faces]
    # Each distinct placing has texture coordinates of its own.
    placings = list(dict.fromkeys(surface.placings))
    number = np.array([*(placings.index(placing) for placing in surface.placings), -1], np.int64)[surface.of_faces]
    lies = np.repeat(np.where(textured, number, -1), 3)
    uv = np.where(np.repeat(textured, 3), faces.uv, -1)
    lacking = np.count_nonzero((uv < 0).reshape(-1, 3).any(axis=1) & textured)
    if lacking:
        notes.append(f"texture coordinates are missing: {lacking:,} face(s) have one colour of their texture")
    has_material = np.repeat(surface.of_faces != NO_MATERIAL, 3).astype(np.int64)
    plain = colored.any() and not textured.all()
    columns = (uv, lies, faces.normal, has_material if plain else np.zeros_like(uv))
    source, (own_uv, own_lies, own_normal, linearly), index = split(faces.vertex, len(points), *columns)
    fields: dict[str, Any] = {}
    if textured.any():
        fields["uv"] = _coordinates(lines, placings, own_uv, own_lies)
    if (faces.normal >= 0).any():
        normals, _ = _table(lines, b"vn", 3)
        fields["vertex_normals"] = np.where(own_normal[:, None] >= 0, normals[own_normal], np.nan)
    materials = surface.materials
    if plain:
        fields["vertex_colors"] = _colors(points[:, 3:], colored)[source]
        if linearly.any():
            fields["vertex_colors"] = np.where(linearly[:, None] > 0, *_alike(fields["vertex_colors"]))
        materials = tuple(replace(m, rgb_of_scene=m.texture is None) for m in materials)
    if colored.any() and textured.any():
        notes.append(f"vertex colours left out: {np.count_nonzero(textured):,} face(s) have a texture instead")
    if materials:
        fields |= {"materials": materials, "face_materials": surface.of_faces}
    return Scene.from_arrays(points[source, :3], index.reshape(-1, 3), polygons=faces.polygon, **fields)


def _alike(colors: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return display-referred colours as linear ones, and as they are, both of them float32."""
    unit = colors / 255 if colors.dtype == np.uint8 else colors
    return linear(unit).astype(np.float32), unit.astype(np.float32)


def _coordinates(lines: Lines, placings: list[Placing], uv: Places, lies: Places) -> NDArray[np.float64]:
    """Return the scene's texture coordinates [n, 2] of vertices with these uv and placings. In files, v points up."""
    given, _ = _table(lines, b"vt", 2)
    found = np.vstack([given, np.zeros((1, 2))])[uv]  # -1, for none, is the last
    for number, placing in enumerate(placings):
        own = lies == number
        found[own] = found[own] * placing.scale + placing.offset
    return np.stack([found[:, 0], 1 - found[:, 1]], axis=1)


def _colors(values: NDArray[np.float64], colored: NDArray[np.bool_]) -> NDArray[Any]:
    """Return the colours of vertices [n, 3]: bytes if all of them are, else floats. White where there is none.

    Files have them in 0..1, or in 0..255.
    """
    values = np.where(colored[:, None], np.nan_to_num(values), 0.0)
    values = values if values.max() > 2 else values * 255
    values = np.where(colored[:, None], np.clip(values, 0, 255), 255.0)
    whole = np.rint(values)
    # Programs write bytes / 255 with three decimals or more.
    return whole.astype(np.uint8) if np.abs(values - whole).max() < 0.13 else (values / 255).astype(np.float32)
