"""Measures how fast clpeel is, compared with VTK and with the limit that memory sets, and says which targets are met.

    python tools/bench.py                                       everything but the soak, in about half an hour
    python tools/bench.py --quick                               less, in a few minutes
    python tools/bench.py --only live --soak 10                 the live view in a browser, and ten minutes of it
    python tools/bench.py --json bench.json --report docs       keeps the numbers; writes them into docs/performance.md
    python tools/bench.py --from bench.json --report docs       the same later, without measuring

Programs and settings that are compared take turns, in new processes each time, so that a machine whose speed drifts
slows them all alike. The table shows the median of the rounds with the least and the greatest. Scenes come from a
folder with scenes.py and vtk_peer.py (VTK without a display), by default `bench` in the folder that CLPEEL_SHARED
names. Without it there is no VTK, and the tool's own scenes are used. The live view is set beside PyVista, if the
Python that --peer-python names has it. When interrupted, the tool writes what it has.
Exit codes: 0 done, whether targets are met or not; 1 something failed, 2 bad input, 3 no such OpenCL device, 130
interrupted.
"""

from __future__ import annotations

import argparse
import datetime
import json
import math
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from benchmark.figures import FIGURES, digits
from benchmark.live import SOAK_MINUTES
from benchmark.report import VERDICTS, as_markdown, as_text, between_markers, bound, machine
from benchmark.runs import QUICK, SCENES, SHARED, Bench, Failed, Settings, Skipped, Values


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        stop(message)


def stop(message: str, code: int = 2) -> NoReturn:
    """Print an error of one line and exit."""
    print(f"bench: error: {message}", file=sys.stderr)
    raise SystemExit(code)


