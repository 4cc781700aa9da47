"""PLY: turns the elements of PLY files into Scenes: polygons, strips, edges, points, colours, normals and textures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.corners import Places, fans, split
from clpeel.reading.images import texels
from clpeel.reading.losses import missing
from clpeel.reading.marks import marks
from clpeel.reading.ply_rows import NO_ROWS, Lists, Rows, read
from clpeel.reading.strips import strip
from clpeel.scene.arrays import DEFAULT_COLOR, AnyArray, Colors, alike
from clpeel.scene.fields import with_arrays
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import Scene, joined
from clpeel.scene.textures import Texture

_INDICES = ("vertex_indices", "vertex_index")
_COORDINATES = (("texture_u", "texture_v"), ("s", "t"), ("u", "v"), ("texture_s", "texture_t"))
_COLORS = (
    ("red", "green", "blue", "alpha"),
    ("r", "g", "b", "a"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
)
"""The names that files use for a face's corners, for texture coordinates, and for colours."""

_SHOWN = {"x", "y", "z", "nx", "ny", "nz", "texnumber"}.union(*_COORDINATES, *_COLORS)
"""The properties that a picture shows anyway. All other numbers are arrays of the scene."""


def ply(data: bytes, companions: Companions) -> Scene:
    """Return the scene of a PLY file. companions: the files beside it, for textures.

    Colours of PLY are display-referred. Of colours of vertices and of faces, those of vertices are used, unless they
    are all alike. Where a face has a texture, it has no other colour: programs write both, one made from the other.
    Edges are lines. Vertices are points if there are no faces, strips and edges.
    Raises InputError if there is nothing to draw, or if the file is damaged.
    """
    elements, textures = read(data)
    vertex, face = elements.get("vertex", NO_ROWS), elements.get("face", NO_ROWS)
    notes = list[str]()
    points = _columns(vertex, ("x", "y", "z"))
    if points is None and vertex.count:
        raise InputError("vertices: expected properties x, y and z, got none; the mesh is damaged")
    polygons = _corners(face)
    place, of_face = fans(polygons.counts)
    short = np.count_nonzero(polygons.counts < 3)
    if short:
        notes.append(f"{short:,} face(s) of fewer than 3 corners left out")
    strips = _strips(elements.get("tristrips", NO_ROWS))
    faces = np.concatenate([polygons.values.astype(np.int64)[place], strips])
    edges = _edges(elements.get("edge", NO_ROWS), notes)
    if points is None or not (len(faces) or len(edges) or vertex.count and not face.count):
        raise InputError("expected triangles, lines or points, got none; the mesh is empty")
    alone = None if len(faces) or len(edges) else np.arange(vertex.count)
    normals = _columns(vertex, ("nx", "ny", "nz"))
    of_vertices, of_faces = _arrays(vertex), _arrays(face)
    drawn = marks(points, edges, alone, _rgba(vertex), normals, arrays=of_vertices)
    if not len(faces):
        assert drawn is not None
        return replace(drawn, notes=tuple(notes))
    fields: dict[str, Any] = {"vertex_normals": normals}
    fields |= _colors(vertex, face, of_face, len(strips), notes)
    last = int(of_face.max(initial=-1)) + 1
    of_polygon = np.append(of_face, last + np.arange(len(strips)))
    scene = Scene.from_arrays(points, faces, polygons=of_polygon, **fields)
    scene = with_arrays(
        scene, of_vertices, {name: _of_triangles(a, of_face, len(strips)) for name, a in of_faces.items()}
    )
    if textures:
        scene = _textured(
            scene,
            _uv(vertex, face, polygons, place, scene),
            _numbers(face, of_face, len(scene.faces)),
            textures,
            companions,
            notes,
        )
    whole = scene if drawn is None else joined([scene, drawn])
    return replace(whole, notes=tuple(dict.fromkeys((*notes, *missing(companions, notes)))))


def _columns(rows: Rows, names: tuple[str, ...]) -> AnyArray | None:
    """Return numbers of each row side by side, [rows, names], or None if any of them is not there."""
    if not rows.count or not set(names) <= rows.scalars.keys():
        return None
    return np.stack([rows.scalars[name] for name in names], axis=1)


