"""`clpeel.view` and `clpeel view`: which screen is chosen, and what is said where there is none."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import clpeel
from clpeel.command import main as cli
from clpeel.command import parser
from clpeel.command.view import source_of
from clpeel.viewer import open as opening

TRIANGLE = clpeel.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], color=(200, 0, 0, 100))
HERE: dict[str, Any] = {"backend": "browser", "open_page": False}


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Any:
    """machine(display=..., notebook=..., lacking=...) is what the viewer finds around it."""

    def make(display: bool = False, notebook: bool = False, lacking: tuple[str, ...] = ()) -> None:
        monkeypatch.setattr(opening, "find_spec", lambda name: None if name in lacking else name)
        monkeypatch.setattr(opening, "has_display", lambda: display)
        monkeypatch.setattr(opening, "in_notebook", lambda: notebook)

    return make


@pytest.mark.parametrize(
    ("around", "backend"),
    [
        ({}, "browser"),
        ({"display": True}, "window"),
        ({"display": True, "lacking": ("wgpu", *opening.QT)}, "browser"),
        ({"display": True, "lacking": ("wgpu", "PyQt6")}, "window"),
        ({"display": True, "notebook": True}, "notebook"),
        ({"notebook": True, "lacking": ("anywidget",)}, "browser"),
    ],
)
def test_the_screen_is_what_there_is(machine: Any, around: dict[str, Any], backend: str) -> None:
    machine(**around)
    assert opening.checked_backend(None) == backend


@pytest.mark.parametrize(
    ("backend", "package"), [("browser", "uvicorn"), ("notebook", "anywidget"), (None, "rendercanvas")]
)
def test_a_package_that_is_missing_is_named_with_how_to_get_it(machine: Any, backend: Any, package: str) -> None:
    machine(lacking=(package,))
    with pytest.raises(clpeel.InputError, match=rf"view: expected {package} .*pip install 'clpeel\[view\]'"):
        opening.checked_backend(backend)


@pytest.mark.parametrize(("variable", "there"), [("DISPLAY", True), ("WAYLAND_DISPLAY", True), ("SSH_TTY", False)])
def test_a_display_is_where_a_variable_says_so(variable: str, there: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not opening.has_display()
    monkeypatch.setenv(variable, ":0")
    assert opening.has_display() == there


def test_a_notebook_is_a_shell_with_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    for shell, there in ((None, False), (SimpleNamespace(), False), (SimpleNamespace(kernel=1), True)):
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda shell=shell: shell))
        assert opening.in_notebook() == there


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"backend": "paper"}, "backend: expected one of window, browser, notebook"),
        ({"technique": "magic"}, "technique: expected one of"),
        ({"passes": 2}, "passes: the technique 'sort' has no such option"),
        ({"size": (0, 5)}, "size: expected"),
        ({"lighting": "moon"}, "lighting: expected one of"),
        ({"host": "no.such.name.example"}, "--host no.such.name.example"),
    ],
)
def test_what_is_wrong_is_one_line_before_anything_opens(options: dict[str, Any], message: str) -> None:
    pytest.importorskip("rendercanvas", reason="needs the extra 'view'")
    with pytest.raises(clpeel.InputError, match=message):
        clpeel.view(TRIANGLE, **{**HERE, **options})


def test_the_first_camera_suits_the_screen_that_there_is() -> None:
    tall = opening.framing_of(TRIANGLE, None)
    assert tall((300, 600)) == clpeel.Camera.frame(TRIANGLE, aspect=0.5)
    assert opening.framing_of(TRIANGLE, "iso")((300, 600)) == clpeel.Camera.frame(TRIANGLE, "iso", aspect=0.5)
    own = clpeel.Camera((0, 0, 5), (0, 0, 0))
    assert opening.framing_of(TRIANGLE, own)((300, 600)) is own
    with pytest.raises(clpeel.InputError, match="camera direction: expected an axis such as"):
        opening.framing_of(TRIANGLE, "front")


def test_something_else_than_a_scene_is_refused() -> None:
    with pytest.raises(clpeel.InputError, match="scene: expected a clpeel.Scene, got str"):
        clpeel.view("part.stl")  # type: ignore[arg-type]


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the command hands to `view`, which does not open anything."""
    found: dict[str, Any] = {}

    def view(scene: clpeel.Scene, camera: Any, **options: Any) -> None:
        found.update(options, scene=scene, camera=camera(options["size"]))

    monkeypatch.setattr(opening, "view", view)
    monkeypatch.setattr(opening, "checked_backend", lambda name: name or "browser")
    return found


