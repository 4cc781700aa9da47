"""Kept frames: pictures of a film that are finished, as PNGs in a folder, where the next run finds them."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.files import locked, write_whole
from clpeel.film.outputs import Output

if TYPE_CHECKING:
    from PIL import Image

MARK = "clpeel turntable"
"""The name of the text in a frame's PNG that says which frame of which film it is, and its notes, as JSON."""


@dataclass(frozen=True)
class Kept:
    """The frames of a film in a folder. name: returns that of frame k, from 0. recipe: what the film is made of."""

    folder: str
    name: Callable[[int], str]
    recipe: str

    def path(self, k: int) -> str:
        """Return where frame k is."""
        return os.path.join(self.folder, self.name(k))

    def notes(self, k: int) -> list[str] | None:
        """Return the notes of frame k, or None if it is not there, damaged, or of another film."""
        try:
            with opened(self.path(k)) as image:
                mark = json.loads(image.info[MARK])
                if (mark["recipe"], mark["frame"]) != (self.recipe, k):
                    return None
                image.verify()
            with opened(self.path(k)) as image:
                image.load()
            return [str(note) for note in mark["notes"]]
        except Exception:  # whatever a damaged file makes of the reader
            return None

    def add(self, k: int, image: NDArray[np.uint8], notes: Sequence[str]) -> None:
        """Keep frame k: uint8 [height, width, 4]. Raises InputError if it cannot be written."""
        from PIL import Image
        from PIL.PngImagePlugin import PngInfo

        info, data = PngInfo(), io.BytesIO()
        info.add_itxt(MARK, json.dumps({"recipe": self.recipe, "frame": k, "notes": list(notes)}))
        opaque = bool((image[..., 3] == 255).all())
        shown = Image.fromarray(np.ascontiguousarray(image[..., :3]) if opaque else image)
        shown.save(data, "PNG", compress_level=4, pnginfo=info)
        write_whole(self.path(k), data.getvalue())

    def image(self, k: int) -> Image.Image:
        """Return frame k, RGB or RGBA. Raises InputError if somebody has taken it away."""
        try:
            with opened(self.path(k)) as image:
                image.load()
                return image
        except Exception as error:
            raise InputError(f"path: frame {k + 1} in '{self.folder}' cannot be read any more: {error}") from None

    def remove_beyond(self, output: Output, count: int) -> int:
        """Remove numbered frames of longer films. Returns how many. Other pictures stay, whatever their names."""
        removed = 0
        for name in os.listdir(self.folder):
            k = output.number(name)
            if k is None or k < count or not marked(os.path.join(self.folder, name)):
                continue
            with suppress(OSError):
                os.unlink(os.path.join(self.folder, name))
                removed += 1
        return removed


def finished(output: Output) -> int:
    """Return how many frames of a film in one file an interrupted run has left."""
    with suppress(OSError):
        return len([name for name in os.listdir(hidden_folder(output.path)) if name.endswith(".png")])
    return 0


@contextmanager
def opened(path: str) -> Iterator[Image.Image]:
    """Open a picture. Only files are opened, as a pipe of that name would never end."""
    from PIL import Image

    if not os.path.isfile(path):
        raise FileNotFoundError(path)
    with warnings.catch_warnings(), open(path, "rb") as file:
        warnings.simplefilter("ignore")
        with Image.open(file, formats=["PNG"]) as image:
            yield image


def marked(path: str) -> bool:
    """Return whether a file is a frame that a turntable has written."""
    try:
        with opened(path) as image:
            return MARK in image.info
    except Exception:
        return False


# --- the folder -------------------------------------------------------------------------------------------------------


@contextmanager
def folder_of(output: Output) -> Iterator[str]:
    """Give the folder that a film's frames are kept in, which is made if it is missing.

    Frames of a film in one file are in a hidden folder beside it, which nobody else uses meanwhile. It is removed at
    the end, but stays if anything ends the block before, unless nothing is in it. Raises InputError if there can be
    none.
    """
    folder = output.path if output.kind == "png" else hidden_folder(output.path)
    numbered = output.kind == "png"
    made = _made(folder, private=not numbered)
    if not numbered:
        _check_own(folder)
    try:
        if numbered:
            yield folder
            return
        with locked(folder) as alone:
            if not alone:
                raise InputError(f"path: another turntable is writing '{output.path}'; wait for it, or name another")
            yield folder
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        if made or not numbered:
            with suppress(OSError):
                os.rmdir(folder)  # this works only if it is empty


def _made(folder: str, private: bool) -> bool:
    """Make a folder. Returns whether it was missing."""
    try:
        os.mkdir(folder, 0o700 if private else 0o777)
    except FileExistsError:
        return False
    except OSError as error:
        raise InputError(f"path: cannot make the folder '{folder}': {error.strerror}") from None
    return True


def hidden_folder(path: str) -> str:
    """Return the folder for the frames of a film. Its name is short, whatever the film's is, and always the same."""
    name = hashlib.blake2b(os.fsencode(os.path.basename(path)), digest_size=8).hexdigest()
    return os.path.join(os.path.dirname(path), f".clpeel-turntable-{name}")


def _check_own(folder: str) -> None:
    """Raise InputError if somebody else has put something in the place of the hidden folder."""
    found: Any = os.lstat(folder)
    if not os.path.isdir(folder) or os.path.islink(folder) or (hasattr(os, "geteuid") and found.st_uid != os.geteuid()):
        raise InputError(f"path: expected a folder of your own for frames at '{folder}', got another; remove it")
