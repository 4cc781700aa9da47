"""The page of the live view, in a real browser: what it shows is what `clpeel render` makes, whatever the hand did."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from viewer.pages import SIZE, Page, Pixels, browser, needs_browser, pixels, rendered, served

needs_browser()
from selenium.common.exceptions import WebDriverException  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

KEY_A = {"key": "a", "code": "KeyA", "windowsVirtualKeyCode": 65}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[tuple[str, Any]]:
    """Three spheres, one inside another and one beside them, so that every way to look at them is different."""
    spheres = [trimesh.creation.icosphere(subdivisions=2, radius=radius) for radius in (1.0, 0.6, 0.4)]
    spheres[1].apply_translation((0.2, 0.1, 0))
    spheres[2].apply_translation((1.2, 0.5, 0.3))
    path = folder / "spheres.ply"
    trimesh.util.concatenate(spheres).export(path)
    with served(str(path), "--opacity=0.4", "--background-color=0.9,0.95,1") as (address, process):
        yield address, process


@pytest.fixture(scope="module")
def driver(folder: Path) -> Iterator[Any]:
    with browser() as found:
        found.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(folder)})
        yield found


@pytest.fixture
def page(driver: Any, server: tuple[str, Any]) -> Iterator[Page]:
    """The page as it is first seen. At the end, it must have got along without an error, and with nobody else."""
    found = Page(driver, server[0])
    found.wait("document.body.dataset.steering === 'true'")
    driver.execute_script(
        "for (const each of document.querySelectorAll('dialog[open]')) each.close();"
        "document.getElementById('notice').hidden = true; document.activeElement.blur()"
    )
    found.press("r", *("p" if found.find("#panel").is_displayed() else ""))
    found.settle()
    driver.execute_script("window.sent.length = 0")
    yield found
    errors = [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]
    assert not errors and not found.get("window.violations")
    names = found.get("performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert [name for name in names if not name.startswith((server[0], "blob:", "data:"))] == []


@pytest.fixture
def is_rendered(page: Page, folder: Path) -> Callable[[bytes], Pixels]:
    """Asserts that a file has the very bits that the status's command makes. Returns them."""

    def check(file: bytes) -> Pixels:
        got = pixels(file)
        assert np.array_equal(got, rendered(page.status["command"], folder))
        return got

    return check


# --- the picture ------------------------------------------------------------------------------------------------------


def test_the_picture_fills_the_window_and_is_the_one_that_render_makes(page: Page, is_rendered: Any) -> None:
    picture = is_rendered(page.settle())
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    assert page.get("[innerWidth, innerHeight]") == list(SIZE)
    box = page.get("document.getElementById('view').getBoundingClientRect()")
    assert (box["x"], box["y"], box["width"], box["height"]) == (0, 0, *SIZE)
    assert (
        page.get("({...document.body.dataset})").items()
        >= {
            "lossless": "true",
            "full": "true",
            "steering": "true",
            "technique": "sort",
            "connection": "open",
        }.items()
    )
    assert "lossless" in page.figures and "640 × 480" in page.figures


def test_each_frame_is_confirmed_once_and_in_order(page: Page) -> None:
    page.drag((200, 100))
    page.settle()
    confirmed = page.get("window.sent.filter((each) => each.type === '_framefeedback').map((each) => each.index)")
    assert len(confirmed) > 1 and confirmed == sorted(set(confirmed))
    assert confirmed[-1] == page.get("window.received") == int(page.get("document.body.dataset.frame"))


def test_the_picture_follows_the_size_of_the_window(page: Page, is_rendered: Any) -> None:
    for size in (500, 400), (301, 455):
        assert is_rendered(page.after(lambda size=size: page.resize(size))).shape == (size[1], size[0], 3)


def test_the_picture_has_the_pixels_of_the_device(page: Page, is_rendered: Any) -> None:
    assert is_rendered(page.after(lambda: page.resize((300, 200), ratio=2))).shape == (400, 600, 3)
    assert is_rendered(page.after(lambda: page.resize((400, 300), ratio=1.25))).shape == (375, 500, 3)


