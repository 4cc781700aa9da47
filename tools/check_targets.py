"""Compiles the kernels for graphics processors with clang, and checks what they take there. No device is needed.

    python tools/check_targets.py                        everything, about ten minutes on two idle cores
    python tools/check_targets.py --quick                the main variant of each kernel
    python tools/check_targets.py --target gfx1030 --technique sort --all

It prints vector registers of a lane, bytes of private memory that did not fit them ("scratch"), local bytes of a
work-group, and occupancy, which is how many waves a SIMD can hold with so many registers. For each kernel and target
it shows the worst variant. `--all` shows every variant, `--json FILE` writes them.

It fails where something does not compile, or where a kernel takes more than LIMITS. EXCEPTIONS are the kernels that
may take more, with the reason. For nvptx64, clang knows no real registers. If NVIDIA's ptxas is found (on PATH), its
figures are checked; otherwise only that the kernels compile. SPIR has no registers either.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyopencl as cl

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # the kernels of this copy are checked, whatever is installed

from clpeel.device.devices import ALLOWED_LANES, GPU_LANES  # noqa: E402
from clpeel.device.layout import DEPTH_FORMATS, REGULAR, Features, Targets  # noqa: E402
from clpeel.device.memory import Budget  # noqa: E402
from clpeel.device.program import build_options, source  # noqa: E402
from clpeel.device.samples import PATTERNS  # noqa: E402
from clpeel.errors import InputError  # noqa: E402
from clpeel.options import Options, options_of  # noqa: E402
from clpeel.stages import many_passes, one_pass, opaque, passes  # noqa: E402
from clpeel.stages.frame import Frame  # noqa: E402
from clpeel.stages.projection import Triangles  # noqa: E402
from clpeel.techniques import TECHNIQUES, AnyTechnique  # noqa: E402
from clpeel.techniques.precision import PRECISIONS  # noqa: E402

# --- what is allowed --------------------------------------------------------------------------------------------------
SCRATCH, LOCAL = 0, 32 << 10
"""The most scratch bytes of a lane, and local bytes of a group. A full-profile device has 32 KiB of them or more."""

REGISTERS = 128
"""The most vector registers of a lane. With 128 a SIMD of gfx90a holds 4 waves, and one of gfx1030 twice as many."""

REGISTERS_OF = {"nvptx64": 168}
"""Where the limit is another one. NVIDIA's own compiler makes other code, and ptxas takes what there is: of 65,536
registers 168 leave room for 12 warps."""


@dataclass(frozen=True)
class Allowance:
    """Kernels that may take more. variant, kernel: regular expressions of both. reason: why it cannot be less."""

    variant: str
    kernel: str
    registers: int
    scratch: int
    reason: str


EXCEPTIONS = (
    Allowance(
        "^moments ", "draw", 256, 160,
        "a lane keeps the moments of its four pixels, up to nine sums of 64 bits each, and solves for all four at once",
    ),
    Allowance(
        "^clipping ", "clip_triangles", 128, 1024,
        "clipping keeps two polygons of ten corners a face; only faces that a clipping plane cuts are clipped",
    ),
    Allowance(
        "^(depth-peeling|multi-layer-peeling) .*mixed", "peel", 136, 0,
        "peeling before opaque surfaces, with lit colours of vertices: 119 registers of gfx1030, but 131 of gfx90a",
    ),
    Allowance(
        "^dual-depth-peeling ", "peel", 168, 64,
        "dual-depth-peeling keeps four depths and two colours of each of a lane's four pixels: 64 registers",
    ),
    Allowance(
        "^weighted-blended ", "draw", 136, 0,
        "weights are quotients, of each of a lane's four pixels at once, beside five sums",
    ),
    Allowance(
        "^stochastic ", "draw", 168, 0,
        "beside five sums there are a mask, a seed and a hash of each of a lane's four pixels",
    ),
    Allowance(
        "^glowscript ", "peel", 184, 0,
        "glowscript keeps the colours of four peels of each of a lane's four pixels: 64 registers",
    ),
    Allowance(
        "^multi-layer-peeling .*LAYERS_A_PASS=[48]\\b", "peel", 200, 0,
        "multi-layer-peeling keeps 4 or 8 slots of each of a lane's four pixels: 32 or 64 registers",
    ),
    Allowance(
        "^multi-layer-peeling .*LAYERS_A_PASS=16\\b", "peel", 256, 0, "16 slots of four pixels are 128 registers",
    ),
    Allowance(
        "^multi-layer-peeling .*LAYERS_A_PASS=64\\b", "peel", 512, 6144, "64 slots of four pixels are 512 registers",
    ),
    Allowance(
        "^multi-layer-peeling .*HAZARD_WINDOW", "peel", 344, 800,
        "concurrent writes are simulated, slot by slot: it is no way to draw fast",
    ),
    Allowance(
        "^multi-layer-peeling .*LAYERS_A_PASS=16 PASSES", "blend_layers", 200, 0,
        "the 16 slots of four pixels are loaded at once",
    ),
    Allowance(
        "^multi-layer-peeling .*LAYERS_A_PASS=64 PASSES", "clear_targets|blend_layers", 128, 2304,
        "the 64 slots of four pixels are in an array",
    ),
    Allowance(
        "^multi-layer-peeling .*RACING", "peel_fragments", 128, 128,
        "the paper's race sorts what it reads of eight targets: it is no way to draw fast",
    ),
    Allowance(
        "^translucency ", "draw", 144, 0,
        "translucency computes the light through four pixels at once, while a tile is being drawn",
    ),
    Allowance(
        "^multi-layer-alpha-blending .*SLOTS=[248]\\b", "draw", 136, 0, "128 but for lit colours of vertices of gfx90a",
    ),
    Allowance("^multi-layer-alpha-blending .*SLOTS=16\\b", "draw", 176, 0, "16 layers of one pixel are 80 registers"),
    Allowance("^adaptive .*NODES=[48]\\b", "draw", 168, 0, "8 nodes of one pixel are 32 registers"),
    Allowance("^adaptive .*NODES=16\\b", "draw", 184, 0, "16 nodes of one pixel are 64 registers"),
    Allowance("^adaptive .*NODES=32\\b", "draw", 224, 0, "32 nodes of one pixel are 128 registers"),
)  # fmt: skip


# --- targets ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Target:
    """What clang compiles for. library: libclc's file of OpenCL functions for it; none where drivers link their own."""

    name: str
    options: tuple[str, ...]
    library: str = ""


