"""Scalars: colours a scene by numbers that its vertices or faces carry, each fragment by its own.

Between vertices the number is interpolated and then looked up in a colour map, so that a map's colours appear in their
order and no others do. To the kernels a number is a texture coordinate, and the map is a texture of one row: the colour
of what is below, the map's colours, and the colour of what is above. With `log_scale` it is the logarithm that is
interpolated, as VTK does (InterpolateScalarsBeforeMapping). Faces that carry one number each have colours of their own
instead.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel import checks
from clpeel.errors import InputError
from clpeel.pictures.colormaps import MOST_COLORS, ColorMap, checked_rgba, sampled
from clpeel.scene.arrays import AnyArray, Colors, as_float
from clpeel.scene.fields import NOT_SHOWN, Field, field_of, names_of, numbers
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import Scene, with_part, with_vertex_colors
from clpeel.scene.textures import Texture, linear
from clpeel.scene.transfer import transfer

Floats = NDArray[np.float64]

FARTHEST = 2.0**20
"""How many colours beyond a map's a number may be, and an infinite one is: much farther, and float32 would lose
others."""

MARGIN = 2.0**-20
"""How far inside of its texel a vertex's number is kept, as a share of the row: float32 rounds what is interpolated. So
a face whose three numbers are alike has one colour, even where two colours meet."""

LEAST_MARGIN = 2.0**-10
"""The same in texels, at least."""

MOST_LOOKS = 64
"""Faces that differ in opacity have materials of their own, if there are at most so many: kernels draw these faster."""

KINDS = ("faces", "lines", "points")


class Mapped(TypedDict, total=False):
    """The options of with_scalars, which `clpeel.load` takes, too."""

    cmap: Any
    clim: Sequence[float] | float | None
    log_scale: bool
    n_colors: int | None
    nan_color: Any
    below_color: Any
    above_color: Any
    component: int | None
    categories: bool | Mapping[Any, str]
    preference: str
    label: str | None


def with_scalars(
    scene: Scene,
    values: str | ArrayLike,
    *,
    cmap: Any = "viridis",
    clim: Sequence[float] | float | None = None,
    log_scale: bool = False,
    n_colors: int | None = None,
    nan_color: Any = None,
    below_color: Any = None,
    above_color: Any = None,
    opacity: float | str | ArrayLike | None = None,
    component: int | None = None,
    categories: bool | Mapping[Any, str] = False,
    preference: str = "vertex",
    label: str | None = None,
) -> Scene:
    """Return the scene in the colours of numbers. They replace its own colours and materials, but not its opacities.

    values: the name of one of the scene's arrays; or numbers, [n] for vertices or [m + k + p] for faces, lines and
    points ([m] for faces alone). Of vectors, [n, k] or [m, k], the length counts, or one `component`, from 0.
    preference: "vertex" or "face", what has them where both may.
    cmap: a name of matplotlib's or cmap's, with "_r" to turn it round; a list of colours; a map of theirs; or a
    ColorMap, which then says all the following. clim: (low, high), by default the least and the greatest finite number;
    one number c stands for (-c, c). log_scale: map logarithms; numbers of 0 or less are below. n_colors: 256 by
    default, or as many as a list has. nan_color, below_color, above_color: text, or 3 or 4 numbers 0..1. By default
    faces of which a corner has no number are left out, and numbers beyond `clim` have the colour of the nearer end, and
    so have infinite ones.
    categories: whether numbers, or texts, stand for kinds, each with a colour; or the names of these by number or text.
    A face whose vertices are of different kinds has that of most of its corners. label: what a scale bar calls the
    numbers, by default the array's name.
    opacity: 0..1; an array's name, or an array as `values` is, of 0..1; a transfer function (transfer.py) such as
    "linear" or "sigmoid", or numbers 0..1 at even distances along the map. None keeps the scene's opacities.

    Lines have the colours of their ends, and mixtures between these. The scene's color_maps has the map, for
    Result.with_bar. Raises InputError if anything of this is wrong.
    """
    field = field_of(scene, values, component, preference)
    notes = list[str]()
    names = _kinds(field.values, categories, cmap)
    if names is not None:
        field = _by_kind(scene, field, names, notes)
    if not isinstance(cmap, ColorMap):
        cmap = ColorMap(
            sampled(cmap, n_colors if names is None else max(len(names), 1), names is not None),
            _range(numbers(field), clim, log_scale) if names is None else (-0.5, max(len(names), 1) - 0.5),
            log_scale and names is None,
            checked_rgba("below_color", below_color),
            checked_rgba("above_color", above_color),
            checked_rgba("nan_color", nan_color),
            field.name if label is None else label,
            () if names is None else tuple(names.values()),
        )
    if cmap.log_scale and (low := np.count_nonzero(numbers(field) <= 0)):
        notes.append(f"scalars: {low:,} numbers of 0 or less are below all others on a logarithmic scale")
    cmap, opacities = _opacities(scene, opacity, cmap, preference, notes)
    _note_what_is_lost(scene, field, notes)
    if opacities.field is not None and opacities.field.of_faces != field.of_faces:
        own = replace(opacities, field=_of_corners(scene, opacities.field))
        scene, field, opacities = with_vertex_colors(scene), _of_corners(scene, field), own
    dressed = _by_face if field.of_faces else _by_fragment
    found = _without_nan(dressed(scene, cmap, numbers(field), opacities), field, cmap, notes)
    kept = [note for note in scene.notes if not note.startswith(NOT_SHOWN)]
    found = replace(found, notes=tuple(dict.fromkeys((*kept, *notes))))
    vars(found)["bounds"] = scene.bounds  # so that a camera sees the same part of space, whatever is left out
    return found


# --- what numbers stand for -------------------------------------------------------------------------------------------


def _range(values: Floats, clim: Sequence[float] | float | None, log_scale: bool) -> tuple[float, float]:
    """Return the least and the greatest number of a map, or raise InputError."""
    if clim is not None:
        low, high = _given_range(clim)
        if log_scale and low <= 0:
            raise InputError(f"clim: expected numbers above 0 with log_scale, got {low:g}, {high:g}")
        return low, high
    known = values[np.isfinite(values) & ((values > 0) | (not log_scale))]
    if not len(known):
        if log_scale and np.isfinite(values).any():
            raise InputError("log_scale: expected a number above 0 among the scalars, got none")
        return (1.0, 10.0) if log_scale else (0.0, 1.0)
    low, high = float(known.min()), float(known.max())
    if low == high:  # one number has the colour in the middle
        return (low / 2, low * 2) if log_scale else (low - (abs(low) / 2 or 0.5), high + (abs(low) / 2 or 0.5))
    if not math.isfinite(high - low):
        raise InputError(f"scalars: expected numbers whose range is finite, got {low:g} to {high:g}; give clim")
    return low, high


def _given_range(clim: Any) -> tuple[float, float]:
    """Return the range that a user gave, or raise InputError."""
    parts = [checks.number(part) for part in ((clim,) if np.ndim(clim) == 0 else clim)]
    parts = [-parts[0], *parts] if np.ndim(clim) == 0 else parts
    if len(parts) != 2 or not parts[0] < parts[1] or not math.isfinite(parts[1] - parts[0]):
        raise InputError(f"clim: expected (low, high) with low < high, or a number above 0, got {clim!r}")
    return parts[0], parts[1]


def _kinds(values: AnyArray, categories: bool | Mapping[Any, str], cmap: Any) -> dict[Any, str] | None:
    """Return the name of each kind that values stand for, or None if they are numbers. Raises InputError.

    cmap: a ColorMap may have names of its own.
    """
    text = values.dtype.kind in "OUS"
    if isinstance(categories, Mapping):
        return {key: str(name) for key, name in categories.items()}
    if not (categories or text or (isinstance(cmap, ColorMap) and cmap.categories)):
        return None
    distinct = np.unique(values.astype(str) if text else values)
    kinds = {value.item(): str(value) if text else f"{value:.6g}" for value in distinct if text or np.isfinite(value)}
    if isinstance(cmap, ColorMap):
        known = {name: value for value, name in kinds.items()}
        return {known.get(name, name): name for name in cmap.categories}
    if len(kinds) > MOST_COLORS:
        raise InputError(
            f"categories: expected at most {MOST_COLORS:,} kinds, got {len(kinds):,}; give numbers as such"
        )
    return kinds


def _by_kind(scene: Scene, field: Field, names: Mapping[Any, str], notes: list[str]) -> Field:
    """Return for each face the place of its kind among the names; NaN for none. Of vertices, most corners' kind."""
    text = field.values.dtype.kind in "OUS"
    values, place = np.unique(field.values.astype(str) if text else field.values, return_inverse=True)
    order = {key: number for number, key in enumerate(names)}
    found = np.array([order.get(value.item(), np.nan) for value in values], np.float64)[place.reshape(-1)]
    if field.of_faces:
        return field._replace(values=found)
    codes = np.nan_to_num(found, nan=-1.0)
    a, b, c = codes[scene.faces].T
    between = np.count_nonzero((a != b) | (b != c))
    if between:
        notes.append(f"scalars: {between:,} faces between categories have that of most of their corners")
    lines = np.zeros(0) if scene.lines is None else codes[scene.lines[:, 0]]
    points = np.zeros(0) if scene.points is None else codes[scene.points]
    own = np.concatenate([np.where(b == c, b, a), lines, points])
    return field._replace(values=np.where(own < 0, np.nan, own), of_faces=True)


