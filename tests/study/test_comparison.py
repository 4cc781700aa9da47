"""Comparing: truth against the float64 twin, figures in closed form, turns, interruption, files, page, command."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
import os
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
import plainly
import pytest
from conftest import printed
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from twins import reference, soups
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.command import main as cli
from clpeel.pictures.png import STEP
from clpeel.rendering.renderer import Renderer
from clpeel.study.chart import CHARACTER, HEIGHT, LINE, WIDTH, place_labels
from clpeel.study.compare import flip_error, judged, opacity_bias
from clpeel.study.comparison import FIGURES, FLIP_HINT, Comparison, Row, shown
from clpeel.study.page import heat
from clpeel.study.tables import COLUMNS
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.multi_layer_peeling import MultiLayerOptions, MultiLayerPeeling
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISIONS, blending_bound

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

TOO_COARSE = {("weighted-blended", "unorm8")}
"""Precisions that techniques refuse."""

PICTURES = [name for name, technique in TECHNIQUES.items() if not technique.maps]
SIZE = (24, 20)


@pytest.fixture(autouse=True)
def flip(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A stand-in for flip-evaluator, which takes a second for what these tests do not ask."""
    record = SimpleNamespace(calls=[])

    def evaluate(reference: Any, test: Any, kind: str, **options: Any) -> Any:
        record.calls.append((reference, test, kind))
        return None, 0.25, options

    monkeypatch.setitem(sys.modules, "flip_evaluator", SimpleNamespace(evaluate=evaluate))
    return record


def stack(*alphas: float) -> clpeel.Scene:
    """Black layers, one behind the other, that fill the view."""
    return soups.stack(np.arange(1, len(alphas) + 1), [[0.0, 0.0, 0.0, alpha] for alpha in alphas]).scene()


@pytest.fixture(scope="module")
def soup() -> soups.Soup:
    return soups.random(11, 150, "mixed", "flat")


@pytest.fixture
def compared(soup: soups.Soup) -> Comparison:
    return clpeel.compare(soup.scene(), BENCH.camera(), SIZE, budgets=(1, 2), frames=2, pictures=True)


def by_name(comparison: Comparison) -> dict[str, Row]:
    return {row.name: row for row in comparison.rows}


# --- figures ----------------------------------------------------------------------------------------------------------


def test_figures_in_closed_form() -> None:
    """Over white, black layers show what they let through: (1 - a)(1 - b), and each technique's known other number."""
    a, b = 0.25, 0.5
    comparison = clpeel.compare(stack(a, b), AHEAD.camera(), (16, 16), budgets=[1], frames=1)
    assert np.abs(comparison.truth - [0, 0, 0, 1 - (1 - a) * (1 - b)]).max() < 1e-15
    assert (comparison.layers_max, comparison.fragments, comparison.triangles) == (2, 2 * 16 * 16, 2)
    errors = {
        "weighted-average": (a - b) ** 2 / 4,  # (1 - (a + b) / 2)^2
        "weighted-sum": a * b,  # 1 - a - b
        "depth-peeling, passes 1": (1 - a) * b,
        "sort": 0,
    }
    rows = by_name(comparison)
    for name, error in errors.items():
        row = rows[name]
        assert row.max_error == pytest.approx(error, abs=1e-7), name
        assert row.rms_error == pytest.approx(error, abs=1e-7), name
        assert (row.share_above_1, row.share_above_8) == (error > 1 / 255, error > 8 / 255), name
        if error:
            assert row.psnr == pytest.approx(-20 * math.log10(error), abs=1e-4), name
    through = (1 - a) * (1 - b)
    for name, alpha in (
        ("weighted-average", 1 - (1 - (a + b) / 2) ** 2),
        ("weighted-sum", a + b),
        ("sort", 1 - through),
    ):
        assert rows[name].opacity_bias == pytest.approx(alpha - (1 - through), abs=1e-7), name
    assert rows["depth-peeling, passes 1"].opacity_bias == pytest.approx(a - (1 - through), abs=1e-7)
    assert rows["weighted-average"].share_above_8 == 0 < rows["weighted-average"].share_above_1
    assert rows["depth-peeling"].passes == 2 and rows["dual-depth-peeling"].passes == 2
    assert rows["depth-peeling, passes 1"].truncation_bound == pytest.approx(1 - a)