NVIDIA_ATOMICS = "".join(
    f"static inline ulong nv_{name}(volatile global ulong *p, ulong v)"
    f'{{ ulong old; __asm__ volatile("atom.global.{code} %0, [%1], %2;" : "=l"(old) : "l"(p), "l"(v) : "memory");'
    f" return old; }}\n#define atom_{name} nv_{name}\n"
    for name, code in (("min", "min.u64"), ("max", "max.u64"), ("or", "or.b64"))
)
"""Atomics of 64 bits for NVIDIA, whose own compiler has them: neither clang nor libclc has them there."""

TARGETS = {
    each.name: each
    for each in (
        Target("gfx1030", ("-target", "amdgcn-amd-amdhsa", "-mcpu=gfx1030", "-S"), "amdgcn--amdhsa.bc"),
        Target(
            "gfx1030-wave64",
            ("-target", "amdgcn-amd-amdhsa", "-mcpu=gfx1030", "-mwavefrontsize64", "-S"),
            "amdgcn--amdhsa.bc",
        ),
        Target("gfx90a", ("-target", "amdgcn-amd-amdhsa", "-mcpu=gfx90a", "-S"), "amdgcn--amdhsa.bc"),
        Target("nvptx64", ("-target", "nvptx64-nvidia-nvcl", "-Xclang", "-target-cpu", "-Xclang", "sm_70", "-S"),
               "nvptx64--nvidiacl.bc"),
        Target("spir64", ("-target", "spir64", "-emit-llvm", "-c")),
    )
}  # fmt: skip

