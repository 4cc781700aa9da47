"""auto: which technique a picture needs, found by a look at it that costs little beside drawing it.

All that may be chosen keep to the error that was asked for, whatever the look has missed: it decides how long the
picture takes and not how right it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from clpeel.device.devices import Gpu
from clpeel.device.layout import ALL_LAYERS, LIST_GAP
from clpeel.rendering.estimates import cost_of, work_of
from clpeel.stages.binning import Batch
from clpeel.stages.counting import TileCounts, look_at_some
from clpeel.stages.one_pass import OWN_BUFFERS, checked_error
from clpeel.stages.projection import Triangles
from clpeel.techniques import LAYERS, MAX_ERROR, TECHNIQUES, Technique, labelled
from clpeel.techniques.precision import DEFAULT_PRECISION, blending_bound

STEP = 1 / 255
"""Colours that lie no farther apart are at most one step apart when they are rounded to 8 bits."""

FEW_RECORDS = 8192
"""In tiles: a picture of fewer takes about a millisecond, and is not looked at."""

UNLIKELY = 2.0
"""Standard deviations: of a tile's 256 pixels few let more through than that."""


@dataclass(frozen=True)
class Alternative:
    """A technique that keeps to the error, with its options.

    nanoseconds: of drawing, where costs were measured (costs.py). nbytes: of the device's memory, with the scene.
    fits: whether the memory surely holds what it needs.
    """

    technique: str
    options: dict[str, Any]
    nanoseconds: float
    nbytes: int
    fits: bool

    @property
    def name(self) -> str:
        """The technique and those of its options that make it another."""
        return labelled(self.technique, self.options)


@dataclass(frozen=True)
class Choice:
    """What was chosen, the error that it keeps to, why, and what else there was, all of it."""

    chosen: Alternative
    max_error: float
    reason: str
    others: tuple[Alternative, ...]

    def explanation(self, seconds: dict[str, float]) -> list[str]:
        """Three lines: what, why, and what the alternatives would have taken, beside the seconds that this one has.

        seconds: by stage, of the device, as of `Result.stats`.
        """
        own = seconds.get(self.chosen.technique, 0.0)
        device = seconds["total"] - seconds["host"]
        others = self.others if self.chosen.nanoseconds else ()  # of what was not looked at nothing is known

        def cost(other: Alternative) -> str:
            about = device - own + own * other.nanoseconds / self.chosen.nanoseconds
            return f"{other.name} {took(about, other.nbytes)}{'' if other.fits else ' or more, which is not there'}"

        error = f"no channel is off by more than {self.max_error:.3g}" if self.max_error else "nothing is left out"
        return [
            f"auto chose {self.chosen.name}, in {DEFAULT_PRECISION}: {error}; {took(device, self.chosen.nbytes)}",
            f"as {self.reason}; half or unorm8 would save neither time nor memory here",
            f"others would take about: {'; '.join(map(cost, others))}" if others else "others would take no less",
        ]


def took(seconds: float, nbytes: int) -> str:
    """Of the device's time and memory."""
    milliseconds, mebibytes = 1000 * seconds, nbytes / 2**20
    texts = (f"{value:.3g}" if value < 1000 else f"{value:,.0f}" for value in (milliseconds, mebibytes))
    return "{} ms, {} MiB".format(*texts)


def error_for_8_bits(layers: int) -> float:
    """What may be left out of so many layers at most, so that with rounding no 8-bit value is off by over one step."""
    return max(STEP - blending_bound(layers), 0.0)


def layers_seen(max_error: float, mean: float, deviation: float) -> int:
    """How many layers almost all pixels need until no more than max_error is left, of such optical depths."""
    if max_error <= 0 or mean <= 0:
        return ALL_LAYERS
    # n mean - UNLIKELY deviation sqrt(n) = -ln(max_error)
    spread = UNLIKELY * deviation
    root = (spread + math.sqrt(spread**2 - 4 * mean * math.log(max_error))) / (2 * mean)
    return max(math.ceil(root**2 - 1e-6), 1)


def candidates(
    max_error: float, most_layers: int, most_alpha: float
) -> Iterator[tuple[str, Technique, dict[str, Any]]]:
    """Techniques that keep to the error with so many layers of such alphas, and their options."""
    for name, technique in TECHNIQUES.items():
        if technique.exact and MAX_ERROR in technique.options:
            for variant in technique.variants:
                yield name, technique, {**variant, MAX_ERROR: max_error}
        elif technique.left_out is not None and technique.left_out(most_layers, most_alpha) <= max_error:
            yield name, technique, {}


def choose(
    gpu: Gpu,
    triangles: Triangles,
    batch: Batch,
    most_layers: int,
    capacity_of: Callable[[Technique], int],
    max_error: float | None,
    layers: bool,
) -> Choice:
    """Looks at a batch and chooses.

    most_layers: the longest list of a tile, and so more than any pixel has. capacity_of: how many fragments the memory
    holds, of a technique. max_error: as of bounded (draw.py), None for error_for_8_bits. layers: whether they are asked
    for, which leaves those that peel.
    """
    checked = checked_error(max_error)
    error = error_for_8_bits(most_layers + 1) if checked is None else float(checked)
    features, records = triangles.features, int(batch.tile_pairs.sum())
    depths = triangles.scene.scene.optical_depths
    seen = layers_seen(error, depths.mean, depths.deviation)
    found: TileCounts | None = None
    if features.surfaces != "opaque" and records >= FEW_RECORDS:
        found = look_at_some(gpu, triangles, batch)
    held = triangles.scene.nbytes
    held += sum(int(buffer.size) for name, buffer in gpu.buffers.items() if name not in OWN_BUFFERS)
    choices = []
    for name, technique, options in candidates(error, most_layers, depths.most_alpha):
        if layers and LAYERS not in technique.options:
            continue
        capacity = capacity_of(technique)
        cost = None if found is None else cost_of(labelled(name, options), technique, found)
        if found is None:
            nanoseconds = 0.0
        elif cost is None:
            continue  # nobody has measured it
        else:
            nanoseconds = work_of(technique, found, features.fragment_color, options, seen).nanoseconds(cost)
        fits = not technique.stores_fragments or most_layers + LIST_GAP <= capacity
        nbytes = held + technique.device_bytes(gpu, features, batch, capacity, options)
        choices.append(Alternative(name, options, nanoseconds, nbytes, fits))
    # The registry's first is the exact one that has no need of the look.
    fitting = [choice for choice in choices if choice.fits] or choices
    best = min(fitting, key=lambda choice: choice.nanoseconds)
    others = sorted((choice for choice in choices if choice is not best), key=lambda choice: choice.nanoseconds)
    return Choice(best, error, reason(features.surfaces, found, seen, records), tuple(others))


def reason(surfaces: str, found: TileCounts | None, seen: int, records: int) -> str:
    """Why."""
    if surfaces == "opaque":
        return "nothing is transparent, so that one pass finds the nearest surfaces whatever the technique"
    if found is None:
        return f"so little is in view ({records:,} triangles in tiles) that a look would take longer than it could save"
    deepest = int(found.totals[:, 1].max())
    needed = f", of which {seen} hide what is behind" if seen < deepest else ""
    return (
        f"{len(found.records)} tiles have up to {deepest} layers{needed}, "
        f"{records / max(float(found.weights.sum()), 1):.3g} triangles each"
    )
