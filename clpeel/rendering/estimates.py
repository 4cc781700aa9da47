"""Estimates: how long drawing would take, from what was counted and from the table of costs (costs.py)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import ALL_LAYERS, TILE_PIXELS
from clpeel.options import Options
from clpeel.rendering.costs import Cost, Costs, costs_of
from clpeel.stages.counting import Counted, TileCounts
from clpeel.techniques import AnyTechnique


@dataclass(frozen=True)
class Work:
    """How often each part of drawing is done; the fields are those of Cost (costs.py).

    walk: nanoseconds that counting would take for the same walks.
    """

    walk: float
    fragment: float
    lit_visit: float
    lit_fragment: float
    pixel: float

    def nanoseconds(self, cost: Cost) -> float:
        """How long the work takes on the device where the costs were measured."""
        return (
            self.walk * cost.walk
            + self.fragment * cost.fragment
            + self.lit_visit * cost.lit_visit
            + self.lit_fragment * cost.lit_fragment
            + self.pixel * cost.pixel
        )


def counting_nanoseconds(costs: Costs, records: NDArray[np.int64], visits: NDArray[np.int64]) -> NDArray[np.float64]:
    """Nanoseconds that counting takes for a walk over so many records that visits so many strips.

    What counting stores of each pixel is not included. records, visits: [n], of n tiles; so is the result.
    """
    return costs.record * records + costs.visit * visits


def work_of(technique: AnyTechnique, tiles: TileCounts, shaded: bool, options: Options, seen: int = ALL_LAYERS) -> Work:
    """The work of drawing: each pass of a tile goes through all of the tile's transparent records.

    A tile needs the passes for the layers of its own deepest pixel, but no more than `seen` layers: what is behind is
    skipped. shaded: whether colours vary over faces. options: the technique's.
    """
    costs, totals, records, weights = costs_of(tiles.vector_width), tiles.totals, tiles.records, tiles.weights
    fragments, deepest, visits = totals["fragments"], totals["layers"], totals["visits"]
    opaque_visits, opaque_records = totals["opaque_visits"], totals["opaque_records"]
    if technique.all_surfaces:
        fragments, deepest, visits = totals["all_fragments"], totals["all_layers"], visits + opaque_visits
        opaque_visits = opaque_records = np.zeros_like(records)
    elif tiles.features.surfaces == "opaque":
        drawn = float(weights @ totals["opaque"])
        walk = float(weights @ counting_nanoseconds(costs, records, opaque_visits))
        return Work(walk, drawn, 0.0, drawn * shaded, tiles.pixels)
    records = records - opaque_records
    if technique.stores_fragments:
        seen = ALL_LAYERS  # it stores all fragments before it can skip any
    elif (peeled := technique.peeled(options)) is not None:
        seen = min(seen, sum(peeled))
    needed = np.minimum(deepest, seen)
    passes = np.maximum(technique.passes_for(needed, options), 1)
    walks = passes * counting_nanoseconds(costs, records, visits)
    walks += counting_nanoseconds(costs, opaque_records, opaque_visits)
    drawn = np.minimum(fragments, TILE_PIXELS * needed)
    # Light is computed strip by strip. A triangle smaller than a pixel costs a whole strip, too, so strips count here.
    lit = float(weights @ (visits * drawn / np.maximum(fragments, 1))) if shaded else 0.0
    total = float(weights @ drawn)
    return Work(float(weights @ walks), total, lit, total * shaded, tiles.pixels)


def cost_of(technique: AnyTechnique, options: Options, tiles: TileCounts) -> Cost | None:
    """The technique's row of the table, or None if it was not measured."""
    all_opaque = tiles.features.surfaces == "opaque" and not technique.all_surfaces
    costs = costs_of(tiles.vector_width)
    return costs.all_opaque if all_opaque else costs.drawing.get(technique.variant(options))


def scale_of(counted: Counted) -> float:
    """How many times as long counting took here as it would on the device where the costs were measured."""
    tiles, costs = counted.tiles, costs_of(counted.tiles.vector_width)
    visits = tiles.totals["visits"] + tiles.totals["opaque_visits"]
    expected = float(counting_nanoseconds(costs, tiles.records, visits).sum())
    return counted.walk_seconds * 1e9 / (expected + costs.pixel * tiles.pixels)


def estimated_seconds(technique: AnyTechnique, counted: Counted, shaded: bool, options: Options) -> float | None:
    """Seconds that a picture would take, or None if the technique's costs were not measured.

    The seconds of the stages before drawing were measured. Those of drawing come from the table, scaled by scale_of.
    """
    cost = cost_of(technique, options, counted.tiles)
    if cost is None:
        return None
    work = work_of(technique, counted.tiles, shaded, options)
    return counted.setup_seconds + 1e-9 * scale_of(counted) * work.nanoseconds(cost)
