"""Formats: which kinds of files there are, by the suffixes of their names, and what each can hold.

This imports nothing heavy, because the command checks its outputs before anything else.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from types import MappingProxyType
from typing import NamedTuple

from clpeel.errors import InputError


class Format(NamedTuple):
    """A kind of file.

    suffixes: of its names. bits: of a channel, those that it can have; the first are the default. half: whether 16 bits
    are half floats. alpha: whether pixels may let a background through. most_side: the most pixels on a side, or None.
    packages: what else must be installed to write so many bits: the module, the package and the extra.
    """

    name: str
    suffixes: tuple[str, ...]
    bits: tuple[int, ...]
    alpha: bool = True
    most_side: int | None = None
    packages: Mapping[int, tuple[str, str, str]] = MappingProxyType({})


_OPENEXR = ("OpenEXR", "OpenEXR", "exr")
_TIFFFILE = ("tifffile", "tifffile", "tiff")

PNG = Format("PNG", (".png",), (8, 16), packages={16: ("png", "pypng", "png16")})
JPEG = Format("JPEG", (".jpg", ".jpeg"), (8,), alpha=False, most_side=65500)
WEBP = Format("WebP", (".webp",), (8,), most_side=16383)
TIFF = Format("TIFF", (".tif", ".tiff"), (8, 16, 32), packages={16: _TIFFFILE, 32: _TIFFFILE})
EXR = Format("OpenEXR", (".exr",), (16, 32), packages={16: _OPENEXR, 32: _OPENEXR})
NPZ = Format("NumPy's .npz", (".npz",), (32,))
NPY = Format("NumPy's .npy", (".npy",), (32,))

PICTURES = (PNG, JPEG, WEBP, TIFF, EXR, NPZ)
"""What a picture may be written as. The first is that of names without a suffix."""

LAYERS = (NPZ, EXR)
"""What layers may be written as."""

MAPS = (NPY, NPZ, EXR._replace(bits=(32,)), TIFF._replace(bits=(32,)), PNG._replace(bits=(16,), packages={}))
"""What a map may be written as. All hold its numbers as they are, but PNG, which holds 16 bits of them."""

EIGHT_BITS = (PNG, JPEG, WEBP, TIFF)
"""What a picture without its float32 colour may be written as."""


class Chosen(NamedTuple):
    """A format, and how many bits a channel has in it."""

    format: Format
    bits: int


def chosen(
    path: str | os.PathLike[str], bits: int | None = None, among: Sequence[Format] = PICTURES, name: str = "output"
) -> Chosen:
    """Return the format of the file of that name. A name without a suffix is that of the first of the formats.

    bits: of a channel; None for the format's default. among: the formats that it may be. name: what errors call the
    file. Raises InputError if there is no such format, if it cannot have so many bits, or if the package that writes it
    is not installed.
    """
    try:
        given = os.fsdecode(path)
    except TypeError:
        raise InputError(f"{name}: expected a file name, got {type(path).__name__}") from None
    suffix = os.path.splitext(given)[1].lower()
    found = next((each for each in among if suffix in each.suffixes), None if suffix else among[0])
    if found is None:
        known = [suffix for each in among for suffix in each.suffixes]
        wanted = f"a name ending in {', '.join(known[:-1])} or {known[-1]}"
        raise InputError(f"{name}: expected {wanted}, got '{given}'")
    if bits is None:
        bits = found.bits[0]
    if bits not in found.bits:
        having = [f"{each.name} {' or '.join(map(str, each.bits))}" for each in among]
        raise InputError(f"{name}: expected bits that the format has ({', '.join(having)}), got {bits} of {found.name}")
    check_installed(found, bits, name)
    return Chosen(found, bits)


def check_installed(format: Format, bits: int, name: str) -> None:
    """Raise InputError, which says what to install, if the package is missing that writes so many bits."""
    if bits in format.packages:
        module, package, extra = format.packages[bits]
        if find_spec(module) is None:
            what = f"{bits}-bit {format.name}" if len(format.bits) > 1 and format is not EXR else format.name
            raise InputError(
                f"{name}: expected the package {package} to write {what}; run: pip install 'clpeel[{extra}]'"
            )


def check_holds(format: Format, size: tuple[int, int], transparent: bool, name: str = "output") -> None:
    """Raise InputError if the format cannot hold a picture of this size, or one that lets a background through.

    size: (width, height) in pixels. transparent: whether some pixels are not opaque, or may not be.
    """
    if transparent and not format.alpha:
        raise InputError(
            f"{name}: expected a background, as {format.name} has no transparency, got none; "
            "give one, or write .png, .webp or .tif"
        )
    if format.most_side is not None and max(size) > format.most_side:
        raise InputError(
            f"{name}: expected at most {format.most_side} pixels a side in {format.name}, got {size[0]} x {size[1]}; "
            "write .png or .tif"
        )
