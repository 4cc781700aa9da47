"""The API reference is built without a warning, and has each public name, with a docstring."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import api_reference as tool
import pytest

import clpeel

pytest.importorskip("pdoc", reason="needs the package pdoc: pip install 'clpeel[docs]'")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reference, in a folder of its own."""
    folder = tmp_path_factory.mktemp("api")
    assert tool.build(folder) == []
    return folder


def test_each_public_name_and_member_is_there(built: Path) -> None:
    places = set(re.findall(r'\bid="([^"]+)"', (built / "clpeel.html").read_text(encoding="utf-8")))
    for name in clpeel.__all__:
        value = getattr(clpeel, name)
        assert name in places and (name == "__version__" or value.__doc__)
        if isinstance(value, type):
            members = {member for member in vars(value) if not member.startswith("_")}
            assert {f"{name}.{member}" for member in members} <= places


def test_docstrings_lead_to_one_another(built: Path) -> None:
    text = (built / "clpeel.html").read_text(encoding="utf-8")
    main = text[text.index("<main") :]
    for name in ("Scene", "Camera", "Result", "Renderer.render"):
        assert f'href="#{name}"' in main
    assert 'href="clpeel/scene/lights.html#PointLight"' in main
    assert 'href="clpeel/rendering/keywords.html#Keywords"' in main


def test_the_reference_is_rendered_as_text_not_as_code(built: Path) -> None:
    text = (built / "clpeel" / "rendering" / "keywords.html").read_text(encoding="utf-8")
    assert "Samples a pixel, averaged for smooth edges" in text and 'id="Keywords.samples"' in text


BARE = """
class Thing:
    own = 1
    def say(self): pass
    @property
    def size(self): return 1
    def _quiet(self): pass
    def told(self):
        "Say it."
def run(): pass
"""


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "undocumented.py").write_text(BARE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(tool, "MODULES", ("undocumented",))
    assert list(tool.undocumented()) == [
        f"undocumented.{name}: no docstring" for name in ("Thing", "Thing.say", "Thing.size", "run")
    ]


def test_dead_links_are_said(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="#here" id="here"></a><a href="#gone"></a><a href="b.html#x"></a>')
    (tmp_path / "b.html").write_text('<a href="https://example.com"></a><a href="a.html#here"></a>')
    assert list(tool.dead_links(tmp_path)) == [
        "a.html: a link to #gone, which is not there",
        "a.html: a link to b.html#x, which is not there",
    ]


def test_without_pdoc_one_line_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pdoc", None)
    assert tool.main(["-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.strip().endswith("pip install 'clpeel[docs]'")


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert tool.main(["-o", str(tmp_path / "file")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
