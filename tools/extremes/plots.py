"""Draws the measurements with matplotlib.

Each technique has a colour that the colour-blind can distinguish, each precision a line style, and the bounds are grey.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

from benchmark.plots import COLORS, GREY, STYLE
from PIL import Image

from extremes.measure import (
    AS_GIVEN,
    COUNTED,
    DETAIL,
    NEAR,
    PEER,
    ROUNDED,
    SHARE,
    UNIT,
    Figures,
    Points,
    Series,
    float32_bound,
    half_bound,
    over_bound,
    reversed_resolution,
    window_resolution,
)

STYLES = {"float32": "-", "unorm8": (0, (4, 1.5)), "half": (0, (1, 1.2))}
MARKERS = {"float32": "o", "unorm8": "s", "half": "^"}
INKS = (*COLORS[:6], COLORS[7])  # without yellow, which is too faint on white
BOUND = {"color": GREY, "linestyle": "--", "linewidth": 1.3, "zorder": 1}
PLOTTED = COUNTED[:5]
LEAST = 2.0**-27
"""The place where a plot shows an error of zero, because a logarithmic axis has no zero."""
WORDS = {"float32": "float32", "unorm8": "8 bits", "half": "16-bit floats"}


def together(found: Series) -> list[tuple[list[str], str, Points]]:
    """Return the lines to draw: names of techniques, precision, points.

    Series of one precision that agree wherever both were measured share a line, with the points of the longer one.
    """
    lines: list[tuple[list[str], str, Points]] = []
    for name, points in found.items():
        technique, _, precision = name.rpartition(", ")
        for k, (names, held, other) in enumerate(lines):
            common = points.keys() & other.keys()
            if held == precision and common and all(points[at] == other[at] for at in common):
                lines[k] = [*names, technique], precision, max(points, other, key=len)
                break
        else:
            lines.append(([technique], precision, points))
    return lines


def draw_lines(axes: Any, found: Series, techniques: list[str]) -> None:
    """Draw the errors of techniques and precisions on two logarithmic axes, with an error of zero at the bottom."""
    for names, precision, points in together(found):
        color = INKS[techniques.index(names[0]) % len(INKS)]
        label = f"{', '.join(names)}: {WORDS[precision]}"
        shown = [max(error, LEAST) for error in points.values()]
        style = {"linestyle": STYLES[precision], "marker": MARKERS[precision], "markersize": 4, "linewidth": 1.8}
        axes.plot(list(points), shown, color=color, label=label, **style)
    axes.set(xscale="log", yscale="log")
    axes.grid(True)


def key_below(figure: Any, axes: Any, columns: int = 2) -> None:
    """Draw one legend for everything below the axes, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=9.5, handlelength=3.4
    )


def note(axes: Any, text: str, at: tuple[float, float], align: str = "left") -> None:
    """Write grey words beside a bound."""
    axes.annotate(text, at, color="#555555", fontsize=9.5, ha=align, va="center")


def names_in(*found: Series) -> list[str]:
    """Return the techniques, in the order in which they were measured."""
    return list(dict.fromkeys(name.rpartition(", ")[0] for one in found for name in one))


