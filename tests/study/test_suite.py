"""The suite: its scenes are what they say, ranks and means by hand, Ctrl-C, notes, files, the page, and the command."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import printed

import clpeel
from clpeel.command import main as cli
from clpeel.study import suite as suites
from clpeel.study.comparison import Comparison, Row, unbeaten
from clpeel.study.dice import Dice, noise, unit
from clpeel.study.scenes import DRAGON, NAMES, standard_scenes
from clpeel.study.standings import LEAST_ERROR, Chapter, SuiteComparison, geometric_mean, ranks
from clpeel.study.suite import PAGE_SIDE, reduced, time_left
from clpeel.techniques.weighted_sum import WeightedSum

pytestmark = pytest.mark.usefixtures("shared_devices")

MADE = [name for name in NAMES if name != "dragon"]
SIZE = (20, 16)
SMALL = ("grass", "shells")


@pytest.fixture(autouse=True)
def nothing_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The dragon is found only where a test says so. FLIP is not measured, as it takes a second a picture."""
    monkeypatch.delenv("CLPEEL_SHARED", raising=False)
    monkeypatch.setattr("clpeel.study.compare.flip_error", lambda *_: 0.25)


@pytest.fixture(scope="module")
def scenes() -> dict[str, clpeel.Scene]:
    return {name: standard_scenes(None)[name].make() for name in MADE}


# --- the numbers ------------------------------------------------------------------------------------------------------


def test_dice_are_splitmix64() -> None:
    """The first words of seed 1234567, as published: rosettacode.org/wiki/Pseudo-random_numbers/Splitmix64."""
    words = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821]
    dice = Dice(1234567)
    assert [int(word) for word in (*dice.words(2), *dice.words(3))] == words
    assert len(dice.words(0)) == 0


def test_dice_are_within_their_bounds_and_even() -> None:
    numbers = Dice(3)(40, 500, low=-2.0, high=6.0)
    assert numbers.shape == (40, 500) and numbers.min() >= -2 and numbers.max() < 6
    # A mean of 20,000 numbers whose deviation is 8 / sqrt(12) is off by 5 deviations once in a million.
    assert abs(numbers.mean() - 2) < 5 * 8 / math.sqrt(12 * 20_000)
    assert np.abs(np.linalg.norm(Dice(4).directions(100), axis=1) - 1).max() < 1e-15
    assert (unit(np.zeros((1, 3))) == 0).all() and sorted(Dice(5).order(9)) == list(range(9))


def test_noise_is_smooth_and_repeats() -> None:
    values = noise(Dice(1), 64, 4)
    around = np.concatenate([values, values[:, :1]], axis=1)
    # The cubic step rises by 1.5 a cell at most, and a cell has 16 texels.
    assert np.abs(np.diff(around, axis=1)).max() <= 1.5 / 16 and 0 <= values.min() < values.max() <= 1


# --- the scenes -------------------------------------------------------------------------------------------------------

COUNTS = {
    "spheres": 10 * 6 * 80 * 80 * 2,
    "boxes": 1000 * 12,
    "grass": 192 * 2,
    "hair": 100_000 * 3 * 2,
    "smoke": 64 * 2,
    # A turned outline has two triangles for each of the 96 faces of a side, and one where the side ends on the axis.
    "shells": 96 * (6 * 8 + (3 + 8) * 4),
    "foliage": 6_000 * 2 + 96 * 4,
}
DIGESTS = {
    "spheres": "7a6c99ce8bcff64e",
    "boxes": "aa958cc4d8b4058a",
    "grass": "f4582678c0183afc",
    "hair": "8f84623de5fc7580",
    "smoke": "370f4f15a882cee8",
    "shells": "4be9254febe34354",
    "foliage": "82bf808cec1c7dc5",
}


def digest(scene: clpeel.Scene) -> str:
    """The bytes of all arrays and textures."""
    found = hashlib.sha256()
    for array in (scene.vertices, scene.faces, scene.colors, scene.uv, scene.face_materials):
        found.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
    for material in scene.materials:
        found.update(b"none" if material.texture is None else material.texture.image.tobytes())
    return found.hexdigest()[:16]


@pytest.mark.parametrize("name", MADE)
def test_scenes_have_the_same_bits_each_time(name: str, scenes: dict[str, clpeel.Scene]) -> None:
    """Their figures of different machines are of the same scene, so a change of any bit is a change of the suite."""
    assert digest(scenes[name]) == digest(standard_scenes(None)[name].make()) == DIGESTS[name]


