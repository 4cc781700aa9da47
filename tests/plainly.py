"""Plain pictures: unlit, with one sample a pixel, over white. Most tests compute what these show by hand.

`clpeel.render` itself has light, smooth edges and a grey background by default, as its first picture is for people.
"""

from __future__ import annotations

from typing import Any

import clpeel

PLAIN: dict[str, Any] = {"background": (1.0, 1.0, 1.0), "lighting": "none", "samples": 1}
"""Options of plain pictures, where they differ from the defaults."""

IN_ORDER = ("camera", "size", "technique", "background", "lighting")
"""What may be given without its name."""


def options_of(given: tuple[Any, ...], named: dict[str, Any]) -> dict[str, Any]:
    """Return the options of a picture that is plain, but for what is given."""
    return {**PLAIN, **dict(zip(IN_ORDER[: len(given)], given, strict=True)), **named}


def render(scene: clpeel.Scene, *given: Any, **named: Any) -> clpeel.Result:
    """Do what `clpeel.render` does, by default as a plain picture."""
    return clpeel.render(scene, **options_of(given, named))


class Renderer(clpeel.Renderer):
    """A `clpeel.Renderer` whose pictures are plain by default."""

    def render(self, *given: Any, **named: Any) -> clpeel.Result:  # type: ignore[override]
        """Do what `clpeel.Renderer.render` does, by default as a plain picture."""
        return super().render(**options_of(given, named))
