"""Draws the pictures of a page's marked examples, by running these: python tools/draw_examples.py docs/gallery.md

An example is a block of Python or of commands below a line `<!-- test: docs/PICTURE -->` (illustrations/examples.py).
Names of pictures behind the page draw these alone. Exit codes: 0 done, 1 an example failed, 2 bad input, 130
interrupted.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from illustrations.examples import DOCS, examples_of

from clpeel.errors import ClpeelError
from clpeel.files import write_whole


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    parser = argparse.ArgumentParser(prog="draw_examples.py", description=__doc__)
    parser.add_argument("page", type=Path, metavar="PAGE.md")
    parser.add_argument("names", nargs="*", metavar="PICTURE", help="these alone, such as glass.png (default: all)")
    options = parser.parse_args(arguments)
    if not options.page.is_file():
        parser.error(f"page: no file {str(options.page)!r}")
    found = examples_of(options.page)
    for name in options.names:
        if name not in {example.file for example in found}:
            parser.error(f"picture: expected one of {', '.join(example.file for example in found)}; got {name!r}")
    for example in found:
        if options.names and example.file not in options.names:
            continue
        with tempfile.TemporaryDirectory(prefix="clpeel-example-") as folder:
            data = example.run(Path(folder)).read_bytes()
        target = DOCS / example.picture
        target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, data)
        print(f"docs/{example.picture}", file=sys.stderr, flush=True)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (ClpeelError, subprocess.CalledProcessError, OSError) as error:
        print(f"draw_examples: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
