"""Plots how far k-buffer is from the exact picture, by how many layers it keeps: python tools/plot_kept_layers.py.

It writes docs/techniques/kept-layers.png, and prints the numbers as the lines of the table that docs/techniques.md has
beside it. The scenes are the demo, and the boxes and the grass of scenes.py in the folder `bench` of the folder that
CLPEEL_SHARED names. It needs matplotlib.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
from benchmark.makers import CAMERA, make
from benchmark.plots import COLORS, GREY, STYLE
from benchmark.runs import SHARED
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

import clpeel
from clpeel.files import write_whole
from clpeel.scene.demo import DIRECTION, ZOOM, demo_scene

OUTPUT = Path(__file__).resolve().parent.parent / "docs" / "techniques" / "kept-layers.png"
SIZE = (400, 300)
KEPT = (0, 1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40)
RULES: tuple[Literal["depth", "arrival"], ...] = ("depth", "arrival")
LEAST = 1e-8
"""The place where the plot shows an error of zero, because a logarithmic axis has no zero."""

OTHERS: dict[str, dict[str, Any]] = {
    "weighted-average": {},
    "weighted-blended": {},
    "wavelet, rank 2": {"wavelet_rank": 2},
    "wavelet, rank 3": {},
}
"""Techniques of the table, with their options."""

Errors = dict[str, tuple[float, float]]
"""Mean and greatest error of the pixels that show anything, 0..1 of a channel, by the technique and what it keeps."""


def scenes() -> Iterator[tuple[str, clpeel.Scene, clpeel.Camera]]:
    """Yield the name, the scene and the camera of each picture."""
    demo = demo_scene()
    yield "demo", demo, clpeel.Camera.frame(demo, DIRECTION, aspect=SIZE[0] / SIZE[1]).zoom(ZOOM)
    sys.path.append(str(SHARED / "bench"))
    for name in ("boxes", "grass"):
        yield name, make(name, {}), CAMERA


def errors(scene: clpeel.Scene, camera: clpeel.Camera) -> tuple[int, Errors]:
    """Return the layers of the deepest pixel, and the errors of all techniques."""
    renderer = clpeel.Renderer(scene)
    exact = renderer.render(camera, SIZE, "sort", "white", "none", samples=1)

    def error(technique: str, **options: Any) -> tuple[float, float]:
        color = renderer.render(camera, SIZE, technique, "white", "none", samples=1, **options).color
        off = np.abs(color - exact.color).max(axis=2)[exact.color[..., 3] > 0]
        return float(off.mean()), float(off.max())

    found = {name: error(name.partition(",")[0], **options) for name, options in OTHERS.items()}
    for rule in RULES:
        found |= {f"{rule} {k}": error("k-buffer", kept_layers=k, kept_by=rule) for k in KEPT}
    return exact.stats["layers_max"], found


def plot(axes: Any, name: str, layers: int, found: Errors, place: int) -> None:
    """Draw the errors of one scene against the layers that are kept. place: of the plot, from the left."""
    words = {"depth": "the nearest", "arrival": "the first to arrive"}
    for rule, color, style in (("depth", COLORS[0], "-"), ("arrival", COLORS[5], "--")):
        means = [max(found[f"{rule} {k}"][0], LEAST) for k in KEPT]
        axes.plot(KEPT, means, style, color=color, marker="o", markersize=4, linewidth=1.8, label=words[rule])
    axes.axhline(found["wavelet, rank 3"][0], color=GREY, linestyle=":", label="wavelet, rank 3")
    axes.set(yscale="log", ylim=(LEAST / 2, 1), xlim=(-1, KEPT[-1] + 1), xlabel="layers kept")
    axes.set_yticks([1e-8, 1e-6, 1e-4, 1e-2, 1], ["0", "1e-6", "1e-4", "0.01", "1"])
    axes.minorticks_off()
    axes.set_title(f"{name}, up to {layers} layers")
    axes.grid(True)
    if place == 0:
        axes.set_ylabel("mean error of a pixel, of 1")
    if place == 1:  # the plot with most room
        axes.legend(frameon=False, loc="lower left")


def main() -> None:
    """Measure all scenes, print the table, and write the plot."""
    with rc_context(STYLE):
        figure = Figure(figsize=(11, 3.9))
        columns: list[list[str]] = []
        for number, (name, scene, camera) in enumerate(scenes()):
            layers, found = errors(scene, camera)
            plot(figure.add_subplot(1, 3, number + 1), name, layers, found, number)
            columns.append([f"{mean:.1e}, {most:.1e}" for mean, most in found.values()])
        for key, row in zip(found, zip(*columns, strict=True), strict=True):
            print(f"| {key} | {' | '.join(row)} |")
        data, small = io.BytesIO(), io.BytesIO()
        figure.savefig(data, format="png", dpi=100)
    Image.open(data).convert("RGB").quantize(64).save(small, format="png", optimize=True)
    write_whole(OUTPUT, small.getvalue())


if __name__ == "__main__":
    main()
