"""`clpeel.show`: what it takes, where it shows it, and in a kernel of IPython what a notebook gets."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from queue import Empty
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import clpeel
from clpeel.viewer import show as showing

LONG = 120.0
"""Seconds after which a test gives up to wait."""

SMALL = (200, 150)


@pytest.fixture
def scene(squares: Path) -> clpeel.Scene:
    return clpeel.load(squares, opacity=0.5)


@pytest.fixture
def around(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Any]]:
    """around(notebook=..., display=..., lacking=...) is what `show` finds. Returns what it displays or views."""

    def make(notebook: bool = False, display: bool = False, lacking: tuple[str, ...] = ()) -> list[Any]:
        found: list[Any] = []
        monkeypatch.setattr(showing, "in_notebook", lambda: notebook)
        monkeypatch.setattr(showing, "has_display", lambda: display)
        monkeypatch.setattr(showing, "missing", lambda backend: list(lacking))
        monkeypatch.setattr(showing, "displayed", lambda thing: (found.append(thing), thing)[1])
        monkeypatch.setattr(
            "clpeel.viewer.open.view", lambda scene, **options: found.append((scene, options)) or "a view"
        )
        return found

    return make


# --- what it takes ----------------------------------------------------------------------------------------------------


def test_options_of_load_and_of_render_are_told_apart(around: Callable[..., list[Any]], squares: Path) -> None:
    shown = around(notebook=True)
    options: dict[str, Any] = {"camera": "iso", "size": SMALL, "technique": "depth-peeling", "samples": 8}
    result = clpeel.show(str(squares), opacity=0.25, color="steelblue", edges=True, **options)
    want = clpeel.render(clpeel.load(squares, opacity=0.25, color="steelblue"), edges=True, **options)
    assert (result.image == want.image).all() and shown == [result]


def test_several_things_are_shown_together(
    around: Callable[..., list[Any]], squares: Path, scene: clpeel.Scene
) -> None:
    around(notebook=True)
    moved = clpeel.Scene.from_arrays(scene.vertices + [3, 0, 0], scene.faces, color=(200, 0, 0))
    want = clpeel.render(clpeel.load(squares, moved), size=SMALL)
    for things in ((squares, moved), ([squares, moved],), ((squares, moved),)):
        assert (clpeel.show(*things, size=SMALL).image == want.image).all()


def test_numbers_have_their_scale_bar(around: Callable[..., list[Any]], scene: clpeel.Scene) -> None:
    around(notebook=True)
    height = scene.vertices[:, 2]
    size = (400, 300)
    bare = clpeel.render(clpeel.load(scene, scalars=height, cmap="gray", label="height"), size=size)
    for bar, want in ((None, bare.with_bar(*bare_maps(scene, height))), (True, None), (False, bare)):
        found = clpeel.show(scene, scalars=height, cmap="gray", label="height", size=size, bar=bar)
        if want is not None:
            assert (found.image == want.image).all()
        assert (found.image != bare.image).any() == (bar is not False)


def bare_maps(scene: clpeel.Scene, height: NDArray[np.float64]) -> Any:
    return clpeel.load(scene, scalars=height, cmap="gray", label="height").color_maps


@pytest.mark.skipif(find_spec("pyvista") is None, reason="needs pyvista")
def test_a_plotter_is_shown_as_it_is_but_for_what_is_asked(around: Callable[..., list[Any]]) -> None:
    import pyvista

    around(notebook=True)
    plotter = pyvista.Plotter(off_screen=True, window_size=(160, 120))
    plotter.add_mesh(pyvista.Cube(), color="tomato", opacity=0.5)
    scene, camera, options = clpeel.from_pyvista(plotter)
    assert (clpeel.show(plotter).image == clpeel.render(scene, camera, **options).image).all()
    changed = clpeel.show(plotter, camera="xy", opacity=0.2)
    want = clpeel.render(clpeel.load(scene, opacity=0.2), "xy", **options)
    assert (changed.image == want.image).all()
    plotter.close()


@pytest.mark.parametrize(
    ("things", "options", "message"),
    [
        ([], {}, "show: expected something to show, got nothing"),
        ([[]], {}, "show: expected something to show, got nothing"),
        (["a.ply"], {"opactiy": 1}, "opactiy: show has no such option; did you mean opacity?"),
        (["a.ply"], {"show_edges": 1}, "show_edges: show has no such option; did you mean"),
        (["a.ply"], {"zzzz": 1}, "zzzz: show has no such option; it has those of clpeel.load and of clpeel.render"),
        (["no-such-file.ply"], {}, "no-such-file.ply: no such file"),
        ([5], {}, "expected"),
        (["a.ply"], {"passes": 2}, "passes: the technique 'sort' has no such option"),
        (["a.ply"], {"technique": "magic"}, "technique: expected one of"),
    ],
)
def test_what_is_wrong_is_one_line(
    around: Callable[..., list[Any]], things: list[Any], options: dict[str, Any], message: str
) -> None:
    around(notebook=True)
    with pytest.raises(clpeel.InputError, match=message) as raised:
        clpeel.show(*things, **options)
    assert "\n" not in str(raised.value)


def test_what_is_drawn_already_takes_no_options(around: Callable[..., list[Any]], scene: clpeel.Scene) -> None:
    shown = around(notebook=True)
    result = clpeel.render(scene, size=SMALL, layers=True)
    assert clpeel.show(result) is result and shown == [result]
    for options in ({"opacity": 0.5}, {"live": True}, {"size": SMALL}):
        with pytest.raises(clpeel.InputError, match="expected no such option for Result, which is drawn already"):
            clpeel.show(result, **options)  # type: ignore[arg-type]


# --- where it shows it ------------------------------------------------------------------------------------------------


def test_outside_of_notebooks_it_is_a_window(around: Callable[..., list[Any]], scene: clpeel.Scene) -> None:
    shown = around(display=True)
    assert clpeel.show(scene, camera="iso", title="squares", samples=4) == "a view"
    ((seen, options),) = shown
    assert len(seen.faces) == 4
    assert options == {"camera": "iso", "samples": 4, "lighting": "kit", "title": "squares", "backend": "window"}


@pytest.mark.parametrize(
    ("where", "options", "message"),
    [
        ({}, {}, r"expected a notebook, or a display for a window, got neither; clpeel.render\(scene\).save\("),
        ({"display": True, "lacking": ("wgpu",)}, {}, r"expected wgpu for a window, got none: pip install 'clpeel\[vi"),
        ({"display": True}, {"live": False}, "live: expected True outside of notebooks"),
        ({"display": True}, {"bar": True}, "bar: expected live=False with it"),
    ],
)
def test_without_a_place_it_says_what_to_do(
    around: Callable[..., list[Any]],
    scene: clpeel.Scene,
    where: dict[str, Any],
    options: dict[str, Any],
    message: str,
) -> None:
    shown = around(**where)
    with pytest.raises(clpeel.InputError, match=message):
        clpeel.show(scene, **options)
    assert not shown


def test_a_result_needs_a_notebook(around: Callable[..., list[Any]], scene: clpeel.Scene) -> None:
    around(display=True)
    result = clpeel.render(scene, size=SMALL, layers=True)
    with pytest.raises(clpeel.InputError, match=r"result.save\('picture.png'\) writes it"):
        clpeel.show(result)
    with pytest.raises(clpeel.InputError, match="expected a notebook for layers"):
        clpeel.show(result.layers)


# --- a kernel of IPython ----------------------------------------------------------------------------------------------

needs_kernel = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("ipykernel", "jupyter_client")), reason="needs ipykernel"
)


@pytest.fixture(scope="module")
def run() -> Iterator[Callable[[str], list[tuple[str, dict[str, Any]]]]]:
    """run(code) runs a cell, and returns what a notebook gets of it: kinds of messages, and their contents."""
    from jupyter_client.manager import start_new_kernel

    manager, client = start_new_kernel(kernel_name="python3", startup_timeout=LONG)

    def cell(code: str) -> list[tuple[str, dict[str, Any]]]:
        number = client.execute(code)
        found = []
        while True:
            try:
                message = client.get_iopub_msg(timeout=LONG)
            except Empty:
                pytest.fail("the kernel never answered")
            if message["parent_header"].get("msg_id") != number:
                continue
            kind, content = message["msg_type"], message["content"]
            if kind == "status" and content["execution_state"] == "idle":
                return found
            if kind in ("display_data", "execute_result", "error", "stream"):
                found.append((kind, content))

    try:
        yield cell
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def picture_in(content: dict[str, Any]) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(content["data"]["image/png"]))).convert("RGBA"))


@needs_kernel
@pytest.mark.filterwarnings("ignore")
def test_in_a_notebook_the_first_show_is_a_picture_and_only_one(run: Any, squares: Path, scene: clpeel.Scene) -> None:
    want = clpeel.render(scene, size=SMALL).image
    show = f"clpeel.show({str(squares)!r}, opacity=0.5, size={SMALL})"
    for code in (f"import clpeel\n{show}", f"import clpeel\nresult = {show}\nx = 1", f"result = {show}\nresult"):
        messages = run(code)
        assert [kind for kind, _ in messages] == ["display_data"], (code, messages)
        assert (picture_in(messages[0][1]) == want).all()
    ((kind, content),) = run("result")
    assert (kind in ("display_data", "execute_result")) and (picture_in(content) == want).all()
    ((kind, content),) = run("result.with_axis(clpeel.Camera((0, 0, 5), (0, 0, 0)))")
    assert kind == "execute_result" and (picture_in(content) != want).any()
    assert run("import pickle; assert (pickle.loads(pickle.dumps(result)).image == result.image).all()") == []


@needs_kernel
@pytest.mark.filterwarnings("ignore")
def test_in_a_notebook_layers_are_shown_together(run: Any, squares: Path, scene: clpeel.Scene) -> None:
    run(f"import clpeel\nscene = clpeel.load({str(squares)!r}, opacity=0.5)")
    messages = run(f"layers = clpeel.show(clpeel.render(scene, size={SMALL}, layers=True).layers, background='red')")
    want = clpeel.render(scene, size=SMALL, layers=True, background="red").image
    assert (picture_in(messages[0][1]) == want).all()


@needs_kernel
@pytest.mark.filterwarnings("ignore")
@pytest.mark.skipif(
    any(find_spec(name) is None for name in ("rendercanvas", "anywidget", "simplejpeg")), reason="needs anywidget"
)
def test_in_a_notebook_live_is_one_widget(run: Any, squares: Path) -> None:
    messages = run(f"import clpeel\nwidget = clpeel.show({str(squares)!r}, live=True)\nwidget")
    shown = [content for kind, content in messages if kind in ("display_data", "execute_result")]
    assert len(shown) == 1 and "application/vnd.jupyter.widget-view+json" in shown[0]["data"], messages
    assert not [content for kind, content in run("widget.close()") if kind == "error"]


@needs_kernel
@pytest.mark.filterwarnings("ignore")
def test_in_a_notebook_an_error_is_one_line(run: Any) -> None:
    ((kind, content),) = run("import clpeel\nclpeel.show('no-such-file.ply', opactiy=1)")
    assert (kind, content["ename"]) == ("error", "InputError") and "did you mean opacity?" in content["evalue"]
