"""FBX: converts what ufbx reads to Scenes: visible meshes and curves, with their colours, materials and textures.

ufbx reads FBX rather than Assimp. It keeps polygons, embedded pictures, and where nodes stand that inherit no scale,
and it reads files of all versions; Assimp's package gives no bytes of embedded pictures.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.corners import Places
from clpeel.reading.losses import listed
from clpeel.reading.marks import chains, marks, together
from clpeel.reading.paints import Pictures, painted, with_opacities
from clpeel.reading.polygons import Polygons, Varying
from clpeel.reading.transforms import Reals, cofactors, moved, turned
from clpeel.scene.arrays import AnyArray
from clpeel.scene.materials import Finish, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Texture, linear

_LEFT_OUT = {
    "lights": "lights",
    "nurbs_surfaces": "NURBS surfaces",
    "nurbs_curves": "NURBS curves",
    "procedural_geometries": "procedural geometries",
    "cache_deformers": "geometry caches",
    "blend_deformers": "morphs",
    "anim_stacks": "animations",
}
"""What is not drawn, by its name in ufbx and in words."""

_DRAWN_MAPS = ("base_color", "opacity")
_OTHER_MAPS = ("normal_map", "roughness", "metalness", "emission_color", "specular_color", "displacement_map")


def from_fbx(path: str, companions: Companions) -> Scene:
    """Return the scene of an FBX file, as its nodes stand at rest, with Y up. Lengths stay as the file has them.

    Skinned meshes stand as their joints do. Colours of materials and vertices are display-referred, as three.js and
    Blender's users take them. Hidden nodes are left out. companions: the files beside it, for textures.
    Raises InputError if there is nothing to draw, and whatever ufbx raises.
    """
    import ufbx

    file = ufbx.load_file(
        path, target_axes=ufbx.axes_right_handed_y_up, evaluate_skinning=True, generate_missing_normals=False
    )
    paints, notes = _Paints(Pictures(companions)), list[str]()
    scenes, hidden = list[Scene | None](), list[str]()
    for node in _each(file.nodes):
        curve = _curve(node)
        if node.mesh is None and curve is None:
            continue
        if not node.visible:
            hidden.append(named(node.name))
        else:
            scenes.append(_mesh(node, paints, notes) if node.mesh is not None else _curves(node, curve))
    if hidden:
        notes.append(f"hidden and left out: {listed(hidden)}")
    counts = {words: len(getattr(file, name)) for name, words in _LEFT_OUT.items()}
    found = [f"{count} {words}" for words, count in counts.items() if count]
    if found:
        notes.append(f"left out: {', '.join(found)}")
    notes += [f"ufbx reports: {warning.description}" for warning in _each(file.metadata.warnings)]
    scene = together(scenes)
    if scene is None:
        got = "; ".join(notes) or "none"
        raise InputError(f"expected triangles or lines, got {got}; the mesh is empty")
    return replace(scene, notes=tuple(dict.fromkeys((*notes, *paints.notes()))))


def _held(thing: Any) -> Any:
    """Return an object of ufbx with one more reference.

    ufbx 0.0.5 gives back one that it does not own, of each item of a list and of each list whose numbers are read, so
    that Python would free what is in use. If a later ufbx does not, the object stays until the process ends.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
    return thing


def _each(elements: Any) -> Iterator[Any]:
    """Yield what a list of ufbx holds."""
    for place in range(len(elements)):
        yield _held(elements[place])


def _numbers(elements: Any, width: int) -> AnyArray:
    """Return the numbers that a list of ufbx holds, in rows, [n, width]."""
    return np.array(_held(elements)).reshape(-1, width) if len(elements) else np.zeros((0, width))


def _indices(elements: Any) -> Places:
    """Return the integers that a list of ufbx holds, int64 [n]."""
    return _numbers(elements, 1)[:, 0].astype(np.int64)


def _matrix(matrix: Any) -> Reals:
    """Return a matrix of ufbx, which names its columns, as float64 [4, 4]."""
    found = np.eye(4)
    found[:3] = np.transpose([matrix.c0, matrix.c1, matrix.c2, matrix.c3])
    return found


# --- meshes and curves ------------------------------------------------------------------------------------------------


