"""Companions: the files that a mesh names, such as materials, textures and buffers, read without ever waiting."""

from __future__ import annotations

import base64
import io
import os
import stat
from urllib.parse import unquote, unquote_to_bytes

from clpeel.files import open_at_once
from clpeel.reading.signatures import looks_like


class Companions:
    """What trimesh calls a resolver: it gives the bytes of a name, and remembers those that could not be had.

    Only regular files in the mesh's folder or below are read: a pipe named as a texture could keep its reader waiting.
    given: bytes by name, from files read before or put there. lost: why a name could not be had.
    """

    def __init__(self, path: str) -> None:
        self.file_path, self.file_name = path, os.path.basename(path)
        self.folder = os.path.realpath(os.path.dirname(os.path.abspath(path)))
        self.given: dict[str, bytes] = {}
        self.lost: dict[str, str] = {}

    def get(self, name: str) -> bytes:
        """The bytes behind a file's name or a data URI; FileNotFoundError if there are none."""
        if name not in self.given:
            try:
                self.given[name] = _embedded(name) if name.startswith("data:") else self._file(name)
            except (OSError, ValueError) as error:
                self.lost[name] = getattr(error, "strerror", None) or str(error)
                raise FileNotFoundError(f"{named(name)}: {self.lost[name]}") from None
        return self.given[name]

    __getitem__ = get

    def _file(self, name: str) -> bytes:
        """The bytes of the first regular file among what the name may mean; OSError or ValueError says why not."""
        plain = name.strip()
        usual = plain.strip('"').replace("\\", "/")  # names may be quoted, and written on Windows
        reason = "no such file"
        for spelling in dict.fromkeys((plain, usual, unquote(usual), usual.lstrip("/"), os.path.basename(usual))):
            path = os.path.realpath(os.path.join(self.folder, spelling))
            if os.path.commonpath((path, self.folder)) != self.folder:
                reason = "it lies outside the folder of the mesh" if reason == "no such file" else reason
            elif os.path.lexists(path):
                if stat.S_ISREG(os.stat(path).st_mode):
                    return _regular(path)
                reason = "not a regular file"
        raise ValueError(reason)

    def picture(self, name: str) -> str | None:
        """Why the picture behind a name cannot be a texture, for a note; None if it can be opened."""
        try:
            return unusable(self.get(name))
        except FileNotFoundError:
            return self.lost[name]


def _regular(path: str) -> bytes:
    """A regular file's bytes; opening does not wait should it have become a pipe meanwhile."""
    with open(path, "rb", opener=open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError("not a regular file")
        return file.read()


def _embedded(uri: str) -> bytes:
    """The bytes in a data URI, data:[type][;base64],bytes."""
    head, comma, body = uri.partition(",")
    if not comma:
        raise ValueError("a data URI without data")
    return base64.b64decode(unquote_to_bytes(body)) if head.endswith(";base64") else unquote_to_bytes(body)


def unusable(data: bytes) -> str | None:
    """Why these bytes cannot be a texture, for a note; None where Pillow opens them."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data)):
            return None
    except Image.DecompressionBombError:
        return f"too large, more than the {2 * (Image.MAX_IMAGE_PIXELS or 0):,} pixels that are read"
    except UnidentifiedImageError:
        return f"expected an image, got {looks_like(data)}"
    except Exception as error:  # whatever a broken image makes a decoder raise
        return f"not a readable image, {type(error).__name__}"


def named(name: str) -> str:
    """A name from a file in quotes, short and without control characters, for a note or an error."""
    if name.startswith("data:"):
        return "embedded data"
    shown = name.strip()
    return repr(shown if len(shown) <= 80 else f"{shown[:40]}…{shown[-39:]}")
