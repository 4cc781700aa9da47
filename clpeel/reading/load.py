"""Loading: turns any file of meshes or points, or mesh of another library, into a Scene."""

from __future__ import annotations

import gzip
import io
import logging
import math
import os
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from types import NoneType
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from clpeel import checks
from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.losses import listed
from clpeel.reading.objects import KNOWN, library_of, of_object
from clpeel.reading.reader_log import collected
from clpeel.reading.signatures import check_beginning
from clpeel.reading.words import one_line
from clpeel.reading.xyz import XYZ, xyz
from clpeel.scene.arrays import checked_color, checked_opacity
from clpeel.scene.duplicates import duplicates
from clpeel.scene.fields import NOT_SHOWN, names_of
from clpeel.scene.scene import Scene, joined, recolored, without_faces

if TYPE_CHECKING:
    from clpeel.reading.gltf_animations import Moment
    from clpeel.scene.scalars import Mapped

GLTF = ("glb", "gltf")

KNOWN_EXTENSIONS = ("ply", "stl", "obj", "off", "glb", "gltf", "3mf", "pcd", *XYZ)
"""File types that `load` always reads, with or without .gz. It reads more where trimesh has the packages for them."""

_OWN = ("ply", "stl", "obj", "off")
"""Those that a module of this name reads. It needs no trimesh, whose import alone can take most of a command's time."""


def load(
    *sources: Any,
    opacity: float | str | ArrayLike | None = None,
    color: ArrayLike | None = None,
    drop_duplicates: bool = False,
    animation_index: int | None = None,
    animation_time: float | None = None,
    scalars: str | ArrayLike | None = None,
    **mapped: Unpack[Mapped],
) -> Scene:
    """Return one Scene from mesh files, meshes of other libraries, and Scenes. Several are joined in the order given.

    Files may be PLY, STL, OBJ, OFF, GLB, glTF or 3MF, or point clouds as PCD or text (XYZ), each with or without .gz.
    With other packages they may also be VTK's, STEP, IGES, COLLADA, FBX, USD, 3DS, or others that meshio and Assimp
    read (reading/libraries.py). Meshes may be those of trimesh, PyVista, VTK, meshio and Open3D;
    `clpeel.from_pyvista` takes a whole PyVista plotter.
    Lines and points of PLY, OBJ and glTF are drawn, too. Scene-graph transforms are applied in
    float64. Colours come from the faces, the vertices, and the materials with their textures: base colours and alpha
    modes of glTF, which are linear, and Kd, d, map_Kd and map_d of OBJ, which are display-referred, as are colours in
    PLY, STL, OFF and 3MF files. A mesh without any colour gets DEFAULT_COLOR, but a glTF mesh without a material is
    white.

    color [3|4], or text such as "steelblue", replaces every rgb; with an alpha, it replaces every alpha too. opacity
    0..1 replaces every alpha. drop_duplicates: faces whose three corners lie at the same places, in any order, are
    duplicates; only the first of them is kept, with its colours, and the vertices stay. The scene's notes say what a
    file holds that the scene lacks, and how many faces are duplicates.

    animation_index, from 0, and animation_time, in seconds, choose a moment of an animation in every glTF file. One of
    them alone means animation 0, or its start. Without both, meshes are in their pose at rest.

    scalars: the name of an array that the files carry, such as a property of PLY or a field of PCD, or an array. The
    scene is coloured by it, and then opacity may be more than a number: with_scalars, which has all other options.

    Raises InputError, one line that begins with the file's name, if a file is missing, unreadable, damaged, of an
    unknown type, without anything to draw, or requires a glTF extension that is not read, or if a glTF file has no such
    animation, or no source is a glTF file that could have one.
    """
    if not sources:
        raise InputError("load: expected at least one mesh file, trimesh object or Scene, got none")
    if scalars is None and mapped:
        raise InputError(f"{next(iter(mapped))}: expected scalars with it, got none")
    given_opacity = None if opacity is None or scalars is not None else checked_opacity(opacity)
    given_color = None if color is None else checked_color("color", color)
    moment = _moment(sources, animation_index, animation_time)
    scene = _without_duplicates(joined([_opened(source, moment) for source in sources]), drop_duplicates)
    if color is not None or given_opacity is not None:
        scene = recolored(scene, given_color, given_opacity)
    if scalars is None:
        return _with_arrays_noted(scene)
    from clpeel.scene.scalars import with_scalars

    return with_scalars(scene, scalars, opacity=opacity, **mapped)


_DUPLICATES = "duplicate faces"  # the note about duplicate faces begins like this


def _without_duplicates(scene: Scene, drop: bool) -> Scene:
    """Return the scene with a note of its duplicate faces. With drop, remove them, and note how many there were."""
    found, total = duplicates(scene.vertices, scene.faces, scene.single_sided), len(scene.faces)
    notes = tuple(note for note in scene.notes if not note.startswith(_DUPLICATES) or " dropped" in note)
    if not len(found):
        return scene if notes == scene.notes else replace(scene, notes=notes)
    if not drop:
        advice = (
            f"{_DUPLICATES}: {len(found):,} of {total:,} lie where another lies and are drawn too: with transparency, "
            "such surfaces are twice as opaque; drop them with --drop-duplicates, or use --coincident paper (of a "
            "technique that peels)"
        )
        return replace(scene, notes=(*notes, advice))
    said = f"{_DUPLICATES}: {len(found):,} of {total:,} dropped"
    return replace(without_faces(scene, found), notes=(*notes, said))


