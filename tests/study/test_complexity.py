"""Depth complexity: counts against the twin, closed forms and what `render` reports; figures, picture and command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
import trimesh
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image
from twins import soups
from twins.soups import AHEAD, BENCH, Soup

import clpeel
from clpeel.command import main as cli
from clpeel.command.terminal import HISTOGRAM_ROWS, format_complexity
from clpeel.errors import InputError
from clpeel.pictures.colormap import colors_at
from clpeel.pictures.scale_bar import ticks
from clpeel.rendering.costs import NARROW, WIDE, Cost, Costs, costs_of
from clpeel.rendering.options import BACKGROUND
from clpeel.study.complexity import Complexity, Need
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge


@pytest.fixture(autouse=True)
def devices(shared_devices: None) -> None:
    """Devices that other tests have used: `complexity` opens its own as a Renderer does."""


def some_opaque(soup: Soup, share: float, seed: int) -> Soup:
    """The same, a share of the faces opaque."""
    assert soup.face_colors is not None
    rgba = soup.face_colors.copy()
    rgba[np.random.default_rng(seed).random(len(rgba)) < share, 3] = 255
    return Soup(soup.vertices, soup.faces, rgba)


def made(layers: Any, opaque: Any = None, needs: tuple[Need, ...] = ()) -> Complexity:
    """One of these counts, [height, width]."""
    counts = np.array(layers, np.int32)
    solid = np.zeros(counts.shape, bool) if opaque is None else np.array(opaque, bool)
    return Complexity(counts, solid, needs, 1, 0.001)


# --- the counts -------------------------------------------------------------------------------------------------------


GLASS = (0, 255, 0, 128)

VIEWS = {"whole": 2.0, "clipped": 4.1}
"""Where the near plane is: before all triangles of a soup, or among them."""


def view(near: float) -> clpeel.Camera:
    return clpeel.Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), clipping_range=(near, 6.0))


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    share=st.sampled_from([0.0, 0.3, 1.0]),
    near=st.sampled_from([*VIEWS.values(), 3.6]),
    opaque=st.sampled_from(["first", "blend"]),
)
@example(seed=1, count=60, size=(1, 1), share=0.3, near=2.0, opaque="first")
@example(seed=2, count=60, size=(17, 33), share=0.3, near=3.9, opaque="first")
@example(seed=3, count=60, size=(16, 16), share=1.0, near=2.0, opaque="first")
def test_counts_are_those_of_a_render(
    seed: int, count: int, size: tuple[int, int], share: float, near: float, opaque: str
) -> None:
    """All of them, and pixel by pixel the layers that a picture's are found in."""
    scene = some_opaque(soups.random(seed, count), share, seed).scene()
    for lanes in (1, 64):
        found = clpeel.complexity(scene, view(near), size, opaque=opaque, lanes=lanes)
        result = plainly.render(scene, view(near), size, opaque=opaque, lanes=lanes, layers=True)
        stats = result.stats
        assert (found.fragments, found.max) == (stats["fragments"], stats["layers_max"])
        assert np.count_nonzero(found.opaque) == stats["opaque_samples"]
        # Layers end with the opaque one, and are all where it is blended.
        each = np.diff(result.layers.start).reshape(found.layers.shape)
        assert (found.layers == each - found.opaque).all()


@pytest.mark.parametrize("near", VIEWS.values(), ids=VIEWS)
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_needs_are_what_each_technique_reports(share: float, near: float, lanes: int) -> None:
    """Passes and bytes, to the last; with no opaque surface, some, and nothing else."""
    scene = some_opaque(soups.random(7, 80), share, 7).scene()
    for size in ((40, 30), (1, 1)):
        found = clpeel.complexity(scene, view(near), size, lanes=lanes)
        for need in found.needs:
            technique = TECHNIQUES[need.technique]
            stats = plainly.render(scene, view(near), size, need.technique, lanes=lanes).stats
            # Those that no query ends make all the passes that they are told, whether they find anything or not.
            query = "occlusion_query" in technique.option_names
            assert need.passes == stats["passes" if query else "passes_issued"], need.technique
            assert need.bytes_per_pixel == stats["buffer_bytes_per_pixel"], need.technique
            assert need.exact == technique.exact
            if not technique.maps:
                assert found.fragments == stats["fragments"]