def test_the_background_is_the_pictures() -> None:
    """Where what lies behind is black as well, nothing shows."""
    comparison = clpeel.compare(stack(0.25, 0.5), AHEAD.camera(), (16, 16), frames=1, background=(0, 0, 0))
    assert all(row.max_error == 0 and row.psnr == math.inf and row.flip == 0 for row in comparison.rows)


def test_the_picture_is_compared_over_a_gradient() -> None:
    """What is black lets a part of the background through, which is white at the top and black at the bottom."""
    color = np.zeros((2, 1, 4))
    color[..., 3] = 0.5
    assert shown(color, ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))[:, 0, 0].tolist() == [0.375, 0.125]
    comparison = clpeel.compare(stack(0.25, 0.5), AHEAD.camera(), (16, 16), ["sort"], frames=1, background="white:navy")
    assert comparison.rows[0].max_error < 1e-6 and json.loads(comparison.to_json())["background"][0] == [1, 1, 1]


def test_shares_and_means_are_of_pixels_and_channels() -> None:
    right = np.full((2, 4, 3), 0.5)
    color = np.concatenate([right, np.ones((2, 4, 1))], axis=-1).astype(np.float32)
    color[0, 0, 1] += np.float32(2 * STEP)
    color[0, 1, 2] -= np.float32(9 * STEP)
    color[1, 0, 0] = 7  # shown as 1
    color[1, 1] = np.nan
    stats = dict.fromkeys("passes buffer_bytes_per_pixel truncated_pixels truncation_bound clamped_pixels".split(), 1)
    image = np.zeros((2, 4, 4), np.uint8)
    told = SimpleNamespace(**stats, bytes={"a": 3, "b": 4})
    result = SimpleNamespace(color=color, image=image, stats=told)
    found = judged(result, right, image, (1.0, 1.0, 1.0), pictures=True)
    assert found["max_error"] == 1 and found["memory_bytes"] == 7
    assert found["share_above_1"] == 4 / 8 and found["share_above_8"] == 3 / 8
    mean = ((2 * STEP) ** 2 + (9 * STEP) ** 2 + 0.5**2 + 3) / 24
    assert found["rms_error"] == pytest.approx(math.sqrt(mean)) and found["psnr"] == pytest.approx(
        10 * math.log10(1 / mean)
    )
    assert found["error"] == pytest.approx(np.array([[2 * STEP, 9 * STEP, 0, 0], [0.5, 1, 0, 0]]), abs=1e-6)


def test_opacity_beyond_1_is_1_and_no_number_is_1() -> None:
    color, truth = np.zeros((1, 2, 4), np.float32), np.zeros((1, 2, 4))
    color[..., 3], truth[..., 3] = [[1.75, np.nan]], [[0.5, 0.25]]
    assert opacity_bias(color, truth) == (0.5 + 0.75) / 2


def test_truth_is_the_twins(soup: soups.Soup, compared: Comparison, judge: Judge) -> None:
    twin, excused, _ = judge.weigh(soup, BENCH, SIZE)
    off = np.abs(compared.truth - twin.color).max(axis=2)
    assert off[~excused].max() < 1e-14 and twin.layers.max() > 4  # more than any technique takes of its own
    want = reference.image(compared.truth, (1.0, 1.0, 1.0))
    assert (compared.truth_image() == want).all()


def test_errors_are_what_the_pictures_say(soup: soups.Soup, compared: Comparison) -> None:
    """Each row's, once more from `render`; those of exact techniques are rounding; stopped ones keep their bound."""
    over = compared.truth[..., :3] + (1 - compared.truth[..., 3:])
    for row in compared.rows:
        options = {**row.options, "precision": row.precision, "passes": row.budget}
        result = plainly.render(
            soup.scene(),
            BENCH.camera(),
            SIZE,
            row.technique,
            **{name: value for name, value in options.items() if value is not None},
        )
        color = result.color.astype(np.float64)
        error = np.abs(np.clip(color[..., :3] + (1 - color[..., 3:]), 0, 1) - over)
        assert row.max_error == pytest.approx(error.max(), rel=1e-12)
        assert row.rms_error == pytest.approx(np.sqrt((error**2).mean()), rel=1e-12)
        assert (row.image == result.image).all() and (row.error == error.max(axis=2).astype(np.float32)).all()
        if row.exact:
            rounding = blending_bound(compared.layers_max, row.precision)
            assert row.max_error <= row.truncation_bound + rounding, row.name
            assert rounding == compared.rounding or row.precision != DEFAULT_PRECISION
            assert row.budget or row.truncation_bound == 0
    assert any(not row.exact and row.max_error > 0.1 for row in compared.rows)
    assert any(row.truncation_bound > 0.1 for row in compared.rows)


