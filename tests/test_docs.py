"""The documentation: what it quotes of the kernels is what they say, and the pictures it shows are there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from illustrations.examples import Example, examples_of
from PIL import Image

from clpeel.command.parser import _options, make_parser
from clpeel.device.program import kernel_folder
from clpeel.techniques import TECHNIQUES

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
WORDS_ALONE = ("drivers.md", "from_f3d.md", "pictures.md")
"""Pages that show no picture."""


def plain(code: str) -> str:
    """Without the spaces that a quotation may change."""
    return re.sub(r"\s+", " ", code).strip()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_is_quoted_is_there(page: Path) -> None:
    quotations = re.findall(r"^ *```c kernels/(\S+)\n(.*?)^ *```", page.read_text(), re.MULTILINE | re.DOTALL)
    for path, code in quotations:
        assert plain(code) in plain(kernel_folder().joinpath(*path.split("/")).read_text()), f"{path}: {code}"
    assert len(quotations) >= 9 or page.name != "techniques.md"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pictures_are_there(page: Path) -> None:
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text())
    assert pictures or page.name in WORDS_ALONE
    for picture in pictures:
        assert (page.parent / picture).is_file(), picture


EXAMPLES = [pytest.param(example, id=example.picture) for page in PAGES for example in examples_of(page)]
BLOCK = re.compile(r"(?:^<!-- (test|run): ([^>]*) -->\n)?^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
PLAIN = [
    pytest.param(code, id=f"{page.name}-{number}")
    for page in PAGES
    for number, (mark, _, code) in enumerate(BLOCK.findall(page.read_text(encoding="utf-8")), 1)
    if not mark
]
"""The examples that draw no picture of a page."""


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_example_of_a_page_draws_its_picture(example: Example, tmp_path: Path) -> None:
    with Image.open(DOCS / example.picture) as shown, Image.open(example.run(tmp_path)) as drawn:
        off = np.abs(np.asarray(shown.convert("RGB"), int) - np.asarray(drawn.convert("RGB"), int))
    assert off.max() <= 1 and off.size > 3 * 400 * 400


@pytest.mark.parametrize("code", PLAIN)
def test_the_example_of_a_page_runs(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in re.findall(r"^import (\w+)", code, re.MULTILINE):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    exec(code, {"__name__": "__main__"})


def test_pages_have_examples_and_reasons() -> None:
    """An example that no test runs is marked `<!-- run: no, REASON -->`."""
    assert len(EXAMPLES) >= 15 and len(PLAIN) >= 4
    for page in PAGES:
        for mark, words, _ in BLOCK.findall(page.read_text(encoding="utf-8")):
            assert mark != "run" or re.fullmatch(r"no, \w.+", words), f"{page.name}: {words}"


def test_every_technique_has_its_picture_section_and_row() -> None:
    text = (DOCS / "techniques.md").read_text()
    for name in TECHNIQUES:
        assert f"(techniques/{name}.png)" in text and f"| `{name}` |" in text
        assert f"\n## {name}\n" in text or name == "sort"


def test_the_table_of_options_has_every_flag() -> None:
    """README's table, and the command's help, which is made of the options' own fields."""
    text = (ROOT / "README.md").read_text()
    table = "\n".join(line for line in text.splitlines() if line.startswith("| `-"))
    flags = {action.option_strings[0] for action in _options(make_parser().commands["render"])}
    assert flags - set(re.findall(r"--[a-z][a-z-]*", table)) <= {"-h", "--help"}


def test_what_editors_know_is_what_there_is() -> None:
    command = [sys.executable, ROOT / "tools" / "write_keywords.py", "--check"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
