"""Signatures: how a file of each type begins, and what a file that begins otherwise may be."""

from __future__ import annotations

import re

from clpeel.errors import InputError

_BEGINNINGS = {
    "ply": (rb"\s*ply\b", "'ply'"),
    "glb": (rb"glTF", "'glTF'"),
    "gltf": (rb"(\xef\xbb\xbf)?\s*\{", "'{', as JSON does"),
    "3mf": (rb"PK", "'PK', as a zip archive does"),
    **dict.fromkeys(("usdz", "zae"), (rb"PK", "'PK', as a zip archive does")),
    "pcd": (rb"(#[^\n]*\n|\s)*(#|VERSION|FIELDS)", "'# .PCD', 'VERSION' or 'FIELDS'"),
    "off": (rb"(\xef\xbb\xbf)?(\s|#[^\n]*\n)*[A-Z0-9]{0,4}OFF\b", "'OFF'"),
}
"""For each extension, a pattern of how such files begin, and the same in words."""

_LOOKS = (
    (rb"\x89PNG", "a PNG image"),
    (rb"\xff\xd8\xff", "a JPEG image"),
    (rb"GIF8", "a GIF image"),
    (rb"RIFF....WEBP", "a WebP image"),
    (rb"\xabKTX", "a KTX image"),
    (rb"BM.{4}\0\0\0\0", "a BMP image"),
    (rb"%PDF", "a PDF document"),
    (rb"PK\x03\x04", "a zip archive"),
    (rb"\x1f\x8b", "a gzip file"),
    (rb"BZh|\xfd7zXZ|7z\xbc\xaf|\x28\xb5\x2f\xfd", "a compressed file"),
    (rb"version https://git-lfs", "a Git LFS pointer, not the file it stands for"),
    (rb"(?i)\s*(<!doctype html|<html)", "a web page"),
    (rb"glTF", "a .glb file"),
    (rb"ply\s", "a .ply file"),
    (rb"C?OFF\s", "a .off file"),
    (rb"solid\s", "a text .stl file"),
    (rb"(\xef\xbb\xbf)?\s*<", "XML"),
    (rb"(\xef\xbb\xbf)?\s*[{\[]", "JSON"),
)
_FOREIGN = 14
"""The number of entries at the start of _LOOKS that are foreign: a file that begins so is no mesh of any other type."""


def check_beginning(extension: str, data: bytes) -> None:
    """Raise InputError unless the bytes begin as a file with this extension does."""
    if extension in _BEGINNINGS:
        pattern, words = _BEGINNINGS[extension]
        if not re.match(pattern, data[:4096] if extension in ("off", "pcd") else data[:64]):
            raise InputError(
                f"not a readable mesh: expected a .{extension} file, which begins with {words}, got {looks_like(data)}"
            )
    elif not data or foreign(data):
        raise InputError(f"not a readable mesh: expected a .{extension} file, got {looks_like(data)}")


def foreign(data: bytes) -> bool:
    """Return whether the bytes begin as a file of another type does. What plain text may begin with does not count."""
    return any(re.match(pattern, data[:64], re.DOTALL) for pattern, _ in _LOOKS[:_FOREIGN])


def looks_like(data: bytes) -> str:
    """Return in words what a file's bytes look like, for a message."""
    if not data:
        return "an empty file"
    for pattern, words in _LOOKS:
        if re.match(pattern, data[:64], re.DOTALL):
            return words
    start = data[:256]
    if not start.strip(b"\0"):
        return f"{len(data):,} bytes that begin with zeros"
    if all(byte >= 32 or byte in b"\t\n\r\f" for byte in start):
        return f"text that begins with {start[:24].decode('utf-8', 'replace')!r}"
    return f"{len(data):,} bytes that begin with {start[:8].hex(' ')}"