def test_reloading_the_page_shows_the_same(page: Page, is_rendered: Any) -> None:
    page.press("2")
    before = pixels(page.after(lambda: page.drag((90, 20))))
    page.driver.refresh()
    page.wait("window.clpeel?.status && document.body.dataset.steering === 'true'")
    assert np.array_equal(is_rendered(page.settle()), before)


# --- the mouse --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("button", "held"), [("left", ""), ("left", Keys.CONTROL), ("left", Keys.SHIFT), ("right", "")]
)
def test_a_drag_moves_the_scene(page: Page, is_rendered: Any, button: str, held: str) -> None:
    before = pixels(page.settle())
    after = is_rendered(page.after(lambda: page.drag((60, 45), button, held)))
    assert not np.array_equal(before, after)
    if held == Keys.CONTROL or button == "right":  # what is in the middle of the scene follows the hand exactly
        assert np.abs(np.subtract(middle(after), middle(before)) - (60, 45)).max() < 3


def middle(picture: Pixels) -> tuple[float, float]:
    """Return the mean place, (x, y), of what is not background."""
    rows, columns = np.nonzero((picture != picture[0, 0]).any(axis=-1))
    return float(columns.mean()), float(rows.mean())


def extent(picture: Pixels) -> float:
    """Return how many pixels from left to right are not background."""
    return float(np.ptp(np.nonzero((picture != picture[0, 0]).any(axis=-1))[1]))


def test_a_drag_there_and_back_leaves_the_scene_as_it_was(page: Page) -> None:
    before = page.status["command"]
    page.after(lambda: page.drag((60, 0), held=Keys.CONTROL))
    page.after(lambda: page.drag((-60, 0), held=Keys.CONTROL))
    assert [round(each, 9) for each in numbers(page.status["command"])] == [round(each, 9) for each in numbers(before)]


def numbers(command: str) -> list[float]:
    (position,) = [word for word in command.split() if word.startswith("--camera-position=")]
    return [float(each) for each in position.partition("=")[2].split(",")]


def test_the_wheel_zooms_without_a_click_before(page: Page, is_rendered: Any) -> None:
    before = pixels(page.settle())
    after = is_rendered(page.after(lambda: page.wheel(-100, (320, 240))))
    assert extent(after) / extent(before) == pytest.approx(1.0015**100, rel=0.05)


def test_the_wheel_zooms_while_a_field_of_the_panel_has_the_focus(page: Page) -> None:
    page.press("p")
    page.find("#set-samples").send_keys(Keys.TAB)
    page.after(lambda: page.wheel(100, (100, 100)))


def test_a_double_click_looks_at_what_is_there(page: Page, is_rendered: Any) -> None:
    at = page.find("#view")
    page.after(lambda: page.actions().move_to_element_with_offset(at, 40, 30).double_click().perform())
    is_rendered(page.settle())


def test_a_double_click_on_nothing_says_so(page: Page) -> None:
    page.actions().move_to_element_with_offset(page.find("#view"), -310, -20).double_click().perform()
    page.wait("!document.getElementById('notice').hidden")
    assert page.find("#notice").text == "nothing is under the pointer"


# --- keys -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "shown"),
    [
        ("1", ["dual-depth-peeling", "occlusion query on"]),
        ("2", ["depth-peeling", "occlusion query on"]),
        ("3", ["weighted-average"]),
        ("0", ["chosen by auto"]),
        ("2q", ["occlusion query off"]),
        ("2--", ["depth-peeling"]),
        ("5[", ["multi-layer-peeling"]),
        ("a", ["opacity 0.35"]),
        ("dd", ["opacity 0.50"]),
        ("m", ["heat map of layers"]),
        ("o", []),
        ("b", []),
        ("l", []),
    ],
)
def test_keys_do_what_the_help_says(page: Page, is_rendered: Any, keys: str, shown: list[str]) -> None:
    before = page.status["command"]
    page.press(*keys)
    file = page.settle()
    assert page.status["command"] != before
    assert all(text in page.figures.replace("\n", " ") for text in shown)
    is_rendered(file)


def test_r_shows_the_first_view(page: Page) -> None:
    before = page.status["command"]
    page.press("2", "a", "b")
    page.drag((50, 20))
    page.settle()
    page.press("r")
    page.settle()
    assert page.status["command"] == before


