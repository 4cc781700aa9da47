"""Colours blended as linear light: every technique and kind of colour against a float64 twin, and guaranteed errors."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import light, soups
from twins.blends import TWINNED
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH
from twins.textures import to_linear, to_srgb

import clpeel
from clpeel.command import main as cli
from clpeel.rendering import auto
from clpeel.rendering.auto import error_for_8_bits
from clpeel.rendering.shown_errors import ENCODING, STEEPEST, error_of, may_hide, rounding_of
from clpeel.scene.materials import Material
from clpeel.scene.textures import Texture
from clpeel.techniques import TECHNIQUES
from clpeel.techniques.precision import blending_bound

pytestmark = pytest.mark.usefixtures("shared_devices")

SIZE = (9, 6)
GRADIENT = ((1.0, 0.9, 0.2), (0.0, 0.3, 0.6))
BACKGROUNDS = [(0.0, 0.0, 0.0), (0.2, 0.5, 0.9), GRADIENT, None]
BLENDING = [name for name in TECHNIQUES if name in TWINNED]
BOUNDED = [name for name, each in TECHNIQUES.items() if "max_error" in each.option_names]

THREE = np.array([(0.9, 0.2, 0.5, 0.5), (0.1, 0.8, 0.02, 0.25), (0.3, 0.6, 1.0, 0.7)])
OFF = STEEPEST * (13 * UNIT + 3 * UNIT) + 12 * UNIT
"""How far three layers may be off: 3 N + 4 roundings of light, a rounding of each colour, and those of sRGB."""

MADE_LINEAR = OFF + STEEPEST * 3 * 2.3 * (2.0**-19 + 40 * UNIT)
"""The same where colours are computed for each fragment, and are made linear or sRGB there. Light is up to 2.3 times as
far off as what is shown."""


def render(scene: clpeel.Scene, **options: Any) -> clpeel.Result:
    """The scene as it is seen by AHEAD, blended as linear light."""
    call = {"camera": AHEAD.camera(), "size": SIZE, "blending_space": "linear", **options}
    return plainly.render(scene, **call)


def behind(background: Any, row: int, height: int) -> Any:
    """The background of a row: gradients are linear in what is shown."""
    if background is None or not isinstance(background[0], tuple):
        return background
    top, bottom = np.array(background)
    return top + (row + 0.5) / height * (bottom - top)


def check(result: clpeel.Result, pixels: Any, background: Any, off: float) -> None:
    """A result against light that was blended, row by row: [height][width] of [4]."""
    for row, column in np.ndindex(result.color.shape[:2]):
        pixel = pixels[row][column]
        assert np.abs(result.color[row, column] - light.color_of(pixel)).max() <= off, (row, column)
        want = light.picture_of(pixel, behind(background, row, len(result.color)))
        slack = off / max(1 - pixel[3], UNIT) if background is None else off
        low, high = (np.clip(np.floor((want + sign * slack) * 255 + 0.5), 0, 255) for sign in (-1, 1))
        got = result.image[row, column]
        assert (got >= low).all() and (got <= high).all(), (row, column, got, want * 255)


def blended(layers: Any, technique: str = "sort") -> Any:
    """The twin's pixels of a picture's layers."""
    width, height = layers.size
    each = [layers.color[a:b] for a, b in zip(layers.start[:-1], layers.start[1:], strict=True)]
    return [[light.blended(each[y * width + x], technique) for x in range(width)] for y in range(height)]


# --- what is blended --------------------------------------------------------------------------------------------------


def test_white_over_black_is_half_the_light(lanes: int) -> None:
    """0.5 of the light is 188 of 255, and half of what is shown 128. A stack of one layer is simple to reckon."""
    scene = soups.stack([2.0], (1.0, 1.0, 1.0, 0.5)).scene()
    assert round(255 * (1.055 * 0.5 ** (1 / 2.4) - 0.055)) == 188
    for space, level in (("linear", 188), ("srgb", 128)):
        got = render(scene, background=(0, 0, 0), blending_space=space, lanes=lanes)
        assert (got.image == [level] * 3 + [255]).all()
    straight = render(scene, background=None, lanes=lanes)
    assert (straight.image == [255, 255, 255, 128]).all() and np.abs(straight.color - 0.5).max() <= OFF
    default = plainly.render(scene, AHEAD.camera(), SIZE, background=(0, 0, 0), lanes=lanes)
    assert (default.image[..., 0] == 128).all()


WAYS = [(name, execution) for name in BLENDING for execution in ("tiles", "passes")[: 1 + TECHNIQUES[name].has_passes]]


@pytest.mark.parametrize(("technique", "execution"), WAYS)
def test_every_technique(technique: str, execution: str, lanes: int) -> None:
    """Three layers in front of an opaque surface in a part of the picture, submitted in another order."""
    if execution == "passes" and lanes == 1:
        pytest.skip("the same launches, on one lane")
    wall = soups.separate([[[-3.0, -9.0, -4.0], [0.4, -9.0, -4.0], [0.4, 9.0, -4.0]]], (0.4, 0.03, 0.9, 1.0))
    soup = soups.merge(soups.stack([3.0, 1.5, 2.0], THREE[[2, 0, 1]]), wall)
    layers = render(soup.scene(), layers=True, lanes=lanes).layers
    assert set(np.diff(layers.start)) == {3, 4}
    for background in BACKGROUNDS:
        got = render(soup.scene(), technique=technique, execution=execution, background=background, lanes=lanes)
        check(got, blended(layers, technique), background, OFF)


def textured(*, blend: bool) -> clpeel.Scene:
    """Three layers, of which the first and the last have materials; some texels are holes where they blend."""
    soup = soups.stack([1.5, 2.0, 3.0], THREE)
    image = np.random.default_rng(4).integers(0, 256, (4, 4, 4), dtype=np.uint8)
    image[0, 0, 3] = 0
    texture = Texture(image, magnify="nearest", minify="nearest")
    materials = [
        Material(texture=texture, alpha_mode="BLEND" if blend else "OPAQUE", base_color=(0.9, 1.0, 0.5, 0.8)),
        Material(texture=texture, alpha_mode="OPAQUE", opacity=0.6, unlit=True),
    ]
    uv = np.tile([[0.1, 0.2], [2.3, 0.4], [0.6, 1.9]], (3, 1))
    return clpeel.Scene.from_arrays(
        soup.vertices, soup.faces, face_colors=soup.face_colors, materials=materials, face_materials=[0, -1, 1], uv=uv
    )


def vertex_colors() -> clpeel.Scene:
    soup = soups.stack([1.5, 2.0, 3.0], THREE)
    colors = np.random.default_rng(3).uniform(0.1, 0.9, (9, 4)).astype(np.float32)
    return clpeel.Scene.from_arrays(soup.vertices, soup.faces, vertex_colors=colors)


def tilted() -> clpeel.Scene:
    """Three layers, not one of which faces the camera; bytes."""
    soup = soups.stack([1.5, 2.0, 3.0], (THREE * 255).astype(np.uint8))
    turn = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    vertices = (soup.vertices - [0, 0, -2.2]) @ turn.T + [0, 0, -2.2]
    return clpeel.Scene.from_arrays(vertices, soup.faces, face_colors=soup.face_colors)


KINDS: dict[str, tuple[Any, dict[str, Any]]] = {
    "bytes": (tilted, {}),
    "one colour": (lambda: clpeel.load(tilted(), color=(0.4, 0.7, 0.1), opacity=0.3), {}),
    "vertex colours": (vertex_colors, {}),
    "headlight": (tilted, {"lighting": "headlight"}),
    "kit": (tilted, {"lighting": "kit", "light_intensity": 3.0}),
    "vertex colours, kit": (vertex_colors, {"lighting": "kit"}),
    "textures": (lambda: textured(blend=True), {}),
    "textures, headlight": (lambda: textured(blend=True), {"lighting": "headlight"}),
    "textures, kit": (lambda: textured(blend=True), {"lighting": "kit"}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_colour(kind: str) -> None:
    """Layers are sRGB, and the same in both spaces. The picture is what light becomes of them, on any lanes."""
    make, options = KINDS[kind]
    scene = make()
    over = BACKGROUNDS[1]
    shown = render(scene, layers=True, lanes=1, blending_space="srgb", background=over, **options)
    assert np.diff(shown.layers.start).max() == 3
    for background in (GRADIENT, None, over):
        call = {"background": background, "layers": True, **options}
        one, many = (render(scene, lanes=lanes, **call) for lanes in (1, 64))
        check(one, blended(shown.layers), background, MADE_LINEAR)
        assert (one.image == many.image).all() and (one.color.view(np.uint32) == many.color.view(np.uint32)).all()
        assert (one.layers.color == shown.layers.color).all()
    assert np.abs(one.image.astype(int) - shown.image).max() > 4


@pytest.mark.parametrize("lighting", ["none", "headlight", "kit"])
@pytest.mark.parametrize("make", [tilted, vertex_colors, lambda: textured(blend=False)])
def test_what_is_opaque_looks_the_same(make: Any, lighting: str) -> None:
    """Only blending differs: without any, not one step is off by more than rounding."""
    scene = clpeel.load(make(), opacity=1.0)
    call: dict[str, Any] = {"lighting": lighting, "lanes": 1}
    light, shown = (render(scene, blending_space=space, **call) for space in ("linear", "srgb"))
    assert light.stats.fragments == 0 and np.abs(light.color - shown.color).max() <= MADE_LINEAR
    assert np.abs(light.image.astype(int) - shown.image).max() <= 1


@pytest.mark.parametrize("samples", [4, 16])
def test_the_mean_of_samples_is_of_light(samples: int, lanes: int) -> None:
    """An edge through the middle of pixels: half of their samples have two layers, the others the farther one."""
    near, far = THREE[0], THREE[2]
    edge = soups.separate([[[0.5, -90.0, -1.0], [90.0, -90.0, -1.0], [0.5, 90.0, -1.0]]], near)
    soup = soups.merge(soups.stack([2.0], far, reach=40.0), edge)
    view = soups.Eye(
        (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=2 * math.degrees(math.atan(3)), clipping_range=(0.5, 8)
    )
    for background in BACKGROUNDS:
        got = plainly.render(
            soup.scene(),
            view.camera(),
            (8, 6),
            background=background,
            samples=samples,
            lanes=lanes,
            blending_space="linear",
        )
        one, two = light.blended([far], "sort"), light.blended([near, far], "sort")
        row = [one] * 4 + [light.mean([one, two])] + [two] * 3
        check(got, [row] * 6, background, OFF + STEEPEST * (samples + 2) * UNIT)


def test_edges_against_the_background(lanes: int) -> None:
    """Half of a white pixel over black is half the light, 188; straight it is white with half the alpha."""
    scene = soups.separate([[[0.5, -90.0, -1.0], [90.0, -90.0, -1.0], [0.5, 90.0, -1.0]]], (255, 255, 255, 255)).scene()
    view = soups.Eye(
        (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=2 * math.degrees(math.atan(3)), clipping_range=(0.5, 8)
    )
    for background, level in (((0, 0, 0), [188, 188, 188, 255]), (None, [255, 255, 255, 128])):
        got = plainly.render(
            scene, view.camera(), (8, 6), background=background, samples=4, lanes=lanes, blending_space="linear"
        )
        assert (got.image[:, 4] == level).all() and (got.image[:, 5:, :3] == 255).all()


def test_nothing_drawn_is_the_background_bit_for_bit(lanes: int) -> None:
    scene = soups.stack([2.0], (1.0, 1.0, 1.0, 0.0)).scene()
    levels = np.arange(256) / 255
    for low in range(0, 255, 3):
        shade = tuple(levels[low : low + 3])
        got = render(scene, size=(2, 1), background=shade, lanes=lanes)
        assert (got.image == [low, low + 1, low + 2, 255]).all()
    assert not render(scene, background=None, lanes=lanes).image.any()


@pytest.mark.parametrize(("shade", "background", "level"), [(1.0, 0.0, 255), (0.0, 1.0, 0), (1.0, 1.0, 255)])
def test_sums_beyond_white_are_white(shade: float, background: float, level: int, lanes: int) -> None:
    """Ten layers of 1/2 sum to 5 times the light, and -4 times the background. The straight colour stays as it is."""
    scene = soups.stack(np.linspace(1, 7, 10), [shade] * 3 + [0.5]).scene()
    got = render(scene, technique="weighted-sum", background=[background] * 3, lanes=lanes)
    assert (got.image[..., :3] == level).all() and got.stats.clamped_pixels == SIZE[0] * SIZE[1]
    assert (got.color == [5 * shade] * 3 + [5]).all()


# --- techniques of their own ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lighting", ["none", "headlight", "kit"])
def test_translucency_is_reckoned_in_light(lighting: str, lanes: int) -> None:
    """F = reflectance S L, C = F + (1 - F) light S exp(-sigma d), where S and the light are linear."""
    scene, sigma, lamp = tilted(), 0.7, (0.9, 0.5, 0.2)
    call: dict[str, Any] = {"technique": "translucency", "variant": "total", "sigma": sigma, "lanes": lanes}
    got = render(scene, lighting=lighting, light_color=lamp, background=None, **call)
    there = got.color[..., 3] == 1
    foremost = (render(scene, layers=True, lighting=each).layers.layer(0)[0] for each in ("none", "headlight"))
    bare, dimmed = (color[there][:, :3] for color in foremost)
    part = dimmed.max(axis=1, keepdims=True) / bare.max(axis=1, keepdims=True) if lighting != "none" else 1.0
    surface = to_linear(bare)
    reflected = 0.35 * surface * part
    through = np.exp(-sigma * np.asarray(got.thickness, np.float64))[there][:, None]
    want = reflected + (1 - reflected) * surface * to_linear(lamp) * through
    assert there.mean() > 0.8 and got.thickness[there].max() > 0.1
    assert np.abs(to_linear(got.color[there][:, :3]) - want).max() <= 2e-5
    assert not got.color[~there].any()


@pytest.mark.parametrize("technique", ["thickness", "layer-count"])
def test_maps_are_no_colours_that_are_blended(technique: str, lanes: int) -> None:
    options = {"technique": technique, "samples": 4, "lanes": lanes}
    options |= {"variant": "total"} if technique == "thickness" else {}
    light, shown = (render(tilted(), blending_space=space, **options) for space in ("linear", "srgb"))
    assert (light.image == shown.image).all() and (light.color == shown.color).all()


def test_a_renderer_goes_from_one_to_the_other(lanes: int) -> None:
    """Also where opacities are set between: each picture is what a new renderer makes."""
    scene = tilted()
    renderer = plainly.Renderer(scene, lanes=lanes)
    for opacity in (None, 0.3, None):
        renderer.set_opacity(opacity)
        for space in ("linear", "srgb", "linear"):
            got = renderer.render(AHEAD.camera(), SIZE, blending_space=space)
            new = scene if opacity is None else clpeel.load(scene, opacity=opacity)
            assert (got.color == render(new, blending_space=space, lanes=lanes).color).all()


# --- errors -----------------------------------------------------------------------------------------------------------


@given(error=st.floats(0, 1), light=st.floats(0, 1))
def test_what_may_be_hidden(error: float, light: float) -> None:
    """Light that is less by what may be hidden is shown darker by no more than the error, wherever on the curve."""
    hidden = may_hide(error, True)
    more = min(light + hidden, 1.0)
    assert to_srgb(more) - to_srgb(light) <= error + 1e-6  # the standard's two pieces do not quite meet
    assert error_of(hidden, True) <= error + 1e-6 and abs(error_of(hidden, True) - error) <= 1e-6
    assert may_hide(error, False) == error == error_of(error, False) == rounding_of(error, False)
    assert error_of(hidden, True) <= rounding_of(hidden, True) + 1e-6


@given(front=st.tuples(st.floats(0, 1), st.floats(0, 1)), back=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_what_skipped_layers_change(front: Any, back: Any) -> None:
    """A front of straight colour c and alpha 1 - t, and anything behind it: `color` is off by g(t) at most."""
    (c, t), (d, b) = front, back
    alone = np.array([c * (1 - t)] * 3 + [t])
    both = np.array([c * (1 - t) + t * b * d] * 3 + [t * (1 - b)])
    assert np.abs(light.color_of(both) - light.color_of(alone)).max() <= to_srgb(t) + 1e-6


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 120),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    colors=st.sampled_from(["flat", "vertex"]),
    dark=st.sampled_from([1.0, 0.02]),
    error=st.sampled_from([0.0, 1 / 255, 1 / 16, 0.3, 1.0]),
    samples=st.sampled_from([1, 4]),
    precision=st.sampled_from(["float32", "float32", "half", "unorm8"]),
    opaque=st.booleans(),
    background=st.sampled_from([(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)]),
)
def test_no_pixel_is_off_by_more(
    seed: int,
    count: int,
    size: tuple[int, int],
    colors: str,
    dark: float,
    error: float,
    samples: Any,
    precision: Any,
    opaque: bool,
    background: Any,
) -> None:
    """Also where all is dark, and sRGB is steepest."""
    soup = soups.random(seed, count, "large", colors, alpha=(0.1, 0.95))
    given_colors = soup.face_colors if soup.face_colors is not None else soup.vertex_colors
    assert given_colors is not None
    given_colors[:, :3] *= np.float32(dark)
    if opaque and soup.face_colors is not None:
        soup.face_colors[::7, 3] = 1
    scene = soup.scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": size, "background": background, "samples": samples}
    call["blending_space"] = "linear"
    truth = plainly.render(scene, lanes=1, **call)
    rounding = truth.rounding  # of `truth`, which is float32 too
    assert rounding == STEEPEST * blending_bound(truth.stats.layers_max + 1) + ENCODING
    for technique in BOUNDED:
        lanes = (1, 64)[(seed + len(technique)) % 2]
        got = plainly.render(scene, technique=technique, lanes=lanes, max_error=error, precision=precision, **call)
        off = np.abs(got.color.astype(float) - truth.color).max(axis=2)
        assert (off <= got.error_bound + rounding).all(), technique
        shown = np.abs(got.image.astype(int) - truth.image).max(axis=2)
        assert (shown <= np.floor(255 * (got.error_bound + rounding)) + 1).all(), technique
        assert got.stats.truncation_bound <= error + 2e-7
        assert (got.error_bound <= np.minimum(error + got.rounding, 1) + 2e-7).all()
        if error == 0:
            assert got.stats.truncated_pixels == 0


@pytest.mark.parametrize("technique", BOUNDED)
@pytest.mark.parametrize("kept", [1, 2, 5])
def test_layers_of_a_half(technique: str, kept: int, lanes: int) -> None:
    """After k layers of 1/2 what is left is 2^-k of the light, which shows as its sRGB. A bit less takes one more."""
    scene = soups.stack(np.linspace(1, 7, 40), (1.0, 0.5, 0.25, 0.5)).scene()
    for error, layers in ((to_srgb(2.0**-kept) + 1e-6, kept), (to_srgb(2.0**-kept) - 1e-6, kept + 1)):
        got = render(scene, technique=technique, max_error=float(error), lanes=lanes)
        layers = -(-layers // 8) * 8 if technique == "multi-layer-peeling" else layers
        assert got.stats.truncation_bound == pytest.approx(float(to_srgb(2.0**-layers)), abs=1e-6)
        assert np.abs(got.error_bound - got.stats.truncation_bound - got.rounding).max() <= 2e-7
    limited = render(scene, technique="depth-peeling", passes=kept, lanes=lanes)
    assert limited.stats.truncation_bound == pytest.approx(float(to_srgb(2.0**-kept)), abs=1e-6)


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 150),
    colors=st.sampled_from(["flat", "vertex"]),
    alpha=st.sampled_from([(0.1, 0.95), (0.0001, 0.0004), (0.9, 1.0)]),
    error=st.sampled_from([None, 0.0, 0.1, 1.0]),
)
def test_auto_keeps_to_the_error(seed: int, count: int, colors: str, alpha: Any, error: float | None) -> None:
    scene = soups.random(seed, count, "large", colors, alpha=alpha).scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (31, 23), "blending_space": "linear", "lanes": 1}
    truth = plainly.render(scene, **call)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(auto, "FEW_RECORDS", 1)
        got = plainly.render(scene, technique="auto", max_error=error, **call)
    assert (np.abs(got.color.astype(float) - truth.color).max(axis=2) <= got.error_bound + truth.rounding).all()
    assert got.stats.auto is not None
    kept = float(got.stats.auto["max_error"])  # type: ignore[arg-type]
    assert kept <= error if error is not None else 0 < kept < 1 / 255
    assert (got.error_bound <= kept + rounding_of(blending_bound(count + 1), True) + 2e-7).all()
    if error is None:
        assert np.abs(got.image.astype(int) - truth.image).max() <= 1


def test_auto_knows_how_steep_srgb_is(monkeypatch: pytest.MonkeyPatch, lanes: int) -> None:
    """7 layers of 1/255 sum to within 21 / 255^2 of the light: less than 1 / 255, but not 12.92 times that."""
    monkeypatch.setattr(auto, "FEW_RECORDS", 1)
    for count, chosen in ((6, True), (7, False)):
        scene = soups.stack(np.linspace(1, 7, count), [1.0, 0.5, 0.0, 1 / 255]).scene()
        assert (STEEPEST * count * (count - 1) / 2 / 255**2 < 1 / 255) == chosen
        stats = render(scene, technique="auto", size=(32, 32), lanes=lanes).stats
        assert stats.auto is not None
        names = [stats.technique, *stats.auto["alternatives"]]  # type: ignore[misc]
        assert ("weighted-sum" in names) == chosen
    for layers in (1, 100, 400):
        whole = error_for_8_bits(layers, True) + STEEPEST * blending_bound(layers) + ENCODING
        assert whole == pytest.approx(1 / 255, rel=1e-12)


# --- the option -------------------------------------------------------------------------------------------------------


def test_a_space_there_is_not() -> None:
    scene = soups.stack([2.0], (1.0, 1.0, 1.0, 0.5)).scene()
    for space in ("Linear", "rgb", None, 1):
        with pytest.raises(clpeel.InputError) as caught:
            render(scene, blending_space=space)
        assert str(caught.value) == f"blending_space: expected one of srgb, linear; got {space!r}"


def test_the_command(squares: Path, tmp_path: Path, capfd: Any) -> None:
    """White squares of half the light, over black: one beside the middle, and two there."""
    from PIL import Image

    output = tmp_path / "out.png"
    words = ["render", str(squares), "-o", str(output), "--resolution=40,40", "--background-color=black", "--unlit"]
    words += ["--color=white", "--opacity=0.5"]
    for more, levels in (
        (["--blending-space=linear"], {188, 225}),
        (["--blending-space=srgb"], {128, 191}),
        ([], {128, 191}),
    ):
        assert cli.main([*words, *more]) == 0
        found = np.asarray(Image.open(output))[..., 0]
        middle, side = int(found[20, 20]), int(found[20, 10])
        assert {middle, side} == levels, more
    assert cli.main([*words, "--blending-space=cmyk"]) == 2
    assert "--blending-space: expected one of srgb, linear; got 'cmyk'" in capfd.readouterr().err
