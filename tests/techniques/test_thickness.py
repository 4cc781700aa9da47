"""thickness: closed forms, solids of all kinds against the float64 twin of solids.py, its picture, and its limits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import reference, soups
from twins.reference import UNIT
from twins.solids import DEPTH_ROUNDINGS, Rays, ball, box, random_solids, turned_inside_out
from twins.soups import AHEAD, BENCH, Eye, Soup

import clpeel
from clpeel.device.layout import RUN_MAX
from clpeel.pictures.colormap import OUTSIDE, VIRIDIS, colors_at
from clpeel.pictures.scale_bar import ticks
from clpeel.techniques.thickness import VARIANTS

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

PARALLEL = replace(BENCH, orthographic=True)


def render(soup: Soup, view: Eye, size: tuple[int, int], variant: str = "exact", **options: Any) -> clpeel.Result:
    """clpeel's thickness of a soup."""
    return plainly.render(soup.scene(), view.camera(), size, "thickness", variant=variant, **options)


def against_rays(soup: Soup, view: Eye, size: tuple[int, int], lanes: int, projected: bool = False) -> Rays:
    """All variants against the twin."""
    rays = Rays(soup, view, size, projected)
    for variant in VARIANTS:
        result = render(soup, view, size, variant, lanes=lanes, projected=projected)
        checked = ~rays.excused(variant)
        assert checked.mean() > 0.8
        error = np.abs(result.thickness - rays.thickness[variant])
        worst = (error / np.maximum(rays.bound[variant], UNIT))[checked].max()
        assert (error <= rays.bound[variant])[checked].all(), f"{variant}: {worst:.3g} of the bound"
        assert (result.unpaired == rays.unpaired[variant])[checked].all(), variant
        assert result.stats["unpaired_pixels"] == result.unpaired.sum()
        assert result.stats["thickness_max"] == result.thickness.max()
    return rays


