"""Times exact pictures against VTK on the same scenes in the same run, and how long the command takes to start.

    python tools/bench.py [--scenes FOLDER] [--rounds N] [--size PIXELS] [--json FILE] [SCENE ...]

FOLDER holds scenes.py (scene makers and the camera) and vtk_peer.py (VTK without a display); by default the folder
`bench` in the one that CLPEEL_SHARED names. Both renderers take turns, each round in a process of its own, so that a
machine whose speed drifts slows both. A peer that cannot run is left out, with the reason. The picture's differences
from VTK's are counted too: its 8-bit blending rounds at each layer, and its edges are snapped elsewhere.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("CLPEEL_SHARED", ROOT.parent / "shared"))
SCENES = ("dragon", "spheres", "boxes", "grass")
CUBE = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]

OURS = """
import json, sys, time
import numpy as np
import scenes, clpeel
name, size, frames, out = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
vertices, faces, colors = scenes.named(name)
view = dict(scenes.CAMERA)
clipping = view.pop("near"), view.pop("far")
renderer = clpeel.Renderer(clpeel.Scene.from_arrays(vertices, faces, face_colors=colors))
camera = clpeel.Camera(**view, clipping_range=clipping)
renderer.render(camera, (size, size))
seconds = []
for frame in range(frames):
    camera = camera.azimuth(1e-9)
    started = time.perf_counter()
    result = renderer.render(camera, (size, size))
    seconds.append(time.perf_counter() - started)
np.save(out, result.image)
print(json.dumps(dict(median_s=float(np.median(seconds)), stats=result.stats)))
"""


def last_line(command: list[str], folder: Path, **environment: str) -> dict[str, Any]:
    """Runs a program that prints a line of JSON last; RuntimeError with its last words when it fails."""
    models = str(folder.parent / "models")
    python_path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    settings = {**os.environ, "MODELS": models, "PYTHONPATH": python_path, **environment}
    done = subprocess.run(command, env=settings, capture_output=True, text=True, check=False)
    if done.returncode:
        words = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise RuntimeError(words[-1])
    answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return answer


def compare(name: str, folder: Path, size: int, rounds: int, peers: tuple[str, ...]) -> dict[str, Any]:
    """One scene: the median of each renderer's rounds, interleaved, and how the pictures differ."""
    import numpy as np

    row: dict[str, Any] = {"scene": name, "size": size, "seconds": {}, "skipped": {}}
    with tempfile.TemporaryDirectory() as scratch:
        ours, theirs = f"{scratch}/ours.npy", f"{scratch}/theirs.npy"
        runs: dict[str, list[float]] = {"clpeel": [], **{f"vtk {peer}": [] for peer in peers}}
        for _ in range(rounds):
            found = last_line([sys.executable, "-c", OURS, name, str(size), "5", ours], folder)
            runs["clpeel"].append(found["median_s"])
            row |= {key: found["stats"][key] for key in ("triangles", "fragments", "layers_max", "device")}
            row["kernel_seconds"] = found["stats"]["kernel_seconds"]
            for peer in peers:
                if f"vtk {peer}" in row["skipped"]:
                    continue
                command = [sys.executable, str(folder / "vtk_peer.py"), name, str(size), peer, theirs]
                try:
                    runs[f"vtk {peer}"].append(last_line(command, folder, FRAMES="3")["median_s"])
                except RuntimeError as error:
                    row["skipped"][f"vtk {peer}"] = str(error)
                    continue
                if peer == "dual":
                    off = np.abs(np.load(ours).astype(int) - np.load(theirs))[..., :3].max(axis=2)
                    row["differs"] = {f"over {step}": float((off > step).mean()) for step in (1, 2, 8)}
        for key, values in runs.items():
            if values:
                row["seconds"][key] = {"median": statistics.median(values), "runs": values}
    for key, timed in row["seconds"].items():
        if key != "clpeel":
            row[f"times {key}"] = timed["median"] / row["seconds"]["clpeel"]["median"]
    return row


def start_up(rounds: int) -> dict[str, float]:
    """Whole-process seconds of the command on a cube of 12 triangles: with empty caches, with full ones, and --help."""
    command = [str(Path(sys.executable).with_name("clpeel"))]
    seconds: dict[str, float] = {}

    def run(arguments: list[str], home: str) -> float:
        settings = {**os.environ, "HOME": home, "XDG_CACHE_HOME": f"{home}/cache"}
        started = time.perf_counter()
        subprocess.run([*command, *arguments], env=settings, check=True, capture_output=True)
        return time.perf_counter() - started

    with tempfile.TemporaryDirectory() as scratch:
        triangles = [t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))]
        header = (
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 12\nproperty list uchar int vertex_indices\nend_header\n"
        )
        rows = [" ".join(map(str, corner)) for corner in CUBE] + [f"3 {a} {b} {c}" for a, b, c in triangles]
        cube = Path(scratch, "cube.ply")
        cube.write_text(header + "\n".join(rows) + "\n")
        render = ["render", str(cube), "-o", f"{scratch}/cube.png"]
        colds = [run(render, f"{scratch}/home{k}") for k in range(rounds)]
        warms = [run(render, f"{scratch}/home0") for _ in range(rounds)]
        helps = [run(["--help"], f"{scratch}/home0") for _ in range(rounds)]
        for name, values in (("cold", colds), ("warm", warms), ("--help", helps)):
            seconds[name] = statistics.median(values)
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=SCENES, metavar="SCENE")
    parser.add_argument("--scenes", type=Path, default=SHARED / "bench", metavar="FOLDER")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    if not (options.scenes / "scenes.py").is_file():
        parser.error(f"no scenes.py in {options.scenes}; give --scenes or set CLPEEL_SHARED")

    found: dict[str, Any] = {"machine": f"{platform.machine()}, {os.cpu_count()} processors", "start_up": {}}
    print(f"{'scene':9}{'triangles':>10}{'fragments':>11}{'layers':>7}{'clpeel':>9}  vs VTK dual      vs VTK unsorted")
    found["scenes"] = []
    for name in options.names:
        row = compare(name, options.scenes, options.size, options.rounds, ("dual", "unsorted"))
        found["scenes"].append(row)
        cells = [
            f"{row['seconds'][key]['median']:6.3f} s {row[f'times {key}']:5.1f} x"
            if key in row["seconds"]
            else "skipped"
            for key in ("vtk dual", "vtk unsorted")
        ]
        ours = row["seconds"]["clpeel"]["median"]
        print(
            f"{name:9}{row['triangles']:10,}{row['fragments']:11,}{row['layers_max']:7}{ours:7.3f} s  "
            + "  ".join(cells),
            flush=True,
        )
        for peer, reason in row["skipped"].items():
            print(f"          {peer} skipped: {reason}")
        if "differs" in row:
            shares = ", ".join(f"{share:.4%} by {key}" for key, share in row["differs"].items())
            print(f"          pixels that differ from VTK's: {shares} steps of 255")
    ratios = [row["times vtk dual"] for row in found["scenes"] if "times vtk dual" in row]
    if ratios:
        found["times vtk dual"] = statistics.geometric_mean(ratios)
        print(f"geometric mean: {found['times vtk dual']:.1f} times as fast as VTK's dual depth peeling")
    found["start_up"] = start_up(options.rounds)
    print("start-up:", ", ".join(f"{name} {seconds:.2f} s" for name, seconds in found["start_up"].items()))
    if options.json:
        options.json.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
