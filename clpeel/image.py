"""Pictures and maps as files: PNG and NumPy's, written whole or not at all."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

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


def write_whole(path: str | os.PathLike[str], data: bytes | Callable[[IO[bytes]], object]) -> None:
    """Writes a file so that it is there whole or as it was: to a neighbour first, then renamed over.

    data: the file's bytes, or what writes them to an open file. Raises InputError when the place cannot be written.
    """
    target = Path(path)
    temporary: str | None = None
    try:
        if target.exists() and not target.is_file():  # a device or pipe: nothing to replace
            with target.open("wb") as file:
                _write(file, data)
            return
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".part")
        with os.fdopen(handle, "wb") as file:
            _write(file, data)
        os.chmod(temporary, target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask())
        os.replace(temporary, target)
        temporary = None
    except OSError as error:
        raise InputError(f"output: cannot write {os.fspath(path)!r}: {error.strerror or error}") from None
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def _write(file: IO[bytes], data: bytes | Callable[[IO[bytes]], object]) -> None:
    if callable(data):
        data(file)
    else:
        file.write(data)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], earlier: str) -> Iterator[Path]:
    """A folder to write files into, which move to the folder `path` at the end; none do where anything goes wrong.

    path is made if it is missing. earlier: a pattern of the names of files that an earlier run may have left there:
    those that are not written anew are removed, and all others left alone. Raises InputError when the place cannot be
    written.
    """
    target = Path(path)
    temporary: Path | None = None
    try:
        try:
            exists = target.is_dir()
            # Within the folder, or where that is to be: the same file system, so that moving is renaming.
            within = target if exists else target.parent
            temporary = Path(tempfile.mkdtemp(dir=within, prefix=".clpeel-", suffix=".part"))
        except OSError as error:
            raise InputError(f"output: cannot write {os.fspath(path)!r}: {error.strerror or error}") from None
        yield temporary
        try:
            if not exists:
                os.chmod(temporary, 0o777 & ~_umask())
                os.rename(temporary, target)
                return
            names = os.listdir(temporary)
            for name in names:
                os.replace(temporary / name, target / name)
            for name in os.listdir(target):
                if re.fullmatch(earlier, name) and name not in names and not (target / name).is_dir():
                    (target / name).unlink()
        except OSError as error:
            raise InputError(f"output: cannot write {os.fspath(path)!r}: {error.strerror or error}") from None
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def save_png(path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
    """Writes uint8 [height, width, 4], row 0 on top, as a PNG. Raises InputError when the place cannot be written."""
    write_whole(path, encode_png(image))
