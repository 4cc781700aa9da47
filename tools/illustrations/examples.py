"""The examples of pages: what is marked with the picture that it draws, and how it is run.

A line `<!-- test: docs/lines.png -->` before a fenced block of Python or of commands says that the block writes
`lines.png` into the folder where it is run, and that the page shows this as docs/lines.png.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MARKED = re.compile(r"^<!-- test: docs/(\S+) -->\n```(python|sh)\n(.*?)^```", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Example:
    """A marked block of a page.

    picture: the file that the page shows, below docs. language: `python` or `sh`. code: what stands in the block.
    """

    picture: str
    language: str
    code: str

    @property
    def file(self) -> str:
        """The name that the block gives its picture."""
        return self.picture.rpartition("/")[2]

    def run(self, folder: Path) -> Path:
        """Run the block in a folder, and return the picture there.

        A block of commands has commands of clpeel alone, one a line. Raises what the code raises, CalledProcessError if
        a command fails, and FileNotFoundError if there is no picture after it.
        """
        with chdir(folder):
            if self.language == "python":
                exec(compile(self.code, f"<the example of docs/{self.picture}>", "exec"), {"__name__": "__main__"})
            else:
                for command in commands(self.code):
                    subprocess.run(with_this_python(command), check=True)
        drawn = folder / self.file
        if not drawn.is_file():
            raise FileNotFoundError(f"the example of docs/{self.picture} wrote no {self.file}")
        return drawn


def examples_of(page: Path) -> list[Example]:
    """Return the marked blocks of a page, from top to bottom."""
    return [Example(*found) for found in MARKED.findall(page.read_text(encoding="utf-8"))]


def commands(code: str) -> list[list[str]]:
    """Return the commands of a block, split into words. A line that ends with a backslash goes on.

    A line that begins with # is a remark. Elsewhere # is part of a word, as in a colour.
    """
    lines = code.replace("\\\n", " ").splitlines()
    return [words for line in lines if not line.lstrip().startswith("#") and (words := shlex.split(line))]


def with_this_python(command: list[str]) -> list[str]:
    """Return a command that begins with `python` or `clpeel` so that this Python runs it."""
    python = {"python": [sys.executable], "clpeel": [sys.executable, "-m", "clpeel"]}
    if command[0] not in python:
        raise ValueError(f"expected a command of python or clpeel, got {shlex.join(command)}")
    return [*python[command[0]], *command[1:]]
