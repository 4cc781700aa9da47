"""Materials with every technique: what alpha means, which fragments are there, and what hides what is behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import reference, soups, textured, textures
from twins.blends import TWINNED, Stacks, blended
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH, Eye, Soup
from twins.textured import checker, facing, noise

import clpeel
from clpeel.device.layout import AMBIENT
from clpeel.scene.materials import NO_MATERIAL, Material
from clpeel.scene.scene import recolored
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

PICTURES = [name for name, technique in TECHNIQUES.items() if not technique.maps]
EXACT = [name for name in PICTURES if TECHNIQUES[name].exact]
ALIKE = [name for name in EXACT if name != "dual-depth-peeling"]  # the same bits: they blend in the same order
PASSES = [name for name in ALIKE if TECHNIQUES[name].has_passes]
SIZE = (40, 36)
BOTH = [(name, lanes) for name in ("sort", "multi-layer-peeling") for lanes in (1, 64)]
"""Techniques that are built for both shapes of machine: one that stores fragments, and one that peels."""


def turn(technique: str) -> int:
    """How many lanes a technique has where they take turns: each of its builds takes seconds."""
    return (1, 64)[PICTURES.index(technique) % 2]


# --- scenes -----------------------------------------------------------------------------------------------------------

ROUTED = textured.textured(noise(1, 6, 5, [0, 128, 255]), magnify="nearest", alpha_mode="BLEND")
SOFT = textured.textured(noise(2, 8, 8, [0, 90, 200]), minify="linear-mipmap-linear", alpha_mode="BLEND")
HOLED = textured.textured(noise(3, 7, 7, [0, 255]), alpha_mode="MASK", alpha_cutoff=0.4)
THIN = textured.textured(noise(4, 4, 4, [0, 100, 255]), magnify="nearest", alpha_mode="MASK", opacity=0.6)
WALL = textured.textured(noise(5, 9, 6, [0, 60]), wrap="mirror")
GLASS = Material(base_color=(0.9, 0.3, 0.1, 0.4), alpha_mode="BLEND")
EVERYTHING = (ROUTED, SOFT, HOLED, THIN, WALL, GLASS)


def everything(seed: int, count: int = 14) -> Soup:
    """Crossing quads with all of these materials, and some with none, in colours of vertices, of which some blend."""
    rng = np.random.default_rng(seed)
    solid = rng.random(count) < 0.5
    colors = rng.uniform(0.2, 1, (4 * count, 4))
    colors[:, 3] = np.where(np.repeat(solid, 4), 1, rng.uniform(0.3, 0.9, 4 * count))
    soup = textured.crossing(seed, count, EVERYTHING, vertex_colors=colors.astype(np.float32))
    kinds = rng.permutation(np.arange(count) % (len(EVERYTHING) + 1)) + NO_MATERIAL
    return replace(soup, face_materials=np.repeat(kinds, 2))


def layered(materials: Sequence[Material | None], size: tuple[int, int], uv: Any = textured.FILL) -> Soup:
    """Quads that fill soups.pixel_view of a picture of that size, front to back, 1/4 apart; None for a white one."""
    own = [material for material in materials if material is not None]
    front = facing(own[0], size, uv)
    assert front.uv is not None
    count = len(materials)
    places = [NO_MATERIAL if material is None else own.index(material) for material in materials]
    corners = front.vertices + np.array([0, 0, -0.25]) * np.arange(count)[:, None, None]
    return textured.quads(corners, np.broadcast_to(front.uv, (count, 4, 2)), own, places)


def plain(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """RGBA of an image as it is shown, 0..1."""
    return image / 255.0


def in_front(twin: reference.Picture) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """How many fragments of the twin's pixels are in front of the first opaque one [h, w], and whether there is one."""
    count, opaque = np.zeros(twin.layers.size, np.int64), np.zeros(twin.layers.size, bool)
    for hit, pixel in reference.ranks(twin.pixel, twin.layers.size):
        solid = twin.rgba[hit, 3] == 1
        count[pixel] += ~opaque[pixel] & ~solid
        opaque[pixel] |= solid
    return count.reshape(twin.layers.shape), opaque.reshape(twin.layers.shape)


