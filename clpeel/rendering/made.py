"""Made: what a result was made of, so that its files can say it (pictures/provenance.py)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from clpeel.rendering.request import Request
from clpeel.scene.scene import Scene
from clpeel.version import VERSION

SOFTWARE = f"clpeel {VERSION}"

NOT_SEEN = ("keep_color", "layers", "maps", "memory")
"""Options that change no picture."""


class Made(NamedTuple):
    """What a result was made of. opacity: that of Renderer.set_opacity."""

    request: Request
    scene: Scene
    opacity: float | None

    def words(self, technique: str, device: str) -> dict[str, str]:
        """Return it as texts by name. The first call for a scene computes the scene's digest."""
        faces, lines, points = self.scene.counts
        counts = ", ".join(f"{n} {word}" for n, word in ((faces, "faces"), (lines, "lines"), (points, "points")) if n)
        return {
            "software": SOFTWARE,
            "python": ", ".join(f"{name}={value!r}" for name, value in self._options()),
            "camera": repr(self.request.camera),
            "technique": technique,
            "scene": f"sha256:{self.scene.digest} ({counts})",
            "device": device,
        }

    def _options(self) -> Iterator[tuple[str, object]]:
        """Yield the options that were given, and the size."""
        picture = self.request.picture
        yield "size", picture.size
        yield from ((name, value) for name, value in picture.given() if name not in ("size", *NOT_SEEN))
        yield from self.request.options.given()
        if self.opacity is not None:
            yield "set_opacity", self.opacity
