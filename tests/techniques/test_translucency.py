"""translucency: its formula on the thickness and the colours there are, in float64; its light, and its limits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from twins import soups
from twins.reference import UNIT
from twins.solids import Rays, ball, box, random_solids
from twins.soups import AHEAD, BENCH, Eye, Soup

import clpeel
from clpeel.techniques.thickness import VARIANTS
from clpeel.techniques.translucency import LIGHT_COLOR, OPTICAL_DIAGONAL, REFLECTANCE

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

# C = F + (1 - F) B with F = r L S and B = light S T: products of up to 4 rounded numbers below one, their difference
# and sum, 10 roundings; T itself is off by 1 in the scale, 2 in the series' last steps and 2 of the exponent x, which
# are worth x exp(-x) < 0.4 of each: 4 more.
ROUNDINGS = 14 * UNIT


def formula(surface: Any, through: Any, light: Any = LIGHT_COLOR, shading: Any = 1.0) -> np.ndarray:
    """C for surface colours [..., 3] and what comes through [...]."""
    surface = np.asarray(surface, float)
    reflected = REFLECTANCE * np.asarray(shading)[..., None] * surface
    return reflected + (1 - reflected) * np.asarray(light) * surface * np.asarray(through)[..., None]


def render(soup: Soup, view: Eye, size: tuple[int, int], variant: str = "exact", **options: Any) -> clpeel.Result:
    """clpeel's picture of a soup."""
    return plainly.render(soup.scene(), view.camera(), size, "translucency", variant=variant, **options)


@pytest.mark.parametrize(("colors", "orthographic"), [("flat", False), ("vertex", True)])
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_formula(variant: str, colors: str, orthographic: bool, lanes: int, judge: Judge) -> None:
    soup, size, sigma, light = random_solids(4, 4), (50, 40), 3.0, (1.0, 0.5, 0.25)
    view = replace(BENCH, orthographic=orthographic)
    if colors == "vertex":
        rgba = np.random.default_rng(0).random((len(soup.vertices), 4)).astype(np.float32)
        soup = Soup(soup.vertices, soup.faces, vertex_colors=rgba)
    result = render(soup, view, size, variant, lanes=lanes, sigma=sigma, light_color=light)
    rays = Rays(soup, view, size)
    opaque = replace(soup, **{name: with_alpha_1(getattr(soup, name)) for name in ("face_colors", "vertex_colors")})
    foremost = plainly.render(opaque.scene(), view.camera(), size, lanes=lanes).color
    excused = rays.excused(variant) | judge.ties(rays.twin)
    want = formula(foremost[..., :3], np.exp(-sigma * rays.thickness[variant]), light)
    want = np.concatenate([want, np.ones((40, 50, 1))], -1) * rays.covered[..., None]
    bound = ROUNDINGS + sigma * rays.bound[variant]
    judge.color(result, want, np.where(excused, np.inf, bound))
    # And exactly as thick as `thickness` says.
    thickness = plainly.render(soup.scene(), view.camera(), size, "thickness", variant=variant, lanes=lanes)
    assert (result.thickness == thickness.thickness).all() and (result.unpaired == thickness.unpaired).all()
    exact = formula(foremost[..., :3], np.exp(-sigma * result.thickness.astype(float)), light)
    exact = np.concatenate([exact, np.ones((40, 50, 1))], -1) * rays.covered[..., None]
    judge.color(result, exact, np.where(rays.edge | judge.ties(rays.twin), np.inf, ROUNDINGS))
    judge.image(result, (1.0, 1.0, 1.0))
    assert result.color.max() <= 1 and result.stats["clamped_pixels"] == 0 and result.stats["sigma"] == sigma