def scene_of(soup: Soup, alone: bool = False) -> clpeel.Scene:
    """A soup as a scene. If not alone, all kinds of materials are beside it, so that few kernels are built."""
    if alone:
        return soup.scene()
    return textured.beside(textured.with_vertex_colors(soup), EVERYTHING).scene()


def render(
    soup: Soup, view: Eye, size: tuple[int, int], technique: str = "sort", alone: bool = False, **options: Any
) -> clpeel.Result:
    """clpeel's picture of a soup. alone: as for `scene_of`."""
    return plainly.render(scene_of(soup, alone), view.camera(), size, technique, **options)


# --- colours ----------------------------------------------------------------------------------------------------------


def test_a_colour_is_a_product_of_light(lanes: int) -> None:
    """Of the base colour, the texel and the scene's colour; and then sRGB of that."""
    image, base, color = noise(6, 5, 4), (0.5, 0.25, 1.0, 1.0), np.array([51, 102, 204, 255], np.uint8)
    soup = facing(textured.textured(image, magnify="nearest", base_color=base), (5, 4), color=color)
    got = render(soup, soups.pixel_view(4), (5, 4), lanes=lanes)
    want = textures.to_srgb(textures.decoded(image)[..., :3] * base[:3] * [0.2, 0.4, 0.8])
    assert np.abs(got.color[..., :3] - want).max() <= 1e-6 and (got.color[..., 3] == 1).all()
    own = replace(soup, materials=(replace(soup.materials[0], rgb_of_scene=False),))
    got = render(own, soups.pixel_view(4), (5, 4), lanes=lanes)
    assert np.abs(got.color[..., :3] - textures.to_srgb(textures.decoded(image)[..., :3] * base[:3])).max() <= 1e-6


@pytest.mark.parametrize(
    ("kind", "shape", "dtype", "lanes"),
    [("color", (4,), np.uint8, 1), ("face_colors", (4, 4), np.float32, 64), ("vertex_colors", (8, 4), np.uint8, 64)],
)
def test_colours_of_every_kind(kind: str, shape: Any, dtype: Any, lanes: int, judge: Judge) -> None:
    """One for all, of faces or of vertices, bytes or floats: all are factors of the texture, and their alphas too."""
    colors = np.random.default_rng(7).integers(60, 256, shape, np.uint8)
    given = colors if dtype == np.uint8 else (colors / np.float32(255)).astype(np.float32)
    blend = textured.textured(noise(8, 6, 6, [90, 255]), alpha_mode="BLEND")
    soup = replace(layered([blend, WALL], SIZE), **{"color": None, kind: given})
    got = render(soup, soups.pixel_view(36), SIZE, alone=True, lanes=lanes)
    judge.painted(got, soup, soups.pixel_view(36), SIZE)


def test_a_material_without_a_texture(lanes: int) -> None:
    soup = facing(Material(base_color=(0.5, 0.0, 1.0, 0.3)), SIZE)
    got = render(soup, soups.pixel_view(36), SIZE, lanes=lanes)
    assert (got.image == [188, 0, 255, 255]).all()


def test_faces_without_a_material_are_as_they_are(lanes: int) -> None:
    """Beside others: their colours are shown, not decoded."""
    colors = np.array([[10, 128, 200, 255]] * 4, np.uint8)
    soup = layered([Material(), None], SIZE)
    left = soup.vertices.copy()
    left[:4, 0] = np.minimum(left[:4, 0], 0)
    got = render(replace(soup, vertices=left, color=None, face_colors=colors), soups.pixel_view(36), SIZE, lanes=lanes)
    lit = np.floor(textures.to_srgb(np.array([10, 128, 200]) / 255) * 255 + 0.5)
    assert (got.image[:, :20, :3] == lit).all() and (got.image[:, 20:, :3] == [10, 128, 200]).all()


