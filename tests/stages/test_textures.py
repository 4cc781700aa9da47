"""Sampling of textures: closed forms, then every filter, wrap and level of detail against the float64 twin."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import soups, textured, textures
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH, Eye, Soup
from twins.textured import facing, noise

import clpeel
from clpeel.scene.materials import Material
from clpeel.scene.textures import MAGNIFY, MINIFY, WRAPS, Texture
from clpeel.stages import shading
from clpeel.stages.shading import mip_map

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

SMALL = (40, 30)
LEVELLED = textured.textured(noise(14, 16, 16), minify="linear-mipmap-linear")


def render(soup: Soup, view: Eye, size: tuple[int, int], lanes: int, **options: Any) -> clpeel.Result:
    """clpeel's picture of a soup. There is always a mip map, so that one build is enough for almost all tests."""
    scene = textured.beside(soup, [LEVELLED]).scene()
    return plainly.render(scene, view.camera(), size=size, lanes=lanes, **options)


def straight(material: Material, size: tuple[int, int], lanes: int, uv: Any = textured.FILL, **options: Any) -> Any:
    """A picture that a quad with this material fills."""
    return render(facing(material, size, uv), soups.pixel_view(size[1]), size, lanes, **options)


def light(result: clpeel.Result) -> NDArray[np.float64]:
    """A picture's colours in linear light: float64 [h, w, 3]."""
    return textures.to_linear(result.color[..., :3])


def gradient(width: int) -> NDArray[np.float32]:
    """Red is u, as a linear filter has it between the outermost texels' middles; so are green and blue."""
    image = np.ones((1, width, 4), np.float32)
    image[..., :3] = ((np.arange(width, dtype=np.float64) + 0.5) / width)[:, None]
    return image


# --- closed forms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("minify", MINIFY)
def test_one_texel_a_pixel_is_the_image(minify: str, lanes: int) -> None:
    """Every byte of every channel, whatever the filter: in the middle of a texel nothing else counts."""
    every = np.arange(256, dtype=np.uint8).reshape(16, 16)
    image = np.stack([every, every.T, every[::-1], np.full_like(every, 255)], axis=-1)
    image = np.concatenate([image, image[::-1]], axis=1)
    for magnify in MAGNIFY:
        got = straight(textured.textured(image, magnify=magnify, minify=minify), (32, 16), lanes)
        assert (got.image == image).all()


def test_row_0_is_on_top_where_v_is_0(lanes: int) -> None:
    image = noise(1, 20, 15)
    turned = straight(textured.textured(image, magnify="nearest"), (20, 15), lanes, ((1.0, 1.0), (0.0, 0.0)))
    assert (turned.image == image[::-1, ::-1]).all()


def test_nearest_magnified_is_repeated_texels(lanes: int) -> None:
    image = noise(2, 8, 6)
    got = straight(textured.textured(image, magnify="nearest", minify="linear"), (32, 24), lanes)
    assert (got.image == image.repeat(4, axis=0).repeat(4, axis=1)).all()


def test_light_is_filtered_and_not_bytes(lanes: int) -> None:
    """Half way between black and white is 188 of 255, and so is their mean in a mip map."""
    image = np.zeros((1, 2, 4), np.uint8)
    image[..., 3], image[0, 1] = 255, 255
    got = straight(textured.textured(image, wrap="clamp"), (3, 1), lanes)  # samples at 1/6, 1/2 and 5/6
    assert got.image[0, :, 0].tolist() == [0, 188, 255]
    assert got.color[0, 1, 0] == pytest.approx(float(textures.to_srgb(0.5)), abs=1e-6)
    far = straight(textured.textured(image, minify="nearest-mipmap-nearest"), (4, 4), lanes, ((0.0, 0.0), (8.0, 4.0)))
    assert (far.image[..., :3] == 188).all()


@pytest.mark.parametrize("uv", [((-2.0, -2.0), (3.0, 3.0)), ((-2.0, 3.0), (3.0, -2.0))])
def test_every_wrap_of_whole_texels(uv: Any, lanes: int) -> None:
    """Five copies a side, of 4 x 3 texels, two pixels each: by the indices themselves."""
    image = noise(3, 4, 3)
    size = 5 * 4 * 2, 5 * 3 * 2
    i, j = (np.arange(-2 * n, 3 * n).repeat(2) for n in (4, 3))
    j = j if uv[0][1] < 0 else j[::-1]
    for across in WRAPS:
        for down in WRAPS:
            material = textured.textured(image, wrap=(across, down), magnify="nearest")
            want = image[textures.texel(j, 3, down)][:, textures.texel(i, 4, across)]
            got = straight(material, size, lanes, uv)
            assert (got.image == want).all(), (across, down)
            view = soups.pixel_view(size[1]).camera()
            alone = plainly.render(facing(material, size, uv).scene(), view, size, lanes=lanes)  # without any mip map
            assert (alone.image == want).all(), (across, down)


