"""The house: which package may import which, read from the sources themselves (docs/house.md has the tour)."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "clpeel"
ROOT = ("errors", "checks", "color", "options", "files", "version")
"""Modules of the top level that everybody may import; they import one another alone."""

STAIRS: dict[str, tuple[str, ...]] = {
    "root": (),
    "scene": ("pictures.colormaps",),
    "pictures": ("scene.textures",),
    "reading": ("scene", "pictures.colormaps"),
    "device": (),
    "stages": ("scene", "pictures", "device"),
    "techniques": ("device.layout",),
    "rendering": ("scene", "pictures", "device", "stages", "techniques"),
    "study": ("scene", "pictures", "reading", "device", "stages", "techniques", "rendering"),
    "viewer": ("scene", "pictures", "reading", "techniques", "rendering", "study"),
    "film": ("scene", "pictures", "techniques", "rendering"),
    "command": (
        "scene",
        "pictures",
        "reading",
        "device",
        "stages",
        "techniques",
        "rendering",
        "study",
        "viewer",
        "film",
    ),
}
"""What each package may import besides the root and itself. Nothing here runs up.

A scene's colours may come from a colour map, which pictures show a scale of. Textures know sRGB, which files of light
are not in.
"""

INSIDE_FUNCTIONS = {
    "techniques": ("scene", "pictures"),
    "command": ("",),
    "pictures": ("",),
    "scene": ("viewer.notebook",),
}
"""What a package may import besides where it is needed, late; "" is clpeel itself, for its version or public names.

A notebook asks a scene how to show it, and the viewer knows.
"""

FOR_TYPES = {"techniques": ("stages",), "rendering": ("",), "study": ("",), "scene": ("",)}
"""What a package may import besides for types alone: a technique is handed a Frame."""

LATE = {"techniques": ("numpy", "pyopencl"), "root": ("numpy", "pyopencl"), "device.layout": ("numpy", "pyopencl")}
"""What must not be imported when these are: help and errors of the command come before NumPy and OpenCL."""


@dataclass(frozen=True)
class Import:
    """Who imports what, in which line, and how: at once, inside a function, or for types alone."""

    module: str
    target: str
    line: int
    how: str

    def __str__(self) -> str:
        return f"{self.module.replace('.', '/')}.py:{self.line} imports {self.target} ({self.how})"


def modules() -> Iterator[tuple[str, Path]]:
    """The name of each module below clpeel, and its file."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        yield ".".join(part for part in parts if part != "__init__"), path


def imports() -> list[Import]:
    """All imports of clpeel's sources."""
    found: list[Import] = []
    for module, path in modules():

        def visit(node: ast.AST, how: str, module: str = module) -> None:
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                how = "types"
            elif isinstance(node, ast.FunctionDef):
                how = "types" if how == "types" else "late"
            if isinstance(node, ast.Import):
                found.extend(Import(module, alias.name, node.lineno, how) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{module}: relative imports hide who imports whom"
                for alias in node.names:
                    whole = f"{node.module}.{alias.name}"
                    own = whole.removeprefix("clpeel.") in NAMES
                    found.append(Import(module, whole if own else str(node.module), node.lineno, how))
            for child in ast.iter_child_nodes(node):
                visit(child, how)

        visit(ast.parse(path.read_text(encoding="utf-8")), "at once")
    return found


NAMES = {name for name, _ in modules()}
IMPORTS = imports()
DOORS = ("", "__main__")
"""clpeel's own names, which lead everywhere, and `python -m clpeel`."""


def package_of(module: str) -> str:
    """The package of a module below clpeel; `root` for those that everybody may import."""
    return "root" if module in ROOT else module.partition(".")[0]


def allowed(each: Import) -> bool:
    """Whether the stairs let this module import that one."""
    target = each.target.removeprefix("clpeel").removeprefix(".")
    own, other = package_of(each.module), package_of(target)
    if own == other or other == "root":
        return True
    known = STAIRS[own]
    if each.how == "late":
        known += INSIDE_FUNCTIONS.get(own, ())
    if each.how == "types":
        known += INSIDE_FUNCTIONS.get(own, ()) + FOR_TYPES.get(own, ())
    return any(target == name or (name and target.startswith(f"{name}.")) for name in known)


def test_there_is_something_to_see() -> None:
    packages = {package_of(module) for module, _ in modules()} - set(DOORS)
    assert packages == set(STAIRS) and len(IMPORTS) > 300


def test_no_import_runs_up() -> None:
    wrong = [
        str(each)
        for each in IMPORTS
        if each.module not in DOORS and each.target.split(".")[0] == "clpeel" and not allowed(each)
    ]
    assert not wrong, "\n".join(wrong)


def test_opencl_stays_in_its_rooms() -> None:
    rooms = ("device", "stages")
    wrong = [
        str(each)
        for each in IMPORTS
        if each.target.split(".")[0] == "pyopencl" and package_of(each.module) not in rooms
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("who", LATE)
def test_nothing_heavy_before_it_is_needed(who: str) -> None:
    wrong = [
        str(each)
        for each in IMPORTS
        if who in (each.module, package_of(each.module))
        and each.how == "at once"
        and each.target.split(".")[0] in LATE[who]
    ]
    assert not wrong, "\n".join(wrong)


def test_there_are_no_circles() -> None:
    """Of modules that import one another when they are imported."""
    leads: dict[str, set[str]] = {}
    for each in IMPORTS:
        target = each.target.removeprefix("clpeel.")
        if each.how == "at once" and target in NAMES and each.module not in DOORS:
            leads.setdefault(each.module, set()).add(target)
    done: set[str] = set()

    def walk(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path[path.index(module) :], module))
        if module not in done:
            for target in sorted(leads.get(module, ())):
                walk(target, (*path, module))
            done.add(module)

    for module in sorted(leads):
        walk(module, ())


def test_what_is_wrong_would_be_seen() -> None:
    assert not allowed(Import("scene.camera", "clpeel.device.layout", 1, "at once"))
    assert not allowed(Import("techniques.sort", "clpeel.stages.frame", 1, "late"))
    assert allowed(Import("techniques.sort", "clpeel.stages.frame", 1, "types"))
    assert not allowed(Import("device.cache", "clpeel.scene.scene", 1, "late"))
    assert not allowed(Import("rendering.auto", "clpeel.command.main", 1, "late"))
    assert not allowed(Import("checks", "clpeel.scene.scene", 1, "late"))
