"""The controls: what each drag, key and setting does to the view. The first ones are those of the paper's own program.

Bavoil and Myers, "Order Independent Transparency with Dual Depth Peeling" (2008), "Running the Sample".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

from clpeel.checks import checked_background, one_of
from clpeel.errors import InputError
from clpeel.rendering.options import Size
from clpeel.scene.arrays import checked_opacity
from clpeel.scene.camera import Camera
from clpeel.techniques import AUTO, TECHNIQUES, option_names
from clpeel.viewer import motion
from clpeel.viewer.view import LIGHTINGS, View

TECHNIQUE_KEYS = {
    "1": "dual-depth-peeling",
    "2": "depth-peeling",
    "3": "weighted-average",
    "4": "weighted-sum",
    "5": "multi-layer-peeling",
    "6": "glowscript",
    "7": "sort",
    "8": "thickness",
    "9": "translucency",
    "0": AUTO,
}

KEYS: tuple[tuple[str, str], ...] = (
    ("drag", "rotate"),
    ("Ctrl + drag, right drag", "pan"),
    ("Shift + drag", "dolly"),
    ("wheel", "zoom to the pointer"),
    ("double click", "look at what is there"),
    ("A D", "less, more opacity"),
    *((key, name) for key, name in TECHNIQUE_KEYS.items()),
    ("Q", "occlusion query on or off"),
    ("+ -", "more, fewer passes"),
    ("[ ]", "fewer, more layers a pass"),
    ("M", "picture, heat map of layers, heat map of errors"),
    ("O", "parallel projection on or off"),
    ("Space", "turn the scene, or stop"),
    ("R", "the first view"),
    ("B", "background"),
    ("L", "next light"),
    ("S", "save the full picture as PNG"),
    ("C", "the command line that makes this picture"),
    ("P", "show or hide the panel"),
    ("H", "show or hide this help"),
)
"""What the hand can do, and what that does."""

BACKGROUNDS = ((1.0, 1.0, 1.0), (0.8, 0.8, 0.8), (0.2, 0.2, 0.2), (0.0, 0.0, 0.0))
"""What the key B goes through, after the background that was given."""

OPACITY_STEP = 0.05

SHOWN = ("picture", "layers", "error")

Framing = Callable[[Size], Camera]
"""Makes the camera for a picture of so many pixels, (width, height)."""

LEFT, RIGHT, MIDDLE = 1, 2, 3
"""The numbers of mouse buttons in events."""


class Actions(Protocol):
    """What keys do besides changing the view."""

    def save(self) -> None: ...

    def print_command(self) -> None: ...

    def pick(self, at: motion.Place) -> None: ...

    def toggle(self, what: str) -> None: ...


@dataclass
class Controls:
    """Keeps the view that is shown, and changes it.

    radius: of the scene, in world units. alpha: the mean of the scene's own, from which changing the opacity begins.
    screen: the (width, height) of the screen in logical pixels. framing: makes the first camera anew once the screen
    tells its size in pixels; None keeps the view's. passes: what the latest picture took.
    """

    view: View
    radius: float
    alpha: float
    actions: Actions
    screen: tuple[float, float]
    framing: Framing | None = None
    passes: int = 1

    def __post_init__(self) -> None:
        self.home, self._first = self.view, self.view.camera
        self._drag: tuple[int, motion.Place] | None = None

    def resize(self, screen: tuple[float, float], pixels: Size) -> None:
        """Take the size of the screen, in logical pixels and in real ones."""
        self.screen = screen
        if self.framing is not None:
            self.home = replace(self.home, camera=self.framing(pixels))
            if self.view.camera is self._first:
                self.view = replace(self.view, camera=self.home.camera)
            self.framing = None
        if pixels != self.view.size:
            self.view = replace(self.view, size=pixels)

    def set(self, name: str, value: object) -> None:
        """Change a setting. Raises InputError if there is no such setting, or if the value is wrong."""
        if name in _SETTERS:
            view = _SETTERS[name](self.view, value)
        elif name in OPTION_NAMES:
            view = self.view.with_option(name, value)
            if name == "occlusion_query":
                view = self._with_query(view, value)
        else:
            raise InputError(f"setting: expected one of {', '.join(SETTINGS)}; got {name!r}")
        view.check()
        self.view = view

    def _with_query(self, view: View, value: object) -> View:
        """Return the view with as many passes as the latest picture took, if no query ends them; else with no limit."""
        if value is False:
            return view.with_option("passes", view.options.get("passes", max(self.passes, 1)))
        if value is not True and value is not None:
            return view  # wrong: whoever checks it says so
        return view.with_option("passes", None).with_option("occlusion_query", None)

    def look(self, camera: Camera | None) -> None:
        """Take a camera, unless it is None."""
        if camera is not None:
            self.view = replace(self.view, camera=camera)

    # --- events -------------------------------------------------------------------------------------------------------

    def handle(self, event: Mapping[str, Any]) -> None:
        """Do what an event of rendercanvas asks for. Raises InputError if that is impossible."""
        handler, before = _HANDLERS.get(event["event_type"]), self.view
        if handler is not None:
            handler(self, event)
        if self.view is not before:
            self.view = replace(self.view, answers=event.get("timestamp", 0.0))

    def _down(self, event: Mapping[str, Any]) -> None:
        if self._drag is None and event["button"] in (LEFT, RIGHT, MIDDLE):
            self._drag = (event["button"], (event["x"], event["y"]))

    def _up(self, event: Mapping[str, Any]) -> None:
        if self._drag is not None and event["button"] in (0, self._drag[0]):
            self._move(event)
            self._drag = None

    def _move(self, event: Mapping[str, Any]) -> None:
        if not event["buttons"] and event["event_type"] == "pointer_move":
            self._drag = None  # the button was let go where nobody saw it
        if self._drag is None:
            return
        button, (x, y) = self._drag
        by = event["x"] - x, event["y"] - y
        self._drag = button, (event["x"], event["y"])
        if by == (0, 0):
            return
        modifiers, camera = event["modifiers"], self.view.camera
        if button in (RIGHT, MIDDLE) or "Control" in modifiers:
            camera = motion.panned(camera, by, self.screen)
        elif "Shift" in modifiers:
            camera = motion.dollied(camera, by, self.screen, self.radius)
        else:
            camera = motion.rotated(camera, by, self.screen)
        self.look(camera)

    def _wheel(self, event: Mapping[str, Any]) -> None:
        at = event["x"], event["y"]
        turned = min(max(event["dy"], -1000.0), 1000.0)
        self.look(motion.zoomed(self.view.camera, turned, at, self.screen, self.radius))

    def _double_click(self, event: Mapping[str, Any]) -> None:
        self._drag = None
        self.actions.pick((event["x"], event["y"]))

    def _key(self, event: Mapping[str, Any]) -> None:
        if {"Control", "Alt", "Meta"} & set(event["modifiers"]):
            return
        key = event["key"].lower()
        if key in TECHNIQUE_KEYS:
            self.set("technique", TECHNIQUE_KEYS[key])
        elif key in _KEYS:
            _KEYS[key](self)

    def _fade(self, by: float) -> None:
        view = self.view
        old = self.alpha if view.opacity is None else view.opacity
        self.set("opacity", min(max(round(old + by, 2), 0.0), 1.0))

    def _toggle_query(self) -> None:
        self._needs("occlusion_query")
        self.set("occlusion_query", self.view.options.get("occlusion_query") is False)

    def _more_passes(self, by: int) -> None:
        self._needs("passes")
        now = self.view.options.get("passes")
        self.set("passes", max((now if isinstance(now, int) else self.passes) + by, 1))

    def _more_layers(self, factor: float) -> None:
        self._needs("layers_per_pass")
        now = self.view.options.get("layers_per_pass")
        before = now if isinstance(now, int) else 8
        self.set("layers_per_pass", min(max(int(before * factor), 1), 64))

    def _needs(self, option: str) -> None:
        if option not in option_names(self.view.technique):
            having = [name for name in TECHNIQUES if option in option_names(name)]
            raise InputError(
                f"{option}: expected a technique that has it, {', '.join(having)}; got {self.view.technique}"
            )

    def _next_background(self) -> None:
        row = (self.home.background, *(each for each in BACKGROUNDS if each != self.home.background))
        place = row.index(self.view.background) if self.view.background in row else -1
        self.view = replace(self.view, background=row[(place + 1) % len(row)])

    def _next_shown(self) -> None:
        self.set("shows", SHOWN[(SHOWN.index(self.view.shows) + 1) % len(SHOWN)])

    def _next_light(self) -> None:
        row = (self.home.lighting, *(each for each in LIGHTINGS if each != self.home.lighting))
        self.set("lighting", row[(row.index(self.view.lighting) + 1) % len(row)])

    def _toggle_parallel(self) -> None:
        self.set("orthographic", not self.view.camera.orthographic)

    def _toggle_turning(self) -> None:
        self.set("turning", not self.view.turning)

    def _reset(self) -> None:
        self.view = replace(self.home, size=self.view.size)


# --- settings ---------------------------------------------------------------------------------------------------------


def _set_technique(view: View, value: object) -> View:
    one_of("technique", value, (*TECHNIQUES, AUTO))
    return replace(view, technique=str(value))


def _set_shows(view: View, value: object) -> View:
    one_of("shows", value, SHOWN)
    return replace(view, shows=value)  # type: ignore[arg-type]


def _set_opacity(view: View, value: object) -> View:
    return replace(view, opacity=None if value is None else checked_opacity(value))


def _set_background(view: View, value: object) -> View:
    return replace(view, background=checked_background(value))


def _set_lighting(view: View, value: object) -> View:
    one_of("lighting", value, (*LIGHTINGS, "scene"))
    return replace(view, lighting=value)  # type: ignore[arg-type]


def _set_orthographic(view: View, value: object) -> View:
    one_of("orthographic", value, (False, True))
    return replace(view, camera=replace(view.camera, orthographic=bool(value)))


def _set_turning(view: View, value: object) -> View:
    one_of("turning", value, (False, True))
    return replace(view, turning=bool(value))


_SETTERS: dict[str, Callable[[View, object], View]] = {
    "technique": _set_technique,
    "shows": _set_shows,
    "opacity": _set_opacity,
    "background": _set_background,
    "lighting": _set_lighting,
    "orthographic": _set_orthographic,
    "turning": _set_turning,
}

OPTION_NAMES = (
    "passes",
    "occlusion_query",
    "layers_per_pass",
    "precision",
    "depth_format",
    "max_error",
    "coincident",
    "opaque",
    "execution",
    "samples",
)
"""The options of techniques and of pictures that the panel has."""

SETTINGS = (*_SETTERS, *OPTION_NAMES)
"""The names of everything that can be set."""

_HANDLERS: dict[str, Callable[[Controls, Mapping[str, Any]], None]] = {
    "pointer_down": Controls._down,
    "pointer_up": Controls._up,
    "pointer_move": Controls._move,
    "wheel": Controls._wheel,
    "double_click": Controls._double_click,
    "key_down": Controls._key,
}

_KEYS: dict[str, Callable[[Controls], None]] = {
    "a": lambda self: self._fade(-OPACITY_STEP),
    "d": lambda self: self._fade(OPACITY_STEP),
    "q": Controls._toggle_query,
    "+": lambda self: self._more_passes(1),
    "=": lambda self: self._more_passes(1),
    "-": lambda self: self._more_passes(-1),
    "[": lambda self: self._more_layers(0.5),
    "]": lambda self: self._more_layers(2),
    "m": Controls._next_shown,
    "o": Controls._toggle_parallel,
    " ": Controls._toggle_turning,
    "r": Controls._reset,
    "b": Controls._next_background,
    "l": Controls._next_light,
    "s": lambda self: self.actions.save(),
    "c": lambda self: self.actions.print_command(),
    "p": lambda self: self.actions.toggle("panel"),
    "h": lambda self: self.actions.toggle("help"),
    "?": lambda self: self.actions.toggle("help"),
}


def radius_of(bounds: Any) -> float:
    """Return half the diagonal of the bounds [2, 3], or 1 if that is 0."""
    return math.dist(bounds[0], bounds[1]) / 2 or 1.0
