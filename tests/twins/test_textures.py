"""The twins of textures and materials against closed forms, before anything is held against them. Needs no OpenCL."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from twins import materials, reference, soups, textured, textures
from twins.materials import Places, Roundings
from twins.soups import AHEAD
from twins.textured import checker, facing, noise
from twins.textures import Footprint

TINY = 1e-12
EXACT = Roundings(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Plain:
    """A texture with the fields of clpeel's."""

    image: NDArray[Any]
    wrap: tuple[str, str] = ("repeat", "repeat")
    magnify: str = "linear"
    minify: str = "linear-mipmap-linear"


def grey(values: Any) -> NDArray[np.float32]:
    """An image of floats with these levels [h, w], opaque."""
    image = np.ones((*np.shape(values), 4), np.float32)
    image[..., :3] = np.asarray(values)[..., None]
    return image


def at(texture: Plain, *uv: tuple[float, float], lod: float = -1.0) -> list[float]:
    """The red of samples."""
    return textures.sample(texture, np.array(uv), np.full(len(uv), lod))[:, 0].tolist()


def footprint(along_x: Any, along_y: Any, uv: Any = (0.5, 0.5)) -> Footprint:
    return Footprint(*(np.array([pair], np.float64) for pair in (uv, along_x, along_y)))


# --- sRGB -------------------------------------------------------------------------------------------------------------


def test_srgb_of_known_values() -> None:
    """White, black, the two pieces where they meet, and a linear half: 188 of 255, as everybody knows it."""
    np.testing.assert_allclose(textures.to_srgb([0, 0.0031308, 1]), [0, 0.0031308 * 12.92, 1], atol=TINY)
    np.testing.assert_allclose(textures.to_linear([0, 0.04045, 1]), [0, 0.04045 / 12.92, 1], atol=TINY)
    assert round(float(textures.to_srgb(0.5)) * 255) == 188
    assert float(textures.to_linear(128 / 255)) == pytest.approx(0.2158605, abs=1e-7)


def test_every_byte_comes_back() -> None:
    image = np.repeat(np.arange(256, dtype=np.uint8)[:, None, None], 4, axis=2)
    light = textures.decoded(image)
    assert (textures.stored(light, np.uint8) == image).all()
    assert (light[:, 0, 3] == np.arange(256) / 255).all() and (np.diff(light[:, 0, 0]) > 0).all()


# --- mip maps ---------------------------------------------------------------------------------------------------------


def test_levels_of_even_sides_are_means_of_four() -> None:
    levels = textures.mip_levels(grey(np.arange(8).reshape(2, 4) / 8))
    assert [level.shape for level in levels] == [(2, 4, 4), (1, 2, 4), (1, 1, 4)]
    assert levels[1][0, :, 0].tolist() == [2.5 / 8, 4.5 / 8] and levels[2][0, 0, 0] == 3.5 / 8


def test_odd_sides_are_weighted_by_what_is_covered() -> None:
    """Of 3 texels all weigh 1/3. Of 5 the two halves are (2, 2, 1) / 5 and (1, 2, 2) / 5. Of 7: (3, 3, 1) / 7, ..."""
    assert textures.halved(np.eye(3), 0) == pytest.approx(np.full((1, 3), 1 / 3), abs=TINY)
    five = np.array([[2, 2, 1, 0, 0], [0, 0, 1, 2, 2]]) / 5
    seven = np.array([[3, 3, 1, 0, 0, 0, 0], [0, 0, 2, 3, 2, 0, 0], [0, 0, 0, 0, 1, 3, 3]]) / 7
    assert textures.halved(np.eye(5), 0) == pytest.approx(five, abs=TINY)
    assert textures.halved(np.eye(7), 0) == pytest.approx(seven, abs=TINY)
    for n in range(1, 20):
        i = np.arange(n)
        weights = np.zeros((n, 2 * n + 1))
        weights[i, 2 * i], weights[i, 2 * i + 1], weights[i, 2 * i + 2] = n - i, n, i + 1
        assert textures.halved(np.eye(2 * n + 1), 1).T == pytest.approx(weights / (2 * n + 1), abs=TINY)


