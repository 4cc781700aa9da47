"""Provenance: what a file says of how it was made, whatever its format, and what strangers' files may say."""

from __future__ import annotations

import io
import json
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import plainly
import pytest
import tifffile
from crossing import SIZE, scene
from PIL import Image, PngImagePlugin

import clpeel
from clpeel.pictures.provenance import LONGEST, read_provenance, text_of

FILES = {"png": (8, 16), "jpg": (8,), "webp": (8,), "tif": (8, 16, 32), "exr": (16, 32), "npz": (32,)}


@pytest.fixture(scope="module")
def result() -> clpeel.Result:
    return plainly.render(scene(), size=SIZE, samples=4, background=(0.25, 0.5, 1))


@pytest.mark.parametrize(("suffix", "bits"), [(suffix, each) for suffix, bits in FILES.items() for each in bits])
def test_a_file_says_how_it_was_made(result: clpeel.Result, suffix: str, bits: int, tmp_path: Path) -> None:
    for name in ("a", "b"):
        result.save(tmp_path / f"{name}.{suffix}", bits=bits)
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
    found = read_provenance(tmp_path / f"a.{suffix}")
    assert found == result.provenance
    assert found["software"] == f"clpeel {clpeel.__version__}" and found["technique"] == "sort"
    assert found["python"] == f"size={SIZE}, background=(0.25, 0.5, 1.0), lighting='none', samples=4"
    assert found["scene"].startswith("sha256:") and found["scene"].endswith(" (6 faces)")
    assert found["device"] == result.stats.device and found["camera"].startswith("Camera(position=(")
    result.save(tmp_path / f"c.{suffix}", bits=bits, provenance=False)
    bare = (tmp_path / f"c.{suffix}").read_bytes()
    assert b"clpeel" not in bare and b"sha256" not in bare
    with pytest.raises(clpeel.InputError, match="expected a picture that says how clpeel made it, got none"):
        read_provenance(tmp_path / f"c.{suffix}")


def test_other_programs_find_it(result: clpeel.Result, tmp_path: Path) -> None:
    text = json.dumps(result.provenance)
    for name, key in (
        ("x.png", "clpeel"),
        ("x.exr", "clpeel"),
        ("x.tif", "ImageDescription"),
        ("x.jpg", "ImageDescription"),
    ):
        result.save(tmp_path / name)
        spec = OpenImageIO.ImageInput.open(str(tmp_path / name)).spec()
        assert spec.getattribute(key) == text, name
        assert spec.getattribute("Software") == f"clpeel {clpeel.__version__}", name
    result.save(tmp_path / "y.tif", bits=16)
    with tifffile.TiffFile(tmp_path / "y.tif") as pages:
        assert pages.pages[0].description == text
    with Image.open(tmp_path / "x.jpg") as file:
        assert file.getexif()[0x010E] == text


def test_layers_and_maps_carry_it(tmp_path: Path) -> None:
    result = plainly.render(scene(), size=SIZE, layers=True, maps=("depth",))
    for name in ("x.exr", "x.npz"):
        result.layers.save(tmp_path / name, result.provenance)
        assert read_provenance(tmp_path / name) == result.provenance
    assert (clpeel.load_layers(tmp_path / "x.npz").depth == result.layers.depth).all()
    for suffix in ("png", "exr", "tif", "npz"):
        line = result.save_map("depth", tmp_path / f"d.{suffix}")
        levels = {} if line is None else {"levels": line}
        assert read_provenance(tmp_path / f"d.{suffix}") == {**result.provenance, "map": "depth", **levels}
    result.save_map("depth", tmp_path / "d.png", provenance=False)
    assert b"clpeel" not in (tmp_path / "d.png").read_bytes()


def test_the_scene_is_told_by_what_is_drawn_of_it() -> None:
    made = scene()
    assert made.digest == scene().digest and len(made.digest) == 64
    moved = made.vertices.copy()
    moved[5, 2] = np.nextafter(moved[5, 2], 9)
    others = [
        clpeel.Scene.from_arrays(moved, made.faces, face_colors=made.colors),
        clpeel.Scene.from_arrays(made.vertices, made.faces[::-1], face_colors=made.colors),
        clpeel.Scene.from_arrays(made.vertices, made.faces, face_colors=made.colors, opacity=0.5),
        clpeel.Scene.from_arrays(made.vertices, made.faces, face_colors=made.colors, single_sided=True),
        clpeel.Scene.from_arrays(made.vertices, made.faces, points=[0], color="red"),
        clpeel.Scene.from_arrays(made.vertices, made.faces, color="red"),
        clpeel.Scene.from_arrays(made.vertices, made.faces, materials=[clpeel.Material(opacity=0.5)]),
        clpeel.Scene.from_arrays(made.vertices, made.faces, materials=[clpeel.Material(opacity=0.6)]),
    ]
    image = np.zeros((2, 2, 3), np.uint8)
    for level in (0, 1):
        image[1, 1, 2] = level
        material = clpeel.Material(texture=clpeel.Texture.of(image.copy()))
        uv = made.vertices[:, :2]
        others.append(clpeel.Scene.from_arrays(made.vertices, made.faces, materials=[material], uv=uv))
    assert len({each.digest for each in (made, *others)}) == len(others) + 1


