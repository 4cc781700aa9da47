"""Pieces: the mesh files of a command, each with the options that hold for it, and how they become one scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from clpeel.command.coloring import COLORING, given_coloring
from clpeel.command.order import MOMENT
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.scene.scene import Scene

Matrix = tuple[tuple[float, ...], ...]


class Piece(NamedTuple):
    """A mesh file. options: those of EACH that are given for it; None stands for what the file says.

    matrix: 4 rows of 4 numbers, by which it is moved, or None. origin: where a scene file names it, for errors.
    """

    path: str
    options: Mapping[str, Any] = MappingProxyType({})
    matrix: Matrix | None = None
    origin: str = ""


def alike(pieces: Sequence[Piece], names: Sequence[str]) -> bool:
    """Return whether all pieces have the same values of these options."""
    first, *others = ([piece.options.get(name) for name in names] for piece in pieces)
    return all(other == first for other in others)


def shared(pieces: Sequence[Piece], name: str) -> Any:
    """Return the value of an option that all pieces have, or None if they differ."""
    return pieces[0].options.get(name) if alike(pieces, (name,)) else None


def colorings(pieces: Sequence[Piece]) -> list[dict[str, Any] | None]:
    """Return the arguments of with_scalars for each piece, or None where its colours are its own. Raises InputError.

    What is the same for all may be given for those without numbers, too, as long as one has some.
    """
    numbered = any(piece.options.get("coloring_array") is not None for piece in pieces)
    common = {name for name in COLORING if numbered and alike(pieces, (name,))}
    found = []
    for piece in pieces:
        given = {name: value for name, value in piece.options.items() if name in COLORING}
        if given.get("coloring_array") is None:
            given = {name: value for name, value in given.items() if name not in common}
        try:
            found.append(given_coloring(given))
        except InputError as error:
            where = piece.origin or ("" if alike(pieces, COLORING) else piece.path)
            raise InputError(f"{where}: {error}" if where else str(error)) from None
    return found


def read(pieces: Sequence[Piece], drop_duplicates: bool = False) -> Scene:
    """Return the scene of all pieces, in their order. Raises InputError."""
    import clpeel

    extra: dict[str, Any] = {"drop_duplicates": True} if drop_duplicates else {}
    given = colorings(pieces)
    if alike(pieces, ("opacity", "color", *MOMENT)) and not _apart(pieces):
        whole = clpeel.load(*(piece.path for piece in pieces), **_looks(pieces[0]), **_moment(pieces[0]), **extra)
        return _colored(whole, given[0])
    each = zip(pieces, _read_each(pieces), given, strict=True)
    groups = [list(group) for _, group in groupby(each, key=lambda parts: parts[2])]
    if len(groups) == 1:
        return _colored(clpeel.load(*(scene for _, scene, _ in groups[0]), **extra), given[0])
    colored = (
        _named(first[0], _colored, clpeel.load(*(scene for _, scene, _ in (first, *others))), first[2])
        for first, *others in groups
    )
    return clpeel.load(*colored, **extra)


def _apart(pieces: Sequence[Piece]) -> bool:
    """Return whether pieces must be read one by one."""
    return any(piece.matrix for piece in pieces) or not alike(pieces, ("backface_type", *COLORING))


def _read_each(pieces: Sequence[Piece]) -> list[Scene]:
    """Return the scene of each piece, moved, and with the sides that are seen. Raises InputError."""
    import clpeel
    from clpeel.reading.load import may_move
    from clpeel.reading.placing import moved_scene, sided

    may = [may_move(piece.path) for piece in pieces]
    scenes = []
    sides = None if alike(pieces, ("backface_type",)) else "backface_type"
    for piece, moves in zip(pieces, may, strict=True):
        moment = _moment(piece) if moves or not any(may) else {}  # if none may move, it is an error
        scene = clpeel.load(piece.path, **_looks(piece), **moment)
        if piece.matrix is not None:
            scene = _named(piece, moved_scene, scene, piece.matrix)
        scenes.append(scene if sides is None else _named(piece, sided, scene, piece.options.get(sides)))
    return scenes


def _named(piece: Piece, change: Callable[..., Scene], *arguments: Any) -> Scene:
    """Return what a function makes of the scene of a piece. Its InputError then begins with the piece's name."""
    try:
        return change(*arguments)
    except InputError as error:
        raise InputError(f"{piece.origin or piece.path}: {error}") from None


def _looks(piece: Piece) -> dict[str, Any]:
    return {name: piece.options.get(name) for name in ("opacity", "color")}


def _moment(piece: Piece) -> dict[str, Any]:
    return {name: value for name in MOMENT if (value := piece.options.get(name)) is not None}


def _colored(scene: Scene, coloring: Mapping[str, Any] | None) -> Scene:
    """Return the scene, coloured by numbers if there is a coloring."""
    import clpeel

    return scene if coloring is None else clpeel.with_scalars(scene, **coloring)
