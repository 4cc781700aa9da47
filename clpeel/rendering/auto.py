"""auto: chooses the technique that draws a picture fastest.

For that it counts a sample of the picture's tiles, which costs little beside drawing it. Only techniques that keep to
the requested error may be chosen. So a misleading sample can make the picture slower, but never less right.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

from clpeel.device.layout import ALL_LAYERS, COLOR_BYTES, FRAGMENT_BYTES, LIST_GAP, Features
from clpeel.device.memory import Budget
from clpeel.options import Options
from clpeel.pictures.png import STEP
from clpeel.rendering.estimates import cost_of, work_of
from clpeel.rendering.request import Request
from clpeel.rendering.shown_errors import may_hide, rounding_of, steepest
from clpeel.stages.binning import Batch, Tiles
from clpeel.stages.counting import TileCounts, look_at_some
from clpeel.stages.frame import float32_below
from clpeel.stages.many_passes import totals_bytes
from clpeel.stages.one_pass import OWN_BUFFERS, slab_bytes
from clpeel.techniques import TECHNIQUES, AnyTechnique
from clpeel.techniques.precision import DEFAULT_PRECISION, Bounded, blending_bound

FEW_RECORDS = 8192
"""A first batch with fewer records in its tiles takes about a millisecond. auto then draws without counting."""

UNLIKELY = 2.0
"""Standard deviations: few of a tile's 256 pixels let through more than the mean and so many of these."""


@dataclass(frozen=True)
class Alternative:
    """A technique with options that keep to the error.

    nanoseconds: of drawing, on the device where costs were measured (costs.py); 0 if nothing was counted. nbytes: bytes
    of the device's memory, with the scene. fits: whether what it needs is certain to fit the memory.
    """

    technique: AnyTechnique
    options: Options
    nanoseconds: float
    nbytes: int
    fits: bool

    @property
    def name(self) -> str:
        """The technique's name and the options that make it a different variant (Technique.label)."""
        return self.technique.label(self.options)


@dataclass(frozen=True)
class Choice:
    """What auto chose.

    max_error: the error that the chosen technique keeps to, 0..1. reason: one clause that says why. others: all
    alternatives that were not chosen, the fastest first.
    """

    chosen: Alternative
    max_error: float
    reason: str
    others: tuple[Alternative, ...]

    def explanation(self, seconds: dict[str, float]) -> list[str]:
        """Three lines of text: what was chosen, why, and what the alternatives would have taken.

        seconds: by stage, as in `Stats.seconds`. The alternatives' times are scaled by what the chosen one took.
        """
        own = seconds.get(self.chosen.technique.name, 0.0)
        device = seconds["total"] - seconds["host"]
        others = self.others if self.chosen.nanoseconds else ()  # without counts nothing is known of others

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
    """Time and memory of the device as text, in ms and MiB."""
    milliseconds, mebibytes = 1000 * seconds, nbytes / 2**20
    texts = (f"{value:.3g}" if value < 1000 else f"{value:,.0f}" for value in (milliseconds, mebibytes))
    return "{} ms, {} MiB".format(*texts)


def error_for_8_bits(layers: int, linear: bool = False) -> float:
    """The greatest error that skipping may make in so many layers. linear: if they are blended as linear light.

    Together with rounding, no 8-bit value is then off by more than one step.
    """
    return max(STEP - rounding_of(blending_bound(layers), linear), 0.0)


def layers_seen(max_error: float, mean: float, deviation: float) -> int:
    """How many layers almost all pixels need until they let through no more than max_error.

    mean, deviation: of the optical depths of the scene's transparent colours, -ln(1 - alpha). ALL_LAYERS if nothing may
    be skipped.
    """
    if max_error <= 0 or mean <= 0:
        return ALL_LAYERS
    # Solves n mean - UNLIKELY deviation sqrt(n) = -ln(max_error) for n.
    spread = UNLIKELY * deviation
    root = (spread + math.sqrt(spread**2 - 4 * mean * math.log(max_error))) / (2 * mean)
    return max(math.ceil(root**2 - 1e-6), 1)


def candidates(
    max_error: float, most_layers: int, most_alpha: float, linear: bool = False
) -> Iterator[tuple[AnyTechnique, Options]]:
    """Yields the techniques, with options, that keep to max_error.

    most_layers: no pixel has more. most_alpha: the greatest alpha of a transparent colour. linear: whether colours are
    blended as linear light.
    """
    for technique in TECHNIQUES.values():
        if technique.exact and issubclass(technique.options, Bounded):
            for variant in technique.variants():
                yield technique, replace(variant, max_error=max_error)
        else:
            error = technique.error_without_order(most_layers, most_alpha)
            if error is not None and steepest(linear) * error <= max_error:
                yield technique, technique.options()


