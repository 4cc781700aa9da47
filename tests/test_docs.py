"""The documentation: what it quotes of the kernels is what they say, and the pictures it shows are there."""

from __future__ import annotations

import ast
import inspect
import json
import operator
import re
import subprocess
import sys
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest
from illustrations.examples import Example, commands, examples_of
from PIL import Image

import clpeel
from clpeel.command.parser import make_parser, parse
from clpeel.device.program import kernel_folder
from clpeel.rendering.keywords import Keywords
from clpeel.scene.scalars import Mapped
from clpeel.techniques import TECHNIQUES

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
WORDS_ALONE = ("drivers.md", "ecosystem.md", "from_f3d.md", "pictures.md")
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


def anchors(page: Path) -> set[str]:
    """What may stand behind # in a link to a page: its headings, as GitHub names them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [*ROOT.glob("*.md"), *PAGES], ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if not re.match(r"[a-z]+:", target):
            name, _, anchor = target.partition("#")
            other = (page.parent / name).resolve() if name else page
            assert other.exists(), f"{page.name}: {target}"
            assert not anchor or anchor in anchors(other), f"{page.name}: {target}"


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
    flags = {action.option_strings[0] for action in make_parser().commands["render"].options()}
    assert flags - set(re.findall(r"--[a-z][a-z-]*", table)) <= {"-h", "--help"}


def test_the_options_of_a_turntable_are_on_its_page() -> None:
    commands = make_parser().commands
    own, others = (
        {action.option_strings[0] for action in commands[name].options()} for name in ("turntable", "render")
    )
    assert "--fps" in own
    for page in (ROOT / "README.md", DOCS / "turntable.md"):
        assert own - others <= set(re.findall(r"--[a-z][a-z-]*", page.read_text())), page


def test_what_editors_know_is_what_there_is() -> None:
    command = [sys.executable, ROOT / "tools" / "write_keywords.py", "--check"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def fenced(page: Path) -> list[str]:
    """The blocks of commands of a page, but for those of f3d."""
    blocks = re.findall(r"(^<!-- f3d -->\n)?^```(?:sh|bash)\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    return [code for other, code in blocks if not other]


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.name)
def test_commands_of_pages_are_accepted(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands in blocks is parsed. In the text, `clpeel COMMAND --flag` needs flags that this command has.

    Scene files are in the page's own folder.
    """
    if (page.with_suffix("")).is_dir():
        monkeypatch.chdir(page.with_suffix(""))
    for command in (words for code in fenced(page) for words in commands(code)):
        if command[0] == "clpeel":
            words = takewhile(lambda word: not word.startswith(">"), command[1:])
            options = parse([word for word in words if word != "&&"])
            assert options.command
    known = make_parser().commands
    for text in re.findall(r"`(clpeel [^`]+)`", page.read_text(encoding="utf-8")):
        name, *words = text.split()[1:]
        flags = {word.partition("=")[0].rstrip(".,") for word in words if re.match(r"-{1,2}[a-z]", word)}
        if name in known:
            assert flags <= {flag for action in known[name].options() for flag in action.option_strings}, text


def f3d_rows() -> list[list[str]]:
    """The cells of the table of options in docs/from_f3d.md, row by row."""
    lines = (DOCS / "from_f3d.md").read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if re.match(r"\| `-", line)]


def test_options_beside_those_of_f3d_are_there() -> None:
    flags = {flag for action in make_parser().commands["render"].options() for flag in action.option_strings}
    rows = f3d_rows()
    assert len(rows) > 35 and {len(row) for row in rows} == {4}
    for theirs, _, ours, differs in rows:
        assert re.fullmatch(r"(`-{1,2}[a-z][a-z-]*(=\w+)?`(, )?)+", theirs), theirs
        named = re.findall(r"`(--[a-z][a-z-]*)", ours + ("" if "f3d's" in differs else differs))
        assert set(named) <= flags and (named or differs), theirs


def test_names_of_libf3d_are_those_of_f3d() -> None:
    """In a process of its own, as f3d brings libraries that do not go together with those of this one."""
    ask = """
import json
import f3d
found = f3d.Options()
names = ("effect.blending.mode", "effect.antialiasing.mode", "background.color", "grid.color")
wanted = [f"render.{name}" for name in names]
print(json.dumps([f3d.__version__, found.get_all_names(), [found[name] for name in wanted]]))
"""
    asked = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True)
    if asked.returncode:
        pytest.skip(asked.stderr.strip().splitlines()[-1])
    version, names, (blending, smoothing, background, grid) = json.loads(asked.stdout)
    if version != "4.0.0":
        pytest.skip(f"the table is of libf3d 4.0.0, and this is {version}")
    named = [name.strip("`") for _, name, *_ in f3d_rows() if name]
    assert len(named) > 20 and set(named) <= set(names)
    assert blending == smoothing == "none" and max(background) < 0.3 and max(grid) == 0


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.name)
def test_calls_in_the_text_have_names_and_keywords_that_are_there(page: Path) -> None:
    """Of `clpeel.render(scene, edges=True)` and the like, in tables and sentences."""
    for text in re.findall(r"`(clpeel\.[^`]+)`", page.read_text(encoding="utf-8")):
        try:
            tree = ast.parse(text.replace("…", "..."))
        except SyntaxError:
            continue  # a name of a module with a placeholder, or the like
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            name = ast.unparse(call.func).removeprefix("clpeel.")
            if re.fullmatch(r"[\w.]+", name) and name.split(".")[0] in clpeel.__all__:
                accepted = keywords_of(operator.attrgetter(name)(clpeel))
                assert {word.arg for word in call.keywords} <= accepted, text


def keywords_of(function: Callable[..., object]) -> set[str]:
    """The keywords that a function of clpeel takes. TypedDicts name those of its `**`."""
    more = {"options": Keywords, "mapped": Mapped}
    names = set(inspect.signature(function).parameters)
    if function is clpeel.show:  # it has the options of both
        return names | keywords_of(clpeel.load) | keywords_of(clpeel.render)
    return names | {keyword for name in names & more.keys() for keyword in more[name].__annotations__}