def test_levels_are_means_of_light() -> None:
    """A checker of black and white is 188 in every level, not 128; alphas are averaged as they are."""
    levels = textures.mip_levels(checker(4, 4, (0, 0, 0, 0), (255, 255, 255, 255)))
    for level in levels[1:]:
        assert (level[..., :3] == 188).all() and (level[..., 3] == 128).all()
    assert [level.shape[:2] for level in textures.mip_levels(noise(1, 5, 1))] == [(1, 5), (1, 2), (1, 1)]


def test_biases_enclose_the_levels() -> None:
    image = noise(2, 13, 9, [0, 100, 255])
    low, middle, high = (textures.mip_levels(image, bias) for bias in (-0.1, 0.0, 0.1))
    for a, b, c in zip(low, middle, high, strict=True):
        assert (a <= b).all() and (b <= c).all()
    assert any((a != c).any() for a, c in zip(low, high, strict=True))


# --- wrapping and filters ---------------------------------------------------------------------------------------------


def test_wraps_by_the_table_of_opengl() -> None:
    index = np.arange(-7, 8)
    assert textures.texel(index, 3, "repeat").tolist() == [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]
    assert textures.texel(index, 3, "mirror").tolist() == [0, 0, 1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]
    assert textures.texel(index, 3, "clamp").tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]


def test_a_checker_at_known_places() -> None:
    image = grey([[0.0, 1.0], [1.0, 0.0]])
    near, soft = Plain(image, magnify="nearest"), Plain(image)
    centres = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
    assert at(near, *centres) == at(soft, *centres) == [0, 1, 1, 0]
    assert at(near, (0.49, 0.49), (0.51, 0.49), (0.0, 0.0)) == [0, 1, 0]
    # In the middle of four: a half. A quarter of the way from centre to centre: 1/4. At (0, 0): wrapped around, a half.
    assert at(soft, (0.5, 0.5), (0.375, 0.25), (0.0, 0.0)) == [0.5, 0.25, 0.5]
    assert at(Plain(image, ("clamp", "clamp")), (0.0, 0.0), (1.0, 0.0), (-5.0, 9.0)) == [0, 1, 1]


def test_beyond_the_edges() -> None:
    """U = 1.25 is 0.25 again if repeated, and 0.75 if mirrored; 2.25 is 0.25 of both."""
    image = grey([[0.1, 0.2, 0.3, 0.4]])
    u = [(1.1, 0.5), (1.35, 0.5), (2.1, 0.5), (-0.1, 0.5), (-1.1, 0.5)]
    values = {wrap: at(Plain(image, (wrap, "clamp"), "nearest"), *u) for wrap in ("repeat", "mirror", "clamp")}
    assert values["repeat"] == pytest.approx([0.1, 0.2, 0.1, 0.4, 0.4])
    assert values["mirror"] == pytest.approx([0.4, 0.3, 0.1, 0.1, 0.4])
    assert values["clamp"] == pytest.approx([0.4, 0.4, 0.4, 0.1, 0.1])


def test_a_linear_filter_keeps_a_gradient() -> None:
    """Texels that are their middles' u: between the outer middles, sampling is the identity."""
    ramp = Plain(grey([(np.arange(16) + 0.5) / 16]), ("clamp", "clamp"))
    u = np.linspace(0.5 / 16, 15.5 / 16, 77)
    assert at(ramp, *((x, 0.5) for x in u)) == pytest.approx(u.tolist(), abs=TINY)


def test_one_texel_is_everywhere() -> None:
    for wrap in ("repeat", "mirror", "clamp"):
        one = Plain(grey([[0.25]]), (wrap, wrap))
        assert at(one, (0.5, 0.5), (1e6, -3.0), (-0.75, 2.0)) == [0.25] * 3
        assert at(one, (0.3, 0.4), lod=5.0) == [0.25]


# --- the level of detail ----------------------------------------------------------------------------------------------

PYRAMID = grey(np.repeat([[0.0, 1.0]], 8, axis=0).repeat(4, axis=1))  # 8 x 8, black on the left, white on the right


