"""STL files: triangles of every count, text and binary, and the colours in the spare bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR

ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl(count: int, promised: int, more: bytes = b"", head: bytes = b"", attribute: Any = 0) -> bytes:
    """A binary STL file of count triangles."""
    rows = np.zeros(count, ROW)
    rows["corners"] = np.arange(1, 9 * count + 1).reshape(count, 3, 3)
    rows["attribute"] = attribute
    return head.ljust(80, b" ") + promised.to_bytes(4, "little") + rows.tobytes() + more


def notes(path: Path, data: bytes) -> tuple[str, ...]:
    """The notes of a file with these bytes."""
    path.write_bytes(data)
    return load(path).notes


# --- counts -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("promised", [0, 1, 9, 2**32 - 1])
def test_a_wrong_count_is_noted_and_all_is_read(tmp_path: Path, promised: int) -> None:
    (note,) = notes(tmp_path / "t.stl", stl(3, promised))
    assert note == f"the header promises {promised:,} triangle(s), the file holds 3: all of them are read"
    assert len(load(tmp_path / "t.stl").faces) == 3


@pytest.mark.parametrize("more", [b"\r\n", bytes(50), bytes(100), b"made by hand " * 20])
def test_bytes_after_the_triangles_are_noted(tmp_path: Path, more: bytes) -> None:
    (note,) = notes(tmp_path / "t.stl", stl(3, 3, more))
    assert note == f"{len(more)} byte(s) after the 3 triangle(s) left out"
    assert len(load(tmp_path / "t.stl").faces) == 3


@pytest.mark.parametrize("head", [b"solid facet", b"solid cube\nfacet normal 0 0 1"])
def test_a_binary_file_may_begin_with_solid(tmp_path: Path, head: bytes) -> None:
    assert notes(tmp_path / "t.stl", stl(3, 3, head=head)) == ()
    more = "1 byte(s) after the 3 triangle(s) left out"
    assert notes(tmp_path / "t.stl", stl(3, 3, b"\n", head=head)) == (more,)
    assert len(load(tmp_path / "t.stl").faces) == 3


# --- colours ----------------------------------------------------------------------------------------------------------

FLAG = 0x8000


def test_colors_of_viscam_are_blue_green_red_where_the_flag_is_set(tmp_path: Path) -> None:
    attributes = [FLAG | 31 << 10, FLAG | 31 << 5, FLAG | 31, FLAG, 31 << 10, FLAG | 20 << 10 | 10 << 5 | 1]
    assert notes(tmp_path / "t.stl", stl(6, 6, attribute=attributes)) == ()
    colors = load(tmp_path / "t.stl").face_colors
    assert colors is not None
    levels = [round(value * 255 / 31) for value in (20, 10, 1)]
    want = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [0, 0, 0], list(DEFAULT_COLOR[:3]), levels]
    assert colors[:, :3].tolist() == want and (colors[:, 3] == 255).all()


def test_colors_of_magics_are_red_green_blue_where_the_flag_is_clear(tmp_path: Path) -> None:
    attributes = [31, 31 << 5, 31 << 10, FLAG, FLAG | 31]
    head = b"made COLOR=" + bytes((10, 20, 30, 102)) + b",MATERIAL="
    assert notes(tmp_path / "t.stl", stl(5, 5, head=head, attribute=attributes)) == ()
    colors = load(tmp_path / "t.stl").face_colors
    assert colors is not None
    want = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 30], [10, 20, 30]]
    assert colors[:, :3].tolist() == want and (colors[:, 3] == 102).all()


def test_a_body_has_its_color_where_no_attribute_says_anything(tmp_path: Path) -> None:
    notes(tmp_path / "t.stl", stl(2, 2, head=b"COLOR=" + bytes((10, 20, 30, 255))))
    colors = load(tmp_path / "t.stl").face_colors
    assert colors is not None and colors.tolist() == [[10, 20, 30, 255]] * 2


def test_a_body_that_nobody_could_see_is_opaque(tmp_path: Path) -> None:
    notes(tmp_path / "t.stl", stl(1, 1, head=b"COLOR=" + bytes((10, 20, 30, 0)), attribute=FLAG))
    colors = load(tmp_path / "t.stl").face_colors
    assert colors is not None and colors.tolist() == [[10, 20, 30, 255]]


def test_attributes_that_are_no_colors_are_ignored(tmp_path: Path) -> None:
    for head, attribute in ((b"", 7), (b" " * 75 + b"COLOR", 7), (b" " * 74 + b"COLOR=", 7)):
        assert notes(tmp_path / "t.stl", stl(3, 3, head=head, attribute=attribute)) == ()
        color = load(tmp_path / "t.stl").color
        assert color is not None and tuple(color) == DEFAULT_COLOR


# --- text -------------------------------------------------------------------------------------------------------------

FACET = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1e0 0 0\n  VERTEX 0 1 {z}\n endloop\nendfacet\n"


@pytest.mark.parametrize("name", ["", " a b", " endsolid vertex", " facet normal"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_text_of_several_solids_is_read(tmp_path: Path, name: str, newline: str) -> None:
    solid = f"solid{name}\n{FACET}endsolid{name}\n"
    text = solid.format(z=1) + solid.format(z=2) + f"SOLID{name}\n{FACET.format(z=3)}"  # the last has no end
    assert notes(tmp_path / "t.stl", text.replace("\n", newline).encode()) == ()
    scene = load(tmp_path / "t.stl")
    assert scene.vertices[scene.faces][:, 2].tolist() == [[0, 1, 1], [0, 1, 2], [0, 1, 3]]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("solid\nendsolid\n", "expected triangles, got none; the mesh is empty"),
        ("solid\n" + FACET.format(z=0) + "facet\nouter loop\nvertex 1 2 3\n", "got 4 corners in 1 whole facets"),
        ("solid\n" + FACET.format(z="0 1"), "the file is damaged or cut: expected three corners of three numbers"),
        ("solid\n" + FACET.format(z=""), "the file is damaged or cut: expected three corners of three numbers"),
        ("solid\n" + FACET.format(z="x"), "not a readable mesh: expected numbers, got 'x'"),
    ],
)
def test_what_is_wrong_in_text_is_said(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        notes(tmp_path / "t.stl", text.encode())
    assert says in str(error.value)


def test_cut_binary_files_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the file is cut: its header promises 3 triangles, it holds 2"):
        notes(tmp_path / "t.stl", stl(3, 3)[:-7])
