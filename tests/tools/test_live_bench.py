"""The figures `live` and `soak` of the benchmark: which picture answers an event, their sums and tables. No browser."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmark import live, live_browser
from benchmark.runs import Bench, Failed, Settings, Skipped
from hypothesis import given
from hypothesis import strategies as st

TIMES = st.lists(st.floats(0, 1e4), min_size=1, max_size=20).map(sorted)


def events(*times: float) -> list[dict[str, float]]:
    return [{"at": at, "since": at - 3} for at in times]


def messages(*pairs: tuple[float, float]) -> list[dict[str, float]]:
    return [{"at": at, "clock": clock} for at, clock in pairs]


def frame(decoded: float, answers: float, **others: Any) -> dict[str, Any]:
    usual = {"milliseconds": 10.0, "scale": 0.5, "bytes": 2048, "coarse": False, "settled": False}
    return {"decoded": decoded, "answers": answers, **usual, **others}


def recorded(
    at: list[dict[str, float]], sent: list[dict[str, float]], frames: list[dict[str, Any]], until: float = 1e4
) -> dict[str, Any]:
    return {"events": at, "messages": sent, "frames": frames, "until": until}


# --- which picture answers an event -----------------------------------------------------------------------------------


def test_an_event_is_answered_by_the_first_picture_that_has_its_message() -> None:
    drag = recorded(events(0, 20), messages((5, 1), (25, 2)), [frame(30, 1), frame(60, 2)])
    assert live.answers(drag) == [30, 60]


def test_a_picture_of_an_older_view_answers_nothing_however_late_it_comes() -> None:
    drag = recorded(events(20), messages((5, 1), (25, 2)), [frame(40, 1), frame(50, 1), frame(70, 2)])
    assert live.answers(drag) == [70]


def test_a_newer_picture_answers_all_events_before_it() -> None:
    drag = recorded(events(0, 20, 40), messages((5, 1), (25, 2), (45, 3)), [frame(80, 3)])
    assert live.answers(drag) == [80, 80, 80]


def test_events_that_share_a_message_are_answered_together() -> None:
    assert live.answers(recorded(events(0, 4), messages((8, 1)), [frame(30, 1)])) == [30, 30]


def test_an_event_without_a_message_or_a_picture_is_not_answered() -> None:
    assert live.answers(recorded(events(0, 20), messages((5, 1)), [frame(30, 1)])) == [30, None]
    assert live.answers(recorded(events(0, 20), messages((5, 1), (25, 2)), [frame(30, 1)])) == [30, None]
    assert live.answers(recorded(events(0), [], [])) == [None]


def test_pictures_are_taken_in_the_order_in_which_they_were_decoded() -> None:
    assert live.answers(recorded(events(0), messages((5, 1)), [frame(50, 2), frame(30, 1)])) == [30]
    assert live.answers(recorded(events(20), messages((5, 1), (25, 2)), [frame(50, 1), frame(30, 2)])) == [30]


@given(TIMES, TIMES, TIMES)
def test_answers_are_those_of_a_search_for_each_event(at: list[float], sent: list[float], decoded: list[float]) -> None:
    asked = messages(*((time, clock) for clock, time in enumerate(sent)))
    frames = [frame(time, answers % len(sent)) for answers, time in enumerate(decoded)]

    def searched(time: float) -> float | None:
        message = next((each for each in asked if each["at"] >= time), None)
        if message is None:
            return None
        return next((each["decoded"] for each in frames if each["answers"] >= message["clock"]), None)

    assert live.answers(recorded(events(*at), asked, frames)) == [searched(time) for time in at]


def test_a_picture_that_comes_again_is_no_new_frame() -> None:
    frames = [frame(10, 1), frame(20, 1), frame(30, 3), frame(40, 2), frame(50, 4)]
    found = live.new_frames(recorded([], [], frames), 10, 40)
    assert [each["decoded"] for each in found] == [10, 30]


# --- sums -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "least"), [(1, 1), (10, 10), (19, 19), (20, 19), (40, 38), (100, 95)])
def test_a_part_of_the_values_is_within(count: int, least: int) -> None:
    values = [float(value) for value in range(count, 0, -1)]
    assert live.within(values, 0.95) == least
    assert np.mean(np.array(values) <= least) >= 0.95


def test_a_summary_leaves_out_the_first_seconds() -> None:
    at = [0.0, 1000, 2000, 2100, 2200]
    sent = messages(*((time + 10, number) for number, time in enumerate(at)))
    slow = [frame(900, 0, milliseconds=500), frame(1900, 1, milliseconds=500)]
    quick = [frame(2050, 2), frame(2130, 3, bytes=4096), frame(2300, 4, coarse=True)]
    full = frame(2600, 4, scale=1, settled=True, milliseconds=77)
    found = live.summary(recorded(events(*at), sent, [*slow, *quick, full]), warm_up=2)
    assert (found["events"], found["unanswered"]) == (3, 0)
    assert (found["median_ms"], found["within_ms"]) == (50, 100)
    assert found["frames_per_second"] == pytest.approx(3 / 0.3)
    assert found["bytes"] == pytest.approx((2048 + 4096 + 2048) / 3)
    assert (found["frame_ms"], found["scale"], found["coarse"]) == (10, 0.5, pytest.approx(1 / 3))
    assert (found["full_ms"], found["held_ms"]) == (77, 3)


def test_an_event_that_is_not_answered_counts_as_long_as_it_was_waited() -> None:
    drag = recorded(events(0, 100), messages((5, 1), (105, 2)), [frame(50, 1)], until=5100)
    found = live.summary(drag, warm_up=0)
    assert (found["unanswered"], found["within_ms"]) == (1, 5000)
    assert found["frames_per_second"] == pytest.approx(1 / 5.1)
    assert found["full_ms"] is None


@pytest.mark.parametrize(
    ("drag", "text"),
    [
        (recorded([], [], []), "no event"),
        (recorded(events(0), messages((5, 1)), [frame(9, 1)]), "first seconds"),
        (recorded(events(0, 3000), messages((3005, 1)), []), "no picture"),
    ],
)
def test_a_drag_without_anything_to_count_has_failed(drag: dict[str, Any], text: str) -> None:
    with pytest.raises(Failed, match=text):
        live.summary(drag, warm_up=2)


def test_growth_is_of_the_most_beside_the_least_after_a_minute() -> None:
    assert live.growth([1, 50, 100, 102, 101], warm_up=2) == pytest.approx(0.02)
    assert live.growth([100, 100], warm_up=1) == 0


# --- the table and the targets ----------------------------------------------------------------------------------------


def drags(within: float, rate: float) -> dict[str, Any]:
    """What a drag's summary could be."""
    usual = {"events": 600, "unanswered": 0, "median_ms": 40.0, "held_ms": 9.0, "bytes": 2048, "frame_ms": 12.0}
    return {**usual, "within_ms": within, "frames_per_second": rate, "scale": 1.0, "coarse": 0.0, "full_ms": 20.0}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[dict[str, Any], Bench]]:
    """Returns a function that runs the figure `live` without a browser, and what it left out."""

    def of(has_pyvista: bool = True, **programs: Callable[[list[Any], tuple[int, int]], Any]) -> Any:
        def run(command: list[str], environment: dict[str, str]) -> str:
            if not has_pyvista:
                raise Failed("No module named 'pyvista'")
            return '{"pyvista": "1"}'

        browser = SimpleNamespace(version="99")
        monkeypatch.setattr(live, "Browser", lambda: nullcontext(browser))
        monkeypatch.setattr(live, "run", run)
        for name, program in programs.items():
            monkeypatch.setattr(live.Drags, name, lambda self, *given, program=program: program(*given))
        (tmp_path / "scenes.py").touch()
        bench = Bench(Settings(scenes=("boxes", "spheres", "grass")), tmp_path, None, ["live"])
        found = live.live(bench)
        bench.close()
        return found, bench

    return of