def with_alpha_1(colors: Any) -> Any:
    """The same colours, opaque."""
    if colors is None:
        return None
    colors = np.array(colors)
    colors[:, 3] = 1
    return colors


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_light_at_the_camera(variant: str, lanes: int) -> None:
    # Nothing comes through at a great extinction: what is left is the lit colour times the reflectance.
    solid = ball(subdivisions=3)
    for alpha in (1.0, 0.25):
        scene = clpeel.Scene.from_arrays(solid.vertices, solid.faces, color=(1.0, 0.5, 0.25, 1.0))
        lit = plainly.render(scene, BENCH.camera(), (40, 40), lighting="headlight", lanes=lanes).color
        scene = clpeel.Scene.from_arrays(solid.vertices, solid.faces, color=(1.0, 0.5, 0.25, alpha))
        dark, bright = (
            plainly.render(
                scene,
                BENCH.camera(),
                (40, 40),
                "translucency",
                variant=variant,
                lighting="headlight",
                lanes=lanes,
                sigma=sigma,
                light_color=(1, 1, 1),
            )
            for sigma in (1e6, 0.0)
        )
        inside = dark.thickness > 0.5
        assert np.abs(dark.color[..., :3] - REFLECTANCE * lit[..., :3])[inside].max() <= 4 * UNIT
        surface = np.array([1.0, 0.5, 0.25])
        want = formula(surface, np.ones((40, 40)), (1, 1, 1), lit[..., 0].astype(float))
        assert np.abs(bright.color[..., :3] - want)[inside].max() <= ROUNDINGS
        assert (bright.color[..., 3] == lit[..., 3]).all()


def test_exp_of_all_sizes(lanes: int) -> None:
    # A wedge, 0 to 2 thick, seen along its edge's normal, at extinctions that take exp from 1 to 0.
    corners = [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0], [2, -2, 2], [2, 2, 2]]
    faces = [[0, 2, 1], [0, 3, 2], [0, 4, 5], [0, 5, 3], [1, 2, 5], [1, 5, 4], [0, 1, 4], [3, 5, 2]]
    soup = soups.paint(corners, faces, (1.0, 1.0, 1.0, 1.0))
    for sigma in (0.0, 1e-3, 0.3, 1.0, 7.0, 40.0, 80.0, 1e4, 1e30):
        result = render(soup, BENCH, (64, 8), lanes=lanes, sigma=sigma, light_color=(1, 1, 1))
        assert not result.unpaired.any() and result.thickness.max() > 1.4
        through = np.exp(-sigma * result.thickness.astype(float))
        error = np.abs(result.color[..., :3] - formula(np.ones(3), through, (1, 1, 1)))
        # Of white only T is rounded much: 3 of itself, and 2 x T < 0.8 for x; by 1 - F = 0.65, which is rounded, as the
        # product is; and 0.35 twice and the sum: below 2 + 4 T.
        assert (error <= UNIT * (2 + 4 * through[..., None]))[result.color[..., 3] == 1].all()


def test_leaves_before_a_statue(lanes: int) -> None:
    # The article's point: with `total` the gap between them absorbs, with the others it does not.
    statue = box((-0.8, -0.8, -0.5), (0.8, 0.8, 0.0), (1.0, 1.0, 1.0, 1.0))
    leaf = box((-0.3, -0.3, 1.4), (0.3, 0.3, 1.45), (1.0, 1.0, 1.0, 1.0))
    both = soups.merge(statue, leaf)
    middle = slice(13, 17), slice(18, 22)
    seen = {v: render(both, BENCH, (40, 30), v, lanes=lanes, sigma=2.0).color[middle][..., 0].mean() for v in VARIANTS}
    want = {"exact": 0.55, "total": 1.95, "first-solid": 0.05}
    for variant in VARIANTS:
        assert abs(seen[variant] - formula(np.ones(3), np.exp(-2 * want[variant]))[0]) <= 1e-5
    assert seen["total"] < seen["exact"] < seen["first-solid"]


def test_sigma_unless_told_goes_by_the_size(lanes: int) -> None:
    pictures = []
    for scale in (1.0, 2.0**20):
        view = Eye((0.0, 0.0, 4 * scale), clipping_range=(2 * scale, 6 * scale))
        result = render(ball(radius=scale), view, (40, 40), lanes=lanes)
        pictures.append(result.color)
        diagonal = 2 * np.sqrt(3) * scale
        assert result.stats["sigma"] == pytest.approx(OPTICAL_DIAGONAL / diagonal, rel=1e-3)
    assert np.abs(pictures[0] - pictures[1]).max() <= ROUNDINGS


