"""A scene: the triangles, lines and points to render, with colours and normals, checked on input."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.errors import InputError
from clpeel.scene.arrays import (
    DEFAULT_COLOR,
    AnyArray,
    Colors,
    alike,
    as_float,
    checked_colors,
    checked_faces,
    checked_flags,
    checked_indices,
    checked_normals,
    checked_opacity,
    checked_polygons,
    checked_uv,
    checked_vertices,
    counted_alphas,
)
from clpeel.scene.digest import digest
from clpeel.scene.lights import Lamp, checked_lights
from clpeel.scene.materials import NO_MATERIAL, Material, Surfaces, checked_materials, recolored_material
from clpeel.scene.textures import linear

if TYPE_CHECKING:
    from clpeel.pictures.colormaps import ColorMap

_FAR_FROM_ORIGIN = 16.0  # in half diagonals; farther away, float32 spends four bits or more on the offset
_SCALE_EXPONENT = 60  # outside 2**±60, products of a few coordinates could leave the range of float32


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions for the device, p = (vertices - origin) * scale, as float32 pairs p = hi + lo.

    hi: float32 [n, 3]. lo: float32 [n, 3], or None if hi is exact. origin: float64 [3], scene units. scale: 1, or the
    power of two that brings the scene to a size of about 1.
    """

    hi: NDArray[np.float32]
    lo: NDArray[np.float32] | None
    origin: NDArray[np.float64]
    scale: float


