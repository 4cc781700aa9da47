"""USD: converts what is visible of a stage to a Scene, with transforms, instances and materials, by usd-core."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.gltf_pose import placed
from clpeel.reading.marks import together
from clpeel.reading.transforms import Reals, product
from clpeel.reading.usd_materials import Materials
from clpeel.reading.usd_meshes import SHAPES, Shapes
from clpeel.reading.words import one_line
from clpeel.scene.scene import Scene

_MOST_COPIES = 2**27
"""The most vertices that instances may draw. Otherwise a small file could ask for all the memory there is."""

_UPRIGHT = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
"""What turns a stage whose Z is up, so that Y is."""

_QUIET = ("Xform", "Scope", "Material", "Shader", "NodeGraph", "GeomSubset", "Camera", "SkelRoot", "Skeleton", "")
"""Types of prims that are no shapes, and whose absence from the picture needs no note."""


def from_usd(path: str, companions: Companions) -> Scene:
    """Return what a stage shows, with Y up. Lengths stay as the stage has them.

    Visible shapes whose purpose is default or render are drawn, with references, payloads and instances, as their
    values stand at the stage's first moment. Both sides of faces are drawn, whatever doubleSided says, as it only
    allows to leave some out. Colours are linear, as USD has them. companions: the files that textures may lie among.
    Raises InputError if the stage cannot be opened or shows nothing, and if arrays of a mesh do not fit together.
    """
    from pxr import Sdf, Tf, Usd, UsdGeom

    try:
        _check_layers(Sdf.Layer.FindOrOpen(path))
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        told = getattr(error.args[0], "commentary", error) if error.args else error
        raise InputError(f"not a readable mesh: the file is damaged (USD: {_reason(told, path)})") from None
    began = stage.HasAuthoredTimeCodeRange()
    moment = Usd.TimeCode(stage.GetStartTimeCode()) if began else Usd.TimeCode.EarliestTime()
    walk = _Walk(stage, moment, Shapes(moment, Materials(moment, companions)))
    up = _UPRIGHT if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else np.eye(4)
    walk.draw(stage.GetPseudoRoot(), None, up[None])
    scene = together(walk.scenes)
    notes = [*(f"USD reports: {_reason(each, path)}" for each in stage.GetCompositionErrors()), *walk.notes()]
    if scene is None:
        raise InputError(f"expected meshes, got {'; '.join(notes)[:300] or 'none'}; the stage is empty")
    return replace(scene, notes=tuple(dict.fromkeys((*scene.notes, *notes))))


def _check_layers(root: Any) -> None:
    """Raise InputError if a layer, or one that it refers to, is no regular file. To open a pipe could block forever."""
    from pxr import Sdf, Tf

    left, seen = [root], set[str]()
    while left:
        layer = left.pop()
        for name in [] if layer is None else layer.GetCompositionAssetDependencies():
            path = layer.ComputeAbsolutePath(name)
            if path in seen or not os.path.exists(path):
                continue
            seen.add(path)
            if not os.path.isfile(path):
                raise InputError(f"expected references to regular files, got {named(name)}")
            with contextlib.suppress(Tf.ErrorException):  # the stage reports it, too
                left.append(Sdf.Layer.FindOrOpen(path))


def _reason(told: object, path: str) -> str:
    """Return what USD says of an error, on a short line without the file's own path."""
    return one_line(ValueError(str(told).replace(path, "the file"))).removeprefix("ValueError: ")


