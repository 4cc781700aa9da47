"""Pictures of the documentation cannot be stale: each has a command, and what is cheap is drawn again here."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import draw_docs as tool
import draw_examples
import pytest
from illustrations import registry, remake
from illustrations.examples import DOCS, ROOT, Example, commands, examples_of, with_this_python
from illustrations.registry import NEEDS, Entry, entries, pictures

PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
CHEAP = ("samples", "edges.md", "materials.md")
"""Entries that take a second or two, and need neither a font nor another library's colours."""


def shown() -> set[str]:
    """The pictures that pages show, in Markdown or HTML, as paths below docs. The table of pictures does not count."""
    found = set()
    for page in PAGES:
        if page.name != "pictures.md":
            named = re.findall(r'!\[[^\]]*\]\(([^)]+)\)|<img src="([^"]+)"', page.read_text(encoding="utf-8"))
            found |= {(page.parent / "".join(names)).resolve() for names in named}
    return {path.relative_to(DOCS).as_posix() for path in found}


def test_each_picture_has_one_command_and_is_shown() -> None:
    owners = {file: [entry.name for entry in entries() if entry.has(file)] for file in pictures()}
    assert {file: names for file, names in owners.items() if len(names) != 1} == {}
    assert shown() == set(pictures())
    assert len(owners) > 80


def test_entries_have_names_of_their_own_and_pictures() -> None:
    names = [entry.name for entry in entries()]
    assert len(names) == len(set(names))
    for entry in entries():
        for pattern in entry.pictures:
            assert any(Entry("", (pattern,), "").has(file) for file in pictures()), f"{entry.name}: {pattern}"
        assert set(entry.needs) <= set(NEEDS)


def test_commands_name_tools_that_are_there() -> None:
    for entry in entries():
        if entry.kind != "by hand":
            program, first, *_ = entry.command.split()
            assert program == "clpeel" or (ROOT / first).is_file(), entry.command


def test_the_table_of_pictures_is_that_of_the_registry() -> None:
    assert tool.document() == tool.PAGE.read_text(encoding="utf-8"), "run: python tools/draw_docs.py --table"


@pytest.mark.parametrize("name", CHEAP)
def test_what_is_drawn_again_has_the_same_pixels(name: str) -> None:
    [entry] = [entry for entry in entries() if entry.name == name]
    found = remake.remade(entry)
    assert sorted(found) == entry.files()
    assert {file: remake.difference(file, data) for file, data in found.items()} == dict.fromkeys(found, "")


def test_a_stale_picture_is_seen_and_renewed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from PIL import Image

    fresh = {"a.png": _png((10, 20, 30)), "b.png": _png((9, 9, 9))}
    for module in (remake, registry, tool):
        monkeypatch.setattr(module, "DOCS", tmp_path)
    (tmp_path / "a.png").write_bytes(_png((10, 20, 90)))
    (tmp_path / "b.png").write_bytes(before := _png((9, 9, 9), compress_level=0))
    monkeypatch.setattr(remake, "remade", lambda entry: fresh)
    entry = Entry("ab", ("*.png",), "python tools/nothing.py")
    assert remake.difference("a.png", fresh["a.png"]) == "4 pixels are off by up to 60 of 255"
    assert not tool.draw(entry, check=True)
    assert tool.draw(entry, check=False)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.getpixel((0, 0)) == (10, 20, 30)
    assert (tmp_path / "b.png").read_bytes() == before  # other bytes, but the same pixels
    assert tool.draw(entry, check=True)


def _png(color: tuple[int, int, int], **options: int) -> bytes:
    """A PNG of 2 x 2 pixels."""
    import io

    from PIL import Image

    file = io.BytesIO()
    Image.new("RGB", (2, 2), color).save(file, "PNG", **options)
    return file.getvalue()


def test_a_command_that_fails_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    entry = Entry("gone", ("samples/*.png",), "python tools/no_such_tool.py")
    assert not tool.draw(entry, check=False)
    *_, last = capsys.readouterr().err.splitlines()
    assert last.startswith("gone: failed: python tools/no_such_tool.py: ") and "No such file" in last


def test_a_picture_that_is_not_made_any_more_is_a_failure() -> None:
    entry = Entry("quiet", ("samples/*.png",), "python -c pass")
    with pytest.raises(remake.Failed, match=r"wrote no samples/lines.png, samples/patterns.png"):
        remake.remade(entry)


def test_what_is_measured_is_left_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.draw(Entry("times", ("x.png",), "python tools/bench.py", "measured"), check=False)
    assert "times: left out: made of times" in capsys.readouterr().err


def test_an_unknown_name_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        tool.main(["nothing"])
    assert caught.value.code == 2 and "got 'nothing'" in capsys.readouterr().err


def test_the_list_has_every_entry(capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.main(["--list"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(entries())


def test_blocks_of_commands_are_of_clpeel_alone() -> None:
    assert commands("clpeel demo \\\n  -o #a.png\n# a remark\n\nclpeel devices\n") == [
        ["clpeel", "demo", "-o", "#a.png"],
        ["clpeel", "devices"],
    ]
    with pytest.raises(ValueError, match="rm -r"):
        with_this_python(["rm", "-r", "/"])
    for page in PAGES:
        for example in examples_of(page):
            if example.language == "sh":
                assert {words[0] for words in commands(example.code)} == {"clpeel"}, example.picture


def test_an_example_without_a_picture_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="wrote no nothing.png"):
        Example("x/nothing.png", "python", "pass\n").run(tmp_path)


def test_no_room_for_a_copy_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise shutil.Error([("a.py", "b.py", "[Errno 28] No space left on device"), ("c.py", "d.py", "and so on")])

    monkeypatch.setattr(shutil, "copytree", full)
    with pytest.raises(remake.Failed, match=r"^cannot copy the tools: \[Errno 28\] No space left on device$"):
        remake.remade(Entry("", ("samples/*.png",), "python tools/sample_patterns.py"))


@pytest.mark.parametrize("page", ["no such page.md", "'quoted' \u00fc.md"])
def test_a_page_that_is_not_there_is_an_error(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        draw_examples.main([page])
    assert caught.value.code == 2 and "error: page: no file" in capsys.readouterr().err


def test_one_picture_of_a_page_is_drawn_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draw_examples, "DOCS", tmp_path)
    page = tmp_path / "page.md"
    block = (
        "<!-- test: docs/sub/{0}.png -->\n```python\nimport pathlib; pathlib.Path('{0}.png').write_text('{0}')\n```\n"
    )
    page.write_text(block.format("a") + "\n" + block.format("b"))
    assert draw_examples.main([str(page), "b.png"]) == 0
    assert (tmp_path / "sub" / "b.png").read_bytes() == b"b" and not (tmp_path / "sub" / "a.png").exists()
    with pytest.raises(SystemExit):
        draw_examples.main([str(page), "c.png"])