@dataclass(frozen=True)
class OpticalDepths:
    """Statistics of the optical depths -ln(1 - alpha) of transparent colours. All are 0 if there are none.

    mean, deviation: the mean and the standard deviation. most_alpha: the greatest alpha of a transparent colour, 0..1.
    """

    mean: float
    deviation: float
    most_alpha: float


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """Triangles, lines and points with colours. `Scene.from_arrays` and `clpeel.load` make one, and check their input.

    vertices: float64 [n, 3], scene units. NaN and infinite ones are allowed; their triangles are discarded when drawn.
    faces: int32 [m, 3], indices into vertices. Their order is the submission order.
    Exactly one of face_colors [m + k + p, 4], vertex_colors [n, 4] and color [4] is set: RGBA, uint8 0..255 or float32
    0..1. face_colors are those of the faces, and behind them of the lines and of the points, if there are any.
    vertex_normals: float32 [n, 3] of any length, with NaN rows where unknown. None if the source has none.
    materials: what the colours of faces are made of (materials.py). face_materials: int32 [m], the place of each face's
    material in `materials`, or NO_MATERIAL; None if there are no materials. On faces that have one, the scene's colours
    are linear. uv: float32 [n, 2], texture coordinates; (0, 0) is the upper left corner of an image, and v points down.
    None if no material has a texture. more_uv: further ones, which textures of materials' lights name by number.
    single_sided: bool [m], faces that are seen from their front alone, from where their corners run counterclockwise.
    None if there are none.
    polygons: int32 [m], the same number for the triangles that one polygon of the file became; None if all faces are
    triangles. What lies between them is no edge of the polygon, so it is not drawn as one.
    lights: the scene's own (lights.py), for render(lighting="scene").
    lines: int32 [k, 2], indices into vertices, a line segment each. points: int32 [p], indices into vertices. Either is
    None if there are none. They are drawn behind the faces in submission order, lines first. They have no material, and
    the scene's colours as they are.
    vertex_arrays, face_arrays: numbers by name that the picture does not show, until scalars.py makes colours of some:
    [n] or [n, components]; and as many rows as face_colors has.
    notes: what the loader could not keep, one line each.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    face_colors: Colors | None = None
    vertex_colors: Colors | None = None
    color: Colors | None = None
    vertex_normals: NDArray[np.float32] | None = None
    materials: tuple[Material, ...] = ()
    face_materials: NDArray[np.int32] | None = None
    uv: NDArray[np.float32] | None = None
    more_uv: tuple[NDArray[np.float32], ...] = ()
    single_sided: NDArray[np.bool_] | None = None
    polygons: NDArray[np.int32] | None = None
    lights: tuple[Lamp, ...] = ()
    lines: NDArray[np.int32] | None = None
    points: NDArray[np.int32] | None = None
    vertex_arrays: Mapping[str, AnyArray] = field(default_factory=dict)
    face_arrays: Mapping[str, AnyArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @staticmethod
    def from_arrays(
        vertices: ArrayLike,
        faces: ArrayLike = (),
        face_colors: ArrayLike | None = None,
        vertex_colors: ArrayLike | None = None,
        color: ArrayLike | None = None,
        *,
        vertex_normals: ArrayLike | None = None,
        opacity: float | None = None,
        materials: Sequence[Material] = (),
        face_materials: ArrayLike | None = None,
        uv: ArrayLike | None = None,
        more_uv: Sequence[ArrayLike] = (),
        single_sided: ArrayLike | None = None,
        polygons: ArrayLike | None = None,
        lights: Sequence[Lamp] = (),
        lines: ArrayLike | None = None,
        points: ArrayLike | None = None,
    ) -> Scene:
        """Return a scene made from arrays, all of which are checked.

        vertices: [n, 3] numbers. faces: [m, 3] integers 0..n-1. lines: [k, 2] integers 0..n-1, a segment each; segments
        that share an end are joined there. points: [p] integers 0..n-1. There must be at least one of all these. At
        most one of face_colors [m, 3|4],
        vertex_colors [n, 3|4] and color [3|4] may be given. Integer colours are 0..255, float colours 0..1, and colours
        without alpha are opaque. color may also be text, such as "steelblue" or "#rrggbbaa". Without any colour, it is
        DEFAULT_COLOR.
        vertex_normals: [n, 3] of any length. opacity: 0..1, replaces every alpha.
        materials: of faces (materials.py). face_materials: [m] integers, which of these each face has, or -1 for none;
        by default the first. On faces with a material, the colours given here are linear, and white by default.
        uv: [n, 2] texture coordinates, where (0, 0) is the upper left corner of an image. They are needed if a material
        has a texture. more_uv: further ones, [n, 2] each, for textures of lights that name them (materials.Finish).
        single_sided: [m] booleans, or one: faces that are seen from their front alone.
        polygons: [m] integers, the same for all triangles of one polygon, which has no edges between these.
        Lines and points have the colours of their vertices, or `color`. With face_colors they have DEFAULT_COLOR.

        Raises InputError, which names the argument, what was expected and what was given.
        """
        places = checked_vertices(vertices)
        segments = None if lines is None else checked_indices("lines", lines, len(places), 2)
        dots = None if points is None else checked_indices("points", points, len(places))
        triangles = checked_faces(faces, len(places), int(segments is None and dots is None))
        given = {"face_colors": face_colors, "vertex_colors": vertex_colors, "color": color}
        names = [name for name, value in given.items() if value is not None]
        if len(names) > 1:
            raise InputError(f"colours: expected at most one of {', '.join(given)}, got {' and '.join(names)}")
        of_faces = checked_materials(materials, face_materials, len(triangles))
        default = np.array([DEFAULT_COLOR], np.uint8)
        if not names and of_faces is None:
            color = default[0]
        elif not names and of_faces is not None:
            own = np.full((len(triangles), 4), 255, np.uint8)
            plain = np.array([*(material.plain for material in materials), True])
            own[plain[of_faces]] = default
            shown = own if segments is None and dots is None else np.append(own, default, axis=0)
            color, face_colors = (shown[0], None) if (shown == shown[0]).all() else (None, own)
        sets = max((material.uv_sets for material in materials), default=0)
        if uv is None and (sets or more_uv):
            raise InputError("uv: expected texture coordinates for a material with a texture, got none")
        if sets > 1 + len(more_uv):
            raise InputError(f"more_uv: expected {sets - 1}, as a texture of a light names it, got {len(more_uv)}")
        scene = Scene(
            places,
            triangles,
            face_colors=None if face_colors is None else checked_colors("face_colors", face_colors, (len(triangles),)),
            vertex_colors=None
            if vertex_colors is None
            else checked_colors("vertex_colors", vertex_colors, (len(places),)),
            color=None if color is None else checked_colors("color", color, ()),
            vertex_normals=None if vertex_normals is None else checked_normals(vertex_normals, len(places)),
            materials=tuple(materials),
            face_materials=of_faces,
            uv=None if uv is None else checked_uv("uv", uv, len(places)),
            more_uv=tuple(checked_uv("more_uv", each, len(places)) for each in more_uv),
            single_sided=None if single_sided is None else checked_flags("single_sided", single_sided, len(triangles)),
            polygons=None if polygons is None else checked_polygons(polygons, len(triangles)),
            lights=checked_lights(lights),
        )
        if segments is not None or dots is not None:
            scene = _with_marks(scene, segments, dots)
        return scene if opacity is None else recolored(scene, None, checked_opacity(opacity))

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """The least and the greatest corner of the finite vertices that are used: float64 [2, 3].

        They are zeros if there is no such vertex.
        """
        used = self.used & np.isfinite(self.vertices).all(axis=1)
        points = self.vertices if used.all() else self.vertices[used]
        corners = np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else np.zeros((2, 3))
        corners.flags.writeable = False
        return corners

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which vertices a face, a line or a point uses: bool [n]."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.faces.reshape(-1)] = True
        used[self.mark_vertices] = True
        return used

    @property
    def mark_vertices(self) -> NDArray[np.int32]:
        """The vertices of lines, two for each, and then of points: int32 [2 k + p]."""
        parts = [part.reshape(-1) for part in (self.lines, self.points) if part is not None]
        return np.concatenate(parts) if parts else np.zeros(0, np.int32)

    @property
    def counts(self) -> tuple[int, int, int]:
        """How many triangles, lines and points there are."""
        lines, points = (0 if part is None else len(part) for part in (self.lines, self.points))
        return len(self.faces), lines, points

    @property
    def described(self) -> str:
        """How much there is to draw, in words: "12 triangles, 30 lines, 500 points"."""
        counted = [(n, word) for n, word in zip(self.counts, ("triangle", "line", "point"), strict=True) if n]
        return ", ".join(f"{n:,} {word}{'s' * (n != 1)}" for n, word in counted)

    @property
    def opaque(self) -> bool:
        """Whether no fragment is transparent."""
        return self.surfaces == "opaque"

    @property
    def surfaces(self) -> str:
        """ "opaque" if all is opaque (all alphas are 1), "transparent" if nothing is, else "mixed"."""
        faces, marks = self.kinds, self.opaque_marks
        if faces.opaque.all() and marks.all():
            return "opaque"
        return "mixed" if (faces.opaque | faces.hiding).any() or marks.any() else "transparent"

    @cached_property
    def opaque_marks(self) -> NDArray[np.bool_]:
        """Which lines, and then which points, are opaque: bool [k + p]."""
        _, lines, points = self.counts
        alpha = self.colors[..., 3]
        solid: NDArray[np.bool_] = np.asarray(alpha == (255 if alpha.dtype == np.uint8 else 1))
        if self.vertex_colors is None:
            own = solid[len(self.faces) :] if self.face_colors is not None else solid
            return np.broadcast_to(own, (lines + points,))
        ends = solid[self.mark_vertices]
        return np.concatenate([ends[: 2 * lines].reshape(-1, 2).all(axis=1), ends[2 * lines :]])

    @cached_property
    def kinds(self) -> Surfaces:
        """What kind each face is. Where all faces are alike, the arrays are views of one element."""
        count = len(self.faces)
        alpha = self.colors[..., 3]
        solid: NDArray[np.bool_] = np.asarray(alpha == (255 if alpha.dtype == np.uint8 else 1))
        if self.vertex_colors is not None:
            solid = np.all(solid[self.faces], axis=1) if solid.any() else np.zeros(1, bool)
        elif self.face_colors is not None:
            solid = solid[:count]
        no = np.broadcast_to(np.zeros(1, bool), (count,))
        if self.face_materials is None:
            return Surfaces(np.broadcast_to(solid, (count,)), no, no)
        opaque, routed, hiding = np.broadcast_to(solid, (count,)).copy(), no.copy(), no.copy()
        unit = as_float(self.colors)[..., 3]
        unit = unit if self.face_colors is None else unit[:count]
        for place, material in enumerate(self.materials):
            if material.plain:
                continue
            own = np.flatnonzero(self.face_materials == place)
            if self.vertex_colors is not None:
                corners = unit[self.faces[own]]
            else:
                corners = np.broadcast_to(unit, (count,))[own]
            if len(own):
                opaque[own], routed[own], hiding[own] = material.kinds(corners)
        return Surfaces(opaque, routed, hiding)

    @cached_property
    def optical_depths(self) -> OpticalDepths:
        """Statistics of how much light the transparent colours absorb. Textures count with all their texels."""
        alpha = np.atleast_1d(self.colors[..., 3])
        if self.face_materials is None:
            values, counts = counted_alphas(alpha)
        else:
            values, counts = self._alphas_of_materials(alpha, self.face_materials)
        if counts.sum() == 0:
            return OpticalDepths(0.0, 0.0, 0.0)
        depths = -np.log1p(-values)
        mean = float(np.average(depths, weights=counts))
        deviation = math.sqrt(float(np.average((depths - mean) ** 2, weights=counts)))
        return OpticalDepths(mean, deviation, float(values[counts > 0].max()))

    def _alphas_of_materials(
        self, alpha: AnyArray, of_faces: NDArray[np.int32]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the transparent alphas of all faces, 0..1, and how often each occurs.

        alpha: of the scene's colours, [k]. of_faces: the material of each face, [m].
        """
        plain = self.plain_faces
        if self.vertex_colors is not None:
            own = np.concatenate([self.faces[plain].reshape(-1), self.mark_vertices])
            found = [counted_alphas(alpha[own])]
        else:
            rows = np.append(plain, np.ones(sum(self.counts[1:]) if self.face_colors is not None else 0, bool))
            found = [counted_alphas(np.broadcast_to(alpha, rows.shape)[rows])]
        most = float(as_float(alpha).max(initial=0.0))
        faces = np.bincount(of_faces[~plain], minlength=len(self.materials))
        for material, count in zip(self.materials, faces, strict=True):
            if count:
                values, shares = material.transparent_alphas(most)
                found.append((values, shares * count))
        values, counts = (np.concatenate(each) for each in zip(*found, strict=True))
        return values, counts

    @property
    def plain_faces(self) -> NDArray[np.bool_]:
        """Which faces have the scene's colours as they are: bool [m]."""
        if self.face_materials is None:
            return np.ones(len(self.faces), bool)
        return np.array([*(material.plain for material in self.materials), True])[self.face_materials]

    @property
    def color_maps(self) -> tuple[ColorMap, ...]:
        """The colour maps that colours of faces come from, each once."""
        maps = dict.fromkeys(material.color_map for material in self.materials)
        return tuple(each for each in maps if each is not None)

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of all that is drawn of the scene, in hexadecimal digits (digest.py)."""
        return digest(self)

    @property
    def colors(self) -> Colors:
        """The one colour array that is set. Raises InputError if none is."""
        for colors in (self.face_colors, self.vertex_colors, self.color):
            if colors is not None:
                return colors
        raise InputError("colours: expected face_colors, vertex_colors or color, got none; use Scene.from_arrays")

    def positions(self) -> Positions:
        """Return the vertices as the device gets them: near the origin, and of a size of about 1 if float32 needs that.

        The origin moves only if the scene's centre is more than 16 half diagonals away from it. It then moves to the
        centre, rounded to a power of two below the half diagonal, so that vertices that were float32 stay exactly
        float32. The scale is always a power of two. It is 1 unless the scene's size is above 2**60 or below 2**-60.
        """
        low, high = self.bounds
        center, half = low / 2 + high / 2, high / 2 - low / 2
        radius = math.hypot(*half)
        origin = np.zeros(3)
        if math.hypot(*center) > _FAR_FROM_ORIGIN * radius:
            grid = math.ldexp(1.0, math.frexp(radius)[1] - 1) if radius else 0.0
            origin = np.array([c - math.remainder(c, grid) if grid else c for c in center])
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            size = float(max(np.abs(low - origin).max(), np.abs(high - origin).max()))
            exponent = math.frexp(size)[1] if size else 0
            scale = math.ldexp(1.0, max(-1000, min(1000, -exponent))) if abs(exponent) > _SCALE_EXPONENT else 1.0
            points = (self.vertices - origin) * scale if origin.any() or scale != 1.0 else self.vertices
            hi = points.astype(np.float32)
            lo = (points - hi).astype(np.float32)
            lo[~np.isfinite(lo)] = 0
        return Positions(hi, lo if lo.any() else None, origin, scale)

    def __repr__(self) -> str:
        """Return what matters of the scene on one line: what there is, its colours, its materials and its bounds."""
        (x, y, z), (to_x, to_y, to_z) = self.bounds.tolist()
        parts = [self.described, self._colors_described]
        parts += [f"{len(self.materials)} material{'s' * (len(self.materials) != 1)}"] if self.materials else []
        parts += [f"{len(self.lights)} light{'s' * (len(self.lights) != 1)}"] if self.lights else []
        parts += [f"{len(self.notes)} note{'s' * (len(self.notes) != 1)}"] if self.notes else []
        return f"<Scene: {', '.join(parts)}, from ({x:.6g}, {y:.6g}, {z:.6g}) to ({to_x:.6g}, {to_y:.6g}, {to_z:.6g})>"

    @property
    def _colors_described(self) -> str:
        """Which colours there are, in words."""
        for name, colors in (("face colours", self.face_colors), ("vertex colours", self.vertex_colors)):
            if colors is not None:
                return name
        if self.color is None:
            return "no colours"
        levels = self.color if self.color.dtype == np.uint8 else np.rint(self.color * 255).astype(int)
        return "colour #" + "".join(f"{level:02x}" for level in levels[: 4 - int(levels[3] == 255)])

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, Any] | None:
        """Return what a notebook shows of the scene: a live view of it, or a picture. None outside of notebooks."""
        from clpeel.viewer.notebook import bundle

        return bundle(self)


# --- several scenes in one ------------------------------------------------------------------------------------------


def joined(scenes: Sequence[Scene]) -> Scene:
    """Return one scene with the triangles, lines and points of all scenes, in order.

    Raises InputError for 2**31 vertices or more.
    The colours take the smallest form that keeps them all: one colour if all scenes have the same, else face colours,
    or vertex colours if any scene has these.
    """
    if len(scenes) == 1:
        return scenes[0]
    notes = tuple(dict.fromkeys(note for scene in scenes for note in scene.notes))
    colors: dict[str, Any]
    flat = [scene.color for scene in scenes if scene.color is not None]
    if len(flat) == len(scenes) and all(c.dtype == flat[0].dtype and (c == flat[0]).all() for c in flat):
        colors = {"color": flat[0]}
    elif all(scene.vertex_colors is None for scene in scenes):
        colors = {"face_colors": _stacked_by_kind(scenes)}
    else:
        scenes = [with_vertex_colors(scene) if scene.face_colors is not None else scene for scene in scenes]
        colors = {"vertex_colors": _stacked(scenes, [len(scene.vertices) for scene in scenes])}
    counts = [len(scene.vertices) for scene in scenes]
    starts = np.cumsum([0, *counts])
    if starts[-1] >= 2**31:
        raise InputError(f"vertices: expected fewer than 2**31 in all, got {starts[-1]}")
    normals = None
    if any(scene.vertex_normals is not None for scene in scenes):
        normals = np.concatenate([_normals_or_nan(scene) for scene in scenes])
    uv = _joined_uv(scenes)
    single_sided = None
    if any(scene.single_sided is not None for scene in scenes):
        parts = [np.zeros(len(s.faces), bool) if s.single_sided is None else s.single_sided for s in scenes]
        single_sided = np.concatenate(parts)
    polygons = None
    if any(scene.polygons is not None for scene in scenes):
        several = [np.arange(len(s.faces)) if s.polygons is None else s.polygons for s in scenes]
        before = np.cumsum([0, *(int(part.max(initial=-1)) + 1 for part in several)])
        parts = [part + start for part, start in zip(several, before, strict=False)]
        polygons = checked_polygons(np.concatenate(parts), sum(map(len, parts)))
    vertices = np.concatenate([scene.vertices for scene in scenes])
    faces = np.concatenate([scene.faces + np.int32(start) for scene, start in zip(scenes, starts, strict=False)])
    materials, face_materials = _joined_materials(scenes)
    lines, points = (_joined_marks([getattr(s, name) for s in scenes], starts) for name in ("lines", "points"))
    return Scene(
        vertices,
        faces,
        lines=lines,
        points=points,
        vertex_normals=normals,
        materials=materials,
        face_materials=face_materials,
        uv=uv[0] if uv else None,
        more_uv=uv[1:],
        single_sided=single_sided,
        polygons=polygons,
        lights=tuple(light for scene in scenes for light in scene.lights),
        vertex_arrays=_joined_arrays([scene.vertex_arrays for scene in scenes], [(count,) for count in counts]),
        face_arrays=_joined_arrays([scene.face_arrays for scene in scenes], [scene.counts for scene in scenes]),
        notes=notes,
        **colors,
    )


def _joined_arrays(arrays: Sequence[Mapping[str, AnyArray]], counts: Sequence[tuple[int, ...]]) -> dict[str, AnyArray]:
    """Return the arrays of all scenes, NaN where a scene lacks one, or has another number of components.

    counts: how many rows of each kind a scene has: of vertices alone, or of faces, lines and points.
    """
    found: dict[str, AnyArray] = {}
    for name in dict.fromkeys(name for own in arrays for name in own):
        shape = next(own[name].shape[1:] for own in arrays if name in own)
        kinds = list[list[AnyArray]]()
        for own, rows in zip(arrays, counts, strict=True):
            array = own.get(name)
            if array is None or array.shape[1:] != shape:
                array = np.full((sum(rows), *shape), np.nan)
            kinds.append(np.split(array, np.cumsum(rows)[:-1]))
        found[name] = np.concatenate([part for kind in zip(*kinds, strict=True) for part in kind])
    return found


def _joined_marks(marks: Sequence[NDArray[np.int32] | None], starts: AnyArray) -> NDArray[np.int32] | None:
    """Return the lines or the points of all scenes. starts: the number of each scene's first vertex."""
    parts = [part + np.int32(start) for part, start in zip(marks, starts, strict=False) if part is not None]
    return np.concatenate(parts) if parts else None


