"""The notebook: the widget by the messages that a notebook sends, and in JupyterLab itself."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Awaitable, Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from numpy.typing import NDArray
from PIL import Image

import clpeel
from clpeel.viewer import notebook
from clpeel.viewer.overlay import status_plate
from clpeel.viewer.status import LABELS, lines_of, settings
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

SIZE = (320, 240)
LONG = 60.0
"""Seconds after which a test gives up to wait."""

needs_widgets = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("rendercanvas", "anywidget", "ipywidgets", "simplejpeg")),
    reason="needs rendercanvas, anywidget and simplejpeg",
)


@pytest.fixture
def scene(squares: Path) -> clpeel.Scene:
    return clpeel.load(squares, opacity=0.5)


# --- a notebook that is not there -------------------------------------------------------------------------------------


class Wire:
    """What a kernel sends to a notebook: the widgets' messages, by the widget's number."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        import comm
        from comm.base_comm import BaseComm

        wire = self
        self.sent: list[tuple[str, dict[str, Any], list[bytes]]] = []

        class Recorded(BaseComm):
            def publish_msg(
                self, msg_type: str, data: Any = None, metadata: Any = None, buffers: Any = None, **more: Any
            ) -> None:
                if msg_type == "comm_msg":
                    wire.sent.append((self.comm_id, data, list(buffers or ())))

        monkeypatch.setattr(comm, "create_comm", Recorded)


class Page:
    """A notebook's page that shows a widget: it answers as renderview-afm.js does."""

    def __init__(self, viewer: Viewer, wire: Wire) -> None:
        self.viewer, self.wire = viewer, wire
        self.widget: Any = notebook.widget(viewer, SIZE)
        row, self.said = self.widget.children
        self.canvas, self.panel = row.children
        self.number = self.canvas.model_id
        self.confirms = True
        self.confirmed = 0

    def send(self, widget: Any, data: dict[str, Any]) -> None:
        widget.comm.handle_msg({"content": {"data": data}, "buffers": []})

    def event(self, kind: str, **more: Any) -> None:
        self.send(self.canvas, {"method": "custom", "content": {"type": kind, "timestamp": 0.0, **more}})

    def pointer(self, kind: str, x: float, y: float, buttons: list[int]) -> None:
        self.event(kind, x=x, y=y, button=1, buttons=buttons, modifiers=[], ntouches=0, touches={})

    def key(self, key: str) -> None:
        self.event("key_down", key=key, modifiers=[])

    def change(self, name: str, **state: Any) -> None:
        """Change the widget of a setting, as the user does."""
        names = list(LABELS)
        self.send(self.panel.children[names.index(name)], {"method": "update", "state": state})

    def show(self, ratio: float = 1.0) -> None:
        """Show the widget on the page."""
        self.send(self.canvas, {"method": "update", "state": {"_has_visible_views": True}})
        width, height = SIZE
        size = {"width": width, "height": height, "pwidth": round(width * ratio), "pheight": round(height * ratio)}
        self.event("resize", ratio=ratio, **size)

    @property
    def frames(self) -> list[tuple[dict[str, Any], bytes]]:
        """All frames that came, and their files."""
        contents = [(data.get("content", {}), files) for comm, data, files in self.wire.sent if comm == self.number]
        return [(content, files[0]) for content, files in contents if content.get("type") == "framebufferdata"]

    def confirm(self) -> None:
        """Say that all frames were seen."""
        if self.canvas.comm is not None and self.confirms and len(self.frames) > self.confirmed:
            self.confirmed = len(self.frames)
            last = self.frames[-1][0]
            feedback = {"index": last["index"], "timestamp": last["timestamp"], "localtime": time.time()}
            self.send(self.canvas, {"method": "update", "state": {"_frame_feedback": feedback}})

    async def wait(self, until: Callable[[], Any]) -> Any:
        """Wait until something is so, and return it. Frames are confirmed meanwhile."""
        for _ in range(int(LONG / 0.02)):
            self.confirm()
            if found := until():
                return found
            await asyncio.sleep(0.02)
        pytest.fail("this never came")

    async def rest(self) -> NDArray[np.uint8]:
        """Wait for a lossless frame of the view, and return it as uint8 [height, width, 3].

        It is one that nothing follows for as long as rendercanvas takes between a draft and the same without loss.
        """
        seen, since = 0, time.monotonic()

        def lossless() -> bool:
            nonlocal seen, since
            if len(self.frames) != seen:
                seen, since = len(self.frames), time.monotonic()
            frame = self.viewer._frame
            full = frame is not None and frame.full and frame.view is self.viewer.view
            still = time.monotonic() - since > 0.5
            return full and still and bool(self.frames) and self.frames[-1][0]["mimetype"] == "image/png"

        await self.wait(lossless)
        return np.asarray(Image.open(io.BytesIO(self.frames[-1][1])))


