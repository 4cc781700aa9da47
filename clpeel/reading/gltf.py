"""Reads glTF 2.0: the triangles of the default scene's nodes as a Scene, and notes of what it lacks."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading import gltf_nodes
from clpeel.reading.companions import Companions
from clpeel.reading.gltf_accessors import Accessors
from clpeel.reading.gltf_animations import Moment, moved
from clpeel.reading.gltf_document import Document, objects
from clpeel.reading.gltf_materials import Look, Materials
from clpeel.reading.gltf_pose import Poses, placed, skinned
from clpeel.reading.gltf_primitives import Primitive
from clpeel.reading.gltf_textures import Textures
from clpeel.reading.losses import missing
from clpeel.reading.transforms import Reals
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene, joined

_MOST_COPIES = 2**27
"""The most vertices that a file may draw beyond those it holds. Otherwise a small file could ask for all the memory
there is, by many nodes with one mesh."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """A primitive as a node shows it. places: float64 [k, 4, 4], where its copies stand."""

    node: int
    primitive: Primitive
    places: Reals


def read_gltf(data: bytes, extension: str, companions: Companions, moment: Moment | None = None) -> Scene:
    """Return the scene of a .glb or .gltf file, at a moment of an animation or in its pose at rest.

    Raises InputError. Where the file breaks the format, it may also raise KeyError, IndexError, TypeError,
    AttributeError or ValueError.
    """
    document = Document(data, extension, companions)
    accessors = Accessors(document)
    motion = moved(document, accessors, moment)
    poses = Poses(document, accessors, gltf_nodes.worlds(document, motion), motion)
    pieces, others = _pieces(document, accessors, poses)
    materials = Materials(document, Textures(accessors))
    for piece in pieces:
        materials.want(piece.primitive)
    materials.textures.decode()
    materials.note_kinds()
    scenes = list[Scene]()
    for piece in pieces:
        look = materials.look(piece.primitive)
        if look is not None:
            scenes.append(_scene(piece, look, poses))
    left_out = ", ".join(f"{count} {kind}" for kind, count in others.items())
    if left_out:
        document.note(f"left out, not triangles: {left_out}")
    if not scenes:
        meshes = document.entries("meshes")
        none = f"{len(meshes)} mesh(es) that no node shows" if meshes else "none"
        got = left_out or ("faces that are cut away" if pieces else none)
        raise InputError(f"expected triangles, got {got}; the mesh is empty")
    notes = document.notes
    return replace(joined(scenes), notes=(*notes, *missing(companions, notes)))


def _pieces(document: Document, accessors: Accessors, poses: Poses) -> tuple[list[_Piece], Counter[str]]:
    """Return the primitives that are drawn, in the order of the nodes, and how many of each kind have no triangles.

    Raises InputError, also if there are more vertices than a file may ask for.
    """
    primitives: dict[int, list[Primitive]] = {}
    pieces, others, total = list[_Piece](), Counter[str](), 0
    for index in gltf_nodes.shown(document):
        mesh = document.entry("nodes", index).get("mesh")
        if mesh is None:
            continue
        held = document.entry("meshes", mesh)
        if mesh not in primitives:
            primitives[mesh] = [Primitive(accessors, each) for each in objects(held, "primitives")]
            if not primitives[mesh]:
                others["mesh(es) without primitives"] += 1
        places = poses.copies(index)
        for primitive in primitives[mesh]:
            if primitive.lacks:
                others[primitive.lacks] += len(places)
                continue
            pieces.append(_Piece(index, primitive, places))
            total += primitive.count * len(places)
    once = sum(primitive.count for each in primitives.values() for primitive in each)
    if total >= 2**31 or total - once > _MOST_COPIES:
        raise InputError(f"expected nodes that draw fewer vertices, got {total:,} of {once:,} that the file holds")
    return pieces, others


def _scene(piece: _Piece, look: Look, poses: Poses) -> Scene:
    """Return the scene of a primitive as a node shows it. Raises InputError."""
    primitive, weights = piece.primitive, poses.weights(piece.node)
    points = primitive.floats("POSITION", weights, "VEC3")
    normals = primitive.floats("NORMAL", weights, "VEC3") if primitive.has("NORMAL") else None
    joints = poses.skin(piece.node)
    if joints is not None and primitive.has("JOINTS_0"):
        matrix = skinned(primitive, joints)[None]
    else:
        matrix = piece.places[:, None]
    vertices, normals, faces = placed(points, normals, primitive.faces, matrix)
    given: dict[str, Any] = {"vertex_normals": normals}
    copies = len(matrix)
    if look.material is None:
        given["color"] = look.color
    else:
        given["materials"] = (look.material,)
        if primitive.has("COLOR_0"):
            given["vertex_colors"] = np.tile(_colors(primitive, weights), (copies, 1))
    if look.mapped is not None:
        uv = look.mapped.at(primitive.floats(look.mapped.coordinates, weights, "VEC2"))
        given["uv"] = np.tile(uv, (copies, 1))
    scene = Scene.from_arrays(vertices, faces, **given)
    return replace(scene, single_sided=np.ones(len(faces), bool)) if look.single_sided else scene


def _colors(primitive: Primitive, weights: Any) -> AnyArray:
    """Return the colours of a primitive's vertices, linear, [n, 3 or 4]: uint8 as stored, or floats 0..1."""
    stored = primitive.stored("COLOR_0", "VEC3", "VEC4")
    if stored.dtype == np.uint8 and not primitive.morphs("COLOR_0", weights):
        return stored
    return np.clip(np.nan_to_num(primitive.floats("COLOR_0", weights, "VEC3", "VEC4")), 0, 1)