def _joined_materials(scenes: Sequence[Scene]) -> tuple[tuple[Material, ...], NDArray[np.int32] | None]:
    """Return the materials of all scenes, each once, and the material of each face."""
    if not any(scene.materials for scene in scenes):
        return (), None
    places: dict[Material, int] = {}
    of_faces = list[NDArray[np.int32]]()
    for scene in scenes:
        if scene.face_materials is None:
            of_faces.append(np.full(len(scene.faces), NO_MATERIAL, np.int32))
            continue
        own = [places.setdefault(material, len(places)) for material in scene.materials]
        of_faces.append(np.array([*own, NO_MATERIAL], np.int32)[scene.face_materials])  # NO_MATERIAL is the last place
    return tuple(places), np.concatenate(of_faces)


def _joined_uv(scenes: Sequence[Scene]) -> tuple[NDArray[np.float32], ...]:
    """Return the texture coordinates of all scenes' vertices, as many sets as any scene has. Others have zeros."""
    own = [() if scene.uv is None else (scene.uv, *scene.more_uv) for scene in scenes]
    rows = zip_longest(*own)
    none = [np.broadcast_to(np.float32(0), (len(scene.vertices), 2)) for scene in scenes]
    return tuple(
        np.concatenate([zeros if uv is None else uv for uv, zeros in zip(row, none, strict=True)]) for row in rows
    )


