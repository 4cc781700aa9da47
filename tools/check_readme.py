"""Runs the commands and examples of README.md, so that what it says stays true.

    python tools/check_readme.py --install            the block marked "run: install", in the repository
    python tools/check_readme.py --test               the block marked "run: test", in the repository
    python tools/check_readme.py --examples --bin BIN  all other sh and python blocks, together in one empty folder,
                                                      with the folder BIN (of a virtual environment) first on PATH

A line `<!-- run: NAME -->` before a block marks it. A block marked `<!-- run: no -->` is skipped.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(
    r"(?:^<!-- run: (?P<mark>[\w-]+) -->\n)?^```(?P<language>sh|python)\n(?P<code>.*?)^```$", re.M | re.S
)


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, its code, its mark ("" for a plain example) and its line in the README."""

    language: str
    code: str
    mark: str
    line: int


def blocks(text: str) -> list[Block]:
    """Return the sh and python blocks of a Markdown text, in order."""
    return [
        Block(match["language"], match["code"], match["mark"] or "", text.count("\n", 0, match.start("code")))
        for match in BLOCK.finditer(text)
    ]


def run(block: Block, folder: Path, environment: dict[str, str]) -> bool:
    """Run a block in a folder, and print what it does and how long it takes. Returns whether it succeeded."""
    print(f"--- README.md line {block.line}, {block.language}\n{block.code}", end="", flush=True)
    command = ["bash", "-euo", "pipefail", "-c", block.code] if block.language == "sh" else ["python", "-c", block.code]
    started = time.monotonic()
    done = subprocess.run(command, cwd=folder, env=environment, check=False)
    print(f"--- exit code {done.returncode}, {time.monotonic() - started:.1f} s", flush=True)
    return done.returncode == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    for name in ("install", "test", "examples"):
        what.add_argument(f"--{name}", dest="what", action="store_const", const=name)
    parser.add_argument("--bin", type=Path, help="folder of the clpeel and python to run the examples with")
    options = parser.parse_args()

    found = blocks((ROOT / "README.md").read_text(encoding="utf-8"))
    environment = dict(os.environ)
    if options.bin:
        environment["PATH"] = f"{options.bin.resolve()}{os.pathsep}{environment['PATH']}"
    chosen = [block for block in found if block.mark == ("" if options.what == "examples" else options.what)]
    if not chosen:
        print(f"README.md: no block to run for --{options.what}", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory(prefix="clpeel-readme-") as empty:
        folder = Path(empty) if options.what == "examples" else ROOT
        failed = [block for block in chosen if not run(block, folder, environment)]
    for block in failed:
        print(f"README.md line {block.line}: failed", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
