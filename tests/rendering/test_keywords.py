"""What editors and type checkers know of `render`: which options there are, and their values."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import clpeel

SCRIPT = """\
import clpeel

scene = clpeel.load("a.ply")
clpeel.render(scene, technique="multi-layer-peeling", coincident="paper", passes=3, layers_per_pass=4)
clpeel.Renderer(scene).render(precision="half", depth_format="unorm24", samples=4, memory="1G")
clpeel.render(scene, precision="f8")
clpeel.render(scene, coincidnt="keep")
clpeel.Renderer(scene).render(layers_per_pass="4")
reveal_type(clpeel.render(scene).stats.passes)
"""


def test_a_type_checker_knows_every_option_and_its_values(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    home = str(Path(clpeel.__file__).resolve().parents[1])
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-color-output", "script.py"]
    environment = {**os.environ, "MYPYPATH": home if "site-packages" not in home else "", "MYPY_CACHE_DIR": "cache"}
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    said = dict(re.findall(r"script\.py:(\d+): (?:error|note): (.*)", run.stdout)[::-1])
    assert sorted(said) == ["6", "7", "8", "9"], run.stdout + run.stderr
    assert """expected "Literal['float32', 'half', 'unorm8']\"""" in said["6"]
    assert 'did you mean "coincident"?' in said["7"]
    assert 'incompatible type "str"; expected "int"' in said["8"]
    assert said["9"] == 'Revealed type is "int"'
