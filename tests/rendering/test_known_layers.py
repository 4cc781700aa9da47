"""Known layers: that rounding cannot change which fragments they have, and that every technique's picture is known."""

from __future__ import annotations

from itertools import product

import numpy as np
import plainly
import pytest
from twins import reference, soups

from clpeel.device.layout import Features
from clpeel.rendering import checking, known_layers
from clpeel.rendering.known_layers import CUT, FACES, HEIGHT, NEAR, SHOWN, WIDTH, Wanted, stack_of
from clpeel.techniques import TECHNIQUES

SIZES = ((WIDTH, HEIGHT), (48, HEIGHT))  # the second one is that of 256 samples a pixel
VIEWS = list(product((True, False), (True, False)))


def wanted(perspective: bool = True, cut: bool = True, pairs: bool = False, rate: str = "face") -> Wanted:
    return Wanted(Features(1, rate, packed_color=False), "transparent", perspective, pairs, cut)


def test_every_technique_has_a_known_picture() -> None:
    """A new technique either sorts, and is known, or needs an entry in SHOWN."""
    assert set(SHOWN) == set(TECHNIQUES)


def test_no_sample_has_more_layers_than_are_told() -> None:
    """The number is known without the layers, as these are imported only for a test."""
    assert len([*FACES, CUT]) == checking.LAYERS


@pytest.mark.parametrize("size", SIZES)
def test_edges_are_clear_of_samples(size: tuple[int, int]) -> None:
    """No sample is within 1/20 of its spacing of an edge, and snapping moves an edge by 1/512 at most."""
    column, row = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    x, y = (column + 0.5 - size[0] / 2).reshape(-1), (size[1] / 2 - row - 0.5).reshape(-1)
    for corner_x, corner_y, _ in (*FACES, CUT):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            across, up = corner_x[b] - corner_x[a], corner_y[b] - corner_y[a]
            along = (x - corner_x[a]) * across + (y - corner_y[a]) * up
            away = np.abs(across * (y - corner_y[a]) - up * (x - corner_x[a])) / np.hypot(across, up)
            within = (along > -1) & (along < across**2 + up**2 + 1)
            assert away[within].min() > 1 / 20


@pytest.mark.parametrize(("perspective", "cut"), VIEWS)
@pytest.mark.parametrize("size", SIZES)
def test_depths_differ_clearly_or_not_at_all(perspective: bool, cut: bool, size: tuple[int, int]) -> None:
    stack = stack_of(wanted(perspective, cut), size, False)
    both = stack.present[:, 1:] & stack.present[:, :-1]
    apart = np.diff(stack.distance, axis=1)[both]
    assert (apart == 0).any() and apart[apart > 0].min() > 1e-3
    shown = stack.distance[stack.present]
    assert shown.min() > NEAR * 1.002  # and the cut is clear of samples


@pytest.mark.parametrize(("perspective", "cut"), VIEWS)
def test_they_are_worth_a_test(perspective: bool, cut: bool) -> None:
    """There are pixels of 0 to 4 layers and more, some submitted in each order, from either side, and crossings."""
    stack = stack_of(wanted(perspective, cut), SIZES[0], False)
    assert set(stack.present.sum(axis=1)) >= {0, 1, 2, 3, 4}
    assert stack.back[stack.present].any() and not stack.back[stack.present].all()
    orders = {tuple(face[there]) for face, there in zip(stack.face, stack.present, strict=True)}
    assert {order for order in orders if list(order) != sorted(order)}
    assert any((1, 4) in zip(order, order[1:], strict=False) for order in orders)
    assert any((4, 1) in zip(order, order[1:], strict=False) for order in orders)


@pytest.mark.parametrize("rate", ["scene", "face", "vertex"])
@pytest.mark.parametrize("pairs", [True, False])
def test_the_scene_is_as_wanted(rate: str, pairs: bool) -> None:
    scene = wanted(pairs=pairs, rate=rate).scene()
    assert (scene.positions().lo is not None) == pairs
    given = {"scene": scene.color, "face": scene.face_colors, "vertex": scene.vertex_colors}
    assert [name for name, colors in given.items() if colors is not None] == [rate]


@pytest.mark.parametrize(("perspective", "cut"), VIEWS)
@pytest.mark.parametrize("rate", ["face", "vertex"])
def test_blending_is_that_of_the_other_twin(perspective: bool, cut: bool, rate: str) -> None:
    """The float64 twin of the other tests rasterizes in another way, and blends the same picture."""
    want = wanted(perspective, cut, rate=rate)
    scene = want.scene()
    soup = soups.Soup(
        scene.vertices,
        scene.faces,
        face_colors=None if scene.face_colors is None else scene.face_colors.astype(float),
        vertex_colors=None if scene.vertex_colors is None else scene.vertex_colors.astype(float),
    )
    twin = reference.render(soup, want.camera(), SIZES[0])
    stack = stack_of(want, SIZES[0], False)
    color = known_layers.blended(stack, stack.transparent).reshape(HEIGHT, WIDTH, 4)
    color[..., 3] = 1 - color[..., 3]
    np.testing.assert_allclose(color, twin.color, atol=1e-5)


def test_the_camera_sees_them() -> None:
    result = plainly.render(wanted().scene(), wanted().camera(), size=SIZES[0], technique="layer-count")
    count = stack_of(wanted(), SIZES[0], False).present.sum(axis=1)
    np.testing.assert_array_equal(result.map("layer_count").reshape(-1), count)
