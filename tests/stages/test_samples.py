"""Several samples a pixel: where they lie, against the float64 twin, and what edges become of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import samples as twins
from twins import soups, textured
from twins.soups import BENCH, Eye, Soup

import clpeel
from clpeel.device.samples import PATTERNS
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

ASIDE = Eye((2.5, 1.5, -2.0), (0.1, 0.0, 0.05), (0.1, 1.0, -0.2), 40.0, (0.5, 8.0))
VIEWS = (BENCH, ASIDE, replace(ASIDE, orthographic=True))
EXACT = sorted(name for name, each in TECHNIQUES.items() if each.exact and each.sorts and not each.maps)
NUMBERS = (4, 8, 16)


def render(soup: Soup, view: Eye, size: tuple[int, int], samples: int, **options: Any) -> clpeel.Result:
    return plainly.render(soup.scene(), view.camera(), size=size, samples=samples, **options)


# --- where they lie ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("samples", sorted(twins.PLACES))
def test_patterns_are_those_of_the_twin(samples: int) -> None:
    assert sorted(PATTERNS[samples].places) == sorted(map(tuple, twins.PLACES[samples].tolist()))


@pytest.mark.parametrize("samples", NUMBERS)
def test_each_sample_has_a_column_and_a_row_of_its_own(samples: int) -> None:
    """The middles of n columns and of n rows, each once; and the word that kernels get says the same."""
    middles = (np.arange(samples) + 0.5) / samples
    for along in twins.PLACES[samples].T:
        np.testing.assert_array_equal(np.sort(along), middles)
    pattern = PATTERNS[samples]
    word = pattern.word
    first_x, first_y = word >> 16 & 255, word >> 24
    for row in range(4):
        for column in range(4):
            x = 256 * column + first_x + 64 * (word >> 2 * row & 3)
            y = 256 * row + first_y + 64 * (word >> 8 >> 2 * column & 3)
            right, down = pattern.places[row % pattern.rows * pattern.columns + column % pattern.columns]
            assert x == 256 * pattern.columns * (column // pattern.columns + right)
            assert y == 256 * pattern.rows * (row // pattern.rows + down)


# --- against the twin -------------------------------------------------------------------------------------------------


@st.composite
def any_soup(draw: st.DrawFn) -> tuple[Soup, Eye, tuple[int, int], str]:
    """A random scene, view, size and technique."""
    kind, colors = draw(st.sampled_from(sorted(soups.SIZES))), draw(st.sampled_from(soups.COLORS))
    soup = soups.random(draw(st.integers(0, 2**32 - 1)), draw(st.integers(1, 40)), kind, colors)
    size = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    return soup, draw(st.sampled_from(VIEWS)), size, draw(st.sampled_from(EXACT))


@pytest.mark.parametrize("samples", NUMBERS)
@given(any_soup())
def test_any_scene(samples: int, judge: Judge, case: tuple[Soup, Eye, tuple[int, int], str]) -> None:
    """Right, and the same bits in both executions and on both shapes of machine."""
    soup, view, size, technique = case
    call: dict[str, Any] = {"technique": technique}
    result = render(soup, view, size, samples, lanes=1, **call)
    twin = twins.render(judge, soup, view, size, samples)
    judge.color(result, twin.color, np.where(twin.excused, np.inf, twin.bound))
    judge.image(result, (1.0, 1.0, 1.0))
    judge.same_bits(render(soup, view, size, samples, lanes=64, **call), result)
    if TECHNIQUES[technique].has_passes:
        for lanes in (1, 64):
            judge.same_bits(render(soup, view, size, samples, lanes=lanes, execution="passes", **call), result)


@pytest.mark.parametrize("samples", NUMBERS)
@pytest.mark.parametrize("kind", ["small", "mixed"])
def test_no_fragment_is_lost(kind: str, samples: int, lanes: int, judge: Judge) -> None:
    """Most triangles of the small soup lie between samples, or cover one: dropping one of these would show."""
    soup = soups.random(7, {"small": 4000, "mixed": 100}[kind], kind, "flat")
    if kind == "small":  # even smaller, about their middles
        middles = soup.vertices.reshape(-1, 3, 3).mean(axis=1).repeat(3, axis=0)
        soup = replace(soup, vertices=middles + 0.3 * (soup.vertices - middles))
    size = (50, 41)
    result = render(soup, BENCH, size, samples, lanes=lanes)
    twin = twins.render(judge, soup, BENCH, size, samples)
    judge.color(result, twin.color, np.where(twin.excused, np.inf, twin.bound))
    assert twin.excused.mean() < 0.5 and abs(result.stats.fragments / twin.layers.sum() - 1) < 0.01


@pytest.mark.parametrize("samples", NUMBERS)
def test_triangles_larger_than_32_bits_hold(samples: int, lanes: int, judge: Judge) -> None:
    """Edge functions of 64 bits: the triangles reach far out of the picture, which is cut by the guard band, too."""
    soup = soups.merge(soups.quad(0.3, 40.0, (0.9, 0.2, 0.1, 0.5)), soups.random(3, 12, "large", "flat8"))
    soup = replace(soup, face_colors=np.array([[0.9, 0.2, 0.1, 0.5]] * len(soup.faces), np.float32))
    for view in (BENCH, ASIDE):
        result = render(soup, view, (70, 45), samples, lanes=lanes)
        twin = twins.render(judge, soup, view, (70, 45), samples)
        judge.color(result, twin.color, np.where(twin.excused, np.inf, twin.bound))


# --- shaded once ------------------------------------------------------------------------------------------------------

HOLED = textured.textured(textured.noise(3, 7, 7, [0, 255]), alpha_mode="MASK", alpha_cutoff=0.4)
SOFT = textured.textured(
    textured.noise(2, 8, 8, [60, 90, 200]), minify="linear-mipmap-linear", alpha_mode="BLEND", opacity=0.9
)
WALL = textured.textured(textured.noise(5, 9, 6, [0, 60]), wrap="mirror", opacity=0.7)
GLASS = Material(base_color=(0.9, 0.3, 0.1, 0.4), alpha_mode="BLEND")
MATERIALS = (HOLED, SOFT, WALL, GLASS)


@pytest.mark.parametrize(("technique", "samples"), [*(("sort", number) for number in NUMBERS), ("depth-peeling", 8)])
def test_materials(technique: str, samples: int, judge: Judge) -> None:
    """One colour for all samples of a face in a pixel, at its centre or as near to it as the face comes.

    Where texels cut away, each sample has its own.
    """
    rng = np.random.default_rng(samples)
    soup = textured.crossing(samples, 12, MATERIALS, vertex_colors=rng.uniform(0.2, 0.9, (48, 4)).astype(np.float32))
    kinds = rng.permutation(np.arange(12) % (len(MATERIALS) + 1)) + NO_MATERIAL
    soup = replace(soup, face_materials=np.repeat(kinds, 2))
    size = (37, 30)
    result = render(soup, BENCH, size, samples, lanes=1, technique=technique)
    twin = twins.render(judge, soup, BENCH, size, samples)
    assert twin.excused.mean() < 0.5
    judge.color(result, twin.color, np.where(twin.excused, np.inf, twin.bound))
    judge.same_bits(render(soup, BENCH, size, samples, lanes=64, technique=technique), result)
    if technique != "sort":
        judge.same_bits(render(soup, BENCH, size, samples, lanes=1, technique=technique, execution="passes"), result)


def test_a_light_is_the_same_on_all_machines(judge: Judge) -> None:
    soup = soups.merge(soups.sphere(0.7, (0.9, 0.5, 0.2, 0.5)), soups.random(3, 60, "mixed", "flat"))
    for samples in NUMBERS:
        call: dict[str, Any] = {"lighting": "headlight", "samples": samples}
        first = render(soup, BENCH, (50, 41), lanes=1, **call)
        for technique, lanes in [
            ("sort", 16),
            ("sort", 64),
            ("sort", 128),
            ("depth-peeling", 1),
            ("depth-peeling", 64),
        ]:
            if technique == "sort" or samples == 8:
                judge.same_bits(render(soup, BENCH, (50, 41), lanes=lanes, technique=technique, **call), first)


# --- edges ------------------------------------------------------------------------------------------------------------

STEPS_OFF = {4: 1.24, 8: 1.6, 16: 2.36}
"""How far off a pixel's share may be where an edge passes it at any angle, in steps of 1 / samples.