LIBRARIES = (Path("/usr/lib/clc"), Path("/usr/share/clc"), Path("/usr/local/lib/clc"))
COMMON = ("-x", "cl", "-O3", "-Xclang", "-finclude-default-header", "-nogpulib")
PROCESSORS = (70, 75, 80, 86, 89, 90, 100, 120)
"""NVIDIA's compute capabilities, times ten. PTX is made for the first, and assembled for the first that ptxas knows."""


@dataclass(frozen=True)
class Tools:
    """The compilers: clang, the folder of libclc that it can link, and ptxas with its target; None where missing."""

    clang: str
    libraries: Path | None
    ptxas: tuple[str, str] | None


def find_tools() -> Tools | None:
    """The compilers on PATH, or None if there is no clang. Prefers a clang that can link the libclc that is there."""
    names = ("clang", *(f"clang-{version}" for version in range(25, 13, -1)))
    found = [path for path in map(shutil.which, names) if path]
    libraries = next((folder for folder in LIBRARIES if folder.is_dir()), None)
    if not found:
        return None
    for clang in found if libraries else ():
        target = TARGETS["gfx1030"]
        text = "kernel void test(global float *at) { at[get_global_id(0)] += 1.0f; }"
        if _clang(Tools(clang, libraries, None), target, text, ["-cl-std=CL1.2"], Path(os.devnull)).returncode == 0:
            return Tools(clang, libraries, _find_ptxas())
    return Tools(found[0], None, _find_ptxas())


def _find_ptxas() -> tuple[str, str] | None:
    """NVIDIA's assembler, and the oldest processor that it still knows."""
    path = shutil.which("ptxas") or shutil.which("/usr/local/cuda/bin/ptxas")
    if path is None:
        return None
    nothing = f".version 6.0\n.target sm_{PROCESSORS[0]}\n.address_size 64\n.visible .entry nothing() {{ ret; }}\n"
    for number in PROCESSORS:
        command = [path, f"-arch=sm_{number}", "-o", os.devnull, "/dev/stdin"]
        if subprocess.run(command, input=nothing, capture_output=True, text=True, check=False).returncode == 0:
            return path, f"sm_{number}"
    return None


