"""Oclgrind, which checks each access to memory: kernels build there, and draw the same picture as elsewhere.

It also watches for data races: work-items that use the same place, one of them to write, without atomics.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

OCLGRIND = shutil.which("oclgrind")

SCRIPT = """
import json
import sys
import numpy as np
import clpeel

device, out, pictures = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
corners = np.random.default_rng(4).normal(size=(18, 3))
scene = clpeel.Scene.from_arrays(corners, np.arange(18).reshape(-1, 3), color=(0.2, 0.5, 0.9, 0.4))
images, lanes = {}, 0
for number, (technique, options) in enumerate(pictures):
    lighting = ("none", "headlight")[number % 2]
    result = clpeel.render(
        scene, None, (16, 12), technique, lighting=lighting, samples=1, device=device or None, lanes=64, **options
    )
    images[f"{technique} {options}"], lanes = result.image, result.stats["lanes"]
np.savez(out, lanes=lanes, **images)
"""

BY_PASSES: dict[str, Any] = {"execution": "passes"}
PICTURES: list[tuple[str, dict[str, Any]]] = [
    ("sort", {}),
    ("weighted-average", {}),
    ("dual-depth-peeling", {}),
    ("depth-peeling", {}),
    ("dual-depth-peeling", BY_PASSES),
    ("depth-peeling", BY_PASSES),
    ("multi-layer-peeling", {"layers_per_pass": 3, **BY_PASSES}),
    ("multi-layer-peeling", {"layers_per_pass": 2, "coincident": "paper", **BY_PASSES}),
    ("glowscript", BY_PASSES),
    ("weighted-average", BY_PASSES),
    ("thickness", {"variant": "total", **BY_PASSES}),
    ("thickness", {"variant": "first-solid", **BY_PASSES}),
]


@pytest.mark.skipif(OCLGRIND is None, reason="needs oclgrind (Debian: apt install oclgrind)")
def test_oclgrind_draws_the_same_pictures_and_sees_no_race(tmp_path: Path) -> None:
    assert OCLGRIND is not None
    command = [sys.executable, "-P", "-c", SCRIPT]
    environment = {name: value for name, value in os.environ.items() if name != "CLPEEL_DEVICE"}
    checking = [OCLGRIND, "--data-races", "--max-errors", "1000000"]
    for start, device, name in ((checking, "Oclgrind", "checked"), ([], "", "usual")):
        done = subprocess.run(
            [*start, *command, device, str(tmp_path / name), json.dumps(PICTURES)],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr[-2000:]
        for wrong in ("Undefined external function", "Invalid", "data race"):
            at = done.stderr.find(wrong)
            assert at < 0, done.stderr[at : at + 2000]
    checked, usual = np.load(tmp_path / "checked.npz"), np.load(tmp_path / "usual.npz")
    assert checked["lanes"] == usual["lanes"] == 64
    assert len(usual.files) == 1 + len(PICTURES)
    for name in usual.files[1:]:
        assert (usual[name][..., :3] < 255).any()
        np.testing.assert_array_equal(checked[name], usual[name], err_msg=name)