def _with_arrays_noted(scene: Scene) -> Scene:
    """Return the scene with a note of its arrays, if none of them is shown, and without an older one."""
    notes, names = [note for note in scene.notes if not note.startswith(NOT_SHOWN)], names_of(scene)
    if names and not scene.color_maps:
        notes.append(f"{NOT_SHOWN}{listed(map(named, names), 9)}; --coloring-array, or scalars, shows one")
    return scene if tuple(notes) == scene.notes else replace(scene, notes=tuple(notes))


def may_move(source: Any) -> bool:
    """Return whether a source of `load` is a file of a type that may have animations: glTF."""
    return isinstance(source, (str, os.PathLike)) and _extension(os.fsdecode(source)) in GLTF


def _moment(sources: Sequence[Any], index: int | None, time: float | None) -> Moment | None:
    """Return the moment of an animation that is asked for, or None. Raises InputError."""
    if index is None and time is None:
        return None
    if not any(may_move(source) for source in sources):
        name = "animation_time" if index is None else "animation_index"
        raise InputError(f"{name}: expected a glTF file among the sources, as others have no animations, got none")
    from clpeel.reading.gltf_animations import Moment

    if not isinstance(index, (int, np.integer, NoneType)):
        raise InputError(f"animation_index: expected a whole number, got {index!r}")
    seconds = checks.number(0 if time is None else time)
    if not math.isfinite(seconds):
        raise InputError(f"animation_time: expected a number of seconds, got {time!r}")
    return Moment(int(index or 0), seconds)


def _opened(source: Any, moment: Moment | None) -> Scene:
    """Return the scene of one source of `load`, at a moment of an animation if it may have any."""
    if isinstance(source, Scene):
        return source
    if isinstance(source, (str, os.PathLike)):
        return _from_file(os.fsdecode(source), moment)
    with _errors_named(f"{library_of(source)} object"), collected():
        scene = of_object(source)
    if scene is None:
        raise InputError(f"load: expected a path, {KNOWN} or a Scene, got {type(source).__name__}")
    return scene


def _from_file(path: str, moment: Moment | None) -> Scene:
    """Return the scene in a mesh file, at a moment of an animation if it may have any."""
    extension = _extension(path)
    if os.path.isdir(path):
        raise InputError(f"{path}: expected a mesh file, one of {_known()}, got a directory")
    if extension not in KNOWN_EXTENSIONS and os.path.exists(path):
        _require_reader(path, extension)
    data = _contents(path)
    with _errors_named(path), collected():
        if extension != "stl":
            check_beginning(extension, data)
        # Readers are imported here where most files do not need them.
        if extension in GLTF:
            from clpeel.reading.gltf import read_gltf

            return read_gltf(data, extension, Companions(path), moment)
        if extension == "3mf":
            from clpeel.reading.three_mf import three_mf

            return three_mf(data)
        if extension == "pcd":
            from clpeel.reading.pcd import pcd

            return pcd(data)
        if extension in XYZ:
            return xyz(data, extension)
        if extension in _OWN:
            read: Callable[[bytes, Companions], Scene] = getattr(
                import_module(f"clpeel.reading.{extension}"), extension
            )
            return read(data, Companions(path))
    _require_reader(path, extension)
    from clpeel.reading.libraries import read_by_library

    with _errors_named(path), collected() as records:
        own = read_by_library(path, extension, data)
        if own is not None:
            return own
        return _read(path, extension, data, records)


def _extension(path: str) -> str:
    """Return the extension of a path in lower case, without its dot, and without that of gzip."""
    stem = path[:-3] if path.lower().endswith(".gz") else path
    return os.path.splitext(stem)[1].lower().removeprefix(".")


def _read(path: str, extension: str, data: bytes, records: list[logging.LogRecord]) -> Scene:
    """Return the scene that trimesh reads from a file's data, with notes of what it lacks. records: trimesh's log."""
    # These are imported here because most files need none of them.
    import trimesh

    from clpeel.reading import losses
    from clpeel.reading.from_trimesh import from_trimesh

    companions = Companions(path)
    loaded = trimesh.load_scene(io.BytesIO(data), file_type=extension, resolver=companions, process=False)
    notes = losses.logged(records)
    notes += losses.missing(companions, notes)
    scene = from_trimesh(loaded, display_referred=extension == "dae")
    own = [note for note in scene.notes if note not in notes]
    return replace(scene, notes=(*notes, *own))


def _require_reader(path: str, extension: str) -> None:
    """Raise InputError unless a library can read files with this extension."""
    from clpeel.reading.libraries import LIBRARY_EXTENSIONS, require

    if extension in LIBRARY_EXTENSIONS:
        with _errors_named(path):
            require(extension)
        return
    import trimesh

    if extension in trimesh.exchange.load.mesh_formats():
        return
    came = f".{extension}" if extension else "no extension"
    raise InputError(f"{path}: expected a mesh file, one of {_known()}, got {came}")


def _contents(path: str) -> bytes:
    """Return the file's bytes, decompressed if its name ends in .gz."""
    try:
        with open(path, "rb") as file:
            data = file.read()
        return gzip.decompress(data) if path.lower().endswith(".gz") else data
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(f"{path}: not a whole gzip file: {one_line(error)}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or one_line(error)}") from None


@contextmanager
def _errors_named(name: str) -> Iterator[None]:
    """Turn any error inside into an InputError of one line that begins with name."""
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except MemoryError:
        raise InputError(f"{name}: not a readable mesh: it asks for more memory than there is") from None
    except Exception as error:
        reason = f"the file is damaged (the reader stopped with {one_line(error)})"
        raise InputError(f"{name}: not a readable mesh: {reason}") from error


def _known() -> str:
    """Return the known extensions as text, for an error message."""
    return ", ".join(f".{extension}" for extension in KNOWN_EXTENSIONS) + " (also .gz of each)"
