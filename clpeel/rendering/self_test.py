"""The self-test: before a device's kernels draw their first picture, they draw one that is known (known_layers.py).

A driver may compile a kernel wrongly, and then the picture is wrong or blank without a word. So the very kernels that a
picture needs first draw a few known layers, with the picture's own options. This is done if no verdict on them is known
(checking.py). It launches kernels as the picture does, so that nothing is compiled for it alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import Background
from clpeel.device.layout import DEPTH_FORMATS, TILE_PIXELS
from clpeel.device.program import lacks
from clpeel.device.verdicts import Kind, Parts, Verdict
from clpeel.errors import DeviceError
from clpeel.options import Options
from clpeel.pictures.background import rows_of
from clpeel.pictures.over import converted
from clpeel.rendering.checking import LAYERS, MAX_ERROR, NO_EDGES, Behind, behind, own_ways, shared_ways
from clpeel.rendering.known_layers import (
    FAR,
    HEIGHT,
    NEAR,
    SHOWN,
    WIDTH,
    Floats,
    Stack,
    Wanted,
    compressed,
    lost,
    masks,
    peeled,
    stack_of,
    wavelet_range,
)
from clpeel.rendering.request import Request
from clpeel.rendering.shown_errors import ENCODING, error_of, rounding_of
from clpeel.scene.textures import linear, srgb
from clpeel.stages.counting import count_layers
from clpeel.stages.upload import upload
from clpeel.techniques import ERROR_BOUND
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISIONS, blending_bound

if TYPE_CHECKING:
    from clpeel.rendering.renderer import Renderer
    from clpeel.rendering.result import Result
    from clpeel.stages.projection import Triangles

BACKGROUNDS: dict[Behind, Background | None] = {
    "colour": (0.25, 0.5, 1.0),
    "gradient": ((0.25, 0.5, 1.0), (1.0, 0.125, 0.5)),
    "none": None,
}
"""Behind the known layers, by the kind of the picture's background."""

ROUNDING = 2.0**-24
"""How far a number up to 1 is off after one float32 operation."""

LIGHTS_ROUNDINGS = 300
"""Of a colour under lights: about 70 for the light, in sums of which no part is negative; as many for the quotients and
roots that these are multiplied with; 2^-19 for sRGB made linear; and the slope of sRGB, up to 2 for what is known here.
"""

COLOR_ROUNDINGS = 20
"""Of a colour that is interpolated: 6 for each product of weights and their sums, 8 for the quotient, 6 for the sum."""

MATERIAL_ROUNDINGS = 40
"""Of a colour with a material: 6 of the product with the texel, 2 of each of two roots and of the sum after it, and 10
of each of two steps of the cube root.
"""

LINEAR_ROUNDINGS, LINEAR_SLOPE = 32, 2.3
"""Of an sRGB colour that is made linear: 2^-19; and by how much more the result is off than that was, at most."""

LIGHT_ROUNDINGS = 35
"""Of a light: 20 of the normal's channels, 3 + 2 of each of two sums of products, and 1 each of the root, the quotient,
the product with 1 - AMBIENT, the sum, and the product with the colour.
"""

DEPTH_ROUNDINGS = 24
"""Of two depths: 12 each for a corner, its shift to the snapped corner, and the interpolation."""

MESSAGE = 200
"""How many characters an error's text may take in a verdict."""


