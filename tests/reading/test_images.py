"""Images: each kind of picture file gives the texels that its format says, and bad ones give a reason, never a warning.

PNG images are written here byte by byte, after the PNG specification (ISO/IEC 15948).
"""

from __future__ import annotations

import base64
import builtins
import io
import random
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from clpeel.reading.images import _opened, texels

Array = NDArray[Any]

GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGBA: 4}
ADAM7 = ((0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1))
"""The passes of an interlaced image: first row, first column, rows apart, columns apart."""


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG image."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(values: Array, kind: int, depth: int, more: bytes = b"", interlaced: bool = False) -> bytes:
    """A PNG image of whole numbers [height, width, channels]. Each row has another filter than the row above."""
    passes = [values[y::dy, x::dx] for y, x, dy, dx in ADAM7] if interlaced else [values]
    data = b"".join(filtered(part, depth) for part in passes if part.size)
    height, width, _ = values.shape
    head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, interlaced)
    chunks = chunk(b"IHDR", head) + more + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


def filtered(values: Array, depth: int) -> bytes:
    """The rows of an image or a pass, packed and filtered."""
    if depth < 8:
        bits = (values[..., 0, None] >> np.arange(depth - 1, -1, -1)) & 1
        rows = [np.packbits(row.reshape(-1).astype(np.uint8)).tobytes() for row in bits]
    else:
        rows = [row.astype(f">u{depth // 8}").tobytes() for row in values]
    step, above, out = max(1, depth * values.shape[2] // 8), bytes(len(rows[0])), b""
    for number, row in enumerate(rows):
        kind = number % 5
        left, corner = bytes(step) + row, bytes(step) + above
        guesses = [predicted(kind, a, b, c) for a, b, c in zip(left, above, corner, strict=False)]
        out += bytes((kind, *((value - guess) & 255 for value, guess in zip(row, guesses, strict=True))))
        above = row
    return out


def predicted(kind: int, left: int, above: int, corner: int) -> int:
    """What a PNG filter predicts of a byte."""
    nearest = min((left, above, corner), key=lambda value: abs(left + above - corner - value))
    return (0, left, above, (left + above) // 2, nearest)[kind]


def decoded(values: Array, top: int) -> Array:
    """Linear light of sRGB numbers 0..top (IEC 61966-2-1)."""
    unit = values / top
    return np.where(unit <= 0.04045, unit / 12.92, ((unit + 0.055) / 1.055) ** 2.4)


def expected(values: Array, kind: int, depth: int, alpha: Array | None = None) -> Array:
    """The texels that a PNG image without a palette stands for: bytes, or linear light and alpha for 16 bits."""
    top = 2**depth - 1
    colors = values[..., :3] if kind in (RGB, RGBA) else values[..., [0, 0, 0]]
    if alpha is None:
        alpha = values[..., -1] if kind in (GREY_ALPHA, RGBA) else np.full(values.shape[:2], top)
    if depth < 16:
        return np.dstack([colors, alpha]) * (255 // top)
    return np.dstack([decoded(colors, top), alpha / top])


def same(found: Array, wanted: Array, depth: int) -> None:
    """Compare texels: bytes must be equal."""
    assert found.dtype == (np.float32 if depth == 16 else np.uint8) and found.shape == wanted.shape
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-7 if depth == 16 else 0)


KINDS = [(GREY, depth) for depth in (1, 2, 4, 8, 16)] + [(k, d) for k in (RGB, GREY_ALPHA, RGBA) for d in (8, 16)]


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize(("kind", "depth"), KINDS)
def test_png_images_of_every_kind_are_exact(kind: int, depth: int, interlaced: bool) -> None:
    values = np.random.default_rng(kind + depth).integers(0, 2**depth, (11, 13, CHANNELS[kind]))
    same(texels(png(values, kind, depth, interlaced=interlaced)), expected(values, kind, depth), depth)


@pytest.mark.parametrize(("kind", "depth"), [each for each in KINDS if each[0] in (GREY, RGB)])
def test_a_png_image_may_have_one_transparent_colour(kind: int, depth: int) -> None:
    values = np.random.default_rng(depth).integers(0, 2**depth, (6, 7, CHANNELS[kind]))
    values[2, 3] = values[4, 5] = 2**depth - 2  # of 16 bits, the upper byte of another colour is the same
    values[5, 5] = 2**depth - 1
    key = values[2, 3]
    alpha = np.where((values == key).all(axis=2), 0, 2**depth - 1)
    data = png(values, kind, depth, chunk(b"tRNS", struct.pack(f">{len(key)}H", *key)))
    same(texels(data), expected(values, kind, depth, alpha), depth)


@pytest.mark.parametrize("depth", [1, 2, 4, 8])
def test_a_png_palette_may_have_alphas(depth: int) -> None:
    chance = np.random.default_rng(depth)
    palette = chance.integers(0, 256, (2**depth, 4))
    palette[-1, 3] = 255  # the file has one alpha less than colours
    values = chance.integers(0, 2**depth, (6, 7, 1))
    more = chunk(b"PLTE", palette[:, :3].astype(np.uint8).tobytes()) + chunk(b"tRNS", bytes(palette[:-1, 3].tolist()))
    same(texels(png(values, PALETTE, depth, more)), palette[values[..., 0]], depth)


def test_colour_profiles_and_gamma_are_ignored() -> None:
    """As glTF 2.0 says (section 3.8.2)."""
    values = np.arange(48).reshape(4, 4, 3) * 5
    more = chunk(b"gAMA", struct.pack(">I", 100000)) + chunk(b"iCCP", b"name\0\0" + zlib.compress(b"no profile"))
    same(texels(png(values, RGB, 8, more)), expected(values, RGB, 8), 8)


# --- other formats ----------------------------------------------------------------------------------------------------

CORNERS = ((255, 0, 0), (0, 204, 0), (0, 0, 255), (255, 255, 255))
"""Upper left, upper right, lower left and lower right of `picture`."""


def picture() -> Image.Image:
    """Four colours in a picture that is wider than high."""
    image = Image.new("RGB", (48, 32))
    for number, color in enumerate(CORNERS):
        image.paste(color, (number % 2 * 24, number // 2 * 16, number % 2 * 24 + 24, number // 2 * 16 + 16))
    return image


def saved(image: Image.Image, name: str, **options: Any) -> bytes:
    """The bytes of a picture file."""
    file = io.BytesIO()
    image.save(file, name, **options)
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "mode", "options"),
    [
        ("JPEG", "RGB", {}),
        ("JPEG", "RGB", {"progressive": True}),
        ("JPEG", "CMYK", {}),
        ("WEBP", "RGB", {"lossless": True}),
        ("BMP", "RGB", {}),
        ("TGA", "RGB", {}),
        ("TGA", "RGB", {"compression": "tga_rle"}),
        ("GIF", "P", {}),
        ("TIFF", "RGB", {}),
        ("PPM", "RGB", {}),
        ("DDS", "RGB", {}),
    ],
)
def test_pictures_of_other_formats_stand_upright(name: str, mode: str, options: dict[str, Any]) -> None:
    found = texels(saved(picture().convert(mode), name, **options))
    assert found.shape == (32, 48, 4) and found.dtype == np.uint8
    centers = found[[8, 8, 24, 24], [12, 36, 12, 36]]
    assert (centers[:, 3] == 255).all()
    assert np.abs(centers[:, :3].astype(int) - CORNERS).max() <= (12 if name == "JPEG" else 0)


def test_alpha_of_other_formats_is_kept() -> None:
    image = picture().convert("RGBA")
    image.putalpha(77)
    for name in ("WEBP", "TGA", "TIFF", "DDS"):
        assert (texels(saved(image, name))[..., 3] == 77).all(), name


def test_the_orientation_of_a_camera_is_ignored() -> None:
    """As glTF 2.0 says (section 3.8.2), the first row of the file is where v is 0."""
    exif = Image.Exif()
    exif[0x0112] = 6  # turned by 90 degrees
    found = texels(saved(picture(), "JPEG", exif=exif))
    assert found.shape == (32, 48, 4) and found[8, 12, 0] > 200 and found[8, 12, 2] < 50


def test_greys_of_16_bits_are_read_from_tiff() -> None:
    greys = np.array([[0, 1000], [40000, 65535]], np.uint16)
    same(texels(saved(Image.fromarray(greys), "TIFF")), expected(greys[..., None], GREY, 16), 16)
    with pytest.raises(ValueError, match="^expected 8 or 16 bits a channel, got 32$"):
        texels(saved(Image.fromarray(greys.astype(np.float32)), "TIFF"))


# --- KTX2 -------------------------------------------------------------------------------------------------------------

ETC1S = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAMAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAAmQAAAAAAAABhAQAA"
    "AAAAAAUAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAgIAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8AAAAAAAAAAP////8fAAAA"
    "S1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAyLjEwAAAGAAMAMwAAAA0AAAAxAAAAAAAAAAAAAAAAAAAAAwAAAAMAAAACAAAAIMCUAAAAAAAQ5A0T"
    "FcCUAAAAAAAAckGgAUQNGAAAAASNpIUDCAAmAAAAAAAAEADk/AIEVFVVVQUAAACoqqqqAv1AVAAAAAAAEERA+a+EMgCmAAgAAAAAkAxEQIQAAQAA"
    "QBDlFKc4AEwACAAAAAAgBQJ+6gDoBw=="
)
UASTC = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAMAAAACAAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAAAAAAAAAAAAAAAAAAAADAAAAA"
    "AAAAAGAAAAAAAAAAYAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMg"
    "VW5pdmVyc2FsIDIuMTAAAAQAAAB/fwAA9x8A4B96AAAAAAAAAAAAABfgH+AfAg8AAAAAAAAAAAAXAOD/HwLgAQAAAAAAAAAAF5lM5j+1igAAAAAA"
    "AAAAABeZTOY/tYoAAAAAAAAAAAAXmUwGILWKAAAAAAAAAAAA"
)
"""KTX2 images of 12 x 8 texels by Basis Universal's own encoder. Red, green and blue squares over a brown row.

The last square of the row is transparent.
"""
SQUARES = np.array(
    [
        [(255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 255)],
        [(200, 100, 50, 255), (200, 100, 50, 255), (200, 100, 50, 0)],
    ]
)


