"""moments: the paper's equations by matrices and roots in float64, the bounds of the theory, extremes, and any order.

Moments of few layers are those of a nearly singular matrix, which the paper's bias keeps from being one. What float32
makes of them is bounded by what moments do that are off by some roundings (`twin_and_bound`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD

import clpeel

pytestmark = pytest.mark.usefixtures("shared_devices")

KINDS = ("4", "6", "8", "trigonometric")
POWERS = KINDS[:3]
NEAR, FAR = 0.5, 8.0  # of AHEAD
CLAMP = 17 * np.log(2)  # the absorbance of what is opaque
ARC = np.pi / 10  # the wrapping zone

# The supplement's biases: how much, and the even moments that are mixed in.
BIAS: dict[str, tuple[float, tuple[float, ...]]] = {
    "4": (5e-7, (0.375, 0.375)),
    "6": (5e-6, (0.48, 0.451, 0.45)),
    "8": (5e-5, (0.75, 0.6766666667, 0.63, 0.6003030303)),
    "trigonometric": (4e-7, (0.0, 0.0)),
}


# --- the twin ---------------------------------------------------------------------------------------------------------
def points(place: np.ndarray, kind: str) -> np.ndarray:
    """What depths are in moments: themselves, or points of the circle."""
    return np.exp(1j * (place + 1) * (np.pi - ARC / 2)) if kind == "trigonometric" else place.astype(complex)


def order_of(kind: str) -> int:
    return 2 if kind == "trigonometric" else int(kind) // 2


def moments_of(absorbance: np.ndarray, place: np.ndarray, kind: str) -> np.ndarray:
    """Moments 0 to 2 n (of the circle, to n), with the bias."""
    count = 2 if kind == "trigonometric" else int(kind)
    b = (absorbance[:, None] * points(place, kind)[:, None] ** np.arange(count + 1)).sum(axis=0) / absorbance.sum()
    amount, even = BIAS[kind]
    target = np.zeros(count + 1, complex)
    if kind != "trigonometric":
        target[2::2] = even
    b[1:] = (1 - amount) * b[1:] + amount * target[1:]
    return b


def share(b: np.ndarray, place: float, kind: str, overestimation: float) -> float:
    """How much lies in front: of masses that have these moments, one of them at the depth (algorithms 1 and 2)."""
    n = order_of(kind)
    point = points(np.array(place), kind)
    if kind == "trigonometric":
        matrix = np.array([[b[j - k] if j >= k else b[k - j].conj() for k in range(n + 1)] for j in range(n + 1)])
    else:
        matrix = np.array([[b[j + k] for k in range(n + 1)] for j in range(n + 1)])
    coefficients = np.linalg.solve(matrix.T, (point ** np.arange(n + 1)).conj())
    nodes = np.append(point, np.roots(coefficients[::-1]))
    masses = np.linalg.solve(np.vander(nodes, n + 1, increasing=True).T, b[: n + 1]).real
    if kind != "trigonometric":
        before = (nodes.real < place).astype(float)
    else:
        angle = np.angle(nodes) % (2 * np.pi)
        begin = np.cos(ARC) - np.sin(ARC)
        ramp = (np.cos(angle) + np.sin(angle) - begin) / (1 - begin)
        before = (angle < (place + 1) * (np.pi - ARC / 2)) + np.where(angle > 2 * np.pi - ARC, ramp, 0)
    before[0] = overestimation
    return float(masses @ before)


def blended(
    b: np.ndarray, absorbance: np.ndarray, place: np.ndarray, colors: np.ndarray, kind: str, overestimation: float
) -> np.ndarray:
    """The picture of these moments: premultiplied RGBA."""
    total = absorbance.sum()
    hidden = np.array([share(b, each, kind, overestimation) for each in place])
    weight = colors[:, 3] * np.exp(-total * (hidden - hidden.min()))
    coverage = -np.expm1(-total)
    return np.append(weight @ colors[:, :3] / weight.sum() * coverage, coverage)


def twin_and_bound(
    away: np.ndarray, colors: np.ndarray, kind: str, overestimation: float = 0.25, roundings: float = 8
) -> tuple[np.ndarray, float]:
    """The picture of layers in float64; and how far off it may be if moment k is off by k times so many roundings.

    A place is off by some roundings, as its depth has up to 12 and a logarithm has its own, times 2 / ln 16. Its k-th
    power is off by k times as many. Twice the sum of what moments do one by one leaves room for what they do together.
    Solving for masses rounds as well. Where there are fewer layers than masses, that is worth some of the bias.
    """
    colors = colors.astype(np.float32).astype(float)
    place = 2 * np.log(away / NEAR) / np.log(FAR / NEAR) - 1
    absorbance = np.minimum(-np.log1p(-np.minimum(colors[:, 3], 1 - 2.0**-30)), CLAMP)
    b = moments_of(absorbance, place, kind)
    want = blended(b, absorbance, place, colors, kind, overestimation)
    moved = 0.0
    for k in range(1, len(b)):
        for unit in (1, 1j) if kind == "trigonometric" else (1,):
            ends = [b + unit * sign * roundings * k * UNIT * (np.arange(len(b)) == k) for sign in (-1, 1)]
            off = [np.abs(blended(each, absorbance, place, colors, kind, overestimation) - want).max() for each in ends]
            moved += max(off)
    return want, 2 * moved + 8 * BIAS[kind][0] + (32 + len(away)) * UNIT


def layers(seed: int, count: int, most: float = 0.9) -> tuple[np.ndarray, np.ndarray]:
    """Distances and straight RGBA of random layers that are not next to each other, in random order."""
    rng = np.random.default_rng(seed)
    away = rng.permutation(np.geomspace(0.6, 7.5, count) * rng.uniform(1, 1.02, count))
    colors = rng.random((count, 4)) * [1, 1, 1, most]
    return away, colors


def render(away: Any, colors: Any, lanes: int = 1, **options: Any) -> np.ndarray:
    """One pixel's premultiplied RGBA of a stack that fills the view."""
    scene = soups.stack(away, np.asarray(colors, np.float32)).scene()
    got = plainly.render(scene, AHEAD.camera(), (5, 3), "moments", lanes=lanes, opaque="blend", **options).color
    assert (got == got[0, 0]).all()
    return got[0, 0].astype(float)


