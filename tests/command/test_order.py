"""The order of options among files: which value each file has, beside an independent twin of the rule."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from conftest import printed
from hypothesis import given
from hypothesis import strategies as st

import clpeel
from clpeel.command import pieces
from clpeel.command.main import main
from clpeel.command.order import EACH
from clpeel.command.parser import parse
from clpeel.command.pieces import Piece, read
from clpeel.errors import InputError

REFUSED = "refused"
FILES = ("a.ply", "b.ply", "c.ply", "d.ply")


def twin(words: Sequence[str]) -> Any:
    """The opacities of files by the words as they stand, or REFUSED. It walks the line; the code counts places."""
    files = [word for word in words if word in FILES]
    values = [word for word in words if word not in FILES]
    if not values:
        return [None] * len(files)
    if len(values) == len(files):
        return [float(value) for value in values]
    if len(values) == 1:
        first_or_last = words[0] in values or words[-1] in values
        return [float(values[0])] * len(files) if first_or_last else REFUSED
    if words[0] not in values or words[-1] in values:
        return REFUSED
    found, current, fresh = [], "", False
    for word in words:
        if word in FILES:
            found.append(float(current))
            fresh = False
        elif fresh:
            return REFUSED  # two values before one file
        else:
            current, fresh = word, True
    return found


def opacities(words: Sequence[str]) -> Any:
    """What the command finds."""
    line = [word if word in FILES else f"--opacity={word}" for word in words]
    try:
        return [piece.options.get("opacity") for piece in parse(["render", *line]).pieces]
    except InputError as error:
        assert "\n" not in str(error) and str(error).startswith("--opacity: ")
        return REFUSED


lines = st.integers(1, 4).flatmap(
    lambda count: st.lists(st.floats(0, 1).map(repr), max_size=5).flatmap(
        lambda values: st.permutations([*(["file"] * count), *values])
    )
)


@given(lines)
def test_any_line_means_what_its_twin_says(line: list[str]) -> None:
    names = iter(FILES)
    words = [next(names) if word == "file" else word for word in line]
    assert opacities(words) == twin(words)


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (".3 a.ply 1 b.ply", [0.3, 1]),
        ("a.ply .3 b.ply 1", [0.3, 1]),
        ("a.ply b.ply .3 1", [0.3, 1]),
        ("a.ply b.ply .3", [0.3, 0.3]),
        (".3 a.ply b.ply", [0.3, 0.3]),
        (".3 a.ply b.ply 1 c.ply", [0.3, 0.3, 1]),
        ("a.ply .3 b.ply", REFUSED),
        ("a.ply .3 b.ply 1 c.ply", REFUSED),
        (".3 a.ply b.ply c.ply 1", REFUSED),
        (".3 .4 a.ply b.ply c.ply", REFUSED),
        ("a.ply .3 .4", REFUSED),
    ],
)
def test_what_lines_mean(line: str, wanted: Any) -> None:
    assert opacities(line.split()) == twin(line.split()) == wanted


def test_switches_and_other_options_have_an_order_too() -> None:
    options = parse(
        "render --colormap=gray --coloring-array h --categories a.ply --no-categories b.ply --coloring-array file "
        "--animation-time 2 c.glb --animation-time 3 --backface-type hidden --animation-time 4".split()
    )
    assert [dict(piece.options) for piece in options.pieces] == [
        {**own, "colormap": "gray", "animation_time": time, "backface_type": "hidden"}
        for own, time in (
            ({"coloring_array": "h", "categories": True}, 2),
            ({"coloring_array": "h", "categories": False}, 3),
            ({"coloring_array": None, "categories": False}, 4),
        )
    ]
    assert options.backface_type == "hidden"


def test_every_option_of_files_is_one_of_the_command() -> None:
    from clpeel.command.parser import make_parser

    assert {*EACH} <= {action.dest for action in make_parser().commands["render"].options()}


# --- what is drawn ----------------------------------------------------------------------------------------------------

SQUARE = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float height
element face 1
property list uchar int vertex_indices
end_header
{0} 0 0 0
{1} 0 0 1
{1} 1 0 1
{0} 1 0 0
4 {order}
"""


