"""VTK's actors: what each of them draws, as a scene, and the widths that it draws lines and points with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.pictures.colormaps import ColorMap
from clpeel.reading.from_vtk import leaves, scene_of, surface
from clpeel.reading.geometry import Tint
from clpeel.reading.marks import marks, together
from clpeel.reading.vtk_arrays import numbers
from clpeel.reading.vtk_scalars import mapped_numbers
from clpeel.scene.arrays import AnyArray, Colors, as_float
from clpeel.scene.edges import edges_of
from clpeel.scene.materials import Finish, Material
from clpeel.scene.normals import with_normals
from clpeel.scene.scalars import with_scalars
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Minify, Texture, Wrap, linear

_POINTS, _WIREFRAME = 0, 1  # representations of a vtkProperty
_FLAT, _PBR = 0, 3  # interpolations of a vtkProperty


@dataclass(frozen=True, eq=False)
class Drawn:
    """What an actor draws.

    lit: whether lights fall on it. shiny: whether it has highlights. edges: their colour and opacity, if it draws them.
    line_width, point_size: in pixels, where it has lines, edges or points. spheres: whether its points are balls.
    """

    scene: Scene
    lit: bool
    shiny: bool
    edges: tuple[tuple[float, float, float], float] | None
    line_width: float | None
    point_size: float | None
    spheres: bool


def drawn_by(actor: Any, matrix: NDArray[np.float64], notes: list[str]) -> Drawn | None:
    """Return what a vtkActor draws, moved by matrix [4, 4], or None if it draws nothing. Adds notes of what is lost."""
    mapper, look = actor.GetMapper(), actor.GetProperty()
    if mapper is None:
        return None
    mapper.Update()
    gaussian = bool(mapper.IsA("vtkPointGaussianMapper"))
    as_surface = not gaussian and look.GetRepresentation() not in (_POINTS, _WIREFRAME)
    parts = [_part(data, tint, look, matrix) for data, tint in _tinted(mapper, look, as_surface)]
    scene = together(parts)
    if scene is None:
        return None
    scene = _dressed(scene, actor, look, notes)
    scene = _represented(scene, _POINTS if gaussian else look.GetRepresentation())
    notes.extend(_lost(actor, mapper, look, gaussian))
    if look.GetInterpolation() == _FLAT or scene.vertex_normals is None:
        scene = with_normals(replace(scene, vertex_normals=None), crease_angle=0.0)
    edges = bool(look.GetEdgeVisibility()) and len(scene.faces) > 0
    _, lines, points = scene.counts
    return Drawn(
        scene,
        lit=bool(look.GetLighting()),
        shiny=look.GetSpecular() > 0 or look.GetInterpolation() == _PBR,
        edges=(tuple(look.GetEdgeColor()), float(look.GetEdgeOpacity() * look.GetOpacity())) if edges else None,
        line_width=float(look.GetLineWidth()) if lines or edges else None,
        point_size=float(look.GetPointSize()) if points else None,
        spheres=gaussian or bool(look.GetRenderPointsAsSpheres()),
    )


def _lost(actor: Any, mapper: Any, look: Any, gaussian: bool) -> Iterator[str]:
    """Yield notes of what the actor has that its scene lacks."""
    if gaussian:
        yield "points_gaussian: drawn as balls, not as soft spots"
    if mapper.GetClippingPlanes() is not None and mapper.GetClippingPlanes().GetNumberOfItems():
        yield "clipping planes of a mesh left out"
    if actor.GetBackfaceProperty() is not None:
        yield "properties of back faces left out: both sides of a mesh look alike"
    if look.GetRenderLinesAsTubes():
        yield "lines are drawn flat, not as tubes"
    if look.GetInterpolation() != _PBR and look.GetLighting():
        for name, usual in (("Ambient", 0.0), ("Diffuse", 1.0), ("Specular", 0.0)):
            value = getattr(look, f"Get{name}")()
            if value != usual:
                yield f"{name.lower()}={value:g} of a mesh left out: surfaces take light by clpeel's own rule"


# --- colours ----------------------------------------------------------------------------------------------------------


def _tinted(mapper: Any, look: Any, as_surface: bool) -> Iterator[tuple[Any, Tint | _Numbers]]:
    """Yield the data that a mapper draws, as vtkPolyData, each with its colours, or with the numbers for these.

    as_surface: whether its faces are drawn, so that numbers can be looked up in between.
    """
    attributes = (
        mapper.GetCompositeDataDisplayAttributes() if hasattr(mapper, "GetCompositeDataDisplayAttributes") else None
    )
    for leaf in leaves(mapper.GetInputDataObject(0, 0)):
        color, opacity = look.GetColor(), look.GetOpacity()
        if attributes is not None:
            if attributes.HasBlockVisibility(leaf) and not attributes.GetBlockVisibility(leaf):
                continue
            if attributes.HasBlockColor(leaf):
                color = attributes.GetBlockColor(leaf)
            if attributes.HasBlockOpacity(leaf):
                opacity = attributes.GetBlockOpacity(leaf)
        data = surface(leaf)
        own = attributes is not None and attributes.HasBlockColor(leaf)
        plain = Tint(color=np.clip([*color, opacity], 0, 1).astype(np.float32))
        looked_up = mapped_numbers(mapper, data) if as_surface and not own and data.GetNumberOfPolys() else None
        if looked_up is not None:
            yield data, _Numbers(*looked_up, opacity)
            continue
        mapped = None if own else _mapped(mapper, data, opacity)
        yield data, mapped or plain


def _mapped(mapper: Any, data: Any, opacity: float) -> Tint | None:
    """Return the colours that a mapper's own lookup table gives the scalars of a vtkPolyData, if there are any."""
    if not mapper.GetScalarVisibility():
        return None
    from vtkmodules.vtkCommonCore import reference
    from vtkmodules.vtkRenderingCore import vtkPolyDataMapper

    own: Any = vtkPolyDataMapper()  # the user's stays as it is
    own.ShallowCopy(mapper)
    own.SetInputDataObject(data)
    own.SetInterpolateScalarsBeforeMapping(False)  # so that it gives colours, and no texture of them
    of_cells = reference(0)
    found = own.MapScalars(data, opacity, of_cells)
    if found is None:
        return None
    colors = numbers(found).copy()  # of memory that ends with the mapper
    if int(of_cells) == 2:  # one for all, from the data's fields
        return Tint(color=colors[0])
    return Tint(cells=colors) if int(of_cells) else Tint(points=colors)


