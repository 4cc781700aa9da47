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
from clpeel.reading.mtl import Library, Placing
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import linear

_SHAPES = ("curv", "curv2", "surf", "call", "csh", "bzp", "bsp", "cdc", "cdp")
_COMMENT_BEHIND = re.compile(rb"^([ \t]*(?:v|vt|vn|f|l|p)[ \t][^#\n]*)#[^\n]*", re.MULTILINE)


def obj(data: bytes, companions: Companions) -> Scene:
    """Return the scene of an OBJ file. companions: the files beside it, for materials and textures.

    Raises InputError if there are no faces, or if it is damaged.
    """
    if data.count(b"#") > data.count(b"\n#"):
        data = _COMMENT_BEHIND.sub(rb"\1", data)
    lines = Lines(data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" "))
    notes = list[str]()
    faces = _Faces.of(lines, notes)
    surface = _Surface.of(lines, faces, companions, notes)
    _note_other_shapes(lines, notes)
    scene = _assembled(lines, faces, surface, notes)
    return replace(scene, notes=tuple(dict.fromkeys((*notes, *missing(companions, notes)))))


def _note_other_shapes(lines: Lines, notes: list[str]) -> None:
    """Add notes of curves, surfaces, lines and points."""
    counts = {word: len(lines.beginning_with(word.encode())) for word in (*_SHAPES, "l", "p")}
    shapes = [f"{counts[word]} {word}" for word in _SHAPES if counts[word]]
    if shapes:
        notes.append(f"curves and surfaces left out: {', '.join(shapes)}")
    parts = [f"{counts[word]} {name}" for word, name in (("l", "line(s)"), ("p", "point(s)")) if counts[word]]
    if parts:
        notes.append(f"left out, not triangles: {', '.join(parts)}")


# --- faces ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Faces:
    """The triangles of a file, in its order.

    vertex, uv, normal: of each triangle's corner, counted from 0, int64 [3 m]; -1 where it has no uv or normal.
    line: where each triangle stands in the file, int64 [m].
    """

    vertex: Places
    uv: Places
    normal: Places
    line: Places

    @staticmethod
    def of(lines: Lines, notes: list[str]) -> _Faces:
        """Return the triangles in the lines. Raises InputError if a corner names no vertex of the file."""
        where = lines.beginning_with(b"f")
        vertices = lines.beginning_with(b"v")
        counts = lines.counts[where] - 1
        if not (counts >= 3).any():
            got = f"{len(vertices):,} point(s) alone" if len(vertices) else "none"
            raise InputError(f"expected triangles, got {got}; the mesh is empty")
        short = np.count_nonzero(counts < 3)
        if short:
            notes.append(f"{short:,} face(s) of fewer than 3 corners left out")
        given = _indices(lines, where)
        place, face = fans(counts)
        corner, line = place.reshape(-1), where[face]
        found = list[Places]()
        for column, word in enumerate((b"v", b"vt", b"vn")):
            own = lines.beginning_with(word)
            # A negative index counts back from its own line.
            before = np.repeat(np.searchsorted(own, where), counts)
            index = given[:, column]
            absolute = np.where(index < 0, before + index, index - 1)
            wrong = (absolute < 0) | (absolute >= len(own))
            if word == b"v" and wrong.any():
                bad = int(np.argmax(wrong))
                at = int(np.repeat(where, counts)[bad]) + 1
                raise InputError(
                    f"faces: expected indices 1..{len(own)}, got {index[bad]} in line {at}; the mesh is damaged"
                )
            absolute[wrong] = -1
            found.append(absolute[corner])
        return _Faces(found[0], found[1], found[2], np.asarray(line))


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
    def of(lines: Lines, faces: _Faces, companions: Companions, notes: list[str]) -> _Surface:
        """Return the materials that the triangles use, with notes of those that they cannot have."""
        library = Library(companions)
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


def _assembled(lines: Lines, faces: _Faces, surface: _Surface, notes: list[str]) -> Scene:
    """Return the scene. A vertex is split where its corners differ in texture coordinates, normal or kind of colour."""
    points, counts = _table(lines, b"v", 6)
    colored = counts >= 6  # x y z r g b
    if len(counts) and counts.min() < 3:
        raise InputError(f"vertices: expected three coordinates, got {counts.min()}; the mesh is damaged")
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
    return Scene.from_arrays(points[source, :3], index.reshape(-1, 3), **fields)


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