def test_coordinates_are_perspective_correct(lanes: int) -> None:
    """A floor to the horizon whose u is its distance: row by row where its ray comes down, to 1e-5."""
    far, size = 100.0, (24, 64)
    ramp = textured.textured(gradient(256), wrap="clamp")
    soup = textured.floor(ramp, [[0, 0], [0, 1], [1, 1], [1, 0]], 1.0, far)
    got = render(soup, replace(AHEAD, clipping_range=(0.5, 200.0)), size, lanes)
    slope = (np.arange(size[1]) + 0.5) / size[1] * 2 - 1
    rows = slope > 1.05 / far
    want = np.clip((1 / slope[rows] - 1) / (far - 1), 0.5 / 256, 1 - 0.5 / 256)
    assert rows.sum() > 25
    assert np.abs(light(got)[rows] - want[:, None, None]).max() <= 1e-5
    assert (got.color[~rows & (slope < 0)] == 0).all()


def test_coordinates_in_parallel_projection(lanes: int) -> None:
    size = (97, 5)
    got = straight(textured.textured(gradient(128), wrap="clamp"), size, lanes)
    want = np.clip((np.arange(97) + 0.5) / 97, 0.5 / 128, 1 - 0.5 / 128)
    assert np.abs(light(got) - want[None, :, None]).max() <= 1e-5


def test_floats_are_linear(lanes: int) -> None:
    """A texture of floats is shown as sRGB: 1/4 as 0.537."""
    image = np.full((2, 3, 4), 0.25, np.float32)
    got = straight(textured.textured(image), (6, 4), lanes)
    assert np.abs(got.color[..., :3] - textures.to_srgb(0.25)).max() <= 8 * UNIT


def test_a_slant_takes_more_probes(lanes: int) -> None:
    """Four texels a pixel along one side, and one along the other: four probes are their mean, and one is level 2."""
    image = noise(4, 32, 8)
    seen = textures.decoded(image)[..., :3]
    for turned in (False, True):
        given = image.swapaxes(0, 1) if turned else image
        material = textured.textured(given, minify="nearest-mipmap-nearest", magnify="nearest")
        size = (8, 8)
        four = straight(material, size, lanes, anisotropy=4)
        mean = seen.reshape(8, 8, 4, 3).mean(axis=2)
        assert np.abs(light(four) - (mean.swapaxes(0, 1) if turned else mean)).max() <= 1e-6
        one = straight(material, size, lanes)
        level = textures.decoded(mip_map(material.texture)[2])[..., :3]  # 8 x 2, each pixel of a column in one of them
        level = level.swapaxes(0, 1) if turned else level
        want = level.repeat(4, axis=0)
        assert np.abs(light(one) - (want.swapaxes(0, 1) if turned else want)).max() <= 1e-6


# --- against the twin -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wrap", WRAPS)
def test_wraps_of_linear_filters(wrap: str, lanes: int, judge: Judge) -> None:
    for down in WRAPS:
        material = textured.textured(noise(5, 5, 4), wrap=(wrap, down))
        soup = facing(material, SMALL, ((-2.1, -1.9), (3.05, 3.15)))
        judge.painted(render(soup, soups.pixel_view(30), SMALL, lanes), soup, soups.pixel_view(30), SMALL)


@pytest.mark.parametrize("minify", MINIFY)
@pytest.mark.parametrize("times", [0.4, 0.999, 1.001, 1.413, 1.415, 2.0, 3.7, 4.0])  # just below and above 1, 2**0.5
def test_minified(minify: str, times: float, lanes: int, judge: Judge) -> None:
    """By whole and by odd factors, of an image with odd levels: 52 x 37, 26 x 18, 13 x 9, 6 x 4, 3 x 2, 1 x 1."""
    for magnify in MAGNIFY:
        material = textured.textured(noise(6, 52, 37), magnify=magnify, minify=minify)
        view = soups.pixel_view(30)
        uv = ((0.01, 0.02), (0.01 + 40 * times / 52, 0.02 + 30 * times / 37))
        soup = facing(material, SMALL, uv)
        judge.painted(render(soup, view, SMALL, lanes), soup, view, SMALL)