# --- opacities --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Opacities:
    """How opaque what is drawn is: factors [m] of faces; one of lines and points; and a field that counts, too, if any.

    counts: bool [m], of which faces the field counts. Where it does not, and of all faces if there is none, it is 1.
    """

    of_faces: Floats
    of_marks: float
    field: Field | None
    counts: NDArray[np.bool_]


def _opacities(
    scene: Scene, opacity: Any, cmap: ColorMap, preference: str, notes: list[str]
) -> tuple[ColorMap, _Opacities]:
    """Return the map with its own alphas, and all other opacities. Raises InputError."""
    count = len(scene.faces)
    plain = _Opacities(np.ones(count), 1.0, None, np.zeros(count, bool))
    if opacity is None:
        return cmap, _kept(scene)
    if isinstance(opacity, str) and opacity not in names_of(scene):
        return _with_transfer(cmap, opacity), plain
    if np.ndim(opacity) == 0 and not isinstance(opacity, str):
        level = checks.share("opacity", opacity)
        return cmap, replace(plain, of_faces=np.full(count, level), of_marks=level)
    if not isinstance(opacity, str) and len(opacity) not in (len(scene.vertices), count, sum(scene.counts)):
        return _with_transfer(cmap, opacity), plain
    field = field_of(scene, opacity, None, preference, "opacity")
    values = numbers(field, "opacity")
    outside = np.count_nonzero(~((values >= 0) & (values <= 1)))
    if outside:
        notes.append(
            f"opacity: {outside:,} numbers of {field.name or 'the array'} outside 0..1 are 0 or 1, whichever is near"
        )
    clipped = np.clip(np.nan_to_num(values), 0, 1).astype(np.float32)
    return cmap, replace(plain, field=field._replace(values=clipped), counts=np.ones(count, bool))


