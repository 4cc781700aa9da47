"""USD's shapes: meshes, points, curves and simple solids as Scenes about their own origins, with their colours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import named
from clpeel.reading.corners import Places
from clpeel.reading.marks import chains, marks
from clpeel.reading.polygons import Polygons, Varying
from clpeel.reading.usd_materials import Look, Materials, Placing
from clpeel.scene.arrays import AnyArray
from clpeel.scene.scene import Scene
from clpeel.scene.textures import srgb

_AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
"""Where x, y and z of a solid along Z go, by the axis that it has instead."""


class Shapes:
    """The scenes of shapes at one moment. Instances share them, and notes say what they lack."""

    def __init__(self, moment: Any, materials: Materials) -> None:
        self._moment, self._materials = moment, materials
        self._made: dict[Any, Scene | None] = {}
        self._losses = Counter[str]()

    def notes(self) -> list[str]:
        """Return what is not drawn of the shapes so far, and of their materials."""
        losses = [f"{words} ({count} shape{'s' * (count > 1)})" for words, count in self._losses.items()]
        return [*losses, *self._materials.notes()]

    def scene(self, prim: Any) -> Scene | None:
        """Return the scene of a shape about its own origin, or None if it is empty. Raises InputError."""
        key = prim.GetPath()
        if key not in self._made:
            try:
                self._made[key] = SHAPES[prim.GetTypeName()](self, prim)
            except InputError as error:
                raise InputError(f"{named(str(key))}: {error}") from None
        return self._made[key]

    def _get(self, prim: Any, name: str) -> Any:
        """Return what an attribute has at this moment, or None."""
        return prim.GetAttribute(name).Get(self._moment)

    def _rows(self, prim: Any, name: str, width: int) -> AnyArray:
        """Return an array of numbers, [n, width]. It is empty if the attribute has none."""
        value = self._get(prim, name)
        return np.zeros((0, width)) if value is None else np.asarray(value, np.float64).reshape(-1, width)

    def _places(self, prim: Any, name: str) -> Places:
        """Return an array of integers, int64 [n]. It is empty if the attribute has none."""
        value = self._get(prim, name)
        return np.zeros(0, np.int64) if value is None else np.asarray(value, np.int64)

    # --- meshes -------------------------------------------------------------------------------------------------------

    def mesh(self, prim: Any) -> Scene | None:
        """Return a Mesh: its polygons, or the cage of a subdivision surface."""
        points, counts = self._rows(prim, "points", 3), self._places(prim, "faceVertexCounts")
        polygons = Polygons(points, counts, self._places(prim, "faceVertexIndices"))
        scheme = prim.GetAttribute("subdivisionScheme")
        if scheme.HasAuthoredValue() and scheme.Get() != "none":
            self._losses["subdivision surfaces are drawn as their cages"] += 1
        if "SkelBindingAPI" in prim.GetAppliedSchemas():
            self._losses["skinned meshes are drawn in their bind pose"] += 1
        kept = np.ones(len(counts), bool)
        holes = self._places(prim, "holeIndices")
        kept[holes[(holes >= 0) & (holes < len(counts))]] = False
        turned = self._get(prim, "orientation") == "leftHanded"
        return self._faces(prim, polygons, kept, turned, scheme.Get() == "none" or not scheme.HasAuthoredValue())

    def _faces(self, prim: Any, polygons: Polygons, kept: AnyArray, turned: bool, normals: bool) -> Scene | None:
        """Return the polygons of a prim with its colours and materials, or None without any. Raises InputError."""
        looks, of_faces = self._materials.of(prim, len(polygons.counts))
        varying = dict[str, Varying]()
        own = self._normals(prim, polygons) if normals else None
        if own is not None:
            varying["vertex_normals"] = own
        varying |= self._coordinates(prim, polygons, looks, of_faces)
        color = self._colors(prim, polygons, looks, bool((of_faces >= 0).all()))
        if isinstance(color, Varying):
            varying["vertex_colors"] = color
        given, polygon = polygons.fields(varying, kept, turned)
        if not len(polygon):
            return None
        more = [given.pop(name) for name in sorted(given) if name.startswith("uv") and name != "uv"]
        if more:
            given["more_uv"] = more
        if color is not None and not isinstance(color, Varying):
            given["color"] = color
        if looks:
            given |= {"materials": [look.material for look in looks], "face_materials": of_faces[polygon]}
        return Scene.from_arrays(**given)

    def _varying(self, primvar: Any, polygons: Polygons, width: int) -> Varying | None:
        """Return what a primvar says for each corner, or None, after a note, if it does not fit the mesh."""
        value = primvar.ComputeFlattened(self._moment)
        if value is None:
            return None
        values = np.asarray(value, np.float64).reshape(-1, width)
        how = primvar.GetInterpolation()
        at = polygons.corners
        if how in ("constant", "uniform"):
            at = polygons.face_of_corner * int(how == "uniform")
        elif how == "faceVarying":
            at = np.arange(len(polygons.corners))
        expected = {
            "constant": 1,
            "uniform": len(polygons.counts),
            "faceVarying": len(polygons.corners),
        }.get(how, len(polygons.points))
        if len(values) < expected or not len(values):
            self._losses[f"{primvar.GetName()} left out: {len(values)} values where {expected} are expected"] += 1
            return None
        if how in ("uniform", "faceVarying"):
            once = Varying.of_corners(values)
            return Varying(once.values, once.index[at])
        return Varying(values, at)

    def _normals(self, prim: Any, polygons: Polygons) -> Varying | None:
        """Return the normals of a mesh's corners, or None if it has none. Those of a primvar come first."""
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
        if primvar and primvar.HasValue():
            return self._varying(primvar, polygons, 3)
        values = self._rows(prim, "normals", 3)
        if not len(values):
            return None
        how = UsdGeom.PointBased(prim).GetNormalsInterpolation()
        sizes = {"vertex": len(polygons.points), "varying": len(polygons.points), "uniform": len(polygons.counts)}
        at = {"uniform": polygons.face_of_corner, "faceVarying": np.arange(len(polygons.corners))}
        if how == "constant" or len(values) < sizes.get(how, len(polygons.corners)):
            self._losses["normals left out, as they do not fit the mesh"] += 1
            return None
        once = Varying.of_corners(values)
        return Varying(once.values, once.index[at.get(how, polygons.corners)])

    def _coordinates(self, prim: Any, polygons: Polygons, looks: list[Look], of_faces: Places) -> dict[str, Varying]:
        """Return the texture coordinates that the materials name, by uv, uv1, uv2 and so on, v pointing down.

        Each material has places of its own in these.
        """
        count = max((len(look.placings) for look in looks), default=0)
        material = of_faces[polygons.face_of_corner]
        found = dict[str, Varying]()
        for slot in range(count):
            values = np.zeros((len(polygons.corners), 2))
            for number, look in enumerate(looks):
                if slot < len(look.placings):
                    own = material == number
                    values[own] = self._placed(prim, polygons, look.placings[slot])[own]
            found[f"uv{slot}" if slot else "uv"] = Varying.of_corners(values)
        return found

    def _placed(self, prim: Any, polygons: Polygons, placing: Placing) -> AnyArray:
        """Return where a texture lies at each corner, [c, 2]: 0 if the mesh lacks the coordinates, with a note."""
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(placing.name)
        varying = self._varying(primvar, polygons, 2) if primvar and primvar.HasValue() else None
        if varying is None:
            self._losses[f"texture coordinates {named(placing.name)} are missing: textures have one colour"] += 1
            return np.zeros((len(polygons.corners), 2))
        return placing.at(varying.values)[varying.index]

    def _colors(
        self, prim: Any, polygons: Polygons, looks: list[Look], covered: bool = False
    ) -> Varying | AnyArray | None:
        """Return the colours of corners, or one for all, [4], or None. covered: whether all faces have materials.

        They are linear for materials that ask for them. Without materials, they are shown, and so display-referred.
        """
        asked = [look.colors for look in looks if look.colors is not None]
        if covered and not asked:
            return None
        rgb = self._primvar(prim, asked[0] if asked else "displayColor", polygons, 3)
        alpha = None if asked else self._primvar(prim, "displayOpacity", polygons, 1)
        if rgb is None and alpha is None:
            return None
        if not asked and rgb is not None:
            rgb = Varying(srgb(np.clip(rgb.values, 0, 1)), rgb.index)
        rgb = rgb or Varying(np.array([[120, 150, 190]]) / 255, np.zeros(len(polygons.corners), np.int64))
        alpha = alpha or Varying(np.ones((1, 1)), np.zeros(len(polygons.corners), np.int64))
        if len(rgb.values) == len(alpha.values) == 1:
            return np.clip(np.nan_to_num(np.append(rgb.values[0], alpha.values[0])), 0, 1)
        both = np.concatenate([rgb.values[rgb.index], alpha.values[alpha.index]], axis=1)
        return Varying.of_corners(np.clip(np.nan_to_num(both), 0, 1))

    def _primvar(self, prim: Any, name: str, polygons: Polygons, width: int) -> Varying | None:
        """Return what a primvar of this name says, its own or that of a prim above it, or None."""
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        return self._varying(primvar, polygons, width) if primvar and primvar.HasValue() else None

    # --- points and curves --------------------------------------------------------------------------------------------

    def points(self, prim: Any) -> Scene | None:
        """Return Points. Their widths are noted, as all points of a picture have one size."""
        places = self._rows(prim, "points", 3)
        return self._marks(prim, places, points=np.arange(len(places)))

    def curves(self, prim: Any) -> Scene | None:
        """Return BasisCurves as polylines: cubic ones through their control points."""
        places, counts = self._rows(prim, "points", 3), self._places(prim, "curveVertexCounts")
        if counts.sum() != len(places) or (len(counts) and counts.min() < 0):
            raise InputError(f"curves: expected {counts.sum()} points, got {len(places)}; the mesh is damaged")
        if self._get(prim, "type") == "cubic":
            self._losses["cubic curves are drawn as lines through their control points"] += 1
        ends = chains(counts)
        if self._get(prim, "wrap") == "periodic":
            last = np.cumsum(counts)[counts > 2]
            ends = np.concatenate([ends, np.stack([last - 1, last - counts[counts > 2]], axis=1)])
        return self._marks(prim, places, lines=ends)

    def _marks(self, prim: Any, places: AnyArray, **kinds: Any) -> Scene | None:
        """Return lines or points in their displayColor, or in the plain colour of their material."""
        if self._get(prim, "widths") is not None:
            self._losses[f"widths of {prim.GetTypeName()} left out: --line-width and --point-size are for all"] += 1
        polygons = Polygons(places, np.full(len(places), 1), np.arange(len(places)))
        color, looks = self._colors(prim, polygons, []), self._materials.of(prim, 0)[0]
        if looks and color is None:
            material = looks[0].material
            color = np.array([*srgb(material.base_color[:3]), material.opacity])
            if looks[0].placings:
                self._losses["textures of lines and points left out"] += 1
        if isinstance(color, Varying):
            return marks(places, **kinds, vertex_colors=color.values[color.index])
        return marks(places, **kinds, color=color)

    # --- solids -------------------------------------------------------------------------------------------------------

    def solid(self, prim: Any) -> Scene | None:
        """Return a Sphere, Cube, Cylinder, Cone, Capsule or Plane."""
        import trimesh

        kind = str(prim.GetTypeName()).removesuffix("_1")
        size = {name: float(self._get(prim, name) or 0) for name in ("radius", "height", "size", "width", "length")}
        make = trimesh.creation
        if kind == "Plane":
            x, y = size["width"] / 2, size["length"] / 2
            points, faces = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]]), np.array([[0, 1, 2, 3]])
        elif kind == "Cube":
            corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            points, faces = corners * size["size"] / 2, _CUBE
        else:
            mesh = {
                "Sphere": lambda: make.uv_sphere(size["radius"], count=[32, 64]),
                "Cylinder": lambda: make.cylinder(size["radius"], size["height"], sections=64),
                "Cone": lambda: make.cone(size["radius"], size["height"], sections=64),
                "Capsule": lambda: make.capsule(size["height"], size["radius"], count=[64, 32]),
            }[kind]()
            points, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
            points = points - [0, 0, size["height"] / 2] if kind == "Cone" else points
        axis = self._get(prim, "axis") if kind not in ("Sphere", "Cube") else "Z"
        points = points[:, _AXES[str(axis or "Z")]]
        polygons = Polygons(points, np.full(len(faces), faces.shape[1]), faces.reshape(-1).astype(np.int64))
        return self._faces(prim, polygons, np.ones(len(faces), bool), False, False)


_CUBE = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""The sides of a cube whose corners are counted by x, then y, then z."""

SHAPES: dict[str, Callable[[Shapes, Any], Scene | None]] = {
    "Mesh": Shapes.mesh,
    "Points": Shapes.points,
    "BasisCurves": Shapes.curves,
    **dict.fromkeys(("Sphere", "Cube", "Cylinder", "Cone", "Capsule", "Plane"), Shapes.solid),
    **dict.fromkeys(("Cylinder_1", "Capsule_1"), Shapes.solid),
}
"""How each type of shape is made."""
