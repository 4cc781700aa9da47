"""Plain pictures: unlit, with one sample a pixel, over white. Most tests compute what these show by hand.

`clpeel.render` itself has light, smooth edges and a grey background by default, as its first picture is for people.
"""

from __future__ import annotations

from typing import Any

import clpeel

WHITE = (1.0, 1.0, 1.0)
PLAIN: dict[str, Any] = {"background": WHITE, "lighting": "none", "samples": 1}
"""Options of plain pictures, where they differ from the defaults."""


def render(
    scene: clpeel.Scene,
    camera: clpeel.Camera | None = None,
    size: tuple[int, int] = (1024, 1024),
    technique: str = "sort",
    background: Any = WHITE,
    lighting: Any = "none",
    **options: Any,
) -> clpeel.Result:
    """Do what `clpeel.render` does, by default as a plain picture."""
    chosen = {"samples": 1, "background": background, "lighting": lighting, **options}
    return clpeel.render(scene, camera, size, technique, **chosen)


class Renderer(clpeel.Renderer):
    """A `clpeel.Renderer` whose pictures are plain by default."""

    def render(  # type: ignore[override]
        self,
        camera: clpeel.Camera | None = None,
        size: tuple[int, int] = (1024, 1024),
        technique: str = "sort",
        background: Any = WHITE,
        lighting: Any = "none",
        **options: Any,
    ) -> clpeel.Result:
        """Do what `clpeel.Renderer.render` does, by default as a plain picture."""
        chosen = {"samples": 1, "background": background, "lighting": lighting, **options}
        return super().render(camera, size, technique, **chosen)