# --- against the twin -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 40])
def test_the_equations_of_the_paper(kind: str, count: int, lanes: int) -> None:
    for seed in range(3):
        away, colors = layers(100 * count + seed, count)
        for overestimation in (0.0, 0.25, 1.0):
            want, bound = twin_and_bound(away, colors, kind, overestimation)
            got = render(away, colors, lanes, moments=kind, overestimation=overestimation)
            assert np.abs(got - want).max() <= bound
            assert bound < 0.05, "so much is allowed that nothing is tested"


@given(seed=st.integers(0, 2**16), count=st.integers(1, 30), kind=st.sampled_from(KINDS))
def test_random_layers(seed: int, count: int, kind: str) -> None:
    away, colors = layers(seed, count)
    want, bound = twin_and_bound(away, colors, kind)
    assert np.abs(render(away, colors, moments=kind) - want).max() <= bound


@pytest.mark.parametrize("kind", KINDS)
def test_16_bits_are_moments_that_are_off_by_half_a_step(kind: str, lanes: int) -> None:
    """With the bias of 16 bits. Mixing spreads half a step of 2^-16 over moments, by a factor of up to 4."""
    away, colors = layers(5, 12)
    exact = render(away, colors, lanes, moments=kind)
    got = render(away, colors, lanes, moments=kind, moment_precision="quantized")
    _, bound = twin_and_bound(away, colors, kind, roundings=4 * 2.0**8)
    assert 0 < np.abs(got - exact).max() <= bound + 0.01
    assert got[3] == exact[3]


def test_mixing_fills_sixteen_bits_and_comes_back() -> None:
    """Moments of single depths, which are the corners of all there are, are from 0 to 1 when they are stored."""
    from clpeel.techniques.moments import MIXINGS

    depth = np.linspace(-1, 1, 1001)
    for kind, mixing in MIXINGS.items():
        n = int(kind) // 2
        for first, matrix in enumerate((np.array(mixing.odd), np.array(mixing.even))):
            b = depth[:, None] ** np.arange(first + 1, 2 * n + 1, 2)
            stored = b @ matrix.T + mixing.offsets[first::2]
            assert -1e-6 <= stored.min() < 0.05 and 0.95 < stored.max() <= 1 + 1e-6, kind
            # A step of 2^-16 is a few of them after mixing back: that is what mixing is for.
            assert np.abs(np.linalg.inv(matrix)).sum(axis=1).max() < 5