def _with_transfer(cmap: ColorMap, function: Any) -> ColorMap:
    """Return the map with the alphas of a transfer function."""
    colors = cmap.colors.copy()
    colors[:, 3] = transfer(function, len(colors))
    return replace(cmap, colors=colors)


def _kept(scene: Scene) -> _Opacities:
    """Return the opacities that the scene has: of its colours, and of its materials, whose textures do not count."""
    materials = [*scene.materials, Material(plain=True)]
    blends = [material.plain or (material.alpha_mode == "BLEND" and material.alpha_of_scene) for material in materials]
    factors = [
        material.opacity * (material.base_color[3] if material.alpha_mode == "BLEND" else 1.0) for material in materials
    ]
    of_faces = np.full(len(scene.faces), NO_MATERIAL) if scene.face_materials is None else scene.face_materials
    factor, counts = np.array(factors)[of_faces], np.array(blends)[of_faces]
    alpha = as_float(scene.colors)[..., 3]
    few = scene.face_colors is not None and not len(scene.mark_vertices) and len(np.unique(alpha)) <= MOST_LOOKS
    if scene.color is not None or few:
        of_marks = 1.0 if few else float(alpha)
        return _Opacities(np.where(counts, factor * alpha, factor), of_marks, None, np.zeros(len(counts), bool))
    field = None if (alpha == 1).all() else Field(alpha, scene.face_colors is not None, "")
    return _Opacities(factor, 1.0, field, counts & (field is not None))


def _of_corners(scene: Scene, field: Field) -> Field:
    """Return the field for the vertices that with_vertex_colors gives each face, line and point."""
    if field.of_faces:
        values = np.repeat(field.values, np.repeat([3, 2, 1], scene.counts))
    else:
        values = field.values[np.concatenate([scene.faces.reshape(-1), scene.mark_vertices])]
    return field._replace(values=values, of_faces=False)


# --- colours ----------------------------------------------------------------------------------------------------------


