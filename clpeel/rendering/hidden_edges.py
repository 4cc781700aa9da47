"""Hidden edges: those behind opaque surfaces shine through these, with an opacity of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clpeel.device.memory import Budget
from clpeel.device.workspace import Workspace
from clpeel.pictures.background import rows_of
from clpeel.pictures.layers import over_background
from clpeel.pictures.over import converted
from clpeel.rendering.auto import capacity_of
from clpeel.rendering.request import Request
from clpeel.scene.textures import linear, srgb
from clpeel.stages.binning import bin_triangles
from clpeel.stages.composite import Finished, Picture
from clpeel.stages.frame import Frame
from clpeel.stages.projection import Triangles
from clpeel.techniques import technique
from clpeel.techniques.precision import Bounded


def with_hidden_edges(
    gpu: Workspace, request: Request, triangles: Triangles, budget: Budget, finished: Finished
) -> Finished:
    """Returns the picture with the edges over it that its opaque surfaces hide, blended front to back, pixel by pixel.

    finished: the picture, with its colours.
    """
    seen = triangles.seen
    # Without opaque surfaces nothing is hidden.
    if seen is None or seen.behind is None or triangles.features.surfaces != "mixed":
        return finished
    sort, shared = technique("sort"), Bounded()
    triangles = replace(triangles, seen=replace(seen, shading=seen.behind))
    tiles = bin_triangles(gpu, triangles, budget.lists)  # again, as lists are made once
    picture = Picture(gpu, request.picture.size, keep_color=True)
    target = picture.begin(request.picture.pattern, None, request.linear)
    frame = Frame(gpu, triangles, target, capacity_of(sort, triangles.features, budget), budget)
    for batch in tiles.batches(budget.batch):
        frame.once(batch, sort.kernel, {**shared.constants, "BEHIND": 1}, scratch_bytes=sort.scratch_bytes)
    picture.fetch()
    over, under = picture.color, finished.color
    assert over is not None and under is not None  # the renderer sees to it
    background = request.picture.over
    if not request.linear:
        color = over + (1 - over[..., 3:]) * under
        image = over_background(color[..., :3], 1 - color[..., 3:], background)
    else:
        light = converted(over, linear) + (1 - over[..., 3:]) * converted(under, linear)
        color, through = converted(light, srgb).astype(np.float32), (1 - light[..., 3:]).astype(np.float32)
        if background is None:
            image = over_background(color[..., :3], through, None)
        else:
            shown = srgb(light[..., :3] + through * linear(rows_of(background, len(light))))
            image = over_background(shown.astype(np.float32), np.zeros_like(through), background)
    return Finished(image, color if request.picture.keep_color else None, finished.maps, finished.stats)
