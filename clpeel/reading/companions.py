"""Companions: the other files that a mesh file names, such as materials, textures and buffers. Reading never blocks."""

from __future__ import annotations

import base64
import os
import stat
from collections.abc import Iterable
from urllib.parse import unquote, unquote_to_bytes

from clpeel.files import open_at_once


class Companions:
    """A resolver, as trimesh calls it: returns the bytes behind a name, and remembers each name without any.

    It reads only regular files, and only in the mesh's folder or below. A mesh file may name a pipe as a texture, and
    reading that pipe could block forever.
    given: the bytes by name, of files that were read or of data that was put there. lost: by name, the reason why it
    could not be read.
    """

    def __init__(self, path: str) -> None:
        self.file_path, self.file_name = path, os.path.basename(path)
        self.folder = os.path.realpath(os.path.dirname(os.path.abspath(path)))
        self.given: dict[str, bytes] = {}
        self.lost: dict[str, str] = {}

    def get(self, name: str) -> bytes:
        """Return the bytes behind a file name or a data URI. Raises FileNotFoundError if there are none."""
        if name not in self.given:
            try:
                self.given[name] = _embedded(name) if name.startswith("data:") else self._file(name)
            except (OSError, ValueError) as error:
                self.lost[name] = getattr(error, "strerror", None) or str(error)
                raise FileNotFoundError(f"{named(name)}: {self.lost[name]}") from None
        return self.given[name]

    __getitem__ = get

    def has(self, name: str) -> bool:
        """Return whether there are bytes behind a name."""
        try:
            self.get(name)
        except FileNotFoundError:
            return False
        return True

    def forget(self, names: Iterable[str]) -> None:
        """Forget that these names were asked for in vain, as others stand for them."""
        for name in names:
            self.lost.pop(name, None)

    def _file(self, name: str) -> bytes:
        """Return the bytes of the first regular file that the name may mean.

        Raises OSError or ValueError with the reason.
        """
        plain = name.strip()
        usual = plain.strip('"').replace("\\", "/")  # a name may be quoted, or written on Windows
        reason = "no such file"
        for spelling in dict.fromkeys((plain, usual, unquote(usual), usual.lstrip("/"), os.path.basename(usual))):
            path = os.path.realpath(self._in_any_case(os.path.join(self.folder, spelling)))
            if os.path.commonpath((path, self.folder)) != self.folder:
                reason = "it lies outside the folder of the mesh" if reason == "no such file" else reason
            elif os.path.lexists(path):
                if stat.S_ISREG(os.stat(path).st_mode):
                    return _regular(path)
                reason = "not a regular file"
        raise ValueError(reason)

    def _in_any_case(self, path: str) -> str:
        """Return the path of a file below the folder whose name differs in upper and lower case alone, if there is one.

        Names from Windows may be written in any way. Otherwise return the path as it is.
        """
        if os.path.lexists(path) or not path.startswith(self.folder + os.sep):
            return path
        found = self.folder
        for part in path[len(self.folder) + 1 :].split(os.sep):
            exact = os.path.join(found, part)
            try:
                names = sorted(os.listdir(found)) if part not in ("", ".", "..") and not os.path.lexists(exact) else []
            except OSError:
                return path
            alike = [name for name in names if name.casefold() == part.casefold()]
            found = os.path.join(found, alike[0]) if alike else exact
        return found


def _regular(path: str) -> bytes:
    """Return a regular file's bytes. The open does not block, even if the file has become a pipe in the meantime."""
    with open(path, "rb", opener=open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError("not a regular file")
        return file.read()


def _embedded(uri: str) -> bytes:
    """Return the bytes in a data URI: data:[type][;base64],bytes. Raises ValueError if it has no data."""
    head, comma, body = uri.partition(",")
    if not comma:
        raise ValueError("a data URI without data")
    return base64.b64decode(unquote_to_bytes(body)) if head.endswith(";base64") else unquote_to_bytes(body)


def named(name: str) -> str:
    """Return a name from a file for a note or an error: quoted, short and without control characters."""
    if name.startswith("data:"):
        return "embedded data"
    shown = name.strip()
    return repr(shown if len(shown) <= 80 else f"{shown[:40]}…{shown[-39:]}")
