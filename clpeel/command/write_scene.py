"""Writing a scene file: what a command line says, as TOML that `clpeel render` reads."""

from __future__ import annotations

import argparse
import json
import os
import re
from collections.abc import Callable

from clpeel.command.toml import NOT_IN_FILES, PATHS, SUFFIX, is_scene_file
from clpeel.errors import InputError

HEAD = "# A scene for clpeel render. Paths are relative to this file."

NUMBER = r"-?(0|[1-9]\d*)(\.\d+)?([eE][+-]?\d+)?"
"""A number that is written in TOML as on the command line."""

TEXTS = ("technique", "device", "memory", "output", "stats", "map", "coloring_array", "opacity_array", "lighting")
"""Options whose texts may look like numbers."""


def prepared(options: argparse.Namespace) -> Callable[[], None]:
    """Return a function that writes the scene file that is asked for. Raises InputError if it cannot be."""
    path = options.write_scene
    from clpeel.command.outputs import check_apart, check_writable, write
    from clpeel.command.streams import say

    if path != "-" and not is_scene_file(path):
        raise InputError(f"--write-scene: expected a name ending in {SUFFIX}, got '{path}'")
    for name in options.named:
        if is_scene_file(name):
            raise InputError(f"--write-scene: expected mesh files, got the scene file '{name}'")
    if path == options.output == "-":
        raise InputError("--write-scene: expected a file of its own, got '-', where the picture goes")
    target = check_writable(path, "--write-scene")
    check_apart({"--write-scene": target, "--output": options.output}, options.inputs)
    text = scene_text(options, path).encode()

    def done() -> None:
        write(target, text)
        if not options.quiet and path != "-":
            say(f"wrote {path}")

    return done


def scene_text(options: argparse.Namespace, path: str) -> str:
    """Return the text of the scene file, which will be at `path`. Raises InputError if a name is not Unicode."""
    found: dict[str, str] = {}
    for flag, text in options.words:
        name = flag.removeprefix("--")
        plain = name.replace("-", "_")
        if plain in NOT_IN_FILES or plain in options.each:
            continue
        if plain in PATHS and text not in (None, "-"):
            text = _relative(text, path)
        found[name] = "true" if text == "-" and plain == "stats" else _value(plain, text)
    lines = [HEAD, *(f"{name} = {value}" for name, value in found.items())]
    for k, file in enumerate(options.files):
        lines += ["", "[[mesh]]", f"path = {_quoted(_relative(file, path))}"]
        for option, texts in options.each_texts.items():
            place = k if len(texts) > 1 else 0
            off = texts[place] is None and not options.each[option][place]
            lines.append(f"{option.replace('_', '-')} = {'false' if off else _value(option, texts[place])}")
    return "\n".join(lines) + "\n"


def _relative(name: str, path: str) -> str:
    """Return the name of a file as a scene file at `path` has it."""
    return name if os.path.isabs(name) else os.path.relpath(name, os.path.dirname(path) or os.curdir)


def _value(option: str, text: str | None) -> str:
    """Return TOML for the text of an option, or for a switch, whose text is None."""
    if text is None:
        return "true"
    parts = text.split(",")
    if option in TEXTS or not all(re.fullmatch(NUMBER, part) for part in parts):
        return _quoted(text)
    return parts[0] if len(parts) == 1 else f"[{', '.join(parts)}]"


def _quoted(text: str) -> str:
    """Return text in the quotes of TOML. Raises InputError if it is not Unicode."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"--write-scene: expected names that are Unicode, got {text!a}") from None
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