@dataclass(frozen=True, eq=False)
class _Numbers:
    """The numbers of each point, which component of them counts, their colour map, and the opacity of all."""

    values: AnyArray
    component: int
    color_map: ColorMap
    opacity: float

    def scene(self, data: Any, matrix: NDArray[np.float64]) -> Scene | None:
        """Return the scene of a vtkPolyData in the colours of these numbers, of each fragment by its own."""
        white = np.array([1, 1, 1, np.clip(self.opacity, 0, 1)], np.float32)
        scene = scene_of(data, Tint(color=white, of_points={_NUMBERS: self.values}), matrix)
        if scene is None:
            return None
        mapped = with_scalars(scene, _NUMBERS, cmap=self.color_map, component=self.component)
        return replace(mapped, vertex_arrays={}, face_arrays={})


_NUMBERS = "scalars"


def _part(data: Any, tint: Tint | _Numbers, look: Any, matrix: NDArray[np.float64]) -> Scene | None:
    """Return the scene of a vtkPolyData, with the faces that culling leaves as one-sided ones."""
    scene = scene_of(data, tint, matrix) if isinstance(tint, Tint) else tint.scene(data, matrix)
    if scene is None or not len(scene.faces):
        return scene
    if look.GetFrontfaceCulling():
        scene = replace(scene, faces=scene.faces[:, ::-1].copy())
    if look.GetFrontfaceCulling() or look.GetBackfaceCulling():
        return replace(scene, single_sided=np.ones(len(scene.faces), bool))
    return scene


