"""clpeel against the float64 twin, picture by picture: what the exactness rules promise of any scene.

What is held against a result (conftest.Judge.against_twin), for an image of any scene:
1. At least 99.9 % of the pixels are within 1/255 of the twin's.
2. Every pixel that is not touches an edge within the snapping distance: rounding to 1/256 pixel moves a corner by at
   most 1/512 in x and in y, and so every point of an edge; the distance is therefore max(|dx|, |dy|), see
   reference.edge_distance. A second excuse is needed on the lines where triangles pass through each other: where two
   layers' distances differ by less than float32 resolves (conftest.TIE), depth does not say which is in front.
3. All other pixels' `color` is within (3 N + 4) 2^-24, N the layers (reference.composite derives that and a tighter
   figure, which is what is used); interpolated colours add their own rounding (reference.interpolation_bound).
4. `image` is `color` over the background by the rule x 255 + 0.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import reference, soups
from twins.soups import BENCH, Eye, Soup

import clpeel

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZES = [(64, 64), (97, 61), (33, 130)]  # (width, height), tile multiples and not
ASIDE = Eye((2.5, 1.5, -2.0), (0.1, 0.0, 0.05), (0.1, 1.0, -0.2), 40.0, (0.5, 8.0))
FLAT = replace(ASIDE, orthographic=True)
VIEWS = {"front": BENCH, "aside": ASIDE, "orthographic": FLAT}


def render(soup: Soup, view: Eye, size: tuple[int, int], lanes: int, **options: Any) -> clpeel.Result:
    """clpeel's picture of a soup."""
    return plainly.render(soup.scene(), view.camera(), size=size, lanes=lanes, **options)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", ["small", "large", "mixed"])
@pytest.mark.parametrize("colors", soups.COLORS)
def test_soups(view: str, kind: str, colors: str, lanes: int, judge: Judge) -> None:
    number = sum(map(ord, view + kind + colors))
    soup = soups.random(number, {"small": 300, "large": 30, "mixed": 60}[kind], kind, colors)
    # Of 1,000 pixels along an edge about one changes sides, and 99.9 % of the picture must not.
    size = (160, 120)
    twin = judge.against_twin(render(soup, VIEWS[view], size, lanes), soup, VIEWS[view], size)
    assert twin.layers.max() >= 2


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("seed", [1, 2])
def test_sizes(size: tuple[int, int], seed: int, lanes: int, judge: Judge) -> None:
    soup = soups.random(seed, 8, "large")
    judge.against_twin(render(soup, ASIDE, size, lanes), soup, ASIDE, size)


GRADIENT = ((1.0, 0.9, 0.2), (0.1, 0.3, 0.6))


@pytest.mark.parametrize("background", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.2, 0.5, 0.9), GRADIENT, None])
def test_backgrounds(background: Any, lanes: int, judge: Judge) -> None:
    # Straight alpha magnifies what is off at an edge where little is covered, so few triangles.
    soup = soups.random(11, 6, "large", "flat")
    result = render(soup, ASIDE, (128, 128), lanes, background=background)
    judge.against_twin(result, soup, ASIDE, (128, 128), background)


def test_fitted_clipping_range_draws_everything(lanes: int, judge: Judge) -> None:
    soup, view = soups.random(12, 40), replace(ASIDE, clipping_range=None)
    judge.against_twin(render(soup, view, (128, 96), lanes), soup, view, (128, 96))


@pytest.mark.parametrize(("name", "options"), [("boxes", {}), ("grass", {}), ("spheres", {"resolution": 40})])
def test_bench_scenes(name: str, options: dict[str, int], lanes: int, judge: Judge, bench: Callable[..., Soup]) -> None:
    soup = bench(name, **options)
    twin = judge.against_twin(render(soup, BENCH, (256, 256), lanes), soup, BENCH, (256, 256))
    assert twin.layers.max() >= 10


def test_models(lanes: int, judge: Judge, model: Callable[[str], Any]) -> None:
    scene = clpeel.load(model("bunny.ply"), opacity=0.6, color=(230, 77, 51))
    camera = clpeel.Camera.frame(scene, aspect=1.0)
    camera = replace(camera, clipping_range=(camera.distance / 10, camera.distance * 10))
    result = plainly.render(scene, camera, size=(200, 200), lanes=lanes)
    judge.against_twin(result, scene, camera, (200, 200))


# --- the same bits, whatever the order and the machine --------------------------------------------------------------


@st.composite
def any_soup(draw: st.DrawFn) -> tuple[Soup, Eye, tuple[int, int], int]:
    """A random scene, view, size and seed."""
    seed = draw(st.integers(0, 2**32 - 1))
    count = draw(st.integers(1, 40))
    soup = soups.random(seed, count, draw(st.sampled_from(sorted(soups.SIZES))), draw(st.sampled_from(soups.COLORS)))
    size = (draw(st.integers(1, 40)), draw(st.integers(1, 40)))
    return soup, draw(st.sampled_from(list(VIEWS.values()))), size, seed


