"""Measures what drawing costs on this device: python tools/measure_costs.py [--device NAME] [--scenes FOLDER].

It draws scenes of many kinds with every technique. Then it fits the numbers of clpeel/rendering/costs.py to the times
of the device's clock, by least squares of relative errors, with no number below zero. It prints the table to put there,
and how far the resulting estimates are off: on the scenes of the fit, and on others, those of FOLDER/scenes.py, which
take no part in it. This takes about four minutes on two processor cores.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Iterator
from dataclasses import astuple, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import clpeel
from clpeel.options import Options
from clpeel.rendering.costs import Cost, costs_of
from clpeel.rendering.estimates import estimated_seconds, work_of
from clpeel.rendering.options import Lighting
from clpeel.scene.demo import DIRECTION, ZOOM, demo_scene
from clpeel.stages.counting import Counted, count_layers
from clpeel.stages.upload import upload
from clpeel.techniques import TECHNIQUES, AnyTechnique
from clpeel.techniques.technique import Variant

REPEATS = 8
"""The number of frames of which the fastest counts, after one that warms up."""

MOST_SECONDS = 0.8
"""The time for a scene with a technique, in seconds. If frames take longer, there are fewer of them."""

LIGHTINGS: tuple[Lighting, ...] = ("none", "headlight")
VIEW = clpeel.Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), view_angle=30.0, clipping_range=(2.0, 6.0))
AWAY = clpeel.Camera((0.0, 0.0, 4.0), (0.0, 0.0, 8.0), clipping_range=(1.0, 2.0))
SIZE = (800, 800)
OTHERS_SIZE = (1024, 1024)
OPAQUE_ROW: Variant = ("OPAQUE", ())
Row = tuple[tuple[float, ...], float, float]
"""The work that was done, the seconds it took, and the seconds of the whole frame."""


def triangles(count: int, radius: float, seed: int, opaque: float = 0.0) -> clpeel.Scene:
    """Return random triangles within about 1 of the origin. A share of them is opaque."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.9, 0.9, (count, 1, 3)) + radius * rng.uniform(-1, 1, (count, 3, 3))
    rgba = rng.integers(20, 236, (count, 4), dtype=np.uint8)
    rgba[rng.random(count) < opaque, 3] = 255
    return clpeel.Scene.from_arrays(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), face_colors=rgba)


def calibration() -> Iterator[tuple[str, clpeel.Scene, clpeel.Camera]]:
    """Yield the scenes of the fit: triangles smaller than a pixel up to picture-sized ones, few layers up to many."""
    for count, radius in ((600_000, 0.003), (150_000, 0.01), (20_000, 0.04), (2_000, 0.15), (300, 0.6), (40, 2.0)):
        yield f"{count} of {radius}", triangles(count, radius, count), VIEW
    for count, radius in ((40_000, 0.03), (100, 1.0)):
        yield f"{count} of {radius}, some opaque", triangles(count, radius, count, 0.1), VIEW
    for count, radius in ((300_000, 0.005), (20_000, 0.04), (100, 1.0)):
        yield f"{count} of {radius}, all opaque", triangles(count, radius, count, 1.0), VIEW
    yield "nothing in view", triangles(100, 0.1, 1), AWAY
    demo = demo_scene()
    yield "demo", demo, clpeel.Camera.frame(demo, DIRECTION).zoom(ZOOM)