@pytest.mark.parametrize("name", ["boxes", "dragon_vrip_res3.ply.gz", "chair_model.obj"])
def test_float64_from_the_mesh_on_says_the_same(
    name: str, bench: Callable[..., soups.Soup], model: Callable[[str], Path], judge: Judge
) -> None:
    """Errors once more without clpeel: the twin's own fragments, blended in order, averaged and summed in float64."""
    scene = bench("boxes", n=5).scene() if name == "boxes" else clpeel.load(model(name), opacity=0.5)
    size, camera = (80, 60), clpeel.Camera.frame(scene, direction=(-0.3, -0.2, -1), aspect=80 / 60)
    techniques = ["weighted-average", "weighted-sum"]
    comparison = clpeel.compare(scene, camera, size, techniques, ["float32"], frames=1, pictures=True)
    twin, excused, _ = judge.weigh(scene, camera, size)
    weights = reference.barycentric(twin.projected, twin.triangle, *reference.samples(twin.pixel, size))
    color = reference.blend(weights, twin.projected.colors[twin.triangle])
    sums = np.zeros((80 * 60, 4))
    np.add.at(sums, twin.pixel, color * [1, 1, 1, 0] * color[:, 3:] + color * [0, 0, 0, 1])
    sums = sums.reshape(60, 80, 4)
    alphas, layers = sums[..., 3:], np.maximum(twin.layers, 1)[..., None]
    through = (1 - alphas / layers) ** layers
    averaged = sums[..., :3] / np.where(alphas > 0, alphas, 1) * (1 - through) + through
    summed = np.clip(sums[..., :3] + 1 - alphas, 0, 1)
    right = twin.color[..., :3] + 1 - twin.color[..., 3:]
    assert excused.mean() < 0.1 and twin.layers.max() > 3
    for row, drawn in zip(comparison.rows, (averaged, summed), strict=True):
        error = np.abs(drawn - right).max(axis=2)
        assert np.abs(row.error - error)[~excused].max() < 1e-5
        for share, steps in ((row.share_above_1, 1), (row.share_above_8, 8)):
            assert abs(share - np.mean(error > steps * STEP)) <= excused.mean()
    assert comparison.rows[1].share_above_8 > 0


def with_options(name: str) -> list[dict[str, object]]:
    """The options that rows of a technique have besides the defaults: none, and those that it says."""
    return [{}, *(dict(options.given()) for options in TECHNIQUES[name].compared())]


def test_rows_are_the_registry_times_what_was_asked(compared: Comparison) -> None:
    want = []
    for name in PICTURES:
        options = TECHNIQUES[name].option_names
        precisions = dict.fromkeys(["float32", TECHNIQUES[name].paper_precision]) if "precision" in options else [None]
        budgets = [None, 1, 2] if "passes" in options else [None]
        want += [(name, own, *each) for own in with_options(name) for each in product(precisions, budgets)]
    assert [(row.technique, row.options, row.precision, row.budget) for row in compared.rows] == want
    assert "thickness" in compared.notes[0] and len(compared.notes) == 1
    papers = {row.technique: row.precision for row in compared.rows}  # the last of each
    assert papers["sort"] == "float32" and papers["depth-peeling"] == "unorm8" and papers["weighted-sum"] == "half"


def test_precisions_are_asked_for_of_all_that_have_them() -> None:
    comparison = clpeel.compare(stack(0.5), AHEAD.camera(), SIZE, precisions=["unorm8", "half"], frames=1)
    rows, has = comparison.rows, [name for name in PICTURES if "precision" in TECHNIQUES[name].option_names]
    want = [
        (name, own, p)
        for name in has
        for own in with_options(name)
        for p in ("half", "unorm8")
        if (name, p) not in TOO_COARSE
    ]
    assert [(row.technique, row.options, row.precision) for row in rows] == want
    for name, precision in TOO_COARSE:
        assert any(note.startswith(f"left out: {name}, {precision}: precision") for note in comparison.notes)
    assert all(row.name.startswith(row.technique) and row.name.endswith(f", {row.precision}") for row in rows)