def test_a_light_at_the_camera(lanes: int) -> None:
    """It multiplies what is shown, but of materials that are unlit: at 60 degrees by 0.2 + 0.8 / 2."""
    image = noise(9, 8, 8)
    half = np.tan(np.radians(60)) * 4
    corners = [[[-9, -4, -half - 1], [9, -4, -half - 1], [9, 4, half - 1], [-9, 4, half - 1]]]
    angle = float(np.degrees(2 * np.arctan(4 / 20)))
    view = replace(soups.pixel_view(8), clipping_range=(1.0, 50.0), position=(0.0, 0.0, 20.0), view_angle=angle)
    pictures = []
    for unlit in (False, True):
        material = textured.textured(image, magnify="nearest", unlit=unlit)
        soup = textured.quads(corners, [[0, 1], [1, 1], [1, 0], [0, 0]], [material])
        dark, lit = (
            render(soup, view, (8, 8), alone=True, lighting=kind, lanes=lanes).color for kind in ("none", "headlight")
        )
        assert (dark[..., 3] == 1).all()
        pictures.append((dark, lit))
    (dark, lit), (glow, still) = pictures
    assert np.abs(lit[..., :3] - dark[..., :3] * (AMBIENT + (1 - AMBIENT) / 2)).max() <= 40 * UNIT
    assert (glow == still).all() and (glow == dark).all()


# --- what alpha means -------------------------------------------------------------------------------------------------


def test_opaque_ignores_alpha(lanes: int) -> None:
    image = noise(10, 8, 6, [0, 100, 255])
    material = textured.textured(image, magnify="nearest", base_color=(1.0, 1.0, 1.0, 0.1))
    colors = np.array([255, 255, 255, 7], np.uint8)
    got = render(facing(material, (8, 6), color=colors), soups.pixel_view(6), (8, 6), lanes=lanes, background=None)
    assert (got.image[..., :3] == image[..., :3]).all() and (got.image[..., 3] == 255).all()
    assert got.stats["fragments"] == 0 and got.stats["opaque_samples"] == 48


@pytest.mark.parametrize(("technique", "lanes"), BOTH)
def test_blended_alphas(technique: str, lanes: int) -> None:
    """0 is not there, 1 is opaque and hides what is behind it, and 128 of 255 blends over it."""
    front, back = noise(11, 12, 9, [0, 128, 255]), noise(12, 12, 9)
    soup = layered(
        [
            textured.textured(front, magnify="nearest", alpha_mode="BLEND"),
            textured.textured(back, magnify="nearest", alpha_mode="BLEND", base_color=(1.0, 1.0, 1.0, 0.5)),
        ],
        (12, 9),
    )
    alpha = front[..., 3:] / 255
    behind = np.concatenate([plain(back)[..., :3] * 0.5, np.full((9, 12, 1), 0.5)], axis=-1)
    want = alpha * np.concatenate([plain(front)[..., :3], np.ones((9, 12, 1))], axis=-1) + (1 - alpha) * behind
    some, all_ = (front[..., 3] == 128).sum(), (front[..., 3] == 255).sum()
    got = render(soup, soups.pixel_view(9), (12, 9), technique, lanes=lanes)
    assert np.abs(got.color - want).max() <= 16 * UNIT
    assert got.stats["fragments"] == some + (108 - all_) and got.stats["opaque_samples"] == all_
    blend = render(soup, soups.pixel_view(9), (12, 9), technique, lanes=lanes, opaque="blend")
    assert np.abs(blend.color - want).max() <= 16 * UNIT
    assert blend.stats["fragments"] == some + all_ + 108 and blend.stats["opaque_samples"] == 0


def test_all_but_opaque_is_not_opaque(lanes: int) -> None:
    """An alpha of 1 hides what is behind it; the greatest float32 below 1 does not."""
    image = np.ones((2, 4, 4), np.float32)
    image[0, :, 3] = np.nextafter(np.float32(1), np.float32(0))
    front = textured.textured(image, magnify="nearest", alpha_mode="BLEND")
    stats = render(layered([front, GLASS], (4, 2)), soups.pixel_view(2), (4, 2), lanes=lanes).stats
    assert stats["opaque_samples"] == 4 and stats["fragments"] == 8


def test_whose_alpha_counts(lanes: int) -> None:
    """That of the scene's colour does, unless the material says otherwise."""
    for counts, alpha in ((True, 0.2), (False, 0.5)):
        material = Material(base_color=(1.0, 1.0, 1.0, 0.5), alpha_mode="BLEND", alpha_of_scene=counts)
        soup = facing(material, (4, 2), color=np.array([255, 255, 255, 102], np.uint8))
        got = render(soup, soups.pixel_view(2), (4, 2), lanes=lanes)
        assert np.abs(got.color - alpha).max() <= 4 * UNIT


