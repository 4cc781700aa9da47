"""auto: whatever it chooses keeps to the error; it needs no look at what is simple, and knows what memory holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import plainly
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import soups
from twins.reference import UNIT
from twins.soups import AHEAD, BENCH

import clpeel
from clpeel.command import main as cli
from clpeel.rendering import auto
from clpeel.rendering.auto import error_for_8_bits, layers_seen
from clpeel.scene.scene import OpticalDepths
from clpeel.stages.counting import LOOKED_AT, count_layers, look_at_some
from clpeel.stages.frame import float32_below
from clpeel.stages.projection import project
from clpeel.stages.upload import upload
from clpeel.techniques import TECHNIQUES, option_names
from clpeel.techniques.precision import blending_bound

pytestmark = pytest.mark.usefixtures("shared_devices")

VARIANTS = [(technique, variant) for technique in TECHNIQUES.values() for variant in technique.variants()]

left_out = TECHNIQUES["weighted-sum"].error_without_order


@pytest.fixture
def looking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets auto look at small scenes, too."""
    monkeypatch.setattr(auto, "FEW_RECORDS", 1)


def chosen(result: Any) -> tuple[str, dict[str, Any]]:
    """The technique of a result and what tells it apart."""
    told = result.stats["auto"]["explanation"][0].removeprefix("auto chose ").partition(", in float32")[0]
    return next(
        (technique.name, dict(variant.given())) for technique, variant in VARIANTS if technique.label(variant) == told
    )


@pytest.mark.usefixtures("looking")
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 150),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    colors=st.sampled_from(["flat8", "vertex"]),
    alpha=st.sampled_from([(0.1, 0.95), (0.001, 0.004), (0.9, 1.0)]),
    error=st.sampled_from([None, 0.0, 1 / 255, 0.1, 1.0]),
    opaque=st.booleans(),
)
def test_whatever_is_chosen_keeps_to_the_error(
    seed: int, count: int, size: tuple[int, int], colors: str, alpha: Any, error: float | None, opaque: bool
) -> None:
    soup = soups.random(seed, count, "large", colors, alpha=alpha)
    if opaque and soup.face_colors is not None:
        soup.face_colors[::7, 3] = 255
    scene, call = soup.scene(), {"camera": BENCH.camera(), "size": size}
    truth = plainly.render(scene, lanes=1, **call)
    rounding = blending_bound(truth.stats["layers_max"] + 1)
    for lanes in (1, 64):
        got = plainly.render(scene, technique="auto", max_error=error, lanes=lanes, **call)
        off = np.abs(got.color.astype(float) - truth.color).max(axis=2)
        assert (off <= got.error_bound + rounding).all()
        kept = got.stats["auto"]["max_error"]
        assert kept == float32_below(error) if error is not None else 0 < kept < 1 / 255
        assert (got.error_bound <= kept + blending_bound(count + 1)).all()
        if error is None:
            assert np.abs(got.image.astype(int) - truth.image).max() <= 1
        name, variant = chosen(got)
        assert got.stats["technique"] == name
        if TECHNIQUES[name].exact:  # it is what it says, to the bit
            same = plainly.render(scene, technique=name, max_error=kept, lanes=lanes, **variant, **call)
            assert (same.color == got.color).all() and (same.image == got.image).all()


def test_an_8_bit_value_is_off_by_one_step_at_most() -> None:
    """Colours within 1 / 255, rounding and all, are rounded to steps that are one apart at most."""
    for layers in (1, 100, 5000):
        assert error_for_8_bits(layers) + blending_bound(layers) == pytest.approx(1 / 255, rel=1e-12)
    assert error_for_8_bits(50_000) == 0


@pytest.mark.parametrize(("count", "technique"), [(9, "weighted-sum"), (60, "sort")])
@pytest.mark.usefixtures("looking")
def test_sums_where_nothing_can_be_seen_of_the_order(count: int, technique: str, lanes: int) -> None:
    """Of layers of 1/255, 9 sum to within 36 / 255^2 of the truth, which is below 1/255; 60 do not."""
    scene = soups.stack(np.linspace(1, 7, count), [1.0, 0.5, 0.0, 1 / 255]).scene()
    got = plainly.render(scene, AHEAD.camera(), (32, 32), "auto", lanes=lanes)
    names = [got.stats["technique"], *got.stats["auto"]["alternatives"]]
    assert ("weighted-sum" in names) == (technique == "weighted-sum")
    if got.stats["technique"] == "weighted-sum":
        assert (got.error_bound >= left_out(count, 1 / 255)).all() and got.stats["truncated_pixels"] == 0


