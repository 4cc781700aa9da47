"""A headless Chromium that opens a page, drags the mouse over its picture, and tells what the page recorded."""

from __future__ import annotations

import json
import math
import shutil
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

from benchmark.runs import Failed, Skipped, Values

NAMES = "chromium", "chromium-browser", "google-chrome", "chrome"
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
RECORDER = Path(__file__).with_name("recorder.js")

EVENTS = 60
"""Moves of the mouse in a second."""

ROUND = 3.0
"""Seconds in which the mouse goes round its circle."""

RADIUS = 0.3
"""Of that circle, in heights of the picture."""

PATIENCE = 240.0
"""Seconds after which a page that shows nothing has failed."""

LAST_ANSWER = 60.0
"""Seconds after a drag after which no answer is waited for any more."""

FIT = """
const [picture, width, height] = [document.querySelector(arguments[0]), arguments[1], arguments[2]]
for (const [name, value] of [['width', `${width}px`], ['height', `${height}px`], ['max-width', 'none'],
  ['max-height', 'none']]) picture.style.setProperty(name, value, 'important')
"""
"""Gives the picture a size, if its page does not."""

COVERED = """
const [picture, places] = [document.querySelector(arguments[0]), arguments[1]]
return places.some(([x, y]) => document.elementFromPoint(x, y) !== picture)
"""

Place = tuple[float, float]


