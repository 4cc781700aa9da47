"""Given: completes the options of a command line by the user's settings and by scene files, each with its origin."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from clpeel.command.config import defaults, users_file
from clpeel.command.order import EACH, spread
from clpeel.command.pieces import Piece, shared
from clpeel.command.toml import Keys, is_scene_file, over
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.command.parser import Parser
    from clpeel.command.scene_file import SceneFile
    from clpeel.command.words import Words


def complete(options: argparse.Namespace, words: Words, parser: Parser) -> argparse.Namespace:
    """Return the options with what the settings and scene files say where the command line says nothing.

    Besides the options themselves, they then have:
    pieces: the meshes, each with the options of its own. files: their paths. named: the files of the command line.
    inputs: all files that are read.
    each, each_texts: values and texts of the options that files may have of their own, as the command line gives them:
    one for all files or one for each. words: flags and texts of the command line. line: the command line in its order,
    with the file of settings. lights: those of a scene file.
    origins: where values come from that are not of the command line, by name. notes: what is left out.
    Raises InputError.
    """
    command = parser.commands[options.command]
    keys = Keys.of(command.options(), parser.options())
    given = {name: getattr(options, name) for name in getattr(options, "given", ()) if name not in EACH}
    settings = _settings(options)
    config, origins = defaults(settings, options.command, parser.commands, keys) if settings else ({}, {})
    named = list(getattr(options, "files", ()))
    scenes = _scene_files(named, options.command, keys)
    scene = next(iter(scenes.values()), None)
    found = over(over(config, scene.options) if scene else config, given)
    for name, value in found.items():
        if name not in EACH:
            setattr(options, name, value)
    both = _each(options, words, keys, len(named))
    each = {name: [value for value, _ in pairs] for name, pairs in both.items()}
    options.each_texts = {name: [text for _, text in pairs] for name, pairs in both.items()}
    first = {action.option_strings[0] for action in command.options()}
    options.words = [(flag, text) for flag, text, _ in words.options if flag in first]
    own = [f"--config={settings}"] if settings and not options.config else []
    options.line = [options.command, *own, *words.in_order(named)]
    options.pieces = _pieces(named, scenes, {name: config[name] for name in EACH if name in config}, each)
    _tell_pieces(options, each)
    options.inputs = (*getattr(options, "files", ()), *scenes, *([settings] if settings else []))
    options.named = named
    options.lights, options.notes = (scene.lights, scene.notes) if scene else ((), ())
    origins |= scene.origins if scene else {}
    options.origins = {name: where for name, where in origins.items() if name not in given}
    return options


def _settings(options: argparse.Namespace) -> str | None:
    """Return the path of the file of settings that holds, or None. Raises InputError."""
    if options.config is not None and options.no_config:
        raise InputError("--config: expected no --no-config with it, got both")
    if options.config == "":
        raise InputError("--config: expected a file name, got ''")
    return options.config or (None if options.no_config else users_file())


def _scene_files(named: list[str], command: str, keys: Keys) -> dict[str, SceneFile]:
    """Return what the scene file says, by its name, if there is one. Raises InputError if there are more."""
    files = [name for name in named if is_scene_file(name)]
    if not files:
        return {}
    if len(files) > 1:
        raise InputError(f"{files[1]}: expected one scene file, got {len(files)}")
    from clpeel.command.scene_file import read_scene_file

    return {files[0]: read_scene_file(files[0], command, keys)}


def _each(options: argparse.Namespace, words: Words, keys: Keys, files: int) -> dict[str, list[tuple[Any, str | None]]]:
    """Return what the command line gives of each option of EACH: values with their texts, for all files or for each."""
    found = {}
    for name, values in getattr(options, "given", {}).items():
        if name in EACH:
            action = next(action for action in keys.actions.values() if action.dest == name)
            own = [(place, text) for flag, text, place in words.options if flag in action.option_strings]
            given = [(place, (value, text)) for (place, text), value in zip(own, values, strict=True)]
            found[name] = spread(action.option_strings[0], given, files)
    return found


def _pieces(
    named: list[str], scenes: Mapping[str, SceneFile], config: Mapping[str, Any], each: Mapping[str, list[Any]]
) -> tuple[Piece, ...]:
    """Return the meshes of all files. Without files there is one piece, for the built-in scene."""
    found: list[Piece] = []
    for k, name in enumerate(named or [""]):
        own = {option: values[k if len(values) > 1 else 0] for option, values in each.items()}
        for piece in scenes[name].pieces if name in scenes else (Piece(name),):
            options = over(over(config, piece.options), own)
            found.append(Piece(piece.path, options, piece.matrix, piece.origin))
    return tuple(found)


def _tell_pieces(options: argparse.Namespace, each: Mapping[str, list[Any]]) -> None:
    """Replace what argparse found of the options of pieces by what holds for them."""
    for name in EACH:
        vars(options).pop(name, None)
    options.each = each
    options.backface_type = shared(options.pieces, "backface_type")
    if hasattr(options, "files"):
        options.files = [piece.path for piece in options.pieces if piece.path]