@pytest.mark.parametrize("anisotropy", [1, 2, 4, 8, 16])
def test_a_floor_to_the_horizon(anisotropy: int, judge: Judge) -> None:
    """All levels of detail at once, and all counts of probes. Lane counts take turns: a build takes seconds."""
    material = textured.textured(noise(7, 32, 32), minify="linear-mipmap-linear")
    soup = textured.floor(material, [[0, 1], [20, 1], [20, 0], [0, 0]], 1.0, 60.0)
    view, size = replace(AHEAD, clipping_range=(0.5, 100.0), view_up=(0.3, 1.0, 0.0)), (48, 48)
    lanes = {1: (1, 64), 2: (1,), 4: (1, 64), 8: (64,), 16: (1,)}[anisotropy]
    for count in lanes:
        got = render(soup, view, size, count, anisotropy=anisotropy)
        judge.painted(got, soup, view, size, anisotropy=anisotropy)


@pytest.mark.parametrize("times", [0.999, 1.001, 1.999, 2.001, 2.999, 3.001, 3.999, 4.001])
def test_counts_of_probes(times: float, lanes: int, judge: Judge) -> None:
    """So many texels a pixel along one side and one along the other, just below and above whole numbers; up to four."""
    for turned in (False, True):
        image = noise(9, 64, 48)
        material = textured.textured(image.swapaxes(0, 1) if turned else image, minify="linear-mipmap-linear")
        size, far = ((12, 12), (0.1 + 12 * times / 64, 0.2 + 12 / 48))
        soup = facing(material, size, ((0.1, 0.2), far) if not turned else ((0.2, 0.1), far[::-1]))
        got = render(soup, soups.pixel_view(12), size, lanes, anisotropy=4)
        judge.painted(got, soup, soups.pixel_view(12), size, anisotropy=4)


@pytest.mark.parametrize("samples", [64, 256])
def test_levels_of_detail_are_those_of_samples(samples: int, lanes: int) -> None:
    """Samples on a regular grid: the mean of a picture that is larger by as much."""
    material = textured.textured(noise(8, 64, 64), minify="linear-mipmap-linear")
    side = int(np.sqrt(samples))
    soup = textured.floor(material, [[0, 1], [20, 1], [20, 0], [0, 0]])
    fine = render(soup, AHEAD, (24 * side, 16 * side), lanes).color.astype(float)
    mean = render(soup, AHEAD, (24, 16), lanes, samples=samples).color
    assert np.abs(mean - fine.reshape(16, side, 24, side, 4).mean(axis=(1, 3))).max() <= 2 * samples * UNIT


@pytest.mark.parametrize("colors", ["uint8", "float32"])
@pytest.mark.parametrize("shape", [(1, 1), (8, 8), (6, 4), (7, 5), (13, 1), (1, 10), (3, 17), (64, 2)])
def test_mip_maps(shape: tuple[int, int], colors: str) -> None:
    """Each level is the twin's of the level before: within a rounding and what light loses when it is added up."""
    image = noise(9, *shape, [0, 7, 100, 255])
    if colors == "float32":
        image = (image / np.float32(255)).astype(np.float32)
    levels = mip_map(Texture(image))
    assert [level.shape[:2] for level in levels] == [level.shape[:2] for level in textures.mip_levels(image)]
    for before, level in zip(levels, levels[1:], strict=False):
        exact = textures.halved(textures.halved(textures.decoded(before), 0), 1)
        if colors == "float32":
            assert level.dtype == np.float32 and np.abs(level - exact).max() <= UNIT
            continue
        wanted = np.concatenate([textures.to_srgb(exact[..., :3]), exact[..., 3:]], axis=-1) * 255
        off = np.abs(level - wanted)
        assert (off[..., :3] <= 0.5 + textures.LEVEL_OFF).all() and (off[..., 3] <= 0.5 + 1e-9).all()


def test_no_mip_map_where_none_is_used() -> None:
    assert len(mip_map(Texture(noise(1, 8, 8), minify="linear"))) == 1
    assert len(mip_map(Texture(noise(1, 8, 8), minify="nearest-mipmap-nearest"))) == 4