def test_levels_are_chosen_as_opengl_says() -> None:
    """Level k of a ramp from left to right is known by its leftmost texel: 0, 0, 0, 1/2."""
    spot = (0.01, 0.5)
    # Of 8 x 8 the columns are 0 0 0 0 1 1 1 1, of 4 x 4: 0 0 1 1, of 2 x 2: 0 1, of 1 x 1: 1/2.
    for lod, want in ((-1, 0), (1.9, 0), (2.4, 0), (2.5, 0), (2.51, 0.5), (3, 0.5), (9, 0.5)):
        assert at(Plain(PYRAMID, magnify="nearest", minify="nearest-mipmap-nearest"), spot, lod=lod) == [want], lod
    for lod, want in ((2, 0), (2.25, 0.125), (2.5, 0.25), (3, 0.5), (7, 0.5)):
        assert at(Plain(PYRAMID, minify="nearest-mipmap-linear"), spot, lod=lod) == pytest.approx([want]), lod
    for minify in ("nearest", "linear"):
        assert at(Plain(PYRAMID, minify=minify), (0.3, 0.5), lod=9.0) == [0]


def test_zero_is_magnified() -> None:
    image = grey([[0.0, 1.0]])
    spot = (0.5, 0.5)  # between both texels: a half if linear, the right one if nearest
    for magnify, minify, below, above in (("linear", "nearest", 0.5, 1.0), ("nearest", "linear", 1.0, 0.5)):
        texture = Plain(image, magnify=magnify, minify=minify)
        assert [*at(texture, spot, lod=0.0), *at(texture, spot, lod=1e-9)] == [below, above]


def test_footprints_are_in_texels() -> None:
    """16 wide and 4 high: 1/16 of u is a texel, and 1/4 of v."""
    texture = Plain(np.zeros((4, 16, 4), np.float32))
    x, y = textures.lengths(texture, footprint((3 / 16, 4 / 4), (0, 1 / 4)))
    assert x[0] == pytest.approx(5) and y[0] == pytest.approx(1)


def test_anisotropy_by_the_extension() -> None:
    """Four texels along x and one along y: level 2 by one probe, level 1 by two, and the image itself by four."""
    count = [int(textures.probe_count(np.array([4.0]), np.array([1.0]), most)[0]) for most in (1, 2, 4, 8)]
    assert count == [1, 2, 4, 4]
    assert textures.probe_count(np.array([4.1, 0.0, 3.0]), np.array([1.0, 0.0, 0.0]), 8).tolist() == [5, 1, 8]
    ramp = Plain(grey([(np.arange(64) + 0.5) / 64] * 64), ("clamp", "clamp"))
    spot = footprint((4 / 64, 0), (0, 1 / 64))
    for most in (1, 2, 4):  # the mean of a ramp is its middle, however it is taken
        assert textures.texels(ramp, spot, most)[0, 0] == pytest.approx(0.5, abs=1e-7)
    # A single white column, a texel right of the middle: of four probes one hits it; level 2 spreads it over four.
    image = np.zeros((64, 64))
    image[:, 33] = 1
    line = Plain(grey(image), magnify="nearest", minify="nearest-mipmap-nearest")
    assert textures.texels(line, spot, 4)[0, 0] == pytest.approx(0.25)
    assert textures.texels(line, spot, 1)[0, 0] == pytest.approx(0.25)
    assert textures.texels(replace(line, minify="nearest"), spot, 2)[0, 0] == pytest.approx(0.5)  # 31 and 33
    assert textures.texels(replace(line, minify="nearest"), footprint((0, 1 / 64), (4 / 64, 0)), 2)[0, 0] == 0.5


# --- ranges -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("anisotropy", [1, 4])
@pytest.mark.parametrize("minify", ["nearest", "linear", "nearest-mipmap-nearest", "linear-mipmap-linear"])
def test_ranges_hold_what_footprints_may_be(minify: str, anisotropy: int) -> None:
    rng = np.random.default_rng(3)
    texture = Plain(noise(4, 12, 7), ("mirror", "repeat"), "linear", minify)
    n = 400
    spot = Footprint(rng.uniform(-2, 2, (n, 2)), *rng.uniform(-0.3, 0.3, (2, n, 2)))
    off = Footprint(np.full((n, 2), 1e-3), np.full((n, 2), 1e-3), np.full((n, 2), 1e-3))
    low, high = textures.texel_range(texture, spot, off, anisotropy=anisotropy)
    narrow = ((high - low).max(axis=1) < 0.3).mean()
    assert narrow > 0.3, "ranges so wide that they prove nothing"
    for _ in range(20):
        move = [rng.uniform(-1e-3, 1e-3, (n, 2)) for _ in range(3)]
        moved = Footprint(spot.uv + move[0], spot.along_x + move[1], spot.along_y + move[2])
        found = textures.texels(texture, moved, anisotropy)
        assert (found >= low - TINY).all() and (found <= high + TINY).all()