def test_a_choice_keeps_the_registrys_order() -> None:
    comparison = clpeel.compare(
        stack(0.5), AHEAD.camera(), SIZE, ["weighted-sum", "sort"], ["half"], budgets=[3], frames=1
    )
    assert [row.name for row in comparison.rows] == ["sort, half", "weighted-sum, half"]
    assert comparison.notes == ()


def test_a_budget_that_a_technique_refuses_is_said() -> None:
    comparison = clpeel.compare(stack(0.5), AHEAD.camera(), SIZE, ["glowscript"], budgets=[4, 9], frames=1)
    assert [(row.precision, row.budget) for row in comparison.rows] == [
        ("float32", None),
        ("float32", 4),
        ("unorm8", None),
        ("unorm8", 4),
    ]
    assert comparison.notes == (
        "left out: glowscript, passes 9: passes: expected 1..4, got 9",
        "left out: glowscript, unorm8, passes 9: passes: expected 1..4, got 9",
    )


# --- rows with options ------------------------------------------------------------------------------------------------


def also(monkeypatch: pytest.MonkeyPatch, *options: Any) -> None:
    """Multi-layer peeling is compared with these options, too."""
    monkeypatch.setattr(MultiLayerPeeling, "compared", lambda self: options)


def test_rows_with_options(soup: soups.Soup, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of `compared`, times precisions and budgets. Rows show what render makes with their options."""
    also(monkeypatch, MultiLayerOptions(layers_per_pass=2), MultiLayerOptions(coincident="paper", layers_per_pass=3))
    comparison = clpeel.compare(
        soup.scene(), BENCH.camera(), SIZE, ["sort", "multi-layer-peeling"], budgets=[1], frames=1, pictures=True
    )
    tails = ["", ", passes 1", ", unorm8", ", unorm8, passes 1"]
    named = [
        "multi-layer-peeling" + own for own in ("", ", layers_per_pass 2", ", coincident paper, layers_per_pass 3")
    ]
    assert [row.name for row in comparison.rows] == ["sort", *(name + tail for name in named for tail in tails)]
    assert comparison.notes == ()
    for row in comparison.rows[1:]:
        asked = {"precision": row.precision, "passes": row.budget, **row.options}
        result = plainly.render(soup.scene(), BENCH.camera(), SIZE, row.technique, **asked)
        assert (row.image == result.image).all() and row.passes == result.stats.passes, row.name
    rows = by_name(comparison)
    two, eight = (rows[f"{name}, passes 1"] for name in (named[1], named[0]))
    assert two.rms_error > eight.rms_error and two.bytes_per_pixel == eight.bytes_per_pixel - 6 * 8
    entries = json.loads(comparison.to_json())["rows"]
    assert entries[0]["options"] == entries[1]["options"] == {}
    assert entries[-1]["options"] == {"coincident": "paper", "layers_per_pass": 3}
    lines = list(csv.DictReader(io.StringIO(comparison.to_csv())))
    assert [line["options"] for line in lines[4:6]] == ["", "layers_per_pass 2"]
    assert "multi-layer-peeling, layers_per_pass 2, unorm8" in comparison.to_html()


def test_options_that_a_budget_does_not_go_with_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    also(monkeypatch, MultiLayerOptions(hazard_window=3))
    comparison = clpeel.compare(
        stack(0.5, 0.5), AHEAD.camera(), SIZE, ["multi-layer-peeling"], ["float32"], budgets=[2], frames=1
    )
    name = "multi-layer-peeling"
    assert [row.name for row in comparison.rows] == [name, f"{name}, passes 2", f"{name}, hazard_window 3"]
    assert comparison.notes == (
        "left out: multi-layer-peeling, hazard_window 3, passes 2: passes: expected none with hazard_window: its "
        "passes end when nothing is written; got one",
    )


def test_a_precision_or_a_budget_among_the_options_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    also(monkeypatch, MultiLayerOptions(precision="half"), MultiLayerOptions(passes=3), MultiLayerOptions())
    rows = clpeel.compare(
        stack(0.5, 0.5), AHEAD.camera(), SIZE, ["multi-layer-peeling"], ["float32"], budgets=[2], frames=1
    ).rows
    assert [(row.precision, row.budget, row.options) for row in rows] == [
        ("float32", None, {}),
        ("float32", 2, {}),
        ("half", None, {}),
        ("half", 2, {}),
        ("float32", 3, {}),
    ]


def test_options_of_all_techniques_are_their_own() -> None:
    """What a technique is compared with is what it can be drawn with, and differs from its defaults."""
    for technique in TECHNIQUES.values():
        for options in technique.compared():
            assert isinstance(options, technique.options) and dict(options.given()), technique.name


def test_memory_is_that_of_the_technique_alone(soup: soups.Soup) -> None:
    alone = clpeel.compare(soup.scene(), BENCH.camera(), SIZE, ["weighted-sum"], ["half"], frames=1)
    beside = clpeel.compare(soup.scene(), BENCH.camera(), SIZE, budgets=[1], frames=1)
    assert by_name(beside)["weighted-sum, half"].memory_bytes == alone.rows[0].memory_bytes > 0
    assert len({row.memory_bytes for row in beside.rows}) > 1


def test_frames_take_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each row a picture that is judged, an untimed frame and a timed one; then frame by frame all rows."""
    calls = []
    render = Renderer.render

    def noted(self: Renderer, *arguments: Any, **options: Any) -> Any:
        result = render(self, *arguments, **options)
        if not options.get("keep_color", True):
            calls.append((options["technique"], result.stats["seconds"]["total"]))
        return result

    monkeypatch.setattr(Renderer, "render", noted)
    told = []
    rows = clpeel.compare(
        stack(0.5, 0.5),
        AHEAD.camera(),
        SIZE,
        ["sort", "depth-peeling"],
        frames=3,
        progress=lambda done, text: told.append(done),
    ).rows
    names = [name for name, _ in calls]
    # depth-peeling in float32, and in the paper's 8 bits.
    assert names == ["sort"] * 2 + ["depth-peeling"] * 4 + ["sort", "depth-peeling", "depth-peeling"] * 2
    assert rows[0].seconds == tuple(calls[k][1] for k in (1, 6, 9))
    assert rows[2].seconds == tuple(calls[k][1] for k in (5, 8, 11)) and rows[2].name == "depth-peeling, unorm8"
    assert rows[0].seconds_least <= rows[0].seconds_median <= rows[0].seconds_greatest and rows[0].frames == 3
    assert told[0] == 0 and told[-1] == 1 and told == sorted(told)


def made(seconds: float, error: float, exact: bool = False) -> Row:
    row = Row("t", None, None, exact, (seconds,), 1, 8, 1, error, error, 0, 0, 0, None, 0, 0, 0)
    return replace(row, psnr=math.inf if error == 0 else -20 * math.log10(error))


def test_the_front() -> None:
    """Faster or nearer than any other that is; rounding is no error; equals do not push each other off."""
    rows = [made(5, 1e-7), made(6, 0), made(1, 0.1), made(1, 0.2), made(2, 0.1), made(3, 0.01), made(3, 0.01)]
    comparison = Comparison(rows, np.zeros((1, 1, 4)), (1, 1, 1), "none", "first", 1, 1, 2, "", 1)
    assert comparison.rounding == 10 * 2.0**-24
    assert comparison.front() == [True, False, True, False, False, True, True]


def test_flip_is_of_the_shown_pictures(flip: SimpleNamespace) -> None:
    truth, image = np.full((4, 5, 4), 255, np.uint8), np.full((4, 5, 4), 51, np.uint8)
    assert flip_error(truth, truth) == 0 and not flip.calls
    assert flip_error(truth, image) == 0.25
    reference, test, kind = flip.calls[0]
    assert kind == "LDR" and reference.shape == (4, 5, 3) and (reference == 1).all()
    assert test == pytest.approx(0.2) and test.dtype == np.float32


def test_flip_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "flip_evaluator")
    pytest.importorskip("flip_evaluator")
    black, white = np.zeros((16, 16, 4), np.uint8), np.full((16, 16, 4), 255, np.uint8)
    found = flip_error(white, black)
    assert found is not None and 0.9 < found <= 1


