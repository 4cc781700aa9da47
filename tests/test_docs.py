"""The documentation: what it quotes of the kernels is what they say, and the pictures it shows are there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from clpeel.command.parser import _options, make_parser
from clpeel.device.program import kernel_folder
from clpeel.techniques import TECHNIQUES

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))


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
    assert pictures or page.name == "drivers.md"
    for picture in pictures:
        assert (page.parent / picture).is_file(), picture


def examples(page: Path) -> list[tuple[str, str]]:
    """The Python examples of a page that are marked with the picture they draw: the picture, and the code."""
    marked = r"^<!-- test: docs/(\S+) -->\n```python\n(.*?)^```"
    return re.findall(marked, page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", ["materials.md", "lines.md", "edges.md", "scalars.md"])
def test_the_example_of_a_page_draws_its_picture(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    [(picture, code)] = examples(DOCS / page)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    with Image.open(DOCS / picture) as shown, Image.open(tmp_path / Path(picture).name) as drawn:
        off = np.abs(np.asarray(shown.convert("RGB"), int) - np.asarray(drawn.convert("RGB"), int))
    assert off.max() <= 1 and off.size > 3 * 400 * 400


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


def test_the_options_of_a_turntable_are_on_its_page() -> None:
    commands = make_parser().commands
    own, others = (
        {action.option_strings[0] for action in _options(commands[name])} for name in ("turntable", "render")
    )
    assert "--fps" in own
    for page in (ROOT / "README.md", DOCS / "turntable.md"):
        assert own - others <= set(re.findall(r"--[a-z][a-z-]*", page.read_text())), page


def test_what_editors_know_is_what_there_is() -> None:
    command = [sys.executable, ROOT / "tools" / "write_keywords.py", "--check"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
