"""Writes the results as text: tables for the terminal, and Markdown between two markers of a document."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmark.figures import digits
from benchmark.runs import Values

BEGIN, END = "<!-- bench: begin -->", "<!-- bench: end -->"
VERDICTS = {True: "met", False: "not met", None: "not judged"}


def machine() -> dict[str, Any]:
    """Return what is known of this machine without a device."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": _system(),
        "Python": platform.python_version(),
        **{name: _version(name) for name in ("clpeel", "pyopencl", "vtk")},
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError, AttributeError):
        return platform.system()


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def bound(target: Values) -> str:
    """Return a target's bound as text."""
    return f"{target['sense']} {target['bound']:g}"


def targets_table(found: Values) -> list[list[str]]:
    """Return a table of all targets of all figures, in order."""
    rows = [["figure", "target", "bound", "measured", "result"]]
    for name, figure in found["figures"].items():
        for one in figure.get("targets", []):
            rows.append([name, one["what"], bound(one), digits(one["value"]), VERDICTS[one["met"]]])
    return rows


def remarks(found: Values) -> list[str]:
    """Return remarks on what was skipped, reduced or interrupted."""
    lines = ["broken off: what was finished is here"] if found.get("interrupted") else []
    lines += [f"changed: {text}" for text in found.get("reduced", [])]
    lines += [f"left out: {name}: {reason}" for name, reason in found.get("missing", {}).items()]
    for word in ("skipped", "failed"):
        lines += [f"{word}: {name}: {one[word]}" for name, one in found["figures"].items() if word in one]
    return lines


def aligned(rows: list[list[str]]) -> list[str]:
    """Return columns for the terminal. The first is left-aligned, the others are right-aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [f"{first:<{widths[0]}}", *(f"{text:>{width}}" for text, width in zip(others, widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return lines


def piped(rows: list[list[str]]) -> list[str]:
    """Return the rows as a Markdown table."""
    heading, *body = rows
    rule = ["---", *["--:"] * (len(heading) - 1)]
    return [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in (heading, rule, *body)]


def as_text(found: Values) -> str:
    """Return all results for the terminal."""
    lines = [f"{found['date']}; " + ", ".join(f"{name}: {value}" for name, value in found["machine"].items())]
    for name, figure in found["figures"].items():
        if "table" in figure:
            lines += ["", f"{name}: {figure['title']}", *aligned(figure["table"]), *figure["notes"]]
    table = targets_table(found)
    if len(table) > 1:
        lines += ["", *aligned(table)]
    return "\n".join([*lines, "", *remarks(found)]).rstrip() + "\n"


def as_markdown(found: Values, pictures: Iterable[str] = ()) -> str:
    """Return all results for a document.

    pictures: paths such as `performance/layers.png`. Each is shown below its figure.
    """
    shown = {Path(path).stem: path for path in pictures}
    lines = [f"Measured on {found['date']}:", ""]
    lines += [f"- {name}: {value}" for name, value in found["machine"].items()]
    table = targets_table(found)
    if len(table) > 1:
        lines += ["", "## Targets", "", *piped(table)]
    notes = remarks(found)
    lines += ["", "Not the full measurement:", "", *(f"- {text}" for text in notes)] if notes else []
    for name, figure in found["figures"].items():
        if "table" not in figure:
            continue
        lines += ["", f"## {figure['title']}", "", *piped(figure["table"])]
        lines += [line for note in figure["notes"] for line in ("", f"{note[0].upper()}{note[1:]}.")]
        if name in shown:
            lines += ["", f"![{figure['title']}]({shown[name]})"]
    return "\n".join(lines) + "\n"


def between_markers(document: str, text: str) -> str:
    """Return the document with the text between its markers replaced.

    Raises ValueError unless it has each marker once and in order.
    """
    before, begin, rest = document.partition(BEGIN)
    old, end, after = rest.partition(END)
    if not (begin and end) or BEGIN in old or BEGIN in after or END in after:
        raise ValueError(f"expected the lines {BEGIN} and {END}, once each and in this order")
    return f"{before}{BEGIN}\n\n{text.strip()}\n\n{END}{after}"