# --- closed forms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", [BENCH, PARALLEL], ids=["perspective", "parallel"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_box_seen_straight_on(view: Eye, variant: str, lanes: int) -> None:
    # From z = 0.75 to -0.5, 3.25 and 4.5 away; in the middle, where both sides are seen: 1.25.
    result = render(box((-0.6, -0.6, -0.5), (0.6, 0.6, 0.75)), view, (40, 30), variant, lanes=lanes)
    # Two depths, and 7 roundings (solids.py).
    bound = DEPTH_ROUNDINGS * ((3.25 + 4.5) if not view.orthographic else 2 * 4.0) + 7 * UNIT * 1.25
    assert np.abs(result.thickness[10:20, 14:26] - 1.25).max() <= bound
    assert (result.thickness[0] == 0).all() and not result.unpaired.any()
    # Window depths, 0 at 2 away and 1 at 6: f / (f - n) (n / 3.25 - n / 4.5), or 1.25 / (6 - 2).
    window = render(box((-0.6, -0.6, -0.5), (0.6, 0.6, 0.75)), view, (40, 30), variant, lanes=lanes, projected=True)
    want = 1.25 / 4 if view.orthographic else 6 / 4 * (2 / 3.25 - 2 / 4.5)
    assert np.abs(window.thickness[10:20, 14:26] - want).max() <= DEPTH_ROUNDINGS * 1.5 * 2 + 7 * UNIT * want


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_ball_is_as_thick_as_its_chords(variant: str, lanes: int) -> None:
    size = (60, 60)
    soup = ball(subdivisions=5)
    result = render(soup, PARALLEL, size, variant, lanes=lanes)
    half = np.tan(np.radians(15)) * 4
    x = ((np.arange(60) + 0.5) / 30 - 1) * half
    r2 = x[None] ** 2 + x[:, None] ** 2
    # Its surface lies between the sphere through its corners and the one that its faces touch.
    a, b, c = (soup.vertices[soup.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    least = np.abs((normal * a).sum(axis=1) / np.linalg.norm(normal, axis=1)).min()
    assert 0.999 < least < 1
    inside = r2 < 0.95
    found = result.thickness[inside]
    off = 2 * DEPTH_ROUNDINGS * 4 + 7 * UNIT * 2  # two depths of a clipping range of 4, and 7 roundings (solids.py)
    assert (found <= 2 * np.sqrt(1 - r2[inside]) + off).all()
    assert (found >= 2 * np.sqrt(least**2 - r2[inside]) - off).all()
    assert (result.thickness[r2 > 1] == 0).all() and not result.unpaired.any()


NEAR_BOX, FAR_BOX = box((-0.3, -0.3, 0.6), (0.3, 0.3, 0.8)), box((-0.8, -0.8, -0.5), (0.8, 0.8, 0.25))


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize(
    ("parts", "want"),
    [
        # A leaf before a statue: total counts what is between, first-solid the leaf alone.
        ((NEAR_BOX, FAR_BOX), {"exact": 0.95, "total": 1.3, "first-solid": 0.2}),
        # A box within another counts once; first-solid is until the inner one ends.
        ((FAR_BOX, box((-0.5, -0.5, -0.25), (0.5, 0.5, 0))), {"exact": 0.75, "total": 0.75, "first-solid": 0.5}),
        # A cavity: its walls face inwards.
        (
            (FAR_BOX, turned_inside_out(box((-0.5, -0.5, -0.25), (0.5, 0.5, 0)))),
            {"exact": 0.5, "total": 0.75, "first-solid": 0.25},
        ),
        # Two that overlap: their union.
        ((FAR_BOX, box((-0.5, -0.5, 0), (0.5, 0.5, 0.5))), {"exact": 1.0, "total": 1.0, "first-solid": 0.5}),
        # The same box twice.
        ((FAR_BOX, FAR_BOX), {"exact": 0.75, "total": 0.75, "first-solid": 0.75}),
    ],
)
def test_several_solids(parts: Any, want: dict[str, float], inside_out: bool, lanes: int) -> None:
    soup = soups.merge(*parts)
    if inside_out:
        soup = turned_inside_out(soup)
    middle = slice(10, 20), slice(15, 25)
    for variant in VARIANTS:
        result = render(soup, BENCH, (40, 30), variant, lanes=lanes)
        if inside_out and variant == "first-solid":
            # Whatever comes first is seen from behind.
            assert result.unpaired[middle].all() and (result.thickness[middle] == 0).all()
            continue
        # Up to four depths, at distances of 5 at most.
        assert np.abs(result.thickness[middle] - want[variant]).max() <= 4 * DEPTH_ROUNDINGS * 5 + 9 * UNIT
        assert not result.unpaired.any()


def test_more_layers_than_are_held_at_once(lanes: int) -> None:
    # 200 boxes of 0.02 in 8 from 1 to 7 away, 400 crossings; with little memory these are lists in windows.
    starts = np.linspace(1, 7, 200)
    boxes = [box((-60, -60, -start - 0.02), (60, 60, -start)) for start in starts]
    soup = soups.merge(*(boxes[k] for k in np.random.default_rng(1).permutation(200)))
    bound = 2 * DEPTH_ROUNDINGS * starts.sum() + 405 * UNIT * 4
    runs = [render(soup, AHEAD, (20, 3), lanes=lanes, memory=memory) for memory in ("256M", "1M")]
    for result in runs:
        assert np.abs(result.thickness - 200 * 0.02).max() <= bound
        assert not result.unpaired.any() and result.stats["layers_max"] == 400 > RUN_MAX
    assert (runs[0].thickness == runs[1].thickness).all()
    total = render(soup, AHEAD, (20, 3), "total", lanes=lanes)
    assert np.abs(total.thickness - 6.02).max() <= DEPTH_ROUNDINGS * (1 + 7.02) + 7 * UNIT * 6.02


# --- against the twin -------------------------------------------------------------------------------------------------


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 6),
    orthographic=st.booleans(),
    projected=st.booleans(),
    lanes=st.sampled_from((1, 64)),
)
def test_closed_meshes(seed: int, count: int, orthographic: bool, projected: bool, lanes: int) -> None:
    rng = np.random.default_rng(seed)
    position = rng.normal(size=3)
    position *= 4 / np.linalg.norm(position)
    view = Eye(tuple(position.tolist()), view_up=(0.1, 0.9, 0.2), orthographic=orthographic, clipping_range=(1.0, 7.0))
    soup, size = random_solids(seed, count), (41, 33)
    rays = against_rays(soup, view, size, lanes, projected)
    # Coverage is exact: not even on edges is a crossing lost.
    assert not rays.unpaired["exact"].any()
    assert not render(soup, view, size, lanes=lanes).unpaired.any()


@pytest.mark.parametrize("orthographic", [False, True])
def test_open_meshes(orthographic: bool, lanes: int) -> None:
    view = replace(BENCH, orthographic=orthographic)
    rays = against_rays(soups.random(3, 60, "large"), view, (50, 40), lanes)
    assert rays.unpaired["exact"].sum() > 100 and rays.unpaired["first-solid"].sum() > 100