class _Walk:
    """Draws the prims of a stage below one another, and counts what is left out."""

    def __init__(self, stage: Any, moment: Any, shapes: Shapes) -> None:
        from pxr import UsdGeom

        self._stage, self._moment, self._shapes = stage, moment, shapes
        self._places = UsdGeom.XformCache(moment)
        self._others, self._hidden = Counter[str](), Counter[str]()
        self._drawn = 0
        self._inside: list[Any] = []
        self.scenes: list[Scene] = []

    def notes(self) -> list[str]:
        """Return what is not drawn."""
        others = ", ".join(f"{count} {kind}" for kind, count in sorted(self._others.items()))
        hidden = ", ".join(f"{count} {kind}" for kind, count in self._hidden.items())
        return [
            *([f"left out: {others}"] if others else []),
            *([f"not shown, as the stage says: {hidden}"] if hidden else []),
            *self._shapes.notes(),
        ]

    def draw(self, root: Any, above: Any, copies: Reals) -> None:
        """Draw a prim and what is below it. above: the prim whose place counts as the origin, or None for the world.

        copies: where it is drawn, float64 [k, 4, 4]. Raises InputError.
        """
        from pxr import UsdGeom

        for prim in self._shown(root):
            kind = prim.GetTypeName()
            own = self._places.GetLocalToWorldTransform(prim) if above is None else self._below(prim, above)
            matrix = product(copies, _column(own)[None])
            if kind == "PointInstancer":
                self._instances(UsdGeom.PointInstancer(prim), matrix)
            elif kind in SHAPES:
                self._place(self._shapes.scene(prim), matrix)
            elif kind not in _QUIET and (prim.IsA(UsdGeom.Gprim) or kind.endswith("Light") or "Volume" in kind):
                self._others[kind] += 1

    def _below(self, prim: Any, above: Any) -> Any:
        """Return the transform of a prim below another, without that of the upper one."""
        return self._places.ComputeRelativeTransform(prim, above)[0]

    def _shown(self, root: Any) -> Iterator[Any]:
        """Yield the prims from this one down, without hidden ones, and without what instances are made of."""
        from pxr import Usd, UsdGeom

        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
        for prim in walk:
            if prim.IsA(UsdGeom.Imageable):
                imageable = UsdGeom.Imageable(prim)
                if imageable.GetVisibilityAttr().Get(self._moment) == UsdGeom.Tokens.invisible:
                    self._hidden["invisible"] += 1
                    walk.PruneChildren()
                    continue
                purpose = imageable.ComputePurpose()
                if purpose in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide):
                    self._hidden[f"of purpose {purpose}"] += 1
                    walk.PruneChildren()
                    continue
            if prim.GetTypeName() == "PointInstancer":
                walk.PruneChildren()
            yield prim

    def _instances(self, instancer: Any, matrix: Reals) -> None:
        """Draw the prototypes of a PointInstancer where its instances stand. matrix: where it stands, [k, 4, 4]."""
        prototypes = [self._stage.GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetForwardedTargets()]
        kinds = np.asarray(instancer.GetProtoIndicesAttr().Get(self._moment) or (), np.int64)
        places = instancer.ComputeInstanceTransformsAtTime(self._moment, self._moment)
        mask = instancer.ComputeMaskAtTime(self._moment)
        unknown = ((kinds < 0) | (kinds >= len(prototypes))).any()
        if len(places) != sum(mask or [True] * len(kinds)) or unknown:
            raise InputError(f"{instancer.GetPath()}: its instances do not fit together; the file is damaged")
        if instancer.GetPath() in self._inside:
            raise InputError(f"{instancer.GetPath()}: it draws itself; the file is damaged")
        self._inside.append(instancer.GetPath())
        kinds = kinds[np.asarray(mask, bool)] if mask else kinds
        columns = np.array([_column(place) for place in places]).reshape(-1, 4, 4)
        for number, prototype in enumerate(prototypes):
            own = columns[kinds == number]
            if len(own) and prototype:
                _check_number(len(matrix) * len(own))
                self.draw(prototype, prototype, product(matrix[:, None], own[None]).reshape(-1, 4, 4))
        self._inside.pop()

    def _place(self, scene: Scene | None, matrix: Reals) -> None:
        """Add copies of a scene where they stand. Raises InputError if there are too many."""
        if scene is None:
            return
        self._drawn += len(matrix) * len(scene.vertices)
        _check_number(self._drawn)
        self.scenes.append(_copied(scene, matrix))


def _column(matrix: Any) -> Reals:
    """Return a matrix of USD, which stands behind rows, as one that stands before columns, float64 [4, 4]."""
    return np.array(matrix, np.float64).T


def _check_number(vertices: int) -> None:
    """Raise InputError if instances draw too many vertices."""
    if vertices > _MOST_COPIES:
        raise InputError(f"expected at most {_MOST_COPIES:,} vertices with all instances, got {vertices:,} or more")


def _copied(scene: Scene, matrix: Reals) -> Scene:
    """Return copies of a scene in their places, [k, 4, 4]. Where one mirrors, fronts stay fronts."""
    count, size = len(matrix), len(scene.vertices)
    vertices, normals, faces = placed(scene.vertices, scene.vertex_normals, scene.faces, matrix[:, None])
    polygons = 0 if scene.polygons is None else 1 + int(scene.polygons.max(initial=0))
    return replace(
        scene,
        vertices=vertices,
        faces=faces.astype(np.int32),
        vertex_normals=None if normals is None else normals.astype(np.float32),
        vertex_colors=_again(scene.vertex_colors, count),
        face_colors=_again(scene.face_colors, count),
        uv=_again(scene.uv, count),
        more_uv=tuple(np.tile(uv, (count, 1)) for uv in scene.more_uv),
        face_materials=_again(scene.face_materials, count),
        polygons=_again(scene.polygons, count, polygons),
        lines=_again(scene.lines, count, size),
        points=_again(scene.points, count, size),
    )


def _again(values: Any, count: int, step: int = 0) -> Any:
    """Return an array, or None, so many times, one after another. step: what each time adds to the values."""
    if values is None:
        return None
    steps = np.arange(count, dtype=values.dtype).reshape(-1, *[1] * values.ndim) * values.dtype.type(step)
    return (values + steps).reshape(-1, *values.shape[1:])
