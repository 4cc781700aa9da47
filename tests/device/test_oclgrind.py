"""Oclgrind, which checks each access to memory: kernels build there, and draw the same picture as elsewhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

OCLGRIND = shutil.which("oclgrind")

SCRIPT = """
import sys
import numpy as np
import clpeel

device, out, *techniques = sys.argv[1:]
corners = np.random.default_rng(4).normal(size=(18, 3))
scene = clpeel.Scene.from_arrays(corners, np.arange(18).reshape(-1, 3), color=(0.2, 0.5, 0.9, 0.4))
images, lanes = {}, 0
for number, technique in enumerate(techniques):
    lighting = ("none", "headlight")[number % 2]
    result = clpeel.render(scene, size=(16, 12), technique=technique, lighting=lighting, device=device or None)
    images[technique], lanes = result.image, result.stats["lanes"]
np.savez(out, lanes=lanes, **images)
"""

TECHNIQUES = ("sort", "weighted-average", "dual-depth-peeling", "depth-peeling")


@pytest.mark.skipif(OCLGRIND is None, reason="needs oclgrind (Debian: apt install oclgrind)")
def test_oclgrind_draws_the_same_picture(tmp_path: Path) -> None:
    assert OCLGRIND is not None
    command = [sys.executable, "-P", "-c", SCRIPT]
    environment = {name: value for name, value in os.environ.items() if name != "CLPEEL_DEVICE"}
    for start, device, name in (([OCLGRIND], "Oclgrind", "checked"), ([], "", "usual")):
        done = subprocess.run(
            [*start, *command, device, str(tmp_path / name), *TECHNIQUES],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr[-2000:]
        assert "Undefined external function" not in done.stderr and "Invalid" not in done.stderr, done.stderr[:2000]
    checked, usual = np.load(tmp_path / "checked.npz"), np.load(tmp_path / "usual.npz")
    assert checked["lanes"] == 64
    for name in usual.files[1:]:
        assert (usual[name][..., :3] < 255).any()
        np.testing.assert_array_equal(checked[name], usual[name], err_msg=name)
