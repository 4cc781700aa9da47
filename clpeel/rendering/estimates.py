"""Estimates: what drawing would take, from what was counted and the table of what things cost (costs.py)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clpeel.device.layout import ALL_LAYERS, TILE_PIXELS
from clpeel.rendering import costs
from clpeel.rendering.costs import Cost
from clpeel.stages.counting import Counted, TileCounts
from clpeel.techniques import Technique, labelled


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


def counting_nanoseconds(records: Any, visits: Any) -> Any:
    """Of a walk over so many records that visits so many strips, but for what counting stores of each pixel."""
    return costs.RECORD * records + costs.VISIT * visits


def work_of(
    technique: Technique, tiles: TileCounts, shaded: bool, options: dict[str, Any], seen: int = ALL_LAYERS
) -> Work:
    """What drawing takes: all of a tile's transparent records once in each pass that the tile needs.

    A tile makes as many passes as its own deepest pixel needs, or `seen` layers, behind which nothing is peeled.
    options: of the technique.
    """
    fragments, deepest, solid, all_fragments, all_deepest, visits, opaque_visits, opaque_records = tiles.totals.T
    records, weights = tiles.records, tiles.weights
    if technique.maps:  # of all surfaces, whatever their alphas
        fragments, deepest, visits = all_fragments, all_deepest, visits + opaque_visits
        opaque_visits = opaque_records = np.zeros_like(records)
    elif tiles.features.surfaces == "opaque":
        drawn = float(weights @ solid)
        walk = float(weights @ counting_nanoseconds(records, opaque_visits))
        return Work(walk, drawn, 0.0, drawn * shaded, tiles.pixels)
    records = records - opaque_records
    if technique.stores_fragments:
        seen = ALL_LAYERS  # it has them all before it can tell
    elif technique.peeled is not None:
        seen = min(seen, sum(technique.peeled(**options)))
    needed = np.minimum(deepest, seen)
    passes = np.maximum(technique.passes_for(needed, options), 1)
    walks = passes * counting_nanoseconds(records, visits) + counting_nanoseconds(opaque_records, opaque_visits)
    drawn = np.minimum(fragments, TILE_PIXELS * needed)
    # What is lit is lit by strips, of which a triangle smaller than a pixel has as many as a larger one.
    lit = float(weights @ (visits * drawn / np.maximum(fragments, 1))) if shaded else 0.0
    total = float(weights @ drawn)
    return Work(float(weights @ walks), total, lit, total * shaded, tiles.pixels)


def cost_of(row: str, technique: Technique, tiles: TileCounts) -> Cost | None:
    """The row of the table; None where it has not been measured."""
    all_opaque = tiles.features.surfaces == "opaque" and not technique.maps
    return costs.OPAQUE if all_opaque else costs.COSTS.get(row)


def scale_of(counted: Counted) -> float:
    """How many times as long counting took as it does where the costs were measured."""
    tiles = counted.tiles
    expected = counting_nanoseconds(float(tiles.records.sum()), float(tiles.totals[:, 5:7].sum()))
    return counted.walk_seconds * 1e9 / (expected + costs.PIXEL * tiles.pixels)


def estimated_seconds(
    name: str, technique: Technique, counted: Counted, shaded: bool, options: dict[str, Any]
) -> float | None:
    """Of the stages before, as measured, and of drawing by the table, scaled as counting was beside the table."""
    cost = cost_of(labelled(name, options), technique, counted.tiles)
    if cost is None:
        return None
    work = work_of(technique, counted.tiles, shaded, options)
    return counted.setup_seconds + 1e-9 * scale_of(counted) * work.nanoseconds(cost)
