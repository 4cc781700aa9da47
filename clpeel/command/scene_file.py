"""Scene files: reads what a TOML file says of meshes, lights, camera and picture, as options of the command."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, get_type_hints

from clpeel.checks import named_view
from clpeel.command.order import EACH
from clpeel.command.pieces import Matrix, Piece
from clpeel.command.toml import PATHS, Keys, is_number, is_scene_file, over, read_toml, said, spelled, unknown
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.scene.lights import Lamp

CAMERA = {"view": "camera_direction", "up": "camera_view_up", "clipping_range": "clipping_range"}
"""Keys of [camera] that are not those of an option that begins with `camera`."""

MOVES = ("translate", "rotate", "scale", "matrix")

IDENTITY: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class SceneFile(NamedTuple):
    """What a scene file says. options, origins: values by name, and where they come from. notes: what is left out."""

    pieces: tuple[Piece, ...]
    lights: tuple[Lamp, ...] = ()
    options: Mapping[str, Any] = MappingProxyType({})
    origins: Mapping[str, str] = MappingProxyType({})
    notes: tuple[str, ...] = ()


def read_scene_file(path: str, command: str, keys: Keys) -> SceneFile:
    """Return what a scene file says to a command with these options.

    Raises InputError, which begins with the path and says which table and key is wrong.
    """
    top = spelled(f"{path}: ", read_toml(path))
    meshes, lights = (_tables(path, name, top.pop(name, [])) for name in ("mesh", "light"))
    if not meshes:
        raise InputError(f"{path}: expected a mesh, [[mesh]] with its path, got none")
    flat = {**_camera(path, top.pop("camera", {}), keys), **{key: (path, value) for key, value in top.items()}}
    options: dict[str, Any] = {}
    origins: dict[str, str] = {}
    left_out = []
    for key, (where, value) in flat.items():
        if key in keys.others or (key == "output" and command != "render"):
            left_out.append(key.replace("_", "-"))
            continue
        if key not in keys.actions:
            unknown(where, key, {*keys.actions, *keys.others, "mesh", "light", "camera"})
        name, options_value = keys.converted(where, key, value)
        options[name], origins[name] = _from_here(path, name, options_value), where
    common = {name: options.pop(name) for name in EACH if name in options}
    said_of = f"{path}: not options of clpeel {command}, left out: {', '.join(left_out)}"
    return SceneFile(
        tuple(_piece(path, f"{path}: mesh {k}", table, common, keys) for k, table in enumerate(meshes, 1)),
        tuple(_light(f"{path}: light {k}", table) for k, table in enumerate(lights, 1)),
        options,
        origins,
        (said_of,) if left_out else (),
    )


def _tables(path: str, name: str, value: Any) -> list[dict[str, Any]]:
    """Return a list of tables, or raise InputError."""
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise InputError(f"{path}: {name}: expected tables, each below [[{name}]], got {said(value)}")
    return [spelled(f"{path}: {name} {k}: ", table) for k, table in enumerate(value, 1)]


def _from_here(path: str, name: str, value: Any) -> Any:
    """Return the value of an option, relative to the scene file if it is a path."""
    return os.path.join(os.path.dirname(path), value) if name in PATHS and value != "-" else value


# --- the camera -------------------------------------------------------------------------------------------------------


def _camera(path: str, value: Any, keys: Keys) -> dict[str, tuple[str, Any]]:
    """Return the keys of options that [camera] stands for, each with where it is and its value. Raises InputError."""
    where = f"{path}: camera"
    if isinstance(value, str):
        if not named_view(value):
            raise InputError(f'{where}: expected a view such as "iso" or "-xy", or a table, [camera], got {value!r}')
        return {"camera_direction": (path, value)}
    if not isinstance(value, dict):
        raise InputError(f'{where}: expected a view such as "iso", or a table, [camera], got {said(value)}')
    known = {key.removeprefix("camera_") for key in {*keys.actions, *keys.others} if key.startswith("camera_")}
    found: dict[str, tuple[str, Any]] = {}
    for key, each in spelled(f"{where}: ", value).items():
        if key not in known and key not in CAMERA:
            unknown(where, key, {*known, *CAMERA})
        name = CAMERA.get(key, f"camera_{key}")
        if name in found:
            raise InputError(f"{where}: {key.replace('_', '-')}: expected one of two that mean the same, got both")
        found[name] = (path, each)
    return found


# --- meshes -----------------------------------------------------------------------------------------------------------


def _piece(path: str, where: str, table: Mapping[str, Any], common: Mapping[str, Any], keys: Keys) -> Piece:
    """Return the mesh of a table. common: options of all meshes of the file. Raises InputError."""
    name = table.get("path")
    if not isinstance(name, str) or not name or "\0" in name:
        came = "none" if name is None else said(name)
        raise InputError(f"{where}: path: expected the name of a mesh file, got {came}")
    if is_scene_file(name):
        raise InputError(f"{where}: path: expected a mesh file, got the scene file '{name}'")
    own = {key for key in {*keys.actions, *keys.others} if key in EACH}
    options = {}
    for key, value in table.items():
        if key in own and key in keys.actions:
            dest, options[key] = keys.converted(where, key, value)
        elif key not in ("path", *MOVES, *own):
            unknown(where, key, {"path", *MOVES, *own})
    return Piece(os.path.join(os.path.dirname(path), name), over(common, options), _matrix(where, table), where)


def _numbers(shown: str, value: Any, count: int, expected: str) -> tuple[float, ...]:
    """Return numbers of a list, or raise InputError."""
    if not isinstance(value, list) or len(value) != count or not all(map(is_number, value)):
        raise InputError(f"{shown}: expected {expected}, got {said(value)}")
    try:
        found = tuple(map(float, value))
    except OverflowError:
        found = (float("inf"),)
    if not all(abs(number) < float("inf") for number in found):
        raise InputError(f"{shown}: expected {expected} that are finite, got {said(value)}")
    return found


def _matrix(where: str, table: Mapping[str, Any]) -> Matrix | None:
    """Return what moves a mesh: `matrix`, or scale, then rotate, then translate; None if nothing does."""
    if "matrix" in table:
        others = [name for name in MOVES[:3] if name in table]
        if others:
            raise InputError(f"{where}: matrix: expected no {others[0]} with it, got both")
        rows, expected = table["matrix"], "4 rows of 4 numbers"
        if not isinstance(rows, list) or len(rows) != 4:
            raise InputError(f"{where}: matrix: expected {expected}, got {said(rows)}")
        found = tuple(_numbers(f"{where}: matrix", row, 4, expected) for row in rows)
        if list(found[3]) != [0, 0, 0, 1]:
            raise InputError(f"{where}: matrix: expected 0, 0, 0, 1 in the last row, got {said(rows[3])}")
        return found
    if not any(name in table for name in MOVES):
        return None
    scale = table.get("scale", 1)
    factors: object = [scale] * 3 if is_number(scale) else scale
    x, y, z = _numbers(f"{where}: scale", factors, 3, "a number, or 3 numbers")
    if not x or not y or not z:
        raise InputError(f"{where}: scale: expected numbers other than 0, got {said(scale)}")
    turn = _turn(
        _numbers(f"{where}: rotate", table.get("rotate", [0, 0, 0]), 3, "3 angles in degrees, about X, Y and Z")
    )
    at = _numbers(f"{where}: translate", table.get("translate", [0, 0, 0]), 3, "3 numbers")
    return (
        *((row[0] * x, row[1] * y, row[2] * z, offset) for row, offset in zip(turn, at, strict=True)),
        IDENTITY[3],
    )


def _turn(degrees: Sequence[float]) -> list[list[float]]:
    """Return the matrix of three turns, about X first, then Y, then Z, each counterclockwise as seen from its end."""
    found = [[float(row == column) for column in range(3)] for row in range(3)]
    for axis, angle in enumerate(degrees):
        cos, sin = _cos_sin(angle)
        a, b = (axis + 1) % 3, (axis + 2) % 3
        found[a], found[b] = (
            [cos * up - sin * side for up, side in zip(found[a], found[b], strict=True)],
            [sin * up + cos * side for up, side in zip(found[a], found[b], strict=True)],
        )
    return found


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Return the cosine and the sine of an angle, which are exact for quarter turns."""
    import math

    quarters, rest = divmod(degrees, 90)
    cos, sin = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[int(quarters) % 4]