def test_m_twice_shows_the_errors(page: Page) -> None:
    page.press("3", "m", "m")
    page.settle()
    assert "heat map of errors" in page.figures and "RMS" in page.figures


def test_space_turns_the_scene(page: Page) -> None:
    page.press(" ")
    first = int(page.get("document.body.dataset.frame"))
    page.wait(f"Number(document.body.dataset.frame) > {first + 4}")
    assert "while moving" in page.figures
    page.press("p")
    assert page.find("#set-turning").is_selected()
    page.find("#set-turning").click()
    page.settle()
    assert page.status["settings"]["turning"] is False


def test_a_key_that_is_held_goes_on(page: Page) -> None:
    page.command("Input.dispatchKeyEvent", type="keyDown", text="a", **KEY_A)
    for _ in range(3):
        page.command("Input.dispatchKeyEvent", type="keyDown", text="a", autoRepeat=True, **KEY_A)
    page.command("Input.dispatchKeyEvent", type="keyUp", **KEY_A)
    page.settle()
    assert page.status["settings"]["opacity"] == 0.2
    assert not page.get("window.sent.filter((each) => each.type === 'char').length")


def test_a_key_that_does_nothing_leaves_nothing_to_wait_for(page: Page) -> None:
    page.press("2")
    page.settle()
    page.press(Keys.SHIFT, Keys.CONTROL, Keys.F9, "x", Keys.ARROW_LEFT)
    page.wait("window.sent.at(-1).key === 'ArrowLeft'")
    page.settle()


def test_a_key_that_the_technique_lacks_says_so_each_time(page: Page) -> None:
    for _ in range(2):
        page.driver.execute_script("document.getElementById('notice').hidden = true")
        page.press("q")
        page.wait("!document.getElementById('notice').hidden")
        assert page.find("#notice").text.startswith("occlusion_query: expected a technique that has it, ")


@pytest.mark.parametrize("key", ["h", "?"])
def test_help_opens_and_closes(page: Page, key: str) -> None:
    page.press(key)
    help = page.find("#help")
    assert help.is_displayed() and "look at what is there" in help.text and "dual-depth-peeling" in help.text
    page.press("1")  # is not for the scene
    page.press(Keys.ESCAPE if key == "h" else key)
    assert not help.is_displayed()
    assert page.status["technique"] == "sort"
    assert not page.get("window.sent.filter((each) => ['h', '?', '1'].includes(each.key)).length")


def test_c_shows_the_command_and_prints_it(page: Page, server: tuple[str, Any]) -> None:
    page.press("3")
    page.settle()
    page.press("c")
    page.wait("document.getElementById('command').open")
    command = page.status["command"]
    assert "--technique=weighted-average" in command and page.find("#command pre").text == command
    assert server[1].stdout.readline() == f"{command}\n"
    page.find("#command p button").click()
    page.wait("document.querySelector('#command output').textContent !== ''")
    page.press(Keys.ESCAPE)
    assert not page.find("#command").is_displayed()


def test_s_saves_the_lossless_picture(page: Page, folder: Path, is_rendered: Any) -> None:
    page.press("4", "s")  # the frame that is shown now is not yet the one that is saved
    page.wait("document.getElementById('notice').textContent === 'Saved as clpeel.png.'")
    path = folder / "clpeel.png"
    while not path.is_file():
        page.get("1")
    assert "weighted-sum" in page.status["command"]
    is_rendered(path.read_bytes())
    path.unlink()


# --- the panel --------------------------------------------------------------------------------------------------------


@pytest.fixture
def panel(page: Page) -> Page:
    """The page with its panel open."""
    if not page.find("#panel").is_displayed():
        page.press("p")
    return page


def test_the_panel_opens_and_closes(page: Page) -> None:
    panel, button = page.find("#panel"), page.find("#tools [data-does=panel]")
    assert not panel.is_displayed() and button.get_attribute("aria-expanded") == "false"  # there is no room for it
    button.click()
    assert panel.is_displayed() and button.get_attribute("aria-expanded") == "true"
    page.press("p")
    assert not panel.is_displayed()
    page.resize((1000, 700))
    page.wait("!document.getElementById('panel').hidden")
    page.resize((390, 844), ratio=3, mobile=True)
    page.wait("document.getElementById('panel').hidden")
    button.click()
    box = panel.rect
    assert (box["x"], box["width"], round(box["y"] + box["height"])) == (0, 390, 844)