def _by_fragment(scene: Scene, cmap: ColorMap, values: Floats, opacities: _Opacities) -> Scene:
    """Return the scene with a texture of the map on all faces. values: of its vertices, [n]."""
    places = _within_texels(cmap.places(values), len(cmap.colors))
    uv = np.full((len(values), 2), 0.5)
    uv[:, 0] = (1 + np.nan_to_num(places)) / (len(cmap.colors) + 2)
    texture = Texture(cmap.row[None], ("clamp", "clamp"), "nearest", "nearest")
    looks, of_faces = np.unique(np.stack([opacities.of_faces, opacities.counts], axis=1), axis=0, return_inverse=True)
    materials = [
        Material(
            cmap.label,
            texture=texture,
            alpha_mode="BLEND",  # where all alphas are 1, faces are opaque anyway
            opacity=float(factor),
            rgb_of_scene=False,
            alpha_of_scene=bool(counts),
            color_map=cmap,
        )
        for factor, counts in looks
    ]
    nowhere = np.isnan(values)[scene.faces].any(axis=1)
    of_faces = np.where(nowhere, len(materials), of_faces.reshape(-1))
    red, green, blue = (float(part) for part in linear(np.array(cmap.nan or (0, 0, 0, 0))[:3] / 255))
    none = Material(
        cmap.label,
        (red, green, blue, 1.0),
        opacity=(cmap.nan or (0, 0, 0, 0))[3] / 255,
        rgb_of_scene=False,
        alpha_of_scene=False,
        color_map=cmap,
    )
    colors: dict[str, Colors] = {"color": np.full(4, 255, np.uint8)}
    if opacities.field is not None or len(scene.mark_vertices):
        alphas = opacities.of_marks if opacities.field is None else opacities.field.values
        colors = {"vertex_colors": _faded(cmap(values), np.isnan(values), alphas)}
    return _in_place_of_colors(
        scene,
        materials=(*materials, *([none] if nowhere.any() else [])),
        face_materials=of_faces.astype(np.int32),
        uv=uv.astype(np.float32),
        **colors,
    )


def _within_texels(places: Floats, count: int) -> Floats:
    """Return where vertices lie among so many colours, none nearer to the end of one than float32 can tell apart."""
    margin = max(LEAST_MARGIN, MARGIN * count)
    first = np.clip(np.floor(places), -1, count)
    first[places == count] = count - 1
    low, high = first + margin, first + 1 - margin
    low[first < 0], high[first == count] = -FARTHEST, FARTHEST
    return np.clip(places, low, high)


def _by_face(scene: Scene, cmap: ColorMap, values: Floats, opacities: _Opacities) -> Scene:
    """Return the scene with a colour of the map for each face, line and point. values: theirs, [m + k + p]."""
    marks = sum(scene.counts[1:])
    alphas = np.append(opacities.of_faces, np.full(marks, opacities.of_marks))
    if opacities.field is not None:
        counts = np.append(opacities.counts, np.ones(marks, bool))
        alphas = np.where(counts, alphas * opacities.field.values, alphas)
    shown = Material(cmap.label, plain=True, color_map=cmap)
    return _in_place_of_colors(
        scene,
        materials=(shown,),
        face_materials=np.zeros(len(scene.faces), np.int32),
        face_colors=_faded(cmap(values), np.isnan(values), alphas),
    )


def _faded(colors: NDArray[np.uint8], nowhere: NDArray[np.bool_], alphas: Any) -> Colors:
    """Return colours [k, 4] with their alphas multiplied, except where there is no number. They stay bytes if they
    can."""
    factor = np.where(nowhere, 1.0, alphas)
    if (factor == 1).all():
        return colors
    found = as_float(colors)
    found[:, 3] *= factor
    return found


def _in_place_of_colors(scene: Scene, **fields: Any) -> Scene:
    """Return the scene with these colours and materials in place of its own."""
    blank: dict[str, Any] = dict.fromkeys(("color", "vertex_colors", "face_colors", "uv"))
    return replace(scene, **{**blank, "more_uv": (), **fields})


def _without_nan(scene: Scene, field: Field, cmap: ColorMap, notes: list[str]) -> Scene:
    """Return the scene without what has no number, if that has no colour, and note how much. Its bounds stay."""
    nowhere = np.isnan(numbers(field))
    if not field.of_faces:
        ends = [scene.faces, scene.lines, scene.points]
        parts = [nowhere[end.reshape(len(end), -1 if len(end) else 1)].any(axis=1) for end in ends if end is not None]
        nowhere = np.concatenate(parts)
    if not nowhere.any() or (cmap.nan is not None and cmap.nan[3] > 0):
        return scene
    kept = ~nowhere
    kept[0] |= nowhere.all()  # a scene has something, even if nothing of it shows: without a number it is transparent
    found = with_part(scene, kept)
    lost = [np.count_nonzero(part) for part in np.split(nowhere, np.cumsum(scene.counts[:2]))]
    said = " and ".join(f"{count:,} {kind}" for count, kind in zip(lost, KINDS, strict=True) if count)
    notes.append(f"scalars: {said} without a number left out; nan_color shows them")
    return found


def _note_what_is_lost(scene: Scene, field: Field, notes: list[str]) -> None:
    """Note the textures that scalars replace, and lines whose colours are not looked up between their ends."""
    textures = sum(material.uv_sets > 0 and material.color_map is None for material in scene.materials)
    if textures:
        notes.append(f"textures of {textures:,} materials left out: the colours are those of scalars")
    if scene.lines is not None and not field.of_faces:
        ends = numbers(field)[scene.lines]
        if (ends[:, 0] != ends[:, 1]).any():
            notes.append("scalars: lines have the colours of their ends, and mixtures of these between them")