def test_the_camera_within_a_solid(lanes: int) -> None:
    soup = soups.merge(box((-3, -3, -3), (3, 3, 3)), box((-0.5, -0.5, -2), (0.5, 0.5, -1)))
    rays = against_rays(soup, replace(AHEAD, clipping_range=(0.5, 20.0)), (30, 30), lanes)
    assert rays.unpaired["exact"].all()
    # The inner box is a first solid; beside it there is none.
    assert 0.05 < (~rays.unpaired["first-solid"]).mean() < 0.5
    assert rays.thickness["total"].max() > 1.9  # from the inner box to the wall


def test_a_solid_cut_by_the_near_plane_is_open(lanes: int) -> None:
    # A ball from 3 to 5 away, cut at 3.5: unpaired where its front is gone, and only there.
    size = (60, 60)
    soup, view = ball(), replace(BENCH, clipping_range=(3.5, 6.0))
    whole, cut = Rays(soup, BENCH, size), render(soup, view, size, lanes=lanes)
    gone = np.zeros(60 * 60, bool)
    gone[whole.twin.pixel[whole.twin.distance < 3.5]] = True
    margin = np.zeros(60 * 60, bool)  # the cut is an edge, too
    margin[whole.twin.pixel[np.abs(whole.twin.distance - 3.5) < 1e-3]] = True
    checked = ~whole.edge & ~margin.reshape(60, 60)
    assert gone.sum() > 300 and (cut.unpaired.ravel() == gone)[checked.ravel()].all()
    assert (cut.thickness[gone.reshape(60, 60) & checked] == 0).all()


def test_bunny(model: Any) -> None:
    scene = clpeel.load(model("bunny.ply"))
    camera = clpeel.Camera.frame(scene)
    maps = {name: plainly.render(scene, camera, (200, 200), "thickness", variant=name) for name in VARIANTS}
    unpaired = maps["exact"].unpaired
    assert 0 < unpaired.sum() < 2000  # it has holes in its base
    total, exact = (maps[name].thickness.astype(float) for name in ("total", "exact"))
    # What lies within is no longer than from the first crossing to the last, but for the roundings of both.
    assert (exact <= total + 30 * UNIT).all()
    assert 0.07 < exact.max() < 0.11


# --- what the map and the picture are ---------------------------------------------------------------------------------


def test_the_same_bits_with_any_lanes_and_memory(judge: Judge) -> None:
    soup = random_solids(5, 6)
    soup = soups.merge(*[soup] * 60)
    for variant in VARIANTS:
        runs = [
            render(soup, BENCH, (90, 70), variant, lanes=lanes, memory=memory)
            for lanes in (1, 64)
            for memory in ("256M", "1M")
        ]
        assert runs[0].stats["batches"] == 1 < runs[1].stats["batches"]
        for other in runs[1:]:
            judge.same_bits(other, runs[0])
            assert (other.thickness.view(np.uint32) == runs[0].thickness.view(np.uint32)).all()
            assert (other.unpaired == runs[0].unpaired).all()


def test_shuffling_the_faces_changes_nothing(lanes: int, judge: Judge) -> None:
    soup = random_solids(8, 5)
    order = np.random.default_rng(0).permutation(len(soup.faces))
    for variant in VARIANTS:
        one, other = (render(s, BENCH, (60, 60), variant, lanes=lanes) for s in (soup, soup.take(order)))
        judge.same_bits(other, one)
        assert (one.thickness == other.thickness).all()


@pytest.mark.parametrize("variant", VARIANTS)
def test_several_samples_are_the_mean(variant: str, lanes: int) -> None:
    soup = soups.merge(random_solids(2, 3), soups.random(1, 10, "large", "flat"))
    fine = render(soup, BENCH, (80, 64), variant, lanes=lanes)
    mean = render(soup, BENCH, (10, 8), variant, lanes=lanes, samples=64)

    def samples(values: Any) -> Any:
        return np.asarray(values, float).reshape(8, 8, 10, 8).swapaxes(1, 2).reshape(8, 10, 64)

    # 63 sums and a quotient by 64, which is exact.
    assert np.abs(mean.thickness - samples(fine.thickness).mean(-1)).max() <= 63 * UNIT * 8
    assert (mean.unpaired == samples(fine.unpaired).any(-1)).all()
    assert (mean.color[..., 3] == samples(fine.color[..., 3]).mean(-1)).all()
    assert (mean.color[..., 3] % 1 != 0).any()