@given(seed=st.integers(0, 10**6), count=st.integers(1, 30), most=st.floats(0.001, 0.2))
def test_what_a_sum_is_off_by(seed: int, count: int, most: float) -> None:
    rng = np.random.default_rng(seed)
    colors = rng.random((count, 4)) * [1, 1, 1, most]
    scene, call = soups.stack(np.linspace(1, 7, count), colors).scene(), {"camera": AHEAD.camera(), "size": (2, 2)}
    for background in ((1.0, 1.0, 1.0), (0.0, 0.5, 1.0)):
        over = [
            result.color[..., :3] + (1 - result.color[..., 3:].astype(float)) * background
            for result in (plainly.render(scene, technique=name, **call) for name in ("sort", "weighted-sum"))
        ]
        bound = left_out(count, float(np.float32(colors[:, 3].max())))
        assert np.abs(over[0] - over[1]).max() <= bound + 2 * (3 * count + 4) * UNIT


def test_opaque_scenes_are_not_looked_at(lanes: int) -> None:
    scene = soups.random(5, 4000, "large", alpha=(1.0, 1.0)).scene()
    renderer = plainly.Renderer(scene, lanes=lanes)
    renderer.gpu.programs.clear()
    got = renderer.render(BENCH.camera(), (300, 200), "auto")
    assert "counting" not in got.stats["seconds"] and got.stats["passes"] == 0 and not got.error_bound.max() > 1e-5
    assert {key[0] for key in renderer.gpu.programs} <= {"stages/setup.cl", "stages/clipping.cl", "stages/opaque.cl"}
    assert "nothing is transparent" in got.stats["auto"]["explanation"][1]


def test_what_is_small_is_not_looked_at(lanes: int) -> None:
    scene = soups.random(5, 40, "large", alpha=(0.2, 0.7)).scene()
    got = plainly.render(scene, BENCH.camera(), (60, 40), "auto", lanes=lanes)
    assert "counting" not in got.stats["seconds"] and got.stats["technique"] == "sort"


def test_a_look_sees_what_there_is(lanes: int, bench: Any) -> None:
    """Its sums are close to those of all tiles; those of the lists are the same."""
    scene, camera, size = bench("boxes").scene(), BENCH.camera(), (512, 512)
    gpu = plainly.Renderer(scene, lanes=lanes).gpu
    whole = count_layers(gpu, upload(gpu, scene), camera, size, True).tiles
    triangles = project(gpu, upload(gpu, scene), camera, size, False, True)
    tiles = clpeel.stages.binning.bin_triangles(gpu, triangles, 1 << 30)
    some = look_at_some(gpu, triangles, next(tiles.batches(1 << 30)))
    assert len(some.records) <= LOOKED_AT < len(whole.records)
    assert some.weights @ some.records == pytest.approx(whole.records.sum(), rel=1e-9)
    for name in ("fragments", "visits"):
        assert some.weights @ some.totals[name] == pytest.approx(whole.totals[name].sum(), rel=0.15)
    assert 0.8 * whole.totals["layers"].max() <= some.totals["layers"].max() <= whole.totals["layers"].max()


def test_layers_that_are_seen() -> None:
    """Of equal alphas: the first n with (1 - a)^n <= E, as in EXTREMES' bounds: 3 of .9, 9 of .5, 60 of .1."""
    for alpha in (0.9, 0.5, 0.3, 0.1, 1 / 255):
        scene = soups.stack([1.0], [1, 1, 1, alpha]).scene()
        depths = scene.optical_depths
        mean, deviation = depths.mean, depths.deviation
        for error in (0.5 / 255, 1 / 255, 1 / 16):
            n = layers_seen(error, mean, deviation)
            through = 1 - float(np.float32(alpha))
            assert deviation == 0 and through**n <= error * (1 + 1e-5) and through ** (n - 1) > error * (1 - 1e-5)
    assert [layers_seen(0.5 / 255, -np.log(1 - a), 0) for a in (0.9, 0.5, 0.1)] == [3, 9, 60]
    assert layers_seen(0.0, 1.0, 0.0) > 10**9 < layers_seen(0.1, 0.0, 0.0)
    assert layers_seen(1.0, 1.0, 0.0) == 1
    # Of mixed ones more than of their mean, as some pixels have less.
    assert layers_seen(1 / 255, 0.5, 0.4) > layers_seen(1 / 255, 0.5, 0.0)
    assert soups.stack([1.0], [1, 1, 1, 1.0]).scene().optical_depths == OpticalDepths(0.0, 0.0, 0.0)


