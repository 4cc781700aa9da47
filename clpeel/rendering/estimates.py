"""Estimates: what drawing would take, from what was counted and the table of what things cost (costs.py)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import ALL_LAYERS, TILE_PIXELS
from clpeel.options import Options
from clpeel.rendering import costs
from clpeel.rendering.costs import Cost
from clpeel.stages.counting import Counted, TileCounts
from clpeel.techniques import AnyTechnique


@dataclass(frozen=True)
class Work:
    """How often the things are done that have a cost (costs.py); walk: nanoseconds that counting would take for it."""

    walk: float
    fragment: float
    lit_visit: float
    lit_fragment: float
    pixel: float

    def nanoseconds(self, cost: Cost) -> float:
        """What it takes where the costs were measured."""
        return (
            self.walk * cost.walk
            + self.fragment * cost.fragment
            + self.lit_visit * cost.lit_visit
            + self.lit_fragment * cost.lit_fragment
            + self.pixel * cost.pixel
        )


def counting_nanoseconds(records: NDArray[np.int64], visits: NDArray[np.int64]) -> NDArray[np.float64]:
    """Of a walk over so many records that visits so many strips, but for what counting stores of each pixel."""
    return costs.RECORD * records + costs.VISIT * visits


def work_of(technique: AnyTechnique, tiles: TileCounts, shaded: bool, options: Options, seen: int = ALL_LAYERS) -> Work:
    """What drawing takes: all of a tile's transparent records once in each pass that the tile needs.

    A tile makes as many passes as its own deepest pixel needs, or `seen` layers, behind which nothing is peeled.
    options: of the technique.
    """
    totals, records, weights = tiles.totals, tiles.records, tiles.weights
    fragments, deepest, visits = totals["fragments"], totals["layers"], totals["visits"]
    opaque_visits, opaque_records = totals["opaque_visits"], totals["opaque_records"]
    if technique.all_surfaces:
        fragments, deepest, visits = totals["all_fragments"], totals["all_layers"], visits + opaque_visits
        opaque_visits = opaque_records = np.zeros_like(records)
    elif tiles.features.surfaces == "opaque":
        drawn = float(weights @ totals["opaque"])
        walk = float(weights @ counting_nanoseconds(records, opaque_visits))
        return Work(walk, drawn, 0.0, drawn * shaded, tiles.pixels)
    records = records - opaque_records
    if technique.stores_fragments:
        seen = ALL_LAYERS  # it has them all before it can tell
    elif (peeled := technique.peeled(options)) is not None:
        seen = min(seen, sum(peeled))
    needed = np.minimum(deepest, seen)
    passes = np.maximum(technique.passes_for(needed, options), 1)
    walks = passes * counting_nanoseconds(records, visits) + counting_nanoseconds(opaque_records, opaque_visits)
    drawn = np.minimum(fragments, TILE_PIXELS * needed)
    # What is lit is lit by strips, of which a triangle smaller than a pixel has as many as a larger one.
    lit = float(weights @ (visits * drawn / np.maximum(fragments, 1))) if shaded else 0.0
    total = float(weights @ drawn)
    return Work(float(weights @ walks), total, lit, total * shaded, tiles.pixels)


def cost_of(technique: AnyTechnique, options: Options, tiles: TileCounts) -> Cost | None:
    """The row of the table; None where it has not been measured."""
    all_opaque = tiles.features.surfaces == "opaque" and not technique.all_surfaces
    return costs.ALL_OPAQUE_COST if all_opaque else costs.COSTS.get(technique.variant(options))


def scale_of(counted: Counted) -> float:
    """How many times as long counting took as it does where the costs were measured."""
    tiles = counted.tiles
    visits = tiles.totals["visits"] + tiles.totals["opaque_visits"]
    expected = float(counting_nanoseconds(tiles.records, visits).sum())
    return counted.walk_seconds * 1e9 / (expected + costs.PIXEL * tiles.pixels)


def estimated_seconds(technique: AnyTechnique, counted: Counted, shaded: bool, options: Options) -> float | None:
    """Of the stages before, as measured, and of drawing by the table, scaled as counting was beside the table."""
    cost = cost_of(technique, options, counted.tiles)
    if cost is None:
        return None
    work = work_of(technique, counted.tiles, shaded, options)
    return counted.setup_seconds + 1e-9 * scale_of(counted) * work.nanoseconds(cost)
