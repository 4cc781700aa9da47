"""Provenance: how a picture was made, as text that its file carries, and read from the file again.

The text is one JSON object of names and texts, in ASCII. Each format has one place for it.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable, Mapping
from typing import IO

from clpeel.errors import InputError

Provenance = Mapping[str, str]
"""What is known of how a picture was made, as texts by name, such as "technique"."""

KEY = "clpeel"
"""The name of the text in PNG and OpenEXR files; in .npz files, `provenance` is."""

NPZ_KEY = "provenance"

SOFTWARE, DESCRIPTION = 305, 270
"""The tags of TIFF and Exif that have the program's name, and the text."""

LONGEST = 30_000
"""The most characters of a value. Longer ones are cut, and end in how many are missing: Exif in JPEG has 64 KB."""

MOST_BYTES = 1 << 20
"""No text that clpeel writes is longer, so a longer one is not read."""


def text_of(provenance: Provenance) -> str:
    """Return the text for a file, one line of ASCII."""
    return json.dumps({name: _cut(value) for name, value in provenance.items()})


def _cut(value: str) -> str:
    short = value
    while len(json.dumps(short)) > LONGEST:  # as ASCII, where a character may take 6 or 12
        short = short[: len(short) // 2]
    return value if short == value else f"{short}... and {len(value) - len(short)} more characters"


def software_of(provenance: Provenance) -> str:
    """Return the program's name and version, for the place that formats have for them."""
    return provenance.get("software", KEY).encode("ascii", "replace").decode()


# --- reading ----------------------------------------------------------------------------------------------------------


def read_provenance(path: str | os.PathLike[str]) -> dict[str, str]:
    """Return what a file says of how it was made. Raises InputError if it says nothing, or cannot be read."""
    name = os.fsdecode(path)
    try:
        if not os.path.isfile(path):
            what = "a folder" if os.path.isdir(path) else "no such file" if not os.path.exists(path) else "no file"
            raise InputError(f"{name}: expected a picture, got {what}")
        with open(path, "rb") as file:
            text = _text_in(file)
    except InputError:
        raise
    except OSError as error:
        if error.strerror:
            raise InputError(f"{name}: cannot be read: {error.strerror}") from None
        text = None  # Pillow's errors of damaged files
    except ImportError:
        raise InputError(f"{name}: expected the package OpenEXR to read it; run: pip install 'clpeel[exr]'") from None
    except Exception:  # libraries may raise anything on damaged files
        text = None
    found = None if text is None else _object(text)
    if found is None:
        raise InputError(
            f"{name}: expected a picture that says how clpeel made it, got none: "
            "others made it, or it was written without provenance"
        )
    return found


def _object(text: str) -> dict[str, str] | None:
    """Return the texts by name, or None if the text is not one that clpeel writes."""
    if len(text) > MOST_BYTES:
        return None
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or not found or not all(isinstance(value, str) for value in found.values()):
        return None
    return found


def _text_in(file: IO[bytes]) -> str | None:
    """Return the text that a file carries, or None. What kind of file it is, its first bytes say."""
    head = file.read(16)
    file.seek(0)
    for signature, read in _READERS.items():
        if head.startswith(signature):
            return read(file)
    return None


def _of_png(file: IO[bytes]) -> str | None:
    from PIL.PngImagePlugin import PngImageFile

    found = PngImageFile(file).info.get(KEY)  # unlike Image.open, this takes pictures of any size
    return found if isinstance(found, str) else None


def _of_jpeg(file: IO[bytes]) -> str | None:
    from PIL.JpegImagePlugin import JpegImageFile

    return _described(JpegImageFile(file).getexif().get(DESCRIPTION))


def _of_webp(file: IO[bytes]) -> str | None:
    from PIL.WebPImagePlugin import WebPImageFile

    return _described(WebPImageFile(file).getexif().get(DESCRIPTION))


def _of_tiff(file: IO[bytes]) -> str | None:
    """Read the first directory alone, as Pillow has no mode for some of the pictures."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    head = file.read(8)
    if head[2] == 43 or head[3] == 43:  # BigTIFF
        head += file.read(8)
    directory = ImageFileDirectory_v2(head)
    file.seek(directory.next)
    directory.load(file)
    return _described(directory.get(DESCRIPTION))


def _described(found: object) -> str | None:
    return found if isinstance(found, str) else None


def _of_exr(file: IO[bytes]) -> str | None:
    import OpenEXR

    found = OpenEXR.File(file, header_only=True).header().get(KEY)
    return found if isinstance(found, str) else None


def _of_npz(file: IO[bytes]) -> str | None:
    import numpy as np

    with zipfile.ZipFile(file) as archive:
        entry = archive.getinfo(f"{NPZ_KEY}.npy")
        if entry.file_size > 4 * MOST_BYTES:  # NumPy's texts take 4 bytes a character
            return None
        with archive.open(entry) as part:
            found = np.lib.format.read_array(part, allow_pickle=False)
    return str(found) if found.shape == () and found.dtype.kind == "U" else None


_READERS: dict[bytes, Callable[[IO[bytes]], str | None]] = {
    b"\x89PNG\r\n\x1a\n": _of_png,
    b"\xff\xd8": _of_jpeg,
    b"RIFF": _of_webp,
    b"II": _of_tiff,
    b"MM": _of_tiff,
    b"\x76\x2f\x31\x01": _of_exr,
    b"PK": _of_npz,
}
"""How the text of a file is read, by its first bytes."""