def _normals_or_nan(scene: Scene) -> NDArray[np.float32]:
    """Return the scene's vertex normals, or NaN if it has none."""
    return np.full(scene.vertices.shape, np.nan, np.float32) if scene.vertex_normals is None else scene.vertex_normals


def _stacked(scenes: Sequence[Scene], counts: Sequence[int]) -> Colors:
    """Return the scenes' colours one after another. If a scene has one colour, it is repeated `count` times."""
    rows = [np.broadcast_to(scene.colors, (count, 4)) for scene, count in zip(scenes, counts, strict=True)]
    return np.concatenate(alike(rows))


def _stacked_by_kind(scenes: Sequence[Scene]) -> Colors:
    """Return the colours of all scenes' faces, of their lines, and of their points. No scene has vertex colours."""
    rows = [np.split(np.broadcast_to(s.colors, (sum(s.counts), 4)), np.cumsum(s.counts[:2])) for s in scenes]
    return np.concatenate(alike([part for kind in zip(*rows, strict=True) for part in kind]))


def with_vertex_colors(scene: Scene) -> Scene:
    """Return a scene with any colours as one with vertex colours that looks the same.

    Each face gets its own vertices, and so do lines and points.
    """
    marks = scene.mark_vertices
    corners = np.concatenate([scene.faces.reshape(-1), marks])
    if scene.vertex_colors is not None:
        colors = scene.vertex_colors[corners]
    elif scene.color is not None:
        colors = np.tile(scene.color, (len(corners), 1))
    else:
        colors = np.repeat(scene.colors, np.repeat([3, 2, 1], scene.counts), axis=0)
    first = np.arange(3 * len(scene.faces), len(corners), dtype=np.int32)
    lines = 0 if scene.lines is None else scene.lines.size
    return replace(
        scene,
        vertices=scene.vertices[corners],
        faces=np.arange(3 * len(scene.faces), dtype=np.int32).reshape(-1, 3),
        lines=None if scene.lines is None else first[:lines].reshape(-1, 2),
        points=None if scene.points is None else first[lines:],
        face_colors=None,
        color=None,
        vertex_colors=colors,
        vertex_normals=None if scene.vertex_normals is None else scene.vertex_normals[corners],
        uv=None if scene.uv is None else scene.uv[corners],
        more_uv=tuple(uv[corners] for uv in scene.more_uv),
        vertex_arrays={name: array[corners] for name, array in scene.vertex_arrays.items()},
    )


