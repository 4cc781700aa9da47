"""depth-peeling: the nearest layer beyond the one before, pass by pass (techniques/depth-peeling.cl).

Everitt 2001; Bavoil and Myers 2008, "Depth Peeling": N layers take N geometry passes.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from clpeel.device.layout import ALL_LAYERS
from clpeel.stages.many_passes import peel
from clpeel.techniques import multi_layer_peeling

SUMMARY = "exact: peels the nearest layer in each geometry pass; N layers take N passes"


def passes_for(layers: Any, options: dict[str, Any]) -> Any:
    """N (Everitt 2001)."""
    return layers


def buffer_bytes(layers: int, options: dict[str, Any]) -> int:
    """Those of multi-layer peeling of one layer a pass."""
    return multi_layer_peeling.buffer_bytes(layers, {**options, "layers_per_pass": 1})


draw = partial(peel, "techniques/depth-peeling.cl", 0)


def peeled(passes: int | None = None, **_: Any) -> tuple[int, int]:
    """One layer a pass, from the front."""
    return ALL_LAYERS if passes is None else int(passes), 0