@pytest.mark.parametrize("name", MADE)
def test_scenes_are_what_they_say(name: str, scenes: dict[str, clpeel.Scene]) -> None:
    scene = scenes[name]
    assert len(scene.faces) == COUNTS[name]
    corners = scene.vertices[scene.faces].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.min() > 0 and np.abs(scene.bounds).max() < 1.2


def hits(scene: clpeel.Scene, camera: clpeel.Camera, x: float, y: float) -> int:
    """How many triangles the ray to a place of the picture meets, -1..1 each way, in float64."""
    origin, target = np.array(camera.position), np.array(camera.focal_point)
    front = (target - origin) / np.linalg.norm(target - origin)
    right = np.cross(front, camera.view_up)
    right /= np.linalg.norm(right)
    reach = math.tan(math.radians(camera.view_angle / 2))
    ray = front + reach * (x * right + y * np.cross(right, front))
    a, b, c = (scene.vertices[scene.faces[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    slope = normal @ ray
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.einsum("ij,ij->i", normal, a - origin) / slope
        place = origin + away[:, None] * ray
        inside = [np.einsum("ij,ij->i", np.cross(q - p, place - p), normal) > 0 for p, q in ((a, b), (b, c), (c, a))]
    return int(np.count_nonzero(inside[0] & inside[1] & inside[2] & (away > 0)))


def center(column: int, row: int, side: int) -> tuple[float, float]:
    """The middle of a pixel, -1..1 each way."""
    return (2 * column + 1) / side - 1, 1 - (2 * row + 1) / side


PLACES = [(8, 8), (7, 6), (10, 9), (5, 10), (3, 3)]


@pytest.mark.parametrize("name", ["spheres", "boxes", "grass", "shells"])
def test_layers_are_those_of_a_ray(name: str, scenes: dict[str, clpeel.Scene]) -> None:
    camera = standard_scenes(None)[name].camera
    assert camera is not None
    layers = clpeel.complexity(scenes[name], camera, (16, 16), opaque="blend").layers
    want = [hits(scenes[name], camera, *center(*place, 16)) for place in PLACES]
    assert [int(layers[row, column]) for column, row in PLACES] == want
    assert max(want) >= 9
    if name == "spheres":
        assert want[0] == 20  # each of ten twice


def test_hair_has_as_many_fragments_as_its_area(scenes: dict[str, clpeel.Scene]) -> None:
    """A ray's count would not do: ribbons are thinner than the steps to which places in a picture are rounded."""
    layers = clpeel.complexity(scenes["hair"], standard_scenes(None)["hair"].camera, (64, 64)).layers
    places = scenes["hair"].vertices[scenes["hair"].faces].astype(np.float64)
    flat = places[..., :2] / (4 - places[..., 2:]) / math.tan(math.radians(15)) * 32  # pixels
    assert np.abs(flat).max() < 43  # some hair hangs out of the picture
    one, two = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    seen = (np.abs(flat) < 32).all(axis=(1, 2))
    area = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    assert area[seen].sum() * 0.97 < layers.sum() < area.sum() * 1.03 and layers.max() > 50


def test_smoke_is_64_sheets_and_leaves_are_cut_out(scenes: dict[str, clpeel.Scene]) -> None:
    depths = scenes["smoke"].vertices[:, 2].reshape(64, 4)
    assert (depths == depths[:, :1]).all()
    assert (np.diff(np.sort(depths[:, 0])) == 2 / 64).all() and (np.diff(depths[:, 0]) < 0).any()
    for name, least, most in (("smoke", 0.1, 0.55), ("foliage", 0.9, 0.93)):
        alpha = scenes[name].materials[0].texture.image[..., 3] / 255
        rim = np.concatenate([alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]])
        assert rim.max() < 0.06 and least < alpha.max() < most, name
        assert 0.05 < np.mean((alpha > 0) & (alpha < alpha.max())), name  # soft
    leaf = scenes["foliage"].materials[0].texture.image[..., 3]
    assert 0.25 < np.mean(leaf == 0) < 0.75


def test_shells_are_closed_and_some_touch(scenes: dict[str, clpeel.Scene]) -> None:
    """Each directed edge has its opposite, so every part is a closed surface; and two parts share a plane."""
    scene = scenes["shells"]
    _, merged = np.unique(
        scene.vertices + 0.0, axis=0, return_inverse=True
    )  # on the axis, a part has many in one place
    faces = merged.reshape(-1)[scene.faces]
    edges = np.concatenate([faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]).astype(np.int64)
    forth, back = edges @ [1 << 32, 1], edges @ [1, 1 << 32]
    assert (np.sort(forth) == np.sort(back)).all()
    heights = scene.vertices[scene.faces][..., 1]
    flat = (heights == heights[:, :1]).all(axis=1)
    assert np.count_nonzero(flat & (heights[:, 0] == -0.6)) > 3 * 96


def test_the_dragon_is_a_file(model: Callable[[str], Path]) -> None:
    path = model(DRAGON)
    scene = standard_scenes(path.parent)["dragon"].make()
    assert len(scene.faces) == 871_414 and scene.colors.shape[-1] == 4


# --- ranks and means, by hand -----------------------------------------------------------------------------------------


def test_ranks() -> None:
    assert ranks([3.0, 1.0, 2.0]) == [3, 1, 2]
    assert ranks([0.5, 0.0, 0.0, 0.7]) == [3, 1, 1, 4]
    assert ranks([1.0]) == [1]


def chapter(name: str, *rows: tuple[str, float, float], layers: int = 2) -> Chapter:
    """A scene with rows (technique, seconds, error)."""
    made = []
    for technique, seconds, error in rows:
        row = Row(technique, None, None, True, (seconds,), 1, 8, 1, error, error, 0, 0, 0, 0.5, 0, 0, 0)
        made.append(replace(row, psnr=-20 * math.log10(error) if error else math.inf))
    truth = np.zeros((1, 1, 4))
    return Chapter(name, f"about {name}", Comparison(made, truth, (1, 1, 1), "none", "first", 1, 1, layers, "dev", 1))


def by_hand() -> SuiteComparison:
    """Rounding is 10 2^-24 = 6e-7 with two layers."""
    return SuiteComparison(
        [
            chapter("one", ("sort", 2.0, 1e-7), ("peel", 8.0, 5e-7), ("sum", 1.0, 0.3)),
            chapter("two", ("sort", 1.0, 0.0), ("peel", 9.0, 2e-7), ("sum", 2.0, 0.4)),
        ],
        ("a note",),
    )


def test_means_of_two_scenes() -> None:
    suite = by_hand()
    sort, peel, sums = suite.standings
    assert (sort.time, sort.rms_error, sort.max_error, sort.rank_time, sort.rank_error) == (1, 0, 0, 1.5, 1)
    assert peel.time == pytest.approx(math.sqrt(4 * 9)) and (peel.rank_time, peel.rank_error) == (3, 1)
    assert peel.rms_geometric == pytest.approx(LEAST_ERROR)
    assert sums.time == pytest.approx(math.sqrt(0.5 * 2)) and (sums.rank_time, sums.rank_error) == (1.5, 3)
    assert sums.rms_error == pytest.approx(math.sqrt((0.09 + 0.16) / 2)) and sums.max_error == 0.4
    assert sums.rms_geometric == pytest.approx(math.sqrt(0.3 * 0.4)) and sums.flip == 0.5
    assert suite.front() == [True, False, sums.time < 1]  # a mean of 1 but for rounding


def test_the_front_is_that_of_a_search() -> None:
    """A point is on it if no other dominates it, found here by sorting: by time, and errors that fall."""
    rng = np.random.default_rng(3)
    points = [(float(a), float(b)) for a, b in rng.integers(0, 12, (60, 2))]
    want, least = {}, math.inf
    for time in sorted({time for time, _ in points}):
        error = min(error for other, error in points if other == time)
        if error < least:
            want[time, error] = True
            least = error
    assert unbeaten(points) == [point in want for point in points]
    assert unbeaten([(1, 1), (1, 1)]) == [True, True]


def test_without_sort_the_first_row_counts_as_one() -> None:
    suite = SuiteComparison([chapter("one", ("peel", 8.0, 0.0), ("sum", 2.0, 0.3))])
    assert suite.reference == "peel" and [each.time for each in suite.standings] == [1, pytest.approx(0.25)]
    assert "that of peel is 1" in suite.table() and "1 scene " in suite.table()


def test_a_scene_that_lacks_rows_counts_in_no_mean() -> None:
    whole, part = chapter("one", ("sort", 2.0, 0.0), ("sum", 1.0, 0.3)), chapter("two", ("sort", 5.0, 0.0))
    suite = SuiteComparison([whole, part])
    assert suite.names == ["sort", "sum"] and suite.whole == [whole]
    assert [each.rank_time for each in suite.standings] == [2, 1]
    assert suite.rank_cells() == [["sort", "2/1", "1/1"], ["sum", "1/2", "-"]]
    assert SuiteComparison([part]).standings[0].time == 1


def test_the_geometric_mean() -> None:
    assert geometric_mean([1.0, 4.0, 16.0]) == pytest.approx(4)


def test_tables_and_files() -> None:
    suite = by_hand()
    text = suite.table()
    assert "one: about one\n" in text and "note: a note" in text
    assert re.search(r"^  sum +1/3 +2/3$", text, re.M) and re.search(r"^\* sort +1\.00 +0 +6\.0e-08", text, re.M)
    found = json.loads(suite.to_json(), parse_constant=lambda name: pytest.fail(name))
    assert [scene["name"] for scene in found["scenes"]] == ["one", "two"] and found["reference"] == "sort"
    assert [(row["rank_time"], row["rank_error"]) for row in found["scenes"][0]["rows"]] == [(2, 1), (3, 1), (1, 3)]
    assert found["overall"][1]["time"] == pytest.approx(6) and found["notes"] == ["a note"]
    lines = list(csv.DictReader(io.StringIO(suite.to_csv())))
    assert [(line["scene"], line["technique"], line["rank_time"]) for line in lines[2:4]] == [
        ("one", "sum", "1"),
        ("two", "sort", "1"),
    ]


# --- drawing ----------------------------------------------------------------------------------------------------------


def few(**options: Any) -> SuiteComparison:
    """A suite of two scenes, small."""
    given: dict[str, Any] = {"scenes": SMALL, "size": SIZE, "techniques": ["sort", "weighted-sum"], "frames": 1}
    return clpeel.compare_suite(**{**given, **options})


def test_a_chapter_is_the_comparison_of_its_scene() -> None:
    suite = few(precisions=["float32"], scenes=["shells", "grass"])
    assert [each.name for each in suite.chapters] == ["grass", "shells"] and suite.notes == ()
    for each in suite.chapters:
        known = standard_scenes(None)[each.name]
        alone = clpeel.compare(known.make(), known.camera, SIZE, ["sort", "weighted-sum"], ["float32"], frames=1)
        assert [row.name for row in each.comparison.rows] == ["sort", "weighted-sum"]
        assert [row.rms_error for row in each.comparison.rows] == [row.rms_error for row in alone.rows]
        assert (each.comparison.truth == alone.truth).all() and each.pictures == {}
    with pytest.raises(clpeel.InputError, match="pictures: expected a suite that was drawn with pictures=True"):
        suite.to_html()


def test_rows_with_options_are_ranked_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(WeightedSum, "compared", lambda self: (WeightedSum.options(precision="half"),))
    suite = few(precisions=["float32"])
    assert suite.names == ["sort", "weighted-sum", "weighted-sum, half"]
    assert len(suite.standings) == 3


def test_without_its_file_the_dragon_is_left_out_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(suites, "NAMES", ("dragon", "grass"))
    note = f"left out: dragon: dragon: expected {DRAGON} in the folder of models, got none in '{tmp_path}'"
    assert few(scenes=None, models=tmp_path).notes == (note,)
    assert "got none" in few(scenes=None).notes[0] and "--models" in few(scenes=None).notes[0]
    with pytest.raises(clpeel.InputError, match="dragon: expected"):
        few(scenes=["dragon", "grass"], models=tmp_path)
    (tmp_path / DRAGON).write_bytes(b"no gzip")
    assert few(scenes=["dragon", "grass"], models=tmp_path).notes[0].startswith("left out: dragon: ")
    with pytest.raises(clpeel.InputError):
        few(scenes=["dragon"], models=tmp_path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenes": ["no-such"]}, f"scenes: expected some of {', '.join(NAMES)}; got 'no-such'"),
        ({"scenes": []}, "scenes: expected at least one"),
        ({"scenes": "dragon"}, "dragon: expected a folder"),
        ({"techniques": "thickness"}, "got 'thickness'"),
        ({"precisions": ["no-such"]}, "precisions: expected some of"),
        ({"budgets": [0]}, "budgets: expected 1..1048576, got 0"),
        ({"frames": 0}, "frames: expected 1..10000, got 0"),
        ({"size": (0, 1)}, "size: "),
        ({"size": (1_000_000, 1_000_000)}, "size: "),
        ({"memory": "lots"}, "memory: "),
        ({"lanes": 3}, "lanes: "),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(clpeel.InputError, match=re.escape(message)):
        few(**options)


def test_the_time_that_is_left() -> None:
    assert time_left(5, 0.1) == time_left(50, 0) == time_left(50, 1) == ""
    assert time_left(20, 0.5) == "20 s left" and time_left(60, 0.25) == "3 min left"
    assert time_left(3600, 0.25) == "3.0 h left"


def test_progress_goes_from_0_to_1(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(0, 10_000, 5))
    monkeypatch.setattr(suites.time, "monotonic", lambda: float(next(now)))
    told: list[tuple[float, str]] = []
    few(precisions=["float32"], progress=lambda done, text: told.append((done, text)))
    parts = [done for done, _ in told]
    assert parts[0] == 0 and parts[-1] == 1 and parts == sorted(parts)
    assert told[0][1] == "grass: making it" and told[-1][1] == "shells: done"
    assert re.fullmatch(r"\d+ (s|min) left, shells: weighted-sum: frame 1 of 1", told[-2][1])


def interrupt_at(wanted: str) -> Callable[[float, str], None]:
    """Ctrl-C when this is reported."""

    def progress(done: float, text: str) -> None:
        if text.endswith(wanted):
            raise KeyboardInterrupt

    return progress


def test_an_interrupted_suite_keeps_what_is_finished() -> None:
    with pytest.raises(clpeel.InterruptedSuite) as caught:
        few(progress=interrupt_at("shells: making it"), pictures=True)
    found = caught.value.comparison
    assert [each.name for each in found.chapters] == ["grass"] and found.notes == ("interrupted in shells",)
    ElementTree.fromstring(found.to_html().partition("\n")[2])
    with pytest.raises(clpeel.InterruptedSuite) as caught:
        few(progress=interrupt_at("shells: weighted-sum: frame 0 of 1"), precisions=["float32"])
    found = caught.value.comparison
    assert [list(each.times) for each in found.chapters] == [["sort", "weighted-sum"], ["sort"]]
    assert [each.name for each in found.whole] == ["grass"] and "note: interrupted in shells" in found.table()


def test_a_suite_interrupted_at_once_is_an_interruption_like_any() -> None:
    with pytest.raises(KeyboardInterrupt) as caught:
        few(progress=interrupt_at("grass: sort: its error"))
    assert not isinstance(caught.value, clpeel.InterruptedSuite)


# --- the page ---------------------------------------------------------------------------------------------------------


def test_pictures_are_reduced_to_means() -> None:
    image = np.random.default_rng(1).integers(0, 256, (2 * PAGE_SIDE, 10, 4), np.uint8)
    image[..., 3] = 255
    small = reduced(image)
    assert small.shape == (PAGE_SIDE, 5, 4)
    means = image.reshape(PAGE_SIDE, 2, 5, 2, 4).mean(axis=(1, 3))
    assert np.abs(small - means).max() <= 1  # it is rounded twice, once each way
    assert reduced(small) is small
    assert reduced(np.zeros((1, 5000, 4), np.uint8)).shape == (1, PAGE_SIDE, 4)


def test_the_page_is_whole_and_needs_nothing_else() -> None:
    suite = replace(few(pictures=True), notes=("a < b & c",))
    text = suite.to_html('<suite> & "friends"')
    page = ElementTree.fromstring(text.partition("\n")[2])
    assert not re.search(r"https?:|url\(|@import|<script [^>]*src|<link|href", text)
    ids = {node.get("id") for node in page.iter("img") if node.get("id")}
    groups = list(page.iter("optgroup"))
    assert [group.get("label") for group in groups] == list(SMALL)
    for group, each in zip(groups, suite.chapters, strict=True):
        assert [option.text for option in group] == ["truth", *each.times]
        assert {option.get("value") for option in group} <= ids
    points = next(node for node in page.iter("svg") if node.get("class") == "plot")
    titles = [title.text or "" for title in points.iter("title")]
    assert sorted(title.partition(":")[0] for title in titles) == sorted(suite.names)
    cells = [["".join(cell.itertext()) for cell in line] for line in page.iter("tr")]
    for name, *want in suite.rank_cells():
        assert [name, *want] in cells


# --- the command ------------------------------------------------------------------------------------------------------


def command(*arguments: str) -> int:
    """`clpeel compare --suite`, small."""
    return cli.main(["compare", "--suite", "--resolution=20,16", "--frames=1", "--techniques=sort", *arguments])


def test_the_command_prints_and_writes(tmp_path: Path, capfd: Any) -> None:
    files = {kind: tmp_path / f"out.{kind}" for kind in ("json", "csv", "html")}
    assert command("--scenes=shells,grass", *(f"--{kind}={path}" for kind, path in files.items())) == 0
    out, err = printed(capfd)
    assert out[0].startswith("grass: ") and any(line.startswith("* sort") for line in out)
    assert [scene["name"] for scene in json.loads(files["json"].read_text())["scenes"]] == ["grass", "shells"]
    assert len(files["csv"].read_text().splitlines()) == 3
    assert "<h1>clpeel compare --suite</h1>" in files["html"].read_text()
    assert err == [f"clpeel: wrote {path}" for path in files.values()]


def test_the_help_names_all_scenes(capfd: Any) -> None:
    assert cli.main(["compare", "--help"]) == 0
    assert f"only these of {', '.join(NAMES)}" in " ".join(capfd.readouterr().out.split())


def test_the_command_asks_for_what_the_options_say(monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    asked = SimpleNamespace()

    def compare(scenes: Any, size: Any, **options: Any) -> Any:
        asked.all = {"scenes": scenes, "size": size, **options}
        raise clpeel.InputError("enough")

    monkeypatch.setattr(clpeel, "compare_suite", compare)
    arguments = "--scenes grass,hair --models there --precisions half --budgets 1,4 --memory 64M --lanes 16 --json -"
    assert command(*arguments.split()) == 2
    assert asked.all == {
        "scenes": ("grass", "hair"),
        "size": (20, 16),
        "models": "there",
        "techniques": ("sort",),
        "precisions": ("half",),
        "budgets": (1, 4),
        "frames": 1,
        "memory": "64M",
        "device": None,
        "lanes": 16,
        "pictures": False,
        "progress": None,
    }


def test_the_command_keeps_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    begin = suites._Clock.begin

    def interrupted(self: Any, name: str) -> None:
        if name == "shells":
            raise KeyboardInterrupt
        begin(self, name)

    monkeypatch.setattr(suites._Clock, "begin", interrupted)
    assert command("--scenes=grass,shells", f"--csv={tmp_path / 'out.csv'}") == 130
    out, err = printed(capfd)
    assert out[0].startswith("grass: ") and "note: interrupted in shells" in out
    assert err[-1] == "clpeel: interrupted" and len((tmp_path / "out.csv").read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--suite", "part.stl"], "--suite: expected no file with it, got 'part.stl'"),
        (["--suite", "--opacity=0.5"], "--opacity: expected no such option with --suite"),
        (["--suite", "--camera-position=1,2,3"], "--camera-position: expected no such option with --suite"),
        (["--suite", "--merge-coincident"], "--drop-duplicates: expected no such option with --suite"),
        (["--suite", "--unlit"], "--unlit: expected no such option with --suite"),
        (["--suite", "--scenes=no-such"], "scenes: expected some of dragon, spheres"),
        (["--suite", "--scenes="], "scenes: expected some of dragon, spheres"),
        (["--suite", "--scenes=dragon", "--models=nowhere"], f"dragon: expected {DRAGON} in the folder of models"),
        (["--suite", "--html=no/such/x.html"], "--html: the folder"),
        (["--scenes=grass", "part.stl"], "--scenes: expected --suite with it, got none"),
        (["--models=.", "part.stl"], "--models: expected --suite with it, got none"),
        ([], "expected mesh files, or --suite, got none"),
    ],
)
def test_bad_input_is_one_line_before_any_work(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suites, "compare", lambda *_, **__: pytest.fail("something was drawn"))
    assert cli.main(["compare", *arguments]) == 2
    out, err = printed(capfd)
    assert out == [] and len(err) == 1 and message in err[0]
    assert os.listdir(tmp_path) == []
