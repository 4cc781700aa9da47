"""The nodes of a glTF file: where each stands in the world, and which of them the scene shows, in which order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from clpeel.reading.gltf_document import Document, Json, damaged, items, numbers, place, title
from clpeel.reading.losses import listed
from clpeel.reading.transforms import Reals, product

Moved = Mapping[tuple[int, str], Reals]
"""What an animation sets at one moment: by a node's index and "translation", "rotation", "scale" or "weights"."""

_IDENTITY = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


def worlds(document: Document, moved: Moved) -> Reals:
    """Return the global transform of every node: float64 [n, 4, 4], column vectors (glTF 2.0, section 3.5.3).

    Raises InputError if a node has two parents, or is its own ancestor.
    """
    nodes = document.entries("nodes")
    found = _locals(nodes, moved)
    parents = _parents(nodes)
    level, done = np.flatnonzero(parents < 0), 0
    children = np.argsort(parents, kind="stable")
    starts = np.searchsorted(parents[children], np.arange(len(nodes) + 1))
    while len(level):
        done += len(level)
        below = [children[starts[node] : starts[node + 1]] for node in level]
        level = np.concatenate(below)
        found[level] = product(found[parents[level]], found[level])
    if done != len(nodes):
        damaged(f"nodes: {len(nodes) - done} of them are their own ancestors")
    return found


def _parents(nodes: list[Json]) -> Any:
    """Return the index of each node's parent, -1 if it has none: int64 [n]. Raises InputError if a node has two."""
    parents = np.full(len(nodes), -1)
    for index, node in enumerate(nodes):
        for child in items(node, "children"):
            if parents[place("children", child, len(nodes))] >= 0:
                damaged(f"nodes: expected one parent for node {child}, got two")
            parents[child] = index
    return parents


def _locals(nodes: list[Json], moved: Moved) -> Reals:
    """Return each node's local transform, float64 [n, 4, 4]: its matrix, or of its translation, rotation and scale."""
    parts = {name: np.tile(values, (len(nodes), 1)) for name, values in _IDENTITY.items()}
    matrices = {}
    for index, node in enumerate(nodes):
        for name, values in _IDENTITY.items():
            if name in node:
                parts[name][index] = numbers(name, node[name], len(values))
        if "matrix" in node and not any((index, name) in moved for name in _IDENTITY):
            matrices[index] = np.reshape(numbers("matrix", node["matrix"], 16), (4, 4)).T
    for (index, name), value in moved.items():
        if name in parts:
            parts[name][index] = value
    found = composed(**parts)
    for index, matrix in matrices.items():
        found[index, :3] = matrix[:3]
    return found


def composed(translation: Reals, rotation: Reals, scale: Reals) -> Reals:
    """Return the transforms [n, 4, 4] of translations [n, 3], quaternions x, y, z, w [n, 4] and scales [n, 3].

    Quaternions of any length stand for their direction, and those of no length for no rotation.
    """
    length = np.sqrt((rotation**2).sum(axis=1, keepdims=True))
    x, y, z, w = np.where(length == 0, _IDENTITY["rotation"], rotation / np.where(length == 0, 1, length)).T
    found = np.zeros((len(translation), 4, 4))
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    for row, values in enumerate(rows):
        for column, value in enumerate(values):
            found[:, row, column] = value * scale[:, column]
    found[:, :3, 3] = translation
    found[:, 3, 3] = 1
    return found


def shown(document: Document) -> list[int]:
    """Return the nodes of the default scene, each before its children. Notes the scenes that are left out.

    That scene is the one that the file names, else the first; without scenes, it is all nodes. Raises InputError.
    """
    nodes, scenes = document.entries("nodes"), document.entries("scenes")
    if not scenes:
        roots = [int(node) for node in np.flatnonzero(_parents(nodes) < 0)]
    else:
        default = place("scene", document.tree.get("scene", 0), len(scenes))
        roots = items(scenes[default], "nodes")
        others = [title(scene, index) for index, scene in enumerate(scenes) if index != default and scene.get("nodes")]
        if others:
            document.note(f"scenes left out, as only the default one is drawn: {listed(others)}")
    found, seen, left = [], set[int](), [place("scene", node, len(nodes)) for node in reversed(roots)]
    while left:
        node = left.pop()
        if node not in seen:
            seen.add(node)
            found.append(node)
            left += reversed(items(nodes[node], "children"))
    return found