@pytest.mark.parametrize("layers", [1, 2, 3, 8, 9])
def test_passes_of_a_stack_are_what_each_technique_makes(layers: int) -> None:
    """Odd and even numbers of layers, and just as many as one pass of several peels, and one more."""
    scene = soups.stack(np.linspace(1, 7, layers), GLASS).scene()
    for need in clpeel.complexity(scene, AHEAD.camera(), (5, 5)).needs:
        stats = plainly.render(scene, AHEAD.camera(), (5, 5), need.technique).stats
        query = "occlusion_query" in TECHNIQUES[need.technique].option_names
        assert need.passes == stats["passes" if query else "passes_issued"], need.technique


def test_passes_are_at_most_so_many_where_surfaces_hide_others(lanes: int) -> None:
    """Of blended surfaces of alpha 1: those that peel stop at the first, as nothing behind it can be seen."""
    scene = soups.stack([1.0, 2.0, 3.0, 4.0], np.full((4, 4), 255, np.uint8)).scene()
    found = clpeel.complexity(scene, AHEAD.camera(), (5, 5), opaque="blend", lanes=lanes)
    for need in found.needs:
        stats = plainly.render(scene, AHEAD.camera(), (5, 5), need.technique, opaque="blend", lanes=lanes).stats
        assert need.passes >= stats["passes"]
    assert found.max == 4


@pytest.mark.parametrize("size", [(60, 45), (1, 1), (33, 17)])
def test_counts_are_the_twins(size: tuple[int, int], lanes: int, judge: Judge) -> None:
    for seed in range(3):
        soup = soups.random(seed, 120)
        twin, excused, _ = judge.weigh(soup, BENCH, size)
        found = clpeel.complexity(soup.scene(), BENCH.camera(), size, lanes=lanes)
        assert (found.layers == twin.layers)[~excused].all() and (excused.mean() < 0.2 or size == (1, 1))
        assert not found.opaque.any()
        assert found.layers.dtype == np.int32 and found.layers.shape == size[::-1]