def test_the_table_has_a_row_for_each_scene_size_and_program(measured: Any) -> None:
    pytest.importorskip("rendercanvas", reason="rendercanvas is not installed")
    turns = iter([50.0, 70.0, 52.0] * 4)
    found, bench = measured(
        clpeel=lambda scene, size: drags(next(turns), 40),
        trame=lambda scene, size: {**drags(900, 2), "unanswered": 5},
        frames=lambda scene, size: {"frame_ms": 300.0, "full_ms": 310.0},
    )
    heading, *rows = found["table"]
    assert [row[:3] for row in rows[:3]] == [
        ["boxes", "800 x 600", "clpeel"],
        ["boxes", "800 x 600", "PyVista, trame"],
        ["boxes", "800 x 600", "PyVista, off screen"],
    ]
    assert [row[:2] for row in rows[3::3]] == [
        ["boxes", "1600 x 1200"],
        ["spheres", "800 x 600"],
        ["spheres", "1600 x 1200"],
    ]
    assert rows[0][4] == "52.0 (50.0 .. 70.0)"  # three rounds of clpeel, one of PyVista
    assert rows[1][4] == "900"
    assert rows[2][3:] == ["", "", "", "", "300", "", "310"]
    assert {len(row) for row in found["table"]} == {len(heading)}
    assert [one["met"] for one in found["targets"]] == [True] * 6
    assert [one["what"].split(",")[0] for one in found["targets"][-2:]] == ["frames a second"] * 2
    assert bench.missing == {}
    assert "Chromium 99, pyvista 1" in found["notes"][1]
    assert "20 events were not answered" in found["notes"][-1]