# --- materials --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Stuff:
    """A material with the fields of clpeel's."""

    base_color: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    texture: Plain | None = None
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    opacity: float = 1.0
    rgb_of_scene: bool = True
    alpha_of_scene: bool = True


def painted(material: Stuff, color: Any) -> materials.Painted:
    """What a material makes of one hit in the middle of its texture."""
    scene = soups.Soup(np.eye(3), np.array([[0, 1, 2]]), materials=(material,), face_materials=np.zeros(1, int))
    spot = footprint((0, 0), (0, 0))
    return materials.paint(scene, Places(np.zeros(1, int), np.array([color], float), spot))


def test_colours_are_products_of_light() -> None:
    texture = Plain(np.array([[[0.5, 1, 0.25, 0.5]]], np.float32))
    stuff = Stuff((0.5, 0.5, 1.0, 0.5), texture)
    color = (0.5, 1.0, 1.0, 0.5)
    light = [0.125, 0.5, 0.25]
    for mode, alpha in (("OPAQUE", 1.0), ("MASK", 1.0), ("BLEND", 0.125)):
        found = painted(replace(stuff, alpha_mode=mode), color)
        assert found.color[0].tolist() == pytest.approx([*textures.to_srgb(light), alpha], abs=TINY)
        assert found.there[0] == (mode != "MASK")
        faint = painted(replace(stuff, alpha_mode=mode, opacity=0.5), color).color[0, 3]
        assert faint == pytest.approx(alpha / 2)
    own = painted(replace(stuff, rgb_of_scene=False, alpha_of_scene=False, alpha_mode="BLEND"), color).color[0]
    assert own.tolist() == pytest.approx([*textures.to_srgb([0.25, 0.5, 0.25]), 0.25], abs=TINY)


def test_the_cut_off_itself_is_there() -> None:
    for alpha, there in ((0.5, True), (0.49, False), (0.0, False), (1.0, True)):
        assert painted(Stuff((1, 1, 1, alpha), alpha_mode="MASK"), (1, 1, 1, 1)).there[0] == there
    assert painted(Stuff((1, 1, 1, 0), alpha_mode="MASK", alpha_cutoff=0.0), (1, 1, 1, 1)).there[0]
    assert not painted(Stuff(alpha_mode="MASK", alpha_cutoff=1.5), (1, 1, 1, 1)).there[0]


def test_nothing_is_not_there() -> None:
    """Where texels of alpha 0 are blended, and nowhere else."""
    clear = np.zeros((1, 2, 4), np.float32)
    clear[0, 1, 3] = 1
    for mode, there in (("BLEND", False), ("OPAQUE", True)):
        texture = Plain(clear, ("clamp", "clamp"))
        found = painted(Stuff((1, 1, 1, 1), Plain(clear[:, :1]), mode), (1, 1, 1, 1))
        assert found.there[0] == there
        assert painted(Stuff((1, 1, 1, 1), texture, mode), (1, 1, 1, 1)).there[0]  # half of it
    assert painted(Stuff((1, 1, 1, 0), None, "BLEND"), (1, 1, 1, 1)).there[0]


# --- pictures ---------------------------------------------------------------------------------------------------------


def test_one_texel_a_pixel() -> None:
    image = noise(5, 24, 10)
    for material in (textured.textured(image), textured.textured(image, magnify="nearest")):
        picture = reference.render(facing(material, (24, 10)), soups.pixel_view(10), (24, 10))
        assert (reference.image(picture.color)[..., :3] == image[..., :3]).all() and (picture.layers == 1).all()


