"""Whatever a 3MF file holds and its picture lacks is a note by name, told once."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from clpeel.reading.load import load

pytest.importorskip("trimesh")


def package(path: Path, resources: str, build: str = '<item objectid="1"/>', **others: str) -> Path:
    """A 3MF package with these resources and further models."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", f"<model><resources>{resources}</resources><build>{build}</build></model>")
        for name, text in others.items():
            archive.writestr(f"3D/{name}.model", f"<model><resources>{text}</resources></model>")
    return path


SHAPE = (
    "<mesh><vertices>"
    + "".join(f'<vertex x="{x}" y="{y}" z="0"/>' for x, y in ((0, 0), (1, 0), (0, 1)))
    + "</vertices>"
    '<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
)


def test_colors_of_3mf_are_noted(tmp_path: Path) -> None:
    resources = f'<m:colorgroup id="5"/><basematerials id="6"/><object id="1">{SHAPE}</object>'
    assert load(package(tmp_path / "t.3mf", resources.replace("m:", ""))).notes == (
        "colours and properties of the 3MF file left out: base materials, colour groups",
    )


def test_3mf_components_that_are_put_together_wrongly_are_noted(tmp_path: Path) -> None:
    part, whole = f'<object id="1">{SHAPE}</object>', '<object id="2"><components>{}</components></object>'
    one = whole.format('<component path="/3D/a.model" objectid="1"/>')
    two = whole.format('<component path="/3D/a.model" objectid="1"/><component path="/3D/b.model" objectid="1"/>')
    item = '<item objectid="2"/>'
    assert load(package(tmp_path / "one.3mf", one, item, a=part)).notes == ()
    (note,) = [n for n in load(package(tmp_path / "two.3mf", two, item, a=part, b=part)).notes if "duplicate" not in n]
    assert "components" in note and "'3D/a.model', '3D/b.model'" in note


def test_the_colors_of_shared_3mf_models_are_noted(model: Callable[[str], Path]) -> None:
    assert load(model("3mf/counterXP.3MF")).notes == ("colours and properties of the 3MF file left out: colour groups",)
    assert "components in other files" in load(model("3mf/production_components.3mf")).notes[0]
