"""A scene: the triangles, colours and normals to render, from arrays or from any mesh file that trimesh reads."""

from __future__ import annotations

import gzip
import io
import logging
import math
import os
import sys
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clpeel.errors import InputError

DEFAULT_COLOR = (120, 150, 190, 255)
"""RGBA of a mesh that brings no colour of its own, uint8."""

KNOWN_EXTENSIONS = ("ply", "stl", "obj", "off", "glb", "gltf", "3mf")
"""File types that `load` reads, also with .gz behind; more where trimesh has the packages for them."""

Colors = NDArray[Any]
"""RGBA in the last axis: uint8 0..255 or float32 0..1."""

_FAR_FROM_ORIGIN = 16.0  # in half diagonals: beyond this, float32 spends four bits or more on the offset
_SCALE_EXPONENT = 60  # beyond 2**±60, float32 products of a few coordinates could leave the range of float32


@dataclass(frozen=True, eq=False)
class Positions:
    """Device positions p = (vertices - origin) * scale, as float32 pairs p = hi + lo.

    hi: float32 [n, 3]; lo: float32 [n, 3], or None where hi is exact; origin: float64 [3], scene units;
    scale: 1, or the power of two that brings the scene to about 1.
    """

    hi: NDArray[np.float32]
    lo: NDArray[np.float32] | None
    origin: NDArray[np.float64]
    scale: float


