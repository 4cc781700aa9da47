"""The slider of a comparison's page, in a real browser and without a network: pictures, drag, keys, differences."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from twins import soups
from twins.soups import AHEAD
from viewer import pages

import clpeel
from clpeel.study.comparison import Comparison

pages.needs_browser()

from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from selenium.webdriver.support.ui import Select, WebDriverWait  # noqa: E402

SIZE = (240, 160)
TECHNIQUES = ["sort", "weighted-average", "weighted-sum"]


@pytest.fixture(scope="module")
def driver() -> Iterator[Any]:
    with pages.browser("--window-size=1000,900", "--host-resolver-rules=MAP * ~NOTFOUND") as found:
        yield found


@pytest.fixture(scope="module")
def compared() -> Comparison:
    """Two layers, over white: their average and their sum differ from the truth, each in its own way."""
    scene = soups.stack(np.array([1, 2]), [[0.9, 0.1, 0.1, 0.7], [0.1, 0.1, 0.9, 0.6]]).scene()
    return clpeel.compare(scene, AHEAD.camera(), SIZE, TECHNIQUES, ["float32"], frames=1, pictures=True)


@pytest.fixture
def page(driver: Any, compared: Comparison, tmp_path: Path) -> Any:
    """The browser, which shows the page of the comparison at its slider."""
    path = tmp_path / "a page's name & more.html"
    path.write_text(compared.to_html("two"), encoding="utf-8")
    return opened(driver, path)


def opened(driver: Any, path: Path) -> Any:
    driver.get(path.as_uri())
    WebDriverWait(driver, pages.PATIENCE).until(lambda _: select(driver, "left").options)
    driver.execute_script("document.querySelector('.choose').scrollIntoView()")
    return driver


def select(driver: Any, name: str) -> Select:
    return Select(driver.find_element(By.ID, name))


def shown(driver: Any) -> np.ndarray:
    """The pixels of the slider, float64 [height, width, 3], once both of its pictures are there."""
    script = "return [...document.querySelectorAll('.pair img')].every((one) => one.complete && one.naturalWidth > 0)"
    WebDriverWait(driver, pages.PATIENCE).until(lambda _: driver.execute_script(script))
    file = driver.find_element(By.CSS_SELECTOR, ".pair").screenshot_as_png
    with Image.open(io.BytesIO(file)) as image:
        return np.asarray(image)[..., :3].astype(float)


def color(compared: Comparison, name: str) -> np.ndarray:
    """The one colour of a row's picture, or of the truth's."""
    image = compared.truth_image() if name == "truth" else next(r.image for r in compared.rows if r.name == name)
    assert (image == image[0, 0]).all()
    return image[0, 0, :3].astype(float)


def border(pixels: np.ndarray, left: np.ndarray, right: np.ndarray) -> float:
    """Where the left picture ends, as a share of the width, in the upper quarter, where nothing else stands."""
    row = pixels[len(pixels) // 8]
    near = [np.abs(row - side).max(axis=1) <= 1 for side in (left, right)]
    assert near[0].sum() + near[1].sum() >= len(row) - 8  # the line between them has a few pixels
    assert not near[0].any() or not near[1].any() or near[0].nonzero()[0].max() < near[1].nonzero()[0].min()
    return float(near[0].sum() / len(row))


def test_both_lists_have_the_truth_and_every_row(page: Any) -> None:
    for name in ("left", "right"):
        assert [option.text for option in select(page, name).options] == ["truth", *TECHNIQUES]
    assert [select(page, name).first_selected_option.text for name in ("left", "right")] == ["sort", "truth"]


def test_any_two_pictures_meet_at_the_line(page: Any, compared: Comparison) -> None:
    select(page, "left").select_by_visible_text("weighted-sum")
    select(page, "right").select_by_visible_text("weighted-average")
    sides = color(compared, "weighted-sum"), color(compared, "weighted-average")
    assert np.abs(sides[0] - sides[1]).max() > 8
    assert abs(border(shown(page), *sides) - 0.5) < 0.01
    select(page, "right").select_by_visible_text("truth")
    assert abs(border(shown(page), sides[0], color(compared, "truth")) - 0.5) < 0.01
    names = [each.text for each in page.find_elements(By.CSS_SELECTOR, ".pair .name")]
    assert names == ["weighted-sum", "truth"]


def test_keys_move_the_line(page: Any, compared: Comparison) -> None:
    select(page, "left").select_by_visible_text("weighted-sum")
    sides = color(compared, "weighted-sum"), color(compared, "truth")
    page.find_element(By.ID, "differ").send_keys(Keys.TAB)
    slider = page.switch_to.active_element
    assert slider.get_attribute("type") == "range" and slider.accessible_name == "share of the left picture, in percent"
    for keys, share in ((Keys.ARROW_RIGHT * 10, 0.6), (Keys.ARROW_LEFT * 30, 0.3), (Keys.END, 1), (Keys.HOME, 0)):
        slider.send_keys(keys)
        assert abs(border(shown(page), *sides) - share) < 0.01, share


def test_the_line_goes_where_the_mouse_is(page: Any, compared: Comparison) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    select(page, "left").select_by_visible_text("weighted-sum")
    sides = color(compared, "weighted-sum"), color(compared, "truth")
    slider = page.find_element(By.CSS_SELECTOR, ".pair input")
    width = slider.size["width"]
    for share in (0.1, 0.95):
        ActionChains(page).move_to_element_with_offset(slider, int((share - 0.5) * width), 0).click().perform()
        assert abs(border(shown(page), *sides) - share) < 0.015, share


def test_differences_are_eight_times_as_bright(page: Any, compared: Comparison) -> None:
    select(page, "left").select_by_visible_text("weighted-average")
    page.find_element(By.ID, "differ").click()
    want = np.minimum(8 * np.abs(color(compared, "weighted-average") - color(compared, "truth")), 255)
    pixels = shown(page)
    assert np.abs(pixels[len(pixels) // 8] - want).max() <= 8 and want.max() > 64
    select(page, "left").select_by_visible_text("sort")
    pixels = shown(page)
    assert pixels[len(pixels) // 8].max() == 0


def test_the_suites_slider_keeps_names_from_scene_to_scene(driver: Any, tmp_path: Path) -> None:
    suite = clpeel.compare_suite(["grass", "shells"], (64, 48), TECHNIQUES, ["float32"], frames=1, pictures=True)
    path = tmp_path / "suite.html"
    path.write_text(suite.to_html(), encoding="utf-8")
    page = opened(driver, path)
    assert [option.text for option in select(page, "group").options] == ["grass", "shells"]
    select(page, "left").select_by_visible_text("weighted-sum")
    before = shown(page)
    select(page, "group").select_by_visible_text("shells")
    assert [select(page, name).first_selected_option.text for name in ("left", "right")] == ["weighted-sum", "truth"]
    source, id = (page.find_element(By.CSS_SELECTOR, ".pair .left").get_attribute("src"), select(page, "left"))
    chosen = id.first_selected_option.get_attribute("value")
    assert source == page.find_element(By.ID, chosen).get_attribute("src") and chosen.startswith("picture-1-")
    assert np.abs(shown(page) - before).max() > 50
    assert page.get_log("browser") == []