def test_textures_side_by_side(lanes: int, judge: Judge) -> None:
    """Images of all shapes and both types, samplers that share an image, and a material without any."""
    image = noise(10, 8, 8)
    materials = [
        textured.textured(image, magnify="nearest", minify="linear-mipmap-linear"),
        textured.textured(image, wrap="mirror"),
        textured.textured(noise(11, 1, 9), wrap=("clamp", "repeat"), minify="nearest-mipmap-linear"),
        textured.textured((noise(12, 17, 3) / 255).astype(np.float32), minify="linear-mipmap-nearest"),
        Material(base_color=(0.2, 0.5, 0.9, 1.0)),
    ]
    soup = textured.crossing(13, 12, materials, 3.0)
    judge.painted(render(soup, BENCH, (64, 48), lanes), soup, BENCH, (64, 48))


def test_texels_that_stay_bytes(lanes: int, judge: Judge, monkeypatch: pytest.MonkeyPatch) -> None:
    """Large textures are not made floats before they are on the device. Nothing else changes, beside floats neither."""
    soup = textured.crossing(
        22,
        10,
        [
            textured.textured(noise(23, 16, 12, [0, 77, 255]), minify="linear-mipmap-linear", alpha_mode="BLEND"),
            textured.textured((noise(24, 5, 9) / 255).astype(np.float32), minify="nearest-mipmap-linear"),
            textured.textured(noise(25, 7, 7), wrap=("clamp", "mirror"), magnify="nearest"),
        ],
    )
    want = render(soup, BENCH, (64, 48), lanes)
    monkeypatch.setattr(shading, "MOST_FLOAT_BYTES", 0)
    got = render(soup, BENCH, (64, 48), lanes)
    judge.same_bits(got, want)
    assert got.stats["bytes"]["scene"] < want.stats["bytes"]["scene"]


# --- any scene --------------------------------------------------------------------------------------------------------

SIDES = st.sampled_from([1, 2, 3, 5, 8, 13, 16])


@st.composite
def any_texture(draw: st.DrawFn) -> Material:
    """A material with a texture of any kind that is not blended."""
    image: Any = noise(draw(st.integers(0, 999)), draw(SIDES), draw(SIDES))
    if draw(st.booleans()):
        image = (image / np.float32(255)).astype(np.float32)
    wrap = draw(st.sampled_from(WRAPS)), draw(st.sampled_from(WRAPS))
    magnify, minify = draw(st.sampled_from(MAGNIFY)), draw(st.sampled_from(MINIFY))
    shade = draw(st.sampled_from([(1.0, 1.0, 1.0, 1.0), (0.2, 0.7, 0.01, 0.5)]))
    return textured.textured(image, wrap=wrap, magnify=magnify, minify=minify, base_color=shade)


@given(
    seed=st.integers(0, 10**6),
    kinds=st.lists(any_texture(), max_size=3),
    repeats=st.sampled_from([0.5, 3.0, 20.0]),
    parallel=st.booleans(),
    anisotropy=st.sampled_from([1, 4]),
)
def test_any_textures(
    seed: int, kinds: list[Material], repeats: float, parallel: bool, anisotropy: int, judge: Judge
) -> None:
    """Within the twin's bound, and the same bits on both shapes of machine."""
    soup = textured.crossing(seed, 6, [LEVELLED, *kinds], repeats)
    view, size = replace(BENCH, orthographic=parallel), (40, 33)
    got = render(soup, view, size, 1, anisotropy=anisotropy)
    judge.painted(got, soup, view, size, anisotropy=anisotropy)
    judge.same_bits(render(soup, view, size, 64, anisotropy=anisotropy), got, "on 64 lanes")


# --- extremes ---------------------------------------------------------------------------------------------------------


def within(color: NDArray[np.float32], image: NDArray[np.uint8]) -> bool:
    """Whether all colours are opaque and lie between those of an image."""
    shown = textures.to_srgb(textures.decoded(image))[..., :3].reshape(-1, 3)
    inside = (color[..., :3] >= shown.min(axis=0) - 8 * UNIT) & (color[..., :3] <= shown.max(axis=0) + 8 * UNIT)
    return bool(inside.all() and (color[..., 3] == 1).all())


@pytest.mark.parametrize("far", [1e6, -1e6, 1e30, 3e38, 2.0**23 + 1])
@pytest.mark.parametrize("wrap", WRAPS)
def test_coordinates_without_measure(far: float, wrap: str, judge: Judge) -> None:
    """Where float32 hardly has fractions, or none, colours are those of some texels, and the same on every machine."""
    image = noise(15, 8, 8)
    for minify in ("nearest", "linear-mipmap-linear"):
        material = textured.textured(image, wrap=wrap, minify=minify)
        for uv in (((far, far), (far, far)), ((0.0, far), (far, 0.0)), ((-far, 0.0), (far, 1.0))):
            got = [straight(material, (20, 18), lanes, uv) for lanes in (1, 64)]
            assert within(got[0].color, image)
            judge.same_bits(got[1], got[0])