def _mesh(node: Any, paints: _Paints, notes: list[str]) -> Scene | None:
    """Return the faces of a node's mesh, or None without any. Raises InputError if they are damaged."""
    mesh = node.mesh
    skinned = len(mesh.skin_deformers) > 0 and mesh.skinned_position.exists
    matrix = np.eye(4) if skinned and not mesh.skinned_is_local else _matrix(node.geometry_to_world)
    position = mesh.skinned_position if skinned else mesh.vertex_position
    if not mesh.num_faces or not position.exists:
        return None
    counts = _numbers(mesh.faces, 2)[:, 1].astype(np.int64)
    short = int((counts < 3).sum())
    if short:
        notes.append(f"{short:,} face(s) of fewer than 3 corners left out")
    points = moved(_numbers(position.values, 3), matrix)
    polygons = Polygons(points, counts, _indices(position.indices))
    materials, of_faces = paints.of(node, len(counts))
    varying = _varying(mesh, skinned, matrix, materials)
    holes = _indices(mesh.face_hole) > 0
    given, polygon = polygons.fields(varying, ~holes if len(holes) == len(counts) else None)
    if not len(polygon):
        return None
    if materials:
        given |= {"materials": materials, "face_materials": of_faces[polygon]}
        if any(material.texture is not None for material in materials) and "uv" not in given:
            notes.append("texture coordinates are missing: faces have one colour of their texture")
            given["uv"] = np.zeros((len(given["vertices"]), 2))
    return Scene.from_arrays(**given)


def _varying(mesh: Any, skinned: bool, matrix: Reals, materials: Sequence[Material]) -> dict[str, Varying]:
    """Return the normals, texture coordinates and colours of a mesh's corners, as far as it has them.

    Colours on faces with materials are linear.
    """
    found: dict[str, Varying] = {}
    normal = mesh.skinned_normal if skinned and mesh.skinned_normal.exists else mesh.vertex_normal
    if normal.exists and not mesh.generated_normals:
        turns = turned(_numbers(normal.values, 3), cofactors(matrix)[0])
        found["vertex_normals"] = _kept(turns, normal.indices)
    if mesh.vertex_uv.exists and any(material.texture is not None for material in materials):
        uv = _numbers(mesh.vertex_uv.values, 2)
        found["uv"] = _kept(uv * [1, -1] + [0, 1], mesh.vertex_uv.indices)
    if mesh.vertex_color.exists:
        colors = np.clip(np.nan_to_num(_numbers(mesh.vertex_color.values, 4)), 0, 1)
        if materials:
            colors[:, :3] = linear(colors[:, :3])
        found["vertex_colors"] = _kept(colors, mesh.vertex_color.indices)
    return found


def _kept(values: AnyArray, indices: Any) -> Varying:
    """Return values of corners by their indices, where values that are equal count as one."""
    once = Varying.of_corners(values)
    return Varying(once.values, once.index[_indices(indices)])


def _curve(node: Any) -> Any:
    """Return the polylines that a node shows, or None."""
    return next((each for each in _each(node.all_attribs) if hasattr(each, "segments")), None)


def _curves(node: Any, curve: Any) -> Scene | None:
    """Return the polylines of a node in their colour, or None without any."""
    segments = _numbers(curve.segments, 2).astype(np.int64)
    indices = _indices(curve.point_indices)
    parts = [indices[begin : begin + count] for begin, count in segments]
    if not parts:
        return None
    points = moved(_numbers(curve.control_points, 3), _matrix(node.geometry_to_world))
    ends = np.concatenate(parts)[chains(np.array([len(part) for part in parts], np.int64))]
    return marks(points, ends, color=np.clip(np.asarray([*curve.color, 1.0], np.float64), 0, 1))


# --- materials --------------------------------------------------------------------------------------------------------