@pytest.mark.parametrize("layers", [1, 7, 300])
def test_a_stack_over_all_of_the_picture(layers: int, lanes: int) -> None:
    """N triangles that fill the view; then one of them, in the middle, opaque."""
    away = np.linspace(1, 7, layers)
    rgba = np.full((layers, 4), 100, np.uint8)
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (37, 21), "lanes": lanes}
    found = clpeel.complexity(soups.stack(away, rgba).scene(), **call)
    assert (found.layers == layers).all() and found.fragments == layers * 37 * 21 and found.mean == layers
    assert found.histogram.tolist() == [0] * layers + [37 * 21] and found.covered_share == 1
    rgba[layers // 2, 3] = 255
    order = np.random.default_rng(layers).permutation(layers)
    scene = soups.stack(away[order], rgba[order]).scene()
    found = clpeel.complexity(scene, **call)
    assert (found.layers == layers // 2).all() and found.opaque.all()
    assert found.max == found.median == found.percentile(99) == layers // 2
    blended = clpeel.complexity(scene, opaque="blend", **call)
    assert (blended.layers == layers).all() and not blended.opaque.any()
    for need, all_of_it in zip(found.needs, blended.needs, strict=True):  # maps are of all surfaces either way
        if TECHNIQUES[need.technique].maps:
            assert (need.passes, need.bytes_per_pixel) == (all_of_it.passes, all_of_it.bytes_per_pixel)


def test_coincident_surfaces_are_all_counted_and_the_first_submitted_is_in_front(lanes: int) -> None:
    glass, wall = (0, 255, 0, 128), (255, 0, 0, 255)
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (5, 5), "lanes": lanes}
    assert (clpeel.complexity(soups.stack([2.0, 2.0], [glass, glass]).scene(), **call).layers == 2).all()
    assert (clpeel.complexity(soups.stack([2.0, 2.0], [glass, wall]).scene(), **call).layers == 1).all()
    assert (clpeel.complexity(soups.stack([2.0, 2.0], [wall, glass]).scene(), **call).layers == 0).all()


def test_little_memory_and_progress_change_nothing(lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many batches, and reports in between."""
    import clpeel.stages.tiles

    scene = some_opaque(soups.random(5, 3000, "small"), 0.1, 5).scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (500, 400), "lanes": lanes}
    want = clpeel.complexity(scene, **call)
    monkeypatch.setattr(clpeel.stages.tiles, "MOST_PAIRS", 500)
    monkeypatch.setattr(clpeel.stages.tiles, "FIRST_PAIRS", 500)
    monkeypatch.setattr(clpeel.stages.counting, "TILE_BYTES", 4000)
    told: list[tuple[float, str]] = []
    got = clpeel.complexity(scene, **call, memory="1M", progress=lambda done, text: told.append((done, text)))
    assert (got.layers == want.layers).all() and (got.opaque == want.opaque).all()
    assert [(n.passes, n.bytes_per_pixel, n.left_out) for n in got.needs] == [
        (n.passes, n.bytes_per_pixel, n.left_out) for n in want.needs
    ]
    shares = [done for done, text in told if text == "counting"]
    assert len(shares) > 10 and max(shares) == 1 and told[-1] == (1.0, "done")


def test_nothing_in_view(lanes: int) -> None:
    away = clpeel.Camera((0.0, 0.0, 4.0), (0.0, 0.0, 8.0), clipping_range=(1.0, 2.0))
    found = clpeel.complexity(soups.random(1).scene(), away, (20, 10), lanes=lanes)
    assert found.max == found.fragments == found.covered == found.median == found.percentile(99) == 0
    assert found.mean == found.covered_share == 0 and found.histogram.tolist() == [200]
    assert (found.image() == 255).all()
    assert format_complexity(found.figures()).splitlines()[1:] == ["nothing is in view"]


# --- figures ----------------------------------------------------------------------------------------------------------


@given(
    layers=st.lists(st.integers(0, 30), min_size=1, max_size=60),
    seed=st.integers(0, 99),
    percent=st.one_of(st.sampled_from([0.0, 50.0, 99.0, 100.0]), st.floats(0, 100)),
)
def test_figures_are_numpys(layers: list[int], seed: int, percent: float) -> None:
    solid = np.random.default_rng(seed).random(len(layers)) < 0.3
    found = made([layers], [solid])
    covered = np.array(layers)[(np.array(layers) > 0) | solid]
    assert found.max == max(layers) and found.fragments == sum(layers) and found.covered == len(covered)
    assert found.covered_share == len(covered) / len(layers)
    assert found.histogram.tolist() == [layers.count(n) for n in range(max(layers) + 1)]
    assert found.histogram.dtype == np.int64
    if len(covered):
        assert found.mean == pytest.approx(covered.mean())
        assert found.median == np.percentile(covered, 50, method="inverted_cdf")
        assert found.percentile(99) == np.percentile(covered, 99, method="inverted_cdf")
        up_to = (covered <= found.percentile(percent)).mean()
        assert up_to >= percent / 100 - 1e-9
        assert json.loads(json.dumps(found.figures()))["layers_99th_percentile"] == found.percentile(99)


@pytest.mark.parametrize("percent", [-1, 100.5, float("nan")])
def test_percents_that_cannot_be(percent: float) -> None:
    with pytest.raises(InputError, match="^percent: expected 0..100, got "):
        made([[1]]).percentile(percent)


def test_what_stopping_early_leaves_out() -> None:
    """Four of ten layers are peeled: six are not."""
    scene = soups.stack(np.linspace(1, 7, 10), GLASS).scene()
    for need in clpeel.complexity(scene, AHEAD.camera(), (4, 3)).needs:
        technique = TECHNIQUES[need.technique]
        peeled = technique.peeled(technique.options())
        if peeled is None:
            assert need.left_out is None
        else:
            assert need.left_out == max(10 - sum(peeled), 0) * 12
            assert need.left_out == 0 or not need.exact


# --- estimates --------------------------------------------------------------------------------------------------------


def test_costs_are_those_of_techniques() -> None:
    """A new technique has none until tools/measure_costs.py has measured it. What auto may choose has one."""
    rows = {technique.variant(each): technique for technique in TECHNIQUES.values() for each in technique.variants()}
    for costs in (NARROW, WIDE):
        assert costs.drawing.keys() <= rows.keys()
        assert {row for row, technique in rows.items() if technique.exact} <= costs.drawing.keys()
        for cost in (*costs.drawing.values(), costs.all_opaque):
            assert isinstance(cost, Cost) and min(cost.__dict__.values()) >= 0 < max(cost.__dict__.values())
        assert min(costs.record, costs.visit, costs.pixel) > 0
    assert NARROW.drawing.keys() == WIDE.drawing.keys()


@pytest.mark.parametrize(("width", "costs"), [(0, NARROW), (1, NARROW), (8, NARROW), (16, WIDE)])
def test_costs_are_those_of_the_devices_vectors(width: int, costs: Costs) -> None:
    assert costs_of(width) is costs


def test_estimates_grow_with_what_there_is_to_do(lanes: int) -> None:
    """More layers take longer, light takes longer where it is shaded, and all are finite numbers above zero."""
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (200, 200), "lanes": lanes}
    few = clpeel.complexity(soups.stack(np.linspace(1, 7, 4), GLASS).scene(), **call)
    many = clpeel.complexity(soups.stack(np.linspace(1, 7, 64), GLASS).scene(), **call)
    for less, more in zip(few.needs, many.needs, strict=True):
        if less.seconds is None or more.seconds is None:
            assert (less.technique, ()) not in WIDE.drawing
            continue
        assert 0 < less.seconds < more.seconds < 60


def test_a_technique_that_was_not_measured_has_no_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    sort = TECHNIQUES["sort"]
    for costs in (NARROW, WIDE):
        monkeypatch.delitem(costs.drawing, sort.variant(sort.options()))
    found = clpeel.complexity(soups.random(1).scene(), BENCH.camera(), (20, 10))
    for need in found.needs:
        technique = TECHNIQUES[need.technique]
        assert (need.seconds is None) == (technique.variant(technique.options()) not in WIDE.drawing)
    assert " ? " in format_complexity(found.figures())


# --- the picture ------------------------------------------------------------------------------------------------------


def test_colours_are_those_of_the_map() -> None:
    layers = np.arange(12).reshape(3, 4)
    found = made(layers, layers == 0)
    want = (colors_at(layers / 11) * 255 + 0.5).astype(np.uint8)
    assert (found.image()[..., :3] == want).all() and (found.image()[..., 3] == 255).all()
    bare = made(layers)
    assert (bare.image()[0, 0] == 255).all() and (bare.image((1, 0, 0))[0, 0] == (255, 0, 0, 255)).all()
    assert (bare.image(None)[0, 0] == 0).all() and (bare.image(None)[1:] == found.image()[1:]).all()
    tall = made(np.zeros((3, 1), np.int32))
    assert tall.image(("black", (0, 0.48, 0.9)), False)[:, 0, 1:3].tolist() == [[20, 38], [61, 115], [102, 191]]
    with pytest.raises(InputError, match="^background: "):
        bare.image((2, 0, 0))


def test_the_scale_has_whole_numbers_alone() -> None:
    for most in range(1, 3000):
        shown = ticks(0, most, whole=True)
        assert all(value == round(value) for value in shown) and shown[0] == 0 and 2 <= len(shown) <= 6
    layers = np.zeros((200, 300), np.int32)
    layers[:100] = 3
    plain, barred = made(layers).image(scale_bar=False), made(layers).image()
    assert (plain == barred)[:, :150].all() and (plain != barred).any()


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    """A file with a torus in it."""
    path = tmp_path / "ring.ply"
    trimesh.creation.torus(2, 0.7).export(path)
    return path


def test_the_command(ring: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, figures = tmp_path / "heat.png", tmp_path / "heat.json"
    view = ["--opacity", "0.5", "--camera-direction", "-1,-1,-2", "--resolution", "200,150"]
    assert cli.main(["complexity", str(ring), "-o", str(out), "--json", str(figures), *view]) == 0
    said, errors = capsys.readouterr()
    assert max(map(len, said.splitlines())) <= 88
    assert all(f"\n{name} " in said for name in TECHNIQUES) and "~0.0" in said
    assert errors == f"clpeel: wrote {out} (200 x 150, 2,048 triangles)\n"
    told = json.loads(figures.read_text())
    scene = clpeel.load(ring, opacity=0.5)
    camera = clpeel.Camera.frame(scene, (-1, -1, -2), aspect=200 / 150)
    want = clpeel.complexity(scene, camera, (200, 150))
    assert told["histogram"] == want.histogram.tolist() and told["layers_max"] == want.max == 4
    assert (np.asarray(Image.open(out)) == want.image(BACKGROUND)[..., :3]).all()
    assert [row["technique"] for row in told["techniques"]] == list(TECHNIQUES)


def test_the_histogram_is_short(capsys: pytest.CaptureFixture[str]) -> None:
    for most in (1, 2, 20, 21, 399, 5000):
        layers = np.arange(most + 1, dtype=np.int32)[None]
        said = format_complexity(made(layers).figures()).split("\n\n")[1].splitlines()[1:]
        assert len(said) <= HISTOGRAM_ROWS and all("#" in line for line in said)
        assert max(map(len, said)) <= 80
        assert sum(int(line.split()[1].replace(",", "")) for line in said) == most


def test_nothing_in_view_is_said(ring: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "heat.png"
    away = ["--camera-position", "0,0,9", "--camera-focal-point", "0,0,20", "--resolution", "40,30"]
    assert cli.main(["complexity", str(ring), "-o", str(out), *away]) == 0
    assert "\nnothing is in view\n" in capsys.readouterr().out and out.is_file()


def test_a_picture_on_standard_output(ring: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert cli.main(["complexity", str(ring), "-o", "-", "--resolution", "40,30"]) == 0
    said, errors = capfdbinary.readouterr()
    assert said.startswith(b"\x89PNG") and b"technique" in errors


@pytest.mark.parametrize(
    "arguments, message",
    [
        (
            ["-o", "heat.gif"],
            "--output: expected a name ending in .png, .jpg, .jpeg, .webp, .tif or .tiff, got 'heat.gif'",
        ),
        (["-o", "no/heat.png"], "--output: the folder "),
        (["--json", "no/heat.json"], "--json: the folder "),
        (["--json", "-"], "--json: expected a file of its own"),
        (["--json", "complexity.png"], "--json: expected a file of its own"),
        (["--json", "ring.ply"], "--json: expected a file of its own"),
        (["--opaque", "last"], "--opaque: expected first or blend, got 'last'"),
        (["--memory", "1K"], "--memory: expected at least 1M"),
        (["--lanes", "3"], "--lanes: expected one of"),
        (["--technique", "sort"], "this command has no option --technique"),
        (["--camera-position", "0,0,0", "--camera-focal-point", "0,0,0"], ""),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    arguments: list[str], message: str, ring: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["complexity", str(ring), *arguments]) == 2
    said, errors = capfd.readouterr()
    assert said == "" and errors.count("\n") == 1 and errors.startswith("clpeel: error: " + message)
    assert list(tmp_path.iterdir()) == [ring]


@pytest.mark.parametrize(
    "wrong",
    [{"size": (0, 1)}, {"lighting": "sun"}, {"opaque": "last"}, {"memory": "little"}, {"lanes": 3}, {"scene": None}],
)
def test_what_cannot_be_counted(wrong: dict[str, Any]) -> None:
    name, _ = next(iter(wrong.items()))
    call: dict[str, Any] = {"scene": soups.random(1).scene(), "size": (4, 4), **wrong}
    with pytest.raises(InputError, match=f"^{name}: expected"):
        clpeel.complexity(**call)