@pytest.fixture
def shape(tmp_path: Path) -> str:
    path = tmp_path / "shape.off"
    path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    return str(path)


def test_the_options_of_render_arrive(seen: dict[str, Any], shape: str) -> None:
    words = "--technique=multi-layer-peeling --layers 4 --passes 2 --samples 16 --opacity .25 --unlit --no-background"
    more = "--camera-position 1,2,3 --camera-focal-point 0,0,1 --memory 64M --resolution 320,200 --depth-format rgba8"
    assert cli.main(["view", shape, *words.split(), *more.split()]) == 0
    named = (
        "technique",
        "layers_per_pass",
        "passes",
        "samples",
        "lighting",
        "background",
        "memory",
        "size",
        "depth_format",
    )
    got = [seen[name] for name in named]
    assert got == ["multi-layer-peeling", 4, 2, 16, "none", None, "64M", (320, 200), "rgba8"]
    assert seen["camera"].position == (1, 2, 3) and seen["scene"].color[3] == 0.25
    assert not seen["turning"] and seen["open_page"] and seen["title"] == "shape.off"


def test_built_in_scenes_need_no_file_and_boxes_turn(seen: dict[str, Any]) -> None:
    assert cli.main(["view", "--boxes", "--transparent-every", "3", "--no-open"]) == 0
    assert len(seen["scene"].faces) == 12_000 and seen["turning"] and not seen["open_page"]
    assert (seen["scene"].face_colors[:, 3] < 255).sum() == 333 * 12
    assert cli.main(["view", "--demo", "--turn", "--port", "8765", "--host", "127.0.0.1"]) == 0
    assert len(seen["scene"].faces) > 200_000 and seen["turning"] and seen["port"] == 8765


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "view: expected FILE..., --demo or --boxes, got none"),
        (["--demo", "--boxes"], "got --demo and --boxes"),
        (["x.stl", "--demo"], "got files and --demo"),
        (["--demo", "--transparent-every=2"], "--transparent-every: expected --boxes with it"),
        (["--boxes", "--transparent-every=1001"], "--transparent-every: expected 1..1000"),
        (["--boxes", "--port=65536"], "--port: expected a whole number 0..65535"),
        (["--boxes", "--passes=2"], "passes: the technique 'sort' has no such option"),
        (["--boxes", "--output=x.png"], "unknown option --output|this command has no option --output"),
        (["no-such-file.stl"], "no-such-file.stl"),
    ],
)
def test_wrong_words_are_one_line(seen: dict[str, Any], words: list[str], message: str, capfd: Any) -> None:
    assert cli.main(["view", *words]) == 2
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1 and re.search(message, lines[0]), lines


def test_others_on_the_network_are_a_note(seen: dict[str, Any], capfd: Any) -> None:
    assert cli.main(["view", "--boxes", "--host=0.0.0.0"]) == 0
    assert "others on the network who learn the page's address can look on and steer" in capfd.readouterr().err


def test_the_source_has_the_words_that_make_the_same_scene() -> None:
    words = ["view", "-a.stl", "b.obj", "--opacity=.5", "--opacity=1", "--color=red", "--drop-duplicates", "--device=0"]
    source = source_of(parser.parse([*words[:1], *words[3:], "--", *words[1:3]]))
    assert source.words == ("clpeel", "render", "./-a.stl", "b.obj")
    assert source.scene == ("--opacity=0.5", "--opacity=1.0", "--color=1.0,0.0,0.0", "--drop-duplicates")
    assert source.device == ("--device=0",)
    source = source_of(parser.parse(["view", "a.glb", "--animation-index=2", "--animation-time=0.25"]))
    assert source.scene == ("--animation-index=2", "--animation-time=0.25")
    source = source_of(
        parser.parse(["view", "--coloring-array=h", "--categories", "a.ply", "--no-categories", "b.ply"])
    )
    assert source.scene == ("--coloring-array=h", "--categories", "--no-categories")