def test_slopes_are_differences_of_neighbours() -> None:
    """Of the plane, seen at a slant: finite differences over a thousandth of a pixel."""
    soup = textured.floor(textured.textured(noise(6, 4, 4)), [[0, 1], [3, 1], [3, 0], [0, 0]])
    size = (20, 20)
    projected = reference.project(soup, AHEAD, size)
    pixel, triangle, _ = reference.cast(projected, size)
    found = reference.places(projected, pixel, triangle, size).at
    x, y = reference.samples(pixel, size)
    for slope, dx, dy in ((found.along_x, 1e-3, 0), (found.along_y, 0, 1e-3)):
        ends = [
            reference.blend(reference.barycentric(projected, triangle, x + s * dx, y + s * dy), projected.uv[triangle])
            for s in (-0.5, 0.5)
        ]
        np.testing.assert_allclose(slope, (ends[1] - ends[0]) / 1e-3, rtol=1e-5, atol=1e-9)


def test_cut_hits_are_gone() -> None:
    """Behind a mask's holes the next layer is seen, and counted."""
    image = checker(4, 4, (255, 0, 0, 255), (255, 0, 0, 0))
    mask = textured.textured(image, magnify="nearest", alpha_mode="MASK")
    front = facing(mask, (8, 8))
    back = np.array([[-4, -4, -1], [4, -4, -1], [4, 4, -1], [-4, 4, -1]], float)
    soup = replace(
        front,
        vertices=np.concatenate([front.vertices, back]),
        faces=np.concatenate([front.faces, front.faces + 4]),
        face_materials=np.array([0, 0, -1, -1]),
        uv=np.concatenate([front.uv, front.uv]),
        face_colors=np.array([[255] * 4] * 2 + [[0, 0, 255, 255]] * 2, np.uint8),
        color=None,
    )
    picture = reference.render(soup, soups.pixel_view(8), (8, 8))
    there = (np.add.outer(np.arange(8) // 2, np.arange(8) // 2) % 2) == 0
    assert (picture.layers == 1 + there).all() and len(picture.cut[0]) == 32
    want = np.where(there[..., None], [1, 0, 0, 1], [0, 0, 1, 1])
    np.testing.assert_allclose(picture.color, want, atol=TINY)


@pytest.mark.parametrize("view", [AHEAD, soups.pixel_view(8)])
def test_faces_seen_from_behind(view: soups.Eye) -> None:
    """Counterclockwise is the front. One that has one side is not seen from behind."""
    triangle = [[-9.0, -9, 0], [9, -9, 0], [0, 20, 0]]
    moved = np.array(triangle) - [0, 0, 0 if view.orthographic else 2]
    for corners, front in ((moved, True), (moved[::-1], False)):
        for single in (False, True):
            soup = replace(soups.separate([corners], (1.0, 1.0, 1.0, 1.0)), single_sided=np.array([single]))
            seen = {
                kind: bool(reference.render(soup, view, (8, 8), backfaces=kind).layers.all())
                for kind in ("default", "visible", "hidden")
            }
            assert seen == {"default": front or not single, "visible": True, "hidden": front}


def test_the_bound_holds_what_moved_corners_do() -> None:
    """Corners that move by up to a tenth of a pixel move no colour by more."""
    material = textured.textured(noise(7, 16, 16, [0, 90, 255]), minify="linear-mipmap-linear", alpha_mode="BLEND")
    soup = textured.crossing(8, 3, [material])
    view, size, rng = soups.BENCH, (40, 40), np.random.default_rng(9)
    picture = reference.render(soup, view, size)
    bound, _ = reference.paint_bound(soup, picture, 0.1, 0.0, EXACT)
    safe = (reference.edge_distance(soup, view, size) > 0.2) & ~reference.near_tie(picture, shift=0.2)
    pixel = 4 * np.tan(np.radians(15)) * 2 / size[1]  # in the middle of the scene
    worst = 0.0
    for _ in range(6):
        # A move along the screen, of a plane's corners alike: its points keep their coordinates.
        moved = soup.vertices.copy()
        moved[:, :2] += np.repeat(rng.uniform(-0.05, 0.05, (3, 2)), 4, axis=0) * pixel
        found = reference.render(replace(soup, vertices=moved), view, size)
        error = np.abs(found.color - picture.color).max(axis=2)
        assert (error[safe] <= bound[safe] + 1e-9).all()
        worst = max(worst, (error[safe] / np.maximum(bound[safe], 1e-9)).max())
    assert safe.mean() > 0.3 and worst > 0.1