def capacity_of(technique: AnyTechnique, features: Features, budget: Budget) -> int:
    """How many of the technique's fragments fit the budget."""
    widest = COLOR_BYTES if features.fragment_color else FRAGMENT_BYTES
    return budget.capacity(features.fragment_bytes + technique.scratch_bytes, widest)


def chosen_for(request: Request, tiles: Tiles, budget: Budget) -> tuple[Request, Iterator[Batch], Choice | None]:
    """The request with its final technique, the batches to draw, and what auto chose (None without auto).

    auto examines the first batch, which is a middle one of the picture, and chooses.
    """
    batches = tiles.batches(budget.batch, middle_first=request.is_auto)
    if not request.is_auto:
        return request, batches, None
    request.report(0.0, "looking")
    first = next(batches)
    choice = choose_technique(request, tiles, first, budget)
    chosen = request.chosen(choice.chosen.technique, choice.chosen.options)
    return chosen, chain((first,), batches), choice


def choose_technique(request: Request, tiles: Tiles, batch: Batch, budget: Budget) -> Choice:
    """Counts some tiles of a batch, and chooses among all techniques that keep to the request's error.

    If the request gives no error, it is error_for_8_bits. If layers are requested, only techniques that sort are left.
    """
    gpu, triangles = tiles.gpu, tiles.triangles
    most_layers = int(tiles.tile_pairs.max())  # the longest list: no pixel has more layers
    asked = request.max_error
    error = error_for_8_bits(most_layers + 1, request.linear) if asked is None else float32_below(asked)
    features, records = triangles.features, int(batch.tile_pairs.sum())
    depths = triangles.scene.scene.optical_depths
    seen = layers_seen(may_hide(error, request.linear), depths.mean, depths.deviation)
    found: TileCounts | None = None
    if features.surfaces != "opaque" and records >= FEW_RECORDS:
        found = look_at_some(gpu, triangles, batch)
    held = triangles.scene.nbytes + (0 if triangles.seen is None else triangles.seen.edges.nbytes)
    held += sum(int(buffer.size) for name, buffer in gpu.buffers.items() if name not in OWN_BUFFERS)
    choices = []
    # A highlight may cover all, and so may an edge.
    covering = features.wires or (request.lit is not None and request.lit.full_highlights)
    most_alpha = 1.0 if covering else depths.most_alpha
    for technique, options in candidates(error, most_layers, most_alpha, request.linear):
        if request.picture.layers and not technique.sorts:
            continue
        capacity = capacity_of(technique, features, budget)
        cost = None if found is None else cost_of(technique, options, found)
        if found is None:
            nanoseconds = 0.0
        elif cost is None:
            continue  # its costs were not measured
        else:
            nanoseconds = work_of(technique, found, features.fragment_color, options, seen).nanoseconds(cost)
        fits = not technique.stores_fragments or most_layers + LIST_GAP <= capacity
        nbytes = held + (
            slab_bytes(gpu, features, batch, capacity, technique.scratch_bytes)
            if technique.stores_fragments
            else totals_bytes(batch)
        )
        choices.append(Alternative(technique, options, nanoseconds, nbytes, fits))
    # Without counts all are equal, and min takes the first of the registry: an exact one, which needs no estimate.
    fitting = [choice for choice in choices if choice.fits] or choices
    best = min(fitting, key=lambda choice: choice.nanoseconds)
    others = sorted((choice for choice in choices if choice is not best), key=lambda choice: choice.nanoseconds)
    return Choice(best, error, reason(features.surfaces, found, seen, records), tuple(others))


def reason(surfaces: str, found: TileCounts | None, seen: int, records: int) -> str:
    """One clause that explains the choice, for Choice.explanation.

    found: what was counted, or None. seen: how many layers hide what is behind (layers_seen). records: of the batch.
    """
    if surfaces == "opaque":
        return "nothing is transparent, so that one pass finds the nearest surfaces whatever the technique"
    if found is None:
        return f"so little is in view ({records:,} triangles in tiles) that a look would take longer than it could save"
    deepest = int(found.totals["layers"].max())
    needed = f", of which {seen} hide what is behind" if seen < deepest else ""
    return (
        f"{len(found.records)} tiles have up to {deepest} layers{needed}, "
        f"{records / max(float(found.weights.sum()), 1):.3g} triangles each"
    )
