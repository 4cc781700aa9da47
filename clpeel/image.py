"""Pictures and maps as files: PNG and NumPy's, written whole or not at all."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """uint8 [height, width, 4] to the bytes of a PNG; without an alpha channel where every pixel is opaque."""
    from PIL import Image

    opaque = bool((image[..., 3] == 255).all())
    data = io.BytesIO()
    Image.fromarray(image[..., :3] if opaque else image).save(data, "PNG", compress_level=4)
    return data.getvalue()


def encode_map(numbers: NDArray[np.float32]) -> bytes:
    """float32 [height, width] to the bytes of a file that numpy.load reads."""
    data = io.BytesIO()
    np.save(data, numbers, allow_pickle=False)
    return data.getvalue()


def write_whole(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes a file so that it is there whole or as it was: to a neighbour first, then renamed over.

    Raises InputError when the place cannot be written.
    """
    target = Path(path)
    temporary: str | None = None
    try:
        if target.exists() and not target.is_file():  # a device or pipe: nothing to replace
            target.write_bytes(data)
            return
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~mask)
        os.replace(temporary, target)
        temporary = None
    except OSError as error:
        raise InputError(f"output: cannot write {os.fspath(path)!r}: {error.strerror or error}") from None
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def save_png(path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
    """Writes uint8 [height, width, 4], row 0 on top, as a PNG. Raises InputError when the place cannot be written."""
    write_whole(path, encode_png(image))
