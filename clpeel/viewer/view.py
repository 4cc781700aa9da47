"""The view: what is shown. A view is never changed; whoever changes something makes a new one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from clpeel.checks import GivenBackground
from clpeel.options import options_of
from clpeel.rendering.options import Lighting, PictureOptions, Size
from clpeel.rendering.request import checked_options
from clpeel.scene.camera import Camera
from clpeel.techniques import option_names

LIGHTINGS: tuple[Lighting, ...] = ("kit", "headlight", "none")
"""What light there may be on any scene. A scene may have lights of its own besides."""

SAMPLES = 1
"""Samples a pixel of a view, unless its options say otherwise: frames count."""

Shows = Literal["picture", "layers", "error"]
"""The picture, how many layers each pixel has, or how far each pixel is from the truth in float64."""

LAYER_COUNT = "layer-count"
"""The technique whose picture shows how many layers each pixel has."""

_OF_ALL = {each.name for each in options_of(PictureOptions)}


@dataclass(frozen=True)
class View:
    """What is shown.

    size: (width, height) in pixels, those of the screen. options: what the user set of all techniques' options and of
    all pictures' options, by name. A technique is given those that it has. opacity: replaces every alpha, 0..1; None
    keeps the scene's own. shows: see Shows. turning: whether the scene turns by itself. answers: the timestamp of the
    newest event that this view has in it, in seconds by the clock of the screen that it came from; 0 before the first.
    """

    camera: Camera
    size: Size
    technique: str = "sort"
    options: Mapping[str, object] = field(default_factory=dict)
    background: GivenBackground = (1.0, 1.0, 1.0)
    lighting: Lighting = "kit"
    opacity: float | None = None
    shows: Shows = "picture"
    turning: bool = False
    answers: float = 0.0

    def keywords(self, technique: str | None = None) -> dict[str, Any]:
        """Return the keywords of `Renderer.render` for this view, except camera and technique.

        technique: draw by this one in place of the view's own.
        """
        has = option_names(technique or self.technique)
        own = {name: value for name, value in self.options.items() if name in has or name in _OF_ALL}
        return {"size": self.size, "background": self.background, "lighting": self.lighting, "samples": SAMPLES, **own}

    def check(self) -> None:
        """Raise InputError if the technique cannot draw with these options."""
        checked_options(self.technique, self.keywords())

    def with_option(self, name: str, value: object) -> View:
        """Return the view with an option of its technique, or of all pictures, set. None is its default."""
        options = {key: old for key, old in self.options.items() if key != name}
        if value is not None:
            options[name] = value
        return replace(self, options=options)
