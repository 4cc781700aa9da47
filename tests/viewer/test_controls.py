"""The controls: each drag, key and setting changes what it says, and nothing else."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from clpeel.errors import InputError
from clpeel.scene.camera import Camera
from clpeel.techniques import AUTO, TECHNIQUES
from clpeel.viewer import motion
from clpeel.viewer.controls import KEYS, SETTINGS, TECHNIQUE_KEYS, Controls
from clpeel.viewer.status import LABELS, description, settings
from clpeel.viewer.view import View

CAMERA = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
SCREEN = (200.0, 100.0)


class Done:
    """What keys did besides changing the view."""

    def __init__(self) -> None:
        self.calls: list[Any] = []

    def save(self) -> None:
        self.calls.append("save")

    def print_command(self) -> None:
        self.calls.append("command")

    def pick(self, at: motion.Place) -> None:
        self.calls.append(at)

    def toggle(self, what: str) -> None:
        self.calls.append(what)


def controls(**view: Any) -> Controls:
    return Controls(View(CAMERA, (200, 100), **view), radius=1.0, alpha=0.4, actions=Done(), screen=SCREEN, passes=7)


def pointer(kind: str, x: float, y: float, button: int = 1, *modifiers: str) -> dict[str, Any]:
    held = () if kind == "pointer_up" else (button,)
    return {"event_type": kind, "x": x, "y": y, "button": button, "buttons": held, "modifiers": modifiers}


def drag(on: Controls, button: int = 1, *modifiers: str) -> Camera:
    """Drags by (30, 20) in two steps. Returns the camera."""
    on.handle(pointer("pointer_down", 50, 40, button, *modifiers))
    on.handle(pointer("pointer_move", 60, 50, button, *modifiers))
    on.handle(pointer("pointer_move", 80, 60, button, *modifiers))
    on.handle(pointer("pointer_up", 80, 60, button, *modifiers))
    on.handle({**pointer("pointer_move", 90, 90), "buttons": ()})
    return on.view.camera


def press(on: Controls, *keys: str) -> View:
    for key in keys:
        on.handle({"event_type": "key_down", "key": key, "modifiers": ()})
    return on.view


def changed(view: View, other: View) -> set[str]:
    return {each.name for each in fields(View) if getattr(view, each.name) != getattr(other, each.name)}


STEPS = ((10.0, 10.0), (20.0, 10.0))


def test_the_left_button_rotates() -> None:
    expected = CAMERA
    for step in STEPS:
        expected = motion.rotated(expected, step, SCREEN)
    assert drag(controls()) == expected != CAMERA


@pytest.mark.parametrize("hand", [(1, "Control"), (2,), (3,), (1, "Control", "Shift")])
def test_control_and_the_other_buttons_pan(hand: Any) -> None:
    expected = CAMERA
    for step in STEPS:
        expected = motion.panned(expected, step, SCREEN)
    assert drag(controls(), *hand) == expected != CAMERA


def test_shift_dollies() -> None:
    expected = CAMERA
    for step in STEPS:
        expected = motion.dollied(expected, step, SCREEN, 1.0)
    assert drag(controls(), 1, "Shift") == expected != CAMERA


def test_the_wheel_zooms() -> None:
    on = controls()
    on.handle({"event_type": "wheel", "x": 20.0, "y": 30.0, "dx": 0.0, "dy": -100.0, "modifiers": ()})
    assert on.view.camera == motion.zoomed(CAMERA, -100.0, (20.0, 30.0), SCREEN, 1.0)


def test_a_drag_that_was_let_go_outside_ends() -> None:
    on = controls()
    on.handle(pointer("pointer_down", 50, 40))
    on.handle({**pointer("pointer_move", 90, 90), "buttons": ()})
    on.handle(pointer("pointer_move", 95, 95))
    assert on.view.camera == CAMERA


def test_a_second_button_does_not_jump_the_drag() -> None:
    on = controls()
    on.handle(pointer("pointer_down", 50, 40))
    on.handle(pointer("pointer_down", 150, 40, 2))
    on.handle(pointer("pointer_move", 60, 50))
    assert on.view.camera == motion.rotated(CAMERA, (10.0, 10.0), SCREEN)


def test_a_double_click_looks_there() -> None:
    on = controls()
    on.handle({"event_type": "double_click", "x": 12.0, "y": 34.0, "button": 1, "buttons": (), "modifiers": ()})
    assert on.actions.calls == [(12.0, 34.0)]  # type: ignore[attr-defined]


@pytest.mark.parametrize(("key", "name"), TECHNIQUE_KEYS.items())
def test_numbers_choose_techniques(key: str, name: str) -> None:
    on = controls()
    assert press(on, key).technique == name
    assert changed(on.view, on.home) <= {"technique"}


def test_the_papers_numbers_are_the_papers_techniques() -> None:
    paper = ["dual-depth-peeling", "depth-peeling", "weighted-average", "weighted-sum"]
    assert [TECHNIQUE_KEYS[key] for key in "1234"] == paper


def test_a_and_d_change_alpha_from_the_scenes_mean() -> None:
    on = controls()
    assert press(on, "d").opacity == 0.45
    assert press(on, "A", "a", "a").opacity == 0.3
    assert press(on, *"a" * 10).opacity == 0.0
    assert press(on, *"d" * 30).opacity == 1.0


def test_q_fixes_the_passes_that_there_were_and_lets_them_go() -> None:
    on = controls(technique="dual-depth-peeling")
    assert press(on, "q").options == {"occlusion_query": False, "passes": 7}
    assert press(on, "+", "+", "-").options == {"occlusion_query": False, "passes": 8}
    assert press(on, "q").options == {}


def test_passes_never_fall_below_one() -> None:
    on = controls(technique="depth-peeling")
    assert press(on, *"-" * 10).options == {"passes": 1}


def test_brackets_halve_and_double_layers_a_pass() -> None:
    on = controls(technique="multi-layer-peeling")
    assert press(on, "]").options == {"layers_per_pass": 16}
    assert press(on, *"[" * 9).options == {"layers_per_pass": 1}
    assert press(on, *"]" * 9).options == {"layers_per_pass": 64}


@pytest.mark.parametrize("key", ["q", "+", "-", "[", "]"])
def test_a_key_that_the_technique_lacks_says_so(key: str) -> None:
    on = controls(technique="sort")
    with pytest.raises(InputError, match="expected a technique that has it, .*multi-layer-peeling.*; got sort"):
        press(on, key)
    assert on.view == on.home


def test_options_of_one_technique_wait_for_its_return() -> None:
    on = controls(technique="depth-peeling")
    press(on, "+", "3")
    assert "passes" not in on.view.keywords()
    assert press(on, "2").keywords()["passes"] == 8


def test_m_goes_through_the_heat_maps() -> None:
    on = controls()
    assert [press(on, "m").shows for _ in range(3)] == ["layers", "error", "picture"]


@pytest.mark.parametrize("first", [(0.1, 0.2, 0.3), ((0.1, 0.2, 0.3), (1.0, 1.0, 1.0))])
def test_b_goes_through_backgrounds_and_returns(first: Any) -> None:
    on = controls(background=first)
    seen = [press(on, "b").background for _ in range(5)]
    assert seen[-1] == first and len(set(seen)) == 5


def test_a_gradient_is_set_and_told_as_lists() -> None:
    """As JSON has no tuples, which pages send and get."""
    on = controls()
    on.set("background", [[0.1, 0.2, 0.3], [1, 1, 1]])
    assert on.view.background == ((0.1, 0.2, 0.3), (1.0, 1.0, 1.0))
    assert settings(on.view)["background"] == [[0.1, 0.2, 0.3], [1.0, 1.0, 1.0]]


def test_l_o_and_space_switch() -> None:
    on = controls()
    assert [press(on, "l").lighting for _ in range(4)] == ["headlight", "none", "kit", "headlight"]
    assert press(on, "o").camera.orthographic and not press(on, "o").camera.orthographic
    assert press(on, " ").turning and not press(on, " ").turning


def test_r_returns_to_the_first_view_but_keeps_the_size() -> None:
    on = controls()
    press(on, "3", "b", "d", "m")
    drag(on)
    on.resize((300.0, 200.0), (600, 400))
    assert press(on, "r") == replace(on.home, size=(600, 400))


def test_the_first_size_frames_anew_and_later_ones_do_not() -> None:
    def framing(pixels: tuple[int, int]) -> Camera:
        return Camera((0.0, 0.0, float(pixels[1])), (0.0, 0.0, 0.0))

    for moved in (False, True):
        on = controls()
        on.framing = framing
        if moved:
            drag(on)
        before = on.view.camera
        on.resize((30.0, 60.0), (30, 60))
        assert on.view.camera == (before if moved else framing((30, 60)))
        on.resize((30.0, 90.0), (30, 90))
        assert on.view.camera == (before if moved else framing((30, 60)))
        assert press(on, "r").camera == framing((30, 60))


def test_keys_that_change_nothing_call_what_they_say() -> None:
    on = controls()
    press(on, "s", "c", "p", "h", "?")
    assert on.actions.calls == ["save", "command", "panel", "help", "help"]  # type: ignore[attr-defined]
    assert on.view is on.home


@pytest.mark.parametrize("modifier", ["Control", "Alt", "Meta"])
def test_shortcuts_of_the_browser_are_not_keys(modifier: str) -> None:
    on = controls()
    on.handle({"event_type": "key_down", "key": "a", "modifiers": (modifier,)})
    assert on.view is on.home


def test_an_unknown_key_does_nothing() -> None:
    assert press(controls(), "F5", "é", "ArrowUp") == controls().view


def test_every_key_is_in_the_help() -> None:
    from clpeel.viewer.controls import _KEYS

    told = {part for key, _ in KEYS for part in key.lower().split()} | {" ", "=", "?"}
    assert set(_KEYS) | set(TECHNIQUE_KEYS) <= told


# --- settings ---------------------------------------------------------------------------------------------------------

VALUES: dict[str, object] = {
    "technique": "multi-layer-peeling",
    "shows": "layers",
    "opacity": 0.25,
    "background": [0.1, 0.2, 0.3],
    "lighting": "none",
    "orthographic": True,
    "turning": True,
    "passes": 3,
    "occlusion_query": False,
    "layers_per_pass": 4,
    "precision": "half",
    "depth_format": "unorm24",
    "max_error": 0.01,
    "coincident": "paper",
    "opaque": "blend",
    "execution": "passes",
    "samples": 4,
}


@pytest.mark.parametrize("name", SETTINGS)
def test_each_setting_can_be_set_and_is_shown(name: str) -> None:
    on = controls(technique="multi-layer-peeling")
    on.set(name, VALUES[name])
    assert settings(on.view)[name] == VALUES[name]


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("value", ["no such thing", -1, [1.0, 2.0, 3.0], 1e9])
def test_a_wrong_value_is_refused_and_nothing_changes(name: str, value: object) -> None:
    on = controls(technique="multi-layer-peeling")
    with pytest.raises(InputError, match="expected"):
        on.set(name, value)
    assert on.view is on.home


def test_a_setting_that_does_not_exist_is_refused() -> None:
    with pytest.raises(InputError, match="setting: expected one of technique"):
        controls().set("camera", 1)


def test_none_returns_to_the_default() -> None:
    on = controls(technique="multi-layer-peeling")
    for name in ("passes", "precision", "max_error", "samples", "opacity"):
        on.set(name, VALUES[name])
        on.set(name, None)
    assert on.view == on.home


def test_every_setting_has_a_label_and_every_choice_is_one() -> None:
    told = description()
    assert set(told["labels"]) == set(SETTINGS) == set(LABELS)
    assert set(told["options"]) == {*TECHNIQUES, AUTO}
    for name, choices in told["choices"].items():
        for choice in choices:
            on = controls(technique="multi-layer-peeling")
            try:
                on.set(name, choice)
            except InputError as error:
                assert name == "technique" or "execution" in str(error), error