def _with_marks(scene: Scene, lines: NDArray[np.int32] | None, points: NDArray[np.int32] | None) -> Scene:
    """Return a scene that has none with these lines and points. Beside face colours they have DEFAULT_COLOR."""
    found = replace(scene, lines=lines, points=points)
    if scene.face_colors is None:
        return found
    own = np.tile(np.array(DEFAULT_COLOR, np.uint8), (sum(found.counts[1:]), 1))
    return replace(found, face_colors=np.concatenate(alike([scene.face_colors, own])))


def faces_alone(scene: Scene) -> Scene:
    """Return the scene without its lines and points. Its vertices stay."""
    count = len(scene.faces)
    colors = None if scene.face_colors is None else scene.face_colors[:count]
    arrays = {name: array[:count] for name, array in scene.face_arrays.items()}
    return replace(scene, lines=None, points=None, face_colors=colors, face_arrays=arrays)


def without_faces(scene: Scene, places: NDArray[Any]) -> Scene:
    """Return the scene without the faces at these places. Its vertices stay."""
    kept = np.ones(sum(scene.counts), bool)
    kept[: len(scene.faces)][places] = False
    return with_part(scene, kept)


def with_part(scene: Scene, kept: NDArray[np.bool_]) -> Scene:
    """Return the scene with some of its faces, lines and points. Its vertices stay. kept: bool [m + k + p]."""
    faces, lines, points = np.split(kept, np.cumsum(scene.counts[:2]))
    rows = {"lines": lines, "points": points, "face_colors": kept}
    rows |= dict.fromkeys(("faces", "face_materials", "single_sided", "polygons"), faces)
    given = {name: getattr(scene, name) for name in rows if getattr(scene, name) is not None}
    parts: dict[str, Any] = {name: array[rows[name]] for name, array in given.items()}
    for name in ("lines", "points"):
        if name in parts and not len(parts[name]):
            parts[name] = None
    parts["face_arrays"] = {name: array[kept] for name, array in scene.face_arrays.items()}
    return replace(scene, **parts)