def layers(figure: Any, values: dict[str, Series]) -> None:
    both = list(values.items())
    techniques = names_in(*values.values())
    all_axes = figure.subplots(1, len(both), sharey=True, squeeze=False)[0]
    for axes, (title, found) in zip(all_axes, both, strict=True):
        draw_lines(axes, found, techniques)
        counts = sorted({count for points in found.values() for count in points})
        axes.plot(counts, [float32_bound(count) for count in counts], **BOUND)
        axes.plot(counts, [half_bound(count) if count > 1 else float("nan") for count in counts], **BOUND)
        middle = counts[len(counts) // 2]
        note(axes, "3 N 2⁻²⁴", (middle / 1.6, 1.8 * float32_bound(middle)), "right")
        note(axes, "(N - 1) 2⁻¹¹", (800, 1.1), "right")
        if title.startswith("a = "):
            alpha = float(title.removeprefix("a = "))
            axes.axhline(over_bound(alpha), **BOUND)
            note(axes, f"0.5 / a = {0.5 / alpha:.0f} steps of 8 bits", (counts[0], 1.5 * over_bound(alpha)))
        equal = title.startswith("a = ")
        axes.set(
            title=f"Equal layers, {title}" if equal else title.capitalize(), xlabel="layers, N", ylim=(LEAST / 1.6, 3)
        )
    all_axes[0].set_ylabel("greatest error of a channel, of 1")
    key_below(figure, all_axes[0])


def alpha(figure: Any, values: dict[str, Any]) -> None:
    found, count = values["errors"], values["layers"]
    axes = figure.subplots()
    draw_lines(axes, found, names_in(found))
    alphas = sorted({at for points in found.values() for at in points})
    axes.axhline(float32_bound(count), **BOUND)
    axes.plot(alphas, [over_bound(at) for at in alphas], **BOUND)
    note(axes, f"3 N 2⁻²⁴, N = {count:,}", (alphas[-1], 1.6 * float32_bound(count)), "right")
    note(axes, "0.5 / a steps of 8 bits", (0.0042, 0.75))
    axes.set(
        title=f"{count:,} equal layers: error against their alpha",
        xlabel="alpha of a layer",
        ylabel="greatest error of a channel, of 1",
        ylim=(LEAST / 1.6, 3),
    )
    key_below(figure, axes)


def sums(figure: Any, found: Series) -> None:
    axes = figure.subplots()
    for (name, points), color, marker in zip(found.items(), INKS, "os^D", strict=False):
        counts = list(points)
        axes.plot(counts, list(points.values()), color=color, marker=marker, markersize=4, linewidth=1.8, zorder=3)
        axes.plot(counts, [float(name) * count for count in counts], **BOUND)
        text = f"a = {name}: sticks at {points[counts[-1]]:,g}"
        place = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "color": color}
        axes.annotate(text, (counts[-1], points[counts[-1]]), **place)
    top = max(map(float, found)) * counts[-1]
    note(axes, "N a", (counts[-1] * 1.1, top))
    axes.set(xscale="log", yscale="log", xlim=(counts[0] / 1.3, counts[-1] * 14), ylim=(None, top * 2))
    axes.set(xlabel="layers, N", ylabel="sum of white times alpha", title="Sums in 16-bit floats stick")
    axes.grid(True)


def depth(figure: Any, found: Series) -> None:
    axes = figure.subplots()
    styles = (("-", "o"), ((0, (4, 1.5)), "s"), ((0, (1, 1.2)), "^"), ((0, (5, 1, 1, 1)), "D"))
    ratios = sorted({ratio for points in found.values() for ratio in points})
    for k, ((name, points), (style, marker)) in enumerate(zip(found.items(), styles, strict=True)):
        size = {"markersize": 11 - 3 * k if k else 6, "markerfacecolor": "none" if k else COLORS[0], "linewidth": 1.8}
        axes.plot(
            list(points), list(points.values()), color=COLORS[k], linestyle=style, marker=marker, label=name, **size
        )
    axes.plot(ratios, [reversed_resolution()] * len(ratios), **BOUND)
    axes.plot(ratios, [window_resolution(SHARE * NEAR * ratio, NEAR) for ratio in ratios], **BOUND)
    note(axes, "Z 2⁻²³", (ratios[-1], 1.4 * reversed_resolution()), "right")
    note(axes, "Z² 2⁻²⁴ / near", (3e4, 0.35 * window_resolution(SHARE * 3e4, NEAR)))
    axes.set(xscale="log", yscale="log", xlabel="far / near; the surfaces are half way to the far plane")
    axes.set(ylabel="least separation, of the distance Z", title="Two surfaces: what each depth format tells apart")
    axes.grid(True)
    axes.legend(frameon=False, loc="upper left", handlelength=3.4)


