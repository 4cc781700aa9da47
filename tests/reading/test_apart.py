"""Readers in a process of their own: what they return, what they say, and how they may end."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clpeel
from clpeel.reading.apart import read_apart

MODULE = Path(__file__).stem


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(Path(__file__).parent), *sys.path])


def made(color: str) -> clpeel.Scene:
    print("words", flush=True)
    os.write(1, b"more words\n")
    return clpeel.Scene.from_arrays(np.eye(3), [[0, 1, 2]], color=color)


def refused() -> clpeel.Scene:
    raise clpeel.InputError("expected a mesh, got none")


def broken() -> clpeel.Scene:
    raise ValueError("of two\nlines")


def crashed() -> clpeel.Scene:
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError


def left() -> clpeel.Scene:
    os._exit(3)


def test_a_scene_comes_as_it_was_made_and_nothing_is_printed(capfd: Any) -> None:
    scene = read_apart(MODULE, "made", "red")
    assert scene.vertices.tolist() == np.eye(3).tolist() and scene.color is not None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("refused", "expected a mesh, got none"),
        ("broken", r"the file is damaged \(the reader stopped with ValueError: of two lines\)"),
        ("crashed", r"the file is damaged \(its reader ended with SIGSEGV\)"),
        ("left", r"the file is damaged \(its reader ended with code 3\)"),
    ],
)
def test_other_ends_are_errors_of_one_line(name: str, said: str, capfd: Any) -> None:
    with pytest.raises(clpeel.InputError, match=f"{said}$") as error:
        read_apart(MODULE, name)
    assert "\n" not in str(error.value) and capfd.readouterr() == ("", "")