def test_targets_are_missed_by_late_pictures_and_by_few(measured: Any) -> None:
    pytest.importorskip("rendercanvas", reason="rendercanvas is not installed")
    late = {"trame": lambda *_: drags(1, 1), "frames": lambda *_: {"frame_ms": 1.0, "full_ms": 1.0}}
    found, _ = measured(clpeel=lambda scene, size: {**drags(61, 29), "coarse": 1.0}, **late)
    assert [one["met"] for one in found["targets"]] == [False] * 6
    assert "coarser mesh: boxes, 800 x 600 100 %" in found["notes"][2]


def test_a_peer_that_fails_is_left_out_of_the_table_and_says_why(measured: Any) -> None:
    pytest.importorskip("rendercanvas", reason="rendercanvas is not installed")

    def fails(scene: list[Any], size: tuple[int, int]) -> Any:
        raise Failed("no display")

    found, bench = measured(
        clpeel=lambda scene, size: drags(50, 40),
        trame=fails,
        frames=lambda scene, size: {"frame_ms": 300.0, "full_ms": 310.0},
    )
    assert {row[2] for row in found["table"][1:]} == {"clpeel", "PyVista, off screen"}
    assert bench.missing["PyVista, trame, boxes, 800 x 600"] == "no display"


def test_without_pyvista_the_rest_is_measured(measured: Any) -> None:
    pytest.importorskip("rendercanvas", reason="rendercanvas is not installed")
    found, bench = measured(has_pyvista=False, clpeel=lambda scene, size: drags(50, 40))
    assert {row[2] for row in found["table"][1:]} == {"clpeel"}
    assert "No module named 'pyvista' (pip install" in bench.missing["PyVista"]
    assert "--peer-python" in bench.missing["PyVista"]


def test_without_its_scenes_or_packages_it_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    from clpeel.viewer import open as opening

    monkeypatch.setattr(opening, "missing", lambda backend: [])
    with pytest.raises(Skipped, match="none of dragon"):
        live.scenes_of(SimpleNamespace(scenes={"soup": ["soup"]}))  # type: ignore[arg-type]
    monkeypatch.setattr(opening, "missing", lambda backend: ["uvicorn"])
    with pytest.raises(Skipped, match="uvicorn is not installed"):
        live.scenes_of(SimpleNamespace(scenes={"boxes": ["boxes"]}))  # type: ignore[arg-type]


def test_without_a_browser_it_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("selenium", reason="selenium is not installed")
    monkeypatch.setattr(live_browser.shutil, "which", lambda name: None)
    with pytest.raises(Skipped, match="no Chromium"):
        live_browser.Browser()


# --- servers ----------------------------------------------------------------------------------------------------------


def test_a_server_says_its_address_and_is_ended() -> None:
    script = "print('hello'); print('open http://here/ (Ctrl-C ends)', flush=True); import time; time.sleep(600)"
    with live.server([sys.executable, "-c", script], {}) as (address, process):
        assert address == "http://here/"
        assert live.resident_bytes(process) > 2**20
    assert not Path(f"/proc/{process}").exists()


def test_a_server_that_fails_says_why() -> None:
    with pytest.raises(Failed, match="the last word"), live.server([sys.executable, "-c", "exit('the last word')"], {}):
        pass


def test_the_mouse_is_dragged_in_a_circle_within_the_picture() -> None:
    browser = object.__new__(live_browser.Browser)
    browser._middle, browser._radius = (400.0, 300.0), 180.0
    places = np.array([browser._place(step / live_browser.EVENTS) for step in range(180)])
    assert np.linalg.norm(places - (400, 300), axis=1) == pytest.approx(180)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.min() > 1  # so that every event moves the camera