@pytest.mark.usefixtures("looking")
def test_memory_is_what_it_says(lanes: int, bench: Any) -> None:
    """Of the choice and all others, whose pictures are then made: what the device's buffers take."""
    scene, call = bench("boxes", n=6).scene(), {"camera": BENCH.camera(), "size": (256, 256)}
    found: list[auto.Choice] = []
    original = auto.choose_technique
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(auto, "choose_technique", lambda *given: found.append(original(*given)) or found[0])
        renderer = plainly.Renderer(scene, lanes=lanes)
        renderer.gpu.buffers.clear()
        renderer.render(technique="auto", **call)
    choice = found[0]
    assert {other.technique.name for other in choice.others} >= {"depth-peeling", "dual-depth-peeling"}
    for one in (choice.chosen, *choice.others):
        renderer = plainly.Renderer(scene, lanes=lanes)
        renderer.gpu.buffers.clear()
        stats = renderer.render(technique=one.technique.name, **dict(one.options.given()), **call).stats
        taken = sum(size for name, size in stats["bytes"].items() if name != "values")
        assert one.fits and one.nbytes == pytest.approx(taken, abs=16384), one.name  # the look's own, and some numbers


def test_what_memory_does_not_hold_is_peeled(lanes: int) -> None:
    """A pixel of 200,000 fragments, 1.6 MB, and as much to sort them, where the scene leaves 1 MiB."""
    count = 200_000
    soup = soups.stack(np.linspace(1, 7, count), [1.0, 0.5, 0.25, 0.5])
    call: dict[str, Any] = {"camera": AHEAD.camera(), "size": (2, 2), "lanes": lanes, "memory": "1M"}
    call["max_error"] = 1 / 255
    with pytest.raises(clpeel.InputError, match="memory: expected room for the .* fragments of one pixel"):
        plainly.render(soup.scene(), **call)
    got = plainly.render(soup.scene(), technique="auto", **call)
    assert got.stats["technique"] != "sort" and got.stats["passes"] <= 8
    assert np.abs(got.color - [1.0, 0.5, 0.25, 1.0]).max() <= got.error_bound.max()
    assert "not there" in got.stats["auto"]["explanation"][2]


@pytest.mark.usefixtures("looking")
def test_batches_and_layers(lanes: int) -> None:
    """The batch that is looked at is drawn once, as all others; layers are there for the asking."""
    scene = soups.random(9, 15000, "large", alpha=(0.2, 0.6)).scene()
    call: dict[str, Any] = {"camera": BENCH.camera(), "size": (200, 150), "lanes": lanes, "max_error": 0.0}
    want = plainly.render(scene, **call)
    got = plainly.render(scene, technique="auto", memory="1M", layers=True, **call)
    assert got.stats["batches"] > 2 and got.stats["fragments"] == want.stats["fragments"]
    assert (got.color == want.color).all() or got.stats["technique"] == "dual-depth-peeling"
    assert len(got.layers.depth) == want.stats["fragments"]


def test_the_least_estimate_is_chosen(lanes: int, bench: Any) -> None:
    got = plainly.render(bench("grass").scene(), BENCH.camera(), (512, 512), "auto", lanes=lanes, max_error=1 / 255)
    lines = got.stats["auto"]["explanation"]
    assert len(lines) == 3 and all("\n" not in line for line in lines)
    assert "counting" in got.stats["seconds"] and "hide what is behind" in lines[1]
    assert set(option_names("auto")) <= set(option_names(got.stats["technique"]))
    milliseconds = [float(part.rpartition(" ms,")[0].rpartition(" ")[2]) for part in lines[2].split("; ")]
    assert milliseconds == sorted(milliseconds)
    assert float(lines[0].rpartition(" ms,")[0].rpartition(" ")[2]) <= milliseconds[0]


@pytest.mark.parametrize("options", [{"passes": 2}, {"precision": "half"}, {"max_error": 2.0}])
def test_what_cannot_be_is_refused(options: dict[str, Any]) -> None:
    scene = soups.stack([1.0], (1.0, 1.0, 1.0, 0.5)).scene()
    name = next(iter(options))
    with pytest.raises(clpeel.InputError, match=f"^{name}: "):
        plainly.render(scene, AHEAD.camera(), (4, 4), "auto", **options)


def test_the_command(tmp_path: Any, capfd: Any) -> None:
    given = ["demo", "-o", str(tmp_path / "a.png"), "--resolution=48,36", "--samples=1"]
    assert cli.main([*given, "--technique=auto", "--explain"]) == 0
    out, err = capfd.readouterr()
    assert out.startswith("auto chose ") and len(out.splitlines()) == 3 and "note:" not in err
    assert cli.main([*given, "--explain"]) == 2
    assert "--explain: expected --technique auto, whose choice it explains, got 'sort'" in capfd.readouterr().err
    assert cli.main(["techniques"]) == 0
    assert "\nauto " in capfd.readouterr().out