@pytest.mark.parametrize("background", [(0.2, 0.4, 0.6), ((0.2, 0.4, 0.6), (1.0, 0.5, 0.0))])
def test_the_picture_is_the_map_in_colours(background: Any, lanes: int, judge: Judge) -> None:
    soup = soups.merge(ball(), box((-2, 0.5, -1), (2, 2, -0.5)).take(slice(0, 10)))  # a box without its front
    result = render(soup, BENCH, (100, 90), lanes=lanes, background=background)
    low, high = result.stats["thickness_range"]
    paired = result.thickness[~result.unpaired]
    assert low == 0 and high == paired.max() and result.stats["unit"] == "scene units"
    assert result.unpaired.sum() > 100
    covered = result.color[..., 3] == 1
    want = np.where(result.unpaired[..., None], OUTSIDE, colors_at(result.thickness / high))
    want = np.concatenate([want, np.ones((90, 100, 1))], -1) * covered[..., None]
    judge.color(result, want, 4 * UNIT)
    judge.image(result, background)
    clear = render(soup, BENCH, (100, 90), lanes=lanes, background=None)
    judge.image(clear, None)
    assert (clear.image[..., 3] == np.where(covered, 255, 0)).all()
    image = render(soup, BENCH, (100, 90), lanes=lanes, background=background, keep_color=False)
    assert (image.image == result.image).all()
    with pytest.raises(clpeel.InputError, match="keep_color"):
        _ = image.color


def test_a_range_clamps_and_counts() -> None:
    soup = soups.merge(NEAR_BOX, FAR_BOX)
    result = render(soup, BENCH, (40, 30), thickness_range=(0.3, 0.8))
    # Twice outside: 0.95 where both are, and 0.2 nowhere alone, as the larger box is behind.
    shown = result.thickness[result.color[..., 3] == 1]
    assert result.stats["clamped_pixels"] == ((shown > 0.8) | (shown < 0.3)).sum() > 50
    assert result.stats["thickness_range"] == [0.3, 0.8]
    assert np.abs(result.color[15, 20, :3] - VIRIDIS[-1]).max() <= UNIT


def test_the_scale_bar() -> None:
    hole = soups.separate([[[-2.0, -2, -1], [-0.9, -2, -1], [-2, -0.9, -1]]], (0.5, 0.5, 0.5, 0.5))
    soup = soups.merge(box((-0.3, -0.3, -0.5), (0.3, 0.3, 0.5)), hole)
    for background in ((0.0, 0.0, 0.0), None):
        bare, barred = (render(soup, BENCH, (320, 240), scale_bar=bar, background=background) for bar in (False, True))
        changed = (bare.image != barred.image).any(axis=2)
        rows, columns = np.nonzero(changed)
        assert 0.03 < changed.mean() < 0.2
        assert (bare.color == barred.color).all() and (bare.thickness == barred.thickness).all()
        # In a corner that is free, and in it the map's ends and the colour of what has no number.
        assert not (changed & (bare.color[..., 3] > 0)).any()
        panel = barred.image[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1, :3].astype(int)
        for color in (OUTSIDE * 255, VIRIDIS[0] * 255, VIRIDIS[-1] * 255):
            assert (np.abs(panel - color).max(axis=2) <= 8).any()
        assert panel.mean() > 100 if background else True
    for size in ((159, 240), (320, 119)):
        assert (render(soup, BENCH, size).image == render(soup, BENCH, size, scale_bar=False).image).all()


@pytest.mark.parametrize(
    ("low", "high", "want"),
    [
        (0, 1, [0, 0.2, 0.4, 0.6, 0.8, 1]),
        (0, 0.103, [0, 0.02, 0.04, 0.06, 0.08, 0.1]),
        (3, 47, [10, 20, 30, 40]),
        (0, 3e-9, [0, 1e-9, 2e-9, 3e-9]),
        (0.95, 1.05, [0.96, 0.98, 1.0, 1.02, 1.04]),
        (0, 1e30, [0, 2e29, 4e29, 6e29, 8e29, 1e30]),
    ],
)
def test_ticks_are_round(low: float, high: float, want: list[float]) -> None:
    assert ticks(low, high) == pytest.approx(want, abs=1e-12 * high)


# --- limits -----------------------------------------------------------------------------------------------------------