def say(text: str) -> None:
    """Print a line of progress."""
    print(text, file=sys.stderr, flush=True)


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, checked. Nothing slow begins before the request is known to be possible."""
    parser = Parser(
        prog="bench.py",
        description=__doc__,
        epilog="Figures: " + ", ".join(FIGURES),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="SCENE", help=f"which of {', '.join(SCENES)} to use (default: all)")
    add("--quick", action="store_true", help="fewer rounds and smaller scenes; the output says what was reduced")
    add("--only", metavar="NAME,...", help="these figures only")
    add("--rounds", type=count, metavar="N", help=f"rounds of each measurement (default: {Settings.rounds})")
    add("--size", type=count, metavar="PIXELS", help=f"side of the picture (default: {Settings.size})")
    add("--triangles", type=count, metavar="N", help=f"of the largest scene (default: {Settings.triangles})")
    add("--scenes", type=Path, metavar="FOLDER", help="with scenes.py and vtk_peer.py")
    add("--device", metavar="DEVICE", help="number, or part of a name, as 'clpeel devices' shows them")
    add(
        "--soak",
        type=minutes,
        metavar="MINUTES",
        help=f"drag the live view for so long and watch its memory (default with --only soak: {SOAK_MINUTES:g})",
    )
    add("--peer-python", metavar="FILE", help="the Python that has PyVista and trame (default: this one)")
    add("--json", type=Path, metavar="FILE", help="write all numbers to a file")
    add(
        "--report",
        type=Path,
        metavar="FOLDER|FILE.md",
        help="renew FOLDER/performance.md, or this FILE.md, between its markers, and its plots",
    )
    add("--from", type=Path, dest="source", metavar="FILE", help="take the numbers from such a file: measure nothing")
    options = parser.parse_args(arguments)
    options.only = options.only.split(",") if options.only else [name for name in FIGURES if name != "soak"]
    if options.soak and "soak" not in options.only:
        options.only.append("soak")
    for name in options.only:
        if name not in FIGURES:
            stop(f"--only: expected some of {', '.join(FIGURES)}; got {name!r}")
    if options.triangles and options.triangles < 10:
        stop(f"--triangles: expected at least 10, got {options.triangles}")
    for name in options.names:
        if name not in SCENES:
            stop(f"scene: expected some of {', '.join(SCENES)}; got {name!r}")
    if options.peer_python and not os.access(options.peer_python, os.X_OK):
        stop(f"--peer-python: expected a program, got {options.peer_python!r}")
    if options.scenes and not (options.scenes / "scenes.py").is_file():
        stop(f"--scenes: no scenes.py in {str(options.scenes)!r}")
    if options.json and not os.access(options.json.parent, os.W_OK):
        stop(f"--json: cannot write into {str(options.json.parent)!r}")
    if options.report:
        renewed(document_of(options.report), "")
    return options


def count(text: str) -> int:
    """Read a whole number of at least 1."""
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number above 0, got {text!r}")
    return int(text)


def minutes(text: str) -> float:
    """Read a number of minutes above 0."""
    try:
        found = float(text)
    except ValueError:
        found = 0.0
    if not 0 < found < math.inf:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got {text!r}")
    return found


def document_of(report: Path) -> Path:
    """Return the document that --report names: itself, or performance.md in a folder."""
    return report if report.suffix == ".md" else report / "performance.md"


def renewed(document: Path, text: str) -> str:
    """Return the document of a report with a new text between its markers."""
    try:
        return between_markers(document.read_text(encoding="utf-8"), text)
    except OSError as error:
        stop(f"--report: {str(document)!r}: {error.strerror}")
    except ValueError as error:
        stop(f"--report: {str(document)!r}: {error}")


def read(source: Path) -> Values:
    """Return the numbers of an earlier run."""
    try:
        found: Values = json.loads(source.read_text(encoding="utf-8"))
        as_text(found)
        return found
    except OSError as error:
        stop(f"--from: {str(source)!r}: {error.strerror}")
    except (ValueError, LookupError, TypeError, AttributeError):
        stop(f"--from: {str(source)!r} was not written by --json")


def settings_of(options: argparse.Namespace) -> Settings:
    """Return what the options ask to measure."""
    given = {name: getattr(options, name) for name in ("rounds", "size", "triangles") if getattr(options, name)}
    if options.rounds:
        given["peer_rounds"] = given["live_rounds"] = options.rounds
    if options.names:
        given["scenes"] = tuple(options.names)
    return replace(QUICK if options.quick else Settings(), **given)


def measure(options: argparse.Namespace) -> Values:
    """Measure the figures that were asked for. When interrupted, return the finished ones."""
    settings = settings_of(options)
    folder = options.scenes or SHARED / "bench"
    folder = folder.resolve() if (folder / "scenes.py").is_file() else None
    found: Values = {"date": datetime.date.today().isoformat(), "machine": machine(), "reduced": settings.reduced}
    found["figures"] = {}
    peer_python = os.path.abspath(options.peer_python or sys.executable)
    bench = Bench(settings, folder, options.device, options.only, peer_python, options.soak or SOAK_MINUTES)
    try:
        try:
            found["machine"] |= bench.measure("device")
        except Failed as failure:
            stop(str(failure).removeprefix("NoDeviceError: "), 3 if "NoDeviceError" in str(failure) else 1)
        for name, figure in FIGURES.items():
            if name in options.only:
                started = time.perf_counter()
                one: Values = {"title": figure.title}
                try:
                    one |= figure.measure(bench)
                except Skipped as reason:
                    one["skipped"] = str(reason)
                except Failed as reason:
                    one["failed"] = str(reason)
                one["took_s"] = time.perf_counter() - started
                found["figures"][name] = one
                say(f"{name:10}{one['took_s']:5.0f} s  {headline(one)}")
    except KeyboardInterrupt:
        found["interrupted"] = True
        say("interrupted")
    finally:
        found["missing"] = bench.missing
        bench.close()
    return found


def headline(one: Values) -> str:
    """Return a figure in one line: why it is missing, or its targets."""
    for word in ("skipped", "failed"):
        if word in one:
            return f"{word}: {one[word]}"
    return "; ".join(
        f"{digits(target['value'])}, {bound(target)}: {VERDICTS[target['met']]}" for target in one["targets"]
    )


def write_report(report: Path, found: Values) -> None:
    """Write the document's data part.

    If matplotlib is installed, also write its plots, into a folder of the same name.
    """
    from clpeel.files import write_whole

    pictures: dict[str, bytes] = {}
    try:
        from benchmark.plots import draw

        pictures = draw(found)
    except ImportError:
        say("plots left out: matplotlib is not installed (pip install '.[bench]')")
    document = document_of(report)
    folder = document.with_suffix("")
    if pictures:
        folder.mkdir(exist_ok=True)
    for name, data in pictures.items():
        write_whole(folder / f"{name}.png", data)
    text = renewed(document, as_markdown(found, [f"{folder.name}/{name}.png" for name in pictures]))
    write_whole(document, text.encode())


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    options = parse(arguments)
    found = read(options.source) if options.source else measure(options)
    print(as_text(found), end="")

    from clpeel.errors import ClpeelError
    from clpeel.files import write_whole

    try:
        if options.json:
            write_whole(options.json, (json.dumps(found, indent=1) + "\n").encode())
        if options.report:
            write_report(options.report, found)
    except (ClpeelError, OSError) as error:
        stop(str(error), 1)
    if found.get("interrupted"):
        return 130
    return 1 if any("failed" in one for one in found["figures"].values()) else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