def test_without_flip_evaluator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    comparison = clpeel.compare(stack(0.5), AHEAD.camera(), SIZE, ["sort"], frames=1)
    assert comparison.rows[0].flip is None
    lines = comparison.table().splitlines()
    assert lines[0].endswith("FLIP") and lines[1].endswith(" -") and FLIP_HINT in lines


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"techniques": ["no-such"]}, "techniques: expected some of sort, "),
        ({"techniques": "thickness"}, "got 'thickness'"),
        ({"techniques": []}, "techniques: expected at least one"),
        ({"precisions": ["no-such"]}, f"precisions: expected some of {', '.join(PRECISIONS)}; got 'no-such'"),
        ({"budgets": [0]}, "budgets: expected 1..1048576, got 0"),
        ({"frames": 0}, "frames: expected 1..10000, got 0"),
        ({"background": None}, "background: expected 3 numbers 0..1, as errors"),
        ({"size": (0, 1)}, "size: "),
        ({"lighting": "moon"}, "lighting: "),
        ({"opaque": "last"}, "opaque: "),
        ({"memory": "lots"}, "memory: "),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=re.escape(message)):
        clpeel.compare(stack(0.5), **{"size": SIZE, **options})


# --- interruption -----------------------------------------------------------------------------------------------------


def interrupt_after(monkeypatch: pytest.MonkeyPatch, renders: int) -> None:
    """Ctrl-C while a later picture than the first so many is drawn."""
    render = Renderer.render
    left = iter(range(renders))

    def interrupted(self: Renderer, *arguments: Any, **options: Any) -> Any:
        if next(left, None) is None:
            raise KeyboardInterrupt
        return render(self, *arguments, **options)

    monkeypatch.setattr(Renderer, "render", interrupted)