SETTINGS: list[tuple[str, str, Callable[[Page], object], object]] = [
    ("1", "technique", lambda page: page.choose("technique", "depth-peeling"), "depth-peeling"),
    ("1", "shows", lambda page: page.choose("shows", "layers"), "layers"),
    ("1", "opacity", lambda page: page.set("opacity", 0.25), 0.25),
    ("1a", "opacity", lambda page: page.find(".slider button").click(), None),
    ("1", "lighting", lambda page: page.choose("lighting", "none"), "none"),
    ("1", "background", lambda page: page.set("background", "#ff0033"), [1, 0, 0.2]),
    ("1", "background", lambda page: page.find(".color button").click(), None),
    ("1", "orthographic", lambda page: page.find("#set-orthographic").click(), True),
    ("1", "samples", lambda page: page.choose("samples", 4), 4),
    ("1", "passes", lambda page: page.enter("passes", "2"), 2),
    ("1-", "passes", lambda page: page.enter("passes", ""), None),
    ("1", "occlusion_query", lambda page: page.find("#set-occlusion_query").click(), False),
    ("5", "layers_per_pass", lambda page: page.enter("layers_per_pass", "3"), 3),
    ("1", "coincident", lambda page: page.choose("coincident", "paper"), "paper"),
    ("1", "precision", lambda page: page.choose("precision", "half"), "half"),
    ("1", "depth_format", lambda page: page.choose("depth_format", "unorm24"), "unorm24"),
    ("1", "max_error", lambda page: page.enter("max_error", "0.01"), 0.01),
    ("1", "opaque", lambda page: page.choose("opaque", "blend"), "blend"),
    ("1", "execution", lambda page: page.choose("execution", "passes"), "passes"),
]


@pytest.mark.parametrize(("keys", "name", "change", "value"), SETTINGS)
def test_settings_of_the_panel_change_the_picture(
    panel: Page, is_rendered: Any, keys: str, name: str, change: Callable[[Page], object], value: object
) -> None:
    panel.press(*keys)
    panel.wait(f"!document.getElementById('set-{name}').disabled")
    file = panel.after(lambda: change(panel))
    sent = panel.get("window.sent.filter((each) => each.type === 'set').at(-1)")
    assert (sent["name"], sent["value"]) == (name, value)
    is_rendered(file)


def test_a_gradient_is_drawn_and_named_until_a_colour_is_chosen(panel: Page, is_rendered: Any) -> None:
    """The command gives one, and the panel has none to choose. So the message is sent past the panel."""
    set_it = (
        "window.sockets.at(-1).send(JSON.stringify({type: 'set', name: 'background', value: 'white:#336699',"
        " timestamp: (performance.timeOrigin + performance.now()) / 1000}))"
    )
    shown = is_rendered(panel.after(lambda: panel.get(set_it)))
    assert (shown[0, 0, :3] >= 250).all() and (abs(shown[-1, 0, :3] - (51.0, 102, 153)) <= 5).all()
    colour = panel.find("#set-background")
    assert colour.get_attribute("value") == "#ffffff"
    assert colour.get_attribute("title") == "a gradient, #ffffff at the top, #336699 at the bottom"
    is_rendered(panel.after(lambda: panel.set("background", "#ff0033")))
    assert colour.get_attribute("value") == "#ff0033" and colour.get_attribute("title") == ""


def test_the_panel_has_every_setting(panel: Page) -> None:
    labels = panel.get("fetch('viewer.json').then((answer) => answer.json()).then((found) => found.labels)")
    for name, text in labels.items():
        assert panel.find(f"#set-{name}").accessible_name == text
    assert {name for _, name, _, _ in SETTINGS} | {"turning"} == set(labels) == set(panel.status["settings"])


def test_the_panel_follows_the_keys(panel: Page) -> None:
    panel.press("2", "a", "o")
    panel.settle()
    assert panel.get("document.getElementById('set-technique').value") == '"depth-peeling"'
    assert panel.get("document.getElementById('set-opacity').value") == "0.35"
    assert panel.get("document.getElementById('set-orthographic').checked")