@dataclass(frozen=True)
class _Test:
    """What is drawn, and what names it.

    parts: the sets of kernels that the picture needs. wanted: the scene. request: the picture, without its scene.
    options: those of the technique. given: all options by name, for Renderer.render.
    """

    parts: Parts
    wanted: Wanted
    request: Request
    options: Options
    given: dict[str, Any]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        pattern = self.request.picture.pattern
        return -(-WIDTH // pattern.columns), HEIGHT // pattern.rows


def _test_of(request: Request, triangles: Triangles, parts: Parts) -> _Test:
    """What to draw for this picture: the same features, technique and options."""
    scene = triangles.scene
    wanted = Wanted(
        triangles.features,
        scene.surfaces,
        triangles.perspective,
        pairs=scene.low_positions is not None,
        cut=triangles.clipped > 0,
    )
    own = own_ways(request)
    features = triangles.features
    lighting = (
        "headlight" if features.headlight else "scene" if features.positioned else "kit" if features.lights else "none"
    )
    given = {**own, **shared_ways(request), "background": BACKGROUNDS[behind(request)], "lighting": lighting}
    if features.wires:
        given["feature_edges"] = NO_EDGES
    return _Test(
        parts=parts,
        wanted=wanted,
        request=request,
        options=replace(type(request.options)(), **own),
        given=given,
    )


# --- the test ---------------------------------------------------------------------------------------------------------


def tested(
    renderer: Renderer, request: Request, triangles: Triangles, parts: Parts, tiles: int
) -> tuple[Verdict, list[str]]:
    """Draws the known layers and compares. Returns the verdict, and the notes that compiling has left.

    request: the picture that is about to be drawn. parts: the sets of kernels that it needs. tiles: of the picture.
    """
    test = _test_of(request, triangles, parts)
    tester = renderer.beside(test.wanted.scene())
    tester.gpu.least["peel_layers"] = TILE_PIXELS * tiles
    notes: list[str] = []

    def compare() -> tuple[Kind, str]:
        result = tester.render(test.wanted.camera(), test.size, test.request.technique.name, **test.given)
        notes.extend(result.stats.notes)
        with np.errstate(all="ignore"):  # a wrong picture may have any numbers
            return _compared(result, test, lacks(renderer.gpu))

    return _verdict(compare, test.parts, renderer.gpu.lanes), notes


def counting_tested(renderer: Renderer, wanted: Wanted, parts: Parts) -> tuple[Verdict, list[str]]:
    """Counts the known layers and compares. Returns the verdict, and no notes. parts: the kernels that count."""
    tester = renderer.beside(wanted.scene())
    first, size = wanted.surfaces != "transparent", (WIDTH, HEIGHT)
    found, stack = _Comparison(), stack_of(wanted, size, first)

    def compare() -> tuple[Kind, str]:
        got = count_layers(tester.gpu, upload(tester.gpu, tester.scene), wanted.camera(), size, first)
        for name, values, want in (
            ("layers", got.layers, stack.transparent.sum(axis=1)),
            ("opaque", got.opaque, stack.opaque.any(axis=1)),
        ):
            found.expect(name, values.astype(np.float64), want.reshape(HEIGHT, WIDTH).astype(np.float64), 0.0)
        return ("wrong", found.wrong or found.inexact) if found.wrong or found.inexact else ("right", "")

    return _verdict(compare, parts, renderer.gpu.lanes), []


def _verdict(compare: Callable[[], tuple[Kind, str]], parts: Parts, lanes: int) -> Verdict:
    """The verdict that a comparison gives. Errors that wrong numbers lead to are wrong pictures, too."""
    try:
        kind, reason = compare()
    except DeviceError:
        raise  # there is no room to compile in: this says nothing of the driver
    except (ValueError, IndexError, ArithmeticError, MemoryError) as error:  # of numbers that the kernels made up
        kind, reason = "wrong", f"{type(error).__name__} ({str(error)[:MESSAGE]})"
    if kind == "wrong":
        reason += f", by {'; '.join(part.partition(' [')[0] for part in sorted(parts))}"
    return Verdict(kind, lanes, parts, reason)


def _compared(result: Result, test: _Test, lacking: str) -> tuple[Kind, str]:
    """The verdict on the picture, and its reason.

    lacking: which roundings the device says it does not make correctly.
    """
    found = _Comparison()
    technique, wanted = test.request.technique, test.wanted
    width, height = test.size
    pattern = test.request.picture.pattern
    stack = stack_of(wanted, test.size, test.request.opaque_first, pattern)
    color, maps = SHOWN[technique.name](stack, wanted, technique, test.options)

    def means(values: Floats) -> Floats:
        """The means over the samples of pixels: [height, width, ...]."""
        shape = height, pattern.rows, width, pattern.columns, *values.shape[1:]
        return values.reshape(shape).mean(axis=(1, 3))

    bound = means(color_bound(stack, test))
    bound = np.where(bound > 0, bound + len(pattern.places) * ROUNDING * LAYERS, 0.0)  # a mean adds up so many samples
    if len(color):
        blended = means(color)
        blended[..., 3] = 1 - blended[..., 3]
        as_light = wanted.features.linear
        shown, slack = (encoded(blended), rounding_of(bound, True)) if as_light else (blended, bound)
        if getattr(test.options, "max_error", None) is not None:
            skipped = result.map(ERROR_BOUND)  # with what rounding may do
            hidden = means(np.maximum(MAX_ERROR, lost(stack, technique, test.options)))
            most = error_of(hidden + LAYERS * ROUNDING, as_light)  # it is a product of float32
            found.expect("error_bound", skipped, np.zeros_like(shown[..., 0]), most + result.rounding)
            slack = slack + skipped
            bound = bound + (linear(skipped) if as_light else skipped)
        found.expect("colour", result.color, shown, slack[..., None])
        found.image(result.image, blended, test.given["background"], bound, as_light)
    for name, wished in maps.items():
        # The marks of a mean say whether any sample has one.
        target = means(wished) if name != "unpaired" else (means(wished) > 0).astype(np.float64)
        slack = np.full((height, width), length_bound(test) if name == "thickness" else 0.0)
        found.expect(name, result.map(name), target, slack)
    if test.request.picture.layers:
        if wanted.features.linear:  # layers are as they are shown
            sized = test.size, test.request.opaque_first, pattern
            stack = stack_of(replace(wanted, features=replace(wanted.features, linear=False)), *sized)
        _compare_layers(found, result, stack, test)
    if not found.wrong and not found.inexact:
        return "right", ""
    if found.wrong or not lacking:
        return "wrong", found.wrong or found.inexact
    return "close", lacking


class _Comparison:
    """Collects what differs. wrong: beyond what rounding can do. inexact: where no rounding should change a bit."""

    def __init__(self) -> None:
        self.wrong = ""
        self.inexact = ""

    def expect(self, name: str, got: NDArray[Any], want: Floats, bound: Floats | float) -> None:
        """Compares arrays [height, width, ...]. Where the bound is 0, bits must be equal, but may be close."""
        error = np.abs(np.where(np.isfinite(got), got, np.inf) - want)
        bound = np.broadcast_to(bound, error.shape)
        exact = bound == 0
        self._note(np.asarray(error > np.where(exact, CLOSE, bound)), name, got, want, wrong=True)
        self._note(exact & (error > 0), name, got, want, wrong=False)

    def image(
        self, image: NDArray[np.uint8], color: Floats, background: Background | None, bound: Floats, as_light: bool
    ) -> None:
        """Compares the 8-bit picture with what a colour, premultiplied and with alpha, becomes over the background.

        The sum or quotient and the product with 255 are off by 4 roundings of 255 more. A quotient's error weighs the
        more the smaller alpha is. as_light: whether the colour is linear.
        """
        alpha = color[..., 3:]
        if background is None:
            straight = np.divide(color[..., :3], alpha, out=np.zeros_like(color[..., :3]), where=alpha > 0)
            shown = np.concatenate([straight, alpha], axis=-1)
            slack = 2 * bound[..., None] / np.maximum(alpha, ROUNDING) + 4 * ROUNDING
        else:
            behind = rows_of(background, len(color))
            behind = linear(behind) if as_light else behind
            shown = np.concatenate([color[..., :3] + (1 - alpha) * behind, np.ones_like(alpha)], axis=-1)
            slack = 2 * bound[..., None] + 4 * ROUNDING
        ends = [shown - slack, shown + slack]
        if as_light:
            for end, sign in zip(ends, (-ENCODING, ENCODING), strict=True):
                end[..., :3] = srgb(np.clip(end[..., :3], 0, 1)) + sign
            shown = np.concatenate([srgb(np.clip(shown[..., :3], 0, 1)), shown[..., 3:]], axis=-1)
        low, high = (np.clip(np.floor(end * 255 + 0.5), 0, 255) for end in ends)
        self._note((image < low) | (image > high), "8-bit colour", image, np.clip(shown, 0, 1) * 255, wrong=True)

    def _note(self, bad: NDArray[np.bool_], name: str, got: NDArray[Any], want: Floats, *, wrong: bool) -> None:
        if (self.wrong if wrong else self.inexact) or not bad.any():
            return
        pixel = tuple(int(place) for place in np.argwhere(bad)[0][:2])
        values, wished = (", ".join(f"{value:.7g}" for value in np.atleast_1d(each[pixel])) for each in (got, want))
        pixels = bad.reshape(*bad.shape[:2], -1).any(axis=2)
        text = f"{name} {values} in place of {wished} in {pixels.sum()} of {pixels.size} pixels"
        if wrong:
            self.wrong = text
        else:
            self.inexact = text


def encoded(color: Floats) -> Floats:
    """What a linear colour, premultiplied and with alpha, becomes without a background: alpha times straight sRGB."""
    return converted(color, lambda straight: srgb(np.clip(straight, 0, 1)))


CLOSE = 16 * ROUNDING
"""How far off exact colours may be on a device that does not round correctly: a few operations of one more rounding."""


def color_bound(stack: Stack, test: _Test) -> Floats:
    """How far off each sample's colour may be: [samples]. 0 where all numbers are exact in float32.

    A layer's own error e changes the picture by 2 e at most, as a C + (1 - a) B has the derivatives a and C - B.
    weighted-average also divides by the sum: 3 e. Sums go beyond 1, up to the number of layers, and so do their
    roundings. Buffers of few bytes round each blend. The sums' 2.5 roundings a layer stay below blending_bound, which
    has one more layer.
    """
    features, precision = test.wanted.features, getattr(test.options, "precision", DEFAULT_PRECISION)
    layers = stack.present.sum(axis=1)
    exact = not (features.packed_color or features.fragment_color or features.linear) and precision == DEFAULT_PRECISION
    own = 0.0
    if features.fragment_color:
        own = (COLOR_ROUNDINGS + (LIGHT_ROUNDINGS if features.headlight else 0)) * ROUNDING
        own += MATERIAL_ROUNDINGS * ROUNDING if features.materials else 0.0
        own += LIGHTS_ROUNDINGS * ROUNDING if features.lights else 0.0
        own = LINEAR_SLOPE * (own + LINEAR_ROUNDINGS * ROUNDING) if features.linear else own
    blends = np.array([blending_bound(count + 1, precision) for count in range(LAYERS + 1)])[layers]
    bound = (3 * own * layers + blends) * np.where(test.request.technique.sorts, 1, np.maximum(layers, 1))
    if test.request.technique.name == "translucency":
        # The light from behind changes by its extinction times the error of the length, and exp rounds a few times.
        return bound + OPTICAL_MOST * length_bound(test) + 16 * ROUNDING
    if test.request.technique.name == "weighted-blended":
        # Sums are as large as weights are, and half rounds them by 2^-11 of themselves.
        return 2 * bound + np.where(layers > 1, WEIGHT_ROUNDINGS, 8) * ROUNDING
    if test.request.technique.name == "stochastic":
        # Alpha correction divides by the foremost alpha at least, 1/4. Where a mask is in doubt nothing is known.
        return np.where(masks(stack, test.options).doubtful & features.fragment_color, float(LAYERS), 4 * bound)
    if test.request.technique.name == "moments":
        return np.where(layers > 1, bound + MOMENTS_SLACK, bound + 16 * ROUNDING)
    if test.request.technique.name == "wavelet":
        return bound + _wavelet_bound(stack, test)
    layers = np.maximum(layers - getattr(test.options, "kept_layers", 0), 0)
    if test.request.technique.name == "adaptive":
        # An area is off by the errors of a height times FAR, and of a length. Where areas are closer, any of the steps
        # may be moved.
        clear = compressed(stack, test.options)[2]
        bound = np.where(clear > 4 * (FAR * bound + length_bound(test)), bound, 1.0)
    dyadic = (layers & (layers - 1)) == 0  # numbers of layers that divide exactly
    return np.where(exact & dyadic, 0.0, bound)


def _wavelet_bound(stack: Stack, test: _Test) -> Floats:
    """How far off the mean colour of wavelet is: [samples].

    If the absorbances before layers are off by d, so are the weights, as shares, and the mean is off by 2 d. From cell
    to cell an absorbance grows by S at most, the sum of all. So d is S times the error of a place in cells, and a
    rounding of S for each addend. Buffers of few bytes round five wavelets a layer, of which each counts once. They
    also round the sum of the weights. It is at least the nearest layer's alpha, or e^-S of it where others may hide it.
    """
    rank, in_scene = getattr(test.options, "wavelet_rank", 3), getattr(test.options, "wavelet_range", "") == "scene"
    cells, layers = 2 << rank, stack.transparent.sum(axis=1)
    alpha = np.where(stack.transparent, stack.color[..., 3], 0.0)
    absorbed = -np.log(np.maximum(1 - alpha, 2.0**-17)).sum(axis=1)
    first, end = (each[:, 0] for each in wavelet_range(stack, test.options))
    place = np.where(end > first, cells * 2 * length_bound(test) / np.maximum(end - first, CLOSE), 0.0)
    rounding = PRECISIONS[getattr(test.options, "precision", DEFAULT_PRECISION)].rounding
    off = absorbed * (place + (layers + cells + 16) * ROUNDING)
    off += 5 * layers * rounding * np.maximum(absorbed, 1)
    least = np.maximum(alpha[:, 0], 1 / 255) * np.exp(-absorbed * in_scene)
    return np.where(layers > 0, 2 * off + 2 * layers * rounding / least + 16 * ROUNDING, 0.0)


WEIGHT_ROUNDINGS = 512
"""How far off weights make a mean, in roundings: twice their own error, as they are above and below the line.

The greatest is that of z^6 or (1 - d)^3. A depth is off by 16 roundings, and a power by its exponent times that. 1 - d
is the difference of two numbers of which the greater is at most twice as large, as known layers lie in the nearer half.
"""

MOMENTS_SLACK = 1 / 32
"""How far off moments make a picture of known layers. A few layers leave their matrix nearly singular. It is 1 / 75 at
most, with 4 quantized moments, where one lies next to the middle of two steps."""

OPTICAL_MOST = 6.0
"""At least the extinction of the known layers by default: OPTICAL_DIAGONAL over a diagonal that is longer than 1."""


def length_bound(test: _Test) -> float:
    """How far off a length may be. A depth's rounding changes its distance d by d^2 / near of that."""
    roundings = DEPTH_ROUNDINGS
    if test.wanted.features.depth_format != DEPTH_FORMATS[0]:
        roundings += 4  # stored as window depths, the coarsest of which has steps of 2^-24
    return 2 * roundings * ROUNDING * FAR * FAR / NEAR


def _compare_layers(found: _Comparison, result: Result, stack: Stack, test: _Test) -> None:
    """Compares the layers that peeling finds: numbers of faces, colours and distances."""
    kept = peeled(stack, test.request.technique, test.options)
    kept = kept | stack.opaque if test.request.opaque_first else kept
    width, height = test.size
    got = result.layers
    count = np.diff(got.start).reshape(height, width)
    found.expect("layers", count, kept.sum(axis=1).astype(np.float64).reshape(height, width), 0.0)
    if found.wrong:
        return
    for k in range(got.count):
        color, depth, face = got.layer(k)
        place = np.argmax(np.cumsum(kept, axis=1) > k, axis=1)
        some = (kept.sum(axis=1) > k).reshape(height, width)

        def at(values: NDArray[Any], place: NDArray[np.int64] = place) -> NDArray[Any]:
            taken = np.take_along_axis(values, place.reshape(-1, *[1] * (values.ndim - 1)), axis=1)[:, 0]
            return taken.reshape(height, width, *values.shape[2:])

        roundings = COLOR_ROUNDINGS + LIGHT_ROUNDINGS + (MATERIAL_ROUNDINGS if test.wanted.features.materials else 0)
        roundings += LIGHTS_ROUNDINGS if test.wanted.features.lights else 0
        found.expect("layer's face", np.where(some, face, 0), np.where(some, at(stack.face), 0).astype(np.float64), 0.0)
        found.expect("layer's colour", color, at(stack.color) * some[..., None], roundings * ROUNDING)
        bound = length_bound(test)
        found.expect("layer's depth", np.where(some, depth, 0), np.where(some, at(stack.distance), 0), bound)