@pytest.fixture
def squares(tmp_path: Path) -> list[str]:
    """Two squares, side by side; the second one shows its back."""
    for k, order in enumerate(("0 1 2 3", "3 2 1 0")):
        (tmp_path / f"{k}.ply").write_text(SQUARE.format(2 * k, 2 * k + 1, order=order))
    return [str(tmp_path / f"{k}.ply") for k in range(2)]


def seen(scene: Any) -> np.ndarray:
    image: np.ndarray = plainly.render(scene, size=(90, 30), background=None).image
    return image


@pytest.mark.usefixtures("shared_devices")
def test_each_file_has_its_own_numbers_and_ranges(squares: list[str]) -> None:
    first, second = (Piece(name, {"coloring_array": "height", "colormap": ["red", "blue"]}) for name in squares)
    together = read([first, second])
    assert len(together.color_maps) == 1
    apart = read([first, Piece(second.path, {"coloring_array": None, "color": (0.0, 1.0, 0.0)})])
    left, right = np.hsplit(seen(apart), [45])
    assert {tuple(color) for color in right[right[..., 3] > 0].tolist()} == {(0, 255, 0, 255)}
    assert {tuple(color) for color in left[left[..., 3] > 0].tolist()} == {(255, 0, 0, 255), (0, 0, 255, 255)}
    ranges = read([Piece(name, {**first.options, "coloring_range": (0, k + 1)}) for k, name in enumerate(squares)])
    assert [colors.clim for colors in ranges.color_maps] == [(0, 1), (0, 2)]


@pytest.mark.usefixtures("shared_devices")
def test_each_file_has_its_own_sides(squares: list[str]) -> None:
    """Beside what the option draws that holds for all."""
    all_of = {kind: seen(clpeel.load(*squares)) for kind in ("visible",)}
    hidden = plainly.render(clpeel.load(*squares), size=(90, 30), background=None, backface_type="hidden").image
    assert (all_of["visible"] != hidden).any()
    for kinds, wanted in (
        (("hidden", "visible"), all_of["visible"]),
        (("visible", "hidden"), hidden),
        ((None, "hidden"), hidden),
    ):
        scene = read([Piece(name, {"backface_type": kind}) for name, kind in zip(squares, kinds, strict=True)])
        assert (seen(scene) == wanted).all(), kinds


def test_a_wrong_kind_of_sides_is_refused(squares: list[str]) -> None:
    with pytest.raises(InputError, match="0.ply: backface_type: expected one of default, visible, hidden; got 'seen'"):
        read([Piece(squares[0], {"backface_type": "seen"}), Piece(squares[1])])


def test_duplicates_of_one_moved_file_are_dropped(squares: list[str]) -> None:
    matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 2.0), (0.0, 0.0, 0.0, 1.0))
    twice = [Piece(squares[0], matrix=matrix)] * 2
    assert len(read(twice).faces) == 4 and len(read(twice, drop_duplicates=True).faces) == 2


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (
            ["--colormap=gray", "{0}", "--colormap=jet", "{1}"],
            "--colormap: expected --coloring-array with it, got none",
        ),
        (
            ["--coloring-array=height", "--colormap=gray", "{0}", "--coloring-array=file", "--colormap=jet", "{1}"],
            "1.ply: --colormap: expected --coloring-array with it, got none",
        ),
        (["{0}", "--opacity=.5", "{1}"], "'--opacity file' to leave one as it is) (see clpeel render --help)"),
        (["{0}", "--animation-time=1", "{1}", "--animation-time=2"], "--animation-time: expected a glTF file"),
        (["--coloring-array=height", "{0}", "--coloring-array=x", "{1}"], "expected an array of the scene, height"),
    ],
)
def test_errors_are_one_line(
    words: list[str], error: str, squares: list[str], capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    line = [word.format(*squares) for word in words]
    assert main(["render", *line, "-o", str(tmp_path / "out.png")]) == 2
    _, said = printed(capfd)
    assert len(said) == 1 and error in said[0], said


def test_alike_is_alike() -> None:
    assert pieces.alike([Piece("a", {"opacity": None}), Piece("b")], ("opacity", "color"))
    assert not pieces.alike([Piece("a", {"opacity": 0.5}), Piece("b")], ("opacity",))