def test_what_a_renderer_did_is_told() -> None:
    renderer = plainly.Renderer(scene())
    renderer.set_opacity(0.25)
    assert renderer.render(size=SIZE).provenance["python"].endswith("set_opacity=0.25")


def test_a_value_of_any_length_has_room(result: clpeel.Result, tmp_path: Path) -> None:
    from clpeel.pictures.formats import chosen

    for character in ("x", "é", "\N{PILE OF POO}", "\n"):
        words = {"command": character * 200_000}
        for name in ("x.jpg", "x.png", "x.webp", "x.tif", "x.exr"):
            (tmp_path / name).write_bytes(result.encoded(chosen(name), words))
            found = read_provenance(tmp_path / name)["command"]
            assert len(text_of({"command": found})) <= LONGEST + 100
            kept, _, rest = found.partition("... and ")
            assert set(kept) == {character} and rest == f"{200_000 - len(kept)} more characters"


def chunk(keyword: str, text: str, compressed: bool = False) -> bytes:
    words, data = PngImagePlugin.PngInfo(), io.BytesIO()
    words.add_text(keyword, text, zip=compressed)
    Image.new("L", (1, 1)).save(data, "PNG", pnginfo=words)
    return data.getvalue()


def archive(name: str, data: bytes) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, data)
    return made.getvalue()


DAMAGED = {
    "empty": b"",
    "text": b"hello",
    "no json": chunk("clpeel", "{"),
    "no object": chunk("clpeel", "[1]"),
    "no texts": chunk("clpeel", '{"software": 1}'),
    "deep": chunk("clpeel", "[" * 100_000),
    "another keyword": chunk("Comment", '{"software": "x"}'),
    "a bomb": chunk("clpeel", '{"a": "' + "x" * 30_000_000 + '"}', compressed=True),
    "too long": chunk("clpeel", '{"a": "' + "x" * 2_000_000 + '"}'),
    "png cut": chunk("clpeel", '{"software": "x"}')[:50],
    "jpeg cut": b"\xff\xd8\xff\xe1\xff\xffExif\0\0II*\0\xff\xff\xff\xff",
    "webp cut": b"RIFF\xff\xff\xff\xffWEBPVP8X",
    "tiff cut": b"II*\0\xff\xff\xff\xff",
    "tiff of one byte more": b"II",
    "exr cut": b"\x76\x2f\x31\x01\x02\0\0\0channels\0chlist",
    "zip cut": b"PK\x03\x04",
    "zip without": archive("x.npy", b"1"),
    "zip with another": archive("provenance.npy", b"\x93NUMPY\x01\x00\x00\x01{'descr': "),
    "zip with a lie": archive(
        "provenance.npy",
        b"\x93NUMPY\x01\x00v\x00"
        + b"{'descr': '<U9', 'fortran_order': False, 'shape': (99999999999999,), }".ljust(117)
        + b"\n",
    ),
    "zip bomb": archive("provenance.npy", b"\0" * 50_000_000),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_say_nothing(name: str, tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(DAMAGED[name])
    with pytest.raises(
        clpeel.InputError, match="x: expected a picture that says how clpeel made it, got none"
    ) as raised:
        read_provenance(tmp_path / "x")
    assert "\n" not in str(raised.value)


def test_what_is_no_file(tmp_path: Path, monkeypatch: Any) -> None:
    with pytest.raises(clpeel.InputError, match="expected a picture, got no such file"):
        read_provenance(tmp_path / "x.png")
    with pytest.raises(clpeel.InputError, match="expected a picture, got a folder"):
        read_provenance(tmp_path)
    with pytest.raises(clpeel.InputError, match="expected a picture, got no file"):
        read_provenance("/dev/zero")
    with pytest.raises(clpeel.InputError, match="expected a picture, got no such file"):
        read_provenance("x" * 300)


def test_without_openexr(result: clpeel.Result, tmp_path: Path, monkeypatch: Any) -> None:
    result.save(tmp_path / "x.exr")
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(
        clpeel.InputError, match=r"x.exr: expected the package OpenEXR to read it; run: pip install 'clp"
    ):
        read_provenance(tmp_path / "x.exr")


def test_any_bytes_changed(result: clpeel.Result, tmp_path: Path) -> None:
    """Of each file, some bytes are others: it says what it said, or nothing, or something else in one line."""
    random = np.random.default_rng(0)
    for name in ("x.png", "x.jpg", "x.webp", "x.tif", "x.npz", "x.exr"):
        result.save(tmp_path / name)
        whole = np.frombuffer((tmp_path / name).read_bytes(), np.uint8)
        for _ in range(60):
            data = whole.copy()
            data[random.integers(0, min(len(data), 1500), 4)] = random.integers(0, 256, 4)
            (tmp_path / "y").write_bytes(data[: random.integers(1, len(data))].tobytes())
            try:
                read_provenance(tmp_path / "y")
            except clpeel.InputError as error:
                assert "\n" not in str(error)