It is the discrepancy of the pattern for half-planes: the most that the share of samples on one side of any line differs
from the area there. It was searched in steps of 1/20 degree, at all distances where a sample changes sides.
"""


def area(normal: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """The area of pixels of side 1 where normal . p <= distance, p from their middles: an exact sum of triangles."""
    a, b = np.sort(np.abs(normal))
    along = np.clip(distance + (a + b) / 2, 0, a + b)
    if a < 1e-12:
        return np.clip(along / b, 0, 1)
    parts = [np.maximum(along - cut, 0) ** 2 for cut in (0, a, b, a + b)]
    return (parts[0] - parts[1] - parts[2] + parts[3]) / (2 * a * b)


@pytest.mark.parametrize("samples", NUMBERS)
@pytest.mark.parametrize("turned", [0.0, 90.0])
@pytest.mark.parametrize("kind", ["along an axis", "near an axis", "any"])
def test_sheets_a_pixel_wide_are_right_to_one_step(kind: str, turned: float, samples: int) -> None:
    """A translucent sheet's alpha, against alpha times the area that it covers of each pixel, in float64.

    Each of its two edges is off by half a step at most along an axis, by one if it leaves an axis by 1 in n at most,
    and by STEPS_OFF at any angle. Snapping moves corners by 1/512 of a sample's cell, and with them edges.
    """
    size, alpha, width = 64, 0.5, 1.1
    off = {"along an axis": 0.5, "near an axis": 1.0, "any": STEPS_OFF[samples]}[kind]
    tilts = {"along an axis": [0.0], "near an axis": [0.3 / samples, 0.99 / samples], "any": [0.4, 1.0, 2.1]}[kind]
    middle = np.arange(size) + 0.5 - size / 2
    x, y = np.meshgrid(middle, -middle)
    worst = 0.0
    for tilt in tilts:
        angle = np.radians(turned) + np.arctan(tilt)
        along, normal = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        starts = np.arange(-30, 30, 3.07)
        corners = [
            [*(s * 200 * along + (start + t * width) * normal), 0.0]
            for start in starts
            for s, t in ((-1, 0), (1, 0), (1, 1), (-1, 1))
        ]
        faces = (4 * np.arange(len(starts))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
        soup = soups.paint(corners, faces, (0.2, 0.4, 0.6, alpha))
        got = render(soup, soups.pixel_view(size), (size, size), samples).color[..., 3]
        places = normal[0] * x + normal[1] * y
        want = sum(area(normal, start + width - places) - area(normal, start - places) for start in starts)
        edges = sum(
            (np.abs(start + t * width - places) < np.abs(normal).sum() / 2 + 0.01).astype(int)
            for start in starts
            for t in (0, 1)
        )
        error = np.abs(got - alpha * want)
        assert (error <= alpha * edges * (off / samples + 0.005) + 1e-6).all()
        worst = max(worst, float(error.max()))
    assert worst > 0.1 * alpha / samples  # it is a test
