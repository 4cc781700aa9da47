"""Plots of the figures, drawn with matplotlib if it is installed, in colours that the colour-blind can distinguish."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from itertools import cycle
from typing import Any

from benchmark.figures import digits
from benchmark.runs import Values

# The palette of Okabe and Ito.
COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#000000")
GREY = "#767676"
STYLE = {
    "font.size": 11,
    "axes.titlesize": 13,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.w_pad": 0.12,
    "figure.constrained_layout.h_pad": 0.08,
}


def series(axes: Any, values: Values, factor: float, unit: str) -> None:
    """Draw medians with their spread against counts, on two logarithmic axes, with the target's line."""
    points, reference = values["ns"], values["reference"]
    counts = [int(count) for count in points]
    medians = [one["median"] for one in points.values()]
    off = [[abs(one[end] - one["median"]) for one in points.values()] for end in ("least", "greatest")]
    axes.errorbar(
        counts, medians, yerr=off, color=COLORS[0], marker="o", linewidth=2, capsize=4, label="median, least, greatest"
    )
    bound = factor * points[reference]["median"]
    label = f"target: {factor:g} times that of {int(reference):,} {unit}"
    axes.axhline(bound, color=COLORS[5], linestyle="--", label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = min([*medians, bound]), max([*medians, bound])
    middle = (low * high) ** 0.5
    axes.set_ylim(min(low * 0.6, middle / 4), max(high * 2, middle * 4))
    axes.set_xticks(counts, [f"{count:,}" for count in counts])
    axes.minorticks_off()
    ticks = [tick for power in range(-1, 7) for tick in (10.0**power, 2 * 10.0**power, 5 * 10.0**power)]
    low, high = axes.get_ylim()
    ticks = [tick for tick in ticks if low <= tick <= high]
    axes.set_yticks(ticks, [f"{tick:,g}" for tick in ticks])
    axes.grid(True)
    label_box = {"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.8}
    for count, one in zip(counts, points.values(), strict=True):
        place = {"xytext": (0, 8), "textcoords": "offset points", "ha": "center", "bbox": label_box}
        axes.annotate(digits(one["median"]), (count, one["greatest"]), **place)
    axes.legend(loc="upper right", frameon=False)


def layers(axes: Any, values: Values) -> None:
    series(axes, values, 3, "layers")
    axes.set(title="Time per fragment against layers", xlabel="layers in every pixel", ylabel="ns per fragment")


def pixels(axes: Any, values: Values) -> None:
    series(axes, values, 1.3, "pixels a side")
    axes.set(title="Time per fragment against pixels, in 512 MiB", xlabel="pixels a side", ylabel="ns per fragment")


def triangles(axes: Any, values: Values) -> None:
    series(axes, values, 1.3, "triangles")
    axes.set(
        title="Time per triangle against triangles of less than a pixel", xlabel="triangles", ylabel="ns per triangle"
    )


def stages(axes: Any, values: Values) -> None:
    names = [key for key in dict.fromkeys(key for one in values.values() for key in one["seconds"]) if key != "total"]
    left = [0.0] * len(values)
    for name, color in zip(names, cycle(COLORS), strict=False):
        widths = [1e3 * one["seconds"].get(name, {"median": 0.0})["median"] for one in values.values()]
        axes.barh(list(values), widths, 0.6, left, label=name, color=color, edgecolor="white", linewidth=0.8)
        left = [a + b for a, b in zip(left, widths, strict=True)]
    for place, total in enumerate(left):
        axes.annotate(f"{total:.0f} ms", (total, place), (5, 0), textcoords="offset points", va="center")
    axes.invert_yaxis()
    axes.set_xlim(0, max(left) * 1.12)
    axes.grid(True, axis="x")
    axes.set(title="Where the time of a frame goes", xlabel="milliseconds")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=len(names), frameon=False, columnspacing=1.2)


def beside(title: str, peer: str, key: str, text: str) -> Callable[[Any, Values], None]:
    """Return a function that draws bars of both renderers for each scene."""

    def draw(axes: Any, values: Values) -> None:
        for shift, who, color, label in ((-0.2, "clpeel", COLORS[0], "clpeel, exact"), (0.2, "vtk", COLORS[1], peer)):
            seconds = [one[who]["median"] for one in values.values()]
            off = [
                [abs(one[who][end] - one[who]["median"]) for one in values.values()] for end in ("least", "greatest")
            ]
            places = [place + shift for place in range(len(values))]
            axes.barh(places, seconds, 0.38, xerr=off, color=color, ecolor=GREY, capsize=3, label=label)
            for place, one in zip(places, values.values(), strict=True):
                words = f"{digits(one[who]['median'])} s" + ("" if who == "vtk" else text.format(one[key]["median"]))
                axes.annotate(words, (one[who]["greatest"], place), (6, 0), textcoords="offset points", va="center")
        axes.set_yticks(range(len(values)), list(values))
        axes.tick_params(axis="y", length=0)
        axes.invert_yaxis()
        axes.set_xlim(0, 1.22 * max(one[who]["greatest"] for one in values.values() for who in ("clpeel", "vtk")))
        axes.grid(True, axis="x")
        axes.set(title=title, xlabel="seconds a frame, on the same processor cores")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False)

    return draw


