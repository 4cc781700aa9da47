"""Heat maps: how far each pixel is from the truth, which is the same fragments blended in float64."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import checked_background
from clpeel.errors import InputError
from clpeel.pictures.scale_bar import draw_scale_bar
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.request import Progress
from clpeel.rendering.result import Stats
from clpeel.study.compare import true_colors
from clpeel.study.comparison import shown
from clpeel.study.page import LEAST_STEP, MOST_STEP, heat
from clpeel.techniques import AUTO, TECHNIQUES
from clpeel.viewer.view import View

STEPS = 255
"""Steps of 8 bits in a channel."""


@dataclass(frozen=True)
class Errors:
    """A heat map. image: uint8 [height, width, 4]. max_error, rms_error: of RGB over the background, of 1."""

    image: NDArray[np.uint8]
    stats: Stats
    max_error: float
    rms_error: float


def error_map(renderer: Renderer, view: View, progress: Progress | None) -> Errors:
    """Draw the view, and in each pixel how far its most wrong channel is from the truth, on a logarithmic scale.

    Raises InputError if the technique's picture is a map itself.
    """
    if view.technique != AUTO and TECHNIQUES[view.technique].maps:
        raise InputError(
            f"heat map: expected a technique that blends colours, got {view.technique!r}, which makes a map"
        )
    drawn = renderer.render(view.camera, technique=view.technique, progress=progress, **_alone(view, view.technique))
    color, stats = drawn.color, drawn.stats
    truth = renderer.render(view.camera, technique="sort", progress=progress, layers=True, **_alone(view, "sort"))
    over = checked_background(view.background) or (1.0, 1.0, 1.0)
    error = np.abs(shown(color, over) - shown(true_colors(truth.layers), over))
    error[np.isnan(error)] = 1
    image = heat(error.max(axis=-1).astype(np.float32))
    low, high = math.log10(LEAST_STEP / STEPS), math.log10(MOST_STEP / STEPS)
    draw_scale_bar(image, low, high, "error, 10^", np.asarray(image[..., :3].any(axis=-1)), unpaired=False, whole=True)
    return Errors(image, stats, float(error.max()), math.sqrt(float(np.mean(error * error))))


def _alone(view: View, technique: str) -> dict[str, Any]:
    """Return the view's keywords with one sample a pixel, as only these have layers.

    Layers are colours as they are shown. So both pictures are blended as they are shown, too.
    """
    left_out = ("samples", "keep_color", "blending_space")
    own = {name: value for name, value in view.keywords(technique).items() if name not in left_out}
    if technique != view.technique:  # the truth skips nothing and rounds nothing
        own = {name: value for name, value in own.items() if name not in ("max_error", "precision", "execution")}
    return own