@pytest.fixture
def played(scene: clpeel.Scene, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """played(play) plays a scene on a page."""
    pytest.importorskip("anywidget")
    wire = Wire(monkeypatch)

    def run(play: Callable[[Page], Awaitable[None]], **more: Any) -> None:
        async def whole() -> None:
            view = View(clpeel.Camera.frame(scene, aspect=4 / 3), SIZE, **more)
            page = Page(Viewer(scene, view), wire)
            try:
                await play(page)
            finally:
                page.widget.close()
                page.viewer.close()

        asyncio.run(whole())

    return run


def uncovered(page: Page, shape: tuple[int, ...], ratio: float) -> NDArray[np.bool_]:
    """Where there is no status, [height, width]."""
    frame = page.viewer._frame
    assert frame is not None
    lines = lines_of(page.viewer._status(frame))
    plate = status_plate(lines, (shape[1], shape[0]), ratio)
    free = np.ones(shape[:2], bool)
    free[plate.top : plate.top + plate.height, plate.left : plate.left + plate.width] = False
    return free


@needs_widgets
@pytest.mark.parametrize("ratio", (1.0, 2.0))
def test_at_rest_a_notebook_gets_the_bits_of_render(
    played: Callable[..., None], scene: clpeel.Scene, ratio: float
) -> None:
    async def play(page: Page) -> None:
        page.show(ratio)
        page.key("x")
        shown = await page.rest()
        size = round(SIZE[0] * ratio), round(SIZE[1] * ratio)
        want = plainly.render(scene, page.viewer.view.camera, size, lighting="kit").image[..., :3]
        free = uncovered(page, want.shape, ratio)
        assert shown.shape == want.shape
        assert (shown[free] == want[free]).all() and (shown[~free] != want[~free]).any()

    played(play)


@needs_widgets
def test_a_drag_rotates_the_scene_while_frames_come(played: Callable[..., None]) -> None:
    async def play(page: Page) -> None:
        page.show()
        before = await page.rest()
        camera, count = page.viewer.view.camera, len(page.frames)
        page.pointer("pointer_down", 100, 100, [1])
        for step in range(1, 6):
            page.pointer("pointer_move", 100 + 20 * step, 100 + 5 * step, [1])
            await page.wait(lambda count=count, step=step: len(page.frames) >= count + step)
        page.pointer("pointer_up", 200, 125, [])
        assert (await page.rest() != before).any()
        assert page.viewer.view.camera != camera

    played(play)


@needs_widgets
def test_frames_that_nobody_confirms_or_sees_are_not_drawn(played: Callable[..., None]) -> None:
    async def play(page: Page) -> None:
        page.show()
        await page.wait(lambda: len(page.frames) >= 3)
        page.confirms = False
        await asyncio.sleep(0.5)
        count, frame = len(page.frames), page.viewer._frame
        await asyncio.sleep(0.5)
        assert len(page.frames) == count and page.viewer._frame is frame, "the painter goes on for nobody"
        page.confirms = True
        await page.wait(lambda: len(page.frames) >= count + 3)
        page.send(page.canvas, {"method": "update", "state": {"_has_visible_views": False}})
        await asyncio.sleep(0.5)
        frame = page.viewer._frame
        await asyncio.sleep(0.5)
        assert page.viewer._frame is frame, "the painter goes on while the widget is out of sight"

    played(play, turning=True)


@needs_widgets
def test_widgets_of_settings_go_to_the_viewer_and_follow_it(played: Callable[..., None]) -> None:
    async def play(page: Page) -> None:
        page.show()
        await page.rest()
        widgets = dict(zip(LABELS, page.panel.children, strict=True))
        techniques = widgets["technique"].options
        page.change("technique", index=techniques.index("multi-layer-peeling"))
        assert page.viewer.view.technique == "multi-layer-peeling"
        page.change("opacity", index=widgets["opacity"].options.index("0.30"))
        page.change("layers_per_pass", value=4)
        page.change("passes", value=2)
        page.change("max_error", index=widgets["max_error"].options.index("1/255"))
        page.change("background", index=widgets["background"].options.index("transparent"))
        page.change("orthographic", value=True)
        values = settings(page.viewer.view)
        assert (values["opacity"], values["layers_per_pass"], values["passes"]) == (0.3, 4, 2)
        assert (values["max_error"], values["background"], values["orthographic"]) == (1 / 255, None, True)
        page.change("passes", value=0)
        assert "passes" not in page.viewer.view.options
        page.key("7")
        await page.wait(lambda: widgets["technique"].value == "sort")
        assert widgets["passes"].disabled and not widgets["precision"].disabled
        page.viewer.set("background", [0.2, 0.4, 0.6])
        page.viewer.set("opacity", 0.33)
        await page.wait(lambda: widgets["background"].value == "#336699" and widgets["opacity"].value == "0.33")
        assert list(widgets["opacity"].options)[7:9] == ["0.30", "0.33"]
        page.key("r")
        await page.wait(lambda: widgets["opacity"].value == "scene's" and not widgets["orthographic"].value)

    played(play)


@needs_widgets
def test_a_value_that_is_refused_goes_back(played: Callable[..., None]) -> None:
    async def play(page: Page) -> None:
        page.show()
        await page.rest()
        widgets = dict(zip(LABELS, page.panel.children, strict=True))
        page.change("technique", index=widgets["technique"].options.index("auto"))
        page.change("execution", index=1)
        assert page.viewer.view.options.get("execution") is None and widgets["execution"].value == "tiles"
        assert page.viewer._notice.startswith("execution: ")

    played(play)


@needs_widgets
def test_widgets_and_viewer_do_not_call_each_other_in_circles(played: Callable[..., None]) -> None:
    async def play(page: Page) -> None:
        page.show()
        await page.rest()
        panel = {each.model_id for each in page.panel.children}
        before, changes = len(page.wire.sent), []
        change = page.viewer._change
        page.viewer._change = lambda *a, **k: (changes.append(a), change(*a, **k))[1]  # type: ignore[method-assign]
        slider = dict(zip(LABELS, page.panel.children, strict=True))["opacity"]
        for step in (4, 5, 6):
            page.change("opacity", index=step)
        await page.rest()
        assert len(changes) == 3 and page.viewer.view.opacity == 0.25 and slider.value == "0.25"
        states = [data["state"] for number, data, _ in page.wire.sent[before:] if number in panel]
        assert not any("index" in state and state["index"] not in (4, 5, 6) for state in states)

    played(play)


@needs_widgets
def test_the_command_and_the_saved_file_are_told_below_the_picture(
    played: Callable[..., None], scene: clpeel.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def play(page: Page) -> None:
        page.show()
        await page.rest()
        page.key("c")
        await page.wait(lambda: "clpeel.render(scene" in page.said.value)
        assert "&#x27;kit&#x27;" in page.said.value, "the text is not escaped"
        page.key("s")
        await page.wait(lambda: "saved clpeel.png" in page.said.value)
        want = plainly.render(scene, page.viewer.view.camera, SIZE, lighting="kit").image
        assert (np.asarray(Image.open("clpeel.png")) == want[..., :3]).all()

    played(play)


@needs_widgets
def test_p_hides_the_widgets_and_shows_them_again(played: Callable[..., None]) -> None:
    async def play(page: Page) -> None:
        page.show()
        await page.rest()
        for display in ("none", None):
            page.key("p")
            await page.wait(lambda display=display: page.panel.layout.display == display)

    played(play)


@needs_widgets
@pytest.mark.parametrize("who", ("widget", "canvas", "page"))
def test_closing_ends_the_painter(played: Callable[..., None], who: str) -> None:
    async def play(page: Page) -> None:
        page.show()
        await page.rest()
        if who == "page":
            page.event("close")
        else:
            getattr(page, who).close()
        painter = page.viewer._painter._thread
        await page.wait(lambda: not painter.is_alive())

    played(play)


# --- what a notebook shows of scenes and results ----------------------------------------------------------------------


def decoded(data: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(data)))


def test_a_result_is_shown_as_its_picture(scene: clpeel.Scene) -> None:
    result = plainly.render(scene, size=(40, 30), background=None)
    assert (decoded(result._repr_png_()) == result.image).all()


def test_outside_of_notebooks_a_scene_is_its_text(scene: clpeel.Scene) -> None:
    assert scene._repr_mimebundle_() is None


@needs_widgets
def test_in_a_notebook_a_scene_is_a_live_widget_and_a_picture_where_no_widgets_are(
    scene: clpeel.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    Wire(monkeypatch)
    monkeypatch.setattr(notebook, "in_notebook", lambda: True)
    made: list[Any] = []
    widget = notebook.widget
    monkeypatch.setattr(notebook, "widget", lambda *arguments: (made.append(widget(*arguments)), made[-1])[1])

    async def show() -> dict[str, Any]:
        found = scene._repr_mimebundle_()
        made[0].close()
        assert found is not None
        return found

    found = asyncio.run(show())
    assert found["text/plain"] == repr(scene)
    assert found["application/vnd.jupyter.widget-view+json"]["model_id"]
    want = clpeel.render(scene, clpeel.Camera.frame(scene, aspect=4 / 3), notebook.SIZE).image
    assert (decoded(base64.b64decode(found["image/png"])) == want[..., :3]).all()


def test_in_a_notebook_without_widgets_a_scene_is_a_picture(
    scene: clpeel.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notebook, "in_notebook", lambda: True)
    monkeypatch.setattr(notebook, "missing", lambda backend: ["anywidget"])
    found = scene._repr_mimebundle_()
    assert found is not None and set(found) == {"text/plain", "image/png"}


def test_in_a_notebook_without_a_device_a_scene_is_its_text_and_the_reason(
    scene: clpeel.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: object) -> None:
        raise clpeel.NoDeviceError("there is no device")

    monkeypatch.setattr(notebook, "in_notebook", lambda: True)
    monkeypatch.setattr(notebook, "Viewer", refuse)
    assert scene._repr_mimebundle_() == {"text/plain": f"{scene!r}\nno picture: there is no device"}


def test_importing_clpeel_imports_nothing_of_the_viewer() -> None:
    code = "import sys, clpeel; clpeel.Scene; clpeel.Result; print([name for name in sys.modules if 'viewer' in name])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


# --- JupyterLab itself ------------------------------------------------------------------------------------------------

CELLS = (
    "import clpeel\nscene = clpeel.load({path!r}, opacity=0.5)",
    "scene",
    "clpeel.render(scene, size=(40, 30))",
)

IMAGE = ".renderview-wrapper img"
"""Where the widget shows its picture."""

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1400,1200",
)

# Gives the file that an image shows, as text.
FETCH = """
const done = arguments[1]
fetch(arguments[0].src).then(it => it.blob()).then(it => {
  const reader = new FileReader()
  reader.onload = () => done(reader.result)
  reader.readAsDataURL(it)
}).catch(() => done(""))
"""


@pytest.fixture
def lab(squares: Path, tmp_path: Path) -> Iterator[str]:
    """The address of a notebook in JupyterLab, whose last cells show a scene and a picture."""
    cells = [
        {
            "cell_type": "code",
            "id": f"c{number}",
            "execution_count": None,
            "metadata": {},
            "outputs": [],
            "source": text,
        }
        for number, text in enumerate(each.format(path=str(squares)) for each in CELLS)
    ]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "scene.ipynb").write_text(json.dumps(whole))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    own = {f"JUPYTER_{name}_DIR": str(tmp_path / name) for name in ("CONFIG", "DATA", "RUNTIME")}
    command = [sys.executable, "-m", "jupyterlab", "--allow-root", "--no-browser", f"--port={port}"]
    command += [f"--ServerApp.root_dir={folder}", "--IdentityProvider.token=secret", "--LabApp.news_url="]
    with (
        (tmp_path / "log").open("w") as log,
        subprocess.Popen(command, env=os.environ | own, stdout=log, stderr=log) as server,
    ):
        try:
            for _ in range(int(LONG)):
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/api?token=secret").close()
                    break
                except OSError:
                    time.sleep(1)
            yield f"http://127.0.0.1:{port}/lab/tree/scene.ipynb?token=secret&reset"
        finally:
            server.terminate()


