"""The pose of a glTF mesh: skins, instances and nodes put its vertices, as morphed, in their places in the world."""

from __future__ import annotations

import numpy as np

from clpeel.reading.companions import named
from clpeel.reading.gltf_accessors import Accessors
from clpeel.reading.gltf_document import INSTANCING, Document, damaged, extension, fields, items, number, place
from clpeel.reading.gltf_nodes import Moved, composed
from clpeel.reading.gltf_primitives import Primitive
from clpeel.reading.losses import listed
from clpeel.reading.transforms import Reals, cofactors, moved, product, turned
from clpeel.scene.arrays import AnyArray


class Poses:
    """Where the meshes of a document's nodes stand. worlds: the global transform of every node, float64 [n, 4, 4]."""

    def __init__(self, document: Document, accessors: Accessors, worlds: Reals, moved: Moved) -> None:
        self.document, self.accessors = document, accessors
        self._worlds, self._moved = worlds, moved
        self._skins: dict[int, Reals] = {}

    def weights(self, index: int) -> tuple[float, ...]:
        """Return the weights of the morph targets of a node's mesh: of the animation, the node, or the mesh."""
        if (index, "weights") in self._moved:
            return tuple(float(each) for each in self._moved[index, "weights"])
        node = self.document.entry("nodes", index)
        held = items(node, "weights") or items(self.document.entry("meshes", node.get("mesh")), "weights")
        return tuple(number("weights", each) for each in held)

    def copies(self, index: int) -> Reals:
        """Return the places of a node's mesh, float64 [k, 4, 4]: one, unless the node has instances of it."""
        node = self.document.entry("nodes", index)
        many = None if "skin" in node else extension(node, INSTANCING)
        if many is None:
            if "skin" in node and extension(node, INSTANCING) is not None:
                self.document.note(f"instances left out: those of a mesh with a skin ({INSTANCING})")
            return self._worlds[index : index + 1]
        attributes = dict(fields(many, "attributes"))
        counts = {self.accessors.count(each) for each in attributes.values()}
        if len(counts) != 1:
            damaged(f"{INSTANCING}: expected attributes of one length, got {len(counts)}")
        (count,) = counts
        parts = {}
        for name, default in (("translation", (0.0,) * 3), ("rotation", (0.0, 0.0, 0.0, 1.0)), ("scale", (1.0,) * 3)):
            given = attributes.pop(name.upper(), None)
            kind = f"VEC{len(default)}"
            parts[name] = np.tile(default, (count, 1)) if given is None else self.accessors.floats(given, name, kind)
        if attributes:
            self.document.note(f"attributes of instances left out: {listed(map(named, sorted(attributes)))}")
        return product(self._worlds[index], composed(**parts))

    def skin(self, index: int) -> Reals | None:
        """Return what moves each joint of a node's skin from its rest, float64 [j, 4, 4], or None without a skin."""
        node = self.document.entry("nodes", index)
        if "skin" not in node:
            return None
        skin = self.document.entry("skins", node["skin"])
        if node["skin"] not in self._skins:
            count = len(self._worlds)
            joints = self._worlds[[place("joints", joint, count) for joint in items(skin, "joints")]]
            if "inverseBindMatrices" in skin:
                rests = self.accessors.floats(skin["inverseBindMatrices"], "inverseBindMatrices", "MAT4")
                if len(rests) < len(joints):
                    damaged(f"inverseBindMatrices: expected {len(joints)}, one for each joint, got {len(rests)}")
                columns = rests[: len(joints)].astype(np.float64).reshape(-1, 4, 4)
                joints = product(joints, columns.transpose(0, 2, 1))
            self._skins[node["skin"]] = joints
        return self._skins[node["skin"]]


def skinned(primitive: Primitive, joints: Reals) -> Reals:
    """Return the transform of each vertex: the mean of its joints' ones by their weights, float64 [n, 3, 4].

    joints: as of Poses.skin. Vertices without weights follow their first joint. Raises InputError.
    """
    columns = list[tuple[AnyArray, Reals]]()
    while primitive.has(name := f"JOINTS_{len(columns) // 4}"):
        share = name.replace("JOINTS", "WEIGHTS")
        if not primitive.has(share):
            damaged(f"{name}: expected {share} with it, got none")
        places, weights = primitive.stored(name, "VEC4"), primitive.floats(share, (), "VEC4").astype(np.float64)
        weights = np.where(weights > 0, weights, 0.0)
        used = places[weights > 0]
        if places.dtype.kind != "u" or (used.size and int(used.max()) >= len(joints)):
            damaged(f"{name}: expected joints 0..{len(joints) - 1} of the skin, got others")
        columns += zip(np.where(weights > 0, places, 0).T, weights.T, strict=True)
    sums = np.zeros(primitive.count)
    for _, weights in columns:
        sums += weights
    lost = sums == 0
    found = np.zeros((primitive.count, 3, 4))
    for places, weights in columns:
        found += (weights / np.where(lost, 1, sums))[:, None, None] * joints[places, :3]
    if lost.any():
        first = primitive.stored("JOINTS_0", "VEC4")[lost, 0]
        found[lost] = joints[np.where(first < len(joints), first, 0), :3]
    return found


def placed(
    points: AnyArray, normals: AnyArray | None, faces: AnyArray, matrix: Reals
) -> tuple[Reals, Reals | None, AnyArray]:
    """Return vertices [k * n, 3], unit normals or None, and faces [k * m, 3] in the world.

    points, normals: [n, 3]. faces: [m, 3], lines [m, 2] or points [m, 1].
    matrix: [k, 1, 4, 4] for k copies of all, or [1, n, 3, 4] of each vertex.
    Where a transform mirrors, two corners of a face are swapped, so that its front stays its front (section 3.7.4).
    """
    count, size = len(matrix), len(points)
    if count == 1 and matrix.shape[1] == 1 and np.array_equal(matrix[0, 0, :3], np.eye(4)[:3]):
        return points.astype(np.float64), normals, faces
    vertices = moved(points[None], matrix)
    turns, signs = cofactors(matrix)
    if normals is not None:
        normals = turned(normals[None], turns * np.sign(signs)[..., None, None])
        normals /= np.sqrt(normals[..., 0:1] ** 2 + normals[..., 1:2] ** 2 + normals[..., 2:3] ** 2)
        normals = normals.reshape(-1, 3)
    if count > 1:
        faces = (faces[None] + size * np.arange(count)[:, None, None]).reshape(-1, faces.shape[1])
    if faces.shape[1] == 3 and (signs < 0).any():
        mirrored = np.broadcast_to(signs < 0, (count, size)).reshape(-1)[faces[:, 0]]
        faces = np.where(mirrored[:, None], faces[:, [0, 2, 1]], faces)
    return vertices.reshape(-1, 3), normals, faces