@dataclass(frozen=True, eq=False)
class Scene:
    """Triangles with colours; make one with `Scene.from_arrays` or `clpeel.load`, which check what they are given.

    vertices: float64 [n, 3], scene units; NaN and infinite ones are allowed, their triangles are discarded when drawn.
    faces: int32 [m, 3], indices into vertices; their order is the submission order.
    Exactly one of face_colors [m, 4], vertex_colors [n, 4] and color [4] is set: RGBA, uint8 0..255 or float32 0..1.
    vertex_normals: float32 [n, 3] of any length, NaN rows where unknown; None where the source gave none.
    notes: what the loader could not keep, one line each.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    face_colors: Colors | None = None
    vertex_colors: Colors | None = None
    color: Colors | None = None
    vertex_normals: NDArray[np.float32] | None = None
    notes: tuple[str, ...] = ()

    @staticmethod
    def from_arrays(
        vertices: ArrayLike,
        faces: ArrayLike,
        face_colors: ArrayLike | None = None,
        vertex_colors: ArrayLike | None = None,
        color: ArrayLike | None = None,
        *,
        vertex_normals: ArrayLike | None = None,
        opacity: float | None = None,
    ) -> Scene:
        """A scene from arrays, all of them checked.

        vertices [n, 3] numbers; faces [m, 3] integers 0..n-1, m >= 1; at most one of face_colors [m, 3|4],
        vertex_colors [n, 3|4] and color [3|4]: integers are 0..255, floats 0..1, and without alpha they are opaque.
        vertex_normals [n, 3] of any length; opacity 0..1 replaces every alpha.

        Raises InputError, which names the argument, what was expected and what came.
        """
        points = _vertices(vertices)
        triangles = _faces(faces, len(points))
        given = {"face_colors": face_colors, "vertex_colors": vertex_colors, "color": color}
        names = [name for name, value in given.items() if value is not None]
        if len(names) > 1:
            raise InputError(f"colours: expected at most one of {', '.join(given)}, got {' and '.join(names)}")
        if not names:
            color = np.array(DEFAULT_COLOR, np.uint8)
        scene = Scene(
            points,
            triangles,
            face_colors=None if face_colors is None else _colors("face_colors", face_colors, (len(triangles),)),
            vertex_colors=None if vertex_colors is None else _colors("vertex_colors", vertex_colors, (len(points),)),
            color=None if color is None else _colors("color", color, ()),
            vertex_normals=None if vertex_normals is None else _normals(vertex_normals, len(points)),
        )
        return scene if opacity is None else _recolored(scene, None, _opacity(opacity))

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """float64 [2, 3]: least and greatest corner of the finite vertices that faces use; zeros if there are none."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.faces.reshape(-1)] = True
        used &= np.isfinite(self.vertices).all(axis=1)
        points = self.vertices if used.all() else self.vertices[used]
        corners = np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else np.zeros((2, 3))
        corners.flags.writeable = False
        return corners

    @cached_property
    def opaque(self) -> bool:
        """Whether every alpha is 1."""
        alpha = self._colors[..., 3]
        return bool((alpha == (255 if alpha.dtype == np.uint8 else 1)).all())

    @property
    def _colors(self) -> Colors:
        """The one colour array that is set."""
        for colors in (self.face_colors, self.vertex_colors, self.color):
            if colors is not None:
                return colors
        raise InputError("colours: expected face_colors, vertex_colors or color, got none; use Scene.from_arrays")

    def positions(self) -> Positions:
        """The vertices as the device gets them: near the origin, about 1 in size where float32 demands it.

        The origin moves only if the scene's centre is more than 16 half diagonals away from it, to the centre rounded
        to a power of two below the half diagonal: so vertices that were float32 stay exactly float32.
        The scale is an exact power of two, and 1 unless the scene's size is beyond 2**60 or below 2**-60.
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


def load(*sources: Any, opacity: float | None = None, color: ArrayLike | None = None) -> Scene:
    """One scene from mesh files, trimesh meshes or scenes, and Scenes; several are put together in order.

    Files: PLY, STL, OBJ, OFF, GLB, glTF, 3MF, each also with .gz behind. Scene-graph transforms are applied in float64.
    Colours are those of the faces, vertices, materials (glTF base colour with its alphaMode, OBJ Kd and d) or textures,
    sampled at the vertices; DEFAULT_COLOR where there are none. They are taken as given: no linear to sRGB conversion.
    color [3|4] replaces every rgb, and with four numbers every alpha; opacity 0..1 replaces every alpha.

    Raises InputError, one line that begins with the file's name: missing, unreadable, damaged, of an unknown type,
    without triangles.
    """
    if not sources:
        raise InputError("load: expected at least one mesh file, trimesh object or Scene, got none")
    given_opacity = None if opacity is None else _opacity(opacity)
    given_color = None
    if color is not None:
        given_color = _colors("color", color, ())[: np.shape(color)[0]]
    scene = _joined([_opened(source) for source in sources])
    return scene if color is None and opacity is None else _recolored(scene, given_color, given_opacity)


def _opened(source: Any) -> Scene:
    """The scene of one source of `load`."""
    if isinstance(source, Scene):
        return source
    if isinstance(source, (str, os.PathLike)):
        return _from_file(os.fsdecode(source))
    trimesh = sys.modules.get("trimesh")
    if trimesh is not None and isinstance(source, (trimesh.Trimesh, trimesh.Scene, trimesh.PointCloud)):
        with _errors_named("trimesh object"):
            return _from_trimesh(source)
    raise InputError(f"load: expected a path, a trimesh object or a Scene, got {type(source).__name__}")


def _from_file(path: str) -> Scene:
    """The scene in a mesh file."""
    stem = path[:-3] if path.lower().endswith(".gz") else path
    extension = os.path.splitext(stem)[1].lower().removeprefix(".")
    if os.path.isdir(path):
        raise InputError(f"{path}: expected a mesh file, one of {_known()}, got a directory")
    if extension not in KNOWN_EXTENSIONS and os.path.exists(path):
        _require_reader(path, extension)
    data = _contents(path)
    with _errors_named(path):
        plain = _PLAIN_READERS[extension](data) if extension in _PLAIN_READERS else None
    if plain is not None:
        return plain
    _require_reader(path, extension)
    with _errors_named(path):
        import trimesh

        resolver = trimesh.resolvers.FilePathResolver(path)
        stream = io.BytesIO(data)
        return _from_trimesh(trimesh.load_scene(stream, file_type=extension, resolver=resolver, process=False))


def _require_reader(path: str, extension: str) -> None:
    """InputError unless trimesh reads files with this extension."""
    import trimesh

    if extension in trimesh.exchange.load.mesh_formats():
        return
    if extension in KNOWN_EXTENSIONS:
        raise InputError(f"{path}: trimesh lacks what it needs to read .{extension}; run: pip install lxml networkx")
    came = f".{extension}" if extension else "no extension"
    raise InputError(f"{path}: expected a mesh file, one of {_known()}, got {came}")


def _contents(path: str) -> bytes:
    """The file's bytes, decompressed if its name ends in .gz."""
    try:
        with open(path, "rb") as file:
            data = file.read()
        return gzip.decompress(data) if path.lower().endswith(".gz") else data
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(f"{path}: not a whole gzip file: {_line(error)}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or _line(error)}") from None