@pytest.mark.parametrize(
    ("renders", "frames"),
    [(4, [1]), (5, [1]), (6, [1]), (7, [1, 1]), (8, [2, 1]), (9, [2, 2]), (10, [3, 2])],
)
def test_what_is_finished_is_kept(renders: int, frames: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt_after(monkeypatch, renders)
    with pytest.raises(clpeel.Interrupted) as caught:
        clpeel.compare(stack(0.5), AHEAD.camera(), SIZE, ["sort", "depth-peeling"], ["float32"], frames=3)
    assert isinstance(caught.value, KeyboardInterrupt)
    comparison = caught.value.comparison
    assert [row.frames for row in comparison.rows] == frames
    assert comparison.notes[-1] == "interrupted" and "note: interrupted" in comparison.table()


@pytest.mark.parametrize("renders", [0, 1, 2, 3])
def test_nothing_finished_is_an_interruption_like_any(renders: int, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt_after(monkeypatch, renders)
    with pytest.raises(KeyboardInterrupt) as caught:
        clpeel.compare(stack(0.5), AHEAD.camera(), SIZE, ["sort", "depth-peeling"], frames=3)
    assert not isinstance(caught.value, clpeel.Interrupted)


def test_progress_may_interrupt() -> None:
    def progress(done: float, text: str) -> None:
        if text == "depth-peeling: frame 2 of 2":
            raise KeyboardInterrupt

    with pytest.raises(clpeel.Interrupted) as caught:
        clpeel.compare(stack(0.5), AHEAD.camera(), SIZE, ["sort", "depth-peeling"], frames=2, progress=progress)
    assert [row.frames for row in caught.value.comparison.rows] == [2, 1, 1]


# --- tables and files -------------------------------------------------------------------------------------------------


def test_the_table_is_aligned_and_fits(compared: Comparison) -> None:
    lines = compared.table().splitlines()
    count = 1 + len(compared.rows)
    assert len({len(line) for line in lines[:count]}) == 1 and max(map(len, lines)) <= 124
    for line, row, on in zip(lines[1:count], compared.rows, compared.front(), strict=True):
        assert line.startswith(("* " if on else "  ") + row.name + " ")
    assert lines[count] == "" and lines[count + 1].startswith("truth: the same ")
    slow = replace(compared, rows=[replace(compared.rows[0], seconds=(123.4, 120.0, 130.0), memory_bytes=2**36)])
    assert max(map(len, slow.table().splitlines())) <= 124


def test_csv_and_json_give_the_figures_back(compared: Comparison) -> None:
    compared = replace(compared, rows=[*compared.rows, made(2, 0)])
    table = list(csv.DictReader(io.StringIO(compared.to_csv())))
    found = json.loads(compared.to_json(), parse_constant=lambda name: pytest.fail(name))
    assert found["size"] == list(SIZE) and found["layers_max"] == compared.layers_max and found["format"] == 1
    assert len(table) == len(found["rows"]) == len(compared.rows)
    for row, line, entry, on in zip(compared.rows, table, found["rows"], compared.front(), strict=True):
        figures = {**row.figures(), "options": ", ".join(f"{name} {value}" for name, value in row.options.items())}
        assert line == {**{k: "" if v is None else str(v) for k, v in figures.items()}, "on_front": str(on)}
        psnr = None if row.psnr == math.inf else row.psnr
        assert entry == {**row.figures(), "psnr": psnr, "on_front": on, "seconds": list(row.seconds)}
    assert float(table[1]["rms_error"]) == compared.rows[1].rms_error and table[-1]["psnr"] == "inf"
    assert set(FIGURES) <= set(found["rows"][0])


def test_the_page_is_whole_and_needs_nothing_else(compared: Comparison) -> None:
    compared = replace(compared, notes=("a < b & c",))
    text = compared.to_html('<dragon> & "friends"')
    page = ElementTree.fromstring(text.partition("\n")[2])
    assert text.startswith("<!DOCTYPE html>\n")
    assert not re.search(r"https?:|url\(|@import|<script [^>]*src|<link|href", text)
    images = [source for node in page.iter("img") if (source := node.get("src"))]
    assert all(source.startswith("data:image/png;base64,") for source in images)
    pictures = [np.asarray(Image.open(io.BytesIO(base64.b64decode(s.partition(",")[2])))) for s in images]
    assert (pictures[0] == compared.truth_image()[..., :3]).all()
    cells = [["".join(cell.itertext()) for cell in line] for line in page.iter("tr")]
    for line, row, on in zip(cells[1:], compared.rows, compared.front(), strict=True):
        assert line == [("* " if on else "") + row.name, *(cell(row) for _, cell in COLUMNS)]
    # Each row's picture and map of errors stand together, under its name.
    shown = {}
    for figure, at in zip(list(page.iter("figure"))[1:], range(1, len(pictures), 2), strict=True):
        for name in figure.iter("b"):
            shown["".join(name.itertext())] = pictures[at], pictures[at + 1]
    for row in compared.rows:
        picture, errors = shown[row.name]
        assert (picture == row.image[..., :3]).all() and (errors == heat(row.error)[..., :3]).all()
    points = [node for node in page.iter("svg") if node.get("class") == "plot"][0]
    titles = [title.text or "" for title in points.iter("title")]
    assert sorted(title.partition(":")[0] for title in titles) == sorted(row.name for row in compared.rows)
    assert len(list(points.iter("circle"))) == len(compared.rows)


def test_a_page_without_any_error(compared: Comparison) -> None:
    """Nothing to take a logarithm of."""
    rows = [replace(row, rms_error=0.0, max_error=0.0, psnr=math.inf) for row in compared.rows[:1]]
    ElementTree.fromstring(replace(compared, rows=rows).to_html().partition("\n")[2])


def test_a_page_wants_pictures(compared: Comparison) -> None:
    rows = [replace(row, image=None) for row in compared.rows]
    with pytest.raises(clpeel.InputError, match="pictures: expected a comparison made with pictures=True"):
        replace(compared, rows=rows).to_html()


def test_heat_is_black_below_what_shows() -> None:
    colors = heat(np.array([[0, 0.249 / 255, 0.251 / 255, 255 / 255]], np.float32))[0]
    assert (colors[:2] == (0, 0, 0, 255)).all()
    assert abs(colors[2].astype(int) - (68, 1, 84, 255)).max() <= 1 and (colors[3] == (253, 231, 37, 255)).all()


@given(
    st.lists(st.tuples(st.floats(80, WIDTH - 60), st.floats(30, HEIGHT - 60), st.booleans()), min_size=1, max_size=25)
)
def test_labels_do_not_overlap(found: list[tuple[float, float, bool]]) -> None:
    names = [f"technique, passes {k}" for k in range(len(found))]
    places = place_labels([(x, y) for x, y, _ in found], names, [on for *_, on in found])
    boxes = [(x, y, x + CHARACTER * len(name), y + LINE) for (x, y), name in zip(places, names, strict=True)]
    for k, a in enumerate(boxes):
        assert 0 <= a[0] and a[2] <= WIDTH
        for b in boxes[:k]:
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


# --- the command ------------------------------------------------------------------------------------------------------


def command(squares: Path, *arguments: str) -> int:
    """`clpeel compare` of two squares, small."""
    return cli.main(["compare", str(squares), "--resolution=20,16", "--opacity=0.4", "--frames=2", *arguments])


def test_the_command_prints_and_writes(squares: Path, tmp_path: Path, capfd: Any) -> None:
    files = {kind: tmp_path / f"out.{kind}" for kind in ("json", "csv", "html")}
    assert (
        command(
            squares,
            "--budgets=1",
            "--unlit",
            "--techniques=sort,depth-peeling",
            *(f"--{kind}={path}" for kind, path in files.items()),
        )
        == 0
    )
    out, err = printed(capfd)
    found = json.loads(files["json"].read_text())
    assert found["lighting"] == "none" and found["size"] == [20, 16] and found["triangles"] == 4
    assert len(out) == 1 + len(found["rows"]) + 1 + 3 and "depth-peeling, passes 1" in "".join(out)
    assert len(list(csv.reader(files["csv"].open()))) == 1 + len(found["rows"])
    assert "<h1>squares.off</h1>" in files["html"].read_text()
    assert err == [f"clpeel: wrote {path}" for path in files.values()]


def test_the_command_asks_for_what_the_options_say(squares: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    asked = SimpleNamespace()

    def compare(scene: Any, camera: Any, **options: Any) -> Any:
        asked.camera, asked.options = camera, options
        raise clpeel.InputError("enough")

    monkeypatch.setattr(clpeel, "compare", compare)
    arguments = "--techniques=sort,weighted-sum --precisions half --budgets 1,4 --background-color=1,0,0 --memory 64M"
    assert command(squares, *arguments.split(), "--opaque", "blend", "--lanes=16", "--camera-position=-1,2,9") == 2
    assert asked.camera.position == (-1, 2, 9)
    wanted = {
        "size": (20, 16),
        "techniques": ("sort", "weighted-sum"),
        "precisions": ("half",),
        "budgets": (1, 4),
        "frames": 2,
        "background": (1, 0, 0),
        "lighting": "kit",
        "opaque": "blend",
        "memory": "64M",
        "lanes": 16,
        "pictures": False,
    }
    assert {name: asked.options[name] for name in wanted} == wanted


def test_figures_alone_on_standard_output(squares: Path, capfd: Any) -> None:
    assert command(squares, "--techniques=sort", "--json", "-") == 0
    out, err = capfd.readouterr()
    assert [row["technique"] for row in json.loads(out)["rows"]] == ["sort"]
    assert "truth: the same" in err


def test_the_command_keeps_what_is_finished(
    squares: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    interrupt_after(monkeypatch, 5)
    assert command(squares, f"--csv={tmp_path / 'out.csv'}", f"--html={tmp_path / 'out.html'}") == 130
    out, err = printed(capfd)
    assert out[1].startswith("* sort ")
    assert out[2] == "" and "note: interrupted" in out
    assert err[-1] == "clpeel: interrupted"
    assert (tmp_path / "out.csv").read_text().splitlines()[1].startswith("sort,")
    assert (tmp_path / "out.html").exists()


def test_the_command_interrupted_at_once(
    squares: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    interrupt_after(monkeypatch, 1)
    assert command(squares, f"--csv={tmp_path / 'out.csv'}") == 130
    assert printed(capfd) == ([], ["clpeel: interrupted"])
    assert os.listdir(tmp_path) == ["squares.off"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--json=no/such/x.json"], "--json: the folder"),
        (["--csv=/"], "--csv: expected a file, got the folder '/'"),
        (["--html="], "--html: expected a file name, got ''"),
        (["--json=-", "--csv=-"], "expected one of --json, --csv and --html on standard output"),
        (["--json=x", "--csv=./x"], "--csv: expected a file of its own, got "),
        (["--html=squares.off"], "--html: expected a file of its own, got "),
        (["--opacity=1", "--opacity=0"], "--opacity: expected once, got 3 of them (see clpeel compare --help)"),
        (["--techniques=no-such"], "techniques: expected some of"),
        (["--precisions=no-such"], "precisions: expected some of float32, half"),
        (["--budgets=1,0"], "--budgets: expected whole numbers of 1 or more, such as 1,2,4, got '1,0'"),
        (["--frames=0"], "--frames: expected a whole number of 1 or more"),
        (["--samples=4"], "this command has no option --samples"),
        (["--memory=lots"], "memory: "),
    ],
)
def test_bad_input_is_one_line_before_any_work(
    squares: Path, tmp_path: Path, arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(clpeel, "load", lambda *_, **__: pytest.fail("a file was read"))
    assert command(squares, *arguments) == 2
    out, err = printed(capfd)
    assert out == [] and len(err) == 1 and message in err[0]
    assert os.listdir(tmp_path) == ["squares.off"]