# --- the kernels' functions, each by itself ---------------------------------------------------------------------------
Call = Callable[..., np.ndarray]


@pytest.fixture
def kernel(opened: Callable[..., Any]) -> Callable[[str, dict[str, int]], Call]:
    """kernel(statement, constants)(values...) runs a statement that sets `result` from float16 vectors a, b, ..."""
    import pyopencl as cl

    from clpeel.device.layout import Features
    from clpeel.device.program import CORRECTLY_ROUNDED, source

    def make(statement: str, constants: dict[str, int]) -> Call:
        gpu = opened(lanes=1)

        def call(*values: np.ndarray) -> np.ndarray:
            names = [chr(ord("a") + k) for k in range(len(values))]
            given = "".join(f"global const float16 *all_{name}, " for name in names)
            load = "".join(f"float16 {name} = all_{name}[item];" for name in names)
            text = source("techniques/moments.cl") + (
                f"kernel void test_it({given}global float16 *results) {{ int item = get_global_id(0); {load}"
                f"float16 result; {statement} results[item] = result; }}"
            )
            options = [*Features(1, "face").options(), CORRECTLY_ROUNDED, "-w"]
            options += [f"-D{name}={value}" for name, value in constants.items()]
            built = cl.Program(gpu.context, text).build(options=options)
            count = len(values[0])
            padded = [np.resize(value.astype(np.float32), -(-count // 16) * 16) for value in values]
            held = [gpu.put(f"moments_{k}", value) for k, value in enumerate([*padded, np.zeros_like(padded[0])])]
            cl.Kernel(built, "test_it")(gpu.queue, (len(padded[0]) // 16,), None, *held)
            return np.asarray(gpu.get(held[-1], len(padded[0]), np.float32)[:count]).astype(float)

        return call

    return make


def test_the_logarithm(kernel: Any) -> None:
    x = np.r_[1.0, np.nextafter(np.float32(1), 0), np.exp2(-np.linspace(1e-6, 40, 5000))].astype(np.float32)
    got, want = kernel("result = minus_logarithm(a);", {})(x), -np.log(x.astype(float))
    assert (np.abs(got - want) <= 2.0**-21 * want + UNIT * np.ceil(want / np.log(2))).all()
    assert got[0] == 0


def test_what_is_covered(kernel: Any) -> None:
    x = np.r_[0.0, np.exp2(-np.linspace(-6, 40, 4000))].astype(np.float32)
    got, want = kernel("result = covered_by(a);", {})(x), -np.expm1(-x.astype(float))
    assert (np.abs(got - want) <= 8 * UNIT * want).all()


def test_sines_and_cosines(kernel: Any) -> None:
    place = np.linspace(-1, 1, 4001).astype(np.float32)
    want = np.exp(1j * (place.astype(float) + 1) * (np.pi / 2 - ARC / 4))
    for part, wanted in (("re", want.real), ("im", want.imag)):
        got = kernel(f"Complex half_way; midway_to(a, &half_way); result = half_way.{part};", {"TRIGONOMETRIC": 1})(
            place
        )
        assert np.abs(got - wanted).max() <= 6 * UNIT


def test_roots_of_polynomials_with_real_roots(kernel: Any) -> None:
    """The value at a found root is what rounding makes of the coefficients: a root of a polynomial next to this one."""
    rng = np.random.default_rng(3)
    for n in (3, 4):
        roots = rng.choice([-1, 1], (2000, n)) * 10 ** rng.uniform(-3, 2, (2000, n))
        a = np.array([np.poly(each)[1:] for each in roots]).astype(np.float32).T
        names = "abcd"[:n]
        for k in range(n):
            text = f"float16 all[ROOTS] = {{{', '.join(names)}}}, x[ROOTS]; real_roots(all, x); result = x[{k}];"
            x = kernel(text, {"MOMENTS": 2 * n})(*a)
            value, size = np.ones_like(x), np.ones_like(x)
            for each in a.astype(float):
                value, size = value * x + each, size * np.abs(x) + np.abs(each)
            assert np.quantile(np.abs(value) / size, 0.999) <= 4 * n * UNIT
            assert (np.abs(value) / size).max() <= 64 * n * UNIT  # where two roots are next to each other


@pytest.mark.parametrize("kind", POWERS)
def test_the_bounds_of_the_theory(kind: str, kernel: Any) -> None:
    """What is in front of a depth is at least what overestimation 0 says, and at most what 1 says, up to the bias."""
    n, amount = order_of(kind), BIAS[kind][0]
    rng = np.random.default_rng(int(kind))
    rows: list[list[float]] = []
    truth: list[tuple[float, float]] = []
    for _ in range(300):
        count = int(rng.integers(1, 30))
        place, absorbance = rng.uniform(-1, 1, count), rng.random(count) ** 3 + 1e-3
        b = moments_of(absorbance, place, kind).real[1:]
        for depth in [*rng.choice(place, 2), rng.uniform(-1, 1)]:
            at = np.float32(depth)
            below, above = (absorbance[test].sum() / absorbance.sum() for test in (place < depth, place <= depth))
            rows.append([at, *b])
            truth.append((below, above))
    values = np.array(rows).T
    below, above = np.array(truth).T
    names = [chr(ord("b") + k) for k in range(2 * n)]
    for overestimation in (0, 1):
        text = f"float16 all[MOMENTS] = {{{', '.join(names)}}}; Curve curve; find_curve(all, &curve);"
        got = kernel(f"{text} result = share_before(&curve, a, {overestimation}.0f);", {"MOMENTS": 2 * n})(*values)
        # Rounded depths lie on either side of their masses, so what is there counts for the bound that it widens.
        slack = amount + 2.0**-10
        wrong = got > above + slack if overestimation == 0 else got < below - slack
        assert not wrong.any(), overestimation
        tight = np.abs(got - (below if overestimation == 0 else above))
        assert np.median(tight) < 0.2


# --- any order --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_bits_in_any_order(kind: str, lanes: int) -> None:
    """Of triangles that lie at the same depth, too."""
    rng = np.random.default_rng(8)
    away = np.repeat([1.0, 2.0, 5.0], 15)
    colors = rng.random((45, 4))
    pictures = [
        render(away[order], colors[order], lanes, moments=kind) for order in (rng.permutation(45) for _ in range(4))
    ]
    assert all((picture == pictures[0]).all() for picture in pictures)


@pytest.mark.parametrize("options", [{"moments": kind} for kind in KINDS] + [{"moment_precision": "quantized"}])
def test_the_same_bits_on_both_shapes(options: dict[str, Any], judge: Any) -> None:
    soup = soups.random(9, 300, "mixed", "flat")
    for precision in ("float32", "half", "unorm8"):
        one, other = (
            plainly.render(
                soup.scene(), soups.BENCH.camera(), (40, 30), "moments", lanes=n, precision=precision, **options
            )
            for n in (1, 64)
        )
        judge.same_bits(one, other, f"{options} {precision}")


# --- extremes ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", KINDS)
def test_one_layer_is_exact(kind: str, lanes: int) -> None:
    for alpha in (2.0**-25, 1 / 255, 0.5, 0.999):
        got = render([2.0], [(0.3, 0.7, 1.0, alpha)], lanes, moments=kind)
        want = np.array([0.3, 0.7, 1.0]) * np.float32(alpha)
        assert np.abs(got[:3] - want).max() <= 2.0**-20 * alpha
        assert abs(got[3] - alpha) <= 4 * UNIT


@pytest.mark.parametrize("kind", KINDS)
def test_alphas_of_0_and_1(kind: str, lanes: int) -> None:
    assert not render([1.0, 2.0, 3.0], [(1, 1, 1, 0.0)] * 3, lanes, moments=kind).any()
    # What is opaque lets 2^-17 through.
    got = render([2.0], [(1, 0.5, 0, 1.0)], lanes, moments=kind)
    assert np.abs(got - [1, 0.5, 0, 1]).max() <= 2.0**-17 + 4 * UNIT
    # A clear layer in front changes nothing, wherever it lies.
    away, colors = layers(3, 6)
    clear = render([0.55, *away], [(1, 1, 1, 0.0), *colors], lanes, moments=kind)
    assert (clear == render(away, colors, lanes, moments=kind)).all()
    # What lies behind an opaque layer is hidden, but for what the moments leave.
    got = render([1.0, 5.0], [(1, 0, 0, 1.0), (0, 1, 0, 0.5)], lanes, moments=kind, overestimation=0.0)
    assert got[1] < 2.0**-10 and got[0] > 1 - 2.0**-9


@pytest.mark.parametrize("kind", KINDS)
def test_thousands_of_layers(kind: str, lanes: int) -> None:
    count = 3000
    for alpha in (2.0**-25, 1e-4, 0.5, 0.999):
        got = render(np.linspace(1, 7, count), np.tile([0.5, 0.25, 1, alpha], (count, 1)), lanes, moments=kind)
        want = np.array([0.5, 0.25, 1, 1]) * -np.expm1(count * np.log1p(-float(np.float32(alpha))))
        assert np.abs(got - want).max() <= 2.0**-20
    # The foremost layers are seen where e^-b0 is nothing that float32 has.
    red = np.tile([0.0, 0, 1, 0.9], (count, 1))
    red[:100] = (1, 0, 0, 0.9)
    got = render(np.linspace(1, 7, count), red, lanes, moments=kind)
    assert got[0] > 0.98 and got[0] + got[2] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_range_of_ten_millions(kind: str, lanes: int) -> None:
    view = soups.Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(1e-3, 1e4))
    colors = np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.5)])
    scene = soups.stack([2e-3, 1.0, 5e3], colors).scene()
    got = plainly.render(scene, view.camera(), (3, 2), "moments", lanes=lanes, moments=kind, overestimation=0.0).color
    # Three layers far apart are what 6 moments tell exactly.
    if kind in ("6", "8"):
        assert np.abs(got - [0.5, 0.25, 0.125, 0.875]).max() < 2e-3
    assert np.abs(got[..., 3] - 0.875).max() <= 4 * UNIT


def test_nothing_in_view(lanes: int) -> None:
    scene = soups.stack([9.0], (1.0, 1.0, 1.0, 0.5)).scene()  # behind the far plane
    for kind in KINDS:
        assert not plainly.render(scene, AHEAD.camera(), (4, 3), "moments", lanes=lanes, moments=kind).color.any()


def test_parallel_projection_and_coarse_depths(lanes: int) -> None:
    """Depths are linear there, and any format of depths gives the same but for its own rounding."""
    view = soups.Eye((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), clipping_range=(1.0, 8.0), orthographic=True)
    colors = np.random.default_rng(2).random((8, 4))
    scene = soups.stack(np.linspace(1.5, 7.5, 8), colors).scene()
    exact = plainly.render(scene, view.camera(), (3, 2), "sort", lanes=lanes).color
    for depth_format in ("float32-reversed", "float32", "unorm24", "rgba8"):
        for kind in KINDS:
            got = plainly.render(
                scene, view.camera(), (3, 2), "moments", lanes=lanes, moments=kind, depth_format=depth_format
            )
            assert np.abs(got.color - exact).max() < 0.1


# --- how bad it gets --------------------------------------------------------------------------------------------------
WORST = {
    2: (0.0, 0.039, 0.006, 0.0),
    5: (0.046, 0.018, 0.0, 0.077),
    20: (0.138, 0.104, 0.073, 0.218),
    100: (0.232, 0.198, 0.175, 0.321),
}
"""The table of docs/techniques.md: layers, and the errors of KINDS."""


def worst(count: int, kind: str) -> float:
    """The greatest error of a channel in 20 stacks of random layers of alpha 1/2, beside sort."""
    found = 0.0
    for seed in range(20):
        away, colors = layers(seed, count)
        colors[:, 3] = 0.5
        exact = plainly.render(soups.stack(away, colors).scene(), AHEAD.camera(), (2, 2), "sort").color[0, 0]
        found = max(found, float(np.abs(render(away, colors, moments=kind) - exact).max()))
    return found


@pytest.mark.parametrize("count", WORST)
def test_the_errors_that_the_page_names(count: int) -> None:
    assert [round(worst(count, kind), 3) for kind in KINDS] == [pytest.approx(each, abs=2e-3) for each in WORST[count]]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"moments": "5"}, "moments: expected one of 4, 6, 8, trigonometric; got '5'"),
        ({"moments": 4}, "moments: expected one of 4, 6, 8, trigonometric; got 4"),
        ({"moment_precision": "half"}, "moment_precision: expected one of single, quantized; got 'half'"),
        ({"overestimation": 1.5}, "overestimation: expected 0..1, got"),
        ({"overestimation": float("nan")}, "overestimation: expected 0..1, got"),
        ({"layers": True}, "layers"),
    ],
)
def test_values_that_it_does_not_take(options: dict[str, Any], said: str) -> None:
    with pytest.raises(clpeel.InputError) as error:
        render([1.0], [(1, 1, 1, 0.5)], **options)
    assert said in str(error.value) and "\n" not in str(error.value)