def _arrays(rows: Rows) -> dict[str, AnyArray]:
    """Return the numbers of each row that are neither places nor colours, by name."""
    return {name: values for name, values in rows.scalars.items() if name not in _SHOWN}


def _of_triangles(values: AnyArray, of_face: Places, strips: int) -> AnyArray:
    """Return the numbers of the triangles that faces became, and behind them NaN for so many that are of strips."""
    own = values[of_face]
    return np.concatenate([own, np.full(strips, np.nan)]) if strips else own


def _corners(face: Rows) -> Lists:
    """Return the corners of all faces."""
    for name in _INDICES:
        if name in face.lists:
            return face.lists[name]
    if face.count:
        raise InputError("faces: expected a list of vertex_indices, got none; the mesh is damaged")
    return Lists(np.zeros(0, np.int64), np.zeros(0, np.int64))


def _edges(rows: Rows, notes: list[str]) -> Places:
    """Return the edges [k, 2], and note that their colours are left out."""
    if not rows.count:
        return np.zeros((0, 2), np.int64)
    edges = _columns(rows, ("vertex1", "vertex2"))
    if edges is None:
        raise InputError("edges: expected properties vertex1 and vertex2, got none; the mesh is damaged")
    if _rgba(rows) is not None:
        notes.append(f"colours of {rows.count:,} edge(s) left out: they have those of their vertices")
    return edges.astype(np.int64)


def _strips(rows: Rows) -> Places:
    """Return the triangles [m, 3] of triangle strips. A negative index ends one, and the next begins behind it."""
    parts = [np.zeros((0, 3), np.int64)]
    for name in _INDICES:
        if name in rows.lists:
            values = rows.lists[name].values.astype(np.int64)
            ends = np.cumsum(rows.lists[name].counts)[:-1]
            for run in np.split(values, ends):
                parts += [strip(part[part >= 0]) for part in np.split(run, np.flatnonzero(run < 0))]
    return np.concatenate(parts)


# --- colours ----------------------------------------------------------------------------------------------------------


def _colors(vertex: Rows, face: Rows, of_face: Places, strips: int, notes: list[str]) -> dict[str, Colors]:
    """Return the colours for Scene.from_arrays, and note those that are not used. strips: how many triangles end the
    scene that are no faces of the file."""
    of_vertices, of_faces = _rgba(vertex), _rgba(face)
    if of_vertices is not None and of_faces is not None:
        flat = (of_vertices == of_vertices[0]).all()
        notes.append(
            "vertex colours left out: all are alike, and the faces have their own"
            if flat
            else "face colours left out: the vertices have their own"
        )
        of_vertices, of_faces = (None, of_faces) if flat else (of_vertices, None)
    if of_vertices is not None:
        return {"vertex_colors": of_vertices}
    if of_faces is None or not len(of_face):
        return {}
    rest = np.broadcast_to(np.array(DEFAULT_COLOR, np.uint8), (strips, 4))
    return {"face_colors": np.concatenate(alike([of_faces[of_face], rest]))}


def _rgba(rows: Rows) -> Colors | None:
    """Return the colours of rows as in Scene, [rows, 4], or None if they have none.

    Bytes stay. Unsigned numbers count from 0 to the most of their type, floats from 0 to 1. Signed ones, and floats of
    which any is above 1, are bytes that were written as something else.
    """
    for names in _COLORS:
        values = _columns(rows, names)
        if values is None:
            values = _columns(rows, names[:3])
        if values is None:
            continue
        top = float(np.iinfo(values.dtype).max) if values.dtype.kind == "u" else 255.0
        if values.dtype.kind == "f":
            values = np.nan_to_num(values)
            top = 255.0 if values.max() > 1 else 1.0
        if values.dtype != np.uint8:
            values = np.clip(values / top, 0, 1).astype(np.float32)
            whole = np.rint(values * 255)
            values = whole.astype(np.uint8) if top == 255 and np.abs(values * 255 - whole).max() < 1e-3 else values
        colors = np.full((rows.count, 4), 255 if values.dtype == np.uint8 else 1, values.dtype)
        colors[:, : values.shape[1]] = values
        return colors
    return None


# --- textures ---------------------------------------------------------------------------------------------------------