def test_nothing_in_view(lanes: int) -> None:
    for variant in VARIANTS:
        away = clpeel.Camera((0, 0, 4), (0, 0, 8))
        result = plainly.render(ball().scene(), away, (200, 150), "thickness", lanes=lanes, variant=variant)
        assert not result.thickness.any() and not result.unpaired.any() and not result.color.any()
        assert result.thickness.dtype == np.float32 and result.unpaired.dtype == np.bool_
        assert result.stats["thickness_range"] == [0, 1]


def test_large_and_small_scenes(lanes: int) -> None:
    # Scaled by powers of two, lengths scale to the bit: depths are ratios.
    base = render(ball(), BENCH, (30, 30), lanes=lanes).thickness
    for power in (-40, 30):
        scale = 2.0**power
        view = Eye((0.0, 0.0, 4 * scale), clipping_range=(2 * scale, 6 * scale))
        assert (render(ball(radius=scale), view, (30, 30), lanes=lanes).thickness == base * np.float32(scale)).all()


def test_unlit_or_lit_opaque_or_not_is_all_the_same() -> None:
    solid = ball()
    maps = []
    for alpha in (0.0, 0.5, 1.0):
        for lighting in ("none", "headlight"):
            scene = clpeel.Scene.from_arrays(solid.vertices, solid.faces, color=(1.0, 0.5, 0.2, alpha))
            maps.append(plainly.render(scene, BENCH.camera(), (50, 40), "thickness", lighting=lighting).thickness)
    assert all((found == maps[0]).all() for found in maps[1:]) and maps[0].max() > 1.9


def test_what_it_reports(lanes: int) -> None:
    soup = box((-0.6, -0.6, -0.5), (0.6, 0.6, 0.75))
    for variant in VARIANTS:
        stats = render(soup, BENCH, (40, 30), variant, lanes=lanes).stats
        assert stats["technique"] == "thickness" and stats["passes"] == stats["passes_issued"] == 1
        assert stats["samples_passed"] == [stats["fragments"]] and stats["layers_max"] == 2
        assert stats["unpaired_pixels"] == stats["truncated_pixels"] == stats["clamped_pixels"] == 0
        assert stats["bytes"]["values"] == 16 * 40 * 30


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "second"}, "variant: expected one of exact, total, first-solid; got 'second'"),
        ({"variant": None}, "variant: expected one of exact"),
        ({"projected": "yes"}, "projected: expected True or False, got 'yes'"),
        ({"thickness_range": (1, 1)}, "thickness_range: expected 0 <= low < high, got 1, 1"),
        ({"thickness_range": (-1, 1)}, "thickness_range: expected 0 <= low < high"),
        ({"thickness_range": (0, float("nan"))}, "thickness_range: expected 0 <= low < high, got 0, nan"),
        ({"thickness_range": 3}, r"thickness_range: expected \(low, high\), got 3"),
        ({"sigma": 3}, "sigma: the technique 'thickness' has no such option"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=message) as error:
        plainly.render(ball().scene(), BENCH.camera(), (4, 4), "thickness", **options)
    assert "\n" not in str(error.value)


def test_other_techniques_have_no_thickness() -> None:
    result = plainly.render(ball().scene(), BENCH.camera(), (4, 4))
    with pytest.raises(clpeel.InputError, match=r"thickness: .* map \(thickness, translucency\), got 'sort'"):
        _ = result.thickness
    with pytest.raises(clpeel.InputError, match="unpaired: expected a result"):
        _ = result.unpaired


def test_too_deep_for_the_memory_is_refused_or_needs_none() -> None:
    # 300,000 crossings of one pixel take 2.4 MB, more than the least memory; those that do not sort keep two of them.
    count = 150_000
    z = np.linspace(1, 7, count)
    soup = soups.stack(np.r_[z, z], (1, 1, 1, 1), reach=4.0)
    with pytest.raises(clpeel.InputError, match="memory: expected room for the .* fragments of one pixel"):
        render(soup, AHEAD, (1, 1), memory="1M", lanes=1)
    total = render(soup, AHEAD, (1, 1), "total", memory="1M", lanes=1)
    assert abs(total.thickness[0, 0] - 6) <= DEPTH_ROUNDINGS * 8 + 7 * UNIT * 6


def test_the_twin_knows_front_from_back() -> None:
    # Counterclockwise as seen, from +z: front-facing.
    triangle = soups.separate([[[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]], (1, 1, 1, 1))
    for soup, sign in ((triangle, 1), (turned_inside_out(triangle), -1)):
        twin = reference.project(soup, BENCH, (9, 9))
        assert np.sign(twin.edges[0].sum(axis=0)[2]) == -sign
