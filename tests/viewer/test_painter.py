"""The painter and the viewer: the latest view wins, drafts come first, and what rests is what render makes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import plainly
import pytest
from twins import soups

import clpeel
from clpeel.viewer import painter as painter_module
from clpeel.viewer.command_line import Source
from clpeel.viewer.heat import error_map
from clpeel.viewer.painter import Frame
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

pytestmark = pytest.mark.usefixtures("shared_devices")

CAMERA = clpeel.Camera((0.3, 0.4, 5.0), (0.0, 0.0, 0.0))
SIZE = (80, 60)
PATIENCE = 60.0  # seconds for kernels to compile in


def scene(count: int = 40) -> clpeel.Scene:
    rng = np.random.default_rng(5)
    points = rng.uniform(-1, 1, (3 * count, 3))
    colors = rng.integers(0, 256, (count, 4), dtype=np.uint8)
    return clpeel.Scene.from_arrays(points, np.arange(3 * count).reshape(-1, 3), face_colors=colors)


class Screen:
    """Keeps the frames."""

    def __init__(self) -> None:
        self.frames: list[tuple[Frame, dict[str, Any]]] = []
        self.came = threading.Condition()

    def present(self, frame: Frame, status: dict[str, Any]) -> None:
        with self.came:
            self.frames.append((frame, status))
            self.came.notify_all()

    def save(self, view: View) -> str:
        return f"saved {view.size}"

    def toggle(self, what: str) -> None:
        pass

    def wait(self, until: Callable[[Frame, dict[str, Any]], bool]) -> tuple[Frame, dict[str, Any]]:
        """The first frame, of those to come or there, for which this holds."""
        with self.came:
            assert self.came.wait_for(lambda: any(until(*each) for each in self.frames), PATIENCE), "no such frame came"
            return next(each for each in self.frames if until(*each))


@pytest.fixture
def look() -> Iterator[Callable[..., tuple[Viewer, Screen]]]:
    """look(scene, option=...) is a viewer of a scene and its screen, which already has a size."""
    opened: list[Viewer] = []

    def start(what: clpeel.Scene | None = None, **view: Any) -> tuple[Viewer, Screen]:
        source = Source(("clpeel", "render", "x.stl"))
        viewer = Viewer(
            what or scene(), View(CAMERA, SIZE, **view), source=source, say=lambda text: None, warn=lambda text: None
        )
        opened.append(viewer)
        screen = Screen()
        viewer.open(screen)
        viewer.resize(SIZE, SIZE)
        return viewer, screen

    yield start
    for viewer in opened:
        viewer.close()


def rendered(what: clpeel.Scene, view: View) -> np.ndarray:
    """What render makes of the view."""
    what = what if view.opacity is None else clpeel.load(what, opacity=view.opacity)
    return plainly.render(what, view.camera, technique=view.technique, **view.keywords()).image


def key(viewer: Viewer, *keys: str) -> None:
    for each in keys:
        viewer.handle({"event_type": "key_down", "key": each, "modifiers": ()})


@pytest.mark.parametrize("options", [{}, {"samples": 4}])
@pytest.mark.parametrize("technique", ["sort", "dual-depth-peeling", "weighted-average", "thickness", "auto"])
def test_what_rests_is_what_render_makes(look: Any, technique: str, options: dict[str, Any]) -> None:
    viewer, screen = look(technique=technique, options=options)
    frame, status = screen.wait(lambda frame, _: frame.full)
    assert (frame.image == rendered(scene(), viewer.view)).all()
    assert (
        status["full"]
        and (status["width"], status["height"]) == SIZE
        and status["samples"] == options.get("samples", 1)
    )


def test_opacity_is_what_loading_with_it_makes(look: Any) -> None:
    viewer, screen = look()
    for opacity in (0.3, 1.0, 0.7, None):
        viewer.set("opacity", opacity)
        frame, _ = screen.wait(
            lambda frame, _, o=opacity: frame.full and frame.view.opacity == o and frame.view is viewer.view
        )
        assert (frame.image == rendered(scene(), viewer.view)).all()


def test_the_latest_view_wins_and_no_queue_grows(look: Any) -> None:
    viewer, screen = look()
    screen.wait(lambda frame, _: frame.full)
    before = len(screen.frames)
    for step in range(2000):
        viewer.set("opacity", (step % 100) / 100)
    viewer.set("opacity", 0.5)
    frame, _ = screen.wait(lambda frame, _: frame.full and frame.view is viewer.view)
    assert frame is screen.frames[-1][0]
    assert len(screen.frames) - before < 1000


def test_a_newer_view_ends_a_full_picture(look: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    viewer, screen = look()
    screen.wait(lambda frame, _: frame.full)
    render, begun, ended = clpeel.Renderer.render, threading.Event(), []

    def slow(self: clpeel.Renderer, *arguments: Any, progress: Any = None, **options: Any) -> Any:
        if progress is None:
            return render(self, *arguments, **options)
        begun.set()
        try:
            for _ in range(6000):
                progress(0.5, "drawing")
                time.sleep(0.01)
        except BaseException as error:
            ended.append(type(error).__name__)
            raise
        raise AssertionError("nobody ended it")

    monkeypatch.setattr(clpeel.Renderer, "render", slow)
    viewer.set("samples", 4)
    assert begun.wait(PATIENCE)
    monkeypatch.setattr(clpeel.Renderer, "render", render)
    viewer.set("samples", 16)
    frame, _ = screen.wait(lambda frame, _: frame.full and frame.stats.samples == 16)
    assert ended == ["_Newer"]
    assert (frame.image == rendered(scene(), viewer.view)).all()


def test_nothing_is_drawn_while_nobody_can_see_it(look: Any) -> None:
    viewer, screen = look()
    screen.wait(lambda frame, _: frame.full)
    viewer.set_ready(False)
    time.sleep(0.05)
    before = len(screen.frames)
    viewer.set("opacity", 0.5)
    time.sleep(0.4)
    assert len(screen.frames) == before
    viewer.set_ready(True)
    screen.wait(lambda frame, _: frame.full and frame.view.opacity == 0.5)


def test_a_turning_scene_turns_about_its_middle_and_stops(look: Any) -> None:
    viewer, screen = look(turning=True)
    screen.wait(lambda frame, _: len(screen.frames) > 5)
    key(viewer, " ")
    frame, status = screen.wait(lambda frame, _: frame.full)
    assert not status["settings"]["turning"]
    assert frame.view.camera.position != CAMERA.position
    assert frame.view.camera.distance == pytest.approx(CAMERA.distance)
    assert (frame.image == rendered(scene(), viewer.view)).all()


def test_a_double_click_puts_what_is_there_in_the_middle(look: Any) -> None:
    points = [[1, 0.5, 0.25], [3, 0.5, 0.25], [1, 2.5, 0.25], [-9, -9, -3], [9, -9, -3], [0, 9, -3]]
    viewer, screen = look(clpeel.Scene.from_arrays(points, [[0, 1, 2], [3, 4, 5]]))
    screen.wait(lambda frame, _: frame.full)
    click = {"event_type": "double_click", "button": 1, "buttons": (), "modifiers": ()}
    viewer.handle({**click, "x": 70.0, "y": 15.0})
    frame, _ = screen.wait(lambda frame, _: frame.full and frame.view.camera != CAMERA)
    focus = np.array(frame.view.camera.focal_point)
    assert focus[2] == pytest.approx(0.25, abs=1e-5) and focus[0] > 1 and focus[1] > 0.5
    assert frame.view.camera.axes() == pytest.approx(CAMERA.axes(), abs=1e-6)


def test_a_double_click_on_nothing_says_so(look: Any) -> None:
    viewer, screen = look()
    screen.wait(lambda frame, _: frame.full)
    click = {"event_type": "double_click", "button": 1, "buttons": (), "modifiers": ()}
    viewer.handle({**click, "x": 0.5, "y": 0.5})
    _, status = screen.wait(lambda _, status: status["notice"] != "")
    assert status["notice"] == "nothing is under the pointer" and viewer.view.camera == CAMERA


def test_what_is_impossible_is_a_notice_and_the_next_change_clears_it(look: Any) -> None:
    viewer, screen = look()
    screen.wait(lambda frame, _: frame.full)
    key(viewer, "q")
    _, status = screen.wait(lambda _, status: status["notice"] != "")
    assert "got sort" in status["notice"]
    key(viewer, "1")
    _, status = screen.wait(lambda _, status: status["technique"] == "dual-depth-peeling")
    assert status["notice"] == ""


def test_a_picture_that_fails_is_a_notice_and_the_viewer_goes_on(look: Any) -> None:
    viewer, screen = look()
    screen.wait(lambda frame, _: frame.full)
    viewer.set("technique", "thickness")
    viewer.set("shows", "error")
    _, status = screen.wait(lambda _, status: "which makes a map" in status["notice"])
    viewer.set("shows", "picture")
    screen.wait(lambda frame, _: frame.full and frame.view is viewer.view)


@pytest.mark.parametrize("samples", [1, 4])
def test_heat_maps_show_layers_and_errors(look: Any, samples: int) -> None:
    viewer, screen = look(technique="weighted-sum", options={"samples": samples})
    viewer.set("shows", "layers")
    frame, status = screen.wait(lambda frame, _: frame.full and frame.view.shows == "layers")
    expected = plainly.render(
        scene(), viewer.view.camera, technique="layer-count", **viewer.view.keywords("layer-count")
    )
    assert (frame.image == expected.image).all()
    viewer.set("shows", "error")
    frame, status = screen.wait(lambda frame, _: frame.full and frame.view.shows == "error")
    assert frame.errors is not None and frame.errors[0] > 0.1 and status["max_error"] == frame.errors[0]


def test_the_heat_map_of_errors_blends_as_shown() -> None:
    """The truth is made of layers, which are colours as they are shown."""
    view = View(CAMERA, SIZE, options={"blending_space": "linear"})
    assert error_map(plainly.Renderer(scene()), view, None).max_error < 1e-5


def test_what_the_picture_lacks_is_a_note(look: Any) -> None:
    points = scene().vertices.copy()
    points[0] = np.nan
    lacking = clpeel.Scene.from_arrays(points, scene().faces, color=(200, 30, 30, 90))
    viewer, screen = look(lacking, technique="depth-peeling", options={"passes": 1})
    _, status = screen.wait(lambda frame, _: frame.full)
    told = " ".join(status["notes"])
    assert "1 triangles with NaN or infinite vertices were left out" in told
    assert "pixels have more layers than were drawn" in told


def test_the_status_has_the_command(look: Any) -> None:
    viewer, screen = look()
    _, status = screen.wait(lambda frame, _: frame.full)
    assert status["command"].startswith("clpeel render x.stl --resolution=80,60 --technique=sort")


def test_a_heavy_scene_is_drawn_coarser_while_the_hand_moves(look: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(painter_module, "HEAVY", 1e-5)  # seconds: any geometry is heavy
    viewer, screen = look(scene(20_000))
    for step in range(400):
        viewer.set("opacity", (step % 90) / 100)
        time.sleep(0.02)
        if any(frame.coarse for frame, _ in screen.frames):
            break
    frame, status = screen.wait(lambda frame, _: frame.coarse)
    assert not frame.full and status["coarse"] and status["triangles"] < 20_000
    frame, status = screen.wait(lambda frame, _: frame.full and frame.view is viewer.view)
    assert not status["coarse"] and (frame.image == rendered(scene(20_000), viewer.view)).all()


# --- heat maps --------------------------------------------------------------------------------------------------------


def test_the_error_is_that_against_float64() -> None:
    layers = soups.stack([1.0, 2.0, 3.0], [[1, 0, 0, 0.5], [0, 1, 0, 0.5], [0, 0, 1, 0.5]]).scene()
    view = View(soups.AHEAD.camera(), (24, 16), "weighted-sum", background=(1.0, 1.0, 1.0), lighting="none")
    found = error_map(plainly.Renderer(layers), view, None)
    right = np.array([0.5, 0.25, 0.125]) + 0.125  # blended in order over white
    wrong = np.clip(np.array([0.5, 0.5, 0.5]) + (1 - 1.5), 0, 1)  # the sum, and what it leaves of white
    assert found.max_error == pytest.approx(np.abs(right - wrong).max(), abs=1e-6)
    exact = error_map(plainly.Renderer(layers), View(view.camera, view.size, "depth-peeling", lighting="none"), None)
    assert exact.max_error < 1e-6 and not exact.image[..., :3].any()


# --- a renderer's opacity ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lighting", ["none", "headlight", "kit"])
@pytest.mark.parametrize("color", ["face", "vertex", "one"])
def test_a_renderers_opacity_makes_the_bits_of_a_scene_with_it(lighting: Any, color: str, lanes: int) -> None:
    base = scene(12)
    rng = np.random.default_rng(3)
    if color == "vertex":
        base = clpeel.Scene.from_arrays(base.vertices, base.faces, vertex_colors=rng.random((36, 4)).astype(np.float32))
    if color == "one":
        base = clpeel.Scene.from_arrays(base.vertices, base.faces, color=(10, 200, 30, 90))
    renderer = plainly.Renderer(base, lanes=lanes)
    for opacity in (None, 0.4, 0.123, 1.0, 0.0, None):
        renderer.set_opacity(opacity)
        own = base if opacity is None else clpeel.load(base, opacity=opacity)
        image = renderer.render(CAMERA, (33, 21), lighting=lighting).image
        assert (image == plainly.render(own, CAMERA, (33, 21), lighting=lighting, lanes=lanes).image).all(), opacity


@pytest.mark.parametrize("wrong", [-0.1, 1.5, float("nan"), "much"])
def test_a_wrong_opacity_is_refused(wrong: Any) -> None:
    with pytest.raises(clpeel.InputError, match="opacity: expected a number 0..1"):
        plainly.Renderer(scene(2)).set_opacity(wrong)