def test_opacity_multiplies_what_is_left(lanes: int) -> None:
    image = noise(13, 8, 6, [0, 51, 255])
    for mode, alpha in (
        ("OPAQUE", np.full((6, 8), 0.25)),
        ("MASK", np.where(image[..., 3] >= 0.5 * 255, 0.25, 0)),
        ("BLEND", image[..., 3] / 255 * 0.25),
    ):
        material = textured.textured(image, magnify="nearest", alpha_mode=mode, opacity=0.25)
        got = render(facing(material, (8, 6)), soups.pixel_view(6), (8, 6), lanes=lanes)
        want = alpha[..., None] * np.concatenate([plain(image)[..., :3], np.ones((6, 8, 1))], axis=-1)
        assert np.abs(got.color - want).max() <= 12 * UNIT, mode
        assert got.stats["fragments"] == (alpha > 0).sum() and got.stats["opaque_samples"] == 0


@pytest.mark.parametrize(
    ("cutoff", "least"), [(0.0, 0), (1 / 255, 1), (0.2, 51), (0.5, 128), (254.5 / 255, 255), (1.0, 255), (1.5, 256)]
)
def test_a_mask_at_known_alphas(cutoff: float, least: int, lanes: int) -> None:
    """Every alpha of a byte: the cut-off itself is there. Nothing of a mask is a transparent fragment."""
    image = np.full((16, 16, 4), 255, np.uint8)
    image[..., 3] = np.arange(256).reshape(16, 16)
    material = textured.textured(image, magnify="nearest", alpha_mode="MASK", alpha_cutoff=cutoff)
    got = render(facing(material, (16, 16)), soups.pixel_view(16), (16, 16), lanes=lanes)
    there = got.color[..., 3] == 1
    assert (there == (image[..., 3] >= least)).all() and (got.color[~there] == 0).all()
    assert got.stats["fragments"] == 0 and got.stats["opaque_samples"] == there.sum() == 256 - least


@pytest.mark.parametrize("magnify", ["nearest", "linear"])
def test_edges_of_a_mask_are_exact(magnify: str, lanes: int) -> None:
    """The pixels of a mask are the twin's, but where its alpha is within a millionth of the cut-off."""
    size = (96, 80)
    for cutoff, base in ((0.5, 1.0), (0.3, 0.8)):
        material = textured.textured(
            noise(14, 9, 8, [0, 40, 170, 255]),
            magnify=magnify,
            alpha_mode="MASK",
            alpha_cutoff=cutoff,
            base_color=(1.0, 1.0, 1.0, base),
        )
        soup = facing(material, size, ((-0.21, 0.13), (1.37, 1.42)))
        view = soups.pixel_view(80)
        projected = reference.project(soup, view, size)
        pixel, triangle, _ = reference.cast(projected, size)
        places = reference.places(projected, pixel, triangle, size)
        alpha = np.zeros(size[0] * size[1])
        alpha[pixel] = textures.texels(material.texture, places.at)[:, 3] * base
        # Coordinates are off by 24 roundings (conftest.py), which moves alpha by the slope of a texture of 9 texels.
        sure = np.abs(alpha - cutoff) > (1e-6 if magnify == "nearest" else 1e-6 + 9 * 2 * 24 * UNIT)
        got = render(soup, view, size, lanes=lanes).color[..., 3].reshape(-1)
        assert sure.mean() > 0.999 and ((got == 1) == (alpha >= cutoff))[sure].all()
        assert set(np.unique(got)) == {0.0, 1.0}


# --- with every technique ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("technique", EXACT)
def test_exact_techniques_are_the_twin(technique: str, judge: Judge) -> None:
    """Crossing quads of every kind: the picture of the twin, and the same bits as by sort. So with opaque="blend"."""
    soup = everything(15)
    want = render(soup, BENCH, SIZE, lanes=1)
    for opaque in ("first", "blend"):
        got = render(soup, BENCH, SIZE, technique, lanes=turn(technique), opaque=opaque)
        twin = judge.painted(got, soup, BENCH, SIZE)
        assert twin.layers.max() >= 4 and len(twin.cut[0]) > 100
        if technique in ALIKE:
            judge.same_bits(got, want, f"{technique}, {opaque}")