@contextmanager
def _errors_named(name: str) -> Iterator[None]:
    """Whatever goes wrong inside becomes one InputError line that begins with name; trimesh's own chatter is silent."""
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)  # holds for the loggers below it too
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except (Exception, MemoryError) as error:
        raise InputError(f"{name}: not a readable mesh: {_line(error)}") from error
    finally:
        logger.setLevel(level)


def _line(error: BaseException) -> str:
    """An error's type and message on one short line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:200]}" if text else type(error).__name__


def _known() -> str:
    """The known extensions, for an error message."""
    return ", ".join(f".{extension}" for extension in KNOWN_EXTENSIONS) + " (also .gz of each)"


# --- trimesh objects ------------------------------------------------------------------------------------------------


def _from_trimesh(source: Any) -> Scene:
    """The triangles of a trimesh mesh, or of every node of a trimesh scene in graph order; InputError if none."""
    if hasattr(source, "graph"):
        placed = [source.graph[node] for node in source.graph.nodes_geometry]
        pieces = [(source.geometry[name], np.asarray(matrix, dtype=np.float64)) for matrix, name in placed]
    else:
        pieces = [(source, np.eye(4))]
    meshes = [(mesh, matrix) for mesh, matrix in pieces if hasattr(mesh, "faces") and len(mesh.faces)]
    others = Counter(_kind(piece) for piece, _ in pieces if not (hasattr(piece, "faces") and len(piece.faces)))
    left_out = ", ".join(f"{count} {kind}" for kind, count in others.items())
    if not meshes:
        raise InputError(f"expected triangles, got {left_out or 'none'}; the mesh is empty")
    scene = _joined([_from_mesh(mesh, matrix) for mesh, matrix in meshes])
    return replace(scene, notes=(*scene.notes, f"left out, not triangles: {left_out}")) if left_out else scene


def _kind(piece: Any) -> str:
    """What a piece of a trimesh scene without triangles is, for a message."""
    if hasattr(piece, "entities"):
        return "line set(s)"
    return "mesh(es) without faces" if hasattr(piece, "faces") else "point cloud(s)"


def _from_mesh(mesh: Any, matrix: NDArray[np.float64]) -> Scene:
    """The scene of one trimesh.Trimesh moved by matrix [4, 4]."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    normals = np.asarray(mesh.vertex_normals) if "vertex_normals" in mesh._cache else None
    if normals is not None and normals.shape != vertices.shape:
        normals = None
    if not np.array_equal(matrix, np.eye(4)):
        turn = matrix[:3, :3]
        vertices = _linear(vertices, turn) + matrix[:3, 3]
        if normals is not None:
            turn = turn / np.abs(turn).max()
            cofactors = np.cross(turn[[1, 2, 0]], turn[[2, 0, 1]])  # the inverse transpose times the determinant
            normals = _linear(normals, cofactors)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colors, notes = _mesh_colors(mesh)
    scene = Scene.from_arrays(vertices, np.asarray(mesh.faces), vertex_normals=normals, **colors)
    return replace(scene, notes=notes)


