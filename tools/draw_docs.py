"""Makes the pictures of the documentation anew, each by the command that docs/pictures.md names.

    python tools/draw_docs.py                    all that can be made here
    python tools/draw_docs.py samples gallery.md these
    python tools/draw_docs.py --list             which there are, and what each needs
    python tools/draw_docs.py --check [NAME...]  make them, write nothing, and say which pixels differ
    python tools/draw_docs.py --table            renew the table of docs/pictures.md, and nothing else

A picture is written only where its pixels have changed. Pictures of times and those made by hand are left alone.
Exit codes: 0 done, 1 a command failed or, with --check, a picture drawn by clpeel differs; 2 bad input, 130
interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator

from benchmark.report import between_markers
from illustrations.examples import DOCS
from illustrations.registry import KINDS, NEEDS, Entry, entries

from clpeel.errors import ClpeelError
from clpeel.files import write_whole

PAGE = DOCS / "pictures.md"


def say(text: str) -> None:
    """Print a line of progress."""
    print(text, file=sys.stderr, flush=True)


def rows() -> Iterator[str]:
    """Yield the lines of the table: each command, its pictures, and what it needs."""
    yield "| name | pictures | command | drawn | needs |"
    yield "|---|---|---|---|---|"
    for entry in entries():
        shown = ", ".join(f"[{file}]({file})" for file in entry.files())
        command = entry.command if entry.kind == "by hand" else f"`{entry.command}`"
        needs = ", ".join(NEEDS[need].what for need in entry.needs)
        yield f"| {entry.name} | {shown} | {command} | {entry.kind} | {needs} |"


def document() -> str:
    """Return docs/pictures.md with the table of now."""
    return between_markers(PAGE.read_text(encoding="utf-8"), "\n".join(rows()))


def listed() -> Iterator[str]:
    """Yield a line for each entry: its name, how many pictures it makes, how, and what it lacks here."""
    for entry in entries():
        lacks = entry.lacks()
        yield f"{entry.name:16} {len(entry.files()):3}  {entry.command}" + (f"  [not here: {lacks}]" if lacks else "")


def draw(entry: Entry, check: bool) -> bool:
    """Make the pictures of an entry, and write those that have changed, or with `check` none.

    Returns whether all is well.
    """
    from illustrations.remake import Failed, difference, remade

    if lacks := entry.lacks():
        say(f"{entry.name}: left out: {lacks}")
        return True
    say(f"{entry.name}: {entry.command}")
    try:
        found = remade(entry)
    except Failed as failure:
        say(f"{entry.name}: failed: {failure}")
        return False
    well = True
    for file, data in found.items():
        off = difference(file, data)
        if off and not check:
            write_whole(DOCS / file, data)
        if off:
            well = well and not (check and entry.kind == "drawn")
            say(f"{entry.name}: docs/{file} {'differs' if check else 'written'}: {off}")
    return well


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, with the entries that were asked for."""
    parser = argparse.ArgumentParser(
        prog="draw_docs.py",
        description=__doc__,
        epilog="drawn: " + "; ".join(f"{kind}: {text}" for kind, text in KINDS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--list", action="store_true", help="say which entries there are")
    what.add_argument("--check", action="store_true", help="write nothing; say what differs")
    what.add_argument("--table", action="store_true", help="renew the table of docs/pictures.md")
    parser.add_argument("names", nargs="*", metavar="NAME", help="entries, as --list names them (default: all)")
    options = parser.parse_args(arguments)
    known = {entry.name: entry for entry in entries()}
    for name in options.names:
        if name not in known:
            parser.error(f"name: expected some of {', '.join(known)}; got {name!r}")
    options.entries = [known[name] for name in options.names or known]
    return options


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    options = parse(arguments)
    if options.list:
        print("\n".join(listed()))
        return 0
    if options.table:
        write_whole(PAGE, document().encode())
        return 0
    well = [draw(entry, options.check) for entry in options.entries]
    return 0 if all(well) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except (ClpeelError, OSError, ValueError) as error:
        say(f"draw_docs: {error}")
        sys.exit(1)