def origin(figure: Any, values: dict[str, Any]) -> None:
    found, least = values["moved"], values["least"]
    axes = figure.subplots()
    bottom = least / 3
    labels = {AS_GIVEN: "clpeel: pairs of float32 from the scene's own origin", ROUNDED: ROUNDED}
    for (name, points), color, marker in zip(found.items(), COLORS, "os", strict=False):
        shown = [max(moved, bottom) for moved in points.values()]
        axes.plot(list(points), shown, color=color, marker=marker, linewidth=1.8, label=labels[name], zorder=3)
    distances = list(next(iter(found.values())))
    axes.plot(distances, [distance * UNIT / DETAIL for distance in distances], **BOUND)
    axes.plot(distances, [distance * 2.0**-53 / DETAIL for distance in distances], **BOUND)
    gone = max(found[ROUNDED].values())
    note(axes, "float32's rounding of positions, D 2⁻²⁴", (1.5e4, 0.35))
    note(axes, "float64's, D 2⁻⁵³", (3e6, 4e-8))
    note(axes, "nothing is left of it", (distances[-1], 2.4 * gone), "right")
    note(axes, "no sample differs", (distances[0], 1.9 * bottom))
    axes.set(xscale="log", yscale="log", ylim=(bottom / 200, 10), xlabel="distance from the origin, D")
    axes.set(ylabel=f"edges moved by, of the detail of {DETAIL:g}", title="Detail of 0.001 far from the origin")
    axes.grid(True)
    axes.legend(frameon=False, loc="center right", bbox_to_anchor=(1.0, 0.56))


def steps(figure: Any, found: dict[str, Figures]) -> None:
    axes = figure.subplots()
    shown: dict[tuple[float, ...], list[str]] = {}
    for name, figures in found.items():
        shown.setdefault(tuple(figures[f"> {k}"] for k in PLOTTED), []).append(name)
    width = 0.8 / len(shown)
    for k, (shares, names) in enumerate(shown.items()):
        places = [place + (k - (len(shown) - 1) / 2) * width for place in range(len(PLOTTED))]
        precision = names[0].rpartition(", ")[2]
        label = (
            names[0] if names[0] == PEER else f"{', '.join(n.rpartition(', ')[0] for n in names)}: {WORDS[precision]}"
        )
        axes.bar(places, [100 * share for share in shares], width * 0.95, color=COLORS[k], label=label)
        for place, share in zip(places, shares, strict=True):
            axes.annotate(
                "0" if share == 0 else f"{100 * share:.0f}" if share > 0.0095 else f"{100 * share:.1g}",
                (place, 100 * share),
                (0, 2),
                textcoords="offset points",
                ha="center",
                fontsize=7.5,
            )
    axes.set_xticks(range(len(PLOTTED)), [f"> {k}" for k in PLOTTED])
    axes.set(xlabel="steps of 8 bits off, in any channel", ylabel="share of the pixels, %")
    axes.set_title("Grass, 8-bit pictures beside float64's")
    axes.grid(True, axis="y")
    key_below(figure, axes, 1)


PLOTS: dict[str, tuple[tuple[float, float], Callable[[Any, Any], None]]] = {
    "layers": ((11, 6.6), layers),
    "alpha": ((8, 6.2), alpha),
    "sums": ((7, 4.2), sums),
    "depth": ((7.5, 4.8), depth),
    "origin": ((7.5, 4.8), origin),
    "steps": ((8.5, 5), steps),
}
"""For each figure, its size in inches and the function that draws it."""


def draw(found: dict[str, Any]) -> dict[str, bytes]:
    """Return a PNG for each figure that was measured. Raises ImportError without matplotlib."""
    import matplotlib
    from matplotlib.figure import Figure

    pictures = {}
    for name, (size, plot) in PLOTS.items():
        if not found.get(name):
            continue
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=size)
            plot(figure, found[name])
            data = io.BytesIO()
            figure.savefig(data, format="png", dpi=100)
        small = io.BytesIO()
        # Takes a third of the bytes.
        Image.open(data).convert("RGB").quantize(256).save(small, format="png", optimize=True)
        pictures[name] = small.getvalue()
    return pictures
