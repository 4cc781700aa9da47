"""Draws contact sheets: the same view of a file by clpeel, PyVista and f3d, side by side.

    python tools/contact_sheet.py --peer-python peers/bin/python    the sheets of docs/materials.md, into docs/materials
    python tools/contact_sheet.py truck duck                        these of them
    python tools/contact_sheet.py part.glb --opacity 0.4 -o sheets  one of another file
    python tools/contact_sheet.py --looks                           the sheets of docs/looks.md, into docs/looks

The files of docs/materials.md come from the folder `models` in the folder that CLPEEL_SHARED names. PyVista and f3d are
run by the Python that --peer-python names: `pip install pyvista f3d`, and libegl1 and libgl1 of the system. A program
that is not there, or cannot read a file, gets an empty cell that says so. A file that is not there is left out.
Exit codes: 0 done, 1 no sheet was made, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmark.runs import SHARED
from sheets.layout import composed, encoded
from sheets.programs import sheet
from sheets.views import DEFAULTS, LOOKS, View

from clpeel.errors import ClpeelError
from clpeel.files import write_whole

DOCS = Path(__file__).resolve().parent.parent / "docs"


def say(text: str) -> None:
    """Print a line of progress."""
    print(text, file=sys.stderr, flush=True)


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line."""
    parser = argparse.ArgumentParser(
        prog="contact_sheet.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME|FILE", help=f"sheets ({', '.join(DEFAULTS)}), or files (default: all sheets)")
    add("--opacity", type=float, metavar="0..1", help="of every surface, in place of the sheet's or the file's")
    add("--looks", action="store_true", help="the sheets of docs/looks.md: each program with its own light and edges")
    add("--lit", action=argparse.BooleanOptionalAction, help="a light at the camera, or colours as they are")
    add("--output", "-o", type=Path, metavar="FOLDER", help="default: docs/materials, or docs/looks")
    add("--peer-python", default=sys.executable, metavar="FILE", help="the Python with PyVista and f3d (default: this)")
    options = parser.parse_args(arguments)
    if not os.access(options.peer_python, os.X_OK):
        parser.error(f"--peer-python: expected a program, got {options.peer_python!r}")
    if options.opacity is not None and not 0 <= options.opacity <= 1:
        parser.error(f"--opacity: expected a number 0..1, got {options.opacity:g}")
    options.output = options.output or DOCS / ("looks" if options.looks else "materials")
    return options


def views(options: argparse.Namespace) -> list[View]:
    """Return the views that were asked for. Those whose file is not there are left out, with a line that names it."""
    found, known = [], LOOKS if options.looks else DEFAULTS
    for name in options.names or known:
        if name in known:
            file, seen = known[name]
            view = View(name, SHARED / "models" / file, **seen)
        else:
            view = View(Path(name).stem, Path(name), own=options.looks)
        given = {key: getattr(options, key) for key in ("opacity", "lit") if getattr(options, key) is not None}
        if view.model.is_file():
            found.append(replace(view, **given))
        else:
            say(f"{name} left out: no file {str(view.model)!r}")
    return found


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    options = parse(arguments)
    made = 0
    with tempfile.TemporaryDirectory(prefix="clpeel-sheets-") as scratch:
        for view in views(options):
            try:
                cells = sheet(view, Path(scratch), os.path.abspath(options.peer_python), dict(os.environ), say)
                options.output.mkdir(parents=True, exist_ok=True)
                suffix, data = encoded(composed(view.title, cells))
                path = options.output / f"{view.name}{suffix}"
                write_whole(path, data)
            except ClpeelError as error:
                say(f"{view.name} left out: {error}")
            else:
                made += 1
                say(f"{view.name}: {path}")
    return 0 if made else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
