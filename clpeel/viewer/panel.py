"""The panel: which settings it has, what their values are called, and what the next and the previous value is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from clpeel.checks import shades_of
from clpeel.viewer.controls import BACKGROUNDS, OPACITY_STEP
from clpeel.viewer.status import LABELS, Status, description

MAX_ERRORS = (None, 0.0, 1e-4, 1e-3, 1 / 255, 1e-2, 0.1)
"""The values of max_error that the panel goes through."""

MOST_LAYERS = 64
"""The most layers a pass."""

KEYS_FROM_NONE = {"opacity": ("a", "d"), "passes": ("-", "+")}
"""The keys for the previous and the next value where none is set: only the controls know from which number to begin."""

NONE = {"opacity": "scene's", "passes": "no limit", "max_error": "none", "background": "transparent"}
"""What it is called that a setting has no value."""


@dataclass(frozen=True)
class Row:
    """A setting. name: that of `Viewer.set`. live: whether the technique has it."""

    name: str
    label: str
    value: str
    live: bool


@cache
def what_never_changes() -> dict[str, Any]:
    """Return `status.description`."""
    return description()


def rows_of(status: Status) -> list[Row]:
    """Return all settings, with their values in words."""
    values = status["settings"]
    return [Row(name, label, text_of(name, values[name]), is_live(name, values)) for name, label in LABELS.items()]


def is_live(name: str, values: dict[str, Any]) -> bool:
    """Return whether the technique that is set has this setting. values: all settings."""
    known = what_never_changes()
    of_some = {each for names in known["options"].values() for each in names}
    return name not in of_some or name in known["options"][values["technique"]]


def text_of(name: str, value: Any) -> str:
    """Return a setting's value in words."""
    if value is None:
        return NONE[name]
    if isinstance(value, bool):
        return "on" if value else "off"
    if name == "opacity":
        return f"{value:.2f}"
    if name == "max_error":
        return "1/255" if value == 1 / 255 else f"{value:g}"
    if name == "background":
        return ":".join("#" + "".join(f"{round(part * 255):02x}" for part in each) for each in shades_of(value))
    return str(value)


@cache
def texts() -> tuple[str, ...]:
    """Return all words that a value may be called."""
    return (*NONE.values(), *(str(each) for row in what_never_changes()["choices"].values() for each in row))


def stepped(name: str, value: Any, by: int) -> Any:
    """Return the next value of a setting if `by` is 1, and the previous one if it is -1.

    Words, and what is on or off, begin again after the last one. Numbers end at the last one.
    """
    if isinstance(value, bool):
        return not value
    if name == "opacity":
        return None if value >= 1 and by > 0 else max(round(value + by * OPACITY_STEP, 2), 0.0)
    if name == "passes":
        return value + by if value + by >= 1 else None
    if name == "layers_per_pass":
        return min(max(value * 2 if by > 0 else value // 2, 1), MOST_LAYERS)
    if name == "max_error":
        return _beside(MAX_ERRORS, value, by)
    if name == "background":
        row: list[Any] = [*map(list, BACKGROUNDS), None]
        return row[(row.index(value) + by) % len(row)] if value in row else row[0]
    choices = what_never_changes()["choices"][name]
    place = choices.index(value) + by
    if isinstance(choices[0], int):
        return choices[min(max(place, 0), len(choices) - 1)]
    return choices[place % len(choices)]


def _beside(row: tuple[float | None, ...], value: float | None, by: int) -> float | None:
    """Return the nearest greater or lesser number of a row whose first one is None, which is less than all."""
    place = -1.0 if value is None else value
    beyond = [each for each in row if ((-1.0 if each is None else each) - place) * by > 0]
    return value if not beyond else beyond[0] if by > 0 else beyond[-1]