@pytest.mark.skipif(find_spec("jupyterlab") is None, reason="needs jupyterlab")
@pytest.mark.skipif(find_spec("selenium") is None or not (CHROMIUM and DRIVER), reason="needs selenium and chromium")
@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@needs_widgets
def test_in_jupyterlab_the_last_line_of_a_cell_is_a_live_scene(lab: str, scene: clpeel.Scene) -> None:
    from selenium import webdriver
    from selenium.common.exceptions import WebDriverException
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for flag in FLAGS:
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))

    def wait(until: Callable[[], Any]) -> Any:
        end = time.monotonic() + LONG
        while time.monotonic() < end:
            if found := until():
                return found
            time.sleep(0.2)
        pytest.fail("this never came")

    def find(selector: str) -> Any:
        return wait(lambda: driver.find_elements("css selector", selector))[0]

    def ran(number: int) -> bool:
        """Run a cell, if the page and its kernel are ready for that."""
        try:
            cell = driver.find_elements("css selector", ".jp-CodeCell")[number]
            cell.find_element("css selector", ".cm-content").click()
            ActionChains(driver).key_down(Keys.SHIFT).send_keys(Keys.ENTER).key_up(Keys.SHIFT).perform()
            time.sleep(1)
            return any(digit in cell.find_element("css selector", ".jp-InputPrompt").text for digit in "*123456789")
        except (IndexError, WebDriverException):
            return False

    def command() -> str:
        """What the key C tells below the picture; perhaps still what it told before."""
        ActionChains(driver).move_to_element(find(IMAGE)).click().send_keys("c").perform()
        time.sleep(0.5)
        told = driver.find_elements("css selector", ".widget-html code")
        return told[0].text if told else ""

    def rest(but: str = "") -> str:
        """Wait until the picture has the bits of `render` beside the status. Returns its command, other than `but`."""

        def same() -> str:
            told = command()
            kind, _, text = driver.execute_async_script(FETCH, find(IMAGE)).partition(",")
            if told in ("", but) or "png" not in kind:
                return ""
            want = eval(told.rsplit(".save(", 1)[0], {"clpeel": clpeel, "scene": scene}).image[..., :3]
            got = decoded(base64.b64decode(text))
            beside = np.ones(want.shape[:2], bool)
            beside[want.shape[0] // 2 :, : want.shape[1] * 3 // 4] = False
            return told if got.shape == want.shape and (got[beside] == want[beside]).all() else ""

        return str(wait(same))

    try:
        driver.set_script_timeout(LONG)
        driver.get(lab)
        for number in range(len(CELLS)):
            wait(lambda number=number: ran(number))
        wait(lambda: driver.find_elements("css selector", ".jp-RenderedImage img"))
        image = find(IMAGE)
        driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", image)
        wait(lambda: image.get_attribute("src").startswith("blob:"))
        before = rest()
        drag = ActionChains(driver).move_to_element(image).click_and_hold()
        drag.move_by_offset(60, 10).move_by_offset(60, 20).release().perform()
        after = rest(but=before)
        assert after.partition("technique")[0] != before.partition("technique")[0], "the camera is where it was"
        Select(find(".widget-dropdown select")).select_by_visible_text("depth-peeling")
        assert rest(but=after) == after.replace("technique='sort'", "technique='depth-peeling'")
    finally:
        driver.quit()