def test_what_the_technique_lacks_is_disabled(panel: Page) -> None:
    assert not panel.find("#set-passes").is_enabled() and panel.find("#set-precision").is_enabled()
    row = panel.find("#set-passes").find_element("xpath", "..")
    assert row.get_attribute("title") == (
        "sort has no such setting. These have it: depth-peeling, dual-depth-peeling, multi-layer-peeling, glowscript."
    )
    panel.press("2")
    panel.settle()
    assert panel.find("#set-passes").is_enabled() and row.get_attribute("title") == ""


def test_keys_that_are_typed_into_a_field_are_not_for_the_scene(panel: Page) -> None:
    panel.press("2")
    panel.settle()
    panel.find("#set-passes").send_keys(Keys.CONTROL, "a", Keys.NULL, "3")
    panel.press("1")  # the focus is still there
    panel.after(lambda: panel.press(Keys.ENTER))
    settings = panel.status["settings"]
    assert (settings["technique"], settings["passes"]) == ("depth-peeling", 31)


def test_a_picture_that_cannot_be_drawn_is_explained(panel: Page) -> None:
    panel.choose("technique", "thickness")
    panel.settle()
    panel.choose("shows", "error")
    panel.wait("!document.getElementById('notice').hidden")
    assert "expected a technique that blends colours" in panel.find("#notice").text
    panel.driver.execute_async_script("setTimeout(arguments[0], 400)")
    assert panel.get("document.body.dataset.waiting") == "false"


def test_a_value_out_of_range_is_not_taken(panel: Page) -> None:
    panel.press("2")
    panel.settle()
    panel.enter("passes", "0")
    panel.after(lambda: panel.enter("max_error", "0.5"))
    assert [each["name"] for each in panel.get("window.sent.filter((each) => each.type === 'set')")] == ["max_error"]


def test_buttons_of_the_panel_do_what_their_keys_do(panel: Page, server: tuple[str, Any]) -> None:
    panel.press("3")
    panel.settle()
    panel.after(lambda: panel.find("#panel [data-does=reset]").click())
    assert panel.status["technique"] == "sort"
    panel.find("#panel [data-does=help]").click()
    panel.press("h")
    panel.find("#panel [data-does=command]").click()
    assert server[1].stdout.readline() == f"{panel.status['command']}\n"
    panel.wait("document.getElementById('command').open")


def test_everything_is_reached_by_the_keyboard(panel: Page) -> None:
    panel.press("5")
    panel.settle()
    reached: set[str] = set()
    for _ in range(40):
        panel.press(Keys.TAB)
        reached.add(panel.get("document.activeElement.id || document.activeElement.dataset.does || ''"))
    assert {f"set-{name}" for _, name, _, _ in SETTINGS} | {"reset", "save", "command", "help", "panel"} <= reached


# --- touch ------------------------------------------------------------------------------------------------------------


def test_one_finger_rotates(page: Page, is_rendered: Any) -> None:
    def swipe() -> None:
        page.touch("Start", (320, 240))
        page.touch("Move", (350, 250))
        page.touch("Move", (380, 260))
        page.touch("End")

    is_rendered(page.after(swipe))
    drag = [each for each in page.get("window.sent") if each["type"].startswith("pointer")]
    assert [drag[0]["type"], drag[-1]["type"]] == ["pointer_down", "pointer_up"]
    assert {each["button"] for each in drag} == {1} and (drag[-1]["x"], drag[-1]["y"]) == (380, 260)


def test_two_fingers_pan(page: Page, is_rendered: Any) -> None:
    def swipe() -> None:
        page.touch("Start", (300, 240))
        page.touch("Start", (300, 240), (340, 240))
        page.touch("Move", (350, 270), (390, 270))
        page.touch("End")

    before = pixels(page.settle())
    after = is_rendered(page.after(swipe))
    assert np.abs(np.subtract(middle(after), middle(before)) - (50, 30)).max() < 3


def test_two_fingers_pinch(page: Page, is_rendered: Any) -> None:
    def pinch() -> None:
        page.touch("Start", (280, 240))
        page.touch("Start", (280, 240), (360, 240))
        page.touch("Move", (260, 240), (380, 240))
        page.touch("End", (380, 240))
        page.touch("End")

    before = pixels(page.settle())
    after = is_rendered(page.after(pinch))
    assert extent(after) / extent(before) == pytest.approx(1.5, rel=0.05)
    (wheel,) = [each for each in page.get("window.sent") if each["type"] == "wheel"]
    assert wheel["dy"] == pytest.approx(-math.log(1.5) / math.log(1.0015)) and (wheel["x"], wheel["y"]) == (320, 240)