# --- checks ---------------------------------------------------------------------------------------------------------


def recolored(scene: Scene, color: Colors | None, opacity: float | None) -> Scene:
    """Return the scene with its rgb replaced by color [3], and its alpha replaced by opacity. None keeps what there is.

    A color [4] replaces the alpha, too, before opacity does. Where a texture cuts holes or blends, it still does.
    """
    if not scene.plain_faces.all():
        return _recolored_materials(scene, color, opacity)
    colors = _recolored_colors(scene.colors, color, opacity)
    fields: dict[str, Any] = {"face_colors": None, "vertex_colors": None, "color": None}
    fields["color" if colors.ndim == 1 else "vertex_colors" if scene.face_colors is None else "face_colors"] = colors
    return _with_bounds(replace(scene, **fields), scene)


def _recolored_colors(colors: Colors, color: Colors | None, opacity: float | None) -> Colors:
    """Return the colours [..., 4], or one colour [4] if they are all alike now."""
    if color is not None:
        if len(color) == 4 or colors.ndim == 1 or (colors[..., 3] == colors[0, 3]).all():
            alpha = color[3:] if len(color) == 4 else colors.reshape(-1, 4)[0, 3:]
            colors = np.concatenate(alike([color[:3], alpha]))
        else:
            rgb, colors = alike([color[:3], colors])
            colors = colors.copy()
            colors[..., :3] = rgb
    if opacity is not None:
        level = opacity * 255
        whole = abs(level - round(level)) <= 1e-9
        colors = colors.copy() if whole or colors.dtype != np.uint8 else as_float(colors)
        colors[..., 3] = round(level) if colors.dtype == np.uint8 else opacity
    return colors


