"""Makes pictures anew: an entry's command runs in a copy of the tools and the pages, and touches nothing else."""

from __future__ import annotations

import io
import os
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import clpeel
from illustrations.examples import DOCS, ROOT, with_this_python
from illustrations.registry import Entry


class Failed(Exception):
    """A command that failed, or did not write its pictures. The message is one line."""


def remade(entry: Entry) -> dict[str, bytes]:
    """Return the pictures that the entry's command makes now, by their paths below docs.

    Raises Failed if it fails, or if one of the pictures that are there is not made any more.
    """
    with tempfile.TemporaryDirectory(prefix="clpeel-docs-") as place:
        root = Path(place)
        _copy_what_it_needs(root)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(_where_clpeel_is())}
        command = with_this_python(shlex.split(entry.command))
        done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            said = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise Failed(f"{entry.command}: {said[-1]}")
        made = {str(path.relative_to(root / "docs").as_posix()): path for path in (root / "docs").rglob("*.*")}
        if missing := [file for file in entry.files() if file not in made]:
            raise Failed(f"{entry.command}: wrote no {', '.join(missing)}")
        return {file: path.read_bytes() for file, path in sorted(made.items()) if entry.has(file)}


def _copy_what_it_needs(root: Path) -> None:
    """Copy the tools, the pages, and the folders of pictures without the pictures. Raises Failed if it cannot."""
    try:
        shutil.copytree(ROOT / "tools", root / "tools", ignore=shutil.ignore_patterns("__pycache__"))
        for folder in (DOCS, *(path for path in DOCS.rglob("*") if path.is_dir())):
            (root / "docs" / folder.relative_to(DOCS)).mkdir(parents=True)
        for page in DOCS.glob("*.md"):
            shutil.copy(page, root / "docs")
    except shutil.Error as error:
        raise Failed(f"cannot copy the tools: {error.args[0][0][2]}") from error
    except OSError as error:
        raise Failed(f"cannot copy the pages: {error}") from error


def _where_clpeel_is() -> list[str]:
    """Return the folders for PYTHONPATH: first the one that this process has clpeel from, as paths from anywhere."""
    given = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    return [str(Path(path).resolve()) for path in (os.path.dirname(clpeel.__path__[0]), *given)]


def difference(file: str, data: bytes) -> str:
    """Return how a picture differs from the one below docs, in pixels; nothing if all of them are the same."""
    if not (DOCS / file).is_file():
        return "there is none yet"
    with Image.open(DOCS / file) as old, Image.open(io.BytesIO(data)) as new:
        if old.size != new.size:
            return f"{new.width} x {new.height} pixels in place of {old.width} x {old.height}"
        was, now = (np.asarray(picture.convert("RGBA"), int) for picture in (old, new))
    off = np.abs(was - now).max(axis=2)
    return f"{np.count_nonzero(off)} pixels are off by up to {off.max()} of 255" if off.any() else ""