@pytest.mark.parametrize(("data", "error"), [(ETC1S, 3), (UASTC, 0)])
def test_ktx2_images_are_transcoded(data: bytes, error: int) -> None:
    found = texels(data)
    assert found.shape == (8, 12, 4) and found.dtype == np.uint8
    assert np.abs(found.astype(int) - SQUARES.repeat(4, axis=0).repeat(4, axis=1)).max() <= error


def test_ktx2_without_its_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    known = builtins.__import__

    def without(module: str, *rest: Any, **named: Any) -> Any:
        if module == "opengl_basisu":
            raise ImportError(module)
        return known(module, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ValueError, match="pip install 'clpeel\\[formats\\]'"):
        texels(ETC1S)


# --- what cannot be read ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "expected an image, got an empty file"),
        (b"hello", "expected an image, got text that begins with 'hello'"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "expected an image, got text that begins with"),
        (b"\x89PNG\r\n\x1a\n", "the image is damaged ("),
        (b"\xff\xd8\xff\xe0", "the image is damaged ("),
    ],
)
def test_what_is_no_picture_gives_a_reason(data: bytes, reason: str) -> None:
    with pytest.raises(ValueError) as error:
        texels(data)
    assert str(error.value).startswith(reason)


def large(width: int, height: int, kind: int = GREY, depth: int = 1) -> bytes:
    """A PNG image whose head promises this size. There is nothing behind it."""
    small = png(np.zeros((1, 1, CHANNELS[kind]), int), kind, depth)
    head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    return small[:8] + chunk(b"IHDR", head) + small[33:]


