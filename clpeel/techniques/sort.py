"""sort: the exact picture, by sorting each pixel's fragments (techniques/sort.cl)."""

from __future__ import annotations

import pyopencl as cl

from clpeel.device import Gpu
from clpeel.layout import FRAGMENT_BYTES, RUN_MAX
from clpeel.program import launch, program
from clpeel.raster import Fragments

SUMMARY = "exact: sorts each pixel's fragments by depth, then blends them front to back"
SCRATCH_BYTES = FRAGMENT_BYTES
"""Room to merge long lists in, taken only where a pixel has more than RUN_MAX fragments."""


def resolve(gpu: Gpu, fragments: Fragments, layer: cl.Buffer) -> None:
    """Front to back under blending in the order (depth, submission index), float32 (Bavoil and Myers 2008)."""
    scratch = gpu.buffer("scratch", SCRATCH_BYTES * fragments.count) if fragments.layers_max > RUN_MAX else None
    launch(
        gpu,
        "sort",
        program(gpu, "techniques/sort.cl", fragments.features)["resolve"],
        fragments.tiles,
        gpu.lanes,
        fragments=fragments.fragments,
        scratch=scratch,
        pixel_end=fragments.pixel_end,
        tile_start=fragments.tile_start,
        colors=fragments.colors,
        window_tile=fragments.window_tile,
        first_pixel=fragments.first_pixel,
        last_pixel=fragments.last_pixel,
        layer=layer,
    )