@given(any_soup())
def test_any_scene(judge: Judge, case: tuple[Soup, Eye, tuple[int, int], int]) -> None:
    """Right inside, and the same bits when shuffled, repeated, and on the other shape of machine."""
    soup, view, size, seed = case
    result = render(soup, view, size, lanes=1)
    twin, excused, bound = judge.weigh(soup, view, size)
    judge.color(result, twin.color, np.where(excused, np.inf, bound))

    judge.same_bits(render(soup, view, size, lanes=1), result, "repeated")
    judge.same_bits(render(soup, view, size, lanes=64), result, "on 64 lanes")
    order = np.random.default_rng(seed).permutation(len(soup.faces))
    shuffled = render(soup.take(order), view, size, lanes=1)
    # The order of submission decides where depths are equal, and only there: near ties are where that can happen.
    same = (shuffled.color.view(np.uint32) == result.color.view(np.uint32)).all(axis=2)
    same |= judge.ties(twin)
    if not same.all():
        judge.fail("shuffled triangles", shuffled.image, result.image, ~same)


@pytest.mark.parametrize("colors", ["flat8", "vertex"])
def test_memory_changes_nothing(colors: str, lanes: int, judge: Judge) -> None:
    soup = soups.random(31, 400, "large", colors)
    size = (150, 100)
    plenty = render(soup, ASIDE, size, lanes, memory="512M")
    assert plenty.stats["fragments"] * 8 > 2**20, "too few fragments to need batches"
    for memory in ("1M", "3M"):
        judge.same_bits(render(soup, ASIDE, size, lanes, memory=memory), plenty, f"memory={memory}")


def test_a_renderer_that_drew_before(lanes: int, judge: Judge) -> None:
    """Buffers are kept from picture to picture: no earlier one may show in the next, nor make it too small."""
    soup = soups.sphere(1.0, (200, 100, 50, 128), 200, 100)
    # The near and the far plane cut a good part of the faces, which then need room of their own.
    cut = Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=120.0, clipping_range=(0.95, 0.999)).camera()
    front = BENCH.camera()
    calls: list[dict[str, Any]] = [
        {"camera": camera, "size": size, "lighting": lighting}
        for size in ((20, 20), (90, 70), (33, 5))
        for lighting in ("none", "headlight")
        for camera in (front, cut, front)
    ]
    used = plainly.Renderer(soup.scene(), lanes=lanes)
    for number, call in enumerate(calls):
        fresh = plainly.Renderer(soup.scene(), lanes=lanes)
        fresh.gpu = replace(fresh.gpu, buffers={}, events=[])
        got, want = used.render(**call), fresh.render(**call)
        # What is written past a buffer's end need not show in the picture, so look at the room itself.
        small = {name: size for name, size in want.stats["bytes"].items() if got.stats["bytes"][name] < size}
        assert not small, f"picture {number}, {call}: too small are {small}"
        judge.same_bits(got, want, f"picture {number}: {call}")


def test_an_opaque_scene_is_its_nearest_layer(lanes: int, judge: Judge) -> None:
    soup = soups.random(41, 60, "mixed", alpha=(1.0, 1.0))
    size = (96, 96)
    result = render(soup, BENCH, size, lanes)
    twin = judge.against_twin(result, soup, BENCH, size)
    assert set(np.unique(result.color[..., 3])) <= {0.0, 1.0}
    assert twin.layers.max() > 3


# --- the judge itself must be able to say no --------------------------------------------------------------------------


def test_the_judge_sees_what_is_wrong(judge: Judge) -> None:
    soup, size = soups.random(51, 30, "large"), (96, 96)
    twin = reference.render(soup, BENCH, size)

    def judged(color: np.ndarray, image: np.ndarray | None = None) -> None:
        color = color.astype(np.float32)
        made = reference.image(color) if image is None else image
        judge.against_twin(type("Result", (), {"color": color, "image": made}), soup, BENCH, size)

    judged(twin.color)
    interior = np.argwhere((twin.layers > 1) & (reference.edge_distance(soup, BENCH, size) > 0.4))[0]
    for error in (0.01, 3 * (3 * twin.layers.max() + 4) * reference.UNIT, np.nan):
        wrong = twin.color.copy()
        wrong[tuple(interior)] += error
        with pytest.raises(pytest.fail.Exception, match="interior|1/255"):
            judged(wrong)
    with pytest.raises(pytest.fail.Exception, match="over the background"):
        image = reference.image(twin.color)
        image[tuple(interior)] ^= 1
        judged(twin.color, image)
    swapped = reference.render(soup.take(np.r_[1:30]), BENCH, size)  # one triangle lost
    with pytest.raises(pytest.fail.Exception, match=r"off by more than 1/255.*got\.png"):
        judged(swapped.color)
    shifted = replace(soup, vertices=soup.vertices + [2 / 96, 0, 0])  # half a pixel to the right
    with pytest.raises(pytest.fail.Exception):
        judged(reference.render(shifted, BENCH, size).color)