def test_an_image_too_large_is_refused_by_its_head() -> None:
    for width, height in ((16385, 1), (1, 16385), (2**31 - 1, 2**31 - 1)):
        reason = f"too large, {width:,} x {height:,} texels; at most 16,384 x 16,384 are read"
        with pytest.raises(ValueError) as error:
            texels(large(width, height))
        assert str(error.value) == reason
    with pytest.raises(ValueError, match="^too large, 8,193 x 8,192 texels; at most 67,108,864 of 16 bits a channel"):
        texels(large(8193, 8192, RGB, 16))
    for head in (large(16384, 16384), large(8192, 8192, RGBA, 16)):
        _opened(head)  # as large as may be
    width = struct.pack("<I", 20000)
    with pytest.raises(ValueError, match="the image is damaged"):
        texels(UASTC[:20] + width + UASTC[24:])


FILES = {
    "PNG": png(np.arange(600).reshape(10, 20, 3) % 256, RGB, 8),
    "deep PNG": png(np.arange(800).reshape(10, 20, 4) * 80, RGBA, 16),
    "ETC1S": ETC1S,
    "UASTC": UASTC,
    **{name: saved(picture(), name) for name in ("JPEG", "WEBP", "BMP", "TGA", "GIF", "TIFF", "DDS")},
}


@pytest.mark.parametrize("name", FILES)
def test_a_cut_picture_gives_a_reason(name: str) -> None:
    data = FILES[name]
    for share in (0.3, 0.6, 0.9):
        with pytest.raises(ValueError) as error:
            texels(data[: int(len(data) * share)])
        assert "\n" not in str(error.value) and len(str(error.value)) < 200


@pytest.mark.parametrize("name", FILES)
def test_a_damaged_picture_gives_a_reason_or_texels(name: str) -> None:
    chance = random.Random(3)
    for _ in range(60):
        data = bytearray(FILES[name])
        for _ in range(chance.choice((1, 3, 9))):
            data[chance.randrange(min(len(data), 400))] ^= 1 << chance.randrange(8)
        try:
            found = texels(bytes(data))
            assert found.ndim == 3 and found.shape[2] == 4
        except ValueError as error:
            assert "\n" not in str(error) and len(str(error)) < 200