@given(seed=st.integers(0, 10**6), parallel=st.booleans(), number=st.integers(0, 5))
def test_any_scene(seed: int, parallel: bool, number: int, judge: Judge) -> None:
    """Within the twin's bound; the same bits on both shapes of machine, shuffled, and by another technique."""
    soup, view = everything(seed, 10), replace(BENCH, orthographic=parallel)
    got = render(soup, view, SIZE, lanes=1)
    twin = judge.painted(got, soup, view, SIZE)
    judge.same_bits(render(soup, view, SIZE, lanes=64), got, "on 64 lanes")
    order = np.random.default_rng(seed).permutation(len(soup.faces))
    shuffled = render(soup.take(order), view, SIZE, lanes=1)
    same = (shuffled.color == got.color).all(axis=2) | judge.ties(twin)
    assert same.all(), "shuffled"
    technique = ALIKE[number % len(ALIKE)]
    judge.same_bits(render(soup, view, SIZE, technique, lanes=turn(technique)), got, technique)


@pytest.mark.parametrize("layers_per_pass", [1, 2, 8])
def test_peels_of_any_number_of_layers(layers_per_pass: int, lanes: int, judge: Judge) -> None:
    soup = everything(16)
    want = render(soup, BENCH, SIZE, lanes=1)
    got = render(soup, BENCH, SIZE, "multi-layer-peeling", lanes=lanes, layers_per_pass=layers_per_pass)
    judge.same_bits(got, want)
    assert got.stats["fragments"] == want.stats["fragments"] and got.stats["layers_max"] == want.stats["layers_max"]


@pytest.mark.parametrize("technique", [name for name in PICTURES if TECHNIQUES[name].has_passes])
def test_passes_make_the_same_bits(technique: str, judge: Judge) -> None:
    soup = everything(17)
    tiles, passes = (
        render(soup, BENCH, SIZE, technique, lanes=turn(technique), execution=execution)
        for execution in ("tiles", "passes")
    )
    judge.same_bits(passes, tiles)
    for name in ("fragments", "layers_max", "opaque_samples", "passes", "samples_passed", "truncated_pixels"):
        assert passes.stats[name] == tiles.stats[name], name


@pytest.mark.parametrize("technique", TWINNED)
def test_every_blend_of_the_layers(technique: str, judge: Judge) -> None:
    """Whatever a technique makes of layers, it makes of these: the twins of blending, to the bit."""
    scene, camera = scene_of(everything(18)), BENCH.camera()
    layers = plainly.render(scene, camera, SIZE, lanes=1, layers=True).layers
    got = plainly.render(scene, camera, SIZE, technique, lanes=turn(technique))
    want = blended(technique, Stacks(layers, "float32"))
    if technique == "weighted-average":
        judge.color(got, want, 12 * UNIT)
    else:
        judge.same_bits(got, SimpleNamespace(color=want, image=got.image))


def test_layers_are_what_is_there(lanes: int, judge: Judge) -> None:
    """Face by face and colour by colour as in the twin: cut and clear fragments are none, the last one is opaque."""
    soup = everything(19)
    got = render(soup, BENCH, SIZE, lanes=lanes, layers=True)
    twin, excused, _ = judge.weigh(soup, BENCH, SIZE)
    assert (got.layers.blended().view(np.uint32) == got.color.view(np.uint32)).all()
    count, opaque = in_front(twin)
    seen = 0
    for pixel in np.flatnonzero(~excused.reshape(-1)):
        own = slice(*got.layers.start[pixel : pixel + 2])
        want = np.flatnonzero(twin.pixel == pixel)[: count.flat[pixel] + opaque.flat[pixel]]
        faces = twin.projected.number[twin.triangle[want]]
        assert got.layers.triangle[own].tolist() == faces.tolist(), pixel
        assert np.abs(got.layers.color[own] - twin.rgba[want]).max(initial=0) <= 2e-3
        seen += len(faces)
    assert seen > 1000
    all_ = render(soup, BENCH, SIZE, lanes=lanes, layers=True, opaque="blend").layers
    sure = ~excused.reshape(-1)
    assert (np.diff(all_.start)[sure] == twin.layers.reshape(-1)[sure]).all()


