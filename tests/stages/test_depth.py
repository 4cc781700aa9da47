"""Depth formats: keys by a NumPy twin, what they tell apart and what becomes coincident, and how far off depths are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from twins import soups
from twins.blends import F, Stacks, blended
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH, Eye, Soup

import clpeel
from clpeel.device.layout import DEPTH_FORMATS
from clpeel.pictures.layers import Layers
from clpeel.techniques import TECHNIQUES

if TYPE_CHECKING:
    from conftest import Judge

pytestmark = pytest.mark.usefixtures("shared_devices")

Numbers = NDArray[np.float64]

PARALLEL = replace(AHEAD, orthographic=True)
VIEWS = {"perspective": AHEAD, "parallel": PARALLEL}
PEELERS = [name for name, technique in TECHNIQUES.items() if "coincident" in technique.option_names]
SORTING = [name for name, technique in TECHNIQUES.items() if technique.sorts]


def runs(depth_format: str) -> list[tuple[str, int, dict[str, Any]]]:
    """Techniques, lanes and options with which a format is tried, taking turns, as each is another kernel to build.

    Keeping what is coincident a technique has one number of lanes, and the other by depth alone; in the next format the
    other way round. What reads a depth is the same in all, and what the lanes change does not know of the format.
    """
    found: list[tuple[str, int, dict[str, Any]]] = []
    for number, technique in enumerate(SORTING, DEPTH_FORMATS.index(depth_format)):
        found.append((technique, (1, 64)[number % 2], {}))
        if technique in PEELERS:
            found.append((technique, (64, 1)[number % 2], {"coincident": "paper"}))
    return found


# --- the twin ---------------------------------------------------------------------------------------------------------


def scale_of(view: Eye) -> np.float32:
    """Of window depths: far / (far - near)."""
    assert view.clipping_range is not None
    near, far = view.clipping_range
    return F(1) if view.orthographic else F(1 / (1 - near / far))


def reversed_depths(distances: Numbers, view: Eye) -> NDArray[np.float32]:
    """What rasterization gives: 1 at the near plane."""
    assert view.clipping_range is not None
    near, far = view.clipping_range
    return ((far - distances) / (far - near) if view.orthographic else near / distances).astype(F)


def keys(depth_format: str, distances: Numbers, view: Eye) -> Numbers:
    """Whole numbers that grow with distance, equal where the format does not tell surfaces apart."""
    depth = reversed_depths(distances, view)
    if depth_format == "float32-reversed":
        return -depth.astype(float)
    z = np.clip((F(1) - depth) * scale_of(view), F(0), F(1))
    if depth_format == "float32":
        return z.view(np.uint32).astype(float)
    if depth_format == "unorm24":
        return np.floor((z * F(2**24 - 1)).astype(float) + 0.5)
    return np.minimum(np.floor(z.astype(float) * 2.0**32), 2.0**32 - 3)


def kept_distances(depth_format: str, distances: Numbers, view: Eye) -> NDArray[np.float32]:
    """What is left of distances: keys turned round, in float64."""
    assert view.clipping_range is not None
    (near, far), kept = view.clipping_range, keys(depth_format, distances, view)
    if depth_format == "float32-reversed":
        depth = -kept
    else:
        window = kept.astype(np.uint32).view(F).astype(float) if depth_format == "float32" else kept
        window = window / {"float32": 1, "unorm24": 2.0**24 - 1, "rgba8": 2.0**32}[depth_format]
        depth = 1 - window / (1 if view.orthographic else 1 / (1 - near / far))
    return (far - depth * (far - near) if view.orthographic else near / depth).astype(F)


def order(depth_format: str, distances: Numbers, view: Eye, coincident: str = "keep") -> NDArray[np.int64]:
    """The surfaces front to back; of coincident ones the first submitted first, or alone."""
    kept = keys(depth_format, distances, view)
    found = np.lexsort((np.arange(len(kept)), kept))
    return found if coincident == "keep" else found[np.diff(kept[found], prepend=-np.inf) > 0]


def stack(distances: Numbers, rgba: Any, view: Eye) -> Soup:
    """One triangle a distance, that covers the view."""
    soup = soups.stack(distances, rgba, reach=16 if view.orthographic else 4)
    if view.orthographic:
        soup.vertices[:, :2] /= np.repeat(distances, 3)[:, None]
    return soups.with_opaque(soup)


def pixel(indices: NDArray[np.int64], rgba: NDArray[np.float32]) -> Stacks:
    """A picture of one pixel with these surfaces, front to back."""
    start, depth = np.array([0, len(indices)]), np.zeros(len(indices), F)
    return Stacks(Layers((1, 1), start, rgba[indices], depth, indices.astype(np.int32)), "float32")


def rounding(depth_format: str) -> float:
    """How far off a kept window depth is at most, of 1.

    It is (1 - d) scale: half a unit of d, which is at most 1, of the difference, of the scale and of the product are
    2^-25 each. 24 bits round that twice more, to the product with 2^24 - 1 and to a whole number; bytes cut at 2^-32.
    """
    return 4 * 2.0**-25 + {"float32": 0.0, "unorm24": 2 * 2.0**-25, "rgba8": 2.0**-32}[depth_format]


def error_at(depth_format: str, distances: Numbers, view: Eye, more: float = 0.0) -> Numbers:
    """How far off a distance is at most, from what is kept of its depth; and where window depths are off by more."""
    assert view.clipping_range is not None
    near, far = view.clipping_range
    if depth_format == "float32-reversed":
        off = 2.0**-25 + more
        return off * (far - near) * np.ones_like(distances) if view.orthographic else off * distances * 1.001
    off = (rounding(depth_format) + more) / float(scale_of(view))
    return off * (far - near) * np.ones_like(distances) if view.orthographic else off * distances**2 / near * 1.001


# --- the order of surfaces, and which of them are coincident ----------------------------------------------------------


def scattered(view: Eye) -> Numbers:
    """Distances of both planes and between, in clusters that are finer and coarser than what the formats tell apart."""
    assert view.clipping_range is not None
    near, far = view.clipping_range
    rng = np.random.default_rng(2)
    clusters = [np.array([near, far, near, far])]
    for distance in (near * 1.01, 1.0, 2.7, 6.1, far * 0.99):
        for grain in (2.0**-27, 2.0**-24, 2.0**-21):
            clusters.append(distance * (1 + grain * rng.uniform(-4, 4, 3)))
    return rng.permutation(np.concatenate(clusters))


@pytest.mark.parametrize("depth_format", DEPTH_FORMATS)
@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_what_is_in_front_and_what_is_coincident(depth_format: str, view: Eye) -> None:
    """In every technique that compares depths; those on the planes, at 0 and 1, are drawn as any."""
    distances = scattered(view)
    rgba = np.random.default_rng(3).random((len(distances), 4)).astype(F) * F(0.5)
    scene = stack(distances, rgba, view).scene()
    assert len(np.unique(keys(depth_format, distances, view))) < len(distances) - 2  # some are, besides the planes'
    # In parallel projection the scale is another, and nothing else.
    tried = runs(depth_format) if view == AHEAD else [("multi-layer-peeling", 1, {})]
    for technique, lanes, options in tried:
        want = order(depth_format, distances, view, options.get("coincident", "keep"))
        assert distances[want[0]] == 0.5 and distances[want[-1]] == 8
        call: dict[str, Any] = {"lanes": lanes, "depth_format": depth_format, "layers": lanes == 1, **options}
        got = plainly.render(scene, view.camera(), (3, 2), technique, **call)
        assert (got.color == blended(technique, pixel(want, rgba))).all(), (technique, lanes, options)
        if call["layers"]:
            peeled = want[:4] if technique == "glowscript" else want
            assert (got.layers.triangle.reshape(6, -1) == peeled).all(), (technique, options)
            assert (got.layers.depth.reshape(6, -1) == kept_distances(depth_format, distances, view)[peeled]).all()
            off = np.abs(got.layers.depth.reshape(6, -1) - distances[peeled])
            # Of one step of the format at most, and their own rounding.
            assert (off <= error_at(depth_format, distances[peeled], view) + distances[peeled] * UNIT).all()


def test_the_formats_differ() -> None:
    """Of 49 distances: the reversed one tells most apart, bytes as many as the float that they are of."""
    told = {name: len(np.unique(keys(name, scattered(AHEAD), AHEAD))) for name in DEPTH_FORMATS}
    assert told["float32-reversed"] > told["float32"] >= told["rgba8"] >= told["unorm24"] > 15, told


@given(seed=st.integers(0, 10**6), count=st.integers(1, 60))
def test_any_scene_in_any_format(seed: int, count: int, judge: Judge) -> None:
    """All techniques agree with the layers, whichever kernel found their depths; naming the default changes nothing."""
    soup = soups.random(seed, count, "large", "flat")
    assert soup.face_colors is not None
    soup.face_colors[::9, 3] = 1
    scene, camera, size = soups.with_opaque(soup).scene(), BENCH.camera(), (19, 17)
    for depth_format in DEPTH_FORMATS:
        call: dict[str, Any] = {"camera": camera, "size": size, "depth_format": depth_format}
        peeling = next(
            name for name, lanes, options in runs(depth_format) if lanes == 1 and not options and name != "glowscript"
        )
        layers = plainly.render(scene, technique=peeling, lanes=1, layers=True, **call).layers
        stacks = Stacks(layers, "float32")
        for technique, lanes, options in runs(depth_format):
            if (
                options
            ):  # by depth alone opaque surfaces are in front of what is coincident, whatever was submitted first
                continue
            got = plainly.render(scene, technique=technique, lanes=lanes, **call)
            want = SimpleNamespace(color=blended(technique, stacks), image=got.image)
            judge.same_bits(got, want, f"{technique}, {depth_format}, {lanes} lanes")
            if depth_format == DEPTH_FORMATS[0]:
                plain = plainly.render(scene, camera, size, technique, lanes=lanes)
                judge.same_bits(got, plain, f"{technique} as by default")


# --- opaque surfaces --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth_format", DEPTH_FORMATS)
def test_opaque_surfaces_are_tested_in_the_format(depth_format: str) -> None:
    """What is in front of one by less than the format tells is hidden if submitted later; by depth alone, always."""
    finest, finer, coarse = (5.0 - 5.0 * grain for grain in (2.0**-26, 2.0**-23, 2.0**-12))
    glass, wall = (1.0, 0.0, 0.0, 0.5), (0.0, 0.0, 1.0, 1.0)
    for front in (finest, finer, coarse):
        for glass_first in (True, False):
            distances = np.array([front, 5.0] if glass_first else [5.0, front])
            rgba = np.array([glass, wall] if glass_first else [wall, glass], F)
            scene, apart = stack(distances, rgba, AHEAD).scene(), bool(np.ptp(keys(depth_format, distances, AHEAD)) > 0)
            assert apart == (front == coarse or (front == finer and depth_format == "float32-reversed"))
            for technique, lanes, options in runs(depth_format):
                call: dict[str, Any] = {"lanes": lanes, "depth_format": depth_format, **options}
                got = plainly.render(scene, AHEAD.camera(), (3, 2), technique, **call)
                seen = apart or (not options and glass_first)
                assert (got.color == ([0.5, 0, 0.5, 1] if seen else [0, 0, 1, 1])).all(), (technique, options, front)


# --- extremes ---------------------------------------------------------------------------------------------------------


FAR_AWAY = replace(AHEAD, clipping_range=(1.0, 1e7))


def pair_about(depth_format: str, distance: float, apart: float) -> Numbers:
    """Two distances about one, the farther first: so many of the format's steps apart, in the middle of one.

    A step is 2^-24 of the window depth, which is near 1 and was 1 - near / distance before; in 24 bits it is 2^-24
    again, to 2^-48. Reversed it is the unit of near / distance.
    """
    depth = float(F(1 / distance))
    if depth_format == "float32-reversed":
        step = float(np.spacing(F(depth)))
    else:
        step, depth = 2.0**-24, 1 - float(F(1) - F(depth))
    return 1 / np.array([depth - step * apart / 2, depth + step * apart / 2])


@pytest.mark.parametrize("depth_format", DEPTH_FORMATS)
@pytest.mark.parametrize("distance", [10.0, 300.0, 1e4])
def test_what_is_told_apart_where_far_is_ten_million_times_near(depth_format: str, distance: float) -> None:
    """EXTREMES 23: window depths tell apart what is Z^2 2^-24 / near apart, reversed ones what is Z 2^-23, no less.

    Rounding to the nearest tells two numbers apart for certain where they are more than a step apart, and does not
    where both are within half of one of the same.
    """
    # What near / Z is rounded by, in steps of window depths.
    margin = 0.02 if depth_format == "float32-reversed" else 0.02 + 2 / distance
    for apart, told in ((1 + margin, True), (1.5, True), (1 - margin, False), (0.5, False)):
        distances = pair_about(depth_format, distance, apart)
        far, near = distances
        reach = far**2 * 2.0**-24 if depth_format != "float32-reversed" else far * 2.0**-23
        assert (far - near < 1.01 * reach * (1 - margin)) or told  # what is not told apart is closer than that
        scene = stack(distances, [(1, 0, 0, 0.5), (0, 1, 0, 0.5)], FAR_AWAY).scene()
        want = [0.25, 0.5, 0, 0.75] if told else [0.5, 0.25, 0, 0.75]  # else the first submitted, the farther
        for technique, lanes, options in runs(depth_format):
            call: dict[str, Any] = {"lanes": lanes, "depth_format": depth_format, **options}
            got = plainly.render(scene, FAR_AWAY.camera(), (3, 2), technique, **call)
            alone = [0.5, 0, 0, 0.5] if options and not told else want
            assert (got.color == alone).all(), (technique, apart, told)


@pytest.mark.parametrize("depth_format", DEPTH_FORMATS)
def test_what_only_the_reversed_tells_apart(depth_format: str) -> None:
    """Two metres at ten kilometres, near at one: a step of the window depth is six metres there."""
    scene = stack(np.array([10_001.0, 9_999.0]), [(1, 0, 0, 0.5), (0, 1, 0, 0.5)], FAR_AWAY).scene()
    technique, lanes, _ = runs(depth_format)[0]
    got = plainly.render(scene, FAR_AWAY.camera(), (3, 2), technique, lanes=lanes, depth_format=depth_format)
    assert (got.color[..., :2] == ([0.25, 0.5] if depth_format == "float32-reversed" else [0.5, 0.25])).all()


# --- lengths ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("depth_format", "variant"), [*((name, "total") for name in DEPTH_FORMATS), ("unorm24", "exact")]
)
@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
@pytest.mark.parametrize("projected", [False, True])
def test_thickness_in_the_format(depth_format: str, variant: str, view: Eye, projected: bool) -> None:
    """Off by what its two crossings are, and the roundings of a window depth's way back: 3 of 2^-25 each."""
    lanes = 1 if variant == "exact" else 64
    near, far = view.clipping_range or (0, 0)
    for ends in ((near, far), (0.7, 0.8), (1.0, 7.9), (6.0, 6.0 + 2.0**-12), (5.0, 5.0)):
        distances = np.array(ends)
        soup = stack(distances, (1, 1, 1, 0.5), view)
        soup.faces[1] = soup.faces[1, ::-1]  # as of a solid between them
        call = {"lanes": lanes, "depth_format": depth_format, "variant": variant, "projected": projected}
        got = plainly.render(soup.scene(), view.camera(), (3, 2), "thickness", **call)
        want = float(np.diff(distances)[0])
        bound = float(error_at(depth_format, distances, view, more=3 * 2.0**-25).sum())
        if projected:
            window = (distances - near) / (far - near)
            if not view.orthographic:
                window = far / (far - near) * (1 - near / distances)
            want = float(np.diff(window)[0])
            bound = 2 * (2 * 2.0**-24 if depth_format == "float32-reversed" else rounding(depth_format) + 4 * 2.0**-25)
        assert (np.abs(got.thickness - want) <= bound + 7 * UNIT * want).all(), ends
        assert not got.unpaired.any() and (want > 0 or (got.thickness == 0).all())


# --- the option -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_format_there_is_not(technique: str) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    for name in ("float64", "RGBA8", "", None, 24):
        with pytest.raises(clpeel.InputError) as caught:
            plainly.render(scene, AHEAD.camera(), (2, 2), technique, depth_format=name)
        assert str(caught.value) == f"depth_format: expected one of {', '.join(DEPTH_FORMATS)}; got {name!r}"