def _linear(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """matrix [3, 3] times each of points [n, 3], in an order of sums that no BLAS chooses: the same bits everywhere."""
    x, y, z = points[:, :1], points[:, 1:2], points[:, 2:]
    return x * matrix[:, 0] + y * matrix[:, 1] + z * matrix[:, 2]


def _mesh_colors(mesh: Any) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The colour argument of Scene.from_arrays for a trimesh.Trimesh ({} if the mesh has no colour), and notes."""
    visual, notes = mesh.visual, list[str]()
    if visual.kind in ("face", "vertex"):
        name = f"{visual.kind}_colors"
        values = np.asarray(getattr(visual, name))
        if len(values) == len(mesh.faces if visual.kind == "face" else mesh.vertices):
            return {name: values}, ()
        return {}, (f"{name} left out: {len(values)} do not fit the mesh",)
    if visual.kind != "texture":
        return {}, ()
    if hasattr(visual.material, "materials"):  # one material a face
        table = [_material(material, None, notes) for material in visual.material.materials]
        default = np.array(DEFAULT_COLOR, np.uint8)
        rgba = _alike([default if c is None else _finished(m, c) for m, c in zip(visual.material, table, strict=True)])
        return {"face_colors": np.array(rgba)[np.asarray(visual.face_materials)]}, tuple(notes)
    uv = visual.uv if np.shape(visual.uv) == (len(mesh.vertices), 2) else None
    colors = _material(visual.material, uv, notes)
    attributes = [a["color"] for a in (visual.vertex_attributes, mesh.vertex_attributes) if "color" in a]
    if attributes and np.shape(attributes[0]) in ((len(mesh.vertices), 3), (len(mesh.vertices), 4)):
        own = _unit_colors(np.asarray(attributes[0]))
        colors = own if colors is None else own * _as_float(colors)
    elif attributes:
        notes.append("vertex colours left out: they do not fit the mesh")
    if colors is None:
        return {}, tuple(notes)
    return {"color" if colors.ndim == 1 else "vertex_colors": _finished(visual.material, colors)}, tuple(notes)


_INVENTED_DIFFUSE = (102, 102, 102, 255)  # what trimesh gives a material without Kd
_INVENTED_IMAGE = bytes((100, 100, 100, 255)) * 4  # and a mesh with texture coordinates but without a material


def _material(material: Any, uv: NDArray[np.float64] | None, notes: list[str]) -> Colors | None:
    """A material's RGBA [4], or [n, 4] with a texture sampled at uv [n, 2]; None where trimesh made the material up."""
    if hasattr(material, "baseColorFactor"):  # glTF
        factor, image = material.baseColorFactor, material.baseColorTexture
    else:  # OBJ and others
        image, invented = material.image, "kd" not in material.kwargs and tuple(material.diffuse) == _INVENTED_DIFFUSE
        if invented and (image is None or (image.size == (2, 2) and image.tobytes() == _INVENTED_IMAGE)):
            return None
        factor = None if invented else material.diffuse
    colors: Colors = np.full(4, 255, np.uint8) if factor is None else np.asarray(factor, dtype=np.uint8)
    if image is None:
        return colors
    if uv is None:
        notes.append("texture left out: the mesh has no coordinates for it")
        return colors
    try:
        texels = _texels(image, uv)
    except (OSError, ValueError) as error:
        notes.append(f"texture left out: {_line(error)}")
        return colors
    notes.append("textures are sampled at the vertices only")
    return texels if (colors == 255).all() else _as_float(texels) * _as_float(colors)


def _texels(image: Any, uv: NDArray[np.float64]) -> NDArray[np.uint8]:
    """The nearest texels [n, 4] of a PIL image, repeated, at uv [n, 2] with v up; 0 and 1 are its outermost texels."""
    pixels: NDArray[np.uint8] = np.asarray(image.convert("RGBA"))
    size = np.array([image.width, image.height])
    spot = np.nan_to_num(uv * [1, -1] + [0, 1], posinf=0.0, neginf=0.0) * (size - 1)
    column, row = (np.rint(np.mod(spot, size)).astype(np.int64) % size).T
    return np.asarray(pixels[row, column])


def _finished(material: Any, colors: Colors) -> Colors:
    """The colours [4] or [n, 4], their alpha as the material's alphaMode (glTF) or d or Tr (OBJ) wants it."""
    top = 255 if colors.dtype == np.uint8 else 1
    colors = colors.copy()
    if hasattr(material, "baseColorFactor"):
        mode = material.alphaMode or "OPAQUE"
        if mode == "MASK":
            cutoff = 0.5 if material.alphaCutoff is None else material.alphaCutoff
            colors[..., 3] = np.where(colors[..., 3] / top >= cutoff, top, 0)
        elif mode != "BLEND":
            colors[..., 3] = top
        return colors
    for key in ("d", "tr"):
        if key in material.kwargs:
            value = float(material.kwargs[key][-1])
            colors = _as_float(colors)
            colors[..., 3] *= min(max(value if key == "d" else 1 - value, 0.0), 1.0)
            break
    return colors


def _unit_colors(colors: NDArray[Any]) -> NDArray[np.float32]:
    """Colours [n, 3|4] of any dtype, normalised integers included, as float32 [n, 4] in 0..1."""
    top = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1
    rgba = np.ones((len(colors), 4), dtype=np.float32)
    rgba[:, : colors.shape[1]] = np.clip(np.nan_to_num(colors / top), 0, 1)
    return rgba


# --- several scenes in one ------------------------------------------------------------------------------------------


def _joined(scenes: Sequence[Scene]) -> Scene:
    """The scenes' triangles one after another, their colours kept as few and as they were as they can be."""
    if len(scenes) == 1:
        return scenes[0]
    notes = tuple(dict.fromkeys(note for scene in scenes for note in scene.notes))
    colors: dict[str, Any]
    flat = [scene.color for scene in scenes if scene.color is not None]
    if len(flat) == len(scenes) and all(c.dtype == flat[0].dtype and (c == flat[0]).all() for c in flat):
        colors = {"color": flat[0]}
    elif all(scene.vertex_colors is None for scene in scenes):
        colors = {"face_colors": _stacked(scenes, [len(scene.faces) for scene in scenes])}
    else:
        scenes = [_split(scene) if scene.face_colors is not None else scene for scene in scenes]
        colors = {"vertex_colors": _stacked(scenes, [len(scene.vertices) for scene in scenes])}
    counts = [len(scene.vertices) for scene in scenes]
    starts = np.cumsum([0, *counts])
    if starts[-1] >= 2**31:
        raise InputError(f"vertices: expected fewer than 2**31 in all, got {starts[-1]}")
    normals = None
    if any(scene.vertex_normals is not None for scene in scenes):
        normals = np.concatenate([_normals_or_nan(scene) for scene in scenes])
    vertices = np.concatenate([scene.vertices for scene in scenes])
    faces = np.concatenate([scene.faces + np.int32(start) for scene, start in zip(scenes, starts, strict=False)])
    return Scene(vertices, faces, vertex_normals=normals, notes=notes, **colors)


def _normals_or_nan(scene: Scene) -> NDArray[np.float32]:
    """The scene's vertex normals, NaN where it has none."""
    return np.full(scene.vertices.shape, np.nan, np.float32) if scene.vertex_normals is None else scene.vertex_normals


def _stacked(scenes: Sequence[Scene], counts: Sequence[int]) -> Colors:
    """The scenes' colours one after another, a scene's one colour repeated count times."""
    rows = [np.broadcast_to(scene._colors, (count, 4)) for scene, count in zip(scenes, counts, strict=True)]
    return np.concatenate(_alike(rows))


def _split(scene: Scene) -> Scene:
    """The same picture from a face-coloured scene with vertex colours: every face gets vertices of its own."""
    corners = scene.faces.reshape(-1)
    normals = None if scene.vertex_normals is None else scene.vertex_normals[corners]
    colors = np.repeat(scene._colors, 3, axis=0)
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Scene(scene.vertices[corners], faces, vertex_colors=colors, vertex_normals=normals, notes=scene.notes)


# --- plain files, without trimesh -----------------------------------------------------------------------------------

_COUNT_OF = "count of "  # the name of a list's count: no PLY name holds a space
_PLY_TYPES = dict(
    word.split(":")
    for word in "char:i1 uchar:u1 short:i2 ushort:u2 int:i4 uint:u4 float:f4 double:f8 "
    "int8:i1 uint8:u1 int16:i2 uint16:u2 int32:i4 uint32:u4 float32:f4 float64:f8".split()
)


def _plain_ply(data: bytes) -> Scene | None:
    """The scene of a PLY file of vertices and triangles, as most are; None for any other, which is left to trimesh.

    Here for speed: text is read about ten times as fast as by trimesh, whose import alone can take most of a command.
    """
    try:
        kind, elements, body = _ply_header(data)
        (vertex, vertex_count, vertex_type), (face, face_count, face_type) = elements
        if (vertex, face) != ("vertex", "face") or 0 in (vertex_count, face_count):
            return None
        if kind == "ascii":
            middle = body
            for _ in range(vertex_count):
                middle = data.index(b"\n", middle) + 1
            points = _ply_table(data[body:middle], vertex_type, vertex_count)
            faces = _ply_table(data[middle:], face_type, face_count)
        else:
            points = np.frombuffer(data, vertex_type, vertex_count, body)
            faces = np.frombuffer(data, face_type, face_count, body + points.nbytes)
        vertices, normals = _ply_columns(points, "x y z"), _ply_columns(points, "nx ny nz")
        face_colors, vertex_colors = _ply_colors(faces), _ply_colors(points)
        (index,) = [name for name in face_type.names or () if face_type[name].shape]
        if index not in ("vertex_indices", "vertex_index") or (faces[_COUNT_OF + index] != 3).any():
            return None
    except InputError:
        raise
    except (ValueError, KeyError, IndexError):
        return None
    if vertices is None or (face_colors is not None and vertex_colors is not None):
        return None
    return Scene.from_arrays(vertices, faces[index], face_colors, vertex_colors, vertex_normals=normals)


def _ply_header(data: bytes) -> tuple[str, list[tuple[str, int, np.dtype[Any]]], int]:
    """The format, the elements (name, count, type of a row, lists taken to be of three) and where the rows begin.

    Raises ValueError, KeyError or IndexError where the header is not a plain one.
    """
    end = data.index(b"end_header")
    body = data.index(b"\n", end) + 1
    kind, elements = "", list[tuple[str, int, list[Any]]]()
    for line in data[:body].decode("latin-1").splitlines():
        match line.split():
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as kind, "1.0"]:
                pass
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", counter, item, name]:
                elements[-1][2].extend([(_COUNT_OF + name, _PLY_TYPES[counter]), (name, _PLY_TYPES[item], (3,))])
            case ["property", scalar, name]:
                elements[-1][2].append((name, _PLY_TYPES[scalar]))
            case ["comment", *_] if "texturefile" in line.lower():
                raise ValueError(line)
            case [] | ["ply"] | ["end_header"] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise ValueError(line)
    rows = [(name, count, np.dtype(fields)) for name, count, fields in elements]
    file_order: Literal["<", ">"] = ">" if kind == "binary_big_endian" else "<"
    return kind, [(name, count, row.newbyteorder(file_order)) for name, count, row in rows], body


