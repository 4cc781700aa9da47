"""The command line of a view: it makes the very picture."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from PIL import Image

import clpeel
from clpeel.command import main as cli
from clpeel.rendering.options import BACKGROUND
from clpeel.viewer.command_line import Source, command_line
from clpeel.viewer.view import View

SHAPE = "OFF\n5 4 0\n0 0 1\n1 0 -1\n-1 0.3 -1\n0 1.1 0\n0.2 -1 0.1\n3 0 1 2\n3 0 1 3\n3 1 2 3\n3 0 2 4\n"
CAMERA = clpeel.Camera((1.1, 2.0 / 3, 4.0), (0.1, 0.2, 1.0 / 3), (0.1, 1.0, 0.0), 33.3)


@pytest.fixture
def shape(tmp_path: Path) -> Path:
    path = tmp_path / "a shape.off"
    path.write_text(SHAPE)
    return path


VIEWS: list[dict[str, Any]] = [
    {},
    {"background": None},
    {"background": ((0.1, 0.2, 1 / 3), (1.0, 0.5, 0.25))},
    {"background": BACKGROUND},
    {"background": (0.1, 0.2, 1 / 3), "lighting": "none"},
    {"opacity": 0.35},
    {"technique": "multi-layer-peeling", "options": {"layers_per_pass": 4, "passes": 1, "precision": "half"}},
    {"technique": "dual-depth-peeling", "options": {"occlusion_query": False, "passes": 2, "max_error": 0.25}},
    {"technique": "weighted-average", "options": {"passes": 3, "samples": 4, "opaque": "blend"}},
    {
        "technique": "depth-peeling",
        "options": {"execution": "passes", "depth_format": "unorm24", "coincident": "paper"},
    },
    {"options": {"blending_space": "linear", "samples": 4}},
    {"shows": "layers", "technique": "weighted-sum"},
    {"camera": clpeel.Camera((1, 2, 4), (0, 0, 0), orthographic=True, clipping_range=(-1.5, 4.25))},
]


@pytest.mark.parametrize("given", VIEWS)
def test_it_makes_the_very_picture(given: dict[str, Any], shape: Path, tmp_path: Path, monkeypatch: Any) -> None:
    view = View(**{"camera": CAMERA, "size": (61, 47), **given})
    text = command_line(view, Source(("clpeel", "render", str(shape)), ("--opacity=0.6", "--color=0.9,0.2,0.1")))
    name, *words = shlex.split(text)
    monkeypatch.chdir(tmp_path)
    assert name == "clpeel" and cli.main(words) == 0
    scene = clpeel.load(shape, opacity=0.6, color=(0.9, 0.2, 0.1))
    if view.opacity is not None:
        scene = clpeel.load(scene, opacity=view.opacity)
    technique = "layer-count" if view.shows == "layers" else view.technique
    image = plainly.render(scene, view.camera, technique=technique, **view.keywords(technique)).image
    assert (np.asarray(Image.open("picture.png").convert("RGBA")) == image).all()


@pytest.mark.parametrize("given", VIEWS)
def test_the_python_makes_the_very_picture(
    given: dict[str, Any], shape: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    view = View(**{"camera": CAMERA, "size": (61, 47), **given})
    scene = clpeel.load(shape, opacity=0.6)
    monkeypatch.chdir(tmp_path)
    exec(command_line(view, None), {"clpeel": clpeel, "scene": scene})
    made = clpeel.load(scene, opacity=view.opacity) if view.opacity is not None else scene
    technique = "layer-count" if view.shows == "layers" else view.technique
    image = plainly.render(made, view.camera, technique=technique, **view.keywords(technique)).image
    assert (np.asarray(Image.open("picture.png").convert("RGBA")) == image).all()


def test_a_changed_opacity_stands_in_place_of_the_commands_own() -> None:
    source = Source(("clpeel", "render", "a.stl", "b.stl"), ("--opacity=0.5", "--opacity=0.6", "--color=1,0,0"))
    words = shlex.split(command_line(View(CAMERA, (9, 9), opacity=0.25), source))
    assert [word for word in words if word.startswith("--opacity")] == ["--opacity=0.25"] and "--color=1,0,0" in words
