"""The check of GPU targets: what it compiles, how it reads compilers, and that it fails where too much is taken."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import check_targets as tool
import pytest
from check_targets import TARGETS, Found, Tools, judged, read_amd, read_nvidia, table, variants, worst

from clpeel.device.layout import Features
from clpeel.device.program import source
from clpeel.techniques import TECHNIQUES

AMD = """
	.amdhsa_kernel first
		.amdhsa_next_free_vgpr 70
; NumVgprs: 70
; Occupancy: 12
	.amdhsa_kernel second
; NumVgprs: 9
; Occupancy: 16
	.amdgpu_metadata
---
amdhsa.kernels:
  - .args:
      - .name:           at
        .size:           8
    .group_segment_fixed_size: 4112
    .name:           first
    .private_segment_fixed_size: 16
    .symbol:         first.kd
    .vgpr_count:     70
  - .agpr_count:     0
    .group_segment_fixed_size: 0
    .name:           second
    .private_segment_fixed_size: 0
    .symbol:         second.kd
    .vgpr_count:     9
...
	.end_amdgpu_metadata
"""

NVIDIA = """ptxas info    : Compiling entry function 'draw' for 'sm_75'
ptxas info    : Function properties for draw
    88 bytes stack frame, 156 bytes spill stores, 168 bytes spill loads
ptxas info    : Used 128 registers, used 1 barriers, 88 bytes cumulative stack size, 6176 bytes smem, 552 bytes cmem[0]
ptxas info    : Compiling entry function 'count' for 'sm_75'
ptxas info    : Function properties for count
    0 bytes stack frame, 0 bytes spill stores, 0 bytes spill loads
ptxas info    : Used 20 registers, 404 bytes cmem[0]
"""

KERNEL = Found("gfx1030", "sort", "sort face", "draw", registers=100, scratch=0, local=5136, occupancy=9)


@pytest.fixture(scope="module")
def tools() -> Tools:
    found = tool.find_tools()
    if found is None or found.libraries is None:
        pytest.skip("needs clang and libclc of one version (Debian: apt install clang-15 libclc-15-dev)")
    return found


def test_every_technique_and_stage_is_compiled_once_in_each_variant() -> None:
    found = variants()
    assert {each.technique for each in found} >= {*TECHNIQUES, "setup", "clipping", "windows", "find-layers", "opaque"}
    assert len({(each.path, each.features, each.defines) for each in found}) == len(found)
    assert {each.technique for each in found if each.main} == {each.technique for each in found}


def test_variants_are_those_that_the_techniques_ask_for() -> None:
    made = TECHNIQUES["multi-layer-peeling"]
    path, features, defines = tool.wanted_by(made, Features(64), made.options(layers_per_pass=4, max_error=0.1))
    assert (path, features) == (made.kernel, Features(64))
    assert dict(defines) == {"LAYERS_A_PASS": 4, "BOUNDED": 1, "BY_DEPTH": 0}


def test_the_text_and_the_options_are_those_of_the_program() -> None:
    variant = next(each for each in variants(1) if each.technique == "sort" and each.main)
    options = tool._options_of(variant)
    assert "-DLANES=1" in options and "-DSTRIP=16" in options and "-cl-std=CL1.2" in options
    assert "kernel void draw(" in source(variant.path)


def test_amd_assembly_is_read_kernel_by_kernel() -> None:
    assert read_amd(AMD) == {
        "first": {"registers": 70, "scratch": 16, "local": 4112, "occupancy": 12},
        "second": {"registers": 9, "scratch": 0, "local": 0, "occupancy": 16},
    }


def test_spilled_registers_of_nvidia_count_as_scratch() -> None:
    assert read_nvidia(NVIDIA) == {
        "draw": {"registers": 128, "scratch": 244, "local": 6176},
        "count": {"registers": 20, "scratch": 0, "local": 0},
    }


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"registers": 129}, "129 registers, expected at most 128"),
        ({"scratch": 4}, "4 bytes of scratch, expected at most 0"),
        ({"local": (32 << 10) + 1}, "local bytes"),
        ({"target": "nvptx64", "registers": 169}, "expected at most 168"),
    ],
)
def test_a_kernel_that_takes_too_much_fails(more: dict[str, int], words: str) -> None:
    assert not judged(KERNEL).problem
    assert words in judged(replace(KERNEL, **more)).problem  # type: ignore[arg-type]


def test_an_exception_has_a_reason_and_a_limit_of_its_own() -> None:
    clipping = replace(KERNEL, technique="clipping", variant="clipping scene", kernel="clip_triangles", scratch=900)
    assert judged(clipping).allowed and not judged(clipping).problem
    assert "expected at most" in judged(replace(clipping, scratch=2000)).problem
    assert all(each.reason for each in tool.EXCEPTIONS)


def test_the_short_table_has_the_worst_variant_of_each_kernel() -> None:
    worse = replace(KERNEL, variant="sort vertex lit", registers=120)
    other = replace(KERNEL, target="gfx90a", problem="does not compile: error")
    lines = table(worst([KERNEL, worse, other])).splitlines()
    assert len(lines) == 3 and "sort vertex lit" in lines[1] and "<- does not compile" in lines[2]


def test_a_machine_without_clang_is_told_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tool.shutil, "which", lambda name: None)
    assert tool.main([]) == 2
    assert capsys.readouterr().out.count("\n") == 1


@pytest.mark.parametrize("target", TARGETS)
def test_a_technique_compiles_for_a_target(
    tools: Tools, target: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "figures.json"
    arguments: Sequence[str] = ("--quick", "--target", target, "--technique", "layer-count", "--json", str(file))
    assert tool.main(arguments) == 0, capsys.readouterr().out
    figures = json.loads(file.read_text())
    assert {each["kernel"] for each in figures} == {"draw"}
    assert all(each["registers"] for each in figures if target.startswith("gfx"))


def test_an_error_of_the_compiler_fails_with_its_first_line(tools: Tools, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tool, "source", lambda path: "kernel void draw(global int *at) { nonsense }")
    (found,) = tool.compile_for(tools, TARGETS["spir64"], variants()[0])
    assert "does not compile" in found.problem and "nonsense" in found.problem