def _ply_table(text: bytes, row: np.dtype[Any], count: int) -> NDArray[Any]:
    """count rows of numbers in text as a structured array; InputError if too few, ValueError if they do not fit."""
    widths = {name: math.prod(row[name].shape) for name in row.names or ()}
    columns, whole = sum(widths.values()), all(row[name].base.kind in "iu" for name in widths)
    numbers = np.fromstring(text, dtype=np.int64 if whole else np.float64, sep=" ")
    if numbers.size < count * columns:
        raise InputError(f"expected {count} rows of {columns} numbers, got {numbers.size} in all; the file is cut")
    numbers = numbers.reshape(count, columns)
    table, column = np.empty(count, row), 0
    for name, width in widths.items():
        table[name] = numbers[:, column] if not row[name].shape else numbers[:, column : column + width]
        column += width
    return table


def _ply_columns(table: NDArray[Any], names: str) -> NDArray[Any] | None:
    """The named scalar columns side by side, [rows, columns]; None if one is missing."""
    if not set(names.split()) <= set(table.dtype.names or ()):
        return None
    return np.stack([table[name] for name in names.split()], axis=1)


def _ply_colors(table: NDArray[Any]) -> NDArray[Any] | None:
    """uint8 [rows, 3 or 4] if the table has colours; ValueError if they are no bytes, whose range would be a guess."""
    colors = _ply_columns(table, "red green blue alpha")
    if colors is None:
        colors = _ply_columns(table, "red green blue")
    if colors is not None and colors.dtype != np.uint8:
        raise ValueError(f"colours of {colors.dtype}")
    return colors


