"""Measures the errors of pictures at the extremes, and draws them with their bounds, as docs/extremes.md shows them.

    python tools/plot_extremes.py --output docs/extremes --report docs/extremes.md
    python tools/plot_extremes.py --only depth,origin

Tables go to standard output, and with --report also between the markers of a document. Plots go to the folder --output
as PNG, which needs matplotlib (pip install '.[bench]'). The last figure needs a folder with scenes.py, and vtk_peer.py
with VTK (pip install vtk): `bench` in the folder that CLPEEL_SHARED names. If something is missing, the tool says so
and goes on. Nothing is timed, and all scenes come from fixed seeds, so the same numbers come out each time. It takes a
minute or two.
Exit codes: 0 done, 1 failed, 2 bad input, 3 no such OpenCL device, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from benchmark.report import between_markers, piped
from extremes.measure import (
    COUNTED,
    DETAIL,
    NEAR,
    SHARE,
    UNIT,
    Figures,
    Points,
    Report,
    Series,
    against_alpha,
    against_distance,
    against_layers,
    against_range,
    edges_moved,
    float32_bound,
    half_bound,
    in_8_bits,
    over_bound,
    reversed_resolution,
    sums_of,
    window_resolution,
)

from clpeel.errors import ClpeelError, NoDeviceError

COUNTS = [4**k for k in range(9)]
QUICK_COUNTS = [1, 16, 256]
FIXED_ALPHA = 0.01
RANDOM = "random alphas, 10⁻⁴ to 1"
LAYERS = 1000
ALPHAS = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 1 / 255, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9]
SUM_ALPHAS = (1.0, 0.5, 0.1)
SUM_COUNTS = [2**k for k in range(2, 14)]
RATIOS = [2.5, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7]
DISTANCES = [10.0**k for k in range(9)]
Values = dict[str, Any]


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        stop(message)


def stop(message: str, code: int = 2) -> NoReturn:
    """Print an error of one line and exit."""
    print(f"plot_extremes: error: {message}", file=sys.stderr)
    raise SystemExit(code)


def say(text: str) -> None:
    """Print a line of progress."""
    print(text, file=sys.stderr, flush=True)


class Progress:
    """Prints a line for each part of a figure."""

    def __init__(self, figure: str) -> None:
        self.figure = figure

    def __call__(self, text: str) -> None:
        say(f"{self.figure}: {text}")


# --- what is measured -------------------------------------------------------------------------------------------------


def layers(quick: bool, device: str | None, report: Report) -> Values:
    counts = QUICK_COUNTS if quick else COUNTS
    return {
        f"a = {FIXED_ALPHA:g}": against_layers(counts, FIXED_ALPHA, report, device),
        RANDOM: against_layers(counts, None, report, device, seeds=1 if quick else 4),
    }


def alpha(quick: bool, device: str | None, report: Report) -> Values:
    count, alphas = (100, [0.01, 0.5]) if quick else (LAYERS, ALPHAS)
    return {"errors": against_alpha(alphas, count, report, device), "layers": count}


def sums(quick: bool, device: str | None, report: Report) -> Series:
    return sums_of(SUM_ALPHAS, [4, 4096] if quick else SUM_COUNTS, report, device)


def depth(quick: bool, device: str | None, report: Report) -> Series:
    return against_range([10.0, 1e4] if quick else RATIOS, report, device, 12 if quick else 24)


def origin(quick: bool, device: str | None, report: Report) -> Values:
    size = 64 if quick else 512
    moved = against_distance([1.0, 1e4] if quick else DISTANCES, report, device, size)
    return {"moved": moved, "least": edges_moved(0.0, size, device=device)[1]}


def steps(quick: bool, device: str | None, report: Report) -> dict[str, Figures]:
    found, missing = in_8_bits(report, size=128 if quick else 1024, device=device)
    if missing:
        report(f"left out: {missing}")
    return found


# --- as tables --------------------------------------------------------------------------------------------------------

Rows = list[list[str]]


def number(value: float | None) -> str:
    """Return a number with two digits, or a dash if it was not measured."""
    return "-" if value is None else "0" if value == 0 else f"{value:.1e}"


def places(found: Series) -> list[float]:
    """Return all places where anything was measured, in order."""
    return sorted({at for points in found.values() for at in points})


def rows_of(heading: str, found: Series, bounds: dict[str, Points], cells: Callable[[float], str]) -> Rows:
    """Return a row for each series and bound, with a column for each place."""
    columns = places(found)
    rows = [[heading, *map(cells, columns)]]
    return rows + [[name, *(number(points.get(at)) for at in columns)] for name, points in (found | bounds).items()]


def tables(found: Values) -> str:
    """Return all measurements as Markdown tables."""
    parts: list[tuple[str, Rows]] = []
    for title, series in found.get("layers", {}).items():
        counts = places(series)
        bounds = {
            "*3 N 2⁻²⁴*": {count: float32_bound(count) for count in counts},
            "*(N - 1) 2⁻¹¹*": {count: half_bound(count) for count in counts if half_bound(count) <= 1},
        }
        rows = rows_of("layers", series, bounds, lambda count: f"{count:,.0f}")
        parts.append((f"Greatest error of a channel against the number of layers, {title}", rows))
    if "alpha" in found:
        errors, count = found["alpha"]["errors"], found["alpha"]["layers"]
        bounds = {"*0.5 / a steps of 8 bits*": {at: over_bound(at) for at in places(errors)}}
        rows = rows_of("alpha", errors, bounds, lambda at: f"{at:.3g}")
        parts.append((f"Greatest error of a channel against alpha, {count:,} equal layers", rows))
    if "sums" in found:
        heading = [[f"alpha, of {max(places(found['sums'])):,.0f} layers", "sum in 16-bit floats", "N a"]]
        body = [
            [name, f"{points[max(points)]:,g}", f"{float(name) * max(points):,g}"]
            for name, points in found["sums"].items()
        ]
        parts.append(("Where sums stick", heading + body))
    if "depth" in found:
        ratios = places(found["depth"])
        bounds = {
            "*2⁻²³*": {ratio: reversed_resolution() for ratio in ratios},
            "*Z 2⁻²⁴ / near*": {ratio: window_resolution(SHARE * NEAR * ratio, NEAR) for ratio in ratios},
        }
        rows = rows_of("far / near", found["depth"], bounds, lambda ratio: f"{ratio:,g}")
        parts.append(("Least separation that is told apart, of the distance Z, half way to the far plane", rows))
    if "origin" in found:
        moved = found["origin"]["moved"]
        bounds = {
            "*float32 positions, D 2⁻²⁴*": {at: at * UNIT / DETAIL for at in places(moved)},
            "*float64 positions, D 2⁻⁵³*": {at: at * 2.0**-53 / DETAIL for at in places(moved)},
        }
        rows = rows_of("distance from the origin", moved, bounds, lambda at: f"{at:,g}")
        parts.append((f"How far edges are moved, of the detail of {DETAIL:g}", rows))
    if found.get("steps"):
        names = [f"> {k}" for k in COUNTED]
        heading = [["pixels off by more steps than", *map(str, COUNTED), "> 2, of covered", "greatest", "RMS, steps"]]
        body = [
            [
                name,
                *(percent(figures[key]) for key in [*names, "> 2, of covered pixels"]),
                f"{figures['greatest']:.0f}",
                f"{figures['rms']:.2f}" if figures["rms"] else "0",
            ]
            for name, figures in found["steps"].items()
        ]
        parts.append(("Pictures of 8 bits beside float64's, grass", heading + body))
    return "\n\n".join(f"**{title}**\n\n" + "\n".join(piped(rows)) for title, rows in parts) + "\n"


def percent(share: float) -> str:
    """Return a share of 1 as a percentage."""
    return "0" if share == 0 else f"{share:.1%}" if share > 0.0005 else f"{100 * share:.1g}%"


FIGURES: dict[str, Callable[[bool, str | None, Report], Any]] = {
    "layers": layers,
    "alpha": alpha,
    "sums": sums,
    "depth": depth,
    "origin": origin,
    "steps": steps,
}


# --- the command ------------------------------------------------------------------------------------------------------


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, checked before anything is measured."""
    parser = Parser(prog="plot_extremes.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--output", "-o", type=Path, metavar="FOLDER", help="write the plots there, NAME.png")
    add("--report", type=Path, metavar="FILE", help="renew the tables between the markers of a document")
    add("--only", metavar="NAME,...", help=f"some of {', '.join(FIGURES)} (default: all)")
    add("--quick", action="store_true", help="a few small ones of each, to see that it works")
    add("--device", metavar="DEVICE", help="number, or part of a name, as 'clpeel devices' shows them")
    options = parser.parse_args(arguments)
    options.only = options.only.split(",") if options.only else list(FIGURES)
    for name in options.only:
        if name not in FIGURES:
            stop(f"--only: expected some of {', '.join(FIGURES)}; got {name!r}")
    if options.report:
        renewed(options.report, "")
    if options.output:
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            stop("--output: matplotlib is not installed (pip install '.[bench]')")
        try:
            options.output.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            stop(f"--output: {str(options.output)!r}: {error.strerror}")
    return options


def renewed(document: Path, text: str) -> str:
    """Return a document with a new text between its markers."""
    try:
        return between_markers(document.read_text(encoding="utf-8"), text)
    except OSError as error:
        stop(f"--report: {str(document)!r}: {error.strerror}")
    except ValueError as error:
        stop(f"--report: {str(document)!r}: {error}")


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    options = parse(arguments)
    found: Values = {}
    for name in options.only:
        found[name] = FIGURES[name](options.quick, options.device, Progress(name))
    text = tables(found)
    print(text, end="")

    from clpeel.files import write_whole

    if options.output:
        from extremes.plots import draw

        for name, data in draw(found).items():
            write_whole(options.output / f"{name}.png", data)
    if options.report:
        write_whole(options.report, renewed(options.report, text).encode())
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except NoDeviceError as error:
        stop(str(error), 3)
    except (ClpeelError, OSError) as error:
        stop(str(error), 1)
