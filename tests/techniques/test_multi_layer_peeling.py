"""multi-layer-peeling: the layers a pass, and concurrent writes: a twin on lists of integers, the paper's figures."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import soups
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.rendering.result import sums
from clpeel.techniques.multi_layer_peeling import HAZARD_ORDERS, layers_per_pass

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")


def test_equation_1() -> None:
    assert layers_per_pass() == layers_per_pass(4, 16, 4, 4) == 8
    assert layers_per_pass(color_bytes=0) == 16 and layers_per_pass(8, 16, 8, 4) == 10
    with pytest.raises(
        clpeel.InputError, match=r"layers_per_pass: expected render targets .* of 32 bytes, got 1 of 16"
    ):
        layers_per_pass(1, 16, 16, 16)


# --- concurrent writes ------------------------------------------------------------------------------------------------

Slots = tuple[int, ...]


class Endless(Exception):
    """The inner loop comes back to where it was."""


def wave(slots: Slots, arriving: Slots, m: int, order: str, torn: bool) -> tuple[Slots, int]:
    """What stands in the slots, nearest first, after a wave that has read `slots`; and how many fragments wrote."""
    writes = [f for f in arriving if f not in slots and (len(slots) < m or f < slots[-1])]
    if order == "nearest-last":
        writes.sort(reverse=True)
    if not writes:
        return slots, 0
    targets = [sorted([*slots, write])[:m] for write in writes[-2:]]
    new = targets[-1]
    if torn and len(writes) > 1:  # even targets keep what the write before has put there
        halves = itertools.zip_longest(targets[0], targets[1])
        new = [pair[i % 2] for i, pair in enumerate(halves) if pair[i % 2] is not None]
    return tuple(sorted(set(new))), len(writes)


def simulate(fragments: Slots, m: int, window: int, order: str = "nearest-last", torn: bool = False) -> list[list[int]]:
    """Table 1: for each peel how many fragments wrote in each of its passes, the last with none; at last [0]."""
    peels: list[list[int]] = []
    z_near = -1
    while True:
        slots: Slots = ()
        passes: list[int] = []
        seen: set[Slots] = set()
        while not passes or passes[-1]:
            count = 0
            for k in range(0, len(fragments), window):
                arriving = tuple(f for f in fragments[k : k + window] if f > z_near)
                slots, wrote = wave(slots, arriving, m, order, torn)
                count += wrote
            passes.append(count)
            if count and slots in seen:
                raise Endless
            seen.add(slots)
        peels.append(passes)
        if passes == [0]:
            return peels
        z_near = slots[-1] if len(slots) == m else max(fragments)


def render(fragments: Slots, m: int, lanes: int, **options: Any) -> Any:
    """These fragments, numbered from the nearest, in this order of submission, in six pixels."""
    away = 1 + np.asarray(fragments, float) / (len(fragments) + 1)
    scene = soups.stack(away, np.array([(0.5, 0.25, 1.0, 0.25)] * len(fragments))).scene()
    call = {"camera": AHEAD.camera(), "size": (3, 2), "lanes": lanes}
    got = plainly.render(scene, technique="multi-layer-peeling", layers_per_pass=m, **options, **call)
    assert (got.color == plainly.render(scene, **call).color).all()
    return got


def test_figure_1_step_by_step(lanes: int) -> None:
    """Four targets; two fragments are in flight at once, and one write of each two is lost, until a second pass."""
    arriving, m = (3, 2, 4, 1), 4
    steps = [(3, 2), (4, 1)]
    slots: Slots = ()
    trace = []
    for step in steps * 3:
        slots, wrote = wave(slots, step, m, "nearest-last", False)
        trace.append((slots, wrote))
    assert trace == [((2,), 2), ((1, 2), 2), ((1, 2, 3), 1), ((1, 2, 3, 4), 1), ((1, 2, 3, 4), 0), ((1, 2, 3, 4), 0)]
    got = render(arriving, m, lanes, hazard_window=2)
    # The inner loop's two passes and the one that writes nothing; the outer loop's that ends it all.
    assert got.stats["samples_passed"] == [4 * 6, 2 * 6, 0, 0]
    assert got.stats["passes"] == 2 and got.stats["passes_issued"] == 4


def test_figure_2_is_caught(lanes: int) -> None:
    """Fragments 2 and 4 both read {3}, and each commits half of its targets: 3 stands there twice, and nothing else."""
    assert wave((3,), (2, 4), 4, "nearest-last", True) == ((3,), 2)  # 2 and 4 come to nothing, whenever they come
    caught = 0
    for arriving in itertools.permutations(range(1, 6)):
        for order in HAZARD_ORDERS:
            options = {"hazard_window": 2, "hazard_order": order, "torn_writes": True}
            try:
                peels = simulate(arriving, 4, 2, order, True)
            except Endless:
                caught += 1
                if caught > 12:
                    continue
                with pytest.raises(clpeel.InputError, match=r"torn_writes: the sample in column \d, row \d .* no end"):
                    render(arriving, 4, lanes, **options)
            else:
                if arriving[0] == 3:
                    got = render(arriving, 4, lanes, **options)
                    assert got.stats["samples_passed"] == [6 * n for n in itertools.chain(*peels)]
    assert 12 < caught < 100


@given(
    count=st.integers(1, 20),
    seed=st.integers(0, 10**6),
    m=st.sampled_from([1, 2, 3, 4, 8]),
    window=st.sampled_from([1, 2, 3, 7, 64]),
    order=st.sampled_from(HAZARD_ORDERS),
)
def test_any_order_as_the_twin(count: int, seed: int, m: int, window: int, order: str) -> None:
    fragments = tuple(np.random.default_rng(seed).permutation(count).tolist())
    peels = simulate(fragments, m, window, order)
    for lanes in (1, 64):
        got = render(fragments, m, lanes, hazard_window=window, hazard_order=order)
        assert got.stats["samples_passed"] == [6 * n for n in itertools.chain(*peels)]
    # One fragment at a time: no pass is repeated. At most M passes a peel, the paper's bound, where the nearest write
    # wins; as fragments arrive, up to as many as there are layers left.
    longest = max(len(passes) - 1 for passes in peels)
    assert longest == 1 if window == 1 else longest <= (m if order == "nearest-last" else count)


def test_the_bound_of_the_paper_does_not_hold_as_fragments_arrive(lanes: int) -> None:
    """Twenty layers that arrive nearest first, all at once: the last one always wins, however far it is."""
    fragments = tuple(range(20))
    assert render(fragments, 4, lanes, hazard_window=20).stats["passes"] == 20
    got = render(fragments, 4, lanes, hazard_window=20, hazard_order="arrival")
    assert got.stats["passes"] == 20 + 16 + 12 + 8 + 4


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
@pytest.mark.parametrize("window", [1, 3, 1000])
def test_any_scene_as_sort(colors: str, window: int, lanes: int, judge: Judge) -> None:
    scene, size = soups.random(61, 150, "mixed", colors, alpha=(0.05, 0.9)).scene(), (50, 40)
    want = plainly.render(scene, BENCH.camera(), size, lanes=lanes)
    layers = -(-want.stats["layers_max"] // 4)
    got = plainly.render(
        scene, BENCH.camera(), size, "multi-layer-peeling", lanes=lanes, layers_per_pass=4, hazard_window=window
    )
    judge.same_bits(got, want)
    assert got.stats["layers_max"] == want.stats["layers_max"] and got.stats["truncated_pixels"] == 0
    assert layers <= got.stats["passes"] <= layers * (1 if window == 1 else 4)


def test_passes_are_those_of_the_picture_however_many_batches_it_has(lanes: int) -> None:
    soup = soups.random(9, 40, "large")
    scene = soups.Soup(soup.vertices, np.tile(soup.faces, (30, 1)), color=np.array([9, 9, 9, 9], np.uint8)).scene()
    call = {"camera": BENCH.camera(), "size": (700, 500), "technique": "multi-layer-peeling", "lanes": lanes}
    one, many = (
        plainly.render(scene, hazard_window=3, layers_per_pass=16, memory=memory, **call) for memory in (None, "1M")
    )
    assert one.stats["batches"] == 1 < many.stats["batches"]
    for name in ("samples_passed", "passes", "passes_issued"):
        assert one.stats[name] == many.stats[name]
    assert (
        len(many.stats["seconds_per_pass"]) == many.stats["passes_issued"] and sum(many.stats["seconds_per_pass"]) > 0
    )
    # One batch peels twice in a pass each, another first in two passes: of each peel what belongs together.
    few = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 0)), (5, 0, 2, 0, 0)
    more = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)), (7, 3, 0, 4, 0, 0)
    assert sums([few, more]) == sums([more, few]) == [12, 3, 0, 6, 0, 0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hazard_window": 0}, "hazard_window: expected 1.*, got 0"),
        ({"hazard_window": 2.5}, "hazard_window: expected 1.*, got 2.5"),
        ({"hazard_window": 2, "passes": 3}, "passes: expected none with hazard_window"),
        (
            {"torn_writes": True, "occlusion_query": False, "passes": 3},
            "occlusion_query: expected none with hazard_window",
        ),
        ({"hazard_window": 2, "hazard_order": "random"}, "hazard_order: expected one of nearest-last, arrival; got"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=message):
        render((0, 1), 4, 1, **options)
