"""Damaged files and files of another type are refused in plain words: what was expected, and what came."""

from __future__ import annotations

import random
import re
import zipfile
from pathlib import Path
from typing import Any

import pytest

from clpeel.errors import InputError
from clpeel.reading.load import load

trimesh = pytest.importorskip("trimesh")

POINTS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def refusal(path: Path, content: bytes) -> str:
    """The one line that refuses a file with this content, without the file's name."""
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        load(path)
    text = str(error.value)
    assert text.startswith(f"{path}: ") and "\n" not in text
    return text.removeprefix(f"{path}: ")


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "off", "glb", "gltf", "3mf"])
@pytest.mark.parametrize(
    ("content", "looks"),
    [
        (b"", "an empty file"),
        (b"\x89PNG\r\n\x1a\n" + bytes(200), "a PNG image"),
        (b"\xff\xd8\xff\xe0" + bytes(200), "a JPEG image"),
        (b"\x1f\x8b\x08" + bytes(200), "a gzip file"),
        (b"version https://git-lfs.github.com/spec/v1\noid", "a Git LFS pointer, not the file it stands for"),
        (b"<!DOCTYPE html><html>" + b" " * 99, "a web page"),
    ],
)
def test_what_a_file_looks_like_is_said(tmp_path: Path, kind: str, content: bytes, looks: str) -> None:
    text = refusal(tmp_path / f"t.{kind}", content)
    assert text.startswith(f"not a readable mesh: expected a .{kind} file") and text.endswith(f", got {looks}")


def test_zip_archives_of_other_things_are_no_3mf(tmp_path: Path) -> None:
    path = tmp_path / "t.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("word/document.xml", "<document/>")
    assert "expected a 3MF package with 3D/3dmodel.model in it" in refusal(path, path.read_bytes())


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("t.off", b"4OFF\n1 1 0\n0 0 0 1\n", "expected an .off file of three coordinates, got '4OFF'"),
        ("t.off", b"OFF BINARY\n\0\0", "expected a text .off file, got a binary one"),
        ("t.stl", b" " * 80 + (9).to_bytes(4, "little") + bytes(70), "promises 9 triangles, it holds 1"),
        ("t.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty int x\nend_header\n1\nx\n", "got 'x'"),
        ("t.ply", b"ply\nformat ascii 1.0\nelement vertex 2\n", "the file is cut: expected a header that ends with"),
        ("t.glb", b"glTF" + bytes(4), "the file is cut: expected 20 bytes or more, got 8"),
        (
            "t.gltf",
            b'{"asset": {"version": "2.0"}, "meshes": [{}], "nodes": [{"mesh": 0}]}',
            "expected triangles, got 1 mesh(es) without primitives; the mesh is empty",
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    assert says in refusal(tmp_path / name, content)


def mutated(data: bytes, chance: random.Random) -> bytes:
    """The data cut, with a part left out or twice, or with some bytes changed."""
    start, end = sorted(chance.randrange(len(data)) for _ in range(2))
    changed = bytearray(chance.choice([data, data[:end], data[:start] + data[end:], data[:end] + data[start:]]))
    for _ in range(chance.randrange(6)):
        if changed:
            changed[chance.randrange(len(changed))] = chance.choice([chance.randrange(256), *b'019-. \n"}\0\xff'])
    return bytes(changed)


def seeds(folder: Path) -> dict[str, Any]:
    """A small file of each kind, the buffers of the glTF one beside it."""
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    files = {kind: mesh.export(file_type=kind) for kind in ("ply", "stl", "obj", "off", "glb", "3mf")}
    files["ascii.ply"], files["ascii.stl"] = (
        mesh.export(file_type="ply", encoding="ascii"),
        mesh.export(file_type="stl_ascii"),
    )
    for name, part in mesh.export(file_type="gltf").items():
        if name.endswith(".gltf"):
            files["gltf"] = part
        else:
            (folder / name).write_bytes(part)
    return {kind: data.encode() if isinstance(data, str) else data for kind, data in files.items()}


def test_no_mutation_crashes_the_loader_or_gives_a_bare_error(tmp_path: Path) -> None:
    chance = random.Random(7)
    for kind, data in seeds(tmp_path).items():
        path = tmp_path / f"t.{kind}"
        for _ in range(30):
            path.write_bytes(mutated(data, chance))
            try:
                lines = load(path).notes
            except InputError as error:
                text = str(error).removeprefix(f"{path}: ")
                assert len(text) < 330 and not re.match(r"(not a readable mesh: )?[A-Z]\w+:", text), text
                lines = (text,)
            assert all(line.isprintable() for line in lines), lines
