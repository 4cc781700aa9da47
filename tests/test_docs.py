"""The documentation: what it quotes of the kernels is what they say, and the pictures it shows are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from clpeel.device.program import kernel_folder
from clpeel.techniques import TECHNIQUES

DOCS = Path(__file__).resolve().parent.parent / "docs"
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
    assert pictures
    for picture in pictures:
        assert (page.parent / picture).is_file(), picture


def test_every_technique_has_its_picture_section_and_row() -> None:
    text = (DOCS / "techniques.md").read_text()
    for name in TECHNIQUES:
        assert f"(techniques/{name}.png)" in text and f"| `{name}` |" in text
        assert f"\n## {name}\n" in text or name == "sort"
