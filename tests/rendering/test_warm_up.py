"""Warm-up: what it compiles, that pictures of these kinds then compile nothing, and what it says where it cannot."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import clpeel
from clpeel.rendering.warm_up import kinds_of, warm_up
from clpeel.techniques import TECHNIQUES

# Makes each kind of picture, and says how many programs were written into the cache meanwhile.
AFTERWARDS = """
import os, sys
from pathlib import Path
from clpeel.rendering.warm_up import _picture_of, kinds_of
kept = lambda: sorted((file, file.stat().st_mtime_ns) for file in Path(os.environ["XDG_CACHE_HOME"]).rglob("*.kernels"))
before = kept()
for kind in kinds_of(sys.argv[1:]):
    _picture_of(kind, None, None)
print(len(before), before == kept())
"""


def run(command: list[str], cache: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    environment.pop("POCL_CACHE_DIR", None)
    return subprocess.run([sys.executable, *command], env=environment, capture_output=True, text=True, check=False)


def test_every_technique_is_warmed_up_in_every_kind_of_scene() -> None:
    kinds = list(kinds_of(list(TECHNIQUES)))
    assert len(set(kinds)) == len(kinds) and len({kind.name for kind in kinds}) == len(kinds)
    assert {kind.technique for kind in kinds} == set(TECHNIQUES)
    for kind in kinds:
        scene = kind.scene()
        assert scene.surfaces == kind.surfaces
        given = {"scene": scene.color, "face": scene.face_colors, "vertex": scene.vertex_colors}
        assert (given[kind.rate] is not None) and (kind.rate == "scene" or len(given[kind.rate]) > 1)
        assert scene.surfaces != "opaque" or kind.technique == "sort"  # all techniques draw those alike


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_pictures_compile_nothing_afterwards(tmp_path: Path, jobs: str) -> None:
    techniques = ["layer-count"]
    done = run(["-m", "clpeel", "warm-up", "--techniques", ",".join(techniques), "--jobs", jobs], tmp_path)
    assert done.returncode == 0, done.stderr
    said = re.fullmatch(r"clpeel: (\d+) kinds of pictures are compiled, in [\d.]+ s, and kept in '(.*)'\n", done.stderr)
    assert said and int(said[1]) == len(list(kinds_of(techniques))) and Path(said[2]).is_relative_to(tmp_path)
    after = run(["-c", AFTERWARDS, *techniques], tmp_path)
    count, same = after.stdout.split()
    assert int(count) >= 2 and same == "True", after.stderr


def test_a_damaged_cache_is_mended_and_no_failure(tmp_path: Path) -> None:
    command = ["-m", "clpeel", "warm-up", "--techniques", "layer-count", "--jobs", "1"]
    assert run(command, tmp_path).returncode == 0
    for file in tmp_path.rglob("*.kernels"):
        file.write_bytes(file.read_bytes()[:-9])
    mended = run(command, tmp_path)
    assert mended.returncode == 0
    assert re.match(r"clpeel: note: compiled kernels kept in '.*' were damaged; .*\nclpeel: \d+ kinds", mended.stderr)


def test_it_fails_where_nothing_can_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    done = run(["-m", "clpeel", "warm-up", "--techniques", "layer-count"], tmp_path / "file")
    assert done.returncode == 1
    assert re.fullmatch(r"clpeel: error: compiled kernels cannot be kept in '.*', so each run .*\n", done.stderr)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"techniques": ["sort", "auto"]}, "techniques: expected one of sort, .*; got 'auto'"),
        ({"techniques": []}, "techniques: expected at least one, got none"),
        ({"jobs": 0}, "jobs: expected 1.*, got 0"),
        ({"lanes": 3}, "lanes: expected one of"),
    ],
)
def test_what_cannot_be_is_refused(options: dict, message: str) -> None:
    with pytest.raises(clpeel.InputError, match=message):
        warm_up(**options)


def test_progress_names_each_kind() -> None:
    told: list[tuple[float, str]] = []
    warmed = warm_up(["layer-count"], progress=lambda done, text: told.append((done, text)))
    assert warmed.kinds == len(told) and told[-1][0] == 1.0 and warmed.kept and warmed.notes == ()
    assert [done for done, _ in told] == sorted(done for done, _ in told) and told[0][1].startswith("layer-count, ")
