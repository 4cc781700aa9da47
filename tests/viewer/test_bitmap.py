"""The screen of windows and notebooks, on rendercanvas's canvas without a display."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from numpy.typing import NDArray
from PIL import Image

import clpeel
from clpeel.viewer import bitmap
from clpeel.viewer.bitmap import BitmapScreen, composed, scaled
from clpeel.viewer.overlay import panel_plate, status_plate
from clpeel.viewer.panel import rows_of
from clpeel.viewer.status import lines_of
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

pytest.importorskip("rendercanvas")
SIZE = (400, 300)
LONG = 60.0
"""Seconds after which a test gives up to wait."""


class Loop:
    """An event loop that has nothing to do but what other threads ask for, which it does at once."""

    def call_soon_threadsafe(self, callback: Callable[..., object], *arguments: object) -> None:
        callback(*arguments)


class Desk:
    """A viewer on a canvas without a display. Nothing is drawn there until a test asks for it."""

    def __init__(self, scene: clpeel.Scene, ratio: float = 1.0, **more: Any) -> None:
        from rendercanvas.offscreen import RenderCanvas

        self.said: list[str] = []
        self.scene = scene
        self.canvas = RenderCanvas(size=SIZE, pixel_ratio=ratio)
        pixels = self.canvas.get_physical_size()
        view = View(clpeel.Camera.frame(scene, aspect=4 / 3), pixels, **more)
        self.viewer = Viewer(scene, view, say=self.said.append, warn=self.said.append)
        self.screen = BitmapScreen(self.viewer, self.canvas, Loop())
        self.came = threading.Condition()
        self.frames: list[tuple[Any, dict[str, Any]]] = []
        present = self.screen.present

        def presented(frame: Any, status: dict[str, Any]) -> None:
            present(frame, status)
            with self.came:
                self.frames.append((frame, status))
                self.came.notify_all()

        self.screen.present = presented  # type: ignore[method-assign]

    def draw(self) -> NDArray[np.uint8]:
        """What the canvas shows now."""
        return np.array(self.canvas.draw())

    def rest(self) -> Any:
        """Wait until the full picture of the view is there, and return its frame."""

        def full() -> bool:
            self.canvas.draw()
            return bool(self.frames) and self.frames[-1][0].full and self.frames[-1][0].view is self.viewer.view

        self.wait(full)
        return self.frames[-1][0]

    def wait(self, until: Callable[[], bool]) -> None:
        """Wait until something is so. It is looked at again and again, at least after each frame."""
        with self.came:
            for _ in range(int(LONG / 0.05)):
                if until():
                    return
                self.came.wait(0.05)
        pytest.fail("this never came")

    def send(self, kind: str, x: float = 0, y: float = 0, button: int = 1, buttons: tuple[int, ...] = (1,)) -> None:
        event = {"event_type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "modifiers": (), "dy": 100}
        self.screen.handle(event)

    def key(self, key: str) -> None:
        self.screen.handle({"event_type": "key_down", "key": key, "modifiers": ()})

    def click(self, x: float, y: float) -> None:
        self.send("pointer_down", x, y)
        self.send("pointer_up", x, y, buttons=())


@pytest.fixture
def scene(squares: Path) -> clpeel.Scene:
    return clpeel.load(squares, opacity=0.5)


@pytest.fixture
def make(scene: clpeel.Scene) -> Iterator[Callable[..., Desk]]:
    """make(ratio) is a desk of two squares."""
    made: list[Desk] = []

    def new(ratio: float = 1.0, **more: Any) -> Desk:
        made.append(Desk(scene, ratio, **more))
        return made[-1]

    yield new
    for desk in made:
        desk.canvas.close()
        desk.viewer.close()


def uncovered(desk: Desk, status: dict[str, Any]) -> NDArray[np.bool_]:
    """Where there is no status, [height, width]."""
    width, height = desk.canvas.get_physical_size()
    plate = status_plate(lines_of(status), (width, height), desk.canvas.get_pixel_ratio())
    free = np.ones((height, width), bool)
    free[plate.top : plate.top + plate.height, plate.left : plate.left + plate.width] = False
    return free


@pytest.mark.parametrize("ratio", (1.0, 1.5, 2.0))
def test_at_rest_the_screen_shows_the_bits_of_render_beside_the_status(
    make: Callable[..., Desk], scene: clpeel.Scene, ratio: float
) -> None:
    desk = make(ratio)
    desk.key("x")  # so that the hint goes away
    frame = desk.rest()
    shown = desk.draw()
    want = plainly.render(scene, desk.viewer.view.camera, desk.canvas.get_physical_size(), lighting="kit").image
    free = uncovered(desk, desk.frames[-1][1])
    assert frame.image.shape == want.shape == shown.shape and free.mean() > 0.5
    assert (shown[free] == want[free]).all() and (shown[~free] != want[~free]).any()
    assert (frame.image == want).all(), "the overlay went into the frame itself"


def test_a_hint_is_shown_until_something_is_done(make: Callable[..., Desk], monkeypatch: pytest.MonkeyPatch) -> None:
    desk = make()
    frame = desk.rest()
    free = uncovered(desk, desk.frames[-1][1])
    assert (desk.draw()[free] != frame.image[free]).any()
    desk.send("pointer_move", 10, 10, 0, ())
    assert (desk.draw()[free] != frame.image[free]).any()
    asked: list[bool] = []
    monkeypatch.setattr(desk.canvas, "request_draw", lambda: asked.append(True))
    desk.key("x")
    assert asked == [True]
    assert (desk.draw()[free] == frame.image[free]).all()


def test_before_the_first_frame_the_screen_says_that_it_is_coming(scene: clpeel.Scene) -> None:
    image = composed(None, SIZE, 1.0)
    assert (image[0, 0] == bitmap.BLANK).all() and (image[150:] == 255).any()


def test_a_drag_rotates_the_scene_and_one_that_began_in_the_panel_does_not(make: Callable[..., Desk]) -> None:
    desk = make()
    desk.rest()
    camera = desk.viewer.view.camera
    desk.key("p")
    plate = panel_plate(desk.frames[-1][1], SIZE, 1.0)
    inside = plate.left + plate.width - 3, plate.top + plate.height - 3
    desk.send("pointer_down", *inside)
    desk.send("pointer_move", 30, 250)
    desk.send("pointer_up", 30, 250, buttons=())
    desk.send("double_click", *inside)
    desk.send("wheel", *inside)
    assert desk.viewer.view.camera == camera
    desk.send("pointer_down", 30, 250)
    desk.send("pointer_move", *inside)
    desk.send("pointer_up", *inside, buttons=())
    assert desk.viewer.view.camera != camera


@pytest.mark.parametrize("ratio", (1.0, 1.5, 2.0))
def test_a_click_on_an_arrow_changes_that_setting_and_no_other(make: Callable[..., Desk], ratio: float) -> None:
    desk = make(ratio, technique="multi-layer-peeling")
    desk.rest()
    desk.key("p")
    from clpeel.viewer.status import settings

    for name in ("coincident", "samples", "orthographic", "opacity", "background", "lighting", "max_error"):
        before = settings(desk.viewer.view)
        status = {**desk.frames[-1][1], "settings": before}
        plate = panel_plate(status, desk.canvas.get_physical_size(), ratio)
        row = [each.name for each in rows_of(status)].index(name)
        left, top, right, bottom = plate.box(row, 3)
        desk.click((left + right) / 2 / ratio, (top + bottom) / 2 / ratio)
        after = settings(desk.viewer.view)
        assert {key for key in after if after[key] != before[key]} == {name}


def test_the_help_and_the_panel_come_and_go(make: Callable[..., Desk]) -> None:
    desk = make()
    desk.key("x")
    desk.rest()
    plain = desk.draw()
    for key in "hp":
        desk.key(key)
        assert (desk.draw() != plain).any()
        desk.key(key)
        assert (desk.draw() == plain).all()


def test_while_nobody_draws_the_painter_pauses(make: Callable[..., Desk]) -> None:
    desk = make(turning=True)
    desk.draw()  # this tells the viewer its size
    for count in (1, 2, 3):
        desk.wait(lambda count=count: len(desk.frames) == count)
        time.sleep(0.2)
        assert len(desk.frames) == count, "a frame was drawn that nobody could take"
        desk.draw()


def test_a_transparent_background_is_shown_as_squares(make: Callable[..., Desk]) -> None:
    desk = make(background=None)
    desk.key("x")
    frame = desk.rest()
    shown = desk.draw()
    assert frame.image[0, 0, 3] == 0
    assert (shown[..., 3] == 255).all() and len(np.unique(shown[:16, :16, 0])) == 2


# --- saving -----------------------------------------------------------------------------------------------------------


def test_s_saves_the_full_picture_without_the_overlay_under_a_new_name(
    make: Callable[..., Desk], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    desk = make()
    frame = desk.rest()
    for name in ("clpeel.png", "clpeel-1.png"):
        desk.key("s")
        desk.wait(lambda name=name: f"saved {name}" in desk.said)
        assert (np.asarray(Image.open(tmp_path / name)) == frame.image[..., :3]).all()
        assert desk.frames[-1][1]["notice"] == f"saved {name}"
    assert sorted(os.listdir(tmp_path)) == ["clpeel-1.png", "clpeel.png", "squares.off"]


def test_s_in_the_middle_of_a_drag_saves_the_full_picture_of_that_view(
    make: Callable[..., Desk], scene: clpeel.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    desk = make()
    desk.rest()
    desk.send("pointer_down", 100, 100)
    desk.send("pointer_move", 150, 120)
    camera = desk.viewer.view.camera
    desk.key("s")
    desk.send("pointer_move", 250, 150)
    desk.wait(lambda: "saved clpeel.png" in desk.said)
    want = plainly.render(scene, camera, SIZE, lighting="kit").image
    assert (np.asarray(Image.open(tmp_path / "clpeel.png")) == want[..., :3]).all()


def test_a_folder_that_cannot_be_written_is_a_notice(
    make: Callable[..., Desk], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    desk = make()
    desk.rest()
    folder.rmdir()
    desk.key("s")
    desk.wait(lambda: bool(desk.said))
    assert desk.said[0].startswith("output: ") and "\n" not in desk.said[0]
    monkeypatch.chdir(tmp_path)
    desk.key("s")
    desk.wait(lambda: "saved clpeel.png" in desk.said)


def test_a_picture_that_cannot_be_drawn_is_a_notice_and_the_next_one_is_saved(
    make: Callable[..., Desk], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    desk = make()
    desk.rest()

    def broken(*arguments: object, **options: object) -> None:
        raise clpeel.InputError("no picture today")

    desk.send("pointer_down", 100, 100)
    with monkeypatch.context() as patch:
        patch.setattr(desk.viewer.renderer, "render", broken)
        desk.send("pointer_move", 150, 120)
        desk.key("s")
        desk.wait(lambda: "error: no picture today" in desk.said)
        desk.wait(lambda: not desk.screen._saving)
    desk.key("s")
    desk.wait(lambda: "saved clpeel.png" in desk.said)


def test_a_notice_stays_while_the_pointer_moves_and_goes_with_the_next_key(make: Callable[..., Desk]) -> None:
    desk = make()
    desk.rest()
    desk.viewer.tell("look here")
    desk.send("pointer_move", 30, 30, 0, ())
    assert desk.frames[-1][1]["notice"] == "look here"
    desk.key("x")
    assert desk.frames[-1][1]["notice"] == ""


def test_closing_ends_the_painter_and_later_frames_are_refused(make: Callable[..., Desk]) -> None:
    desk = make(turning=True)
    desk.draw()
    desk.wait(lambda: bool(desk.frames))
    desk.canvas.close()
    painter = desk.viewer._painter._thread
    painter.join(LONG)
    assert not painter.is_alive()
    desk.viewer.refresh()


# --- scaling ----------------------------------------------------------------------------------------------------------


def test_an_image_of_the_right_size_is_copied() -> None:
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 4), np.uint8)
    found = scaled(image, (40, 30))
    assert (found == image).all() and not np.shares_memory(found, image)


@pytest.mark.parametrize("factor", (1, 2))
def test_a_slightly_smaller_image_is_repeated(factor: int) -> None:
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 4), np.uint8)
    found = scaled(image, (40 * factor, 30 * factor))
    assert (found == image.repeat(factor, 0).repeat(factor, 1)).all()


def test_a_much_smaller_image_is_interpolated() -> None:
    ramp = np.zeros((8, 8, 4), np.uint8)
    ramp[..., 0] = np.arange(8) * 32
    ramp[..., 1] = np.arange(8)[:, None] * 32
    found = scaled(ramp, (80, 80))
    assert found.shape == (80, 80, 4)
    steps = np.abs(np.diff(found.astype(int), axis=1))[..., 0], np.abs(np.diff(found.astype(int), axis=0))[..., 1]
    assert max(step.max() for step in steps) == 16  # half of the ramp's own step
    assert (found[..., 2] == 0).all()


@pytest.mark.parametrize("size", ((33, 7), (1, 1), (500, 3)))
def test_any_size_is_reached(size: tuple[int, int]) -> None:
    image = np.full((13, 17, 4), 7, np.uint8)
    found = scaled(image, size)
    assert found.shape == (size[1], size[0], 4) and (found == 7).all()
