"""A page of the live view in a real browser, and the server that it comes from, as a user starts both."""

from __future__ import annotations

import base64
import io
import json
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

Pixels = NDArray[np.uint8]
SIZE = (640, 480)
PATIENCE = 60
"""Seconds until something must have happened. They are long, as kernels may be compiled meanwhile."""

WATCH = """
if (window.sent === undefined) {
  window.sent = []; window.received = 0; window.sockets = []; window.violations = []
  document.addEventListener('securitypolicyviolation', (event) => window.violations.push(event.blockedURI))
  window.WebSocket = class extends window.WebSocket {
    constructor (...all) {
      super(...all)
      window.sockets.push(this)
      this.addEventListener('message', (event) => { if (typeof event.data !== 'string') window.received++ })
    }
    send (text) { window.sent.push(JSON.parse(text)); super.send(text) }
  }
}
"""
"""Runs before the page's own scripts, once or more often, and keeps what goes over its socket."""


def needs_browser() -> None:
    """Skip the tests of this module where a package or a program is missing."""
    pytest.importorskip("selenium", reason="needs selenium: pip install 'clpeel[test]'")
    from clpeel.viewer.open import EXTRA, missing

    lacking = missing("browser")
    if lacking:
        pytest.skip(f"needs {' and '.join(lacking)}: {EXTRA}", allow_module_level=True)
    lacking = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    if lacking:
        pytest.skip(f"needs {' and '.join(lacking)}", allow_module_level=True)


# --- the server -------------------------------------------------------------------------------------------------------


@contextmanager
def served(*words: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run `clpeel view WORDS` and yield the address that it prints, and the process. Ctrl-C ends it."""
    command = [sys.executable, "-P", "-u", "-m", "clpeel", "view", *words, "--backend", "browser", "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            assert line.startswith("open http://"), line
            yield line.split()[1], process
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)
        finally:
            process.kill()


def rendered(command: str, folder: Path) -> Pixels:
    """Return the picture that a command line such as "clpeel render part.ply ..." makes, uint8 [h, w, 3 or 4]."""
    from clpeel.command.main import main

    words = shlex.split(command)
    assert words[0] == "clpeel" and words[-2] == "-o"
    path = folder / "rendered.png"
    assert main([*words[1:-1], str(path), "--quiet"]) == 0
    return pixels(path.read_bytes())


def pixels(file: bytes) -> Pixels:
    """Return the pixels of a PNG."""
    with Image.open(io.BytesIO(file)) as image:
        assert image.format == "PNG"
        return np.asarray(image)


# --- the browser ------------------------------------------------------------------------------------------------------


@contextmanager
def browser(*words: str) -> Iterator[Any]:
    """Run a browser without a window, which asks nobody but the server."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for word in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        *words,
    ):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    driver.set_script_timeout(PATIENCE)
    try:
        yield driver
    finally:
        driver.quit()