class Browser:
    """Chromium with one page. Raises Skipped if there is none."""

    def __init__(self) -> None:
        try:
            from selenium import webdriver
            from selenium.common.exceptions import WebDriverException
            from websockets.exceptions import WebSocketException
        except ImportError as error:
            raise Skipped(f"{error.name} is not installed (pip install '.[test,view]')") from None
        binary = next(filter(None, map(shutil.which, NAMES)), None)
        if binary is None:
            raise Skipped("no Chromium is installed")
        options = webdriver.ChromeOptions()
        options.binary_location = binary
        for flag in FLAGS:
            options.add_argument(flag)
        self._errors = (WebDriverException, WebSocketException, OSError)
        try:
            self._driver = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
        except WebDriverException as error:
            raise Skipped(f"Chromium does not start: {first_line(error)}") from None
        self.version = str(self._driver.capabilities["browserVersion"])
        self._call("Page.addScriptToEvaluateOnNewDocument", source=RECORDER.read_text("utf-8"))
        self._call("Emulation.setScrollbarsHidden", hidden=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._driver.quit()

    def _call(self, method: str, **parameters: Any) -> None:
        self._driver.execute_cdp_cmd(method, parameters)

    def visit(
        self,
        address: str,
        picture: str,
        size: tuple[int, int],
        seconds: float,
        each_second: Callable[[], None] = lambda: None,
    ) -> Values:
        """Open a page, drag the mouse over its picture, and return what recorder.js wrote down.

        picture: its element, as a CSS selector. size: that it is given, (width, height) in pixels. each_second: called
        once a second meanwhile. Besides recorder.js's lists there is "until": the time when it was waited no longer.
        Raises Failed if there is no such picture.
        """
        try:
            self._open(address, picture, size)
            self._drag(seconds, each_second)
            found: Values = self._driver.execute_script("return {...recorder, until: performance.now()}")
            self._driver.get("about:blank")
        except self._errors as error:
            raise Failed(first_line(error)) from None
        return found

    # --- a page -------------------------------------------------------------------------------------------------------

    def _open(self, address: str, picture: str, size: tuple[int, int]) -> None:
        """Open a page, give its picture a size, and wait until it is shown and nothing more comes."""
        self._view(size)
        self._driver.get(address)
        self._wait(self._is_settled)
        box = self._box(picture)
        self._view((size[0] + round(size[0] - box[2]), size[1] + round(size[1] - box[3])))
        if self._box(picture)[2:] != size:
            self._driver.execute_script(FIT, picture, *size)
        self._wait(lambda: self._is_settled() and self._newest_size() == size)
        left, top, width, height = self._box(picture)
        self._middle, self._radius = (left + width / 2, top + height / 2), RADIUS * height
        places = [self._place(step / EVENTS) for step in range(round(ROUND * EVENTS))]
        if self._driver.execute_script(COVERED, picture, places):
            raise Failed("something covers the picture of the page")

    def _view(self, size: tuple[int, int]) -> None:
        self._call(
            "Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False
        )

    def _box(self, picture: str) -> tuple[float, float, float, float]:
        """Return the left, top, width and height of the picture on the page."""
        script = "const {x, y, width, height} = document.querySelector(arguments[0]).getBoundingClientRect();"
        x, y, width, height = self._driver.execute_script(f"{script} return [x, y, width, height]", picture)
        return x, y, width, height

    def _wait(self, is_true: Callable[[], object]) -> None:
        until = time.monotonic() + PATIENCE
        while not is_true():
            if time.monotonic() > until:
                raise Failed(f"the page shows no picture of the right size within {PATIENCE:g} s")
            time.sleep(0.1)

    def _is_settled(self) -> bool:
        """Return whether a picture at rest is shown, and nothing has come since for the time of three of them."""
        last, now = self._driver.execute_script("return [recorder.frames.at(-1) ?? null, performance.now()]")
        return bool(last and last["settled"] and now - last["decoded"] > 500 + 3 * last["milliseconds"])

    def _newest_size(self) -> tuple[int, int]:
        width, height = self._driver.execute_script(
            "const {width, height} = recorder.frames.at(-1); return [width, height]"
        )
        return width, height

    # --- a drag -------------------------------------------------------------------------------------------------------

    def _place(self, seconds: float) -> Place:
        angle = 2 * math.pi * seconds / ROUND
        return self._middle[0] + self._radius * math.cos(angle), self._middle[1] + self._radius * math.sin(angle)

    def _drag(self, seconds: float, each_second: Callable[[], None]) -> None:
        """Drag the mouse round the picture's middle, whether the page keeps up or not."""
        from websockets.sync.client import connect

        host = self._driver.capabilities["goog:chromeOptions"]["debuggerAddress"]
        with urllib.request.urlopen(f"http://{host}/json") as answer:
            page = next(each for each in json.load(answer) if each["type"] == "page")
        with connect(page["webSocketDebuggerUrl"], max_size=None) as socket:

            def mouse(kind: str, place: Place, number: int) -> None:
                """Send an event, and drop the answers to earlier ones. They come when the page has taken the event."""
                event = {"type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1}
                event["buttons"] = int(kind != "mouseReleased")
                socket.send(json.dumps({"id": number, "method": "Input.dispatchMouseEvent", "params": event}))
                while True:
                    try:
                        socket.recv(timeout=0)
                    except TimeoutError:
                        return

            began, count = time.monotonic(), round(seconds * EVENTS)
            mouse("mousePressed", self._place(0), 0)
            for number in range(1, count + 1):
                time.sleep(max(began + number / EVENTS - time.monotonic(), 0))
                mouse("mouseMoved", self._place(number / EVENTS), number)
                if number % EVENTS == 0:
                    each_second()
            mouse("mouseReleased", self._place(count / EVENTS), count + 1)
            self._settle()

    def _settle(self) -> None:
        """Wait until the last event is answered and the picture at rest has come, but not forever.

        The last message may change nothing, and so needs no picture of its own.
        """
        until = time.monotonic() + LAST_ANSWER
        script = "return [recorder.messages.at(-1), recorder.frames.at(-1), performance.now()]"
        while time.monotonic() < until:
            message, last, now = self._driver.execute_script(script)
            nothing_comes = now - max(message["at"], last["decoded"]) > 1000 + 3 * last["milliseconds"]
            if last["settled"] and (last["answers"] >= message["clock"] or nothing_comes):
                return
            time.sleep(0.1)


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, or its kind."""
    return next(iter(str(error).splitlines()), "") or type(error).__name__