def test_little_memory_changes_nothing(lanes: int, judge: Judge) -> None:
    """Windows of a tile and batches of tiles count what is there before it is drawn."""
    soup, size = everything(20, 400), (64, 64)
    want = render(soup, BENCH, size, lanes=lanes, opaque="blend")
    assert want.stats["fragments"] * 24 > 2 * 2**20, "fits at once"
    got = render(soup, BENCH, size, lanes=lanes, opaque="blend", memory="1M")
    judge.same_bits(got, want)
    assert got.stats["fragments"] == want.stats["fragments"]


def test_samples_are_averaged(lanes: int) -> None:
    soup = everything(21)
    fine = render(soup, BENCH, (80, 64), lanes=lanes).color.astype(float)
    mean = render(soup, BENCH, (10, 8), lanes=lanes, samples=64).color
    assert np.abs(mean - fine.reshape(8, 8, 10, 8, 4).mean(axis=(1, 3))).max() <= 65 * UNIT


@pytest.mark.parametrize("technique", ["sort", "multi-layer-peeling"])
def test_a_guaranteed_error(technique: str) -> None:
    soup = everything(22, 30)
    right = render(soup, BENCH, SIZE, lanes=1).color.astype(float)
    got = render(soup, BENCH, SIZE, technique, lanes=turn(technique), max_error=0.1)
    assert (np.abs(got.color - right).max(axis=2) <= got.error_bound).all()
    assert (got.error_bound <= 0.1 + 1e-4).all()


def test_auto_draws_them(judge: Judge) -> None:
    soup = everything(23)
    judge.painted(render(soup, BENCH, SIZE, "auto"), soup, BENCH, SIZE)


# --- what is counted --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("technique", PICTURES)
def test_what_opaque_texels_hide_is_no_fragment(technique: str) -> None:
    """Behind a checker of glass and wall only the glass's squares let fragments through."""
    image = checker(4, 4, (255, 0, 0, 128), (0, 255, 0, 255))
    front = textured.textured(image, magnify="nearest", alpha_mode="BLEND")
    soup = layered([GLASS, front, GLASS, GLASS], (16, 12))
    got = render(soup, soups.pixel_view(12), (16, 12), technique, lanes=turn(technique))
    assert got.stats["fragments"] == 192 + 96 * 3 and got.stats["opaque_samples"] == 96
    assert got.stats["layers_max"] == 4


def test_a_mask_in_front_costs_no_fragments(lanes: int) -> None:
    """A scene of cut-outs alone is one pass; and what a cut-out hides is not drawn."""
    soup = layered([HOLED, WALL, HOLED], SIZE)
    for technique in EXACT:
        got = render(soup, soups.pixel_view(36), SIZE, technique, alone=True, lanes=lanes)
        stats = got.stats
        assert stats["fragments"] == stats["passes"] == stats["layers_max"] == 0
        assert stats["opaque_samples"] == SIZE[0] * SIZE[1] and (got.color[..., 3] == 1).all()
    glass = render(layered([HOLED, GLASS], SIZE), soups.pixel_view(36), SIZE, lanes=lanes).stats
    there = render(layered([HOLED], SIZE), soups.pixel_view(36), SIZE, lanes=lanes).stats["opaque_samples"]
    assert 0 < there < SIZE[0] * SIZE[1] and glass["opaque_samples"] == there
    assert glass["fragments"] == SIZE[0] * SIZE[1] - there


def test_counts_are_of_what_is_there(lanes: int, judge: Judge) -> None:
    """layer-count, complexity and every technique's stats count as the twin does."""
    soup = everything(24)
    twin, excused, _ = judge.weigh(soup, BENCH, SIZE)
    count, opaque = in_front(twin)
    sure = ~excused
    got = render(soup, BENCH, SIZE, "layer-count", lanes=lanes, scale_bar=False)
    assert (got.layer_count == twin.layers)[sure].all() and got.stats["fragments"] == got.layer_count.sum()
    first = clpeel.complexity(scene_of(soup), BENCH.camera(), SIZE, lanes=lanes)
    assert (first.layers == count)[sure].all() and (first.opaque == opaque)[sure].all()
    blend = clpeel.complexity(scene_of(soup), BENCH.camera(), SIZE, lanes=lanes, opaque="blend")
    assert (blend.layers == twin.layers)[sure].all() and not blend.opaque.any()
    stats = render(soup, BENCH, SIZE, lanes=lanes).stats
    assert stats["fragments"] == first.fragments and stats["opaque_samples"] == first.opaque.sum()
    assert render(soup, BENCH, SIZE, lanes=lanes, opaque="blend").stats["fragments"] == blend.fragments