def _plain_stl(data: bytes) -> Scene | None:
    """The scene of a binary STL file; None for text, which is left to trimesh, as is a file of another length."""
    row = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    count = int.from_bytes(data[80:84], "little")
    if not count or len(data) != 84 + count * row.itemsize:
        return None
    corners = np.frombuffer(data, row, count, 84)["corners"]
    return Scene.from_arrays(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


_PLAIN_READERS: dict[str, Callable[[bytes], Scene | None]] = {"ply": _plain_ply, "stl": _plain_stl}


# --- checks ---------------------------------------------------------------------------------------------------------


def _vertices(value: ArrayLike) -> NDArray[np.float64]:
    """value as float64 [n, 3], or InputError."""
    array = _array("vertices", value)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise InputError(f"vertices: expected [n, 3] real numbers, got {_described(array)}")
    return np.ascontiguousarray(array, dtype=np.float64)


def _faces(value: ArrayLike, count: int) -> NDArray[np.int32]:
    """value as int32 [m, 3] with every index in 0..count-1 and m >= 1, or InputError."""
    array = _array("faces", value)
    if array.size == 0:
        raise InputError("faces: expected at least one triangle, got none; the mesh is empty")
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise InputError(f"faces: expected [m, 3] integers, got {_described(array)}")
    least, greatest = int(array.min()), int(array.max())
    if least < 0 or greatest >= count:
        wrong = least if least < 0 else greatest
        face = int(np.argmax((array == wrong).any(axis=1)))
        raise InputError(f"faces: expected indices 0..{count - 1}, got {wrong} in face {face}; the mesh is damaged")
    return np.ascontiguousarray(array, dtype=np.int32)


def _normals(value: ArrayLike, count: int) -> NDArray[np.float32]:
    """value as float32 [count, 3], or InputError."""
    array = _array("vertex_normals", value)
    if array.shape != (count, 3) or array.dtype.kind not in "fiu":
        raise InputError(f"vertex_normals: expected [{count}, 3] real numbers, got {_described(array)}")
    with np.errstate(over="ignore", under="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)


def _colors(name: str, value: ArrayLike, rows: tuple[int, ...]) -> Colors:
    """value as uint8 or float32 [*rows, 4], or InputError."""
    array = _array(name, value)
    if array.shape not in ((*rows, 3), (*rows, 4)) or array.dtype.kind not in "fiu":
        shape = ", ".join(map(str, (*rows, "3 or 4")))
        raise InputError(f"{name}: expected [{shape}] integers 0..255 or floats 0..1, got {_described(array)}")
    top = 1 if array.dtype.kind == "f" else 255
    if array.size and array.dtype != np.uint8:
        least, greatest = array.min(), array.max()  # NaN if any is
        if not (least >= 0 and greatest <= top):
            wrong = greatest if not greatest <= top else least
            kind = "floats" if top == 1 else "integers"
            raise InputError(f"{name}: expected {kind} 0..{top}, got {wrong}")
    colors = np.empty((*rows, 4), dtype=np.float32 if top == 1 else np.uint8)
    colors[..., : array.shape[-1]] = array
    if array.shape[-1] == 3:
        colors[..., 3] = top
    return colors


def _opacity(value: Any) -> float:
    """value as a float in 0..1, or InputError."""
    try:
        opacity = float(value)
    except (TypeError, ValueError):
        opacity = math.nan
    if not 0 <= opacity <= 1:
        raise InputError(f"opacity: expected a number 0..1, got {value}")
    return opacity


def _recolored(scene: Scene, color: Colors | None, opacity: float | None) -> Scene:
    """The scene with its rgb replaced by color [3] (with [4] its alpha too), then its alpha by opacity, where given."""
    colors = scene._colors
    if color is not None:
        if len(color) == 4 or colors.ndim == 1 or (colors[..., 3] == colors[0, 3]).all():
            alpha = color[3:] if len(color) == 4 else colors.reshape(-1, 4)[0, 3:]
            colors = np.concatenate(_alike([color[:3], alpha]))
        else:
            rgb, colors = _alike([color[:3], colors])
            colors = colors.copy()
            colors[..., :3] = rgb
    if opacity is not None:
        level = opacity * 255
        whole = abs(level - round(level)) <= 1e-9
        colors = colors.copy() if whole or colors.dtype != np.uint8 else _as_float(colors)
        colors[..., 3] = round(level) if colors.dtype == np.uint8 else opacity
    fields: dict[str, Any] = {"face_colors": None, "vertex_colors": None, "color": None}
    fields["color" if colors.ndim == 1 else "vertex_colors" if scene.face_colors is None else "face_colors"] = colors
    return replace(scene, **fields)


def _alike(arrays: list[Colors]) -> list[Colors]:
    """The colours as they are if all are uint8, else all as float32."""
    return arrays if all(array.dtype == np.uint8 for array in arrays) else [_as_float(array) for array in arrays]


def _as_float(colors: Colors) -> NDArray[np.float32]:
    """The colours as float32 0..1."""
    return np.asarray(colors / np.float32(255) if colors.dtype == np.uint8 else colors, dtype=np.float32)


def _array(name: str, value: ArrayLike) -> NDArray[Any]:
    """value as an array of numbers, or InputError."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected an array of numbers, got {type(value).__name__}: {error}") from None


def _described(array: NDArray[Any]) -> str:
    """An array's shape and type, for an error message."""
    return f"{list(array.shape)} {array.dtype}"
