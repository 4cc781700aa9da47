"""Builds the API reference, HTML of the docstrings, by pdoc: python tools/api_reference.py [-o FOLDER]

It needs pdoc: pip install 'clpeel[docs]'. A warning of pdoc, a name without a docstring and a link that leads nowhere
are errors. Exit codes: 0 done, 1 something is missing, 2 bad input.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import re
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "build" / "api"
MODULES = ("clpeel", "clpeel.rendering.keywords", "clpeel.scene.lights")
"""What the reference has: the names of clpeel; the keywords of `render` and the lights, in modules of their own."""


def build(folder: Path) -> list[str]:
    """Build the reference into a folder, and return what is wrong with it, a line each.

    Raises ImportError without pdoc.
    """
    import pdoc

    # Where pdoc finds a folder of a module's name in the current one, it warns that it might be meant.
    with (
        tempfile.TemporaryDirectory() as empty,
        contextlib.chdir(empty),
        warnings.catch_warnings(record=True) as caught,
    ):
        warnings.simplefilter("always")
        pdoc.render.configure(docformat="markdown", show_source=False, footer_text="clpeel")
        pdoc.pdoc(*MODULES, output_directory=folder)
    wrong = [f"warning: {warning.message}" for warning in caught]
    return [*wrong, *undocumented(), *dead_links(folder)]


def undocumented() -> Iterator[str]:
    """Yield a line for each function, class, method and property of the reference that has no docstring.

    Fields need none of their own, as the docstring of their class says what they are.
    """
    import pdoc.doc

    for name in MODULES:
        for part in pdoc.doc.Module.from_name(name).members.values():
            if isinstance(part, (pdoc.doc.Class, pdoc.doc.Function)) and not part.name.startswith("_"):
                members = vars(part.obj).items() if isinstance(part, pdoc.doc.Class) else ()
                bare = [f"{part.fullname}.{member}" for member, value in members if is_bare(member, value)]
                yield from (f"{each}: no docstring" for each in (bare if part.docstring else [part.fullname, *bare]))


def is_bare(name: str, value: object) -> bool:
    """Return whether a member of a class is public, a method or a property, and without a docstring."""
    code = isinstance(value, (property, cached_property, classmethod, staticmethod)) or inspect.isfunction(value)
    return code and not name.startswith("_") and not value.__doc__


def dead_links(folder: Path) -> Iterator[str]:
    """Yield a line for each link to a page or a place that is not there."""
    places = {
        page: set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8"))) for page in folder.rglob("*.html")
    }
    for page in places:
        for target in sorted(set(re.findall(r'href="([^"]+)"', page.read_text(encoding="utf-8")))):
            if "${" in target:
                continue  # a template of the search's script
            file, _, place = target.partition("#")
            other = (page.parent / file).resolve() if file else page
            if not re.match(r"[a-z]+:", target) and (not other.is_file() or (place and place not in places[other])):
                yield f"{page.name}: a link to {target}, which is not there"


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    parser = argparse.ArgumentParser(prog="api_reference.py", description=__doc__)
    parser.add_argument("--output", "-o", type=Path, default=OUTPUT, metavar="FOLDER", help="default: build/api")
    options = parser.parse_args(arguments)
    try:
        wrong = build(options.output.resolve())
    except ImportError as error:
        print(f"{error}; the reference needs pdoc: pip install 'clpeel[docs]'", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"--output: {str(options.output)!r}: {error.strerror}", file=sys.stderr)
        return 2
    print("\n".join(wrong) or f"{options.output / 'index.html'}", file=sys.stderr if wrong else sys.stdout)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
