"""Reads glTF 2.0: what the default scene's nodes show as a Scene, and notes of what it lacks."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading import gltf_nodes
from clpeel.reading.companions import Companions
from clpeel.reading.gltf_accessors import Accessors, unit
from clpeel.reading.gltf_animations import Moment, moved
from clpeel.reading.gltf_document import Document, objects
from clpeel.reading.gltf_lights import lights_of
from clpeel.reading.gltf_materials import Look, Materials
from clpeel.reading.gltf_pose import Poses, placed, skinned
from clpeel.reading.gltf_primitives import Primitive
from clpeel.reading.gltf_textures import Textures
from clpeel.reading.losses import missing
from clpeel.reading.transforms import Reals
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene, joined

_MOST_DRAWN = 2**27
"""The most vertices, or triangles, that a file may draw if it does not hold as many bytes. Otherwise a small file could
ask for all the memory there is, by many nodes with one mesh."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """A primitive as nodes show it.

    weights: of its morph targets. joints: what moves each joint of its skin, float64 [j, 4, 4]; None without a skin.
    places: where its copies stand, float64 [k, 4, 4] for each node.
    """

    primitive: Primitive
    weights: tuple[float, ...]
    joints: Reals | None
    places: list[Reals]


def read_gltf(data: bytes, extension: str, companions: Companions, moment: Moment | None = None) -> Scene:
    """Return the scene of a .glb or .gltf file, at a moment of an animation or in its pose at rest.

    Raises InputError. Where the file breaks the format, it may also raise KeyError, IndexError, TypeError,
    AttributeError or ValueError.
    """
    document = Document(data, extension, companions)
    accessors = Accessors(document)
    motion = moved(document, accessors, moment)
    worlds = gltf_nodes.worlds(document, motion)
    poses = Poses(document, accessors, worlds, motion)
    pieces, others = _pieces(document, accessors, poses)
    materials = Materials(document, Textures(accessors))
    for piece in pieces:
        if not piece.primitive.marks:
            materials.want(piece.primitive)
    materials.textures.decode()
    scenes = list[Scene]()
    for piece in pieces:
        look = materials.look(piece.primitive) if not piece.primitive.marks else None
        if look is not None:
            scenes.append(_scene(piece, look))
        elif piece.primitive.marks:
            scenes.append(_marks(piece, materials))
    materials.note_losses()
    left_out = ", ".join(f"{count} {kind}" for kind, count in others.items())
    if left_out:
        document.note(f"left out, nothing to draw: {left_out}")
    if not scenes:
        meshes = document.entries("meshes")
        none = f"{len(meshes)} mesh(es) that no node shows" if meshes else "none"
        got = left_out or ("faces that are cut away" if pieces else none)
        raise InputError(f"expected triangles, got {got}; the mesh is empty")
    lights = lights_of(document, worlds)
    notes = document.notes
    return replace(joined(scenes), lights=lights, notes=(*notes, *missing(companions, notes)))


def _pieces(document: Document, accessors: Accessors, poses: Poses) -> tuple[list[_Piece], Counter[str]]:
    """Return the primitives that are drawn, in the order of the nodes, and how many of each kind have no triangles.

    Nodes that show a primitive alike but for their places share a piece, in the first one's place. Raises InputError,
    also if more is drawn than a file may ask for.
    """
    primitives: dict[int, list[Primitive]] = {}
    pieces: dict[tuple[Any, ...], _Piece] = {}
    others, drawn = Counter[str](), 0
    for index in gltf_nodes.shown(document):
        mesh = document.entry("nodes", index).get("mesh")
        if mesh is None:
            continue
        held = objects(document.entry("meshes", mesh), "primitives")
        if not held:
            others["mesh(es) without primitives"] += 1
        skin, places = poses.skin(index), poses.copies(index)
        for number, each in enumerate(held):
            if number == len(primitives.setdefault(mesh, [])):
                primitives[mesh].append(Primitive(accessors, each))
            primitive = primitives[mesh][number]
            drawn += len(places) * max(primitive.count, len(primitive.faces))
            most = min(max(_MOST_DRAWN, accessors.size), 2**31 - 1)
            if drawn > most:
                of = f"of a file with {accessors.size:,} bytes of numbers"
                raise InputError(f"expected at most {most:,} vertices or triangles {of}, got {drawn:,} or more")
            if primitive.lacks:
                others[primitive.lacks] += len(places)
                continue
            weights = poses.weights(index) if primitive.targets else ()
            joints = skin if primitive.has("JOINTS_0") else None
            key = (primitive, weights, None if joints is None else index)
            pieces.setdefault(key, _Piece(primitive, weights, joints, [])).places.append(places)
    return list(pieces.values()), others


def _scene(piece: _Piece, look: Look) -> Scene:
    """Return the scene of a primitive as nodes show it. Raises InputError."""
    primitive, weights = piece.primitive, piece.weights
    vertices, normals, faces, copies = _placed(piece)
    given: dict[str, Any] = {"vertex_normals": normals}
    given["materials"] = (look.material,)
    if look.material.plain:
        given["color"] = look.color
    else:
        if primitive.has("COLOR_0"):
            given["vertex_colors"] = np.tile(_colors(primitive, weights), (copies, 1))
    sets = [each.at(primitive.floats(each.coordinates, weights, "VEC2")) for each in look.mappings]
    if sets:
        given["uv"], *given["more_uv"] = (np.tile(uv, (copies, 1)) for uv in sets)
    scene = Scene.from_arrays(vertices, faces, **given)
    return replace(scene, single_sided=np.ones(len(faces), bool)) if look.single_sided else scene


def _placed(piece: _Piece) -> tuple[Reals, Reals | None, AnyArray, int]:
    """Return vertices, normals and faces of a primitive as nodes show it, and how many copies of it there are."""
    primitive, weights = piece.primitive, piece.weights
    points = primitive.floats("POSITION", weights, "VEC3")
    normals = primitive.floats("NORMAL", weights, "VEC3") if primitive.has("NORMAL") else None
    if piece.joints is None:
        matrix = np.concatenate(piece.places)[:, None]
    else:
        matrix = skinned(primitive, piece.joints)[None]
    return (*placed(points, normals, primitive.faces, matrix), len(matrix))


def _marks(piece: _Piece, materials: Materials) -> Scene:
    """Return the scene of a primitive of lines or points as nodes show it. Raises InputError.

    Its colours are shown as they are: what its material makes of them, without textures.
    """
    primitive = piece.primitive
    vertices, normals, faces, copies = _placed(piece)
    own = unit(_colors(primitive, piece.weights), True) if primitive.has("COLOR_0") else np.ones((1, 4))
    colors, lit = materials.shown(primitive, np.asarray(own, np.float64))
    lines = faces if faces.shape[1] == 2 else None
    return Scene.from_arrays(
        vertices,
        lines=lines,
        points=faces[:, 0] if lines is None else None,
        vertex_colors=None if len(colors) == 1 else np.tile(colors, (copies, 1)),
        color=colors[0] if len(colors) == 1 else None,
        vertex_normals=normals if lit else None,
    )


def _colors(primitive: Primitive, weights: Any) -> AnyArray:
    """Return the colours of a primitive's vertices, linear, [n, 3 or 4]: uint8 as stored, or floats 0..1."""
    stored = primitive.stored("COLOR_0", "VEC3", "VEC4")
    if stored.dtype == np.uint8 and not primitive.morphs("COLOR_0", weights):
        return stored
    return np.clip(np.nan_to_num(primitive.floats("COLOR_0", weights, "VEC3", "VEC4")), 0, 1)