def auto(axes: Any, values: Values) -> None:
    """Draw a row for each scene, with a mark for each choice."""
    names = list(next(iter(values.values()))["seconds"])
    for name, marker, color in zip(names, cycle("osDv^<>Ph"), cycle((COLORS[5], *COLORS[:5])), strict=False):
        places = [place + (0.22 if name == "auto" else -0.05) for place in range(len(values))]
        seconds = [one["seconds"][name]["median"] * 1e3 for one in values.values()]
        size = 110 if name == "auto" else 55
        axes.scatter(seconds, places, size, color, marker, label=name, edgecolors="white", linewidths=0.8, zorder=3)
    for place, one in enumerate(values.values()):
        text = f"{digits(one['seconds']['auto']['median'] * 1e3)} ms, {one['times']['median']:.2f} times the best"
        at = one["seconds"]["auto"]["median"] * 1e3, place + 0.22
        axes.annotate(text, at, (9, 0), textcoords="offset points", va="center")
    axes.set_yticks(range(len(values)), list(values))
    axes.set_ylim(len(values) - 0.4, -0.5)
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    ticks = [tick for power in range(-1, 6) for tick in (10.0**power, 2 * 10.0**power, 5 * 10.0**power)]
    axes.set_xticks([tick for tick in ticks if low <= tick <= high], [f"{t:g}" for t in ticks if low <= t <= high])
    axes.minorticks_off()
    axes.grid(True, axis="x")
    axes.set(title="auto beside each choice by itself, error 1/255", xlabel="milliseconds a frame")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=5, frameon=False, columnspacing=1.2)


def errors(axes: Any, values: Values) -> None:
    """Draw against the error how many times as fast each technique is."""
    for (name, one), color, marker in zip(values.items(), cycle(COLORS[:4]), cycle("osDv"), strict=False):
        speeds = [1.0, *(times["median"] for times in one["times"].values())]
        solid = name.startswith(next(iter(values)).partition(",")[0])
        axes.plot(range(len(speeds)), speeds, color=color, marker=marker, linestyle="-" if solid else "--", label=name)
    axes.set_xticks(range(len(speeds)), ["none", *one["times"]])
    axes.set_ylim(0)
    axes.grid(True)
    axes.set(title="What a guaranteed error saves", xlabel="error in any channel", ylabel="times as fast as with none")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def features(axes: Any, values: Values) -> None:
    """Draw a bar for each feature: the mean over the scenes, with a line from the least to the greatest."""
    names = [name.replace("`", "") for name in values]
    times = [[one["median"] for one in scenes.values()] for scenes in values.values()]
    means = [math.prod(one) ** (1 / len(one)) for one in times]
    off = [
        [m - min(o) for m, o in zip(means, times, strict=True)],
        [max(o) - m for m, o in zip(means, times, strict=True)],
    ]
    axes.barh(names, means, 0.6, xerr=off, color=COLORS[0], ecolor=GREY, capsize=3)
    for place, (mean, one) in enumerate(zip(means, times, strict=True)):
        axes.annotate(f"{mean:.2f}", (max(one), place), (6, 0), textcoords="offset points", va="center")
    axes.axvline(1, color=COLORS[5], linestyle="--")
    axes.invert_yaxis()
    axes.set_xscale("log")
    ticks = (0.25, 0.5, 1, 2, 4, 8, 16, 32, 64)
    axes.set_xlim(0.2, 2 * max(map(max, times)))
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(True, axis="x")
    axes.set(title="What a feature costs", xlabel="times the frame without it: mean of the scenes, least and greatest")


PLOTS: dict[str, Callable[[Any, Values], None]] = {
    "peeling": beside(
        "Exact pictures: clpeel beside VTK", "VTK, dual depth peeling", "times", "  ({:.0f} times as fast)"
    ),
    "unsorted": beside(
        "An exact picture beside an unsorted one",
        "VTK, one unsorted pass (wrong picture)",
        "share",
        "  ({:.2g} of its time)",
    ),
    "layers": layers,
    "pixels": pixels,
    "triangles": triangles,
    "stages": stages,
    "auto": auto,
    "errors": errors,
    "features": features,
}


def draw(found: Values) -> dict[str, bytes]:
    """Return a PNG for each figure that has a plot and was measured. Raises ImportError without matplotlib."""
    import matplotlib
    from matplotlib.figure import Figure

    pictures = {}
    for name, plot in PLOTS.items():
        values = found["figures"].get(name, {}).get("values")
        if not values:
            continue
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(8, 4.5))
            plot(figure.subplots(), values)
            data = io.BytesIO()
            figure.savefig(data, format="png", dpi=110)
        pictures[name] = data.getvalue()
    return pictures