class Page:
    """The page that the driver shows now."""

    def __init__(self, driver: Any, address: str, size: tuple[int, int] = SIZE) -> None:
        """Open the page, unless the driver shows it already."""
        self.driver = driver
        self.resize(size)
        if driver.current_url != address or self.get("document.body.dataset.connection") != "open":
            self.command("Page.addScriptToEvaluateOnNewDocument", source=WATCH)
            driver.get(address)
        self.wait("document.body.dataset.frame")

    def command(self, name: str, **parameters: Any) -> Any:
        """Give a command of the DevTools protocol."""
        return self.driver.execute_cdp_cmd(name, parameters)

    def resize(self, size: tuple[int, int], ratio: float = 1, mobile: bool = False) -> None:
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=size[0],
            height=size[1],
            deviceScaleFactor=ratio,
            mobile=mobile,
        )

    def minimize(self, away: bool) -> None:
        """Minimize the window, or bring it back."""
        number = self.command("Browser.getWindowForTarget")["windowId"]
        state = "minimized" if away else "normal"
        self.command("Browser.setWindowBounds", windowId=number, bounds={"windowState": state})

    def get(self, expression: str) -> Any:
        """Return the value of an expression of JavaScript."""
        return self.driver.execute_script(f"return {expression}")

    def wait(self, expression: str) -> Any:
        """Wait until an expression of JavaScript is true, and return its value."""
        from selenium.webdriver.support.ui import WebDriverWait

        return WebDriverWait(self.driver, PATIENCE, 0.02).until(lambda _: self.get(expression), expression)

    def find(self, selector: str) -> Any:
        return self.driver.find_element("css selector", selector)

    @property
    def status(self) -> dict[str, Any]:
        """The status of the frame that is shown."""
        return dict(self.get("window.clpeel.status"))

    @property
    def figures(self) -> str:
        """The text at the bottom left."""
        return str(self.find("#figures").text)

    def settle(self) -> bytes:
        """Wait until the picture is lossless, and return its file."""
        found: str = self.driver.execute_async_script("""
            const done = arguments[arguments.length - 1]
            window.clpeel.lossless().then((blob) => {
              const reader = new FileReader()
              reader.onload = () => done(reader.result.split(',')[1])
              reader.readAsDataURL(blob)
            })
        """)
        return base64.b64decode(found)

    def after(self, act: Callable[[], object]) -> bytes:
        """Do what changes the picture, wait until the new one is lossless, and return its file."""
        old = self.status["command"]
        act()
        self.wait(f"window.clpeel.status.command !== {json.dumps(old)}")
        return self.settle()

    # --- what the hand does ---

    def actions(self) -> Any:
        from selenium.webdriver.common.action_chains import ActionChains

        return ActionChains(self.driver, duration=10)

    def press(self, *keys: str) -> None:
        """Press keys, wherever the focus is."""
        self.actions().send_keys(*keys).perform()

    def drag(self, by: tuple[int, int], button: str = "left", held: str = "") -> None:
        """Drag from the middle of the picture, in two steps."""
        from selenium.webdriver.common.actions.mouse_button import MouseButton

        number = {"left": MouseButton.LEFT, "right": MouseButton.RIGHT}[button]
        actions = self.actions()
        pointer, keys = actions.w3c_actions.pointer_action, actions.w3c_actions.key_action
        if held:
            actions.key_down(held)
        actions.move_to_element(self.find("#view"))
        pointer.pointer_down(number)
        keys.pause()  # each device has one action at a time
        for part in (by[0] // 3, by[1] // 3), (by[0] - by[0] // 3, by[1] - by[1] // 3):
            actions.move_by_offset(*part)
        pointer.pointer_up(number)
        keys.pause()
        if held:
            actions.key_up(held)
        actions.perform()

    def wheel(self, dy: int, at: tuple[int, int]) -> None:
        self.command("Input.dispatchMouseEvent", type="mouseWheel", x=at[0], y=at[1], deltaX=0, deltaY=dy)

    def touch(self, kind: str, *fingers: tuple[float, float]) -> None:
        """Put down, move or lift fingers: kind is "Start", "Move" or "End", and fingers are those on the screen."""
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(fingers)]
        self.command("Input.dispatchTouchEvent", type=f"touch{kind}", touchPoints=points)

    def choose(self, name: str, choice: object) -> None:
        """Choose from a list of the panel."""
        from selenium.webdriver.support.ui import Select

        Select(self.find(f"#set-{name}")).select_by_value(json.dumps(choice))

    def set(self, name: str, value: object) -> None:
        """Set a slider or a colour of the panel."""
        self.driver.execute_script(
            "const [it, value] = arguments; it.value = value;"
            "for (const type of ['input', 'change']) it.dispatchEvent(new Event(type, {bubbles: true}))",
            self.find(f"#set-{name}"),
            value,
        )

    def enter(self, name: str, text: str) -> None:
        """Type into a field of the panel, in place of what is there."""
        from selenium.webdriver.common.keys import Keys

        self.find(f"#set-{name}").send_keys(Keys.CONTROL, "a", Keys.NULL, Keys.DELETE, text, Keys.ENTER)
