"""Which event a frame answers: the newest one in the view that it was drawn of, and none that came later."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

import clpeel
from clpeel.viewer.painter import Frame
from clpeel.viewer.status import status_of
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

Shown = queue.Queue[tuple[Frame, dict[str, Any]]]


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    """A viewer of one triangle, whose frames nobody takes yet."""
    scene = clpeel.Scene.from_arrays([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, 1, 2]], color=(1, 0, 0, 0.5))
    found = Viewer(scene, View(clpeel.Camera((0, 0, 4), (0, 0, 0)), (32, 24)))
    yield found
    found.close()


def pointer(kind: str, x: float, at: float) -> dict[str, Any]:
    return {"event_type": kind, "x": x, "y": 5, "button": 1, "buttons": [1], "modifiers": [], "timestamp": at}


def test_a_view_answers_the_newest_event_that_changed_it(viewer: Viewer) -> None:
    assert viewer.view.answers == 0
    viewer.handle(pointer("pointer_down", 10, 1.5))
    assert viewer.view.answers == 0  # nothing has moved yet
    viewer.handle(pointer("pointer_move", 20, 2.5))
    assert viewer.view.answers == 2.5
    viewer.handle(pointer("pointer_move", 20, 3.5))
    assert viewer.view.answers == 2.5
    viewer.handle({"event_type": "key_down", "key": "o", "modifiers": []})  # of a screen that tells no time
    assert viewer.view.answers == 0


def test_a_frame_says_which_event_it_answers(viewer: Viewer) -> None:
    shown: Shown = queue.Queue()
    screen: Any = type("Screen", (), {"present": lambda self, frame, status: shown.put((frame, status))})()
    viewer.open(screen)
    viewer.handle(pointer("pointer_down", 10, 1.5))
    viewer.handle(pointer("pointer_move", 20, 2.5))
    frame, status = shown.get(timeout=60)
    assert status["answers"] == 2.5
    assert status_of(frame, replace(frame.view, answers=9.0))["answers"] == 2.5  # the 9th second came too late for it