# --- lights -----------------------------------------------------------------------------------------------------------


def _light(where: str, table: Mapping[str, Any]) -> Lamp:
    """Return the light of a table. Raises InputError."""
    from clpeel.scene import lights

    kinds: dict[str, type[Lamp]] = {
        "ambient": lights.AmbientLight,
        "directional": lights.DirectionalLight,
        "point": lights.PointLight,
        "spot": lights.SpotLight,
    }
    name = table.get("kind")
    if not isinstance(name, str) or name not in kinds:
        came = "none" if name is None else said(name)
        raise InputError(f"{where}: kind: expected one of {', '.join(kinds)}, got {came}")
    kind = kinds[name]
    hints = get_type_hints(kind)
    known = [each.name for each in fields(kind)]
    given: dict[str, Any] = {}
    for key, value in table.items():
        if key == "kind":
            continue
        if key not in known:
            unknown(where, key, ("kind", *known))
        given[key] = _of_light(where, key, hints[key], value)
    for needed in ("direction", "position"):
        if needed in known and needed not in given:
            raise InputError(f"{where}: {needed}: expected X,Y,Z, got none")
    try:
        return kind(**given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _of_light(where: str, key: str, hint: Any, value: Any) -> Any:
    """Return a value of a light as its field has it: a bool, a number, text of a colour, or three numbers."""
    shown = f"{where}: {key.replace('_', '-')}"
    if hint is bool:
        if not isinstance(value, bool):
            raise InputError(f"{shown}: expected true or false, got {said(value)}")
        return value
    if "tuple" in str(hint):
        color = key in ("color", "sky", "ground")
        if color and isinstance(value, str):
            return value
        return _numbers(shown, value, 3, "a name of a colour, or 3 numbers" if color else "3 numbers")
    if not is_number(value):
        raise InputError(f"{shown}: expected a number, got {said(value)}")
    return float(value)
