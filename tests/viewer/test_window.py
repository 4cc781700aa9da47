"""The window, in a process of its own on a display without a screen, with a mouse and keys that the test moves."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageGrab, features

import clpeel
from clpeel.viewer import open as opening
from clpeel.viewer import window
from clpeel.viewer.overlay import panel_plate
from clpeel.viewer.panel import rows_of
from clpeel.viewer.status import settings
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer
from clpeel.viewer.window import Typed, chosen_qt

SIZE = (400, 300)
LONG = 120.0
"""Seconds after which a test gives up to wait."""

needs_glfw = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("rendercanvas", "glfw", "wgpu")),
    reason="needs rendercanvas, glfw and wgpu",
)

# A line on standard input closes the window, as its user does.
CHILD = """
import os, sys, threading, clpeel
from clpeel.viewer.open import view

def listen():
    os.read(0, 1)
    import glfw
    from rendercanvas.glfw import loop
    (canvas,) = loop.get_canvases()
    loop.call_soon_threadsafe(glfw.set_window_should_close, canvas._window, True)

threading.Thread(target=listen, daemon=True).start()
try:
    view(clpeel.load(sys.argv[1], opacity=0.5), backend="window", size=(400, 300), title="squares.off")
except clpeel.InputError as error:
    print("refused:", error)
else:
    print("returned")