def _recolored_materials(scene: Scene, color: Colors | None, opacity: float | None) -> Scene:
    """Do the same as recolored for a scene with materials: faces with a material keep the scene's colours."""
    rgb = None if color is None else tuple(float(value) for value in linear(as_float(color)[:3]))
    alpha = float(as_float(color)[3]) if color is not None and len(color) == 4 and opacity is None else opacity
    materials = tuple(recolored_material(material, rgb, alpha) for material in scene.materials)
    found = _with_bounds(replace(scene, materials=materials), scene)
    plain = scene.plain_faces
    marks = len(scene.mark_vertices)
    if not plain.any() and not marks:
        return found
    if scene.vertex_colors is not None:
        found = with_vertex_colors(found)
        plain = np.append(np.repeat(plain, 3), np.ones(marks, bool))
    else:
        plain = np.append(plain, np.ones(sum(scene.counts[1:]), bool))
    own = np.broadcast_to(found.colors, (len(plain), 4))
    old, new = alike([own, np.broadcast_to(_recolored_colors(own, color, opacity), own.shape)])
    colors = np.where(plain[:, None], new, old)
    if found.vertex_colors is not None:
        return replace(found, vertex_colors=colors)
    return replace(found, color=None, face_colors=colors)


def _with_bounds(found: Scene, scene: Scene) -> Scene:
    """Give a scene the bounds of another one, which has the same vertices and faces, if they are known."""
    if "bounds" in vars(scene):
        vars(found)["bounds"] = scene.bounds
    return found