@dataclass
class _Paints:
    """The Materials of a file's materials, each made once."""

    pictures: Pictures

    def __post_init__(self) -> None:
        self._made: dict[int, Material] = {}
        self._others: dict[str, None] = {}
        self._sets: dict[str, None] = {}

    def of(self, node: Any, count: int) -> tuple[list[Material], AnyArray]:
        """Return the materials of a node's mesh, and the place of each of its `count` faces' among them."""
        own = [*_each(node.materials)] or [*_each(node.mesh.materials)]
        places = _indices(node.mesh.face_material)
        if not own or len(places) != count:
            places = np.zeros(count, np.int64)
        made = [self._of(material) for material in own]
        if made and (places >= len(made)).any():
            places = np.where(places < len(made), places, len(made))
            made = [*made, Material()]
        return made, places

    def notes(self) -> list[str]:
        """Return what is not drawn of the materials that were made."""
        others = [f"textures left out, as only those of colour and opacity are drawn: {listed(self._others, 9)}"]
        sets = [f"textures are drawn by the first texture coordinates, not by {listed(self._sets)}"]
        return [*self.pictures.notes, *(others if self._others else []), *(sets if self._sets else [])]

    def _of(self, material: Any) -> Material:
        """Return the Material of one. A texture of the colour stands for it, as in Maya and Blender."""
        if material.element_id not in self._made:
            pbr = material.pbr
            texture = self._texture(pbr.base_color, _opacity_map(material))
            rgb = np.array(pbr.base_color.value_vec4[:3]) if pbr.base_color.has_value else np.full(3, 0.8)
            if pbr.base_factor.has_value:
                rgb = rgb * pbr.base_factor.value_vec4.x
            if _file_of(pbr.base_color) is not None and texture is not None:
                rgb = np.ones(3)
            for name in _OTHER_MAPS:
                there = getattr(pbr, name, None)
                if there is not None and there.texture is not None:
                    self._others[f"{name} of {named(material.name)}"] = None
            self._made[material.element_id] = painted(
                material.name, rgb.tolist(), _opacity(material), texture, _finish(material)
            )
        return self._made[material.element_id]

    def _texture(self, color: Any, opacity: Any) -> Texture | None:
        """Return the texture of a colour and of an opacity, or None if neither can be read."""
        shown, mask = _file_of(color), _file_of(opacity)
        if mask is not None and shown is not None and _name_of(mask) == _name_of(shown):
            mask = None
        images = [None if each is None else self.pictures.image(_name_of(each), each.content) for each in (shown, mask)]
        rgba = images[0] if images[1] is None else with_opacities(images[0], images[1])
        lies = shown if shown is not None else mask
        if rgba is None:
            return None
        if lies.uv_set not in ("", "default", "UVMap", "map1", "UVChannel_1"):
            self._sets[named(lies.uv_set)] = None
        wraps = ["clamp" if wrap == 1 else "repeat" for wrap in (lies.wrap_u, lies.wrap_v)]
        return Texture(rgba, (wraps[0], wraps[1]))  # type: ignore[arg-type]


def _file_of(channel: Any) -> Any:
    """Return the texture of a material's channel that has a picture, or None. Of layers, the first counts."""
    if channel is None or channel.texture is None or not channel.texture_enabled:
        return None
    texture = channel.texture
    return texture if texture.has_file else next(_each(texture.file_textures), None)


def _name_of(texture: Any) -> str:
    """Return the name of a texture's picture: relative to the file if it is known."""
    return str(texture.relative_filename or texture.filename or texture.absolute_filename)


def _opacity_map(material: Any) -> Any:
    """Return the channel of a material whose texture says how opaque it is, or None."""
    return next(
        (each for each in (material.pbr.opacity, material.fbx.transparency_color) if each.texture is not None), None
    )


def _opacity(material: Any) -> float:
    """Return a material's alpha: of shaders of physical materials the opacity, else as Blender and three.js find it.

    Programs disagree about TransparencyFactor: where it is 0 or 1 it says nothing, and Opacity counts, and without
    that the transparent colour.
    """
    if material.shader_type > 2 and material.pbr.opacity.has_value:
        return float(material.pbr.opacity.value_vec4.x)
    says = {prop.name: prop.value_vec4.x for prop in _each(material.props.props)}
    alpha = 1.0 - says.get("TransparencyFactor", 0.0)
    if alpha not in (0.0, 1.0):
        return float(alpha)
    return float(says.get("Opacity", 1.0 - says.get("TransparentColor", 0.0)))


def _finish(material: Any) -> Finish | None:
    """Return how a material takes light, or None if it says nothing of that."""
    pbr = material.pbr
    emissive, factor = pbr.emission_color, pbr.emission_factor
    light = np.zeros(3)
    if emissive.has_value and emissive.texture is None:
        light = linear(np.clip(emissive.value_vec4[:3], 0, 1)) * (factor.value_vec4.x if factor.has_value else 1.0)
    physical = material.shader_type > 2 and (pbr.roughness.has_value or pbr.metalness.has_value)
    if not physical and not light.any():
        return None
    metallic = pbr.metalness.value_vec4.x if physical and pbr.metalness.has_value else 0.0
    rough = pbr.roughness.value_vec4.x if physical and pbr.roughness.has_value else 0.5
    red, green, blue = (float(max(value, 0.0)) for value in light)
    return Finish(float(np.clip(metallic, 0, 1)), float(np.clip(rough, 0, 1)), (red, green, blue))