"""


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """The name of a display without a screen, on which a window opens."""
    lacking = [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]
    if lacking or not features.check("xcb"):
        pytest.skip(f"needs {' and '.join(lacking) or 'Pillow with XCB'}")
    here, there = os.pipe()
    command = ["Xvfb", "-displayfd", str(there), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[there], stderr=subprocess.DEVNULL) as server:
        os.close(there)
        with open(here) as told:
            name = f":{told.readline().strip()}"
        try:
            code = "from clpeel.viewer.window import *; check_glfw(); check_adapter()"
            checked = subprocess.run(
                [sys.executable, "-c", code], env=os.environ | {"DISPLAY": name}, capture_output=True, text=True
            )
            if checked.returncode:
                pytest.skip(f"no window opens here: {checked.stderr.strip().splitlines()[-1]}")
            yield name
        finally:
            server.terminate()


class Window:
    """A viewer's window, and its user."""

    def __init__(self, display: str, squares: Path, folder: Path, **more: str) -> None:
        self.display, self.folder = display, folder
        self.scene = clpeel.load(squares, opacity=0.5)
        env = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        env |= {"PYTHONUNBUFFERED": "1", **({"DISPLAY": display} if display else {}), **more}
        command = [sys.executable, "-c", CHILD, str(squares)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, cwd=folder, env=env, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        self.said: list[str] = []
        self.errors: list[str] = []
        self.threads = [
            threading.Thread(target=lambda: self.said.extend(self.process.stdout or ())),
            threading.Thread(target=lambda: self.errors.extend(self.process.stderr or ())),
        ]
        for thread in self.threads:
            thread.start()

    def wait(self, until: Callable[[], Any]) -> Any:
        """Wait until something is so, and return it."""
        for _ in range(int(LONG / 0.1)):
            if found := until():
                return found
            if self.process.poll() is not None:
                break
            time.sleep(0.1)
        pytest.fail(f"this never came; it said {self.said} and {self.errors}")

    def do(self, *words: object) -> str:
        """Do something with xdotool."""
        command = ["xdotool", *map(str, words)]
        env = os.environ | {"DISPLAY": self.display}
        return subprocess.run(command, env=env, capture_output=True, text=True).stdout.strip()

    def open(self) -> None:
        """Wait for the window, and for its full picture."""
        self.wait(lambda: self.do("search", "--name", "squares.off"))
        self.do("mousemove", 200, 20)
        self.key("x")  # this does nothing, but the hint goes away
        self.rest()

    def key(self, key: str) -> None:
        self.do("key", key)

    def command(self) -> str:
        """What the key C prints."""
        before = len(self.said)
        self.key("c")
        return str(self.wait(lambda: next((line for line in self.said[before:] if "clpeel.render" in line), None)))

    def wanted(self) -> NDArray[np.uint8]:
        """The picture that the command makes, uint8 [height, width, 3]."""
        made, saved = self.command().strip().rsplit(".save(", 1)
        assert saved == "'picture.png')"
        return eval(made, {"clpeel": clpeel, "scene": self.scene}).image[..., :3]

    def shown(self, size: tuple[int, int] = SIZE) -> NDArray[np.uint8]:
        """What the window shows, uint8 [height, width, 3]. Without a window manager it is at the top left."""
        return np.asarray(ImageGrab.grab(xdisplay=self.display))[: size[1], : size[0], :3]

    def rest(self, size: tuple[int, int] = SIZE) -> NDArray[np.uint8]:
        """Wait until the window shows the bits of the full picture wherever there is no status. Returns the picture."""
        self.wait(lambda: f"size={size}" in self.command())
        want = self.wanted()
        assert want.shape == (size[1], size[0], 3)
        beside = np.ones(want.shape[:2], bool)
        beside[size[1] // 2 :, :300] = False  # the status is in the lower half, at the left
        self.wait(lambda: (self.shown(size)[beside] == want[beside]).all())
        assert (self.shown(size)[~beside] != want[~beside]).any(), "there is no status"
        return want

    def ended(self) -> int:
        """Wait for the end of the process, and return its code."""
        code = self.process.wait(LONG)
        for thread in self.threads:
            thread.join(LONG)
        return code


@pytest.fixture
def opened(squares: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Callable[..., Window]]:
    """opened() is a window on the display; display="" has none."""
    made: list[Window] = []
    folder = tmp_path / "folder"
    folder.mkdir()

    def new(display: str | None = None, **more: str) -> Window:
        name = request.getfixturevalue("display") if display is None else display
        made.append(Window(name, squares, folder, **more))
        return made[-1]

    yield new
    for each in made:
        each.process.kill()
        each.ended()
        for pipe in (each.process.stdin, each.process.stdout, each.process.stderr):
            assert pipe is not None
            pipe.close()


@needs_glfw
def test_a_window_shows_the_bits_of_render_before_and_after_a_drag_and_saves_them(
    opened: Callable[..., Window],
) -> None:
    shown = opened()
    shown.open()
    before = shown.wanted()
    shown.do("mousemove", 150, 100, "mousedown", 1, "mousemove", 180, 110, "mousemove", 210, 130, "mouseup", 1)
    after = shown.rest()
    assert (after != before).any(axis=-1).mean() > 0.01, "the drag has changed nothing"
    for name in ("clpeel.png", "clpeel-1.png"):
        shown.key("s")
        shown.wait(lambda name=name: f"saved {name}\n" in shown.said)
        assert (np.asarray(Image.open(shown.folder / name)) == after).all()
    assert sorted(os.listdir(shown.folder)) == ["clpeel-1.png", "clpeel.png"]
    assert shown.process.stdin is not None
    shown.process.stdin.write("\n")
    shown.process.stdin.flush()
    assert shown.ended() == 0 and shown.said[-1] == "returned\n"


@needs_glfw
def test_a_click_in_the_panel_changes_the_technique_and_not_the_camera(opened: Callable[..., Window]) -> None:
    shown = opened()
    shown.open()
    before = shown.command()
    shown.key("p")
    view = View(clpeel.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0)), SIZE)
    status = {"settings": settings(view)}
    plate = panel_plate(status, SIZE, 1.0)
    left, top, right, bottom = plate.box([row.name for row in rows_of(status)].index("technique"), 3)
    shown.do("mousemove", (left + right) // 2, (top + bottom) // 2, "mousedown", 1, "mousemove_relative", 9, 60)
    shown.do("mouseup", 1)
    assert shown.command() == before.replace("technique='sort'", "technique='depth-peeling'")
    shown.key("p")
    shown.rest()


@needs_glfw
def test_a_window_can_be_resized_while_the_scene_turns(opened: Callable[..., Window]) -> None:
    shown = opened()
    shown.open()
    shown.key("space")
    number = shown.do("search", "--name", "squares.off")
    for size in ((600, 200), (350, 500), (50, 40), (500, 400)):
        shown.do("windowsize", number, *size)
        before = shown.shown((300, 200))
        shown.wait(lambda before=before: (shown.shown((300, 200)) != before).any())
    shown.key("space")
    shown.rest((500, 400))


@needs_glfw
@pytest.mark.parametrize("key", ("x", "space"), ids=("at rest", "while it turns"))
def test_ctrl_c_closes_the_window(opened: Callable[..., Window], key: str) -> None:
    shown = opened()
    shown.open()
    before = shown.shown()
    shown.key(key)
    shown.wait(lambda: key == "x" or (shown.shown() != before).any())
    shown.process.send_signal(signal.SIGINT)
    assert shown.ended() == 0 and shown.said[-1] == "returned\n"
    assert not any("Traceback" in line or "signal" in line for line in shown.errors)


@needs_glfw
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no DISPLAY")
@pytest.mark.parametrize("display", ("", ":987"))
def test_without_a_display_the_process_says_so_and_goes_on(opened: Callable[..., Window], display: str) -> None:
    told = opened(display)
    assert told.ended() == 0, told.errors
    (line,) = told.said
    assert line.startswith("refused: window: ") and "display" in line.lower() and "--backend browser" in line


@needs_glfw
def test_without_vulkan_the_process_says_so_and_goes_on(opened: Callable[..., Window]) -> None:
    told = opened(VK_DRIVER_FILES="/nowhere", VK_ICD_FILENAMES="/nowhere")
    assert told.ended() == 0, told.errors
    (line,) = told.said
    assert line.startswith("refused: window: ") and "--backend browser" in line


# Looks at the window again and again until it has the bits of `render` beside the status, and closes it then.
QT_CHILD = """
import sys, threading, {qt}.QtWidgets, clpeel, numpy as np
from clpeel.viewer.open import view

scene = clpeel.load(sys.argv[1], opacity=0.5)
want = clpeel.render(scene, clpeel.Camera.frame(scene, aspect=4 / 3), (400, 300), samples=1).image

def look():
    from rendercanvas.qt import loop
    (canvas,) = loop.get_canvases()
    shown = canvas.grab().toImage()
    shown = shown.convertToFormat(shown.Format.Format_RGBA8888)
    got = np.frombuffer(bytes(shown.constBits().asarray(480000) if "{qt}" == "PyQt6" else shown.constBits()), np.uint8)
    if (got.reshape(300, 400, 4)[60:150] == want[60:150]).all():
        print("same")
        canvas.close()
    else:
        loop.call_later(0.1, look)

def begin():
    from rendercanvas.qt import loop
    loop.call_soon_threadsafe(look)

threading.Timer(1, begin).start()
view(scene, backend="window", size=(400, 300))
print("returned")
"""


@pytest.mark.skipif(
    not any(map(find_spec, opening.QT)) or not find_spec("rendercanvas"),
    reason="needs rendercanvas, and PySide6 or PyQt6",
)
def test_on_qt_a_window_shows_the_bits_of_render(squares: Path) -> None:
    qt = next(filter(find_spec, opening.QT))
    command = [sys.executable, "-c", QT_CHILD.format(qt=qt), str(squares)]
    env = os.environ | {"QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=LONG)
    assert done.returncode == 0 and done.stdout == "same\nreturned\n", done.stderr


# --- without a display ------------------------------------------------------------------------------------------------


def test_a_window_that_cannot_be_opened_ends_the_painter(squares: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise RuntimeError("first line\nsecond line")

    monkeypatch.setattr(window, "_opened", fail)
    scene = clpeel.load(squares)
    viewer = Viewer(scene, View(clpeel.Camera.frame(scene), SIZE))
    with pytest.raises(clpeel.InputError, match="^window: .*: first line; try --backend browser$"):
        window.run(viewer, "title", SIZE)
    assert not viewer._painter._thread.is_alive()


def there(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let there be only these packages."""
    for module in (window, opening):
        monkeypatch.setattr(module, "find_spec", lambda name: name if name in names else None)


def test_qt_is_used_if_it_is_imported_or_if_glfw_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "modules", {name: it for name, it in sys.modules.items() if name not in opening.QT})
    there(monkeypatch, "rendercanvas", "glfw", "wgpu", "PySide6", "PyQt6")
    assert chosen_qt() is None
    monkeypatch.setitem(sys.modules, "PyQt6", sys)
    assert chosen_qt() == "PyQt6"
    monkeypatch.delitem(sys.modules, "PyQt6")
    there(monkeypatch, "rendercanvas", "glfw", "PySide6")
    assert chosen_qt() == "PySide6" and opening.missing("window") == []
    there(monkeypatch, "rendercanvas", "glfw")
    assert chosen_qt() is None and opening.missing("window") == ["wgpu"]
    there(monkeypatch, "PySide6")
    assert opening.missing("window") == ["rendercanvas"]


def key(name: str) -> dict[str, Any]:
    return {"event_type": "key_down", "key": name, "modifiers": ("Shift",)}


def char(text: str) -> dict[str, Any]:
    return {"event_type": "char", "data": text, "char_str": text, "modifiers": ()}


def test_a_key_counts_as_what_it_types_on_the_keyboard_that_is_used() -> None:
    found: list[Any] = []
    typed = Typed(found.append)
    # A French keyboard has A where an American one has Q, and types + with a key that glfw calls =.
    for event in (key("Q"), char("a"), key("="), char("+")):
        typed.handle(event)
    assert [event["key"] for event in found] == ["a", "+"]
    assert all(event["event_type"] == "key_down" and not event["modifiers"] for event in found)


def test_a_key_that_is_held_counts_once() -> None:
    found: list[Any] = []
    typed = Typed(found.append)
    for event in (key("s"), char("s"), char("s"), char("s")):
        typed.handle(event)
    assert [event["key"] for event in found] == ["s"]


def test_other_keys_and_the_pointer_pass() -> None:
    found: list[Any] = []
    typed = Typed(found.append)
    events = [key("Escape"), {"event_type": "pointer_move", "x": 1, "y": 2}]
    for event in events:
        typed.handle(event)
    assert found == events