def _uv(vertex: Rows, face: Rows, polygons: Lists, place: Places, scene: Scene) -> NDArray[np.float64]:
    """Return the texture coordinates of each corner, [m, 3, 2], as in the file, where v points up. NaN for none."""
    found = np.full((len(scene.faces), 3, 2), np.nan)
    own = face.lists.get("texcoord")
    if own is not None:
        fits = own.counts == 2 * polygons.counts
        begin = np.cumsum(own.counts) - own.counts
        corner = np.arange(len(polygons.values)) - np.repeat(
            np.cumsum(polygons.counts) - polygons.counts, polygons.counts
        )
        at = np.repeat(begin, polygons.counts) + 2 * corner
        known = np.repeat(fits, polygons.counts)
        at = np.where(known, at, -1)[place]
        values = np.append(own.values.astype(np.float64), [np.nan, np.nan])
        found[: len(place)] = np.stack([values[at], values[np.where(at < 0, -1, at + 1)]], axis=-1)
        return found
    for names in _COORDINATES:
        of_vertices = _columns(vertex, names)
        if of_vertices is not None:
            return of_vertices.astype(np.float64)[scene.faces]
    return found


def _numbers(face: Rows, of_face: Places, count: int) -> Places:
    """Return which of the file's textures each triangle has: the first, unless the file says it of its faces."""
    found = np.zeros(count, np.int64)
    if "texnumber" in face.scalars:
        found[: len(of_face)] = face.scalars["texnumber"][of_face]
    return found


def _textured(
    scene: Scene, uv: NDArray[np.float64], numbers: Places, names: list[str], companions: Companions, notes: list[str]
) -> Scene:
    """Return the scene with its textures, and with notes of those that it cannot have."""
    has_uv = np.isfinite(uv).all(axis=(1, 2))
    of_faces = np.where(has_uv & (numbers >= 0) & (numbers < len(names)), numbers, NO_MATERIAL)
    if not has_uv.any():
        notes.append(f"texture {named(names[0])} left out: the file has no texture coordinates")
        return scene
    materials = list[Material]()
    for number, name in enumerate(names):
        own = of_faces == number
        material = _material(name, companions, notes) if own.any() else None
        of_faces[own] = NO_MATERIAL if material is None else len(materials)
        materials += [] if material is None else [material]
    if not materials:
        return scene
    textured = of_faces != NO_MATERIAL
    if scene.color is None:
        notes.append(f"colours left out: {np.count_nonzero(textured):,} face(s) have a texture instead")
    ids = np.unique(uv.reshape(-1, 2).astype(np.float32).view(np.int64), return_inverse=True)[1].reshape(-1)
    ids = np.where(np.repeat(textured, 3), ids, -1)
    source, (own_id,), index = split(scene.faces.reshape(-1).astype(np.int64), len(scene.vertices), ids)
    corner = np.full(ids.max() + 2, 0)
    corner[ids] = np.arange(len(ids))
    flat = np.where((own_id >= 0)[:, None], uv.reshape(-1, 2)[corner[own_id]], 0.0)
    colors = {name: getattr(scene, name) for name in ("vertex_colors", "face_colors") if not textured.all()}
    vertex_colors = colors.get("vertex_colors")
    normals = scene.vertex_normals
    made = Scene.from_arrays(
        scene.vertices[source],
        index.reshape(-1, 3),
        face_colors=colors.get("face_colors"),
        vertex_colors=None if vertex_colors is None else vertex_colors[source],
        vertex_normals=None if normals is None else normals[source],
        materials=[replace(material, rgb_of_scene=False, alpha_of_scene=False) for material in materials],
        face_materials=of_faces,
        uv=flat * [1, -1] + [0, 1],
        polygons=scene.polygons,
    )
    return with_arrays(made, {name: array[source] for name, array in scene.vertex_arrays.items()}, scene.face_arrays)


def _material(name: str, companions: Companions, notes: list[str]) -> Material | None:
    """Return the material of a texture, or None, after a note, if it cannot be read."""
    try:
        image = texels(companions.get(name))
    except FileNotFoundError:
        notes.append(f"texture {named(name)} left out: {companions.lost[name]}")
        return None
    except ValueError as error:
        notes.append(f"texture {named(name)} left out: {error}")
        return None
    material = Material(name, texture=Texture(image))
    return material if material.texel_alphas[0] == 1 else replace(material, alpha_mode="BLEND")