def test_complexity_of_cut_outs_alone(lanes: int) -> None:
    soup = layered([HOLED, HOLED], SIZE)
    found = clpeel.complexity(soup.scene(), soups.pixel_view(36).camera(), SIZE, lanes=lanes)
    there = render(soup, soups.pixel_view(36), SIZE, alone=True, lanes=lanes).color[..., 3] == 1
    assert (found.opaque == there).all() and 0 < there.sum() < there.size and found.fragments == 0


@pytest.mark.parametrize(("variant", "lanes"), [("exact", 1), ("exact", 64), ("total", 1), ("first-solid", 64)])
def test_thickness_has_the_holes(variant: str, lanes: int) -> None:
    """Two walls with the same holes, 1/4 apart: no length where there are holes. One with none: unpaired there."""
    image = checker(5, 4, (255, 255, 255, 255), (255, 255, 255, 0))
    size = (10, 8)
    there = image[..., 3].repeat(2, axis=0).repeat(2, axis=1) == 255
    for mode in ("MASK", "BLEND"):
        holed = textured.textured(image, magnify="nearest", alpha_mode=mode)
        for both in (True, False):
            soup = layered([holed, holed if both else WALL], size)
            faces = soup.faces.copy()
            faces[2:] = faces[2:, ::-1]
            got = render(
                replace(soup, faces=faces), soups.pixel_view(8), size, "thickness", variant=variant, lanes=lanes
            )
            assert np.abs(got.thickness - there * 0.25).max() <= 1e-5
            unpaired = ~there & (not both) & (variant != "total")
            assert (got.unpaired == unpaired).all()


def test_alphas_of_vertices_cut_too(lanes: int) -> None:
    """A mask without a texture: its alpha is that of the vertices, from 0 on the left to 1 on the right."""
    mask = Material(alpha_mode="MASK")
    size = (16, 6)
    soup = layered([mask, mask], size)
    colors = np.ones((8, 4), np.float32)
    colors[:, 3] = soup.vertices[:, 0] > 0
    faces = soup.faces.copy()
    faces[2:] = faces[2:, ::-1]
    soup = replace(soup, faces=faces, vertex_colors=colors, color=None)
    there = np.broadcast_to(np.arange(16) >= 8, (6, 16))
    view = soups.pixel_view(6)
    assert (render(soup, view, size, lanes=lanes).color[..., 3] == there).all()
    assert (render(soup, view, size, "layer-count", lanes=lanes, scale_bar=False).layer_count == 2 * there).all()
    assert np.abs(render(soup, view, size, "thickness", lanes=lanes).thickness - 0.25 * there).max() <= 1e-5
    found = clpeel.complexity(scene_of(soup), view.camera(), size, lanes=lanes, opaque="blend")
    assert (found.layers == 2 * there).all()


# --- equal depths -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("technique", "lanes"), BOTH)
def test_coincident_with_what_hides(technique: str, lanes: int) -> None:
    """Of equal depths the first submitted is in front, be it opaque by its texels or as a whole."""
    image = checker(4, 3, (255, 0, 0, 255), (255, 0, 0, 128))
    hides = textured.textured(image, magnify="nearest", alpha_mode="BLEND")
    wall = Material(base_color=(0.0, 0.0, 1.0, 1.0))
    solid = image[..., 3:] == 255
    half = 128 / 255
    soup = layered([hides, wall], (4, 3))
    flat = replace(soup, vertices=soup.vertices * [1, 1, 0])
    over = np.where(solid, [1, 0, 0, 1], [half, 0, 1 - half, 1])
    for order, want in (([0, 1, 2, 3], over), ([2, 3, 0, 1], np.broadcast_to([0, 0, 1, 1], (3, 4, 4)))):
        got = render(flat.take(order), soups.pixel_view(3), (4, 3), technique, lanes=lanes)
        assert np.abs(got.color - want).max() <= 8 * UNIT


