"""glowscript: opaque surfaces, then at most four peels in front of them (techniques/glowscript.cl).

"Details about handling transparency with depth peeling" (GlowScript): no occlusion query, as reading it back costs more
than the passes it saves, so that the number of passes is fixed.
"""

from __future__ import annotations

from typing import Any

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.stages.many_passes import check_peeling, checked_count, peel
from clpeel.stages.one_pass import Drawn
from clpeel.techniques.precision import DEFAULT_PRECISION, color_bytes

SUMMARY = (
    "the four foremost layers, or as many --passes as told, in front of opaque surfaces; what is behind is left out"
)
MOST_PEELS = 4


def passes_for(layers: Any, options: dict[str, Any]) -> Any:
    """As many as are told: nothing tells it that fewer would do."""
    return int(options.get("passes", MOST_PEELS))


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """z_near, slot, whether there is more, and the peels' colours; see Buffers in the kernel file."""
    return 2 * FRAGMENT_BYTES + 4 + MOST_PEELS * color_bytes(options)


def check(passes: int = MOST_PEELS, coincident: str = "keep", precision: str = DEFAULT_PRECISION) -> None:
    """InputError where one of the options cannot be."""
    checked_count("passes", passes, MOST_PEELS)
    check_peeling(coincident=coincident, precision=precision)


def draw(*arguments: Any, passes: int = MOST_PEELS, **options: Any) -> Drawn:
    """Draws a batch of tiles with `passes` peels (1..MOST_PEELS, else InputError)."""
    check(passes)
    return peel("techniques/glowscript.cl", 0, *arguments, passes=passes, occlusion_query=False, **options)


def peeled(passes: int = MOST_PEELS, **_: Any) -> tuple[int, int]:
    """One layer a peel, from the front."""
    return int(passes), 0