def _dressed(scene: Scene, actor: Any, look: Any, notes: list[str]) -> Scene:
    """Return the scene with the texture of an actor, or with the finish of a physically based one."""
    if not len(scene.faces):
        return replace(scene, uv=None)
    texture = None if actor.GetTexture() is None else _texture(actor.GetTexture())
    finish = None
    if look.GetInterpolation() == _PBR:
        finish = Finish(
            metallic=float(np.clip(look.GetMetallic(), 0, 1)), roughness=float(np.clip(look.GetRoughness(), 0, 1))
        )
    if texture is not None and scene.uv is None:
        notes.append("texture left out: the mesh has no coordinates for it")
        texture = None
    if scene.color_maps:
        if texture is not None:
            notes.append("texture left out: scalars say the colours of its mesh")
        return replace(scene, materials=tuple(replace(each, finish=finish) for each in scene.materials))
    if texture is not None:
        return _with_material(as_linear(scene), Material(texture=texture, alpha_mode="BLEND", finish=finish))
    scene = replace(scene, uv=None)
    return scene if finish is None else _with_material(scene, Material(plain=True, finish=finish))


def _with_material(scene: Scene, material: Material) -> Scene:
    """Return the scene with one material on all faces."""
    return replace(scene, materials=(material,), face_materials=np.zeros(len(scene.faces), np.int32))


def _texture(texture: Any) -> Texture | None:
    """Return a vtkTexture with an image of bytes, or None for any other."""
    texture.Update()
    image = texture.GetInput()
    scalars = None if image is None else image.GetPointData().GetScalars()
    if scalars is None:
        return None
    width, height, _ = image.GetDimensions()
    pixels = numbers(scalars).reshape(height, width, -1)[::-1]  # VTK's row 0 is at the bottom
    minify: Minify = (
        "linear-mipmap-linear" if texture.GetMipmap() else "linear" if texture.GetInterpolate() else "nearest"
    )
    wrap: Wrap = "repeat" if texture.GetRepeat() else "clamp"
    smooth = bool(texture.GetInterpolate())
    return Texture.of(np.ascontiguousarray(pixels), (wrap, wrap), "linear" if smooth else "nearest", minify)


def as_linear(scene: Scene) -> Scene:
    """Return the scene with the colours of its faces made linear, as materials have them; not of lines and points."""
    colors = as_float(scene.colors).copy()
    if scene.vertex_colors is not None:
        own: NDArray[Any] = np.unique(scene.faces)
    else:
        colors = np.broadcast_to(colors, (sum(scene.counts), 4)).copy()
        own = np.arange(len(scene.faces))
    colors[own, :3] = linear(colors[own, :3])
    if scene.vertex_colors is not None:
        return replace(scene, vertex_colors=colors)
    return replace(scene, color=None, face_colors=colors)


def unlit(scene: Scene) -> Scene:
    """Return the scene with faces that lights leave as they are."""
    if not len(scene.faces):
        return scene
    if scene.materials and not scene.materials[0].plain:
        return replace(scene, materials=tuple(replace(each, unlit=True) for each in scene.materials))
    return _with_material(as_linear(scene), Material(unlit=True, alpha_mode="BLEND"))


# --- representations --------------------------------------------------------------------------------------------------


def _represented(scene: Scene, representation: int) -> Scene:
    """Return the scene with the edges of its faces in place of these, or with the vertices of all, or as it is."""
    if representation not in (_POINTS, _WIREFRAME) or not len(scene.mark_vertices) + len(scene.faces):
        return scene
    if representation == _WIREFRAME and not len(scene.faces):
        return scene
    found, own = scene, _colors_of_vertices(scene)
    places = np.flatnonzero(scene.used)
    lines: NDArray[Any] | None = scene.lines
    points: NDArray[Any] | None = scene.points
    if representation == _POINTS:
        lines, points = None, places
    else:
        edges = edges_of(scene)
        outer = edges.ends[~edges.inner]
        lines = outer if lines is None else np.concatenate([outer, lines])
    drawn = marks(found.vertices, lines, points, vertex_colors=own, vertex_normals=found.vertex_normals)
    if drawn is None:
        raise InputError("expected a mesh with edges, got one without any")
    return drawn


def _colors_of_vertices(scene: Scene) -> Colors:
    """Return a colour for each vertex: its own, or that of the first face, line or point that uses it."""
    if scene.vertex_colors is not None:
        return scene.vertex_colors
    count = len(scene.vertices)
    if scene.color is not None:
        return np.tile(scene.color, (count, 1))
    found = np.zeros((count, 4), scene.colors.dtype)
    ends = np.concatenate([scene.faces.reshape(-1), scene.mark_vertices])[::-1]
    found[ends] = np.repeat(scene.colors, np.repeat([3, 2, 1], scene.counts), axis=0)[::-1]
    return found