# --- other pages, and the connection ----------------------------------------------------------------------------------


def test_the_first_page_steers_and_the_next_one_takes_over(page: Page, server: tuple[str, Any]) -> None:
    driver, first = page.driver, page.driver.current_window_handle
    driver.switch_to.new_window("window")
    second = Page(driver, server[0], (400, 300))
    assert second.get("document.body.dataset.steering") == "false" and "another page steers" in second.figures
    assert not second.find("#set-technique").is_enabled()
    second.press("3")  # changes nothing
    driver.switch_to.window(first)
    file = page.after(lambda: page.press("2"))
    driver.switch_to.window(driver.window_handles[-1])
    second.wait("document.body.dataset.technique === 'depth-peeling'")
    assert np.array_equal(pixels(second.settle()), pixels(file))
    driver.switch_to.window(first)
    other = driver.window_handles[-1]
    driver.close()
    driver.switch_to.window(other)
    second.wait("document.body.dataset.steering === 'true'")
    second.wait("window.clpeel.status.width === 400")
    assert pixels(second.settle()).shape == (300, 400, 3)
    assert pixels(second.after(lambda: second.press("1"))).shape == (300, 400, 3)


def test_a_page_that_crashes_in_a_drag_leaves_the_server_well(page: Page, server: tuple[str, Any]) -> None:
    driver = page.driver
    crashing = driver.current_window_handle
    driver.switch_to.new_window("window")
    other = driver.current_window_handle
    driver.switch_to.window(crashing)
    page.actions().move_to_element(page.find("#view")).click_and_hold().move_by_offset(50, 20).perform()
    with pytest.raises(WebDriverException, match="crashed"):  # the button is held, and frames are on their way
        page.command("Page.crash")
    driver.close()
    driver.switch_to.window(other)
    next_one = Page(driver, server[0])
    next_one.wait("document.body.dataset.steering === 'true'")
    next_one.after(lambda: next_one.press("2"))
    assert server[1].poll() is None


def test_nothing_is_drawn_for_a_hidden_page(page: Page) -> None:
    page.press(" ")
    page.minimize(True)
    page.wait("document.hidden && window.sent.some((each) => each.type === 'hide')")
    received = page.get("window.received")
    page.driver.execute_async_script("setTimeout(arguments[0], 700)")
    assert page.get("window.received") <= received + 4  # those on their way; 700 ms of turning are 20 and more
    page.minimize(False)
    page.wait(f"!document.hidden && window.received > {received + 5}")
    page.press(" ")
    page.settle()


def test_a_lost_connection_is_told_and_comes_back(page: Page, is_rendered: Any) -> None:
    page.get("window.sockets.at(-1).close()")
    page.wait("document.body.dataset.connection === 'lost'")
    assert "No connection to clpeel" in page.find("#connection").text
    page.wait("document.body.dataset.connection === 'open' && document.body.dataset.steering === 'true'")
    assert not page.find("#connection").is_displayed()
    is_rendered(page.after(lambda: page.press("3")))


def test_a_page_that_the_server_turned_away_says_why(page: Page) -> None:
    page.get("window.sockets.at(-1).send('\"nonsense\"')")
    page.wait("document.body.dataset.connection === 'refused'")
    assert "Closed by the server: type: expected one that a page sends, got another." in page.find("#connection").text
    page.find("#connection button").click()
    page.wait("document.body.dataset.connection === 'open'")
    page.after(lambda: page.press("3"))


def test_the_page_says_so_when_a_picture_takes_its_time(page: Page, server: tuple[str, Any]) -> None:
    server[1].send_signal(signal.SIGSTOP)
    try:
        page.press("2")
        page.wait("document.body.dataset.waiting === 'true'")
        assert "drawing…" in page.figures
    finally:
        server[1].send_signal(signal.SIGCONT)
    page.settle()
    assert page.get("document.body.dataset.waiting") == "false" and "drawing…" not in page.figures
