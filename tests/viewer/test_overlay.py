"""The overlay and the panel: text stays inside the picture, and a click finds what is drawn there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from clpeel.scene.camera import Camera
from clpeel.techniques import TECHNIQUES
from clpeel.viewer import overlay
from clpeel.viewer.controls import KEYS, SETTINGS
from clpeel.viewer.overlay import LESS, MORE, Plate, draw_overlay, help_plate, panel_plate, setting_at
from clpeel.viewer.panel import KEYS_FROM_NONE, MAX_ERRORS, rows_of, stepped, text_of, what_never_changes
from clpeel.viewer.status import LABELS, settings
from clpeel.viewer.view import View

SIZES = ((64, 64), (64, 400), (400, 64), (160, 120), (300, 900), (640, 480), (1600, 1200))
SIDES = st.integers(64, 2000)
RATIOS = st.sampled_from((1.0, 1.25, 1.5, 2.0, 3.0))
SHOWN = ({}, {"help": True}, {"panel": True})
NOTE = "a note that tells at length what the picture lacks, and why it does so, in many words"


def status(technique: str = "multi-layer-peeling", notice: str = "", **options: Any) -> dict[str, Any]:
    """A status as the viewer gives it, of no picture."""
    view = View(Camera((0, 0, 3), (0, 0, 0), (0, 1, 0)), (100, 100), technique, options, opacity=0.4)
    return {
        "technique": technique,
        "auto": False,
        "shows": "picture",
        "passes": 12,
        "layers": 123,
        "fragments": 123_456_789,
        "milliseconds": 1234.5,
        "width": 10_000,
        "height": 10_000,
        "samples": 16,
        "full": True,
        "coarse": False,
        "max_error": 1e-3,
        "rms_error": 1e-5,
        "notes": [NOTE],
        "settings": settings(view),
        "notice": notice,
    }


def drawn(size: tuple[int, int], ratio: float, shown: dict[str, bool], **more: Any) -> NDArray[np.uint8]:
    """A white picture with an overlay."""
    image = np.full((size[1], size[0], 4), 255, np.uint8)
    draw_overlay(image, status(**more), ratio, **shown)
    return image


def plates(monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], ratio: float, shown: dict[str, bool]) -> list[Plate]:
    """The plates that an overlay draws."""
    found: list[Plate] = []
    draw = Plate.draw
    monkeypatch.setattr(Plate, "draw", lambda self, image: (found.append(self), draw(self, image)))
    drawn(size, ratio, shown, notice=NOTE)
    return found


@pytest.mark.parametrize("ratio", (1.0, 1.5, 3.0))
@pytest.mark.parametrize("shown", SHOWN, ids=str)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_all_text_is_inside_its_plate_and_all_plates_are_inside_the_picture(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], shown: dict[str, bool], ratio: float
) -> None:
    found = plates(monkeypatch, size, ratio, shown)
    assert len(found) >= 1
    for plate in found:
        assert plate.table, "a plate with no text"
        assert 0 <= plate.left <= plate.left + plate.width <= size[0]
        assert 0 <= plate.top <= plate.top + plate.height <= size[1]
        assert len(plate.table) * plate.line + 2 * plate.pad <= plate.height
        for row in plate.table:
            for cell, left, right in zip(row, plate.columns[:-1], plate.columns[1:], strict=True):
                assert overlay.length(cell.text, plate.font) <= right - left


@pytest.mark.parametrize("shown", SHOWN, ids=str)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_there_is_text_at_every_size(size: tuple[int, int], shown: dict[str, bool]) -> None:
    image = drawn(size, 1.0, shown)
    ink = (image[..., :3].max(axis=-1) > 180) & (image[..., :3].min(axis=-1) < 250)
    plate = (image[..., :3] < 130).all(axis=-1)
    assert plate.any() and ink.any() and (image[..., 3] == 255).all()


def test_pixels_beside_the_plates_stay_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    found = plates(monkeypatch, (900, 650), 1.0, {"panel": True})
    outside = np.ones((650, 900), bool)
    for plate in found:
        outside[plate.top : plate.top + plate.height, plate.left : plate.left + plate.width] = False
    noise = np.random.default_rng(1).integers(0, 256, (650, 900, 4), np.uint8)
    noise[..., 3] = 255
    image = noise.copy()
    draw_overlay(image, status(notice=NOTE), 1.0, panel=True)
    assert (image[outside] == noise[outside]).all() and outside.mean() > 0.5
    assert (image[~outside] != noise[~outside]).any(axis=-1).mean() > 0.9


def test_the_help_has_all_keys_in_two_columns_where_there_is_room() -> None:
    plate = help_plate((900, 650), 1.0)
    texts = [cell.text for row in plate.table for cell in row]
    assert len(plate.columns) == 7  # key, what it does, a gap; twice
    for key, what in KEYS:
        assert key in texts and what in texts


def test_twice_the_pixels_make_the_same_text_twice_as_large() -> None:
    one, two = panel_plate(status(), (900, 650), 1.0), panel_plate(status(), (1800, 1300), 2.0)
    assert two.font == 2 * one.font
    assert two.width == pytest.approx(2 * one.width, rel=0.05) and two.height == pytest.approx(2 * one.height, rel=0.05)


def test_while_the_panel_is_shown_the_status_is_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    panel, line, notice = plates(monkeypatch, (640, 480), 1.0, {"panel": True})
    assert len(panel.table) == len(LABELS)
    assert line.left + line.width <= panel.left and notice.left + notice.width <= panel.left


# --- the panel --------------------------------------------------------------------------------------------------------


def test_the_panel_has_all_settings() -> None:
    assert {row.name for row in rows_of(status())} == set(SETTINGS)


@given(width=SIDES, height=SIDES, ratio=RATIOS, technique=st.sampled_from((*TECHNIQUES, "auto")))
def test_a_click_in_the_middle_of_each_arrow_finds_its_setting(
    width: int, height: int, ratio: float, technique: str
) -> None:
    now = status(technique)
    plate, rows = panel_plate(now, (width, height), ratio), rows_of(now)
    for number, row in enumerate(plate.table):
        for column, cell in enumerate(row):
            left, top, right, bottom = plate.box(number, column)
            place = (left + right) / 2, (top + bottom) / 2
            if right == left:
                continue
            assert plate.has(*place) and plate.cell_at(*place) == (number, column)
            by = {LESS: -1, MORE: 1}.get(cell.text)
            wanted = (rows[number].name, by) if by and rows[number].live else None
            assert setting_at(plate, now, *place) == wanted


def test_where_no_arrow_is_drawn_there_is_nothing_to_click() -> None:
    now = status()
    plate = panel_plate(now, (900, 650), 1.0)
    arrows = np.zeros((650, 900), bool)
    for number, row in enumerate(plate.table):
        for column, cell in enumerate(row):
            left, top, right, bottom = plate.box(number, column)
            arrows[top:bottom, left:right] = cell.text in (LESS, MORE) and rows_of(now)[number].live
    found = [[setting_at(plate, now, x + 0.5, y + 0.5) is not None for x in range(900)] for y in range(0, 650, 3)]
    assert (np.array(found) == arrows[::3]).all() and arrows.any()


@pytest.mark.parametrize("technique", (*TECHNIQUES, "auto"))
def test_settings_that_the_technique_lacks_are_grey_and_cannot_be_clicked(technique: str) -> None:
    now, known = status(technique), what_never_changes()
    plate = panel_plate(now, (900, 650), 1.0)
    for number, (row, cells) in enumerate(zip(rows_of(now), plate.table, strict=True)):
        own = row.name in known["options"][technique] or row.name in known["common"]
        always = not any(row.name in names for names in known["options"].values())
        assert row.live == (own or always)
        assert (cells[2].color == overlay.GREY) == (not row.live)
        left, top, right, bottom = plate.box(number, 3)
        assert (setting_at(plate, now, (left + right) / 2, (top + bottom) / 2) is not None) == row.live


def test_arrows_stay_where_they_are_whatever_the_values_are() -> None:
    short, long = status("sort", samples=1), status("multi-layer-peeling", depth_format="float32-reversed", samples=256)
    assert panel_plate(short, (900, 650), 1.0).columns == panel_plate(long, (900, 650), 1.0).columns


# --- steps ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ("technique", "shows", "precision", "depth_format", "coincident", "execution"))
def test_words_go_round(name: str) -> None:
    choices = what_never_changes()["choices"][name]
    value, seen = choices[0], []
    for _ in choices:
        seen.append(value)
        value = stepped(name, value, 1)
    assert value == choices[0] and seen == choices
    assert stepped(name, choices[0], -1) == choices[-1]


@pytest.mark.parametrize("name", ("occlusion_query", "orthographic", "turning"))
def test_what_is_on_goes_off(name: str) -> None:
    assert stepped(name, True, 1) is False and stepped(name, False, -1) is True


def test_numbers_end() -> None:
    assert stepped("samples", 1, -1) == 1 and stepped("samples", 256, 1) == 256 and stepped("samples", 4, 1) == 8
    assert stepped("layers_per_pass", 1, -1) == 1 and stepped("layers_per_pass", 64, 1) == 64
    assert stepped("opacity", 0.0, -1) == 0.0 and stepped("opacity", 0.4, 1) == 0.45
    assert stepped("passes", 3, 1) == 4 and stepped("passes", 3, -1) == 2


def test_numbers_return_to_none() -> None:
    assert stepped("opacity", 1.0, 1) is None and stepped("passes", 1, -1) is None
    assert stepped("max_error", 0.0, -1) is None
    assert set(KEYS_FROM_NONE) == {"opacity", "passes"}


def test_the_error_goes_through_its_row_from_any_value() -> None:
    value: float | None = None
    for want in MAX_ERRORS[1:]:
        value = stepped("max_error", value, 1)
        assert value == want
    assert stepped("max_error", 0.1, 1) == 0.1
    assert stepped("max_error", 5e-4, 1) == 1e-3 and stepped("max_error", 5e-4, -1) == 1e-4


@pytest.mark.parametrize("first", [[0.1, 0.2, 0.3], [[0.1, 0.2, 0.3], [1, 1, 1]]])
def test_backgrounds_go_round_from_any_colour(first: object) -> None:
    value, seen = stepped("background", first, 1), []
    while value not in seen:
        seen.append(value)
        value = stepped("background", value, 1)
    assert None in seen and len(seen) == 5


@pytest.mark.parametrize(
    ("name", "value", "text"),
    (
        ("max_error", 1 / 255, "1/255"),
        ("max_error", 1e-4, "0.0001"),
        ("background", [1.0, 0.5, 0.0], "#ff8000"),
        ("background", [[1.0, 0.5, 0.0], [0.0, 0.0, 0.2]], "#ff8000:#000033"),
        ("background", None, "transparent"),
        ("occlusion_query", False, "off"),
        ("passes", None, "no limit"),
        ("opacity", 0.4, "0.40"),
        ("samples", 16, "16"),
    ),
)
def test_values_have_names(name: str, value: object, text: str) -> None:
    assert text_of(name, value) == text


def test_every_step_of_every_setting_is_a_value_that_can_be_set() -> None:
    camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0))
    from clpeel.viewer.controls import Controls

    controls = Controls(View(camera, (100, 100), "multi-layer-peeling"), 1.0, 0.4, None, (100, 100))  # type: ignore[arg-type]
    for name in LABELS:
        for by in (1, -1):
            value = settings(controls.view)[name]
            if value is not None or name not in KEYS_FROM_NONE:
                wanted = stepped(name, value, by)
                if (name, wanted) != ("execution", "passes"):
                    controls.set(name, wanted)
                    controls.set(name, value)
    assert controls.view.technique == "multi-layer-peeling"