# --- sides ------------------------------------------------------------------------------------------------------------


def test_sides(lanes: int, judge: Judge) -> None:
    """A face with one side is not seen from behind; all are if wanted, or none."""
    soup = everything(25)
    single = np.random.default_rng(26).random(len(soup.faces)) < 0.5
    soup = replace(soup, single_sided=single)
    layers = {}
    for kind in ("default", "visible", "hidden"):
        got = render(soup, BENCH, SIZE, lanes=lanes, backface_type=kind)
        layers[kind] = judge.painted(got, soup, BENCH, SIZE, backfaces=kind).layers.sum()
    assert layers["hidden"] < layers["default"] < layers["visible"]
    two = replace(soup, single_sided=None)
    judge.same_bits(
        render(two, BENCH, SIZE, lanes=lanes), render(soup, BENCH, SIZE, lanes=lanes, backface_type="visible")
    )


def test_sides_without_materials(lanes: int, judge: Judge) -> None:
    """Plain faces have sides, too; and so have pieces of clipped ones."""
    soup = soups.random(27, 60, "large")
    soup = replace(soup, single_sided=np.arange(60) % 2 == 0)
    for view in (BENCH, replace(BENCH, clipping_range=(3.7, 4.5)), replace(BENCH, orthographic=True)):
        for kind in ("default", "hidden"):
            got = render(soup, view, SIZE, alone=True, lanes=lanes, backface_type=kind)
            twin, excused, bound = judge.weigh(soup, view, SIZE, kind)
            judge.color(got, twin.color, np.where(excused, np.inf, bound))


def test_thickness_sees_both_sides(lanes: int) -> None:
    """What measures all surfaces needs their backs, whatever files say; but for those who ask."""
    soup = layered([Material(), Material()], SIZE)
    faces = soup.faces.copy()
    faces[2:] = faces[2:, ::-1]
    soup = replace(soup, faces=faces, single_sided=np.ones(4, bool))
    got = render(soup, soups.pixel_view(36), SIZE, "thickness", lanes=lanes)
    assert np.abs(got.thickness - 0.25).max() <= 1e-5
    hidden = render(soup, soups.pixel_view(36), SIZE, "thickness", lanes=lanes, backface_type="hidden")
    assert hidden.unpaired.all()


# --- a scene that is kept ---------------------------------------------------------------------------------------------


def test_opacity_of_a_kept_scene(lanes: int, judge: Judge) -> None:
    """Renderer.set_opacity makes the picture of a scene with that opacity; and None the first one again."""
    scene = scene_of(everything(28))
    kept = plainly.Renderer(scene, lanes=lanes)
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": SIZE}
    first = kept.render(**call)
    for opacity in (0.3, 1.0):
        kept.set_opacity(opacity)
        judge.same_bits(kept.render(**call), plainly.render(recolored(scene, None, opacity), lanes=lanes, **call))
    kept.set_opacity(None)
    judge.same_bits(kept.render(**call), first)


def test_a_renderer_that_drew_other_scenes(lanes: int, judge: Judge) -> None:
    """Buffers are shared: neither textures nor materials of another scene may show."""
    scenes = [scene_of(everything(29)), soups.random(30, 40, "large", "vertex").scene(), scene_of(everything(31, 5))]
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": SIZE, "lanes": lanes}
    first = [plainly.render(scene, **call) for scene in scenes]
    for scene, want in zip(scenes[::-1], first[::-1], strict=True):
        judge.same_bits(plainly.render(scene, **call), want)


def test_there_is_no_other_way() -> None:
    soup = layered([WALL], SIZE)
    for name, value, message in (
        ("anisotropy", 3, "anisotropy: expected one of 1, 2, 4, 8, 16; got 3"),
        ("backface_type", "none", "backface_type: expected one of default, visible, hidden; got 'none'"),
    ):
        with pytest.raises(clpeel.InputError, match=f"^{message}$"):
            render(soup, AHEAD, SIZE, **{name: value})