def others(folder: str) -> Iterator[tuple[str, clpeel.Scene, clpeel.Camera]]:
    """Yield the scenes of another benchmark, or none if the folder has none."""
    path = Path(folder) / "scenes.py"
    spec = importlib.util.spec_from_file_location("other_scenes", path) if path.is_file() else None
    if spec is None or spec.loader is None:
        return
    os.environ.setdefault("MODELS", str(Path(folder).parent / "models"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name in ("dragon", "boxes", "grass", "spheres"):
        vertices, faces, rgba = module.named(name)
        yield name, clpeel.Scene.from_arrays(vertices, faces, face_colors=rgba), VIEW


def measured(
    renderer: clpeel.Renderer,
    camera: clpeel.Camera,
    size: tuple[int, int],
    technique: AnyTechnique,
    lighting: Lighting,
    options: Options,
) -> tuple[float, float]:
    """Return the seconds of the technique's own stage, and of all stages: the least of several frames."""
    given: dict[str, Any] = dict(options.given())
    least = (np.inf, np.inf)
    spent = 0.0
    for repeat in range(REPEATS + 1):
        stats = renderer.render(
            camera, size, technique.name, lighting=lighting, samples=1, keep_color=False, **given
        ).stats
        seconds = dict(stats.seconds)
        spent += seconds.pop("total")
        seconds.pop("host")
        if repeat:
            own = sum(value for stage, value in seconds.items() if stage not in ("projection", "binning"))
            least = min(least[0], own), min(least[1], sum(seconds.values()))
        if repeat and spent > MOST_SECONDS:
            break
    return least


def counted_at_rest(renderer: clpeel.Renderer, camera: clpeel.Camera, size: tuple[int, int]) -> Counted:
    """Return the counts, with the least seconds of several tries."""
    scene = upload(renderer.gpu, renderer.scene)
    tries = [count_layers(renderer.gpu, scene, camera, size, True) for _ in range(REPEATS + 1)]
    setup = min(tried.setup_seconds for tried in tries[1:])
    return replace(tries[-1], setup_seconds=setup, walk_seconds=min(tried.walk_seconds for tried in tries[1:]))


def fitted(rows: list[Row]) -> NDArray[np.float64]:
    """Return the costs, none below zero, for which work times costs is closest to seconds.

    Closest means the least squares of the errors, each as a share of its frame's time.
    """
    work = np.array([row for row, _, _ in rows]) * 1e-9
    seconds, whole = (np.array([row[k] for row in rows]) for k in (1, 2))
    scaled, wanted = work / whole[:, None], seconds / whole
    best, found = np.inf, np.zeros(work.shape[1])
    for chosen in range(1, 2 ** work.shape[1]):  # all sets of non-zero costs, of which there are few
        columns = [k for k in range(work.shape[1]) if chosen >> k & 1]
        part, *_ = np.linalg.lstsq(scaled[:, columns], wanted, rcond=None)
        error = float(((scaled[:, columns] @ part - wanted) ** 2).sum())
        if (part >= 0).all() and error < best - 1e-9:
            best = error
            found = np.zeros(work.shape[1])
            found[columns] = part
    return found


def off_by(estimates: list[float], truths: list[float]) -> str:
    """Return by which factor estimates are off: the median, and the greatest."""
    factors = np.exp(np.abs(np.log(np.array(estimates) / np.array(truths))))
    return f"{np.median(factors):.2f}, {factors.max():.2f}"


def main() -> None:
    """Measure, fit and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", help="number or part of a name, as 'clpeel devices' shows them")
    parser.add_argument("--scenes", default=os.path.join(os.environ.get("CLPEEL_SHARED", ""), "bench"))
    parser.add_argument(
        "--fit", action=argparse.BooleanOptionalAction, default=True, help="or check the table there is"
    )
    options = parser.parse_args()
    trials = [(each, variant) for each in TECHNIQUES.values() for variant in each.variants()]
    rows: dict[Variant, list[tuple[Counted, bool, AnyTechnique, Options, float, float]]] = {}
    counting: list[Row] = []
    kept: list[
        tuple[str, AnyTechnique, Options, bool, str, Counted, float]
    ] = []  # the measured times to compare the estimates with
    scenes = [("fit", *one) for one in calibration()] if options.fit else []
    for group, label, scene, camera in [*scenes, *(("others", *one) for one in others(options.scenes))]:
        renderer = clpeel.Renderer(scene, options.device)
        for size in (SIZE if group == "fit" else OTHERS_SIZE,):
            counted = counted_at_rest(renderer, camera, size)
            if group == "fit":
                tiles = counted.tiles
                walked = (
                    float(tiles.records.sum()),
                    float((tiles.totals["visits"] + tiles.totals["opaque_visits"]).sum()),
                    tiles.pixels,
                )
                counting.append((walked, counted.walk_seconds, counted.walk_seconds))
            for lighting in LIGHTINGS:
                lit = lighting != "none"
                for technique, variant in trials:
                    own, whole = measured(renderer, camera, size, technique, lighting, variant)
                    nothing = counted.tiles.features.surfaces == "opaque" and not technique.all_surfaces
                    if group == "fit":
                        row = OPAQUE_ROW if nothing else technique.variant(variant)
                        rows.setdefault(row, []).append((counted, lit, technique, variant, own, whole))
                    kept.append((group, technique, variant, lit, label, counted, whole))
        print(f"{label} done", file=sys.stderr, flush=True)
    if options.fit:
        # The costs of a walk are fitted first, because the work of the techniques is expressed in them.
        costs = costs_of(counted.tiles.vector_width)
        for part, cost in zip(("record", "visit", "pixel"), fitted(counting), strict=True):
            costs.__dict__[part] = float(cost)
            print(f"{part}={cost:.3g},")
        table = {
            name: fitted(
                [
                    (astuple(work_of(which, counted.tiles, lit, variant)), own, whole)
                    for counted, lit, which, variant, own, whole in found
                ]
            )
            for name, found in rows.items()
        }
        heads = [field.name for field in fields(Cost)]
        for name, found in table.items():
            shown = ", ".join(f"{head}={value:.3g}" for head, value in zip(heads, found, strict=True))
            print(f"{name!r:<60} Cost({shown})")
        costs.all_opaque.__dict__.update(Cost(*table.pop(OPAQUE_ROW)).__dict__)
        costs.drawing.update({name: Cost(*found) for name, found in table.items()})
    print("\nestimates are off by a factor of (half of them at most, all): on the scenes of the fit, on others")
    both = [
        (which.label(variant), one, estimated_seconds(which, counted, lit, variant), whole)
        for one in kept
        for _, which, variant, lit, _, counted, whole in (one,)
    ]
    for label in dict.fromkeys(label for label, *_ in both):
        cells = []
        for group in ("fit", "others"):
            pairs = [(guess, truth) for which, one, guess, truth in both if (which, one[0]) == (label, group) and guess]
            cells.append(off_by(*map(list, zip(*pairs, strict=True))) if pairs else "-")
        print(f"{label:<40} {cells[0]:<12} {cells[1]}")
    print("\nothers: estimated / measured seconds")
    for label, (group, _, _, lit, place, counted, _), guess, truth in both:
        if group == "others" and guess is not None:
            height, width = counted.layers.shape
            kind = f"{place:<8} {width:>4} x {height:<4} {'lit' if lit else 'flat':<4}"
            print(f"{kind} {label:<40} {guess:.4f} / {truth:.4f} = {guess / truth:.2f}")


if __name__ == "__main__":
    main()