def test_coordinates_that_are_no_numbers(lanes: int) -> None:
    """They become 0, where the first texel is."""
    image = noise(16, 4, 4)
    soup = facing(textured.textured(image, magnify="nearest"), SMALL)
    assert soup.uv is not None
    for value in (np.nan, np.inf, -np.inf):
        broken = replace(soup, uv=np.full_like(soup.uv, value))
        got = render(broken, soups.pixel_view(30), SMALL, lanes)
        assert (got.image == image[0, 0]).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 4096), (4096, 1)])
def test_long_and_tiny_images(shape: tuple[int, int], lanes: int, judge: Judge) -> None:
    for minify in ("nearest", "linear-mipmap-linear"):
        material = textured.textured(noise(17, *shape), minify=minify)
        view = soups.pixel_view(30)
        for uv in (textured.FILL, ((-3.0, 0.25), (2.5, 0.75)), ((0.5, 0.5), (0.5 + 40 / 4096, 0.5 + 30 / 4096))):
            soup = facing(material, SMALL, uv)
            judge.painted(render(soup, view, SMALL, lanes), soup, view, SMALL)


@pytest.mark.parametrize("tilt", [1.0, 0.1, 1e-2, 1e-3, 1e-5, 1e-7])
def test_seen_edge_on(tilt: float, judge: Judge) -> None:
    """A plane through the middle row, ever less tilted: slopes without end, and colours of the image all the same."""
    image = noise(18, 16, 16)
    material = textured.textured(image, minify="linear-mipmap-linear")
    corners = np.array([[-1, -tilt, 0.9], [1, -tilt, 0.9], [1, tilt, -1.5], [-1, tilt, -1.5]])
    soup = textured.quads([corners], [[0, 4], [4, 4], [4, 0], [0, 0]], [material])
    for anisotropy in (1, 4):
        got = [render(soup, BENCH, (33, 33), lanes, anisotropy=anisotropy) for lanes in (1, 64)]
        judge.same_bits(got[1], got[0])
        seen = got[0].color[..., 3] > 0
        assert seen.any() or tilt <= 1e-3
        assert within(got[0].color[seen], image)
        judge.painted(got[0], soup, BENCH, (33, 33), anisotropy=anisotropy)


@pytest.mark.parametrize("near", [0.5, 1.3, 2.9])
def test_a_near_plane_cuts_a_textured_quad(near: float, lanes: int, judge: Judge) -> None:
    """Pieces of a clipped face have its coordinates; so has a face that reaches behind the eye."""
    material = textured.textured(noise(19, 16, 16), minify="linear-mipmap-linear")
    soup = textured.floor(material, [[0, 3], [8, 3], [8, 0], [0, 0]], near=-5.0, far=8.0, half=4.0)
    view, size = replace(AHEAD, clipping_range=(near, 6.0)), (40, 40)
    got = render(soup, view, size, lanes)
    assert got.stats["clipped"] == 2
    judge.painted(got, soup, view, size)


def test_a_wide_clipping_range(lanes: int, judge: Judge) -> None:
    material = textured.textured(noise(20, 16, 16), minify="linear-mipmap-linear")
    soup = textured.crossing(21, 5, [material])
    view, size = replace(BENCH, clipping_range=(1e-3, 1e4)), (40, 40)
    judge.painted(render(soup, view, size, lanes), soup, view, size)


def test_white_is_one(lanes: int) -> None:
    assert (straight(Material(), (8, 8), lanes).color == 1).all()


@pytest.mark.parametrize("wrong", [4.0, -0.5, np.nan])
def test_light_beyond_white_is_refused(wrong: float) -> None:
    image = np.ones((2, 2, 4), np.float32)
    image[1, 1, 0] = wrong
    with pytest.raises(clpeel.InputError, match=r"image: expected floats 0\.\.1"):
        Texture(image)


def test_a_light_copies_no_texture_again() -> None:
    renderer = plainly.Renderer(textured.beside(facing(LEVELLED, SMALL, textured.FILL), []).scene())
    for lighting in ("none", "headlight"):
        renderer.render(size=SMALL, lighting=lighting)
    held = {needs: uploaded.textures for (needs, _), uploaded in renderer._uploaded.items()}
    assert held["headlight"] is held["none"] is not None