@pytest.mark.parametrize("variant", VARIANTS)
def test_several_samples_are_the_mean(variant: str, lanes: int) -> None:
    soup = random_solids(2, 3)
    fine = render(soup, BENCH, (80, 64), variant, lanes=lanes)
    mean = render(soup, BENCH, (10, 8), variant, lanes=lanes, samples=64)
    for found, of in ((mean.color, fine.color), (mean.thickness[..., None], fine.thickness[..., None])):
        want = np.asarray(of, float).reshape(8, 8, 10, 8, -1).mean(axis=(1, 3))
        assert np.abs(found - want).max() <= 63 * UNIT * 8


def test_the_same_bits_with_any_lanes_and_memory(judge: Judge) -> None:
    soup = soups.merge(*[random_solids(5, 6)] * 60)
    for variant in VARIANTS:
        runs = [
            render(soup, BENCH, (90, 70), variant, lanes=lanes, memory=memory)
            for lanes in (1, 64)
            for memory in ("256M", "1M")
        ]
        assert runs[0].stats["batches"] == 1 < runs[1].stats["batches"]
        for other in runs[1:]:
            judge.same_bits(other, runs[0])
            assert (other.thickness == runs[0].thickness).all()


def test_more_layers_than_are_held_at_once(lanes: int) -> None:
    # 150 boxes, the nearest one red: the colour is its own, however many are behind.
    boxes = [
        box((-60, -60, -start - 0.01), (60, 60, -start), (1.0, 0.0, 0.0, 1.0) if start == 1 else (0.0, 1.0, 0.0, 0.3))
        for start in np.linspace(1, 7, 150)
    ]
    soup = soups.merge(*reversed(boxes))
    for memory in ("256M", "1M"):
        result = render(soup, AHEAD, (12, 3), lanes=lanes, memory=memory, sigma=0.5, light_color=(1, 1, 1))
        assert result.stats["layers_max"] == 300
        assert (result.color[..., 1:3] == 0).all()
        through = np.exp(-0.5 * result.thickness.astype(float))
        assert np.abs(result.color[..., 0] - formula(np.ones(3), through, (1, 1, 1))[..., 0]).max() <= ROUNDINGS
        assert np.abs(result.thickness - 1.5).max() < 1e-3


def test_nothing_in_view(lanes: int) -> None:
    away = clpeel.Camera((0, 0, 4), (0, 0, 8))
    result = plainly.render(ball().scene(), away, (20, 20), "translucency", lanes=lanes)
    assert not result.color.any() and (result.image == 255).all() and not result.thickness.any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "second"}, "variant: expected one of exact, total, first-solid; got 'second'"),
        ({"sigma": -1}, "sigma: expected a number of 0 or more, a scene unit, got -1"),
        ({"sigma": float("nan")}, "sigma: expected a number of 0 or more"),
        ({"sigma": "much"}, "sigma: expected a number of 0 or more, a scene unit, got 'much'"),
        ({"light_color": (1, 1)}, "light_color: expected 3 numbers 0..1"),
        ({"light_color": (1, 1, 2)}, "light_color: expected 3 numbers 0..1"),
        ({"projected": True}, "projected: the technique 'translucency' has no such option"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=message) as error:
        plainly.render(ball().scene(), BENCH.camera(), (4, 4), "translucency", **options)
    assert "\n" not in str(error.value)


def test_bunny(model: Any) -> None:
    scene = clpeel.load(model("bunny.ply"))
    lit = plainly.render(scene, size=(150, 150), technique="translucency", lighting="headlight")
    # Its ears and edges are brighter than its body.
    thin, thick = (lit.thickness > 0) & (lit.thickness < 0.02), lit.thickness > 0.06
    brightness = lit.color[..., :3].mean(axis=2)
    assert thin.sum() > 200 and thick.sum() > 200 and brightness[thin].mean() > 1.5 * brightness[thick].mean()