def _clang(
    tools: Tools, target: Target, text: str, options: Sequence[str], to: Path
) -> subprocess.CompletedProcess[str]:
    command = [tools.clang, *COMMON, *target.options, *options, "-o", str(to), "-"]
    if target.library and tools.libraries:
        command += ["-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(tools.libraries / target.library)]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=False)


# --- variants: what the program compiles ------------------------------------------------------------------------------
@dataclass(frozen=True)
class Variant:
    """What a kernel file is compiled for. technique: whose it is, or the stage's name. main: a quick run has it."""

    technique: str
    path: str
    features: Features
    defines: tuple[tuple[str, int], ...]
    main: bool

    @property
    def name(self) -> str:
        """In words."""
        of = self.features
        parts = [
            Path(self.path).stem,
            of.color_rate,
            *(["floats"] if not of.packed_color else []),
            *(["lit"] if of.headlight else []),
            *([of.surfaces] if of.surfaces != "transparent" else []),
            *([of.depth_format] if of.depth_format != DEPTH_FORMATS[0] else []),
            *([f"pattern {of.pattern:x}"] if of.pattern != REGULAR else []),
            *(f"{name}={value}" for name, value in self.defines if value),
        ]
        return " ".join(parts)


MAIN = Features(GPU_LANES, color_rate="face")
"""What a quick run compiles, besides colours of vertices with a light."""

TRIED: dict[str, tuple[object, ...]] = {
    "max_error": (0.01,),
    "layers_per_pass": (1, 2, 4, 16, 64),
    "hazard_window": (8,),
}
"""Values of options that are neither switches nor choices. Options that no kernel is compiled for are not here."""

TOGETHER: tuple[dict[str, object], ...] = (
    {"hazard_window": 8, "hazard_order": "arrival"},
    {"hazard_window": 8, "torn_writes": True, "layers_per_pass": 2},
)


class _Asked(Exception):
    """Raised in place of compiling: a technique has said which kernel it wants."""

    def __init__(self, wanted: tuple[str, Features, Any]) -> None:
        self.wanted = wanted


def _ask(gpu: object, path: str, features: Features, **defines: int) -> Any:
    """In place of clpeel.device.program.program."""
    raise _Asked((path, features, tuple(sorted(defines.items()))))


def wanted_by(
    made: AnyTechnique, features: Features, options: Options, atomics: int | None = None
) -> tuple[str, Features, Any]:
    """Which kernel file a technique draws with, compiled for which features and constants: it is asked to draw.

    atomics: bits of the device's atomics if it draws by passes, or None if it draws by tiles. Raises InputError if it
    cannot draw by passes with these options.
    """
    nothing = cast(Any, None)
    scene = SimpleNamespace(
        scene=SimpleNamespace(bounds=np.array([[0.0] * 3, [1.0] * 3])), grid=SimpleNamespace(scale=1.0)
    )
    triangles = Triangles(
        cast(Any, scene), features, True, (32, 32), (0.0, 0.0, 1.0), (1.0, 9.0), (1.0, 9.0), 1.0,
        1, 1, 0, 0, nothing, nothing, nothing, nothing,
    )  # fmt: skip
    gpu = SimpleNamespace(lanes=features.lanes, long_atomics=atomics == 64, put=lambda *_: None, buffer=lambda *_: None)
    targets = None if atomics is None else made.targets(options)
    frame = Frame(cast(Any, gpu), triangles, {}, 1 << 20, Budget(1 << 30, 1 << 30), targets=targets)
    batch = SimpleNamespace(most_layers=9, tiles=4, first_tile=0, tile_pairs=np.array([1, 2, 3, 4]))
    kept = [(module, module.program) for module in (one_pass, many_passes, opaque, passes)]
    try:
        for module, _ in kept:
            vars(module)["program"] = _ask
        made.draw(frame, cast(Any, batch), options)
    except _Asked as asked:
        return asked.wanted
    finally:
        for module, program in kept:
            vars(module)["program"] = program
    raise AssertionError(f"{made.name} draws without a kernel")


def options_to_try(owner: type[Options]) -> Iterator[Options]:
    """The defaults, then each other value of one option, and values that go together."""
    yield owner()
    for each in options_of(owner):
        values = each.choices or ((not each.default,) if isinstance(each.default, bool) else TRIED.get(each.name, ()))
        for value in values:
            if value != each.default:
                yield from _possible(owner, {each.name: value})
    for values_together in TOGETHER:
        if values_together.keys() <= {each.name for each in options_of(owner)}:
            yield from _possible(owner, values_together)


def _possible(owner: type[Options], values: Mapping[str, object]) -> Iterator[Options]:
    try:
        yield owner(**cast(Any, values))
    except InputError:
        return  # not without another option


def features_to_try(lanes: int) -> Iterator[Features]:
    """All ways in which colours come, and surfaces are drawn; one by one what else fragments depend on."""
    main = replace(MAIN, lanes=lanes)
    yield main
    for surfaces, headlight, rate in product(("transparent", "mixed"), (False, True), ("scene", "face", "vertex")):
        yield replace(main, surfaces=surfaces, headlight=headlight, color_rate=rate)
    yield replace(main, packed_color=False)
    yield replace(main, packed_color=False, color_rate="vertex", headlight=True)
    for samples in (4, 8, 16):
        yield replace(main, pattern=PATTERNS[samples].word)
        yield replace(main, pattern=PATTERNS[samples].word, color_rate="vertex", headlight=True)
    for depth_format in DEPTH_FORMATS:
        yield replace(main, depth_format=depth_format)


def variants(lanes: int = GPU_LANES) -> list[Variant]:
    """All variants, each once."""
    main = replace(MAIN, lanes=lanes)
    lit = replace(main, color_rate="vertex", headlight=True, surfaces="mixed")
    found: dict[tuple[object, ...], Variant] = {}

    def add(technique: str, wanted: tuple[str, Features, Any]) -> None:
        found.setdefault(wanted, Variant(technique, *wanted, main=False))

    for positions in (0, 1):
        for stage in ("setup", "clipping"):
            add(stage, (f"stages/{stage}.cl", Features(lanes), (("LOW_POSITIONS", positions),)))
    for features in features_to_try(lanes):
        add("windows", ("stages/windows.cl", features, ()))
        add("find-layers", ("stages/find_layers.cl", features, ()))
        add("stream", ("stages/stream.cl", features, ()))
        shown = replace(features, surfaces="opaque")
        for number in range(len(PRECISIONS)):
            add("opaque", ("stages/opaque.cl", shown, (("PRECISION", number),) if number else ()))
        for surfaces in ("transparent", "mixed", "opaque"):
            plain = Features(lanes, surfaces=surfaces, depth_format=features.depth_format)
            add("counting", ("stages/counting.cl", plain, (("ALL_OPAQUE", int(surfaces == "opaque")),)))
    for constant in ("BY_DEPTH", "FACING", "PRECISION"):
        add("stream", ("stages/stream.cl", replace(main, surfaces="mixed"), ((constant, 1),)))
    for made in TECHNIQUES.values():
        for features in features_to_try(lanes):
            if features.surfaces == "transparent" or not made.all_surfaces:
                add(made.name, wanted_by(made, features, made.options()))
        for features, options in product((main, lit), options_to_try(made.options)):
            shown = replace(features, surfaces="transparent") if made.all_surfaces else features
            add(made.name, wanted_by(made, shown, options))
            for atomics in (64, 32) if made.has_passes else ():
                try:
                    add(made.name, wanted_by(made, shown, options, atomics))
                except InputError:
                    break  # not with this option
    return [replace(each, main=_is_main(each, lanes)) for each in found.values()]


DEFAULTS = {
    "LAYERS_A_PASS": 8,
    "SLOTS": 4,
    "NODES": 8,
    "WEIGHT": 10,
    "MASK_BITS": 8,
    "CORRECTED": 1,
    "KEPT_LAYERS": 8,
    "BY_ARRIVAL": 0,
    "AVERAGED": 1,
    "WAVELET_RANK": 3,
    "PIXEL_RANGE": 1,
}
"""Constants of techniques' options, and what the default options make of them."""

IN_MAIN = (*DEFAULTS, "PERSPECTIVE", "ALL_OPAQUE", "ATOMICS_64", *Targets(1, 1, 1).constants)
"""Constants that a technique's default options have."""


def _is_main(variant: Variant, lanes: int) -> bool:
    """Whether a quick run has it: default options, and one of the two main kinds of colours, or none."""
    if any(value and name not in IN_MAIN for name, value in variant.defines):
        return False
    main = replace(MAIN, lanes=lanes, surfaces=variant.features.surfaces)
    if any(value != DEFAULTS.get(name, value) for name, value in variant.defines):
        return False
    return variant.features in (
        main,
        replace(main, color_rate="vertex", headlight=True),
        replace(main, color_rate="scene"),
    )


# --- compiling --------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Found:
    """What a kernel takes. Numbers are None where the target has none. problem: why it fails, or ""."""

    target: str
    technique: str
    variant: str
    kernel: str
    registers: int | None = None
    scratch: int | None = None
    local: int | None = None
    occupancy: int | None = None
    problem: str = ""
    allowed: str = ""


def compile_for(tools: Tools, target: Target, variant: Variant) -> list[Found]:
    """Compiles a variant for a target, and reads what each of its kernels takes."""
    of = (target.name, variant.technique, variant.name)
    with tempfile.TemporaryDirectory() as folder:
        to = Path(folder) / "out"
        long_atomics = target.name == "nvptx64" and dict(variant.defines).get("ATOMICS_64")
        text = (NVIDIA_ATOMICS if long_atomics else "") + source(variant.path)
        done = _clang(tools, target, text, _options_of(variant), to)
        if done.returncode or not to.exists():
            lines = [line for line in done.stderr.splitlines() if "error" in line] or ["no output"]
            return [Found(*of, "", problem=f"does not compile: {lines[0]}")]
        names = re.findall(r"^kernel void (\w+)\(", source(variant.path), re.M)
        if target.name.startswith("gfx"):
            taken = read_amd(to.read_text())
        elif target.name == "nvptx64" and tools.ptxas:
            path, processor = tools.ptxas
            command = [path, "-v", f"-arch={processor}", str(to), "-o", os.devnull]
            assembled = subprocess.run(command, capture_output=True, text=True, check=False)
            if assembled.returncode:
                return [Found(*of, "", problem=f"ptxas: {assembled.stderr.strip().splitlines()[0]}")]
            taken = read_nvidia(assembled.stderr + assembled.stdout)
        else:
            taken = {name: {} for name in names}
    return [judged(Found(*of, name, **cast(Any, numbers))) for name, numbers in taken.items()]


def _options_of(variant: Variant) -> list[str]:
    """The compiler's options, as the program has them on a device that divides as it should."""
    config = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
    gpu = SimpleNamespace(device=SimpleNamespace(single_fp_config=config))
    return build_options(cast(Any, gpu), variant.features, dict(variant.defines))


def read_amd(assembly: str) -> dict[str, dict[str, int]]:
    """What kernels take, by name, from LLVM's assembly for AMD: its metadata, and the occupancy in its comments."""
    occupancy = dict(re.findall(r"\.amdhsa_kernel (\w+)\n.*?; Occupancy: (\d+)", assembly, re.S))
    taken: dict[str, dict[str, int]] = {}
    for part in assembly.partition(".amdgpu_metadata")[2].split("\n  - .a")[
        1:
    ]:  # .args or .agpr_count: a kernel's first
        fields = dict(re.findall(r"^ *\.(\w+): +(\S+)$", part, re.M))
        name = fields["symbol"].removesuffix(".kd")
        taken[name] = {
            "registers": int(fields["vgpr_count"]),
            "scratch": int(fields["private_segment_fixed_size"]),
            "local": int(fields["group_segment_fixed_size"]),
            "occupancy": int(occupancy[name]),
        }
    return taken


def read_nvidia(told: str) -> dict[str, dict[str, int]]:
    """What kernels take, by name, from the output of `ptxas -v`."""
    taken: dict[str, dict[str, int]] = {}
    for part in told.split("Compiling entry function '")[1:]:
        registers, stack, spilled = (
            re.search(pattern, part)
            for pattern in (r"Used (\d+) registers", r"(\d+) bytes stack", r"(\d+) bytes spill s")
        )
        shared = re.search(r"(\d+) bytes smem", part)
        if registers and stack and spilled:
            taken[part.partition("'")[0]] = {
                "registers": int(registers[1]),
                "scratch": int(stack[1]) + int(spilled[1]),
                "local": int(shared[1]) if shared else 0,
            }
    return taken


def judged(found: Found) -> Found:
    """The same with its problem, if it takes more than is allowed, and the reason where it may."""
    usual = REGISTERS_OF.get(found.target, REGISTERS)
    registers, scratch, reason = usual, SCRATCH, ""
    for each in EXCEPTIONS:
        if re.search(each.variant, found.variant) and re.fullmatch(each.kernel, found.kernel):
            registers, scratch, reason = max(registers, each.registers), max(scratch, each.scratch), each.reason
    above = [
        f"{value} {what}, expected at most {most}"
        for what, value, most in (
            ("registers", found.registers, registers),
            ("bytes of scratch", found.scratch, scratch),
            ("local bytes", found.local, LOCAL),
        )
        if value is not None and value > most
    ]
    over = (found.registers or 0) > usual or (found.scratch or 0) > SCRATCH
    return replace(found, problem="; ".join(above), allowed=reason if over else "")


def check(tools: Tools, targets: Iterable[Target], chosen: Sequence[Variant], jobs: int) -> Iterator[Found]:
    """Compiles all variants for all targets, `jobs` at a time."""
    with ThreadPoolExecutor(jobs) as pool:
        for each in pool.map(lambda pair: compile_for(tools, *pair), product(targets, chosen)):
            yield from each


# --- what is printed --------------------------------------------------------------------------------------------------
HEADINGS = ("target", "technique", "kernel", "registers", "scratch", "local", "occupancy", "variant")


def worst(found: Iterable[Found]) -> list[Found]:
    """The worst variant of each kernel of each technique and target."""
    by_kernel: dict[tuple[str, str, str], Found] = {}
    for each in found:
        key = each.target, each.technique, each.kernel
        if key not in by_kernel or _badness(each) > _badness(by_kernel[key]):
            by_kernel[key] = each
    return list(by_kernel.values())


def _badness(found: Found) -> tuple[bool, int, int]:
    return bool(found.problem), found.scratch or 0, found.registers or 0


def table(found: Iterable[Found]) -> str:
    """The figures, a line each."""
    rows: list[Sequence[str]] = [HEADINGS]
    for each in found:
        numbers = (each.registers, each.scratch, each.local, each.occupancy)
        shown = ("-" if number is None else f"{number:,}" for number in numbers)
        note = f"   <- {each.problem}" if each.problem else "   (allowed)" if each.allowed else ""
        rows.append((each.target, each.technique, each.kernel, *shown, each.variant + note))
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS) - 1)]
    names = 3  # columns of text, on the left
    return "\n".join(
        "  ".join(
            [
                *(cell.ljust(width) for cell, width in zip(row[:names], widths[:names], strict=True)),
                *(cell.rjust(width) for cell, width in zip(row[names:-1], widths[names:], strict=True)),
                row[-1],
            ]
        )
        for row in rows
    )


def parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", action="append", choices=TARGETS, help="only this one (default: all)")
    parser.add_argument("--technique", action="append", metavar="NAME", help="only this technique or stage")
    parser.add_argument("--kernel", metavar="NAME", help="only kernels of this name")
    parser.add_argument("--lanes", type=int, default=GPU_LANES, choices=ALLOWED_LANES, help="work-items of a tile")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="compilers side by side")
    parser.add_argument("--quick", action="store_true", help="the main variants alone")
    parser.add_argument("--all", action="store_true", help="print every variant")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to a file")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the targets. Returns 0, 1 if something fails, or 2 if nothing could be compiled."""
    given = parser().parse_args(arguments)
    tools = find_tools()
    if tools is None:
        print("check_targets: clang is missing; install clang and libclc (Debian: apt install clang libclc-dev)")
        return 2
    if tools.libraries is None:
        print("check_targets: no clang here can link OpenCL's functions; install clang and libclc of one version")
        return 2
    chosen = [each for each in variants(given.lanes) if each.main or not given.quick]
    if given.technique:
        known = {each.technique for each in chosen}
        if unknown := set(given.technique) - known:
            print(f"check_targets: expected techniques of {', '.join(sorted(known))}; got {', '.join(sorted(unknown))}")
            return 2
        chosen = [each for each in chosen if each.technique in given.technique]
    targets = [TARGETS[name] for name in given.target or TARGETS]
    found = list(check(tools, targets, chosen, given.jobs))
    if given.kernel:
        found = [each for each in found if each.kernel == given.kernel or each.problem and not each.kernel]
    if given.json:
        given.json.write_text(json.dumps([asdict(each) for each in found], indent=1) + "\n", encoding="utf-8")
    print(table(found if given.all else worst(found)))
    if not tools.ptxas and any(target.name == "nvptx64" for target in targets):
        print("ptxas is missing: for nvptx64 only compilation was checked")
    for reason in dict.fromkeys(each.allowed for each in found if each.allowed):
        print(f"allowed: {reason}")
    failed = [each for each in found if each.problem]
    print(f"{len(chosen)} variants for {len(targets)} targets, {len(failed)} kernels that fail")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
